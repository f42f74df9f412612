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
    blade_pitch: float  # rad
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
