"""The paper's claims on the 1:50 model and at full scale, each as a test that can fail."""

import numpy as np
import pytest
from plant_helpers import rates, state
from typer.testing import CliRunner

import fowt_env
from fowt_env.analysis.trim import trim_prescribed
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.state import State
from fowt_env.training.cli.app import app
from fowt_env.training.studies.froude_model import identify
from fowt_env.training.studies.paper import load_cases
from fowt_env.training.studies.paper import report as paper_report

TABLE_1 = {"surge": 10.24, "sway": 10.24, "heave": 3.66, "roll": 4.27, "platform_pitch": 4.27, "yaw": 3.15}


def study(test):
    """Leave a claim of the paper to the nightly tests: it needs runs of all load cases."""
    return pytest.mark.nightly(test)


@pytest.fixture(scope="module")
def model():
    return read_platform(load_cases.PLATFORM)


@pytest.fixture(scope="module")
def natural():
    return load_cases.natural_frequencies()


@pytest.fixture(scope="module")
def runs():
    return {name: load_cases.run_load_case(name) for name in load_cases.CASES}


def verdicts(runs, natural):
    return {claim.text: claim.holds for claim in load_cases.claims(runs, natural)}


# The model


def test_the_six_computed_periods_of_table_1_are_met_within_half_a_percent():
    periods = fowt_env.natural_periods(fowt_env.build_scene(load_cases.PLATFORM, fidelity="reference"))
    assert periods == pytest.approx(TABLE_1, rel=0.005)


def test_only_lines_hold_the_model_which_floats_at_its_design_draft(model):
    assert model.hydro.yaw_stiffness == 0.0
    assert len(model.lines) == 6
    for line in model.lines:
        assert min(line.length, line.wet_weight, line.EA) > 0.0
        rest = identify.pull_at_rest(line)
        assert rest.regime == 2 and rest.anchor_tension > 0.9 * rest.fairlead_tension  # taut, no touchdown
    assert min(model.ballast.mass, *model.ballast.inertia) > 0.0
    # the nacelle's offset leans it by a tenth of a degree, which lowers it a little
    assert abs(fowt_env.trim(fowt_env.build_scene(model, fidelity="reference"))["PtfmHeave"]) < 1e-4


def test_the_model_is_oc3_hywind_by_froude_but_for_what_was_identified(model):
    full = read_platform("oc3_hywind")
    assert np.allclose(np.array(model.hull.z) * 50.0, full.hull.z)
    assert np.allclose(np.array(model.hull.diameter) * 50.0, full.hull.diameter)
    factor = 50.0**3 * full.environment.water_density / model.environment.water_density
    assert model.tower.mass * factor == pytest.approx(full.tower.mass)
    assert model.ballast.mass * factor == pytest.approx(full.ballast.mass, rel=0.03)  # identified: 2.5 % less
    assert model.ballast.inertia[0] * factor * 2500.0 == pytest.approx(full.ballast.inertia[0], rel=0.04)
    turbine, original = read_turbine(model.turbine), read_turbine(full.turbine)
    assert np.allclose(turbine.blade.chord * 50.0, original.blade.chord)
    for name, polar in original.blade.polars.items():
        weakened = polar * np.array([1.0, *[model.published["polar_factor"]] * 3])
        assert np.allclose(turbine.blade.polars[name], weakened, rtol=1e-6, atol=1e-6)


def test_rated_thrust_is_froude_scaled_in_lc2_with_the_one_polar_factor(model):
    scene = fowt_env.build_scene(model, wind=3.36, fidelity="reference")
    point = trim_prescribed(scene, 85.6 * np.pi / 30.0, 0.0, platform="fixed")
    assert point["RtFldFxh"] == pytest.approx(703e3 / 50.0**3 * 1000.0 / 1025.0, rel=1e-4)


@pytest.mark.slow
def test_the_committed_model_is_what_the_identification_gives(model):
    again = identify.identify()
    assert again.ballast.mass == pytest.approx(model.ballast.mass, rel=1e-6)
    assert again.ballast.inertia[0] == pytest.approx(model.ballast.inertia[0], rel=1e-6)
    for one, other in zip(again.lines, model.lines, strict=True):
        assert (one.length, one.EA, *one.anchor) == pytest.approx(
            (other.length, other.EA, *other.anchor), rel=1e-6
        )


