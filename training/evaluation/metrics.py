"""Computes the metrics of a run from its columns with OpenFAST channel names."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import rainflow

from fowt_env.descriptions.channel_meanings import channel_meaning
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import InputError

TIME = "Time_[s]"
# Inverse slopes m of the S-N curves. Welded steel of the tower: 4, the usual choice for tubular towers in
# IEC 61400-1 practice. Stud or studless chain at the fairlead: 3 (DNV-OS-E301, T-N curves; 5 is wire rope's).
# Glass-fibre laminate of blades: 10, as in IEC 61400-1 practice.
TOWER_EXPONENT, CHAIN_EXPONENT, BLADE_EXPONENT = 4.0, 3.0, 10.0
# Life exponent of ball bearings, ISO 281, for the pitch bearings as in NREL/TP-500-42362.
BEARING_EXPONENT = 3.0
# channels of each blade, in axes of the cone and of the pitched blade; the metric is that of the worst blade
BLADE_ROOTS = ("RootMyc", "RootMxc", "RootMyb", "RootMxb")
# the shaft's bending in axes at rest and turning with it, and the yaw bearing's
HUB_LOADS = ("LSSTipMys", "LSSTipMzs", "LSSTipMya", "LSSTipMza", "YawBrMyp", "YawBrMzp")
BLADES = (1, 2, 3)
BEARING = (("BldPitch", "deg"), ("RootMyc", "kN-m"), ("RootMxc", "kN-m"))  # channels of a pitch bearing
# The constraints of the ATLAS Offshore contest (ARPA-E, 2019).
BLADE_PITCH_RATE_LIMIT = 10.0  # deg/s
TOWER_TOP_ACCELERATION_LIMIT = 3.3  # m/s2
ROTOR_SPEED_LIMIT = 1.3  # of rated: 15.73 rpm
SETTLED_END = 300.0  # s at the end of a run, in which the rotor speed must have settled
STANDSTILL = 10.0  # % of rated rotor speed, below which a feathered, idling rotor counts as stopped
SETTLED_BAND = 5.0  # % of rated rotor speed about the final mean: limit of settling
FINAL = 100.0  # s at the end of a run for final mean and oscillation: some periods of platform pitch
REQUIRED_CHANNELS = (
    TIME, "RotSpeed_[rpm]", "GenPwr_[kW]", "PtfmPitch_[deg]", "PtfmSurge_[m]", "BldPitch1_[deg]",
    "GenTq_[kN-m]",
)  # fmt: skip


class Metric(NamedTuple):
    """Defines a metric or a statistic of a channel, and how its values are compared and averaged."""

    meaning: str
    better: int = 0  # -1: less is better, 1: more is better, 0: neither
    never_negative: bool = False
    exponent: float = 1.0  # p of its mean over winds and seeds, see mean_exponent
    of: Callable | None = None  # of a statistic: function of values over time, the first axis


STATISTICS = {
    "mean": Metric("mean", of=lambda x: np.mean(x, axis=0)),
    # about the mean of the run, N in the denominator
    "std": Metric("standard deviation", -1, True, 2.0, lambda x: np.std(x, axis=0)),
    "min": Metric("minimum", of=lambda x: np.min(x, axis=0)),
    "max": Metric("maximum", -1, of=lambda x: np.max(x, axis=0)),
    "rms": Metric("root mean square", -1, True, 2.0, lambda x: np.sqrt(np.mean(x**2, axis=0))),
}
# channel -> its statistics; a channel that a run lacks (mooring without lines) gives NaN
ALL = ("mean", "std", "min", "max")
CHANNELS = dict.fromkeys(
    (
        "Wind1VelX_[m/s]", "Wave1Elev_[m]", "RotSpeed_[rpm]", "GenPwr_[kW]", "GenTq_[kN-m]",
        "PtfmPitch_[deg]", "PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmRoll_[deg]", "PtfmYaw_[deg]",
        "BldPitch1_[deg]", "RotThrust_[kN]", "RotTorq_[kN-m]", "TwrBsMyt_[kN-m]",
    ),
    ALL,
) | {"NcIMUTAxs_[m/s^2]": (*ALL, "rms")}  # fmt: skip
FURTHER_CHANNELS = (  # of which a run may lack some, as of CHANNELS
    "GenTqLim_[-]", "PtfmSway_[m]", *(f"{name}_[kN-m]" for name in HUB_LOADS),
    *(f"{name}{i}_[kN-m]" for name in BLADE_ROOTS for i in BLADES), *(f"BldPitch{i}_[deg]" for i in BLADES),
)  # fmt: skip
WEATHER = ("Wind1VelX_[m/s]", "Wave1Elev_[m]")  # channels of which neither less nor more is better


def _metric_name(channel, statistic):
    """Return the name of a metric: "RotSpeed_std_[rpm]" of "RotSpeed_[rpm]" and "std"."""
    name, unit = channel.split("_[")
    return f"{name}_{statistic}_[{unit}"


def _of_channel(channel, statistic):
    """Return the Metric of a statistic of a channel; more is better only for the mean power."""
    row = STATISTICS[statistic]
    better = 1 if (channel, statistic) == ("GenPwr_[kW]", "mean") else row.better
    meaning = f"{channel_meaning(channel)}: {row.meaning}"
    return row._replace(meaning=meaning, better=0 if channel in WEATHER else better, of=None)


def _size(meaning):
    """Return a Metric that cannot be below zero, of which less is better."""
    return Metric(meaning, -1, True)


def _deviation(meaning):
    """Return the Metric of a standard deviation."""
    return Metric(meaning, -1, True, 2.0)


def _fatigue(meaning, exponent=TOWER_EXPONENT, material=""):
    """Return the Metric of a damage-equivalent load with the inverse slope of its S-N curve."""
    return Metric(
        f"1 Hz damage-equivalent load of the {meaning}, m = {exponent:g}{material}", -1, True, exponent
    )


TABLE = {  # metric -> definition, in the order of columns
    _metric_name(channel, statistic): _of_channel(channel, statistic)
    for channel, statistics in CHANNELS.items()
    for statistic in statistics
} | {
    "overspeed_[%]": Metric("maximum rotor speed above rated", -1),
    "energy_[kWh]": Metric("electrical energy, power counted up to rated", 1),
    "GenPwr_capped_mean_[kW]": Metric("mean electrical power, counted up to rated", 1),
    "blade_pitch_travel_[deg/s]": _size("mean absolute blade-pitch rate"),
    "actuator_duty_[%]": _size("mean absolute blade-pitch rate over the drive's limit"),
    "torque_travel_[kN-m/s]": _size("mean absolute rate of the generator torque"),
    "torque_limited_[s]": _size("time with the generator torque at a range or rate limit"),
    "FAIRTEN_std_[kN]": _deviation("standard deviation of the fairlead tension, worst line"),
    "FAIRTEN_max_[kN]": _size("maximum fairlead tension of all lines"),
    "TwrBsMyt_DEL_[kN-m]": _fatigue("fore-aft tower-base moment", material=" (welded steel)"),
    "RotTorq_DEL_[kN-m]": _fatigue("low-speed shaft torque"),
    "FAIRTEN_DEL_[kN]": _fatigue("worst fairlead", CHAIN_EXPONENT, " (chain)"),
    "RootMyc_DEL_[kN-m]": _fatigue("worst blade root out of the rotor plane", BLADE_EXPONENT),
    "RootMxc_DEL_[kN-m]": _fatigue("worst blade root in the rotor plane", BLADE_EXPONENT),
    "RootMyb_DEL_[kN-m]": _fatigue("worst blade root flapwise", BLADE_EXPONENT),
    "RootMxb_DEL_[kN-m]": _fatigue("worst blade root edgewise", BLADE_EXPONENT),
    "LSSTipMys_DEL_[kN-m]": _fatigue("hub's tilt moment, non-rotating"),
    "LSSTipMzs_DEL_[kN-m]": _fatigue("hub's yaw moment, non-rotating"),
    "LSSTipMya_DEL_[kN-m]": _fatigue("shaft's bending moment about y, rotating"),
    "LSSTipMza_DEL_[kN-m]": _fatigue("shaft's bending moment about z, rotating"),
    "YawBrMyp_DEL_[kN-m]": _fatigue("yaw bearing's tilt moment"),
    "YawBrMzp_DEL_[kN-m]": _fatigue("yaw bearing's yaw moment"),
    "each_blade_travel_[deg/s]": _size("mean absolute pitch rate of each blade, mean of the three"),
    "PitchBrg_DEL_[kN-m]": Metric(
        "pitch bearing: moment with the same rolling damage at 1 deg/s, worst blade",
        -1,
        True,
        BEARING_EXPONENT,
    ),
    "PtfmSway_std_[m]": _deviation("standard deviation of the platform's sway"),
    "blade_pitch_rate_above_limit_[s]": _size("time with a blade-pitch rate above 10 deg/s"),
    "blade_pitch_rate_violations_[-]": _size("exceedances of 10 deg/s by the blade-pitch rate"),
    "tower_top_acceleration_above_limit_[s]": _size("time with a tower-top acceleration above 3.3 m/s2"),
    "tower_top_acceleration_violations_[-]": _size("exceedances of 3.3 m/s2 by the tower-top acceleration"),
    "rotor_speed_above_limit_[s]": _size("time with a rotor speed above 1.3 times rated"),
    "rotor_speed_violations_[-]": _size("exceedances of 1.3 times rated by the rotor speed"),
    "RotSpeed_offset_[%]": _size("steady wind: deviation of the final mean rotor speed from rated"),
    "BldPitch_oscillation_[deg]": _size("steady wind: peak-to-peak blade pitch of the last 100 s"),
    "settling_time_[s]": _size("time from a gust until the rotor speed stays within 5 % of its final mean"),
    "standstill_time_[s]": _size("time from a stop until the rotor stays below 10 % of rated speed"),
}
METRICS = tuple(TABLE)
UNKNOWN = Metric("")  # a column that is not a metric of this version
DIRECTIONS = {-1: "lower", 0: "", 1: "higher"}


def never_negative(metric):
    """Return whether a metric cannot be below zero: deviations, travel, fatigue, tensions, times, counts."""
    return TABLE.get(metric, UNKNOWN).never_negative


def better(metric):
    """Return -1 if less of a metric is better, 1 if more is better, 0 if neither."""
    return TABLE.get(metric, UNKNOWN).better


def mean_exponent(metric):
    """Return the exponent p with which a metric is averaged over winds and seeds: (mean of x^p)^(1/p).

    Damage-equivalent loads: the exponent of their S-N curve, since damage is additive. Standard deviations
    and rms: 2, since variances are additive: the result is the lifetime deviation about the means of the
    individual runs, without the variation of these means with wind speed. Any other: 1.
    """
    return TABLE.get(metric, UNKNOWN).exponent


EXPONENTS = np.array([mean_exponent(name) for name in METRICS])
# metrics without which a deviation of the rotor speed can mislead: what the grid and the drive train pay
PAID = ("GenPwr_std_[kW]", "torque_travel_[kN-m/s]", "RotTorq_DEL_[kN-m]")


def metric_table():
    """Return [(name, unit, meaning, better direction: "lower", "higher" or "")] of all METRICS."""
    return [
        (*name.rstrip("]").split("_["), row.meaning, DIRECTIONS[row.better]) for name, row in TABLE.items()
    ]


def travel(time, value):
    """Return the mean absolute rate over time, the first axis: the sum of absolute increments per second."""
    return np.sum(np.abs(np.diff(value, axis=0)), axis=0) / (time[-1] - time[0])


def overspeed(fastest, rated):
    """Return the maximum rotor speed above rated, in percent of rated; 0 if the speed stays below rated."""
    return np.maximum(0.0, 100.0 * (fastest / rated - 1.0))  # Python's max() would replace NaN by 0


def damage_equivalent_load(values, duration, exponent):
    """Return the range (unit of values) of the 1 Hz cycles with the same fatigue damage as the values.

    (sum n_i S_i^m / duration)^(1/m) over the rainflow cycles of the series (ASTM E1049-85, 5.4.4): ranges
    S_i, counts n_i (residual half cycles count 0.5), m the inverse slope of the S-N curve, duration in s.
    No mean-load correction. Any NaN gives NaN.
    """
    values = np.asarray(values, dtype=np.float64)
    if not np.isfinite(values).all():
        return float("nan")
    damage = sum(count * cycle**exponent for cycle, _, count, _, _ in rainflow.extract_cycles(values))
    return float((damage / duration) ** (1.0 / exponent))


def pitch_bearing_load(time, blade_pitch, out_of_plane, in_plane):
    """Return the bending moment (kN m) of a pitch bearing that at 1 deg/s has the same rolling damage.

    (sum M^3 |step of the blade pitch| / duration)^(1/3), M the resultant of the root moments (kN m), pitch in
    deg: the damage of a ball bearing grows with its travel and the cube of its load. Any NaN gives NaN.
    """
    moment = np.hypot(out_of_plane, in_plane)
    damage = 0.5 * (moment[1:] ** BEARING_EXPONENT + moment[:-1] ** BEARING_EXPONENT)
    total = np.sum(damage * np.abs(np.diff(blade_pitch))) / (time[-1] - time[0])
    return float(total ** (1.0 / BEARING_EXPONENT))


def beyond(time, value, limit):
    """Return (time in s of evenly spaced values above a limit, number of upcrossings); NaN if any is NaN."""
    if len(value) < 2 or not np.isfinite(value).all():
        return float("nan"), float("nan")
    above = value > limit
    rises = int(np.sum(above[1:] & ~above[:-1])) + int(above[0])
    return float(np.sum(above) * (time[-1] - time[0]) / (len(time) - 1)), float(rises)


def metrics(
    df,
    skip=0.0,
    rated_speed_rpm=12.1,
    pitch_rate_limit=8.0,
    rated_power_kW=5000.0,
    steady=False,
    gust_start=None,
    stop=None,
):
    """Return {metric: value} of a run, in the order and with the names of METRICS.

    df                output of simulate: evenly spaced rows
    skip              time at the start that is not evaluated, s (start-up transient)
    rated_speed_rpm   rated rotor speed, reference of the overspeed
    pitch_rate_limit  of the blade-pitch drive, deg/s; the actuator duty is the mean rate in percent of this
    rated_power_kW    electrical; power above rated counts neither as energy nor in the capped mean
    steady            whether the wind is steady and above rated in still water, so that offset and
                      oscillation are computed (else NaN)
    gust_start        time (s) of a gust after which the rotor must settle; None: no settling time (NaN)
    stop              time (s) of the event that stops the rotor; None: no standstill time (NaN)
    TABLE defines each metric; a channel missing in the run gives NaN.
    Raises: InputError for missing columns or if skip leaves fewer than two rows.
    """
    kept = _kept(df, skip)
    lines = kept[[name for name in kept.columns if name.startswith("FAIRTEN")]].to_numpy()
    axes = ("NcIMUTAxs_[m/s^2]", "NcIMUTAys_[m/s^2]")
    accelerations = [kept[name].to_numpy() for name in axes if name in kept.columns]
    lacking = [name for name in (*CHANNELS, *FURTHER_CHANNELS) if name not in kept.columns]
    kept = kept.assign(**dict.fromkeys(lacking, np.nan))
    time, blade_pitch = kept[TIME].to_numpy(), kept["BldPitch1_[deg]"].to_numpy()
    length = time[-1] - time[0]

    def fatigue(channel, exponent=TOWER_EXPONENT):
        return damage_equivalent_load(kept[f"{channel}_[kN-m]"], length, exponent)

    result = {
        _metric_name(channel, statistic): float(STATISTICS[statistic].of(kept[channel].to_numpy()))
        for channel, statistics in CHANNELS.items()
        for statistic in statistics
    }
    result["overspeed_[%]"] = float(overspeed(result["RotSpeed_max_[rpm]"], rated_speed_rpm))
    capped = np.minimum(kept["GenPwr_[kW]"].to_numpy(), rated_power_kW)
    result["energy_[kWh]"] = float(np.trapezoid(capped, time) / 3600.0)
    result["GenPwr_capped_mean_[kW]"] = float(np.mean(capped))
    result["blade_pitch_travel_[deg/s]"] = float(travel(time, blade_pitch))
    result["actuator_duty_[%]"] = 100.0 * result["blade_pitch_travel_[deg/s]"] / pitch_rate_limit
    result["torque_travel_[kN-m/s]"] = float(travel(time, kept["GenTq_[kN-m]"].to_numpy()))
    result["torque_limited_[s]"] = float(np.mean(kept["GenTqLim_[-]"].to_numpy()[:-1]) * length)
    result["FAIRTEN_std_[kN]"] = float(lines.std(axis=0).max()) if lines.size else np.nan
    result["FAIRTEN_max_[kN]"] = float(lines.max()) if lines.size else np.nan
    loads = [damage_equivalent_load(line, length, CHAIN_EXPONENT) for line in lines.T]
    result["FAIRTEN_DEL_[kN]"] = float(np.max(loads)) if loads else np.nan
    for name in ("TwrBsMyt", "RotTorq", *HUB_LOADS):
        result[f"{name}_DEL_[kN-m]"] = fatigue(name)
    for name in BLADE_ROOTS:
        worst = np.max([fatigue(f"{name}{i}", BLADE_EXPONENT) for i in BLADES])
        result[f"{name}_DEL_[kN-m]"] = float(worst)
    blades = [travel(time, kept[f"BldPitch{i}_[deg]"].to_numpy()) for i in BLADES]
    result["each_blade_travel_[deg/s]"] = float(np.mean(blades))
    worn = [
        pitch_bearing_load(time, *(kept[f"{name}{i}_[{unit}]"].to_numpy() for name, unit in BEARING))
        for i in BLADES
    ]
    result["PitchBrg_DEL_[kN-m]"] = float(np.max(worn))
    result["PtfmSway_std_[m]"] = float(np.std(kept["PtfmSway_[m]"]))
    speed = kept["RotSpeed_[rpm]"].to_numpy()
    result |= _violations(time, speed, accelerations, blade_pitch, rated_speed_rpm)
    result |= _settling(time, speed, blade_pitch, rated_speed_rpm, steady, gust_start)
    result["standstill_time_[s]"] = _standstill(time, speed, rated_speed_rpm, stop)
    return {name: result[name] for name in METRICS}


def turbine_metrics(df, turbine, skip=0.0, steady=False, gust_start=None, stop=None):
    """Return the metrics of a run, with the turbine's rated speed, rated power and pitch-rate limit."""
    power = 1e-3 * turbine.torque_law.rated_power * turbine.drivetrain.generator_efficiency
    rate = turbine.pitch_drive.rate_limit / DEGREE
    return metrics(df, skip, turbine.rated_rotor_speed / RPM, rate, power, steady, gust_start, stop)


