"""Computes loads on a flexible tower: of nacelle and rotor, structure and weight (theory.md, 2.7)."""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.state import Wrench
from fowt_env.plant.tower.modes import from_nacelle


@kernel
def carried(load, bend):
    """Transform a Wrench from the nacelle frame to the body frame; rigid tower: unchanged."""
    if bend is None:
        return load
    fx, fy, fz = from_nacelle(bend, load.fx, load.fy, load.fz)
    mx, my, mz = from_nacelle(bend, load.mx + bend.z * load.fy, load.my - bend.z * load.fx, load.mz)
    return Wrench(
        fx, fy, fz,
        mx + bend.y * fz - bend.z * fy,
        my + bend.z * fx - bend.x * fz,
        mz + bend.x * fy - bend.y * fx,
    )  # fmt: skip


@kernel
def add_modal(load, bend, tower, modal):
    """Add the generalised forces of a Wrench on the nacelle to modal (n,); no-op for a rigid tower."""
    if bend is None:
        return
    fx, fy, _ = from_nacelle(bend, load.fx, load.fy, load.fz)
    turning = bend.cb * (load.my - bend.z * load.fx) - bend.sb * load.mz
    rolling = load.mx + bend.z * load.fy
    for i in range(0, len(tower.count), 2):
        modal[i] += fx + tower.slope[i] * turning
        modal[i + 1] += fy - tower.slope[i + 1] * rolling


@inlined_kernel
def begin_modal(x, tower, modal):
    """Set modal (n,) to the generalised elastic and damping forces of the tower; no-op for a rigid tower."""
    if tower is None:
        return
    n = len(tower.count)
    q, v = tower.first, tower.first + n
    for i in range(n):
        force = 0.0
        for j in range(n):
            force -= tower.stiffness[i, j] * x[q + j] + tower.damping[i, j] * x[v + j]
        modal[i] = force


@inlined_kernel
def shortening(x, tower):
    """Return the decrease of the first moment of mass along z by axial shortening of the bent tower, kg m."""
    n, q = len(tower.count), tower.first
    total = 0.0
    for i in range(n):
        for j in range(n):
            total += 0.5 * x[q + i] * tower.weight_stiffness[i, j] * x[q + j]
    return total


@inlined_kernel
def displaced_moment(x, bend, tower):
    """Return the change (x, y, z) of the turbine's first moment of mass by bending, kg m, platform axes."""
    n, q = len(tower.count), tower.first
    dx = dy = 0.0
    for i in range(0, n, 2):
        dx += tower.first_moment[i] * x[q + i]
        dy += tower.first_moment[i + 1] * x[q + i + 1]
    s, m = tower.hanging_moment, tower.hanging_mass
    sx, sy, sz = from_nacelle(bend, s[0], s[1], s[2])
    return dx + m * bend.x + sx - s[0], dy + m * bend.y + sy - s[1], sz - s[2] - shortening(x, tower)


@kernel
def add_bent_weight(load, pose, x, bend, tower, gravity):
    """Return load plus the moment that bending adds to the weight of the straight turbine."""
    if bend is None:
        return load
    sx, sy, sz = displaced_moment(x, bend, tower)
    g, nx, ny, nz = gravity, pose.r31, pose.r32, pose.r33
    return Wrench(
        load.fx, load.fy, load.fz,
        load.mx + g * (sz * ny - sy * nz),
        load.my + g * (sx * nz - sz * nx),
        load.mz + g * (sy * nx - sx * ny),
    )  # fmt: skip


@kernel
def add_modal_weight(pose, x, bend, tower, gravity, modal):
    """Add the generalised forces of the weight to modal (n,); no-op for a rigid tower."""
    if bend is None:
        return
    n, q, g = len(tower.count), tower.first, gravity
    s, m = tower.hanging_moment, tower.hanging_mass
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    sx, sy, sz = from_nacelle(bend, s[0], s[1], s[2])
    turning = sx * nz - sz * nx  # moment about the top, over g, along y
    rolling = bend.ca * (sz * ny - sy * nz) - bend.sa * (sy * nx - sx * ny)  # along the rotated x axis
    for i in range(n):
        raised = 0.0
        for j in range(n):
            raised += tower.weight_stiffness[i, j] * x[q + j]
        modal[i] += g * nz * raised
    for i in range(0, n, 2):
        modal[i] += g * (tower.slope[i] * turning - (m + tower.first_moment[i]) * nx)
        modal[i + 1] -= g * (tower.slope[i + 1] * rolling + (m + tower.first_moment[i + 1]) * ny)
