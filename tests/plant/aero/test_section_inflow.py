"""The look-up with dynamic inflow against blade-element momentum with it."""

import numpy as np
import pytest
from naive import inflow
from naive.rigid_body import rotation
from numba import config, njit
from rotor_helpers import move_platform, put_load, rough_field, series_of

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.load import Aero, settled_wake
from fowt_env.plant.aero.section_inflow import build_dynamic_sections, dynamic_sections_load
from fowt_env.plant.aero.section_table import build_section_table, section_table_load
from fowt_env.plant.aero.station_choice import build_fewer_elements
from fowt_env.plant.aero.wake import (
    PER_ELEMENT,
    build_dynamic_inflow,
    build_skewed_wake,
    n_wake_states,
    time_constants,
)
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.blade_pitches import BladePitches
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import N_RIGID, State, pose_of

if config.DISABLE_JIT:
    pytest.skip("the tables take minutes to build without the compiler", allow_module_level=True)

WAKE, SKEW = build_dynamic_inflow(), build_skewed_wake()
STRAIGHT = build_blade_elements(read_turbine("nrel5mw"), 1.225)
CURVED = build_fewer_elements(read_turbine("iea15"), 1.225, 18)
ROTORS = {"straight": STRAIGHT, "curved": CURVED}
NAMES = ["straight", pytest.param("curved", marks=pytest.mark.nightly)]
# wind m/s, tip-speed ratio and blade pitch (deg) of operation
SCHEDULE = np.array(
    [(5, 9.0, 0), (8, 8.3, 0), (11.4, 7.0, 0), (14, 5.7, 8.7), (18, 4.4, 14.9), (24, 3.3, 22.5)]
)


@njit
def _many(states, winds, series, field, rotor, counters, pitches, out, rates, blades):
    """out (2, n, 8): loads solved and looked up, rates (2, n, n_state), blades (2, n, 3, 6)."""
    elements, wake = rotor.elements, rotor.wake
    for i in range(states.shape[0]):
        x = states[i]
        series.value[0] = winds[i]
        now, pose = wind_now(0.0, series), pose_of(x)
        a = rotor_load(
            0.0, pose, x, now, series, field, elements, rotor.skew, wake, rates[0, i], counters, pitches,
            blades[0, i],
        )  # fmt: skip
        b = dynamic_sections_load(
            0.0, pose, x, now, series, field, rotor, rates[1, i], counters, pitches, blades[1, i]
        )
        put_load(a, out[0, i])
        put_load(b, out[1, i])


def both(states, winds, rotor, field=None, pitches=None):
    """((2, n, 8), (2, n, n_state)): loads and rates, solved and looked up."""
    out, rates = np.zeros((2, len(states), 8)), np.zeros((2, *states.shape))
    series = series_of([1.0, 0.0, 0.0, 0.0, 0.0])
    blades = np.zeros((2, len(states), 3, 6))
    _many(states, winds, series, field, rotor, np.zeros(N_COUNTERS), pitches, out, rates, blades)
    if pitches is not None:
        share = np.abs(blades[1] - blades[0]).max(axis=(0, 1)) / np.abs(blades[0]).max(axis=(0, 1)).clip(1e-9)
        assert share.max() < 0.01, share
    return out, rates


def settled(x, wind, rotor, shear=0.14):
    """The state with its wake at rest."""
    series = series_of(wind, shear)
    x, now = x.copy(), wind_now(0.0, series)
    aero, end = Aero(series, None, rotor, None, None), (np.zeros(N_COUNTERS), None, np.zeros((3, 6)))
    count = settled_wake(0.0, pose_of(x), x, now, aero, rotor, np.zeros_like(x), *end)
    assert count == n_wake_states(rotor.elements, rotor.wake)
    return x


