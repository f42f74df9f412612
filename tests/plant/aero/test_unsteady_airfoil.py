"""Unsteady airfoils against their differential equations, AeroDyn, and each other's rotor models."""

import numpy as np
import pytest
from naive import unsteady_airfoil as naive
from numba import config
from rotor_helpers import moving, series_of

import fowt_env
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.blade_elements import build_blade_elements, lift_drag
from fowt_env.plant.aero.section_inflow import build_dynamic_sections, dynamic_sections_load
from fowt_env.plant.aero.unsteady_airfoil import (
    PER_STATION,
    STEADY,
    AirfoilBlade,
    airfoil_dynamics,
    build_unsteady_airfoils,
    linear_range,
    n_airfoil_states,
    separation_at,
    step_airfoils,
    unsteady_coefficients,
    unsteady_load,
)
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import N_RIGID, pose_of
from fowt_env.scene.build import build_scene

TURBINE = read_turbine("nrel5mw")
ELEMENTS = build_blade_elements(TURBINE, 1.225)
NAMES = sorted(set(TURBINE.blade.airfoil))


def stepped(times, angle, speed, chord, foil, elements, part):
    """((n,), (n,)) lift and drag at times, evenly spaced by the step of the part; at rest before."""
    steady, x, dx = part._replace(dt=STEADY), np.zeros(PER_STATION), np.zeros(PER_STATION)
    unsteady_coefficients(angle(times[0]), speed(times[0]), chord, foil, 0, steady, elements.polars, x, dx)
    x += STEADY * dx
    found = []
    for t in times:
        found.append(unsteady_coefficients(angle(t), speed(t), chord, foil, 0, part, elements.polars, x, dx))
        x += part.dt * dx
    return np.array(found).T


@pytest.mark.parametrize("name", ["NACA64_A17", "DU35_A17"])
def test_loops_in_stall_are_those_of_the_differential_equations(name):
    foil, polar, chord = NAMES.index(name), np.asarray(TURBINE.blade.polars[name]), 3.0
    dynamics, ends = airfoil_dynamics(polar), linear_range(polar)

    def angle(t):
        return np.radians(9.0 + 7.0 * np.sin(1.3 * t) + 1.5 * np.cos(3.9 * t))

    def speed(t):
        return 45.0 + 8.0 * np.cos(1.3 * t)

    errors = []
    for dt in (0.04, 0.02):
        part = build_unsteady_airfoils(ELEMENTS, 0, dt)
        times = np.arange(round(12.0 / dt)) * dt
        found = stepped(times, angle, speed, chord, foil, ELEMENTS, part)
        exact = np.array(naive.response(times, angle, speed, chord, polar, dynamics, ends))
        static = np.array([lift_drag(angle(t), foil, ELEMENTS.polars)[:2] for t in times]).T
        late = times > 2.0
        errors.append(np.sqrt(np.mean((found - exact)[:, late] ** 2, axis=1)))
        size = np.sqrt(np.mean((static - exact)[:, late] ** 2, axis=1))
    assert (errors[1] < 0.02 * size).all() and (errors[1] < 0.4 * errors[0]).all()  # second order


@pytest.mark.parametrize("name", NAMES)
def test_at_rest_lift_and_drag_are_those_of_the_polar(name):
    foil, part = NAMES.index(name), build_unsteady_airfoils(ELEMENTS, 0, 0.1)
    for alpha in np.radians([-170.0, -60.0, -12.0, -3.0, 0.0, 5.0, 9.3, 14.0, 25.0, 42.0, 60.0]):
        found = stepped([0.0], lambda t, a=alpha: a, lambda t: 50.0, 3.0, foil, ELEMENTS, part)[:, 0]
        assert found == pytest.approx(lift_drag(alpha, foil, ELEMENTS.polars)[:2], rel=1e-9, abs=1e-12)


def test_lift_follows_a_step_of_the_angle_late_and_a_slow_or_stalled_flow_at_once():
    foil, part = NAMES.index("NACA64_A17"), build_unsteady_airfoils(ELEMENTS, 0, 0.01)

    def after(angle, speed, jump=0.02):
        times = np.arange(400) * 0.01
        lift, _ = stepped(
            times, lambda t: angle + jump * (t > 0.005), lambda t: speed, 3.0, foil, ELEMENTS, part
        )
        return (lift - lift[0]) / (lift_drag(angle + jump, foil, ELEMENTS.polars)[0] - lift[0])

    late = after(0.02, 30.0)
    assert 0.02 < late[1] < 0.3 and late[40] < 0.95 and late[-1] == pytest.approx(1.0, abs=2e-3)
    assert after(np.radians(46.0), 30.0)[1:] == pytest.approx(np.ones(399), abs=1e-9)
    assert after(0.02, 0.005)[1:] == pytest.approx(np.ones(399), abs=1e-9)


