import numpy as np
import pytest
from naive.strips import strip_load
from plant_helpers import make_pose
from spar_in_waves import STILL, SWITCHES, motion, strips_of, waves_of

from fowt_env.plant.hydro.load import fill_added_mass
from fowt_env.plant.hydro.morison import Current, morison_load

pytestmark = pytest.mark.installation

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


@pytest.mark.parametrize("stream", [None, Current(0.8, -0.4, 1.0 / 7.0)])
@pytest.mark.parametrize("switches", [None, *SWITCHES], ids=lambda switches: "-".join(switches or ["still"]))
def test_load_is_the_plain_integral_for_any_motion(switches, stream, platform, site):
    """switches None: still water."""
    strips, waves = strips_of(platform, *(switches or ())), waves_of(SEA, site) if switches else None

    def profile(height):
        share = np.clip((site.water_depth + height) / site.water_depth, 0.0, 1.0) ** (1.0 / 7.0)
        return np.array([0.8, -0.4]) * share

    rng = np.random.default_rng(2)
    for _ in range(3):
        t, moving = rng.uniform(0.0, 100.0), motion(rng)
        got = load(t, moving, strips, waves, stream)
        wanted, S = strip_load(t, *moving, platform.hull, strips, waves, stream and profile)
        wrench = np.array(got.wrench)
        assert np.abs(wrench[:3] - wanted[:3]).max() < 1e-5 * np.abs(wanted[:3]).max()
        assert np.abs(wrench[3:] - wanted[3:]).max() < 1e-5 * np.abs(wanted[3:]).max()
        assert np.allclose((got.s0, got.s1, got.s2), S, rtol=1e-5, atol=0.0)


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


def test_the_matrix_of_the_added_mass_is_that_of_slices_that_take_water_across_the_axis_along(platform):
    got = load(0.0, STILL, strips_of(platform), None)
    matrix, expected = np.ones((6, 6)), np.diag([0.0, 0.0, got.a33, 0.0, 0.0, 0.0])
    fill_added_mass(got, matrix)
    centre = got.s1 / got.s0
    apart = np.sqrt(got.s2 / got.s0 - centre**2)
    for z in (centre - apart, centre + apart):  # two slices with the same three integrals
        moved = np.vstack([np.eye(3), np.cross(np.eye(3), [0.0, 0.0, z])])[:, :2]
        expected += 0.5 * got.s0 * moved @ moved.T
    assert matrix == pytest.approx(expected, rel=1e-12, abs=1e-12 * got.s2)


def test_current_on_an_upright_spar_is_its_drag_integral(platform, site):
    strips = strips_of(platform)
    got = load(0.0, STILL, strips, None, Current(1.0, 0.0, 0.0))
    area = 108.0 * 9.4 + 8.0 * (9.4 + 6.5) / 2.0 + 4.0 * 6.5
    expected = 0.5 * site.water_density * platform.hydro.drag_coefficient * area
    assert got.wrench.fx == pytest.approx(expected, rel=1e-12)
    # a linear profile: u^2 integrates to the second moment of the height above the seabed
    z = np.linspace(-120.0, 0.0, 200001)
    d = np.interp(z, platform.hull.z, platform.hull.diameter)
    quadratic = 0.5 * site.water_density * platform.hydro.drag_coefficient
    expected = quadratic * np.trapezoid(d * (1.0 + z / site.water_depth) ** 2, z)
    sheared = load(0.0, STILL, strips, None, Current(1.0, 0.0, 1.0))
    assert sheared.wrench.fx == pytest.approx(expected, rel=1e-6)


def test_axial_drag_slows_heave(platform, site):
    strips = strips_of(platform)._replace(axial_drag_coefficient=2.0)
    area = np.pi / 4.0 * 9.4**2
    for speed in (0.5, -0.5):
        got = load(0.0, (np.zeros(3), np.eye(3), np.array([0.0, 0.0, speed]), np.zeros(3)), strips, None)
        expected = -0.5 * site.water_density * 2.0 * area * abs(speed) * speed
        assert got.wrench.fz == pytest.approx(expected, rel=1e-12)


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
