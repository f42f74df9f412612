"""Advances one plant by fixed steps, and computes its measurement and output."""

from math import isfinite

import numpy as np

from fowt_env.plant.channels import measure, record
from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.dynamics import loads_of
from fowt_env.plant.hydro.radiation import forget_memory
from fowt_env.plant.integrators import keep_rates, rates, take_step
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State

RUNNING, NON_FINITE, CAPSIZED, OVERSPEED, BLOWN_UP, BAD_COMMAND, TRIPPED, SUNK = range(8)
CAPSIZE = 1.4  # rad (80 deg) of platform pitch: the Euler angles are singular at 90 deg
# No floating platform moves as fast: higher speeds come from the time step, not from the sea. A hull that
# capsizes passes 80 deg at some 0.5 rad/s.
FASTEST, FASTEST_TURN = 100.0, 10.0  # m/s, rad/s
STOP_REASONS = {
    NON_FINITE: "non-finite state",
    CAPSIZED: "capsize (platform pitch beyond 80 deg)",
    OVERSPEED: "overspeed (above the limit that ends the run)",
    BLOWN_UP: f"numerical blow-up (platform faster than {FASTEST:g} m/s or {FASTEST_TURN:g} rad/s): loads too"
    " stiff for the time step",
    TRIPPED: "above the limit that ends the run",
    SUNK: "sunk (the foot of the tower is below still water)",
    BAD_COMMAND: "the controller's command is not finite (fields that its information does not declare are"
    " NaN)",
}


@kernel
def status_of(x):
    """Return the status of a state: RUNNING, NON_FINITE, BLOWN_UP or CAPSIZED."""
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
    """Advance the state x by n steps from time first*dt under constant u; returns the status."""
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
    """Fill the rates dx and the measurement as observe does."""
    rates(t, x, u, model, data, dx)
    measure(model, data, x, dx, u, t, measurement)


@inlined_kernel
def output_plant(model, data, x, u, t, dx, row):
    """Fill the rates dx and one output row as output does."""
    rates(t, x, u, model, data, dx)
    keep_rates(x, u, dx, data)
    record(model, data, x, dx, u, t, loads_of(data, dx), row)


@entry
def observe(handle, x, u, t, dx, measurement):
    """Fill the rates dx (n_state,) and the measurement (Scene.n_measurements,) at time t under u.

    Cached loads are used where they are valid: after changing x from outside, call forget first.
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
    """Return one output row (size,) in SI of any state at time t under u."""
    row = np.empty(size)
    forget(handle)
    output(handle, x, u, float(t), np.zeros_like(x), row)
    return row
