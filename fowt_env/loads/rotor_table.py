"""Rotor loads from a table of the blade element momentum solution, for axial inflow.

Much faster than the sweep over all stations (rotor.py). The axial wind relative to the moving rotor is
taken at four points of the disk, on the radius whose mean is the disk average: their mean enters the
table, their differences (shear, platform pitch and yaw rate) give the tilting moments to first order.
Left out: cross wind, the in-plane forces, finer structure of the wind and every change with azimuth.
"""

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.jit import kernel
from fowt_env.loads.rotor import (
    FAST_ROTOR,
    NO_ROTOR_LOAD,
    SLOW_ROTOR,
    RotorLoad,
    blade_section,
    elements_key,
    fade,
)
from fowt_env.state import State, Wrench
from fowt_env.weather.wind import wind_at

# Angle theta = atan2(speed * tip radius, axial wind): 0 parked, 90 deg no wind, 180 deg parked in reversed
# wind, negative turning backwards. Steps are small where the loads bend: (start, step) in deg. Tip-speed
# ratios 3 to 20 are 71 to 87 deg; around 90 deg the wake state changes within a degree.
THETA_STEPS = ((-180.0, 3.0), (0.0, 1.0), (40.0, 0.5), (66.0, 0.1), (89.9, 0.02), (90.1, 0.5), (110.0, 2.0))
PITCH_STEPS = ((-10.0, 1.0), (-4.0, 0.25), (26.0, 1.0), (40.0, 2.5))  # deg, blade pitch
THETA_END, PITCH_END = 180.0, 100.0


STEP = 1e-3  # of the unit speed, for the change of the line load with the axial wind


class Coefficients(NamedTuple):
    """Loads without dimension, q = rho (V^2 + (speed R)^2)/2, A = pi R^2."""

    thrust: float  # on q A
    torque: float  # on q A R
    tilt: float  # moment on rho A R^2 sqrt(V^2 + (speed R)^2)/2 times the gradient of the axial wind (1/s)


class RotorTable(NamedTuple):
    """Coefficients over inflow angle (n,) and blade pitch (m,), rad."""

    theta: np.ndarray  # (n,)
    blade_pitch: np.ndarray  # (m,)
    load: np.ndarray  # (n, m, 3) thrust/(q A), torque/(q A R), tilting moment, see _fill
    tip_radius: float
    overhang: float
    hub_height: float
    scale: float  # 1/2 air density * disk area, kg/m


def _points(steps, end):
    """Increasing points from the list of (start, step), with the last at end (deg); rad."""
    edges = [start for start, _ in steps] + [end]
    parts = [
        np.linspace(low, high, max(1, round((high - low) / step)), endpoint=False)
        for (low, step), high in zip(steps, edges[1:], strict=True)
    ]
    return np.radians(np.concatenate([*parts, [end]]))


@kernel
def _fill(theta, blade_pitch, load, rotor):
    """Put the coefficients of the blade element momentum solution into load; one blade stands for all.

    A gradient g of the axial wind changes it by g r cos(psi) along the blade; averaged over the azimuth
    the moment is half the number of blades times the integral of r^2 dfn/dV.
    """
    area = pi * rotor.tip_radius * rotor.tip_radius
    for i in range(theta.shape[0]):
        # unit speed: V^2 + (speed R)^2 = 1, so that load coefficients are loads over density and area
        wind, tip_speed = cos(theta[i]), sin(theta[i])
        induction = fade(tip_speed, SLOW_ROTOR * abs(wind), FAST_ROTOR * abs(wind))
        for k in range(blade_pitch.shape[0]):
            thrust = torque = tilt = 0.0
            for j in range(rotor.radius.shape[0]):
                v_tangential = tip_speed * rotor.radius[j] / rotor.tip_radius
                section = blade_section(wind, v_tangential, blade_pitch[k], j, induction, rotor)
                thrust += rotor.weight[j] * section.fn
                torque += rotor.moment_weight[j] * section.ft
                more = blade_section(wind + STEP, v_tangential, blade_pitch[k], j, induction, rotor)
                less = blade_section(wind - STEP, v_tangential, blade_pitch[k], j, induction, rotor)
                change = (more.fn - less.fn) / (2.0 * STEP)
                tilt += 0.5 * rotor.moment_weight[j] * rotor.radius[j] * change
            q = 0.5 * rotor.air_density * area / rotor.blades
            load[i, k, 0] = thrust / q
            load[i, k, 1] = torque / (q * rotor.tip_radius)
            load[i, k, 2] = tilt / (q * rotor.tip_radius**2)


_built = {}  # one table per set of blade elements in this process: building takes about two seconds


