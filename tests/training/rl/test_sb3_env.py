"""What stable-baselines3 may ask of the adapter beside steps; what it says where the library is missing."""

import importlib
import sys

import pytest

pytest.importorskip("stable_baselines3")

from fowt_env.training.rl import sb3_env

QUICK = {"rotor": "table", "wave_components": 20, "duration": 4.0}


def test_attributes_are_set_and_read_in_the_chosen_environments():
    env = sb3_env.FowtSB3VecEnv(3, threads=1, **QUICK)
    env.set_attr("colour", "red")
    env.set_attr("colour", "blue", indices=[0, 2])
    assert env.get_attr("colour") == ["blue", "red", "blue"]
    assert env.get_attr("colour", indices=1) == ["red"]
    assert env.env_method("__repr__", indices=[1]) == [repr(env.env.envs[1])]


def test_without_the_library_it_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "fowt_env.training.rl.sb3_env")
    with pytest.raises(ImportError, match=r"pip install 'fowt-env\[train\]'"):
        importlib.import_module("fowt_env.training.rl.sb3_env")
