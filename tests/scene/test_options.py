"""Each row of ROTORS and FIDELITIES: it builds what it says, and errs by no more than it says."""

import csv
from pathlib import Path

import numpy as np
import pytest
from plant_helpers import state

import fowt_env
from fowt_env import build_scene
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.aero.load import rotor_part
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.hydro.load import BandedStrips, ExactStrips
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.state import pose_of
from fowt_env.scene.options import FIDELITIES, ROTORS
from fowt_env.training.validation.openfast_cases import box_wind

ACCURACY = Path(fowt_env.__file__).resolve().parent.parent / "docs" / "figures" / "accuracy.csv"
STRIPS = {"exact": ExactStrips, "fast": BandedStrips}
EXACT = min(ROTORS, key=lambda name: ROTORS[name].error)
# wind (m/s), rotor speed (rad/s), blade pitch (rad) of operation from cut-in to cut-out
OPERATION = ((5.0, 0.75, 0.0), (8.0, 0.96, 0.0), (11.4, 1.267, 0.0), (18.0, 1.267, 0.26), (24.0, 1.267, 0.39))


def stored_errors(axis):
    """{(rotor, variant): largest error over the seeds} of an axis of docs/figures/accuracy.csv."""
    found = {}
    with ACCURACY.open() as lines:
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            if row["axis"] in axis:
                key = row["rotor"], row["variant"]
                found[key] = max(found.get(key, 0.0), float(row["worst"]))
    return found


# Rotors


def load_of(name, wind, speed, blade_pitch, density=1.225):
    """(thrust, torque, wrench) of a rotor in uniform wind, mean over a turn: (8,)."""
    platform = read_platform("oc3_hywind")
    site = platform.environment.model_copy(update={"air_density": density})
    scene = build_scene(
        platform.model_copy(update={"environment": site}),
        wind=float(wind),
        rotor=name,
        shear_exponent=0.0,
        fidelity="reference",
    )
    aero, counters = scene.model.aero, np.zeros(N_COUNTERS)
    rows = []
    for azimuth in np.linspace(0.0, 2.0 * np.pi / 3.0, 8, endpoint=False):
        x = state(rotor_speed=speed, blade_pitch=blade_pitch, azimuth=azimuth)
        now = wind_now(0.0, aero.wind)
        found = rotor_part(0.0, pose_of(x), x, now, aero, aero.rotor, np.zeros_like(x), counters, None, None)
        rows.append([found.thrust, found.torque, *found.wrench])
    return np.mean(rows, axis=0)


@pytest.mark.parametrize("name", ROTORS)
def test_its_loads_in_operation_are_those_of_the_exact_one(name):
    exact = np.array([load_of(EXACT, *point) for point in OPERATION])
    loads = np.array([load_of(name, *point) for point in OPERATION])
    assert np.all(np.isfinite(loads)) and np.all(loads[:, :2] > 0.0)
    # uniform wind: the same solution but for the interpolation in tables, 0.1 % in operation
    assert np.all(np.abs(loads - exact)[:, :2].max(axis=0) < 1e-3 * exact[:, :2].max(axis=0))


@pytest.mark.parametrize("name", ROTORS)
def test_no_density_and_no_wind_at_rest_are_no_load(name):
    assert not load_of(name, *OPERATION[1], density=0.0).any()
    assert not load_of(name, 0.0, 0.0, 0.0).any()


@pytest.mark.parametrize("option", ["dynamic_inflow", "skewed_wake"])
@pytest.mark.parametrize("name", ROTORS)
def test_a_wake_is_taken_by_those_that_have_it_and_refused_by_the_others(name, option):
    if option in ROTORS[name].supports:
        assert build_scene(wind=8.0, rotor=name, **{"fidelity": "reference"} | {option: True}).rotor == name
        return
    with pytest.raises(InputError, match=f"rotor = '{name}': does not support {option}, which needs rotor"):
        build_scene(wind=8.0, rotor=name, **{"fidelity": "reference"} | {option: True})


@pytest.mark.parametrize("wanted", [{"dynamic_inflow"}, {"skewed_wake"}, {"dynamic_inflow", "skewed_wake"}])
@pytest.mark.parametrize("level", FIDELITIES)
def test_a_level_has_the_cheapest_rotor_with_the_wake_that_is_wanted(level, wanted):
    found = build_scene(wind=8.0, fidelity=level, **dict.fromkeys(wanted, True)).rotor
    assert found == ("bem" if level == "reference" else "lookup")


def test_the_wake_lags_no_less_than_the_step_follows():
    scene = build_scene(wind=8.0, fidelity="standard", dynamic_inflow=True)
    assert scene.model.aero.rotor.wake.least == pytest.approx(1.25 * 0.1 / 0.3)
    assert scene.with_step(0.05).model.aero.rotor.wake.least == pytest.approx(1.25 * 0.05 / 0.3)


