"""The plant against OpenFAST on the same cases: each test asserts the figure that was asked for.

Quick here: one decay, the steady curve, the regular wave; the rest is slow. What is missed is asserted with
its measured value and its cause, in a test whose name says so.
"""

import gzip
from dataclasses import replace

import numpy as np
import pytest
from series_figures import TIME, judged

from fowt_env.analysis.trim import trim
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.advance import output_row
from fowt_env.plant.aero.blade_elements import build_blade_elements, lift_drag
from fowt_env.plant.channels import Out
from fowt_env.plant.state import State
from fowt_env.scene.build import build_scene
from fowt_env.training.validation.comparison import Row, Study
from fowt_env.training.validation.openfast_cases import (
    FOLDER,
    PLATFORM,
    RUNS,
    box_wind,
    hub_wind,
    reference,
    steady_reference,
)
from fowt_env.training.validation.report import markdown, write_validation_report
from fowt_env.training.validation.signal_errors import (
    harmonics,
    normalised_rms,
)
from fowt_env.training.validation.validate import GROUPS, validate_cases
from fowt_env.weather.wind_field import read_box

# the targets, %, apart from the code that is judged; None: no target. The first line that fits counts:
# begin of the case, part of the quantity
TARGETS = (
    ("decay_", "period", 0.2),
    ("decay_", "logarithmic decrement", 3.0),
    ("decay_", "normalised rms error", 3.0),
    ("steady_", "RotSpeed", 0.2),
    ("steady_", "BldPitch1", 0.2),
    ("steady_", "aerodynamic", 0.3),
    ("float_steady_", "normalised rms error", 3.0),
    ("regwave_", "first harmonic as a vector", None),
    ("regwave_", "first harmonic", 1.0),
    ("second harmonic", "", None),
    ("float_windsteps_", "normalised rms error without mean", 5.0),
    ("turb_", "standard deviation", 3.0),
    ("turb_", "energy in", 5.0),
    ("turb_", "normalised rms error", 10.0),
)


def target(row):
    """Target (%) of a row of a study, or None."""
    fits = (t for case, what, t in TARGETS if row.case.startswith(case) and what in row.quantity)
    return next(fits)


# --------------------------------------------------------------------------- quick


@pytest.mark.installation
def test_total_mass_and_displacement_are_the_decks():
    platform, scene = read_platform(PLATFORM), build_scene(PLATFORM, fidelity="reference")
    assert scene.model.rigid_body.mass == pytest.approx(platform.published["total_mass"], abs=1.0)
    assert trim(scene)["FAIRTEN1"] == pytest.approx(911.4, rel=2e-3)


def test_an_error_of_either_sign_beyond_what_is_allowed_is_missed():
    for error in (3.0, -3.0, 3.01, -3.01, np.nan, np.inf):
        row = Row("case", "quantity", "m", 1.0, 1.0, error, 3.0)
        assert row.verdict == ("met" if abs(error) == 3.0 else "MISSED")
        assert replace(row, allowed=np.nan).verdict == "reported"


def test_a_study_has_errors_in_percent_of_the_reference():
    study = Study()
    for openfast, here in ((2.0, 2.1), (-2.0, -1.9), (0.0, 0.0), (0.0, 1e-9)):
        study.add("case", "quantity", "m", openfast, here, allowed=4.9)
    assert [row.error for row in study.rows] == pytest.approx([5.0, -5.0, 0.0, np.inf])
    assert [row.verdict for row in study.rows] == ["MISSED", "MISSED", "met", "MISSED"]
    assert list(study.table()["verdict"]) == [row.verdict for row in study.rows]


@pytest.mark.installation
def test_steady_winds_with_locked_platform_are_within_02_and_03_percent():
    study = Study()
    GROUPS["steady"][0](study)
    assert len(judged(study, target)) == 4 * len(steady_reference())


