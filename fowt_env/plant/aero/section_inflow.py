"""Computes rotor loads with dynamic inflow or skewed wake from tables per blade station.

Loads in section_table.py include the induced velocity of the momentum balance. Here that velocity is changed
by the models of wake.py, so there are two tables: the quasi-steady induced velocity of a station over the
inflow direction, and the load over the direction of the local flow with the changed velocity, without
momentum balance. Directions, rows and limits of both tables are as in section_table.py. States, and loads
outside the tables, are as in rotor_load.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.blade_elements import (
    BladeElements,
    airload,
    blade_section,
    element_of,
    elements_key,
)
from fowt_env.plant.aero.blade_shape import effective_pitch, place_stations, turn_of
from fowt_env.plant.aero.blade_sweep import (
    NO_ROTOR_LOAD,
    Blade,
    SampledWind,
    faded_induction,
    is_sheared,
    load_of_three,
    motion_of,
    near_tower,
    rotor_flow,
    rotor_reach,
    shape_of,
    sheared_forces,
    stations_outside,
    swept,
)
from fowt_env.plant.aero.section_table import (
    LEAST_NORMAL,
    load_components,
    pitches_in_table,
    put_moment,
    station_arms,
    table_pitches,
)
from fowt_env.plant.aero.station_response import AHEAD, BEHIND, REVERSED, Induced, Lagging, WakeRate, rows_of
from fowt_env.plant.aero.unsteady_airfoil import airfoil_blade
from fowt_env.plant.aero.wake import (
    PER_ELEMENT,
    DynamicInflow,
    blade_skew,
    build_dynamic_inflow,
    skew_of,
    time_constants,
)
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.state import BLADES, State

LEAST_LAG = 1e-6  # s, lower limit of time constants where the wake has none


class DynamicSections(NamedTuple):
    """Holds induced velocity and load of the n stations of a blade over blade pitch and flow direction."""

    induced: np.ndarray  # (blade pitches, n, directions, 2) float32, normal and tangential; see _fill
    load: np.ndarray  # (blade pitches, n, directions, 2, or 3 of curved blades) float32; see _fill
    arm: np.ndarray  # (n,) m, radius at which the station's part of a straight blade's force acts
    ratio: np.ndarray  # (n,) tau_1 over tau_2
    elements: BladeElements  # of the exact solution
    wake: object  # DynamicInflow, or None: quasi-steady induction
    skew: object  # SkewedWake or None


@entry
def _fill(induced, load, blade_pitch, elements, shape):
    """Fill induced with quasi-steady induced velocities over v_normal + |v_tangential| of the inflow.

    load gets the columns of section_table._fill, for a local flow that includes the induced velocity.
    """
    for i in range(load.shape[0]):
        for j in range(load.shape[1]):
            weight = elements.weight[j] / elements.air_density
            turned = effective_pitch(j, blade_pitch[i], shape)
            element = element_of(j, turned, elements)
            for k in range(load.shape[2]):
                direction = k - REVERSED
                v_normal = direction / AHEAD if direction <= AHEAD else 1.0 - (direction - AHEAD) / BEHIND
                v_tangential = 1.0 - abs(v_normal)
                if direction > AHEAD:
                    v_tangential = -v_tangential
                cn, ct, square = airload(v_normal, v_tangential, element, elements.polars)
                load[i, j, k, 0] = weight * element.half_density_chord * square * cn
                load[i, j, k, 1] = weight * element.half_density_chord * square * ct
                put_moment(load[i, j, k], weight, v_normal, v_tangential, j, element, elements, shape)
                if direction >= 0:
                    v_normal = max(v_normal, LEAST_NORMAL)
                    section = blade_section(v_normal, v_tangential, turned, j, 1.0, elements)
                    induced[i, j, direction, 0] = section.induced_normal
                    induced[i, j, direction, 1] = section.induced_tangential


_tables = Cache(8)  # two per blade, 37 MB together: building takes about a second


def build_dynamic_sections(elements, wake, skew=None):
    """Return the DynamicSections of a BladeElements with DynamicInflow and SkewedWake, each or None.

    The cached tables serve all air densities.

    19 stations: 37 MB, 1 s compiled; many minutes with the JIT off (use rotor_load instead).
    """
    unit = elements._replace(air_density=1.0, airfoils=None, tower=None)
    induced, load = _tables.get(elements_key(unit), lambda: _filled_tables(unit))
    free = build_dynamic_inflow()
    lags = np.array([time_constants(0.0, 1.0, r, elements.tip_radius, free) for r in elements.radius])
    ratio = lags[:, 0] / lags[:, 1]
    return DynamicSections(induced, load, station_arms(elements), ratio, elements, wake, skew)


def _filled_tables(elements):
    """Return the arrays (induced, load) of DynamicSections, computed by blade element momentum."""
    blade_pitch = table_pitches()
    stations, directions = (len(blade_pitch), len(elements.radius)), AHEAD + BEHIND + 1
    induced = np.zeros((*stations, directions, 2), dtype=np.float32)
    load = np.zeros((*stations, REVERSED + directions, load_components(elements)), dtype=np.float32)
    _fill(induced, load, blade_pitch, elements, elements.shape)
    return induced, load


@inlined_kernel
def _pitch_rows(blade_pitch, shape, rotor):
    """Return (Turn, rows of induced velocity, rows of load) of a blade pitch (rad) within the table."""
    turn = turn_of(blade_pitch)
    return turn, rows_of(turn, rotor.induced, shape), rows_of(turn, rotor.load, shape)


@inlined_kernel
def _blade_rows(number, first, x, shape, rotor, pitches):
    """Return the _pitch_rows of a blade; first: _pitch_rows of the first blade."""
    if pitches is None:
        return first
    return _pitch_rows(pitch_of(number, x, pitches), shape, rotor)


@inlined_kernel
def _no_rate(wind_speed, elements, wake):
    return None


@inlined_kernel
def _rate(wind_speed, elements, wake):
    slow, _ = time_constants(0.0, wind_speed, 0.0, elements.tip_radius, DynamicInflow(wake.scale, 0.0))
    return WakeRate(1.0 / slow, 1.0 / max(wake.least, LEAST_LAG))


@inlined_kernel
def _induced(number, induced, load, shape, skewed, airfoils, rate, rotor, x, dx):
    return Induced(induced, load, rotor.arm, shape, skewed, airfoils, rotor.elements.weight)


@inlined_kernel
def _lagging(number, induced, load, shape, skewed, airfoils, rate, rotor, x, dx):
    elements = rotor.elements
    state = State.INTERNAL + PER_ELEMENT * elements.radius.shape[0] * number
    return Lagging(
        state, induced, load, rate, rotor.ratio, rotor.arm, shape, skewed, airfoils, elements.weight, x, dx
    )


# (wind_speed, elements, wake) -> WakeRate in a wind relative to the hub, m/s; None without dynamic inflow
_wake_rate = chosen_by_class("wake", {type(None): _no_rate, DynamicInflow: _rate})
# (number, induced, load, shape, skewed, airfoils, rate, rotor, x, dx) -> response of a blade
_response = chosen_by_class("rate", {type(None): _induced, WakeRate: _lagging})


@inlined_kernel
def _blade(number, first, x, flow, rate, skewed, rotor, dx, pitches, blades):
    """Return the Blade with this number; first: _pitch_rows of the first blade."""
    elements = rotor.elements
    shape = shape_of(number, x, elements.shape, elements.modes, blades)
    turn, induced, load = _blade_rows(number, first, x, shape, rotor, pitches)
    place_stations(turn, shape)
    motion = motion_of(number, x, elements, flow)
    of_blade = blade_skew(skewed, rotor.skew, motion, elements)
    airfoils = airfoil_blade(number, turn.pitch, shape, elements, elements.airfoils, x, dx)
    response = _response(number, induced, load, shape, of_blade, airfoils, rate, rotor, x, dx)
    return Blade(number, motion, turn, shape, response, near_tower(flow, flow.tower))


@kernel
def _sampled_force(blade, flow, radius):
    """Return the BladeForce with the wind sampled at each station."""
    return swept(SampledWind(flow, blade.motion), blade, radius)


@kernel
def _tabled_load(flow, x, rotor, dx, pitches, blades):
    """Return (stations outside the tables, RotorLoad) of a fast three-bladed rotor, pitched within them."""
    elements, shape, radius = rotor.elements, rotor.elements.shape, rotor.elements.radius
    rate, skewed = _wake_rate(flow.hub.speed, elements, rotor.wake), skew_of(flow.hub, rotor.skew)
    bent = shape_of(0, x, shape, elements.modes, blades)
    first, reach = _pitch_rows(x[State.BLADE_PITCH], bent, rotor), rotor_reach(elements.tip_radius, shape)
    p = _blade(0, first, x, flow, rate, skewed, rotor, dx, None, blades)
    q = _blade(1, first, x, flow, rate, skewed, rotor, dx, pitches, blades)
    r = _blade(2, first, x, flow, rate, skewed, rotor, dx, pitches, blades)
    if is_sheared(flow.hub, reach, flow.field):
        forces = sheared_forces(p, q, r, flow, reach, radius)
    else:
        forces = (
            _sampled_force(p, flow, radius),
            _sampled_force(q, flow, radius),
            _sampled_force(r, flow, radius),
        )
    return stations_outside(forces), load_of_three(p, q, r, forces, elements, pitches, blades)


@kernel
def dynamic_sections_load(t, pose, x, now, series, field, rotor, dx, counters, pitches, blades):
    """Return the RotorLoad of the state x at time t with its wake states; arguments as in rotor_load.

    rotor_load computes the load if there are not three blades or a station lies outside the tables.
    """
    if rotor is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    elements = rotor.elements
    flow = rotor_flow(t, pose, now, series, field, elements)
    induction = faded_induction(x[State.ROTOR_SPEED], flow.hub.speed, elements)
    if elements.blades == BLADES and induction == 1.0 and pitches_in_table(x, pitches):
        outside, load = _tabled_load(flow, x, rotor, dx, pitches, blades)
        if outside == 0:
            return load
    return rotor_load(
        t, pose, x, now, series, field, elements, rotor.skew, rotor.wake, dx, counters, pitches, blades
    )
