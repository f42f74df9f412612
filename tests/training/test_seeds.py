"""Training, validation and test never share a realisation of wind and waves."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from fowt_env.envs import FowtEnv
from fowt_env.envs.tasks import LARGEST_SEED, TASKS
from fowt_env.errors import InputError
from training import tune_controllers
from training.seeds import PURPOSES, TEST, TRAINING, VALIDATION, seeds_for
from training.train import ALGORITHMS, environment_settings, resolve, validation_episodes

SUITE_SEEDS = range(1, 7)


def test_the_ranges_cover_every_seed_once():
    for one, other in combinations(PURPOSES.values(), 2):
        assert max(one.start, other.start) >= min(one.stop, other.stop)
    assert sum(len(seeds) for seeds in PURPOSES.values()) == LARGEST_SEED


def test_the_suites_seeds_are_for_test_and_those_of_tuning_for_validation():
    assert all(seed in TEST for seed in SUITE_SEEDS)
    assert all(seed in VALIDATION for seed in tune_controllers.SEEDS)


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_agents_train_on_training_seeds_and_are_chosen_on_validation_seeds(algo):
    settings = resolve(algo, "above_rated", 0, 1)
    task = environment_settings(settings)["task"]
    rng = np.random.default_rng(0)
    assert all(task.draw(rng).weather_seed in TRAINING for _ in range(200))
    assert all(episode["weather_seed"] in VALIDATION for episode in validation_episodes(settings))


def test_the_environment_draws_its_weather_from_the_range_of_its_task():
    task = replace(TASKS["above_rated"], weather_seeds=(500, 502))
    env = FowtEnv(task, rotor="table", wave_components=5, duration=1.0, wind=18.0)
    drawn = {env.reset(seed=seed)[1]["episode"]["weather_seed"] for seed in range(12)}
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
