"""Computes hydrodynamic loads: buoyancy, waves, current and motion of the hull, and the total added mass."""

from typing import NamedTuple

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.hydro.added_inertia import added_inertia_load
from fowt_env.plant.hydro.banded_strips import banded_strip_load
from fowt_env.plant.hydro.body_matrices import add_body_matrices
from fowt_env.plant.hydro.excitation import add_excitation, elevation_beside, position_rates
from fowt_env.plant.hydro.hydrostatics import hydrostatic_load
from fowt_env.plant.hydro.linear_damping import damping_load
from fowt_env.plant.hydro.member_buoyancy import add_member_buoyancy
from fowt_env.plant.hydro.members import add_member_loads
from fowt_env.plant.hydro.morison import NO_STRIP_LOAD, current_at, morison_load
from fowt_env.plant.hydro.radiation import add_radiation
from fowt_env.plant.hydro.strips import Strips
from fowt_env.plant.hydro.undisplaced_axis import fill_undisplaced_mass
from fowt_env.plant.hydro.wave_bands import surface_elevation
from fowt_env.plant.hydro.waves import elevation, wave_kinematics
from fowt_env.plant.state import NO_LOAD, Wrench, add


class ExactStrips(NamedTuple):
    """Computes strip loads by the plain sum over all wave components."""

    shape: Strips
    diffraction: object  # diffraction.StripDiffraction or None: 1 + C_A in every wave


class BandedStrips(NamedTuple):
    """Computes strip loads by a few wave numbers at the nodes of a fixed quadrature."""

    shape: Strips
    quadrature: object  # wave_bands.StripQuadrature
    bands: object  # wave_bands.WaveBands, or None in still water
    diffraction: object  # wave_bands.BandDiffraction or None


class Hydro(NamedTuple):
    """Holds the hydrodynamic parts of a floating platform."""

    hull: object  # hydrostatics.BuoyantHull or None
    strips: object  # ExactStrips, BandedStrips or None
    waves: object  # waves.Waves or None
    current: object  # morison.Current or None
    damping: object  # linear_damping.LinearDamping or None
    added_inertia: object  # added_inertia.AddedInertia or None
    matrices: object  # body_matrices.BodyMatrices or None
    radiation: object  # radiation.StateSpaceMemory, ConvolutionMemory or None
    members: object  # members.Members or None
    excitation: object  # excitation.Excitation or None
    depth: float  # of the water, m


class HydroLoad(NamedTuple):
    """Holds hydrodynamic loads except added mass times acceleration, body components about body origin."""

    buoyancy: Wrench
    # and members, potential-flow body with excitation and radiation memory, constant added mass
    strips: Wrench
    damping: Wrench


NO_HYDRO_LOAD = HydroLoad(NO_LOAD, NO_LOAD, NO_LOAD)


@inlined_kernel
def _exact(t, pose, hydro, strips, data):
    return morison_load(
        t, pose, strips.shape, hydro.waves, hydro.current, data.kinematics, strips.diffraction
    )


@inlined_kernel
def _banded(t, pose, hydro, strips, data):
    return banded_strip_load(
        t, pose, strips.quadrature, strips.bands, hydro.current, data.bands, strips.diffraction
    )


@inlined_kernel
def _without(t, pose, hydro, strips, data):
    return NO_STRIP_LOAD


# (t, pose, hydro, strips, data) -> morison.StripLoad
strip_load = chosen_by_class("strips", {ExactStrips: _exact, BandedStrips: _banded, type(None): _without})


@inlined_kernel
def _plain_elevation(t, waves, strips, excitation, data):
    return elevation(t, 0.0, 0.0, waves)


@inlined_kernel
def _banded_elevation(t, waves, strips, excitation, data):
    return surface_elevation(t, waves, strips.bands, data.bands)


@inlined_kernel
def _free_elevation(t, waves, strips, excitation, data):
    return elevation_beside(t, waves, excitation, data.excitation)


