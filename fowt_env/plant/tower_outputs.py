"""Computes tower outputs: base loads and, of a flexible tower, displacement and acceleration of the top."""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import State, Wrench
from fowt_env.plant.tilt import across_shaft, along_shaft
from fowt_env.plant.tower.loads import carried, displaced_moment
from fowt_env.plant.tower.modes import TowerModes
from fowt_env.plant.tower.rates import above_base_rate


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
def _rigid(pose, x, dx, loads, bend, body, layout, tower):
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


@kernel
def _bent(pose, x, dx, loads, bend, body, layout, tower):
    m, g = layout.upper_matrix, body.gravity
    f, w = carried(loads.rotor.wrench, bend), loads.tower
    c = above_base_rate(pose, x, dx, bend, body, tower)
    ex, ey, ez = displaced_moment(x, bend, tower)
    mass, sx, sy, sz = m[0, 0], m[1, 5] + ex, ey - m[0, 5], m[0, 4] + ez
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    return Wrench(
        f.fx + w.fx - mass * g * nx - c.fx,
        f.fy + w.fy - mass * g * ny - c.fy,
        f.fz + w.fz - mass * g * nz - c.fz,
        f.mx + w.mx - g * (sy * nz - sz * ny) - c.mx,
        f.my + w.my - g * (sz * nx - sx * nz) - c.my,
        f.mz + w.mz - g * (sx * ny - sy * nx) - c.mz,
    )


# (pose, x, dx, loads, bend, body, layout, tower) -> Wrench on the tower base, body axes about body origin:
# aerodynamics, user loads and weight above the base less the rate of momentum there
carried_at_base = chosen_by_class("tower", {type(None): _rigid, TowerModes: _bent}, inlined=True)
