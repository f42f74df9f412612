"""Reads mooring lines of MAP++ and MoorDyn files: from anchors to the vessel, without intermediate points."""

import math
import re
from typing import NamedTuple

from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, number_of, same_key, words_of

MOST_LINES = 1000
FEWEST_SEGMENTS, MOST_SEGMENTS = 4, 500  # of a moving line here
KINDS_OF_ENDS = dict.fromkeys(("fix", "fixed", "anchor", "fixedpoint"), "anchor")
KINDS_OF_ENDS |= dict.fromkeys(("vessel", "coupled", "cpldpin", "turbine1", "t1", "cpld"), "fairlead")
MAP_LINE = ("Line", "LineType", "UnstrLen", "NodeAnch", "NodeFair")
VERSION_1 = ("Line", "LineType", "UnstrLen", "NumSegs", "NodeAnch", "NodeFair")  # of MoorDyn
VERSION_2 = ("ID", "LineType", "AttachA", "AttachB", "UnstrLen", "NumSegs")
_SECTION = "---"
_SECTIONS = {  # of MoorDyn: words that identify a header, in MoorDyn's order of checks
    "types": ("line dictionary", "line types"),
    "rod types": ("rod dictionary", "rod types"),
    "bodies": ("bodies", "body list", "body properties"),
    "rods": ("rods", "rod list", "rod properties"),
    "points": ("points", "connection properties", "node properties", "point properties", "point list"),
    "lines": ("lines", "line properties", "line list"),
    "external loads": ("external loads",),
    "control": ("control",),
    "failure": ("failure",),
    "options": ("options",),
    "output": ("output",),
}
_REFUSED = ("bodies", "rods", "external loads", "control", "failure")
_COUNTS = ("ntypes", "nconnects", "nlines", "npoints", "nconns")  # of version 1
_ON_BED = ("seabed", "ground", "floor", "depth")
_DYNAMIC = "dynamic lines (MoorDyn): drag, added mass, damping and inertia of the lines"
_HERE = 'quasi-static catenaries; with the option mooring = "dynamic" as in the deck'
_COEFFICIENTS = {  # of MovingLine: columns of the line types of version 1, and of version 2
    "drag_coefficient": (7, 6),
    "axial_drag_coefficient": (8, 8),
    "added_mass_coefficient": (5, 7),
    "axial_added_mass_coefficient": (6, 9),
}


class MooringLine(NamedTuple):
    """Defines a mooring line; anchor and fairlead in m, wet weight in N/m, EA in N."""

    anchor: tuple
    fairlead: tuple
    length: float
    wet_weight: float
    EA: float
    seabed_friction: float
    kind: str
    dynamics: dict | None = None  # of descriptions.platform.MovingLine; None: MAP++ has none


