"""ElastoDyn's files: masses and geometry of rotor, nacelle, tower and platform.

Blades and tower are lumped at the midpoints of ElastoDyn's elements, as it does it: totals then are those
of its summary. All heights are of still water, angles in rad with ElastoDyn's signs.
"""

import math
from dataclasses import dataclass

import numpy as np

from fowt_env.descriptions.records import validate
from fowt_env.descriptions.rotor_mass import BladeMass, blade_mass
from fowt_env.descriptions.tower_modes import TowerBending
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile

MASS = {"low": 0.0, "high": 1e12}  # kg
INERTIA = {"low": 0.0, "high": 1e18}  # kg m2
LENGTH = {"low": -1e4, "high": 1e4}  # m
NODES = {"low": 1, "high": 999}
LARGEST = {"kg/m": 1e9, "N m2": 1e18}


@dataclass(frozen=True)
class Span:
    """A tower above its base: moments of its mass about the base."""

    length: float  # m
    mass: float  # kg
    first: float  # kg m
    second: float  # kg m2


@dataclass(frozen=True)
class ElastoDyn:
    """What the conversion takes of ElastoDyn's files; names of figures as in the files."""

    file: PartFile
    values: dict  # key of ElastoDyn in small letters: number in SI
    blades: int
    blade: BladeMass
    tower: Span
    bending: TowerBending | None  # of a tower file with mode shapes
    platform_products: tuple  # PtfmXYIner, PtfmYZIner, PtfmXZIner, kg m2
    gravity: float | None  # of FAST 8, where it stands here
    flexible: tuple  # names of degrees of freedom that are on and that the plant does not have
    notes: tuple  # (what the deck has, what the plant has)

    def __getitem__(self, key):
        return self.values[key.lower()]


FLEXIBLE = {
    "FlapDOF1": "first blade flap mode",
    "FlapDOF2": "second blade flap mode",
    "EdgeDOF": "first blade edge mode",
    "DrTrDOF": "drivetrain torsion",
    "YawDOF": "nacelle yaw",
    "TwFADOF1": "first fore-aft tower mode",
    "TwFADOF2": "second fore-aft tower mode",
    "TwSSDOF1": "first side-to-side tower mode",
    "TwSSDOF2": "second side-to-side tower mode",
}


