import numpy as np
import pytest
from numba import config, njit
from rotor_helpers import by, looked_up, move_platform, rough_field, series_of, solved

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.aero.blade_elements import blade_section, build_blade_elements
from fowt_env.plant.aero.blade_sweep import NO_ROTOR_LOAD
from fowt_env.plant.aero.section_table import (
    COARSE_END,
    DENSE_START,
    build_section_table,
    section_table_load,
)
from fowt_env.plant.aero.station_response import Rows, Tabled, station_load
from fowt_env.plant.aero.wind import power_profile, profile_at, wind_now
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import N_RIGID, State, pose_of

pytestmark = pytest.mark.installation

if config.DISABLE_JIT:
    pytest.skip("the table takes minutes to build without the compiler", allow_module_level=True)

TURBINE = read_turbine("nrel5mw")
ROTOR = build_blade_elements(TURBINE, 1.225)
TABLE = build_section_table(ROTOR)
RPM = np.pi / 30
NAMES = ("fx", "fy", "fz", "mx", "my", "mz", "thrust", "torque")

# steady operation of the OC3 controller (OpenFAST): wind m/s, rpm, blade pitch deg
SCHEDULE = np.array(
    [
        (4, 7.18, 0), (6, 7.9, 0), (8, 9.21, 0), (10, 11.51, 0), (11.4, 12.1, 1.34), (12, 12.1, 3.96),
        (14, 12.1, 8.68), (17, 12.1, 13.56), (19, 12.1, 16.26), (22, 12.1, 19.91), (25, 12.1, 23.47),
    ]
)  # fmt: skip


def both(states, winds, rotor=ROTOR, table=TABLE, field=None):
    """((n, 8), (n, 8)): exact and tabulated loads, columns NAMES."""
    ways = ((solved, rotor), (looked_up, table))
    return tuple(by(way, states, winds, of, field=field)[0] for way, of in ways)


def operating(n, seed=1):
    """(states, winds): the schedule +-5 deg of blade pitch and +-20 % of speed, platform moving, wind
    sheared, turned by up to 9 deg and rising."""
    rng = np.random.default_rng(seed)
    states, winds = np.zeros((n, N_RIGID)), np.zeros((n, 5))
    speed = rng.uniform(4.0, 25.0, n)
    rpm, pitch = (np.interp(speed, SCHEDULE[:, 0], SCHEDULE[:, i]) for i in (1, 2))
    states[:, State.ROTOR_SPEED] = RPM * rpm * rng.uniform(0.8, 1.2, n)
    states[:, State.BLADE_PITCH] = np.radians(np.clip(pitch + rng.uniform(-5.0, 5.0, n), -4.0, None))
    states[:, State.AZIMUTH] = rng.uniform(0.0, 2.0 * np.pi, n)
    move_platform(states, rng)
    winds[:, 0] = speed
    winds[:, 1:] = speed[:, None] * rng.uniform(-1.0, 1.0, (n, 4)) * [0.15, 0.08, 0.1, 0.1]
    return states, winds


def one(speed=1.2, blade_pitch=0.1, wind=12.0, **values):
    """(states, winds) of a single state."""
    x = np.zeros((1, N_RIGID))
    x[0, State.ROTOR_SPEED], x[0, State.BLADE_PITCH], x[0, State.AZIMUTH] = speed, blade_pitch, 0.4
    for name, value in values.items():
        x[0, State[name.upper()]] = value
    return x, np.array([[wind, 0.5, 0.3, 1.0, -0.7]])


@njit
def stations(v_normal, v_tangential, blade_pitch, station, table, out):
    """out (n, 4): normal and tangential share of the blade's force, of the table and exact, over density."""
    rotor = table.elements
    for i in range(v_normal.size):
        j = station[i]
        degrees = np.degrees(blade_pitch[i])
        row = (degrees + 5.0) * 4.0 if degrees < 30.0 else 140.0 + degrees - 30.0
        k = int(row)
        response = Tabled(Rows(table.load[k], table.load[k + 1], row - k), table.arm, None)
        found = station_load(response, v_normal[i], v_tangential[i], j)
        out[i, 0], out[i, 1] = found.normal, found.tangential
        section = blade_section(v_normal[i], v_tangential[i], blade_pitch[i], j, 1.0, rotor)
        share = rotor.weight[j] / rotor.air_density
        out[i, 2], out[i, 3] = share * section.fn, share * section.ft


