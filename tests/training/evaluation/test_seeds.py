"""Training, validation and test never share a realisation of wind and waves."""

import hashlib
import shlex
import tomllib
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from fowt_env.controllers.policy.controller import AGENTS
from fowt_env.envs import FowtEnv
from fowt_env.envs.tasks import LARGEST_SEED, TASKS
from fowt_env.errors import InputError
from fowt_env.training.design import sweeps, tune
from fowt_env.training.evaluation.cases import FOLDER, read_suite, suite_names
from fowt_env.training.evaluation.seeds import (
    DRAWING_RULE,
    DRAWN,
    PURPOSES,
    TEST,
    TRAINING,
    VALIDATION,
    drawn_seeds,
    ranges,
    seeds_for,
    with_drawn_seeds,
)
from fowt_env.training.rl.train import ALGORITHMS, environment_settings, resolve, validation_episodes

ROBUST = "above_rated_robust"


def test_seeds_in_a_row_are_one_range():
    assert ranges([1, 2, 3, 7, 9, 10]) == [(1, 3), (7, 7), (9, 10)] and ranges([]) == []


def test_the_ranges_cover_every_seed_once():
    for one, other in combinations(PURPOSES.values(), 2):
        assert max(one.start, other.start) >= min(one.stop, other.stop)
    assert sum(len(seeds) for seeds in PURPOSES.values()) == LARGEST_SEED


HASH = "0123456789abcdef0123456789abcdef01234567"


def test_drawn_seeds_follow_the_rule_that_is_published_with_them():
    """Here with the tools of another program: anybody can draw them again."""
    seeds = drawn_seeds(HASH, "above_rated", 2, 3)
    for i, seed in enumerate(seeds):
        first = hashlib.sha256(f"{HASH}/above_rated/2/{i}".encode()).hexdigest()[:16]
        assert seed == 2**62 + int(first, 16) // 4
    assert "SHA-256 of 'HASH/SUITE/VERSION/i'" in DRAWING_RULE
    assert drawn_seeds(HASH.upper(), "above_rated", 2, 6)[:3] == seeds
    others = drawn_seeds(HASH, "above_rated", 3, 3) + drawn_seeds(HASH, "gusts", 2, 3)
    assert len({*seeds, *others}) == 9 and all(seed in DRAWN for seed in seeds)
    assert all(purpose.stop < DRAWN.start for purpose in PURPOSES.values())


@pytest.mark.parametrize("source", ["", "main", "v0.2.0", HASH[:39], HASH[:-1] + "g", HASH + "\n"])
def test_seeds_are_drawn_from_a_whole_hash_alone(source):
    with pytest.raises(InputError, match="40 to 128 hexadecimal digits"):
        drawn_seeds(source, "above_rated", 2, 3)


@pytest.mark.parametrize("name", suite_names())
def test_the_seeds_of_a_shipped_suite_are_for_test_and_none_is_left_in_one_of_drawn_seeds(name):
    text = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    written = [seed for part in (text, *text["case"]) for seed in np.atleast_1d(part.get("seeds", []))]
    listed = read_suite(name)
    used = [seed for part in (listed, *listed.cases) for seed in part.seeds or ()]
    assert written and set(written) == set(used) and set(used) <= set(TEST)
    drawn = with_drawn_seeds(listed, HASH)
    assert drawn.drawn == {"hash": HASH, "rule": DRAWING_RULE} and listed.drawn is None
    for before, after in zip((listed, *listed.cases), (drawn, *drawn.cases), strict=True):
        assert len(after.seeds or ()) == len(before.seeds or ()) and set(after.seeds or ()).isdisjoint(used)
        assert all(seed in DRAWN for seed in after.seeds or ())


def test_gains_are_tuned_on_validation_seeds_alone():
    assert len(suite_names()) == len(list(FOLDER.glob("*.toml"))) > 5
    assert tune.SEEDS and set(tune.SEEDS) <= set(VALIDATION)
    assert VALIDATION.start == TEST.stop
    for search in (
        lambda seed: sweeps.sweep([{}], "steady_16", [seed]),
        lambda seed: tune.Objective(seeds=[seed]),
    ):
        with pytest.raises(InputError, match="seeds"):
            search(TEST.stop - 1)


def assert_apart(settings):
    """Every episode of training is drawn from TRAINING, every one of validation from VALIDATION."""
    task = environment_settings(settings)["task"]
    assert range(*task.weather_seeds) == TRAINING
    rng = np.random.default_rng(0)
    assert all(task.draw(rng).weather_seed in TRAINING for _ in range(200))
    episodes, _ = validation_episodes(settings)
    assert episodes and all(episode["weather_seed"] in VALIDATION for episode in episodes)


@pytest.mark.parametrize(
    ("algo", "task"),
    [*((algo, "above_rated") for algo in ALGORITHMS), ("ppo", ROBUST), ("ppo", "above_rated_mixture")],
)
def test_agents_train_on_training_seeds_and_are_chosen_on_validation_seeds(algo, task):
    assert_apart(resolve(algo, task, 0, 1))


@pytest.mark.parametrize("card", sorted(AGENTS.glob("*.toml")), ids=lambda path: path.stem)
def test_the_command_of_each_shipped_agent_keeps_its_seeds_apart(card):
    words = shlex.split(tomllib.loads(Path(card).read_text(encoding="utf-8"))["command"])
    options = list(zip(words[2::2], words[3::2], strict=True))
    named = dict(options)
    changes = dict(value.split("=", 1) for option, value in options if option == "--set")
    assert words[:2] == ["fowt", "train"] and not {key for key in changes if "seed" in key or "first" in key}
    changes = {key: tomllib.loads(f"value = {value}")["value"] for key, value in changes.items()}
    assert_apart(resolve(named["--algo"], named["--task"], int(named["--seed"]), 1, changes))


def test_the_environment_draws_its_weather_from_the_range_of_its_task():
    task = replace(TASKS["above_rated"], weather_seeds=(500, 502))
    env = FowtEnv(task, rotor="table", wave_components=5, duration=1.0, wind=18.0)
    drawn = {env.reset(seed=seed)[1]["sampled"]["weather_seed"] for seed in range(12)}
    assert drawn == {500, 501}


@pytest.mark.parametrize("seeds", [(5, 5), (-1, 4), (0, LARGEST_SEED + 1), (0.0, 4), [0, 4], (1,)])
def test_a_task_refuses_ranges_of_weather_seeds_that_cannot_be_drawn_from(seeds):
    with pytest.raises(InputError, match="weather_seeds"):
        replace(TASKS["above_rated"], weather_seeds=seeds)


def test_seeds_beyond_a_purpose_are_refused():
    assert seeds_for("validation", 2, 3) == (1002, 1003, 1004)
    for first, count in ((-1, 2), (0, 0), (len(VALIDATION) - 1, 2)):
        with pytest.raises(InputError, match="validation seeds"):
            seeds_for("validation", first, count)
