"""Options of reset, what ended and closed environments answer, and rewards and costs of one's own."""

import pickle

import gymnasium
import numpy as np
import pytest
from episodes import NAME, QUICK
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from fowt_env.envs import FowtEnv, FowtVectorEnv, SafetyCosts
from fowt_env.errors import InputError
from fowt_env.training.rl.randomisation import randomised

NTM = {"kind": "ntm", "speed": (11.0, 13.0), "class": "B"}


@pytest.fixture(scope="module")
def env():
    return FowtEnv(**QUICK)


def test_ranges_are_drawn_by_seed_and_replayed(env):
    options = {"wind": NTM, "sea": {"kind": "jonswap", "Hs": (2.0, 3.0), "Tp": 9.0}}
    first, info = env.reset(seed=5, options=options)
    drawn = info["sampled"]
    assert 11.0 <= drawn["wind"]["speed"] <= 13.0 and 2.0 <= drawn["sea"]["Hs"] <= 3.0
    assert drawn["sea"]["Tp"] == 9.0 and drawn["exact_start"] is False
    again, info = env.reset(seed=5, options=options)
    assert np.array_equal(first, again) and info["sampled"] == drawn
    replayed, _ = env.reset(options=drawn)
    assert np.array_equal(first, replayed)
    speeds = {env.reset(options=options)[1]["sampled"]["wind"]["speed"] for _ in range(4)}
    assert len(speeds) == 4  # the next episodes are others


def test_a_joint_sea_follows_the_wind_of_the_options(env):
    low = env.reset(seed=1, options={"wind": 12.0, "sea": {"kind": "joint"}})[1]["sampled"]["sea"]
    high = env.reset(seed=1, options={"wind": 24.0, "sea": {"kind": "joint"}})[1]["sampled"]["sea"]
    assert low["Hs"] < high["Hs"]


def test_offsets_and_mixtures_are_drawn_too(env):
    mixture = [(1.0, NTM, None), (1.0, {"kind": "steady", "speed": (20.0, 21.0)}, None)]
    seen = set()
    for k in range(12):
        _, info = env.reset(seed=k, options={"wind": mixture, "offsets": {"PtfmPitch": (2.0, 3.0)}})
        seen.add(info["sampled"]["wind"]["kind"])
        assert 2.0 <= info["sampled"]["offsets"]["PtfmPitch"] <= 3.0
    assert seen == {"ntm", "steady"}


def test_options_without_ranges_draw_as_before(env):
    """The generator gives what it gave: a sea that the options leave out is the task's."""
    plain = env.reset(seed=9)[1]["sampled"]
    given = env.reset(seed=9, options={"wind": 18.0})[1]["sampled"]
    assert given["sea"] == plain["sea"] and given["exact_start"] is True


def test_a_batch_draws_for_each_environment():
    batch = FowtVectorEnv(3, **QUICK)
    _, infos = batch.reset(seed=5, options={"wind": NTM})
    speeds = [episode["wind"]["speed"] for episode in infos["sampled"]]
    single = FowtEnv(**QUICK).reset(seed=6, options={"wind": NTM})[1]["sampled"]
    assert len(set(speeds)) == 3 and speeds[1] == single["wind"]["speed"]


def test_a_step_after_the_end_says_why_and_when_it_ended(env):
    with pytest.raises(ResetNeeded, match="call reset"):
        FowtEnv(**QUICK).step((0.0, 0.0))
    env.reset(seed=1, options={"offsets": {"RotSpeed": 6.0}})
    _, _, terminated, _, info = env.step((0.0, 0.0))
    assert terminated and info["termination"].startswith("overspeed")
    for step in (env.step, lambda action: env.step_physical(4e4, 0.2)):
        with pytest.raises(ResetNeeded, match=r"^the episode ended \(overspeed\) at 0\.1 s: call reset\(\)$"):
            step((0.0, 0.0))
    ended = env.get_state()
    env.reset(seed=1)
    env.step((0.0, 0.0))
    env.set_state(ended)
    with pytest.raises(ResetNeeded, match=r"overspeed\) at 0\.1 s"):
        env.step((0.0, 0.0))


def test_closed_environments_say_so():
    env = FowtEnv(**QUICK)
    env.reset(seed=1)
    saved = env.get_state()
    env.close()
    env.close()
    for use in (
        env.reset,
        lambda: env.step((0.0, 0.0)),
        lambda: env.step_physical(4e4, 0.2),
        lambda: env.set_state(saved),
    ):
        with pytest.raises(ClosedEnvironmentError, match="was closed"):
            use()
    env.twin().reset(seed=1)
    batch = FowtVectorEnv(2, **QUICK)
    batch.reset(seed=1)
    batch.close()
    for use in (batch.reset, lambda: batch.step(np.zeros((2, 2)))):
        with pytest.raises(ClosedEnvironmentError, match="was closed"):
            use()


