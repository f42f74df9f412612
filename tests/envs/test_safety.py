"""The safety layer: it takes over where it must, hands back, and is not there otherwise."""

import numpy as np
import pytest

from fowt_env.envs import FowtEnv, SafetyLayer
from fowt_env.errors import InputError

QUICK = {"rotor": "table", "wave_components": 10, "wind": 18.0, "duration": 60.0, "fidelity": "standard"}


def careless(env, periods=600):
    """(termination or None, highest rotor speed over rated) under no torque and flat blades."""
    env.reset(seed=1)
    rated = env.unwrapped.scene.turbine.rated_rotor_speed
    highest = 0.0
    for _ in range(periods):
        _, _, terminated, truncated, info = env.step(np.array([-1.0, -1.0]))
        highest = max(highest, env.unwrapped.measurement().rotor_speed / rated)
        if terminated or truncated:
            break
    return info.get("termination"), highest, info


def test_an_agent_that_would_overspeed_is_kept_from_it():
    reason, _, _ = careless(FowtEnv(action_mode="direct", **QUICK))
    assert "overspeed" in reason
    reason, highest, info = careless(SafetyLayer(FowtEnv(action_mode="direct", **QUICK)))
    assert reason is None and 1.1 < highest < 1.25
    assert info["guarded_periods"] > 100


def test_within_the_limits_every_bit_is_the_agents():
    plain, guarded = (FowtEnv(action_mode="residual", **QUICK) for _ in range(2))
    guarded = SafetyLayer(guarded)
    plain.reset(seed=2), guarded.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(200):
        action = rng.uniform(-0.2, 0.2, 2)
        one, other = plain.step(action), guarded.step(action)
        assert np.array_equal(one[0], other[0]) and one[1:4] == other[1:4]
        assert not other[4]["guarded"]


def test_a_steep_platform_rate_hands_over_and_calm_hands_back():
    env = SafetyLayer(FowtEnv(action_mode="residual", **QUICK), platform_rate=1.0, calm=2.0)
    env.reset(seed=3, options={"offsets": {"PtfmPitch": 7.0}})
    guarded = [env.step(np.zeros(2))[4]["guarded"] for _ in range(590)]
    assert not guarded[0] and any(guarded) and not guarded[-1]


@pytest.mark.parametrize(
    "changes",
    [{"overspeed": 1.0}, {"platform_rate": 0.0}, {"calm": -1.0}, {"release": 0.0}, {"baseline": "x"}],
)
def test_limits_that_cannot_be_used_are_named(changes):
    name = next(iter(changes))
    with pytest.raises(InputError, match=f"{name} = " if name != "baseline" else "unknown baseline"):
        SafetyLayer(FowtEnv(**QUICK), **changes)
