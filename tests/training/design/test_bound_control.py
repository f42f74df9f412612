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
    RATES,
    Information,
    Problem,
    baseline_deviations,
    front,
    noise_of,
    towards,
)
from fowt_env.training.design.bound_lidar import BoundLidar, lidar_of
from fowt_env.training.design.bound_plant import OMEGA, BoundPlant

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
    """(A, B, W) of plant, controls and the states of both filters; W: intensity of the noise."""
    plant, n = problem.plant, len(problem.states)
    wind, waves = problem.wind_filter, plant.wave_filter
    m = n + len(wind.a)
    size = m + waves.b.size
    a, b, w = np.zeros((size, size)), np.zeros((size, problem.b.shape[1])), np.zeros((size, size))
    a[:n, :n], b[:n] = problem.a, problem.b
    a[: plant.n, n:m], a[: plant.n, m:] = np.outer(plant.wind, wind.output), plant.E @ plant.force
    a[n:m, n:m], a[m:, m:] = wind.a, waves.a
    w[n:m, n:m], w[m:, m:] = wind.intensity, waves.intensity
    return a, b, w


def from_covariance(problem, x, k):
    """(6,) deviations, in the order of QUANTITIES, from a covariance of all states and the controls -k x."""
    rows = np.hstack([problem.rows, np.zeros((len(QUANTITIES), len(x) - len(problem.states)))])
    rows = rows - problem.of_rates @ k
    found = np.sqrt(np.einsum("ij,jk,ik->i", rows, x, rows)) * [problem.scale[name] for name in QUANTITIES]
    return found * [GAUSSIAN_MEAN if name in RATES else 1.0 for name in QUANTITIES]


def values(deviations):
    return np.array([getattr(deviations, name) for name in QUANTITIES])


def loop(problem, cost):
    """(A, W, k) of the closed loop of all states and, with sensors, estimation errors; controls are -k x."""
    a, b, w = whole(problem)
    q = np.zeros_like(a)
    q[: len(cost.q), : len(cost.q)] = cost.q
    k = np.linalg.solve(cost.r, b.T @ solve_continuous_are(a, b, q, cost.r))
    if problem.information.sensors is None:
        return a - b @ k, w, k
    gain, c = problem.estimator()
    places = [*range(problem.plant.n), *range(len(cost.q), len(a))]
    n, m = len(a), len(places)
    both, intensity = np.zeros((n + m, n + m)), np.zeros((n + m, n + m))
    both[:n, :n], both[:n, n:] = a - b @ k, b @ k[:, places]
    both[n:, n:] = a[np.ix_(places, places)] - gain @ c
    twice = [*range(n), *places]
    intensity[:] = w[np.ix_(twice, twice)]
    intensity[n:, n:] += gain @ np.diag(problem.noise) @ gain.T
    return both, intensity, np.hstack([k, -k[:, places]])


def lyapunov(problem, cost):
    """Deviations by Riccati and Lyapunov equations of the whole system, estimator and all."""
    a, w, k = loop(problem, cost)
    return from_covariance(problem, solve_continuous_lyapunov(a, -w), k)


@pytest.mark.parametrize("information", [FULL, MEASURED, SPEED, PITCH], ids=lambda x: x.text)
def test_integrals_over_the_spectra_are_the_covariances_of_lyapunov_equations(plant, information):
    problem = Problem(plant, information)
    q = problem.cost(*WEIGHTS, 0.2)
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
    cost[:n, :n] = q.q * step
    p = solve_discrete_are(A, B, cost, q.r * step)
    k = np.linalg.solve(q.r * step + B.T @ p @ B, B.T @ p @ A)
    return A, B, noise, k


def test_preview_is_the_optimum_with_a_delay_line_for_states(plant):
    """Sampled at 0.1 s, the wind of the next seconds as that many states, one Riccati equation for all."""
    time = 3.0
    problem = Problem(plant, replace(FULL, preview=time))
    q = problem.cost(*WEIGHTS)
    a, b, noise, k = delay_line(problem, q, time, 0.1)
    expected = from_covariance(problem, solve_discrete_lyapunov(a - b @ k, noise), k)
    np.testing.assert_allclose(values(problem.deviations(q, plant.fitted)), expected, rtol=0.02)


