import numpy as np
import pytest
from naive import inflow
from naive import rotor as naive
from numba import njit
from rotor_helpers import state, wind_series

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.aero.bem_rotor import NO_ROTOR_LOAD, rotor_load
from fowt_env.plant.aero.blade_elements import bem_residual, blade_section, build_blade_elements
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.events import N_COUNTERS, Counter
from fowt_env.plant.state import State, pose_of
from fowt_env.training.validation.openfast_cases import steady_reference

pytestmark = pytest.mark.installation

TURBINE = read_turbine("nrel5mw")
ROTOR = build_blade_elements(TURBINE, 1.225)
AREA = np.pi * ROTOR.tip_radius**2
RPM = np.pi / 30

# model-choices.md: wind m/s, rpm, blade pitch deg, C_P, C_T, thrust kN, torque MN m
REFERENCE = [
    (8.0, 9.156, 0.0, 0.4883, 0.7904, 386.3, 1.9916),
    (11.4, 12.1, 0.0, 0.4831, 0.7522, 746.5, 4.3139),
    (12.0, 12.1, 3.83, 0.4055, 0.5399, 593.8, 4.2231),
    (15.0, 12.1, 10.45, 0.2061, 0.2451, 421.2, 4.1916),
    (18.0, 12.1, 14.92, 0.1197, 0.1418, 350.9, 4.2074),
    (25.0, 12.1, 23.47, 0.0401, 0.0530, 253.0, 3.7801),
]


def load(x, series, rotor=ROTOR, counters=None):
    counters = np.zeros(N_COUNTERS) if counters is None else counters
    now = wind_now(0.0, series)
    return rotor_load(
        0.0, pose_of(x), x, now, series, None, rotor, None, None, np.zeros_like(x), counters, None, None
    )


@njit
def sections(v_normal, v_tangential, blade_pitch, station, rotor, out):
    """out (n, 6): phi, fn, ft, residual at phi, solved, residual the solver reports."""
    for i in range(v_normal.size):
        s = blade_section(v_normal[i], v_tangential[i], blade_pitch[i], station[i], 1.0, rotor)
        balanced = s.solved and v_tangential[i] > 0.02 * abs(v_normal[i])
        out[i, 0], out[i, 1], out[i, 2], out[i, 4], out[i, 5] = s.phi, s.fn, s.ft, s.solved, s.residual
        out[i, 3] = 0.0
        if balanced:
            out[i, 3] = bem_residual(s.phi, v_normal[i], v_tangential[i], blade_pitch[i], station[i], rotor)


