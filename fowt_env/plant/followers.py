"""Advances the states that follow the platform within a time step: radiation memory and mooring lines.

They are the last of the state vector and have no rates: once an integrator knows the motion of the platform
over a step or half of it, they are advanced by their own steps.
"""

from fowt_env.plant.compile.decorators import inlined_kernel
from fowt_env.plant.hydro import radiation
from fowt_env.plant.hydro.radiation import begin_memory, end_memory, memory_after
from fowt_env.plant.line_dynamics import begin_lines, end_lines, lines_after, states_before_lines


@inlined_kernel
def integrated_states(x, model):
    """Return the number of states that an integrator advances by their rates: all but the followers."""
    return states_before_lines(radiation.integrated_states(x, model.hydro), model.mooring)


@inlined_kernel
def begin_followers(x, dt, halves, model, data):
    """Begin a step of dt from x; halves: whether follow is called at half a step."""
    plane = model.rigid_body.plane
    begin_memory(x, dt, halves, plane, model.hydro, data.radiation)
    begin_lines(x, plane, model.mooring, data.line_work)


@inlined_kernel
def follow(x, y, half, dt, model, data):
    """Fill y, of known motion of the platform, with the followers a step dt (half: half of it) after x."""
    plane = model.rigid_body.plane
    memory_after(x, y, half, plane, model.hydro, data.radiation)
    lines_after(x, y, 0.5 * dt if half else dt, plane, model.mooring, data.lines, data.line_work)


@inlined_kernel
def end_followers(x, dt, model, data):
    """Advance the followers of x to the end of a step of dt; all other states of x are already there."""
    plane = model.rigid_body.plane
    end_memory(x, plane, model.hydro, data.radiation)
    end_lines(x, dt, plane, model.mooring, data.lines, data.line_work)