def test_the_tip_node_of_aerodyn_explains_its_thrust_and_torque_to_3e_5_at_every_wind_speed():
    """AeroDyn gives nodes at the very hub and tip an axial induction of 1; here the line load is zero there.

    Half of the outermost element (0.025 m of each blade) then carries the section's loads at the angle of
    attack -(twist + blade pitch) and no wind. Compared at OpenFAST's own rotor speed and blade pitch.
    """
    rotor = build_blade_elements(read_turbine(read_platform(PLATFORM).turbine), 1.225)
    width = 0.5 * (rotor.tip_radius - rotor.radius[-1])
    plain, explained = [], []
    for row in steady_reference().to_dict("records"):
        scene = build_scene(PLATFORM, wind=row["wind_mps"], fidelity="reference")
        x = np.zeros(scene.n_state)
        x[State.ROTOR_SPEED] = np.radians(6.0 * row["rotor_speed_rpm"])
        x[State.BLADE_PITCH] = np.radians(row["blade_pitch_deg"])
        loads = output_row(scene.handle(), x, np.zeros(2), 0.0, len(scene.channels))[
            [Out.RTFLDFXH, Out.RTFLDMXH]
        ]
        lift, drag, _, _ = lift_drag(-(rotor.twist[-1] + x[State.BLADE_PITCH]), rotor.foil[-1], rotor.polars)
        pressure = 0.5 * rotor.air_density * (x[State.ROTOR_SPEED] * rotor.tip_radius) ** 2
        tip = rotor.blades * width * pressure * rotor.chord[-1] * np.array([lift, -drag * rotor.tip_radius])
        theirs = 1e3 * np.array([row["aero_thrust_kN"], row["aero_torque_kNm"]])
        plain.append(loads / theirs - 1.0)
        explained.append((loads + tip) / theirs - 1.0)
    assert np.abs(plain).max() > 8e-4
    assert np.abs(explained).max() < 3e-5


@pytest.mark.installation
@pytest.mark.parametrize("case", ["regwave_H3T5", "regwave_H3T5_displaced"])
def test_first_harmonics_in_a_regular_wave_are_within_1_percent(case):
    pair = [frame[frame[TIME] >= 400.0 - 1e-6] for frame in (RUNS[case].frame(), reference(case))]
    omega = 2.0 * np.pi / 5.0
    for channel in ("PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]", "FAIRTEN1_[kN]", "FAIRTEN2_[kN]"):
        mine, wanted = (
            harmonics(f[TIME].to_numpy()[:-1], f[channel].to_numpy()[:-1], omega)[0] for f in pair
        )
        assert abs(mine - wanted) < 0.01 * abs(wanted)


def test_references_carry_their_settings_and_stay_small():
    sizes = {path: path.stat().st_size for path in FOLDER.rglob("*.*z")}
    for path in sizes:
        if path.suffix == ".gz":
            with gzip.open(path, "rt") as file:
                assert file.readline().startswith("# ")
    assert sum(sizes.values()) < 13e6


@pytest.mark.installation
def test_the_stored_region_of_the_box_holds_the_recorded_hub_wind():
    box = read_box(box_wind(), hub_height=90.0, rotor_diameter=126.0)
    theirs = reference("turb_18mps_Hs7.5_box")
    assert box.usable >= theirs[TIME].iloc[-1]
    wind = hub_wind()
    chosen = wind["time"] <= 600.0
    hub = box.at(wind["time"][chosen], 0.0, 0.0, 90.0)[:, 0]
    assert np.abs(hub - wind["speed"][chosen]).max() < 0.03  # rounded to 0.04 m/s


