import numpy as np
import pytest
from naive import morison as naive
from naive.morison import spar_of
from plant_helpers import make_pose
from spar_in_waves import STILL, SWITCHES, motion, nodes_of, strips_of, waves_of

from fowt_env.plant.hydro.load import ExactStrips, fill_strip_mass
from fowt_env.plant.hydro.morison import Current, morison_load
from fowt_env.plant.hydro.strip_kinematics import strip_kinematics
from fowt_env.plant.hydro.strips import axis_surface
from fowt_env.plant.hydro.waves import wave_kinematics

pytestmark = pytest.mark.installation

AXES = ["displaced", "undisplaced"]
# omega, amplitude, phase, heading: from kh = 0.5 (felt at the seabed) to 158 (spent above the keel)
SEA = [
    (0.09, 0.8, 0.3, 0.0),
    (0.35, 1.0, 1.0, 0.7),
    (0.8, 1.2, -2.0, -2.5),
    (1.2566, 0.4, 0.5, 3.0),
    (2.2, 0.1, 0.0, 1.0),
]


@pytest.fixture(scope="module")
def site(platform):
    return platform.environment


def load(t, motion, strips, waves, current=None):
    kin = np.zeros((7, strips.nodes))
    return morison_load(t, make_pose(*motion), strips, waves, current, kin)


def test_no_strips_no_load():
    empty = morison_load(
        1.0, make_pose(*motion(np.random.default_rng(0))), None, None, None, np.zeros((7, 0))
    )
    assert all(value == 0.0 for value in (*empty.wrench, *empty[1:]))


@pytest.mark.parametrize("switches", SWITCHES, ids="-".join)
def test_strip_kinematics_are_the_plain_sum_at_the_nodes(switches, platform, site):
    strips, waves = strips_of(platform, *switches), waves_of(SEA, site)
    rng = np.random.default_rng(1)
    for _ in range(12):
        t, moving = rng.uniform(0.0, 100.0), motion(rng)
        pose = make_pose(*moving)
        top, eta = axis_surface(t, pose, strips, waves)
        kin = np.zeros((7, strips.nodes))
        keel = strip_kinematics(t, pose, top, eta, strips, waves, kin)
        z = np.r_[nodes_of(strips, top)[0], strips.keel_z]
        r, R = (moving[0], moving[1]) if switches[0] == "instantaneous" else (np.zeros(3), np.eye(3))
        points = r + np.outer(z, R[:, 2])
        if switches[2] == "wheeler":
            points[:, 2] = site.water_depth * (points[:, 2] - eta) / (site.water_depth + eta)
        expected = np.array([wave_kinematics(t, *point, waves) for point in points]).T
        scale = np.abs(expected).max(axis=1)
        assert np.all(np.abs(kin - expected[:, :-1]).max(axis=1) < 1e-11 * scale)
        got = np.array(keel)
        assert np.all(np.abs(got - expected[:, -1]) < 1e-11 * scale)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("switches", SWITCHES, ids="-".join)
def test_load_is_the_plain_integral_for_any_motion(switches, axis, platform, site):
    strips, spar = (make(platform, *switches, axis=axis) for make in (strips_of, spar_of))
    strips, spar.axial_drag = strips._replace(axial_drag_coefficient=1.5), 1.5
    waves = waves_of(SEA, site)
    rng = np.random.default_rng(2)
    for _ in range(3):
        t, moving = rng.uniform(0.0, 100.0), motion(rng)
        got = load(t, moving, strips, waves)
        top, eta = naive.surface_on_axis(t, moving[0], moving[1], SEA, spar)
        assert np.allclose(
            axis_surface(t, make_pose(*moving), strips, waves), (top, eta), rtol=0.0, atol=1e-8
        )
        # at the same nodes: the same sum; at many nodes: what the quadrature costs
        for at, tolerance in ((nodes_of(strips, top), 1e-8), (None, 1e-5)):
            F, M, S = naive.load(t, *moving, SEA, spar, at=at)
            wrench = np.array(got.wrench)
            assert np.abs(wrench[:3] - F).max() < tolerance * np.abs(F).max()
            assert np.abs(wrench[3:] - M).max() < tolerance * np.abs(M).max()
            assert np.allclose((got.s0, got.s1, got.s2), S, rtol=1e-5, atol=0.0)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("with_waves", [False, True])
def test_load_in_a_current_is_the_plain_integral(with_waves, axis, platform, site):
    strips, spar = strips_of(platform, axis=axis), spar_of(platform, axis=axis)
    sea = SEA if with_waves else None
    waves = waves_of(SEA, site) if with_waves else None
    current = Current(0.8, -0.4, 1.0 / 7.0)

    def profile(height):
        share = np.clip((site.water_depth + height) / site.water_depth, 0.0, 1.0) ** (1.0 / 7.0)
        return np.array([0.8, -0.4]) * share

    rng = np.random.default_rng(3)
    for _ in range(3):
        t, moving = rng.uniform(0.0, 100.0), motion(rng)
        got = load(t, moving, strips, waves, current)
        top, _ = naive.surface_on_axis(t, moving[0], moving[1], sea, spar)
        at = nodes_of(strips, top)
        F, M, _ = naive.load(t, *moving, sea, spar, current=profile, at=at)
        assert np.abs(np.array(got.wrench) - np.r_[F, M]).max() < 1e-8 * np.abs(np.r_[F, M]).max()


