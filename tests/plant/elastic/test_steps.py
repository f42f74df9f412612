"""Steps of turbines with bending blades: corrections, slow loads at every second step, order, stability."""

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.plant.adams import bashforth, moulton
from fowt_env.plant.advance import advance, forget
from fowt_env.plant.elastic.steps import ELASTIC_WEIGHT, IMPLICIT, correct_blades, keep_blades
from fowt_env.plant.model import LoadCache
from fowt_env.plant.slow_loads import FIRST, WEIGHTS
from fowt_env.plant.state import BLADES, State

FINE, T = 0.00625, 20.0
SEA = {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}
RATED = dict.fromkeys(("oc3_hywind", "nrel5mw_oc4_semi"), (1.267, 43_093.0))  # rad/s, N m
RATED["iea15_volturnus_s"] = (0.79, 19.8e6)


def start(scene, speed, pitch, torque):
    """A state with straight blades at rest, at a rotor speed (rad/s) and a blade pitch (rad); its command."""
    x, u = np.zeros(scene.n_state), np.full(1 + BLADES, pitch)
    x[State.ROTOR_SPEED], u[0] = speed, torque
    first = scene.model.pitches.first
    x[[State.BLADE_PITCH, first, first + 1]] = pitch
    return x, u


def states(scene, x, u, dt, seconds, every=False):
    """States every 0.1 s, and the last status; every: evaluate the slow loads at every step."""
    scene, rows, count, x = scene.with_step(dt), [], round(0.1 / dt), x.copy()
    data = scene.data()
    handle = scene.handle(data)
    forget(handle)
    for step in range(round(seconds / dt)):
        if every and data.cache[LoadCache.STEPS] > FIRST:
            data.cache[LoadCache.STEPS] = FIRST + 1.0
        status = advance(handle, x, u, step, 1, dt)
        if step % count == count - 1:
            rows.append(x.copy())
        if status != 0:
            break
    return np.array(rows), status


KIND = {"duration": 100.0, "blades": "modes2", "tower": "modes2", "shaft": "torsion"}  # as elastic_scene


@pytest.fixture(scope="module")
def waves():
    return build_scene("oc3_hywind", wind=18.0, sea=SEA, seed=1, **KIND)


def test_differences_of_blades_are_corrected_for_fourth_differences_of_structure_and_damping(waves):
    """Not their mean, which is exact on a shaft that twists."""
    blades, work, rng, dt = waves.model.blades, waves.data().rotor, np.random.default_rng(4), 0.05
    n, first = len(blades.beam.count), blades.first
    q, v = slice(first, first + 3 * n), slice(first + 3 * n, first + 6 * n)
    x, y, past = rng.normal(size=waves.n_state), rng.normal(size=waves.n_state), np.zeros((4, 3 * n))
    history, deflections = rng.normal(size=(4, waves.n_state)), rng.normal(size=(4, 3 * n))
    for row in deflections[::-1]:
        x[q] = row
        keep_blades(x, blades, past)
    np.testing.assert_array_equal(past, deflections)
    new = y.copy()
    correct_blades(dt, x, history, past, blades, waves.model.shaft, work, new)

    def differences(values):
        split = values.reshape(*values.shape[:-1], BLADES, n)
        return split - split.mean(axis=-2, keepdims=True)

    rates = history[:, q]  # of the deflections: their velocities at past steps
    moved = x[q] + dt / 24.0 * (9.0 * new[v] + 19.0 * rates[0] - 5.0 * rates[1] + rates[2])
    bent = differences(np.vstack([moved, deflections]))
    swung = differences(np.vstack([new[v], rates]))
    binomial = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
    force = ELASTIC_WEIGHT * np.tensordot(binomial, bent, 1) @ blades.spring.T
    force += IMPLICIT * np.tensordot(binomial, swung, 1) @ blades.decay.T
    wanted = (y[v].reshape(BLADES, n) - dt * force).ravel()
    np.testing.assert_allclose(new[v], wanted, rtol=1e-12, atol=1e-12)
    assert np.array_equal(np.delete(new, np.r_[v]), np.delete(y, np.r_[v]))


def test_corrections_are_weighted_by_what_the_formulas_miss():
    past = (-np.arange(4.0)[:, None]) ** 4  # of s^4, whose fourth difference is 24, and its integral to 1 1/5
    missed, over = 0.2 - bashforth(4, 0, past), 0.2 - moulton(4, 1.0, 0, past)
    assert pytest.approx(missed, rel=1e-12) == 24.0 * IMPLICIT
    assert pytest.approx(missed + over, rel=1e-12) == 24.0 * ELASTIC_WEIGHT


def test_slow_loads_are_extrapolated_by_the_cubic_through_four_evaluations():
    times = -np.arange(4.0)
    for power in range(4):
        assert np.dot(WEIGHTS, times**power) == pytest.approx(0.5**power, abs=1e-13)
    assert FIRST == 7  # evaluations at the steps 0, 2, 4 and 6


