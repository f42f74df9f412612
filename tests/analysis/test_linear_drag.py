"""Drag made linear: against means over random numbers, and against the strips' own drag in random seas."""

import floaters
import numpy as np
import pytest
from plant_helpers import state

from fowt_env import build_scene
from fowt_env.analysis.linear_drag import (
    AT_REST,
    VELOCITIES,
    HullMotion,
    elevation_spectrum,
    linear_drag,
    mean_slope,
    with_drag,
)
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.statics import mean_derivative
from fowt_env.analysis.wave_excitation import _strip_force
from fowt_env.descriptions.platform import AdditionalLoads
from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.errors import InputError
from fowt_env.plant.hydro.morison import morison_load
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State, pose_of
from fowt_env.weather.waves import build_waves

SEA = sea_state_of({"kind": "jonswap", "Hs": 3.0, "Tp": 9.0, "gamma": 2.0})
OMEGA = np.linspace(0.2, 4.0, 800)


@pytest.fixture(scope="module")
def scene():
    return build_scene("oc3_hywind", fidelity="reference")


def random_seas(scene, count=24):
    """Seas of SEA with other phases; each repeats after TIMES."""
    site = scene.platform.environment
    here = {"depth": site.water_depth, "density": site.water_density, "gravity": site.gravity}
    return [build_waves(SEA, **here, seed=seed, duration=400.0, components=200) for seed in range(count)]


TIMES = np.arange(0.0, 400.0, 1.0)


def drag_series(scene, seas, vx=0.0, wy=0.0):
    """(n, 6) drag of the exact strips in each sea over TIMES, the hull moving at constant speed."""
    fixed = {"instantaneous_position": False, "instantaneous_surface": False, "wheeler": False}
    strips = scene.model.hydro.strips.shape._replace(**fixed)
    smooth, x = strips._replace(drag_coefficient=0.0), state(vx=vx, wy=wy)
    kinematics, out, found = np.zeros((7, strips.nodes)), np.zeros((2, 6)), []
    for sea in seas:
        for t in TIMES:
            _strip_force(strips, sea, x, float(t), kinematics, out[0])
            _strip_force(smooth, sea, x, float(t), kinematics, out[1])
            found.append(out[0] - out[1])
    return np.array(found)


def test_the_mean_slope_in_one_direction_is_borgmans():
    for sigma in (0.1, 2.0):
        for size in (1, 2):
            covariance = np.zeros((1, size, size))
            covariance[0, 0, 0] = sigma**2
            found = mean_slope(np.zeros((1, size)), covariance)
            assert found[0, 0, 0] == pytest.approx(np.sqrt(8.0 / np.pi) * sigma, rel=1e-4)
            if size == 2:  # across it, the drag of the mean speed
                assert found[0, 1, 1] == pytest.approx(np.sqrt(2.0 / np.pi) * sigma, rel=1e-4)


@pytest.mark.parametrize("mean", [(0.0, 0.0), (0.5, 1.0), (4.0, 0.0)])
def test_the_mean_slope_is_that_of_random_vectors(mean):
    covariance = np.array([[4.0, 1.0], [1.0, 3.0]])
    r = np.random.default_rng(0).multivariate_normal(mean, covariance, 1_000_000)
    size = np.linalg.norm(r, axis=1)
    expected = size.mean() * np.eye(2) + np.einsum("ni,nj->ij", r / size[:, None], r) / len(r)
    np.testing.assert_allclose(mean_slope(np.array([mean]), covariance[None])[0], expected, atol=0.01)


def test_the_linear_force_has_the_least_error_in_a_random_sea(scene):
    """Its regression on the strips' drag is 1: sqrt(8/pi) is the least-squares gain of |u| u on u."""
    seas = random_seas(scene)
    drag = drag_series(scene, seas)
    found = linear_drag(scene, state(), OMEGA, SEA)
    for column in (0, 4):
        linear = []
        for waves in seas:  # elevation a cos(e - omega t)
            transfer = np.interp(waves.omega, OMEGA, found.excitation[:, column])
            signal = transfer * waves.amplitude * np.exp(-1j * waves.phase)
            linear.append((np.exp(1j * np.outer(TIMES, waves.omega)) @ signal).real)
        linear = np.concatenate(linear)
        product = linear @ drag[:, column]
        assert product / (linear @ linear) == pytest.approx(1.0, abs=0.03)
        # what is left is the rest of |u| u, 1 - 8/(3 pi) = 0.15 of its variance
        assert 0.1 < 1.0 - product**2 / (linear @ linear) / (drag[:, column] @ drag[:, column]) < 0.2


@pytest.mark.nightly
def test_the_damping_is_the_mean_drag_on_a_hull_that_moves_slowly(scene):
    seas = random_seas(scene)
    found = linear_drag(scene, state(), OMEGA, SEA)
    for name, place, step in (("vx", 0, 2e-3), ("wy", 4, 2e-5)):
        sides = [drag_series(scene, seas, **{name: sign * step}).mean(axis=0) for sign in (1.0, -1.0)]
        slope = -(sides[0] - sides[1]) / (2.0 * step)
        np.testing.assert_allclose(slope[[0, 4]], found.damping[[0, 4], place], rtol=0.03)