def own(info, measurement):
    return info["reward/power"] - abs(measurement.platform_pitch_rate) - 10.0 * ("termination" in info)


def test_a_reward_function_gets_the_terms_and_the_true_motion():
    env = FowtEnv(**QUICK, reward=own, sensors={"noise": 0.1, "delay": 3})
    env.reset(seed=1)
    for _ in range(5):
        _, reward, _, _, info = env.step((0.8, 0.0))
        true = env.true_measurement()
        assert true.platform_pitch_rate != env.measurement().platform_pitch_rate
        assert reward == info["reward/power"] - abs(true.platform_pitch_rate)
    env.reset(seed=1, options={"offsets": {"RotSpeed": 6.0}})
    assert env.step((0.0, 0.0))[1] < -9.0


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_pays_what_single_environments_pay(mode):
    batch = FowtVectorEnv(3, mode, per_env=[{"reward": own}, {}, {"reward": own}], duration=0.5, **QUICK)
    batch.reset(seed=1)
    singles = [FowtEnv(**QUICK, duration=0.5, **({} if i == 1 else {"reward": own})) for i in range(3)]
    for i, single in enumerate(singles):
        single.reset(seed=1 + i)
    for _ in range(5):
        actions = np.full((3, 2), 0.3)
        rewards = batch.step(actions)[1]
        assert rewards.tolist() == [single.step(actions[0])[1] for single in singles]
    rewards = batch.step(actions)[1]  # the step that resets, or the first of the next episode
    assert rewards[0] == 0.0 if mode == "NextStep" else rewards[0] != 0.0


def of_power(info):
    return 2.0 * info["reward/power"]


def test_a_reward_may_take_the_info_alone():
    env = FowtEnv(**QUICK, reward=of_power)
    for each in (env, pickle.loads(pickle.dumps(env))):
        each.reset(seed=1)
        _, reward, _, _, info = each.step((0.0, 0.0))
        assert reward == 2.0 * info["reward/power"]


def test_reward_functions_that_cannot_be_used_are_refused():
    for function in (lambda: 1.0, lambda info, measurement, action: 1.0):
        with pytest.raises(InputError, match=r"must accept \(info\) or \(info, measurement\)"):
            FowtEnv(**QUICK, reward=function)
    for value in (None, "much", float("nan"), [1.0, 2.0], 10**400, -(10**5000)):
        env = FowtEnv(**QUICK, reward=lambda info, measurement, value=value: value)
        env.reset(seed=1)
        with pytest.raises(InputError, match=r"returned .* at 0\.1 s: must be a finite number"):
            env.step((0.0, 0.0))


def test_costs_are_those_of_the_limits_passed():
    env = SafetyCosts(gymnasium.make(NAME, **QUICK), rotor_speed=1.0, platform_pitch=1.5)
    env.reset(seed=1)
    info = env.step(np.zeros(2, dtype=np.float32))[4]
    assert (info["cost"], info["cost_rotor_speed"], info["cost_platform_pitch"]) == (1.0, 1.0, 0.0)
    cases = (({}, "needs a limit"), ({"speed": 1.0}, "unknown limit"), ({"surge": -1.0}, "surge"))
    for limits, message in cases:
        with pytest.raises(InputError, match=message):
            SafetyCosts(env, **limits)


def test_render_without_a_mode_names_the_call_to_make():
    env = gymnasium.make(NAME, **QUICK).unwrapped
    env.reset(seed=1)
    with pytest.warns(UserWarning, match=r"gymnasium\.make\(\.\.\., render_mode='rgb_array'\)"):
        assert env.render() is None


def test_max_episode_steps_is_left_to_the_environment():
    env = gymnasium.make(NAME, duration=0.3, **QUICK)
    assert env.spec.max_episode_steps is None
    env.reset(seed=1)
    assert [env.step(np.zeros(2, dtype=np.float32))[3] for _ in range(3)] == [False, False, True]
    env = gymnasium.make(NAME, max_episode_steps=2, **QUICK)
    env.reset(seed=1)
    assert [env.step(np.zeros(2, dtype=np.float32))[3] for _ in range(2)] == [False, True]


def test_plants_that_differ_are_settings_of_make_and_make_vec():
    settings = randomised({"plants": 2}, 2, seed=3)
    batch = gymnasium.make_vec(NAME, num_envs=2, per_env=settings, **QUICK)
    masses = {env.scene.platform.ballast.mass for env in batch.envs}
    assert len(masses) == 2 and all(env.design_scene is not env.scene for env in batch.envs)
    batch.reset(seed=1)
    single = gymnasium.make(NAME, **settings[1], **QUICK).unwrapped
    assert single.scene.platform.ballast.mass == batch.envs[1].scene.platform.ballast.mass
