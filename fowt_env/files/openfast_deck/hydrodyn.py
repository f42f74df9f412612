"""Reads HydroDyn files: potential flow, additional matrices, members with coefficients, and ballast water."""

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, locate, number_of

MOST = 10_000  # joints, members
SECOND_ORDER = ("MnDrift", "NewmanApp", "DiffQTF", "SumQTF")


class Cylinder(NamedTuple):
    """Defines a cylindrical member of HydroDyn; pairs of values are for the two ends."""

    number: int
    start: tuple  # m
    end: tuple
    diameter: tuple  # m
    thickness: tuple  # m
    drag: tuple
    added_mass: tuple
    pressure: tuple
    axial: tuple  # (drag, added mass, pressure) of each end, on half rho A |v| v; zero for an inner joint
    potential_flow: bool


class Fill(NamedTuple):
    """Defines ballast water (of any density) in a member up to a height, as a rigid body."""

    member: int
    mass: float  # kg
    centre: tuple  # m
    inertia: np.ndarray  # (3, 3) about the centre, kg m2


class PotentialFiles(NamedTuple):
    """Defines the path of WAMIT's coefficients, and HydroDyn's data of the body."""

    root: object  # Path without suffix
    length_scale: float
    volume: float
    centre_of_buoyancy: tuple


class HydroDyn(NamedTuple):
    """Holds the data of HydroDyn's file that the conversion uses."""

    file: PartFile
    potential: PotentialFiles | None
    added: dict  # AddF0: (6,), AddCLin, AddBLin, AddBQuad: 6 rows of 6
    members: list
    fills: list
    second_order: dict  # key of HydroDyn: number of the WAMIT file, if not 0
    memory: int  # RdtnMod
    notes: list  # (feature of the deck, treatment in the plant)


def read_hydrodyn(path, density, folders=()):
    """Read a HydroDyn file; density: of the water. Raises: InputError, also for unsupported features."""
    file = PartFile(path, "HydroDyn")
    notes = []
    inside = file.one_of("PotMod", (0, 1), why="2, fluid impulse theory, cannot be represented") == 1
    potential = _potential(file, folders) if inside else None
    growth = file.table("NMGDepths", high=MOST)
    if any(cells.get("mgthck", 0.0) != 0.0 for _, cells in growth):
        what = "marine growth cannot be represented: NMGDepths must be 0"
        raise file.refusal(what, growth[0][0], "NMGDepths")
    for key in ("NPropSetsRec", "NCoefMembersRec"):
        file.one_of(key, (0,), default=0, why="rectangular members cannot be represented")
    added = {"AddF0": file.vector("AddF0")}
    added |= {key: file.matrix(key) for key in ("AddCLin", "AddBLin", "AddBQuad")}
    for key in added if not inside else ():
        if np.any(added[key]):
            notes.append((f"{key}, which HydroDyn does not use with PotMod 0", "left out"))
            added[key] = np.zeros_like(added[key])
    members = _members(file, notes, inside)
    if not inside and not members:
        raise file.wrong("PotMod", 0, "1 without members: the platform needs buoyancy")
    fills = _fills(file, members, density)
    second = {key: file.whole(key, default=0) for key in SECOND_ORDER}
    second = {key: value for key, value in second.items() if value and inside}
    memory = file.whole("RdtnMod", default=1) if inside else 0
    return HydroDyn(file, potential, added, members, fills, second, memory, [*notes, *differences(file)])


def _potential(file, folders):
    """Return the PotentialFiles of a file with PotMod 1."""
    file.one_of("NBody", (1,), default=1, why="floaters of several bodies cannot be represented")
    name, folders = file.text("PotFile"), (file.path.parent, *folders)
    path = locate(name + ".1", folders) or locate(name + ".hst", folders)
    if path is None:
        raise file.wrong("PotFile", name, "the root of WAMIT's files: no .1 or .hst file exists")
    return PotentialFiles(
        root=path.with_suffix(""),
        volume=file.positive("PtfmVol0", high=1e9),
        centre_of_buoyancy=tuple(
            file.number(key, default=0.0, low=-1e3, high=1e3) for key in ("PtfmCOBxt", "PtfmCOByt")
        ),
        length_scale=file.positive("WAMITULEN", default=1.0, high=1e4),
    )


# --------------------------------------------------------------------------- members


class _Member(NamedTuple):
    """Holds one row of HydroDyn's table of members."""

    line: int
    number: int
    ends: tuple  # (position, number of the axial coefficients) of each
    sections: tuple  # (diameter, thickness) of each end
    model: int  # MCoefMod
    inside: bool  # of the potential-flow body