class _Mooring:
    """Collects line types and points of a mooring file to build the lines; sea: (depth, density, gravity)."""

    def __init__(self, file, sea):
        self.file, self.sea = file, sea
        self.types, self.points, self.motions = {}, {}, {}
        self.bed = {}  # stiffness and damping of the sea bed, of MoorDyn

    def add_type(self, number, words, stiffness, friction=0.0, motion=None):
        """Add a line type; the row starts with name, diameter and mass per length.

        motion: (BA, {coefficient of MovingLine: number or None}) of MoorDyn.
        """
        name = self.file.new(number, self.types, words[0].lower(), "line type")
        diameter, mass = (number_of(word) for word in words[1:3])
        if None in (diameter, mass) or not (0.0 <= diameter <= 100.0 and 0.0 <= mass <= 1e6):
            what = f"line type {words[0]}: diameter and mass per length must be numbers >= 0"
            raise self.file.refusal(what, number)
        _, density, gravity = self.sea
        weight = (mass - density * 0.25 * math.pi * diameter**2) * gravity
        if weight <= 0.0:
            what = f"line type {words[0]}: weighs {weight:.4g} N/m in water: must be > 0 (no buoyant lines)"
            raise self.file.refusal(what, number)
        axial = self.positive(number, "EA", stiffness)
        self.types[name] = weight, axial, friction
        if motion is not None and diameter > 0.0:
            self.motions[name] = diameter, mass, axial, *motion

    def add_point(self, number, words, what):
        """Add the point of a row; return (name, whether on the vessel). what: term for messages."""
        name = self.file.new(number, self.points, bare(words[0]).lower(), what)
        if len(words) < 5:
            raise self.file.refusal("must be Node, Type, X, Y, Z", number, "node")
        position = [number_of(word.lstrip("#")) for word in words[2:5]]
        if any(mark in words[4].lower() for mark in _ON_BED):
            position[2] = -self.sea[0]
        if None in position or max(map(abs, position)) > 1e5:
            what = f"node {words[0]}: X, Y, Z must be numbers, Z also 'depth'"
            raise self.file.refusal(what, number)
        self.points[name] = number, words[1].lower(), tuple(position)
        return name, KINDS_OF_ENDS.get(words[1].lower()) == "fairlead"

    def check_fairlead(self, number, words, start, names):
        """Check that a point of the vessel has no mass, volume or force. Raises: InputError."""
        for name, word in zip(names, words[start:], strict=False):
            if value := number_of(word):
                allowed = "must be 0: add mass and buoyancy to the platform"
                what = f"point {words[0]} on the vessel: {name} = {value:g}: {allowed}"
                raise self.file.refusal(what, number)

    def positive(self, number, key, word):
        """Return the number > 0 of a word in a line. Raises: InputError."""
        value = number_of(word)
        if value is None or not 0.0 < value <= 1e15:
            raise self.file.refusal(f"{key}: must be a number > 0", number)
        return value

    def lines(self, rows, columns):
        """Return the MooringLines of rows (line from 0, words) with these columns."""
        lines = []
        for number, words in rows:
            if len(words) < len(columns):
                raise self.file.refusal(f"must be {', '.join(columns)}", number, "line")
            row = dict(zip(columns, words, strict=False))
            kind = row["LineType"]
            if kind.lower() not in self.types:
                raise self.file.refusal(f"line {words[0]}: unknown line type {kind!r}", number)
            length = self.positive(number, "UnstrLen", row["UnstrLen"])
            names = [row[key] for key in columns if key.startswith(("Node", "Attach"))]
            ends = self.ends(number, names, words[0])
            motion = self.motion(kind.lower(), length, row.get("NumSegs"))
            lines.append(MooringLine(*ends, length, *self.types[kind.lower()], kind, motion))
        return lines

    def motion(self, kind, length, segments):
        """Return the values of MovingLine of a line of this type; None without. BA < 0 is a damping ratio."""
        if kind not in self.motions:
            return None
        diameter, mass, axial, damping, coefficients = self.motions[kind]
        count = number_of(segments or "")
        count = 20 if count is None else int(min(max(count, FEWEST_SEGMENTS), MOST_SEGMENTS))
        ratio = None if damping is None else -damping
        if ratio is not None and ratio < 0.0:
            ratio = damping * count / length / math.sqrt(axial * mass)
        values = {"segments": count, "diameter": diameter, **coefficients, "damping_ratio": ratio, **self.bed}
        return {key: value for key, value in values.items() if value is not None}

    def ends(self, number, names, line):
        """Return the positions (anchor, fairlead) of a line, whose points may be in either order."""
        positions = {}
        for name in names:
            if name.lower() not in self.points:
                what = f"line {line}: {name!r} is not a point (rods and bodies cannot be represented)"
                raise self.file.refusal(what, number)
            row, kind, position = self.points[name.lower()]
            if kind not in KINDS_OF_ENDS:
                raise self.file.refusal(
                    f"line {line}: end of type {kind!r} (line {row + 1}): must be fixed or"
                    " on the vessel: points between lines, bodies and rods cannot be represented",
                    number,
                )
            positions[KINDS_OF_ENDS[kind]] = position
        if len(positions) < 2:
            fault = f"both ends are {next(iter(positions))}s"
            raise self.file.refusal(f"line {line}: must go from an anchor to the vessel, {fault}", number)
        return positions["anchor"], positions["fairlead"]