def random_inflow(n, seed):
    """Inflows of every kind: reversed, backwards, standing still, feathered, weak in one direction."""
    rng = np.random.default_rng(seed)
    v_normal, v_tangential = rng.uniform(-40, 40, n), rng.uniform(-30, 110, n)
    blade_pitch = np.radians(rng.uniform(-20, 110, n))
    v_normal[: n // 50] = 0.0
    v_tangential[n // 50 : n // 25] = 0.0
    blade_pitch[::7] = np.pi / 2
    v_normal[1::11] *= 1e-3
    v_tangential[2::13] *= 1e-3
    return v_normal, v_tangential, blade_pitch, rng.integers(0, len(ROTOR.radius), n)


def test_absent_rotor_or_wind_gives_exactly_zero():
    x = state(1.2)
    series = wind_series(10.0)
    assert load(x, series, rotor=None) == NO_ROTOR_LOAD
    assert load(x, None) == NO_ROTOR_LOAD
    thin = build_blade_elements(TURBINE, 0.0)
    assert np.all(np.abs(load(x, series, rotor=thin).wrench) == 0.0)
    assert np.all(np.array(load(state(), wind_series(0.0)).wrench) == 0.0)


@pytest.mark.parametrize("U, rpm, beta, cp, ct, thrust, torque", REFERENCE)
def test_rotor_reproduces_the_reference_table(U, rpm, beta, cp, ct, thrust, torque):
    """The table integrates radius times line load by the trapezium rule; so does this comparison."""
    trapezium = ROTOR._replace(moment_weight=ROTOR.radius * ROTOR.weight)
    result = load(state(rpm * RPM, np.radians(beta)), wind_series(U), trapezium)
    q = 0.5 * 1.225 * AREA * U**2
    assert result.thrust / 1e3 == pytest.approx(thrust, rel=2e-3)
    assert result.torque / 1e6 == pytest.approx(torque, rel=2e-3)
    assert result.thrust / q == pytest.approx(ct, rel=2e-3)
    assert result.torque * rpm * RPM / (q * U) == pytest.approx(cp, abs=5e-5 + 1e-3 * cp)  # printed to 1e-4


def test_rotor_agrees_with_openfast_at_its_operating_points():
    """AeroDyn, rigid, no tilt or cone, uniform steady wind of 4 to 24 m/s, OC3's controller."""
    points = steady_reference()
    assert len(points) == 18
    for point in points.to_dict("records"):
        x = state(point["rotor_speed_rpm"] * RPM, np.radians(point["blade_pitch_deg"]))
        result = load(x, wind_series(point["wind_mps"]))
        assert result.thrust / 1e3 == pytest.approx(point["aero_thrust_kN"], rel=3e-3), point
        assert result.torque / 1e3 == pytest.approx(point["aero_torque_kNm"], rel=3e-3), point


def test_a_of_one_third_gives_the_betz_thrust_of_eight_ninths():
    from scipy.optimize import brentq

    station, wind, blade_pitch = 11, 8.0, 0.02
    speed = brentq(lambda v: blade_section(wind, v, blade_pitch, station, 1.0, ROTOR).a - 1 / 3, 20.0, 60.0)
    s = blade_section(wind, speed, blade_pitch, station, 1.0, ROTOR)
    loss = naive.losses(s.phi, ROTOR.radius[station], ROTOR)
    local = ROTOR.blades * s.fn / (2 * np.pi * ROTOR.radius[station]) / (0.5 * 1.225 * wind**2)
    assert local / loss == pytest.approx(8 / 9, rel=1e-9)


def test_residual_vanishes_on_every_random_inflow():
    n = 100_000
    out = np.empty((n, 6))
    sections(*random_inflow(n, seed=1), ROTOR, out)
    assert np.all(np.isfinite(out)) and np.all(out[:, 4] == 1.0)
    assert np.abs(out[:, 3]).max() < 1e-10
    assert np.abs(out[:, 5]).max() < 1.01e-8


def section_of(station, blade_pitch):
    blade = TURBINE.blade
    polar = blade.polars[blade.airfoil[station]]
    return blade.twist[station] + blade_pitch, blade.radius[station], blade.chord[station], polar, ROTOR


@pytest.mark.parametrize("count", [100, pytest.param(300, marks=pytest.mark.nightly)])
def test_sections_agree_with_the_naive_twin(count):
    rng = np.random.default_rng(2)
    several = 0
    for _ in range(count):
        station = rng.integers(0, 19)
        v_normal, v_tangential = rng.uniform(-30, 30), rng.uniform(1.0, 100)
        if rng.random() < 0.2:  # little wind: the propeller-brake state
            v_normal *= 0.05
        beta = rng.uniform(-0.2, 1.65)
        theta, radius, chord, polar, rotor = section_of(station, beta)
        v_tangential = max(v_tangential, 0.021 * abs(v_normal))
        s = blade_section(v_normal, v_tangential, beta, station, 1.0, ROTOR)
        mirrored = v_normal < 0
        every = naive.roots(abs(v_normal) / v_tangential, theta, radius, chord, polar, rotor, mirrored)
        f = -s.phi if mirrored else s.phi
        assert min(abs(f - root) for root in every) < 1e-9
        if len(every) > 1:
            several += 1
            continue
        phi, a, ap, fn, ft = naive.solve(v_normal, v_tangential, theta, radius, chord, polar, rotor)
        scale = 0.5 * 1.225 * chord * (v_normal**2 + v_tangential**2)
        assert s.phi == pytest.approx(phi, abs=1e-9)
        assert s.fn == pytest.approx(fn, abs=1e-9 * scale)
        assert s.ft == pytest.approx(ft, abs=1e-9 * scale)
        assert s.a == pytest.approx(a, rel=1e-7, abs=1e-7)
        assert s.ap == pytest.approx(ap, rel=1e-7, abs=1e-7)
    assert several < 0.13 * count


@pytest.mark.parametrize("U, speed, beta", [(8.0, 0.96, 0.0), (13.0, 1.267, 6.6), (22.0, 1.3, 19.9)])
def test_moving_rotor_in_sheared_wind_agrees_with_the_naive_twin(U, speed, beta):
    series = wind_series(U, 1.5, -0.4, vertical=0.8, horizontal=-0.5, shear=0.14)
    x = state(
        speed, np.radians(beta), 0.7, (3, -2, 1, 0.03, 0.08, 0.05), (0.4, -0.3, 0.2, 0.004, 0.012, -0.006)
    )
    result = load(x, series)
    pose, now = pose_of(x), wind_now(0.0, series)
    R = np.array(pose[3:12]).reshape(3, 3)

    def wind(point):
        return np.array(wind_at(0.0, *point, now, series, None))

    pitches = [x[State.BLADE_PITCH]] * 3
    force, moment, torque, _ = inflow.loads(
        TURBINE, ROTOR, R, x[:3], x[7:10], x[10:13], x[State.AZIMUTH], speed, pitches, None, wind
    )
    assert np.array(result.wrench[:3]) == pytest.approx(force, abs=1e-9 * np.linalg.norm(force))
    assert np.array(result.wrench[3:]) == pytest.approx(moment, abs=1e-9 * np.linalg.norm(moment))
    assert result.torque == pytest.approx(torque, rel=1e-9)
    assert result.thrust == pytest.approx(force[0], rel=1e-9)


def test_wind_without_spin_starts_the_rotor_and_feathering_unloads_it():
    fine = load(state(0.0, 0.0), wind_series(12.0))
    start = load(state(0.0, np.radians(45.0)), wind_series(12.0))
    feathered = load(state(0.0, np.pi / 2), wind_series(12.0))
    assert start.torque > fine.torque > 0.0
    assert 0.0 < feathered.thrust < 0.2 * fine.thrust


def test_parked_rotor_has_no_induction():
    s = blade_section(20.0, 0.0, 0.3, 10, 1.0, ROTOR)
    assert (s.a, s.ap, s.induced_normal, s.induced_tangential) == (0.0, 0.0, 0.0, 0.0)
    theta, _, chord, polar, _ = section_of(10, 0.3)
    cl, cd = naive.coefficients(np.pi / 2 - theta, polar)
    assert s.fn == pytest.approx(0.5 * 1.225 * chord * 400.0 * cd, rel=1e-12)
    assert s.ft == pytest.approx(0.5 * 1.225 * chord * 400.0 * cl, rel=1e-12)


@pytest.mark.parametrize("U, beta", [(12.0, 0.0), (20.0, 0.4), (25.0, 1.2)])
def test_loads_are_continuous_from_standstill_to_overspeed(U, beta):
    """Polars are steep in stall, hence the bound on steps of 0.05 % of the range, not smaller."""
    speed = np.linspace(-0.3, 2.2, 2001)
    result = [load(state(s, beta), wind_series(U)) for s in speed]
    for values in (np.array([r.thrust for r in result]), np.array([r.torque for r in result])):
        assert np.abs(np.diff(values)).max() < 0.02 * np.ptp(values)


@pytest.mark.parametrize("station", [4, 8, 11, 14, 17])
def test_section_load_is_continuous_from_reversed_flow_through_still_air_into_wind(station):
    v = np.linspace(-1.0, 6.0, 4001)
    fn = np.array([blade_section(u, 1.267 * ROTOR.radius[station], 0.0, station, 1.0, ROTOR).fn for u in v])
    assert np.abs(np.diff(fn)).max() < 0.005 * np.ptp(fn)
    if station >= 8:  # farther inboard the swirl takes a little load away
        assert np.diff(fn).min() > 0.0


def test_section_load_is_continuous_where_the_tangential_wind_changes_sign():
    v = np.linspace(-1.0, 1.5, 4001)
    for station in (0, 3, 8):
        fn = np.array([blade_section(20.0, t, 0.1, station, 1.0, ROTOR).fn for t in v])
        assert np.abs(np.diff(fn)).max() < 0.01 * np.abs(fn).max()


def test_power_stays_below_thrust_times_wind_and_below_betz():
    rng = np.random.default_rng(4)
    best = 0.0
    for _ in range(600):
        U, tsr, beta = rng.uniform(3, 25), rng.uniform(0.3, 15), rng.uniform(-0.1, 1.6)
        speed = tsr * U / ROTOR.tip_radius
        result = load(state(speed, beta), wind_series(U))
        power = result.torque * speed
        if power > 0.0:
            assert power <= result.thrust * U * (1 + 1e-12)
        best = max(best, power / (0.5 * 1.225 * AREA * U**3))
    assert 0.4 < best < 0.593


def test_parked_rotor_of_round_bars_is_mirror_symmetric():
    """Real blades are handed; bars without lift are not: mirrored wind and azimuth mirror the load."""
    bars = {name: np.array([[-np.pi, 0, 0.5, 0], [np.pi, 0, 0.5, 0]]) for name in TURBINE.blade.polars}
    blade = TURBINE.blade.model_copy(update={"polars": bars})
    rotor = build_blade_elements(TURBINE.model_copy(update={"blade": blade}), 1.225)
    a = load(state(0.0, 0.2, 0.5, (0, 2, 0, 0.1, 0.05, 0.2)), wind_series(20.0, 5.0, horizontal=1.0), rotor)
    b = load(
        state(0.0, 0.2, -0.5, (0, -2, 0, -0.1, 0.05, -0.2)), wind_series(20.0, -5.0, horizontal=-1.0), rotor
    )
    signs = np.array([1, -1, 1, -1, 1, -1])
    assert np.array(b.wrench) * signs == pytest.approx(np.array(a.wrench), rel=1e-12, abs=1e-6)


def test_still_air_damps_the_motion_of_a_spinning_and_of_a_parked_rotor():
    still = wind_series(0.0)
    for beta in (0.0, 0.2):
        for v in (0.2, 1.0, 3.0):
            down = load(state(1.267, beta, velocity=(v, 0, 0, 0, 0, 0)), still)
            up = load(state(1.267, beta, velocity=(-v, 0, 0, 0, 0, 0)), still)
            assert down.wrench.fx < up.wrench.fx
    rng = np.random.default_rng(6)
    for _ in range(100):  # parked, drag alone: lift does no work on the motion of its section
        velocity = rng.normal(0, 1, 6) * (1, 1, 1, 0.02, 0.02, 0.02)
        result = load(state(0.0, rng.uniform(0, 1.6), rng.uniform(0, 6), velocity=velocity), still)
        assert np.dot(result.wrench, velocity) < 0.0


def test_missing_root_is_counted_and_the_search_ends():
    """A finite polar always has a root; a hole in the table of polars has none."""
    segment = ROTOR.polars.segment.copy()
    segment[:, 1] = np.nan
    broken = ROTOR._replace(polars=ROTOR.polars._replace(segment=segment))
    s = blade_section(8.0, 50.0, 0.0, 4, 1.0, broken)
    assert not s.solved
    assert (s.a, s.ap, s.induced_normal, s.induced_tangential) == (0.0, 0.0, 0.0, 0.0)
    counters = np.zeros(N_COUNTERS)
    load(state(1.2), wind_series(8.0), broken, counters)
    assert counters[Counter.BEM_FALLBACK] == 3 * len(ROTOR.radius)
    counters[:] = 0.0
    for wind in (0.0, 1e-9, 8.0, -8.0):
        load(state(1.2), wind_series(wind), counters=counters)
    assert counters[Counter.BEM_FALLBACK] == 0.0


@pytest.mark.parametrize(
    "polar, words",
    [
        ([[-np.pi, 0, np.nan, 0], [np.pi, 0, 0.5, 0]], "finite"),
        ([[-1.0, 0, 0.5, 0], [np.pi, 0, 0.5, 0]], "-180 to 180"),
    ],
)
def test_defective_polar_is_refused_by_name(polar, words):
    polars = {**TURBINE.blade.polars, "DU21_A17": np.array(polar)}
    turbine = TURBINE.model_copy(update={"blade": TURBINE.blade.model_copy(update={"polars": polars})})
    with pytest.raises(InputError, match=f"DU21_A17.*{words}"):
        build_blade_elements(turbine, 1.225)


def test_infinite_or_missing_numbers_come_back_as_nan():
    for bad in (np.nan, np.inf, -np.inf):
        for wind in ((bad, 10.0, 0.0), (10.0, bad, 0.0), (10.0, 10.0, bad)):
            assert np.isnan(blade_section(*wind, 5, 1.0, ROTOR).fn)
