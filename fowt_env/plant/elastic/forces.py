"""Computes the generalised forces of structure and aerodynamics on the modes of bending blades."""

from math import sqrt

from fowt_env.plant.aero.blade_shape import N_STATION_LOAD, bent_attitude, turn_of
from fowt_env.plant.aero.blade_sweep import shape_of
from fowt_env.plant.blade_pitches import pitch_of
from fowt_env.plant.compile.decorators import inlined_kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.state import BLADES


@inlined_kernel
def _add_aerodynamics(turn, shape, force):
    """Add the forces of the station loads of a BentShape to force (n,)."""
    m, q = shape.modes, shape.q
    n = len(m.count)
    for j in range(m.x.shape[0]):
        at = N_STATION_LOAD * j
        fn, ft, moment = shape.loads[at], shape.loads[at + 1], shape.loads[at + 2]
        back = 0.0
        for i in range(n):
            back += m.load_axial[j, i] * q[i]
        lean = bent_attitude(j, turn, shape).lean
        up = sqrt(1.0 - lean * lean)
        fx, fy = turn.cosine * up * fn + turn.sine * ft, turn.sine * up * fn - turn.cosine * ft
        mx, my = turn.cosine * lean * moment, turn.sine * lean * moment
        for i in range(n):
            shorter = m.load_axial[j, i]
            for k in range(n):
                shorter += m.load_shortening[j, i, k] * q[k]
            force[i] += (
                fx * m.load_x[j, i] + fy * m.load_y[j, i] + lean * fn * shorter
                + (my - fx * back) * m.slope_x[j, i] - (mx + fy * back) * m.slope_y[j, i]
            )  # fmt: skip


@inlined_kernel
def _aerodynamic_forces(x, aero, pitches, blades, loads, work):
    if aero is None:
        return
    elements = aero.rotor.elements
    for number in range(BLADES):
        shape = shape_of(number, x, elements.shape, elements.modes, loads)
        _add_aerodynamics(turn_of(pitch_of(number, x, pitches)), shape, work.force[number])


@inlined_kernel
def _no_forces(x, aero, pitches, blades, loads, work):
    return


@inlined_kernel
def _modal_forces(x, aero, pitches, blades, loads, work):
    beam = blades.beam
    n = len(beam.count)
    for number in range(BLADES):
        q = blades.first + n * number
        v = q + BLADES * n
        for i in range(n):
            total = 0.0
            for j in range(n):
                total -= beam.stiffness[i, j] * x[q + j] + beam.damping[i, j] * x[v + j]
            work.force[number, i] = total
    _aerodynamic_forces(x, aero, pitches, blades, loads, work)


# (x, aero, pitches, blades, loads, work): generalised forces on the blade modes into work.force
fill_blade_forces = chosen_by_class(
    "blades", {type(None): _no_forces, BladeModes: _modal_forces}, inlined=True
)
