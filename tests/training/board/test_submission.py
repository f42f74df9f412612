"""Submissions and boards: what is refused, and that adding one runs nothing of it."""

import pytest

from fowt_env.controllers.policy.controller import AGENTS
from fowt_env.errors import InputError
from fowt_env.training.board.folder import Board, new_board, read_seeds
from fowt_env.training.board.submission import LARGEST_FOLDER, read_submission

CARD = {
    "name": "mine",
    "author": "A. Researcher",
    "licence": "MIT",
    "controller": "mine.py:Mine",
    "information": ["generator_speed"],
}


def write(folder, source="raise SystemExit('was run')", **changes):
    folder.mkdir(exist_ok=True)
    card = {key: value for key, value in (CARD | changes).items() if value is not None}
    (folder / "card.toml").write_text("".join(f"{key} = {value!r}\n" for key, value in card.items()))
    (folder / "mine.py").write_text(source)
    return folder


def test_a_sound_card_is_read_and_nothing_is_run(tmp_path):
    found = read_submission(write(tmp_path / "a"))
    assert (found.name, found.kind, found.card.information) == ("mine", "Python file", ("generator_speed",))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": "../up"}, "name = '../up': must be 1 to 50"),
        ({"author": " "}, "author = '': must not be empty"),
        ({"licence": None}, "licence"),
        ({"controller": "other.py:Mine"}, "no file 'other.py'"),
        ({"controller": "../mine.py:Mine"}, "no file '../mine.py'"),
        ({"controller": "mine.py:a b"}, "must be FILE.py:Name"),
        ({"controller": "gspi"}, "unknown controller 'gspi'. Did you mean"),
        ({"controller": "mine.npz"}, "no such file"),
        ({"controller": "lqr"}, "information: is read from a built-in itself"),
        ({"information": None}, "information is missing"),
        ({"information": ["wind"]}, "unknown input 'wind'"),
        ({"information": ["wind_preview"]}, "preview_times = ..: must be given with"),
        ({"preview_times": [2.0]}, "must be given with"),
        ({"information": ["wind_preview"], "preview_times": [2.0, 1.0]}, "must rise"),
        ({"information": ["wind_preview"], "preview_times": [-1.0]}, "preview_times"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_wrong_card_is_refused_by_key_and_value(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        read_submission(write(tmp_path / "a", **changes))


def test_links_and_large_folders_are_refused(tmp_path):
    folder = write(tmp_path / "a")
    (folder / "link").symlink_to("/etc/hostname")
    with pytest.raises(InputError, match="is a link"):
        read_submission(folder)
    (folder / "link").unlink()
    with (folder / "large").open("wb") as file:
        file.truncate(int(LARGEST_FOLDER) + 1)
    with pytest.raises(InputError, match="at most 50 MB"):
        read_submission(folder)


def test_a_new_board_holds_the_package_s_controllers_and_frozen_suites(tmp_path):
    board = new_board(tmp_path / "board")
    names = [each.name for each in board.submissions()]
    assert {"gspi_oc3", "lqr", "rosco_float"} <= set(names)
    assert board.suite("above_rated").cases
    text = tmp_path / "board" / "suites" / "above_rated.toml"
    text.write_text(text.read_text().replace("duration = 800.0", "duration = 700.0"))
    assert board.suite("above_rated").duration == 700.0
    with pytest.raises(InputError, match="is there already"):
        new_board(tmp_path / "board")


def test_added_submissions_are_kept_and_never_replaced(tmp_path):
    board = new_board(tmp_path / "board")
    assert board.add(write(tmp_path / "a")) == "mine"
    assert board.add(tmp_path / "a") == "mine"
    with pytest.raises(InputError, match="another one of this name"):
        board.add(write(tmp_path / "b", source="x = 1"))
    kept = tmp_path / "board" / "submissions" / "mine" / "mine.py"
    assert "was run" in kept.read_text()
    assert not list((tmp_path / "board" / "submissions").glob(".*"))


def test_a_folder_without_a_board_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"has no board\.toml"):
        Board(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "whole numbers"),
        ("1001 x", "whole numbers"),
        ("1001\n1001", "twice"),
        ("5", "is a published one"),
    ],
)
def test_secret_seeds_are_checked(tmp_path, text, words):
    path = tmp_path / "seeds.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_seeds(path)
    path.write_text("1001\n1002\n")
    assert read_seeds(path) == (1001, 1002)


def test_a_policy_file_tells_its_inputs_itself(tmp_path):
    folder = write(tmp_path / "a", controller="p.npz", information=None)
    (folder / "p.npz").write_bytes(next(AGENTS.glob("*.npz")).read_bytes())
    assert read_submission(folder).kind == "policy file"
    (folder / "p.npz").write_bytes(b"no arrays")
    with pytest.raises(InputError, match="controller"):
        read_submission(folder)
