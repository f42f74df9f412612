"""Degraded sensors and a plant that controllers do not know: one reading for all, and nothing else."""

import numpy as np
import pytest
from episodes import DEGRADED

from fowt_env import build_scene, simulate
from fowt_env.control import call_law
from fowt_env.controllers import make
from fowt_env.controllers.lqr.law import WindEstimator
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.envs.safety import SafetyLayer
from fowt_env.envs.sensors import reading_scales
from fowt_env.errors import InputError
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure, Measurement
from fowt_env.training.evaluation.plant_perturbation import (
    PlantPerturbation,
    perturbed_sensors,
    plant_settings,
)

QUICK = {"rotor": "table", "wave_components": 20, "wind": {"kind": "ntm", "speed": 18.0, "class": "B"}}
NAMES = ("rotor_speed", "platform_pitch_rate", "previous_action", "estimated_wind", "estimated_waves")
ON_LQR = {"action_mode": "residual", "baseline": "lqr", "observation": NAMES}
SHIFTED = plant_settings({"added_mass": 1.2, "mooring_stiffness": 0.8, "upper_mass": 1.05})
NOMINAL = {"platform": "oc3_hywind"}


def run(env, steps=40, seed=3, reset_seed=4, reach=1.0):
    """Observations of actions drawn with a seed, and all measurements and readings."""
    rng = np.random.default_rng(seed)
    rows = [(env.reset(seed=reset_seed)[0], env.view().measurement.copy(), env.view().reading.copy())]
    for _ in range(steps):
        observation = env.step(rng.uniform(-reach, reach, 2))[0]
        rows.append((observation, env.view().measurement.copy(), env.view().reading.copy()))
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (ON_LQR, {"sensors": {}}),
        ({"action_mode": "setpoint"}, {"sensors": {}}),
        ({"action_mode": "direct"}, {"sensors": {}}),
        (ON_LQR, {"nominal_plant": NOMINAL}),
    ],
)
def test_exact_sensors_and_a_design_on_the_very_plant_change_no_bit(settings, told):
    plain, exact = FowtEnv(**settings, **QUICK), FowtEnv(**settings, **told, **QUICK)
    for one, other in zip(run(plain), run(exact), strict=True):
        assert np.array_equal(one, other)
    assert np.array_equal(plain.view().state, exact.view().state)
    assert np.array_equal(plain.view().in_force, exact.view().in_force)


def test_a_reading_is_what_was_measured_before_and_noise_of_the_stated_size():
    env = FowtEnv(**(ON_LQR | {"observation": ("rotor_speed",)}), sensors=DEGRADED, **QUICK)
    _, measured, read = run(env, steps=1500, reach=0.0)
    scales = reading_scales(env.scene.turbine)
    late = np.concatenate([measured[:1], measured[:1], measured[:-2]])
    noise = (read - late)[:, 1:] / (0.02 * scales[1:])
    assert np.array_equal(read[:, Measure.TIME], measured[:, Measure.TIME])
    assert np.abs(noise.std(axis=0) - 1.0).max() < 0.1 and np.abs(noise.mean(axis=0)).max() < 0.1
    assert np.abs(np.corrcoef(noise.T) - np.eye(N_MEASUREMENTS - 1)).max() < 0.12
    rated = env.scene.turbine.rated_rotor_speed
    seen = env._episode.observation[0] * 0.2 * rated + rated
    assert seen == pytest.approx(read[-1, Measure.ROTOR_SPEED], rel=1e-6)
    assert env.measurement() == Measurement(*read[-1].tolist())


@pytest.mark.parametrize("sensors", [{"noise": 0.02}, {"delay": 3}, DEGRADED])
def test_observation_baseline_and_estimator_are_given_the_same_reading(sensors):
    """lqr and estimator by hand, told what measurement() says: the same estimate, command and motion."""
    env = FowtEnv(sensors=sensors, **ON_LQR, **QUICK)
    env.reset(seed=5)
    hand = FowtEnv(sensors=sensors, **(ON_LQR | {"action_mode": "direct"}), **QUICK)
    hand.reset(seed=5)
    law = make("lqr", hand.scene.turbine, 0.1)
    law.prepare(hand.scene)
    law.reset(hand.measurement())
    watch = WindEstimator(hand.scene.turbine, 0.1)
    watch.prepare(hand.scene)
    watch.reset(hand.measurement())
    for _ in range(60):
        observation = env.step(np.zeros(2))[0]
        other = hand.step_physical(*law.act(hand.measurement()))[0]
        both = [np.delete(seen, [2, 3]) for seen in (observation, other)]  # the last action differs by mode
        assert np.array_equal(*both)
        assert np.array_equal(env.view().in_force, hand.view().in_force)
        assert np.array_equal(env.view().state, hand.view().state)
        measured, command = np.array(hand.measurement()), hand.view().in_force
        call_law(watch.kernel, watch.parameters, watch.memory, measured, command)
        assert np.array_equal(watch.memory, env.view().estimate)


