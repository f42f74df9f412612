"""Domain randomisation: what is drawn reaches the plants and the sensors, and only where it is asked for."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from fowt_env.description import read_platform
from fowt_env.errors import InputError
from training.randomisation import PLANT, SENSORS, Sensors, distributions, draw, plant_settings, randomised
from training.train import decision_env, make_envs, resolve

from .small_run import small


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
    per_env, sensors = randomised({"plants": 3}, 5, seed=1)
    assert per_env[0] is per_env[3] and per_env[0] != per_env[1]
    assert len(set(sensors.noise[:3])) == 3 and sensors.noise[4] == sensors.noise[1]


def test_readings_are_late_by_the_delay_and_noisy_by_the_noise():
    sensors = Sensors(noise=[0.0, 0.5], delay=[2, 0], seed=0)
    sensors.sensed = np.array([True, False])
    sensors.restart(slice(None), np.zeros((2, 2), dtype=np.float32))
    seen = []
    for value in range(1, 400):
        sensors.take(np.full((2, 2), value, dtype=np.float32))
        seen.append(sensors.read())
    seen = np.array(seen)
    assert seen[:4, 0, 0].tolist() == [0.0, 0.0, 1.0, 2.0]
    assert seen[:4, 0, 1].tolist() == [1.0, 2.0, 3.0, 4.0]
    noise = seen[:, 1, 0] - np.arange(1, 400)
    assert 0.4 < noise.std() < 0.6 and abs(noise.mean()) < 0.1
    assert np.array_equal(seen[:, 1, 1], np.arange(1, 400))


def test_the_plain_task_is_not_randomised_and_the_robust_one_is():
    plain, judge = make_envs(small("ppo"))
    assert decision_env(plain).sensors is None
    settings = small("ppo") | {"environment": small("ppo")["environment"] | {"randomise": {"plants": 2}}}
    robust, judge = make_envs(settings)
    masses = [env.scene.platform.ballast.mass for env in decision_env(robust).base.env.envs]
    assert len(set(masses)) == 2 and decision_env(robust).sensors is not None
    assert len({env.scene.platform.ballast.mass for env in decision_env(judge).base.env.envs}) == 1
    for algo in ("ppo", "sac", "tqc"):
        assert "randomise" in resolve(algo, "above_rated_robust", 0, 1)["environment"]
        assert "randomise" not in resolve(algo, "above_rated", 0, 1)["environment"]


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
