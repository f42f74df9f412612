"""Implements domain randomisation: plants and sensors drawn from named distributions.

Building a plant and its operating points takes seconds, so a pool of plants is drawn once, by seed, and
environment i uses plant i modulo the size of the pool. Sensor noise and delay are drawn with the plant; wind,
sea and initial state are drawn in every episode, as without randomisation. Controllers in the environments
(the baseline, the estimator) are designed on the nominal plant.
"""

import numpy as np

from fowt_env.descriptions.checks import check_whole_number, is_number
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.envs.sensors import check_sensors
from fowt_env.errors import InputError, unknown
from fowt_env.training.evaluation.plant_perturbation import PLANT, PLATFORM, plant_settings

SENSORS = {  # description, default distribution
    "noise": (
        "white noise of every reading: standard deviation over the channel's observation scale",
        ("uniform", 0.0, 0.02),
    ),
    "delay": ("whole control periods from measurement to reading", ("uniform", 0.0, 3.0)),
}
DISTRIBUTIONS = {
    "uniform": lambda rng, low, high: rng.uniform(low, high),
    "loguniform": lambda rng, low, high: float(np.exp(rng.uniform(np.log(low), np.log(high)))),
    # truncated at two standard deviations: an outlier could give a plant that does not float
    "normal": lambda rng, mean, std: mean + std * float(np.clip(rng.normal(), -2.0, 2.0)),
}


def check_distribution(where, spec):
    """Return (kind, a, b) of a distribution. Raises: InputError for invalid kind or parameters."""
    if not isinstance(spec, list | tuple) or len(spec) != 3:
        raise InputError(f"{where} = {spec!r}: must be [kind, a, b], kind one of {', '.join(DISTRIBUTIONS)}")
    kind, a, b = spec
    if kind not in DISTRIBUTIONS:
        raise unknown(f"distribution of {where}", kind, DISTRIBUTIONS)
    ordered = is_number(a) and is_number(b) and (b >= 0.0 if kind == "normal" else b >= a)
    if not ordered or (kind == "loguniform" and a <= 0.0):
        raise InputError(f"{where} = {spec!r}: must have low <= high (positive for loguniform) or std >= 0")
    return kind, float(a), float(b)


def distributions(spec):
    """Return {name: (kind, a, b)} of all randomised quantities: defaults updated by spec.

    spec: {name: [kind, a, b] or None (not randomised)}; "plants" is ignored. Raises: InputError.
    """
    chosen = {name: default for name, (_, default) in (PLANT | SENSORS).items()}
    for name in spec:
        if name not in chosen and name != "plants":
            raise unknown("randomised quantity", name, chosen)
    chosen = {name: spec.get(name, default) for name, default in chosen.items()}
    kept = {name: entry for name, entry in chosen.items() if entry is not None}
    return {name: check_distribution(f"randomise.{name}", entry) for name, entry in kept.items()}


def draw(chosen, rng):
    """Return {name: value} of one draw from the distributions, in a fixed order."""
    order = [name for name in (*PLANT, *SENSORS) if name in chosen]
    return {name: float(DISTRIBUTIONS[chosen[name][0]](rng, *chosen[name][1:])) for name in order}


def randomised(spec, n, seed):
    """Return n dicts of FowtEnv settings drawn with a seed: plant, sensors and nominal plant.

    spec: {"plants": size of the pool, name: distribution or None, ...}. Raises: InputError.
    """
    size = spec.get("plants", 8)
    check_whole_number("randomise.plants", size, 1, 1000)
    chosen = distributions(spec)
    rng = np.random.default_rng([seed, 1])
    pool = [draw(chosen, rng) for _ in range(min(size, n))]
    settings = []
    for drawn in pool:
        sensors = {"noise": drawn.get("noise", 0.0), "delay": round(drawn.get("delay", 0.0))}
        plant = plant_settings({name: value for name, value in drawn.items() if name in PLANT})
        settings.append(plant | {"sensors": check_sensors(sensors), "nominal_plant": {"platform": PLATFORM}})
    return [settings[i % len(settings)] for i in range(n)]


PLANTS = 8  # of an environment of unknown plants


def unknown_plant(plant=0, **settings):
    """Return a FowtEnv with the settings and the plant of a seed; its controllers know the nominal plant."""
    return FowtEnv(**settings, **drawn_plants(1, plant)[0])


def unknown_plants(num_envs=1, plant=0, **settings):
    """Return a FowtVectorEnv of num_envs environments, with PLANTS different plants of a seed at most."""
    return FowtVectorEnv(num_envs, per_env=drawn_plants(num_envs, plant), **settings)


def drawn_plants(n, seed):
    """Return n dicts of FowtEnv settings with PLANTS different drawn plants at most, without sensors."""
    drawn = randomised({"plants": min(PLANTS, n), "noise": None, "delay": None}, n, seed)
    return [{name: value for name, value in each.items() if name != "sensors"} for each in drawn]
