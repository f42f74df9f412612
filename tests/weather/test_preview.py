"""The wind ahead as series: exact at every instant, periodic where the wind is, and no more than asked."""

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.errors import InputError
from fowt_env.weather.preview import check_times, exact_preview, rotor_wind_series


def seen(preview, j, time):
    return np.interp(time, preview.time, preview.values[j])


def scene_in(wind, **options):
    return build_scene("oc3_hywind", wind=wind, **{"duration": 60.0, "fidelity": "fast", **options})


def test_random_wind_is_seen_as_it_comes_and_repeats_with_its_period():
    scene = scene_in({"kind": "ntm", "speed": 16.0}, seed=1001, duration=600.0)
    times = (0.0, 2.5, 11.03, 70.0)
    preview = exact_preview(scene, times)
    start, speed, period = rotor_wind_series(scene)
    instant = np.random.default_rng(0).uniform(0.0, 600.0, 500)
    for j, ahead in enumerate(times):
        coming = np.interp((instant + ahead) % period, start, speed)
        np.testing.assert_allclose(seen(preview, j, instant), coming, rtol=0, atol=1e-6)
    assert preview.time[0] == 0.0 and preview.time[-1] >= 600.0


def test_leads_on_the_grid_of_the_wind_add_no_instants():
    scene = scene_in({"kind": "ntm", "speed": 16.0}, seed=1001, duration=600.0)
    assert exact_preview(scene, (0.3, 1.7, 10.9)).time.size <= scene.model.aero.wind.time.size + 1


def test_steps_of_wind_are_seen_to_the_instant_and_the_last_one_holds():
    scene = scene_in({"kind": "steps", "speeds": [14.0, 18.0], "every": 30.0, "ramp": 0.1})
    preview = exact_preview(scene, (7.03,))
    for time, speed in ((22.97, 14.0), (23.02, 16.0), (23.07, 18.0), (60.0, 18.0)):
        assert seen(preview, 0, time) == pytest.approx(speed, abs=1e-6)


def test_a_steady_wind_is_the_same_ahead():
    preview = exact_preview(scene_in(15.0), (1.0, 5.0))
    assert preview.values.shape == (2, 2)
    assert np.all(preview.values == 15.0)


@pytest.mark.parametrize("periodic", [True, False])
def test_a_box_is_seen_as_the_mean_over_the_rotor(periodic):
    grid = np.linspace(-80.0, 80.0, 9)
    wave = 18.0 + np.sin(2.0 * np.pi * 0.5 * np.arange(160) / 80.0)
    u = wave[:, None, None] + 0.02 * grid[None, :, None] + 0.01 * grid[None, None, :]
    box = {"kind": "box", "u": u, "y": grid, "z": 90.0 + grid, "dt": 0.5, "speed": 18.0}
    scene = scene_in(box | {"periodic": periodic}, fidelity="standard")
    preview = exact_preview(scene, (6.0,))
    time = np.arange(0.0, 60.0, 0.25)
    known = np.full(time.size, True) if periodic else time + 6.0 < 79.5 - 80.0 / 18.0
    expected = 18.0 + np.sin(2.0 * np.pi * (time + 6.0 + 80.0 / 18.0) / 80.0)
    np.testing.assert_allclose(seen(preview, 0, time)[known], expected[known], atol=1e-3)


@pytest.mark.parametrize(
    "times", [3.0, "3", (3.0, 2.0), (1.0, 1.0), (-1.0,), (np.nan,), (601.0,), (True,), ("a",)]
)
def test_what_is_no_list_of_increasing_times_is_refused(times):
    with pytest.raises(InputError, match="preview_times = "):
        check_times(times)


def test_a_scene_without_wind_has_nothing_to_see():
    with pytest.raises(InputError, match="needs a scene with wind"):
        exact_preview(scene_in(None), (1.0,))
