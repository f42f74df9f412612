"""What the metrics of a run mean, in words, for lists, tables and reports."""

from fowt_env.descriptions.channel_meanings import channel_meaning
from fowt_env.training.evaluation.metrics import METRICS, better

STATISTICS = {
    "mean": "mean",
    "std": "standard deviation",
    "min": "least value",
    "max": "greatest value",
    "rms": "root mean square",
}
FATIGUE = "1 Hz damage-equivalent load"
MEANINGS = {
    "overspeed_[%]": "greatest rotor speed over rated",
    "energy_[kWh]": "electrical energy, power counted up to rated",
    "GenPwr_capped_mean_[kW]": "mean electrical power, counted up to rated",
    "blade_pitch_travel_[deg/s]": "mean absolute blade-pitch rate",
    "actuator_duty_[%]": "mean absolute blade-pitch rate over the drive's limit",
    "torque_travel_[kN-m/s]": "mean absolute rate of the generator torque",
    "torque_limited_[s]": "time with the generator torque at a range or rate limit",
    "FAIRTEN_std_[kN]": "standard deviation of the fairlead tension, worst line",
    "FAIRTEN_max_[kN]": "greatest fairlead tension of all lines",
    "TwrBsMyt_DEL_[kN-m]": f"{FATIGUE} of the fore-aft tower-base moment, m = 4 (welded steel)",
    "RotTorq_DEL_[kN-m]": f"{FATIGUE} of the low-speed shaft torque, m = 4",
    "FAIRTEN_DEL_[kN]": f"{FATIGUE} of the worst fairlead, m = 3 (chain)",
    "RootMyc_DEL_[kN-m]": f"{FATIGUE} of the worst blade root out of the rotor plane, m = 10",
    "RootMxc_DEL_[kN-m]": f"{FATIGUE} of the worst blade root in the rotor plane, m = 10",
    "LSSTipMys_DEL_[kN-m]": f"{FATIGUE} of the hub's tilt moment, non-rotating, m = 4",
    "LSSTipMzs_DEL_[kN-m]": f"{FATIGUE} of the hub's yaw moment, non-rotating, m = 4",
    "YawBrMyp_DEL_[kN-m]": f"{FATIGUE} of the yaw bearing's tilt moment, m = 4",
    "YawBrMzp_DEL_[kN-m]": f"{FATIGUE} of the yaw bearing's yaw moment, m = 4",
    "each_blade_travel_[deg/s]": "mean absolute pitch rate of single blades, mean of the three",
    "PtfmSway_std_[m]": "standard deviation of the platform's sway",
    "blade_pitch_rate_beyond_[s]": "time with a blade-pitch rate above 10 deg/s",
    "blade_pitch_rate_violations_[-]": "how often the blade-pitch rate passes 10 deg/s",
    "tower_top_acceleration_beyond_[s]": "time with a tower-top acceleration above 3.3 m/s2",
    "tower_top_acceleration_violations_[-]": "how often the tower-top acceleration passes 3.3 m/s2",
    "rotor_speed_beyond_[s]": "time with a rotor speed above 1.3 times rated",
    "rotor_speed_violations_[-]": "how often the rotor speed passes 1.3 times rated",
    "RotSpeed_offset_[%]": "steady wind: distance of the final mean rotor speed from rated",
    "BldPitch_oscillation_[deg]": "steady wind: peak-to-peak blade pitch of the last 100 s",
    "settling_time_[s]": "time from a gust until the rotor speed stays within 5 % of its final mean",
    "standstill_time_[s]": "time from a stop until the rotor stays below 10 % of rated speed",
}
BETTER = {-1: "lower", 0: "", 1: "higher"}


def metric_meaning(metric):
    """Text of what a metric of METRICS is; its unit is in its name."""
    if metric in MEANINGS:
        return MEANINGS[metric]
    channel, statistic = metric.partition("_[")[0].rsplit("_", 1)
    return f"{channel_meaning(channel)}: {STATISTICS[statistic]}"


def metric_table():
    """[(name, unit, meaning, "lower", "higher" or "" of which is better)] of all METRICS, in their order."""
    rows = []
    for metric in METRICS:
        name, unit = metric.rstrip("]").split("_[")
        rows.append((name, unit, metric_meaning(metric), BETTER[better(metric)]))
    return rows