def operating(n, rotor, seed=1, more=0):
    """(states, winds): about operation, platform moving, wind sheared, wake within 30 % of steady."""
    rng = np.random.default_rng(seed)
    tip, wakes = rotor.elements.tip_radius, n_wake_states(rotor.elements, rotor.wake)
    states, winds = np.zeros((n, N_RIGID + wakes + more)), np.zeros((n, 5))
    speed = rng.uniform(5.0, 24.0, n)
    ratio, pitch = (np.interp(speed, SCHEDULE[:, 0], SCHEDULE[:, i]) for i in (1, 2))
    states[:, State.ROTOR_SPEED] = ratio * speed / tip * rng.uniform(0.9, 1.1, n)
    states[:, State.BLADE_PITCH] = np.radians(pitch + rng.uniform(0.0, 3.0, n))
    states[:, State.AZIMUTH] = rng.uniform(0.0, 2.0 * np.pi, n)
    move_platform(states, rng, pitch=6.0)
    winds[:, 0] = speed
    winds[:, 1:] = speed[:, None] * rng.uniform(-1.0, 1.0, (n, 4)) * [0.1, 0.05, 0.1, 0.1]
    wake = slice(N_RIGID, N_RIGID + wakes)
    for x, wind in zip(states, winds, strict=True) if wakes else ():
        x[wake] = settled(x, wind, rotor)[wake] * rng.uniform(0.7, 1.3, wakes)
    return states, winds


def worst(solved, found):
    """Largest rms error over the standard deviation of all columns that move."""
    moving = solved.std(axis=0) > 1e-9
    error = np.sqrt(np.mean((found - solved) ** 2, axis=0))
    return (error[moving] / solved.std(axis=0)[moving]).max()


def outer(rates, rotor):
    """Rates without those of the two innermost stations: flow along the shaft, where balances jump."""
    wakes = n_wake_states(rotor.elements, rotor.wake)
    shape = (len(rates), rotor.elements.blades, -1, PER_ELEMENT)
    return rates[:, N_RIGID : N_RIGID + wakes].reshape(shape)[:, :, 2:].reshape(len(rates), -1)


@pytest.fixture(scope="module", params=NAMES)
def rotor(request):
    return build_dynamic_sections(ROTORS[request.param], WAKE)


def test_loads_and_rates_are_those_of_blade_element_momentum(rotor):
    states, winds = operating(300, rotor)
    (solved, found), (exact, rates) = both(states, winds, rotor)
    # measured: thrust and torque 2e-4 of their deviation, the others 7e-4, rates of single stations 4e-3
    assert worst(solved[:, 6:], found[:, 6:]) < 5e-4 and worst(solved, found) < 2e-3
    assert worst(outer(exact, rotor), outer(rates, rotor)) < 1e-2
    assert not rates[:, :N_RIGID].any()


@pytest.mark.nightly
@pytest.mark.parametrize(
    "wake",
    [
        pytest.param(None, id="quasi-steady", marks=pytest.mark.nightly),
        pytest.param(WAKE, id="lagging"),
    ],
)
@pytest.mark.parametrize("name", NAMES)
def test_a_skewed_wake_is_that_of_blade_element_momentum(name, wake):
    skewed = build_dynamic_sections(ROTORS[name], wake, SKEW)
    states, winds = operating(100, skewed, seed=10)
    winds[:, 1] = winds[:, 0] * np.tan(np.radians(20.0))
    (solved, found), (exact, rates) = both(states, winds, skewed)
    (straight, _), _ = both(states, winds, skewed._replace(skew=build_skewed_wake(0.0)))
    effect = np.abs(solved - straight).std(axis=0)[3:6]
    # measured: 0.015 of the effect on the smaller one of the moments across the shaft
    assert (np.abs(solved - found).std(axis=0)[4:6] < 0.03 * effect[1:]).all()
    assert worst(solved[:, 6:], found[:, 6:]) < 1e-3 and worst(solved, found) < 4e-3
    if wake is not None:
        # rates, which no skew changes: 0.012 in this yaw, inboard
        assert worst(outer(exact, skewed), outer(rates, skewed)) < 2e-2
    states[0, State.ROTOR_SPEED], winds[1, 0] = 0.1, -8.0  # solved
    (solved, found), _ = both(states[:2], winds[:2], skewed)
    assert np.array_equal(solved, found)


@pytest.mark.nightly
def test_in_a_box_of_wind_too(rotor):
    states, winds = operating(100, rotor, seed=2)
    (solved, found), (exact, rates) = both(states, winds, rotor, rough_field(5, 14.0, 1.0, (-150.0, 5.0), 31))
    assert worst(solved[:, 6:], found[:, 6:]) < 1e-3
    assert worst(outer(exact, rotor), outer(rates, rotor)) < 2e-2


