import numpy as np
import pytest
from naive import curved_rotor
from numba import config, njit
from rotor_helpers import curved, move_platform, series_of

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.blade_shape import BladeLoad, blade_motion, with_blade
from fowt_env.plant.aero.section_table import build_section_table, section_table_load
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.aero.wind_field import WindField
from fowt_env.plant.blade_pitches import BladePitches
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import BLADES, N_RIGID, NO_LOAD, State, pose_of
from fowt_env.plant.tilt import build_tilt, rotor_pose, to_body_axes

compiled = pytest.mark.skipif(config.DISABLE_JIT, reason="tables take minutes without the compiler")
PITCHES = BladePitches(N_RIGID)


STRAIGHT = read_turbine("nrel5mw")
TURBINES = {"straight": STRAIGHT, "curved": curved(STRAIGHT)}
ELEMENTS = {name: build_blade_elements(turbine, 1.225) for name, turbine in TURBINES.items()}


@pytest.fixture(scope="module")
def tables():
    return {name: build_section_table(elements) for name, elements in ELEMENTS.items()}


@njit
def exact_load(x, series, field, tilt, elements, pitches, blades, counters):
    pose, now = rotor_pose(pose_of(x), tilt), wind_now(0.0, series)
    load = rotor_load(
        0.0, pose, x, now, series, field, elements, None, None, x, counters, pitches, blades
    )  # fmt: skip
    return load.wrench, load.thrust, load.torque


@njit
def table_load(x, series, field, tilt, table, pitches, blades, counters):
    pose, now = rotor_pose(pose_of(x), tilt), wind_now(0.0, series)
    load = section_table_load(0.0, pose, x, now, series, field, table, counters, pitches, blades)
    return load.wrench, load.thrust, load.torque


def box(seed=3):
    """WindField that the rotor never leaves in y and z, 16 m/s on the average."""
    velocity = np.random.default_rng(seed).normal(0.0, 1.5, (40, 12, 12, 3)).astype(np.float32)
    velocity[..., 0] += 16.0
    return WindField(velocity, 2.0, 10.0, 1.0 / 16.0, -110.0, -10.0, 0.05, 0.05, True)


def by(kernel, rotor, name, states, winds, pitches=PITCHES, field=None):
    """((n, 8), (n, 3, 6)): wrench in rotor axes about the body origin, thrust, torque; blades' loads."""
    tilt, counters = build_tilt(TURBINES[name].rotor.shaft_tilt), np.zeros(N_COUNTERS)
    totals, parts = [], []
    for x, row in zip(states, winds, strict=True):
        blades = np.zeros((BLADES, 6))
        found = kernel(x.copy(), series_of(row), field, tilt, rotor, pitches, blades, counters)
        totals.append([*found[0], *found[1:]])
        parts.append(blades)
    return np.array(totals), np.array(parts)


def moving(n, seed=1, spread=6.0):
    """n states of a moving platform about 16 m/s whose pitches differ by up to `spread` deg, and the wind."""
    rng = np.random.default_rng(seed)
    states, winds = np.zeros((n, N_RIGID + 2)), np.zeros((n, 5))
    move_platform(states, rng)
    states[:, State.AZIMUTH] = rng.uniform(0.0, 2.0 * np.pi, n)
    states[:, State.ROTOR_SPEED] = 1.267 * rng.uniform(0.9, 1.1, n)
    mean, change = rng.uniform(8.0, 16.0, (n, 1)), 0.5 * spread * rng.uniform(-1.0, 1.0, (n, 3))
    states[:, State.BLADE_PITCH :] = np.radians(mean + change)
    winds[:, 0] = rng.uniform(12.0, 20.0, n)
    winds[:, 1:] = winds[:, :1] * rng.uniform(-1.0, 1.0, (n, 4)) * [0.1, 0.05, 0.06, 0.06]
    return states, winds


@compiled
@pytest.mark.parametrize("field", [None, box()], ids=["series", "box"])
@pytest.mark.parametrize("name", TURBINES)
def test_equal_pitches_have_the_loads_of_one_pitch_for_all(name, field, tables):
    states, winds = moving(20, spread=0.0)
    states[0, State.BLADE_PITCH :] = np.radians(-6.0)  # outside the table
    states[1, State.ROTOR_SPEED] = 0.3  # too slow for it
    for kernel, rotor in ((exact_load, ELEMENTS[name]), (table_load, tables[name])):
        each, _ = by(kernel, rotor, name, states, winds, field=field)
        collective, untouched = by(kernel, rotor, name, states, winds, None, field)
        assert each == pytest.approx(collective, rel=1e-12, abs=1e-12 * np.abs(collective).max())
        assert not untouched.any()


