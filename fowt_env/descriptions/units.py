"""Defines units of files, tables and pages: a value in a unit times the unit is the value in SI."""

from math import pi

RPM = pi / 30.0  # rad/s
DEGREE = pi / 180.0  # rad
PERCENT = 0.01

# Keys of files with values in another unit than that of the field: key in the file: (field, unit).
FILE_UNITS = {
    "rated_rotor_speed_rpm": ("rated_rotor_speed", RPM),
    "overspeed_rpm": ("overspeed", RPM),
    "rate_limit_deg_per_s": ("rate_limit", DEGREE),
    "acceleration_limit_deg_per_s2": ("acceleration_limit", DEGREE),
    "deadband_deg": ("deadband", DEGREE),
    "friction_deg": ("friction", DEGREE),
    "minimum_deg": ("minimum", DEGREE),
    "maximum_deg": ("maximum", DEGREE),
    "limit_deg": ("limit", DEGREE),
    "normal_rate_deg_per_s": ("normal_rate", DEGREE),
    "start_rate_deg_per_s": ("start_rate", DEGREE),
    "emergency_rate_deg_per_s": ("emergency_rate", DEGREE),
    "azimuth_deg": ("azimuth", DEGREE),
    "shaft_tilt_deg": ("shaft_tilt", DEGREE),
    "cone_deg": ("cone", DEGREE),
    "region3_min_pitch_deg": ("region3_min_pitch", DEGREE),
    "gain_schedule_pitch_deg": ("gain_schedule_pitch", DEGREE),
    "damping_ratio_percent": ("damping_ratio", PERCENT),
}
