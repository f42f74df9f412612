"""The environment: the promises of the Gymnasium interface and of this project, for every task."""

import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from episodes import INDIVIDUAL, NAME, NTM, ON_LQR, QUICK, actions, ladder, quick, record
from fresh_python import fresh_python
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import fowt_env
from fowt_env.analysis.trim_cache import GRID, cached_trim, interpolated_trim
from fowt_env.envs import TASKS, Task
from fowt_env.envs.observations import BLADE_CHANNELS, KNOWN
from fowt_env.envs.rewards import REWARD_TERMS
from fowt_env.errors import InputError
from fowt_env.plant.state import State
from fowt_env.registration import ENVIRONMENTS, LADDER

SEA = {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0}
DRAWN = ("90%", "drawn")
EASY = next(iter(LADDER))
FIXED = {"wind": NTM, "sea": SEA, "weather_seed": 7, "offsets": {}}


def rollout(env, seed, n=40):
    """Bits of an episode under actions that are drawn with the seed."""
    return env.reset(seed=seed)[0].tobytes(), record(env, actions(n, seed=seed))


EVERY_CHANNEL = QUICK | {"observation": KNOWN, "wind_preview": (1.0, 5.0)}
OF_BLADES = ("default", "azimuth", "previous_action", *BLADE_CHANNELS)


