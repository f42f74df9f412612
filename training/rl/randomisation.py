"""Domain randomisation: plants and sensors drawn from named distributions.

Building a plant and its operating points takes seconds, so a batch draws a pool of plants once, by seed, and
its environments share them in turn: environment i has plant i modulo the pool's size. Wind, sea and start are
drawn anew in every episode as ever; how much noise its sensors have, and how late they are, is drawn with the
plant. Controllers in the environments (the baseline, the estimator) are designed on the plant of the files.
"""

import numpy as np

from fowt_env.descriptions.checks import check_whole_number, is_number
from fowt_env.envs.sensors import check_sensors
from fowt_env.errors import InputError, unknown
from fowt_env.training.evaluation.plant_perturbation import PLANT, PLATFORM, plant_settings

SENSORS = {  # words, distribution by default
    "noise": (
        "white noise of every reading, standard deviation over the channel's observation scale",
        ("uniform", 0.0, 0.02),
    ),
    "delay": ("whole control periods from measurement to reading", ("uniform", 0.0, 3.0)),
}
DISTRIBUTIONS = {
    "uniform": lambda rng, low, high: rng.uniform(low, high),
    "loguniform": lambda rng, low, high: float(np.exp(rng.uniform(np.log(low), np.log(high)))),
    # within two standard deviations: a tail must not make a plant that cannot float
    "normal": lambda rng, mean, std: mean + std * float(np.clip(rng.normal(), -2.0, 2.0)),
}


def check_distribution(where, spec):
    """Return (kind, a, b) of a distribution. Raises: InputError naming what is wrong with it."""
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
    """Return {name: (kind, a, b)} of all randomised quantities: defaults, and the changes of spec.

    spec: {name: [kind, a, b] or None (not randomised)}; "plants" is left out. Raises: InputError.
    """
    chosen = {name: default for name, (_, default) in (PLANT | SENSORS).items()}
    for name in spec:
        if name not in chosen and name != "plants":
            raise unknown("randomised quantity", name, chosen)
    chosen = {name: spec.get(name, default) for name, default in chosen.items()}
    kept = {name: given for name, given in chosen.items() if given is not None}
    return {name: check_distribution(f"randomise.{name}", given) for name, given in kept.items()}


def draw(chosen, rng):
    """Return {name: value} of one draw of distributions, in a fixed order."""
    order = [name for name in (*PLANT, *SENSORS) if name in chosen]
    return {name: float(DISTRIBUTIONS[chosen[name][0]](rng, *chosen[name][1:])) for name in order}


def randomised(spec, n, seed):
    """Return n dicts of FowtEnv settings drawn with a seed: plant, sensors, and the nominal plant.

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
