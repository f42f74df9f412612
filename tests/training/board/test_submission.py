"""Submissions and boards: what is refused, and that adding one runs nothing of it."""

import hashlib
import io
import stat

import pytest
from naive.turbine import turbine

from fowt_env.controllers.policy.controller import AGENTS
from fowt_env.errors import InputError
from fowt_env.training.board.folder import Board, new_board, read_seeds, write_secret_seeds
from fowt_env.training.board.isolated import LARGEST_FOLDER, digest_of
from fowt_env.training.board.page import information_class
from fowt_env.training.board.submission import read_submission

CARD = {
    "name": "mine",
    "author": "A. Researcher",
    "licence": "MIT",
    "controller": "mine.py:Mine",
    "information": ["generator_speed"],
}


FAR = {"information": ["wind_preview"]}


def write(folder, source="raise SystemExit('was run')", **changes):
    folder.mkdir(exist_ok=True)
    card = {key: value for key, value in (CARD | changes).items() if value is not None}
    (folder / "card.toml").write_text("".join(f"{key} = {value!r}\n" for key, value in card.items()))
    (folder / "mine.py").write_text(source)
    (folder / "mine.py.so").write_text("no library")
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
        ({"controller": "lqr"}, "information: must be omitted for a built-in"),
        ({"information": None}, "information is missing"),
        ({"information": ["wind"]}, "unknown input 'wind'"),
        ({"information": ["wind_preview"]}, "preview_times = ..: must be set if and only if"),
        ({"information": ["wind_preview"], "preview_times": [2.0, 1.0]}, "must increase"),
        ({"name": "parked"}, "name = 'parked': is reserved"),
        ({"preview": "../../../../escaped"}, "unknown preview '../../../../escaped'"),
        (FAR | {"preview_times": [0.5 * i for i in range(1, 102)]}, "at most 100 times of at most 60 s"),
        (FAR | {"preview_times": [60.5]}, "at most 100 times of at most 60 s"),
        ({"controller": "none.so", "information": None}, "no file 'none.so' in the folder"),
        ({"controller": "../mine.so", "information": None}, "no file '../mine.so' in the folder"),
        ({"controller": "mine.py.so,other.IN", "information": None}, "no file 'other.IN' in the folder"),
        ({"controller": "mine.py.so", "information": None}, "is no shared library"),
        ({"description": "x" * 2001}, "description: has more than 2000"),
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
    with pytest.raises(InputError, match="exists already"):
        new_board(tmp_path / "board")


def test_added_submissions_are_kept_and_never_replaced(tmp_path):
    board = new_board(tmp_path / "board")
    assert board.add(write(tmp_path / "a")) == "mine"
    assert board.add(tmp_path / "a") == "mine"
    with pytest.raises(InputError, match="another submission of this name"):
        board.add(write(tmp_path / "b", source="x = 1"))
    kept = tmp_path / "board" / "submissions" / "mine" / "mine.py"
    assert "was run" in kept.read_text()
    assert not list((tmp_path / "board" / "submissions").glob(".*"))


def test_names_that_readers_take_for_each_other_are_refused(tmp_path):
    board = new_board(tmp_path / "board")
    board.add(write(tmp_path / "a", name="one_more"))
    with pytest.raises(InputError, match="the board has 'one_more', which readers would confuse with it"):
        board.add(write(tmp_path / "b", name="one-more"))


def test_the_digest_tells_files_apart_whatever_is_in_them(tmp_path):
    """Two files are not one that holds both, and a moved one is another."""
    digests = set()
    for number, files in enumerate(
        ({"a": "x", "b": "y"}, {"a": "x\0b\0y"}, {"a": "xb1 1 y"}, {"c/a": "x", "b": "y"})
    ):
        for name, text in files.items():
            path = tmp_path / str(number) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        digests.add(digest_of(tmp_path / str(number)))
    assert len(digests) == 4 and all(len(digest) == 64 for digest in digests)


def test_a_folder_without_a_board_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"has no board\.toml"):
        Board(tmp_path)


SALT = "salt " + "0f" * 32


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must begin with a line of 'salt'"),
        (f"{2**61}\n", "must begin with a line of 'salt'"),
        ("salt 0123456789abcdef\n", "must begin with a line of 'salt'"),
        (f"{SALT}\n", "whole numbers"),
        (f"{SALT}\n{2**61} x", "whole numbers"),
        (f"{SALT}\n{2**61}\n{2**61}", "twice"),
        (f"{SALT}\n{2**61}\n{2**40 - 1}", "must be from 2..40"),
        (f"{SALT}\n{2**63}", "must be from 2..40"),
    ],
)
def test_secret_seeds_that_could_be_found_are_refused(tmp_path, text, words):
    path = tmp_path / "seeds.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_seeds(path)


def test_a_file_of_secret_seeds_is_new_private_and_salted(tmp_path, monkeypatch):
    one, other = tmp_path / "seeds.txt", tmp_path / "other.txt"
    digest = write_secret_seeds(one, 6)
    seeds, again = read_seeds(one)
    assert digest == again == hashlib.sha256(one.read_bytes()).hexdigest()
    assert len(seeds) == 6 and min(seeds) >= 2**62 and max(seeds) < 2**63
    assert stat.S_IMODE(one.stat().st_mode) == 0o600
    other.write_text("\n".join(["salt " + "ab" * 32, *map(str, seeds)]))
    assert read_seeds(other)[0] == seeds and read_seeds(other)[1] != digest
    with pytest.raises(InputError, match="cannot be written: File exists"):
        write_secret_seeds(one, 6)
    with pytest.raises(InputError, match="does not exist"):
        read_seeds(tmp_path / "none.txt")
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(one.read_bytes())))
    assert read_seeds("-") == (seeds, digest)


def test_a_policy_file_tells_its_inputs_itself(tmp_path):
    folder = write(tmp_path / "a", controller="p.npz", information=None)
    (folder / "p.npz").write_bytes(next(AGENTS.glob("*.npz")).read_bytes())
    assert read_submission(folder).kind == "policy file"
    (folder / "p.npz").write_bytes(b"no arrays")
    with pytest.raises(InputError, match="controller"):
        read_submission(folder)


@pytest.mark.parametrize(
    ("information", "preview", "words"),
    [
        (["generator_speed", "lidar"], "circular_cw", "rotor and blades + lidar circular_cw, raw"),
        (["generator_speed", "lidar"], "exact", "rotor and blades + lidar four_beam_pulsed, raw"),
        (["platform_pitch", "plant_model"], "exact", "sensors + plant model"),
    ],
)
def test_the_information_class_names_the_lidar_that_is_read_raw(tmp_path, information, preview, words):
    found = read_submission(write(tmp_path / "a", information=information, preview=preview))
    assert information_class(found, turbine()) == words
