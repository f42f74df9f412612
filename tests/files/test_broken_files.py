"""Files that are broken, or made by strangers: refused by name, without crash or hang, their code not run."""

import itertools
import json
import os
import pickle
import sys
import zipfile
from contextlib import suppress
from copy import deepcopy
from pathlib import Path

import mutation
import numpy as np
import pytest
from potential_body import made_up_body
from typer.testing import CliRunner

from fowt_env.controllers import make
from fowt_env.controllers.policy.controller import AGENTS
from fowt_env.controllers.policy.network_file import read_policy
from fowt_env.descriptions.files import parse_json, read_toml
from fowt_env.descriptions.potential_flow import coefficient_arrays, read_coefficients
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.cli import app as cli
from fowt_env.training.cli import console
from fowt_env.training.evaluation import provenance
from fowt_env.training.evaluation.metrics import METRICS

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
    assert len(judged(tmp_path, 250, seed=7)) > 30


@pytest.mark.nightly
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


def policy_arrays():
    with np.load(AGENTS / "ppo_lqr.npz") as file:
        return {name: file[name] for name in file.files}


READERS = {  # of arrays: the function, what makes sound ones, and the name of one
    "policy": (read_policy, policy_arrays, "mean"),
    "coefficients": (read_coefficients, lambda: coefficient_arrays(made_up_body()), "omega"),
}


@pytest.mark.parametrize(("read", "sound", "name"), READERS.values(), ids=READERS)
def test_a_pickled_array_is_not_loaded(tmp_path, mark, read, sound, name):
    path = tmp_path / "bomb.npz"
    np.savez(path, **sound() | {name: np.array([Bomb(mark)], dtype=object)})
    with pytest.raises(InputError, match="bomb.npz.*holds pickled objects, which are not loaded"):
        read(path)
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


@pytest.mark.parametrize(("read", "name"), [(read, name) for read, _, name in READERS.values()], ids=READERS)
def test_an_array_that_claims_more_than_it_has_takes_no_memory(tmp_path, read, name):
    path = tmp_path / "claims.npz"
    head = b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little")
    said = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(f"{name}.npy", head + said.ljust(117) + b"\n" + bytes(80))
    with pytest.raises(InputError, match=f"{name}.npy.*is not its size"):
        read(path)


def invoke(*words):
    return CliRunner().invoke(cli.app, words, env={"COLUMNS": "1000", "NO_COLOR": "1"})


def test_a_stable_baselines3_zip_is_refused_where_a_policy_is_meant(tmp_path, mark):
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("data", pickle.dumps(Bomb(mark)))
    result = invoke("simulate", "--controller", f"policy:{path}", "--duration", "1")
    assert result.exit_code == console.EXIT_INPUT and "runs code of its author" in result.stderr
    assert not mark.exists()


def checkpoint_of_a_stranger(folder, mark):
    """A training run's folder whose every file would run code."""
    from fowt_env.training.rl.train import resolve

    place = folder / "checkpoints" / "step_64"
    place.mkdir(parents=True)
    for name in ("state.pkl", "normalisation.pkl", "replay_buffer.pkl", "model.zip"):
        (place / name).write_bytes(pickle.dumps(Bomb(mark)))
    import yaml

    (folder / "settings.yml").write_text(yaml.safe_dump(resolve("ppo", "above_rated", 0, 100)))
    return folder


@pytest.mark.parametrize(
    "words", [("connect", "export-policy", "--out", "policy.npz"), ("train", "--resume", "--out")]
)
def test_a_checkpoint_of_a_stranger_is_not_loaded_unless_it_is_trusted(tmp_path, mark, monkeypatch, words):
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    monkeypatch.chdir(tmp_path)
    folder = checkpoint_of_a_stranger(tmp_path / "run", mark)
    result = invoke(*words, str(folder))
    assert result.exit_code == console.EXIT_INPUT, result.output
    assert "--trust-zip" in result.stderr and "executes code" in result.stderr
    assert not mark.exists()


HOSTILE = ("own_law:Law", "os:abort", "policy:self.npz", "design:/etc/passwd", "../../x")


@pytest.fixture
def trapped(tmp_path, mark, monkeypatch):
    """Working folder whose module own_law leaves the mark when imported, as os.abort does when called."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(os, "abort", mark.touch)
    Path("own_law.py").write_text(f"open({str(mark)!r}, 'w')\nLaw = print\n")
    yield tmp_path
    assert sys.modules.pop("own_law", None) is None and not mark.exists()


def places(content, path=()):
    """Paths of all values of nested tables and lists that are none themselves."""
    items = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in items:
        if isinstance(value, dict | list) and value:
            yield from places(value, (*path, key))
        else:
            yield (*path, key)


def changed(content, path, value):
    """A copy of nested tables and lists with another value at a path."""
    content = deepcopy(content)
    place = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return content


def policy_of_a_stranger(settings, path):
    """The path written: the shipped agent's arrays with other settings."""
    np.savez(path, **policy_arrays() | {"settings": np.array(json.dumps(settings))})
    return path


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_in_a_policy_file_is_looked_up_as_code_or_as_a_file(text, trapped):
    sound = read_policy(AGENTS / "ppo_lqr.npz")[0]
    found = list(places(sound))
    assert ("baseline",) in found and ("observation", 0) in found
    for path in found:
        policy_of_a_stranger(changed(sound, path, text), "self.npz")
        if path[0] == "about":  # told to people
            assert make("policy:self.npz", read_turbine("nrel5mw"), 0.1).name == "policy:self.npz"
            continue
        with pytest.raises(InputError, match=f"policy file 'self.npz': {path[0]}.*{text}.*must be"):
            read_policy("self.npz")
        with pytest.raises(InputError):
            make("policy:self.npz", read_turbine("nrel5mw"), 0.1)


