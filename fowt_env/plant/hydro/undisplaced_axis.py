"""Computes loads of strips along the axes that they have at rest, as HydroDyn does (theory.md, 5.4).

The nodes move with the hull, and so does the point at which their loads act; drag and inertia of a strip of a
spar stay horizontal, the pressure on taper and keel vertical.
"""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.state import to_body, to_inertial


def undisplaced(axis):
    """Return the option strip_axis as True or None: of unlike types, so that one alone is compiled."""
    return True if axis == "undisplaced" else None


@inlined_kernel
def _own_motion(pose, z):
    """Return velocity and velocity-dependent acceleration, inertial, of the axis at body height z."""
    sx, sy = pose.vx + pose.wy * z, pose.vy - pose.wx * z
    cx, cy = pose.wy * pose.vz - pose.wz * sy, pose.wz * sx - pose.wx * pose.vz
    return to_inertial(pose, sx, sy, pose.vz), to_inertial(pose, cx, cy, pose.wx * sy - pose.wy * sx)


@inlined_kernel
def side_force(pose, z, u, v, du, dv, drag, added, froude, vertical):
    """Return the force, N, body axes, of a strip at body height z: horizontal, and a given vertical one.

    u, v, du, dv   horizontal velocity and acceleration of the water, m/s and m/s2
    drag, added, froude   N/(m/s)^2; kg of body acceleration; kg of water acceleration
    """
    own, turn = _own_motion(pose, z)
    rx, ry = u - own[0], v - own[1]
    speed = (rx * rx + ry * ry) ** 0.5
    fx = drag * speed * rx + froude * du - added * turn[0]
    fy = drag * speed * ry + froude * dv - added * turn[1]
    return to_body(pose, fx, fy, vertical)


@inlined_kernel
def keel_force(pose, z, w, dw, drag, added, pressure):
    """Return the vertical force, N, body axes, on the keel at body height z.

    w, dw   vertical velocity and acceleration of the water, m/s and m/s2
    drag, added, pressure   N/(m/s)^2, kg, N
    """
    own, turn = _own_motion(pose, z)
    rise = w - own[2]
    return to_body(pose, 0.0, 0.0, pressure + added * (dw - turn[2]) + drag * abs(rise) * rise)


@kernel
def fill_undisplaced_mass(pose, strips, zk, matrix):
    """Fill the symmetric (6, 6) added mass of a StripLoad whose strips take water along in horizontal motion.

    At height z the hull moves by v + w x (0, 0, z); the moment of a force there is (-z fy, z fx, 0).
    zk: height of the keel, whose added mass is vertical.
    """
    n = (pose.r31, pose.r32, pose.r33)
    for i in range(3):
        for j in range(3):
            vertical = n[i] * n[j]
            level = (1.0 if i == j else 0.0) - vertical
            matrix[i, j] = strips.s0 * level + strips.a33 * vertical
            first = strips.s1 * level + zk * strips.a33 * vertical
            second = strips.s2 * level + zk * zk * strips.a33 * vertical
            if j < 2:  # a turn about y moves the axis along x, one about x against y
                sign, column = (1.0, 4) if j == 0 else (-1.0, 3)
                matrix[i, column] = matrix[column, i] = sign * first
                if i < 2:
                    turned, row = (1.0, 4) if i == 0 else (-1.0, 3)
                    matrix[row, column] = turned * sign * second
        matrix[i, 5] = matrix[5, i] = matrix[i + 3, 5] = matrix[5, i + 3] = 0.0
