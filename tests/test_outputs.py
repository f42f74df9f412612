import os

import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.outputs import read_table, replacing, write_table

FRAME = pd.DataFrame({"Time_[s]": [0.0, 0.1], "PtfmPitch_[deg]": [1.0 / 3.0, -2e-7]})


@pytest.mark.parametrize(("name", "tolerance"), [("run.csv", 1e-9), ("run.parquet", 0.0)])
def test_a_written_table_reads_back(tmp_path, name, tolerance):
    path = write_table(FRAME, tmp_path / "a" / name)
    pd.testing.assert_frame_equal(read_table(path), FRAME, rtol=tolerance, atol=0.0)


def test_a_failed_write_keeps_the_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_files_get_the_mode_that_the_user_asked_for(tmp_path):
    mask = os.umask(0o027)
    try:
        path = write_table(FRAME, tmp_path / "run.csv")
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o640


def test_wrong_endings_and_missing_files_are_named(tmp_path):
    with pytest.raises(InputError, match="run.xlsx"):
        write_table(FRAME, tmp_path / "run.xlsx")
    with pytest.raises(InputError, match="not found"):
        read_table(tmp_path / "run.csv")
