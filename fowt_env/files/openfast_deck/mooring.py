"""Mooring lines of MAP++'s and MoorDyn's files: from anchors to the vessel, without points between."""

import math
import re
from dataclasses import dataclass, replace

from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, number_of, same_key, words_of

MOST_LINES = 1000
ANCHORS = ("fix", "fixed", "anchor", "fixedpoint")
FAIRLEADS = ("vessel", "coupled", "cpldpin", "turbine1", "t1", "cpld")
_SECTION = "---"


@dataclass(frozen=True)
class MooringLine:
    """One line; anchor and fairlead in m, wet weight in N/m, EA in N."""

    anchor: tuple
    fairlead: tuple
    length: float
    wet_weight: float
    EA: float
    seabed_friction: float
    kind: str


def read_map(path, depth, density, gravity):
    """(PartFile, lines, notes) of a MAP++ file. Raises: InputError."""
    file = PartFile(path, "MAP++")
    types, nodes, rows, angles, notes = {}, {}, [], [], []
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
            raise file.refusal(
                f"{text.strip()[:40]!r}: MAP++ has no comments in this table, where OpenFAST takes it for a"
                " row: must be removed",
                number,
            )
        if head in ("linetype", "node", "line", "option"):
            continue
        if "dictionary" in section:
            figures = [number_of(word) for word in words[1:5]]
            if len(figures) < 4 or None in figures:
                raise file.refusal("must be LineType, Diam, MassDenInAir, EA, CB", number, "line type")
            diameter, mass, stiffness, friction = figures
            wet = _wet_weight(file, number, words[0], mass, diameter, density, gravity)
            name = file.new(number, types, words[0].lower(), "line type")
            types[name] = (wet, _positive(file, number, "EA", stiffness), max(friction, 0.0))
        elif "node" in section:
            name = file.new(number, nodes, bare(words[0]).lower(), "node")
            nodes[name] = (number, *_node(file, number, words, depth))
            if name != str(len(nodes)):
                raise file.refusal(f"node {words[0]}: must be {len(nodes)}: MAP++ counts its rows", number)
            if nodes[name][1] in FAIRLEADS:
                _check_fairlead(file, number, words, 5, ("M", "B", "FX", "FY", "FZ"))
        elif "line prop" in section:
            rows.append((number, words))
        elif "solver" in section and head == "repeat":
            angles += [number_of(word) for word in words[1:]]
            if None in angles or len(angles) > 360:
                raise file.refusal("repeat: must be angles in degrees", number)
        elif "solver" in section:
            file.entries[head] = (words[0], number, words[1:] or ["True"])
    lines = _lines(file, rows, types, nodes, ("Line", "LineType", "UnstrLen", "NodeAnch", "NodeFair"))
    for number, words in rows:
        for i, flag in enumerate(map(str.lower, words[5:]), 6):
            if "linear" in flag:
                notes.append((f"line {words[0]} as a linear spring", "an elastic catenary of the same line"))
            if "omit" in flag:
                notes.append((f"line {words[0]} without contact with the sea bed", "with contact"))
            if number_of(flag) is None:
                value = number_of(words[i]) if i < len(words) else None
                file.columns.setdefault(flag, []).append((number, "True" if value is None else value))
    turned = [_turned(line, angle) for angle in angles for line in lines]
    _check_count(file, lines + turned)
    return file, lines + turned, [*notes, *differences(file)]


def _node(file, number, words, depth):
    """(type, place) of a row of MAP's nodes."""
    if len(words) < 5:
        raise file.refusal("must be Node, Type, X, Y, Z", number, "node")
    kind = words[1].lower()
    place = [number_of(word.lstrip("#")) for word in words[2:4]]
    on_bed = any(mark in words[4].lower() for mark in _ON_BED)
    z = -depth if on_bed else number_of(words[4].lstrip("#"))
    if None in (*place, z) or max(map(abs, (*place, z))) > 1e5:
        raise file.refusal(f"node {words[0]}: its place must be numbers, Z also 'depth'", number)
    return kind, (*place, z)


def _wet_weight(file, number, name, mass, diameter, density, gravity):
    """Weight in water per metre, N/m."""
    if not (0.0 <= diameter <= 100.0 and 0.0 <= mass <= 1e6):
        raise file.refusal(f"line type {name}: diameter and mass per length must be >= 0", number)
    weight = (mass - density * 0.25 * math.pi * diameter**2) * gravity
    if weight <= 0.0:
        raise file.refusal(
            f"line type {name}: weighs {weight:.4g} N/m in water: must be > 0: lines may not float",
            number,
        )
    return weight


def _positive(file, number, key, value):
    if value is None or not 0.0 < value <= 1e15:
        raise file.refusal(f"{key}: must be a number > 0", number)
    return value


