"""A whole deck: the .fst file, or part files one by one, and everything that they name."""

from dataclasses import dataclass
from pathlib import Path

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.aerodyn import AeroDyn, read_aerodyn
from fowt_env.files.openfast_deck.elastodyn import ElastoDyn, read_elastodyn
from fowt_env.files.openfast_deck.environment import Inflow, Sea, read_inflow, read_sea
from fowt_env.files.openfast_deck.hydrodyn import HydroDyn, read_hydrodyn
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.mooring import read_mooring
from fowt_env.files.openfast_deck.parser import PartFile
from fowt_env.files.openfast_deck.servodyn import Control, read_control

PARTS = {  # option: key of the .fst
    "elastodyn": "EDFile",
    "aerodyn": "AeroFile",
    "servodyn": "ServoFile",
    "hydrodyn": "HydroFile",
    "seastate": "SeaStFile",
    "mooring": "MooringFile",
    "inflow": "InflowFile",
}
NEEDED = ("elastodyn", "aerodyn", "hydrodyn")
STANDARD_GRAVITY, WATER, AIR = 9.80665, 1025.0, 1.225


@dataclass(frozen=True)
class Site:
    """Figures of the site, with their sources."""

    gravity: float
    water_density: float
    air_density: float
    water_depth: float
    sources: dict


@dataclass(frozen=True)
class Deck:
    """Everything that was read; notes: (what the deck has, what the plant has)."""

    name: str
    fst: PartFile | None
    site: Site
    elastodyn: ElastoDyn
    aerodyn: AeroDyn
    hydrodyn: HydroDyn
    water: PartFile  # SeaState's file, or HydroDyn's, which was it before OpenFAST 4
    mooring: PartFile | None
    lines: tuple
    sea: Sea
    inflow: Inflow
    control: Control
    notes: tuple
    files: tuple  # paths of the part files


def read_deck(fst=None, parts=None, folders=(), discon=None):
    """Deck of an .fst file, of part files ({"elastodyn": path ...}, PARTS), or of both: parts replace files.

    folders: further ones in which files that the deck names are looked for. discon: a DISCON.IN instead of
    the deck's. Raises: InputError naming file, line, key, value and what is allowed.
    """
    parts = {name: Path(path) for name, path in (parts or {}).items() if path is not None}
    given = tuple(parts)
    main = None if fst is None else PartFile(fst, "OpenFAST")
    folders = tuple(map(Path, folders))
    if main is not None:
        _check_switches(main, parts)
        for name, key in PARTS.items():
            if name in parts or not _switched_on(main, name):
                continue
            try:
                path = main.other(key, f"{key}(1)", folders=folders, default=None)  # (1): OpenFAST 5
            except InputError:
                if name != "inflow":  # the wind is a suggestion
                    raise
                path = None
            if path is not None:
                parts[name] = path
    missing = [name for name in NEEDED if name not in parts]
    if missing:
        which = ", ".join(f"{name} ({PARTS[name]})" for name in missing)
        where = "the deck" if main is None else f"OpenFAST file {str(main.path)!r}"
        raise InputError(f"{where} names no file of {which}: a floating turbine needs them")
    # FAST 8 finds files beside the .fst as well
    folders = (*folders, *({main.path.parent} if main is not None else ()))
    elastodyn = read_elastodyn(parts["elastodyn"], folders)
    aerodyn = read_aerodyn(parts["aerodyn"], folders, elastodyn.blades)
    water = PartFile(
        parts.get("seastate", parts["hydrodyn"]), "SeaState" if "seastate" in parts else "HydroDyn"
    )
    site = _site(main, elastodyn, aerodyn, water)
    hydrodyn = read_hydrodyn(parts["hydrodyn"], (site.water_density, site.water_depth, 0.0), folders)
    notes = [] if main is None else differences(main)
    mooring, lines = None, []
    if "mooring" in parts:
        kind = (
            None
            if main is None or "mooring" in given
            else {1: 1, 3: 3}.get(main.whole("CompMooring", default=0))
        )
        mooring, lines, more = read_mooring(
            kind, parts["mooring"], site.water_depth, site.water_density, site.gravity
        )
        notes += more
    else:
        notes.append(("no mooring system", "none: the platform drifts"))
    for line in lines:
        if not -site.water_depth * (1.0 + 1e-3) - 0.1 <= line.anchor[2] <= 0.0:
            raise mooring.refusal(
                f"an anchor at z = {line.anchor[2]:g} m: must be from -{site.water_depth:g} m (WtrDpth) to 0"
            )
    if main is not None and main.whole("CompElast", default=1) == 2:
        notes.append(("blades of BeamDyn (CompElast 2)", "rigid, with the masses of ElastoDyn's BldFile"))
    inflow = read_inflow(parts["inflow"], folders) if "inflow" in parts else Inflow(None, None, "none")
    control = read_control(
        parts.get("servodyn"), elastodyn["GBRatio"], discon, folders, site.air_density, elastodyn["TipRad"]
    )
    reference = elastodyn["PtfmRefzt"]
    if reference != 0.0 and hydrodyn.potential is not None:
        raise elastodyn.file.wrong(
            "PtfmRefzt", reference, "0 with potential flow: WAMIT's origin at still water"
        )
    sea = read_sea(water)
    return Deck(
        name=(main.path if main is not None else parts["elastodyn"]).stem,
        fst=main,
        site=site,
        elastodyn=elastodyn,
        aerodyn=aerodyn,
        hydrodyn=hydrodyn,
        water=water,
        mooring=mooring,
        lines=tuple(lines),
        sea=sea,
        inflow=inflow,
        control=control,
        notes=(*sea.notes, *inflow.notes, *notes),
        files=tuple(([] if main is None else [main.path]) + list(parts.values())),
    )