def read_elastodyn(path, folders=()):
    """ElastoDyn of an ElastoDyn file, with the blade and tower files that it names.

    folders: further ones in which these are looked for. Raises: InputError.
    """
    file = PartFile(path, "ElastoDyn")
    blades = file.one_of("NumBl", (1, 2, 3), why="blades of a rotor in ElastoDyn")
    if file.flag("Furling", default=False):
        raise file.wrong("Furling", "True", "False: a furling rotor or tail cannot be represented")
    if blades == 2:
        if file.flag("TeetDOF", default=False):
            raise file.wrong("TeetDOF", "True", "False: a teetering rotor cannot be represented")
        if file.number("UndSling", default=0.0) != 0.0:
            raise file.wrong("UndSling", file.number("UndSling"), "0: the rotor centre is the apex")
    values = {}
    for key, limits in (
        ("TipRad", {"low": 0.1, "high": 1e3}),
        ("HubRad", {"low": 0.0, "high": 1e3, "open_low": True}),
        ("HubCM", LENGTH), ("OverHang", LENGTH), ("NacCMxn", LENGTH), ("NacCMyn", LENGTH),
        ("NacCMzn", LENGTH), ("Twr2Shft", LENGTH), ("TowerHt", LENGTH), ("TowerBsHt", LENGTH),
        ("HubMass", MASS), ("HubIner", INERTIA), ("GenIner", INERTIA), ("NacMass", MASS),
        ("NacYIner", INERTIA), ("YawBrMass", MASS), ("PtfmMass", MASS), ("PtfmRIner", INERTIA),
        ("PtfmPIner", INERTIA), ("PtfmYIner", INERTIA), ("PtfmCMxt", LENGTH), ("PtfmCMyt", LENGTH),
        ("PtfmCMzt", LENGTH), ("PtfmRefzt", LENGTH), ("GBRatio", {"low": 1e-3, "high": 1e4}),
        ("GBoxEff", {"low": 1.0, "high": 100.0}),
    ):  # fmt: skip
        missing = 0.0 if key in ("PtfmCMxt", "PtfmCMyt", "PtfmRefzt", "YawBrMass", "HubCM") else None
        if key == "PtfmRefzt" and not file.has(key) and file.has("PtfmRef"):
            values["ptfmrefzt"] = -file.number("PtfmRef")
        elif missing is None:
            values[key.lower()] = file.number(key, **limits)
        else:
            values[key.lower()] = file.number(key, default=missing, **limits)
    values["shfttilt"] = math.radians(file.number("ShftTilt", low=-28.0, high=28.0))
    cones = [file.number(f"PreCone({i})", low=-28.0, high=28.0) for i in range(1, blades + 1)]
    tips = [file.number(f"TipMass({i})", default=0.0, **MASS) for i in range(1, blades + 1)]
    for name, of_blades in (("PreCone", cones), ("TipMass", tips)):
        for i, value in enumerate(of_blades[1:], 2):
            if value != of_blades[0]:
                raise file.wrong(f"{name}({i})", value, f"{of_blades[0]:g}, as of blade 1: blades are alike")
    values |= {"precone": math.radians(cones[0]), "tipmass": tips[0]}
    if values["tiprad"] <= values["hubrad"]:
        raise file.wrong("TipRad", values["tiprad"], f"> HubRad = {values['hubrad']:g}")
    if values["towerht"] <= values["towerbsht"]:
        raise file.wrong("TowerHt", values["towerht"], f"> TowerBsHt = {values['towerbsht']:g}")
    if values["overhang"] > 0.0:
        raise file.wrong("OverHang", values["overhang"], "<= 0: downwind rotors cannot be represented")
    tower_file, tower, bending = _tower(file, folders, values)
    blade_file, blade = _blade(file, folders, values)
    return ElastoDyn(
        file=file,
        values=values,
        blades=blades,
        blade=blade,
        tower=tower,
        bending=bending,
        platform_products=tuple(file.number(f"Ptfm{name}Iner", default=0.0) for name in ("XY", "YZ", "XZ")),
        gravity=file.number("Gravity", default=None, low=0.0, open_low=True),
        flexible=tuple(what for key, what in FLEXIBLE.items() if file.flag(key, default=False)),
        notes=tuple(row for part in (file, blade_file, tower_file) for row in differences(part)),
    )


def _distributed(file, count_key, first, *columns):
    """((n,) fraction of the length, then (n,) of each column) of a blade or tower file.

    columns: (name, unit, key of the factor on it); values are from 0 to 1e9 kg/m or to 1e18 N m2.
    """
    count = file.whole(count_key, low=2, high=10_000)
    rows = file.headed(first, count)
    place = np.array([cells[first.lower()] for _, cells in rows])
    for i, (line, _) in enumerate(rows):
        if not 0.0 <= place[i] <= 1.0 or (i and place[i] <= place[i - 1]):
            raise file.refusal(f"{first} = {place[i]:g}: must increase from 0 to 1", line)
    found = [place]
    for name, unit, factor in columns:
        if name.lower() not in rows[0][1]:
            raise file.refusal(f"the column {name} is missing", rows[0][0] - 1)
        adjust = file.number(factor, default=1.0, low=0.0, high=1e3)
        values = np.array([cells[name.lower()] for _, cells in rows])
        largest = LARGEST[unit]
        for value, (line, _) in zip(values, rows, strict=True):
            if not 0.0 <= value <= largest:
                raise file.refusal(f"{name} = {value:g}: must be from 0 to {largest:g} {unit}", line)
        found.append(adjust * values)
    return found