_elevation = chosen_by_class(
    "strips", {ExactStrips: _plain_elevation, BandedStrips: _banded_elevation, type(None): _free_elevation}
)


@inlined_kernel
def _mass_of_strips(pose, load, strips, matrix):
    if strips.shape.undisplaced_axis is not None:  # decided here: a call would pass the arrays of the shape
        fill_undisplaced_mass(pose, load, strips.shape.keel_z, matrix)
    else:
        fill_added_mass(load, matrix)


@inlined_kernel
def _no_mass(pose, load, strips, matrix):
    matrix[:] = 0.0


# (pose, StripLoad, strips, matrix): fills the added mass (6, 6)
fill_strip_mass = chosen_by_class(
    "strips", {ExactStrips: _mass_of_strips, BandedStrips: _mass_of_strips, type(None): _no_mass}
)


@kernel
def surface_at_origin(t, hydro, data):
    """Return the surface elevation at the inertial origin, m."""
    if hydro is None:
        return 0.0
    return _elevation(t, hydro.waves, hydro.strips, hydro.excitation, data)


@kernel
def water_at(t, X, Y, Z, hydro):
    """Return (u, v, w, du, dv, dw), m/s and m/s2, of waves and current at an inertial point (m)."""
    if hydro is None:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return _water(t, X, Y, Z, hydro.waves, hydro.current, hydro.depth)


@kernel
def _water(t, X, Y, Z, waves, current, depth):
    u, v = current_at(Z, depth, current)
    if waves is None:
        return u, v, 0.0, 0.0, 0.0, 0.0
    moved = wave_kinematics(t, X, Y, Z, waves)
    return u + moved.u, v + moved.v, moved.w, moved.du, moved.dv, moved.dw


@inlined_kernel
def hydro_load(t, pose, x, hydro, data):
    """Return the HydroLoad at a state; fills data.added_mass."""
    if hydro is None:
        return NO_HYDRO_LOAD
    buoyancy = hydrostatic_load(pose, hydro.hull, data.counters)
    buoyancy = add_member_buoyancy(pose, buoyancy, hydro.members)
    strips = strip_load(t, pose, hydro, hydro.strips, data)
    fill_strip_mass(pose, strips, hydro.strips, data.added_mass)
    wrench = add_inertia(pose, strips.wrench, hydro.added_inertia, data.added_mass)
    wrench = add_body_matrices(pose, x, wrench, hydro.matrices, data.added_mass)
    wrench = add_radiation(pose, x, wrench, hydro.radiation, data.radiation)
    wrench = add_member_loads(t, pose, wrench, hydro.members, hydro.waves, hydro.current, data)
    wrench = add_excitation(t, pose, x, wrench, hydro.excitation, data.excitation)
    return HydroLoad(buoyancy, wrench, damping_load(pose, x, hydro.damping))


@inlined_kernel
def hydro_rates(x, hydro, dx):
    """Fill dx with the rates of the hydrodynamic internal states, except radiation memory."""
    if hydro is None:
        return
    position_rates(x, hydro.excitation, dx)


@kernel
def fill_added_mass(strips, matrix):
    """Fill the symmetric (6, 6) added mass of a StripLoad, whose axis is the body's z."""
    for i in range(6):
        for j in range(6):
            matrix[i, j] = 0.0
    matrix[0, 0] = matrix[1, 1] = strips.s0
    matrix[2, 2] = strips.a33
    matrix[0, 4] = matrix[4, 0] = strips.s1
    matrix[1, 3] = matrix[3, 1] = -strips.s1
    matrix[3, 3] = matrix[4, 4] = strips.s2


@kernel
def add_inertia(pose, load, inertia, matrix):
    """Return load plus the constant added-mass load, and add its 6x6 to matrix; None: unchanged."""
    if inertia is None:
        return load
    for i in range(6):
        for j in range(6):
            matrix[i, j] += inertia.matrix[i, j]
    return add(load, added_inertia_load(pose, inertia))
