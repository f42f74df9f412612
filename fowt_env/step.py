"""Fixed-step advance of one plant, and the compiled loop of a whole run with its controller."""

from math import isfinite

import numpy as np

from fowt_env.channels import measure, record
from fowt_env.dynamics import derivative
from fowt_env.jit import kernel
from fowt_env.loads.drivetrain import followed_pitch
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
def rk4(t, x, u, dt, scene, work):
    """One classical Runge-Kutta step of x in place."""
    k1, k2, k3, k4, y = work.stages[0], work.stages[1], work.stages[2], work.stages[3], work.stages[4]
    derivative(t, x, u, scene, work, k1)
    for i in range(x.shape[0]):
        y[i] = x[i] + 0.5 * dt * k1[i]
    derivative(t + 0.5 * dt, y, u, scene, work, k2)
    for i in range(x.shape[0]):
        y[i] = x[i] + 0.5 * dt * k2[i]
    derivative(t + 0.5 * dt, y, u, scene, work, k3)
    for i in range(x.shape[0]):
        y[i] = x[i] + dt * k3[i]
    derivative(t + dt, y, u, scene, work, k4)
    for i in range(x.shape[0]):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])


@kernel
def advance_scene(scene, work, x, u, first, n, dt):
    """Advance x by n steps from time first*dt under constant u; returns the status."""
    for i in range(n):
        x[State.BLADE_PITCH] = followed_pitch(x[State.BLADE_PITCH], u[1], dt, scene.actuator)
        rk4((first + i) * dt, x, u, dt, scene, work)
        status = status_of(x)
        if status != RUNNING:
            return status
    return RUNNING


@kernel
def advance(box, x, u, first, n, dt):
    """Advance x (n_state,) in place by n steps of dt under constant u (2,); returns the status."""
    return advance_scene(box.scene, box.work, x, u, first, n, dt)


@kernel
def observe(box, x, u, t, dx, measurement):
    """Fill dx (n_state,) and measurement (N_MEASUREMENTS,) at time t under u."""
    scene = box.scene
    derivative(t, x, u, scene, box.work, dx)
    measure(scene, x, dx, u, t, measurement)


@kernel
def output(box, x, u, t, dx, row):
    """Fill one output row (n_channels,) in SI at time t under u."""
    scene = box.scene
    loads = derivative(t, x, u, scene, box.work, dx)
    record(scene, box.work, x, dx, u, t, loads, row)


def output_row(box, x, u, t, size):
    """One output row (size,) in SI at time t under u."""
    row = np.empty(size)
    output(box, x, u, float(t), np.zeros_like(x), row)
    return row


@kernel
def run(box, x, u, act, parameters, memory, measurement, dx, dt, per_control, per_output, first, last, out):
    """Closed loop over the instants first <= step < last, writing rows of out (k, n_channels).

    act: a control kernel (jit.control_kernel). Returns (status, step reached, rows written).
    """
    rows = 0
    step = first
    while step < last:
        t = step * dt
        if step % per_control == 0:
            observe(box, x, u, t, dx, measurement)
            act(parameters, memory, measurement, u)
        if step % per_output == 0:
            output(box, x, u, t, dx, out[rows])
            rows += 1
        # on to the next instant at which something happens
        n = min(per_control - step % per_control, per_output - step % per_output, last - step)
        status = advance_scene(box.scene, box.work, x, u, step, n, dt)
        step += n
        if status != RUNNING:
            return status, step, rows
    return RUNNING, step, rows
