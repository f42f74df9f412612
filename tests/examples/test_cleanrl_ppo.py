"""PPO in one file: its advantages, its episodes, and that it learns the easiest task."""

import runpy
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

EXAMPLE = Path(__file__).parents[2] / "examples" / "18_cleanrl_ppo.py"
BAND = (0.69, 0.73)  # of the reward of a decision; 0.710 after 30,720, where zero action earns 0.674


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(EXAMPLE))


def test_advantages_are_discounted_sums_of_errors_up_to_the_end_of_an_episode(script):
    torch.manual_seed(0)
    rewards, values, last = torch.rand(6, 2), torch.rand(6, 2), torch.rand(2)
    dones = torch.zeros(6, 2)
    dones[3, 0] = 1.0  # step 3 of the first environment begins a new episode
    found = script["advantages"](rewards, values, dones, last, torch.tensor([0.0, 1.0]), 0.9, 0.8)
    for env, ends in ((0, (3, 6)), (1, (6,))):
        following = [*values[1:, env].tolist(), last[env].item()]
        begins = [*dones[1:, env].tolist(), float(env == 1)]
        errors = [
            rewards[t, env].item() + 0.9 * following[t] * (1.0 - begins[t]) - values[t, env].item()
            for t in range(6)
        ]
        for t in range(6):
            end = next(end for end in ends if end > t)
            expected = sum(errors[k] * (0.9 * 0.8) ** (k - t) for k in range(t, end))
            assert found[t, env].item() == pytest.approx(expected, abs=1e-6)


@pytest.mark.nightly
def test_a_rollout_ends_episodes_and_gives_a_policy_of_bounded_actions(script):
    seen = []
    args = script["arguments"](["--total-timesteps", "2440", "--num-envs", "4", "--num-steps", "610"])
    policy, returns = script["train"](args, lambda done, policy: seen.append(done))
    assert seen == [0, 2440] and len(returns) == 4
    assert all(0.0 < value < 600.0 for value in returns)  # of whole episodes, before scaling
    actions = policy(np.random.default_rng(0).normal(0.0, 100.0, (50, 18)))
    assert actions.shape == (50, 2) and np.abs(actions).max() <= 1.0 and np.ptp(actions) > 0.0


@pytest.mark.nightly
def test_it_learns_the_easiest_task(script):
    from fowt_env.training.studies.acceptance import EASY, returns

    policy, _ = script["train"](script["arguments"](["--seed", "0", "--total-timesteps", "30000"]))
    assert BAND[0] < returns(EASY, policy).mean() < BAND[1]
