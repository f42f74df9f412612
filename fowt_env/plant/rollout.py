"""Fixed-step advance of one plant, and the compiled loop of a whole run with its controller."""

from math import isfinite
from typing import NamedTuple

import numpy as np

from fowt_env.plant.blade_pitches import spread_command
from fowt_env.plant.channels import measure, record
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.drivetrain import followed_torque, lose_torque, torque_was_limited
from fowt_env.plant.dynamics import loads_of
from fowt_env.plant.hydro.radiation import forget_memory
from fowt_env.plant.integrators import rates, take_step
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.protection import (
    Stop,
    Watch,
    break_drives,
    break_sensors,
    own_command,
    stop_turbine,
    watch_turbine,
)
from fowt_env.plant.sensing import Setting, read
from fowt_env.plant.state import BLADES, Command, State

RUNNING, NON_FINITE, CAPSIZED, OVERSPEED, BLOWN_UP, BAD_COMMAND = 0, 1, 2, 3, 4, 5
CAPSIZE = 1.4  # rad (80 deg) of platform pitch: the Euler angles are singular at 90 deg
# No floating platform moves as fast: a state beyond is the time step's doing, not the sea's. A hull that
# capsizes passes 80 deg at some 0.5 rad/s.
FASTEST, FASTEST_TURN = 100.0, 10.0  # m/s, rad/s
STOP_REASONS = {
    NON_FINITE: "non-finite state",
    CAPSIZED: "capsize (platform pitch beyond 80 deg)",
    OVERSPEED: "overspeed (rotor speed beyond the turbine file's limit)",
    BLOWN_UP: f"numerical blow-up (platform faster than {FASTEST:g} m/s or {FASTEST_TURN:g} rad/s): loads too"
    " stiff for the time step",
    BAD_COMMAND: "the controller's command is not finite (what its information does not declare, it reads as"
    " NaN)",
}


@kernel
def status_of(x):
    """RUNNING, NON_FINITE, BLOWN_UP or CAPSIZED for a state."""
    for value in x:
        if not isfinite(value):
            return NON_FINITE
    for i in range(3):
        if abs(x[State.VX + i]) > FASTEST or abs(x[State.WX + i]) > FASTEST_TURN:
            return BLOWN_UP
    if abs(x[State.PLATFORM_PITCH]) > CAPSIZE:
        return CAPSIZED
    return RUNNING


@kernel
def advance_plant(model, data, x, u, first, n, dt):
    """Advance x by n steps from time first*dt under constant u; returns the status."""
    for i in range(n):
        take_step((first + i) * dt, x, u, dt, model, model.integrator, data)
        status = status_of(x)
        if status != RUNNING:
            return status
    return RUNNING


@entry
def advance(handle, x, u, first, n, dt):
    """Advance x (n_state,) in place by n steps of dt under constant u (n_commands,); returns the status."""
    return advance_plant(model_of(handle), data_of(handle), x, u, first, n, dt)


@inlined_kernel
def observe_plant(model, data, x, u, t, dx, measurement):
    """Fill dx and measurement as observe does."""
    rates(t, x, u, model, data, dx)
    measure(model, data, x, dx, u, t, measurement)


@inlined_kernel
def output_plant(model, data, x, u, t, dx, row):
    """Fill dx and one output row as output does."""
    rates(t, x, u, model, data, dx)
    record(model, data, x, dx, u, t, loads_of(data, dx), row)


@entry
def observe(handle, x, u, t, dx, measurement):
    """Fill dx (n_state,) and measurement (Scene.n_measurements,) at time t under u.

    The loads kept by the data arrays are used where they are fresh: after changing x from outside,
    call forget first.
    """
    observe_plant(model_of(handle), data_of(handle), x, u, t, dx, measurement)


@entry
def output(handle, x, u, t, dx, row):
    """Fill one output row (n_channels,) in SI at time t under u; cached loads as in observe."""
    output_plant(model_of(handle), data_of(handle), x, u, t, dx, row)


@entry
def forget(handle):
    """Drop cached loads, past derivatives and past velocities: the state was changed from outside."""
    data_of(handle).cache[LoadCache.VALID] = 0.0
    data_of(handle).cache[LoadCache.STEPS] = 0.0
    forget_memory(data_of(handle).radiation)


def output_row(handle, x, u, t, size):
    """One output row (size,) in SI of any state at time t under u."""
    row = np.empty(size)
    forget(handle)
    output(handle, x, u, float(t), np.zeros_like(x), row)
    return row