def test_a_driven_rotor_turns_the_platform_as_equation_20_says(model):
    # difference to a standing rotor: M1 nu' = -H (0, 0, 0, w_b', w_b w_z, -w_b w_y) with w_b' = 0
    scene = fowt_env.build_scene(model, hydrodynamics=False, mooring=False, fidelity="reference")
    body = scene.model.rigid_body._replace(rotor_fixed=True)
    scene = scene.with_model(rigid_body=body)
    spinning = state(vx=0.1, wy=0.2, wz=-0.3, rotor_speed=8.96)
    standing = spinning.copy()
    standing[State.ROTOR_SPEED] = 0.0
    change = rates(scene, spinning)[State.VX : State.WZ + 1] - rates(scene, standing)[State.VX : State.WZ + 1]
    moment = -body.coupling * 8.96 * np.array([0.0, 0.0, 0.0, 0.0, -0.3, -0.2])
    assert body.mass_matrix @ change == pytest.approx(moment, abs=1e-12)
    assert rates(scene, spinning)[State.ROTOR_SPEED] == 0.0


# The mooring, Fig. 5


@pytest.mark.parametrize("platform", [load_cases.PLATFORM, "oc3_hywind"])
@pytest.mark.parametrize("direction", ["surge", "sway"])
def test_a_static_pull_is_zero_at_rest_and_grows_with_the_offset(platform, direction):
    offsets = np.linspace(-1.0, 1.0, 21) * {load_cases.PLATFORM: 0.25, "oc3_hywind": 20.0}[platform]
    table = load_cases.static_pull(read_platform(platform), direction, offsets)
    force = table["force_[N]"].to_numpy()
    assert abs(force[10]) < 1e-6 * np.abs(force).max()
    assert np.all(np.diff(force) > 0.0)
    tensions = table[[name for name in table if name.startswith("tension")]].to_numpy()
    assert np.all(tensions > 0.0)
    if direction == "surge":  # line 1 lies downwind of the tower: moving there slackens it
        assert np.all(np.diff(tensions[:, 0]) < 0.0)


# Claims of the figures


@study
def test_every_claim_of_figures_6_to_12_holds(runs, natural):
    found = verdicts(runs, natural)
    assert len(found) == 14 and all(found.values()), found


@study
def test_the_judge_sees_no_double_frequency_where_waves_act_at_rest(natural):
    # fixed position and still-water integration leave 0.05 % at twice the frequency
    frame = load_cases.run_load_case("LC5", kinematics_position="fixed", surface="swl", stretching="none")
    found = verdicts({"LC5": frame}, natural)
    assert found["LC5: surge spectrum peaks at the wave frequency"]
    assert not found["LC5: surge spectrum peaks at twice the wave frequency"]


@study
def test_the_judge_sees_no_peaks_of_the_other_case(runs, natural):
    found = verdicts({"LC11": runs["LC3"]}, natural)  # wind alone
    assert not found["LC11: pitch spectrum peaks at the wave frequency"]


@study
def test_the_pitch_peak_of_a_regular_wave_is_its_start(runs, natural):
    late = load_cases.settled(runs["LC5"], 300.0)
    late = late.assign(**{load_cases.TIME: late[load_cases.TIME] - 300.0})
    found = verdicts({"LC5": late}, natural)
    assert not found["LC5: surge spectrum peaks at the pitch frequency"]
    assert found["LC5: surge spectrum peaks at twice the wave frequency"]


# Full scale


@pytest.mark.slow
def test_fig_15_double_frequency_of_the_four_combinations_is_that_of_theory():
    for combination, expected in zip(load_cases.COMBINATIONS, load_cases.EXPECTED_DOUBLE, strict=True):
        found = load_cases.double_frequency(load_cases.regular_wave(*combination))
        assert (found[load_cases.SURGE][1], found[load_cases.PITCH][1]) == pytest.approx(expected, abs=0.03)


# The command


def test_case_names_are_checked():
    assert load_cases.wanted_cases("lc5, LC2") == ["LC5", "LC2"]
    assert load_cases.wanted_cases("all") == list(load_cases.CASES)
    with pytest.raises(InputError, match="LC13"):
        load_cases.wanted_cases("LC13")


@pytest.mark.nightly
def test_the_command_writes_series_statistics_claims_and_plots(tmp_path):
    pytest.importorskip("matplotlib")
    result = CliRunner().invoke(app, ["dev", "paper", "LC5", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "twice the wave frequency" in result.output
    assert (tmp_path / "runs" / "LC5.parquet").exists()
    assert (tmp_path / "statistics.csv").exists()
    text = (tmp_path / "paper.md").read_text()
    assert "| 9 |" in text
    assert all(f"]({path.name})" in text for path in tmp_path.glob("*.png"))
    assert (tmp_path / "spectra_surge.png").exists()


@study
def test_plots_of_a_few_cases_are_made(runs, natural, tmp_path):
    few, path = {name: runs[name] for name in ("LC1", "LC5")}, tmp_path / "plot.png"
    for draw, arguments in (
        (paper_report.box_plots, (few, load_cases.PITCH)),
        (paper_report.spectra, (few, load_cases.SURGE, natural)),
        (paper_report.time_series, (few, load_cases.SURGE)),
        (paper_report.static_pulls, ()),
    ):
        draw(*arguments, path)
        assert path.stat().st_size > 10_000
        path.unlink()
