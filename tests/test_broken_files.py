"""Files that are broken, or made by strangers: refused by name, without crash or hang, their code not run."""

import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import mutation
import numpy as np
import pytest
from typer.testing import CliRunner

from controllers.policy import AGENTS
from controllers.policy_file import read_policy
from fowt_env import cli
from fowt_env.errors import InputError
from fowt_env.textfiles import parse_json, read_toml

FILES = int(os.environ.get("FOWT_MUTATIONS", "10000"))


def judged(folder, count, seed):
    """Counts of a study of broken files in which nothing failed and every kind was both met and refused."""
    pytest.importorskip("openfast_io", reason="openfast_io is not installed")
    pytest.importorskip("plotly", reason="plotly is not installed")
    found = mutation.study(folder, count, seed)
    assert found["failures"] == []
    assert sum(found["counts"].values()) == count and found["slowest"] < mutation.SECONDS
    refused = {kind for kind, told in found["counts"] if told == "refused"}
    assert {kind for kind, _ in found["counts"]} == refused
    return found["counts"]


def test_hundreds_of_broken_files_load_or_are_refused(tmp_path):
    assert len(judged(tmp_path, 500, seed=7)) > 30


@pytest.mark.slow
def test_ten_thousand_broken_files_load_or_are_refused(tmp_path):
    judged(tmp_path, FILES, seed=3)


@pytest.mark.parametrize("key", ["a." * 5000 + "b", '"a" . ' * 40 + "b"])
def test_a_key_of_thousands_of_parts_is_refused_at_once(tmp_path, key):
    path = tmp_path / "deep.toml"
    path.write_text(f"x = 1\n{key} = 2\n")
    with pytest.raises(InputError, match="deep.toml.*line 2: a key of more than 32 parts"):
        read_toml(path, "platform")
    path.write_text(f"rows = [{'1.5, ' * 500}]\n" + ".".join("abc") + " = 2\n")
    assert read_toml(path, "platform")["a"] == {"b": {"c": 2}}


@pytest.mark.parametrize("text", ["[" * 100_000, "NaN", "[1e400]", "{", '{"a": -Infinity}', "[1] 2"])
def test_json_that_is_none_or_holds_no_numbers_is_a_value_error(text):
    with pytest.raises(ValueError):
        parse_json(text)


class Bomb:
    """Leaves a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


@pytest.fixture
def mark(tmp_path):
    return tmp_path / "code_was_run"


def test_a_pickled_array_in_a_policy_is_not_loaded(tmp_path, mark):
    path = tmp_path / "bomb.npz"
    bomb = np.array([Bomb(mark)], dtype=object)
    with np.load(AGENTS / "ppo_lqr.npz") as file:
        np.savez(path, **{name: file[name] for name in file.files if name != "mean"}, mean=bomb)
    with pytest.raises(InputError, match="bomb.npz.*holds pickled objects, which are not loaded"):
        read_policy(path)
    assert not mark.exists()
    pickle.loads(pickle.dumps(Bomb(mark)))
    assert mark.exists()  # it would have


def test_a_pickle_that_calls_itself_a_policy_is_not_loaded(tmp_path, mark):
    path = tmp_path / "bomb.npz"
    path.write_bytes(pickle.dumps(Bomb(mark)))
    with pytest.raises(InputError, match="cannot be read"):
        read_policy(path)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("settings.npy", pickle.dumps(Bomb(mark)))
    with pytest.raises(InputError, match="cannot be read"):
        read_policy(path)
    assert not mark.exists()


def test_a_policy_that_unpacks_to_more_than_its_share_is_refused(tmp_path):
    path = tmp_path / "large.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("settings.npy", bytes(200_000_000))
    assert path.stat().st_size < 1_000_000
    with pytest.raises(InputError, match="holds 200000000 bytes; allowed: at most 100000000"):
        read_policy(path)


def test_an_array_that_claims_more_than_it_has_takes_no_memory(tmp_path):
    path = tmp_path / "claims.npz"
    head = b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little")
    said = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("mean.npy", head + said.ljust(117) + b"\n" + bytes(80))
    with pytest.raises(InputError, match="mean.npy.*is not its size"):
        read_policy(path)


def invoke(*words):
    return CliRunner().invoke(cli.app, words, env={"COLUMNS": "1000", "NO_COLOR": "1"})


def test_a_stable_baselines3_zip_is_refused_where_a_policy_is_meant(tmp_path, mark):
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("data", pickle.dumps(Bomb(mark)))
    result = invoke("simulate", "--controller", f"policy:{path}", "--duration", "1")
    assert result.exit_code == cli.EXIT_INPUT and "runs code of its author" in result.stderr
    assert not mark.exists()


def checkpoint_of_a_stranger(folder, mark):
    """A training run's folder whose every file would run code."""
    from training.train import resolve

    place = folder / "checkpoints" / "step_64"
    place.mkdir(parents=True)
    for name in ("state.pkl", "normalisation.pkl", "replay_buffer.pkl", "model.zip"):
        (place / name).write_bytes(pickle.dumps(Bomb(mark)))
    import yaml

    (folder / "settings.yml").write_text(yaml.safe_dump(resolve("ppo", "above_rated", 0, 100)))
    return folder


@pytest.mark.parametrize("words", [("export-policy", "--out", "policy.npz"), ("train", "--resume", "--out")])
def test_a_checkpoint_of_a_stranger_is_not_loaded_unless_it_is_trusted(tmp_path, mark, monkeypatch, words):
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    monkeypatch.chdir(tmp_path)
    folder = checkpoint_of_a_stranger(tmp_path / "run", mark)
    result = invoke(*words, str(folder))
    assert result.exit_code == cli.EXIT_INPUT, result.output
    assert "--trust-zip" in result.stderr and "executes code" in result.stderr
    assert not mark.exists()


def test_the_study_itself_finds_a_crash_a_hang_and_a_wrong_error(tmp_path):
    """Of a worker whose loaders do so, at once and not after its time limit."""
    code = (
        "import sys, os, time; sys.argv = ['mutation.py', *sys.argv[1:]]\n"
        "import mutation\n"
        "class Samples:\n"
        "    def __init__(self, folder):\n"
        "        path = folder / 'file'\n"
        "        path.write_text('sound')\n"
        "        self.calls = 0\n"
        "        self.kinds = {'odd': (path, (mutation.flipped,), self.load)}\n"
        "    def load(self):\n"
        "        self.calls += 1\n"
        "        if self.calls == 2: raise KeyError('a')\n"
        "        if self.calls == 3: time.sleep(60)\n"
        "        if self.calls == 4: bytearray(10**11)\n"
        "        if self.calls == 5: os.kill(os.getpid(), 11)\n"
        "mutation.Samples, mutation.SECONDS, mutation.WAITS = Samples, 1, 1\n"
        "mutation.main()\n"
    )
    words = ["--folder", tmp_path / "worker", "--count", "9", "--work"]
    root = mutation.ROOT
    variables = os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{root / 'tests'}"}
    command = [sys.executable, "-c", code, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, env=variables)
    assert done.returncode == -11
    told = [line for line in done.stdout.splitlines() if "told" in line]
    assert ["KeyError" in told[0], "TimeoutError" in told[1], "MemoryError" in told[2]] == [True] * 3
    assert len(told) == 3