def test_noise_reaches_baseline_and_estimator_but_not_the_reward():
    exact, degraded = FowtEnv(**ON_LQR, **QUICK), FowtEnv(sensors={"noise": 0.05}, **ON_LQR, **QUICK)
    exact.reset(seed=6), degraded.reset(seed=6)
    assert not np.array_equal(exact.view().estimate, degraded.view().estimate)
    exact.step(np.zeros(2)), degraded.step(np.zeros(2))
    assert exact.view().in_force[1] != degraded.view().in_force[1]
    deaf = {"action_mode": "direct", "observation": ("rotor_speed",)}
    exact, degraded = FowtEnv(**deaf, **QUICK), FowtEnv(sensors={"noise": 0.05}, **deaf, **QUICK)
    exact.reset(seed=6), degraded.reset(seed=6)
    for _ in range(20):
        seen, paid, *_ = exact.step([0.1, 0.2])
        read, equally_paid, *_ = degraded.step([0.1, 0.2])
        assert seen[0] != read[0] and paid == equally_paid


def test_readings_repeat_with_the_weather_and_differ_in_another():
    env = FowtEnv(observation=("rotor_speed",), sensors=DEGRADED, **QUICK)
    seen, _, _ = run(env, reset_seed=7)
    again, _, _ = run(env, reset_seed=7)
    _, info = env.reset(seed=8)
    first = env.reset(options=info["sampled"])[0]
    assert np.array_equal(seen, again) and not np.array_equal(first, seen[0])
    assert np.array_equal(first, env.reset(options=info["sampled"])[0])


def test_environments_of_a_batch_may_differ_in_noise_and_delay_but_not_in_having_sensors():
    per_env = [{"sensors": DEGRADED}, {"sensors": {"noise": 0.0}}]
    batch = FowtVectorEnv(2, threads=1, per_env=per_env, **ON_LQR, **QUICK)
    seen = batch.reset(seed=1)[0]
    assert np.array_equal(seen[1], FowtEnv(**ON_LQR, **QUICK).reset(seed=2)[0])
    with pytest.raises(InputError, match="sensors"):
        FowtVectorEnv(2, threads=1, per_env=[{"sensors": DEGRADED}, {}], **ON_LQR, **QUICK)


def test_the_drawn_plant_is_not_leaked_to_lqr_estimator_preview_and_safety_layer():
    nominal = FowtEnv(**ON_LQR, **QUICK)
    nominal.reset(seed=1)
    told = FowtEnv(nominal_plant=NOMINAL, **ON_LQR, **SHIFTED, **QUICK)
    leaked = FowtEnv(**ON_LQR, **SHIFTED, **QUICK)
    for env, same in ((told, True), (leaked, False)):
        env.reset(seed=1)
        assert np.array_equal(env._config.parameters, nominal._config.parameters) is same
        assert np.array_equal(env._config.estimator, nominal._config.estimator) is same
    assert told.scene.platform.hydro != nominal.scene.platform.hydro  # it is another plant that moves
    feedforward = {"action_mode": "residual", "baseline": "preview"}
    heavy_air = plant_settings({"air_density": 1.04})
    nominal = FowtEnv(**feedforward, **QUICK)
    told = FowtEnv(nominal_plant=NOMINAL, **feedforward, **heavy_air, **QUICK)
    leaked = FowtEnv(**feedforward, **heavy_air, **QUICK)
    for seed in (1, 2):  # the wind foreseen is that of each episode
        for env in (nominal, told, leaked):
            env.reset(seed=seed)
        assert np.array_equal(told._config.parameters, nominal._config.parameters)
        assert not np.array_equal(leaked._config.parameters, nominal._config.parameters)
    guarded = SafetyLayer(FowtEnv(nominal_plant=NOMINAL, **ON_LQR, **SHIFTED, **QUICK), baseline="lqr")
    guarded.reset(seed=1)
    law = make("lqr", guarded.unwrapped.design_scene.turbine, 0.1)
    law.prepare(FowtEnv(**ON_LQR, **QUICK).scene)
    assert np.array_equal(guarded._baseline.parameters, law.parameters)


