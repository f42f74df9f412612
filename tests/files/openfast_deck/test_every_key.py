"""Every key of a deck that the importer reads moves what it writes, or is refused.

The keys are those that the importer asks for while it imports small decks of several kinds. Each is changed
by itself, or put in where the deck has none, and the import is compared with that of the unchanged deck.
"""

import functools
import re
import tomllib
from typing import NamedTuple

import numpy as np
import pytest
from small_deck import ROTOR_TABLE, write_deck

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.importer import import_deck
from fowt_env.files.openfast_deck.parser import PartFile, number_of, words_of

FAST_8_SEA = """1000 WtrDens
150 WtrDpth
0 MSL2SWL
2 WaveMod
5 WaveHs
9 WaveTp
20 WaveDir
1 CurrMod
0.3 CurrSSV0
0.2 CurrNSV0
0.1 CurrDIV
"""
KINDS = {  # of decks: changes of the small one; each makes the importer read further keys
    "plain": {},
    "MoorDyn": {"OpenFAST": [("1    CompMooring", "3    CompMooring"), ("map.dat", "moor.dat")]},
    "members alone": {"HydroDyn": [("1    PotMod ", "0    PotMod ")]},
    "FAST 8": {
        "OpenFAST": 'head\n1 CompMooring\n"ed.dat" EDFile\n"ad.dat" AeroFile\n"servo.dat" ServoFile\n'
        '"hd.dat" HydroFile\n"map.dat" MooringFile\n"wind.dat" InflowFile\n',
        "ElastoDyn": [("3      NumBl", "9.80665 Gravity\n3 NumBl"), ("0      PtfmRefzt", "0      PtfmRef")],
        "AeroDyn": [('"default"  AirDens', "1.225 AirDens")],
        "HydroDyn": [("1    NBody\n", ""), ("1    PotMod ", FAST_8_SEA + "1 PotMod ")],
        "MAP": [("400 0 depth", "400 0 -150")],
    },
    "regular waves": {"SeaState": [("2     WaveMod", "1     WaveMod")]},
    "ServoDyn's law": {"ServoDyn": [("5     VSContrl", "1     VSContrl")]},
    "legacy controller": {"ServoDyn": [('"libdiscon.so"', '"DISCON_OC3Hywind.dll"')],
                          "ElastoDyn": [("90     GBRatio", "97     GBRatio")]},
    "two blades": {"ElastoDyn": [("3      NumBl", "2      NumBl")]},
    "uniform wind": {"InflowWind": [("1     WindType", '2 WindType\n"uniform.wnd" Filename_Uni')]},
    "other options of ROSCO": {"DISCON": [
        ("0         ! PA_Mode", "2 ! PA_Mode\n1.5 ! PA_CornerFreq\n0.7 ! PA_Damping"),
        ("8.8 11.0  ! IPC_Vramp", '"Cp.txt" ! PerfFileName\n50 ! WE_BladeRadius'),
        ("3.0 12.0 24.0 ! WE_FOPoles_v", "4.0 12.0 23.0 ! PS_WindSpeeds"),
    ]},
}  # fmt: skip
BESIDE = {  # further files that these name
    "uniform.wnd": "! a uniform wind\n0 12 0 0 0 0.2 0 0\n100 12 0 0 0 0.2 0 0\n",
    "Cp.txt": ROTOR_TABLE,
}
WITHOUT_EFFECT = set()  # (file, key) that are read for no more than a check, each with its reason beside it


class Key(NamedTuple):
    """A key of a file, or a column of a table of it."""

    file: str
    key: str
    method: str  # of PartFile, by which it is read
    also: tuple = ()  # other names
    default: object = None
    lines: tuple = ()  # of a column: the rows in which it is read
    column: int = -1


METHODS = ("number", "whole", "one_of", "flag", "text", "matrix", "vector", "table", "other", "find")


class Recorder:
    """What an import asks the part files for."""

    def __init__(self, monkeypatch):
        self.keys, self.depth, self.cells = {}, 0, {}
        for method in (*METHODS, "has", "headed", "rows_below"):
            monkeypatch.setattr(PartFile, method, self.wrapped(method, getattr(PartFile, method)))
        cells = PartFile._cells

        def recorded(file, number, words, columns, texts, key):
            found = cells(file, number, words, columns, texts, key)
            return _Cells(found, lambda name: self.column(file, key, number, name, columns.index(name)))

        monkeypatch.setattr(PartFile, "_cells", recorded)

    def wrapped(self, method, original):
        """The method, noting the key when the importer calls it, not another method."""

        @functools.wraps(original)
        def wrapper(file, key, *more, **named):
            if self.depth == 0 and method in METHODS and isinstance(key, str):
                names = more if method not in ("one_of", "matrix", "vector") else more[1:]
                name = next((name for name in (key, *names) if name.lower() in file.places), key)
                asked = Key(file.path.name, name, method, (key, *names), named.get("default"))
                self.keys.setdefault((file.path.name, name.lower()), asked)
            self.depth += 1
            try:
                return original(file, key, *more, **named)
            finally:
                self.depth -= 1

        return wrapper

    def column(self, file, key, line, name, place):
        """Note that a cell is read."""
        lines = self.cells.setdefault((file.path.name, f"{key}: {name}", place), [])
        if line not in lines:
            lines.append(line)

    def found(self):
        """All keys and columns."""
        columns = [Key(file, key, "column", lines=tuple(lines), column=place)
                   for (file, key, place), lines in self.cells.items()]  # fmt: skip
        return [*self.keys.values(), *columns]


