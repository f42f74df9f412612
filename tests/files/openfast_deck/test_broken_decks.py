"""Files of strangers: whatever a part file holds, the readers raise nothing but InputError, and soon."""

import random
import time
import warnings

import pytest
from small_deck import NAMES, TEXTS, write_deck

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.conversion import platform_rows, stations, turbine_rows
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.report import make_report, markdown

WORDS = (
    "", "0", "-1", "1e400", "nan", "inf", "1e308", "-9e99", "99999999999999999999", "1e-320", "1d5", "-", "!",
    '"', "True", "DEFAULT", "none", "---", "\xb2", "\0", "5 5 5 5 5 5 5 5", "#", "NumBl", "3", "..", "7",
)  # fmt: skip


def mutated(text, rng):
    """The text with a few of its words or lines changed, dropped or repeated."""
    lines = text.split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        i, way = rng.randrange(len(lines)), rng.randrange(8)
        words = lines[i].split(" ")
        if way < 4:
            words[rng.randrange(len(words))] = rng.choice(WORDS)
            lines[i] = " ".join(words)
        elif way == 4:
            lines[i] = ""
        elif way == 5:
            lines.insert(i, rng.choice(lines))
        elif way == 6:
            lines = lines[: i + 1]
        else:
            lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
    return "\n".join(lines)


@pytest.mark.parametrize("part", sorted(TEXTS))
def test_a_broken_file_is_an_input_error(tmp_path, part):
    rng = random.Random(part)
    moored = [("1    CompMooring", "3    CompMooring"), ("map.dat", "moor.dat")] if part == "MoorDyn" else []
    path = write_deck(tmp_path, OpenFAST=moored)
    whole = (tmp_path / NAMES[part]).read_text()
    read = 0
    for _ in range(60):
        (tmp_path / NAMES[part]).write_bytes(mutated(whole, rng).encode("latin-1"))
        start = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                deck = read_deck(path)
                platform_rows(deck, "x", "x", "x", "x")
                turbine_rows(deck, "x")
                stations(deck)
                markdown(make_report(deck, "x"))
                read += 1
            except InputError as error:
                assert str(error)
        assert time.perf_counter() - start < 5.0
    assert read > 0