BY_NAME = {"observation": ("rotor_speed", "platform_pitch"), "sensors": "standard"}


@pytest.mark.parametrize(
    "settings", [SHIFTED | {"sensors": DEGRADED, "nominal_plant": NOMINAL}, BY_NAME], ids=["noise", "chain"]
)
def test_environment_and_run_give_a_controller_the_same_readings(settings):
    """sensors of FowtEnv, and a chain or noise of simulate: the same numbers for the same weather."""
    env = FowtEnv(action_mode="direct", **settings, **QUICK)
    env.reset(options={"wind": QUICK["wind"], "sea": None, "weather_seed": 5, "offsets": {}})
    known = build_scene(wind=QUICK["wind"], seed=5, fidelity="standard", rotor="table")
    noise = perturbed_sensors(PlantPerturbation(**DEGRADED), known.turbine, 0.1)
    told = {"sensors": "standard"} if settings is BY_NAME else {"nominal": known, "sensors": noise}
    kept = []

    class Watched:
        def __init__(self):
            self.law = make("gspi_oc3", known.turbine, 0.1)
            self.reset = self.law.reset
            if settings is not BY_NAME:
                self.information = Measurement._fields

        def act(self, measurement):
            kept.append(np.array(measurement))
            return self.law.act(measurement)

    simulate(env.scene, Watched(), duration=3.0, **told)
    law = make("gspi_oc3", env.scene.turbine, 0.1)
    law.reset(env.measurement())
    for reading in kept:
        seen = env.measurement()
        shown = np.isfinite(reading)
        assert shown.any() and (settings is BY_NAME or shown.all())
        np.testing.assert_allclose(np.array(seen)[shown], reading[shown], rtol=1e-9, atol=1e-9)
        env.step_physical(*law.act(seen))
    assert np.isnan(env.measurement().surge) == (settings is BY_NAME)  # which no sensor of the chain shows


def test_a_preview_baseline_is_given_the_wind_ahead_as_in_a_run():
    env = FowtEnv(action_mode="residual", baseline="preview", observation=("rotor_speed",), **QUICK)
    env.reset(seed=4)
    start = dict(zip(("torque", "pitch"), env.view().in_force, strict=True))
    pitch = []
    for _ in range(60):
        env.step(np.zeros(2))
        pitch.append(env.view().in_force[1])
    law = make("preview", env.scene.turbine, 0.1)
    hand = FowtEnv(action_mode="direct", observation=("rotor_speed",), **QUICK)
    hand.reset(seed=4)
    law.prepare(hand.scene)
    law.reset(hand.measurement(law.preview_times))
    for wanted in pitch:
        command = law.act(hand.measurement(law.preview_times))
        assert command[1] == pytest.approx(wanted, rel=1e-9)
        hand.step_physical(*command)
    assert np.ptp([start["pitch"], *pitch]) > 1e-3


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (BY_NAME | {"observation": ("surge",)}, "'surge': is not measured by the sensor chain 'standard'"),
        ({"sensors": "standart"}, "unknown sensor chain"),
        ({"sensors": 0.02}, "must be a dict with noise and delay"),
        ({"sensors": {"nosie": 0.02}}, "Did you mean 'noise'"),
        ({"sensors": {"noise": -0.1}}, r"sensors.noise = -0.1"),
        ({"sensors": {"noise": float("nan")}}, r"sensors.noise = nan"),
        ({"sensors": {"delay": 1.5}}, r"sensors.delay = 1.5"),
        ({"sensors": {"delay": True}}, r"sensors.delay = True"),
        ({"designed_on": {"platform": "oc3_hywind"}}, "'designed_on' of FowtEnv: is called nominal_plant"),
        ({"nominal_plant": "oc3_hywind"}, "must be a dict with platform"),
        ({"nominal_plant": {"turbine": None}}, "must be a dict with platform"),
        ({"nominal_plant": {"platform": "oc3_hywind", "sea": 1}}, "unknown key of nominal_plant 'sea'"),
    ],
)
def test_what_cannot_be_used_is_named(settings, message):
    with pytest.raises(InputError, match=message):
        FowtEnv(**settings, **QUICK)
