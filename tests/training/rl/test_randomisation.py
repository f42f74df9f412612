"""Domain randomisation: what is drawn reaches the plants and the sensors, and only where it is asked for."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from small_run import small

from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import InputError
from fowt_env.training.evaluation.plant_perturbation import PLANT, plant_settings
from fowt_env.training.rl.randomisation import SENSORS, distributions, draw, randomised
from fowt_env.training.rl.train import inner_env, make_envs, resolve


def test_each_factor_reaches_its_figure():
    base = read_platform("oc3_hywind")
    factors = {name: 1.0 + 0.01 * (i + 1) for i, name in enumerate(PLANT)}
    made = plant_settings(factors)
    platform, turbine = made["platform"], made["turbine"]
    for name, got, want in (
        ("ballast_mass", platform.ballast.mass, base.ballast.mass),
        ("upper_mass", platform.tower.mass, base.tower.mass),
        ("upper_mass", turbine.nacelle.mass, 240000.0),
        ("added_mass", platform.hydro.added_mass_coefficient, base.hydro.added_mass_coefficient),
        ("drag", platform.hydro.drag_coefficient, base.hydro.drag_coefficient),
        ("mooring_stiffness", platform.lines[2].wet_weight, base.lines[2].wet_weight),
        ("actuator_lag", turbine.pitch_drive.time_constant, 0.2),
        ("air_density", platform.environment.air_density, base.environment.air_density),
    ):
        assert got == pytest.approx(factors[name] * want), name
    assert read_platform("oc3_hywind") == base


def test_draws_stay_within_their_distributions_and_repeat_by_seed():
    chosen = distributions({})
    rows = [draw(chosen, np.random.default_rng(seed)) for seed in range(300)]
    assert rows[7] == draw(chosen, np.random.default_rng(7))
    assert list(rows[0]) == [*PLANT, *SENSORS]
    for name, (kind, a, b) in chosen.items():
        values = np.array([row[name] for row in rows])
        low, high = (a - 2.0 * b, a + 2.0 * b) if kind == "normal" else (a, b)
        assert low <= values.min() < values.max() <= high and np.ptp(values) > 0.7 * (high - low)


def test_environments_share_a_pool_of_plants_and_differ_within_it():
    per_env = randomised({"plants": 3}, 5, seed=1)
    assert per_env[0] is per_env[3] and per_env[0] != per_env[1]
    assert len({settings["sensors"]["noise"] for settings in per_env[:3]}) == 3


def test_the_plain_task_is_not_randomised_and_the_robust_one_is():
    plain, validation_env = make_envs(small("ppo"))
    assert {env._config.interface.sensors for env in environments(plain)} == {None}
    settings = small("ppo") | {"environment": small("ppo")["environment"] | {"randomise": {"plants": 2}}}
    robust, validation_env = make_envs(settings)
    assert len({env.scene.platform.ballast.mass for env in environments(robust)}) == 2
    assert len({env._sensors["noise"] for env in environments(robust)}) == 2
    assert len({env.scene.platform.ballast.mass for env in environments(validation_env)}) == 1
    assert {env._config.interface.sensors for env in environments(validation_env)} == {None}
    for algo in ("ppo", "sac", "tqc"):
        assert "randomise" in resolve(algo, "above_rated_robust", 0, 1)["environment"]
        assert "randomise" not in resolve(algo, "above_rated", 0, 1)["environment"]


def environments(env):
    return inner_env(env).env.envs


def test_on_drawn_plants_baseline_and_estimator_are_those_of_the_plant_in_the_files():
    """What the task randomises is not told to what is designed on models."""
    chosen = small("ppo")
    estimate = {"baseline": "lqr", "observation": "estimate", "action_mode": "residual"}
    chosen = chosen | {"environment": chosen["environment"] | estimate}
    drawn = chosen | {"environment": chosen["environment"] | {"randomise": {"plants": 2}}}
    plain, robust = make_envs(chosen)[0], make_envs(drawn)[0]
    plain.reset(), robust.reset()
    reference = environments(plain)[0]._config
    for env in environments(robust):
        assert env.scene.platform != environments(plain)[0].scene.platform
        assert np.array_equal(env._config.parameters, reference.parameters)
        assert np.array_equal(env._config.estimator, reference.estimator)


def test_sensors_of_the_validation_go_round_the_seeds_of_each_wind():
    settings = small("ppo")
    validation = settings["validation"] | {"winds": [14, 18], "seeds": 2, "sensors": [{}, {"noise": 0.02}]}
    _, validation_env = make_envs(settings | {"validation": validation})
    assert [env._sensors["noise"] for env in environments(validation_env)] == [0.0, 0.02, 0.0, 0.02]


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"mass": ["uniform", 1, 2]}, "unknown randomised quantity 'mass'"),
        ({"drag": ["unifrom", 1, 2]}, "Did you mean 'uniform'"),
        ({"drag": ["uniform", 2, 1]}, "low <= high"),
        ({"drag": ["uniform", 1]}, r"must be \[kind, a, b\]"),
        ({"actuator_lag": ["loguniform", 0.0, 1.0]}, "positive for loguniform"),
        ({"plants": 0}, "randomise.plants = 0"),
        ({"drag": ["uniform", -1.0, -0.5]}, "factors must be positive"),
    ],
)
def test_wrong_distributions_are_named(spec, message):
    with pytest.raises(InputError, match=message):
        randomised(spec, 2, 0)