def _lines(file, rows, types, points, columns):
    """MooringLines of rows (line from 0, words) with these columns, by the ends and types that they name."""
    lines, size = [], columns.index("UnstrLen")
    places = [i for i, column in enumerate(columns) if column.startswith(("Node", "Attach"))]
    for number, words in rows:
        if len(words) < len(columns):
            raise file.refusal(f"must be {', '.join(columns)}", number, "line")
        if words[1].lower() not in types:
            raise file.refusal(f"line {words[0]}: unknown line type {words[1]!r}", number)
        length = _positive(file, number, "UnstrLen", number_of(words[size]))
        for name in (words[place] for place in places):
            if name.lower() not in points:
                raise file.refusal(
                    f"line {words[0]}: {name!r} is no point here (rods and bodies cannot be represented)",
                    number,
                )
        ends = [points[words[place].lower()] for place in places]
        lines.append(_line(file, number, words[0], ends, length, types[words[1].lower()], words[1]))
    _check_count(file, lines)
    return lines


def _line(file, number, name, ends, length, kind, type_name):
    """MooringLine of its two ends (line, type, place) in either order."""
    kinds = ["anchor" if end[1] in ANCHORS else "fairlead" if end[1] in FAIRLEADS else None for end in ends]
    if None in kinds:
        other = ends[kinds.index(None)]
        raise file.refusal(
            f"line {name}: its end has the type {other[1]!r} (line {other[0] + 1}); must be fixed or"
            " on the vessel: points between lines, bodies and rods cannot be represented",
            number,
        )
    if kinds[0] == kinds[1]:
        raise file.refusal(
            f"line {name}: must go from an anchor to the vessel, both its ends are {kinds[0]}s", number
        )
    anchor, fairlead = ends if kinds[0] == "anchor" else ends[::-1]
    wet, stiffness, friction = kind
    return MooringLine(anchor[2], fairlead[2], length, wet, stiffness, friction, type_name)


