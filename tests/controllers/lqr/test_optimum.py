"""The linear optimum of lqr beside slow twins, the limits that it keeps, and what noise does to it."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

from fowt_env import build_scene
from fowt_env.controllers.lqr.design import (
    MOMENT,
    N_PLANT,
    N_STATE,
    SENSOR_NOISE,
    WIND,
    LQGSettings,
    design_model,
    sampled,
)
from fowt_env.controllers.lqr.optimum import (
    COMMAND,
    LIMITED,
    POWER_CEILING,
    TOLERANCE,
    TRAVEL_CEILING,
    SampledLoop,
    limits,
    optimal_gain,
    optimal_gains,
    stationary_covariance,
)
from fowt_env.controllers.pi import PISettings
from fowt_env.envs.sensors import reading_scales
from fowt_env.plant.measurement import Measure

SETTINGS = LQGSettings()


@pytest.fixture(scope="module")
def loops():
    scene = build_scene("oc3_hywind", wind=18.0, fidelity="reference")
    return {wind: SampledLoop(design_model(scene, wind), scene.turbine, 0.1) for wind in (12, 13, 14, 18, 24)}


def test_the_covariance_is_that_of_scipy(loops):
    gain, _, _ = optimal_gain(loops[18], SETTINGS)
    a, q, _, _ = loops[18].closed(gain)
    found = stationary_covariance(a, q)
    scale = np.sqrt(np.diag(found))  # the states' deviations span nine decades, which scipy's method minds
    expected = solve_discrete_lyapunov(a / scale[:, None] * scale, q / np.outer(scale, scale))
    assert np.abs(found / np.outer(scale, scale) - expected).max() < 1e-6


def test_the_deviations_are_those_of_a_long_run_step_by_step(loops):
    loop, rng, runs, steps, dt = loops[18], np.random.default_rng(1), 24, 30_000, 0.1
    k, expected, _ = optimal_gain(loop, SETTINGS)
    model, correction = loop.model, loop.filter_gain
    phi, gamma = sampled(model.A, model.B * [model.torque, 1.0], dt)
    white = np.linalg.cholesky(loop.noise + 1e-20 * np.eye(MOMENT))
    # columns are runs: plant and weather, the filter's estimate, commands less the trim, speed integral
    z, estimate = np.zeros((MOMENT, runs)), np.zeros((N_STATE, runs))
    command, integral = np.zeros((2, runs)), np.zeros((1, runs))
    speed, lean, travel, drift, used = 0.0, 0.0, 0.0, 0.0, 0
    for step in range(steps):
        noise = np.array(SENSOR_NOISE)[:, None] * rng.normal(size=(5, runs))
        estimate += correction @ (model.C[:, :MOMENT] @ z + noise - model.C @ estimate)
        fed = np.vstack([estimate[:N_PLANT], command, integral, estimate[WIND:MOMENT]])
        command = command - dt * k @ fed
        before = z[5].copy()
        z = phi[:MOMENT, :MOMENT] @ z + gamma[:MOMENT] @ command + white @ rng.normal(size=z.shape)
        estimate = phi @ estimate + gamma @ command
        integral = integral + dt * z[4]
        if step >= 6000:
            used += 1
            speed, lean = speed + np.mean(z[4] ** 2), lean + np.mean(z[1] ** 2)
            travel += np.mean(np.abs(z[5] - before)) / dt
            drift += np.mean(integral**2)
    # 24 runs of 2400 s hold some 2000 periods of the platform: 2 % of a deviation
    assert np.sqrt(speed / used) == pytest.approx(expected.speed, rel=0.05)
    assert np.sqrt(lean / used) == pytest.approx(expected.lean, rel=0.05)
    assert travel / used == pytest.approx(expected.travel, rel=0.05)
    assert np.sqrt(drift / used) == pytest.approx(expected.integral, rel=0.05)


@pytest.mark.parametrize("wind", [18, 24])
def test_the_baseline_is_gspi_in_continuous_time_but_for_sampling(loops, wind):
    loop, found = loops[wind], loops[wind].baseline()
    model, published = loop.model, PISettings.published(loop.turbine)
    n = MOMENT
    # the PI law: command g (KP f + KI I) of the filtered speed f, where the schedule's slope makes
    # g = gear ratio GK/(2 - GK)
    schedule = 1.0 / (1.0 + model.pitch / published.gain_schedule_pitch)
    g = published.gear_ratio * schedule / (2.0 - schedule)
    corner = published.speed_filter_corner
    a, q = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2))
    a[:n, :n] = model.A[:n, :n]
    a[:n, n] = g * published.KP * model.B[:n, 1]
    a[:n, n + 1] = g * published.KI * model.B[:n, 1]
    a[n, 4], a[n, n], a[n + 1, n] = corner, -corner, 1.0
    q[:n, :n] = model.G[:n] @ model.G[:n].T
    x = solve_continuous_lyapunov(a, -q)
    # ten instants a second are half a period late, 1 % of these loops
    assert found.speed == pytest.approx(np.sqrt(x[4, 4]), rel=0.02)
    assert found.lean == pytest.approx(np.sqrt(x[1, 1]), rel=0.02)
    assert found.travel == pytest.approx(np.sqrt(2.0 / np.pi * (a[5] @ x @ a[5])), rel=0.02)
    assert found.integral == pytest.approx(np.sqrt(x[n + 1, n + 1]), rel=0.02)


def test_where_gspi_is_unstable_the_ceilings_stand_for_it(loops):
    """At 13 m/s gspi_oc3 is nearly unstable, and its linear model has more travel than the ceiling."""
    baseline = loops[12].baseline()
    assert baseline.travel == TRAVEL_CEILING and baseline.power == POWER_CEILING
    assert baseline.surge == baseline.integral == float("inf")
    assert loops[13].baseline().travel == TRAVEL_CEILING > loops[14].baseline().travel
    assert limits(SETTINGS, 12.0, baseline, loops[12].turbine)["travel"] == pytest.approx(
        SETTINGS.travel_near_rated * np.pi / 180.0
    )


@pytest.mark.parametrize("wind", [14, 18, 24])
def test_no_limit_is_passed_and_travel_is_used_up(loops, wind):
    loop = loops[wind]
    _, reached, _ = optimal_gain(loop, SETTINGS)
    limited = limits(SETTINGS, wind, loop.baseline(), loop.turbine)
    for name in LIMITED:
        assert getattr(reached, name) <= (1.0 + TOLERANCE) * limited[name]
    assert reached.travel == pytest.approx(limited["travel"], rel=TOLERANCE)


def test_share_trades_rotor_speed_for_platform_pitch(loops):
    found = [optimal_gain(loops[18], SETTINGS.changed(share=share))[1] for share in (0.2, 0.5, 0.8)]
    assert found[0].speed < found[1].speed < found[2].speed
    assert found[0].lean > found[1].lean > found[2].lean


def test_noise_of_two_percent_of_the_channels_costs_little_travel(loops):
    for wind in (14, 18, 24):
        loop = loops[wind]
        gain, _, _ = optimal_gain(loop, SETTINGS)
        scales = reading_scales(loop.turbine)
        at = (Measure.ROTOR_SPEED, Measure.BLADE_PITCH, Measure.PLATFORM_PITCH)
        at += (Measure.PLATFORM_PITCH_RATE, Measure.NACELLE_ACCELERATION)
        noise = np.array([scales[i] for i in at])
        exact = loop.deviations(gain, 0.0 * noise).travel
        assert loop.deviations(gain, 0.02 * noise).travel < 1.08 * exact
        assert loop.deviations(gain, 0.05 * noise).travel < 1.35 * exact


def test_below_the_lowest_wind_its_gains_hold(loops):
    scene = build_scene("oc3_hywind", wind=18.0, fidelity="reference")
    models = [design_model(scene, wind) for wind in (10, 11, 12, 13)]
    gains = optimal_gains(models, SETTINGS, scene.turbine, 0.1)
    np.testing.assert_array_equal(gains[0], gains[2])
    np.testing.assert_array_equal(gains[1], gains[2])
    assert np.abs(gains[3] - gains[2]).max() > 0.0


def test_what_is_added_to_the_pitch_command_is_forgotten_slowly(loops):
    """A residual on top of lqr acts through the command, and a gain on it would take it back at once."""
    for loop in loops.values():
        gain, _, _ = optimal_gain(loop, SETTINGS)
        assert 0.0 < gain[1, COMMAND] < 0.5  # 1/s
