"""Reads ElastoDyn files: masses and geometry of rotor, nacelle, tower and platform.

Blades and tower are lumped at the midpoints of ElastoDyn's elements, as in ElastoDyn, so that totals equal
those of its summary. All heights are relative to still water, angles in rad with ElastoDyn's signs.
"""

import math
from dataclasses import dataclass

import numpy as np

from fowt_env.descriptions.blade_structure import LARGEST as DISTRIBUTED
from fowt_env.descriptions.blade_structure import SHAPES, BladeStructure, Shaft
from fowt_env.descriptions.records import validate
from fowt_env.descriptions.rotor_mass import BladeMass, blade_mass
from fowt_env.descriptions.tower_modes import COLUMNS, TowerBending
from fowt_env.descriptions.units import DEGREE, PERCENT
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile

MASS = {"low": 0.0, "high": 1e12}  # kg
INERTIA = {"low": 0.0, "high": 1e18}  # kg m2
LENGTH = {"low": -1e4, "high": 1e4}  # m
NODES = {"low": 1, "high": 999}
RANGES = {"kg/m": (0.0, 1e9), "N m2": (0.0, 1e18), "deg": (-180.0, 180.0)}
DAMPING = {"low": 0.0, "high": 99.0}  # percent of critical
TUNER = {"low": 0.0, "high": 1e3, "open_low": True}
FIGURES = {
    **dict.fromkeys("OverHang NacCMxn NacCMyn NacCMzn Twr2Shft TowerHt TowerBsHt PtfmCMzt".split(), LENGTH),
    **dict.fromkeys("HubCM PtfmCMxt PtfmCMyt".split(), LENGTH | {"default": 0.0}),
    **dict.fromkeys("HubMass NacMass PtfmMass".split(), MASS),
    **dict.fromkeys("HubIner GenIner NacYIner PtfmRIner PtfmPIner PtfmYIner".split(), INERTIA),
    "YawBrMass": MASS | {"default": 0.0},
    "TipRad": {"low": 0.1, "high": 1e3},
    "HubRad": {"low": 0.0, "high": 1e3, "open_low": True},
    "GBRatio": {"low": 1e-3, "high": 1e4},
    "GBoxEff": {"low": 1.0, "high": 100.0},
}
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


@dataclass(frozen=True)
class ElastoDyn:
    """Holds the data of ElastoDyn's files that the conversion uses; names as in the files."""

    file: PartFile
    values: dict  # key of ElastoDyn: number in SI
    blades: int
    blade: BladeMass
    tower: tuple  # mass (kg), first (kg m) and second (kg m2) moment about the base of the tower
    structure: BladeStructure | None  # of a blade file with mode shapes
    shaft: Shaft | None
    bending: TowerBending | None  # of a tower file with mode shapes
    platform_products: list  # PtfmXYIner, PtfmYZIner, PtfmXZIner, kg m2
    flexible: list  # names of enabled degrees of freedom of FLEXIBLE
    notes: list  # (feature of the deck, treatment in the plant)

    def __getitem__(self, key):
        return self.values[key]


