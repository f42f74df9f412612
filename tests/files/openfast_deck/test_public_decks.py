"""Public decks give the built-in files back when they are imported, and OpenFAST's summaries."""

import csv
import hashlib
import math
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import fowt_env
from fowt_env.descriptions.platform import MovingLine, read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.importer import import_deck
from fowt_env.files.openfast_deck.keys import UNKNOWN
from fowt_env.files.openfast_deck.parser import PartFile

DATA = Path(fowt_env.__file__).parent / "data"
DECKS = Path(__file__).parents[2] / "reference" / "decks"
IEA = DECKS / "IEA-15-240-RWT" / "OpenFAST" / "IEA-15-240-RWT-UMaineSemi"
FAST = DECKS / "FAST" / "CertTest" / "5MW_Baseline"
ROSCO = DECKS / "ROSCO" / "Examples" / "Test_Cases"
DISCON = ROSCO / "IEA-15-240-RWT" / "IEA-15-240-RWT-UMaineSemi" / "IEA-15-240-RWT-UMaineSemi_DISCON.IN"


def of_fast(floater):
    """Arguments of import_deck of a floater of FAST 8 with the NREL 5 MW turbine."""
    kinds = {"elastodyn": "ElastoDyn", "hydrodyn": "HydroDyn", "mooring": "MAP", "servodyn": "ServoDyn"}
    parts = {part: FAST / f"NRELOffshrBsline5MW_{floater}_{kind}.dat" for part, kind in kinds.items()}
    turbine = ROSCO / "NREL-5MW"
    parts["aerodyn"] = turbine / "NRELOffshrBsline5MW_Onshore_AeroDyn15.dat"
    return {"fst": None, "parts": parts, "search": (turbine,)}


ARGUMENTS = {
    "iea15_volturnus_s": {"fst": IEA / "IEA-15-240-RWT-UMaineSemi.fst", "discon": DISCON},
    "nrel5mw_iti_barge": of_fast("ITIBarge4"),
    "nrel5mw_oc4_semi": of_fast("OC4DeepCwindSemi"),
}
BESIDE = {"name", "source", "turbine", "shapes", "published", "protection"}  # not of a deck
# of the deck's MoorDyn file, while the import takes its MAP++ file
MOVING = {f"platform.line_dynamics.{key}" for key in MovingLine.model_fields}
BY_HAND = {  # keys of the built-in files whose values the import does not give
    "iea15_volturnus_s": {
        # CB of the deck's MAP++ file: the deck runs with its MoorDyn file, which has none
        *(f"platform.lines.{i}.seabed_friction" for i in range(3)),
        "platform.potential_flow.draft",  # of the report: the deck has no members
        "platform.options.blade_stations",  # a choice
        "platform.options.tower_potential",  # off in the built-in files
        "platform.options.tower_shadow",
    },
    # blade.polars: a folder, which another turbine shares
    "nrel5mw_iti_barge": {"turbine.blade.polars", "platform.options.tower_potential", *MOVING},
    "nrel5mw_oc4_semi": {"turbine.blade.polars", "platform.options.tower_potential", *MOVING},
}
FILES = {  # whose names differ
    "platform.tower.modes.distribution", "platform.potential_flow.coefficients", "turbine.discon",
    "turbine.blade_structure.distribution",
}  # fmt: skip


class Imported(NamedTuple):
    """What came out of a deck, and the built-in files that are made of it."""

    name: str
    folder: Path
    platform: object
    turbine: object
    built_in: Path  # platform file
    built_in_turbine: Path


@pytest.fixture(scope="module", params=ARGUMENTS)
def imported(request, tmp_path_factory):
    """Imported of each of the decks."""
    folder, name = tmp_path_factory.mktemp(request.param) / "out", request.param
    stored = read_platform(name)
    body, excitation = stored.potential_flow, None
    if name == "nrel5mw_oc4_semi":  # WAMIT's .3 of it is in no repository
        excitation = body.excitation_omega, body.heading, body.excitation
    import_deck(**ARGUMENTS[name], folder=folder, excitation=excitation, name=name)
    platform = read_platform(folder / "platform.toml")
    built_in = DATA / "platforms" / f"{name}.toml", DATA / "turbines" / stored.turbine / "turbine.toml"
    return Imported(name, folder, platform, read_turbine(platform.turbine), *built_in)


def flat(value, name):
    """{"table.key": number or text} of what a TOML file holds."""
    if not isinstance(value, dict | list):
        return {name: value}
    items = value.items() if isinstance(value, dict) else enumerate(value)
    return {place: leaf for key, item in items for place, leaf in flat(item, f"{name}.{key}").items()}


def of_files(platform, turbine):
    """Flat mapping of both, without what no deck has."""
    found = {}
    for name, path in (("platform", platform), ("turbine", turbine)):
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        found |= flat({key: value for key, value in tables.items() if key not in BESIDE}, name)
    return found


def alike(ours, stored):
    """Whether two values are one text, or numbers within 1e-9 of each other."""
    if isinstance(ours, str) or isinstance(stored, str):
        return ours == stored
    return ours == pytest.approx(stored, rel=1e-9, abs=0.0)


