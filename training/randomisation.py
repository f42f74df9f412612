"""Domain randomisation: plants and sensors drawn from named distributions.

Building a plant and its operating points takes seconds, so a batch draws a pool of plants once, by seed, and
its environments share them in turn: environment i has plant i modulo the pool's size. Wind, sea and start are
drawn anew in every episode as ever; sensor noise is drawn at every reading, the delay once per environment.
"""

from math import isfinite

import numpy as np

from fowt_env.description import read_platform, read_turbine
from fowt_env.errors import InputError, unknown

# name: (what is drawn, default distribution). Factors multiply the file's value.
PLANT = {
    "ballast_mass": (
        "factor on the ballast's mass; the plant floats deeper or higher",
        ("uniform", 0.99, 1.01),
    ),
    "upper_mass": ("factor on the masses and inertias of tower and nacelle", ("uniform", 0.95, 1.05)),
    "added_mass": ("factor on the transverse and heave added mass", ("uniform", 0.8, 1.2)),
    "drag": ("factor on the transverse drag coefficient and linear damping", ("uniform", 0.7, 1.3)),
    "mooring_stiffness": ("factor on the lines' wet weight and EA", ("uniform", 0.8, 1.2)),
    "actuator_lag": ("factor on the time constant of the blade-pitch drive", ("loguniform", 0.5, 2.0)),
    "air_density": ("factor on the density of air", ("normal", 1.0, 0.02)),
}
SENSORS = {
    "noise": "noise of each channel's readings, standard deviation as a share of its observation scale",
    "delay": "whole control periods from measurement to reading",
}
DEFAULT_SENSORS = {"noise": ("uniform", 0.0, 0.02), "delay": ("uniform", 0.0, 3.0)}
KINDS = {
    "uniform": lambda rng, low, high: rng.uniform(low, high),
    "loguniform": lambda rng, low, high: float(np.exp(rng.uniform(np.log(low), np.log(high)))),
    # within two standard deviations: a tail must not make a plant that cannot float
    "normal": lambda rng, mean, std: mean + std * float(np.clip(rng.normal(), -2.0, 2.0)),
}


def check_distribution(where, spec):
    """(kind, a, b) of a distribution. Raises: InputError naming what is wrong with it."""
    if not isinstance(spec, list | tuple) or len(spec) != 3:
        raise InputError(f"{where} = {spec!r}: must be [kind, a, b], kind one of {', '.join(KINDS)}")
    kind, a, b = spec
    if kind not in KINDS:
        raise unknown(f"distribution of {where}", kind, KINDS)
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) and isfinite(x) for x in (a, b))
    ordered = numbers and (b >= 0.0 if kind == "normal" else b >= a)
    if not ordered or (kind == "loguniform" and a <= 0.0):
        raise InputError(f"{where} = {spec!r}: must have low <= high (positive for loguniform) or std >= 0")
    return kind, float(a), float(b)


def distributions(spec):
    """{name: (kind, a, b)} of all that is randomised, the given ones in place of the defaults.

    spec: {name: [kind, a, b] or None (not randomised)}; "plants" is left out. Raises: InputError.
    """
    chosen = {name: default for name, (_, default) in PLANT.items()} | DEFAULT_SENSORS
    for name, given in spec.items():
        if name == "plants":
            continue
        if name not in chosen:
            raise unknown("randomised quantity", name, chosen)
        if given is None:
            del chosen[name]
        else:
            chosen[name] = given
    return {name: check_distribution(f"randomise.{name}", given) for name, given in chosen.items()}


def draw(chosen, rng):
    """{name: value} of one draw of distributions, in a fixed order."""
    order = [name for name in (*PLANT, *SENSORS) if name in chosen]
    return {name: float(KINDS[chosen[name][0]](rng, *chosen[name][1:])) for name in order}


