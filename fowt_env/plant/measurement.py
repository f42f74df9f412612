"""What a controller is given at each control instant (SI, radians)."""

from enum import IntEnum
from typing import NamedTuple


class Measurement(NamedTuple):
    """Channels at one control instant; attribute order is the order of the kernels' array.

    Speeds of the platform are time derivatives of surge ... yaw (inertial position, Euler angles).
    wind_speed is the hub wind along x (rotor-averaged where the scene's wind is), wave_elevation
    that at the origin: a real turbine does not know them exactly, so controllers that use them
    say so. nacelle_acceleration is the fore-aft (body x) acceleration of the tower top.
    """

    time: float  # s
    rotor_speed: float  # rad/s
    generator_speed: float  # rad/s, high-speed shaft
    blade_pitch: float  # rad; the mean of blades with pitches of their own
    generator_torque: float  # N m, high-speed shaft, as applied until now
    surge: float  # m
    sway: float
    heave: float
    roll: float  # rad
    platform_pitch: float
    yaw: float
    surge_rate: float  # m/s
    sway_rate: float
    heave_rate: float
    roll_rate: float  # rad/s
    platform_pitch_rate: float
    yaw_rate: float
    nacelle_acceleration: float  # m/s2
    nacelle_velocity: float  # m/s, body x, at the tower top
    platform_pitch_acceleration: float  # rad/s2
    wind_speed: float  # m/s
    wave_elevation: float  # m


Measure = IntEnum("Measure", [name.upper() for name in Measurement._fields], start=0)
N_MEASUREMENTS = len(Measurement._fields)
SENSOR_FIELDS = (  # what a turbine's own sensors show
    "time", "rotor_speed", "generator_speed", "blade_pitch", "generator_torque", "platform_pitch",
    "platform_pitch_rate", "platform_pitch_acceleration", "nacelle_acceleration", "nacelle_velocity",
)  # fmt: skip


class BladeMeasurement(NamedTuple):
    """What is measured beside a Measurement where every blade has a pitch of its own.

    Bending moments of the blade roots include weight and inertia: out of the rotor plane (RootMyc) and in it
    (RootMxc). Those of hub and yaw bearing are in axes that do not turn with the rotor: tilt about y, yaw
    about z.
    """

    azimuth: float  # rad, of the first blade, 0 up
    blade_pitch_1: float  # rad
    blade_pitch_2: float
    blade_pitch_3: float
    root_out_of_plane_1: float  # N m
    root_out_of_plane_2: float
    root_out_of_plane_3: float
    root_in_plane_1: float
    root_in_plane_2: float
    root_in_plane_3: float
    hub_tilt_moment: float  # N m
    hub_yaw_moment: float
    yaw_bearing_tilt_moment: float
    yaw_bearing_yaw_moment: float


BladeMeasure = IntEnum("BladeMeasure", [name.upper() for name in BladeMeasurement._fields], start=0)
N_BLADE_MEASUREMENTS = len(BladeMeasurement._fields)
BLADE_SENSOR_FIELDS = BladeMeasurement._fields[: BladeMeasure.HUB_TILT_MOMENT]  # encoders, strain gauges
