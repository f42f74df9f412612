"""The three blades as agents: PettingZoo's checker, what each sees, and whose action moves which blade."""

import importlib
import sys

import gymnasium
import numpy as np
import pytest

pytest.importorskip("pettingzoo")

from pettingzoo.test import parallel_api_test  # noqa: E402

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.rl.pettingzoo_env import AGENTS, NAME, FowtBladesEnv, turn  # noqa: E402

QUICK = {"fidelity": "standard", "duration": 4.0}
NAMES = ["rotor_speed", "sin_azimuth", "cos_azimuth", "root_1", "root_2", "root_3"]
NAMES += [f"previous_action_{i}" for i in range(4)]


def test_an_observation_is_turned_to_the_place_of_each_blade():
    azimuth = 0.3
    seen = np.array([1.2, np.sin(azimuth), np.cos(azimuth), 10.0, 20.0, 30.0, 0.5, 0.1, 0.2, 0.3])
    assert np.array_equal(turn(NAMES, 0) @ seen, seen)
    angle = azimuth + 2.0 * np.pi / 3.0
    second = [1.2, np.sin(angle), np.cos(angle), 20.0, 30.0, 10.0, 0.5, 0.2, 0.3, 0.1]
    np.testing.assert_allclose(turn(NAMES, 1) @ seen, second, rtol=1e-14)
    np.testing.assert_allclose(turn(NAMES, 1) @ second, turn(NAMES, 2) @ seen, rtol=1e-14)


class Checked(FowtBladesEnv):
    """Drops the option that the checker invents."""

    def reset(self, seed=None, options=None):
        return super().reset(seed, None if options == {"options": 1} else options)


@pytest.mark.slow
def test_pettingzoo_s_checker_accepts_it():
    parallel_api_test(Checked(**QUICK), num_cycles=30)


@pytest.mark.slow
def test_agents_together_are_the_environment_and_each_moves_its_own_blade():
    env, single = FowtBladesEnv(**QUICK), gymnasium.make(NAME, **QUICK)
    first, infos = env.reset(seed=3)
    observation, info = single.reset(seed=3)
    assert np.array_equal(first[AGENTS[0]], observation) and infos[AGENTS[1]] == info
    names = [entry.name for entry in single.unwrapped.observed]
    for _ in range(5):
        actions = dict(zip(AGENTS, ([0.0], [1.0], [0.0]), strict=True))
        seen, rewards, terminated, truncated, _ = env.step(actions)
        observation, reward, *_ = single.step((0.0, 0.0, 1.0, 0.0))
        assert rewards == dict.fromkeys(AGENTS, reward) and 0.0 < reward < 1.0
        np.testing.assert_allclose(seen[AGENTS[0]], observation, rtol=1e-6)
    pitches = [seen[agent][names.index("blade_pitch_1")] for agent in AGENTS]
    assert pitches[1] > max(pitches[0], pitches[2]) + 0.1  # 0.6 deg
    assert all(seen[agent] in env.observation_space(agent) for agent in AGENTS)
    for _ in range(15):
        *_, terminated, truncated, _ = env.step(dict.fromkeys(AGENTS, np.zeros(1)))
    assert truncated == dict.fromkeys(AGENTS, True) and not any(terminated.values()) and env.agents == []


@pytest.mark.nightly  # the elastic turbine takes minutes to compile
def test_random_actions_survive_and_lower_no_blade_s_load_for_free():
    """A reward for equal root moments: less with additions at random than without."""
    env = gymnasium.make_vec(NAME, num_envs=4, threads=1, duration=30.0, autoreset_mode="Disabled")
    rng, earned = np.random.default_rng(0), []
    for size in (0.0, 1.0):
        env.reset(seed=0)
        total = 0.0
        for _ in range(150):
            _, _, terminated, _, infos = env.step(size * rng.uniform(-1.0, 1.0, (4, 4)))
            assert not terminated.any()
            total += infos["reward/blade_root"].mean() / 150
        earned.append(total)
    assert 0.3 < earned[0] < 0.9 and earned[1] < earned[0]


@pytest.mark.slow
def test_other_modes_and_missing_blades_are_refused(monkeypatch):
    with pytest.raises(InputError, match="action_mode = 'residual': must be 'individual_residual'"):
        FowtBladesEnv("fowt_env/OC3HywindEasy-v0")
    env = FowtBladesEnv(**QUICK)
    env.reset(seed=0)
    with pytest.raises(InputError, match="actions of blade_1: must be of blade_1, blade_2, blade_3"):
        env.step({"blade_1": [0.0]})
    assert "fowt_env.training.rl.pettingzoo_env" in sys.modules
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    monkeypatch.delitem(sys.modules, "fowt_env.training.rl.pettingzoo_env")
    with pytest.raises(ImportError, match=r"pip install 'fowt-env\[pettingzoo\]'"):
        importlib.import_module("fowt_env.training.rl.pettingzoo_env")
