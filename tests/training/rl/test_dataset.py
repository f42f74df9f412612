"""Data sets of Minari: made, continued, loaded, replayed, and what a check finds."""

import json
import sys

import numpy as np
import pytest
from command_line import fowt

minari = pytest.importorskip("minari")
pytest.importorskip("osqp")

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.evaluation.seeds import TRAINING  # noqa: E402
from fowt_env.training.rl import dataset as module  # noqa: E402
from fowt_env.training.rl.dataset import BEHAVIOURS, check_dataset, make_dataset  # noqa: E402

HOURS, DURATION = 0.005, 9.0  # two episodes


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    "behaviour",
    [pytest.param(name, marks=pytest.mark.nightly) if name == "expert" else name for name in BEHAVIOURS],
)
def test_a_set_is_loaded_by_minari_and_replays_bit_for_bit(behaviour, folder):
    make_dataset(behaviour, HOURS, duration=DURATION)
    dataset = minari.load_dataset(f"oc3hywind/{behaviour}-v0")
    assert dataset.total_episodes == 2 and dataset.total_steps == 180
    episodes = list(dataset.iterate_episodes())
    assert episodes[0].observations.shape == (91, 18) and episodes[0].actions.dtype == np.float32
    assert not np.array_equal(episodes[0].observations, episodes[1].observations)
    found = check_dataset(dataset.spec.dataset_id, replays=2)
    assert found["episodes"] == 2 and found["hours"] == pytest.approx(HOURS) and 0.2 < found["reward"] < 1.0
    card = (folder / "oc3hywind" / f"{behaviour}-v0" / "README.md").read_text()
    assert BEHAVIOURS[behaviour].summary in card and "| 17 | wind_speed | m/s |" in card
    seeds = [one["seed"] for one in dataset.storage.get_episode_metadata(range(2))]
    assert len(set(seeds)) == 2 and all(seed in TRAINING for seed in seeds)


@pytest.mark.slow
def test_a_stopped_set_continues_and_equals_one_made_at_once(folder, monkeypatch):
    whole = make_dataset("medium", HOURS, "fowt_env/whole-v0", DURATION)
    episode = module._episode

    def stopped(env, behaviour, number):
        if number == 1:
            raise KeyboardInterrupt
        return episode(env, behaviour, number)

    with monkeypatch.context() as patch:
        patch.setattr(module, "_episode", stopped)
        with pytest.raises(KeyboardInterrupt):
            make_dataset("medium", HOURS, "fowt_env/part-v0", DURATION)
    assert minari.load_dataset("fowt_env/part-v0").total_episodes == 1
    part = make_dataset("medium", HOURS, "fowt_env/part-v0", DURATION)
    for one, other in zip(whole.iterate_episodes(), part.iterate_episodes(), strict=True):
        assert np.array_equal(one.observations, other.observations)
        assert np.array_equal(one.actions, other.actions)
    with pytest.raises(InputError, match="holds other episodes"):
        make_dataset("random", HOURS, "fowt_env/part-v0", DURATION)


@pytest.mark.slow
def test_a_check_finds_changed_actions_and_seeds_that_judge(folder):
    dataset = make_dataset("medium", HOURS, duration=DURATION)
    name, storage = dataset.spec.dataset_id, dataset.storage
    storage.update_episode_metadata([{"seed": 5}], [1])
    with pytest.raises(InputError, match="different seeds of training"):
        check_dataset(name)
    storage.update_episode_metadata([{"seed": module.FIRST_SEED + 7}], [1])
    assert check_dataset(name, replays=1)["episodes"] == 2  # the second is not replayed
    with pytest.raises(InputError, match="episode 1: its start differs"):
        check_dataset(name, replays=2)
    storage.update_episode_metadata([{"seed": module.FIRST_SEED + 1}], [1])
    episode = list(dataset.iterate_episodes())[1]
    changed = episode.actions.copy()
    changed[40, 1] += 1e-3
    buffer = minari.data_collector.EpisodeBuffer(
        1, module.FIRST_SEED + 1, {"weather_seed": module.FIRST_SEED + 1}, episode.observations, changed,
        episode.rewards, episode.terminations, episode.truncations,
    )  # fmt: skip
    storage.update_episodes([buffer])
    storage.update_metadata({"total_steps": 180})
    with pytest.raises(InputError, match="episode 1: step 40 differs"):
        check_dataset(name, replays=2)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"rewards": np.array([0.5, 1.5])}, "rewards must be in"),
        ({"rewards": np.array([0.5, np.nan])}, "rewards must be in"),
        ({"truncations": np.array([True, True])}, "must end in its last step alone"),
        ({"truncations": np.array([False, False])}, "must end in its last step alone"),
        ({"actions": np.array([[0.0, 0.0], [0.0, 1.5]])}, "actions must be in"),
        ({"observations": np.full((3, 2), np.nan)}, "observations must be in the space"),
        ({"observations": np.zeros((2, 2))}, "of shapes"),
    ],
)
def test_what_is_wrong_with_an_episode_is_said(change, fault):
    from types import SimpleNamespace

    from gymnasium.spaces import Box

    env = SimpleNamespace(observation_space=Box(-1.0, 1.0, (2,)), action_space=Box(-1.0, 1.0, (2,)))
    good = {
        "observations": np.zeros((3, 2)), "actions": np.zeros((2, 2)), "rewards": np.array([0.0, 1.0]),
        "terminations": np.zeros(2, dtype=bool), "truncations": np.array([False, True]),
    }  # fmt: skip
    assert module._fault(SimpleNamespace(**good), env) is None
    assert fault in module._fault(SimpleNamespace(**good | change), env)


@pytest.mark.slow
def test_the_command_checks(folder):
    name = "oc3hywind/medium-v0"
    make_dataset("medium", HOURS, name, DURATION)
    shown, told = fowt("dataset", "check", name)
    assert name in shown and "checked: 2 episodes, 2 of them replayed" in told
    _, told = fowt("dataset", "make", "experts", code=2)
    assert "unknown behaviour 'experts'. Did you mean 'expert'" in told
    fowt("dataset", "check", "fowt_env/none-v0", code=2)
    metadata = json.loads((folder / name / "data" / "metadata.json").read_text())
    assert metadata["total_episodes"] == 2


def test_bad_requests_and_a_missing_library_are_named(folder, monkeypatch):
    with pytest.raises(InputError, match="hours = 0"):
        make_dataset("medium", 0.0)
    monkeypatch.setitem(sys.modules, "minari.dataset.minari_storage", None)
    with pytest.raises(InputError, match=r"pip install 'fowt-env\[minari\]'"):
        make_dataset("medium", 1.0)


def test_a_set_that_is_not_here_is_named_with_the_command_that_makes_one(folder):
    with pytest.raises(InputError, match=r"oc3hywind/none-v0.*on this machine \(none\): fowt dataset make"):
        check_dataset("oc3hywind/none-v0")