def read_mooring(kind, path, depth, density, gravity):
    """Return (lines, notes) of a mooring file; kind: 1 for MAP++, 3 for MoorDyn, None: from its contents.

    Raises: InputError.
    """
    if kind is None:
        text = "\n".join(PartFile(path, "mooring").lines).lower()
        kind = 1 if "massdeninair" in text or "line dictionary" in text else 3
    file = PartFile(path, "MAP++" if kind == 1 else "MoorDyn")
    reader = _map_lines if kind == 1 else _moordyn_lines
    lines, notes = reader(file, (depth, density, gravity))
    if not 0 < len(lines) <= MOST_LINES:
        raise file.refusal(f"has {len(lines)} lines; allowed: 1 to {MOST_LINES}")
    for line in lines:
        if not -depth * (1.0 + 1e-3) - 0.1 <= line.anchor[2] <= 0.0:
            allowed = f"must be from -{depth:g} m (WtrDpth) to 0"
            raise file.refusal(f"an anchor at z = {line.anchor[2]:g} m: {allowed}")
    return lines, [*notes, *differences(file)]


def _map_lines(file, sea):
    """Return (lines, notes) of a MAP++ file."""
    mooring, rows, angles, notes = _Mooring(file, sea), [], [], []
    file.entries, section = {}, ""
    for number, text in enumerate(file.lines):
        words = words_of(text[:2000])
        if not words or words[0].startswith("("):
            continue
        if words[0].startswith(_SECTION) or (len(words) > 1 and set(words[0]) == {"-"}):
            section = text.lower()
            continue
        head = words[0].lower()
        if words[0].startswith(("!", "#")):
            if "solver" in section or not section:
                continue
            why = "MAP++ has no comments in this table (OpenFAST reads a row): must be removed"
            raise file.refusal(f"{text.strip()[:40]!r}: {why}", number)
        if head in ("linetype", "node", "line", "option"):
            continue
        if "dictionary" in section:
            friction = number_of(words[4]) if len(words) > 4 else None
            if friction is None:
                raise file.refusal("must be LineType, Diam, MassDenInAir, EA, CB", number, "line type")
            mooring.add_type(number, words, words[3], max(friction, 0.0))
        elif "node" in section:
            name, on_vessel = mooring.add_point(number, words, "node")
            if name != str(len(mooring.points)):
                what = f"node {words[0]}: must be {len(mooring.points)}: MAP++ numbers nodes by row"
                raise file.refusal(what, number)
            if on_vessel:
                mooring.check_fairlead(number, words, 5, ("M", "B", "FX", "FY", "FZ"))
        elif "line prop" in section:
            rows.append((number, words))
        elif "solver" in section and head == "repeat":
            angles += [number_of(word) for word in words[1:]]
            if None in angles or len(angles) > 360:
                raise file.refusal("repeat: must be angles in degrees", number)
        elif "solver" in section:
            file.entries[head] = (words[0], number, words[1:] or ["True"])
    lines = mooring.lines(rows, MAP_LINE)
    for number, words in rows:
        for i, flag in enumerate(map(str.lower, words[5:]), 6):
            if "linear" in flag:
                notes.append((f"line {words[0]} as a linear spring", "an elastic catenary of the same line"))
            if "omit" in flag:
                notes.append((f"line {words[0]} without contact with the sea bed", "with contact"))
            if number_of(flag) is None:
                value = number_of(words[i]) if i < len(words) else None
                file.columns.setdefault(flag, []).append((number, "True" if value is None else value))
    return [*lines, *(_turned(line, -math.radians(angle)) for angle in angles for line in lines)], notes


def _turned(line, angle):
    """Return the line rotated about the vertical axis by an angle in rad (MAP++ repeats clockwise)."""
    c, s = math.cos(angle), math.sin(angle)
    ends = ((round(c * x - s * y, 9), round(s * x + c * y, 9), z) for x, y, z in (line.anchor, line.fairlead))
    return line._replace(**dict(zip(("anchor", "fairlead"), ends, strict=True)))


def _moordyn_rows(file):
    """Yield rows (section, line from 0, words) of a MoorDyn file, without the two header lines of a table."""
    section, heads = None, 0
    for number, text in enumerate(file.lines):
        words = words_of(text[:2000])
        if not words:
            continue
        if _SECTION in text:
            lower = text.lower()
            matches = (name for name, marks in _SECTIONS.items() if any(mark in lower for mark in marks))
            section = next(matches, None)
            heads = 0 if section in ("options", "output") else 2
        elif len(words) > 1 and words[1].lower() in _COUNTS:
            continue
        elif heads:
            heads -= 1
        elif section is not None:
            yield section, number, words


