"""Models the turbine as a rigid body with a rotor: weight, momentum rate, attitude (theory.md, 2)."""

from math import cos, sin

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import State, Wrench, pose_by_sines
from fowt_env.plant.tilt import across_shaft, along_shaft


@kernel
def gravity_load(pose, body):
    """Return the weight of the whole turbine, Eq. (13)."""
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    mg = -body.mass * body.gravity
    g = body.gravity
    weight = Wrench(
        mg * nx,
        mg * ny,
        mg * nz,
        g * body.s_z * ny,
        -g * (body.s_z * nx - body.s_x * nz),
        -g * body.s_x * ny,
    )
    return _off_centre(weight, pose, g, body.s_y)


@kernel
def _off_centre(weight, pose, gravity, s_y):
    """Add to the weight the moment of a centre of mass off the plane of symmetry."""
    if s_y is None:
        return weight
    moment = gravity * s_y
    return Wrench(
        weight.fx,
        weight.fy,
        weight.fz,
        weight.mx - moment * pose.r33,
        weight.my,
        weight.mz + moment * pose.r31,
    )


@kernel
def momentum_rate(pose, rotor_speed, mass_matrix, coupling, tilt):
    """Return C1 nu + C2 w_b: velocity-dependent part of the momentum rate, Eqs (9)-(10).

    coupling: H of the rotor, whose angular momentum lies along the shaft; tilt: of the shaft, or None.
    """
    m = mass_matrix
    vx, vy, vz, wx, wy, wz = pose.vx, pose.vy, pose.vz, pose.wx, pose.wy, pose.wz
    px = m[0, 0] * vx + m[0, 1] * vy + m[0, 2] * vz + m[0, 3] * wx + m[0, 4] * wy + m[0, 5] * wz
    py = m[1, 0] * vx + m[1, 1] * vy + m[1, 2] * vz + m[1, 3] * wx + m[1, 4] * wy + m[1, 5] * wz
    pz = m[2, 0] * vx + m[2, 1] * vy + m[2, 2] * vz + m[2, 3] * wx + m[2, 4] * wy + m[2, 5] * wz
    kx = m[3, 0] * vx + m[3, 1] * vy + m[3, 2] * vz + m[3, 3] * wx + m[3, 4] * wy + m[3, 5] * wz
    ky = m[4, 0] * vx + m[4, 1] * vy + m[4, 2] * vz + m[4, 3] * wx + m[4, 4] * wy + m[4, 5] * wz
    kz = m[5, 0] * vx + m[5, 1] * vy + m[5, 2] * vz + m[5, 3] * wx + m[5, 4] * wy + m[5, 5] * wz
    spin = coupling * rotor_speed
    kx += along_shaft(spin, 0.0, tilt)
    kz -= across_shaft(spin, tilt)
    return Wrench(
        wy * pz - wz * py,
        wz * px - wx * pz,
        wx * py - wy * px,
        vy * pz - vz * py + wy * kz - wz * ky,
        vz * px - vx * pz + wz * kx - wx * kz,
        vx * py - vy * px + wx * ky - wy * kx,
    )


@kernel
def attitude_rate(x, dx, plane):
    """Fill dx with the rates of position and Euler angles: r' = R v, phi' = J^-1 w.

    Singular at 90 deg of platform pitch.
    """
    sines = (
        sin(x[State.ROLL]), cos(x[State.ROLL]), sin(x[State.PLATFORM_PITCH]), cos(x[State.PLATFORM_PITCH]),
        sin(x[State.YAW]), cos(x[State.YAW]),
    )  # fmt: skip
    attitude_rate_at(pose_by_sines(x, sines, plane), sines, dx, plane)


@kernel
def attitude_rate_at(pose, sines, dx, plane):
    """Fill dx with the rates of attitude_rate, from the pose and the sines (state.fill_sines) of a state."""
    if plane is not None:
        dx[State.SURGE] = pose.r11 * pose.vx + pose.r13 * pose.vz
        dx[State.HEAVE] = pose.r31 * pose.vx + pose.r33 * pose.vz
        dx[State.PLATFORM_PITCH] = pose.wy
        dx[State.SWAY] = dx[State.ROLL] = dx[State.YAW] = 0.0
        return
    dx[State.SURGE] = pose.r11 * pose.vx + pose.r12 * pose.vy + pose.r13 * pose.vz
    dx[State.SWAY] = pose.r21 * pose.vx + pose.r22 * pose.vy + pose.r23 * pose.vz
    dx[State.HEAVE] = pose.r31 * pose.vx + pose.r32 * pose.vy + pose.r33 * pose.vz
    s1, c1, s2, c2 = sines[0], sines[1], sines[2], sines[3]
    swing = (s1 * pose.wy + c1 * pose.wz) / c2
    dx[State.ROLL] = pose.wx + swing * s2
    dx[State.PLATFORM_PITCH] = c1 * pose.wy - s1 * pose.wz
    dx[State.YAW] = swing
