"""The seal of checkpoints: whose key counts."""

import os

import pytest

from fowt_env.training.rl import checkpoint_signature


@pytest.fixture
def checkpoint(tmp_path, monkeypatch):
    """Folder of a checkpoint sealed by this user, with the configuration in tmp_path / "own" / "config"."""
    monkeypatch.setenv("FOWT_CONFIG_DIR", str(tmp_path / "own" / "config"))
    folder = tmp_path / "checkpoint"
    folder.mkdir()
    (folder / "weights").write_text("1 2 3")
    before = os.umask(0)
    try:
        checkpoint_signature.seal(folder)
    finally:
        os.umask(before)
    assert checkpoint_signature.is_own(folder)
    return folder


def test_the_key_and_its_folders_are_private_whatever_the_umask(checkpoint, tmp_path):
    paths = [tmp_path / "own", *(tmp_path / "own").rglob("*")]
    assert len(paths) == 3 and not any(path.stat().st_mode & 0o077 for path in paths)


@pytest.mark.parametrize("mode", [0o620, 0o640, 0o604, 0o602])
def test_a_key_that_others_may_know_or_have_put_there_seals_nothing(mode, checkpoint, tmp_path):
    (tmp_path / "own" / "config" / checkpoint_signature.KEY_FILE).chmod(mode)
    assert not checkpoint_signature.is_own(checkpoint)


def test_a_key_of_another_user_seals_nothing(checkpoint, tmp_path, monkeypatch):
    if os.geteuid() == 0:
        os.chown(tmp_path / "own" / "config" / checkpoint_signature.KEY_FILE, 54321, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 54321)
    assert not checkpoint_signature.is_own(checkpoint)


def test_the_home_folder_is_found_where_no_shell_has_put_it(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("FOWT_CONFIG_DIR", "~/our config")
    assert checkpoint_signature.config_folder() == tmp_path / "our config"
