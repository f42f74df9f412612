"""fowt model linearize and fowt design from the shell."""

import json

import numpy as np
import pandas as pd
import pytest
import scipy.io
from command_line import fowt


def test_linearize_writes_models_and_says_where_the_pitch_rests(tmp_path):
    out = tmp_path / "m.npz"
    stdout, stderr = fowt("model", "linearize", "--winds", "8,18", "--out", str(out))
    assert "up to 8 m/s the blade pitch is at its minimum" in " ".join(stdout.split())
    assert "m.npz" in stderr
    assert np.load(out)["A"].shape == (2, 14, 14)


def test_a_wind_above_cut_out_is_named_as_such():
    assert "above cut-out (25 m/s)" in fowt("model", "linearize", "--winds", "24,30")[0]
    assert "cut-out" not in fowt("model", "linearize", "--winds", "24")[0]


def test_linearize_writes_the_table_of_modes_or_a_folder_of_everything(tmp_path):
    table, folder = tmp_path / "modes.csv", tmp_path / "study"
    fowt("model", "linearize", "--winds", "18", "--out", str(table))
    assert set(pd.read_csv(table)["mode"]) >= {"surge", "platform_pitch"}
    _, stderr = fowt("model", "linearize", "--winds", "18", "--out", str(folder))
    assert {path.name for path in folder.iterdir()} >= {"modes.csv", "models.json"}
    assert all(path.name in stderr for path in folder.iterdir())


def test_linearize_writes_the_model_of_one_wind_for_matlab(tmp_path):
    out = tmp_path / "m.mat"
    fowt("model", "linearize", "--winds", "18", "--out", str(out))
    assert scipy.io.loadmat(out)["A"].shape == (14, 14)
    _, stderr = fowt("model", "linearize", "--winds", "12,18", "--out", str(tmp_path / "n.mat"), code=2)
    assert "a .mat contains the model of one wind" in stderr


def test_linearize_refuses_other_endings_before_it_starts(tmp_path):
    _, stderr = fowt("model", "linearize", "--winds", "18", "--out", str(tmp_path / "m.xls"), code=2)
    assert "must be a folder or end with .csv, .parquet, .json, .npz, .mat" in " ".join(stderr.split())


def test_a_designed_pi_is_saved_and_simulated_by_its_file(tmp_path):
    path, run = tmp_path / "my.json", tmp_path / "run.csv"
    stdout, _ = fowt(
        "design", "pi", "--omega", "0.15", "--zeta", "0.9", "--winds", "12,18,24", "--out", str(path)
    )
    assert "the platform is unstable at 12 m/s" in stdout
    assert json.loads(path.read_text())["settings"]["KP"] > 0.0
    fowt("simulate", "--wind", "18", "--duration", "5", "--controller", f"design:{path}", "--out", str(run))
    assert len(pd.read_csv(run)) > 40


def test_a_designed_lqr_is_saved_with_its_settings(tmp_path):
    path = tmp_path / "lq.json"
    stdout, stderr = fowt("design", "lqr", "--setting", "share=0.6", "--out", str(path))
    saved = json.loads(path.read_text())
    assert saved["settings"]["lqg"]["share"] == 0.6
    assert saved["command"] == "fowt design lqr --setting share=0.6"
    assert len(saved["settings"]["models"]) == 22
    assert "design:" in stderr and "0.6" in stdout.split("share")[1]
    assert "must end with .json" in fowt("design", "lqr", "--out", str(tmp_path / "sweep.csv"), code=2)[1]


@pytest.mark.nightly
def test_bound_writes_and_front_reads_its_fronts(tmp_path):
    bound, runs = tmp_path / "bound.csv", tmp_path / "runs.csv"
    picture, share = tmp_path / "bound.png", tmp_path / "front.png"
    stdout, _ = fowt("design", "bound", "--wind", "18", "--out", str(bound), "--plot", str(picture))
    assert "measured" in stdout
    metrics = "RotSpeed_std_[rpm],PtfmPitch_std_[deg],GenPwr_std_[kW],blade_pitch_travel_[deg/s]"
    runs.write_text(f"case,variant,seed,{metrics}\nntm_18,gspi_oc3,1,1,1,1,1\nntm_18,mine,1,0.8,0.8,1,1\n")
    ratios = tmp_path / "ratios.csv"
    words = ("--runs", str(runs), "--bound", str(bound), "--out", str(ratios), "--plot", str(share))
    stdout, _ = fowt("design", "front", *words)
    assert "mine" in stdout
    assert pd.read_csv(ratios)["speed_ratio_[-]"].tolist() == [0.8]
    assert picture.stat().st_size > 10_000 and share.stat().st_size > 10_000
    _, stderr = fowt("design", "bound", "--wind", "9", code=2)
    assert "wind = 9.0: must be above 11.4" in " ".join(stderr.split())


def test_a_sweep_of_settings_refuses_seeds_for_scoring_and_settings_that_there_are_not():
    _, stderr = fowt("design", "lqr-sweep", "--seeds", "1,2", code=2)
    assert "seeds = [1, 2]: must be 1000 or more for tuning" in " ".join(stderr.split())
    _, stderr = fowt("design", "lqr-sweep", "--vary", "torque_rat=1,2", code=2)
    assert "unknown setting of lqr 'torque_rat'. Did you mean 'torque_rate'" in " ".join(stderr.split())


@pytest.mark.nightly
def test_a_sweep_of_settings_shows_and_writes_every_variant_beside_gspi(tmp_path):
    path = tmp_path / "sweep.csv"
    words = ("--vary", "travel=1,0.6", "--cases", "steady_16", "--seeds", "1001", "--out", str(path))
    stdout, _ = fowt("design", "lqr-sweep", *words)
    table = pd.read_csv(path)
    assert list(table["variant"]) == ["gspi_oc3", "{'travel': 1.0}", "{'travel': 0.6}"]
    assert all(name in stdout for name in table["variant"])
