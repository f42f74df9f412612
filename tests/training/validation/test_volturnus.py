"""VolturnUS-S against OpenFAST: the figures of each group, and what is allowed, apart from what judges it."""

import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import series_figures as figures

from fowt_env.training.validation import linear_cases
from fowt_env.training.validation.openfast_cases import FOLDER, ReferenceRun, without_rosco
from fowt_env.training.validation.report import _decays
from fowt_env.training.validation.validate import validate_cases
from fowt_env.training.validation.volturnus import PLATFORM, RUNS, _structural_flap

REFERENCES = FOLDER / PLATFORM
# group, part of the case, part of the quantity, what is allowed (%, None: nothing is); the first that fits
ALLOWED = (
    ("decays", "", "period", 0.5),
    ("decays", "", "decrement", 5.0),
    ("decays", "", "rms", 4.0),
    ("regular", "", "first harmonic", 1.0),
    ("waves", "qtf", "standard deviation", 5.0),
    ("waves", "", "standard deviation", 2.0),
    ("rotor", "shear", "", 2.0),
    ("rotor", "", "", 0.5),
    ("blades", "against bem", "mean", 1.0),
    ("blades", "", "mean", 2.0),
    ("blades", "", "harmonic", 5.0),
    ("floating", "", "standard deviation", 3.0),
    ("tower", "decay", "frequency", 1.0),
    ("tower", "decay", "damping ratio", 5.0),
    ("tower", "decay", "period", 0.5),
    ("tower", "decay", "decrement", 5.0),
    ("tower", "decay", "rms", 4.0),
    ("tower", "turb", "TwrBsMyt, standard deviation", 5.0),
    ("tower", "turb", "TTDspFA, standard deviation", 5.0),
    *(("tower", "turb", name, None) for name in ("TwrBsMxt", "TTDspSS", "NcIMUTAxs")),
    ("tower", "turb", "standard deviation", 3.0),
    ("linear", "linear model", "frequency", 3.0),
    ("linear", "linear model", "damping ratio", 10.0),
    ("linear", "linear model", "rotor pole", 10.0),
    ("memory", "", "rms error", 1.0),
)


def allowed(group):
    """Function of a row of a group: what is allowed, %; None: it is reported."""

    def of(row):
        if group == "rest":  # 0.02 m or deg
            return 100.0 * 0.02 / abs(row.openfast)
        rules = (r for r in ALLOWED if r[0] == group and r[1] in row.case and r[2] in row.quantity)
        return next((wanted for *_, wanted in rules), None)

    return of


def stored():
    """Figures of OpenFAST's tables without time, and the sizes and damping ratios that follow from them."""
    found = []
    for name in ("steady", "blade_loads", "linear_poles", "linear_responses"):
        table = pd.read_csv(REFERENCES / f"{name}.csv.gz", comment="#")
        number = table.select_dtypes("number")
        found += [np.ravel(factor * number) for factor in (1.0, 1e-3, 180.0 / np.pi)]
        found += [
            np.hypot(table[f"cos{k}_kNm"], table[f"sin{k}_kNm"]) for k in (1, 3) if f"cos{k}_kNm" in table
        ]
        found += [np.hypot(table["real"], table["imag"])] if "real" in table else []
        for mode in ("surge", "heave", "pitch"):
            if f"{mode}_real" in table:
                real, imag = table[f"{mode}_real"], table[f"{mode}_imag"]
                found.append(-real / np.hypot(real, imag))
    return np.concatenate(found)


def judged(group, *exceptions):
    """Rows of a group as figures.judged has them; OpenFAST's figures without time are those of the tables."""
    runs, plain = {}, ReferenceRun.frame

    def kept(run, *arguments, **options):
        frame = runs[run.case, options.get("radiation")] = plain(run, *arguments, **options)
        return frame

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ReferenceRun, "frame", kept)
        study = validate_cases([group], platform=PLATFORM)
    if group in ("rotor", "blades", "linear"):
        known = stored()
        for row in study.rows:
            assert "against bem" in row.case or np.isclose(known, row.openfast, rtol=1e-9, atol=0.0).any(), (
                row
            )
    return figures.judged(study, allowed(group), *exceptions, runs=runs)


