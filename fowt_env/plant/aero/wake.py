"""Computes optional wake effects on the quasi-steady induction: skewed wake and dynamic inflow.

Both models are off by default (None). Source: theory.md, 5.1.
"""

from math import atan2, pi, sqrt, tan
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import State

PER_ELEMENT = 4  # wake states of a blade element: first stage and induced velocity, axial and tangential
LOWEST_WIND = 1.0  # m/s; lower limit of the wind speed in time constants, which would otherwise be unbounded


class SkewedWake(NamedTuple):
    """Redistributes the axial induction in yawed or tilted inflow (Glauert / Pitt-Peters).

    a_skew = a (1 + strength tan(chi/2) (radius/tip radius) cos(psi - psi_0)), with the wake skew angle
    chi = (0.6 a + 1) chi_0 of each element, chi_0 the angle between shaft and relative wind at the
    hub, and psi_0 the azimuth of a blade that points downstream. chi is limited to 90 deg.
    """

    strength: float  # 15 pi/32 in the literature


class DynamicInflow(NamedTuple):
    """Filters the induced velocity of every blade element by Oeye's model with two time constants.

    W_int + tau_1 W_int' = W_qs + 0.6 tau_1 W_qs',  W + tau_2 W' = W_int. With the state
    s = W_int - 0.6 W_qs no derivative of W_qs is needed: tau_1 s' = 0.4 W_qs - s.
    tau_1 = scale 1.1/(1 - 1.3 min(a, 0.5)) tip_radius/U_0, tau_2 = (0.39 - 0.26 (r/tip_radius)^2) tau_1.
    """

    scale: float  # 1; other values for sensitivity studies only
    least: float  # s, lower limit of both time constants for the integrator, see least_lag


class Skew(NamedTuple):
    """Holds the wind direction in the rotor plane (unit vector) and the angle of wind to shaft, rad."""

    y: float
    z: float
    angle: float


def build_skewed_wake(strength=15.0 * pi / 32.0):
    """Return the SkewedWake of this strength."""
    return SkewedWake(float(strength))


def build_dynamic_inflow(scale=1.0, least=0.0):
    """Return the DynamicInflow with scaled time constants of at least `least` (s)."""
    return DynamicInflow(float(scale), float(least))


def n_wake_states(elements, wake):
    """Return the number of states of dynamic inflow; 0 without rotor or wake."""
    if elements is None or wake is None:
        return 0
    return PER_ELEMENT * elements.blades * len(elements.radius)


@kernel
def skew_of(hub, skew):
    """Return the Skew of the relative wind at the hub; zero without a skew model."""
    if skew is None:
        return Skew(0.0, 0.0, 0.0)
    across = sqrt(hub.wy * hub.wy + hub.wz * hub.wz)
    if across == 0.0:
        return Skew(0.0, 0.0, 0.0)
    return Skew(hub.wy / across, hub.wz / across, atan2(across, abs(hub.wx)))


@kernel
def skew_factor(induced_normal, v_normal, ey, ez, span, skewed, skew):
    """Return the factor on the axial induced velocity of an element at azimuth direction (0, ey, ez)."""
    if skew is None:
        return 1.0
    a = -induced_normal / v_normal if v_normal != 0.0 else 0.0
    chi = min((0.6 * min(max(a, 0.0), 1.0) + 1.0) * skewed.angle, 0.5 * pi)
    return 1.0 + skew.strength * tan(0.5 * chi) * span * (skewed.y * ey + skewed.z * ez)


class BladeSkew(NamedTuple):
    """Holds the skewed wake as one blade meets it."""

    skew: SkewedWake
    skewed: Skew
    ey: float  # azimuth direction (0, ey, ez) of the blade
    ez: float
    radius: np.ndarray  # (n,) m, of the stations
    tip_radius: float  # m


@inlined_kernel
def _no_skew(skewed, skew, motion, elements):
    return None


@inlined_kernel
def _with_skew(skewed, skew, motion, elements):
    return BladeSkew(skew, skewed, motion.ey, motion.ez, elements.radius, elements.tip_radius)


# (skewed, skew, motion, elements) -> BladeSkew of a blade with this BladeMotion, None without a skew model
blade_skew = chosen_by_class("skew", {type(None): _no_skew, SkewedWake: _with_skew})


@inlined_kernel
def skewed_induction(normal, v_normal, j, skew):
    """Return the axial induced velocity (m/s) of station j with the BladeSkew; None: unchanged."""
    if skew is None:
        return normal
    span = skew.radius[j] / skew.tip_radius
    return normal * skew_factor(normal, v_normal, skew.ey, skew.ez, span, skew.skewed, skew.skew)


@kernel
def pace(a):
    """Return the factor on 1/tau_1 and 1/tau_2 at axial induction a; 1 at a = 0."""
    return 1.0 - 1.3 * min(max(a, 0.0), 0.5)


@kernel
def time_constants(a, wind_speed, radius, tip_radius, wake):
    """Return the time constants (tau_1, tau_2), s, of a blade element with axial induction a."""
    slow = 1.1 / pace(a) * tip_radius / max(wind_speed, LOWEST_WIND)
    span = radius / tip_radius
    slow *= wake.scale
    return max(slow, wake.least), max((0.39 - 0.26 * span * span) * slow, wake.least)


@kernel
def filtered_induction(section, v_normal, blade, j, wind_speed, wake, x, dx, radius, tip_radius):
    """Return the induced velocity (normal, tangential) of an element, m/s.

    Quasi-steady without dynamic inflow; otherwise taken from the wake states, whose rates are put into dx.
    """
    if wake is None:
        return section.induced_normal, section.induced_tangential
    a = -section.induced_normal / v_normal if v_normal != 0.0 else 0.0
    slow, fast = time_constants(a, wind_speed, radius[j], tip_radius, wake)
    i = State.INTERNAL + PER_ELEMENT * (blade * radius.shape[0] + j)
    dx[i] = (0.4 * section.induced_normal - x[i]) / slow
    dx[i + 1] = (x[i] + 0.6 * section.induced_normal - x[i + 1]) / fast
    dx[i + 2] = (0.4 * section.induced_tangential - x[i + 2]) / slow
    dx[i + 3] = (x[i + 2] + 0.6 * section.induced_tangential - x[i + 3]) / fast
    return x[i + 1], x[i + 3]
