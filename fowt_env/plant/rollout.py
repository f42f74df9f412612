"""Fixed-step advance of one plant, and the compiled loop of a whole run with its controller."""

from math import isfinite

import numpy as np

from fowt_env.plant.channels import measure, record
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.drivetrain import followed_torque, torque_was_limited
from fowt_env.plant.dynamics import Kept, loads_of
from fowt_env.plant.integrators import rates, take_step
from fowt_env.plant.state import State

RUNNING, NON_FINITE, CAPSIZED, OVERSPEED, BLOWN_UP = 0, 1, 2, 3, 4
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
def advance_scene(scene, work, x, u, first, n, dt):
    """Advance x by n steps from time first*dt under constant u; returns the status."""
    for i in range(n):
        take_step((first + i) * dt, x, u, dt, scene, scene.multistep, work)
        status = status_of(x)
        if status != RUNNING:
            return status
    return RUNNING


@entry
def advance(box, x, u, first, n, dt):
    """Advance x (n_state,) in place by n steps of dt under constant u (2,); returns the status."""
    return advance_scene(model_of(box), data_of(box), x, u, first, n, dt)


@inlined_kernel
def observe_scene(scene, work, x, u, t, dx, measurement):
    """Fill dx and measurement as observe does."""
    rates(t, x, u, scene, work, dx)
    measure(scene, work, x, dx, u, t, measurement)


@inlined_kernel
def output_scene(scene, work, x, u, t, dx, row):
    """Fill dx and one output row as output does."""
    rates(t, x, u, scene, work, dx)
    record(scene, work, x, dx, u, t, loads_of(work, dx), row)


@entry
def observe(box, x, u, t, dx, measurement):
    """Fill dx (n_state,) and measurement (N_MEASUREMENTS,) at time t under u.

    The loads kept by the work arrays are used where they are fresh: after changing x from outside,
    call forget first.
    """
    observe_scene(model_of(box), data_of(box), x, u, t, dx, measurement)


@entry
def output(box, x, u, t, dx, row):
    """Fill one output row (n_channels,) in SI at time t under u; kept loads as in observe."""
    output_scene(model_of(box), data_of(box), x, u, t, dx, row)


@entry
def forget(box):
    """Drop kept loads and past derivatives: the state was changed from outside."""
    data_of(box).kept[Kept.FRESH] = 0.0
    data_of(box).kept[Kept.STEPS] = 0.0


def output_row(box, x, u, t, size):
    """One output row (size,) in SI of any state at time t under u."""
    row = np.empty(size)
    forget(box)
    output(box, x, u, float(t), np.zeros_like(x), row)
    return row


@kernel
def follow_torque(t, torque, u, period, generator, grid_loss, kept):
    """Put the torque that the generator reaches into u[0], in place of the command there.

    torque: what was in force before, N m; period: s until the next command. From the time grid_loss (s) on
    the generator is off the grid and has no torque at once, whatever is commanded.
    """
    command = u[0]
    if t >= grid_loss:
        u[0] = 0.0
        kept[Kept.TORQUE_LIMITED] = 0.0
        return
    u[0] = followed_torque(torque, command, period, generator)
    kept[Kept.TORQUE_LIMITED] = 1.0 if torque_was_limited(u[0], command, generator) else 0.0


@entry
def command(box, u, t, torque, blade_pitch, period, grid_loss):
    """Put a command (N m, rad) into u as the plant takes it for a control period; see follow_torque."""
    before = u[0]
    u[0] = torque
    u[1] = blade_pitch
    follow_torque(t, before, u, period, model_of(box).generator, grid_loss, data_of(box).kept)


@kernel
def run_scene(
    scene, work, x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output, overspeed,
    grid_loss, first, last, out,
):  # fmt: skip
    """Closed loop as in run."""
    rows = 0
    for step in range(first, last):
        t = step * dt
        if step % per_control == 0:
            if x[State.ROTOR_SPEED] > overspeed:
                return OVERSPEED, step, rows
            observe_scene(scene, work, x, u, t, dx, measurement)
            torque = u[0]
            act(parameters, memory, measurement, u)
            follow_torque(t, torque, u, per_control * dt, scene.generator, grid_loss, work.kept)
        if step % per_output == 0:
            output_scene(scene, work, x, u, t, dx, out[rows])
            rows += 1
        take_step(t, x, u, dt, scene, scene.multistep, work)
        status = status_of(x)
        if status != RUNNING:
            return status, step + 1, rows
    return RUNNING, last, rows


@entry
def run(
    box, x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output, overspeed, grid_loss,
    first, last, out,
):  # fmt: skip
    """Closed loop over the instants first <= step < last, writing rows of out (k, n_channels).

    act: a control kernel (jit.control_kernel). overspeed: rotor speed (rad/s) beyond which the run ends at
    the next control instant; grid_loss: time (s) from which the generator has no torque.
    Returns (status, step reached, rows written).
    """
    return run_scene(
        model_of(box), data_of(box), x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output,
        overspeed, grid_loss, first, last, out,
    )  # fmt: skip
