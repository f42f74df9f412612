"""Computes the generalised forces of structure and aerodynamics on the modes of bending blades."""

from fowt_env.plant.aero.blade_sweep import shape_of
from fowt_env.plant.compile.decorators import inlined_kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.compile.vector_sums import lane_dot
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.state import BLADES


@inlined_kernel
def _add_aerodynamics(shape, force):
    """Add the forces of the station loads of a BentShape to force (n,)."""
    size = shape.modes.size
    for i in range(len(shape.modes.count)):
        force[i] += lane_dot(shape.modal[size * i : size * (i + 1)], shape.loads[:size], size)


@inlined_kernel
def _aerodynamic_forces(x, aero, blades, loads, work):
    if aero is None:
        return
    elements = aero.rotor.elements
    for number in range(BLADES):
        shape = shape_of(number, x, elements.shape, elements.modes, loads)
        _add_aerodynamics(shape, work.force[number])


@inlined_kernel
def _no_forces(x, aero, blades, loads, work):
    return


@inlined_kernel
def _modal_forces(x, aero, blades, loads, work):
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
    _aerodynamic_forces(x, aero, blades, loads, work)


# (x, aero, blades, loads, work): generalised forces on the blade modes into work.force
fill_blade_forces = chosen_by_class("blades", {type(None): _no_forces, BladeModes: _modal_forces})
