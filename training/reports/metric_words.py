"""Short names of the metrics that reports lead with, and what a reader is told of any metric."""

from fowt_env.training.evaluation.metrics import TABLE, better

SHORT = {
    "RotSpeed_std_[rpm]": "rotor-speed std",
    "PtfmPitch_std_[deg]": "platform-pitch std",
    "blade_pitch_travel_[deg/s]": "pitch travel",
    "torque_travel_[kN-m/s]": "torque travel",
    "RotTorq_DEL_[kN-m]": "shaft-torque DEL",
    "TwrBsMyt_DEL_[kN-m]": "tower-base DEL",
    "GenPwr_capped_mean_[kW]": "capped power",
    "GenPwr_max_[kW]": "greatest power",
}
DIRECTIONS = {-1: "Less is better.", 0: "Neither more nor less is better by itself.", 1: "More is better."}


def short_name(metric):
    """ "rotor-speed std" for "RotSpeed_std_[rpm]"; of a metric without a short name its own, in words."""
    return SHORT.get(metric, metric.partition("_[")[0].replace("_", " "))


def about_metric(metric):
    """What a metric is, its unit and which direction is better, in sentences; of an unknown one its name."""
    name, _, unit = metric.partition("_[")
    meaning = TABLE[metric].meaning if metric in TABLE else name.replace("_", " ")
    return f"{meaning[:1].upper()}{meaning[1:]}. Unit: {unit.removesuffix(']')}. {DIRECTIONS[better(metric)]}"