# --------------------------------------------------------------------------- quick


def test_root_moment_of_a_hanging_blade_is_its_weight_at_its_arm():
    """Without tilt and cone neither weight nor rotation bends a straight blade out of the rotor plane."""

    class Rotor:
        shaft_tilt, cone, hub_radius = 0.0, 0.0, 3.97

    assert _structural_flap(Rotor, 0.8) == (0.0, 0.0)
    Rotor.shaft_tilt = np.radians(6.0)
    mean, cosine = _structural_flap(Rotor, 0.8)
    assert mean == pytest.approx(68507.6 * 27.601 * 9.81 * np.sin(np.radians(6.0)))
    assert cosine == 0.0
    Rotor.shaft_tilt, Rotor.cone = 0.0, np.radians(4.0)
    mean, cosine = _structural_flap(Rotor, 0.0)
    # azimuth 0 and 180 deg; x downwind, z up: a moment around y bends the tip downwind
    for up in (1.0, -1.0):
        centre = 27.601 * np.array([-np.sin(Rotor.cone), 0.0, up * np.cos(Rotor.cone)])
        moment = np.cross(centre, [0.0, 0.0, -68507.6 * 9.81])[1]
        assert mean + up * cosine == pytest.approx(up * moment)


def test_holding_a_coordinate_leaves_the_model_of_the_smaller_mass_matrix():
    sys.path.insert(0, str(FOLDER))
    try:
        from reduce_linear import HELD, hold_tower
    finally:
        sys.path.remove(str(FOLDER))
    draw = np.random.default_rng(3)
    mass = draw.normal(size=(5, 5))
    mass = mass @ mass.T + 5.0 * np.eye(5)
    mass[4, :4] = mass[:4, 4] = 0.0  # the rotor
    stiffness, damping = np.diag([1.0, 2.0, 3.0, 400.0, 0.0]), np.diag([0.1, 0.1, 0.1, 0.0, 0.5])
    load = draw.normal(size=(5, 1))
    inverse = np.linalg.inv(mass)
    full = np.block([[np.zeros((5, 5)), np.eye(5)], [-inverse @ stiffness, -inverse @ damping]])
    held, by = hold_tower(full, np.vstack([np.zeros((5, 1)), inverse @ load]))
    kept = [0, 1, 2]
    small = np.linalg.inv(mass[np.ix_(kept, kept)])
    assert held[3:6, :3] == pytest.approx(-small @ stiffness[np.ix_(kept, kept)], abs=1e-12)
    assert held[3:6, 3:6] == pytest.approx(-small @ damping[np.ix_(kept, kept)], abs=1e-12)
    assert by[3:6] == pytest.approx(small @ load[kept], abs=1e-12)
    assert linear_cases.named_poles(held, HELD)["rotor"] == pytest.approx(-0.5 / mass[4, 4])


def test_the_reference_poles_hardly_depend_on_how_the_tower_is_held():
    poles = pd.read_csv(REFERENCES / "linear_poles.csv.gz", comment="#")
    assert len(poles) == 20 and set(poles["azimuths"]) == {12}
    above = poles[poles["wind_mps"] >= 12.0]
    for name, within in (("surge", 2e-3), ("heave", 2e-3), ("pitch", 0.015)):
        assert np.allclose(above[f"{name}_imag_other"], above[f"{name}_imag"], rtol=within)
        # and the tower's own give moves them by little
        assert np.allclose(above[f"{name}_imag_flexible"], above[f"{name}_imag"], rtol=0.02)


