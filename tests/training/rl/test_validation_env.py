"""What validation records of its episodes, against single environments."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from fowt_env.envs import FowtEnv
from fowt_env.training.evaluation.metrics import turbine_metrics
from fowt_env.training.rl import validation_env
from fowt_env.training.rl.validation_env import ValidationVecEnv

QUICK = {"rotor": "table", "wave_components": 10, "wind": 18.0, "duration": 8.0}


def test_the_figures_of_validation_are_the_metrics_of_its_episodes():
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 10.0}
    episodes = [
        {"wind": {"kind": "ntm", "speed": speed, "class": "B"}, "sea": sea, "weather_seed": 1001}
        for speed in (14.0, 20.0)
    ]
    skip, dt = 5.0, 0.1
    settings = {name: value for name, value in QUICK.items() if name != "wind"} | {"duration": 20.0}
    settings |= {"action_mode": "residual", "baseline": "gspi_oc3"}
    env = ValidationVecEnv(episodes, skip, threads=1, **settings)
    env.reset()
    for _ in range(200):
        env.step(np.zeros((2, 2)))
    assert env.over
    figures = env.figures()
    names = {
        "rotor_speed_std_[rpm]": "RotSpeed_std_[rpm]",
        "platform_pitch_std_[deg]": "PtfmPitch_std_[deg]",
        "blade_pitch_travel_[deg/s]": "blade_pitch_travel_[deg/s]",
        "shaft_power_mean_[kW]": "GenPwr_mean_[kW]",
        "shaft_power_std_[kW]": "GenPwr_std_[kW]",
        "torque_travel_[kN-m/s]": "torque_travel_[kN-m/s]",
    }
    others = {"shaft_torque_DEL_[kN-m]", "capped_power_mean_[kW]", "failed"}
    late = {"rotor_speed_offset_[%]", "blade_pitch_swing_[deg]"}  # of the time after 300 s
    assert {*names, *others, *late} == set(figures)
    assert all(np.all(np.isnan(figures[name])) for name in late)
    for i, one in enumerate(env.env.envs):
        single = FowtEnv(record=True, **settings)
        single.reset(seed=i, options=episodes[i] | {"offsets": {}})
        for _ in range(200):
            single.step(np.zeros(2))
        frame = single.frame().iloc[round(skip / dt) :].reset_index(drop=True)
        found = turbine_metrics(frame, one.scene.turbine)
        losses = one.scene.turbine.drivetrain.generator_efficiency
        for name, metric in names.items():
            factor = losses if name.startswith("shaft_power") else 1.0
            assert factor * figures[name][i] == pytest.approx(found[metric], rel=1e-12), name
        # the shaft's acceleration is that between control periods, and its bearing losses are left out
        assert figures["shaft_torque_DEL_[kN-m]"][i] == pytest.approx(found["RotTorq_DEL_[kN-m]"], rel=0.05)
        power = frame["GenPwr_[kW]"].to_numpy() / losses
        capped = np.minimum(power, 1e-3 * one.scene.turbine.torque_law.rated_power).mean()
        assert figures["capped_power_mean_[kW]"][i] == pytest.approx(capped, rel=1e-12)


def test_rest_in_steady_wind_is_judged_after_300_s(monkeypatch):
    monkeypatch.setattr(validation_env, "SETTLED_AFTER", 5.0)
    monkeypatch.setattr(validation_env, "SWING_AFTER", 6.0)
    env = ValidationVecEnv([{"wind": 18.0, "weather_seed": 1001}], 1.0, threads=1, **QUICK)
    env.reset()
    turbine = env.env.envs[0].scene.turbine
    time = 0.1 * np.arange(len(env._record))
    env._record[:] = 0.0
    env._record[:, 0, 0] = turbine.rated_rotor_speed * np.where(
        time < 5.0, 1.2, 0.997 + 0.01 * (-1.0) ** np.arange(81)
    )
    env._record[:, 0, 2] = np.where(time < 6.0, 0.1, 0.001 * np.sin(20.0 * time))
    figures = env.figures()
    assert figures["rotor_speed_offset_[%]"] == pytest.approx([0.3], abs=0.05)
    assert figures["blade_pitch_swing_[deg]"] == pytest.approx([np.rad2deg(0.002)], rel=0.05)
