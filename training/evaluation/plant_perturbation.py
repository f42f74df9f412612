"""Defines perturbed plants: factors on parameters of the input files, and noise on the controller's readings.

A controller is made for the nominal turbine and prepared with the nominal scene, so that model-based designs
(lqr, rosco, preview) have a model mismatch, as at sea. Metrics are computed from the true motions: noise
affects only the controller's readings.
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

# name: (description, default distribution). Factors multiply the file's value.
PLANT = {
    "ballast_mass": (
        "factor on the ballast's mass; changes the draught",
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
            raise InputError(f"randomise.{name}: drew {value:g}, but factors must be positive")
        return value

    def times(by, value):  # None stays None
        if isinstance(value, tuple):
            return tuple(times(by, each) for each in value)
        return None if value is None else by * value

    def scaled(part, **factors):
        if part is None or set(factors.values()) == {1.0}:
            return part
        values = {name: times(by, getattr(part, name)) for name, by in factors.items()}
        if dataclasses.is_dataclass(part):
            return dataclasses.replace(part, **values)
        return part.model_copy(update=values)

    mass, drag, upper = factor("added_mass"), factor("drag"), factor("upper_mass")
    ballast, stiffness, air = factor("ballast_mass"), factor("mooring_stiffness"), factor("air_density")
    masses = ("added_mass", "added_mass_infinite", "added_mass_zero")
    member = {"added_mass_coefficient": mass, "axial_added_mass_coefficient": mass}
    member |= {"drag_coefficient": drag, "axial_drag_coefficient": drag}
    hydro = {"added_mass_coefficient": mass, "heave_added_mass": mass}
    hydro |= {"drag_coefficient": drag, "linear_damping": drag}
    tower = scaled(base.tower, mass=upper, inertia=upper)
    tower = tower.model_copy(update={"modes": scaled(tower.modes, mass_density=upper, top_mass=upper)})
    base = base.model_copy(
        update={
            "environment": scaled(base.environment, air_density=air),
            "ballast": scaled(base.ballast, mass=ballast, inertia=ballast),
            "hydro": scaled(base.hydro, **hydro),
            "potential_flow": scaled(base.potential_flow, **dict.fromkeys(masses, mass)),
            "additional": scaled(base.additional, linear_damping=drag, quadratic_damping=drag),
            "members": tuple(scaled(each, **member) for each in base.members),
            "tower": tower,
            "lines": tuple(scaled(line, wet_weight=stiffness, EA=stiffness) for line in base.lines),
        }
    )
    turbine = turbine.model_copy(
        update={
            "nacelle": scaled(turbine.nacelle, mass=upper, inertia=upper),
            "pitch_drive": turbine.pitch_drive.slowed(factor("actuator_lag")),
        }
    )
    return {"platform": base, "turbine": turbine}


class PlantPerturbation(Record):
    """Defines the perturbation of a case's plant: factors on the nominal parameters, with the names of PLANT.

    noise: standard deviation of white noise on each reading, as a
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
        """Return {name of PLANT: factor} of the factors other than 1."""
        return {name: getattr(self, name) for name in PLANT if getattr(self, name) != 1.0}


@cached(64)
def perturbed_parts(perturbation, platform="oc3_hywind"):
    """Return {"platform", "turbine"} of a perturbed platform (a name or file), for build_scene."""
    return plant_settings(perturbation.factors, platform)


def perturbed_sensors(perturbation, turbine, control_dt):
    """Return the SensorChain with a PlantPerturbation's noise and delay on every reading, or None."""
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