def _kept(df, skip):
    """Return the rows of a run after `skip`. Raises: InputError."""
    missing = [name for name in REQUIRED_CHANNELS if name not in df.columns]
    if missing:
        raise InputError(f"metrics: the run lacks the columns {', '.join(missing)}")
    check_number("skip", skip, 0.0, allowed="0 or more seconds")
    time = df[TIME].to_numpy()
    kept = df[time >= (time[0] + skip - 1e-9)] if len(time) else df
    if len(kept) < 2:
        length = time[-1] - time[0] if len(time) else 0.0
        raise InputError(f"skip = {skip} s: leaves fewer than two rows of a run of {length:g} s")
    return kept


def _settling(time, speed, blade_pitch, rated_speed_rpm, steady, gust_start):
    """Return the settling metrics from the rows after `skip`; NaN where they are not defined for the run."""
    names = ("RotSpeed_offset_[%]", "BldPitch_oscillation_[deg]", "settling_time_[s]")
    result = dict.fromkeys(names, np.nan)
    if steady:
        end = time >= time[-1] - SETTLED_END - 1e-9
        offset = 100.0 * abs(np.mean(speed[end]) / rated_speed_rpm - 1.0)
        result["RotSpeed_offset_[%]"] = float(offset)
        result["BldPitch_oscillation_[deg]"] = float(np.ptp(blade_pitch[time >= time[-1] - FINAL - 1e-9]))
    if gust_start is not None and np.isfinite(speed).all():
        final = np.mean(speed[time >= time[-1] - FINAL - 1e-9])
        away = np.abs(speed - final) > 0.01 * SETTLED_BAND * rated_speed_rpm
        late = time[away & (time >= gust_start - 1e-9)]
        result["settling_time_[s]"] = float(late[-1] - gust_start) if late.size else 0.0
    return result


def _standstill(time, speed, rated_speed_rpm, stop):
    """Return the time (s) from a stop until the rotor remains at standstill; NaN if never."""
    fast = np.abs(speed) > 0.01 * STANDSTILL * rated_speed_rpm
    if stop is None or fast[-1] or not np.isfinite(speed).all():
        return np.nan
    return max(float(time[fast][-1]) - stop, 0.0) if fast.any() else 0.0


def _violations(time, speed, axes, blade_pitch, rated_speed_rpm):
    """Return the metrics of constraints; axes: tower-top accelerations, fore-aft and side to side."""
    rate = np.abs(np.diff(blade_pitch) / np.diff(time))
    acceleration = np.hypot.reduce(axes) if axes else np.full(time.shape, np.nan)
    result = {}
    for name, times, values, limit in (
        ("blade_pitch_rate", time[1:], rate, BLADE_PITCH_RATE_LIMIT),
        ("tower_top_acceleration", time, acceleration, TOWER_TOP_ACCELERATION_LIMIT),
        ("rotor_speed", time, speed, ROTOR_SPEED_LIMIT * rated_speed_rpm),
    ):
        result[f"{name}_above_limit_[s]"], result[f"{name}_violations_[-]"] = beyond(times, values, limit)
    return result