def test_in_a_slow_or_stalled_flow_the_states_have_the_values_of_the_angle_after_a_step():
    foil, part = NAMES.index("NACA64_A17"), build_unsteady_airfoils(ELEMENTS, 0, 0.01)
    A1, A2 = part.constants[foil, 2:4]
    for alpha, speed in ((np.radians(46.0), 30.0), (0.06, 0.005)):
        x, dx = np.array([0.3, -0.2, 0.1, 0.6]), np.zeros(PER_STATION)
        unsteady_coefficients(alpha, speed, 3.0, foil, 0, part, ELEMENTS.polars, x, dx)
        separation, _ = separation_at(alpha, foil, part, ELEMENTS.polars)
        assert x + part.dt * dx == pytest.approx([A1 * alpha, A2 * alpha, alpha, separation], abs=1e-12)


def test_each_station_of_each_blade_has_states_of_its_own():
    part, count = build_unsteady_airfoils(ELEMENTS, N_RIGID, 0.1), len(ELEMENTS.radius)
    elements = ELEMENTS._replace(airfoils=part)
    x = np.zeros(N_RIGID + n_airfoil_states(elements))
    for number in range(3):
        rates = np.zeros_like(x)
        blade = AirfoilBlade(part, number, 0.1, None, elements, x, rates)
        for j in range(count):
            rates[:] = 0.0
            unsteady_load(0.0, 0.0, 1.0, 9.0, 50.0, j, blade)
            own = N_RIGID + PER_STATION * (count * number + j) + np.arange(PER_STATION)
            if part.constants[elements.foil[j], 0] != 0.0:  # not a cylinder
                assert rates[own[:3]].all()
                rates[own] = 0.0
            assert not rates.any()
    y = np.full_like(x, 5.0)
    step_airfoils(x + 1.0, 0.1, part, elements, np.arange(len(x), dtype=float), y)
    assert y == pytest.approx(np.r_[np.full(N_RIGID, 5.0), 1.0 + 0.1 * np.arange(N_RIGID, len(x))])


# OpenFAST v5.0.0 (git 2895884d), UA_Mod 4, BDF2, 0.005 s: IEA 15 MW with straight blades, no tilt and cone,
# 10 m/s from 20 deg, 7.05 rpm, 0 deg, quasi-steady induction: harmonics over the azimuth at node 9 of 50.
AERODYN_ANGLE = (11.32, 4.8688, 0.63575, 0.057412, -0.0035671)  # deg, cosines
AERODYN_SPEED = (19.194, -2.9424, 0.038482, 0.00118)
AERODYN_LIFT = ((1.6953, 0.0), (0.37924, 0.050374), (0.037751, -0.020998))  # cosine and sine
AERODYN_DRAG = ((0.08393, 0.0), (0.035847, -0.037517), (0.015631, -0.0092561))


def test_the_loop_of_an_inner_station_in_yawed_wind_is_that_of_aerodyn():
    turbine = read_turbine("iea15")
    elements = build_blade_elements(turbine, 1.225)
    j, rate = 8, 7.05 * np.pi / 30.0
    foil = elements.foil[j]
    steps = 600
    dt = 2.0 * np.pi / rate / steps
    times = np.arange(4 * steps) * dt

    def series(terms, t):
        return sum(term * np.cos(k * rate * t) for k, term in enumerate(terms))

    found = stepped(
        times, lambda t: np.radians(series(AERODYN_ANGLE, t)), lambda t: series(AERODYN_SPEED, t),
        elements.chord[j], foil, elements, build_unsteady_airfoils(elements, 0, dt),
    )[:, -steps:]  # fmt: skip
    static = np.array(
        [lift_drag(np.radians(series(AERODYN_ANGLE, t)), foil, elements.polars)[:2] for t in times[-steps:]]
    ).T
    waves = np.exp(1j * rate * times[-steps:])
    for values, steady, expected in zip(found, static, (AERODYN_LIFT, AERODYN_DRAG), strict=True):
        for k, (cosine, sine) in enumerate(expected):
            scale = 1.0 if k == 0 else 2.0
            wave = scale * np.mean(values * waves**k)
            # measured: 0.008 of the part that is not steady, which polars and their spline in AeroDyn add
            unsteady = abs(scale * np.mean((values - steady) * waves**k)) if k else 0.05 * cosine
            assert abs(wave - complex(cosine, sine)) < 0.03 * unsteady + 1e-3 * abs(expected[0][0])


