"""Accelerations of spar, tower, nacelle, rotor and generator rotor as free bodies that joints hold together.

Newton and Euler for each body in inertial axes, with its own six unknown accelerations; the joints and the
gearbox are rows of constraints, their forces Lagrange multipliers. No partial velocities and no mass matrix
of the whole, which rigid_body.py and the package have.
"""

import numpy as np
from naive import rigid_body


def skew(a):
    """Matrix of the cross product with a."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def accelerations(platform, turbine, row, force, moment):
    """(7,) v', w', w_b' of a state and a load on the rotor at the hub, in platform axes.

    row: mapping with roll, platform_pitch, yaw, vx to wz, rotor_speed and generator_torque (SI, radians).
    """
    parts = rigid_body.bodies(platform, turbine)
    spar, shell, generator, rotor = 0, 2, 3, 4
    R = rigid_body.rotation(row["roll"], row["platform_pitch"], row["yaw"])
    v, w = (np.array([row[k + axis] for axis in "xyz"]) for k in ("v", "w"))
    size = 6 * len(parts)
    mass, load = np.zeros((size, size)), np.zeros(size)
    turning = [R @ part.turning(w, row["rotor_speed"]) for part in parts]
    for k, part in enumerate(parts):
        linear, angular = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
        inertia = R @ part.inertia @ R.T
        mass[linear, linear], mass[angular, angular] = part.mass * np.eye(3), inertia
        load[linear] = [0.0, 0.0, -part.mass * platform.environment.gravity]
        load[angular] = -np.cross(turning[k], inertia @ turning[k])
    lever = rigid_body.hub(turbine) - parts[rotor].centre
    load[6 * rotor : 6 * rotor + 3] += R @ force
    load[6 * rotor + 3 : 6 * rotor + 6] += R @ (moment + np.cross(lever, force))
    shaft, W = R @ parts[rotor].axis, R @ w
    load[6 * generator + 3 : 6 * generator + 6] -= row["generator_torque"] * shaft
    load[6 * shell + 3 : 6 * shell + 6] += row["generator_torque"] * shaft

    rows, wanted = [], []
    for k in range(1, len(parts)):  # every body is at a place of the first one that does not move in it
        reach = R @ (parts[k].centre - parts[spar].centre)
        joint = np.zeros((3, size))
        joint[:, 6 * k : 6 * k + 3], joint[:, :3] = np.eye(3), -np.eye(3)
        joint[:, 3:6] = skew(reach)
        rows += list(joint)
        wanted += list(np.cross(W, np.cross(W, reach)))
        # and turns with it, but for a spin about the shaft, which itself turns
        relative = np.zeros((3, size))
        relative[:, 6 * k + 3 : 6 * k + 6], relative[:, 3:6] = np.eye(3), -np.eye(3)
        spin = parts[k].spin * row["rotor_speed"] * np.cross(W, shaft)
        across = np.linalg.svd(shaft[None])[2][1:] if parts[k].spin else np.eye(3)
        rows += list(across @ relative)
        wanted += list(across @ spin)
    gear = np.zeros(size)  # against the nacelle the generator turns the ratio times what the rotor does
    gear[6 * generator + 3 : 6 * generator + 6] = shaft
    gear[6 * rotor + 3 : 6 * rotor + 6] = -parts[generator].spin * shaft
    gear[3:6] = (parts[generator].spin - 1.0) * shaft
    constraints, wanted = np.array([*rows, gear]), np.array([*wanted, 0.0])
    scale = 1e6  # about a mass: the same size everywhere
    whole = np.block([
        [mass, scale * constraints.T],
        [scale * constraints, np.zeros((len(wanted), len(wanted)))],
    ])  # fmt: skip
    found = np.linalg.solve(whole, np.r_[load, scale * wanted])
    turned = found[3:6]
    back = R @ -parts[spar].centre
    origin = found[:3] + np.cross(turned, back) + np.cross(W, np.cross(W, back))
    spinning = shaft @ (found[6 * rotor + 3 : 6 * rotor + 6] - turned)
    return np.r_[R.T @ origin - np.cross(w, v), R.T @ turned, spinning]
