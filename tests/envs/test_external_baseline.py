"""Controllers that are not compiled as baselines of the residual mode: a Python class, a library."""

import copy

import numpy as np
import pytest
from bladed_library import built, needs_gcc

from fowt_env.control import make
from fowt_env.envs.env import FowtEnv
from fowt_env.envs.vector_env import FowtVectorEnv
from fowt_env.errors import InputError


class PythonPI:
    """The built-in law, called from Python."""

    information = ("generator_speed", "blade_pitch", "generator_torque")

    def __init__(self, turbine, control_dt):
        self.law = make("pi", turbine, control_dt)

    def reset(self, measurement):
        self.law.reset(measurement)

    def act(self, measurement):
        return self.law.act(measurement)


def residual(baseline, **settings):
    return FowtEnv(platform="oc3_hywind", action_mode="residual", baseline=baseline, **settings)


def trajectory(env, steps=40, seed=3):
    env.reset(seed=seed)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, 2))
    return np.array([np.append(*env.step(action)[:2]) for action in actions])


def test_a_law_has_the_same_episode_from_python_as_compiled():
    compiled, python = (trajectory(residual(baseline)) for baseline in ("pi", PythonPI))
    assert np.allclose(python, compiled, rtol=1e-12, atol=1e-12)
    env = residual(PythonPI)
    assert np.array_equal(trajectory(env), python)  # a second controller of the same environment
    assert np.array_equal(trajectory(env), python)  # and its second episode


def test_its_state_cannot_be_saved_and_a_batch_refuses_it():
    env = residual(PythonPI)
    env.reset(seed=1)
    for use in (env.get_state, lambda: copy.deepcopy(env)):
        with pytest.raises(InputError, match="is not compiled, so its state cannot be saved"):
            use()
    with pytest.raises(InputError, match="SyncVectorEnv"):
        FowtVectorEnv(2, platform="oc3_hywind", action_mode="residual", baseline=PythonPI)


@needs_gcc
def test_a_library_is_a_baseline_and_ends_with_the_environment(tmp_path):
    env = residual(f"dll:{built(tmp_path)}")
    first = trajectory(env)
    assert np.array_equal(trajectory(env), first) and np.ptp(first[:, 0]) > 0.0
    env.close()
    assert env._baseline.controller.console_output == "41 calls, last at 3.9 s"
