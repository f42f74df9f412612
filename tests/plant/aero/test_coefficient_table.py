import numpy as np
import pytest
from rotor_helpers import series_of, state, wind_series

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.aero.bem_rotor import NO_ROTOR_LOAD, rotor_load
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.coefficient_table import build_coefficient_table, coefficient_table_load
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.events import N_COUNTERS, Counter
from fowt_env.plant.state import State, pose_of

pytestmark = pytest.mark.installation

ROTOR = build_blade_elements(read_turbine("nrel5mw"), 1.225)
TABLE = build_coefficient_table(ROTOR)
RATED_THRUST, RATED_TORQUE = 750e3, 4.18e6
OPERATION = [  # wind m/s, rotor speed rad/s, blade pitch rad: operating points from cut-in to cut-out
    (4.0, 0.752, 0.0),
    (8.0, 0.964, 0.0),
    (11.0, 1.248, 0.0),
    (12.0, 1.267, 0.0692),
    (15.0, 1.267, 0.1826),
    (18.0, 1.267, 0.2609),
    (24.0, 1.267, 0.3864),
]


def from_table(x, series, table=TABLE, counters=None):
    counters = np.zeros(N_COUNTERS) if counters is None else counters
    return coefficient_table_load(pose_of(x), x, wind_now(0.0, series), series, table, counters)


def from_sections(x, series):
    now, counters = wind_now(0.0, series), np.zeros(N_COUNTERS)
    return rotor_load(
        0.0, pose_of(x), x, now, series, None, ROTOR, None, None, np.zeros_like(x), counters, None, None
    )


def both(speed, blade_pitch, wind):
    """(load of the table, of the sections) in a uniform wind."""
    x, series = state(speed, blade_pitch), wind_series(wind)
    return from_table(x, series), from_sections(x, series)


def over_azimuth(x, series, points=8):
    """Mean wrench and torque of the sections over a third of a turn."""
    loads = []
    for azimuth in np.linspace(0, 2 * np.pi / 3, points, endpoint=False):
        x[State.AZIMUTH] = azimuth
        result = from_sections(x, series)
        loads.append([*result.wrench, result.thrust, result.torque])
    return np.mean(loads, axis=0)


def test_absent_table_or_wind_gives_exactly_zero():
    x = state(1.2, 0.0)
    assert from_table(x, wind_series(10.0), None) == NO_ROTOR_LOAD
    assert from_table(x, None) == NO_ROTOR_LOAD
    empty = build_coefficient_table(ROTOR._replace(air_density=0.0))
    assert np.all(np.array(from_table(x, wind_series(10.0), empty).wrench) == 0.0)


def test_wind_steeper_than_the_table_takes_is_counted_and_a_usual_one_is_not():
    counters = np.zeros(N_COUNTERS)
    from_table(state(1.2, 0.1), wind_series(15.0), counters=counters)
    assert not counters.any()
    yawing = state(1.2, 0.1, velocity=(0, 0, 0, 0, 0, 0.2))
    from_table(yawing, wind_series(15.0), counters=counters)
    assert counters[Counter.ROTOR_TABLE_CLAMPED] == counters.sum() == 1.0


def test_same_rotor_is_tabulated_once():
    one, again = (build_blade_elements(read_turbine("nrel5mw"), 1.225) for _ in range(2))
    assert build_coefficient_table(again) is build_coefficient_table(one)


def test_table_is_the_blade_element_momentum_solution_at_its_points():
    rng = np.random.default_rng(0)
    for _ in range(200):
        theta, beta = rng.choice(TABLE.theta.point), rng.choice(TABLE.blade_pitch.point)
        if abs(theta) == np.pi or np.cos(theta) == 0.0:
            continue
        wind, speed = 20 * np.cos(theta), 20 * np.sin(theta) / ROTOR.tip_radius
        a, b = both(speed, beta, wind)
        q = 0.5 * 1.225 * np.pi * 63.0**2 * 400.0
        assert a.thrust == pytest.approx(b.thrust, abs=1e-9 * q)
        assert a.torque == pytest.approx(b.torque, abs=1e-9 * q * 63.0)


