"""The plant of the limit: its weather, its closed loop with the baseline, and that loop in simulation."""

from copy import copy

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.analysis.linear_drag import linear_drag, with_drag
from fowt_env.analysis.linear_model import linearize
from fowt_env.controllers.design.closed_loop import closed_loop_matrix
from fowt_env.controllers.lqr.design import scene_at
from fowt_env.controllers.pi import PISettings
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.training.design.bound_control import baseline_deviations
from fowt_env.training.design.bound_plant import OMEGA, BoundPlant, N
from fowt_env.weather.turbulence import turbulence


@pytest.fixture(scope="module")
def windy():
    return build_scene("oc3_hywind", wind=18.0, fidelity="reference")


@pytest.fixture(scope="module")
def plant(windy):
    return BoundPlant(windy, 18.0)


def test_the_wind_s_spectrum_is_that_of_drawn_wind_and_its_filter_follows_it(plant):
    sigma = 0.14 * (0.75 * 18.0 + 5.6)
    period, series = turbulence(18.0, sigma, height=90.0, diameter=126.0, period=800.0, seed=5)
    wind = series[:-1, 0]
    assert np.trapezoid(plant.true.wind, OMEGA) == pytest.approx(wind.var(), rel=0.01)
    power = 2.0 * np.abs(np.fft.rfft(wind) / wind.size) ** 2
    for low, high in ((2, 6), (6, 15), (15, 40), (40, 100)):  # of the period's harmonics
        omega = np.linspace(low - 0.5, high - 0.5, 2000) * 2.0 * np.pi / period
        true, fitted = (
            np.trapezoid(np.interp(omega, OMEGA, w.wind), omega) for w in (plant.true, plant.fitted)
        )
        assert true == pytest.approx(power[low:high].sum(), rel=0.03)
        assert fitted == pytest.approx(true, rel=0.05)
    assert plant.wind_filter.error < 0.05


def test_the_wave_filter_has_the_sea_s_variance_and_force(plant):
    assert np.trapezoid(plant.true.elevation, OMEGA) == pytest.approx(plant.sea.Hs**2 / 16.0, rel=1e-6)
    assert np.trapezoid(plant.fitted.elevation, OMEGA) == pytest.approx(plant.sea.Hs**2 / 16.0, rel=0.03)
    assert plant.wave_filter.error < 0.1
    for column in (0, 2):
        sizes = [
            np.sqrt(np.trapezoid(np.abs(w.force[:, column]) ** 2 * w.elevation, OMEGA))
            for w in (plant.true, plant.fitted)
        ]
        assert sizes[1] == pytest.approx(sizes[0], rel=0.1)


@pytest.mark.parametrize("wind", [14.0, 18.0, 24.0])
def test_fitted_and_whole_spectra_give_the_baseline_alike(windy, wind):
    plant = BoundPlant(windy, wind)
    true, fitted = (baseline_deviations(plant, weather) for weather in (plant.true, plant.fitted))
    for name in ("rotor_speed", "platform_pitch", "travel"):
        assert getattr(fitted, name) == pytest.approx(getattr(true, name), rel=0.02)


def test_the_closed_loop_of_the_baseline_has_the_eigenvalues_of_the_whole_plant(windy, plant):
    model = with_drag(linearize(scene_at(windy, 18.0)), plant.drag)
    every, _ = closed_loop_matrix(model, PISettings.published(windy.turbine))
    theirs = np.linalg.eigvals(every)
    for value in np.linalg.eigvals(plant.baseline()):
        assert np.abs(theirs - value).min() < 0.02 * abs(value) + 1e-4


def test_the_drag_is_that_of_the_motion_that_it_allows(windy, plant):
    """Linearised again in the motion under the baseline it is the same."""
    again = linear_drag(
        windy, linearize(scene_at(windy, 18.0)).point.state, OMEGA, plant.sea, plant._motion()
    )
    np.testing.assert_allclose(again.damping, plant.drag.damping, rtol=5e-3, atol=1e-3 * again.damping.max())


def test_still_water_has_drag_of_the_platform_s_own_motion_alone(windy, plant):
    still = BoundPlant(windy, 18.0, {"kind": "still"})
    assert not still.true.elevation.any() and not still.fitted.elevation.any()
    assert 0.0 < still.drag.damping[0, 0] < plant.drag.damping[0, 0]
    calm, rough = (baseline_deviations(each, each.true) for each in (still, plant))
    assert calm.travel < rough.travel


@pytest.mark.nightly
def test_a_pitch_drive_without_lag_counts_as_a_quick_one(plant):
    """OpenFAST's own turbine has none; its closed loop is nearly that of the other."""
    quick = BoundPlant(build_scene("oc3_hywind_openfast", wind=18.0, fidelity="reference"), 18.0)
    assert quick.turbine.pitch_drive.time_constant == 0.0
    theirs, own = (baseline_deviations(each, each.true) for each in (plant, quick))
    assert own.platform_pitch == pytest.approx(theirs.platform_pitch, rel=0.05)
    assert own.rotor_speed == pytest.approx(theirs.rotor_speed, rel=0.05)


def test_what_has_no_limit_is_named(windy, plant):
    with pytest.raises(InputError, match="swept area = .* IEC 61400-1, which applies above 200 m2"):
        small = build_scene("liu_1_50", wind=2.0, fidelity="reference")
        BoundPlant(small, 2.0)
    with pytest.raises(InputError, match="the blade pitch is at its limit"):
        BoundPlant(windy, 10.0)
    with pytest.raises(InputError, match="unstable under gspi_oc3"):
        loose = copy(plant)
        loose.A = plant.A + 0.2 * np.eye(N)
        loose.baseline()
    with pytest.raises(InputError, match="must be one with a spectrum"):
        BoundPlant(windy, 18.0, {"kind": "regular", "H": 2.0, "T": 9.0})


@pytest.mark.slow
@pytest.mark.parametrize("wind", [16, *(pytest.param(wind, marks=pytest.mark.nightly) for wind in (20, 24))])
def test_the_linear_baseline_is_the_simulated_one(windy, wind):
    """Means over six seeds of the headline suite's weather: pitch within 6 %, rotor 5 %, travel 7 %."""
    plant = BoundPlant(windy, float(wind))
    expected = baseline_deviations(plant, plant.true)
    found = []
    for seed in range(1001, 1007):
        weather = {"kind": "ntm", "speed": float(wind), "class": "B"}
        sea = joint_sea_state("gulf_of_maine_normal", float(wind))
        scene = build_scene(
            "oc3_hywind", wind=weather, sea=sea, seed=seed, fidelity="standard", duration=800.0
        )
        run = simulate(scene, "gspi_oc3", duration=800.0)
        kept = run[run["Time_[s]"] >= 200.0]
        travel = kept["BldPitch1_[deg]"].diff().abs().sum() / 600.0
        found.append((kept["RotSpeed_[rpm]"].std(), kept["PtfmPitch_[deg]"].std(), travel))
    speed, lean, travel = np.mean(found, axis=0)
    assert expected.rotor_speed * 30.0 / np.pi == pytest.approx(speed, rel=0.05)
    assert expected.platform_pitch / DEGREE == pytest.approx(lean, rel=0.06)
    assert expected.travel / DEGREE == pytest.approx(travel, rel=0.07)