def _members(file, notes, potential):
    """Return the list of Cylinder; potential: whether members may be in a potential-flow body (PropPot)."""
    needs = ("MemberID", "MJointID1", "MJointID2", "MPropSetID1", "MPropSetID2", "MCoefMod")
    table = file.table("NMembers", texts=("proppot",), needs=needs, high=MOST)
    if not table:
        return []
    joints, sections, axial, members = {}, {}, {}, {}
    needs = ("JointID", "Jointxi", "Jointyi", "Jointzi", "JointAxID")
    for line, cells in file.table("NJoints", needs=needs, high=MOST):
        position = tuple(cells[f"joint{axis}i"] for axis in "xyz")
        if max(map(abs, position)) > 1e4:
            raise file.refusal(f"joint {cells['jointid']:g}: must be within 10 km of the body", line)
        joints[file.new(line, joints, cells["jointid"], "joint")] = (position, int(cells["jointaxid"]))
    needs = ("PropSetID", "PropD", "PropThck")
    for line, cells in file.table("NPropSets", "NPropSetsCyl", needs=needs, high=MOST):
        size, thickness = cells["propd"], cells["propthck"]
        if not (0.0 < size <= 1e3 and 0.0 <= thickness <= 0.5 * size + 1e-9):
            raise file.refusal("PropD must be > 0 and PropThck from 0 to PropD / 2", line)
        sections[file.new(line, sections, cells["propsetid"], "property set")] = (size, thickness)
    for line, cells in file.table("NAxCoef", needs=("AxCoefID", "AxCd", "AxCa", "AxCp"), high=MOST):
        number = file.new(line, axial, cells["axcoefid"], "axial coefficient")
        axial[number] = tuple(cells[name] for name in ("axcd", "axca", "axcp"))
    coefficients = _Coefficients(file)

    def looked_up(line, table, number, what):
        if number != int(number) or int(number) not in table:
            raise file.refusal(f"{what} {number:g} is not defined", line)
        return table[int(number)]

    for line, cells in table:
        number = file.new(line, members, cells["memberid"], "member")
        if cells.get("msecgeom", 1.0) not in (0.0, 1.0):
            raise file.refusal(f"member {number}: MSecGeom must be 1, a circular section", line)
        ends = tuple(looked_up(line, joints, cells[f"mjointid{i}"], "joint") for i in (1, 2))
        props = tuple(looked_up(line, sections, cells[f"mpropsetid{i}"], "property set") for i in (1, 2))
        for _, coefficient in ends:
            looked_up(line, axial, coefficient, "axial coefficient")
        if math.dist(ends[0][0], ends[1][0]) < 1e-6:
            raise file.refusal(f"member {number}: both joints are at the same position", line)
        text = cells.get("proppot", "False").lower()
        inside = potential and (text[:1] == "t" or text.startswith(".t") or text == "1")
        member = _Member(line, number, ends, props, int(cells["mcoefmod"]), inside)
        if not inside:
            coefficients.check_buoyancy(member, cells.get("mhstlmod", 1.0))
        if props[0][0] != props[1][0]:
            notes += coefficients.of_taper(member)
        members[number] = member
    faces = _faces(members.values(), axial, notes)
    return [part for member in members.values() for part in _parts(member, coefficients, faces)]


def _parts(member, coefficients, faces):
    """Yield the Cylinders of a member, split at the depths of the coefficient table; faces: see _faces."""
    (low, _), (high, _) = member.ends
    low, high = np.array(low), np.array(high)
    starts = [0.0, *coefficients.breaks(member, low[2], high[2]), 1.0]
    for a, b in zip(starts[:-1], starts[1:], strict=True):
        values = [coefficients.at(member, (1.0 - t) * low[2] + t * high[2], t) for t in (a, b)]
        positions = [tuple(float(x) for x in low + t * (high - low)) for t in (a, b)]
        pairs = zip(*member.sections, strict=True)
        sizes = [tuple((1.0 - t) * first + t * last for t in (a, b)) for first, last in pairs]
        none = (0.0, 0.0, 0.0)
        first, last = faces[member.number]
        axial = first if a == 0.0 else none, last if b == 1.0 else none
        yield Cylinder(member.number, *positions, *sizes, *zip(*values, strict=True), axial, member.inside)


