"""fowt dev leaderboard, and fowt evaluate on drawn seeds, which nobody knows while controllers are tuned."""

import hashlib
import json

import pytest
from command_line import fowt

from fowt_env.training.evaluation.seeds import DRAWING_RULE, drawn_seeds

HASH = "0123456789abcdef0123456789abcdef01234567"
SUITE = (
    'version = 2\ndescription = "d"\nsource = "s"\nwind = "rotor-averaged"\nseeds = [1, 2, 3, 4]\n'
    'duration = 15.0\nskip = 5.0\n[[case]]\nname = "gusty"\nwind = {kind = "ntm", speed = 18.0}\n'
)


def test_seeds_prints_the_hash_of_the_file_that_it_makes_and_replaces_none(tmp_path):
    path = tmp_path / "seeds.txt"
    printed = fowt("dev", "leaderboard", "seeds", str(path), "--count", "3")[0].split()
    assert printed == [hashlib.sha256(path.read_bytes()).hexdigest()]
    assert len(path.read_text().splitlines()) == 4
    assert "cannot be written" in fowt("dev", "leaderboard", "seeds", str(path), code=2)[1]


def test_evaluate_draws_the_seeds_of_a_suite_and_says_so_in_what_it_writes(tmp_path):
    suite, out = tmp_path / "mine.toml", tmp_path / "out"
    suite.write_text(SUITE)
    words = ("evaluate", "--suite", str(suite), "--controllers", "pi", "--no-plot", "--out", str(out))
    assert f"seeds drawn from {HASH}" in fowt(*words, "--draw-seeds", HASH)[1]
    board = json.loads((out / "leaderboard.json").read_text())
    assert board["seeds"] == sorted(drawn_seeds(HASH, "mine", 2, 4))
    assert board["suite"]["drawn"] == {"hash": HASH, "rule": DRAWING_RULE}
    other = fowt(*words, "--draw-seeds", "f" + HASH[1:], code=2)[1]
    drawn = "version 2 with seeds drawn from"
    assert f"{drawn} 0123456789ab, not 'mine' {drawn} f1234" in other


@pytest.mark.parametrize("words", [(), ("--suite", "above_rated", "--seeds", "1"), ("--cases", "ntm_18")])
def test_drawn_seeds_need_a_suite_and_no_other_seeds(tmp_path, words):
    _, stderr = fowt("evaluate", *words, "--draw-seeds", HASH, "--out", str(tmp_path / "out"), code=2)
    assert "--draw-seeds: needs a --suite" in stderr
    assert not (tmp_path / "out").exists()
