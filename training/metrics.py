"""What one run is judged by, computed from its OpenFAST-named columns."""

import numpy as np

from fowt_env.errors import InputError

TIME = "Time_[s]"
# channel -> statistics; a channel that a run lacks (mooring without lines) gives NaN
STATISTICS = {
    "Wind1VelX_[m/s]": ("mean", "std"),
    "Wave1Elev_[m]": ("std",),
    "RotSpeed_[rpm]": ("mean", "std", "min", "max"),
    "GenPwr_[kW]": ("mean", "std", "min", "max"),
    "PtfmPitch_[deg]": ("mean", "std", "min", "max"),
    "PtfmSurge_[m]": ("mean", "std", "min", "max"),
    "BldPitch1_[deg]": ("mean", "std", "min", "max"),
    "TwrBsMyt_[kN-m]": ("std", "max"),
    "NcIMUTAxs_[m/s^2]": ("rms",),
}
REQUIRED = (
    TIME,
    "RotSpeed_[rpm]",
    "GenPwr_[kW]",
    "PtfmPitch_[deg]",
    "PtfmSurge_[m]",
    "BldPitch1_[deg]",
    "GenTq_[kN-m]",
)
REDUCTIONS = {
    "mean": np.mean,
    "std": np.std,
    "min": np.min,
    "max": np.max,
    "rms": lambda x: np.sqrt(np.mean(x**2)),
}


def _metric_name(channel, statistic):
    """ "RotSpeed_[rpm]", "std" -> "RotSpeed_std_[rpm]"."""
    name, unit = channel.split("_[")
    return f"{name}_{statistic}_[{unit}"


METRICS = (
    *(_metric_name(channel, s) for channel, statistics in STATISTICS.items() for s in statistics),
    "overspeed_[%]",
    "blade_pitch_travel_[deg/s]",
    "torque_travel_[kN-m/s]",
    "FAIRTEN_std_[kN]",
    "FAIRTEN_max_[kN]",
)


def travel(time, value):
    """Mean absolute rate of a signal: the sum of its steps' sizes per second."""
    return float(np.sum(np.abs(np.diff(value))) / (time[-1] - time[0]))


def metrics(df, skip=0.0, rated_speed_rpm=12.1):
    """{metric: value} of a run, in the order and with the names of METRICS.

    df               output of simulate: evenly spaced rows
    skip             seconds at the start that are left out (start-up transient)
    rated_speed_rpm  overspeed is the greatest rotor speed above this, in percent of it
    Standard deviations are about the run's own mean (N in the denominator). Travel is the sum of
    absolute steps per second. FAIRTEN: the line for which the figure is greatest.
    Raises: InputError for missing columns or if skip leaves fewer than two rows.
    """
    missing = [name for name in REQUIRED if name not in df.columns]
    if missing:
        raise InputError(f"metrics: the run lacks the columns {', '.join(missing)}")
    if not skip >= 0.0:
        raise InputError(f"skip = {skip}: must be 0 or more seconds")
    time = df[TIME].to_numpy()
    kept = df[time >= (time[0] + skip - 1e-9)] if len(time) else df
    if len(kept) < 2:
        length = time[-1] - time[0] if len(time) else 0.0
        raise InputError(f"skip = {skip} s: leaves fewer than two rows of a run of {length:g} s")
    time = kept[TIME].to_numpy()
    result = {}
    for channel, statistics in STATISTICS.items():
        values = kept[channel].to_numpy() if channel in kept.columns else None
        for statistic in statistics:
            value = np.nan if values is None else REDUCTIONS[statistic](values)
            result[_metric_name(channel, statistic)] = float(value)
    fastest = result["RotSpeed_max_[rpm]"]
    # a plain max() would turn NaN into 0
    result["overspeed_[%]"] = float(np.maximum(0.0, 100.0 * (fastest / rated_speed_rpm - 1.0)))
    result["blade_pitch_travel_[deg/s]"] = travel(time, kept["BldPitch1_[deg]"].to_numpy())
    result["torque_travel_[kN-m/s]"] = travel(time, kept["GenTq_[kN-m]"].to_numpy())
    lines = kept[[name for name in kept.columns if name.startswith("FAIRTEN")]].to_numpy()
    result["FAIRTEN_std_[kN]"] = float(lines.std(axis=0).max()) if lines.size else np.nan
    result["FAIRTEN_max_[kN]"] = float(lines.max()) if lines.size else np.nan
    return {name: result[name] for name in METRICS}
