"""Settings of the predictive law: weights of its cost, horizon and limits."""

from dataclasses import asdict, dataclass, fields, replace
from math import inf

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import unknown

RANGES = {  # of what is not simply 0 or more: (low, high, low omitted)
    "pitch_rate": (0.0, inf, True),
    "torque_rate": (0.0, inf, True),
    "schedule_time": (0.0, inf, True),
    "horizon": (5.0, 120.0, False),
    "preview_time": (1.0, 60.0, False),
    "speed_limit": (1.02, 1.3, False),
    "torque_low": (0.0, 1.0, False),
    "torque_high": (1.0, 1.5, False),
}


@dataclass(frozen=True)
class MPCSettings:
    """Cost of each squared term in units of the scale in its comment, and what bounds the moves.

    The weights of defaults are what `fowt design tune mpc` found.

    Raises: InputError naming the key, value and allowed range.
    """

    speed: float = 1.0  # rotor speed, over 5 % of rated
    platform_pitch: float = 1.215  # over 1 deg
    platform_pitch_rate: float = 0.2613  # over 0.1 deg/s
    power: float = 0.1423  # over 5 % of rated
    torque: float = 0.2046  # over 5 % of rated
    speed_integral: float = 0.0045  # over 5 % of rated times 10 s
    pitch_rate: float = 2.342  # blade-pitch command, over 0.2 deg/s
    torque_rate: float = 1.049  # over 5 % of rated torque a second
    pitch_rate_growth: float = 1.738  # pitch_rate holds at 18 m/s and below goes with this power of the wind
    pitch_rate_growth_above: float = -2.617  # the same above 18 m/s
    power_growth: float = -1.0  # the same for power, below 18 m/s
    power_growth_above: float = -1.1  # the same above 18 m/s
    torque_growth: float = 2.1  # the same for torque, below and above
    schedule_time: float = 240.7  # s, over which the operating wind follows the estimate; no cost
    horizon: float = 30.0  # s
    preview_time: float = 10.0  # s that the wind is known ahead, for the law that is shown it
    speed_limit: float = 1.15  # of rated, soft
    torque_low: float = 0.5  # of rated
    torque_high: float = 1.1  # of rated

    def __post_init__(self):
        for item in fields(self):
            key, value = f"mpc {item.name}", getattr(self, item.name)
            if "_growth" in item.name:
                check_number(key, value, -10.0, 10.0)
                continue
            low, high, left_out = RANGES.get(item.name, (0.0, inf, False))
            check_number(key, value, low, high, low_open=left_out)

    def changed(self, **changes):
        """Return a copy with some settings changed. Raises: InputError for unknown names."""
        for key in changes:
            if key not in asdict(self):
                raise unknown("mpc setting", key, asdict(self))
        return replace(self, **changes)


PREVIEW = MPCSettings(power=0.1, torque=0.1)  # with the wind ahead torque has less to make up for
