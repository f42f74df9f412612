"""The performance limit: its covariances by other ways, its optimum against other gains, its weather."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

from fowt_env import build_scene
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.wave_excitation import wave_force
from fowt_env.controllers.lqr.design import MOMENT, N_FEEDBACK, N_PLANT, PLANT, design_model, wind_filter
from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.sea_state import joint_sea_state, sea_state_of
from fowt_env.errors import InputError
from fowt_env.training.design import linear_bound
from fowt_env.training.design.linear_bound import (
    INFORMATION,
    LIMITED,
    RATIOS,
    SPEED,
    WIND,
    Problem,
    bound_table,
    efficient,
    fraction_of_bound,
    front,
    gspi_covariance,
    ratio_table,
)
from fowt_env.training.design.plots import plot_bound
from fowt_env.weather.turbulence import amplitudes
from fowt_env.weather.waves import jonswap

HEIGHT, DIAMETER = 90.0, 126.0


@pytest.fixture(scope="module")
def windy():
    return build_scene("oc3_hywind", wind=18.0)


@pytest.fixture(scope="module")
def problem(windy):
    return Problem(design_model(windy, 18.0), windy.turbine)


@pytest.fixture(scope="module")
def base(problem):
    return gspi_covariance(problem)[0]


def rotor_wind_spectrum(speed):
    """(frequency Hz, one-sided spectrum m2 s) of the rotor-averaged Kaimal wind."""
    samples, step = 6000, 0.1
    amplitude = amplitudes(speed, ntm_sigma(speed, "B"), HEIGHT, DIAMETER, samples, step, "rotor")[0]
    frequency = np.arange(amplitude.size) / (samples * step)
    return frequency[1:-1], 0.5 * amplitude[1:-1] ** 2 * samples * step


@pytest.mark.parametrize("speed", [12.0, 18.0, 24.0])
def test_the_wind_filter_has_the_spectrum_of_the_rotor_averaged_kaimal_wind(speed):
    frequency, spectrum = rotor_wind_spectrum(speed)
    t1, t2, noise = wind_filter(speed, HEIGHT, DIAMETER)
    omega = 2.0 * np.pi * frequency
    fitted = 2.0 * noise**2 / ((1.0 + (omega * t1) ** 2) * (1.0 + (omega * t2) ** 2))
    for low, high in ((1 / 300, 0.01), (0.01, 0.02), (0.02, 0.05), (0.05, 0.1)):  # the bands that matter
        band = (frequency >= low) & (frequency < high)
        assert fitted[band].sum() == pytest.approx(spectrum[band].sum(), rel=0.15)
    variance = noise**2 / (2.0 * (t1 + t2))
    assert variance == pytest.approx(spectrum.sum() * (frequency[1] - frequency[0]), rel=1e-6)


def test_the_covariance_under_gspi_is_the_integral_of_its_spectra(problem, base):
    _, a = gspi_covariance(problem)
    keep = [i for i in range(N_FEEDBACK) if i != N_PLANT + 1]
    g = problem.g[keep]
    omega = np.geomspace(1e-4, 1e3, 6000)
    response = np.array([np.linalg.solve(1j * w * np.eye(len(a)) - a, g) for w in omega])
    density = (np.abs(response) ** 2).sum(axis=2) / np.pi  # unit white noise: 1/(2 pi), both sides
    assert np.trapezoid(density[:, SPEED], omega) ** 0.5 == pytest.approx(base.rotor_speed, rel=2e-3)
    assert np.trapezoid(density[:, 1], omega) ** 0.5 == pytest.approx(base.platform_pitch, rel=2e-3)


def test_the_closed_loop_of_gspi_has_the_eigenvalues_of_the_whole_plant(windy, problem):
    """The planar states of the bound against closed_loop.py with all degrees of freedom."""
    from fowt_env.controllers.design.closed_loop import closed_loop_matrix
    from fowt_env.controllers.lqr.design import scene_at
    from fowt_env.controllers.pi import PISettings

    whole, _ = closed_loop_matrix(linearize(scene_at(windy, 18.0)), PISettings.published(windy.turbine))
    _, a = gspi_covariance(problem)
    theirs = np.linalg.eigvals(whole)
    for value in np.linalg.eigvals(a[: WIND - 1, : WIND - 1]):
        assert np.abs(theirs - value).min() < 0.02 * abs(value) + 1e-4


def test_the_weather_filters_give_the_deviations_of_the_exact_spectra(windy, problem, base):
    """Kaimal and JONSWAP through the frequency response, with the wave force at every frequency."""
    model = problem.model
    scene = windy.with_weather(18.0, None, 0)
    _, a = gspi_covariance(problem)
    plant = a[: WIND - 1, : WIND - 1]
    drive = np.zeros((WIND - 1, 1))
    drive[:N_PLANT, 0] = model.A[:N_PLANT, MOMENT - 3]  # per wind speed
    frequency, spectrum = rotor_wind_spectrum(18.0)

    def variances(omega, columns, density):
        found = [
            np.abs(np.linalg.solve(1j * w * np.eye(len(plant)) - plant, column)[[1, SPEED]]) ** 2 * s
            for w, column, s in zip(omega, columns, density, strict=True)
        ]
        return np.trapezoid(np.array(found), omega, axis=0)

    wind = variances(2.0 * np.pi * frequency, [drive[:, 0]] * frequency.size, spectrum / (2.0 * np.pi))
    sea = sea_state_of(joint_sea_state("gulf_of_maine_normal", 18.0))
    omega = np.linspace(0.3, 1.6, 120)
    linear = linearize(scene)
    force = wave_force(scene, linear.point.state, omega)
    rows = [linear.index(name) for name in PLANT]
    columns = [np.r_[(linear.E @ f)[rows], np.zeros(WIND - 1 - N_PLANT)] for f in force]
    waves = variances(omega, columns, jonswap(omega, sea.Hs, sea.Tp, sea.gamma))
    lean, speed = np.sqrt(wind + waves)
    assert base.platform_pitch == pytest.approx(lean, rel=0.06)
    assert base.rotor_speed == pytest.approx(speed, rel=0.06)


def test_the_fronts_keep_the_limits_of_gspi_and_better_information_betters_them(problem, base):
    limits = replace(base, torque=0.05)
    found = {name: front(problem, limits, name, (0.3, 0.7)) for name in ("full", "measured")}
    for points in found.values():
        for _, reached in points:
            for name in LIMITED:
                assert getattr(reached, name) < 1.005 * getattr(limits, name)
    for (share, full), (_, measured) in zip(found["full"], found["measured"], strict=True):
        sums = [
            (1.0 - share) * (d.rotor_speed / base.rotor_speed) ** 2
            + share * (d.platform_pitch / base.platform_pitch) ** 2
            for d in (full, measured)
        ]
        assert sums[0] < 0.95 * sums[1]
    assert found["full"][0][1].rotor_speed < 0.8 * base.rotor_speed
    assert found["full"][1][1].platform_pitch < 0.8 * base.platform_pitch


def test_no_other_gain_has_a_lower_cost_with_full_information(problem):
    q, r = problem.cost(0.5, 1.0, 0.3, 0.1)
    best = np.trace(q @ problem.closed("full", q, r))
    k = np.linalg.solve(r, problem.b.T @ solve_continuous_are(problem.a, problem.b, q, r))
    noise = problem.g @ problem.g.T

    def total(gain):
        x = solve_continuous_lyapunov(problem.a - problem.b @ gain, -noise)
        return np.trace((q + gain.T @ r @ gain) @ x)

    least = total(k)
    assert np.trace(q @ solve_continuous_lyapunov(problem.a - problem.b @ k, -noise)) == pytest.approx(best)
    random = np.random.default_rng(1)
    tried = [k * (1.0 + 0.02 * random.standard_normal(k.shape)) for _ in range(40)]
    stable = [gain for gain in tried if np.linalg.eigvals(problem.a - problem.b @ gain).real.max() < 0.0]
    assert len(stable) >= 10
    assert min(total(gain) for gain in stable) > least


def test_the_covariance_on_estimates_is_that_of_plant_and_estimator_side_by_side(problem):
    """The same loop written in the estimates themselves, not in their errors."""
    q, r = problem.cost(0.5, 1.0, 0.3, 0.1)
    k = np.linalg.solve(r, problem.b.T @ solve_continuous_are(problem.a, problem.b, q, r))
    a, c, gain, noise = problem.kalman
    n, m = N_FEEDBACK, MOMENT
    places = [*range(N_PLANT), *range(WIND, n)]
    own = [i for i in range(n) if i not in places]  # torque, command and integral are known
    both, drive = np.zeros((n + m, n + m)), np.zeros((n + m, n + m))
    both[:n, :n] = problem.a
    both[:n, own] -= problem.b @ k[:, own]
    both[:n, n:] = -problem.b @ k[:, places]
    both[n:, n:] = a - gain @ c
    both[np.ix_(range(n, n + m), places)] = gain @ c
    both[n:, own[:2]] = problem.a[np.ix_(places, own[:2])]
    drive[:n, :n] = problem.g @ problem.g.T
    drive[n:, n:] = gain @ noise @ gain.T
    expected = solve_continuous_lyapunov(both, -drive)[:n, :n]
    found = problem.closed("measured", q, r)
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.sqrt(np.diag(expected)), rtol=1e-5)


def test_bad_wishes_are_named(windy):
    with pytest.raises(InputError, match="wind = 10.0: must be above 11.4"):
        bound_table(windy, (10.0,))
    with pytest.raises(InputError, match="torque_std = -1.0: must be positive"):
        bound_table(windy, (18.0,), torque_std=-1.0)


def test_efficient_points_are_those_that_no_other_betters():
    points = [(1.0, 1.0), (0.5, 2.0), (0.6, 0.9), (2.0, 0.9), (0.5, 3.0), (3.0, 0.1)]
    np.testing.assert_array_equal(efficient(points), [(0.5, 2.0), (0.6, 0.9), (3.0, 0.1)])


def test_the_fraction_of_the_bound_is_one_on_the_front_and_none_at_the_baseline():
    table = pd.DataFrame(
        {
            "wind_[m/s]": 18.0,
            "information": "full",
            "speed_ratio_[-]": [0.5, 0.6, 0.9],
            "pitch_ratio_[-]": [0.9, 0.6, 0.5],
        }
    )
    assert fraction_of_bound(table, 18.0, 0.6, 0.6) == pytest.approx(1.0)
    assert fraction_of_bound(table, 18.0, 0.8, 0.8) == pytest.approx(0.5)
    assert fraction_of_bound(table, 18.0, 0.75, 1.0) == pytest.approx(0.5)  # straight to the left
    assert np.isnan(fraction_of_bound(table, 18.0, 1.1, 1.0))


def runs_table():
    rows = [
        ("ntm_18", "gspi_oc3", 1, 1.0, 0.8, 300.0, 0.1),
        ("ntm_18", "gspi_oc3", 2, 3.0, 0.8, 300.0, 0.1),
        ("ntm_18", "a", 1, 0.5, 0.4, 150.0, 0.05),
        ("ntm_18", "a", 2, 2.5, 0.4, 150.0, 0.15),
    ]
    return pd.DataFrame(rows, columns=["case", "variant", "seed", *RATIOS.values()])


def small_front():
    return pd.DataFrame(
        {
            "wind_[m/s]": 18.0,
            "information": ["full", "full", "measured", "measured"],
            "speed_ratio_[-]": [0.5, 0.9, 0.7, 0.9],
            "pitch_ratio_[-]": [0.9, 0.5, 0.9, 0.6],
        }
    )


def test_ratios_are_of_means_over_seeds():
    (row,) = ratio_table(runs_table(), small_front()).to_dict("records")
    assert row["wind_[m/s]"] == 18.0 and row["variant"] == "a"
    assert row["speed_ratio_[-]"] == pytest.approx(0.75)
    assert row["pitch_ratio_[-]"] == pytest.approx(0.5)
    assert row["travel_ratio_[-]"] == pytest.approx(1.0)
    assert 0.0 < row["of_bound_[-]"] < row["of_measured_[-]"]


def test_runs_that_cannot_be_compared_are_named():
    with pytest.raises(InputError, match="column 'seed' is missing"):
        ratio_table(runs_table().drop(columns="seed"))
    with pytest.raises(InputError, match="case 'ntm_18' has no wind speed in its name or no gspi_oc3"):
        ratio_table(runs_table().query("variant == 'a'"))


def test_the_plot_shows_fronts_and_points_of_the_winds_that_have_both(tmp_path):
    pytest.importorskip("matplotlib")
    fronts = small_front()
    both = pd.concat([fronts, fronts.assign(**{"wind_[m/s]": 20.0})])
    figure = plot_bound(both, INFORMATION, path=tmp_path / "b.png")
    assert [axes.get_title() for axes in figure.axes][:2] == ["18 m/s", "20 m/s"]
    assert [len(axes.lines) for axes in figure.axes[:2]] == [2, 2]
    with_points = plot_bound(both, INFORMATION, ratio_table(runs_table()))
    assert [axes.get_title() for axes in with_points.axes if axes.get_title()] == ["18 m/s"]
    assert (tmp_path / "b.png").stat().st_size > 1000
    with pytest.raises(InputError, match="nothing to plot"):
        plot_bound(fronts.assign(**{"wind_[m/s]": 20.0}), INFORMATION, ratio_table(runs_table()))


def test_the_published_fronts_are_those_of_today(windy):
    """training/design/data/linear_bound.csv, as fowt design bound wrote it."""
    stored = pd.read_csv(Path(linear_bound.__file__).parent / "data" / "linear_bound.csv")
    stored = stored[(stored["wind_[m/s]"] == 18.0) & (stored["information"] != "state")]
    fresh = bound_table(windy, (18.0,), ("full", "wind", "measured"))
    assert list(stored["information"]) == list(fresh["information"])
    for name in ("speed_ratio_[-]", "pitch_ratio_[-]", "RotSpeed_std_[rpm]"):
        np.testing.assert_allclose(fresh[name], stored[name], rtol=0.01)
