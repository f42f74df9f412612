import numpy as np
import pytest
from naive import hydrostatics as naive
from naive.rigid_body import rotation
from plant_helpers import make_pose

from fowt_env.plant.events import N_COUNTERS, Counter
from fowt_env.plant.hydro.hydrostatics import build_hull, hydrostatic_load, sliced, submerged
from fowt_env.plant.state import NO_LOAD

pytestmark = pytest.mark.installation


@pytest.fixture(scope="module")
def hull(platform):
    site = platform.environment
    return build_hull(platform.hull, site.water_density, site.gravity)


def posed(r, R):
    return make_pose(r, R, np.zeros(3), np.zeros(3))


def volume_and_moment(r, R, hull):
    counters = np.zeros(N_COUNTERS)
    volume, *Q = submerged(posed(r, R), hull, counters)
    return volume, np.array(Q), counters[Counter.HYDROSTATIC_FALLBACK]


def load(r, R, hull):
    return np.array(hydrostatic_load(posed(r, R), hull, np.zeros(N_COUNTERS)))


def test_no_hull_no_load():
    pose = posed([1.0, 2.0, 3.0], rotation(0.1, 0.2, 0.3))
    assert hydrostatic_load(pose, None, np.zeros(N_COUNTERS)) == NO_LOAD


def test_closed_form_is_the_integral_over_the_wet_hull(hull):
    rng = np.random.default_rng(1)
    cases = [([3.0, -1.0, 0.8], np.radians([6.0, 14.0, 40.0]))]
    for _ in range(30):
        cases.append((rng.normal(size=3) * [9, 9, 0.7], rng.uniform(-1, 1, 3) * [0.25, 0.25, 3.0]))
    for r, angles in cases:
        R = rotation(*angles)
        volume, Q, fallbacks = volume_and_moment(r, R, hull)
        expected, expected_Q = naive.submerged(np.array(r), R, hull.z, hull.section_radius)
        assert fallbacks == 0.0
        assert volume == pytest.approx(expected, rel=1e-12)
        assert np.abs(Q - expected_Q).max() < 1e-10 * np.abs(expected_Q).max()
        F, M = naive.wrench(np.array(r), R, hull.z, hull.section_radius, hull.specific_weight)
        assert np.abs(load(r, R, hull) - np.r_[F, M]).max() < 1e-10 * hull.specific_weight * expected


@pytest.mark.parametrize(
    "heave, roll, platform_pitch",
    [
        (-9.0, 0.0, 0.9),  # the plane cuts cylinder and taper
        (-16.0, 0.3, 0.2),  # deck under water
        (6.0, 0.2, -0.9),  # cylinder out of the water
        (0.0, 0.4, 1.2),
        (-30.0, 0.0, 1.55),  # nearly lying
        (-3.0, 0.2, 1.45),
        (-6.0, 2.5, 0.4),  # upside down
        (200.0, 0.1, 0.2),  # in the air
        (-300.0, 0.1, 0.2),  # sunk
    ],
)
def test_slices_are_the_integral_at_any_draft_and_tilt(heave, roll, platform_pitch, hull):
    r, R = np.array([0.0, 0.0, heave]), rotation(roll, platform_pitch, 0.5)
    volume, *Q = sliced(posed(r, R), hull)
    expected, expected_Q = naive.submerged(r, R, hull.z, hull.section_radius, rings=200, spokes=400)
    whole, whole_Q = naive.submerged(np.array([0.0, 0.0, -1e3]), R, hull.z, hull.section_radius)
    assert abs(volume - expected) < 1e-4 * whole
    assert np.abs(np.array(Q) - expected_Q).max() < 1e-4 * np.abs(whole_Q).max()


def test_load_is_continuous_where_the_fallback_takes_over(hull):
    R = rotation(0.1, 0.3, 0.0)
    reach = hull.radius * np.hypot(R[2, 0], R[2, 1]) / R[2, 2]
    for edge, inward in ((hull.z_join + reach, 1.0), (hull.z_top - reach, -1.0)):
        heave = -edge * R[2, 2]
        inside = np.array([0.0, 0.0, heave - 1e-9 * inward])
        outside = np.array([0.0, 0.0, heave + 1e-9 * inward])
        assert volume_and_moment(inside, R, hull)[2] == 0.0
        assert volume_and_moment(outside, R, hull)[2] == 1.0
        jump = load(inside, R, hull) - load(outside, R, hull)
        assert np.abs(jump[:3]).max() < 1e-6 * np.abs(load(inside, R, hull)[:3]).max()
        assert np.abs(jump[3:]).max() < 1e-6 * np.abs(load(inside, R, hull)[3:]).max()


def test_fallback_is_counted_only_when_the_plane_leaves_the_cylinder(hull):
    counters = np.zeros(N_COUNTERS)
    upright = rotation(0.0, 0.1, 0.0)
    hydrostatic_load(posed(np.zeros(3), upright), hull, counters)
    assert np.all(counters == 0.0)
    for heave in (12.0, -13.0, 5.0):
        hydrostatic_load(posed([0.0, 0.0, heave], upright), hull, counters)
    assert counters[Counter.HYDROSTATIC_FALLBACK] == 3.0


def potential(r, R, hull):
    """U = -rho g (V r_z + n.Q)."""
    volume, Q, _ = volume_and_moment(r, R, hull)
    return -hull.specific_weight * (volume * r[2] + R[2] @ Q)


def test_load_is_the_gradient_of_the_potential(hull):
    rng = np.random.default_rng(3)
    for _ in range(10):
        r, R = rng.normal(size=3) * [5, 5, 0.5], rotation(*(rng.uniform(-1, 1, 3) * [0.2, 0.2, 3.0]))
        force_and_moment = load(r, R, hull)
        inertial = R @ force_and_moment[:3]
        step = 1e-3
        for i in range(3):
            up, down = r.copy(), r.copy()
            up[i] += step
            down[i] -= step
            slope = -(potential(up, R, hull) - potential(down, R, hull)) / (2 * step)
            assert slope == pytest.approx(inertial[i], abs=1e-6 * np.abs(inertial).max())
        step = 1e-4
        for i in range(3):
            turn = [rotation(*(sign * step * np.eye(3)[i])) for sign in (1.0, -1.0)]
            slope = -(potential(r, R @ turn[0], hull) - potential(r, R @ turn[1], hull)) / (2 * step)
            assert slope == pytest.approx(force_and_moment[3 + i], abs=1e-6 * np.abs(force_and_moment).max())


def test_displaced_volume_is_the_published_one(hull, platform):
    volume, _, _ = volume_and_moment(np.zeros(3), np.eye(3), hull)
    assert volume == pytest.approx(platform.published["displaced_volume"], abs=0.01)


def test_stiffnesses_are_the_published_ones(hull):
    step = 1e-4
    up, down = (load([0, 0, h], np.eye(3), hull)[2] for h in (step, -step))
    heave = -(up - down) / (2 * step)
    assert heave == pytest.approx(333550.0, rel=1e-5)  # of the cylinder; panels give 332941
    assert heave == pytest.approx(332941.0, rel=2e-3)
    step = 1e-5
    up, down = (load([0, 0, 0], rotation(0, a, 0), hull)[4] for a in (step, -step))
    assert -(up - down) / (2 * step) == pytest.approx(-5.008e9, rel=1e-4)
