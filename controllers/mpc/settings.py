"""Defines the settings of MPC: weights of the cost, horizon and limits."""

from dataclasses import dataclass

from fowt_env.controllers.settings import Settings

COSTS = (
    "speed", "platform_pitch", "platform_pitch_rate", "power", "torque", "speed_integral",
)  # fmt: skip
GROWTHS = (
    "pitch_rate_growth", "pitch_rate_growth_above", "power_growth", "power_growth_above", "torque_growth",
)  # fmt: skip


@dataclass(frozen=True)
class MPCSettings(Settings):
    """Holds the weights of squared terms (scale of each in the comment), horizon and limits of MPC.

    The default weights are results of `fowt design tune mpc`.

    Raises: InputError naming the key, value and allowed range.
    """

    NAME = "mpc"
    RANGES = {
        **dict.fromkeys(COSTS, {"low": 0.0}),
        **dict.fromkeys(("pitch_rate", "torque_rate", "schedule_time"), {"low": 0.0, "low_open": True}),
        **dict.fromkeys(GROWTHS, {"low": -10.0, "high": 10.0}),
        "horizon": {"low": 5.0, "high": 120.0},
        "preview_time": {"low": 1.0, "high": 60.0},
        "speed_limit": {"low": 1.02, "high": 1.3},
        "torque_low": {"low": 0.0, "high": 1.0},
        "torque_high": {"low": 1.0, "high": 1.5},
    }

    speed: float = 1.0  # rotor speed, over 5 % of rated
    platform_pitch: float = 1.215  # over 1 deg
    platform_pitch_rate: float = 0.2613  # over 0.1 deg/s
    power: float = 0.1423  # over 5 % of rated
    torque: float = 0.2046  # over 5 % of rated
    speed_integral: float = 0.0045  # over 5 % of rated times 10 s
    pitch_rate: float = 2.342  # blade-pitch command, over 0.2 deg/s
    torque_rate: float = 1.049  # over 5 % of rated torque per second
    pitch_rate_growth: float = 1.738  # exponent of wind/(18 m/s) in the weight pitch_rate, below 18 m/s
    pitch_rate_growth_above: float = -2.617  # the same above 18 m/s
    power_growth: float = -1.0  # the same for power, below 18 m/s
    power_growth_above: float = -1.1  # the same above 18 m/s
    torque_growth: float = 2.1  # the same for torque, below and above
    schedule_time: float = 240.7  # s, time constant of the operating wind; not a weight
    horizon: float = 30.0  # s
    preview_time: float = 10.0  # s, look-ahead time of laws with preview
    speed_limit: float = 1.15  # of rated, soft
    torque_low: float = 0.5  # of rated
    torque_high: float = 1.1  # of rated


PREVIEW = MPCSettings(power=0.1, torque=0.1)  # with preview less torque action is needed