def test_absent_table_or_wind_gives_exactly_zero():
    x, winds = one()
    series = series_of(winds[0])
    now, pose, counters = wind_now(0.0, series), pose_of(x[0]), np.zeros(N_COUNTERS)
    assert section_table_load(0.0, pose, x[0], now, series, None, None, counters, None, None) == NO_ROTOR_LOAD
    calm = wind_now(0.0, None)
    assert section_table_load(0.0, pose, x[0], calm, None, None, TABLE, counters, None, None) == NO_ROTOR_LOAD
    thin = build_blade_elements(TURBINE, 0.0)
    for speed in (1.2, 0.0):
        states, winds = one(speed)
        assert np.all(both(states, winds, rotor=thin, table=build_section_table(thin))[1] == 0.0)


def test_loads_over_the_operating_range_are_those_of_blade_element_momentum():
    states, winds = operating(20000)
    exact, quick = both(states, winds)
    error, size = quick - exact, exact.std(axis=0)
    rms, largest = np.sqrt(np.mean(error**2, axis=0)) / size, np.abs(error).max(axis=0) / size
    # measured: rms 1.3e-4 to 1.4e-4, largest 3.9e-3 to 4.5e-3 for these four; the in-plane forces and the
    # yaw moment are a tenth as large in themselves: rms 5.7e-4 to 7.5e-4, largest 1.9e-2
    for name in ("fx", "my", "thrust", "torque"):
        assert rms[NAMES.index(name)] < 2e-4
        assert largest[NAMES.index(name)] < 6e-3
    assert rms.max() < 1e-3 and largest.max() < 2.5e-2
    # the largest lie below -2 deg, where the blades stall and the exact load itself jumps by 2e-3
    allowed = states[:, State.BLADE_PITCH] >= 0.0
    assert np.all(np.abs(error[allowed][:, 6:]).max(axis=0) < 2e-3 * size[6:])
    bias = np.abs(np.mean(error, axis=0)) / np.abs(exact).mean(axis=0)  # which would shift the operation
    assert bias[6:].max() < 6e-5


def test_single_stations_follow_the_exact_load_for_any_inflow():
    rng = np.random.default_rng(3)
    n = 100000
    v_normal, v_tangential = rng.uniform(0.01, 40.0, n), rng.uniform(-30.0, 110.0, n)
    blade_pitch, station = np.radians(rng.uniform(-5.0, 89.9, n)), rng.integers(0, len(ROTOR.radius), n)
    out = np.zeros((n, 4))
    stations(v_normal, v_tangential, blade_pitch, station, TABLE, out)
    unit = (ROTOR.chord * ROTOR.weight)[station] * 0.5 * (v_normal**2 + v_tangential**2)
    error = np.abs(out[:, :2] - out[:, 2:]) / unit[:, None]  # of force coefficients, which go up to 2
    # where the momentum balance has several roots the exact load jumps and the table bridges it
    assert np.sqrt(np.mean(error**2)) < 1e-2
    assert np.quantile(error, 0.5) < 2e-4 and np.quantile(error, 0.99) < 1e-2