def build_rotor_table(rotor):
    """RotorTable of a BladeElements; the same elements give the table built before."""
    key = elements_key(rotor)
    if key not in _built:
        unit = rotor._replace(air_density=1.0) if rotor.air_density == 0.0 else rotor
        theta, blade_pitch = _points(THETA_STEPS, THETA_END), _points(PITCH_STEPS, PITCH_END)
        load = np.zeros((len(theta), len(blade_pitch), 3))
        _fill(theta, blade_pitch, load, unit)
        _built[key] = RotorTable(
            theta,
            blade_pitch,
            load,
            float(rotor.tip_radius),
            float(rotor.overhang),
            float(rotor.hub_height),
            float(0.5 * rotor.air_density * pi * rotor.tip_radius**2),
        )
    return _built[key]


@kernel
def _interval(x, points):
    """(i, weight): x lies between points i and i + 1; outside, the ends are held."""
    last = points.shape[0] - 1
    if not x > points[0]:
        return 0, 0.0
    if x >= points[last]:
        return last - 1, 1.0
    i, above = 0, last
    while above - i > 1:
        middle = (i + above) // 2
        if points[middle] <= x:
            i = middle
        else:
            above = middle
    return i, (x - points[i]) / (points[i + 1] - points[i])


@kernel
def table_coefficients(wind, tip_speed, blade_pitch, table):
    """Coefficients, bilinear in the table."""
    i, p = _interval(atan2(tip_speed, wind), table.theta)
    k, b = _interval(blade_pitch, table.blade_pitch)
    load = table.load
    w00, w01, w10, w11 = (1.0 - p) * (1.0 - b), (1.0 - p) * b, p * (1.0 - b), p * b
    return Coefficients(
        w00 * load[i, k, 0] + w01 * load[i, k + 1, 0] + w10 * load[i + 1, k, 0] + w11 * load[i + 1, k + 1, 0],
        w00 * load[i, k, 1] + w01 * load[i, k + 1, 1] + w10 * load[i + 1, k, 1] + w11 * load[i + 1, k + 1, 1],
        w00 * load[i, k, 2] + w01 * load[i, k + 1, 2] + w10 * load[i + 1, k, 2] + w11 * load[i + 1, k + 1, 2],
    )


@kernel
def _axial_wind(t, pose, y, z, now, series, field, overhang):
    """Wind along the shaft relative to the point (-overhang, y, z) of the moving body, m/s."""
    u, v, w = wind_at(
        t,
        pose.x - overhang * pose.r11 + y * pose.r12 + z * pose.r13,
        pose.y - overhang * pose.r21 + y * pose.r22 + z * pose.r23,
        pose.z - overhang * pose.r31 + y * pose.r32 + z * pose.r33,
        now,
        series,
        field,
    )
    moving = pose.vx + pose.wy * z - pose.wz * y
    return pose.r11 * u + pose.r21 * v + pose.r31 * w - moving


@kernel
def rotor_table_load(t, pose, x, now, series, field, table):
    """RotorLoad: thrust, torque and tilting moments from the axial wind relative to the moving rotor.

    No table or no wind series: zero.
    """
    if table is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    arm, height = table.tip_radius * sqrt(0.5), table.hub_height
    up = _axial_wind(t, pose, 0.0, height + arm, now, series, field, table.overhang)
    down = _axial_wind(t, pose, 0.0, height - arm, now, series, field, table.overhang)
    left = _axial_wind(t, pose, arm, height, now, series, field, table.overhang)
    right = _axial_wind(t, pose, -arm, height, now, series, field, table.overhang)
    wind = 0.25 * (up + down + left + right)
    tip_speed = x[State.ROTOR_SPEED] * table.tip_radius
    at = table_coefficients(wind, tip_speed, x[State.BLADE_PITCH], table)
    square = wind * wind + tip_speed * tip_speed
    thrust = table.scale * square * at.thrust
    torque = table.scale * square * table.tip_radius * at.torque
    tilt = table.scale * sqrt(square) * table.tip_radius**2 * at.tilt / (2.0 * arm)
    return RotorLoad(
        Wrench(thrust, 0.0, 0.0, torque, height * thrust + tilt * (up - down), tilt * (right - left)),
        thrust,
        torque,
    )


def performance(rotor, tip_speed_ratio, blade_pitch):
    """(cp, ct, cq), each (n, m): power, thrust and torque coefficients of a BladeElements in axial wind.

    tip_speed_ratio (n,); blade_pitch (m,) rad. The usual ones: on rho V^2/2 times the area (and the radius).
    """
    ratio = np.ascontiguousarray(tip_speed_ratio, dtype=np.float64)
    blade_pitch = np.ascontiguousarray(blade_pitch, dtype=np.float64)
    load = np.zeros((len(ratio), len(blade_pitch), 3))
    _fill(np.arctan(ratio), blade_pitch, load, rotor)
    square = 1.0 + ratio[:, None] ** 2
    torque = square * load[:, :, 1]
    return ratio[:, None] * torque, square * load[:, :, 0], torque