@kernel
def follow_torque(t, torque, u, period, generator, grid_loss, cache):
    """Put the torque that the generator reaches into u, in place of the command there.

    torque: what was in force before, N m; period: s until the next command. From the time grid_loss (s) on
    the generator is off the grid and has no torque at once, whatever is commanded.
    """
    command = u[Command.GENERATOR_TORQUE]
    limited = 0.0
    if t >= grid_loss:
        reached = 0.0
    else:
        reached = followed_torque(torque, command, period, generator)
        limited = 1.0 if torque_was_limited(reached, command, generator) else 0.0
    u[Command.GENERATOR_TORQUE] = reached
    cache[LoadCache.TORQUE_LIMITED] = limited


class Schedule(NamedTuple):
    """When a rollout steps, controls and records, in steps of dt from the run's beginning."""

    dt: float  # s
    per_control: int  # steps in a control period
    per_output: int  # steps from one output row to the next
    last: int  # step at which the run ends, with a row
    overspeed: float  # rotor speed (rad/s) beyond which the run ends at the next control instant
    grid_loss: float  # s, time from which the generator has no torque
    individual: bool = False  # whether the law commands each blade, else one pitch for all


@kernel
def hide_command(u, hidden, individual, pitches):
    """Hide of the command in force what a law that is about to overwrite it does not declare."""
    u[Command.GENERATOR_TORQUE] += hidden[Measure.GENERATOR_TORQUE]
    if not hide_pitches(u, hidden, individual, pitches):
        u[Command.BLADE_PITCH] += hidden[Measure.BLADE_PITCH]


@kernel
def hide_pitches(u, hidden, individual, pitches):
    """As hide_command, of a law that commands each blade. Returns whether it does."""
    if pitches is None:
        return False
    if individual:
        for blade in range(BLADES):
            u[Command.BLADE_PITCH + blade] += hidden[N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + blade]
    return individual


@kernel
def all_finite(values):
    """Whether every entry is finite."""
    for value in values:
        if not isfinite(value):
            return False
    return True


@entry
def rollout(
    handle, x, u, law, parameters, memory, reading, guarding, measurement, dx, schedule, first, end, out
):
    """Closed loop over the instants first <= step < end, and at the run's last one; rows go to out.

    law         compiled control law (CompiledController.law), called at every control instant
    reading     Handle whose data is the Reader that stands between measurement and law
    guarding    Handle whose data is the Guard of the run: once it stops the turbine, the law is not called
    first       = end: nothing moves, and measurement and the reader's reading are filled as at that instant
    out         (k, n_channels) of the rows to come, SI
    Returns (status, step reached, rows written). x (n_state,), u, memory, the reader, the guard and
    measurement are written.
    """
    model, data = model_of(handle), data_of(handle)
    reader, guard = data_of(reading), data_of(guarding)
    dt, rows = schedule.dt, 0
    if first == end:
        observe_plant(model, data, x, u, first * dt, dx, measurement)
        read(reader, first // schedule.per_control, first * dt, measurement)
        break_sensors(first * dt, guard, reader)
        return RUNNING, first, rows
    for step in range(first, end + 1):
        t = step * dt
        ending = step == schedule.last
        if step == end and not ending:
            break
        if (ending or step % schedule.per_control == 0) and x[State.ROTOR_SPEED] > schedule.overspeed:
            return OVERSPEED, step, rows
        if not ending and step % schedule.per_control == 0:
            observe_plant(model, data, x, u, t, dx, measurement)
            torque, grid_loss = u[Command.GENERATOR_TORQUE], schedule.grid_loss
            if watch_turbine(t, x, dx, u, measurement, model, guard):
                stop_turbine(x, u, guard)
                if int(guard.watch[Watch.STOP]) == Stop.EMERGENCY:
                    grid_loss = t
            else:
                own_command(u, guard)
                read(reader, step // schedule.per_control, t, measurement)
                break_sensors(t, guard, reader)
                hide_command(u, reader.sensors.chain[Setting.HIDDEN], schedule.individual, model.pitches)
                law(parameters, memory, reader.reading, u)
                if not schedule.individual:
                    spread_command(u, model.pitches)
                if not all_finite(u):
                    return BAD_COMMAND, step, rows
            break_drives(t, x, u, model, guard)
            follow_torque(t, torque, u, schedule.per_control * dt, model.generator, grid_loss, data.cache)
            if t >= grid_loss:
                lose_torque(x, model.converter)
        if ending or step % schedule.per_output == 0:
            if rows == out.shape[0]:
                raise IndexError("rollout: out has too few rows")
            output_plant(model, data, x, u, t, dx, out[rows])
            rows += 1
        if ending:
            break
        take_step(t, x, u, dt, model, model.integrator, data)
        status = status_of(x)
        if status != RUNNING:
            return status, step + 1, rows
    return RUNNING, end, rows