@pytest.mark.parametrize("exponent", [0.0, 0.11, 0.14, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("low, high", [(27.0, 153.0), (13.0, 155.0)])
def test_height_profile_follows_the_power_law(exponent, low, high):
    """Within the error of the Pade approximant: 4e-8 over the rotor at rest, 2e-6 at its limit (0.14)."""
    profile = power_profile(low, high, series_of([1.0, 0.0, 0.0, 0.0, 0.0], exponent))
    root = np.sqrt(np.sqrt(high / low))
    bound = 2.0 * abs(np.sin(np.pi * exponent)) * ((root - 1.0) / (root + 1.0)) ** 11
    for height in np.linspace(low, high, 201):
        got = profile.scale * profile_at(height / profile.centre - 1.0, profile)
        assert got == pytest.approx((height / 90.0) ** exponent, rel=1.1 * bound + 1e-14)


@pytest.mark.parametrize(
    "values",
    [
        {"speed": 0.0, "blade_pitch": np.pi / 2, "wind": 45.0},
        {"speed": 0.0, "blade_pitch": 0.0},
        {"speed": -0.5},
        {"speed": 0.3},
        {"blade_pitch": np.radians(COARSE_END)},
        {"blade_pitch": np.radians(DENSE_START) - 1e-6},
        {"speed": 0.0, "wind": 0.0},
        {"wind": np.nan},
        {"blade_pitch": np.nan},
        {"speed": np.nan},
    ],
)
def test_slow_parked_and_feathered_rotors_get_the_exact_load(values):
    exact, quick = both(*one(**values))
    assert np.array_equal(exact, quick, equal_nan=True)


def test_still_air_and_reversed_flow_are_exact_and_a_rotor_that_moves_upwind_is_close():
    for wind in (-8.0, -2.0):
        exact, quick = both(*one(1.2, 0.05, wind))
        assert quick == pytest.approx(exact, rel=1e-12, abs=1e-6)
    states, winds = one(1.2, 0.05, 0.0)
    winds[:] = 0.0
    exact, quick = both(states, winds)
    assert quick == pytest.approx(exact, rel=1e-12, abs=1e-6)
    states[0, State.VX] = -0.5
    exact, quick = both(states, winds)
    assert quick[0, 6] == pytest.approx(exact[0, 6], rel=1e-3)
    assert not both(one(0.0, 0.0, 0.0)[0], winds)[1].any()


def test_near_the_sea_and_far_from_it_the_wind_is_sampled_station_by_station():
    """Heights over which the profile would be a poor power law."""
    for heave in (-35.0, -26.0, -25.0):
        exact, quick = both(*one(heave=heave, platform_pitch=0.1))
        assert quick[0, 6:] == pytest.approx(exact[0, 6:], rel=1e-3)


@pytest.mark.nightly
@pytest.mark.parametrize("periodic", [False, True])
def test_full_field_wind_is_sampled_at_every_station(periodic):
    """Also where a blade reaches beyond the grid."""
    field = rough_field(mean=15.0, deviation=2.0, corner=(-90.0, 10.0), size=19, periodic=periodic)
    states, winds = operating(2000)
    states[::10, State.SWAY] += 60.0
    exact, quick = both(states, winds, field=field)
    uniform, _ = both(states, winds)
    rms = np.sqrt(np.mean((quick - exact) ** 2, axis=0)) / exact.std(axis=0)
    assert rms[6] < 5e-4 and rms[7] < 5e-4
    assert np.abs(uniform - exact)[:, 6].mean() > 0.1 * exact[:, 6].std()  # the box does replace the series


@pytest.mark.parametrize("name", ["blade_pitch", "rotor_speed", "vx", "wy", "azimuth", "heave"])
def test_loads_are_continuous(name):
    """No step across the cells of the table, the two pitch spacings and the wind profile's limit."""
    span = {
        "blade_pitch": (0.5, 0.55),
        "rotor_speed": (1.1, 1.3),
        "heave": (-20.0, -10.0),
        "wy": (-0.02, 0.02),
    }.get(name, (-1.0, 1.0))
    base, winds = one(1.2, 0.2, 15.0)
    n = 20001
    states = np.repeat(base, n, axis=0)
    states[:, State[name.upper()]] = np.linspace(*span, n)
    quick = both(states, np.repeat(winds, n, axis=0))[1]
    step = np.abs(np.diff(quick, axis=0)).max(axis=0)
    slope = np.abs(np.diff(quick[::100], axis=0)).max(axis=0) / 100.0
    assert np.all(step < 4.0 * slope + 1e-7 * np.abs(quick).max(axis=0))


def test_batches_of_fewer_stations_work_alike():
    few = build_blade_elements(TURBINE, 1.225, stations=range(1, 19, 3))
    exact, quick = both(*operating(2000), rotor=few, table=build_section_table(few))
    rms = np.sqrt(np.mean((quick - exact) ** 2, axis=0)) / exact.std(axis=0)
    assert rms[6] < 5e-4 and rms[7] < 5e-4


def test_a_table_serves_every_air_density():
    dense = build_blade_elements(TURBINE, 2.0)
    table = build_section_table(dense)
    assert table.load is build_section_table(build_blade_elements(TURBINE, 1.225)).load
    states, winds = operating(200)
    assert both(states, winds, rotor=dense, table=table)[1] == pytest.approx(
        2.0 / 1.225 * both(states, winds)[1], rel=1e-12
    )
