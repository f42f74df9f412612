"""Computes moving mooring lines as lumped masses joined by elastic segments (theory.md, 5.5).

Each line is MoorDyn's: axial stiffness and damping of the segments, weight, drag and added mass across and
along the line, a sea bed that pushes up; still water, no bending and no friction. Within a plant step the
fairleads follow cubic paths and the lines are advanced by substeps: the tensions, which change within
milliseconds, are implicit and follow from one tridiagonal system per line; the rest is explicit. The states
are the last of the state vector, have no rates, and are advanced after those of the platform, as the
radiation memory is.
"""

from math import ceil, hypot, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import entry, inlined_kernel, kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.mooring import (
    REGIME,
    SUSPENDED,
    TOUCHDOWN,
    is_lost,
    line_shape,
    line_state,
    mooring_load,
)
from fowt_env.plant.state import NO_LOAD, Wrench, pose_in, to_body, to_inertial

PER_NODE = 6  # states of an inner node
LONGEST = 0.05  # s: longest substep
SWING = 0.2  # largest frequency of transverse motion times a substep; steps become unstable at about 0.35
MOST_SUBSTEPS = 1000  # of a plant step: a line of such a tension has broken, or the run has failed
# weight of the end of a substep in it: 1/2 is of second order and lets the fastest axial waves ring, 1 stops
# them at once
LATE = 0.75
# rows of the work array: positions, velocities of all nodes; segments: direction, tension, stiffness; nodes:
# W f, W q of the segment before and after; factors of the tridiagonal system
PX, PY, PZ, VX, VY, VZ, QX, QY, QZ, TENSION, STIFF = range(11)
FX, FY, FZ, BX, BY, BZ, AX, AY, AZ, UPPER, RIGHT = range(11, 22)
N_WORK = 22
STARTS = N_WORK  # then one row for each line: position and velocity of its fairlead when the step begins
# relaxation to equilibrium: substep, s; most of them; largest speed of a node that is at rest, m/s
REST_STEP, REST_STEPS, AT_REST = 0.02, 20_000, 1e-5


class LineDynamics(NamedTuple):
    """Holds the lumped masses of n mooring lines; all values are of one segment or one inner node."""

    first: int  # of the lines' states: x, y, z, vx, vy, vz of the inner nodes of one line after another
    begin: np.ndarray  # (n + 1,) first inner node of each line, and the number of all
    length: np.ndarray  # (n,) unstretched, m
    stiffness: np.ndarray  # (n,) N/m
    damping: np.ndarray  # (n,) along the segment, N s/m
    mass: np.ndarray  # (n,) with the water that moves across the line, kg
    axial_mass: np.ndarray  # (n,) with the water that moves along the line, kg
    weight: np.ndarray  # (n,) in water, N
    drag: np.ndarray  # (n,) across, N/(m/s)^2
    axial_drag: np.ndarray  # (n,) along, N/(m/s)^2
    bed: float  # z of the sea bed, m
    bed_stiffness: np.ndarray  # (n,) N/m
    bed_damping: np.ndarray  # (n,) N s/m
    resting: bool = False  # True: the lines hang as catenaries, for a search for a steady state


def line_states(mooring):
    """Return the number of states of the lines of a Mooring or None."""
    dynamics = None if mooring is None else mooring.dynamics
    return 0 if dynamics is None else PER_NODE * int(dynamics.begin[-1])


def line_frequency(mooring, mass):
    """Return the frequency (rad/s) of a mass (kg) on the last segments of moving lines; 0 without.

    No motion of the platform, which the segments follow, is faster.
    """
    if not line_states(mooring):
        return 0.0
    way = mooring.fairlead - mooring.anchor
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    stiffness = np.einsum("i,ij,ik->jk", mooring.dynamics.stiffness, way, way)
    return float(np.sqrt(np.linalg.eigvalsh(stiffness)[-1] / mass))


def line_work(mooring):
    """Return a new work array of a run for the lines of a Mooring or None."""
    if not line_states(mooring):
        return np.zeros((0, 0))
    most = int(np.diff(mooring.dynamics.begin).max())
    return np.zeros((STARTS + mooring.length.shape[0], max(most + 2, 6)))