class _Cells(dict):
    """Row of a table that tells what is read of it."""

    def __init__(self, cells, note):
        super().__init__(cells)
        self.note = note

    def __getitem__(self, name):
        self.note(name)
        return super().__getitem__(name)

    def get(self, name, default=None):
        if name in self:
            self.note(name)
        return super().get(name, default)


def written(folder):
    """{file: its values} of an import, without comments; the controller's file goes along as it is."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".toml":
            found[name] = tomllib.loads(path.read_text())
        elif path.suffix == ".csv":
            found[name] = [line for line in path.read_text().splitlines() if not line.startswith("#")]
        elif path.suffix == ".npz":
            with np.load(path) as arrays:
                found[name] = {key: arrays[key].tobytes() for key in arrays.files}
        elif path.suffix == ".md":
            found[name] = path.read_text()
    return found


def import_of(path):
    """Values that the import of a deck writes, or the text of its refusal."""
    try:
        import_deck(path, path.parent / "out", name="x", replace_files=True)
    except InputError as error:
        return str(error)
    return written(path.parent / "out")


def others(word, method, default):
    """Other words for a value of a key; word: that of the deck, or None."""
    text = (word or "").strip('"')
    if method == "flag":
        truth = default if word is None or text.lower() == "default" else text.lower() in ("true", "1")
        return [str(not truth)]
    if word is not None and number_of(text) is None and text.lower() != "default":
        return ['"nowhere"', "False"] if text.lower() in ("true", "false") else ['"nowhere"']
    if word is None and method in ("text", "other"):
        return ['"nowhere"']
    value = number_of(text)
    if method in ("number", "numbers", "matrix", "vector", "column") and value is not None:
        steps = [f"{value * 1.03 + 0.001 * (value == 0.0):.12g}", f"{value + 1:g}", f"{value - 1:g}"]
        return steps[::-1] if method == "column" and value == int(value) < 10 else steps
    if method == "number":
        return ["0.93", "3.3", "130"]
    return [str(number) for number in (1, 0, 2, 3) if number != value]


def renamed(folder, key):
    """(file, its lines) with each other name of a key in place of the one that the deck has."""
    path = next(path for path in folder.iterdir() if path.name == key.file)
    found = PartFile(path, "").find(key.key)
    for other in key.also if found else ():
        if other.lower() != key.key.lower():
            lines = path.read_text().splitlines()
            yield path, [*lines[: found[0]], " ".join([*found[1], other]), *lines[found[0] + 1 :]]


def changes(folder, key):
    """(file, its lines) of each way to change a key, or a column in one of its rows."""
    path = next(path for path in folder.iterdir() if path.name == key.file)
    lines = path.read_text().splitlines()
    if key.column >= 0:
        for line in key.lines:
            words = words_of(lines[line])
            for word in others(words[key.column], key.method, None):
                changed = " ".join([*words[: key.column], word, *words[key.column + 1 :]])
                yield path, [*lines[:line], changed, *lines[line + 1 :]]
        return
    found = PartFile(path, "").find(key.key)
    if found is None:
        for word in others(None, key.method, key.default):
            yield path, [lines[0], f"{word} {key.key}", *lines[1:]]
        return
    line, values = found
    for place in range(min(len(values), 6)):
        for word in others(values[place], key.method, key.default):
            changed = " ".join([*values[:place], word, *values[place + 1 :], key.key])
            yield path, [*lines[:line], changed, *lines[line + 1 :]]


def deck_of(kind, folder):
    """Path of a deck of one of the kinds."""
    for name, text in BESIDE.items():
        (folder / name).write_text(text)
    return write_deck(folder, **KINDS[kind])


def import_with(path, lines, deck):
    """import_of a deck whose part file has these lines for once."""
    whole = path.read_bytes()
    path.write_text("\n".join(lines) + "\n")
    found = import_of(deck)
    path.write_bytes(whole)
    return found


def moves(key, plain, deck):
    """Whether a change to a key moves what the import writes, or is refused for more than its own range."""
    limits = re.compile(rf"{re.escape(key.key)} = \S+: must be a (whole )?number")
    return any(
        found != plain and not (isinstance(found, str) and limits.search(found))
        for found in (import_with(*way, deck) for way in changes(deck.parent, key))
    )


def keys_read(tmp_path_factory):
    """Yield (key, what its deck gives, deck) of all keys in decks of all kinds."""
    for kind in KINDS:
        deck = deck_of(kind, tmp_path_factory.mktemp(kind.replace(" ", "_")))
        with pytest.MonkeyPatch.context() as monkeypatch:
            recorder = Recorder(monkeypatch)
            plain = import_of(deck)
        assert isinstance(plain, dict), plain
        for key in recorder.found():
            yield key, plain, deck


@pytest.mark.nightly
def test_every_key_that_is_read_moves_what_is_written_or_is_refused(tmp_path_factory):
    moved, still = set(), set()
    for key, plain, deck in keys_read(tmp_path_factory):
        name = key.file, key.key
        if name not in moved:
            (moved if moves(key, plain, deck) else still).add(name)
    assert still - moved == WITHOUT_EFFECT
    assert len(moved) > 200


@pytest.mark.nightly
def test_the_other_names_of_a_key_mean_the_same(tmp_path_factory):
    unlike, ways = set(), 0
    for key, plain, deck in keys_read(tmp_path_factory):
        for way in renamed(deck.parent, key):
            ways += 1
            if import_with(*way, deck) != plain:
                unlike.add((key.file, key.key))
    assert ways and not unlike
