"""The results folder: what it holds and refuses; an interrupted evaluation repeats nothing."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

import fowt_env
from fowt_env.errors import InputError
from fowt_env.training.evaluation import provenance, results
from fowt_env.training.evaluation.cases import Case, Suite
from fowt_env.training.evaluation.evaluate import COLUMNS, evaluate
from fowt_env.training.evaluation.leaderboard_file import write_leaderboard
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.reports.terminal import leaderboard_rows

CALM = Case("calm", 16.0)
WINDY = Case("windy", 18.0)
SHORT = {"duration": 20.0, "skip": 5.0}


class Broken:
    """Returns NaN."""

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return float("nan"), 0.0


class Misshapen(Broken):
    """Returns three numbers."""

    def act(self, measurement):
        return 1.0, 2.0, 3.0


def went(folder, *arguments, **options):
    """(table, runs that were made) of an evaluation into a folder."""
    made = []
    progress = lambda done, total, row: row and made.append(row)  # noqa: E731
    table = evaluate(*arguments, folder=folder, progress=progress, **SHORT | options)
    return table, [(row["controller"], row["case"], row["seed"]) for row in made]


class Repaired(Broken):
    """Keeps the command of the start."""

    def reset(self, measurement):
        self.command = measurement.generator_torque, measurement.blade_pitch

    def act(self, measurement):
        return self.command


def test_failed_runs_are_repeated_on_request_alone_also_with_changed_code(tmp_path):
    went(tmp_path, {"pi": "pi", "mine": Broken()}, [CALM, WINDY])
    with pytest.raises(InputError, match="or use --retry-failed"):
        went(tmp_path, {"mine": Repaired()}, [CALM])
    assert not went(tmp_path, {"pi": "pi", "mine": Broken()}, [CALM, WINDY])[1]
    table, made = went(tmp_path, {"pi": "pi", "mine": Broken()}, [CALM], retry_failed=True)
    assert made == [("mine", "calm", 1)] and len(table) == 4  # the other case was not asked for
    changed = {"pi": "pi", "mine": Repaired()}
    with pytest.raises(InputError, match="has changed"):  # its run in the other case would be of other code
        went(tmp_path, changed, [CALM], retry_failed=True)
    table, made = went(tmp_path, changed, [CALM, WINDY], retry_failed=True)
    assert made == [("mine", "calm", 1), ("mine", "windy", 1)]
    assert (table["status"] == "ok").all() and len(table) == 4
    assert not went(tmp_path, changed, [CALM, WINDY], retry_failed=True)[1]


def test_a_folder_holds_every_run_its_row_and_what_was_asked_for(tmp_path):
    table, made = went(tmp_path, {"pi": "pi", "broken": Broken(), "odd": Misshapen()}, [CALM], seeds=(1, 2))
    assert len(made) == 6 and (table["status"] == "ok").tolist() == [True, False, False] * 2
    for row in table.to_dict("records"):
        path = results.run_file(tmp_path / "runs", row["controller"], "calm", row["seed"])
        stored = results.read_row(path)
        assert stored == pytest.approx(row, nan_ok=True) and list(stored) == list(COLUMNS)
        frame = pd.read_parquet(path)
        assert "Time_[s]" in frame.columns
    assert len(pd.read_parquet(tmp_path / "runs" / "pi" / "calm_seed2.parquet")) == 201
    written = pd.read_csv(tmp_path / "results.csv")
    np.testing.assert_allclose(written[list(METRICS)], table[list(METRICS)].astype(float), rtol=1e-9)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["fowt_env"] == fowt_env.__version__ and manifest["seeds"] == [1, 2]
    assert manifest["cases"]["calm"]["duration"] == 20.0 and list(manifest["controllers"])[0] == "pi"
    board = write_leaderboard(table, tmp_path)
    assert json.loads((tmp_path / "leaderboard.json").read_text())["baseline"] == board["baseline"] == "pi"
    rows = leaderboard_rows(board)[2]
    assert [row[1] for row in rows] == ["2/2", "0/2, 2 failed", "0/2, 2 failed"]


def test_what_is_done_is_not_done_again_and_more_can_be_added(tmp_path):
    _, made = went(tmp_path, "pi", [CALM])
    assert made == [("pi", "calm", 1)]
    path = tmp_path / "runs" / "pi" / "calm_seed1.parquet"
    before = path.stat().st_mtime_ns
    table, made = went(tmp_path, "pi,pi_land", [CALM, WINDY], seeds=(1, 2))
    assert ("pi", "calm", 1) not in made and len(made) == 7 and path.stat().st_mtime_ns == before
    assert len(table) == 8
    again, made = went(tmp_path, "pi", [CALM])
    assert made == [] and len(again) == 8  # the whole folder's table
    fresh = evaluate("pi,pi_land", [CALM, WINDY], seeds=(1, 2), **SHORT)
    pd.testing.assert_frame_equal(table, fresh, check_exact=True)


def test_a_lost_run_is_made_again(tmp_path):
    first, _ = went(tmp_path, "pi", [CALM], seeds=(1, 2))
    (tmp_path / "runs" / "pi" / "calm_seed2.parquet").unlink()
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    (tmp_path / "runs" / "pi" / f".calm_seed2-{ended.pid}-abcdefgh.parquet").write_bytes(b"half a file")
    (tmp_path / "results.csv").unlink()
    second, made = went(tmp_path, "pi", [CALM], seeds=(1, 2))
    assert made == [("pi", "calm", 2)]
    pd.testing.assert_frame_equal(first, second, check_exact=True)
    assert not list(tmp_path.rglob(".*")) and (tmp_path / "results.csv").exists()


SETTINGS = {"suite": None, "options": {}, "cases": {}, "seeds": [], "controllers": {}}


def suite(version=1, wind=16.0):
    return Suite("mine", version, "d", "s", "rotor-averaged", (1,), 20.0, 5.0, (Case("calm", wind),))


def test_other_settings_and_versions_are_refused_with_what_to_do(tmp_path, monkeypatch):
    evaluate("pi", suite(), folder=tmp_path)
    evaluate("pi", suite(), folder=tmp_path)
    for arguments, message in (
        ({"cases": suite(version=2)}, "'mine' version 1"),
        ({"cases": [CALM], **SHORT}, "suite"),
        ({"cases": suite(), "sensors": "standard"}, "sensors = exact, now standard"),
        ({"cases": suite(wind=17.0)}, "wind = 16.0, now 17.0"),
        ({"cases": suite(), "duration": 30.0}, "duration = 20.0, now 30.0"),
        ({"cases": suite(), "control_dt": 0.2}, "options"),
    ):
        with pytest.raises(InputError, match=message) as error:
            evaluate("pi", folder=tmp_path, **arguments)
        assert "--out" in str(error.value) and str(tmp_path) in str(error.value)
    new = {"name": "pi", "code": "new"}
    for name, value, message in (
        ("__version__", "9.9", "was made by fowt_env .* not 9.9"),
        ("training.evaluation.provenance.plant_code", lambda: "other", "other sources"),
        (
            "training.evaluation.evaluate.controller_code",
            lambda controller: new,
            "'pi' or its code has changed",
        ),
    ):
        with monkeypatch.context() as patch, pytest.raises(InputError, match=message):
            patch.setattr(f"fowt_env.{name}", value)
            evaluate("pi", suite(), folder=tmp_path)


def test_a_policys_code_changes_with_its_file(tmp_path):
    path = tmp_path / "agent.npz"
    codes = []
    for content in (b"one", b"one", b"trained anew"):
        path.write_bytes(content)
        codes.append(provenance.controller_code(f"policy:{path}")["code"])
    assert codes[0] == codes[1] != codes[2]
    assert provenance.controller_code("policy:ppo_lqr")["code"] not in codes


@pytest.mark.parametrize("content", ["{", "[]", '{"format": 99}'])
def test_a_manifest_of_another_format_is_refused(tmp_path, content):
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(InputError, match="--out"):
        evaluate("pi", suite(), folder=tmp_path)
    assert (tmp_path / "manifest.json").read_text() == content


def test_a_folder_in_use_and_a_file_are_refused(tmp_path):
    with results.open_results(tmp_path / "a", SETTINGS, COLUMNS):
        with pytest.raises(InputError, match="another evaluation"):
            evaluate("pi", suite(), folder=tmp_path / "a")
    (tmp_path / "b").write_text("")
    with pytest.raises(InputError, match="is a file"):
        evaluate("pi", suite(), folder=tmp_path / "b")
    with pytest.raises(InputError, match="out and runs_folder"):
        evaluate("pi", suite(), folder=tmp_path / "c", out=tmp_path / "x.csv")


class Unmeasured(Repaired):
    """Reads a channel that does not exist."""

    information = ("rotor_colour",)


def test_a_refused_controller_leaves_the_folder_as_it_was(tmp_path):
    folder = tmp_path / "new" / "folder"
    with pytest.raises(InputError, match="rotor_colour"):
        went(folder, {"bad": Unmeasured()}, [CALM])
    assert not list(tmp_path.iterdir())
    folder.mkdir(parents=True)
    (folder / "notes.txt").write_text("of the user")
    went(folder, {"good": Repaired()}, [CALM])
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert len(before) == 4
    with pytest.raises(InputError, match="rotor_colour"):
        went(folder, {"good": Repaired(), "bad": Unmeasured()}, [CALM])
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
