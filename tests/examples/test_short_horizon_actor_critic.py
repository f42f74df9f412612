"""Short-horizon actor-critic: its gradient of a window against differences of the window's outcome."""

import runpy
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

EXAMPLE = Path(__file__).parents[2] / "examples" / "20_short_horizon_actor_critic.py"


def test_the_gradient_of_a_window_is_that_of_differences_of_its_outcome():
    """Steps of 0.025 s: with those of 0.1 s what the time step keeps of a command costs up to 1 %."""
    script = runpy.run_path(str(EXAMPLE))
    drive, outcome = script["drive"], script["outcome"]
    torch.manual_seed(3)
    actor, critic = script["Actor"](), script["network"](1)
    for values in actor.network.parameters():
        torch.nn.init.normal_(values, std=0.05)
    settings = {"wind": script["WIND"], "sea": script["SEA"], "duration": 60.0, "action_mode": "direct"}
    env = script["FowtEnv"](**settings, observation=("rotor_speed",), dt=0.025)
    followed = script["PeriodJacobians"](env)
    followed.reset(seed=5)
    start = env.get_state()
    states, commands, jacobians, _ = drive(followed, actor, 32)
    derivative, _ = script["backward"](actor, critic, states, commands, jacobians)
    weights = list(actor.network.parameters())
    found = torch.autograd.grad((actor(states[:-1]) * derivative).sum(), weights)
    length = torch.nn.utils.parameters_to_vector(found).norm()
    totals = []
    for step in (1e-5, -2e-5):  # to either side
        with torch.no_grad():
            for values, change in zip(weights, found, strict=True):
                values += step / length * change
        env.set_state(start)
        totals.append(outcome(critic, *drive(env, actor, 32)[:2])[0].item())
    assert (totals[0] - totals[1]) / 2e-5 == pytest.approx(length.item(), rel=1e-3)
