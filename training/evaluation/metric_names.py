"""Defines the short names of metrics in tables, pages and messages."""

SHORT = {
    "RotSpeed_std_[rpm]": "rotor-speed std",
    "PtfmPitch_std_[deg]": "platform-pitch std",
    "blade_pitch_travel_[deg/s]": "pitch travel",
    "GenPwr_std_[kW]": "power std",
    "torque_travel_[kN-m/s]": "torque travel",
    "RotTorq_DEL_[kN-m]": "shaft-torque DEL",
    "TwrBsMyt_DEL_[kN-m]": "tower-base DEL",
    "GenPwr_capped_mean_[kW]": "power up to rated",
    "GenPwr_max_[kW]": "maximum power",
}
FURTHER = {  # of metrics that are no columns of the page from the start
    "RotSpeed_max_[rpm]": "maximum rotor speed",
    "FAIRTEN_DEL_[kN]": "mooring DEL",
    "RootMyb_DEL_[kN-m]": "blade-root DEL",
    "rotor_speed_above_limit_[s]": "time above 1.3 times rated speed",
    "blade_pitch_rate_above_limit_[s]": "time above 10 deg/s of blade pitch",
    "tower_top_acceleration_above_limit_[s]": "time above 3.3 m/s² of tower top",
    "RotSpeed_mean_[rpm]": "mean rotor speed",
    "GenTq_mean_[kN-m]": "mean generator torque",
    "GenPwr_mean_[kW]": "mean power",
    "PtfmPitch_max_[deg]": "maximum platform pitch",
    "each_blade_travel_[deg/s]": "pitch travel of each blade",
    "PitchBrg_DEL_[kN-m]": "pitch-bearing DEL",
    "RotSpeed_offset_[%]": "settled rotor-speed offset",
    "BldPitch_oscillation_[deg]": "settled blade-pitch oscillation",
}


def short_name(metric):
    """Return the short name of a metric, such as "rotor-speed std", else the metric's name in words."""
    return (SHORT | FURTHER).get(metric, metric.partition("_[")[0].replace("_", " "))
