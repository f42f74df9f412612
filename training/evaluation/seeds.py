"""Defines disjoint ranges of weather seeds for training, validation and test.

A realisation of wind and waves is fixed by its weather seed (build_scene's seed).

Seeds listed in a suite are for development: a controller can recognise their weather, which is reproducible.
A published comparison needs seeds drawn from a hash that was unknown while the controllers were tuned
(with_drawn_seeds), or secret ones (new_secret_seeds).
"""

import hashlib
import re
import secrets
from dataclasses import replace

from fowt_env.envs.tasks import LARGEST_SEED
from fowt_env.errors import InputError

TEST = range(0, 1000)  # published scores, with the suites' seeds 1, 2, ...
VALIDATION = range(1000, 100_000)  # choices between agents, and between gains of the baselines
TRAINING = range(100_000, LARGEST_SEED)  # episodes of the training of agents

DRAWN = range(2**62, 2**63)  # seeds drawn from a hash and secret seeds: too many to try all
LEAST_SECRET = 2**40  # smaller seeds can be found by trying all
DRAWING_RULE = "2**62 + (first 8 bytes of SHA-256 of 'HASH/SUITE/VERSION/i', big-endian) // 4, i = 0, 1, ..."
HASH = re.compile("[0-9a-f]{40,128}")

PURPOSES = {"test": TEST, "validation": VALIDATION, "training": TRAINING}


def seeds_for(purpose, first, count):
    """Return count seeds of a purpose, starting at index first. Raises: InputError outside its range."""
    allowed = PURPOSES[purpose]
    if first < 0 or count < 1 or first + count > len(allowed):
        raise InputError(
            f"{purpose} seeds {first} to {first + count - 1}: must be at least one of 0 to {len(allowed) - 1}"
        )
    return tuple(allowed[first : first + count])


def drawn_seeds(source, suite, version, count):
    """Return count seeds of DRAWN by DRAWING_RULE, which are reproducible from the hash.

    source: 40 to 128 hexadecimal digits that were unknown while controllers were tuned, such as the commit
    that fixes them and the suite. suite, version: name and version of the suite.
    Raises: InputError for any other source.
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
    """Return the Suite with drawn_seeds instead of its listed seeds, as many for each case.

    The new Suite's `drawn` is {"hash", "rule"}, for the manifest of a results folder.
    Raises: InputError for a source that is not a hash.
    """
    most = max(len(seeds) for seeds in (suite.seeds, *(case.seeds or () for case in suite.cases)))
    drawn = drawn_seeds(source, suite.name, suite.version, most)
    about = {"hash": str(source).lower(), "rule": DRAWING_RULE}
    return replace(reseeded(suite, drawn), seeds=drawn[: len(suite.seeds)], drawn=about)


def reseeded(suite, seeds):
    """Return the Suite with other seeds; the number of seeds of each case is unchanged."""
    cases = (replace(case, seeds=case.seeds and seeds[: len(case.seeds)]) for case in suite.cases)
    return replace(suite, seeds=seeds, cases=tuple(cases))


def new_secret_seeds(count):
    """Return count different seeds of DRAWN from the system's source of randomness."""
    return tuple(secrets.SystemRandom().sample(DRAWN, count))


def ranges(seeds):
    """Return [(first, last)] of the contiguous ranges of sorted seeds."""
    limits = []
    for seed in seeds:
        if limits and seed == limits[-1][1] + 1:
            limits[-1] = limits[-1][0], seed
        else:
            limits.append((seed, seed))
    return limits