def build_line_dynamics(lines, own, density, gravity, depth, first=0):
    """Return the LineDynamics of `Line` records and their `MovingLine` records, with states from `first` on.

    density, gravity: of the water, SI; depth: of the water, m.
    """
    segments = np.array([part.segments for part in own])
    length = np.array([line.length for line in lines]) / segments
    area = np.array([0.25 * pi * part.diameter**2 for part in own])
    diameter = np.array([part.diameter for part in own])
    stiffness = np.array([line.EA for line in lines]) / length
    weight = np.array([line.wet_weight for line in lines]) * length
    water = density * area * length
    mass = weight / gravity + water

    def column(name):
        return np.array([getattr(part, name) for part in own])

    ratio = column("damping_ratio")
    return LineDynamics(
        first=first,
        begin=np.concatenate([[0], np.cumsum(segments - 1)]).astype(np.int64),
        length=length,
        stiffness=stiffness,
        damping=ratio * np.sqrt(stiffness * mass),
        mass=mass + column("added_mass_coefficient") * water,
        axial_mass=mass + column("axial_added_mass_coefficient") * water,
        weight=weight,
        drag=0.5 * density * column("drag_coefficient") * diameter * length,
        axial_drag=0.5 * density * column("axial_drag_coefficient") * pi * diameter * length,
        bed=-float(depth),
        bed_stiffness=column("seabed_stiffness") * diameter * length,
        bed_damping=column("seabed_damping") * diameter * length,
    )


# ---------------------------------------------------------------- one line


@kernel
def _place(start, n, g, anchor, fairlead, velocity, x, work):
    """Fill work with the velocities of all nodes and their positions after the time g at these velocities."""
    for k in range(3):
        p, v = work[PX + k], work[VX + k]
        row, rate = start + k * n, start + (3 + k) * n
        for j in range(n):
            v[j + 1] = x[rate + j]
            p[j + 1] = x[row + j] + g * x[rate + j]
        p[0] = anchor[k]
        v[0] = 0.0
        p[n + 1] = fairlead[k] + g * velocity[k]
        v[n + 1] = velocity[k]


@kernel
def _stretch(i, n, g, dynamics, work):
    """Fill work with direction, tension and implicit stiffness of the n + 1 segments of line i."""
    px, py, pz, vx, vy, vz = work[PX], work[PY], work[PZ], work[VX], work[VY], work[VZ]
    qx, qy, qz, tension, stiff = work[QX], work[QY], work[QZ], work[TENSION], work[STIFF]
    length, stiffness, damping = dynamics.length[i], dynamics.stiffness[i], dynamics.damping[i]
    for j in range(n + 1):
        dx, dy, dz = px[j + 1] - px[j], py[j + 1] - py[j], pz[j + 1] - pz[j]
        stretched = sqrt(dx * dx + dy * dy + dz * dz)
        scale = 1.0 / stretched
        dx, dy, dz = dx * scale, dy * scale, dz * scale
        rate = dx * (vx[j + 1] - vx[j]) + dy * (vy[j + 1] - vy[j]) + dz * (vz[j + 1] - vz[j])
        elastic = stiffness if stretched > length else 0.0  # a line cannot push
        qx[j], qy[j], qz[j] = dx, dy, dz
        tension[j] = elastic * (stretched - length) + damping * rate
        stiff[j] = g * (g * elastic + damping)


