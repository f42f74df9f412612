import numpy as np
import pandas as pd
import pytest

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.evaluation.metrics import (
    METRICS,
    STATISTICS,
    damage_equivalent_load,
    mean_exponent,
    metrics,
    travel,
    turbine_metrics,
)

pytestmark = pytest.mark.installation


def synthetic_run(duration=100.0, dt=0.1, **columns):
    """A run with constant channels, except for those given."""
    time = np.arange(round(duration / dt) + 1) * dt
    constants = {
        "RotSpeed_[rpm]": 12.1,
        "GenPwr_[kW]": 5000.0,
        "PtfmPitch_[deg]": 2.0,
        "PtfmSurge_[m]": 12.0,
        "BldPitch1_[deg]": 14.9,
        "GenTq_[kN-m]": 43.1,
        "FAIRTEN1_[kN]": 900.0,
        "FAIRTEN2_[kN]": 900.0,
    }
    data = {"Time_[s]": time}
    for name, value in (constants | columns).items():
        data[name] = value(time) if callable(value) else np.full_like(time, value)
    return pd.DataFrame(data)


def test_constant_channels_have_their_mean_and_no_spread_or_travel():
    result = metrics(synthetic_run())
    assert result["RotSpeed_mean_[rpm]"] == pytest.approx(12.1, rel=1e-12)
    assert result["PtfmPitch_min_[deg]"] == result["PtfmPitch_max_[deg]"] == 2.0
    for name in ("RotSpeed_std_[rpm]", "GenPwr_std_[kW]", "FAIRTEN_std_[kN]"):
        assert result[name] == pytest.approx(0.0, abs=1e-9)
    assert result["blade_pitch_travel_[deg/s]"] == 0.0
    assert result["torque_travel_[kN-m/s]"] == 0.0


def test_sine_has_the_known_standard_deviation_and_travel():
    # 10 whole periods of 10 s with amplitude 3: std 3/sqrt(2), travel 4 * 3 per period
    run = synthetic_run(**{"BldPitch1_[deg]": lambda t: 10.0 + 3.0 * np.cos(2.0 * np.pi * t / 10.0)})
    result = metrics(run)
    # the closing row repeats the first one: one row in 1001
    assert result["BldPitch1_std_[deg]"] == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-3)
    assert result["blade_pitch_travel_[deg/s]"] == pytest.approx(1.2, rel=1e-12)


def test_deviations_are_about_the_mean_with_n_in_the_denominator():
    names = ("RotSpeed_[rpm]", "PtfmSway_[m]", "FAIRTEN2_[kN]")
    result = metrics(synthetic_run(duration=0.3, **dict.fromkeys(names, lambda t: 12.0 + 10.0 * t)))
    for name in ("RotSpeed_std_[rpm]", "PtfmSway_std_[m]", "FAIRTEN_std_[kN]"):
        assert result[name] == pytest.approx(np.sqrt(1.25), rel=1e-12)


def test_what_is_skipped_counts_from_the_first_row_whatever_its_time():
    run = synthetic_run(**{"RotSpeed_[rpm]": lambda t: np.where(t < 19.95, 5.0, 12.0)})
    for start in (0.0, 100.0):
        moved = run.assign(**{"Time_[s]": run["Time_[s]"] + start})
        assert metrics(moved, skip=20.0)["RotSpeed_min_[rpm]"] == 12.0
        assert metrics(moved, skip=19.9)["RotSpeed_min_[rpm]"] == 5.0


def test_ramp_travels_at_its_slope_whatever_the_output_step():
    for dt in (0.05, 0.5):
        result = metrics(synthetic_run(dt=dt, **{"GenTq_[kN-m]": lambda t: 40.0 - 0.02 * t}))
        assert result["torque_travel_[kN-m/s]"] == pytest.approx(0.02, rel=1e-9)


def test_the_time_at_the_generator_s_limits_is_that_of_the_scored_rows():
    at_limit = synthetic_run(**{"GenTqLim_[-]": lambda t: 1.0 * ((t > 19.95) & (t < 40.05))})
    assert metrics(at_limit)["torque_limited_[s]"] == pytest.approx(20.1)
    assert metrics(at_limit, skip=30.0)["torque_limited_[s]"] == pytest.approx(10.1)
    assert np.isnan(metrics(synthetic_run())["torque_limited_[s]"])


def test_overspeed_is_the_excess_over_rated_in_percent():
    fast = synthetic_run(**{"RotSpeed_[rpm]": lambda t: 12.1 + 1.21 * (t == 50.0)})
    assert metrics(fast)["overspeed_[%]"] == pytest.approx(10.0, rel=1e-9)
    assert metrics(fast, rated_speed_rpm=13.31)["overspeed_[%]"] == pytest.approx(0.0, abs=1e-9)
    assert metrics(synthetic_run(**{"RotSpeed_[rpm]": 9.0}))["overspeed_[%]"] == 0.0


