"""HydroDyn's file: potential flow, additional matrices, members with coefficients, and ballast water."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, locate, number_of, words_of

MOST = 10_000  # joints, members
ENDS = ("cd", "ca", "cp", "axcd")  # coefficients along a member
SECOND_ORDER = {"MnDrift": "mean drift", "NewmanApp": "Newman's approximation",
                "DiffQTF": "difference-frequency forces", "SumQTF": "sum-frequency forces"}  # fmt: skip


@dataclass(frozen=True)
class Cylinder:
    """A member of HydroDyn; a pair of values is of its two ends."""

    number: int
    start: tuple  # m
    end: tuple
    diameter: tuple  # m
    thickness: tuple  # m
    drag: tuple
    added_mass: tuple
    pressure: tuple
    axial: tuple  # (drag, added mass, pressure) of each end, on half rho A |v| v; zero of an inner joint
    potential_flow: bool


@dataclass(frozen=True)
class Fill:
    """Water (or what has the density) in a member up to a height: a rigid body."""

    member: int
    mass: float  # kg
    centre: tuple  # m
    inertia: np.ndarray  # (3, 3) about its centre, kg m2


@dataclass(frozen=True)
class PotentialFiles:
    """Where the coefficients of WAMIT are, and what HydroDyn says of the body."""

    root: object  # Path without ending
    length_scale: float
    volume: float
    centre_of_buoyancy: tuple


@dataclass(frozen=True)
class HydroDyn:
    """What the conversion takes of HydroDyn's file."""

    file: PartFile
    potential: PotentialFiles | None
    preload: tuple
    stiffness: tuple  # 6 rows of 6
    linear_damping: tuple
    quadratic_damping: tuple
    members: tuple
    fills: tuple
    second_order: dict  # key of HydroDyn: the file that it takes, where not 0
    memory: int  # RdtnMod
    notes: tuple
    sources: dict


def read_hydrodyn(path, site, folders=()):
    """HydroDyn of its file. site: (water density, depth or None, still water above the mean level).

    Raises: InputError, also for what cannot be represented.
    """
    file = PartFile(path, "HydroDyn")
    notes = []
    mode = file.one_of("PotMod", (0, 1), why="2, fluid impulse theory, cannot be represented")
    potential = _potential(file, folders) if mode == 1 else None
    growth = file.table("NMGDepths", high=MOST)
    if any(cells.get("mgthck", 0.0) != 0.0 for _, cells in growth):
        raise file.refusal(
            "marine growth cannot be represented: NMGDepths must be 0", growth[0][0], "NMGDepths"
        )
    for key, what in (
        ("NPropSetsRec", "rectangular cross-sections"),
        ("NCoefMembersRec", "rectangular members"),
    ):
        if file.whole(key, default=0) != 0:
            raise file.wrong(key, file.whole(key), f"0: {what} cannot be represented")
    added = {"AddF0": [file.vector("AddF0")]}
    added |= {key: file.matrix(key) for key in ("AddCLin", "AddBLin", "AddBQuad")}
    unused = [key for key, values in added.items() if np.any(values)] if mode == 0 else []
    for key in unused:
        notes.append((f"{key}, which HydroDyn does not use with PotMod 0", "left out"))
        added[key] = np.zeros_like(added[key]).tolist()
    second = {key: file.whole(key, default=0) for key in SECOND_ORDER}
    rows = _members(file, site, notes, mode == 1)
    if mode == 0 and not rows:
        raise file.wrong("PotMod", 0, "1, or there must be members: nothing makes the platform float")
    return HydroDyn(
        file=file,
        potential=potential,
        preload=tuple(added["AddF0"][0]),
        stiffness=tuple(map(tuple, added["AddCLin"])),
        linear_damping=tuple(map(tuple, added["AddBLin"])),
        quadratic_damping=tuple(map(tuple, added["AddBQuad"])),
        members=tuple(rows),
        fills=tuple(_fills(file, rows, site)),
        second_order={key: value for key, value in second.items() if value and mode == 1},
        memory=file.whole("RdtnMod", default=1) if mode == 1 else 0,
        notes=(*notes, *differences(file)),
        sources={},
    )


