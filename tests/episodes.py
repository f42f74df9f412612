"""Environments of few kinds, so that each is compiled once, and what their steps return, for tests."""

import numpy as np
import pytest

from fowt_env.envs import FowtEnv, Task
from fowt_env.registration import LADDER
from fowt_env.training.validation.openfast_cases import box_wind

NAME = "fowt_env/OC3Hywind-v1"
QUICK = {"rotor": "table", "wave_components": 20}
NTM = {"kind": "ntm", "speed": 18.0, "class": "B"}
ESTIMATES = ("estimated_wind", "estimated_platform", "estimated_waves")
ON_LQR = {
    "wind": NTM, "action_mode": "residual", "baseline": "lqr",
    "observation": ("rotor_speed", "blade_pitch", *ESTIMATES, "wind_speed"),
}  # fmt: skip
DEGRADED = {"noise": 0.02, "delay": 2}  # sensors
BOX = {  # of full-field wind
    "wind": box_wind(), "sea": {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}, "rotor": None,
    "fidelity": "standard", "duration": 60.0,
}  # fmt: skip
INDIVIDUAL = {"pitch": "individual", "action_mode": "individual", "rotor": None, "wind": 18.0}

WATCHED = {  # with all that lies between the plant and an agent
    "task": Task("ahead", wind=NTM, wind_preview=(1.5, 4.0), observation=("rotor_speed", "wind_preview")),
    "preview": "four_beam_pulsed", "protection": "turbine", "sensors": "standard", "record": True,
    "faults": [{"kind": "pitch_runaway", "towards": "fine", "time": (0.3, 1.5)}],
}  # fmt: skip


def ladder():
    """Names of the ladder as parameters; each compiles a kind of scene, the first for each push."""
    first, *others = LADDER
    return [first, *(pytest.param(name, marks=pytest.mark.nightly) for name in others)]


def quick(**settings):
    """An environment of QUICK with other settings."""
    return FowtEnv(**(QUICK | settings))


def actions(steps, *shape, seed=0, reach=1.0):
    """(steps, *shape, 2) random actions within +-reach."""
    return np.random.default_rng(seed).uniform(-reach, reach, (steps, *shape, 2))


def record(env, given):
    """Bits of everything that the steps under the given actions return."""
    parts = []
    for action in given:
        observation, *rest = env.step(action)
        parts.append((observation.tobytes(), str(rest)))
    return parts


def same(one, other):
    """Whether two infos are equal in keys, types, values and masks."""
    if isinstance(one, dict):
        alike = isinstance(other, dict) and one.keys() == other.keys()
        return alike and all(same(one[k], other[k]) for k in one)
    if isinstance(one, np.ndarray) and one.ndim:
        alike = one.dtype == other.dtype and one.shape == other.shape
        return alike and all(same(a, b) for a, b in zip(one, other, strict=True))
    return type(one) is type(other) and bool(one == other)
