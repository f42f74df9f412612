"""Which weather seeds are for what: training, validation and test never share one, by construction.

A realisation of wind and waves is fixed by its weather seed (build_scene's seed). Each purpose has a
range of its own, and the ranges do not touch.

Seeds that a suite lists are for development: whoever has this package can rebuild their weather, and a
controller can recognise it. A table that others are to trust has seeds drawn from a hash which nobody knew
while the controllers were tuned (with_drawn_seeds), or secret ones (new_secret_seeds).
"""

import hashlib
import re
import secrets
from dataclasses import replace

from fowt_env.envs.tasks import LARGEST_SEED
from fowt_env.errors import InputError

TEST = range(0, 1000)  # scores that are published: the suites' seeds 1, 2, ... are in it
VALIDATION = range(1000, 100_000)  # choices between agents, and between gains of the baselines
TRAINING = range(100_000, LARGEST_SEED)  # episodes that agents learn from

DRAWN = range(2**62, 2**63)  # too many to try: those drawn from a hash, and an organiser's secret ones
LEAST_SECRET = 2**40  # smaller ones are found by trying
DRAWING_RULE = "2**62 + (first 8 bytes of SHA-256 of 'HASH/SUITE/VERSION/i', big-endian) // 4, i = 0, 1, ..."
HASH = re.compile("[0-9a-f]{40,128}")

PURPOSES = {"test": TEST, "validation": VALIDATION, "training": TRAINING}


def seeds_for(purpose, first, count):
    """Tuple of count seeds of a purpose, from its number first on. Raises: InputError beyond its range."""
    allowed = PURPOSES[purpose]
    if first < 0 or count < 1 or first + count > len(allowed):
        raise InputError(
            f"{purpose} seeds {first} to {first + count - 1}: must be at least one of 0 to {len(allowed) - 1}"
        )
    return tuple(allowed[first : first + count])


def drawn_seeds(source, suite, version, count):
    """Tuple of count seeds of DRAWN by DRAWING_RULE: anybody who has the hash finds the same.

    source: 40 to 128 hexadecimal digits that nobody could choose or know while controllers were tuned, as the
    commit in which these and the suite are fixed. suite, version: name and version of the suite.
    Raises: InputError for another source.
    """
    text = str(source).lower()
    if not HASH.fullmatch(text):
        raise InputError(
            f"hash {str(source)[:140]!r}: must be 40 to 128 hexadecimal digits, as the full id of a commit"
            " (git rev-parse HEAD)"
        )
    digests = (hashlib.sha256(f"{text}/{suite}/{version}/{i}".encode()).digest() for i in range(count))
    return tuple(DRAWN.start + int.from_bytes(digest[:8], "big") // 4 for digest in digests)


def with_drawn_seeds(suite, source):
    """The Suite with seeds of drawn_seeds in place of those that it lists, as many for each of its cases.

    Its `drawn` says from which hash and how, and goes into the manifest of a results folder.
    Raises: InputError for a source that is no hash.
    """
    most = max(len(seeds) for seeds in (suite.seeds, *(case.seeds or () for case in suite.cases)))
    drawn = drawn_seeds(source, suite.name, suite.version, most)
    cases = (
        case if case.seeds is None else replace(case, seeds=drawn[: len(case.seeds)]) for case in suite.cases
    )
    about = {"hash": str(source).lower(), "rule": DRAWING_RULE}
    return replace(suite, seeds=drawn[: len(suite.seeds)], cases=tuple(cases), drawn=about)


def new_secret_seeds(count):
    """Tuple of count different seeds of DRAWN from the system's source of randomness."""
    found = set()
    while len(found) < count:
        found.add(DRAWN.start + secrets.randbelow(len(DRAWN)))
    return tuple(found)


def ranges(seeds):
    """[(first, last)] of the unbroken ranges of seeds in rising order."""
    found = []
    for seed in seeds:
        if found and seed == found[-1][1] + 1:
            found[-1] = found[-1][0], seed
        else:
            found.append((seed, seed))
    return found