def test_damping_is_symmetric_positive_and_alike_to_all_sides_in_waves_from_all():
    scene = build_scene("oc3_hywind", fidelity="reference")
    motion = HullMotion(0.0, np.diag([0.04, 0.04, 0.0, 0.0, 0.0, 0.0]))
    damping = linear_drag(scene, state(), OMEGA, None, motion).damping
    np.testing.assert_allclose(damping, damping.T, rtol=1e-12, atol=1e-6)
    assert damping[0, 0] == pytest.approx(damping[1, 1], rel=1e-9)
    assert damping[4, 4] == pytest.approx(damping[3, 3], rel=1e-9)
    assert damping[0, 4] == pytest.approx(-damping[1, 3], rel=1e-9)
    assert np.linalg.eigvalsh(damping[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])]).min() > 0.0
    assert linear_drag(scene, state(), OMEGA, None, AT_REST).damping.max() == 0.0


@pytest.mark.parametrize("pitch", [0.0, 0.3])
def test_motion_with_the_waves_takes_from_the_relative_velocity(scene, pitch):
    """A hull that goes with the water at one depth has no drag there; w = i u, body x is u cos - w sin."""
    still = linear_drag(scene, state(platform_pitch=pitch), OMEGA, SEA)
    node = int(np.argmin(np.abs(still.z + 20.0)))
    k = OMEGA**2 / scene.platform.environment.gravity
    surge = np.zeros((OMEGA.size, 6), complex)
    surge[:, 0] = OMEGA * np.exp(k * still.z[node] * np.exp(-1j * pitch) - 1j * pitch)
    moving = linear_drag(scene, state(platform_pitch=pitch), OMEGA, SEA, HullMotion(surge, 0.0))
    assert moving.deviation[node] < 0.02 * still.deviation[node]


@pytest.mark.parametrize("attitude", [{}, {"roll": 0.05, "platform_pitch": 0.1, "yaw": 0.6}])
def test_the_part_of_a_current_is_that_of_the_plant_at_rest(attitude):
    """at_rest against differences of the strips' own drag in the current."""
    scene = build_scene("oc3_hywind", current={"speed": 0.8}, fidelity="reference")
    hydro = scene.model.hydro
    found = linear_drag(scene, state(**attitude), OMEGA, None)
    np.testing.assert_allclose(found.damping, found.at_rest)
    strips, kinematics = hydro.strips.shape, np.zeros((7, hydro.strips.shape.nodes))

    def load(**values):
        pose = pose_of(state(**attitude, **values))
        return np.array(morison_load(0.0, pose, strips, None, hydro.current, kinematics).wrench)

    for name, place in (("vx", 0), ("vy", 1), ("wx", 3), ("wy", 4)):
        step = 1e-4
        slope = -(load(**{name: step}) - load(**{name: -step})) / (2.0 * step)
        rest = np.abs(found.at_rest[:, place]).max()
        np.testing.assert_allclose(found.at_rest[:, place], slope, rtol=1e-3, atol=1e-6 * rest)


def test_a_hull_that_is_turned_meets_the_waves_from_another_side(scene):
    sea = {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0, "gamma": 2.0}
    found = linear_drag(scene, state(yaw=np.radians(50.0)), OMEGA, sea_state_of(sea | {"heading": 30.0}))
    wanted = linear_drag(scene, state(), OMEGA, sea_state_of(sea | {"heading": -20.0}))
    for name in ("damping", "excitation"):
        a, b = getattr(found, name), getattr(wanted, name)
        assert np.abs(a - b).max(initial=0.0) < 1e-9 * np.abs(b).max()


def test_axial_drag_damps_heave(scene):
    rough = scene.with_model({"hydro.strips.shape.axial_drag_coefficient": 5.0})
    heave = linear_drag(
        rough, state(), OMEGA, None, HullMotion(0.0, np.diag([0, 0, 0.25, 0, 0, 0.0]))
    ).damping
    strips = rough.model.hydro.strips.shape
    expected = 0.5 * strips.density * 5.0 * strips.keel_area * np.sqrt(8.0 / np.pi) * 0.5
    assert heave[2, 2] == pytest.approx(expected, rel=1e-9)


def test_a_linear_model_takes_the_damping_as_forces_on_the_hull(scene):
    model = linearize(scene)
    drag = linear_drag(scene, model.point.state, OMEGA, SEA)
    damped = with_drag(model, drag)
    velocity = np.zeros(len(model.states))
    velocity[[model.index(name) for name in VELOCITIES]] = [0.3, 0.1, 0.2, 0.01, 0.02, 0.03]
    force = -drag.damping @ [0.3, 0.1, 0.2, 0.01, 0.02, 0.03]
    np.testing.assert_allclose((damped.A - model.A) @ velocity, model.E @ force, atol=1e-12)
    np.testing.assert_allclose((damped.C - model.C) @ velocity, model.F @ force, atol=1e-6)
    pitch = [next(m for m in each.modes() if m.name == "platform_pitch") for each in (model, damped)]
    assert pitch[1].damping_ratio > pitch[0].damping_ratio + 0.005