def test_table_is_within_a_tenth_of_a_percent_around_operation():
    """Interpolation error near the operating points, relative to rated thrust and torque."""
    rng = np.random.default_rng(1)
    thrust, torque = [], []
    for _ in range(500):
        U, speed, beta = OPERATION[rng.integers(len(OPERATION))]
        factors = rng.uniform([0.85, 0.9], [1.15, 1.1])
        U, speed, beta = U * factors[0], speed * factors[1], beta + rng.uniform(-0.03, 0.05)
        a, b = both(speed, beta, U)
        thrust.append(abs(a.thrust - b.thrust) / RATED_THRUST)
        torque.append(abs(a.torque - b.torque) / RATED_TORQUE)
    assert max(thrust) < 1e-3
    assert max(torque) < 1e-3


def test_table_covers_standstill_overspeed_feather_and_reversed_wind():
    """Relative to the dynamic pressure of wind and tip speed together, which bounds every load."""
    rng = np.random.default_rng(2)
    worst = 0.0
    for _ in range(2000):
        U, speed, beta = rng.uniform(-25, 40), rng.uniform(-0.5, 2.2), rng.uniform(-0.1, 1.65)
        a, b = both(speed, beta, U)
        q = 0.5 * 1.225 * np.pi * 63.0**2 * (U**2 + (63.0 * speed) ** 2)
        worst = max(worst, abs(a.thrust - b.thrust) / q, abs(a.torque - b.torque) / (63.0 * q))
    assert worst < 2e-3
    assert np.all(np.array(from_table(state(0.0, 0.3), wind_series(0.0)).wrench) == 0.0)


def hub_loads(wrench):
    """Three forces and three moments about the hub."""
    fx, fy, fz, mx, my, mz = wrench[:6]
    height, overhang = ROTOR.hub_height, ROTOR.overhang
    return np.array([fx, fy, fz, mx + height * fy, my - height * fx - overhang * fz, mz + overhang * fy])


def test_random_gusts_and_motions_give_the_loads_of_the_sections_over_a_turn():
    """Error over standard deviation, with wind, shear and motion as in 18 m/s turbulence and Hs 7.5 m."""
    rng = np.random.default_rng(3)
    table, sections = [], []
    for _ in range(200):
        gust = rng.normal(size=5) * [1.8, 1.2, 0.5, 2.8, 2.8]
        series = series_of(gust + [18.0, 0.0, 0.0, 0.0, 0.0])
        x = state(1.267 + 0.1 * rng.normal(), 0.26 + 0.012 * gust[0] + 0.01 * rng.normal())
        attitude = rng.normal(size=3) * [0.004, 0.015, 0.015] + [0.0, 0.05, 0.0]
        x[[State.ROLL, State.PLATFORM_PITCH, State.YAW]] = attitude
        x[State.VX : State.WZ + 1] = rng.normal(size=6) * [0.5, 0.1, 0.3, 0.002, 0.008, 0.003]
        table.append(hub_loads(from_table(x, series).wrench))
        sections.append(hub_loads(over_azimuth(x.copy(), series, 16)))
    error = np.std(np.subtract(table, sections), axis=0) / np.std(sections, axis=0)
    assert np.all(error < [0.01, 0.02, 0.02, 0.01, 0.015, 0.01])


@pytest.mark.parametrize("U, speed, beta", OPERATION)
def test_platform_motion_is_damped_as_by_the_sections(U, speed, beta):
    """Derivatives with surge velocity, pitch and yaw rate, within 2 %."""
    series = wind_series(U)
    for axis, row, step in ((0, 0, 0.2), (4, 4, 0.004), (5, 5, 0.004)):
        velocity = np.zeros(6)
        velocity[axis] = step
        slopes = []
        for evaluate in (
            lambda x: np.array(from_table(x, series).wrench),
            lambda x: over_azimuth(x, series)[:6],
        ):
            up = evaluate(state(speed, beta, velocity=velocity))
            down = evaluate(state(speed, beta, velocity=-velocity))
            slopes.append((up[row] - down[row]) / (2 * step))
        assert slopes[1] < 0.0
        # the moment's own derivative is taken over the width of gusts, that of the thrust is exact
        assert slopes[0] == pytest.approx(slopes[1], rel=0.02 if axis != 5 else 0.05)