@pytest.mark.nightly
def test_loads_at_every_second_step_are_as_good_as_at_every_step():
    waves = build_scene("oc3_hywind", 18.0, SEA, seed=1, **KIND | {"blades": "modes", "tower": "modes"})
    moved = start(waves, *RATED["oc3_hywind"][:1], 0.26, RATED["oc3_hywind"][1])
    exact, _ = states(waves, *moved, FINE, T)
    every, _ = states(waves, *moved, waves.dt, T, every=True)
    second, _ = states(waves, *moved, waves.dt, T)
    assert np.any(second != every)
    deviation = exact.std(axis=0)
    here = deviation > 0.0
    errors = [np.sqrt(((rows - exact) ** 2).mean(axis=0))[here] / deviation[here] for rows in (every, second)]
    assert np.all(errors[1] < errors[0] + 3e-4)


@pytest.mark.nightly
def test_the_default_step_converges_with_order_four(waves):
    scene = waves.with_weather(wind=12.0, sea=None)
    x, u = start(scene, 1.2, 0.1, 40_000.0)
    ends = [states(scene, x, u, dt, 10.0)[0][-1] for dt in (0.05, 0.025, FINE)]
    first = scene.model.blades.first
    deflections = slice(first, first + BLADES * len(scene.model.blades.beam.count))
    for part in (slice(State.AZIMUTH), deflections):
        coarse, fine = (np.abs(end - ends[-1])[part].max() for end in ends[:-1])
        assert coarse / fine > 10.0  # 16 with order 4, 8 with order 3
    assert coarse < 5e-3 * np.abs(ends[-1][deflections]).max()


# (wind m/s, rotor speed over that at rated power, blade pitch rad, torque over the rated, held rotor)
LIMITS = {
    "parked in a storm": (50.0, 0.0, 1.57, 0.0, True),
    "parked, blades across the wind": (25.0, 0.0, 0.0, 0.0, True),
    "idling": (50.0, 0.0, 1.57, 0.0, False),
    "overspeed": (16.0, 1.3, 0.2, 1.0, False),
    "slow": (6.0, 0.6, 0.0, 0.4, False),
    "grid loss": (18.0, 1.0, 1.0, 0.0, False),
}


@pytest.mark.nightly
@pytest.mark.parametrize("platform", RATED)
@pytest.mark.parametrize("case", LIMITS)
def test_the_default_step_is_stable(platform, case):
    wind, over, pitch, share, held = LIMITS[case]
    scene = build_scene(platform, wind=wind, sea=SEA, seed=1, **KIND)
    scene = scene.with_model({"rigid_body.rotor_fixed": held})
    speed, torque = RATED[platform]
    begin = start(scene, over * speed, pitch, share * torque)
    blades = scene.model.blades
    size = BLADES * len(blades.beam.count)
    swings = []
    for dt in (scene.dt, 0.5 * scene.dt):  # a swing that is limited by the air does not grow either
        rows, status = states(scene, *begin, dt, 60.0)
        assert status == 0
        swings.append(rows[:, blades.first + size : blades.first + 2 * size].std(axis=1))
        deflections = rows[:, blades.first : blades.first + size]
        assert np.abs(deflections).max() < 0.25 * scene.turbine.rotor.tip_radius
    assert swings[0][-100:].max() < 2.0 * swings[0][50:250].max()
    assert swings[0][-100:].max() < 1.2 * swings[1][-100:].max()


@pytest.mark.parametrize(
    ("platform", "parts", "step"),
    [
        ("oc3_hywind", {}, 0.05),
        ("oc3_hywind", {"shaft": "rigid"}, 0.025),
        # whose nacelle the torque of the shaft moves more
        pytest.param("nrel5mw_oc4_semi", {}, 0.025, marks=pytest.mark.nightly),
        ("nrel5mw_oc4_semi", {"turbine": "nrel5mw"}, 0.025),
        ("nrel5mw_iti_barge", {}, 0.05),
        # without a gearbox, whose torque would move the nacelle
        pytest.param("iea15_volturnus_s", {}, 0.05, marks=pytest.mark.nightly),
    ],
)
def test_the_default_step_is_halved_where_blades_in_phase_move_the_nacelle(platform, parts, step):
    """With 0.05 s runs of the OC4 semi-submersible at 14 and 18 m/s ended as not finite, one at 8.5 s."""
    assert build_scene(platform, fidelity="elastic", **parts).dt == step


@pytest.mark.nightly
def test_blades_in_phase_keep_their_swing_on_a_rigid_shaft():
    """Against the rotor, at 3 Hz in still air: half of 0.05 s, at which it dies within seconds."""
    parts = {"hydrodynamics": False, "mooring": False, "blades": "modes", "tower": "rigid", "shaft": "rigid"}
    scene = build_scene("oc3_hywind", **parts).with_model({"rigid_body.platform_fixed": True})
    x, u = start(scene, 1.2, 0.0, 0.0)
    first, n = scene.model.blades.first, len(scene.model.blades.beam.count)
    x[first + 1 : first + BLADES * n : n] = 0.1  # m, edgewise
    swings = []
    for dt in (scene.dt, FINE):
        rows, _ = states(scene, x, u, dt, 10.0)
        rates = rows[:, first + BLADES * n : first + 2 * BLADES * n].reshape(-1, BLADES, n)
        swings.append(rates.mean(axis=1)[50:, 1].std())
    assert swings[0] == pytest.approx(swings[1], rel=0.1)
