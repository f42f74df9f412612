"""AeroDyn 15's files: blade geometry, polars and the drag of the tower."""

import re
from dataclasses import dataclass

import numpy as np

from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, locate, words_of

MOST_AIRFOILS = 1000
FULL = 180.0  # deg, to which a polar must reach


@dataclass(frozen=True)
class AeroDyn:
    """What the conversion takes of AeroDyn's files."""

    file: PartFile
    blade_file: PartFile
    span: np.ndarray  # (n,) m from the blade root along the pitch axis
    prebend: np.ndarray  # (n,) m, BlCrvAC
    sweep: np.ndarray  # (n,) m, BlSwpAC
    twist: np.ndarray  # (n,) deg
    chord: np.ndarray  # (n,) m
    airfoil: tuple  # (n,) names
    polars: dict  # name: (m, 4) alpha (deg), cl, cd, cm
    tables: dict  # name: (number of the table taken, tables in the file, its Reynolds number in millions)
    air_density: float | None  # None: that of the .fst
    tower: np.ndarray  # (k, 3) height above still water, diameter, drag coefficient
    tower_loads: bool
    notes: tuple  # (what the deck has, what the plant has)


def read_aerodyn(path, folders=(), blades=3):
    """AeroDyn of an AeroDyn 15 file, with the blade file and polars that it names. Raises: InputError."""
    file = PartFile(path, "AeroDyn")
    if not file.has("NumAFfiles"):
        if file.has("StallMod", "NumFoil", "InfModel"):
            raise file.refusal(
                "is of AeroDyn 14 (StallMod, NumFoil): must be of AeroDyn 15, in the .fst or with --aerodyn"
            )
        raise file.refusal("NumAFfiles is missing: must be the number of polar files")
    count = file.whole("NumAFfiles", low=1, high=MOST_AIRFOILS)
    columns = [
        file.whole(f"InCol_{name}", default=default, low=0, high=20)
        for name, default in (("Alfa", 1), ("Cl", 2), ("Cd", 3), ("Cm", 4))
    ]
    moment = file.flag("UseBlCm", default=True)
    mode = file.whole("AFTabMod", default=1)
    blade_file, blade = _blade(file, folders, blades)
    files = _airfoil_files(file, count, folders)
    numbers = [int(row["blafid"]) for row in blade]
    for i, (number, row) in enumerate(zip(numbers, blade, strict=True)):
        if not 1 <= number <= count or number != row["blafid"]:
            raise blade_file.refusal(
                f"BlAFID = {row['blafid']:g} of node {i + 1}: must be from 1 to NumAFfiles = {count}"
            )
    names = _names(files, numbers)
    polars, tables, parts = {}, {}, []
    for number, name in names.items():
        polar = PartFile(files[number - 1], "polar")
        parts.append(polar)
        polars[name], tables[name] = _polar(polar, columns, moment, mode)
    heights = file.table("NumTwrNds", high=10_000)
    tower = np.array([[cells[key] for key in ("twrelev", "twrdiam", "twrcd")] for _, cells in heights
                      if _has(file, cells, ("twrelev", "twrdiam", "twrcd"))]).reshape(-1, 3)  # fmt: skip
    if len(tower) > 1 and (np.diff(tower[:, 0]) < 0.0).any():
        raise file.refusal("TwrElev must increase from row to row", heights[0][0])
    if (tower[:, 1:] < 0.0).any():
        raise file.refusal("TwrDiam and TwrCd must be >= 0", heights[0][0])
    notes = [row for part in (file, blade_file, *parts) for row in differences(part)]
    return AeroDyn(
        file=file,
        blade_file=blade_file,
        span=np.array([row["blspn"] for row in blade]),
        prebend=np.array([row.get("blcrvac", 0.0) for row in blade]),
        sweep=np.array([row.get("blswpac", 0.0) for row in blade]),
        twist=np.array([row["bltwist"] for row in blade]),
        chord=np.array([row["blchord"] for row in blade]),
        airfoil=tuple(names[number] for number in numbers),
        polars=polars,
        tables=tables,
        air_density=file.number("AirDens", default=None, low=0.0, high=1e4),
        tower=tower,
        tower_loads=file.flag("TwrAero", default=True),
        notes=tuple(notes),
    )


def _has(file, cells, names):
    for name in names:
        if name not in cells:
            raise file.refusal(f"the table of the tower has no column {name}")
    return True


