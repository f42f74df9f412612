"""Pictures: they show what is computed, at a rate that is fit for watching, and cost nothing unasked."""

import subprocess
import sys
import time
from math import pi, radians, tan

import floaters
import gymnasium
import numpy as np
import pytest

pytest.importorskip("pygame", reason="pygame is not installed: the extra `render` is missing")

import fowt_env  # noqa: E402
from fowt_env.descriptions.platform import read_platform  # noqa: E402
from fowt_env.envs import FowtEnv, FowtVectorEnv  # noqa: E402
from fowt_env.errors import InputError  # noqa: E402
from fowt_env.plant.hydro.waves import elevation  # noqa: E402
from fowt_env.visual import rendering  # noqa: E402
from fowt_env.visual.animation import animate  # noqa: E402
from fowt_env.visual.rendering import RGB_COLOURS, PlatformPose, Surface, TurbinePanel, View, mooring_shapes  # noqa: E402

QUICK = {"rotor": "table", "wave_components": 20}
WEATHER = {"wind": 18.0, "sea": {"kind": "jonswap", "Hs": 5.0, "Tp": 10.0}}
REST = dict.fromkeys(
    ("PtfmSurge", "PtfmSway", "PtfmHeave", "PtfmRoll", "PtfmPitch", "PtfmYaw", "Azimuth", "BldPitch1"), 0.0
)
ROW = REST | {"Time": 0.0, "Wind1VelX": 18.0, "RotSpeed": 12.1, "GenPwr": 5000.0, "GenTq": 43.1}


@pytest.fixture(scope="module")
def scene():
    return fowt_env.build_scene("oc3_hywind", seed=3, fidelity="standard", wave_components=20, **WEATHER)


@pytest.fixture(scope="module")
def still():
    return fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard")


@pytest.fixture
def env():
    env = FowtEnv(render_mode="rgb_array", **QUICK, **WEATHER)
    env.reset(seed=1)
    yield env
    env.close()


def test_one_picture_has_the_traces_of_the_steps_before_it(env):
    env.reset(seed=2)
    for _ in range(20):
        env.step(np.zeros(2))
    env.render()
    (history,) = env._view.traces.histories
    np.testing.assert_allclose([row[0] for row in history], 0.1 * np.arange(21), atol=1e-9)
    env.reset(seed=2)
    env.render()
    assert len(env._view.traces.histories[0]) == 1


def test_lines_end_at_anchor_and_fairlead_wherever_the_platform_is(scene):
    mooring = scene.model.mooring
    for row in (
        REST,
        REST | {"PtfmSurge": 25.0, "PtfmSway": -9.0, "PtfmHeave": -2.0, "PtfmPitch": 7.0, "PtfmYaw": 12.0},
    ):
        pose = PlatformPose(row)
        shapes = mooring_shapes(scene, pose)
        assert len(shapes) == 3
        for i, (points, tension) in enumerate(shapes):
            np.testing.assert_allclose(points[0], mooring.anchor[i], atol=1e-6)
            np.testing.assert_allclose(points[-1], pose.inertial(mooring.fairlead[i]), atol=1e-6)
            assert np.diff(points[:, 2]).min() > -1e-9 and tension > 1e5


def test_drawn_tension_and_pose_are_those_of_the_plant(env):
    for _ in range(20):
        env.step(np.array([0.3, -0.2]))
    row = env.channels()
    for i, (_, tension) in enumerate(mooring_shapes(env.scene, PlatformPose(row))):
        assert 1e-3 * tension == pytest.approx(row[f"FAIRTEN{i + 1}"], rel=1e-9)


def test_the_drawn_sea_is_the_sum_of_the_scene_s_components(scene):
    x = np.array([-90.0, 0.0, 41.5])
    surface = Surface(scene.model.hydro.waves, x)
    for t in (0.0, 17.3, 401.0):
        expected = [elevation(t, at, 0.0, scene.model.hydro.waves) for at in x]
        np.testing.assert_allclose(surface.at(t), expected, atol=1e-12)
    assert np.ptp(surface.at(17.3)) > 0.1