def _faces(members, axial, notes):
    """Return {member: [(drag, added mass, pressure) of each end]}, coefficients on the area of that end.

    HydroDyn applies the load of a joint to the vector sum of the end areas of the members there (except for
    drag, of the members outside the potential-flow body). Here the largest member carries this load, with
    coefficients scaled by the component of that sum along the member's axis. The drag coefficient of a joint
    multiplies rho A |v| v / 4 in HydroDyn, and rho A |v| v / 2 here.
    """
    at = {}  # position of a joint: [(member, end, diameter, outward direction (3,))] of the members there
    for member in members:
        along = np.subtract(member.ends[1][0], member.ends[0][0])
        along /= np.linalg.norm(along)
        for end, outward in ((0, -along), (1, along)):
            face = member, end, member.sections[end][0], outward
            at.setdefault(tuple(np.round(member.ends[end][0], 6)), []).append(face)
    result = {member.number: np.zeros((2, 3)) for member in members}
    for position, faces in at.items():
        member, end, *_ = faces[0]
        drag, mass, pressure = axial[member.ends[end][1]]
        wet = [face for face in faces if not face[0].inside]
        for meeting, power, coefficients in (
            (faces, 2, (0.5 * drag, 0.0, 0.0)), (wet, 3, (0.0, mass, 0.0)), (wet, 2, (0.0, 0.0, pressure)),
        ):  # fmt: skip
            if not meeting or not any(coefficients):
                continue
            member, end, largest, along = max(meeting, key=lambda face: face[2])
            total = sum((diameter**power * outward for _, _, diameter, outward in meeting), np.zeros(3))
            total /= largest**power
            part = float(total @ along)
            aside = float(np.linalg.norm(total - part * along))
            if aside > 1e-3 and (coefficients[0] or coefficients[1]):
                what = f"axial loads of the joint at {position} across member {member.number}"
                notes.append((what, f"left out: {aside:.2g} of the loads along the member"))
            if part > 1e-6:
                result[member.number][end] += part * np.array(coefficients)
    return {number: tuple(map(tuple, ends.tolist())) for number, ends in result.items()}


class _Coefficients:
    """Looks up HydroDyn's member coefficients in the three tables: simple, by depth, by member."""

    def __init__(self, file):
        self.file = file
        rows = file.table("NCoefDpth", "NCoefDpthCyl", needs=("Dpth",), high=MOST)
        self.depth = sorted((cells for _, cells in rows), key=lambda cells: cells["dpth"])
        self.member = {}
        for line, cells in file.table("NCoefMembers", "NCoefMembersCyl", needs=("MemberID",), high=MOST):
            self.member[file.new(line, self.member, cells["memberid"], "coefficients of member")] = cells

    @cached_property
    def simple(self):
        """Return {column: value} of the simple coefficients, common to all members."""
        return self.file.headed("SimplCd", 1)[0][1]

    def _listed(self, member, name):
        """Return [(column, value)] of a coefficient from the table that applies to a member."""
        if member.model == 1:
            rows, columns = [self.simple], [f"simpl{name}"]
        elif member.model == 2:
            rows, columns = self.depth, [f"dpth{name}"]
        else:
            rows, columns = [self.member.get(member.number, {})], [f"member{name}{i}" for i in (1, 2)]
        return [(column, row[column]) for row in rows for column in columns if column in row]

    def check_buoyancy(self, member, switch):
        """Check that a member's buoyancy is that of its volume (Cb 1, MHstLMod not 0). Raises: InputError."""
        named = f"member {member.number}"
        if switch == 0.0:
            allowed = "must be 1 or 2: members outside the potential-flow body always have buoyancy here"
            raise self.file.refusal(f"{named}: MHstLMod = 0: {allowed}", member.line)
        for column, value in self._listed(member, "cb"):
            if value != 1.0:
                raise self.file.refusal(f"{named}: {column} = {value:g}: must be 1", member.line)

    def of_taper(self, member):
        """Yield (feature of the deck, treatment here) for axial coefficients of a tapered member."""
        neutral = {"axcd": 0.0} if member.inside else {"axcd": 0.0, "axca": 0.0, "axcp": 1.0}
        for name, usual in neutral.items():
            if other := [pair for pair in self._listed(member, name) if pair[1] != usual]:
                column, value = other[0]
                yield f"loads along the taper of member {member.number} ({column} {value:g})", "left out"

    def breaks(self, member, z1, z2):
        """Return the fractions of a member's length at the depths of the coefficient table."""
        if member.model != 2 or z1 == z2:
            return []
        at = sorted((-cells["dpth"] - z1) / (z2 - z1) for cells in self.depth)
        inner = [t for t in at if 1e-6 < t < 1.0 - 1e-6]
        return [t for t, before in zip(inner, [0.0, *inner], strict=False) if t - before > 1e-6]

    def at(self, member, z, t):
        """Return [cd, ca, cp] at height z and fraction t of a member's length."""
        named = f"member {member.number}"
        if member.model not in (1, 2, 3):
            raise self.file.refusal(f"{named}: MCoefMod = {member.model}: must be 1, 2 or 3", member.line)
        if member.model == 3 and member.number not in self.member:
            raise self.file.refusal(f"{named}: has no row of NCoefMembers", member.line)
        nodes = {1: [0.0], 2: [cells["dpth"] for cells in self.depth], 3: [0.0, 1.0]}[member.model]
        coefficients = []
        for name in ("cd", "ca", "cp"):
            values = [value for _, value in self._listed(member, name)]
            whole = 0 < len(values) == len(nodes)
            value = float(np.interp(-z if member.model == 2 else t, nodes, values)) if whole else None
            if value is None or not 0.0 <= value <= 1e4:
                what = f"{named}: coefficient {name} = {value}: must be >= 0"
                raise self.file.refusal(what, member.line)
            coefficients.append(value)
        return coefficients


