"""Reads a complete deck: the .fst file or individual part files, and all files named there."""

from pathlib import Path
from typing import NamedTuple

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.aerodyn import AeroDyn, read_aerodyn
from fowt_env.files.openfast_deck.elastodyn import ElastoDyn, read_elastodyn
from fowt_env.files.openfast_deck.environment import Inflow, Sea, read_inflow, read_sea
from fowt_env.files.openfast_deck.hydrodyn import HydroDyn, read_hydrodyn
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.mooring import read_mooring
from fowt_env.files.openfast_deck.parser import PartFile
from fowt_env.files.openfast_deck.servodyn import Control, read_control

PARTS = {  # option: key of the file and module switch in the .fst
    "elastodyn": ("EDFile", "CompElast"),
    "aerodyn": ("AeroFile", "CompAero"),
    "servodyn": ("ServoFile", "CompServo"),
    "hydrodyn": ("HydroFile", "CompHydro"),
    "seastate": ("SeaStFile", "CompSeaSt"),
    "mooring": ("MooringFile", "CompMooring"),
    "inflow": ("InflowFile", "CompInflow"),
}
NEEDED = ("elastodyn", "aerodyn", "hydrodyn")
POSITIVE = {"low": 0.0, "high": 1e5, "open_low": True}


class Site(NamedTuple):
    """Holds the site's constants, with their sources."""

    gravity: float
    water_density: float
    air_density: float
    water_depth: float
    sources: dict


class Deck(NamedTuple):
    """Holds the contents of a deck; notes: (feature of the deck, treatment in the plant)."""

    name: str
    fst: PartFile | None
    site: Site
    elastodyn: ElastoDyn
    aerodyn: AeroDyn
    hydrodyn: HydroDyn
    water: PartFile  # SeaState's file, or HydroDyn's before OpenFAST 4
    lines: list
    sea: Sea
    inflow: Inflow
    control: Control
    notes: tuple
    files: list  # paths of the .fst and the part files


def read_deck(fst=None, parts=None, folders=(), discon=None):
    """Read a Deck from an .fst file, part files ({"elastodyn": path ...}, PARTS), or both; parts override.

    folders: additional search folders for files named in the deck. discon: a DISCON.IN instead of
    the deck's. Raises: InputError naming file, line, key, value and the allowed range.
    """
    parts = {name: Path(path) for name, path in (parts or {}).items() if path is not None}
    folders, main, kind, notes = tuple(map(Path, folders)), None, None, []
    if fst is not None:
        main = PartFile(fst, "OpenFAST")
        _check_switches(main, parts)
        if "mooring" not in parts:
            kind = main.whole("CompMooring", default=0) or None
        parts |= _named(main, parts, folders)
        folders = (*folders, main.path.parent)  # FAST 8 searches the folder of the .fst as well
        notes += differences(main)
    if missing := [f"{name} ({PARTS[name][0]})" for name in NEEDED if name not in parts]:
        where = "the deck" if main is None else f"OpenFAST file {str(main.path)!r}"
        raise InputError(f"{where} names no file of {', '.join(missing)}: a floating turbine needs them")
    elastodyn = read_elastodyn(parts["elastodyn"], folders)
    aerodyn = read_aerodyn(parts["aerodyn"], folders, elastodyn.blades)
    at_sea = "seastate" in parts
    water = PartFile(parts["seastate" if at_sea else "hydrodyn"], "SeaState" if at_sea else "HydroDyn")
    site = _site(main, elastodyn, aerodyn, water)
    hydrodyn = read_hydrodyn(parts["hydrodyn"], site.water_density, folders)
    lines, more = [], [("no mooring system", "none: the platform drifts")]
    if "mooring" in parts:
        lines, more = read_mooring(kind, parts["mooring"], site.water_depth, site.water_density, site.gravity)
    if main is not None and main.whole("CompElast", default=1) == 2:
        here = "rigid, or with the option blades the modes of ElastoDyn's BldFile; its masses"
        more.append(("blades of BeamDyn (CompElast 2)", here))
    control = read_control(
        parts.get("servodyn"), elastodyn["GBRatio"], discon, folders, site.air_density, elastodyn["TipRad"]
    )
    reference = elastodyn["PtfmRefzt"]
    if reference != 0.0 and hydrodyn.potential is not None:
        allowed = "0 with potential flow: WAMIT's origin at still water"
        raise elastodyn.file.wrong("PtfmRefzt", reference, allowed)
    inflow = read_inflow(parts["inflow"], folders) if "inflow" in parts else Inflow(None, "none")
    sea = read_sea(water)
    files = [*([] if main is None else [main.path]), *parts.values()]
    name = files[0].stem if main is not None else parts["elastodyn"].stem
    notes = (*sea.notes, *inflow.notes, *notes, *more)
    return Deck(
        name, main, site, elastodyn, aerodyn, hydrodyn, water, lines, sea, inflow, control, notes, files
    )


def _named(main, parts, folders):
    """Return {part: path} of the module files that the .fst names and enables, without the parts passed."""
    paths = {}
    for name, (key, switch) in PARTS.items():
        if name in parts or (main.has(switch) and main.whole(switch) == 0):
            continue
        try:
            paths[name] = main.other(key, f"{key}(1)", folders=folders, default=None)  # (1): OpenFAST 5
        except InputError:
            if name != "inflow":  # the wind file is optional
                raise
    return {name: path for name, path in paths.items() if path is not None}


def _check_switches(main, parts):
    """Check the module switches of an .fst. Raises: InputError for modules that cannot be represented."""
    for key, choices, why in (
        ("CompElast", (1, 2), "3, simplified ElastoDyn, cannot be read"),
        ("NumTurbines", (1,), "several turbines cannot be represented"),
        ("CompSub", (0,), "a flexible substructure (SubDyn) cannot be represented"),
        ("CompIce", (0,), "ice cannot be represented"),
        ("MHK", (0,), "turbines in water cannot be represented"),
        ("CompAero", (1, 2), "with a file of AeroDyn 15"),
    ):
        main.one_of(key, choices, default=choices[0], why=why)
    if "mooring" not in parts:
        why = "FEAMooring and OrcaFlex cannot be read; pass a file of MAP++ or MoorDyn with --mooring"
        main.one_of("CompMooring", (0, 1, 3), default=0, why=why)
    if main.whole("CompHydro", default=1) == 0:
        raise main.wrong("CompHydro", 0, "1: only floating turbines can be imported")
    if main.flag("MHK_Floating", default=False):
        raise main.wrong("MHK_Floating", "True", "False")


def _site(main, elastodyn, aerodyn, water):
    """Return the Site from the modules' files (older versions) or else from the .fst."""
    sources = {}

    def first(name, key, module, default=None, **limits):
        for file in (module, main):
            value = None if file is None else file.number(key, default=None, **limits)
            if value is not None:
                sources[name] = file.source(key)
                return value
        sources[name] = "not in the deck"
        return default

    level = first("level", "MSL2SWL", water, 0.0)
    if level != 0.0:
        raise water.wrong("MSL2SWL", level, "0: still water at the mean sea level")
    depth = first("water_depth", "WtrDpth", water, **POSITIVE)
    if depth is None:
        raise water.refusal("WtrDpth is missing: must be the water depth in m, here or in the .fst")
    return Site(
        gravity=first("gravity", "Gravity", elastodyn.file, 9.80665, **POSITIVE),
        water_density=first("water_density", "WtrDens", water, 1025.0, **POSITIVE),
        air_density=first("air_density", "AirDens", aerodyn.file, 1.225, low=0.0, high=1e4),
        water_depth=depth,
        sources=sources,
    )