SWITCHES = {
    "elastodyn": "CompElast",
    "aerodyn": "CompAero",
    "servodyn": "CompServo",
    "hydrodyn": "CompHydro",
    "seastate": "CompSeaSt",
    "mooring": "CompMooring",
    "inflow": "CompInflow",
}


def _switched_on(main, name):
    """Whether the .fst switches a module on; without the switch, whether it names a file."""
    if not main.has(SWITCHES[name]):
        return True
    return main.whole(SWITCHES[name]) != 0


def _check_switches(main, parts):
    """Raises: InputError for modules that cannot be represented."""
    if main.has("CompElast"):
        main.one_of("CompElast", (1, 2), why="3, simplified ElastoDyn, cannot be read")
    if main.whole("NumTurbines", default=1) != 1:
        raise main.wrong("NumTurbines", main.whole("NumTurbines"), "1")
    for key, why in (
        ("CompSub", "a flexible substructure (SubDyn) cannot be represented"),
        ("CompIce", "ice cannot be represented"),
        ("MHK", "turbines in water cannot be represented"),
    ):
        main.one_of(key, (0,), default=0, why=why)
    if "mooring" not in parts:
        why = "FEAMooring and OrcaFlex cannot be read; give a file of MAP++ or MoorDyn with --mooring"
        main.one_of("CompMooring", (0, 1, 3), default=0, why=why)
    if main.has("CompHydro") and main.whole("CompHydro") == 0:
        raise main.wrong("CompHydro", 0, "1: only floating turbines can be imported")
    if main.has("CompAero") and main.whole("CompAero") not in (1, 2):
        raise main.wrong("CompAero", main.whole("CompAero"), "1 or 2, with a file of AeroDyn 15")
    if main.flag("MHK_Floating", default=False):
        raise main.wrong("MHK_Floating", "True", "False")


def _site(main, elastodyn, aerodyn, water):
    """Site of what the .fst says, or the module that said it before."""
    sources = {}

    def first(name, *places, default=None):
        for file, key, limits in places:
            if file is None:
                continue
            value = file.number(key, default=None, **limits)
            if value is not None:
                sources[name] = file.source(key)
                return value
        sources[name] = "not in the deck"
        return default

    level = first("level", (water, "MSL2SWL", {}), (main, "MSL2SWL", {}), default=0.0)
    if level != 0.0:
        raise water.wrong("MSL2SWL", level, "0: still water at the mean sea level")
    positive = {"low": 0.0, "high": 1e5, "open_low": True}
    depth = first("water_depth", (water, "WtrDpth", positive), (main, "WtrDpth", positive))
    if depth is None:
        raise water.refusal("WtrDpth is missing: must be the water depth in m, here or in the .fst")
    if elastodyn.gravity is not None:
        sources["gravity"] = elastodyn.file.source("Gravity")
    return Site(
        gravity=elastodyn.gravity
        if elastodyn.gravity is not None
        else first("gravity", (main, "Gravity", positive), default=STANDARD_GRAVITY),
        water_density=first(
            "water_density", (water, "WtrDens", positive), (main, "WtrDens", positive), default=WATER
        ),
        air_density=first(
            "air_density",
            (aerodyn.file, "AirDens", {"low": 0.0}),
            (main, "AirDens", {"low": 0.0}),
            default=AIR,
        ),
        water_depth=depth,
        sources=sources,
    )