def test_a_plain_sweep_gives_the_same_loads_and_rates():
    rotor = build_dynamic_sections(STRAIGHT, WAKE)
    states, winds = operating(2, rotor, seed=3)
    (_, found), (_, rates) = both(states, winds, rotor)
    turbine, series = read_turbine("nrel5mw"), series_of([1.0, 0.0, 0.0, 0.0, 0.0])
    for i, x in enumerate(states):
        series.value[0] = winds[i]
        now = wind_now(0.0, series)
        wake = x[N_RIGID:].reshape(3, -1, PER_ELEMENT)
        force, moment, torque, plain = inflow.loads(
            turbine, STRAIGHT, rotation(*x[3:6]), x[:3], x[7:10], x[10:13], x[State.AZIMUTH],
            x[State.ROTOR_SPEED], [x[State.BLADE_PITCH]] * 3, wake,
            lambda p, now=now: np.array(wind_at(0.0, *p, now, series, None)),
        )  # fmt: skip
        # the error of the tables, which is 1e-3 of a load at most
        assert found[i, :3] == pytest.approx(force, abs=2e-3 * np.abs(force).max())
        assert found[i, 3:6] == pytest.approx(moment, abs=2e-3 * np.abs(moment).max())
        assert found[i, 7] == pytest.approx(torque, rel=5e-3)
        plain = plain[:, 2:].ravel()
        assert outer(rates[[i]], rotor)[0] == pytest.approx(plain, abs=0.01 * np.abs(plain).max())


def test_a_wake_at_rest_has_the_load_of_the_table_without_it(rotor):
    table = build_section_table(rotor.elements)
    states, winds = operating(5, rotor, seed=4)
    for state, wind in zip(states, winds, strict=True):
        x, series = settled(state, wind, rotor), series_of(wind)
        _, rates = both(x[None], wind[None], rotor)
        assert np.abs(rates[1]).max() < 1e-12
        (_, found), _ = both(x[None], wind[None], rotor)
        steady = section_table_load(
            0.0, pose_of(x), x, wind_now(0.0, series), series, None, table, np.zeros(N_COUNTERS), None,
            np.zeros((3, 6)),
        )  # fmt: skip
        assert found[0, 6:] == pytest.approx([steady.thrust, steady.torque], rel=2e-3)


@njit
def _stepped(x, dt, steps, series, rotor, looked_up, thrust):
    """Thrust over steps of Heun's method on the wake alone, by look-up or solved."""
    counters, blades = np.zeros(N_COUNTERS), np.zeros((3, 6))
    n = x.shape[0]
    rates = np.zeros((2, n))
    pose, now = pose_of(x), wind_now(0.0, series)
    y = x.copy()
    for i in range(steps):
        for stage in range(2):
            at, dx = (x, rates[0]) if stage == 0 else (y, rates[1])
            if looked_up:
                load = dynamic_sections_load(
                    0.0, pose, at, now, series, None, rotor, dx, counters, None, blades
                )
            else:
                load = rotor_load(
                    0.0, pose, at, now, series, None, rotor.elements, None, rotor.wake, dx, counters, None,
                    blades,
                )  # fmt: skip
            if stage == 0:
                thrust[i] = load.thrust
                for k in range(State.INTERNAL, n):
                    y[k] = x[k] + dt * dx[k]
        for k in range(State.INTERNAL, n):
            x[k] += 0.5 * dt * (rates[0, k] + rates[1, k])


def thrust_after(rotor, step, dt, steps, looked_up=True, wind=14.0, wind_step=0.0):
    """(before, (steps,)) thrust, N, as the blade pitch jumps by step (rad), or the wind (m/s)."""
    x = np.zeros(N_RIGID + n_wake_states(rotor.elements, rotor.wake))
    ratio, pitch = (np.interp(wind, SCHEDULE[:, 0], SCHEDULE[:, i]) for i in (1, 2))
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = ratio * wind / rotor.elements.tip_radius, np.radians(pitch)
    x = settled(x, [wind, 0.0, 0.0, 0.0, 0.0], rotor)
    before, thrust = np.zeros(1), np.zeros(steps)
    series = series_of([wind, 0.0, 0.0, 0.0, 0.0])
    _stepped(x.copy(), dt, 1, series, rotor, looked_up, before)
    x[State.BLADE_PITCH] += step
    series.value[0, 0] += wind_step
    _stepped(x, dt, steps, series, rotor, looked_up, thrust)
    return before[0], thrust