def _potential(file, folders):
    """PotentialFiles of a file with PotMod 1."""
    bodies = file.whole("NBody", default=1, low=1)
    if bodies != 1:
        raise file.wrong("NBody", bodies, "1: floaters of several bodies cannot be represented")
    name = file.text("PotFile")
    root = _wamit_root(name, (file.path.parent, *folders))
    if root is None:
        raise file.wrong("PotFile", name, "the root of WAMIT's files: no .1 or .hst is there")
    volume = file.number("PtfmVol0", low=0.0, high=1e9, open_low=True)
    centre = tuple(file.number(key, default=0.0, low=-1e3, high=1e3) for key in ("PtfmCOBxt", "PtfmCOByt"))
    return PotentialFiles(
        root, file.number("WAMITULEN", default=1.0, low=0.0, high=1e4, open_low=True), volume, centre
    )


def _wamit_root(name, folders):
    """Path without ending of WAMIT's files, letters of either case; or None."""
    for ending in (".1", ".hst"):
        path = locate(name + ending, folders)
        if path is not None:
            return path.with_name(path.name[: -len(ending)])
    return None


# --------------------------------------------------------------------------- members


def _members(file, site, notes, potential):
    """List of Cylinder; potential: whether there is a body that members may be inside of (PropPot)."""
    rows = file.table("NMembers", texts=("proppot",), high=MOST)
    if not rows:
        return []
    density, _, level = site
    joints = {}
    for line, cells in file.table("NJoints", high=MOST):
        _need(file, line, cells, ("jointid", "jointxi", "jointyi", "jointzi", "jointaxid"))
        place = tuple(cells[f"joint{axis}i"] for axis in "xyz")
        if max(map(abs, place)) > 1e4:
            raise file.refusal(f"joint {cells['jointid']:g}: must be within 10 km of the body", line)
        joints[file.new(line, joints, cells["jointid"], "joint")] = (place, int(cells["jointaxid"]))
    sections = {}
    for line, cells in file.table("NPropSets", "NPropSetsCyl", high=MOST):
        _need(file, line, cells, ("propsetid", "propd", "propthck"))
        if not (0.0 < cells["propd"] <= 1e3 and 0.0 <= cells["propthck"] <= 0.5 * cells["propd"] + 1e-9):
            raise file.refusal("PropD must be > 0 and PropThck from 0 to its half", line)
        number = file.new(line, sections, cells["propsetid"], "property set")
        sections[number] = (cells["propd"], cells["propthck"])
    axial = {}
    for line, cells in file.table("NAxCoef", high=MOST):
        _need(file, line, cells, ("axcoefid", "axcd", "axca", "axcp"))
        number = file.new(line, axial, cells["axcoefid"], "axial coefficient")
        axial[number] = tuple(cells[name] for name in ("axcd", "axca", "axcp"))
    coefficients = _Coefficients(file)
    bare_members = []
    for line, cells in rows:
        _need(
            file,
            line,
            cells,
            ("memberid", "mjointid1", "mjointid2", "mpropsetid1", "mpropsetid2", "mcoefmod"),
        )
        number = file.new(line, [row[1] for row in bare_members], cells["memberid"], "member")
        if cells.get("msecgeom", 1.0) not in (0.0, 1.0):
            raise file.refusal(f"member {number}: MSecGeom must be 1, a circular section", line)
        ends = [_looked_up(file, line, joints, cells[f"mjointid{i}"], "joint") for i in (1, 2)]
        props = [_looked_up(file, line, sections, cells[f"mpropsetid{i}"], "property set") for i in (1, 2)]
        for _, coefficient in ends:
            _looked_up(file, line, axial, coefficient, "axial coefficient")
        if math.dist(ends[0][0], ends[1][0]) < 1e-6:
            raise file.refusal(f"member {number}: its joints are at one place", line)
        text = cells.get("proppot", "False").lower()
        inside = potential and (text[:1] == "t" or text.startswith(".t") or text == "1")
        model = int(cells["mcoefmod"])
        if not inside:
            coefficients.check_buoyancy(line, number, model, cells.get("mhstlmod", 1.0))
        if props[0][0] != props[1][0]:
            notes += coefficients.of_taper(number, model, inside)
        bare_members.append((line, number, ends, props, model, inside))
    faces = _faces(bare_members, axial, notes)
    found = []
    for line, number, ends, props, model, inside in bare_members:
        starts = [0.0, *coefficients.breaks(model, ends[0][0][2] - level, ends[1][0][2] - level), 1.0]
        low, high = (np.array(end[0]) for end in ends)
        for a, b in zip(starts[:-1], starts[1:], strict=True):
            values = [
                coefficients.at(line, number, model, (1.0 - t) * low[2] + t * high[2] - level, t)
                for t in (a, b)
            ]
            size = [tuple((1.0 - t) * props[0][i] + t * props[1][i] for t in (a, b)) for i in (0, 1)]
            place = [tuple(float(x) for x in low + t * (high - low)) for t in (a, b)]
            none = (0.0, 0.0, 0.0)
            found.append(Cylinder(
                number, place[0], place[1], size[0], size[1],
                *(tuple(value[name] for value in values) for name in ("cd", "ca", "cp")),
                (faces[number][0] if a == 0.0 else none, faces[number][1] if b == 1.0 else none), inside,
            ))  # fmt: skip
    if any(level != 0.0 for level in (site[2],)):
        raise file.wrong("MSL2SWL", site[2], "0: still water at the mean sea level")
    return found