def total(plant, information, q, noise=None):
    """Value of the quadratic cost, less that of the controls' rates, in the fitted weather."""
    problem = Problem(plant, information, noise)
    parts = problem.parts(problem.deviations(q, plant.fitted))
    return float(parts[:-1] ** 2 @ [1.0 - WEIGHTS[0], *WEIGHTS])


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
    limits = replace(base, torque=0.05, torque_travel=np.inf)
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
    impossible = replace(impossible, torque_travel=np.inf)
    with pytest.raises(InputError, match="five: no gains meet the limits"):
        front(Problem(plant, MEASURED), impossible, (0.5,))


def test_a_limit_may_be_left_out(plant, base):
    free = replace(base, power=np.inf, torque=np.inf, torque_travel=np.inf)
    (bound,) = front(Problem(plant, FULL), replace(free, power=base.power, torque=0.02), (0.5,))
    (unbound,) = front(Problem(plant, FULL), free, (0.5,))
    assert unbound[1].torque > bound[1].torque
    assert unbound[1].rotor_speed < bound[1].rotor_speed


def test_a_limit_of_the_torque_rate_is_met_and_costs_motion(plant, base):
    free = replace(base, torque=0.05, torque_travel=np.inf)
    (fast,) = front(Problem(plant, MEASURED), free, (0.5,))
    tight = replace(free, torque_travel=0.05 * fast[1].torque_travel)
    (slow,) = front(Problem(plant, MEASURED), tight, (0.5,))
    assert slow[1].torque_travel == pytest.approx(tight.torque_travel, rel=5e-3)
    assert slow[1].rotor_speed > 1.02 * fast[1].rotor_speed
    assert slow[1].travel == pytest.approx(base.travel, rel=5e-3)


@pytest.mark.parametrize("ratio", [0.8, 0.95])
def test_the_point_towards_a_ratio_of_motions_is_on_the_front(plant, base, ratio):
    limits = replace(base, torque=0.05, torque_travel=0.01)
    problem = Problem(plant, MEASURED)
    aim = replace(base, platform_pitch=ratio * base.platform_pitch)
    fraction, best, _ = towards(problem, limits, aim)
    assert best.platform_pitch / best.rotor_speed == pytest.approx(
        ratio * base.platform_pitch / base.rotor_speed, rel=0.01
    )
    (same,) = front(problem, limits, (fraction,))
    np.testing.assert_allclose(values(best)[:2], values(same[1])[:2], rtol=5e-3)


