"""fowt study: a platform and controllers in, one page with a verdict out."""

import re
import subprocess

import numpy as np
import pytest
from bladed_library import needs_gcc
from command_line import fowt
from small_deck import write_deck

import fowt_env
from fowt_env.errors import InputError
from fowt_env.files.tables import write_table
from fowt_env.training.cli.study import FILM, _imported, most_different

SUITE = """\

version = 1
description = "one case"
source = "a test"
wind = "rotor-averaged"
duration = 90.0
skip = 30.0
seeds = [1]

[[case]]
name = "ntm_16"
wind = { kind = "ntm", speed = 16.0 }
sea = { kind = "jonswap", Hs = 4.0, Tp = 9.0 }
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run of another law in steady wind and irregular waves, as a user's own output."""
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0, sea="jonswap:4:9", seed=3)
    frame = fowt_env.simulate(scene, "pi_unscheduled", duration=90.0)
    return write_table(frame, tmp_path_factory.mktemp("theirs") / "run.outb")


def test_a_study_says_the_verdict_and_writes_one_page_with_all_parts(tmp_path, monkeypatch, recorded):
    pytest.importorskip("plotly", reason="plotly is not installed: the extra `report` is missing")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SUITE)
    words = ("--controller", "pi", "--against", "gspi_oc3,pi_land", "--suite", "short.toml", "--seeds", "1")
    stdout, _ = fowt("study", *words, "--compare", str(recorded), "--no-animation", "--out", "made")
    lines = stdout.splitlines()
    assert lines[-1] == "open made/report.html"
    assert any("Observed against gspi_oc3" in line for line in lines)
    said = {line.partition(":")[0].strip(): line.strip() for line in lines if "rotor-speed std" in line}
    text = (tmp_path / "made" / "report.html").read_text(encoding="utf-8")
    assert (
        text.index("Beside your own run")
        < text.index("Linear margins at 16 m/s")
        < text.index('id="leaderboard"')
    )
    page = re.sub("<[^>]+>", "", text)
    assert said.keys() == {"pi", "pi_land"} and all(line in page for line in said.values())
    assert "pi in the wind of run.outb, with its waves, towards +x" in text and "shear exponent 0.14" in text
    assert "Only 63 s are compared" in text  # of the 90 s, without the first 30 %
    assert "RotSpeed (rpm)" in text and "phase margin (deg)" in text


def test_what_cannot_be_studied_is_refused_before_anything_is_evaluated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words, said in (
        (("nowhere.fst",), "nowhere.fst"),
        (("--controller", ""), "--controller"),
        (("--controller", "pi", "--compare", "nowhere.outb"), "nowhere.outb"),
        (("oc3_hywin",), "oc3_hywind"),
        (("--against", "gspi"), "gspi_oc3"),
        (("--controller", "mpc,pi", "--against", "gspi_oc3,pi"), "--against pi: is also a --controller"),
        (("--shear", "0.1"), "--shear: is used with --compare"),
    ):
        assert said in fowt("study", *words, code=2)[1]
    assert not (tmp_path / "results" / "study" / "results.csv").exists()


def test_a_refused_study_of_a_deck_leaves_nothing_and_what_was_there_untouched(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck").mkdir()
    deck, made = str(write_deck(tmp_path / "deck")), tmp_path / "a" / "study" / "small"
    before = set(tmp_path.rglob("*"))
    assert "'pie'" in fowt("study", deck, "--against", "pie", "--out", "a/study", code=2)[1]
    with pytest.raises(InputError), _imported(deck, made.parent) as (_, _, keep):
        assert keep() == str(made / "platform.toml")  # evaluate refuses the folder
        raise InputError
    assert set(tmp_path.rglob("*")) == before
    made.parent.mkdir(parents=True)
    made.touch()
    assert "is a file" in fowt("study", deck, "--against", "pi", "--out", "a/study", code=2)[1]
    made.unlink()
    with pytest.raises(InputError), _imported(deck, made.parent) as (_, _, keep):
        keep()
        (made.parent / "runs" / "pi").mkdir(parents=True)
        (made.parent / "runs" / "pi" / "ntm_16_seed1.parquet").touch()
        raise InputError  # after a run on the platform
    assert (made / "platform.toml").exists()
    with _imported(deck, made.parent) as (_, _, keep):
        keep()  # the same again
    (made / "platform.toml").write_text("mine")
    with (
        pytest.raises(InputError, match="platform.toml: differs"),
        _imported(deck, made.parent) as (*_, keep),
    ):
        keep()
    fowt("study", deck, "--against", "pie", "--out", "a/study", code=2)
    with pytest.raises(InputError), _imported(deck, made.parent):
        raise InputError
    assert (made / "platform.toml").read_text() == "mine" and (made / "report.md").exists()


@needs_gcc
def test_a_library_that_refuses_its_input_file_stops_a_study_at_the_start(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.c").write_text(
        "#include <string.h>\nvoid DISCON(float *swap, int *fail, char *in, char *out, char *message)\n"
        '{ *fail = -1; strcpy(message, "made for another version"); }\n'
    )
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", "old.so", "old.c"], check=True)
    (tmp_path / "short.toml").write_text(SUITE)
    words = ("--controller", "dll:old.so", "--suite", "short.toml", "--seeds", "1", "--no-animation")
    assert "made for another version" in " ".join(fowt("study", *words, code=1)[1].split())


def test_the_animation_shows_where_the_first_signal_swings_and_the_second_does_not():
    time = np.arange(0.0, 600.0, 0.1)
    second = np.sin(0.2 * time)
    first = np.where((time > 300.0) & (time < 300.0 + FILM), 3.0, 1.0) * second
    assert abs(most_different(first, second) - 300.0) <= 4.0
    assert most_different(first[:700], second[:700]) == 60.0
