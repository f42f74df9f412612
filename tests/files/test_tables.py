import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

from fowt_env import build_scene, linearize
from fowt_env.errors import InputError
from fowt_env.files.atomic import is_leftover, remove_leftovers, replacing
from fowt_env.files.matlab import write_mat
from fowt_env.files.tables import read_series, read_table, write_table

FRAME = pd.DataFrame({"Time_[s]": [0.0, 0.1], "PtfmPitch_[deg]": [1.0 / 3.0, -2e-7]})


@pytest.mark.parametrize(("name", "tolerance"), [("run.csv", 1e-9), ("run.parquet", 0.0)])
def test_a_written_table_reads_back(tmp_path, name, tolerance):
    path = write_table(FRAME, tmp_path / "a" / name)
    pd.testing.assert_frame_equal(read_table(path), FRAME, rtol=tolerance, atol=0.0)


def test_the_time_of_fast_7_is_that_of_other_runs(tmp_path):
    path = tmp_path / "run.out"
    path.write_text("Time\tRotSpeed\n(sec)\t(rpm)\n0.0\t12.1\n0.1\t12.2\n")
    assert list(read_series(path).columns) == ["Time_[s]", "RotSpeed_[rpm]"]


def test_a_failed_write_keeps_the_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_what_a_killed_process_left_is_removed_and_what_a_living_one_writes_stays(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead = tmp_path / f".run-{ended.pid}-abcdefgh.csv"
    others = [tmp_path / name for name in (".run-1-abcdefgh.csv", ".hidden", "run-999999999-abcdefgh.csv")]
    for path in (dead, *others):
        path.touch()
    with replacing(tmp_path / "run.csv") as own:
        remove_leftovers(tmp_path)
        assert is_leftover(own) and own.exists() and is_leftover(dead)
    assert sorted(tmp_path.iterdir()) == sorted([*others, tmp_path / "run.csv"])


def test_files_get_the_mode_that_the_user_asked_for(tmp_path):
    mask = os.umask(0o027)
    try:
        path = write_table(FRAME, tmp_path / "run.csv")
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("mode", [0o600, 0o444, 0o664])
def test_a_file_that_is_written_anew_keeps_its_rights(tmp_path, mode):
    path = tmp_path / "run.csv"
    path.write_text("private")
    path.chmod(mode)
    with replacing(path) as temporary:
        assert temporary.stat().st_mode & 0o077 == 0  # nobody reads it before it is in its place
        temporary.write_text("anew")
    assert path.stat().st_mode & 0o777 == mode and path.read_text() == "anew"


def test_a_link_goes_on_pointing_to_the_new_content(tmp_path):
    (tmp_path / "disk").mkdir()
    target, link, dangling = tmp_path / "disk" / "run.csv", tmp_path / "run.csv", tmp_path / "new.csv"
    target.write_text("old")
    link.symlink_to("disk/run.csv")
    dangling.symlink_to(tmp_path / "later" / "new.csv")
    for path in (link, dangling):
        write_table(FRAME, path)
        assert path.is_symlink()
        pd.testing.assert_frame_equal(read_table(path), FRAME)
    assert target.read_text() == (tmp_path / "later" / "new.csv").read_text() != "old"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["disk", "later", "new.csv", "new.csv"] + [
        "run.csv", "run.csv",
    ]  # fmt: skip


def test_wrong_endings_and_missing_files_are_named(tmp_path):
    with pytest.raises(InputError, match="run.xlsx"):
        write_table(FRAME, tmp_path / "run.xlsx")
    with pytest.raises(InputError, match="not found"):
        read_table(tmp_path / "run.csv")


@pytest.mark.parametrize("wind", [18.0, None])
def test_a_linear_model_comes_back_from_its_mat_file_whole(tmp_path, wind):
    model = linearize(build_scene("oc3_hywind", wind=wind, fidelity="standard"))
    read = loadmat(write_mat(model, tmp_path / "model.mat"), squeeze_me=True, chars_as_strings=True)
    np.testing.assert_array_equal(read["A"], model.A)
    np.testing.assert_array_equal(read["B"], model.B)
    assert tuple(read["states"]) == model.states and tuple(read["inputs"]) == model.inputs
    assert read["x0"].shape == (14,) and read["u0"].shape == (3,)
    index = model.index("platform_pitch")
    channel = read["operating_point"]["PtfmPitch"].item()
    assert np.degrees(read["x0"][index]) == pytest.approx(channel, rel=1e-9)
    assert read["u0"][2] == wind if wind else np.isnan(read["u0"][2])
    assert [path.name for path in tmp_path.iterdir()] == ["model.mat"]


def test_a_mat_file_needs_its_ending(tmp_path):
    with pytest.raises(InputError, match=r"model.txt.*\.mat"):
        write_mat(None, tmp_path / "model.txt")