def test_the_older_deck_has_the_masses_of_its_files():
    platform, turbine = linear_cases.old_deck()
    assert platform.tower.mass == pytest.approx(1263e3, rel=1e-3)
    assert turbine.nacelle.mass + turbine.rotor.mass == pytest.approx(991.4e3, rel=1e-3)
    assert turbine.rotor.tip_radius == 120.0 and turbine.rotor.hub_height == pytest.approx(150.0, abs=0.01)
    assert turbine.blade.radius[0] > turbine.rotor.hub_radius
    assert platform.environment.gravity == 9.80665


def test_panels_of_two_decays_of_one_motion_say_which_has_the_bending_tower(tmp_path):
    pytest.importorskip("matplotlib")
    frame = pd.DataFrame({figures.TIME: [0.0, 1.0]}).assign(
        **{channel: [1.0, 0.0] for run in RUNS.values() for channel in run.initial}
    )
    study = SimpleNamespace(cases=RUNS, runs=dict.fromkeys(RUNS, (frame, frame)))
    labels = [axes.get_ylabel() for axes in _decays(study, tmp_path / "decays.png").axes]
    assert len(set(labels)) == len(labels) == 5
    assert labels[-1] == "platform pitch\nbending tower\n(deg)" and "platform pitch\n(deg)" in labels


# --------------------------------------------------------------------------- slow


@pytest.mark.slow
def test_rest_decays_and_the_regular_wave_meet_every_figure():
    for group in ("rest", "decays", "regular"):
        assert judged(group)


@pytest.mark.nightly
def test_a_tower_that_bends_rings_and_loads_its_base_as_openfast_s():
    rows = judged("tower")
    assert {row.allowed for row in rows if "frequency" in row.quantity} == {1.0}
    if not without_rosco():
        bands = [row for row in rows if "Hz (" in row.quantity]
        assert [row.allowed for row in bands] == 3 * [5.0]
        assert all(abs(row.error) < 1.0 for row in bands)


@pytest.mark.nightly
def test_motions_in_irregular_waves_have_openfast_s_deviations():
    rows = judged("waves")
    assert {row.allowed for row in rows if "standard" in row.quantity} == {2.0, 5.0}


@pytest.mark.nightly
def test_rotor_loads_in_steady_wind_miss_small_hub_moments_alone():
    """Thrust, torque and root moments within 0.06 %; moments about the hub that are 0.1 % of the torque."""
    rows = judged("rotor", "moment at the hub")
    for row in rows:
        if "thrust" in row.quantity or "torque" in row.quantity or "RootMyc" in row.quantity:
            assert abs(row.error) < 0.1, f"{row.case}: {row.quantity}"
        if "moment at the hub" in row.quantity:
            torque = {r.case: r.openfast for r in rows if r.quantity == "aerodynamic torque"}[row.case]
            assert abs(row.here - row.openfast) < 1e-3 * torque, f"{row.case}: {row.quantity}"


@pytest.mark.nightly
def test_blades_one_by_one_miss_with_the_look_up_alone_what_a_skewed_wake_makes():
    """Every figure is met by bem, which has that wake; the look-up has the loads of bem without it."""
    known = ("RootMyc1, first", "RootMyc2, first", "RootMyc3, first", "YawBrMzp, mean", "TwrBsMxt, mean")
    rows = judged("blades", *(f", lookup: {part}" for part in known))
    assert len(rows) == 80
    for row in rows:
        if "(against bem" in row.case:
            assert abs(row.error) < 0.01, f"{row.case}: {row.quantity}"


@pytest.mark.nightly
def test_motions_under_rosco_have_openfast_s_deviations():
    if without_rosco():
        pytest.skip(without_rosco())
    rows = judged("floating")
    assert len(rows) == 3 * 7 * 3 + 3 * 3  # sway, roll and yaw in turbulence


@pytest.mark.nightly
def test_linear_models_miss_the_damping_of_heave_alone():
    rows = judged("linear", "heave mode, damping ratio")
    assert len([row for row in rows if row.verdict == "met"]) == 5 * 6


@pytest.mark.nightly
def test_states_of_the_radiation_memory_stay_within_1_percent_of_convolution():
    assert len(judged("memory")) == 6