def test_fairlead_figures_are_those_of_the_worst_line():
    result = metrics(
        synthetic_run(**{"FAIRTEN2_[kN]": lambda t: 800.0 + 20.0 * np.where(t % 2.0 < 0.95, 1.0, -1.0)})
    )
    assert result["FAIRTEN_std_[kN]"] == pytest.approx(20.0, rel=1e-2)
    assert result["FAIRTEN_max_[kN]"] == 900.0


def test_the_load_of_a_pitch_bearing_counts_travel_once_and_the_resultant_moment_cubed():
    flat = dict.fromkeys((f"RootMyc{i}_[kN-m]" for i in (1, 2)), lambda t: 3e3 + 0.0 * t)
    flat |= dict.fromkeys((f"RootMxc{i}_[kN-m]" for i in (1, 2)), lambda t: -4e3 + 0.0 * t)
    other = {"RootMyc3_[kN-m]": lambda t: 1e3 + 0.0 * t, "RootMxc3_[kN-m]": lambda t: 0.0 * t}
    turning = {f"BldPitch{i}_[deg]": lambda t, i=i: 2.0 * i * np.abs(t % 10.0 - 5.0) for i in (1, 2, 3)}
    result = metrics(synthetic_run(**flat, **other, **turning))  # 2, 4 and 6 deg/s
    assert result["PitchBrg_DEL_[kN-m]"] == pytest.approx(5e3 * 4.0 ** (1.0 / 3.0), rel=1e-9)
    assert mean_exponent("PitchBrg_DEL_[kN-m]") == 3.0


def test_figures_of_single_blades_are_those_of_the_worst_blade_and_absent_without_them():
    names = [f"{name}{i}_[kN-m]" for name in ("RootMyc", "RootMxc", "RootMyb") for i in (1, 2, 3)]
    waves = {
        name: lambda t, a=i + 1.0: 1e3 * a * np.cos(2.0 * np.pi * t / 5.0) for i, name in enumerate(names)
    }
    waves |= {
        f"BldPitch{i}_[deg]": lambda t, i=i: 10.0 + i * np.cos(2.0 * np.pi * t / 10.0) for i in (1, 2, 3)
    }
    waves["LSSTipMya_[kN-m]"] = lambda t: 250.0 * np.cos(2.0 * np.pi * t / 5.0)
    waves["YawBrMzp_[kN-m]"] = lambda t: 500.0 * np.cos(2.0 * np.pi * t / 5.0)
    result = metrics(synthetic_run(**waves))
    # 20 cycles of the range 2 A in 100 s, exponent m: 2 A (20/100)^(1/m)
    assert result["RootMyc_DEL_[kN-m]"] == pytest.approx(6e3 * 0.2**0.1, rel=1e-9)
    assert result["RootMxc_DEL_[kN-m]"] == pytest.approx(12e3 * 0.2**0.1, rel=1e-9)
    assert result["RootMyb_DEL_[kN-m]"] == pytest.approx(18e3 * 0.2**0.1, rel=1e-9)
    assert result["YawBrMzp_DEL_[kN-m]"] == pytest.approx(1e3 * 0.2**0.25, rel=1e-9)
    assert result["LSSTipMya_DEL_[kN-m]"] == pytest.approx(500.0 * 0.2**0.25, rel=1e-9)
    assert result["each_blade_travel_[deg/s]"] == pytest.approx(
        0.8, rel=1e-9
    )  # 4 A a period, A = 2 on the mean
    assert np.isnan(metrics(synthetic_run())["RootMyc_DEL_[kN-m]"])
    assert np.isnan(metrics(synthetic_run())["each_blade_travel_[deg/s]"])
    assert np.isnan(metrics(synthetic_run())["PitchBrg_DEL_[kN-m]"])
    assert mean_exponent("RootMxc_DEL_[kN-m]") == 10.0 and mean_exponent("YawBrMzp_DEL_[kN-m]") == 4.0


def test_channels_that_a_run_lacks_are_nan_and_the_names_never_change():
    run = synthetic_run().drop(columns=["FAIRTEN1_[kN]", "FAIRTEN2_[kN]"])
    result = metrics(run)
    assert tuple(result) == METRICS
    assert np.isnan(result["FAIRTEN_max_[kN]"]) and np.isnan(result["NcIMUTAxs_rms_[m/s^2]"])


def test_a_nan_in_the_run_is_not_hidden():
    result = metrics(synthetic_run(**{"RotSpeed_[rpm]": lambda t: np.where(t == 5.0, np.nan, 12.0)}))
    assert np.isnan(result["RotSpeed_mean_[rpm]"]) and np.isnan(result["overspeed_[%]"])