def _need(file, line, cells, names):
    for name in names:
        if name not in cells:
            raise file.refusal(f"the column {name} is missing", line - 1)


def _looked_up(file, line, known, number, what):
    """The entry of a number. Raises: InputError."""
    if number != int(number) or int(number) not in known:
        raise file.refusal(f"{what} {number:g} is not there", line)
    return known[int(number)]


def _faces(members, axial, notes):
    """{member: [(drag, added mass, pressure) of each end]}, as coefficients on the area of that end alone.

    HydroDyn loads a joint by the vector sum of the areas of the members that end there, for all but drag of
    those outside the potential-flow body. Here the largest of them carries it, its coefficients scaled by
    the sum's part along its own axis. The drag coefficient of a joint multiplies rho A |v| v / 4 in HydroDyn,
    and rho A |v| v / 2 here.
    """
    at = {}
    for _, number, ends, props, _, inside in members:
        along = np.subtract(ends[1][0], ends[0][0])
        along /= np.linalg.norm(along)
        for end in (0, 1):
            face = _Face(number, end, props[end][0], along if end else -along, ends[end][1], inside)
            at.setdefault(tuple(np.round(ends[end][0], 6)), []).append(face)
    result = {number: np.zeros((2, 3)) for _, number, *_ in members}
    for place, faces in at.items():
        drag, mass, pressure = axial[faces[0].axial]
        wet = [face for face in faces if not face.inside]
        for meeting, power, coefficients in (
            (faces, 2, (0.5 * drag, 0.0, 0.0)), (wet, 3, (0.0, mass, 0.0)), (wet, 2, (0.0, 0.0, pressure)),
        ):  # fmt: skip
            if not meeting or not any(coefficients):
                continue
            biggest = max(meeting, key=lambda face: face.diameter)
            total = sum((face.diameter**power * face.outward for face in meeting), np.zeros(3))
            total /= biggest.diameter**power
            part = float(total @ biggest.outward)
            aside = float(np.linalg.norm(total - part * biggest.outward))
            if aside > 1e-3 and (coefficients[0] or coefficients[1]):
                notes.append((
                    f"axial loads of the joint at {place} across member {biggest.member}",
                    f"left out: {aside:.2g} of those along it",
                ))  # fmt: skip
            if part > 1e-6:
                result[biggest.member][biggest.end] += part * np.array(coefficients)
    return {number: tuple(map(tuple, ends.tolist())) for number, ends in result.items()}