def test_a_simulation_of_the_optimal_loop_has_the_deviations_of_the_limit(plant, base):
    """Plant, filters, Kalman filter and feedback in steps of 0.1 s under drawn noise, for 30 hours."""
    limits = replace(base, torque=0.05, torque_travel=0.01)
    problem = Problem(plant, MEASURED)
    ((_, _, cost),) = front(problem, limits, (0.6,))
    expected = values(problem.deviations(cost, plant.fitted))
    a, w, k = loop(problem, cost)
    step, count = 0.1, 1_080_000
    move, noise = expm(a * step / 4096), w * step / 4096
    for _ in range(12):  # twice the time, up to one step
        move, noise = move @ move, noise + move @ noise @ move.T
    values_, vectors = np.linalg.eigh(noise)
    root = vectors * np.sqrt(np.maximum(values_, 0.0))
    random = np.random.default_rng(3)
    x, total, square = np.zeros((len(a), 90)), 0.0, np.zeros((len(a), len(a)))
    for period in range(count // 90):
        x = move @ x + root @ random.normal(size=x.shape)
        if period > 6000:  # 600 s: started at rest
            square += x @ x.T
            total += x.shape[1]
    found = from_covariance(problem, square / total, k)
    np.testing.assert_allclose(found, expected, rtol=0.04)


class TestLidar:
    """A lidar as a further sensor: a perfect one, a useless one, and those that are simulated."""

    READ = Information("five and a lidar", SENSORS, lidar=True)

    def reached(self, plant, base, lidar, information=READ):
        limits = replace(base, torque=0.05, torque_travel=np.inf)
        ((_, reached, cost),) = front(Problem(plant, information, None, lidar), limits, (0.6,))
        return reached, cost

    def test_one_without_error_is_a_preview(self, plant, base):
        """The chain of approximants of the delay: 3 s in two sections."""
        lidar = BoundLidar(plant, 3.0, np.zeros(OMEGA.size))
        exact = self.reached(plant, base, None, replace(MEASURED, preview=3.0))[0]
        read = self.reached(plant, base, lidar)[0]
        for name in ("rotor_speed", "platform_pitch"):
            assert getattr(read, name) == pytest.approx(getattr(exact, name), rel=0.03)
            assert getattr(read, name) > 0.999 * getattr(exact, name)

    def test_one_with_a_huge_error_is_none(self, plant, base):
        lidar = BoundLidar(plant, 3.0, 1e6 * plant.true.wind)
        np.testing.assert_allclose(
            values(self.reached(plant, base, lidar)[0]),
            values(self.reached(plant, base, None, MEASURED)[0]),
            rtol=1e-3,
        )

    def test_its_integrals_are_covariances_of_lyapunov_equations(self, plant):
        lidar = BoundLidar(plant, 4.0, 0.2 * plant.true.wind)
        problem = Problem(plant, self.READ, None, lidar)
        cost = problem.cost(*WEIGHTS, 0.2)
        found = values(problem.deviations(cost, plant.fitted))
        np.testing.assert_allclose(found, lyapunov(problem, cost), rtol=2e-3)

    def test_true_weather_has_the_exact_delay(self, plant):
        lidar = BoundLidar(plant, 4.0, 0.2 * plant.true.wind)
        seen, slow = lidar.of(plant.true, plant)[0], OMEGA < 1.0
        np.testing.assert_allclose(np.unwrap(np.angle(seen[slow])), 4.0 * OMEGA[slow], atol=1e-9)
        fitted = lidar.of(plant.fitted, plant)[0]
        np.testing.assert_allclose(fitted[slow], seen[slow], atol=0.05)

    def test_the_error_of_a_simulated_lidar_is_that_of_drawn_readings(self):
        """Squared coherence of the farthest gate with the rotor's wind, over ten drawn winds of 800 s."""
        from scipy.signal import csd, welch

        from fowt_env.weather.lidar_gates import lidar_gates
        from fowt_env.weather.preview import rotor_wind_series

        scene = build_scene("oc3_hywind", wind=18.0, fidelity="standard")
        plant = BoundPlant(scene, 18.0)
        lidar = lidar_of(plant, scene, "four_beam_pulsed")
        cross, own, known = 0.0, 0.0, 0.0
        for seed in range(1001, 1011):
            wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
            drawn = build_scene("oc3_hywind", wind=wind, seed=seed, duration=800.0)
            time, values_, _ = lidar_gates(drawn, "four_beam_pulsed").series
            start, rotor, period = rotor_wind_series(drawn)
            pair = np.interp(time, start, rotor, period=period), values_[len(values_) // 2 - 1]
            settings = {"fs": 1.0 / (time[1] - time[0]), "nperseg": 1024}
            f, here = csd(*pair, **settings)
            cross = cross + here
            own, known = own + welch(pair[1], **settings)[1], known + welch(pair[0], **settings)[1]
        found = np.abs(cross) ** 2 / (own * known)
        expected = 1.0 / (1.0 + lidar.error / np.where(plant.true.wind > 0.0, plant.true.wind, np.inf))
        for low, high in ((0.01, 0.03), (0.03, 0.06), (0.06, 0.1)):
            band = (f > low) & (f < high)
            shown = np.interp(2.0 * np.pi * f[band], OMEGA, expected)
            assert found[band].mean() == pytest.approx(shown.mean(), abs=0.06)