@kernel
def _weigh(i, n, g, dynamics, work):
    """Fill work with the inverse masses of the inner nodes, times forces and directions of segments.

    W is the inverse of A (I - q q^T) + B q q^T: mass across and along the line with the implicit part of the
    drag.
    """
    vx, vy, vz = work[VX], work[VY], work[VZ]
    qx, qy, qz = work[QX], work[QY], work[QZ]
    fx, fy, fz = work[FX], work[FY], work[FZ]
    bx, by, bz, ax, ay, az = work[BX], work[BY], work[BZ], work[AX], work[AY], work[AZ]
    mass, axial, weight = dynamics.mass[i], dynamics.axial_mass[i], dynamics.weight[i]
    drag, along = dynamics.drag[i], dynamics.axial_drag[i]
    for j in range(1, n + 1):
        tx, ty, tz = qx[j - 1] + qx[j], qy[j - 1] + qy[j], qz[j - 1] + qz[j]
        scale = 1.0 / sqrt(tx * tx + ty * ty + tz * tz + 1e-30)
        tx, ty, tz = tx * scale, ty * scale, tz * scale
        slip = tx * vx[j] + ty * vy[j] + tz * vz[j]
        nx, ny, nz = vx[j] - slip * tx, vy[j] - slip * ty, vz[j] - slip * tz
        across = drag * sqrt(nx * nx + ny * ny + nz * nz)
        push = along * abs(slip) * slip
        gx = -across * nx - push * tx
        gy = -across * ny - push * ty
        gz = -across * nz - push * tz - weight
        a = 1.0 / (mass + 2.0 * g * across)
        b = 1.0 / (axial + 2.0 * g * along * abs(slip)) - a
        dot = b * (tx * gx + ty * gy + tz * gz)
        fx[j], fy[j], fz[j] = a * gx + dot * tx, a * gy + dot * ty, a * gz + dot * tz
        hx, hy, hz = qx[j - 1], qy[j - 1], qz[j - 1]
        dot = b * (tx * hx + ty * hy + tz * hz)
        bx[j], by[j], bz[j] = a * hx + dot * tx, a * hy + dot * ty, a * hz + dot * tz
        hx, hy, hz = qx[j], qy[j], qz[j]
        dot = b * (tx * hx + ty * hy + tz * hz)
        ax[j], ay[j], az[j] = a * hx + dot * tx, a * hy + dot * ty, a * hz + dot * tz


@kernel
def _tighten(n, work):
    """Replace the tensions in work by those that are consistent with the motion that they cause.

    tension_j = explicit_j + stiff_j q_j . (a_{j+1} - a_j), where a = W (f + tension_j q_j - tension_{j-1}
    q_{j-1}) is the acceleration of a node: a tridiagonal system, solved by elimination from the anchor.
    """
    qx, qy, qz, tension, stiff = work[QX], work[QY], work[QZ], work[TENSION], work[STIFF]
    fx, fy, fz = work[FX], work[FY], work[FZ]
    bx, by, bz, ax, ay, az = work[BX], work[BY], work[BZ], work[AX], work[AY], work[AZ]
    upper, right = work[UPPER], work[RIGHT]
    before = 0.0
    for j in range(n + 1):
        x, y, z, k = qx[j], qy[j], qz[j], stiff[j]
        diagonal, value, lower, above = 1.0, tension[j], 0.0, 0.0
        if j > 0:
            diagonal += k * (x * ax[j] + y * ay[j] + z * az[j])
            value -= k * (x * fx[j] + y * fy[j] + z * fz[j])
            lower = -k * (x * bx[j] + y * by[j] + z * bz[j])
        if j < n:
            diagonal += k * (x * bx[j + 1] + y * by[j + 1] + z * bz[j + 1])
            value += k * (x * fx[j + 1] + y * fy[j + 1] + z * fz[j + 1])
            above = -k * (x * ax[j + 1] + y * ay[j + 1] + z * az[j + 1])
        pivot = 1.0 / (diagonal - lower * before)
        value = (value - lower * right[j - 1]) * pivot if j > 0 else value * pivot
        before = above * pivot
        upper[j], right[j] = before, value
    tension[n] = right[n]
    for j in range(n - 1, -1, -1):
        tension[j] = right[j] - upper[j] * tension[j + 1]


@kernel
def _move(i, start, n, h, g, dynamics, x, work):
    """Advance the nodes of x by a step h with the tensions in work.

    Nodes that reach the sea bed are stopped by its spring and damper, implicit over the whole step: they rest
    on it without bouncing.
    """
    tension = work[TENSION]
    for k in range(2):
        f, b, a = work[FX + k], work[BX + k], work[AX + k]
        row, rate = start + k * n, start + (3 + k) * n
        for j in range(n):
            change = g * (f[j + 1] + tension[j + 1] * a[j + 1] - tension[j] * b[j + 1])
            x[row + j] += h * (x[rate + j] + change)
            x[rate + j] += change * (h / g)
    f, b, a = work[FZ], work[BZ], work[AZ]
    row, rate, scale = start + 2 * n, start + 5 * n, h / dynamics.mass[i]
    spring, damper = scale * dynamics.bed_stiffness[i], scale * dynamics.bed_damping[i]
    for j in range(n):
        change = g * (f[j + 1] + tension[j + 1] * a[j + 1] - tension[j] * b[j + 1])
        mean, last = x[rate + j] + change, x[rate + j] + change * (h / g)
        depth = dynamics.bed - x[row + j]
        stopped = (last + spring * depth) / (1.0 + damper + h * spring)
        touches = h * last < depth
        x[row + j] += h * (stopped if touches else mean)
        x[rate + j] = stopped if touches else last