class _Face(NamedTuple):
    """End of a member at a joint."""

    member: int
    end: int  # 0 or 1
    diameter: float
    outward: np.ndarray  # (3,)
    axial: int  # number of the joint's axial coefficients
    inside: bool  # of the potential-flow body


class _Coefficients:
    """The three tables of coefficients of HydroDyn's members."""

    def __init__(self, file):
        self.file = file
        self.depth = sorted(
            (cells for _, cells in file.table("NCoefDpth", "NCoefDpthCyl", high=MOST)),
            key=lambda cells: cells.get("dpth", 0.0),
        )
        self.member = {}
        for line, cells in file.table("NCoefMembers", "NCoefMembersCyl", high=MOST):
            _need(file, line, cells, ("memberid",))
            self.member[file.new(line, self.member, cells["memberid"], "coefficients of member")] = cells
        self._simple = None

    @property
    def simple(self):
        """{column: value} of the coefficients of all members alike."""
        if self._simple is None:
            self._simple = self.file.headed("SimplCd", 1)[0][1]
        return self._simple

    def _listed(self, model, number, name):
        """[(column, value)] of all that the table of a model has of a coefficient, for a member."""
        if model == 1:
            rows, columns = [self.simple], [f"simpl{name}"]
        elif model == 2:
            rows, columns = self.depth, [f"dpth{name}"]
        else:
            rows, columns = [self.member.get(number, {})], [f"member{name}{i}" for i in (1, 2)]
        return [(column, row[column]) for row in rows for column in columns if column in row]

    def check_buoyancy(self, line, number, model, switch):
        """Raises: InputError for a member whose buoyancy is not that of its volume (Cb, MHstLMod 0)."""
        if switch == 0.0:
            raise self.file.refusal(
                f"member {number}: MHstLMod = 0: must be 1 or 2: a member outside of the potential-flow body"
                " has its buoyancy here",
                line,
            )
        for column, value in self._listed(model, number, "cb"):
            if value != 1.0:
                raise self.file.refusal(f"member {number}: its {column} = {value:g}: must be 1", line)

    def of_taper(self, number, model, inside):
        """[(what the deck has, what is here)] of the coefficients along a member that tapers."""
        neutral = {"axcd": 0.0} if inside else {"axcd": 0.0, "axca": 0.0, "axcp": 1.0}
        for name, usual in neutral.items():
            for column, value in self._listed(model, number, name):
                if value != usual:
                    yield f"loads along the taper of member {number} ({column} {value:g})", "left out"
                    break

    def breaks(self, model, z1, z2):
        """Fractions of a member's length where depth-dependent coefficients bend."""
        if model != 2 or z1 == z2:
            return []
        at = sorted((-cells.get("dpth", 0.0) - z1) / (z2 - z1) for cells in self.depth)
        inner = [t for t in at if 1e-6 < t < 1.0 - 1e-6]
        return [t for t, before in zip(inner, [0.0, *inner], strict=False) if t - before > 1e-6]

    def at(self, line, number, model, z, t):
        """{cd, ca, cp} at height z and fraction t of the member's length."""
        if model == 1:
            values = {name: self.simple.get(f"simpl{name}") for name in ("cd", "ca", "cp")}
        elif model == 2:
            values = {name: self._of_depth(f"dpth{name}", -z) for name in ("cd", "ca", "cp")}
        elif model == 3:
            if number not in self.member:
                raise self.file.refusal(f"member {number}: has no row of NCoefMembers", line)
            own = self.member[number]
            values = {}
            for name in ("cd", "ca", "cp"):
                ends = [own.get(f"member{name}{i}") for i in (1, 2)]
                values[name] = None if None in ends else (1.0 - t) * ends[0] + t * ends[1]
        else:
            raise self.file.refusal(f"member {number}: MCoefMod = {model}: must be 1, 2 or 3", line)
        for name, value in values.items():
            if value is None or not 0.0 <= value <= 1e4:
                raise self.file.refusal(
                    f"member {number}: its coefficient {name} = {value}: must be >= 0", line
                )
        return values

    def _of_depth(self, name, depth):
        if not self.depth or name not in self.depth[0]:
            return None
        return float(np.interp(depth, [c["dpth"] for c in self.depth], [c[name] for c in self.depth]))


