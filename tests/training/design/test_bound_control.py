"""The best linear control: against Lyapunov and whole Riccati equations, and a delay line."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import (
    expm,
    solve_continuous_are,
    solve_continuous_lyapunov,
    solve_discrete_are,
    solve_discrete_lyapunov,
)

from fowt_env import build_scene
from fowt_env.controllers.lqr.design import SENSORS, sampled_noise
from fowt_env.errors import InputError
from fowt_env.training.design.bound_control import (
    GAUSSIAN_MEAN,
    LIMITED,
    QUANTITIES,
    Information,
    Problem,
    baseline_deviations,
    front,
    noise_of,
)
from fowt_env.training.design.bound_plant import BoundPlant, N

WEIGHTS = (0.5, 1.0, 0.3, 0.1)
FULL, MEASURED = Information("all"), Information("five", SENSORS)
SPEED = Information("two", SENSORS[:2])
PITCH = Information("two, no torque", SENSORS[:2], torque=False)


@pytest.fixture(scope="module")
def plant():
    return BoundPlant(build_scene("oc3_hywind", wind=18.0, fidelity="reference"), 18.0)


@pytest.fixture(scope="module")
def base(plant):
    return baseline_deviations(plant, plant.true)


def whole(problem):
    """(A, B, G) of plant, controls and the states of both filters, driven by unit white noise."""
    plant, n = problem.plant, len(problem.states)
    wind, waves = plant.wind_filter, plant.wave_filter
    m = n + wind.b.size
    size = m + waves.b.size
    a, b, g = np.zeros((size, size)), np.zeros((size, problem.b.shape[1])), np.zeros((size, 2))
    a[:n, :n], b[:n] = problem.a, problem.b
    a[:N, n:m], a[:N, m:] = np.outer(plant.wind, wind.output), plant.E @ plant.force
    a[n:m, n:m], a[m:, m:] = wind.a, waves.a
    g[n:m, 0], g[m:, 1] = wind.b, waves.b
    return a, b, g


def from_covariance(problem, x):
    """(5,) deviations, in the order of QUANTITIES, from a covariance of all states."""
    rows = np.hstack([problem.rows, np.zeros((len(QUANTITIES), len(x) - len(problem.states)))])
    found = np.sqrt(np.einsum("ij,jk,ik->i", rows, x, rows)) * [problem.scale[name] for name in QUANTITIES]
    found[QUANTITIES.index("travel")] *= GAUSSIAN_MEAN
    return found


def values(deviations):
    return np.array([getattr(deviations, name) for name in QUANTITIES])


def lyapunov(problem, q):
    """Deviations by Riccati and Lyapunov equations of the whole system, estimator and all."""
    a, b, g = whole(problem)
    cost = np.zeros_like(a)
    cost[: len(q), : len(q)] = q
    k = np.linalg.solve(problem.r, b.T @ solve_continuous_are(a, b, cost, problem.r))
    if problem.information.sensors is None:
        return from_covariance(problem, solve_continuous_lyapunov(a - b @ k, -g @ g.T))
    gain, c = problem.estimator()
    places = [*range(N), *range(len(q), len(a))]
    estimated = a[np.ix_(places, places)]
    n, m = len(a), len(places)
    both, drive = np.zeros((n + m, n + m)), np.vstack([g, g[places]])
    both[:n, :n], both[:n, n:] = a - b @ k, b @ k[:, places]
    both[n:, n:] = estimated - gain @ c
    intensity = drive @ drive.T
    intensity[n:, n:] += gain @ np.diag(problem.noise) @ gain.T
    return from_covariance(problem, solve_continuous_lyapunov(both, -intensity)[:n, :n])


@pytest.mark.parametrize("information", [FULL, MEASURED, SPEED, PITCH], ids=lambda x: x.text)
def test_integrals_over_the_spectra_are_the_covariances_of_lyapunov_equations(plant, information):
    problem = Problem(plant, information)
    q = problem.cost(*WEIGHTS)
    found, expected = values(problem.deviations(q, plant.fitted)), lyapunov(problem, q)
    np.testing.assert_allclose(found, expected, rtol=1e-3)  # the grid's steps and ends
    if not information.torque:
        assert found[QUANTITIES.index("torque")] == 0.0


def delay_line(problem, q, time, step):
    """(A, B, noise, K) of plant and weather sampled at step, the wind of the next time s as states of a line.

    The wind's filter is time ahead of the plant; its output goes through the line, and the plant takes the
    mean of the two values at the ends of a step. K is the optimum of the sampled cost.
    """
    plant, n = problem.plant, len(problem.states)
    wind, waves = plant.wind_filter, plant.wave_filter
    w, v, count = wind.b.size, waves.b.size, round(time / step)
    core = n + v
    a = np.zeros((core, core))
    a[:n, :n], a[:n, n:], a[n:, n:] = problem.a, problem.waves @ plant.force, waves.a
    m = problem.b.shape[1]
    inputs = np.zeros((core, m + 1))
    inputs[:n, :m], inputs[:n, m] = problem.b, problem.wind
    block = np.zeros((core + m + 1, core + m + 1))
    block[:core, :core], block[:core, core:] = a, inputs
    held = expm(block * step)
    size = core + w + count
    line = core + w  # v(t), v(t + step) ..., of which the last stands before what the filter gives out
    A, B = np.zeros((size, size)), np.zeros((size, m))
    A[:core, :core], B[:core] = held[:core, :core], held[:core, core : core + m]
    A[core:line, core:line] = expm(wind.a * step)
    effect = held[:core, -1]
    A[:core, line] = A[:core, line + 1] = 0.5 * effect
    A[line : size - 1, line + 1 :] = np.eye(count - 1)
    A[-1, core:line] = wind.output
    noise = np.zeros((size, size))
    g = np.zeros((core, 1))
    g[n:, 0] = waves.b
    noise[:core, :core] = sampled_noise(a, g @ g.T, step)
    noise[core:line, core:line] = sampled_noise(wind.a, np.outer(wind.b, wind.b), step)
    cost = np.zeros((size, size))
    cost[:n, :n] = q * step
    p = solve_discrete_are(A, B, cost, problem.r * step)
    k = np.linalg.solve(problem.r * step + B.T @ p @ B, B.T @ p @ A)
    return A, B, noise, k


def test_preview_is_the_optimum_with_a_delay_line_for_states(plant):
    """Sampled at 0.1 s, the wind of the next seconds as that many states, one Riccati equation for all."""
    time = 3.0
    problem = Problem(plant, replace(FULL, preview=time))
    q = problem.cost(*WEIGHTS)
    a, b, noise, k = delay_line(problem, q, time, 0.1)
    expected = from_covariance(problem, solve_discrete_lyapunov(a - b @ k, noise))
    np.testing.assert_allclose(values(problem.deviations(q, plant.fitted)), expected, rtol=0.02)


def total(plant, information, q, noise=None):
    """Value of the quadratic cost, less that of the controls' rates, in the fitted weather."""
    problem = Problem(plant, information, noise)
    parts = problem.parts(problem.deviations(q, plant.fitted))
    return float(parts**2 @ [1.0 - WEIGHTS[0], *WEIGHTS])


