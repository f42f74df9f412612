"""Computes rotor loads without iteration, from a table per blade station, for each blade and wind sample.

The quasi-steady load of a station over the square of the inflow speed depends only on inflow direction and
blade pitch (blade_elements.py). This ratio is tabulated once per blade and interpolated linearly in both; all
else is as in rotor_load. The table spans inflows from upwind (v_normal > 0) and blade pitches from -5 to 90
deg; elsewhere, and on a slow or parked rotor, the exact solution is used. Where the exact solution jumps
between roots of the momentum balance (deep stall), or fades within hundredths of an angle, the table smooths
it over a cell. Induction is not tabulated: dynamic inflow needs section_inflow.py, skewed wake rotor_load.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.bent_blade import BentShape
from fowt_env.plant.aero.bent_sweep import bent_forces
from fowt_env.plant.aero.blade_elements import (
    BladeElements,
    blade_section,
    element_of,
    elements_key,
    pitching_moment,
)
from fowt_env.plant.aero.blade_shape import BladeShape, effective_pitch, place_stations, turn_like, turn_of
from fowt_env.plant.aero.blade_sweep import (
    NO_ROTOR_LOAD,
    UNKNOWN_FORCE,
    Blade,
    SampledWind,
    add_blade,
    box_wind,
    faded_induction,
    is_boxed,
    is_sheared,
    load_of_three,
    motion_of,
    near_tower,
    rotor_axes_load,
    rotor_flow,
    rotor_reach,
    shape_of,
    sheared_forces,
    stations_outside,
    swept,
)
from fowt_env.plant.aero.station_response import (
    AHEAD,
    BEHIND,
    COARSE_END,
    COARSE_ROWS,
    DENSE_END,
    DENSE_ROWS,
    DENSE_START,
    Tabled,
    TabledOrSolved,
    pitch_row,
    rows_of,
)
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import BLADES, NO_LOAD, State

LEAST_NORMAL = 1e-9  # v_normal of the first direction: limit from upwind, since the load jumps at zero


class SectionTable(NamedTuple):
    """Holds the loads of the n stations of a blade over blade pitch and inflow direction."""

    load: np.ndarray  # (blade pitches, n, directions, 2, or 3 of curved blades) float32; see _fill
    arm: np.ndarray  # (n,) m, radius at which the station's part of a straight blade's force acts
    elements: BladeElements  # of the exact solution


@entry
def _fill(load, blade_pitch, elements, shape):
    """Fill load with each station's part of the blade force, normal and tangential, over the air density
    and the square of v_normal + |v_tangential|; for curved blades also with the pitching moment."""
    for i in range(load.shape[0]):
        for j in range(load.shape[1]):
            weight = elements.weight[j] / elements.air_density
            turned = effective_pitch(j, blade_pitch[i], shape)
            element = element_of(j, turned, elements)
            for k in range(load.shape[2]):
                v_tangential = 1.0 - k / AHEAD if k <= AHEAD else -(k - AHEAD) / BEHIND
                v_normal = max(1.0 - abs(v_tangential), LEAST_NORMAL)
                section = blade_section(v_normal, v_tangential, turned, j, 1.0, elements)
                v_normal, v_tangential = (
                    v_normal + section.induced_normal,
                    v_tangential + section.induced_tangential,
                )
                load[i, j, k, 0] = weight * section.fn
                load[i, j, k, 1] = weight * section.ft
                put_moment(load[i, j, k], weight, v_normal, v_tangential, j, element, elements, shape)


@kernel
def put_moment(load, weight, v_normal, v_tangential, j, element, elements, shape):
    """Put the pitching moment of a local flow, times weight, into load[2]; no-op for straight blades."""
    if shape is None:
        return
    load[2] = weight * pitching_moment(v_normal, v_tangential, j, element, shape, elements.polars)


_tables = Cache(8)  # one per blade, 18 MB each: building takes about a second


def build_section_table(elements):
    """Return the SectionTable of a BladeElements; one cached table serves all air densities.

    19 stations: 18 MB, 0.8 s compiled; many minutes with the JIT off (use rotor_load instead).
    """
    unit = elements._replace(air_density=1.0, airfoils=None, tower=None)
    load = _tables.get(elements_key(unit), lambda: _filled_table(unit))
    return SectionTable(load, station_arms(elements), elements)


def station_arms(elements):
    """Return the (n,) radii (m) at which each station's part of a straight blade's force acts."""
    return np.ascontiguousarray(elements.moment_weight / elements.weight, dtype=np.float64)


def table_pitches():
    """Return the blade pitches of the table rows, rad."""
    dense = np.linspace(DENSE_START, DENSE_END, DENSE_ROWS, endpoint=False)
    coarse = np.linspace(DENSE_END, COARSE_END, COARSE_ROWS + 1)
    return np.radians(np.concatenate((dense, coarse)))


def load_components(elements):
    """Return the number of components of a load table: 2, or 3 with the moment of curved blades."""
    return 2 if elements.shape is None else 3


def _filled_table(elements):
    """Return the load array of a SectionTable, computed by blade element momentum."""
    blade_pitch = table_pitches()
    size = (len(blade_pitch), len(elements.radius), AHEAD + BEHIND + 1, load_components(elements))
    load = np.zeros(size, dtype=np.float32)
    _fill(load, blade_pitch, elements, elements.shape)
    return load


@kernel
def pitches_in_table(x, pitches):
    """Return whether the pitch of every blade lies in the table."""
    if pitches is None:
        return pitch_row(x[State.BLADE_PITCH]) >= 0.0
    inside = True
    for number in range(BLADES):
        inside = inside and pitch_row(pitch_of(number, x, pitches)) >= 0.0
    return inside


@inlined_kernel
def turn_and_response(turn, shape, table):
    """Return (Turn, Tabled) of a Turn within the table and the shape of the blade."""
    return turn, Tabled(rows_of(turn, table.load, shape), table.arm, shape)


@inlined_kernel
def _blade_response(number, first, x, shape, table, pitches):
    """Return (Turn, Tabled) of a blade; first: (Turn, Tabled) of the first blade."""
    if pitches is None:
        return first
    return turn_and_response(turn_like(first[0], pitch_of(number, x, pitches)), shape, table)


@inlined_kernel
def tabled_blade(number, first, x, flow, table, pitches, blades):
    """Return the Blade with this number; first: (Turn, Tabled) of the first blade."""
    elements = table.elements
    shape = shape_of(number, x, elements.shape, elements.modes, blades)
    turn, response = _blade_response(number, first, x, shape, table, pitches)
    place_stations(turn, shape)
    near = near_tower(flow, flow.tower)
    return Blade(number, motion_of(number, x, elements, flow), turn, shape, response, near)


@inlined_kernel
def box_force(blade, flow, field, boxed, elements):
    """Return the BladeForce in a wind box that contains the rotor (boxed); otherwise UNKNOWN_FORCE."""
    if field is None:
        return UNKNOWN_FORCE
    if not boxed:
        return UNKNOWN_FORCE
    return swept(box_wind(flow, blade.motion, field), blade, elements.radius)


@kernel
def sampled_force(blade, flow, elements, counters):
    """Return the BladeForce with the wind sampled at each station; inflows outside the table are solved."""
    sure = TabledOrSolved(blade.response, blade.turn, elements, counters)
    blade = Blade(blade.number, blade.motion, blade.turn, blade.shape, sure, blade.near)
    return swept(SampledWind(flow, blade.motion), blade, elements.radius)


@inlined_kernel
def _swept_stations(p, q, r, flow, reach, radius, shape):
    return sheared_forces(p, q, r, flow, reach, radius)


@inlined_kernel
def _bent_stations(p, q, r, flow, reach, radius, shape):
    return bent_forces(p, q, r, flow, reach, radius, p.near)


# (p, q, r, flow, reach, radius, shape) -> the three BladeForces of sheared_forces; shape: of p
_forces_of_three = chosen_by_class(
    "shape", {type(None): _swept_stations, BladeShape: _swept_stations, BentShape: _bent_stations}
)


@kernel
def section_table_load(t, pose, x, now, series, field, table, counters, pitches, blades):
    """Return the RotorLoad of the state x at time t from the station tables; arguments as in rotor_load.

    Error against rotor_load: rms 1e-4 of the standard deviation of thrust and torque over operating states.
    """
    if table is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    elements, shape = table.elements, table.elements.shape
    flow = rotor_flow(t, pose, now, series, field, elements)
    induction = faded_induction(x[State.ROTOR_SPEED], flow.hub.speed, elements)
    if not (induction == 1.0 and pitches_in_table(x, pitches)):
        return rotor_load(t, pose, x, now, series, field, elements, None, None, x, counters, pitches, blades)
    bent = shape_of(0, x, shape, elements.modes, blades)
    first, reach = (
        turn_and_response(turn_of(x[State.BLADE_PITCH]), bent, table),
        rotor_reach(elements.tip_radius, shape),
    )
    density = elements.air_density
    if elements.blades == BLADES and is_sheared(flow.hub, reach, field):
        p = tabled_blade(0, first, x, flow, table, None, blades)
        q = tabled_blade(1, first, x, flow, table, pitches, blades)
        r = tabled_blade(2, first, x, flow, table, pitches, blades)
        forces = _forces_of_three(p, q, r, flow, reach, elements.radius, bent)
        if stations_outside(forces) == 0:
            return load_of_three(p, q, r, forces, elements, pitches, blades)
    total, boxed = NO_LOAD, is_boxed(flow, reach, shape, field)
    for number in range(elements.blades):
        blade = tabled_blade(number, first, x, flow, table, pitches, blades)
        force = box_force(blade, flow, field, boxed, elements)
        if force.outside > 0:
            force = sampled_force(blade, flow, elements, counters)
        total = add_blade(total, blade, force.load, density, pitches, blades)
    return rotor_axes_load(total, density, elements)
