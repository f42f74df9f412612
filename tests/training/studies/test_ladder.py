"""What controllers earn on the ladder of tasks: the same episodes as an agent's."""

import gymnasium
import numpy as np
import pytest

from fowt_env.registration import LADDER, SOLVED, STEPS
from fowt_env.training.studies.acceptance import WINDS, returns
from fowt_env.training.studies.ladder import earned

FAULTS, UNKNOWN = "fowt_env/OC3HywindFaults-v0", "fowt_env/OC3HywindUnknown-v0"


@pytest.mark.nightly
@pytest.mark.parametrize("name", [FAULTS, pytest.param(UNKNOWN, marks=pytest.mark.nightly)])
def test_the_baseline_earns_what_zero_action_earns(name):
    """With the same sensors, faults and plants in each episode: the table compares like with like."""
    zero = returns(name, lambda seen: np.zeros((len(seen), 2))).mean()
    assert earned(name, "pi") == pytest.approx(zero, abs=1e-9)
    assert zero < SOLVED[name] < zero + 0.1


def test_every_rung_says_when_it_is_solved():
    assert set(SOLVED) == set(LADDER)
    for name in LADDER:
        assert gymnasium.spec(name).reward_threshold == pytest.approx(SOLVED[name] * STEPS)
        assert LADDER[name]["task"] in WINDS