@pytest.mark.parametrize("option", [{"dynamic_inflow": True}, {"unsteady_airfoils": "hgm"}], ids=str)
def test_a_step_gives_one_scene_so_that_its_trim_is_computed_once(option):
    scene = build_scene(wind=8.0, fidelity="standard", **option)
    assert scene.with_step(scene.dt) is scene
    assert scene.with_step(0.05) is scene.with_step(0.05) is not scene


@pytest.mark.parametrize("name", ROTORS)
def test_a_box_of_wind_is_met_by_the_blades_or_averaged(name):
    scene = build_scene(wind=box_wind(), rotor=name, duration=100.0, fidelity="reference")
    assert (scene.model.aero.field is not None) == ROTORS[name].full_field


def test_its_error_is_the_largest_of_the_stored_ones():
    stored = {rotor: worst for (rotor, _), worst in stored_errors(["rotor"]).items()}
    assert {EXACT, *stored} == set(ROTORS) and ROTORS[EXACT].error == 0.0
    for name, worst in stored.items():
        assert worst <= ROTORS[name].error <= 2.0 * worst


# Fidelities


@pytest.mark.parametrize("name", FIDELITIES)
def test_a_level_has_its_parts_and_its_step(name):
    level, scene = FIDELITIES[name], build_scene(wind=12.0, sea="paper_wind_wave", fidelity=name)
    model = scene.model
    assert scene.rotor == level.rotor and type(model.hydro.strips) is STRIPS[level.wave_loads]
    assert scene.options["integrator"] == level.integrator
    assert type(model.integrator) is type(INTEGRATORS[level.integrator].part)
    assert (model.mooring.table is not None) == (level.mooring == "table")
    bends = name == "elastic"
    modes = [0 if part is None else len(part.beam.count) for part in (model.blades, model.tower)]
    assert modes == ([3, 4] if bends else [0, 0]) and (model.shaft is not None) == bends
    assert (scene.options["dynamic_inflow"] is True) == bends
    own = level.dt or INTEGRATORS[level.integrator].dt
    assert 0.0 < scene.dt <= own if bends else scene.dt == own


@pytest.mark.parametrize("name", [name for name in FIDELITIES if name != "elastic"])
def test_what_is_given_overrides_a_level(name):
    for rotor in ROTORS:
        assert build_scene(wind=12.0, fidelity=name, rotor=rotor).rotor == rotor
    for loads, kind in STRIPS.items():
        assert type(build_scene(fidelity=name, wave_loads=loads).model.hydro.strips) is kind
    for integrator, method in INTEGRATORS.items():
        scene = build_scene(fidelity=name, integrator=integrator)
        assert type(scene.model.integrator) is type(method.part)
        own = integrator == FIDELITIES[name].integrator and FIDELITIES[name].dt
        assert scene.dt == (own or method.dt)
    for mooring in ("catenary", "table"):
        table = build_scene(fidelity=name, mooring=mooring).model.mooring.table
        assert (table is not None) == (mooring == "table")


def test_what_is_given_overrides_the_bending_parts_of_a_level():
    rigid = {"blades": "rigid", "tower": "rigid", "shaft": "rigid", "dynamic_inflow": False}
    scene = build_scene(wind=12.0, fidelity="elastic", **rigid)
    assert scene.model.structure is None
    assert scene.dt == build_scene(wind=12.0).dt and scene.n_state == build_scene(wind=12.0).n_state
    assert len(build_scene(wind=12.0, fidelity="elastic", blades="modes").model.blades.beam.count) == 2
    assert build_scene(wind=12.0, fidelity="elastic", rotor="bem").rotor == "bem"
    with pytest.raises(InputError, match="rotor = 'table': does not support dynamic_inflow"):
        build_scene(wind=12.0, fidelity="elastic", rotor="table")


def test_a_bending_level_names_what_a_turbine_lacks():
    platform = read_platform("oc3_hywind")
    whole = read_turbine(platform.turbine)
    for lacking, option, modes in (
        ("blade_structure", "blades", "modes2"),
        ("shaft_torsion", "shaft", "torsion"),
    ):
        turbine = whole.model_copy(update={lacking: None})
        with pytest.raises(InputError, match=rf"{option} = '{modes}': .* has no \[{lacking}\]"):
            build_scene(wind=12.0, fidelity="elastic", turbine=turbine)
        scene = build_scene(wind=12.0, fidelity="elastic", turbine=turbine, **{option: "rigid"})
        assert scene.model.tower is not None and getattr(scene.model, option) is None


def test_levels_err_as_stored_each_more_than_the_one_before():
    stored = stored_errors(["reference", "all together"])
    for level in (level for level in FIDELITIES.values() if level.blades == "rigid"):
        dt = level.dt or INTEGRATORS[level.integrator].dt
        tabled = ", mooring by table" if level.mooring == "table" else ""
        variant = f"{level.integrator} {dt:g} s, {level.rotor}, {level.wave_loads} waves{tabled}"
        assert stored[level.rotor, variant] <= level.error <= 2.0 * stored[level.rotor, variant]
    errors = [level.error for level in FIDELITIES.values()]
    assert errors == sorted(errors)