def test_the_spectrum_has_the_sea_s_variance_and_a_sea_without_one_is_named(scene):
    density = elevation_spectrum(SEA, OMEGA)
    assert np.trapezoid(density, OMEGA) == pytest.approx(SEA.Hs**2 / 16.0)
    assert not elevation_spectrum(None, OMEGA).any()
    with pytest.raises(InputError, match="kind = 'regular': must be one with a spectrum"):
        linear_drag(scene, state(), OMEGA, sea_state_of({"kind": "regular", "H": 1.0, "T": 8.0}))
    with pytest.raises(InputError, match="no frequency lies in the band"):
        elevation_spectrum(SEA, np.array([50.0, 60.0]))


def test_frequencies_need_not_be_evenly_spaced(scene):
    uneven = np.geomspace(OMEGA[0], OMEGA[-1], OMEGA.size)
    found, wanted = (linear_drag(scene, state(), omega, SEA) for omega in (uneven, OMEGA))
    np.testing.assert_allclose(found.deviation, wanted.deviation, rtol=1e-3)
    assert np.abs(found.damping - wanted.damping).max() < 1e-3 * np.abs(wanted.damping).max()


def test_without_water_there_is_no_drag(bare_scene):
    found = linear_drag(bare_scene, np.zeros(bare_scene.n_state), OMEGA, SEA)
    assert not found.damping.any() and not found.excitation.any()


# members and matrices


def test_a_spar_of_members_has_the_linear_drag_of_its_strips(scene):
    fixed = {"kinematics_position": "fixed", "surface": "swl", "stretching": "none", "strip_length": 1.0}
    members = build_scene(floaters.spar(), **{"fidelity": "reference"} | fixed)
    waves = np.zeros((OMEGA.size, 6), complex)
    waves[:, 0], waves[:, 4] = 0.3j * OMEGA, 0.004
    for motion in (AT_REST, HullMotion(waves, np.diag([0.04, 0.02, 0.01, 1e-5, 1e-5, 0.0]))):
        wanted = linear_drag(scene, np.zeros(15), OMEGA, SEA, motion)
        found = linear_drag(members, np.zeros(15), OMEGA, SEA, motion)
        for name in ("damping", "excitation"):
            a, b = getattr(found, name), getattr(wanted, name)
            assert np.abs(a - b).max() < 1e-4 * np.abs(b).max()


def test_leaning_members_have_the_drag_of_the_plant_s_slope():
    """In a current, still water and no motion the gain is the slope of the plant's own load."""
    current = build_scene(floaters.semi(), current={"speed": 0.8, "heading": 30.0}, fidelity="reference")
    found = linear_drag(current, np.zeros(15), OMEGA, None)
    data = current.data()
    handle = current.handle(data)
    # ends that no flow meets have a slope of the step itself
    step, slope = 1e-6, np.zeros((6, 6))
    for column in range(6):
        for side in (1.0, -1.0):
            x, dx, mean = np.zeros(15), np.zeros(15), np.zeros(15)
            x[State.VX + column] = side * step
            mean_derivative(handle, x, np.zeros(2), 1, dx, mean)
            load = data.cache[LoadCache.HYDRO : LoadCache.HYDRO + 6]
            slope[:, column] -= side * load / (2.0 * step)
    scale = np.sqrt(np.outer(np.diag(slope), np.diag(slope)))
    assert np.abs((found.at_rest - slope) / scale).max() < 5e-4
    assert found.damping == pytest.approx(found.at_rest, rel=1e-9)


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (0.05, 0.1, 0.6)])
def test_a_quadratic_damping_matrix_takes_the_gain_of_its_motion_in_body_axes(attitude):
    x = state(roll=attitude[0], platform_pitch=attitude[1], yaw=attitude[2])
    quadratic = np.diag([1e5, 2e5, 3e5, 4e9, 5e9, 6e9])
    quadratic[0, 4] = -7e6
    platform = floaters.semi(
        additional=AdditionalLoads(quadratic_damping=tuple(map(tuple, quadratic.tolist())))
    )
    plain = linear_drag(build_scene(floaters.semi(), fidelity="reference"), x, OMEGA, None)
    deviation = np.array([0.5, 0.2, 0.3, 0.01, 0.02, 0.03])
    motion = HullMotion(0.0, np.diag(deviation**2))
    more = linear_drag(build_scene(platform, fidelity="reference"), x, OMEGA, None, motion).damping
    less = linear_drag(build_scene(floaters.semi(), fidelity="reference"), x, OMEGA, None, motion).damping
    assert more - less == pytest.approx(quadratic * np.sqrt(8.0 / np.pi) * deviation, rel=1e-9, abs=1e-3)
    assert not plain.damping.any()