def read_elastodyn(path, folders=()):
    """Read an ElastoDyn file with the blade and tower files named there.

    folders: additional search folders for these. Raises: InputError.
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
    values = {key: file.number(key, **limits) for key, limits in FIGURES.items()}
    old = not file.has("PtfmRefzt") and file.has("PtfmRef")
    values["PtfmRefzt"] = -file.number("PtfmRef") if old else file.number("PtfmRefzt", default=0.0, **LENGTH)
    values["ShftTilt"] = math.radians(file.number("ShftTilt", low=-28.0, high=28.0))
    for name, limits in (("PreCone", {"low": -28.0, "high": 28.0}), ("TipMass", {"default": 0.0, **MASS})):
        values[name], *others = (file.number(f"{name}({i})", **limits) for i in range(1, blades + 1))
        for i, value in enumerate(others, 2):
            if value != values[name]:
                raise file.wrong(f"{name}({i})", value, f"{values[name]:g}, blades must be identical")
    values["PreCone"] = math.radians(values["PreCone"])
    for key, least in (("TipRad", "HubRad"), ("TowerHt", "TowerBsHt")):
        if values[key] <= values[least]:
            raise file.wrong(key, values[key], f"> {least} = {values[least]:g}")
    if values["OverHang"] > 0.0:
        raise file.wrong("OverHang", values["OverHang"], "<= 0: downwind rotors cannot be represented")
    tower_file, tower, bending = _tower(file, folders, values)
    blade_file, blade, structure = _blade(file, folders, values, blades)
    products = [file.number(f"Ptfm{name}Iner", default=0.0) for name in ("XY", "YZ", "XZ")]
    flexible = [what for key, what in FLEXIBLE.items() if file.flag(key, default=False)]
    notes = [row for part in (file, blade_file, tower_file) for row in differences(part)]
    shaft = _shaft(file)
    return ElastoDyn(file, values, blades, blade, tower, structure, shaft, bending, products, flexible, notes)


def _distributed(file, count_key, first, *columns):
    """Return [(n,) fraction of the length, then (n,) of each column] of a blade or tower file.

    columns: (name, unit of RANGES, key of the column's factor or None).
    """
    count = file.whole(count_key, low=2, high=10_000)
    rows = file.headed(first, count)
    station = np.array([cells[first.lower()] for _, cells in rows])
    for i, (line, _) in enumerate(rows):
        if not 0.0 <= station[i] <= 1.0 or (i and station[i] <= station[i - 1]):
            raise file.refusal(f"{first} = {station[i]:g}: must increase from 0 to 1", line)
    result = [station]
    for name, unit, factor in columns:
        file.need(rows[0], name)
        adjust = 1.0 if factor is None else file.number(factor, default=1.0, low=0.0, high=1e3)
        low, high = RANGES[unit]
        for line, cells in rows:
            if not low <= cells[name.lower()] <= high:
                allowed = f"must be from {low:g} to {high:g} {unit}"
                raise file.refusal(f"{name} = {cells[name.lower()]:g}: {allowed}", line)
        result.append(adjust * np.array([cells[name.lower()] for _, cells in rows]))
    return result


def _blade(file, folders, values, blades):
    """Return (file, BladeMass with the tip mass, BladeStructure or None) of the blade file."""
    nodes = file.whole("BldNodes", default=50, **NODES)
    part = PartFile(file.blade("BldFile", blades, folders), "ElastoDyn blade")
    station, density = _distributed(part, "NBlInpSt", "BlFract", ("BMassDen", "kg/m", "AdjBlMs"))
    tip = values["TipRad"]
    blade = blade_mass(station, density, values["HubRad"], tip, nodes)
    whole = BladeMass(np.append(blade.radius, tip), np.append(blade.mass, values["TipMass"]))
    return part, whole, _structure(part, nodes, values["TipMass"])


def _structure(blade, nodes, tip_mass):
    """Return the BladeStructure of a blade file; None without mode shapes, or with zero mass or stiffness."""
    if not blade.has("BldFl1Sh(2)"):
        return None
    station, twist, *positive = _distributed(
        blade, "NBlInpSt", "BlFract", ("StrcTwst", "deg", None), ("BMassDen", "kg/m", "AdjBlMs"),
        ("FlpStff", "N m2", "AdjFlSt"), ("EdgStff", "N m2", "AdjEdSt"),
    )  # fmt: skip
    if min(map(np.min, positive)) <= 0.0 or (station[0], station[-1]) != (0.0, 1.0):
        return None
    keys = dict(zip(SHAPES, ("BldFl1Sh", "BldFl2Sh", "BldEdgSh"), strict=True))
    percent = [blade.number(key, **DAMPING) for key in ("BldFlDmp(1)", "BldFlDmp(2)", "BldEdDmp(1)")]
    values = {"span_fraction": station, "structural_twist": DEGREE * twist}
    values |= dict(zip(DISTRIBUTED, positive, strict=True)) | {
        **{name: tuple(blade.number(f"{key}({i})") for i in range(2, 7)) for name, key in keys.items()},
        "damping_ratio": tuple(PERCENT * value for value in percent),
        "flap_tuner": tuple(blade.number(f"FlStTunr({i})", default=1.0, **TUNER) for i in (1, 2)),
        "tip_mass": tip_mass,
        "elements": nodes,
    }
    structure, problems = validate(BladeStructure, values)
    if problems:
        raise blade.refusal("; ".join(problems))
    return structure


def _shaft(file):
    """Return the Shaft of an ElastoDyn file; None without stiffness."""
    stiffness = file.number("DTTorSpr", default=0.0, low=0.0, high=1e18)
    if stiffness == 0.0:
        return None
    return Shaft(stiffness=stiffness, damping=file.number("DTTorDmp", default=0.0, low=0.0, high=1e18))


def _tower(file, folders, values):
    """Return (file, mass moments, TowerBending or None) of the tower file."""
    path = file.other("TwrFile", folders=folders)
    if path is None:
        raise file.wrong("TwrFile", "unused", "the tower file, which defines the tower mass")
    nodes = file.whole("TwrNodes", default=20, **NODES)
    tower = PartFile(path, "tower")
    station, density = _distributed(tower, "NTwInpSt", "HtFract", ("TMassDen", "kg/m", "AdjTwMa"))
    length = values["TowerHt"] - values["TowerBsHt"]
    middle = (np.arange(nodes) + 0.5) / nodes
    mass, s = np.interp(middle, station, density) * length / nodes, middle * length
    moments = float(mass.sum()), float(mass @ s), float(mass @ s**2)
    return tower, moments, _bending(tower, nodes, values["YawBrMass"])


def _bending(tower, nodes, top_mass):
    """Return the TowerBending of a tower file; None without mode shapes, or with zero mass or stiffness."""
    if not tower.has("TwFAM1Sh(2)"):
        return None
    columns = _distributed(
        tower, "NTwInpSt", "HtFract", ("TMassDen", "kg/m", "AdjTwMa"), ("TwFAStif", "N m2", "AdjFASt"),
        ("TwSSStif", "N m2", "AdjSSSt"),
    )  # fmt: skip
    station = columns[0]
    if min(map(np.min, columns[1:])) <= 0.0 or (station[0], station[-1]) != (0.0, 1.0):
        return None

    def of_modes(name, limits, factor=1.0):
        return tuple(factor * tower.number(f"{name}({i})", default=1.0, **limits) for i in (1, 2))

    def shapes(letters):
        return tuple(
            tuple(tower.number(f"Tw{letters}M{i}Sh({power})") for power in range(2, 7)) for i in (1, 2)
        )

    values = dict(zip(COLUMNS, (tuple(column.tolist()) for column in columns), strict=True)) | {
        "fore_aft": shapes("FA"),
        "side_side": shapes("SS"),
        "fore_aft_damping": of_modes("TwrFADmp", DAMPING, PERCENT),
        "side_side_damping": of_modes("TwrSSDmp", DAMPING, PERCENT),
        "fore_aft_tuner": of_modes("FAStTunr", TUNER),
        "side_side_tuner": of_modes("SSStTunr", TUNER),
        "top_mass": top_mass,
        "elements": nodes,
    }
    modes, problems = validate(TowerBending, values)
    if problems:
        raise tower.refusal("; ".join(problems))
    return modes
