"""One block at a time in a folder, whatever becomes of its process."""

import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from fowt_env.errors import InputError
from fowt_env.training.evaluation.locks import locked

ROOT = Path(__file__).resolve().parents[3]
WHAT, BUSY = "folder", "others are in it"
HOLDER = """
import sys, time
from fowt_env.training.evaluation.locks import locked
with locked(sys.argv[1], "folder", "others are in it"):
    print("locked", flush=True)
    time.sleep(600)
"""


def refused(folder):
    """Whether the folder is refused because another block has it."""
    try:
        with locked(folder, WHAT, BUSY):
            return False
    except InputError as error:
        assert str(error) == "folder: others are in it"
        return True


def test_a_folder_is_had_by_one_block_at_a_time(tmp_path):
    folder = tmp_path / "a" / "b"
    with locked(folder, WHAT, BUSY) as given:
        assert given == folder and folder.is_dir()
        assert refused(folder) and not refused(tmp_path / "a")
    assert not refused(folder)


def test_a_process_that_is_killed_leaves_no_lock(tmp_path):
    words, variables = [sys.executable, "-c", HOLDER, tmp_path], os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(words, stdout=subprocess.PIPE, env=variables) as holder:
        try:
            assert holder.stdout.readline() == b"locked\n"
            assert refused(tmp_path)
        finally:
            holder.send_signal(signal.SIGKILL)
    assert not refused(tmp_path)


def test_a_block_that_raises_takes_away_the_empty_folders_made_for_it_and_no_others(tmp_path):
    def fail_in(folder, file=None):
        with ExitStack() as stack:
            stack.enter_context(pytest.raises(ZeroDivisionError))
            stack.enter_context(locked(folder, WHAT, BUSY))
            if file is not None:
                file.touch()
            raise ZeroDivisionError

    fail_in(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "there").mkdir()
    fail_in(tmp_path / "there")
    assert (tmp_path / "there").is_dir()
    fail_in(tmp_path / "c" / "d", tmp_path / "c" / "file")
    assert [path.name for path in (tmp_path / "c").iterdir()] == ["file"]
    fail_in(tmp_path / "c" / "d", tmp_path / "c" / "d" / "file")
    assert (tmp_path / "c" / "d" / "file").exists()


def test_a_place_that_can_be_no_folder_is_named(tmp_path):
    (tmp_path / "file").touch()
    for folder, why in ((tmp_path / "file", "is a file"), (tmp_path / "file" / "below", "cannot be written")):
        with pytest.raises(InputError, match=f"folder: {why}"), locked(folder, WHAT, BUSY):
            pass