def test_loads_are_those_of_stations_of_blades_turned_one_by_one():
    turbine, elements = TURBINES["curved"], ELEMENTS["curved"]
    states, winds = moving(3)
    found, _ = by(exact_load, elements, "curved", states, winds)
    tilt = build_tilt(turbine.rotor.shaft_tilt)
    for load, x, row in zip(found, states, winds, strict=True):
        series = series_of(row)

        def wind(point, series=series):
            return np.array(wind_at(0.0, *point, wind_now(0.0, series), series, None))

        pitches = x[[State.BLADE_PITCH, N_RIGID, N_RIGID + 1]]
        expected = curved_rotor.loads(turbine, elements, x, wind, 1.225, pitches)
        wrench = to_body_axes(NO_LOAD._make(load[:6]), tilt)
        assert np.array(wrench) == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@compiled
@pytest.mark.parametrize("field", [None, box()], ids=["series", "box"])
@pytest.mark.parametrize("name", TURBINES)
def test_the_table_has_the_exact_loads_of_every_blade(name, field, tables):
    """To the table's own accuracy, and exactly where one of the blades is pitched beyond it."""
    states, winds = moving(60)
    states[0, State.BLADE_PITCH], states[1, N_RIGID], states[2, N_RIGID + 1] = np.radians([-6.0, 91.0, -7.0])
    exact, each_exact = by(exact_load, ELEMENTS[name], name, states, winds, field=field)
    quick, each_quick = by(table_load, tables[name], name, states, winds, field=field)
    assert np.array_equal(quick[:3], exact[:3]) and np.array_equal(each_quick[:3], each_exact[:3])
    assert not np.array_equal(quick[3:], exact[3:])
    assert np.all(np.abs(quick - exact).max(axis=0) < 3e-3 * np.abs(exact).max(axis=0))
    largest = np.abs(each_exact).max(axis=(0, 1))
    assert np.all(np.abs(each_quick - each_exact).max(axis=(0, 1)) <= 3e-3 * largest)


@compiled
@pytest.mark.parametrize("field", [None, box()], ids=["series", "box"])
@pytest.mark.parametrize("name", TURBINES)
def test_loads_of_the_blades_add_up_to_those_of_the_rotor(name, field, tables):
    turbine = TURBINES[name]
    hub = np.array([-turbine.rotor.overhang, 0.0, turbine.rotor.hub_height])
    c, s = np.cos(turbine.rotor.shaft_tilt), np.sin(turbine.rotor.shaft_tilt)
    hub = np.array([c * hub[0] - s * hub[2], 0.0, s * hub[0] + c * hub[2]])
    states, winds = moving(10)
    for kernel, rotor in ((exact_load, ELEMENTS[name]), (table_load, tables[name])):
        totals, parts = by(kernel, rotor, name, states, winds, field=field)
        for x, load, blades in zip(states, totals, parts, strict=True):
            about_centre = NO_LOAD
            for number, part in enumerate(blades):
                psi = x[State.AZIMUTH] + 2.0 * np.pi * number / BLADES
                at = blade_motion(psi, 0.0, pose_of(x), pose_of(x))
                about_centre = with_blade(about_centre, BladeLoad(*part), at)
            force, moment = np.array(about_centre[:3]), np.array(about_centre[3:])
            expected = [*force, *(moment + np.cross(hub, force)), force[0], moment[0]]
            assert load == pytest.approx(np.array(expected), rel=1e-11, abs=1e-11 * np.abs(load).max())


@compiled
@pytest.mark.parametrize("name", TURBINES)
def test_a_blade_feels_its_own_pitch_alone(name, tables):
    states, winds = moving(5)
    for kernel, rotor in ((exact_load, ELEMENTS[name]), (table_load, tables[name])):
        _, before = by(kernel, rotor, name, states, winds)
        for number, index in enumerate((State.BLADE_PITCH, N_RIGID, N_RIGID + 1)):
            changed = states.copy()
            changed[:, index] += 0.02
            _, after = by(kernel, rotor, name, changed, winds)
            others = [other for other in range(BLADES) if other != number]
            assert np.array_equal(after[:, others], before[:, others])
            assert np.all(after[:, number, 0] < 0.99 * before[:, number, 0])  # towards feather: less thrust