def test_the_first_blade_points_up_at_azimuth_zero_and_feathers_with_blade_pitch(scene):
    panel = TurbinePanel(rendering.load_pygame(), scene, (300, 300))
    radius, overhang = scene.turbine.rotor.tip_radius, len(scene.turbine.blade.radius)
    rest = 0.0, 0.0
    assert panel._blade(0.0, 0.0, rest)[overhang] == pytest.approx([0.0, 0.0, radius])
    assert panel._blade(0.5 * pi, 0.0, rest)[overhang] == pytest.approx([0.0, -radius, 0.0], abs=1e-9)
    flat, feathered = (np.ptp(panel._blade(0.0, angle, rest)[:, 0]) for angle in (0.0, 0.5 * pi))
    assert feathered > 3.0 * flat


def yellow_lean(picture):
    """Slope dx/dz of the middle of the yellow part above the water."""
    red, green, blue = (picture[..., k].astype(int) for k in range(3))
    rows, columns = np.nonzero((red > 110) & (blue < 0.45 * red) & (red > green) & (green > 0.65 * red))
    height = np.unique(rows)[7:-7]  # the ends are cut at right angles to the axis, not level
    middle = [columns[rows == row].mean() for row in height]
    assert len(height) > 10
    return -np.polyfit(height, middle, 1)[0]


@pytest.mark.parametrize("lean", [-15.0, 0.0, 20.0])
def test_the_spar_leans_by_the_platform_pitch(still, lean):
    view = View([still])
    view.draw([ROW | {"PtfmPitch": lean, "PtfmHeave": 14.0}])
    assert yellow_lean(view.array()[:, : view.right]) == pytest.approx(tan(radians(lean)), abs=0.04)


def test_lines_are_drawn_where_they_were_computed_in_their_tension_s_colour(still):
    view = View([still])
    view.draw([ROW])
    picture, panel = view.array().astype(int), view.panels[0]
    seen = 0
    for number, (points, tension) in enumerate(mooring_shapes(still, PlatformPose(ROW))):
        colour = np.array(rendering.tension_colour(tension, panel.tension_at_rest[number]))
        for x, y in panel.pixels(points)[:-1] / rendering.SAMPLING:
            if 2 < x < panel.size[0] - 3 and 2 < y < panel.size[1] - 3:
                near = picture[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2].reshape(-1, 3)
                seen += np.abs(near - colour).max(axis=1).min() < 40
    assert seen >= 10


def test_the_mooring_inset_reaches_every_anchor(still):
    view = View([still])
    panel = view.mooring
    ends = panel.pixels(still.model.mooring.anchor)
    assert (ends >= 0).all() and (ends[:, 0] <= panel.size[0]).all() and (ends[:, 1] <= panel.size[1]).all()


def test_pictures_are_not_blank_and_move_with_the_run(env):
    first = env.render()
    assert first.shape == (640, 960, 3) and first.dtype == np.uint8
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 200
    assert np.array_equal(first, env.render())  # looking changes nothing
    for _ in range(10):
        env.step(np.zeros(2))
    assert (env.render() != first).mean() > 0.005


def test_rendering_leaves_the_run_as_it_is():
    rows = []
    for mode in (None, "rgb_array"):
        env = FowtEnv(render_mode=mode, **QUICK, **WEATHER)
        env.reset(seed=5)
        for _ in range(15):
            observation = env.step(np.array([0.1, 0.4]))[0]
            if mode:
                env.render()
        rows.append(observation.tobytes())
    assert rows[0] == rows[1]


def test_a_new_episode_starts_new_traces_in_its_own_weather(env):
    env.step(np.zeros(2))
    env.render()
    env.reset(seed=9)
    env.render()
    assert len(env._view.traces.histories[0]) == 1
    assert env._view.panels[0].surface.waves is env.scene.model.hydro.waves


