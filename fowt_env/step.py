"""Fixed-step advance of one plant, and the compiled loop of a whole run with its controller."""

from math import isfinite

import numpy as np

from fowt_env.channels import measure, record
from fowt_env.dynamics import Kept, loads_of
from fowt_env.integrators import rates, take_step
from fowt_env.jit import entry, inlined_kernel, kernel
from fowt_env.state import State

RUNNING, NON_FINITE, CAPSIZED = 0, 1, 2
CAPSIZE = 1.4  # rad (80 deg) of platform pitch: the Euler angles are singular at 90 deg
STOP_REASONS = {NON_FINITE: "non-finite state", CAPSIZED: "capsize (platform pitch beyond 80 deg)"}


@kernel
def status_of(x):
    """RUNNING, NON_FINITE or CAPSIZED for a state."""
    for value in x:
        if not isfinite(value):
            return NON_FINITE
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
    return advance_scene(box.scene, box.work, x, u, first, n, dt)


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
    observe_scene(box.scene, box.work, x, u, t, dx, measurement)


@entry
def output(box, x, u, t, dx, row):
    """Fill one output row (n_channels,) in SI at time t under u; kept loads as in observe."""
    output_scene(box.scene, box.work, x, u, t, dx, row)


@entry
def forget(box):
    """Drop kept loads and past derivatives: the state was changed from outside."""
    box.work.kept[Kept.FRESH] = 0.0
    box.work.kept[Kept.STEPS] = 0.0


def output_row(box, x, u, t, size):
    """One output row (size,) in SI of any state at time t under u."""
    row = np.empty(size)
    forget(box)
    output(box, x, u, float(t), np.zeros_like(x), row)
    return row


@kernel
def run_scene(
    scene, work, x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output, first, last, out
):
    """Closed loop as in run."""
    rows = 0
    for step in range(first, last):
        t = step * dt
        if step % per_control == 0:
            observe_scene(scene, work, x, u, t, dx, measurement)
            act(parameters, memory, measurement, u)
        if step % per_output == 0:
            output_scene(scene, work, x, u, t, dx, out[rows])
            rows += 1
        take_step(t, x, u, dt, scene, scene.multistep, work)
        status = status_of(x)
        if status != RUNNING:
            return status, step + 1, rows
    return RUNNING, last, rows


@entry
def run(box, x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output, first, last, out):
    """Closed loop over the instants first <= step < last, writing rows of out (k, n_channels).

    act: a control kernel (jit.control_kernel). Returns (status, step reached, rows written).
    """
    return run_scene(
        box.scene, box.work, x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output,
        first, last, out,
    )  # fmt: skip
