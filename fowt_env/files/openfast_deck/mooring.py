"""Mooring lines of MAP++'s and MoorDyn's files: from anchors to the vessel, without points between."""

import math
from dataclasses import dataclass

from fowt_env.files.openfast_deck.parser import PartFile, bare, number_of, words_of

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
    section = ""
    for number, text in enumerate(file.lines):
        words = words_of(text[:2000])
        if not words or words[0].startswith(("!", "#", "(")):
            continue
        if words[0].startswith(_SECTION) or (len(words) > 1 and set(words[0]) == {"-"}):
            section = text.lower()
            continue
        head = words[0].lower()
        if head in ("linetype", "node", "line", "option"):
            continue
        if "dictionary" in section:
            figures = [number_of(word) for word in words[1:5]]
            if len(figures) < 4 or None in figures:
                raise file.refusal("must be LineType, Diam, MassDenInAir, EA, CB", number, "line type")
            diameter, mass, stiffness, friction = figures
            wet = _wet_weight(file, number, words[0], mass, diameter, density, gravity)
            types[head] = (wet, _positive(file, number, "EA", stiffness), max(friction, 0.0))
        elif "node" in section:
            nodes[bare(words[0])] = (number, *_node(file, number, words, depth))
        elif "line prop" in section:
            rows.append((number, words))
        elif "solver" in section and head == "repeat":
            angles += [number_of(word) for word in words[1:]]
            if None in angles or len(angles) > 360:
                raise file.refusal("repeat: must be angles in degrees", number)
    lines = []
    for number, words in rows[:MOST_LINES]:
        if len(words) < 5:
            raise file.refusal("must be Line, LineType, UnstrLen, NodeAnch, NodeFair", number, "line")
        if words[1].lower() not in types:
            raise file.refusal(f"line {words[0]}: unknown line type {words[1]!r}", number)
        length = _positive(file, number, "UnstrLen", number_of(words[2]))
        ends = []
        for name in words[3:5]:
            if name not in nodes:
                raise file.refusal(f"line {words[0]}: node {name!r} is not there", number)
            ends.append(nodes[name])
        for flag in (word.lower() for word in words[5:]):
            if "linear" in flag:
                notes.append((f"line {words[0]} as a linear spring", "an elastic catenary of the same line"))
            if "omit" in flag:
                notes.append((f"line {words[0]} without contact with the sea bed", "with contact"))
        lines.append(_line(file, number, words[0], ends, length, types[words[1].lower()], words[1]))
    _check_count(file, lines)
    turned = [_turned(line, angle) for angle in angles for line in lines]
    _check_count(file, lines + turned)
    return file, lines + turned, notes


def _node(file, number, words, depth):
    """(type, place) of a row of MAP's nodes."""
    if len(words) < 5:
        raise file.refusal("must be Node, Type, X, Y, Z", number, "node")
    kind = words[1].lower()
    place = [number_of(word.lstrip("#")) for word in words[2:4]]
    z = -depth if words[4].lower() == "depth" else number_of(words[4].lstrip("#"))
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

    def turn(place):
        x, y, z = place
        return (round(c * x - s * y, 9), round(s * x + c * y, 9), z)

    return MooringLine(
        turn(line.anchor), turn(line.fairlead), line.length, line.wet_weight, line.EA, line.seabed_friction,
        line.kind,
    )  # fmt: skip


def _check_count(file, lines):
    if not lines:
        raise file.refusal("has no lines")
    if len(lines) > MOST_LINES:
        raise file.refusal(f"has {len(lines)} lines; allowed: at most {MOST_LINES}")