def test_traces_hold_the_last_minute(still):
    view = View([still])
    for t in np.arange(0.0, 100.0, 1.0):
        view.traces.add([ROW | {"Time": t}])
    times = [entry[0] for entry in view.traces.histories[0]]
    assert times[0] == pytest.approx(99.0 - rendering.WINDOW) and times[-1] == 99.0


def test_a_picture_takes_less_than_a_thirtieth_of_a_second(scene):
    view = View([scene])
    times = []
    for k in range(40):
        begin = time.process_time()
        view.draw([ROW | {"Time": 0.1 * k}])
        view.array()
        times.append(time.process_time() - begin)
    assert np.median(times) < 1.0 / 30.0


def test_the_human_mode_draws_in_a_window_at_reset_and_every_step():
    env = FowtEnv(render_mode="human", **QUICK, **WEATHER)
    env.reset(seed=1)
    begin = time.perf_counter()
    for _ in range(6):
        env.step(np.zeros(2))
    assert time.perf_counter() - begin > 5 / 30.0 * 0.8  # no faster than can be watched
    assert env.render() is None
    window = env._view._window
    assert np.array_equal(env._view.pygame.surfarray.array3d(window).swapaxes(0, 1), env._view.array())
    env.close()
    env.close()
    assert env._view is None


def test_gymnasium_finds_nothing_wrong_with_either_mode():
    from gymnasium.utils.env_checker import check_env

    for mode in ("rgb_array", "human"):
        env = gymnasium.make("fowt_env/OC3Hywind-v1", render_mode=mode, **QUICK)
        check_env(env.unwrapped)
        env.close()


