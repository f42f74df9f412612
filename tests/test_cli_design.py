"""fowt linearize and fowt design from the shell."""

import json

import numpy as np
import pandas as pd
from test_cli import fowt


def test_linearize_writes_models_and_says_where_the_pitch_rests(tmp_path):
    out = tmp_path / "m.npz"
    stdout, stderr = fowt("linearize", "--winds", "8,18", "--out", str(out))
    assert "up to 8 m/s the blade pitch rests on its minimum" in " ".join(stdout.split())
    assert "m.npz" in stderr
    assert np.load(out)["A"].shape == (2, 14, 14)


def test_linearize_refuses_other_endings_before_it_starts(tmp_path):
    _, stderr = fowt("linearize", "--winds", "18", "--out", str(tmp_path / "m.mat"), code=2)
    assert "must be a folder or end with .csv, .parquet, .json, .npz" in " ".join(stderr.split())


def test_a_designed_pi_is_saved_and_simulated_by_its_file(tmp_path):
    path, run = tmp_path / "my.json", tmp_path / "run.csv"
    stdout, _ = fowt(
        "design", "pi", "--omega", "0.15", "--zeta", "0.9", "--winds", "12,18,24", "--out", str(path)
    )
    assert "the platform is unstable at 12 m/s" in stdout
    assert json.loads(path.read_text())["settings"]["KP"] > 0.0
    fowt("simulate", "--wind", "18", "--duration", "5", "--controller", f"design:{path}", "--out", str(run))
    assert len(pd.read_csv(run)) > 40


def test_a_designed_lqr_is_saved_with_its_weights(tmp_path):
    path = tmp_path / "lq.json"
    fowt("design", "lqr", "--weight", "pitch_rate=9", "--out", str(path))
    saved = json.loads(path.read_text())
    assert saved["settings"]["weights"]["pitch_rate"] == 9
    assert saved["command"] == "fowt design lqr --weight pitch_rate=9"
    assert len(saved["settings"]["models"]) == 22
    _, stderr = fowt("design", "lqr", "--vary", "pitch_rate=1,2", "--out", str(path), code=2)
    assert "a design has one value per weight" in " ".join(stderr.split())


def test_bound_writes_and_front_reads_its_fronts(tmp_path):
    bound, runs = tmp_path / "bound.csv", tmp_path / "runs.csv"
    stdout, _ = fowt("design", "bound", "--wind", "18", "--out", str(bound))
    assert "measured" in stdout
    metrics = "RotSpeed_std_[rpm],PtfmPitch_std_[deg],GenPwr_std_[kW],blade_pitch_travel_[deg/s]"
    runs.write_text(f"case,variant,seed,{metrics}\nntm_18,gspi_oc3,1,1,1,1,1\nntm_18,mine,1,0.8,0.8,1,1\n")
    stdout, _ = fowt("design", "front", "--runs", str(runs), "--bound", str(bound))
    assert "mine" in stdout
    _, stderr = fowt("design", "bound", "--wind", "9", code=2)
    assert "wind = 9.0: must be above 11.4" in " ".join(stderr.split())