def test_drag_quadrature_converges(platform, site):
    waves = waves_of([(1.2566, 1.5, 0.4, 0.0)], site)
    rng = np.random.default_rng(4)
    for _ in range(10):
        t, moving = rng.uniform(0.0, 10.0), motion(rng)
        loads = [load(t, moving, strips_of(platform, cell=cell), waves) for cell in (4.0, 2.0, 0.25)]
        coarse, fine, finest = (np.array(found.wrench) for found in loads)
        assert np.abs(fine - finest).max() < 1e-4 * np.abs(finest).max()
        assert np.abs(coarse - finest).max() < 1e-3 * np.abs(finest).max()


def test_load_is_continuous_in_time(platform, site):
    # a sum that drops spent components must do so without a step
    strips, waves = strips_of(platform), waves_of(SEA, site)
    r, R, v, w = motion(np.random.default_rng(5))
    times = 10.0 + 1e-6 * np.arange(400)
    wrenches = np.array([load(t, (r, R, v, w), strips, waves).wrench for t in times])
    steps = np.abs(np.diff(wrenches, n=2, axis=0)).max(axis=0)
    assert np.all(steps < 1e-8 * np.abs(wrenches).max())


def test_added_mass_has_the_published_entries(platform):
    got = load(0.0, STILL, strips_of(platform), None)
    assert got.s0 == pytest.approx(7.9827e6, rel=1e-4)
    assert got.s1 == pytest.approx(-4.954e8, rel=2e-4)
    assert got.s2 == pytest.approx(3.973e10, rel=2e-4)
    assert got.a33 == platform.hydro.heave_added_mass


@pytest.mark.parametrize("axis", AXES)
def test_the_matrix_of_the_added_mass_is_that_of_slices_that_take_water_across_the_axis_along(axis, platform):
    moving = motion(np.random.default_rng(8))
    strips = strips_of(platform, axis=axis)
    got = load(0.0, moving, strips, None)
    n = moving[1][2] if axis == "undisplaced" else np.array([0.0, 0.0, 1.0])  # the vertical in body axes
    matrix, keel = np.ones((6, 6)), np.r_[n, np.cross([0.0, 0.0, platform.hull.z[0]], n)]
    fill_strip_mass(make_pose(*moving), got, ExactStrips(strips, None), matrix)
    expected = got.a33 * np.outer(keel, keel)
    centre = got.s1 / got.s0
    apart = np.sqrt(got.s2 / got.s0 - centre**2)
    for z in (centre - apart, centre + apart):  # two slices with the same three integrals
        moved = np.vstack([np.eye(3), np.cross([0.0, 0.0, z], np.eye(3)).T])
        expected += 0.5 * got.s0 * moved @ (np.eye(3) - np.outer(n, n)) @ moved.T
    assert matrix == pytest.approx(expected, rel=1e-12, abs=1e-12 * got.s2)


def test_no_waves_equals_waves_of_no_height(platform, site):
    strips, waves = strips_of(platform), waves_of(SEA, site)
    flat = waves._replace(amplitude=0.0 * waves.amplitude, velocity=0.0 * waves.velocity)
    rng = np.random.default_rng(6)
    for _ in range(20):
        moving = motion(rng)
        without, zero = load(3.0, moving, strips, None), load(3.0, moving, strips, flat)
        scale = np.abs(np.array(without.wrench)).max()
        assert np.abs(np.array(without.wrench) - np.array(zero.wrench)).max() < 1e-14 * scale
        assert without[1:] == zero[1:]


def test_drag_vanishes_when_water_moves_with_the_hull(platform):
    # a uniform current and a hull that drifts with it, upright or heeled, no added-mass terms
    strips = strips_of(platform)
    rng = np.random.default_rng(7)
    for _ in range(10):
        r, R, _, _ = motion(rng)
        stream = np.array([0.9, -0.3, 0.0])
        got = load(0.0, (r, R, R.T @ stream, np.zeros(3)), strips, None, Current(0.9, -0.3, 0.0))
        assert np.abs(np.array(got.wrench)).max() < 1e-9


def test_current_on_an_upright_spar_is_its_drag_integral(platform, site):
    strips = strips_of(platform)
    got = load(0.0, STILL, strips, None, Current(1.0, 0.0, 0.0))
    area = 108.0 * 9.4 + 8.0 * (9.4 + 6.5) / 2.0 + 4.0 * 6.5
    expected = 0.5 * site.water_density * platform.hydro.drag_coefficient * area
    assert got.wrench.fx == pytest.approx(expected, rel=1e-12)
    # a linear profile: u^2 integrates to the second moment of the height above the seabed
    z, weight, d, _ = naive.nodes(spar_of(platform), 0.0)
    quadratic = 0.5 * site.water_density * platform.hydro.drag_coefficient
    expected = quadratic * np.sum(weight * d * (1.0 + z / site.water_depth) ** 2)
    sheared = load(0.0, STILL, strips, None, Current(1.0, 0.0, 1.0))
    assert sheared.wrench.fx == pytest.approx(expected, rel=1e-6)