def _turned(line, angle):
    """The line turned about the vertical axis."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    ends = ((round(c * x - s * y, 9), round(s * x + c * y, 9), z) for x, y, z in (line.anchor, line.fairlead))
    return replace(line, **dict(zip(("anchor", "fairlead"), ends, strict=True)))


def _check_count(file, lines):
    if not lines:
        raise file.refusal("has no lines")
    if len(lines) > MOST_LINES:
        raise file.refusal(f"has {len(lines)} lines; allowed: at most {MOST_LINES}")


_SECTIONS = (  # a section of MoorDyn, and what its header may have, in the order of MoorDyn's own tests
    ("types", ("line dictionary", "line types")),
    ("rod types", ("rod dictionary", "rod types")),
    ("bodies", ("bodies", "body list", "body properties")),
    ("rods", ("rods", "rod list", "rod properties")),
    ("points", ("points", "connection properties", "node properties", "point properties", "point list")),
    ("lines", ("lines", "line properties", "line list")),
    ("external loads", ("external loads",)),
    ("control", ("control",)),
    ("failure", ("failure",)),
    ("options", ("options",)),
    ("output", ("output",)),
)
_REFUSED = ("bodies", "rods", "external loads", "control", "failure")
_COUNTS = ("ntypes", "nconnects", "nlines", "npoints", "nconns")  # of version 1
VERSION_2 = ("ID", "LineType", "AttachA", "AttachB", "UnstrLen", "NumSegs")
_ON_BED = ("seabed", "ground", "floor", "depth")


def _moordyn_rows(file):
    """Rows (section, line from 0, words) of a MoorDyn file, without the two lines that name columns."""
    section, heads = None, 0
    for number, text in enumerate(file.lines):
        words = words_of(text[:2000])
        if not words:
            continue
        if _SECTION in text:
            lower = text.lower()
            section = next((name for name, marks in _SECTIONS if any(mark in lower for mark in marks)), None)
            heads = 0 if section in ("options", "output") else 2
        elif len(words) > 1 and words[1].lower() in _COUNTS:
            continue
        elif heads:
            heads -= 1
        elif section is not None:
            yield section, number, words


def read_moordyn(path, depth, density, gravity):
    """(PartFile, lines, notes) of a MoorDyn file, version 1 or 2. Raises: InputError."""
    file = PartFile(path, "MoorDyn")
    of = {name: [] for name, _ in _SECTIONS}
    for section, number, words in _moordyn_rows(file):
        if section in _REFUSED:
            raise file.refusal(f"{section} cannot be represented: this section must be empty", number)
        of[section].append((number, words))
    notes = [
        (
            "dynamic lines (MoorDyn): drag, added mass, damping and inertia of the lines",
            "quasi-static catenaries",
        )
    ]
    notes += _moordyn_options(file, of["options"], depth, density, gravity)
    gravity = file.number("g", "gravity", default=gravity, low=0.0, high=100.0, open_low=True)
    density = file.number("rhoW", "rho", default=density, low=0.0, high=1e5)
    types, points = {}, {}
    for number, words in of["types"]:
        name = file.new(number, types, words[0].lower(), "line type")
        types[name] = _moordyn_type(file, number, words, density, gravity)
    for number, words in of["points"]:
        name = file.new(number, points, bare(words[0]).lower(), "point")
        points[name] = (number, *_node(file, number, _without_attachment(words), depth))
        if points[name][1] in FAIRLEADS:
            _check_fairlead(file, number, words, 5, ("M", "V"))
            if len(words) > 9:  # version 1
                _check_fairlead(file, number, words, 7, ("FX", "FY", "FZ"))
            _keep_columns(file, number, words, -2 if len(words) < 12 else 10, ("CdA", "CA"))
    old = any("nodeanch" in text.lower() or "nodefair" in text.lower() for text in file.lines)
    columns = ("Line", "LineType", "UnstrLen", "NumSegs", "NodeAnch", "NodeFair") if old else VERSION_2
    known = set()
    for number, words in of["lines"]:
        known.add(file.new(number, known, words[0].lower(), "line"))
    lines = _lines(file, of["lines"], types, points, columns)
    return file, lines, [*notes, *differences(file)]


def _moordyn_options(file, rows, depth, density, gravity):
    """Rows of the report on the site that MoorDyn has of its own; entries of the file become its options."""
    file.entries = {}
    for number, words in rows:
        if len(words) < 2:
            raise file.refusal("must be a value and the name of an option", number, "option")
        file.entries[same_key(words[1])] = (words[1], number, words[:1])
        file.places[same_key(words[1])] = (number, words[:1])
    found = file.find("WtrDpth", "depth", "WaterDepth")
    if found is not None and re.search("[a-df-z]", bare(found[1][0]).lower()):
        yield f"bathymetry from a file (WtrDpth {bare(found[1][0])[:60]})", f"a flat bed at {depth:g} m"
    elif found is not None:
        own = file.number("WtrDpth", "depth", "WaterDepth", low=0.0, open_low=True)
        if abs(own - depth) > 1e-6 * depth:
            raise file.wrong("WtrDpth", own, f"{depth:g}, the depth of the site", "depth", "WaterDepth")
    for key, also, site in (("g", "gravity", gravity), ("rhoW", "rho", density)):
        own = file.number(key, also, default=site, low=0.0, high=1e5, open_low=True)
        if own != site:
            yield (
                f"{key} {own:g} of MoorDyn and {site:g} of the site",
                f"{own:g} in the weight of the lines in water, {site:g} elsewhere",
            )


def _check_fairlead(file, number, words, place, names):
    """Raises: InputError for a point of the vessel with a mass, a volume or a force of its own."""
    for name, word in zip(names, words[place:], strict=False):
        value = number_of(word)
        if value:
            raise file.refusal(
                f"point {words[0]} on the vessel: {name} = {value:g}: must be 0: give its mass and buoyancy"
                " to the platform",
                number,
            )


def _keep_columns(file, number, words, place, names):
    """Put values of a row into the columns of the file, for the report."""
    for name, word in zip(names, words[place:], strict=False):
        value = number_of(word)
        if value is not None:
            file.columns.setdefault(name.lower(), []).append((number, value))


def _without_attachment(words):
    """The words of a point: some files have "Vessel1" or "Coupled 0 ..." alike."""
    if len(words) < 2 or words[1].lower() in FAIRLEADS:
        return words
    return [words[0], words[1].rstrip("0123456789"), *words[2:]]


def _moordyn_type(file, number, words, density, gravity):
    """(wet weight, EA, friction) of a row of line types."""
    if len(words) < 4:
        raise file.refusal("must be Name, Diam, MassDen, EA", number, "line type")
    stiffness = number_of(words[3])
    if stiffness is None:
        raise file.refusal(
            f"line type {words[0]}: EA = {words[3][:60]}: must be one number, not a curve",
            number,
        )
    diameter, mass = (number_of(word) for word in words[1:3])
    if diameter is None or mass is None:
        raise file.refusal(f"line type {words[0]}: Diam and MassDen must be numbers", number)
    if len(words) > 9:  # version 2
        if number_of(words[5]) is None:
            raise file.refusal(f"line type {words[0]}: EI = {words[5][:60]}: must be a number", number)
        _keep_columns(file, number, words, 5, ("EI",))
        _keep_columns(file, number, words, 10, ("Cl",))
    wet = _wet_weight(file, number, words[0], mass, diameter, density, gravity)
    return wet, _positive(file, number, "EA", stiffness), 0.0


def read_mooring(kind, path, depth, density, gravity):
    """(PartFile, lines, notes) of a mooring file; kind: 1 for MAP++, 3 for MoorDyn, None: by its contents."""
    if kind is None:
        text = "\n".join(PartFile(path, "mooring").lines).lower()
        kind = 1 if "massdeninair" in text or "line dictionary" in text else 3
    reader = {1: read_map, 3: read_moordyn}[kind]
    return reader(path, depth, density, gravity)
