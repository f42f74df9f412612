"""Computes wind loads of the rotor, by the scene's rotor model, and of the tower."""

from typing import NamedTuple

from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.blade_sweep import RotorLoad
from fowt_env.plant.aero.coefficient_table import CoefficientTable, coefficient_table_load
from fowt_env.plant.aero.section_inflow import DynamicSections, dynamic_sections_load
from fowt_env.plant.aero.section_table import SectionTable, section_table_load
from fowt_env.plant.aero.tower_drag import bent_tower_load, tower_load
from fowt_env.plant.aero.unsteady_airfoil import step_airfoils
from fowt_env.plant.aero.wake import PER_ELEMENT
from fowt_env.plant.aero.wind import WindSeries, wind_at, wind_now
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.tower import TowerModes
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import NO_LOAD, State, Wrench
from fowt_env.plant.tilt import rotor_pose, to_body_axes


class BemRotor(NamedTuple):
    """Holds the data of blade element momentum at every station, and of the optional wake models."""

    elements: object  # blade_elements.BladeElements
    skew: object  # wake.SkewedWake or None
    wake: object  # wake.DynamicInflow or None


class Aero(NamedTuple):
    """Holds the wind and the parts of the turbine on which the wind acts."""

    wind: WindSeries
    field: object  # wind_field.WindField, which replaces the series, or None
    rotor: object  # BemRotor, SectionTable, DynamicSections or CoefficientTable
    tilt: object  # tilt.Tilt of the shaft or None
    tower: object  # tower_drag.TowerDrag or None


class AeroLoad(NamedTuple):
    """Holds wind loads: tower in body axes about the body origin, rotor in axes and origin of the nacelle."""

    rotor: RotorLoad
    tower: Wrench


NO_AERO_LOAD = AeroLoad(RotorLoad(NO_LOAD, 0.0, 0.0), NO_LOAD)


@inlined_kernel
def _solved(t, pose, x, now, aero, rotor, dx, counters, pitches, blades):
    return rotor_load(
        t, pose, x, now, aero.wind, aero.field, rotor.elements, rotor.skew, rotor.wake, dx, counters, pitches,
        blades,
    )  # fmt: skip


@inlined_kernel
def _by_sections(t, pose, x, now, aero, rotor, dx, counters, pitches, blades):
    return section_table_load(t, pose, x, now, aero.wind, aero.field, rotor, counters, pitches, blades)


@inlined_kernel
def _by_dynamic_sections(t, pose, x, now, aero, rotor, dx, counters, pitches, blades):
    return dynamic_sections_load(t, pose, x, now, aero.wind, aero.field, rotor, dx, counters, pitches, blades)


@inlined_kernel
def _by_coefficients(t, pose, x, now, aero, rotor, dx, counters, pitches, blades):
    return coefficient_table_load(pose, x, now, aero.wind, rotor, counters)


# (t, pose, x, now, aero, rotor, dx, counters, pitches, blades) -> RotorLoad, pose and load in rotor axes
_rotor_model = chosen_by_class(
    "rotor",
    {
        BemRotor: _solved,
        SectionTable: _by_sections,
        DynamicSections: _by_dynamic_sections,
        CoefficientTable: _by_coefficients,
    },
)


@inlined_kernel
def _step_no_rotor(x, dt, rotor, rates, y):
    return


@inlined_kernel
def _step_rotor(x, dt, rotor, rates, y):
    step_airfoils(x, dt, rotor.elements.airfoils, rotor.elements, rates, y)


# (x, dt, rotor, rates, y): puts the states of the airfoils after a step of dt from x into y
_step_airfoils = chosen_by_class(
    "rotor",
    {
        BemRotor: _step_rotor,
        SectionTable: _step_no_rotor,
        DynamicSections: _step_rotor,
        CoefficientTable: _step_no_rotor,
    },
)


@inlined_kernel
def step_air(x, dt, aero, rates, y):
    """Put the states that integrators do not advance after a step of dt (s) from x into y.

    rates: of the internal states at x. The states are those of unsteady airfoils.
    """
    if aero is None:
        return
    _step_airfoils(x, dt, aero.rotor, rates, y)


@kernel
def settled_wake(t, pose, x, now, aero, rotor, dx, counters, pitches, blades):
    """Set the wake states of x to their steady values for the other states; return the number of wake states.

    The filter is linear in its states: the rates at two values of the first stage, 0 and 1, give its
    steady value 0.4 W_qs, whatever the time constants. pose: in rotor axes; rotor: DynamicSections, or
    BemRotor with dynamic inflow; dx: scratch, (n_state,).
    """
    count = PER_ELEMENT * rotor.elements.blades * rotor.elements.radius.shape[0]
    for i in range(State.INTERNAL, State.INTERNAL + count):
        x[i] = 0.0
    _rotor_model(t, pose, x, now, aero, rotor, dx, counters, pitches, blades)
    for i in range(State.INTERNAL, State.INTERNAL + count, 2):
        x[i + 1] = dx[i]
        x[i] = 1.0
    _rotor_model(t, pose, x, now, aero, rotor, dx, counters, pitches, blades)
    for i in range(State.INTERNAL, State.INTERNAL + count, 2):
        x[i] = x[i + 1] / (x[i + 1] - dx[i])
        x[i + 1] = x[i] / 0.4
        dx[i] = dx[i + 1] = 0.0
    return count


@inlined_kernel
def rotor_part(t, pose, x, now, aero, rotor, dx, counters, pitches, blades):
    """Return the RotorLoad of a rotor model in the axes of pose; write only the wake rates of dx.

    pitches, blades: individual blade pitches and the output array of blade loads, as in rotor_load.
    """
    load = _rotor_model(t, rotor_pose(pose, aero.tilt), x, now, aero, rotor, dx, counters, pitches, blades)
    return RotorLoad(to_body_axes(load.wrench, aero.tilt), load.thrust, load.torque)


@kernel
def _straight_drag(t, pose, x, now, aero, modes, modal):
    return tower_load(t, pose, now, aero.wind, aero.field, aero.tower)


@kernel
def _bent_drag(t, pose, x, now, aero, modes, modal):
    return bent_tower_load(t, pose, x, now, aero.wind, aero.field, aero.tower, modes, modal)


# (t, pose, x, now, aero, modes, modal) -> Wrench; forces on tower deflections are added to modal
_drag = chosen_by_class("modes", {type(None): _straight_drag, TowerModes: _bent_drag})


@inlined_kernel
def aero_load(t, pose, nacelle, x, aero, pitches, modes, data, dx):
    """Return the AeroLoad at a state; put wake rates into dx, add modal forces of tower drag to data.cache.

    nacelle: nacelle_pose, the axes and origin of the rotor load. modes: TowerModes or None.
    """
    if aero is None:
        return NO_AERO_LOAD
    now = wind_now(t, aero.wind)
    rotor = rotor_part(t, nacelle, x, now, aero, aero.rotor, dx, data.counters, pitches, data.blades)
    return AeroLoad(rotor, _drag(t, pose, x, now, aero, modes, data.cache[LoadCache.MODAL :]))


@kernel
def wind_of(t, X, Y, Z, aero):
    """Return the wind (u, v, w), m/s, inertial components, at an inertial point (m); zero if aero is None."""
    if aero is None:
        return 0.0, 0.0, 0.0
    return wind_at(t, X, Y, Z, wind_now(t, aero.wind), aero.wind, aero.field)