def test_an_unrendered_run_never_loads_pygame():
    code = (
        "import sys, numpy as np, fowt_env.envs as e;"
        f"env = e.FowtEnv(**{QUICK | WEATHER!r}); env.reset(seed=1);"
        " env.step(np.zeros(2)); sys.exit('pygame' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_missing_pygame_and_a_vector_environment_are_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(InputError, match=r"fowt-env\[render\]"):
        FowtEnv(render_mode="human", **QUICK)
    env = FowtEnv(render_mode="rgb_array", **QUICK)  # as stable-baselines3 makes one from a name
    env.reset()
    env.step(np.zeros(2))
    with pytest.raises(InputError, match=r"fowt-env\[render\]"):
        env.render()
    with pytest.raises(InputError, match="vector environment cannot render"):
        FowtVectorEnv(2, render_mode="rgb_array", **QUICK)


@pytest.fixture(scope="module")
def runs(scene):
    return {name: fowt_env.simulate(scene, controller=name, duration=4.0) for name in ("pi", "pi_land")}


def test_a_gif_shows_the_runs_beside_each_other(scene, runs, tmp_path):
    from PIL import Image

    path = animate(scene, runs, tmp_path / "two.gif", speed=4.0, fps=10, size=(480, 320))
    with Image.open(path) as image:
        assert image.size == (480, 320) and image.n_frames == 10 and image.info["duration"] == 100
        first = np.asarray(image.convert("RGB")).astype(int)
        image.seek(9)
        last = np.asarray(image.convert("RGB")).astype(int)
    assert np.abs(last - first).max(axis=2).mean() > 1.0
    for colour in RGB_COLOURS[:2]:  # both traces keep their colours in the palette
        assert (np.abs(last - colour).max(axis=2) < 12).sum() > 20


def test_a_gif_holds_changes_alone_and_shows_what_was_drawn(tmp_path):
    """Frames after the first are small boxes, and put together they are the pictures, in its palette."""
    from PIL import Image

    from fowt_env.visual.animation import UNSEEN, _write_gif

    still = np.full((60, 80, 3), 240, dtype=np.uint8)
    pictures = [still.copy() for _ in range(5)]
    for number, picture in enumerate(pictures):
        picture[20:24, 10 * number : 10 * number + 8] = RGB_COLOURS[0]
    pictures.insert(3, pictures[2])  # nothing moves
    _write_gif(iter(pictures), tmp_path / "a.gif", 10)
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 6
        for number, picture in enumerate(pictures):
            image.seek(number)
            if number:
                left, top, right, bottom = image.dispose_extent
                assert (bottom - top) * (right - left) <= 4 * 18
            seen = np.asarray(image.convert("RGB")).astype(int)
            assert np.abs(seen - picture).max() <= UNSEEN + 10


def test_what_rests_within_a_gif_s_frame_packs_to_nothing(tmp_path):
    """Two opposite corners change in every frame; the texture between them is not written again."""
    from fowt_env.visual.animation import _write_gif

    texture = np.where(np.random.default_rng(1).random((120, 160, 1)) < 0.5, 60, 200).astype(np.uint8)
    pictures = [np.repeat(texture, 3, axis=2) for _ in range(8)]
    for number, picture in enumerate(pictures):
        picture[:4, :4] = picture[-4:, -4:] = RGB_COLOURS[number % 2]
    for name, kept in (("one", pictures[:1]), ("all", pictures)):
        _write_gif(iter(kept), tmp_path / f"{name}.gif", 10)
    assert (tmp_path / "all.gif").stat().st_size < 2 * (tmp_path / "one.gif").stat().st_size


def test_an_mp4_has_a_picture_per_step(scene, runs, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg is not installed")
    path = animate(scene, {"": runs["pi"]}, tmp_path / "one.mp4", speed=2.0, fps=10, size=(480, 320))
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count == 20 and seconds == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"path": "a.avi"}, "must end with .gif or .mp4"),
        ({"runs": {}}, "0 runs"),
        ({"speed": 0.0}, "speed = 0"),
        ({"fps": 61}, "fps = 61"),
        ({"size": (481, 320)}, "even"),
        ({"start": 99.0}, "start = 99"),
    ],
)
def test_animations_that_cannot_be_made_are_named(scene, runs, tmp_path, arguments, message):
    settings = {"runs": runs, "path": "a.gif"} | arguments
    settings["path"] = tmp_path / settings["path"]
    with pytest.raises(InputError, match=message):
        animate(scene, **settings)
    with pytest.raises(InputError, match="needs at least two rows"):
        animate(scene, {"cut": runs["pi"][["Time_[s]"]]}, tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []


def test_an_environment_s_picture_has_its_size_action_and_reward(monkeypatch):
    shown = []
    draw = View.draw
    monkeypatch.setattr(
        View, "draw", lambda view, rows, agent=None: (shown.append(agent), draw(view, rows, agent))
    )
    env = FowtEnv(render_mode="rgb_array", render_size=(480, 320), **QUICK, **WEATHER)
    env.reset(seed=1)
    assert env.render().shape == (320, 480, 3) and shown[-1].reward is None
    reward = env.step(np.array([0.25, -0.5]))[1]
    env.render()
    assert shown[-1].action == (0.25, -0.5) and shown[-1].reward == reward
    assert env._view.speed == pytest.approx(3.0)  # 30 pictures of 0.1 s a second
    env.close()
    with pytest.raises(InputError, match=r"render_size = \(10, 320\): must be \(width, height\)"):
        FowtEnv(render_mode="rgb_array", render_size=(10, 320), **QUICK, **WEATHER)


def test_scales_hold_the_rated_and_the_trip_line_and_do_not_blow_up_small_changes(still):
    traces = View([still]).traces
    speed = next(trace for trace in rendering.TRACES if trace.channel == "RotSpeed")
    low, high, step = traces.scale(speed, np.array([12.0, 12.1]))
    assert low <= 12.0 and high >= traces.levels["overspeed_[rpm]"] > 15.0
    wind = next(trace for trace in rendering.TRACES if trace.channel == "Wind1VelX")
    low, high, step = traces.scale(wind, np.array([18.0, 18.01]))
    assert high - low >= wind.least and low % step == pytest.approx(0.0, abs=1e-9)


def test_a_blade_seen_edge_on_keeps_a_width_and_its_outline_does_not_cross_itself(still):
    panel = TurbinePanel(rendering.load_pygame(), still, (300, 300))
    count = 20
    middle = np.column_stack([np.zeros(count), np.linspace(0.0, 200.0, count)])
    twisted = 0.01 * np.linspace(1.0, -1.0, count)[:, None] * np.array([[1.0, 0.0]])
    outline = np.vstack([middle + twisted, [[0.0, 210.0]], (middle - twisted)[::-1]])
    thick = panel._thick(outline, np.array([4.0, 1.0]))
    width = thick[:count, 0] - thick[:count:-1, 0]
    assert np.abs(width) == pytest.approx(2.0 * np.linspace(4.0, 1.0, count), rel=0.02)
    assert len(set(np.sign(width))) == 1


def pixel(view, point):
    """Colour (3,) at a point of the platform at rest."""
    x, y = view.panels[0].pixels([point])[0] / rendering.SAMPLING
    return view.array()[round(y), round(x)].astype(int)


def view_of(platform):
    view = View([fowt_env.build_scene(platform, fidelity="standard")])
    view.draw([ROW])
    return view


@pytest.mark.parametrize(
    ("platform", "beside"),
    [
        ("iea15_volturnus_s", (-90.0, 0.0, 2.0)),
        ("nrel5mw_iti_barge", (-90.0, 0.0, 2.0)),
        (floaters.semi(), (60.0, 0.0, 3.0)),
        (floaters.tension_leg(), (60.0, 0.0, 3.0)),
    ],
    ids=["shapes", "box", "semi", "tension leg"],
)
def test_columns_and_boxes_are_drawn_where_they_are(platform, beside):
    """Each part above the water is yellow 3 m above it; beside the hull there is water or sky."""
    view = view_of(platform)
    described = view.panels[0].scene.platform
    seen = 0
    for solid in described.shapes or described.members:
        start, end = np.array(solid.start), np.array(solid.end)
        if end[2] > 0.0 and (solid.diameter is None or np.max(solid.diameter) > 2.0):
            at = 0.75 * start + 0.25 * end  # of a box: beside the tower
            red, green, blue = pixel(view, (*at[:2], 3.0))
            assert red > green > 1.5 * blue, solid
            seen += 1
    red, green, blue = pixel(view, beside)
    assert seen and blue > red


def test_a_hull_without_a_shape_is_a_box_of_its_draft():
    potential = read_platform("nrel5mw_iti_barge")
    view = view_of(potential.model_copy(update={"members": (), "shapes": ()}))
    half = 0.5 * np.sqrt(potential.potential_flow.volume / potential.draft)
    for x, inside in ((0.9 * half, True), (1.15 * half, False)):
        red, green, blue = pixel(view, (x, 0.0, 0.25 * potential.draft))
        assert (red > 2 * blue) == inside


def test_a_blade_bends_downwind_and_against_the_rotation_to_its_tip_and_not_at_the_root(scene):
    panel = TurbinePanel(rendering.load_pygame(), scene, (300, 300))
    straight, bent = panel._blade(0.0, 0.0, (0.0, 0.0)), panel._blade(0.0, 0.0, (4.0, 1.0))
    stations = len(scene.turbine.blade.radius)
    moved = bent - straight  # with blade 1 up the rotation is towards negative y
    assert moved[stations] == pytest.approx([4.0, 1.0, 0.0])
    assert 0.7 < moved[stations // 2, 0] < 1.6 and abs(moved[0]).max() < 0.02


def test_the_agent_s_bars_show_its_action_and_the_reward_changes_the_picture():
    pygame = rendering.load_pygame()

    def shown(action, reward=0.0):
        agent = rendering.Agent(action, reward)
        picture = rendering.agent_picture(pygame, rendering.Writer(pygame), 240, agent)
        return pygame.surfarray.array3d(picture).astype(int)

    one, half, less = (
        (np.abs(shown((size, 0.0)) - RGB_COLOURS[0]).max(axis=2) < 5).sum() for size in (1.0, 0.5, 0.25)
    )
    assert one > 1.8 * half > 1.5 * less
    assert (shown((0.0, 0.0), 1.0) != shown((0.0, 0.0), 2.0)).any()