def test_wrong_input_is_named():
    with pytest.raises(InputError, match=r"RotSpeed_\[rpm\]"):
        metrics(synthetic_run().drop(columns="RotSpeed_[rpm]"))
    with pytest.raises(InputError, match="skip = 100"):
        metrics(synthetic_run(), skip=100.0)
    for skip in (-1.0, float("nan")):
        with pytest.raises(InputError, match="skip = "):
            metrics(synthetic_run(), skip=skip)


def test_power_beyond_rated_is_no_energy_and_a_lull_is_not_made_up_for():
    swing = synthetic_run(**{"GenPwr_[kW]": lambda t: 5000.0 + 1000.0 * np.where(t % 2.0 < 0.95, 1.0, -1.0)})
    result = metrics(swing)
    share = np.mean(swing["GenPwr_[kW]"] > 5000.0)
    assert result["GenPwr_mean_[kW]"] == pytest.approx(4000.0 + 2000.0 * share)
    assert result["GenPwr_capped_mean_[kW]"] == pytest.approx(4000.0 + 1000.0 * share)
    assert result["energy_[kWh]"] == pytest.approx(
        result["GenPwr_capped_mean_[kW]"] * 100.0 / 3600.0, rel=1e-2
    )
    assert metrics(swing, rated_power_kW=7000.0)["GenPwr_capped_mean_[kW]"] == result["GenPwr_mean_[kW]"]
    turbine = read_turbine("nrel5mw")  # 5.29661 MW of the shaft make 5 MW
    above = turbine_metrics(synthetic_run(**{"GenPwr_[kW]": 9000.0}), turbine)
    assert above["GenPwr_capped_mean_[kW]"] == pytest.approx(5000.0, rel=1e-6)


def test_offset_and_oscillation_are_those_of_the_end_of_a_steady_run_alone():
    columns = {
        "RotSpeed_[rpm]": lambda t: np.where(t < 300.0, 20.0, 0.98 * 12.1),
        "BldPitch1_[deg]": lambda t: 10.0 + np.where(t < 500.0, 3.0, 0.1) * np.sin(2.0 * np.pi * t / 40.0),
    }
    run = synthetic_run(duration=600.0, **columns)
    result = metrics(run, steady=True)
    assert result["RotSpeed_offset_[%]"] == pytest.approx(2.0, rel=1e-2)  # either way counts
    assert result["BldPitch_oscillation_[deg]"] == pytest.approx(0.2, rel=1e-2)
    assert np.isnan(metrics(run)["RotSpeed_offset_[%]"]) and np.isnan(result["settling_time_[s]"])


def test_a_gust_is_over_where_the_rotor_stays_within_5_percent_of_where_it_ends():
    speed = {"RotSpeed_[rpm]": lambda t: 12.1 + 2.42 * np.exp(-(t - 200.0) / 50.0) * (t >= 200.0)}
    run = synthetic_run(duration=600.0, **speed)
    expected = 50.0 * np.log(2.42 / 0.605)  # the end is at 12.1 within 0.01 rpm
    assert metrics(run, skip=150.0, gust_start=200.0)["settling_time_[s]"] == pytest.approx(expected, abs=1.0)
    early = synthetic_run(duration=300.0, **{"RotSpeed_[rpm]": lambda t: np.where(t < 150.0, 20.0, 12.1)})
    assert metrics(early, gust_start=200.0)["settling_time_[s]"] == 0.0  # away before the gust alone


# ------------------------------------------------------------------ fatigue and constraints


@pytest.mark.parametrize("exponent", [3.0, 4.0, 10.0])
def test_whole_cycles_of_one_range_have_the_load_of_their_frequency(exponent):
    # 100 cycles of range 6 in 50 s, by hand: (100 * 6^m / 50)^(1/m); at 1 Hz it is the range itself
    points = np.tile([3.0, -3.0], 100)
    series = np.append(points, 3.0)
    expected = 6.0 * (100.0 / 50.0) ** (1.0 / exponent)
    assert damage_equivalent_load(series, 50.0, exponent) == pytest.approx(expected, rel=1e-12)
    assert damage_equivalent_load(series, 100.0, exponent) == pytest.approx(6.0, rel=1e-12)


def test_the_example_of_the_standard_has_its_counted_cycles():
    # ASTM E1049-85, figure 6: half cycles of 3, 4, 8, 9, 8, 6 and one whole cycle of 4
    series = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
    damage = 0.5 * (3.0**4 + 4.0**4 + 8.0**4 + 9.0**4 + 8.0**4 + 6.0**4) + 4.0**4
    assert damage_equivalent_load(series, 1.0, 4.0) == pytest.approx(damage**0.25, rel=1e-12)


