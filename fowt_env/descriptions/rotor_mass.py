"""Computes mass properties of a rotor from blades and hub for turbine files (theory.md, section 1)."""

from typing import NamedTuple

import numpy as np

BLADE_MASSES = ("blade_mass", "blade_first_moment", "blade_second_moment")  # of a Rotor, about the root


class RotorMass(NamedTuple):
    """Holds the mass properties of a rotor of equal blades, isotropic for three or more blades."""

    mass: float  # kg, blades and hub
    inertia: float  # kg m2 about the shaft
    inertia_diameter: float  # kg m2 about a diameter through the rotor's centre of mass
    cm_offset: float  # m, centre of mass from the rotor centre along the shaft, positive downwind


class BladeMass(NamedTuple):
    """Holds a blade as lumped masses along the pitch axis."""

    radius: np.ndarray  # (n,) m from the rotor centre along the pitch axis
    mass: np.ndarray  # (n,) kg


def blade_mass(fraction, line_mass, hub_radius, tip_radius, elements):
    """Return the BladeMass of equal elements, each with the line mass at the midpoint.

    fraction (m,) from 0 at the root to 1 at the tip; line_mass (m,) kg/m, linear in between. ElastoDyn uses
    the same discretisation with BldNodes elements.
    """
    length = (tip_radius - hub_radius) / elements
    middle = hub_radius + length * (np.arange(elements) + 0.5)
    density = np.interp((middle - hub_radius) / (tip_radius - hub_radius), fraction, line_mass)
    return BladeMass(middle, length * density)


def rotor_mass_properties(
    blade, *, blades=3, cone=0.0, hub_mass=0.0, hub_inertia=0.0, hub_inertia_diameter=0.0, hub_cm=0.0,
    prebend=None, sweep=None,
):  # fmt: skip
    """Return the RotorMass of equal blades on a hub.

    blade                 BladeMass
    cone                  rad, positive: blades lean upwind (-PreCone)
    hub_mass, hub_cm      kg; m from the rotor centre along the shaft, positive downwind (HubCM)
    hub_inertia           kg m2 about the shaft (HubIner); hub_inertia_diameter about a diameter through the
                          hub's centre of mass
    prebend, sweep        (n,) m, of the lumps from the pitch axis, as in descriptions.turbine.Blade;
                          None: straight blades, as in ElastoDyn
    """
    bend = np.zeros_like(blade.mass) if prebend is None else np.asarray(prebend, dtype=float)
    across = np.zeros_like(blade.mass) if sweep is None else np.asarray(sweep, dtype=float)
    along = bend * np.cos(cone) - blade.radius * np.sin(cone)  # the shaft, downwind
    square = (blade.radius * np.cos(cone) + bend * np.sin(cone)) ** 2 + across**2  # distance from it
    mass = blades * blade.mass.sum() + hub_mass
    offset = (blades * blade.mass @ along + hub_mass * hub_cm) / mass
    about_shaft = blades * blade.mass @ square
    about_apex = (
        0.5 * about_shaft + blades * blade.mass @ along**2 + hub_inertia_diameter + hub_mass * hub_cm**2
    )
    return RotorMass(
        float(mass),
        float(about_shaft + hub_inertia),
        float(about_apex - mass * offset**2),
        float(offset),
    )