def _moordyn_lines(file, sea):
    """Return (lines, notes) of a MoorDyn file, version 1 or 2."""
    of = {name: [] for name in _SECTIONS}
    for section, number, words in _moordyn_rows(file):
        if section in _REFUSED:
            raise file.refusal(f"{section} cannot be represented: this section must be empty", number)
        of[section].append((number, words))
    notes = [(_DYNAMIC, _HERE), *_moordyn_options(file, of["options"], *sea)]
    depth, density, gravity = sea
    gravity = file.positive("g", "gravity", default=gravity, high=100.0)
    mooring = _Mooring(file, (depth, file.number("rhoW", "rho", default=density, low=0.0, high=1e5), gravity))

    def keep(number, words, start, names):
        """Store values of a row in the columns of the file, for the report."""
        for name, word in zip(names, words[start:], strict=False):
            if (value := number_of(word)) is not None:
                file.columns.setdefault(name.lower(), []).append((number, value))

    for number, words in of["types"]:
        if len(words) < 4:
            raise file.refusal("must be Name, Diam, MassDen, EA", number, "line type")
        for i, key in ((3, "EA"), *([(5, "EI")] if len(words) > 9 else ())):  # EI: version 2
            if number_of(words[i]) is None:
                what = f"line type {words[0]}: {key} = {words[i][:60]}: must be a number, not a curve"
                raise file.refusal(what, number)
        if len(words) > 9:
            keep(number, words, 5, ("EI",))
            keep(number, words, 10, ("Cl",))
        version = 1 if len(words) > 9 else 0
        coefficients = {
            name: number_of(words[columns[version]]) if len(words) > columns[version] else None
            for name, columns in _COEFFICIENTS.items()
        }
        damping = number_of(words[4]) if len(words) > 4 else None
        known = all(value is None or value >= 0.0 for value in coefficients.values())
        known = known and coefficients["drag_coefficient"] is not None
        mooring.add_type(number, words, words[3], motion=(damping, coefficients) if known else None)
    for key, names in (("seabed_stiffness", ("kBot", "kB")), ("seabed_damping", ("cBot", "cB"))):
        if file.has(*names):
            mooring.bed[key] = file.number(*names, low=0.0, high=1e12)
    for number, words in of["points"]:
        if len(words) > 1 and words[1].lower() not in KINDS_OF_ENDS:  # some files have "Vessel1"
            words[1] = words[1].rstrip("0123456789")
        if mooring.add_point(number, words, "point")[1]:
            mooring.check_fairlead(number, words, 5, ("M", "V"))
            if len(words) > 9:  # version 1
                mooring.check_fairlead(number, words, 7, ("FX", "FY", "FZ"))
            keep(number, words, -2 if len(words) < 12 else 10, ("CdA", "CA"))
    old = any("nodeanch" in text.lower() or "nodefair" in text.lower() for text in file.lines)
    names = set()
    for number, words in of["lines"]:
        names.add(file.new(number, names, words[0].lower(), "line"))
    return mooring.lines(of["lines"], VERSION_1 if old else VERSION_2), notes


def _moordyn_options(file, rows, depth, density, gravity):
    """Yield report rows on MoorDyn's separate site data; set the file's entries to MoorDyn's options."""
    file.entries = {}
    for number, words in rows:
        if len(words) < 2:
            raise file.refusal("must be a value and the name of an option", number, "option")
        file.entries[same_key(words[1])] = (words[1], number, words[:1])
        file.places[same_key(words[1])] = (number, words[:1])
    names = ("WtrDpth", "depth", "WaterDepth")
    word = bare(file.find(*names)[1][0]) if file.has(*names) else ""
    if re.search("[a-df-z]", word.lower()):
        yield f"bathymetry from a file (WtrDpth {word[:60]})", f"a flat bed at {depth:g} m"
    elif word:
        value = file.positive(*names)
        if abs(value - depth) > 1e-6 * depth:
            raise file.wrong("WtrDpth", value, f"{depth:g}, the depth of the site", *names[1:])
    for key, also, site in (("g", "gravity", gravity), ("rhoW", "rho", density)):
        value = file.positive(key, also, default=site, high=1e5)
        if value != site:
            here = f"{value:g} in the weight of the lines in water, {site:g} elsewhere"
            yield f"{key} {value:g} of MoorDyn and {site:g} of the site", here