def settings_of_a_stranger():
    """Settings of a run with a value in every section of them, as many texts among them as there can be."""
    from fowt_env.training.rl.train import resolve

    settings = resolve("ppo", "above_rated", 0, 100)
    settings["environment"] |= {
        "platform": "oc3_hywind", "turbine": "nrel5mw", "rotor": "table", "fidelity": "standard",
        "wind": {"kind": "ntm", "speed": 18.0, "class": "B"}, "sea": "paper_wind_wave", "diffraction": "none",
        "integrator": "ab4", "mooring": "table", "sensors": {"noise": 0.0}, "wave_loads": "fast",
        "nominal_plant": {"platform": "oc3_hywind", "turbine": "nrel5mw"},
    }  # fmt: skip
    return settings


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_in_the_settings_of_a_stranger_is_looked_up_as_code(text, trapped):
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    import yaml

    from fowt_env.training.rl.train import Training

    sound = settings_of_a_stranger()
    found = list(places(sound))
    assert ("environment", "baseline") in found and ("environment", "nominal_plant", "platform") in found
    for path in found:
        if path == ("name",):  # of the settings among ours: told to people
            continue
        folder = trapped / "run"
        folder.mkdir(exist_ok=True)
        (folder / "settings.yml").write_text(yaml.safe_dump(changed(sound, path, text)))
        with pytest.raises(InputError, match=text):
            Training(None, folder, resume=True).run()


@pytest.mark.parametrize("tag", ["object/apply:own_law.Law []", "name:own_law.Law", "module:own_law"])
def test_settings_that_name_python_objects_are_not_loaded(tag, trapped):
    from fowt_env.training.rl.train import Training

    Path("run").mkdir()
    Path("run", "settings.yml").write_text(f"environment: !!python/{tag}\n")
    with pytest.raises(InputError, match="settings.yml.*not valid YAML"):
        Training(None, "run", resume=True)


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_in_a_design_is_looked_up_as_code_or_as_a_file(text, trapped):
    turbine = read_turbine("nrel5mw")
    sound = {
        "format": "fowt-design", "version": 2, "kind": "pi", "platform": "", "turbine": turbine.name,
        "command": "fowt", "settings": {"KP": 0.006, "KI": 0.0009, "gain_schedule_pitch": 0.11},
    }  # fmt: skip
    for path in places(sound):
        Path("self.json").write_text(json.dumps(changed(sound, path, text)))
        if path[0] in ("platform", "command"):  # told to people
            assert make("design:self.json", turbine, 0.1).name == "self"
            continue
        with pytest.raises(InputError, match="design file 'self.json'"):
            make("design:self.json", turbine, 0.1)
    Path("self.json").write_text(json.dumps(sound | {"kind": [text]}))
    with pytest.raises(InputError, match="unknown kind"):
        make("design:self.json", turbine, 0.1)


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_in_a_suite_is_looked_up_as_code(text, trapped):
    import tomllib

    from fowt_env.training.evaluation.cases import FOLDER, read_suite

    words = (FOLDER / "atlas.toml").read_text(encoding="utf-8").split('"')
    assert len(words) > 21
    for number in range(1, len(words), 2):
        content = '"'.join([*words[:number], text, *words[number + 1 :]])
        tomllib.loads(content)
        Path("suite.toml").write_text(content)
        with suppress(InputError):
            read_suite("suite.toml")


ODD_VALUES = (None, -1, 10**400, "x", [{}], {"a": {}})


# every 25th change: of each odd value in turn
@pytest.mark.parametrize("every", [25, pytest.param(1, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", ["manifest.json", "leaderboard.json"])
def test_every_value_of_a_results_folder_s_files_may_be_any_other(tmp_path, monkeypatch, name, every):
    pytest.importorskip("openfast_io", reason="openfast_io is not installed")
    pytest.importorskip("plotly", reason="plotly is not installed")
    monkeypatch.setattr("plotly.offline.get_plotlyjs", lambda: "")
    monkeypatch.setattr(provenance, "plant_code", provenance.plant_code)  # as Samples leaves it
    monkeypatch.setattr(provenance, "versions", provenance.versions)
    samples = mutation.Samples(tmp_path, ["results"])
    path = tmp_path / "results" / name
    loads = [load for file, _, load in samples.kinds.values() if file == path]
    sound = json.loads(path.read_text())
    others = set(METRICS) - {"RotSpeed_std_[rpm]"}  # one metric stands for all
    tried = refused = 0
    found = [place for place in (*((key,) for key in sound), *places(sound)) if not others & set(place)]
    for place, value in list(itertools.product(found, ODD_VALUES))[::every]:
        path.write_text(json.dumps(changed(sound, place, value)))
        for load in loads:
            tried += 1
            try:
                load()
            except InputError as error:
                assert str(tmp_path / "results") in str(error)
                refused += 1
        path.write_text(json.dumps(sound))
    assert loads and tried > 100 / every and 0.2 * tried < refused < tried