def _span(length, nodes, place, density):
    """Span of a distribution, lumped at the midpoints of equal elements."""
    middle = (np.arange(nodes) + 0.5) / nodes
    mass = np.interp(middle, place, density) * length / nodes
    s = middle * length
    return Span(length, float(mass.sum()), float(mass @ s), float(mass @ s**2))


def _blade(file, folders, values):
    """(file, BladeMass) of the blade file, with the mass at the tip."""
    path = file.other("BldFile(1)", "BldFile", folders=folders)
    if path is None:
        raise file.wrong("BldFile(1)", "unused", "the blade file: the masses of the rotor are in it")
    names = [file.text(f"BldFile({i})", default=None) for i in (2, 3)]
    first = file.text("BldFile(1)", "BldFile")
    for i, name in zip((2, 3), names, strict=True):
        if name not in (None, first) and i <= file.whole("NumBl"):
            raise file.wrong(f"BldFile({i})", name, "the file of blade 1: blades are alike")
    nodes = file.whole("BldNodes", default=50, **NODES)
    part = PartFile(path, "ElastoDyn blade")
    place, density = _distributed(part, "NBlInpSt", "BlFract", ("BMassDen", "kg/m", "AdjBlMs"))
    tip = values["tiprad"]
    blade = blade_mass(place, density, values["hubrad"], tip, nodes)
    return part, BladeMass(np.append(blade.radius, tip), np.append(blade.mass, values["tipmass"]))


def _tower(file, folders, values):
    """(file, Span, TowerBending or None) of the tower file."""
    path = file.other("TwrFile", folders=folders)
    if path is None:
        raise file.wrong("TwrFile", "unused", "the tower file: the mass of the tower is in it")
    nodes = file.whole("TwrNodes", default=20, **NODES)
    tower = PartFile(path, "tower")
    place, density = _distributed(tower, "NTwInpSt", "HtFract", ("TMassDen", "kg/m", "AdjTwMa"))
    span = _span(values["towerht"] - values["towerbsht"], nodes, place, density)
    return tower, span, _bending(tower, nodes, values["yawbrmass"])


def _bending(tower, nodes, top_mass):
    """TowerBending of a tower file; None of one without shapes, or without mass or stiffness somewhere."""
    if not tower.has("TwFAM1Sh(2)"):
        return None
    place, density, *stiffness = _distributed(
        tower, "NTwInpSt", "HtFract", ("TMassDen", "kg/m", "AdjTwMa"), ("TwFAStif", "N m2", "AdjFASt"),
        ("TwSSStif", "N m2", "AdjSSSt"),
    )  # fmt: skip
    if min(map(np.min, (density, *stiffness))) <= 0.0 or (place[0], place[-1]) != (0.0, 1.0):
        return None

    def of_modes(name, default, factor=1.0, **limits):
        return tuple(factor * tower.number(f"{name}({i})", default=default, **limits) for i in (1, 2))

    def shapes(letters):
        return tuple(
            tuple(tower.number(f"Tw{letters}M{i}Sh({power})") for power in range(2, 7)) for i in (1, 2)
        )

    given = {
        "height_fraction": tuple(place.tolist()),
        "mass_density": tuple(density.tolist()),
        "fore_aft_stiffness": tuple(stiffness[0].tolist()),
        "side_side_stiffness": tuple(stiffness[1].tolist()),
        "fore_aft": shapes("FA"),
        "side_side": shapes("SS"),
        "fore_aft_damping": of_modes("TwrFADmp", 1.0, 0.01, low=0.0, high=99.0),
        "side_side_damping": of_modes("TwrSSDmp", 1.0, 0.01, low=0.0, high=99.0),
        "fore_aft_tuner": of_modes("FAStTunr", 1.0, low=0.0, high=1e3, open_low=True),
        "side_side_tuner": of_modes("SSStTunr", 1.0, low=0.0, high=1e3, open_low=True),
        "top_mass": top_mass,
        "elements": nodes,
    }
    found, problems = validate(TowerBending, given)
    if problems:
        raise tower.refusal("; ".join(problems))
    return found
