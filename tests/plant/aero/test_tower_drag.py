import numpy as np
import pytest
from naive import rotor as naive
from rotor_helpers import wind_series

from fowt_env.descriptions.platform import read_platform
from fowt_env.plant.aero.tower_drag import bent_tower_load, build_tower_drag, tower_load
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.state import N_RIGID, NO_LOAD, pose_of
from fowt_env.scene.tower import build_tower_modes

pytestmark = pytest.mark.installation

PLATFORM = read_platform("oc3_hywind")
TOWER = PLATFORM.tower
PART = build_tower_drag(TOWER, 1.225)


def load(x, series, part=PART):
    return tower_load(0.0, pose_of(x), wind_now(0.0, series), series, None, part)


def state(position=(0,) * 6, velocity=(0,) * 6):
    x = np.zeros(N_RIGID)
    x[:6], x[7:13] = position, velocity
    return x


def test_absent_tower_or_wind_gives_exactly_zero():
    assert load(state(), wind_series(10.0), None) == NO_LOAD
    assert load(state(), None) == NO_LOAD
    assert np.all(np.array(load(state(), wind_series(10.0), build_tower_drag(TOWER, 0.0))) == 0.0)
    assert np.all(np.array(load(state(), wind_series(0.0))) == 0.0)


def test_uniform_wind_gives_pressure_times_projected_area():
    result = load(state(), wind_series(20.0))
    height, mean = TOWER.top_height - TOWER.base_height, 0.5 * (TOWER.base_diameter + TOWER.top_diameter)
    assert result.fx == pytest.approx(0.5 * 1.225 * TOWER.drag_coefficient * 400.0 * height * mean, rel=1e-12)
    assert result.fy == result.fz == result.mx == result.mz == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_moving_tower_in_sheared_wind_agrees_with_the_naive_twin(seed):
    """40 points, because 6 do not resolve a wind that changes sign along the tower (seed 3)."""
    rng = np.random.default_rng(seed)
    series = wind_series(*rng.uniform(-20, 20, 3), vertical=rng.uniform(-3, 3), shear=0.14)
    scale = np.array([5, 5, 3, 0.1, 0.1, 0.5])
    x = state(rng.normal(0, 1, 6) * scale, rng.normal(0, 1, 6) * (1, 1, 1, 0.03, 0.03, 0.03))
    pose, now = pose_of(x), wind_now(0.0, series)
    R = np.array(pose[3:12]).reshape(3, 3)

    def wind(point):
        return np.array(wind_at(0.0, *point, now, series, None))

    force, moment = naive.tower_wrench(TOWER, 1.225, R, x[:3], x[7:10], x[10:13], wind)
    result = np.array(load(x, series, build_tower_drag(TOWER, 1.225, points=40)))
    assert result[:3] == pytest.approx(force, abs=1e-6 * np.linalg.norm(force))
    assert result[3:] == pytest.approx(moment, abs=1e-6 * np.linalg.norm(moment))


def test_a_bent_tower_is_pushed_where_it_is_as_fast_as_it_moves(turbine):
    rng = np.random.default_rng(2)
    modes = build_tower_modes(PLATFORM, turbine, 1, N_RIGID)
    series = wind_series(12.0, v=3.0, vertical=2.0, shear=0.14)
    for _ in range(5):
        x = np.zeros(N_RIGID + 4)
        x[:6], x[7:13] = rng.normal(0, 0.3, 6), rng.normal(0, 0.3, 6)
        x[N_RIGID:] = rng.normal(0, 3.0, 4)
        pose, now, modal = pose_of(x), wind_now(0.0, series), np.ones(2)
        R, v, w = np.array(pose[3:12]).reshape(3, 3), x[7:10], x[10:13]
        force, moment, work = np.zeros(3), np.zeros(3), np.ones(2)
        for z, factor, shape in zip(PART.z, PART.factor, modes.drag_shape, strict=True):
            place = np.array([*(shape * x[N_RIGID : N_RIGID + 2]), z])
            speed = v + np.cross(w, place) + [*(shape * x[N_RIGID + 2 :]), 0.0]
            relative = R.T @ wind_at(0.0, *(x[:3] + R @ place), now, series, None) - speed
            push = factor * np.hypot(*relative[:2]) * relative * [1.0, 1.0, 0.0]
            force, moment, work = force + push, moment + np.cross(place, push), work + shape * push[:2]
        found = bent_tower_load(0.0, pose, x, now, series, None, PART, modes, modal)
        assert found[:3] == pytest.approx(force, rel=1e-12)
        assert found[3:] == pytest.approx(moment, rel=1e-12)
        assert modal == pytest.approx(work, rel=1e-12)


def test_still_air_never_adds_energy():
    rng = np.random.default_rng(1)
    still = wind_series(0.0)
    for _ in range(1000):
        velocity = rng.normal(0, 1, 6) * (2, 2, 2, 0.1, 0.1, 0.1)
        x = state(rng.normal(0, 1, 6) * (5, 5, 3, 0.3, 0.3, 2.0), velocity)
        assert np.dot(load(x, still), velocity) < 0.0


def test_tower_moving_with_the_wind_has_no_drag():
    assert np.all(np.array(load(state(velocity=(7, 0, 0, 0, 0, 0)), wind_series(7.0))) == 0.0)


def test_drag_is_mirror_symmetric():
    a = np.array(load(state((0, 1, 0, 0.1, 0.05, 0.2), (1, 0.5, 0, 0.01, 0.02, 0.03)), wind_series(15, 4)))
    b = load(state((0, -1, 0, -0.1, 0.05, -0.2), (1, -0.5, 0, -0.01, 0.02, -0.03)), wind_series(15, -4))
    assert np.array(b) * (1, -1, 1, -1, 1, -1) == pytest.approx(a, rel=1e-12, abs=1e-9)


def test_six_points_are_enough():
    many = build_tower_drag(TOWER, 1.225, points=40)
    series = wind_series(18.0, 3.0, vertical=2.0, shear=0.2)
    x = state((0, 0, 0, 0.02, 0.08, 0.1), (1, 0.5, 0.2, 0.01, 0.03, 0.0))
    assert np.array(load(x, series)) == pytest.approx(np.array(load(x, series, many)), rel=1e-5, abs=1e-3)
