"""Defines the observation channels: source, unit, centre, scale and bounds of each.

An entry of the observation is (value - centre)/scale, clipped to the bounds, float32. The bounds keep the
observation space finite; they lie far outside the values reached before an episode fails.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError, unknown
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import (
    BLADES_MEASURED,
    MEASURED,
    N_BLADE_MEASUREMENTS,
    N_MEASUREMENTS,
    BladeMeasure,
    BladeMeasurement,
    Measure,
)
from fowt_env.plant.state import MOTIONS, N_COMMANDS, N_INDIVIDUAL_COMMANDS

SIN_AZIMUTH = N_MEASUREMENTS  # indices of the signals after the measurements
COS_AZIMUTH = N_MEASUREMENTS + 1
FIRST_ACTION = N_MEASUREMENTS + 2
ESTIMATES = FIRST_ACTION + N_INDIVIDUAL_COMMANDS
ESTIMATED = (  # first entries of an estimator's memory, see controllers/lqr/law.py
    "surge", "platform_pitch", "surge_rate", "platform_pitch_rate", "rotor_speed", "blade_pitch",
    "wind_tendency", "wind", "wave", "wave_quadrature", "moment", "mean_wind",
)  # fmt: skip
OF_BLADES = ESTIMATES + len(ESTIMATED)  # BladeMeasurement
SINCE_SHUTDOWN = OF_BLADES + N_BLADE_MEASUREMENTS
PREVIEW = SINCE_SHUTDOWN + 1
N_ACTIONS = N_COMMANDS  # in every mode except "individual"
DEFAULT = "default"  # in a list of channels: the task's channels


class Entry(NamedTuple):
    """Defines one number of the observation, SI before scaling."""

    name: str
    unit: str
    signal: int  # index among the signals
    centre: float
    scale: float
    low: float
    high: float
    meaning: str


def _meaning(name):
    """Return the meaning of a measured field with its positive direction."""
    field = (MEASURED | BLADES_MEASURED)[name]
    return f"{field.meaning} ({field.positive})"


def _symmetric(name, unit, scale, bound, meaning, signal):
    """Return an Entry with centre 0 and symmetric bounds."""
    return Entry(name, unit, int(signal), 0.0, scale, -bound, bound, meaning)


FIXED = tuple(  # channels with the same scaling for every turbine
    _symmetric(name, field.unit, field.scale, field.bound, _meaning(name), Measure[name.upper()])
    for name, field in MEASURED.items()
    if field.scale is not None
)
RATES = tuple(f"{name}_rate" for name in MOTIONS)
STANDARD = (*MOTIONS, *RATES, "rotor_speed", "blade_pitch", "generator_torque")


def _wind(name, signal, meaning):
    return Entry(name, "m/s", int(signal), 0.0, 15.0, -100.0, 150.0, meaning)


def _estimated(name):
    """Return the signal index of an estimated quantity."""
    return ESTIMATES + ESTIMATED.index(name)


ESTIMATE_CHANNELS = {  # computed by the estimator of lqr from measurements of a turbine
    "estimated_wind": (
        _wind("estimated_wind", _estimated("wind"), "rotor-averaged wind, estimated"),
        _wind("estimated_wind_tendency", _estimated("wind_tendency"), "slow component of the estimated wind"),
        _wind("estimated_mean_wind", _estimated("mean_wind"), "estimated wind, low pass of about 80 s"),
    ),
    "estimated_platform": (
        _symmetric("estimated_surge", "m", 20.0, 200.0, "surge, estimated", _estimated("surge")),
        _symmetric(
            "estimated_surge_rate", "m/s", 1.0, 50.0, "time derivative of surge, estimated",
            _estimated("surge_rate"),
        ),
    ),
    "estimated_waves": (
        _symmetric("estimated_wave", "m", 3.0, 50.0, "wave elevation, estimated", _estimated("wave")),
        _symmetric(
            "estimated_wave_quadrature", "m", 3.0, 50.0, "estimated_wave a quarter of the peak period later",
            _estimated("wave_quadrature"),
        ),
    ),
}  # fmt: skip


STOP_CHANNELS = {  # of tasks with a shutdown
    "time_since_shutdown": (
        Entry(
            "time_since_shutdown", "s", SINCE_SHUTDOWN, 0.0, 60.0, 0.0, 1e5, "time since the stop signal"
        ),
    ),
}  # fmt: skip
ORDINALS = ("first", "second", "third", "fourth")
BLADE_CHANNELS = BladeMeasurement._fields[BladeMeasure.BLADE_PITCH_1 :]  # of individual pitch


def _blade_channels(turbine):
    """Return {channel: (Entry,)} of BLADE_CHANNELS; moments are scaled by rated torque at the rotor shaft."""
    drive, table = turbine.pitch_drive, {}
    moment = turbine.drivetrain.gear_ratio * turbine.torque_law.rated_torque
    for name in BLADE_CHANNELS:
        signal = OF_BLADES + int(BladeMeasure[name.upper()])
        if name.startswith("blade_pitch"):
            entry = Entry(
                name, "rad", signal, 0.0, 15.0 * DEGREE, drive.minimum, drive.maximum, _meaning(name)
            )
        else:
            entry = _symmetric(name, "N m", moment, 50.0 * moment, _meaning(name), signal)
        table[name] = (entry,)
    return table


def observation_channels(turbine, preview=(), actions=N_ACTIONS):
    """Return {channel: tuple of its Entries} for a descriptions.turbine.Turbine.

    preview: look-ahead times (s); actions: number of actions.
    """
    rated, law, drive = turbine.rated_rotor_speed, turbine.torque_law, turbine.pitch_drive
    table = {entry.name: (entry,) for entry in FIXED}
    table["rotor_speed"] = (
        Entry(
            "rotor_speed", "rad/s", int(Measure.ROTOR_SPEED), rated, 0.2 * rated, -rated, 3.0 * rated,
            _meaning("rotor_speed"),
        ),
    )  # fmt: skip
    table["blade_pitch"] = (
        Entry(
            "blade_pitch", "rad", int(Measure.BLADE_PITCH), 0.0, 15.0 * DEGREE, drive.minimum, drive.maximum,
            _meaning("blade_pitch"),
        ),
    )  # fmt: skip
    table["generator_torque"] = (
        Entry(
            "generator_torque", "N m", int(Measure.GENERATOR_TORQUE), 0.0, law.rated_torque,
            -law.max_torque, law.max_torque, _meaning("generator_torque"),
        ),
    )  # fmt: skip
    table["wind_speed"] = (_wind("wind_speed", Measure.WIND_SPEED, _meaning("wind_speed")),)
    table["azimuth"] = (
        _symmetric("sin_azimuth", "-", 1.0, 1.0, "sine of the rotor azimuth", SIN_AZIMUTH),
        _symmetric("cos_azimuth", "-", 1.0, 1.0, "cosine of the rotor azimuth", COS_AZIMUTH),
    )
    table["previous_action"] = tuple(
        _symmetric(
            f"previous_action_{i}", "-", 1.0, 1.0, f"{ORDINALS[i]} component of the last action",
            FIRST_ACTION + i,
        )
        for i in range(actions)
    )  # fmt: skip
    table["wind_preview"] = tuple(
        _wind(f"wind_preview_{ahead:g}s", PREVIEW + i, f"wind along x at the hub {ahead:g} s ahead, exact")
        for i, ahead in enumerate(preview)
    )
    return table | ESTIMATE_CHANNELS | _blade_channels(turbine) | STOP_CHANNELS


def check_channels(where, names, default=None):
    """Return the tuple of unique channel names, with DEFAULT replaced by the names in default.

    Raises: InputError for unknown names, an empty list, or a string in place of a list.
    """
    if isinstance(names, str):
        raise InputError(f"{where} = {names!r}: must be a list of channel names, such as ({names!r},)")
    if not isinstance(names, Iterable):
        raise InputError(f"{where} = {names!r}: must be a list of channel names, such as ('rotor_speed',)")
    known = (*KNOWN, *BLADE_CHANNELS, *STOP_CHANNELS, *(() if default is None else (DEFAULT,)))
    chosen = []
    for name in names:
        if name not in known:
            raise unknown(f"channel of {where}", name, known)
        chosen += default if name == DEFAULT else [name]
    if not chosen:
        raise InputError(f"{where}: at least one channel is needed; known: {', '.join(KNOWN)}")
    return tuple(dict.fromkeys(chosen))


KNOWN = (  # channels of every scene with wind
    *(entry.name for entry in FIXED),
    "rotor_speed",
    "blade_pitch",
    "generator_torque",
    "wind_speed",
    "azimuth",
    "previous_action",
    "wind_preview",
    *ESTIMATE_CHANNELS,
)


def entries(names, turbine, preview, actions=N_ACTIONS, individual=False):
    """Return the entries of an observation in order; individual: whether each blade is pitched individually.

    Raises: InputError for a preview without times, and for blade channels without individual pitch.
    """
    for name in names:
        if name in BLADE_CHANNELS and not individual:
            raise InputError(
                f"observation: {name!r}: is measured only with individual pitch: needs pitch = 'individual'"
            )
    if "wind_preview" in names and not len(preview):
        raise InputError("wind_preview: needs look-ahead times, for example wind_preview=(2.0, 4.0, 6.0)")
    table = observation_channels(turbine, preview, actions)
    return tuple(entry for name in names for entry in table[name])


class ObservationMap(NamedTuple):
    """Holds the Entries as arrays (n,), and the look-ahead times of the preview (s)."""

    signal: np.ndarray  # int64
    centre: np.ndarray
    scale: np.ndarray
    low: np.ndarray  # of the scaled entry, representable in float32
    high: np.ndarray
    preview: np.ndarray


def build_observation_map(observed, preview):
    """Return the ObservationMap of Entries."""
    centre = np.array([entry.centre for entry in observed])
    scale = np.array([entry.scale for entry in observed])
    low = (np.array([entry.low for entry in observed]) - centre) / scale
    high = (np.array([entry.high for entry in observed]) - centre) / scale
    return ObservationMap(
        np.array([entry.signal for entry in observed], dtype=np.int64),
        centre,
        scale,
        low.astype(np.float32).astype(np.float64),
        high.astype(np.float32).astype(np.float64),
        np.ascontiguousarray(preview, dtype=np.float64),
    )


@kernel
def fill_signals(reading, azimuth, action, estimate, since_shutdown, ahead, signals):
    """Fill signals (n,) from readings, azimuth (rad), last action, estimates and wind preview (leads,).

    reading: values of a Measurement, followed by those of a BladeMeasurement with individual pitch.
    estimate: memory of an estimator, or None; since_shutdown: time since the stop signal, s.
    """
    for i in range(N_MEASUREMENTS):
        signals[i] = reading[i]
    signals[SIN_AZIMUTH] = np.sin(azimuth)
    signals[COS_AZIMUTH] = np.cos(azimuth)
    for i in range(action.shape[0]):
        signals[FIRST_ACTION + i] = action[i]
    for i in range(N_MEASUREMENTS, reading.shape[0]):
        signals[OF_BLADES + i - N_MEASUREMENTS] = reading[i]
    if estimate is not None:
        for i in range(OF_BLADES - ESTIMATES):
            signals[ESTIMATES + i] = estimate[i]
    signals[SINCE_SHUTDOWN] = max(since_shutdown, 0.0)
    for i in range(ahead.shape[0]):
        signals[PREVIEW + i] = ahead[i]


@kernel
def fill_observation(signals, observation_map, observation):
    """Fill observation (n,) float32 from the signals; entries that are not finite keep the last value."""
    for i in range(observation.shape[0]):
        entry, centre = observation_map.signal[i], observation_map.centre[i]
        value = (signals[entry] - centre) / observation_map.scale[i]
        if np.isfinite(value):
            low, high = observation_map.low[i], observation_map.high[i]
            observation[i] = np.float32(max(low, min(high, value)))