def plant_settings(factors, platform="oc3_hywind"):
    """{"platform", "turbine"} settings of FowtEnv for a plant with {name of PLANT: factor}."""
    base = read_platform(platform)
    turbine = read_turbine(base.turbine)

    def factor(name):
        value = factors.get(name, 1.0)
        if not value > 0.0:
            raise InputError(f"randomise.{name}: drew {value:g}: factors must be positive")
        return value

    def scaled(part, by, *names):
        values = {name: getattr(part, name) for name in names}
        return part.model_copy(
            update={
                n: tuple(by * x for x in v) if isinstance(v, tuple) else by * v for n, v in values.items()
            }
        )

    hydro = scaled(base.hydro, factor("added_mass"), "added_mass_coefficient", "heave_added_mass")
    upper, tau = factor("upper_mass"), factor("actuator_lag")
    base = base.model_copy(
        update={
            "environment": scaled(base.environment, factor("air_density"), "air_density"),
            "ballast": scaled(base.ballast, factor("ballast_mass"), "mass", "inertia"),
            "hydro": scaled(hydro, factor("drag"), "drag_coefficient", "linear_damping"),
            "tower": scaled(base.tower, upper, "mass", "inertia"),
            "lines": tuple(
                scaled(line, factor("mooring_stiffness"), "wet_weight", "EA") for line in base.lines
            ),
        }
    )
    turbine = turbine.model_copy(
        update={
            "nacelle": scaled(turbine.nacelle, upper, "mass", "inertia"),
            "pitch_drive": scaled(turbine.pitch_drive, tau, "time_constant"),
        }
    )
    return {"platform": base, "turbine": turbine}


def randomised(spec, n, seed):
    """(per_env settings of n environments, their Sensors) drawn with a seed.

    spec: {"plants": size of the pool, name: distribution or None, ...}. Raises: InputError.
    """
    size = spec.get("plants", 8)
    if type(size) is not int or not 1 <= size <= 1000:
        raise InputError(f"randomise.plants = {size!r}: must be a whole number from 1 to 1000")
    chosen = distributions(spec)
    rng = np.random.default_rng([seed, 1])
    pool = [draw(chosen, rng) for _ in range(min(size, n))]
    settings = [plant_settings({k: v for k, v in plant.items() if k in PLANT}) for plant in pool]
    per_env = [settings[i % len(settings)] for i in range(n)]
    sensors = Sensors(
        noise=np.array([pool[i % len(pool)].get("noise", 0.0) for i in range(n)]),
        delay=np.array([round(pool[i % len(pool)].get("delay", 0.0)) for i in range(n)]),
        seed=seed,
    )
    return per_env, sensors


class Sensors:
    """Readings of n environments: late by whole control periods, with white noise; scaled observations.

    noise (n,): standard deviations; delay (n,): control periods. sensed (channels,) bool: which channels are
    sensors' (an agent knows its own last action exactly); all, until set. Raises: InputError below 0.
    """

    def __init__(self, noise, delay, seed):
        self.noise = np.asarray(noise, dtype=np.float64)
        self.delay = np.asarray(delay, dtype=np.int64)
        if np.any(self.noise < 0.0) or np.any(self.delay < 0):
            raise InputError("randomise: noise and delay must not be negative")
        self.rng = np.random.default_rng([seed, 2])
        self.sensed = True
        self.past = None  # (delay + 1, n, channels), newest first

    def restart(self, rows, observations):
        """Forget the past of some rows."""
        if self.past is None:
            self.past = np.zeros((int(self.delay.max()) + 1, *np.shape(observations)), dtype=np.float32)
        self.past[:, rows] = observations

    def take(self, observations):
        """Take the observations (n, channels) of one control period."""
        self.past[1:] = self.past[:-1].copy()
        self.past[0] = observations

    def read(self):
        """(n, channels) float32: what the sensors show now."""
        late = self.past[self.delay, np.arange(len(self.delay))]
        noisy = late + self.noise[:, None] * self.rng.normal(size=late.shape)
        return np.where(self.sensed, noisy, self.past[0]).astype(np.float32)

    def get_state(self):
        """All that decides the coming readings."""
        return self.past.copy(), self.rng.bit_generator.state

    def set_state(self, state):
        """Go on from what get_state returned."""
        past, generator = state
        self.past = past.copy()
        self.rng.bit_generator.state = generator
