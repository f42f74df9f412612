from math import pi

import numpy as np
import pytest
from naive import waves as naive

from fowt_env.descriptions.sea_state import SeaState
from fowt_env.plant.hydro.waves import elevation, ramp_factor, wave_kinematics
from fowt_env.weather.waves import build_waves, jonswap, recorded_sea, wave_number

pytestmark = pytest.mark.installation

G, RHO, DEPTH = 9.80665, 1025.0, 320.0
SITE = dict(depth=DEPTH, density=RHO, gravity=G, seed=0, duration=600.0)
# omega, amplitude, phase, heading: kh from 0.5 to 158 at the depth of the site
SEA = [(0.09, 0.8, 0.3, 0.0), (0.5, 1.2, 1.0, 0.7), (1.1, 0.5, -2.0, -2.5), (2.2, 0.1, 0.0, 3.0)]


def components(sea, depth=DEPTH, **changes):
    omega, amplitude, phase, heading = np.array(sea).T
    state = SeaState(
        kind="components", omega=omega, amplitude=amplitude, phase=phase, heading=np.degrees(heading)
    )
    return build_waves(state, **(SITE | {"depth": depth} | changes))


def jonswap_sea(**changes):
    sea = dict(kind="jonswap", Hs=6.0, Tp=10.0, gamma=3.3) | changes
    return SeaState(**sea)


@pytest.mark.parametrize("sea", [None, SeaState(kind="still"), SeaState(kind="regular", H=0.0, T=8.0)])
def test_still_water_has_no_waves(sea):
    assert build_waves(sea, **SITE) is None
    assert elevation(3.0, 1.0, 2.0, None) == 0.0