# --------------------------------------------------------------------------- ballast water


def _fills(file, members, density):
    """Return the list of Fill of all members in all groups; density: of the water."""
    fills = []
    count = file.whole("NFillGroups", default=0, low=0, high=MOST)
    if not count:
        return fills
    head, rows = file.find("NFillGroups")[0], []
    for line in range(head + 1, len(file.lines)):
        words = file.words(line)
        if len(rows) == count or (words and words[0].startswith("---")):
            break
        if words and number_of(words[0]) is not None:
            rows.append((line, words))
    if len(rows) < count:
        raise file.refusal(f"NFillGroups = {count}: only {len(rows)} rows follow", head)
    for line, words in rows:
        size = number_of(words[0])
        size = int(size) if size == int(size) and 0 < size <= MOST else 0
        *numbers, level = [number_of(word) for word in words[1 : size + 2]] or [None]
        if not size or len(numbers) < size or None in (*numbers, level):
            raise file.refusal("must be FillNumM, FillNumM members, FillFSLoc, FillDens", line, "FillMList")
        word = bare(words[size + 2]) if len(words) > size + 2 else "default"
        filled = density if word.lower() == "default" else number_of(word)
        if filled is None or not 0.0 <= filled <= 1e5:
            raise file.refusal(f"FillDens = {word[:20]}: must be a density >= 0 or DEFAULT", line)
        for number in numbers:
            parts = [member for member in members if member.number == number]
            if not parts:
                raise file.refusal(f"FillMList: member {number:g} is not defined", line)
            fills += [_fill(part, level, filled, not is_old(file)) for part in parts]
    return [fill for fill in fills if fill is not None]


def is_old(file):
    """Return whether a file is of HydroDyn before OpenFAST 3, which had another model of member loads.

    In old files the water in members was lumped on the member axes, without a restoring moment of its weight:
    decks defined this moment as additional stiffness (OpenFAST/r-test 5MW_OC4Semi, before and after).
    """
    return not file.has("NBody")


def _fill(member, level, density, solid):
    """Return the Fill of a member up to a height, or None if empty. solid: include inertia about the axis."""
    low, high = np.array(member.start), np.array(member.end)
    inner = [0.5 * d - t for d, t in zip(member.diameter, member.thickness, strict=True)]
    if low[2] > high[2]:
        low, high, inner = high, low, inner[::-1]
    if level <= low[2] or density == 0.0:
        return None
    top = 1.0 if level >= high[2] else (level - low[2]) / (high[2] - low[2])
    length, axis = np.linalg.norm(high - low), (high - low) / np.linalg.norm(high - low)
    # moments of the water in a cone along the axis; Gauss quadrature is exact for polynomials of degree 6
    points, weights = np.polynomial.legendre.leggauss(6)
    t, w = 0.5 * top * (points + 1.0), 0.5 * top * length * weights
    radius = inner[0] + t * (inner[1] - inner[0])
    area = math.pi * radius**2
    mass = density * float(w @ area)
    if mass <= 0.0:
        return None
    s = t * length
    centre = density * float(w @ (area * s)) / mass
    axial = 0.5 * density * float(w @ (area * radius**2)) if solid else 0.0
    across = density * float(w @ (area * (s - centre) ** 2)) + 0.5 * axial
    inertia = across * np.eye(3) + (axial - across) * np.outer(axis, axis)
    return Fill(member.number, mass, tuple(float(x) for x in low + centre * axis), inertia)
