"""Which weather seeds are for what: training, validation and test never share one, by construction.

A realisation of wind and waves is fixed by its weather seed (build_scene's seed). Each purpose has a
range of its own, and the ranges do not touch.
"""

from fowt_env.envs.tasks import LARGEST_SEED
from fowt_env.errors import InputError

TEST = range(0, 1000)  # scores that are published: the suites' seeds 1, 2, ... are in it
VALIDATION = range(1000, 100_000)  # choices between agents, and between gains of the baselines
TRAINING = range(100_000, LARGEST_SEED)  # episodes that agents learn from

PURPOSES = {"test": TEST, "validation": VALIDATION, "training": TRAINING}


def seeds_for(purpose, first, count):
    """Tuple of count seeds of a purpose, from its number first on. Raises: InputError beyond its range."""
    allowed = PURPOSES[purpose]
    if first < 0 or count < 1 or first + count > len(allowed):
        raise InputError(
            f"{purpose} seeds {first} to {first + count - 1}: must be at least one of 0 to {len(allowed) - 1}"
        )
    return tuple(allowed[first : first + count])


def ranges(seeds):
    """[(first, last)] of the unbroken ranges of seeds in rising order."""
    found = []
    for seed in seeds:
        if found and seed == found[-1][1] + 1:
            found[-1] = found[-1][0], seed
        else:
            found.append((seed, seed))
    return found