# --------------------------------------------------------------------------- ballast water


def _fills(file, members, site):
    """List of Fill: of each member of each group."""
    found = []
    count = file.whole("NFillGroups", default=0, low=0, high=MOST)
    if not count:
        return found
    line = file.find("NFillGroups")[0] + 1
    rows = []
    while line < len(file.lines) and len(rows) < count:
        words = words_of(file.lines[line][:2000])
        if words and number_of(words[0]) is not None:
            rows.append((line, words))
        elif words and words[0].startswith("---"):
            break
        line += 1
    if len(rows) < count:
        raise file.refusal(f"NFillGroups = {count}: {len(rows)} rows are there", file.find("NFillGroups")[0])
    for line, words in rows:
        head = number_of(words[0])
        some = int(head) if head == int(head) and 0 < head <= MOST else 0
        numbers = [number_of(word) for word in words[1 : some + 2]]
        if not some or len(numbers) < some + 1 or None in numbers:
            raise file.refusal("must be FillNumM, as many members, FillFSLoc, FillDens", line, "FillMList")
        word = bare(words[some + 2]) if len(words) > some + 2 else "default"
        density = site[0] if word.lower() == "default" else number_of(word)
        if density is None or not 0.0 <= density <= 1e5:
            raise file.refusal(f"FillDens = {word[:20]}: must be a density >= 0 or DEFAULT", line)
        for number in numbers[:-1]:
            parts = [member for member in members if member.number == number]
            if not parts:
                raise file.refusal(f"FillMList: member {number:g} is not there", line)
            fills = [_fill(part, numbers[-1], density, not is_old(file)) for part in parts]
            found += [fill for fill in fills if fill is not None]
    return found


def is_old(file):
    """Whether a file is of HydroDyn before OpenFAST 3, which had members' loads of another kind.

    There the water in members was lumped on their axes, and its weight restored nothing: decks gave the
    moment that it has as additional stiffness (OpenFAST/r-test 5MW_OC4Semi, before and after).
    """
    return not file.has("NBody")


def _fill(member, level, density, solid):
    """Fill of a member up to a height, or None where there is none. solid: not on the member's axis alone."""
    low, high = np.array(member.start), np.array(member.end)
    inner = [0.5 * d - t for d, t in zip(member.diameter, member.thickness, strict=True)]
    if low[2] > high[2]:
        low, high, inner = high, low, inner[::-1]
    if level <= low[2] or density == 0.0:
        return None
    top = 1.0 if level >= high[2] else (level - low[2]) / (high[2] - low[2])
    length, axis = np.linalg.norm(high - low), (high - low) / np.linalg.norm(high - low)
    # moments of a cone's water along its axis; Gauss points are exact for its polynomials of degree six
    points, weights = np.polynomial.legendre.leggauss(6)
    t, w = 0.5 * top * (points + 1.0), 0.5 * top * length * weights
    radius = inner[0] + t * (inner[1] - inner[0])
    area = math.pi * radius**2
    mass = density * float(w @ area)
    if mass <= 0.0:
        return None
    s = t * length
    centre = density * float(w @ (area * s)) / mass
    own = 0.5 * density * float(w @ (area * radius**2)) if solid else 0.0
    across = density * float(w @ (area * (s - centre) ** 2)) + 0.5 * own
    inertia = across * np.eye(3) + (own - across) * np.outer(axis, axis)
    return Fill(member.number, mass, tuple(float(x) for x in low + centre * axis), inertia)
