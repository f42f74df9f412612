"""Computes the design data of individual pitch control: response of the blades to pitch, lag of the drive.

A cyclic pitch theta_i = theta_t cos psi_i + theta_y sin psi_i of blades at the azimuths psi_i changes the
out-of-plane root moments, and in multi-blade coordinates

M_tilt = 2/3 sum M_i cos psi_i,    M_yaw = 2/3 sum M_i sin psi_i

by the slope G = dM/d theta of a single rigid blade: (M_tilt, M_yaw) changes by G (theta_t, theta_y). Tilt
and yaw are coupled only by the lag of the pitch drive at 1P, which rotates the vector by the phase lag.
Bossanyi, Wind Energy 6(2), 2003, and 8(4), 2005; azimuth offset that compensates the lag: Mulders,
Pamososuryo, Disario and van Wingerden, Wind Energy 22(6), 2019.
"""

from math import atan2
from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.controllers.gains import AIR, PITCH_STEP, power_slope
from fowt_env.errors import InputError
from fowt_env.plant.aero.blade_elements import blade_section, build_blade_elements
from fowt_env.plant.compile.decorators import entry

BANDWIDTH = 0.4  # of the loop, fraction of rated rotor speed


class RootSlope(NamedTuple):
    """Holds the slope G of a blade's root moment over pitch along the steady curve above rated."""

    at_zero: float  # N m/rad at zero pitch, of the line at_zero (1 + theta/doubling); negative
    doubling: float  # rad, blade pitch at which the slope has doubled
    blade_pitch: np.ndarray  # (n,) rad, points of the fitted line
    slope: np.ndarray  # (n,) N m/rad
    moment: float  # N m, largest aerodynamic root moment along the curve


_SLOPES = Cache(16)  # id of the turbine -> (turbine, RootSlope)


def root_slope(turbine):
    """Return the RootSlope of a turbine in uniform steady wind, from rated torque to cut-out.

    The slope follows from the blade elements with the inflow of each blade in equilibrium with its pitch, as
    in a quasi-steady wake model. Raises: InputError as power_slope, or if feathering does not unload blades.
    """
    return _SLOPES.get(id(turbine), lambda: (turbine, _root_slope(turbine)))[1]


@entry
def _root_moment(wind, rotor_speed, blade_pitch, hub_radius, rotor, result):
    """Fill result[0] with the out-of-plane root moment (N m) of a blade in uniform wind."""
    result[0] = 0.0
    for j in range(rotor.radius.shape[0]):
        here = blade_section(wind, rotor_speed * rotor.radius[j], blade_pitch, j, 1.0, rotor)
        result[0] += (rotor.moment_weight[j] - hub_radius * rotor.weight[j]) * here.fn


def _root_slope(turbine):
    elements, curve = build_blade_elements(turbine, AIR), power_slope(turbine)
    rated, result = turbine.rated_rotor_speed, np.zeros(1)

    def moment(wind, pitch):
        _root_moment(float(wind), rated, float(pitch), float(turbine.rotor.hub_radius), elements, result)
        return result[0]

    pairs = list(zip(curve.wind, curve.blade_pitch, strict=True))
    slopes = [
        (moment(wind, pitch + PITCH_STEP) - moment(wind, pitch - PITCH_STEP)) / (2.0 * PITCH_STEP)
        for wind, pitch in pairs
    ]
    growth, at_zero = np.polyfit(curve.blade_pitch, slopes, 1)
    if not (at_zero < 0.0 and growth < 0.0):
        raise InputError(f"turbine {turbine.name!r}: pitching to feather does not unload its blades")
    greatest = max(moment(wind, pitch) for wind, pitch in pairs)
    return RootSlope(float(at_zero), float(at_zero / growth), curve.blade_pitch, np.array(slopes), greatest)


def drive_lag(turbine, frequency):
    """Return the phase lag (rad, positive) of a turbine's pitch drive at a frequency (rad/s)."""
    drive = turbine.pitch_drive
    if drive.natural_frequency is None:
        return atan2(drive.time_constant * frequency, 1.0)
    ratio = frequency / drive.natural_frequency
    return atan2(2.0 * drive.damping * ratio, 1.0 - ratio * ratio)


def lead_time(turbine, control_dt):
    """Return the time lag (s) of the blades at 1P: pitch drive plus half a control period."""
    rated = turbine.rated_rotor_speed
    return drive_lag(turbine, rated) / rated + 0.5 * control_dt
