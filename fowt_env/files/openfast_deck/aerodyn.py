"""Reads AeroDyn 15 files: blade geometry, polars and tower drag."""

import re
from itertools import islice
from typing import NamedTuple

import numpy as np

from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, locate, number_of, truth_of, words_of
from fowt_env.plant.aero.tower_influence import POTENTIAL, SHADOW

MOST_AIRFOILS = 1000
FULL = 180.0  # deg, required range of a polar


class AeroDyn(NamedTuple):
    """Holds the data of AeroDyn's files that the conversion uses."""

    file: PartFile
    blade_file: PartFile
    blade: np.ndarray  # (n, 5) m from the root along the pitch axis, chord, twist (deg), BlCrvAC, BlSwpAC
    airfoil: list  # (n,) names
    polars: dict  # name: (m, 4) alpha (deg), cl, cd, cm
    tables: dict  # name: (number of the table used, tables in the file, Reynolds number in millions)
    tower: np.ndarray  # (k, 4) height above still water, diameter, drag coefficient, turbulence intensity
    tower_loads: bool
    tower_influence: dict  # scene options {tower_potential, tower_shadow} of the models in use
    notes: list  # (feature of the deck, treatment in the plant)


def read_aerodyn(path, folders=(), blades=3):
    """Read an AeroDyn 15 file with the blade file and polars named there. Raises: InputError."""
    file = PartFile(path, "AeroDyn")
    if not file.has("NumAFfiles"):
        if file.has("StallMod", "NumFoil", "InfModel"):
            allowed = "must be of AeroDyn 15, in the .fst or with --aerodyn"
            raise file.refusal(f"is of AeroDyn 14 (StallMod, NumFoil): {allowed}")
        raise file.refusal("NumAFfiles is missing: must be the number of polar files")
    count = file.whole("NumAFfiles", low=1, high=MOST_AIRFOILS)
    columns = [
        file.whole(f"InCol_{name}", default=default, low=0, high=20)
        for default, name in enumerate(("Alfa", "Cl", "Cd", "Cm"), 1)
    ]
    moment = file.flag("UseBlCm", default=True)
    mode = file.whole("AFTabMod", default=1)
    blade_file = PartFile(file.blade("ADBlFile", blades, folders), "AeroDyn blade")
    blade, numbers = _blade(blade_file, count)
    names = _names(_airfoil_files(file, count, folders), numbers)
    polars, tables, parts = {}, {}, [file, blade_file]
    for name, polar_path in names.values():
        parts.append(PartFile(polar_path, "polar"))
        polars[name], tables[name] = _polar(parts[-1], columns, moment, mode)
    heights = file.table("NumTwrNds", needs=("TwrElev", "TwrDiam", "TwrCd"), high=10_000)
    names_of = ("twrelev", "twrdiam", "twrcd", "twrti")
    tower = np.array([[cells.get(key, 0.0) for key in names_of] for _, cells in heights]).reshape(-1, 4)
    if len(tower) > 1 and (np.diff(tower[:, 0]) < 0.0).any():
        raise file.refusal("TwrElev must increase from row to row", heights[0][0])
    if (tower[:, 1:3] < 0.0).any():
        raise file.refusal("TwrDiam and TwrCd must be >= 0", heights[0][0])
    airfoil, tower_loads = [names[number][0] for number in numbers], file.flag("TwrAero", default=True)
    notes = [row for part in parts for row in differences(part)]
    influence = _tower_influence(file)
    return AeroDyn(file, blade_file, blade, airfoil, polars, tables, tower, tower_loads, influence, notes)


def _tower_influence(file):
    """Return {option: value} of the models of TwrPotent and TwrShadow in use; TwrShadow may be a flag."""
    numbers = {"tower_potential": file.whole("TwrPotent", default=0, low=0, high=2)}
    word = file.text("TwrShadow", default="0")
    numbers["tower_shadow"] = (
        int(file.flag("TwrShadow")) if truth_of(word) is not None
        else file.whole("TwrShadow", default=0, low=0, high=2)
    )  # fmt: skip
    models = {"tower_potential": POTENTIAL, "tower_shadow": SHADOW}
    return {option: models[option][number] for option, number in numbers.items() if number}


