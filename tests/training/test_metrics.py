import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from training.metrics import METRICS, metrics


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


def test_ramp_travels_at_its_slope_whatever_the_output_step():
    for dt in (0.05, 0.5):
        result = metrics(synthetic_run(dt=dt, **{"GenTq_[kN-m]": lambda t: 40.0 - 0.02 * t}))
        assert result["torque_travel_[kN-m/s]"] == pytest.approx(0.02, rel=1e-9)


def test_rms_keeps_the_mean_and_std_does_not():
    result = metrics(synthetic_run(**{"NcIMUTAxs_[m/s^2]": 0.5, "TwrBsMyt_[kN-m]": 7e4}))
    assert result["NcIMUTAxs_rms_[m/s^2]"] == pytest.approx(0.5, rel=1e-12)
    assert result["TwrBsMyt_std_[kN-m]"] == pytest.approx(0.0, abs=1e-6)


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


def test_skipped_seconds_do_not_count():
    run = synthetic_run(**{"PtfmPitch_[deg]": lambda t: np.where(t < 20.0, 9.0, 2.0)})
    assert metrics(run)["PtfmPitch_max_[deg]"] == 9.0
    assert metrics(run, skip=20.0)["PtfmPitch_max_[deg]"] == 2.0
    assert metrics(run, skip=20.0)["PtfmPitch_std_[deg]"] == 0.0


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
