"""Runs the compiled loop of a simulation: control periods with a law, and output rows."""

from typing import NamedTuple

from fowt_env.loop.period import all_finite, apply_command, begin_period, show_command
from fowt_env.loop.protection import has_ended, is_supervised, supervise_turbine
from fowt_env.plant.advance import BAD_COMMAND, RUNNING, TRIPPED, observe_plant, output_plant, status_of
from fowt_env.plant.blade_pitches import spread_command
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.integrators import take_step


class Schedule(NamedTuple):
    """Holds the schedule of control periods and output rows of a rollout, in steps of dt from its start."""

    dt: float  # s
    per_control: int  # steps in a control period
    per_output: int  # steps from one output row to the next
    last: int  # step at which the run ends, with a row
    individual: bool = False  # whether the law commands each blade, else one pitch for all
    external: bool = False  # whether commands come from an external controller, after begin_command
    begun: bool = False  # whether begin_command has begun the first control period of a rollout


@kernel
def observe_and_begin(step, model, data, x, u, interface, link, schedule):
    """Measure at a control instant and begin its period. Returns whether the law is not to command."""
    t = step * schedule.dt
    observe_plant(model, data, x, u, t, link.dx, link.measurement)
    return begin_period(step // schedule.per_control, t, x, model, interface, link)


@entry
def begin_command(handle, x, u, linked, schedule, step):
    """Begin a control period for an external controller; link.command then holds the command in force.

    Returns whether the turbine is being stopped or started: commands of the controller are then ignored.
    """
    model, data, interface, link = model_of(handle), data_of(handle), model_of(linked), data_of(linked)
    stopping = observe_and_begin(step, model, data, x, u, interface, link, schedule)
    if not stopping:
        show_command(u, interface, schedule.individual, model.pitches, link)
    return stopping


@entry
def rollout(handle, x, u, law, parameters, memory, linked, schedule, first, end, out):
    """Run the closed loop over steps first <= step < end, and the last instant of the run; write rows to out.

    law         compiled control law (CompiledController.law), called at every control instant
    linked      Handle of the run's Interface and InterfaceData
    out         (k, n_channels) output rows, SI
    Returns (status, step reached, rows written). x (n_state,), u, memory and the InterfaceData are updated.
    While the guard stops or starts the turbine, the law is not called. With schedule.external, begin_command
    has begun the period of `first`, and no other control instant may lie before end.
    """
    model, data, interface, link = model_of(handle), data_of(handle), model_of(linked), data_of(linked)
    return _roll(model, data, x, u, law, parameters, memory, interface, link, schedule, first, end, out)


@inlined_kernel
def _roll(model, data, x, u, law, parameters, memory, interface, link, schedule, first, end, out):
    """Run the loop of rollout, as a kernel: in an entry each slice counts references."""
    dt, rows = schedule.dt, 0
    for step in range(first, end + 1):
        t = step * dt
        ending = step == schedule.last
        if step == end and not ending:
            break
        if ending or step % schedule.per_control == 0:
            if ending or not (schedule.external or (schedule.begun and step == first)):
                observe_and_begin(step, model, data, x, u, interface, link, schedule)
            if has_ended(interface.guard, link):
                return TRIPPED, step, rows
        if not ending and step % schedule.per_control == 0:
            if is_supervised(interface.guard, link):
                supervise_turbine(x, interface.guard, link)
            else:
                if not schedule.external:
                    show_command(u, interface, schedule.individual, model.pitches, link)
                    law(parameters, memory, link.law_reading, link.command)
                if not schedule.individual:
                    spread_command(link.command)
                if not all_finite(link.command):
                    return BAD_COMMAND, step, rows
            apply_command(t, x, u, model, data, interface, link)
        if ending or step % schedule.per_output == 0:
            if rows == out.shape[0]:
                raise IndexError("rollout: out has too few rows")
            output_plant(model, data, x, u, t, link.dx, out[rows])
            rows += 1
        if ending:
            break
        take_step(t, x, u, dt, model, model.integrator, data)
        status = status_of(x)
        if status != RUNNING:
            return status, step + 1, rows
    return RUNNING, end, rows