def test_a_small_cycle_inside_a_large_one_is_counted_apart():
    # rainflow sees the swing 0 to 10 and, within it, 6 to 4; plain peak counting would not
    series = [0.0, 6.0, 4.0, 10.0, 0.0]
    damage = 2.0**3 + 0.5 * (10.0**3 + 10.0**3)
    assert damage_equivalent_load(series, 2.0, 3.0) == pytest.approx((damage / 2.0) ** (1.0 / 3.0), rel=1e-12)


def test_a_constant_load_does_no_damage_and_a_broken_one_is_nan():
    assert damage_equivalent_load(np.full(100, 7.0), 10.0, 4.0) == 0.0
    assert np.isnan(damage_equivalent_load([0.0, np.nan, 1.0], 2.0, 4.0))


def test_the_metrics_hold_the_loads_of_tower_and_worst_line():
    run = synthetic_run(
        **{
            "TwrBsMyt_[kN-m]": lambda t: 5e4 + 1e4 * np.cos(2.0 * np.pi * t / 5.0),
            "FAIRTEN2_[kN]": lambda t: 900.0 + 50.0 * np.cos(2.0 * np.pi * t / 10.0),
        }
    )
    result = metrics(run)
    assert result["TwrBsMyt_DEL_[kN-m]"] == pytest.approx(2e4 * 0.2 ** (1 / 4), rel=1e-9)
    assert result["FAIRTEN_DEL_[kN]"] == pytest.approx(100.0 * 0.1 ** (1 / 3), rel=1e-9)
    assert np.isnan(result["RotTorq_DEL_[kN-m]"])


def test_energy_is_the_integral_of_power_and_duty_the_share_of_the_rate_limit():
    run = synthetic_run(**{"GenPwr_[kW]": lambda t: 36.0 * t, "BldPitch1_[deg]": lambda t: 0.4 * t})
    result = metrics(run)
    assert result["energy_[kWh]"] == pytest.approx(36.0 * 0.5 * 100.0**2 / 3600.0, rel=1e-9)
    assert result["actuator_duty_[%]"] == pytest.approx(5.0, rel=1e-9)


def test_constraint_violations_are_counted_and_timed():
    run = synthetic_run(
        **{
            "RotSpeed_[rpm]": lambda t: np.where(((t > 9.95) & (t < 14.95)) | (t > 89.95), 16.0, 12.0),
            "NcIMUTAxs_[m/s^2]": lambda t: np.where(np.abs(t - 50.0) < 0.55, -3.0, 0.0),
            "NcIMUTAys_[m/s^2]": lambda t: np.where(np.abs(t - 50.0) < 0.55, 2.0, 0.0),
            "BldPitch1_[deg]": lambda t: 5.0 + 1.5 * (t > 30.05),
        }
    )
    result = metrics(run)
    assert result["rotor_speed_violations_[-]"] == 2
    assert result["rotor_speed_above_limit_[s]"] == pytest.approx(15.1)
    assert result["tower_top_acceleration_violations_[-]"] == 1  # 3.6 m/s2 in both directions together
    assert result["tower_top_acceleration_above_limit_[s]"] == pytest.approx(1.1)
    assert result["blade_pitch_rate_violations_[-]"] == 1  # 15 deg/s for one row
    assert result["blade_pitch_rate_above_limit_[s]"] == pytest.approx(0.1)


def test_a_limit_is_not_passed_by_touching_it():
    result = metrics(synthetic_run(**{"RotSpeed_[rpm]": 1.3 * 12.1, "NcIMUTAxs_[m/s^2]": 3.3}))
    assert result["rotor_speed_violations_[-]"] == result["tower_top_acceleration_above_limit_[s]"] == 0.0


def test_several_runs_beside_each_other_have_the_figures_of_each():
    time = np.linspace(0.0, 50.0, 501)
    runs = np.random.default_rng(0).normal(size=(501, 3)).cumsum(axis=0)
    for name, reduce in ((name, row.of) for name, row in STATISTICS.items()):
        assert reduce(runs) == pytest.approx([reduce(run) for run in runs.T], rel=1e-12), name
    assert travel(time, runs) == pytest.approx([travel(time, run) for run in runs.T], rel=1e-12)


def test_a_turbine_brings_its_rated_speed_and_the_rate_of_its_pitch_drive():
    run = synthetic_run(**{"RotSpeed_[rpm]": 13.31, "BldPitch1_[deg]": lambda t: 4.0 + 0.08 * t})
    found = turbine_metrics(run, read_turbine("nrel5mw"), skip=10.0)  # 12.1 rpm, 8 deg/s
    assert found["overspeed_[%]"] == pytest.approx(10.0) and found["actuator_duty_[%]"] == pytest.approx(1.0)
    assert found == pytest.approx(metrics(run, 10.0, 12.1, 8.0), nan_ok=True)