def _blade(file, count):
    """Return ((n, 5) values as AeroDyn.blade, (n,) polar numbers from 1 to count) of a blade file."""
    rows = file.table("NumBlNds", needs=("BlSpn", "BlTwist", "BlChord", "BlAFID"), high=10_000)
    if len(rows) < 2:
        raise file.refusal("NumBlNds must be at least 2")
    before = -1e-9
    for line, cells in rows:
        offsets = [cells.get(name, 0.0) for name in ("blcrvac", "blswpac")]
        for good, what in (
            (before < cells["blspn"] <= 1e3, f"BlSpn = {cells['blspn']:g}: must increase from 0"),
            (0.0 < cells["blchord"] < 1e3, f"BlChord = {cells['blchord']:g}: must be > 0"),
            (abs(cells["bltwist"]) <= 180.0, f"BlTwist = {cells['bltwist']:g}: must be from -180 to 180 deg"),
            (max(map(abs, offsets)) < 1e3, "BlCrvAC and BlSwpAC must be offsets in m"),
            (cells["blafid"] in range(1, count + 1),
             f"BlAFID = {cells['blafid']:g}: must be from 1 to NumAFfiles = {count}"),
        ):  # fmt: skip
            if not good:
                raise file.refusal(what, line)
        before = cells["blspn"]
    names = ("blspn", "blchord", "bltwist", "blcrvac", "blswpac")
    values = np.array([[cells.get(name, 0.0) for name in names] for _, cells in rows])
    return values, [int(cells["blafid"]) for _, cells in rows]


def _airfoil_files(file, count, folders):
    """Return the paths of the polar files, from AFNames and the lines below."""
    entry = file.find("AFNames")
    if entry is None:
        raise file.refusal("AFNames is missing: must name the polar files, one a line")
    paths = []
    for line in range(entry[0], entry[0] + count):
        words = file.words(line) if line < len(file.lines) else []
        name = bare(words[0]) if words else ""
        path = locate(name, (file.path.parent, *folders)) if name else None
        if path is None:
            raise file.refusal(f"AFNames = {name[:200]!r}: no such file", line)
        paths.append(path)
    return paths


def _names(files, numbers):
    """Return {number of a used polar: (name, path)}, named by file stem; equal stems get a number."""
    used = sorted(set(numbers))
    # file names of this project must not contain commas or comment characters
    stems = [re.sub(r"[^\w.-]", "_", files[number - 1].stem) for number in used]
    return {
        number: (stem if stems.count(stem) == 1 else f"{stem}_{number}", files[number - 1])
        for number, stem in zip(used, stems, strict=True)
    }


def _polar(file, columns, moment, mode):
    """Return ((m, 4) alpha (deg), cl, cd, cm; (table used, tables, Reynolds number)) of a polar file."""
    heads, reynolds = [], None  # of each table: (line of NumAlf, value, Reynolds number)
    for line, text in enumerate(file.lines):
        words = words_of(text[:400])
        key = words[1].lower() if len(words) >= 2 else ""
        if key == "re":
            reynolds = words[0]
        if key == "numalf":
            heads.append((line, bare(words[0]), reynolds))
    if not heads:
        raise file.refusal("NumAlf is missing: must be the number of rows of the table of coefficients")
    chosen = 0 if mode == 1 else len(heads) // 2
    line, count, reynolds = heads[chosen]
    if not count.isdigit() or not 2 <= int(count) <= 10_000:
        raise file.refusal(f"NumAlf = {count[:20]}: must be a whole number from 2 to 10000", line)
    rows, filled = [], (number for number in range(line + 1, len(file.lines)) if file.lines[number].strip())
    below = list(islice(filled, int(count)))
    for number in below:
        text = file.lines[number].strip()[:60]
        words = ["0", *file.words(number)]  # column 0: absent, zero
        values = [number_of(words[i]) if i < len(words) else None for i in columns]
        if None in values or max(map(abs, values)) > 1e4:
            raise file.refusal(f"{text!r}: must be finite numbers in columns {columns}", number)
        if not moment:
            values[3] = 0.0
        if rows and values[0] < rows[-1][0]:
            raise file.refusal(f"alpha = {values[0]:g} after {rows[-1][0]:g} deg: must increase", number)
        if not rows or values[0] > rows[-1][0]:
            rows.append(values)
    if len(below) < int(count):
        raise file.refusal(f"{int(count) - len(below)} rows of NumAlf are missing", line)
    polar = np.array(rows)
    if len(polar) < 2 or np.abs(polar[[0, -1], 0] - (-FULL, FULL)).max() > 0.5:
        covered = f"alpha covers {polar[0, 0]:g} to {polar[-1, 0]:g} deg"
        raise file.refusal(f"{covered}: must cover -180 to 180 deg", line)
    polar[[0, -1], 0] = -FULL, FULL
    return polar, (chosen + 1, len(heads), reynolds)
