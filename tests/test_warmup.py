"""Kinds of scene compiled ahead."""

import os
import subprocess
import sys

import pytest
from command_line import fowt

from fowt_env import InputError
from fowt_env import warmup as module
from fowt_env.warmup import KINDS, USUAL, warmup


@pytest.fixture
def kinds(monkeypatch):
    """The kinds that were run, in place of running them."""
    run = []
    fakes = {
        name: (text, lambda platform, name=name: run.append((platform, name)))
        for name, (text, _) in KINDS.items()
    }
    monkeypatch.setattr(module, "KINDS", fakes)
    return run


def test_kinds_are_run_once_each_in_order_and_told(kinds):
    told = []
    table = warmup("mine.toml", ["vector", "standard", "vector"], progress=lambda *words: told.append(words))
    assert kinds == [("mine.toml", "vector"), ("mine.toml", "standard")]
    assert table.kind.tolist() == ["vector", "standard"] and table.kernels.tolist() == [0, 0]
    assert told == [("vector", 1, 0), ("standard", 2, 0)]


@pytest.mark.parametrize(
    "words, message",
    [
        ({"kinds": ["standard", "sport"]}, "kind.*sport"),
        ({"kinds": []}, "at least one"),
        ({"jobs": 0}, "jobs = 0"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(kinds, words, message):
    with pytest.raises(InputError, match=message):
        warmup(**words)
    assert kinds == []


@pytest.mark.parametrize("words", [("--kinds", "standard,sport"), ("--jobs", "0"), ("--platform", "raft")])
def test_a_refused_command_does_not_say_that_it_compiles(words):
    assert "compiling" not in fowt("warmup", *words, code=2)[1]


def test_the_command_says_once_what_it_compiles_and_then_each_kind(kinds):
    lines = fowt("warmup", "--kinds", "fast,linear,fast")[1].splitlines()
    assert lines == ["compiling 2 kinds of scene: fast, linear", "1 of 2: fast", "2 of 2: linear"]


def test_others_are_compiled_in_processes_of_their_own(kinds, monkeypatch):
    monkeypatch.setattr(
        module, "CHILD", "import json, sys; print('noise'); print(json.dumps([sys.argv[3], 7, 1.5]))"
    )
    table = warmup(kinds=["fast", "linear", "vector"], jobs=2)
    assert kinds == [("oc3_hywind", "fast")]
    assert table.set_index("kind").kernels.to_dict() == {"fast": 0, "linear": 7, "vector": 7}


def test_a_process_that_fails_is_named(kinds, monkeypatch):
    monkeypatch.setattr(module, "CHILD", "import sys; sys.exit('no such platform')")
    with pytest.raises(InputError, match="kind linear: no such platform"):
        warmup(kinds=["fast", "linear"], jobs=2)


@pytest.mark.nightly
def test_after_it_the_same_kinds_compile_nothing(tmp_path):
    """Among them the run that README begins with."""
    environment = os.environ | {"FOWT_CACHE_DIR": str(tmp_path)}
    subprocess.run(
        [sys.executable, "-c", f"from fowt_env.warmup import warmup; warmup(kinds={list(USUAL)}, jobs=2)"],
        env=environment, check=True, capture_output=True,
    )  # fmt: skip
    code = (
        "import fowt_env, gymnasium\n"
        "from fowt_env.plant.compile.notice import compilation_reported\n"
        "said = []\n"
        "with compilation_reported(said.append):\n"
        "    sea = {'kind': 'jonswap', 'Hs': 7.5, 'Tp': 10.0, 'gamma': 3.3}\n"
        "    wind = {'kind': 'ntm', 'speed': 18.0, 'class': 'B'}\n"
        "    scene = fowt_env.build_scene('oc3_hywind', wind=wind, sea=sea, fidelity='standard')\n"
        "    fowt_env.simulate(scene, 'pi', duration=1.0)\n"
        "    env = gymnasium.make('fowt_env:fowt_env/OC3Hywind-v2', task='above_rated')\n"
        "    env.reset(seed=1)\n"
        "    env.step(env.action_space.sample())\n"
        "print(said)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