def table(path):
    """[[words or numbers]] of a CSV file without its comments."""
    lines = [line.split(",") for line in path.read_text().splitlines() if not line.startswith("#")]
    return [lines[0], *([cell if cell[0].isalpha() else float(cell) for cell in line] for line in lines[1:])]


def test_the_vendored_files_are_those_of_their_repositories():
    with (DECKS / "files.csv").open(encoding="utf-8") as file:
        listed = {row["file"]: row["sha256"] for row in csv.DictReader(file)}
    found = {path.relative_to(DECKS).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
             for path in DECKS.glob("*/**/*") if path.is_file()}  # fmt: skip
    assert found == listed


# --------------------------------------------------------------------------- the built-in files


def test_every_number_of_the_built_in_files_comes_from_the_deck(imported):
    ours = of_files(imported.folder / "platform.toml", imported.folder / "turbine" / "turbine.toml")
    stored = of_files(imported.built_in, imported.built_in_turbine)
    missing = object()
    apart = {key for key in ours.keys() | stored.keys()
             if not alike(ours.get(key, missing), stored.get(key, missing))}  # fmt: skip
    assert apart - FILES == BY_HAND[imported.name]
    assert len(ours) > 120


def test_blade_tower_and_polars_are_the_built_in_ones(imported):
    tables = tomllib.loads(imported.built_in_turbine.read_text())
    folder, ours = imported.built_in_turbine.parent, imported.folder / "turbine"
    polars, structure = (
        next(place / name for place in (folder, folder.parent) if (place / name).exists())
        for name in (tables["blade"]["polars"], tables["blade_structure"]["distribution"])
    )
    tower = imported.built_in.with_name(f"{imported.name}_tower.csv")
    pairs = [(ours / "blade.csv", folder / "blade.csv"), (imported.folder / "tower.csv", tower)]
    pairs += [(ours / "blade_structure.csv", structure)]
    pairs += [(path, polars / path.name) for path in (ours / "polars").iterdir()]
    assert len(pairs) == 3 + len(list(polars.iterdir()))
    for ours, stored in pairs:
        assert table(ours) == table(stored), ours.name


def test_coefficients_are_the_built_in_ones_at_the_periods_that_are_vendored(imported):
    with (np.load(imported.folder / "hydro.npz") as ours,
          np.load(imported.built_in.with_suffix(".npz")) as stored):  # fmt: skip
        assert {*ours.files} == {*stored.files}
        for axis, names in {
            "omega": ("added_mass", "damping"),
            "qtf_omega": ("qtf_value",),
            "excitation_omega": ("excitation",),
        }.items():
            if axis not in ours.files:
                continue
            at = np.searchsorted(stored[axis], ours[axis])
            assert len(at) > 10 and np.array_equal(stored[axis][at], ours[axis])
            for name in names:
                kept = stored[name][:, at][:, :, at] if name == "qtf_value" else stored[name][at]
                if name == "excitation":
                    kept = kept[:, np.searchsorted(stored["heading"], ours["heading"])]
                assert np.array_equal(ours[name], kept, equal_nan=True), name
                assert np.abs(kept).max() > 0.0
        for name in ("added_mass_zero", "added_mass_infinite", "stiffness"):
            assert np.array_equal(ours[name], stored[name]), name


def test_the_controller_s_file_and_its_table_of_the_rotor_are_the_built_in_ones(imported):
    """Every value of DISCON.IN, and every number of the table that it names beside itself."""
    stored = read_turbine(imported.built_in_turbine)
    if stored.discon is None:
        assert imported.turbine.discon is None
        return
    found = []
    for discon in map(Path, (imported.turbine.discon, stored.discon)):
        file = PartFile(discon, "DISCON.IN")
        values = {key: words for key, (_, words) in file.places.items() if key != "perffilename"}
        found.append((values, np.loadtxt(numbers_of(discon.with_name(file.text("PerfFileName"))))))
    assert found[0][0] == found[1][0] and len(found[0][0]) > 100
    assert np.array_equal(found[0][1], found[1][1]) and len(found[0][1]) > 1000


def numbers_of(path):
    """The numbers of a text, one a line."""
    return [word for line in path.read_text().splitlines() if line[:1] != "#" for word in line.split()]


def test_no_key_of_a_public_deck_is_unknown(imported):
    assert UNKNOWN not in (imported.folder / "report.md").read_text()


# --------------------------------------------------------------------------- OpenFAST's summaries