@kernel
def _substep(i, h, fairlead, velocity, mooring, dynamics, x, work):
    """Advance line i of x by h; fairlead: its position at the beginning; velocity: its mean."""
    n = dynamics.begin[i + 1] - dynamics.begin[i]
    start, g = dynamics.first + PER_NODE * dynamics.begin[i], LATE * h
    anchor = (mooring.anchor[i, 0], mooring.anchor[i, 1], mooring.anchor[i, 2])
    _place(start, n, g, anchor, fairlead, velocity, x, work)
    _stretch(i, n, g, dynamics, work)
    _weigh(i, n, g, dynamics, work)
    _tighten(n, work)
    _move(i, start, n, h, g, dynamics, x, work)


@kernel
def _fairlead(pose, i, mooring):
    """Return position (3) and velocity (3) of a fairlead, inertial axes."""
    bx, by, bz = mooring.fairlead[i, 0], mooring.fairlead[i, 1], mooring.fairlead[i, 2]
    x, y, z = to_inertial(pose, bx, by, bz)
    u, v, w = to_inertial(
        pose,
        pose.vx + pose.wy * bz - pose.wz * by,
        pose.vy + pose.wz * bx - pose.wx * bz,
        pose.vz + pose.wx * by - pose.wy * bx,
    )
    return pose.x + x, pose.y + y, pose.z + z, u, v, w


@kernel
def _path(before, after, dt, s):
    """Return a coordinate after the fraction s of a step: cubic through positions and velocities."""
    p, v, q, u = before[0], before[1], after[0], after[1]
    rest = 1.0 - s
    value = rest * rest * ((1.0 + 2.0 * s) * p + dt * s * v)
    return value + s * s * ((1.0 + 2.0 * rest) * q - dt * rest * u)


@kernel
def _substeps(i, dt, fairlead, x, dynamics):
    """Return the number of substeps of line i in dt, from the tension of its last segment."""
    n = dynamics.begin[i + 1] - dynamics.begin[i]
    last = dynamics.first + PER_NODE * dynamics.begin[i] + n - 1
    dx, dy, dz = fairlead[0] - x[last], fairlead[1] - x[last + n], fairlead[2] - x[last + 2 * n]
    stretch = sqrt(dx * dx + dy * dy + dz * dz) - dynamics.length[i]
    tension = max(dynamics.stiffness[i] * stretch, dynamics.weight[i] * n)
    swing = 2.0 * sqrt(tension / (dynamics.mass[i] * dynamics.length[i]))
    count = ceil(dt * max(swing / SWING, 1.0 / LONGEST) - 1e-6)
    return int(count) if count < MOST_SUBSTEPS else MOST_SUBSTEPS


@kernel
def _advance(x, dt, plane, mooring, dynamics, lines, work):
    """Advance the lines of x by dt, whose platform is already there; work has the fairleads of the start.

    The states of a lost line, which no longer moves the platform, stay as they are.
    """
    if dynamics.resting:
        return
    pose = pose_in(x, plane)
    for i in range(mooring.length.shape[0]):
        if is_lost(i, lines):
            continue
        old, new = work[STARTS + i], _fairlead(pose, i, mooring)
        count = _substeps(i, dt, old, x, dynamics)
        h = dt / count
        px, py, pz = old[0], old[1], old[2]
        for k in range(1, count + 1):
            s = k / count
            qx = _path((old[0], old[3]), (new[0], new[3]), dt, s)
            qy = _path((old[1], old[4]), (new[1], new[4]), dt, s)
            qz = _path((old[2], old[5]), (new[2], new[5]), dt, s)
            mean = ((qx - px) / h, (qy - py) / h, (qz - pz) / h)
            _substep(i, h, (px, py, pz), mean, mooring, dynamics, x, work)
            px, py, pz = qx, qy, qz


# ---------------------------------------------------------------- the load