def test_a_preview_of_no_time_is_knowledge_of_the_wind_now(plant):
    q = Problem(plant, FULL).cost(*WEIGHTS)
    for time, rtol in ((0.0, 1e-9), (1e-4, 1e-3)):
        ahead = Problem(plant, replace(FULL, preview=time)).deviations(q, plant.true)
        np.testing.assert_allclose(
            values(ahead), values(Problem(plant, FULL).deviations(q, plant.true)), rtol=rtol
        )


def test_more_knowledge_costs_less(plant):
    q = Problem(plant, FULL).cost(*WEIGHTS)
    times = [total(plant, replace(FULL, preview=time), q) for time in (0.0, 0.5, 1.0, 3.0, 6.0, 11.0, 20.0)]
    assert np.all(np.diff(times) < 0.0)
    sensed = [total(plant, replace(MEASURED, preview=time), q) for time in (0.0, 3.0, 11.0)]
    assert np.all(np.diff(sensed) < 0.0)
    known = [total(plant, each, q) for each in (FULL, MEASURED, SPEED)]
    assert np.all(np.diff(known) > 0.0)
    assert sensed[0] < known[1]  # the wind of now, exactly
    assert times[3] < sensed[1]


def test_more_noise_costs_more_and_none_is_full_knowledge(plant):
    q = Problem(plant, FULL).cost(*WEIGHTS)
    noise = noise_of()
    costs = [
        total(plant, MEASURED, q, {name: factor * size for name, size in noise.items()})
        for factor in (1e-2, 0.3, 1.0, 5.0)
    ]
    assert np.all(np.diff(costs) > 0.0)
    assert costs[0] == pytest.approx(total(plant, FULL, q), rel=0.05)
    with pytest.raises(InputError, match="noise: blade_pitch = 0.0: must be a positive standard deviation"):
        Problem(plant, MEASURED, dict.fromkeys(SENSORS, 0.0) | {"rotor_speed": 1.0})


def test_the_noise_is_that_of_the_readings_of_a_chain():
    from fowt_env.descriptions.sensors import Sensor, SensorChain, sensor_chain

    found, chain = noise_of(), sensor_chain("standard").sensors
    assert list(found) == list(SENSORS)
    for name in SENSORS:
        assert chain[name].noise <= found[name] < 1.1 * chain[name].noise
    coarse = SensorChain("coarse", {name: Sensor(noise=0.3, step=0.4 * np.sqrt(12.0)) for name in SENSORS})
    assert list(noise_of(coarse).values()) == pytest.approx([0.5] * len(SENSORS))
    with pytest.raises(
        InputError, match="sensors = 'exact': must be a chain with noise on each of rotor_speed"
    ):
        noise_of("exact")


def test_the_fronts_keep_the_limits_and_better_information_betters_them(plant, base):
    limits = replace(base, torque=0.05)
    found = {}
    for information in (FULL, MEASURED, PITCH, replace(FULL, preview=11.0)):
        points = front(Problem(plant, information), limits, (0.3, 0.7))
        assert len(points) == 2
        for fraction, reached, _ in points:
            for name in LIMITED:
                assert getattr(reached, name) < 1.005 * getattr(limits, name)
            ratios = reached.rotor_speed / base.rotor_speed, reached.platform_pitch / base.platform_pitch
            total = (1.0 - fraction) * ratios[0] ** 2 + fraction * ratios[1] ** 2
            found.setdefault(fraction, []).append(total)
    for full, measured, pitch, ahead in found.values():
        assert ahead < 0.6 * full and full < 0.92 * measured and measured < 0.95 * pitch


def test_limits_that_no_gain_meets_are_named(plant, base):
    impossible = replace(base, travel=1e-6 * base.travel, power=1e-3 * base.power, torque=1e-6)
    with pytest.raises(InputError, match="five: no gains meet the limits"):
        front(Problem(plant, MEASURED), impossible, (0.5,))


def test_a_limit_may_be_left_out(plant, base):
    free = replace(base, power=np.inf, torque=np.inf)
    (bound,) = front(Problem(plant, FULL), replace(base, torque=0.02), (0.5,))
    (unbound,) = front(Problem(plant, FULL), free, (0.5,))
    assert unbound[1].torque > bound[1].torque
    assert unbound[1].rotor_speed < bound[1].rotor_speed
