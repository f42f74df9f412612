"""fowt dev benchmark from the shell, on tiny settings: what is printed and written, and clear refusals."""

import json
from pathlib import Path

import pandas as pd
import pytest
from command_line import fowt

FOUND = Path(__file__).parents[2] / "reference" / "stability"


def test_speed_prints_and_writes_the_kinds_asked_for(tmp_path):
    path, kind = tmp_path / "speed.csv", "still water, no wind"
    words = ("--kinds", kind, "--seconds", "2", "--repeats", "1", "--out", str(path))
    stdout, stderr = fowt("dev", "benchmark", "speed", *words)
    assert kind in stdout and "simulate_x" in stdout and "speed.csv" in stderr
    table = pd.read_csv(path, comment="#")
    assert list(table["kind"]) == [kind] and (table["step_us"] > 0.0).all()


def test_evaluation_prints_and_writes_what_a_run_takes(tmp_path):
    path = tmp_path / "evaluation.csv"
    stdout, _ = fowt("dev", "benchmark", "evaluation", "--count", "1", "--out", str(path))
    table = pd.read_csv(path, comment="#")
    assert len(table) and all(name in stdout for name in table.columns)


def test_stability_writes_its_part_and_a_report_and_says_what_holds(tmp_path):
    words = ("--parts", "cases", "--cases", "5", "--out", str(tmp_path))
    stdout, stderr = fowt("dev", "benchmark", "stability", *words)
    assert "holds" in stdout and "MISSED" not in stdout and "robustness.md" in stderr
    assert json.loads((tmp_path / "cases.json").read_text())
    assert (tmp_path / "robustness.md").read_text().startswith("#")


def test_stability_runs_a_stored_case_again():
    stdout, _ = fowt("dev", "benchmark", "stability", "--replay", str(FOUND / "fast_rotor_yawing.json"))
    assert stdout.startswith("reached ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("speed", "--kinds", "full, standart"), "Did you mean 'full, standard'"),
        (("accuracy", "--axes", "step"), "unknown axis 'step'"),
        (("accuracy", "--seeds", "one"), "seeds"),
        (("stability", "--parts", "maps"), "Did you mean 'map'"),
        (("stability", "--replay", "nowhere.json"), "nowhere.json"),
        (("evaluation", "--suite", "above"), "above"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_cannot_be_measured_is_refused_by_name(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, stderr = fowt("dev", "benchmark", *words, code=2)
    assert message in " ".join(stderr.split())
    assert not list(tmp_path.iterdir())