@kernel
def _pull(i, fairlead, x, dynamics):
    """Return the force (3) of line i on its fairlead: its last segment, and half a node's weight and drag."""
    n = dynamics.begin[i + 1] - dynamics.begin[i]
    last = dynamics.first + PER_NODE * dynamics.begin[i] + n - 1
    px, py, pz, u, v, w = fairlead
    dx, dy, dz = px - x[last], py - x[last + n], pz - x[last + 2 * n]
    stretched = sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / stretched, dy / stretched, dz / stretched
    rate = dx * (u - x[last + 3 * n]) + dy * (v - x[last + 4 * n]) + dz * (w - x[last + 5 * n])
    tension = dynamics.stiffness[i] * max(stretched - dynamics.length[i], 0.0) + dynamics.damping[i] * rate
    slip = dx * u + dy * v + dz * w
    u, v, w = u - slip * dx, v - slip * dy, w - slip * dz
    across = 0.5 * dynamics.drag[i] * sqrt(u * u + v * v + w * w)
    along = tension + 0.5 * dynamics.axial_drag[i] * abs(slip) * slip
    fz = -along * dz - across * w - 0.5 * dynamics.weight[i]
    return -along * dx - across * u, -along * dy - across * v, fz


@kernel
def _put_anchor(i, x, mooring, dynamics, row):
    """Fill the row of line i with the tension at the anchor and the length on the sea bed."""
    n = dynamics.begin[i + 1] - dynamics.begin[i]
    start = dynamics.first + PER_NODE * dynamics.begin[i]
    dx, dy = x[start] - mooring.anchor[i, 0], x[start + n] - mooring.anchor[i, 1]
    dz = x[start + 2 * n] - mooring.anchor[i, 2]
    stretched = sqrt(dx * dx + dy * dy + dz * dz)
    rate = (dx * x[start + 3 * n] + dy * x[start + 4 * n] + dz * x[start + 5 * n]) / stretched
    stretch = max(stretched - dynamics.length[i], 0.0)
    row[3] = dynamics.stiffness[i] * stretch + dynamics.damping[i] * rate
    lying = 0
    while lying < n and x[start + 2 * n + lying] <= dynamics.bed:
        lying += 1
    row[4] = dynamics.length[i] * lying
    row[REGIME] = TOUCHDOWN if lying else SUSPENDED


@kernel
def _dynamic_load(pose, x, mooring, dynamics, lines):
    """Return the wrench of moving lines, body axes, about the body origin; fill the rows of lines."""
    fx = fy = fz = mx = my = mz = 0.0
    for i in range(mooring.length.shape[0]):
        if is_lost(i, lines):
            continue
        X, Y, Z = _pull(i, _fairlead(pose, i, mooring), x, dynamics)
        lines[i, 0] = hypot(X, Y)
        lines[i, 1] = -Z
        lines[i, 2] = sqrt(X * X + Y * Y + Z * Z)
        _put_anchor(i, x, mooring, dynamics, lines[i])
        px, py, pz = to_body(pose, X, Y, Z)
        bx, by, bz = mooring.fairlead[i, 0], mooring.fairlead[i, 1], mooring.fairlead[i, 2]
        fx += px
        fy += py
        fz += pz
        mx += by * pz - bz * py
        my += bz * px - bx * pz
        mz += bx * py - by * px
    return Wrench(fx, fy, fz, mx, my, mz)


@kernel
def _load_by_kind(pose, x, mooring, dynamics, lines, counters):
    if dynamics is None:
        return mooring_load(pose, mooring, lines, counters)
    if dynamics.resting:
        return mooring_load(pose, mooring, lines, counters)
    return _dynamic_load(pose, x, mooring, dynamics, lines)


@kernel
def lines_load(pose, x, mooring, lines, counters):
    """Return the wrench of all mooring lines, quasi-static or moving, as mooring_load does."""
    if mooring is None:
        return NO_LOAD
    return _load_by_kind(pose, x, mooring, mooring.dynamics, lines, counters)


# ---------------------------------------------------------------- interface of integrators


@kernel
def _states_before(count, dynamics):
    if dynamics is None:
        return count
    return min(count, dynamics.first)


@inlined_kernel
def states_before_lines(count, mooring):
    """Return the number of states that have rates, of `count` that are not of the radiation memory."""
    if mooring is None:
        return count
    return _states_before(count, mooring.dynamics)


