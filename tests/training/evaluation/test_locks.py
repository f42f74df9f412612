"""The lock of a folder: one block at a time, and no folder left behind by a failure.

That a killed process leaves no lock is held by test_kills.py, which kills evaluations and resumes them.
"""

import pytest

from fowt_env.errors import InputError
from fowt_env.training.evaluation.locks import locked

WHAT, BUSY = "folder", "others are in it"


def test_a_folder_is_had_by_one_block_at_a_time(tmp_path):
    folder = tmp_path / "a" / "b"
    with locked(folder, WHAT, BUSY) as path:
        assert path == folder and folder.is_dir()
        with pytest.raises(InputError, match="^folder: others are in it$"), locked(folder, WHAT, BUSY):
            pass
        with locked(tmp_path / "a", WHAT, BUSY):
            pass
    with locked(folder, WHAT, BUSY):
        pass


def test_a_block_that_raises_takes_away_the_empty_folders_made_for_it_and_no_others(tmp_path):
    kept = ["c", "c/file"]
    for name, file, left in (("a/b", None, []), ("c/d", "c/file", kept), ("c", None, kept)):
        with pytest.raises(ZeroDivisionError), locked(tmp_path / name, WHAT, BUSY):
            if file is not None:
                (tmp_path / file).touch()
            raise ZeroDivisionError
        assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")) == left


def test_a_place_that_can_be_no_folder_is_named(tmp_path):
    (tmp_path / "file").touch()
    for folder, why in ((tmp_path / "file", "is a file"), (tmp_path / "file" / "below", "cannot be written")):
        with pytest.raises(InputError, match=f"folder: {why}"), locked(folder, WHAT, BUSY):
            pass