@pytest.mark.parametrize(
    "settings",
    [
        *(
            pytest.param(settings, marks=pytest.mark.installation)
            for settings in (*({"id": NAME, "task": task} for task in TASKS), {"id": EASY})
        ),
        EVERY_CHANNEL | {"action_mode": "residual"},
        *(
            pytest.param(EVERY_CHANNEL | {"action_mode": mode}, marks=pytest.mark.nightly)
            for mode in ("direct", "setpoint")
        ),
        pytest.param(QUICK | ON_LQR, marks=pytest.mark.nightly),
        pytest.param(
            INDIVIDUAL | {"observation": OF_BLADES, "sensors": {"noise": 0.01, "delay": 1}},
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_gymnasium_and_sb3_checkers_find_nothing(settings):
    check(settings)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [*ladder(), *(pytest.param(name, marks=pytest.mark.nightly) for name in ENVIRONMENTS)]
)
def test_the_checkers_find_nothing_in_any_name(name):
    check({"id": name})


def check(settings):
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*out of date")  # older versions
        env = gymnasium.make(**{"id": NAME} | settings)
        check_env(env.unwrapped)
        sb3_check_env(env)


def test_same_seed_same_bits_in_two_environments_and_two_processes():
    here = rollout(quick(), 11)
    env = quick()
    rollout(env, 5)  # what went before leaves no trace
    assert rollout(env, 11) == here
    folder = Path(__file__).parent
    there = fresh_python(
        "from test_env import quick, rollout; print(rollout(quick(), 11))", paths=(folder, folder.parent)
    )
    assert there == str(here)


def test_another_seed_gives_another_start_and_another_episode():
    env = quick()
    starts = [env.reset(seed=seed)[0] for seed in range(4)]
    moved = np.ptp(np.array(starts), axis=0) > 0.0
    # every episode starts from rest, and above rated at rated torque
    assert np.all(moved[:6]) and not np.any(moved[6:12]) and np.array_equal(moved[12:], [True, True, False])
    assert rollout(env, 1) != rollout(env, 2)


def test_turbulence_of_a_drawn_strength_is_drawn_anew_for_each_episode():
    winds = {sigma: {"kind": "ntm", "speed": (12.0, 24.0), "class": "B", "sigma": sigma} for sigma in DRAWN}
    envs = {sigma: quick(wind=wind) for sigma, wind in winds.items()}
    ratios = []
    for seed in range(3):
        deviations = {}
        for sigma, env in envs.items():
            env.reset(seed=seed)
            deviations[sigma] = env.scene.model.aero.wind.value[:-1, 0].std()
        ratios.append(deviations["drawn"] / deviations["90%"])
    assert len(set(ratios)) == 3 and 0.6 < min(ratios) < max(ratios) < 1.3


@pytest.mark.parametrize("task", TASKS)
def test_no_observation_entry_is_constant_and_all_stay_in_the_space(task):
    names = [name for name in KNOWN if task != "steady" or name != "wave_elevation"]  # its sea is still
    wind = {"kind": "eog", "speed": 14.0, "start": 1.0} if task == "steady" else None
    env = quick(task=task, observation=names, wind_preview=(3.0,), wind=wind)
    rng = np.random.default_rng(0)
    seen = [env.reset(seed=3)[0]]
    for _ in range(100):
        observation, _, terminated, _, _ = env.step(rng.uniform(-1.0, 1.0, 2))
        assert observation.dtype == np.float32 and observation in env.observation_space
        seen.append(observation)
        assert not terminated
    assert np.all(np.ptp(np.array(seen), axis=0) > 0.0)


def test_observations_are_of_order_one_in_operation():
    names = [name for name in KNOWN if name != "previous_action"]
    env = quick(action_mode="residual", observation=names, wind_preview=(3.0,))
    largest = 0.0
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        for _ in range(600):
            largest = np.maximum(largest, np.abs(observation))
            observation, *_ = env.step((0.0, 0.0))
    assert np.all(largest < 6.0) and np.all(largest > 0.05), largest


@pytest.mark.parametrize(
    "action",
    [0.0, (0.0,), (0.0, 0.0, 0.0), [[0.0, 0.0]], (np.nan, 0.0), (0.0, np.inf), (-np.inf, 0.0), "ab", None,
     ((0.0, 1.0), 2.0)],
)  # fmt: skip
def test_unusable_actions_are_errors_and_leave_the_run_alone(action):
    env = quick()
    env.reset(seed=0)
    untouched = quick()
    untouched.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        env.step(action)
    assert np.array_equal(env.step((0.1, 0.2))[0], untouched.step((0.1, 0.2))[0])


def test_actions_beyond_the_range_saturate_and_are_counted():
    env, other = quick(), quick()
    env.reset(seed=0)
    other.reset(seed=0)
    for action, count in (((1.0, -1.0), 0), ((1.5, 0.0), 1), ((3.0, -7.0), 2), ((0.0, 1.0), 2)):
        got, reward, _, _, info = env.step(action)
        expected, expected_reward, *_ = other.step(np.clip(action, -1.0, 1.0))
        assert np.array_equal(got, expected) and reward == expected_reward
        assert info["saturated_actions"] == count
    assert env.reset(seed=0)[1]["saturated_actions"] == 0


def test_rare_events_are_in_the_infos_of_a_reset_and_of_the_end():
    env = quick(duration=0.3)
    deep = FIXED | {"wind": 18.0, "sea": "still", "offsets": {"PtfmHeave": -60.0}}  # under water
    assert env.reset(options=deep)[1]["events"] == {"HYDROSTATIC_FALLBACK": 1}
    infos = [env.step((0.0, 0.0))[4] for _ in range(3)]
    assert ["events" in info for info in infos] == [False, False, True]
    assert infos[-1]["events"] == {"HYDROSTATIC_FALLBACK": 7}  # two of each of the first steps of ab4
    assert env.reset(seed=1)[1]["events"] == {}


def test_action_types_do_not_matter():
    env, frozen = quick(), np.array([0.25, -0.5])
    frozen.flags.writeable = False
    seen = []
    for action in ((0.25, -0.5), frozen.astype(np.float32), frozen, np.array([0.25, 9.0, -0.5])[::2]):
        env.reset(seed=0)
        seen.append(env.step(action)[0])
    assert all(np.array_equal(other, seen[0]) for other in seen)


def test_direct_pitch_action_spans_the_task_s_range():
    env = quick(task=Task("slow", wind=8.0, blade_pitch=(5.0, 25.0), rotor="table"))
    for action, angle in ((-1.0, 5.0), (0.0, 15.0), (1.0, 25.0)):
        env.reset(seed=0)
        for _ in range(60):
            env.step((1.0, action))
        assert np.degrees(env.measurement().blade_pitch) == pytest.approx(angle, abs=1e-6)


def test_the_action_of_the_start_holds_the_operating_point():
    env = quick(task="steady", observation=("default", "previous_action"))
    observation, _ = env.reset(options={"wind": 18.0, "offsets": {}})
    start = env.measurement()
    for _ in range(100):
        env.step(observation[-2:])
    now = env.measurement()
    # the operating point is azimuth-averaged; the platform follows the blades' passing
    assert now.rotor_speed == pytest.approx(start.rotor_speed, rel=2e-3)
    assert now.platform_pitch == pytest.approx(start.platform_pitch, abs=2e-4)


@pytest.mark.parametrize("share", [0.98, 1.05])
def test_setpoint_mode_brings_the_rotor_to_its_setpoint(share):
    env = quick(task="steady", action_mode="setpoint", observation=("default", "previous_action"))
    observation, _ = env.reset(options={"wind": 18.0, "offsets": {}})
    low, high = env.task.setpoint
    action = (2.0 * (share - low) / (high - low) - 1.0, observation[-1])
    for _ in range(900):
        assert not env.step(action)[2]
    rated = env.scene.turbine.rated_rotor_speed
    assert env.measurement().rotor_speed == pytest.approx(share * rated, rel=5e-3)


def test_residual_actions_add_to_the_baseline_within_their_limits():
    plain, moved = quick(action_mode="residual"), quick(action_mode="residual")
    for env in (plain, moved):
        env.reset(seed=4, options=FIXED)
    plain.step((0.0, 0.0))
    moved.step((-0.2, 1.0))
    law = moved.scene.turbine.torque_law
    difference = moved.measurement().generator_torque - plain.measurement().generator_torque
    assert difference == pytest.approx(-0.2 * 0.1 * law.rated_torque, rel=1e-9)
    assert moved.view().in_force[1] - plain.view().in_force[1] == pytest.approx(np.radians(2.0), rel=1e-9)


def test_looking_at_channels_leaves_the_run_as_it_is():
    env, other = quick(), quick()
    env.reset(seed=2)
    other.reset(seed=2)
    for _ in range(20):
        env.channels()
        assert np.array_equal(env.step((0.3, 0.1))[0], other.step((0.3, 0.1))[0])
    assert np.array_equal(env.view().state, other.view().state)
    assert set(env.channels()) == {c.name for c in env.scene.channels}


def test_reward_is_the_weighted_sum_of_its_visible_terms():
    env = quick(reward={"power": 3.0, "torque_travel": 0.0})
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(50):
        _, reward, _, _, info = env.step(rng.uniform(-1.0, 1.0, 2))
        terms = {name: info[f"reward/{name}"] for name in REWARD_TERMS}
        paid = [env.task.weights.get(n, 0.0) * v for n, v in terms.items()]  # a task names what it pays for
        assert reward == pytest.approx(sum(paid), rel=1e-12)
        assert all(REWARD_TERMS[n].low <= value <= REWARD_TERMS[n].high for n, value in terms.items())
    assert env.task.weights["power"] == 3.0
    assert env.task.weights["rotor_speed"] == TASKS["above_rated"].weights["rotor_speed"] > 0.0


def test_rotor_without_torque_ends_in_overspeed():
    env = quick()
    env.reset(seed=1, options={"wind": 18.0})
    hold = env.measurement().blade_pitch
    for _ in range(300):
        observation, reward, terminated, truncated, info = env.step((-1.0, np.degrees(hold) / 15.0 - 1.0))
        if terminated:
            break
        assert "termination" not in info and info["reward/failure"] == 0.0
    assert terminated and not truncated and info["termination"].startswith("overspeed")
    assert env.measurement().rotor_speed > env.scene.turbine.overspeed
    assert info["reward/failure"] == -1.0 and reward < -90.0
    assert observation in env.observation_space


def test_capsize_ends_the_episode():
    env = quick()
    env.reset(seed=1, options={"wind": 18.0, "offsets": {"PtfmPitch": 82.0}})
    observation, _, terminated, _, info = env.step((0.0, 0.0))
    assert terminated and info["termination"].startswith("capsize")
    assert observation in env.observation_space


def test_a_state_that_is_not_finite_ends_the_episode_with_a_finite_observation():
    env = quick()
    env.reset(seed=1)
    env.unwrapped._episode.x[State.VX] = np.inf
    observation, reward, terminated, _, info = env.step_physical(4e4, 0.1)
    assert terminated and info["termination"] == "non-finite state"
    assert np.isfinite(reward) and observation in env.observation_space


def test_a_physical_command_is_followed_within_the_generator_s_limits():
    env = quick()
    env.reset(options=FIXED | {"wind": 18.0, "sea": "still"})
    law, hold = env.scene.turbine.torque_law, env.measurement().blade_pitch
    way, start = 0.1 * law.max_torque_rate, env.measurement().generator_torque
    assert env.step_physical(start - way, hold)[4]["torque_limited"] == 0
    assert env.measurement().generator_torque == start - way
    for torque, end in ((90e3, law.max_torque), (-43e3, 0.0)):
        before = env.measurement().generator_torque
        counted = env.step_physical(torque, hold)[4]["torque_limited"]
        assert env.measurement().generator_torque == pytest.approx(before + np.copysign(way, end - before))
        assert env.channels()["GenTqLim"] == 1.0
        for _ in range(40):
            info = env.step_physical(torque, hold)[4]
        assert env.measurement().generator_torque == end and info["torque_limited"] == counted + 40
    env.step_physical(0.0, hold)
    assert env.channels()["GenTqLim"] == 0.0


def test_the_commands_of_an_action_beyond_the_generator_are_counted():
    env = quick()
    info = env.reset(options=FIXED | {"wind": 18.0, "sea": "still"})[1]
    assert info["torque_limited"] == 0
    counts = [env.step((-1.0, 0.0))[4]["torque_limited"] for _ in range(32)]
    # from 43.1 kN m to zero in steps of 1.5 takes 29 periods, the last of which gets there
    assert counts == [*range(1, 29), 28, 28, 28, 28] and env.measurement().generator_torque == 0.0
    for _ in range(40):
        env.step((1.0, 0.0))
    assert env.measurement().generator_torque == env.scene.turbine.torque_law.max_torque


def test_time_truncates_and_a_new_reset_is_needed():
    env = quick(duration=2.0)
    with pytest.raises(ResetNeeded):
        env.step((0.0, 0.0))
    env.reset(seed=0)
    for k in range(1, 21):
        _, _, terminated, truncated, info = env.step((0.5, 0.0))
        assert not terminated and truncated == (k == 20)
        assert info["time"] == pytest.approx(0.1 * k, abs=1e-12)
    with pytest.raises(ResetNeeded):
        env.step((0.0, 0.0))
    env.reset()
    env.step((0.0, 0.0))


def test_episodes_start_at_the_operating_point_of_their_mean_wind():
    env = quick()
    env.reset(seed=0, options=FIXED)
    point = fowt_env.trim(env.scene)
    assert np.array_equal(env.view().state, point.state)
    assert np.array_equal(env.view().in_force, point.command)


def test_interpolated_operating_points_are_near_the_exact_ones():
    env = quick(task="steady")
    scene, key = env.scene, env._key
    bounds = {State.SURGE: 0.06, State.PLATFORM_PITCH: 3e-4, State.BLADE_PITCH: 1e-3, State.ROTOR_SPEED: 4e-3}
    for speed in (5.125, 7.875, 10.375, 11.375, 11.875, 14.125, 24.875):
        near, exact = interpolated_trim(scene, key, speed)[0], cached_trim(scene, key, speed)[0]
        wider = 20.0 if abs(speed - scene.turbine.rated_wind_speed) < GRID else 1.0  # pitch control sets in
        for index, bound in bounds.items():
            assert abs(near[index] - exact[index]) < wider * bound, (speed, index)
    assert interpolated_trim(scene, key, 18.0)[0] is cached_trim(scene, key, 18.0)[0]


def test_preview_shows_the_wind_that_comes():
    env = quick(observation=("wind_speed", "wind_preview"), wind_preview=(0.5, 1.0))
    shown = [env.reset(seed=0)[0]]
    shown += [env.step((0.5, 0.1))[0] for _ in range(20)]
    shown = np.array(shown)
    np.testing.assert_allclose(shown[5:, 0], shown[:-5, 1], rtol=1e-6)
    np.testing.assert_allclose(shown[10:, 0], shown[:-10, 2], rtol=1e-6)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"task": "above_rate"}, "Did you mean 'above_rated'"),
        ({"action_mode": "dirct"}, "Did you mean 'direct'"),
        ({"render_mode": "humann"}, "'human'"),
        ({"dt": 0.03}, "does not divide control_dt"),
        ({"duration": 10.05}, "does not divide duration"),
        ({"duration": -1.0}, "duration = -1.0"),
        ({"observation": ("surge", "sureg")}, "Did you mean 'surge'"),
        ({"observation": ("wind_preview",)}, "look-ahead"),
        ({"observation": 3}, "observation = 3: must be a list of channel names"),
        ({"reward": {"powr": 1.0}}, "Did you mean 'power'"),
        ({"reward": 3}, "reward = 3: must be a dict of reward terms"),
        ({"basline": "lqr"}, "unexpected keyword argument 'basline'. Did you mean 'baseline'"),
        ({"rotor": "tabel"}, "Did you mean 'table'"),
        ({"wind": {"kind": "series", "time": [0.0, 60.0], "speed": [10.0, 12.0]}}, "wind series ends at 60"),
        ({"wave_component": 20}, "Did you mean 'wave_components'"),
        ({"platform": "oc3_hywnd"}, "oc3_hywind"),
        ({"task": Task("wide", wind=18.0, blade_pitch=(-5.0, 30.0))}, "within \\[0, 90\\] deg"),
    ],
)
def test_bad_settings_are_refused_with_the_key_and_what_is_allowed(settings, message):
    with pytest.raises(InputError, match=message):
        quick(**settings)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wnd": 18.0}, "Did you mean 'wind'"),
        ({"wind": None}, "needs a wind"),
        ({"wind": -3.0}, "wind"),
        ({"sea": "papr_regular"}, "Did you mean 'paper_regular'"),
        ({"weather_seed": -1}, "seed = -1"),
        ({"offsets": {"PtfmTVxi": 1.0}}, "unknown channel"),
        ({"offsets": {"PtfmSurge": float("nan")}}, "nan"),
        ({"wind": 18.0, "offsets": {"PtfmPitch": 100.0}}, "must be inside"),
        ([], r"options = \[\]: must be a mapping"),
        (0, "options = 0: must be a mapping"),
    ],
)
def test_bad_reset_options_are_refused_and_need_a_new_reset(options, message):
    env = quick()
    with pytest.raises(InputError, match=message):
        env.reset(seed=0, options=options)
    with pytest.raises(ResetNeeded):
        env.step((0.0, 0.0))