@pytest.mark.parametrize("depth", [5.0, 50.0, 320.0, 5000.0])
def test_wave_numbers_satisfy_the_dispersion_relation(depth):
    omega = np.geomspace(0.02, 6.0, 300)
    k = wave_number(omega, depth, G)
    assert np.abs(G * k * np.tanh(k * depth) / omega**2 - 1.0).max() < 1e-14
    expected = [naive.wave_number(om, depth, G) for om in omega[::30]]
    assert np.allclose(k[::30], expected, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("depth", [30.0, 320.0])
def test_kinematics_are_the_hyperbolic_sums(depth):
    waves = components(SEA, depth=depth)
    rng = np.random.default_rng(0)
    for _ in range(40):
        t, x, y = rng.uniform(-100.0, 100.0, 3)
        z = rng.uniform(-depth, 2.0)
        got = wave_kinematics(t, x, y, z, waves)
        velocity, acceleration, pressure = naive.kinematics(t, x, y, z, SEA, depth, RHO, G)
        assert np.allclose(got[0:3], velocity, rtol=1e-10, atol=1e-11)
        assert np.allclose(got[3:6], acceleration, rtol=1e-10, atol=1e-11)
        assert got.pressure == pytest.approx(pressure, rel=1e-10, abs=1e-7)
        assert elevation(t, x, y, waves) == pytest.approx(naive.elevation(t, x, y, SEA, depth, G), abs=1e-11)


def test_acceleration_is_the_time_derivative_of_velocity_and_of_pressure_gradient():
    waves = components(SEA)
    t, x, y, z, step = 11.0, 5.0, -3.0, -12.0, 1e-4
    now = wave_kinematics(t, x, y, z, waves)
    later, before = (wave_kinematics(t + s * step, x, y, z, waves) for s in (1, -1))
    for i in range(3):
        rate = (later[i] - before[i]) / (2 * step)
        assert rate == pytest.approx(now[3 + i], abs=1e-7)
    moved = [
        [wave_kinematics(t, x + s * dx, y + s * dy, z + s * dz, waves).pressure for s in (1e-3, -1e-3)]
        for dx, dy, dz in np.eye(3)
    ]
    for (up, down), acceleration in zip(moved, now[3:6], strict=True):
        assert -(up - down) / 2e-3 / RHO == pytest.approx(acceleration, abs=1e-6)


def test_crest_travels_towards_the_heading():
    waves = components([(0.8, 1.0, 0.0, np.radians(30.0))])
    speed = 0.8 / waves.wave_number[0]
    x, y = speed * 5.0 * np.cos(np.radians(30.0)), speed * 5.0 * np.sin(np.radians(30.0))
    assert elevation(0.0, 0.0, 0.0, waves) == pytest.approx(1.0, abs=1e-15)
    assert elevation(5.0, x, y, waves) == pytest.approx(1.0, abs=1e-12)


def test_longest_waves_come_first_so_that_sums_may_stop_early():
    waves = components(SEA[::-1])
    assert np.all(np.diff(waves.wave_number) > 0.0)


def test_ramp_raises_the_waves_from_rest():
    still = build_waves(SeaState(kind="regular", H=2.0, T=8.0), **SITE)
    raised = build_waves(SeaState(kind="regular", H=2.0, T=8.0, ramp=50.0), **SITE)
    assert [ramp_factor(t, 50.0) for t in (0.0, 12.5, 50.0, 80.0)] == [0.0, 0.25, 1.0, 1.0]
    assert [ramp_factor(t, 0.0) for t in (-3.0, 0.0, 3.0)] == [1.0, 1.0, 1.0]
    assert ramp_factor(-3.0, 50.0) == 0.0
    for t in (0.0, 20.0, 60.0):
        share = min(t / 50.0, 1.0)
        assert elevation(t, 3.0, 0.0, raised) == pytest.approx(
            share * elevation(t, 3.0, 0.0, still), abs=1e-15
        )
        full, part = (wave_kinematics(t, 3.0, 0.0, -5.0, waves) for waves in (still, raised))
        assert np.allclose(part, share * np.array(full), rtol=1e-14, atol=0.0)


def test_spectrum_has_its_height_peak_and_area():
    omega = np.linspace(0.05, 40.0, 400000)
    spectrum = jonswap(omega, 6.0, 10.0, 3.3)
    m0 = np.sum((spectrum[1:] + spectrum[:-1]) / 2.0 * np.diff(omega))
    assert 4.0 * np.sqrt(m0) == pytest.approx(6.0, rel=5e-3)  # 1 - 0.287 ln(gamma) is a fit
    assert omega[np.argmax(spectrum)] == pytest.approx(2.0 * pi / 10.0, abs=2e-4)
    # Pierson-Moskowitz has this height exactly
    m0 = np.sum(jonswap(omega, 6.0, 10.0, 1.0)) * (omega[1] - omega[0])
    assert 4.0 * np.sqrt(m0) == pytest.approx(6.0, rel=1e-4)


def test_the_peak_of_jonswap_is_wider_above_than_below():
    peak, gamma = 2.0 * pi / 10.0, 3.3
    omega = peak * np.array([1.0 - 0.07, 1.0, 1.0 + 0.09])  # a width off, where the exponent is -1/2
    raised = jonswap(omega, 6.0, 10.0, gamma) / jonswap(omega, 6.0, 10.0, 1.0)
    expected = (1.0 - 0.287 * np.log(gamma)) * gamma ** np.exp([-0.5, 0.0, -0.5])
    assert np.allclose(raised, expected, rtol=1e-12, atol=0.0)


def test_unit_gamma_is_pierson_moskowitz():
    omega = np.linspace(0.3, 3.0, 50)
    peak = 2.0 * pi / 9.0
    expected = 5.0 / 16.0 * 4.0**2 * peak**4 / omega**5 * np.exp(-1.25 * (peak / omega) ** 4)
    assert np.allclose(jonswap(omega, 4.0, 9.0, 1.0), expected, rtol=1e-14, atol=0.0)
    a = build_waves(jonswap_sea(gamma=1.0), **SITE)
    b = build_waves(SeaState(kind="pierson_moskowitz", Hs=6.0, Tp=10.0), **SITE)
    assert np.array_equal(a.amplitude, b.amplitude) and np.array_equal(a.phase, b.phase)


@pytest.mark.parametrize("count", [None, 1, 7, 500])
def test_drawn_sea_has_its_significant_height(count):
    waves = build_waves(jonswap_sea(), **SITE, components=count)
    assert 4.0 * np.sqrt(np.sum(waves.amplitude**2) / 2.0) == pytest.approx(6.0, rel=1e-12)
    assert count is None or waves.omega.size == count


def test_drawn_sea_follows_the_spectrum():
    waves = build_waves(jonswap_sea(), **SITE)
    step = np.diff(waves.omega).mean()
    density = waves.amplitude**2 / (2.0 * step)
    expected = jonswap(waves.omega, 6.0, 10.0, 3.3)
    assert np.allclose(density, expected, rtol=0.01, atol=0.0)  # what lies outside the band is returned


def test_components_stand_in_the_middle_of_their_shares_of_the_band():
    waves = build_waves(jonswap_sea(), **SITE, components=50)
    edges = 2.0 * pi / 10.0 * np.linspace(0.5, 5.0, 51)
    assert np.allclose(waves.omega, 0.5 * (edges[1:] + edges[:-1]), rtol=1e-12, atol=0.0)


def test_elevation_has_a_quarter_of_the_significant_height_as_deviation():
    waves = build_waves(jonswap_sea(), **(SITE | {"duration": 3600.0}))
    eta = np.array([elevation(t, 0.0, 0.0, waves) for t in np.arange(0.0, 3600.0, 1.0)])
    assert eta.std() == pytest.approx(1.5, rel=0.01)
    assert abs(eta.mean()) < 0.02


def test_default_sea_does_not_repeat_within_the_run():
    waves = build_waves(jonswap_sea(), **(SITE | {"duration": 1200.0}))
    assert np.diff(waves.omega).max() <= 2.0 * pi / 1200.0 * (1.0 + 1e-12)


def test_seed_draws_the_phases_and_nothing_else():
    first, again, other = (build_waves(jonswap_sea(), **(SITE | {"seed": s})) for s in (5, 5, 6))
    assert np.array_equal(first.phase, again.phase)
    assert not np.array_equal(first.phase, other.phase)
    assert np.array_equal(first.amplitude, other.amplitude)


def test_a_recorded_elevation_is_represented_by_its_components():
    made = build_waves(jonswap_sea(), **SITE)
    time = np.arange(0.0, 600.0, 0.1)
    record = np.array([elevation(t, 0.0, 0.0, made) for t in time])
    record += 0.5 + 0.1 * np.sin(0.05 * time)  # tide, second-order waves
    found = build_waves(SeaState(**recorded_sea(time, record, heading=30.0)), **SITE)
    inner = time[600:-600:50]
    error = [elevation(t, 0.0, 0.0, found) - elevation(t, 0.0, 0.0, made) for t in inner]
    assert np.std(error) < 0.02 * record.std()
    assert np.allclose((found.cos_heading, found.sin_heading), np.array([[0.75**0.5], [0.5]]))


def test_a_record_of_still_water_has_no_waves():
    time = np.arange(0.0, 60.0, 0.1)
    assert build_waves(SeaState(**recorded_sea(time, 0.0 * time)), **SITE) is None