def _blade(file, folders, blades):
    """(file, rows) of the blade of a rotor with this number of them."""
    path = file.other("ADBlFile(1)", "ADBlFile", folders=folders)
    if path is None:
        raise file.wrong("ADBlFile(1)", "unused", "the blade file")
    for i in (2, 3):
        other = file.text(f"ADBlFile({i})", default=None)
        if other not in (None, file.text("ADBlFile(1)", "ADBlFile")) and i <= blades:
            raise file.wrong(f"ADBlFile({i})", other, "the file of blade 1: blades are alike")
    blade = PartFile(path, "AeroDyn blade")
    rows = blade.table("NumBlNds", default=0, high=10_000)
    if len(rows) < 2:
        raise blade.refusal("NumBlNds must be at least 2")
    for name in ("blspn", "bltwist", "blchord", "blafid"):
        if name not in rows[0][1]:
            raise blade.refusal(f"the column {name} is missing", rows[0][0] - 1)
    before = -1e-9
    for line, cells in rows:
        if not before < cells["blspn"] <= 1e3:
            raise blade.refusal(f"BlSpn = {cells['blspn']:g}: must increase from 0", line)
        if not 0.0 < cells["blchord"] < 1e3:
            raise blade.refusal(f"BlChord = {cells['blchord']:g}: must be > 0", line)
        if not abs(cells["bltwist"]) <= 180.0:
            raise blade.refusal(f"BlTwist = {cells['bltwist']:g}: must be from -180 to 180 deg", line)
        if not max(abs(cells.get(name, 0.0)) for name in ("blcrvac", "blswpac")) < 1e3:
            raise blade.refusal("BlCrvAC and BlSwpAC must be offsets in m", line)
        before = cells["blspn"]
    return blade, [cells for _, cells in rows]


def _airfoil_files(file, count, folders):
    """Paths of the polar files: AFNames and the lines below it."""
    found = file.find("AFNames")
    if found is None:
        raise file.refusal("AFNames is missing: must name the polar files, one a line")
    paths = []
    for i in range(count):
        line = found[0] + i
        words = words_of(file.lines[line][:2000]) if line < len(file.lines) else []
        name = bare(words[0]) if words else ""
        path = locate(name, (file.path.parent, *folders)) if name else None
        if path is None:
            raise file.refusal(f"AFNames = {name[:200]!r}: no such file", line)
        paths.append(path)
    return paths


def _names(files, numbers):
    """{number of a polar that the blade has: name}, by the files' stems; equal stems get a number."""
    used = sorted(set(numbers))
    # names of files of ours: neither commas nor marks of comments
    stems = [re.sub(r"[^\w.-]", "_", files[number - 1].stem) for number in used]
    return {
        number: stem if stems.count(stem) == 1 else f"{stem}_{number}"
        for number, stem in zip(used, stems, strict=True)
    }


def _polar(file, columns, moment, mode):
    """((m, 4) alpha (deg), cl, cd, cm, (table taken, tables, Reynolds number)) of a polar file."""
    heads = []  # line of NumAlf, Reynolds number
    reynolds = None
    for line, text in enumerate(file.lines):
        words = words_of(text[:400])
        if len(words) >= 2 and words[1].lower() == "re":
            reynolds = words[0]
        if len(words) >= 2 and words[1].lower() == "numalf":
            heads.append((line, words[0], reynolds))
    if not heads:
        raise file.refusal("NumAlf is missing: must be the number of rows of the table of coefficients")
    taken = 0 if mode == 1 else len(heads) // 2
    line, word, reynolds = heads[taken]
    count = bare(word)
    if not count.isdigit() or not 2 <= int(count) <= 10_000:
        raise file.refusal(f"NumAlf = {count[:20]}: must be a whole number from 2 to 10000", line)
    rows = []
    for number in range(line + 1, len(file.lines)):
        text = file.lines[number]
        if not text.strip():
            continue
        words = words_of(text[:2000])
        try:
            values = [float(words[i - 1].replace("D", "e").replace("d", "e")) if i else 0.0 for i in columns]
        except (ValueError, IndexError):
            raise file.refusal(
                f"{text.strip()[:60]!r}: must be numbers in columns {columns}", number
            ) from None
        if not np.isfinite(values).all() or max(map(abs, values)) > 1e4:
            raise file.refusal(f"{text.strip()[:60]!r}: must be finite numbers", number)
        if not moment:
            values[3] = 0.0
        if not rows or values[0] > rows[-1][0]:
            rows.append(values)
        elif values[0] < rows[-1][0]:
            raise file.refusal(f"alpha = {values[0]:g} after {rows[-1][0]:g} deg: must increase", number)
        count = int(count) - 1
        if not count:
            break
    if int(count):
        raise file.refusal(f"{count} rows of NumAlf are missing", line)
    polar = np.array(rows)
    if len(polar) < 2 or abs(polar[0, 0] + FULL) > 0.5 or abs(polar[-1, 0] - FULL) > 0.5:
        raise file.refusal(
            f"alpha covers {polar[0, 0]:g} to {polar[-1, 0]:g} deg: must cover -180 to 180 deg", line
        )
    polar[0, 0], polar[-1, 0] = -FULL, FULL
    return polar, (taken + 1, len(heads), reynolds)
