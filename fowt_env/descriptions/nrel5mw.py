"""Defines rated values of the NREL 5 MW turbine, from which built-in data are scaled to other turbines."""

from fowt_env.descriptions.units import DEGREE, RPM

CUT_IN, RATED_WIND, CUT_OUT = 3.0, 11.4, 25.0  # m/s
ROTOR_SPEED = 12.1 * RPM  # rated, rad/s
GENERATOR_SPEED = 122.9096  # rated, rad/s
TORQUE = 43093.55  # rated, on the high-speed shaft, N m
PITCH_RATE = 8.0 * DEGREE  # of the pitch drive, rad/s
TIP_RADIUS, HUB_HEIGHT = 63.0, 90.0  # m
GEAR_RATIO = 97.0
