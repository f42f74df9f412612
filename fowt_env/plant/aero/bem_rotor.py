"""Computes rotor loads by blade element momentum at every station of every blade (theory.md, 5.1).

The wind is sampled at the present position of each station. On a parked or slow rotor the induction fades
out between the tip-speed ratios FAST_ROTOR and SLOW_ROTOR (as in AeroDyn); below SLOW_ROTOR there is no
induction, at any angle of attack.
"""

from fowt_env.plant.aero.blade_shape import place_stations, turn_of
from fowt_env.plant.aero.blade_sweep import (
    NO_ROTOR_LOAD,
    Blade,
    SampledWind,
    add_blade,
    faded_induction,
    motion_of,
    near_tower,
    rotor_axes_load,
    rotor_flow,
    shape_of,
    swept,
)
from fowt_env.plant.aero.station_response import Solved
from fowt_env.plant.aero.unsteady_airfoil import airfoil_blade
from fowt_env.plant.aero.wake import skew_of
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import NO_LOAD, State


@kernel
def rotor_load(t, pose, x, now, series, field, rotor, skew, wake, dx, counters, pitches, blades):
    """Return the RotorLoad of the state x at time t in rotor axes; theory.md, 5.1. No rotor or no wind: zero.

    pose                in rotor axes (tilt.py)
    now, series, field  wind (wind.py), sampled at the present position of every station
    skew, wake          optional SkewedWake and DynamicInflow (wake.py)
    dx                  rates of the state: only those of wake and airfoil states are written
    counters            counters[Counter.BEM_FALLBACK] is incremented for each station without a root
    pitches             BladePitches, or None: one pitch for all blades
    blades              with pitches: output, the BladeLoad of each blade, (blades, 6)
    """
    if rotor is None:
        return NO_ROTOR_LOAD
    if series is None:
        return NO_ROTOR_LOAD
    flow = rotor_flow(t, pose, now, series, field, rotor)
    wind_speed = flow.hub.speed
    induction = faded_induction(x[State.ROTOR_SPEED], wind_speed, rotor)
    skewed = skew_of(flow.hub, skew)
    total = NO_LOAD
    for number in range(rotor.blades):
        motion, turn = motion_of(number, x, rotor, flow), turn_of(pitch_of(number, x, pitches))
        shape = shape_of(number, x, rotor.shape, rotor.modes, blades)
        place_stations(turn, shape)
        airfoils = airfoil_blade(number, turn.pitch, shape, rotor, rotor.airfoils, x, dx)
        response = Solved(
            number, turn, motion, shape, induction, wind_speed, skewed, skew, wake, airfoils, x, dx, counters,
            rotor,
        )  # fmt: skip
        blade = Blade(number, motion, turn, shape, response, near_tower(flow, flow.tower))
        force = swept(SampledWind(flow, motion), blade, rotor.radius)
        total = add_blade(total, blade, force.load, 1.0, pitches, blades)
    return rotor_axes_load(total, 1.0, rotor)