def test_a_cylinder_has_no_unsteady_lift():
    cylinder = np.array([[-np.pi, 0.0, 0.5, 0.0], [0.0, 0.0, 0.5, 0.0], [np.pi, 0.0, 0.5, 0.0]])
    assert linear_range(cylinder) is None and airfoil_dynamics(cylinder).lift_slope == 0.0


@pytest.mark.nightly
@pytest.mark.skipif(config.DISABLE_JIT, reason="tables take minutes without the compiler")
def test_the_look_up_has_the_airfoils_of_blade_element_momentum():
    states, winds = moving(60)
    part = build_unsteady_airfoils(ELEMENTS, N_RIGID, 0.1)
    elements = ELEMENTS._replace(airfoils=part)
    count = n_airfoil_states(elements)
    assert count == PER_STATION * 3 * 19
    states = np.hstack([states[:, :N_RIGID], np.zeros((60, count))])
    rotor, counters, loads, rates = build_dynamic_sections(elements, None), np.zeros(N_COUNTERS), [], []
    steady = build_dynamic_sections(elements._replace(airfoils=part._replace(dt=STEADY)), None)
    rng = np.random.default_rng(4)
    for x, row in zip(states, winds, strict=True):
        series, dx = series_of(row), np.zeros((3, len(x)))
        now, pose = wind_now(0.0, series), pose_of(x)
        dynamic_sections_load(0.0, pose, x, now, series, None, steady, dx[0], counters, None, None)
        x[N_RIGID:] = STEADY * dx[0, N_RIGID:] * rng.uniform(0.8, 1.2, count)
        both = (
            rotor_load(0.0, pose, x, now, series, None, elements, None, None, dx[1], counters, None, None),
            dynamic_sections_load(0.0, pose, x, now, series, None, rotor, dx[2], counters, None, None),
        )
        loads.append([(load.thrust, load.torque) for load in both])
        rates.append(dx[1:])
    solved, found = np.array(loads).transpose(1, 0, 2)
    assert (np.abs(found - solved).max(axis=0) < 2e-3 * solved.std(axis=0)).all()
    exact, table = np.array(rates).transpose(1, 0, 2)
    assert not table[:, :N_RIGID].any() and np.abs(exact).max() > 0.01
    assert np.sqrt(np.mean((table - exact) ** 2)) < 5e-3 * exact.std()


@pytest.mark.nightly
def test_a_run_has_the_trim_of_quasi_steady_airfoils_and_the_loads_of_half_the_step():
    plain = build_scene(wind=14.0, sea="regular:6:9", rotor="bem", fidelity="standard")
    scene = build_scene(
        wind=14.0, sea="regular:6:9", rotor="bem", fidelity="standard", unsteady_airfoils="hgm"
    )
    for name in ("BldPitch1", "RtFldFxh", "PtfmPitch"):
        assert fowt_env.trim(scene)[name] == pytest.approx(fowt_env.trim(plain)[name], rel=1e-9)
    runs = [
        fowt_env.simulate(which, controller="pi", duration=40.0, dt=dt)["RtFldFxh_[N]"].to_numpy()[100:]
        for which, dt in ((scene, 0.1), (scene, 0.05), (plain, 0.05))
    ]
    effect = np.std(runs[2] - runs[1])
    assert 0.003 * np.std(runs[2]) < effect < 0.2 * np.std(runs[2])
    assert np.std(runs[0] - runs[1]) < 0.1 * effect


def test_tables_of_the_whole_rotor_and_linear_models_refuse_it():
    with pytest.raises(InputError, match="rotor = 'table': does not support unsteady_airfoils"):
        build_scene(wind=8.0, rotor="table", unsteady_airfoils="hgm")
    scene = build_scene(wind=8.0, rotor="bem", unsteady_airfoils="hgm")
    assert dict((block.name, block.size) for block in scene.blocks)["airfoil"] == PER_STATION * 3 * 19
    assert scene.with_step(0.02).model.aero.rotor.elements.airfoils.dt == 0.02
    with pytest.raises(InputError, match="airfoil cannot be linearised.*unsteady_airfoils=False"):
        fowt_env.linearize(scene)