@kernel
def _begin(x, plane, mooring, dynamics, work):
    if dynamics is None:
        return
    pose = pose_in(x, plane)
    for i in range(mooring.length.shape[0]):
        row = work[STARTS + i]
        row[0], row[1], row[2], row[3], row[4], row[5] = _fairlead(pose, i, mooring)


@inlined_kernel
def begin_lines(x, plane, mooring, work):
    """Begin a step of the lines from x: keep the motion of the fairleads."""
    if mooring is None:
        return
    _begin(x, plane, mooring, mooring.dynamics, work)


@kernel
def _after(x, y, dt, plane, mooring, dynamics, lines, work):
    if dynamics is None:
        return
    for k in range(dynamics.first, dynamics.first + PER_NODE * dynamics.begin[-1]):
        y[k] = x[k]
    _advance(y, dt, plane, mooring, dynamics, lines, work)


@inlined_kernel
def lines_after(x, y, dt, plane, mooring, lines, work):
    """Fill y, of known motion of the platform, with the lines a time dt after x."""
    if mooring is None:
        return
    _after(x, y, dt, plane, mooring, mooring.dynamics, lines, work)


@kernel
def _end(x, dt, plane, mooring, dynamics, lines, work):
    if dynamics is None:
        return
    _advance(x, dt, plane, mooring, dynamics, lines, work)


@inlined_kernel
def end_lines(x, dt, plane, mooring, lines, work):
    """Advance the lines of x to the end of a step of dt; all other states of x are already there."""
    if mooring is None:
        return
    _end(x, dt, plane, mooring, mooring.dynamics, lines, work)


# ---------------------------------------------------------------- equilibrium


@entry
def _relax(handle, x):
    """Relax the lines of x to equilibrium; return the largest speed that is left, m/s.

    A line moves freely until its kinetic energy falls and then starts again from rest.
    """
    model = model_of(handle)
    mooring, plane = model.mooring, model.rigid_body.plane
    return _relax_lines(x, plane, mooring, mooring.dynamics, data_of(handle).line_work)


@kernel
def _relax_lines(x, plane, mooring, dynamics, work):
    pose, worst, still = pose_in(x, plane), 0.0, (0.0, 0.0, 0.0)
    for i in range(mooring.length.shape[0]):
        px, py, pz, _, _, _ = _fairlead(pose, i, mooring)
        n = dynamics.begin[i + 1] - dynamics.begin[i]
        rates = dynamics.first + PER_NODE * dynamics.begin[i] + 3 * n
        before, largest = 0.0, 1.0
        for _ in range(REST_STEPS):
            _substep(i, REST_STEP, (px, py, pz), still, mooring, dynamics, x, work)
            energy = largest = 0.0
            for k in range(rates, rates + 3 * n):
                energy += x[k] * x[k]
                largest = max(largest, abs(x[k]))
            if largest < AT_REST:
                break
            if energy < before:
                for k in range(rates, rates + 3 * n):
                    x[k] = 0.0
                energy = 0.0
            before = energy
        for k in range(rates, rates + 3 * n):
            x[k] = 0.0
        worst = max(worst, largest)
    return worst


def rest_lines(scene, x):
    """Set the states of moving lines in x to their equilibrium for the pose of the platform."""
    if line_states(scene.model.mooring):
        fill_catenaries(scene.model.mooring, pose_in(x, scene.model.rigid_body.plane), x)
        _relax(scene.handle(), x)


def fill_catenaries(mooring, pose, x):
    """Fill the states of moving lines in x with nodes at rest on the catenaries of a pose."""
    dynamics = mooring.dynamics
    for i, anchor in enumerate(mooring.anchor):
        fairlead = np.array(_fairlead(pose, i, mooring)[:3])
        way = fairlead - anchor
        across, n = hypot(way[0], way[1]), int(dynamics.begin[i + 1] - dynamics.begin[i])
        line = line_state(across, way[2], i, mooring, None, 0.0)
        properties = mooring.length[i], mooring.weight[i], mooring.EA[i]
        shape = line_shape(line.H, line.V, across, *properties, n=n + 2)[1:-1]
        start = dynamics.first + PER_NODE * int(dynamics.begin[i])
        nodes = x[start : start + PER_NODE * n].reshape(PER_NODE, n)
        nodes[:3] = anchor[:, None] + np.outer([*way[:2], 0.0], shape[:, 0] / max(across, 1e-9))
        nodes[2] += shape[:, 1]
        nodes[3:] = 0.0