def test_unknown_platforms_and_cases_and_missing_references_are_named(tmp_path):
    for groups, settings, named in (
        (["decay"], {}, "decays"), (["steady"], {"platform": "iea15_volturnus_s"}, "decays"),
        (None, {"platform": "volturnus"}, "iea15_volturnus_s"),
        (["decays"], {"folder": tmp_path}, "reference"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=named):
            validate_cases(groups, **settings)


def test_the_report_has_every_figure_and_its_plots(tmp_path):
    pytest.importorskip("matplotlib")
    study = validate_cases(["decays"])
    judged(study, target)
    paths = write_validation_report(study, tmp_path)
    text = (tmp_path / "validation.md").read_text()
    assert text.count("\n| ") == len(study.rows) + 6 == 30  # heads of 6 tables
    assert "`fowt dev validate --platform oc3_hywind --case decays`" in text
    assert "missed" not in text and text.index("![decays](decays.png)") < text.index("## decay_surge")
    study.rows[0] = replace(study.rows[0], error=50.0)
    assert "| **50, missed** | 0.2 |" in markdown(study)
    assert all(path.stat().st_size > 0 for path in paths) and len(paths) == 3


# --------------------------------------------------------------------------- slow


@pytest.mark.nightly
def test_floating_steady_winds_are_within_3_percent_but_for_pitch_at_18_mps_after_100_s():
    """Missed with 3.9 %: 0.003 deg of a record whose deviation is 0.08 deg.

    With AeroDyn's tip node (0.1 % of thrust, see the quick test) and strip forces along the undisplaced
    axis, as HydroDyn has them, the same figure is 0.4 % (docs/results/validation.md).
    """
    known = "float_steady_18mps: PtfmPitch, normalised rms error, t >= 100 s"
    rows = judged(validate_cases(["floating"]), target, known)
    (row,) = [r for r in rows if f"{r.case}: {r.quantity}" == known]
    assert row.error == pytest.approx(3.88, abs=0.2)


@pytest.mark.nightly
def test_regular_wave_second_harmonics_come_from_position_and_surface_as_in_openfast():
    rows = judged(validate_cases(["waves"]), target)
    second = {r.case: r for r in rows if r.case.startswith("second") and "PtfmSurge" in r.quantity}
    fixed, moved, surface, both = (
        second[f"second harmonic, position {position}, surface {surface}"]
        for surface in ("swl", "instantaneous")
        for position in ("fixed", "instantaneous")
    )
    assert fixed.here < 0.05 and fixed.openfast < 0.05
    assert moved.here == pytest.approx(moved.openfast, rel=0.05)
    assert both.here == pytest.approx(moved.here + surface.here, rel=0.05)


@pytest.mark.nightly
def test_wind_steps_are_within_5_percent_rms_at_every_wind_speed():
    assert len(judged(validate_cases(["steps"]), target)) == 39


@pytest.mark.slow
def test_the_first_minutes_of_turbulence_with_irregular_waves_are_openfasts():
    """Within the 10 % that are allowed over the whole records, which the next test has."""
    case = "turb_18mps_Hs7.5_box"
    ours, theirs = replace(RUNS[case], duration=200.0).frame(), reference(case)
    late = ours[TIME] > 100.0
    for channel in ("PtfmPitch_[deg]", "RotSpeed_[rpm]"):
        assert normalised_rms(ours[channel][late], theirs[channel][: len(ours)][late]) < 0.10


@pytest.mark.nightly
def test_turbulence_with_irregular_waves_meets_every_figure_in_both_winds():
    assert len(judged(validate_cases(["turbulence"]), target)) == 2 * 21


@pytest.mark.nightly
def test_cheaper_choices_cost_what_the_documentation_says():
    study = validate_cases(["costs"])
    found = {(row.case, row.quantity): row.error for row in study.rows}

    def error(case, quantity):
        (value,) = [e for (c, q), e in found.items() if c.startswith(case) and q == quantity]
        return value

    assert error("tabulated rotor", "RotSpeed, normalised rms error") < 2.0
    assert error("hub wind blown uniformly", "RotSpeed, standard deviation") > 30.0
    assert abs(error("rotor-averaged wind with", "RotSpeed, standard deviation")) < 10.0
    assert abs(error("generator", "u: std of the rotor average over that of a point")) < 10.0