def test_thrust_overshoots_and_decays_as_that_of_blade_element_momentum(rotor):
    for change in ({"step": 0.02}, {"step": 0.0, "wind_step": 1.0}):
        before, found = thrust_after(rotor, dt=0.1, steps=600, **change)
        _, solved = thrust_after(rotor, dt=0.1, steps=600, looked_up=False, **change)
        size = abs(solved[-1] - before)
        assert (
            abs(solved[0] - before) > 1.03 * size
        )  # 1.32, 1.19 of a straight rotor, 1.16, 1.05 of the other
        assert np.abs((found - found[-1]) - (solved - solved[-1])).max() < 0.01 * size
        assert found[0] - before == pytest.approx(solved[0] - before, rel=0.01)


def test_without_lag_it_is_the_table():
    quick = build_dynamic_sections(STRAIGHT, build_dynamic_inflow(1e-3))
    _, thrust = thrust_after(quick, 0.02, dt=2e-4, steps=600)
    _, slow = thrust_after(build_dynamic_sections(STRAIGHT, WAKE), 0.02, dt=0.2, steps=600)
    assert thrust[-1] == pytest.approx(slow[-1], rel=1e-9)


def test_what_the_tables_do_not_know_is_solved():
    rotor = build_dynamic_sections(STRAIGHT, WAKE)
    states, winds = operating(4, rotor, seed=6)
    states[0, State.ROTOR_SPEED] = 0.1  # the induction fades
    states[1, State.BLADE_PITCH] = np.radians(95.0)
    states[2, N_RIGID + 1 :: PER_ELEMENT] = -40.0  # the wake blows back
    winds[3, 0] = -8.0
    (solved, found), (exact, rates) = both(states, winds, rotor)
    assert np.array_equal(solved, found) and np.array_equal(exact, rates)
    two = build_dynamic_sections(STRAIGHT._replace(blades=2), WAKE)
    states, winds = operating(2, two)
    (solved, found), (exact, rates) = both(states, winds, two)
    assert np.array_equal(solved, found) and np.array_equal(exact, rates)


def test_a_wake_that_blows_back_a_little_is_looked_up():
    rotor = build_dynamic_sections(STRAIGHT, WAKE)
    states, winds = operating(50, rotor, seed=7)
    tip = slice(N_RIGID + 4 * 18 + 1, None, 4 * 19)
    states[:, tip] = -winds[:, :1] - 2.0
    (solved, found), _ = both(states, winds, rotor)
    assert not np.array_equal(solved, found)
    assert worst(solved[:, 6:], found[:, 6:]) < 5e-4


@pytest.mark.nightly
def test_blades_with_pitches_of_their_own(rotor):
    states, winds = operating(100, rotor, seed=8, more=2)
    first = states.shape[1] - 2
    pitches = BladePitches(first)
    states[:, first:] = states[:, [State.BLADE_PITCH]]
    (_, alike), (_, rates) = both(states, winds, rotor, pitches=pitches)
    (_, found), (_, together) = both(states, winds, rotor)
    assert alike == pytest.approx(found, rel=1e-9, abs=1e-9 * np.abs(found).max())
    assert rates == pytest.approx(together, rel=1e-9, abs=1e-9)
    states[:, first:] += np.radians([2.0, -1.0])
    for field in (None, rough_field(5, 14.0, 1.0, (-150.0, 5.0), 31)):
        (solved, found), (exact, rates) = both(states, winds, rotor, field, pitches)
        assert worst(solved[:, 6:], found[:, 6:]) < 1e-3
        assert worst(outer(exact, rotor), outer(rates, rotor)) < 0.02


def test_no_time_constant_is_shorter_than_the_least():
    slow, fast = time_constants(0.0, 40.0, 62.0, 63.0, build_dynamic_inflow(least=0.4))
    assert slow > 1.0 and fast == 0.4
    rotor = build_dynamic_sections(STRAIGHT, build_dynamic_inflow(least=0.4))
    states, winds = operating(50, rotor, seed=9)
    winds[:, 0] = 40.0
    states[:, State.ROTOR_SPEED] = 1.6
    _, (exact, rates) = both(states, winds, rotor)
    assert worst(outer(exact, rotor), outer(rates, rotor)) < 0.02
