"""Computes tower outputs: base loads and, of a flexible tower, displacement and acceleration of the top."""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.tower import TowerModes, carried
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import State, Wrench, cross
from fowt_env.plant.tilt import across_shaft, along_shaft


@kernel
def record_tower(bend, ax, ay, row):
    """Fill the channels of the group "tower" into row; nothing with a rigid tower.

    ax, ay: absolute acceleration of the tower top along tower-top axes, m/s2. As in ElastoDyn, the
    displacement is along the axes of the tower base, and the acceleration excludes gravity.
    """
    if bend is None:
        return
    row[0], row[1], row[2], row[3] = bend.x, bend.y, ax, ay


@kernel
def tower_channels(bend):
    """Return the number of channels of the group "tower"."""
    if bend is None:
        return 0
    return 4


@inlined_kernel
def _rigid(pose, x, dx, loads, bend, body, layout, tower, work):
    m = layout.upper_matrix
    c = momentum_rate(pose, x[State.ROTOR_SPEED], m, body.coupling, body.tilt)
    mass, sx, sy, sz = m[0, 0], m[1, 5], -m[0, 5], m[0, 4]
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    g = body.gravity
    f = loads.rotor.wrench
    w = loads.tower
    fx = f.fx + w.fx - mass * g * nx - c.fx
    fy = f.fy + w.fy - mass * g * ny - c.fy
    fz = f.fz + w.fz - mass * g * nz - c.fz
    spun = body.coupling * dx[State.ROTOR_SPEED]
    mx = f.mx + w.mx + g * sz * ny - g * sy * nz - c.mx - along_shaft(spun, 0.0, body.tilt)
    my = f.my + w.my - g * (sz * nx - sx * nz) - c.my
    mz = f.mz + w.mz - g * sx * ny + g * sy * nx - c.mz + across_shaft(spun, body.tilt)
    for j in range(6):
        a = dx[State.VX + j]
        fx -= m[0, j] * a
        fy -= m[1, j] * a
        fz -= m[2, j] * a
        mx -= m[3, j] * a
        my -= m[4, j] * a
        mz -= m[5, j] * a
    return Wrench(fx, fy, fz, mx, my, mz)


@inlined_kernel
def _bent(pose, x, dx, loads, bend, body, layout, tower, work):
    f, r, g = carried(loads.rotor.wrench, bend), loads.rotor.wrench, body.gravity
    load = _rigid(pose, x, dx, loads, bend, body, layout, tower, work)
    p, c, J, X = work.tower_pull, work.tower_moment, work.tower_block, work.tower_coupling
    bx, by, bz = dx[State.WX], dx[State.WY], dx[State.WZ]
    ax, ay, az = cross(pose.wx, pose.wy, pose.wz, pose.vx, pose.vy, pose.vz)
    ax, ay, az = ax + g * pose.r31, ay + g * pose.r32, az + g * pose.r33
    ax, ay, az = ax + dx[State.VX], ay + dx[State.VY], az + dx[State.VZ]
    tx, ty, tz = cross(bx, by, bz, c[0], c[1], c[2])
    sx, sy, sz = cross(c[0], c[1], c[2], ax, ay, az)
    fx, fy, fz = load.fx + f.fx - r.fx - p[0] - tx, load.fy + f.fy - r.fy - p[1] - ty, load.fz + f.fz - r.fz
    fz -= p[2] + tz
    mx = load.mx + f.mx - r.mx - p[3] - sx - J[0] * bx - J[3] * by - J[4] * bz
    my = load.my + f.my - r.my - p[4] - sy - J[3] * bx - J[1] * by - J[5] * bz
    mz = load.mz + f.mz - r.mz - p[5] - sz - J[4] * bx - J[5] * by - J[2] * bz
    n = len(tower.beam.count)
    for i in range(n):
        rate = dx[tower.first + n + i]
        fx -= X[i, 0] * rate
        fy -= X[i, 1] * rate
        fz -= X[i, 2] * rate
        mx -= X[i, 3] * rate
        my -= X[i, 4] * rate
        mz -= X[i, 5] * rate
    return Wrench(fx, fy, fz, mx, my, mz)


# (pose, x, dx, loads, bend, body, layout, tower, work) -> Wrench on the tower base, body axes about body
# origin: aerodynamics, user loads and weight above the base less the rate of momentum there; without nacelle
# and rotor where parts are elastic
carried_at_base = chosen_by_class("tower", {type(None): _rigid, TowerModes: _bent})