def test_drag_takes_energy_in_still_water_whatever_the_motion(platform):
    strips = strips_of(platform)._replace(
        added_mass_coefficient=0.0, heave_added_mass=0.0, axial_drag_coefficient=1.5
    )
    rng = np.random.default_rng(9)
    for _ in range(200):
        moving = motion(rng, tilt=1.0)
        power = np.array(load(0.0, moving, strips, None).wrench) @ np.r_[moving[2], moving[3]]
        assert power < 0.0


def test_axial_drag_slows_heave(platform, site):
    strips = strips_of(platform)._replace(axial_drag_coefficient=2.0)
    area = np.pi / 4.0 * 9.4**2
    for speed in (0.5, -0.5):
        got = load(0.0, (np.zeros(3), np.eye(3), np.array([0.0, 0.0, speed]), np.zeros(3)), strips, None)
        expected = -0.5 * site.water_density * 2.0 * area * abs(speed) * speed
        assert got.wrench.fz == pytest.approx(expected, rel=1e-12)


def test_still_water_power_of_the_inertia_terms_is_third_order(platform):
    # relative Morison is not a conservative added mass: its residual power is the Munk-type
    # integral of rho A C_A u_z (u_x w_y - u_y w_x), theory.md 5.4
    strips = strips_of(platform)._replace(drag_coefficient=0.0)
    spar = spar_of(platform)
    rng = np.random.default_rng(10)
    for _ in range(20):
        r, R, v, w = motion(rng)
        r[2] = 0.0
        got = np.array(load(0.0, (r, R, v, w), strips, None).wrench)
        z, weight, d, _ = naive.nodes(spar, 0.0)
        line = spar.density * spar.added_mass * np.pi / 4.0 * d**2
        ux, uy = v[0] + w[1] * z, v[1] - w[0] * z
        # w x u has no part along u, so what the normal terms do is what its axial part leaves out
        munk = np.sum(weight * line * v[2] * (w[0] * uy - w[1] * ux))
        keel = v[0] + w[1] * spar.z[0], v[1] - w[0] * spar.z[0]
        munk -= spar.heave_added_mass * v[2] * (w[0] * keel[1] - w[1] * keel[0])
        assert got @ np.r_[v, w] == pytest.approx(munk, rel=1e-4, abs=1e-3)
        tenth = np.array(load(0.0, (r, R, 0.1 * v, 0.1 * w), strips, None).wrench)
        assert tenth @ np.r_[0.1 * v, 0.1 * w] == pytest.approx(1e-3 * munk, rel=1e-4, abs=1e-6)


def test_fixed_spar_has_the_force_amplitudes_of_linear_theory(platform, site):
    # H = 3 m, T = 5 s, integrals to still water; OpenFAST's strips on the same spar
    openfast = {0: 1290.35e3, 4: 10264.2e3, 2: 155.21e3}
    strips = strips_of(platform, "fixed", "swl", "none")._replace(heave_added_mass=0.0)
    omega, height = 2.0 * np.pi / 5.0, 1.5
    waves = waves_of([(omega, height, 0.0, 0.0)], site)
    times = np.arange(200) * 5.0 / 200
    wrench = np.array([load(t, STILL, strips, waves).wrench for t in times])
    amplitude = 2.0 * np.abs(np.exp(-1j * omega * times) @ wrench) / times.size
    for i, expected in openfast.items():
        assert amplitude[i] == pytest.approx(expected, rel=2e-3)
    assert np.abs(wrench[:, [1, 3, 5]]).max() < 1e-9 * amplitude[0]
    # deep-water Airy by fine trapezoids; drag, out of phase, adds 1e-4
    z = np.linspace(-120.0, 0.0, 200001)
    line = site.water_density * np.pi / 4.0 * np.interp(z, platform.hull.z, platform.hull.diameter) ** 2
    line *= (1.0 + platform.hydro.added_mass_coefficient) * omega**2 * height
    line *= np.exp(omega**2 / site.gravity * z)
    assert amplitude[0] == pytest.approx(np.trapezoid(line, z), rel=3e-4)
    assert amplitude[4] == pytest.approx(-np.trapezoid(line * z, z), rel=3e-4)


def test_load_does_not_depend_on_what_the_scratch_held(platform, site):
    strips, waves = strips_of(platform), waves_of(SEA, site)
    moving = make_pose(*motion(np.random.default_rng(12)))
    clean, dirty = np.zeros((7, strips.nodes)), np.full((7, strips.nodes), 1e30)
    assert morison_load(2.0, moving, strips, waves, None, clean) == morison_load(
        2.0, moving, strips, waves, None, dirty
    )
