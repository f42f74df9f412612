"""Defines the measurements that a controller reads at each control instant (SI, radians).

The fields of the two classes are the only table of measured quantities: units, signs, meanings, whether a
turbine has such a sensor, and scale as an observation.
"""

from enum import IntEnum
from math import pi
from typing import Annotated, NamedTuple, get_type_hints

DEGREE = pi / 180.0  # rad


class Measured(NamedTuple):
    """Describes a measured quantity."""

    unit: str
    positive: str  # positive direction
    meaning: str
    sensor: bool = False  # whether sensors of a turbine measure it
    # An observation is divided by the scale and clipped at +-bound, SI, far outside the range before an
    # episode fails. None: no observation, or one that depends on the turbine (envs/observations.py).
    scale: float | None = None
    bound: float | None = None


class Measurement(NamedTuple):
    """Holds the measured quantities of a control instant, in the order of the kernels' array.

    Speeds of the platform are time derivatives of surge ... yaw (inertial position, Euler angles).
    wind_speed is the hub wind along x (rotor-averaged where the scene's wind is), wave_elevation
    the surface at the origin: no real turbine measures them exactly, so controllers that use them
    declare so. nacelle_acceleration is the fore-aft (body x) acceleration of the tower top.
    """

    # fmt: off
    time: Annotated[float, Measured("s", "", "time since the start of the run", True)]
    rotor_speed: Annotated[float, Measured("rad/s", "in operation", "speed of the rotor", True)]
    generator_speed: Annotated[float, Measured(
        "rad/s", "in operation", "speed of the high-speed shaft: gear_ratio times the rotor's", True)]
    blade_pitch: Annotated[float, Measured(
        "rad", "towards feather",
        "actual pitch angle of the blades; with individual pitch the mean of the blades", True)]
    generator_torque: Annotated[float, Measured(
        "N m", "braking the rotor", "generator torque on the high-speed shaft, as applied up to now", True)]
    surge: Annotated[float, Measured("m", "downwind", "position of the platform", False, 20.0, 200.0)]
    sway: Annotated[float, Measured(
        "m", "left, looking downwind", "position of the platform", False, 10.0, 200.0)]
    heave: Annotated[float, Measured("m", "up", "position of the platform", False, 2.0, 50.0)]
    roll: Annotated[float, Measured(
        "rad", "tower top to the right", "Euler angle about the platform's x axis", False, 2.0 * DEGREE, pi)]
    platform_pitch: Annotated[float, Measured(
        "rad", "tower top downwind", "Euler angle of platform pitch", True, 5.0 * DEGREE, 0.5 * pi)]
    yaw: Annotated[float, Measured(
        "rad", "counter-clockwise from above", "Euler angle of platform yaw", False,
        5.0 * DEGREE, 2.0 * pi)]
    surge_rate: Annotated[float, Measured("m/s", "downwind", "time derivative of surge", False, 1.0, 50.0)]
    sway_rate: Annotated[float, Measured("m/s", "left", "time derivative of sway", False, 0.5, 50.0)]
    heave_rate: Annotated[float, Measured("m/s", "up", "time derivative of heave", False, 0.5, 50.0)]
    roll_rate: Annotated[float, Measured(
        "rad/s", "as roll", "time derivative of roll", False, 0.5 * DEGREE, 2.0)]
    platform_pitch_rate: Annotated[float, Measured(
        "rad/s", "as platform_pitch", "time derivative of platform_pitch", True, DEGREE, 2.0)]
    yaw_rate: Annotated[float, Measured(
        "rad/s", "as yaw", "time derivative of yaw", False, 0.5 * DEGREE, 2.0)]
    nacelle_acceleration: Annotated[float, Measured(
        "m/s2", "downwind", "acceleration of the tower top along the platform's x", True, 1.0, 100.0)]
    nacelle_velocity: Annotated[float, Measured(
        "m/s", "downwind", "velocity of the tower top along the platform's x", True, 1.0, 100.0)]
    nacelle_pitch_acceleration: Annotated[float, Measured(
        "rad/s2", "as platform_pitch", "angular acceleration of the nacelle about its y axis", True,
        0.5 * DEGREE, 5.0)]
    wind_speed: Annotated[float, Measured(
        "m/s", "downwind", "wind at the hub along x; rotor-averaged where the scene's wind is")]
    wave_elevation: Annotated[float, Measured(
        "m", "up", "water surface at the platform's rest position", False, 3.0, 50.0)]
    # fmt: on


