"""Defines the settings of MPC: prices of its cost, horizon and limits."""

from dataclasses import dataclass

from fowt_env.controllers.settings import Settings

ABOVE_ZERO = ("travel", "mean_speed", "torque_rate", "schedule_time")
PRICES = ("speed", "platform_pitch", "surge", "shaft", "power")


@dataclass(frozen=True)
class MPCSettings(Settings):
    """Holds the prices of deviations over those of gspi_oc3 (weights.py), horizon and limits of MPC.

    The aim of the default prices is that of `fowt design search mpc --aim scores`.

    Raises: InputError naming the key, value and allowed range.
    """

    NAME = "mpc"
    RANGES = {
        **dict.fromkeys(PRICES, {"low": 0.0}),
        **dict.fromkeys(ABOVE_ZERO, {"low": 0.0, "low_open": True}),
        "shaft_near_rated": {"low": 0.0, "high": 1.0},
        "horizon": {"low": 5.0, "high": 120.0},
        "preview_time": {"low": 1.0, "high": 60.0},
        "speed_limit": {"low": 1.02, "high": 1.3},
        "power_limit": {"low": 1.02, "high": 1.5},
        "torque_low": {"low": 0.0, "high": 1.0},
        "torque_high": {"low": 1.0, "high": 1.5},
    }

    speed: float = 1.0  # price of rotor speed
    platform_pitch: float = 1.2
    surge: float = 0.4
    shaft: float = 0.2  # torque of the shaft
    power: float = 0.05
    travel: float = 0.97  # limit, not a price, of blade-pitch travel, over that of gspi_oc3
    shaft_near_rated: float = 0.018  # deviation of shaft torque by lulls at the lowest design wind, of rated
    mean_speed: float = 0.007  # limit of the deviation of 10-minute means of rotor speed, of rated
    torque_rate: float = 0.1  # cost of (torque rate / 5 % of rated a second)^2
    schedule_time: float = 300.0  # s, time constant of the operating wind
    horizon: float = 30.0  # s
    preview_time: float = 10.0  # s, look-ahead time of laws with preview
    speed_limit: float = 1.15  # of rated, soft
    power_limit: float = 1.15  # of torque and rotor speed, of rated; soft in the plan
    torque_low: float = 0.75  # of rated; in lulls that of the torque curve, if less
    torque_high: float = 1.05  # of rated