# of ElastoDyn of OpenFAST 2895884 in double precision; of the barge's tower and platform of FAST 8.16 in
# single precision (old-NWTC/FAST 0badc8d, CertTest/TstFiles/Test22.ED.sum)
NREL5MW = {
    "rotor mass": 109389.842, "blade mass": 17536.614, "first moment": 362132.653,
    "second moment": 11752352.265, "rotor inertia": 38677040.613, "tower-top mass": 349389.842,
    "hub height": 90.0,
}  # fmt: skip
SUMMARIES = {
    "iea15_volturnus_s": {
        "rotor mass": 274653.799, "blade mass": 68507.600, "first moment": 1890891.013,
        "second moment": 101086645.135, "rotor inertia": 350799553.174, "tower-top mass": 947759.799,
        "tower mass": 1466499.498, "platform mass": 17838000.000, "total mass": 20252259.297,
    },
    "nrel5mw_iti_barge": NREL5MW | {"tower mass": 347460.250, "platform mass": 5452000.000},
    "nrel5mw_oc4_semi": NREL5MW | {
        "tower mass": 249718.003, "platform mass": 3852180.000, "total mass": 4451287.845,
    },
}  # fmt: skip
PRECISION = {  # where it is less than the three decimals of a summary and the ten digits of our files
    ("nrel5mw_iti_barge", "tower mass"): 1e-7,
    ("nrel5mw_oc4_semi", "platform mass"): 2e-6,  # less the ballast water, of six digits
    ("nrel5mw_oc4_semi", "total mass"): 2e-6,
}
YAW_BEARING = {"iea15_volturnus_s": 28249.0}  # kg, YawBrMass: in our tower, in ElastoDyn's tower top
# of HydroDyn and MAP++ of OpenFAST 2895884; of the barge and of OC4's lines of FAST
# (Test22.HD.sum, Test22.MAP.sum, Test25.MAP.sum), OC4's moment of OpenFAST/r-test bf4b023
VOLUMES = {"iea15_volturnus_s": 20206.35, "nrel5mw_iti_barge": 6000.0, "nrel5mw_oc4_semi": 13917.0}  # m3
BALLAST_VOLUME = {"nrel5mw_oc4_semi": 9389.12}  # m3
BALLAST_MOMENT = {"nrel5mw_oc4_semi": 314.5924}  # N m, of its weight about the tower's axis
WEIGHTS = {"iea15_volturnus_s": 5844.12, "nrel5mw_iti_barge": 1227.15, "nrel5mw_oc4_semi": 1065.26}  # N/m


def test_masses_and_inertias_are_those_of_elastodyn_s_summary(imported):
    platform, rotor, said = imported.platform, imported.turbine.rotor, SUMMARIES[imported.name]
    bearing = YAW_BEARING.get(imported.name, 0.0)
    water = BALLAST_VOLUME.get(imported.name, 0.0) * platform.environment.water_density
    top = rotor.mass + imported.turbine.nacelle.mass + bearing
    ours = {
        "rotor mass": rotor.mass, "blade mass": rotor.blade_mass, "first moment": rotor.blade_first_moment,
        "second moment": rotor.blade_second_moment, "rotor inertia": rotor.inertia,
        "hub height": rotor.hub_height, "tower-top mass": top, "tower mass": platform.tower.mass - bearing,
        "platform mass": platform.ballast.mass - water,
        "total mass": top + platform.tower.mass - bearing + platform.ballast.mass - water,
    }  # fmt: skip
    for name, figure in said.items():
        allowed = PRECISION.get((imported.name, name), 1e-9)
        assert ours[name] == pytest.approx(figure, rel=allowed, abs=6e-4), name


def test_volumes_ballast_water_and_lines_are_those_of_hydrodyn_s_and_map_s_summaries(imported):
    name, platform = imported.name, imported.platform
    assert platform.potential_flow.volume == pytest.approx(VOLUMES[name], rel=1e-6)
    assert {round(line.wet_weight, 2) for line in platform.lines} == {WEIGHTS[name]}
    if name in BALLAST_MOMENT:
        moment = platform.ballast.mass * platform.ballast.cm_downwind * platform.environment.gravity
        assert moment == pytest.approx(BALLAST_MOMENT[name], rel=1e-4)


@pytest.mark.parametrize(
    ("floater", "platform"), [("ITIBarge4", "nrel5mw_iti_barge"), ("OC4DeepCwindSemi", "nrel5mw_oc4_semi")]
)
def test_the_lines_of_moordyn_1_are_those_of_map(floater, platform):
    """Of one deck, in its two files: places to the 4 cm by which they differ; the built-in file has both."""
    arguments = of_fast(floater)
    lines = {}
    for kind in ("MAP", "MoorDyn"):
        parts = arguments["parts"] | {"mooring": FAST / f"NRELOffshrBsline5MW_{floater}_{kind}.dat"}
        deck = read_deck(None, parts, arguments["search"])
        assert all(here != UNKNOWN for _, here in deck.notes)
        lines[kind] = sorted(deck.lines, key=lambda line: round(math.degrees(math.atan2(*line.anchor[:2]))))
    for ours, other in zip(lines["MAP"], lines["MoorDyn"], strict=True):
        assert other.anchor == pytest.approx(ours.anchor, abs=0.04)
        assert other.fairlead == pytest.approx(ours.fairlead, abs=0.04)
        assert (other.length, other.EA) == (ours.length, ours.EA)
        assert other.wet_weight == pytest.approx(ours.wet_weight, rel=1e-9)
        assert MovingLine(**other.dynamics) == read_platform(platform).line_dynamics
        assert ours.dynamics is None