class BladeMeasurement(NamedTuple):
    """Holds the quantities measured in addition to a Measurement with individual pitch.

    Bending moments of the blade roots include weight and inertia: out of the rotor plane (RootMyc) and in
    the rotor plane (RootMxc). Moments of hub and yaw bearing are in axes that do not rotate with the rotor:
    tilt about y, yaw about z.
    """

    # fmt: off
    azimuth: Annotated[float, Measured(
        "rad", "in operation", "azimuth of the first blade, 0 where it points up", True)]
    blade_pitch_1: Annotated[float, Measured("rad", "towards feather", "pitch angle of blade 1", True)]
    blade_pitch_2: Annotated[float, Measured("rad", "towards feather", "pitch angle of blade 2", True)]
    blade_pitch_3: Annotated[float, Measured("rad", "towards feather", "pitch angle of blade 3", True)]
    root_out_of_plane_1: Annotated[float, Measured(
        "N m", "pushed downwind", "bending moment at the root of blade 1 out of the rotor plane (RootMyc)",
        True)]
    root_out_of_plane_2: Annotated[float, Measured(
        "N m", "pushed downwind", "bending moment at the root of blade 2 out of the rotor plane (RootMyc)",
        True)]
    root_out_of_plane_3: Annotated[float, Measured(
        "N m", "pushed downwind", "bending moment at the root of blade 3 out of the rotor plane (RootMyc)",
        True)]
    root_in_plane_1: Annotated[float, Measured(
        "N m", "pushed in the direction of rotation",
        "bending moment at the root of blade 1 in the rotor plane (RootMxc)", True)]
    root_in_plane_2: Annotated[float, Measured(
        "N m", "pushed in the direction of rotation",
        "bending moment at the root of blade 2 in the rotor plane (RootMxc)", True)]
    root_in_plane_3: Annotated[float, Measured(
        "N m", "pushed in the direction of rotation",
        "bending moment at the root of blade 3 in the rotor plane (RootMxc)", True)]
    hub_tilt_moment: Annotated[float, Measured(
        "N m", "top pushed downwind", "tilting moment at the hub, in axes that do not rotate with the rotor")]
    hub_yaw_moment: Annotated[float, Measured(
        "N m", "as yaw", "yawing moment at the hub, in axes that do not rotate with the rotor")]
    yaw_bearing_tilt_moment: Annotated[float, Measured(
        "N m", "top pushed downwind", "tilting moment at the yaw bearing")]
    yaw_bearing_yaw_moment: Annotated[float, Measured("N m", "as yaw", "yawing moment at the yaw bearing")]
    # fmt: on


def _fields(of):
    """Return {field: Measured} of a class of measurements, in the order of its fields."""
    hints = get_type_hints(of, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in of._fields}


MEASURED, BLADES_MEASURED = _fields(Measurement), _fields(BladeMeasurement)
Measure = IntEnum("Measure", [name.upper() for name in Measurement._fields], start=0)
BladeMeasure = IntEnum("BladeMeasure", [name.upper() for name in BladeMeasurement._fields], start=0)
N_MEASUREMENTS, N_BLADE_MEASUREMENTS = len(Measure), len(BladeMeasure)
SENSOR_FIELDS = tuple(name for name, field in MEASURED.items() if field.sensor)  # sensors of a turbine
BLADE_SENSOR_FIELDS = tuple(name for name, field in BLADES_MEASURED.items() if field.sensor)
HEAD = ("field", "unit", "positive", "meaning", "sensor of a turbine")


def measurement_rows(of: type = Measurement) -> list[tuple[str, str, str, str, str]]:
    """Return rows (field, unit, positive, meaning, whether turbines have such a sensor) of a class.

    of: Measurement or BladeMeasurement, in the order of its fields.
    """
    table = MEASURED if of is Measurement else BLADES_MEASURED
    return [(name, *field[:3], "yes" if field.sensor else "no") for name, field in table.items()]


def _as_text(of):
    """Return the rows as lines of a docstring, for help(fowt_env.Measurement)."""
    rows = [HEAD, *measurement_rows(of)]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    lines = []
    for name, unit, positive, meaning, sensor in rows:
        cells = (name.ljust(widths[0]), unit.ljust(widths[1]), positive.ljust(widths[2]))
        mark = "" if sensor == "yes" or name == HEAD[0] else "; no sensor of a turbine"
        lines.append(f"    {'  '.join(cells)}  {meaning}{mark}".rstrip())
    return "\n".join(lines)


for _class in (Measurement, BladeMeasurement):
    _class.__doc__ = f"{(_class.__doc__ or '').rstrip()}\n\n{_as_text(_class)}\n    "