def read_moordyn(path, depth, density, gravity):
    """(PartFile, lines, notes) of a MoorDyn file, version 1 or 2. Raises: InputError."""
    file = PartFile(path, "MoorDyn")
    types, points, rows = {}, {}, []
    section = ""
    for number, text in enumerate(file.lines):
        words = words_of(text[:2000])
        if not words or words[0].startswith("("):
            continue
        if words[0].startswith(_SECTION):
            section = text.lower()
            continue
        head = words[0].lower()
        if head in (
            "name",
            "linetype",
            "type",
            "node",
            "id",
            "point",
            "line",
            "typename",
            "rodid",
            "bodyid",
            "key",
        ):
            continue
        if len(words) > 1 and words[1].lower() in ("ntypes", "nconnects", "nlines", "npoints", "nconns"):
            continue
        if "line type" in section or "line dict" in section:
            types[head] = _moordyn_type(file, number, words, density, gravity)
        elif any(name in section for name in ("rod", "bodies", "body")) and "output" not in section:
            if "type" not in section and "dict" not in section:
                raise file.refusal(
                    "bodies and rods cannot be represented: this section must be empty", number
                )
        elif "point" in section or "connection" in section or "node" in section:
            points[bare(words[0]).lower()] = (number, *_node(file, number, _without_attachment(words), depth))
        elif "line" in section and "option" not in section and "need" not in section:
            rows.append((number, words))
        elif "failure" in section or "control" in section:
            raise file.refusal("failure and control of lines cannot be represented: must be empty", number)
    old = any("nodeanch" in text.lower() or "nodefair" in text.lower() for text in file.lines)
    lines = []
    for number, words in rows[:MOST_LINES]:
        # version 1: Line LineType UnstrLen NumSegs NodeAnch NodeFair; version 2: ID LineType A B UnstrLen
        places = (2, 4, 5) if old else (4, 2, 3)
        if len(words) < 6:
            raise file.refusal("must be ID, LineType, AttachA, AttachB, UnstrLen, NumSegs", number, "line")
        if words[1].lower() not in types:
            raise file.refusal(f"line {words[0]}: unknown line type {words[1]!r}", number)
        length = _positive(file, number, "UnstrLen", number_of(words[places[0]]))
        ends = []
        for name in (words[places[1]], words[places[2]]):
            if name.lower() not in points:
                raise file.refusal(
                    f"line {words[0]}: point {name!r} is not there (rods and bodies cannot be represented)",
                    number,
                )
            ends.append(points[name.lower()])
        lines.append(_line(file, number, words[0], ends, length, types[words[1].lower()], words[1]))
    _check_count(file, lines)
    notes = [
        ("dynamic lines (MoorDyn): drag, added mass and inertia of the lines", "quasi-static catenaries")
    ]
    return file, lines, notes


def _without_attachment(words):
    """The words of a point: some files have "Vessel1" or "Coupled 0 ..." alike."""
    return (
        [
            words[0],
            words[1].rstrip("0123456789") if words[1].lower() not in FAIRLEADS else words[1],
            *words[2:],
        ]
        if (len(words) > 1)
        else words
    )


def _moordyn_type(file, number, words, density, gravity):
    """(wet weight, EA, friction) of a row of line types."""
    if len(words) < 4:
        raise file.refusal("must be Name, Diam, MassDen, EA", number, "line type")
    stiffness = number_of(words[3].partition("|")[0])
    if stiffness is None:
        raise file.refusal(
            f"line type {words[0]}: EA = {words[3][:60]}: must be a number, not a curve",
            number,
        )
    if "|" in words[3]:
        raise file.refusal(f"line type {words[0]}: EA = {words[3][:60]}: must be one number", number)
    diameter, mass = (number_of(word) for word in words[1:3])
    if diameter is None or mass is None:
        raise file.refusal(f"line type {words[0]}: Diam and MassDen must be numbers", number)
    wet = _wet_weight(file, number, words[0], mass, diameter, density, gravity)
    return wet, _positive(file, number, "EA", stiffness), 0.0


def read_mooring(kind, path, depth, density, gravity):
    """(PartFile, lines, notes) of a mooring file; kind: 1 for MAP++, 3 for MoorDyn, None: by its contents."""
    if kind is None:
        text = "\n".join(PartFile(path, "mooring").lines).lower()
        kind = 1 if "massdeninair" in text or "line dictionary" in text else 3
    reader = {1: read_map, 3: read_moordyn}[kind]
    return reader(path, depth, density, gravity)
