"""Perturbed plants: factors on the files' values and noise on readings, unknown to the controller.

A controller is made for the nominal turbine and prepared with the nominal scene, so that model-based designs
(lqr, rosco, preview) are based on a wrong model, as they would be at sea. Metrics are of the true motions:
noise is only on the controller's readings.
"""

import dataclasses
from typing import Annotated

from pydantic import Field

from fowt_env.caches import cached
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.records import NonNegative, Positive, Record
from fowt_env.descriptions.sensors import Sensor, SensorChain
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs.sensors import reading_scales
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement

# name: (what is drawn, default distribution). Factors multiply the file's value.
PLANT = {
    "ballast_mass": (
        "factor on the ballast's mass; the plant floats deeper or higher",
        ("uniform", 0.99, 1.01),
    ),
    "upper_mass": ("factor on the masses and inertias of tower and nacelle", ("uniform", 0.95, 1.05)),
    "added_mass": ("factor on the added mass of the hull", ("uniform", 0.8, 1.2)),
    "drag": (
        "factor on the drag coefficients, linear and quadratic damping of the hull",
        ("uniform", 0.7, 1.3),
    ),
    "mooring_stiffness": ("factor on the lines' wet weight and EA", ("uniform", 0.8, 1.2)),
    "actuator_lag": ("factor on the time constant of the blade-pitch drive", ("loguniform", 0.5, 2.0)),
    "air_density": ("factor on the density of air", ("normal", 1.0, 0.02)),
}
PLATFORM = "oc3_hywind"  # default nominal platform


def plant_settings(factors, platform=PLATFORM):
    """Return {"platform", "turbine"} settings of FowtEnv for a plant with {name of PLANT: factor}."""
    base = read_platform(platform)
    turbine = read_turbine(base.turbine)

    def factor(name):
        value = factors.get(name, 1.0)
        if not value > 0.0:
            raise InputError(f"randomise.{name}: drew {value:g}: factors must be positive")
        return value

    def scaled(part, by, *names):
        values = {name: getattr(part, name) for name in names}
        return part.model_copy(update={name: times(by, value) for name, value in values.items()})

    def times(by, value):  # None: none
        if isinstance(value, tuple):
            return tuple(times(by, each) for each in value)
        return None if value is None else by * value

    hydro, potential, additional = base.hydro, base.potential_flow, base.additional
    mass, drag = factor("added_mass"), factor("drag")
    if hydro is not None:
        hydro = scaled(hydro, mass, "added_mass_coefficient", "heave_added_mass")
        hydro = scaled(hydro, drag, "drag_coefficient", "linear_damping")
    if potential is not None and mass != 1.0:
        names = ("added_mass", "added_mass_infinite", "added_mass_zero")
        scaled_mass = {name: times(mass, getattr(potential, name)) for name in names}
        potential = dataclasses.replace(potential, **scaled_mass)
    if additional is not None and drag != 1.0:
        additional = scaled(additional, drag, "linear_damping", "quadratic_damping")
    upper, tau = factor("upper_mass"), factor("actuator_lag")
    tower = scaled(base.tower, upper, "mass", "inertia")
    if tower.modes is not None and upper != 1.0:
        tower = tower.model_copy(update={"modes": scaled(tower.modes, upper, "mass_density", "top_mass")})
    base = base.model_copy(
        update={
            "environment": scaled(base.environment, factor("air_density"), "air_density"),
            "ballast": scaled(base.ballast, factor("ballast_mass"), "mass", "inertia"),
            "hydro": hydro,
            "potential_flow": potential,
            "additional": additional,
            "members": tuple(
                scaled(
                    scaled(member, mass, "added_mass_coefficient", "axial_added_mass_coefficient"),
                    drag,
                    "drag_coefficient",
                    "axial_drag_coefficient",
                )
                for member in base.members
            ),
            "tower": tower,
            "lines": tuple(
                scaled(line, factor("mooring_stiffness"), "wet_weight", "EA") for line in base.lines
            ),
        }
    )
    turbine = turbine.model_copy(
        update={
            "nacelle": scaled(turbine.nacelle, upper, "mass", "inertia"),
            "pitch_drive": turbine.pitch_drive.slowed(tau),
        }
    )
    return {"platform": base, "turbine": turbine}


class PlantPerturbation(Record):
    """Difference of a case's plant from the nominal one; names as in PLANT.

    Factors on the values of the files. noise: standard deviation of white noise on each reading, as a
    fraction of the channel's scale in observations (rotor speed: 20 % of rated; blade pitch: 15 deg; platform
    pitch: 5 deg, its rate: 1 deg/s; nacelle acceleration: 1 m/s2). delay: control periods from measurement to
    reading.
    """

    ballast_mass: Positive = 1.0
    upper_mass: Positive = 1.0
    added_mass: Positive = 1.0
    drag: Positive = 1.0
    mooring_stiffness: Positive = 1.0
    actuator_lag: Positive = 1.0
    air_density: Positive = 1.0
    noise: NonNegative = 0.0
    delay: Annotated[int, Field(ge=0, le=1000, strict=True)] = 0

    @property
    def factors(self):
        """{name of PLANT: factor} of the factors other than 1."""
        return {name: getattr(self, name) for name in PLANT if getattr(self, name) != 1.0}


@cached(64)
def perturbed_parts(perturbation, platform="oc3_hywind"):
    """Return {"platform", "turbine"} of a perturbed platform (a name or file), for build_scene."""
    return plant_settings(perturbation.factors, platform)


def perturbed_sensors(perturbation, turbine, control_dt):
    """Return the SensorChain of a PlantPerturbation's noise and delay on every reading; None without both."""
    if perturbation.noise == 0.0 and perturbation.delay == 0:
        return None
    scales = dict(zip(Measurement._fields, reading_scales(turbine).tolist(), strict=True))
    delay = perturbation.delay * control_dt
    sensors = {
        name: Sensor(noise=perturbation.noise * scale, delay=delay)
        for name, scale in scales.items()
        if name != "time"
    }
    return SensorChain("shifted", sensors, "equal relative noise and delay on every reading")
