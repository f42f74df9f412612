"""What Gymnasium's wrappers and the training loops of other libraries do with an environment."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from gymnasium.wrappers.vector import RecordEpisodeStatistics as RecordVectorStatistics

from fowt_env.envs import FowtVectorEnv
from fowt_env.errors import InputError

NAME = "fowt_env/OC3Hywind-v1"
QUICK = {"rotor": "table", "wave_components": 20, "action_mode": "residual"}
DURATIONS = (1.0, 1.1, 0.7)  # s, of which no two end in one step
MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)


def single(duration):
    return gymnasium.make(NAME, duration=duration, **QUICK)


def native(mode):
    each = [{"duration": duration} for duration in DURATIONS]
    return gymnasium.make_vec(NAME, 3, autoreset_mode=mode, per_env=each, threads=1, **QUICK)


def sync(mode):
    return SyncVectorEnv([lambda d=d: single(d) for d in DURATIONS], autoreset_mode=mode)


def episodes(env, steps):
    """Return [(environment, return, length)] of the episodes that end, as a training loop reads them."""
    env.reset(seed=3)
    found = []
    for _ in range(steps):
        infos = env.step(np.zeros((3, 2), dtype=np.float32))[4]
        if "episode" in infos:
            statistics = infos["episode"]
            for i in np.flatnonzero(infos["_episode"]):
                found.append((int(i), float(statistics["r"][i]), int(statistics["l"][i])))
    return found


def summed(env, steps):
    """Return the same, added up by hand from the rewards of the environment itself."""
    env.reset(seed=3)
    returns, lengths, found = np.zeros(3), np.zeros(3, dtype=int), []
    waiting = np.zeros(3, dtype=bool)  # for the step that resets
    for _ in range(steps):
        _, rewards, terminated, truncated, _ = env.step(np.zeros((3, 2), dtype=np.float32))
        returns, lengths = np.where(waiting, 0.0, returns + rewards), np.where(waiting, 0, lengths + 1)
        over = terminated | truncated
        found += [(int(i), float(returns[i]), int(lengths[i])) for i in np.flatnonzero(over)]
        if env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP:
            returns[over], lengths[over] = 0.0, 0
        else:
            waiting = over
    return found


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("make", [native, sync])
def test_statistics_of_episodes_are_recorded_whenever_one_ends(make, mode):
    found, expected = episodes(RecordVectorStatistics(make(mode)), 40), summed(make(mode), 40)
    assert [row[::2] for row in found] == [row[::2] for row in expected] and len(found) > 8
    np.testing.assert_allclose([row[1] for row in found], [row[1] for row in expected], rtol=1e-12)
    for i, duration in enumerate(DURATIONS):
        assert {length for place, _, length in found if place == i} == {round(duration / 0.1)}


def test_statistics_of_single_environments_are_in_the_last_info():
    """Those that a loop puts around each environment, and reads from what the vector environment gives."""
    env = SyncVectorEnv(
        [lambda d=d: RecordEpisodeStatistics(single(d)) for d in DURATIONS],
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
    env.reset(seed=3)
    found = []
    for _ in range(40):
        infos = env.step(np.zeros((3, 2), dtype=np.float32))[4]
        if "final_info" in infos:
            last = infos["final_info"]["episode"]
            found += [(int(i), float(last["r"][i]), int(last["l"][i])) for i in np.flatnonzero(last["_r"])]
    expected = summed(sync(AutoresetMode.SAME_STEP), 40)
    assert [row[::2] for row in found] == [row[::2] for row in expected] and len(found) > 8


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("make", [native, sync])
def test_without_a_wrapper_no_info_has_statistics_of_an_episode(make, mode):
    env = make(mode)
    assert "sampled" in env.reset(seed=3)[1]
    for _ in range(30):
        infos = env.step(np.zeros((3, 2), dtype=np.float32))[4]
        assert not {"episode", "_episode"} & {*infos, *infos.get("final_info", ())}


def test_an_unknown_setting_is_a_keyword_that_python_would_refuse():
    """TorchRL's GymEnv gives every environment `frameskip`, and makes it without where it is refused so."""
    rule = "unexpected keyword argument 'frameskip'"
    for make in (gymnasium.make, lambda name, **given: gymnasium.make_vec(name, 2, **given)):
        with pytest.raises(TypeError, match=rule) as refused:
            make(NAME, frameskip=1, **QUICK)
        assert isinstance(refused.value, InputError)
    with pytest.raises(InputError, match=r"keyword argument 'basline'\. Did you mean 'baseline'"):
        single(1.0).unwrapped.__class__(basline="lqr")


@pytest.mark.parametrize("name", ["same_step", "SAME_STEP", "SameStep", AutoresetMode.SAME_STEP])
def test_an_autoreset_mode_goes_by_either_of_its_names(name):
    env = FowtVectorEnv(2, autoreset_mode=name, duration=0.2, **QUICK)
    assert env.autoreset_mode is AutoresetMode.SAME_STEP
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
