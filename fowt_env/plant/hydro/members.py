"""Computes strip (Morison) loads on straight cylinders of any position, direction, taper (theory.md, 5.10).

A member has cells of two Gauss points along its wet part and a node at each end. Every node has an axis, with
coefficients across and along the axis, so that one loop computes the load of all members. With the
undisplaced position and the still-water surface, nodes and added mass are constant, and the water motion can
come from a table (member_series.py); else the nodes are placed at each evaluation.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.hydro.member_buoyancy import build_member_bodies
from fowt_env.plant.hydro.member_series import N_WATER, VELOCITIES, WaterSeries, interpolate, no_series
from fowt_env.plant.hydro.morison import current_at
from fowt_env.plant.hydro.strips import GAUSS_OFFSET
from fowt_env.plant.hydro.undisplaced_axis import undisplaced
from fowt_env.plant.hydro.waves import elevation, wave_kinematics
from fowt_env.plant.state import N_RIGID, Wrench, add, pose_of, to_body, to_inertial

CELLS_PER_SIZE = 20  # of the longest side of the box around all members: 3e-4 of the first harmonic, T = 5 s
CUT_ROUNDS = 12  # iterations for the intersection of an axis with the waves
CUT_TOLERANCE = 1e-10  # m

# columns of nodes: position and axis in body axes, coefficients across the axis, coefficients along the axis
X, Y, Z, AX, AY, AZ = range(6)
DRAG, ADDED, FROUDE = range(6, 9)  # N/(m/s)^2; kg of body acceleration; kg of water acceleration
AXIAL_DRAG, AXIAL_ADDED, AREA = range(9, 12)  # the same of an end; m2 of pressure along the axis
N_NODE = 12

# columns of the members: start, axis, length; diameters and coefficients at start and end; the two ends
START, AXIS, LENGTH = 0, 3, 6
DIAMETER, C_DRAG, C_ADDED, C_PRESSURE = 7, 9, 11, 13  # two each
AXIAL = 15  # AXIAL_DRAG, AXIAL_ADDED, AREA at the start, then at the end
N_MEMBER = 21


class Members(NamedTuple):
    """Holds all members of a hull."""

    nodes: np.ndarray  # (n, N_NODE) with a load, of the undisplaced platform in still water
    added_mass: np.ndarray  # (6, 6) of these nodes about the body origin
    table: np.ndarray  # (m, N_MEMBER)
    cells: np.ndarray  # (m,) int64
    bodies: object  # member_buoyancy.MemberBodies or None: all belong to a potential-flow body
    series: WaterSeries  # of these nodes; without rows where the waves are summed
    density: float
    depth: float
    inertial: bool  # whether any node has other loads than drag
    instantaneous_position: bool
    instantaneous_surface: bool
    wheeler: bool
    undisplaced_axis: object  # as strips.Strips

    @property
    def scratch_nodes(self):
        """Return the number of nodes that are placed at each evaluation; 0 for constant nodes."""
        moving = self.instantaneous_position or self.instantaneous_surface
        return int(np.sum(2 * self.cells + 2)) if moving else 0


def build_members(
    members, *, density, gravity, depth, position, surface, stretching, cell=None, axis="displaced"
):
    """Return the Members of descriptions.platform.Member records with kinematics options; None without any.

    cell: longest cell, m; None: a fraction of the overall size. The series has no rows yet.
    """
    if not members:
        return None
    corners = np.array([point for member in members for point in (member.start, member.end)])
    if cell is None:
        cell = np.max(np.ptp(corners, axis=0)) / CELLS_PER_SIZE
    table = np.array([_member_row(member, density) for member in members])
    cells = np.ceil(table[:, LENGTH] / cell - 1e-9).astype(np.int64)
    still = Members(
        nodes=np.zeros((0, N_NODE)),
        added_mass=np.zeros((6, 6)),
        table=np.ascontiguousarray(table),
        cells=cells,
        bodies=build_member_bodies(members, density, gravity),
        series=no_series(),
        density=float(density),
        depth=float(depth),
        inertial=True,
        instantaneous_position=False,
        instantaneous_surface=False,
        wheeler=False,
        undisplaced_axis=undisplaced(axis),
    )
    nodes = np.zeros((int(np.sum(2 * cells + 2)), N_NODE))
    lay_nodes(0.0, pose_of(np.zeros(N_RIGID)), still, None, nodes)
    nodes = np.ascontiguousarray(nodes[np.any(nodes[:, DRAG:] != 0.0, axis=1)])
    added = np.zeros((6, 6))
    for node in nodes:
        add_node_mass(node, node[AX], node[AY], node[AZ], added)
    return still._replace(
        nodes=nodes,
        added_mass=added,
        inertial=bool(np.any(table[:, [C_ADDED, C_ADDED + 1, C_PRESSURE, C_PRESSURE + 1]]))
        or bool(np.any(table[:, [AXIAL + 1, AXIAL + 2, AXIAL + 4, AXIAL + 5]])),
        instantaneous_position=position == "instantaneous",
        instantaneous_surface=surface == "instantaneous",
        wheeler=stretching == "wheeler",
    )


def _member_row(member, density):
    """Return the table row of a Member."""
    start, end = np.array(member.start), np.array(member.end)
    length = float(np.linalg.norm(end - start))
    factor = 0.0 if member.potential_flow else 1.0  # a potential-flow body already has inertia and pressure
    radius = 0.5 * np.array(member.diameter)
    area, half_sphere = pi * radius**2, 2.0 / 3.0 * pi * radius**3
    ends = np.column_stack(
        [
            0.5 * density * area * member.axial_drag_coefficient,
            factor * density * half_sphere * member.axial_added_mass_coefficient,
            factor * area * member.axial_pressure_coefficient * [1.0, -1.0],
        ]
    )
    return np.concatenate(
        [
            start, (end - start) / length, [length], member.diameter, member.drag_coefficient,
            factor * np.array(member.added_mass_coefficient), factor * np.array(member.pressure_coefficient),
            ends.ravel(),
        ]
    )  # fmt: skip


@kernel
def axis_point(pose, m, along, members):
    """Return the inertial position, m, of a point of a member's axis; along: distance from its start, m."""
    row = members.table[m]
    x, y, z = row[0] + along * row[3], row[1] + along * row[4], row[2] + along * row[5]
    return _position(pose, x, y, z, members.instantaneous_position)


@kernel
def _position(pose, x, y, z, moved):
    """Return the inertial position of a body-fixed point; moved: of the displaced platform."""
    if not moved:
        return x, y, z
    dx, dy, dz = to_inertial(pose, x, y, z)
    return pose.x + dx, pose.y + dy, pose.z + dz


@kernel
def _above(t, pose, m, along, members, waves):
    """Return the height of a point of a member's axis above the water, m."""
    x, y, z = axis_point(pose, m, along, members)
    if members.instantaneous_surface:
        return z - elevation(t, x, y, waves)
    return z


@kernel
def wet_part(t, pose, m, members, waves):
    """Return (from, to) of the wet part of a member's axis, m from its start; equal for a dry member."""
    low, high = 0.0, members.table[m, LENGTH]
    above_low = _above(t, pose, m, low, members, waves)
    above_high = _above(t, pose, m, high, members, waves)
    if above_low <= 0.0 and above_high <= 0.0:
        return low, high
    if above_low > 0.0 and above_high > 0.0:
        return 0.0, 0.0
    start_wet = above_low <= 0.0
    cut, last, side = 0.0, -1.0, 0
    for _ in range(CUT_ROUNDS):  # false position, halving the value at a retained end (the Illinois method)
        cut = (low * above_high - high * above_low) / (above_high - above_low)
        if abs(cut - last) < CUT_TOLERANCE:
            break
        last = cut
        above = _above(t, pose, m, cut, members, waves)
        if (above <= 0.0) == start_wet:
            low, above_low = cut, above
            above_high *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            high, above_high = cut, above
            above_low *= 0.5 if side == 2 else 1.0
            side = 2
    return (0.0, cut) if start_wet else (cut, members.table[m, LENGTH])


@kernel
def lay_nodes(t, pose, members, waves, nodes):
    """Place the nodes (n, N_NODE) of all members on their wet parts."""
    n = 0
    for m in range(members.table.shape[0]):
        row = members.table[m]
        low, high = wet_part(t, pose, m, members, waves)
        height = (high - low) / members.cells[m]
        for cell in range(members.cells[m]):
            for point in range(2):
                along = low + height * (cell + (GAUSS_OFFSET if point == 0 else 1.0 - GAUSS_OFFSET))
                _side_node(row, along, 0.5 * height, members.density, nodes[n])
                n += 1
        _end_node(row, 0, high > low and low == 0.0, nodes[n])
        _end_node(row, 1, high > low and high == row[LENGTH], nodes[n + 1])
        n += 2


@kernel
def _fill_position(row, along, node):
    """Fill position and axis of a node."""
    for i in range(3):
        node[X + i] = row[START + i] + along * row[AXIS + i]
        node[AX + i] = row[AXIS + i]


@kernel
def _linear(row, column, fraction):
    """Return the linear interpolation between the values at start and end of a member, at this fraction."""
    return row[column] + fraction * (row[column + 1] - row[column])


@kernel
def _side_node(row, along, weight, density, node):
    """Fill the node of a cell's Gauss point; weight: member length, m, of the node."""
    per_length = 1.0 / row[LENGTH] if row[LENGTH] > 0.0 else 0.0
    fraction = along * per_length
    diameter = _linear(row, DIAMETER, fraction)
    slope = (row[DIAMETER + 1] - row[DIAMETER]) * per_length
    mass = weight * density * 0.25 * pi * diameter * diameter
    added, pressure = _linear(row, C_ADDED, fraction), _linear(row, C_PRESSURE, fraction)
    _fill_position(row, along, node)
    node[DRAG] = weight * 0.5 * density * _linear(row, C_DRAG, fraction) * diameter
    node[ADDED] = mass * added
    node[FROUDE] = mass * (added + pressure)
    node[AXIAL_DRAG] = node[AXIAL_ADDED] = 0.0
    node[AREA] = weight * pressure * 0.5 * pi * diameter * slope


@kernel
def _end_node(row, end, wet, node):
    """Fill the node at a member's start (0) or end (1)."""
    _fill_position(row, end * row[LENGTH], node)
    node[DRAG] = node[ADDED] = node[FROUDE] = 0.0
    for i in range(3):
        node[AXIAL_DRAG + i] = row[AXIAL + 3 * end + i] if wet else 0.0


@kernel
def axis_of(pose, node, members):
    """Return the axis (ax, ay, az) of a node in body axes."""
    if members.undisplaced_axis is not None:
        return to_body(pose, node[AX], node[AY], node[AZ])
    return node[AX], node[AY], node[AZ]


@kernel
def add_node_mass(node, ax, ay, az, added):
    """Add the added mass of a node with this axis about the body origin to `added` (6, 6)."""
    across, along = node[ADDED], node[AXIAL_ADDED]
    if across == 0.0 and along == 0.0:
        return
    x, y, z = node[X], node[Y], node[Z]
    for i in range(3):
        # column i of the node's mass across / (I - a a') + along a a', and its moment about the origin
        scale = (along - across) * (ax if i == 0 else ay if i == 1 else az)
        px = scale * ax + (across if i == 0 else 0.0)
        py = scale * ay + (across if i == 1 else 0.0)
        pz = scale * az + (across if i == 2 else 0.0)
        kx, ky, kz = y * pz - z * py, z * px - x * pz, x * py - y * px
        added[0, i] += px
        added[1, i] += py
        added[2, i] += pz
        added[3, i] += kx
        added[4, i] += ky
        added[5, i] += kz
        added[i, 3] += kx
        added[i, 4] += ky
        added[i, 5] += kz
    # moments by rotation: -[r] m [r] with m = across I + (along - across) a a'
    bx, by, bz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
    extra = along - across
    square = x * x + y * y + z * z
    added[3, 3] += across * (square - x * x) + extra * bx * bx
    added[4, 4] += across * (square - y * y) + extra * by * by
    added[5, 5] += across * (square - z * z) + extra * bz * bz
    xy = extra * bx * by - across * x * y
    xz = extra * bx * bz - across * x * z
    yz = extra * by * bz - across * y * z
    added[3, 4] += xy
    added[4, 3] += xy
    added[3, 5] += xz
    added[5, 3] += xz
    added[4, 5] += yz
    added[5, 4] += yz


@inlined_kernel
def add_member_loads(t, pose, load, members, waves, current, data):
    """Return load plus that of Members except added mass times acceleration; add to data.added_mass.

    members None: unchanged. data.member_nodes and data.member_water are scratch.
    """
    if members is None:
        return load
    if members.instantaneous_position or members.instantaneous_surface:
        lay_nodes(t, pose, members, waves, data.member_nodes)
        return add(load, _load_of(t, pose, data.member_nodes, True, members, waves, current, data))
    return add(load, _load_of(t, pose, members.nodes, False, members, waves, current, data))


@kernel
def _load_of(t, pose, nodes, moving, members, waves, current, data):
    """Return the Wrench of these nodes; add their added mass."""
    if members.inertial and (moving or members.undisplaced_axis is not None):
        for i in range(nodes.shape[0]):
            ax, ay, az = axis_of(pose, nodes[i], members)
            add_node_mass(nodes[i], ax, ay, az, data.added_mass)
    elif members.inertial:
        for i in range(6):
            for j in range(6):
                data.added_mass[i, j] += members.added_mass[i, j]
    fill_water(t, pose, nodes, members, waves, data.member_water)
    return node_loads(pose, nodes, members, waves, current, data.member_water)


@kernel
def fill_water(t, pose, nodes, members, waves, water):
    """Fill water (n * channels,) with the wave motion at the nodes; channels: the first ones of N_WATER."""
    if waves is None:
        return
    if members.series.values.shape[0] > 0:
        interpolate(t, waves.ramp, members.series, water)
        return
    channels = N_WATER if members.inertial else VELOCITIES
    for i in range(nodes.shape[0]):
        x, y, z = _position(pose, nodes[i, X], nodes[i, Y], nodes[i, Z], members.instantaneous_position)
        if members.wheeler:
            eta = elevation(t, x, y, waves)
            z = members.depth * (z - eta) / (members.depth + eta)
        moved = wave_kinematics(t, x, y, z, waves)
        k = i * channels
        water[k], water[k + 1], water[k + 2] = moved.u, moved.v, moved.w
        if members.inertial:
            water[k + 3], water[k + 4], water[k + 5] = moved.du, moved.dv, moved.dw
            water[k + 6] = moved.pressure


@kernel
def node_loads(pose, nodes, members, waves, current, water):
    """Return the Wrench of the nodes: drag, inertia, pressure, and inertia terms of the angular velocity."""
    channels = N_WATER if members.inertial else VELOCITIES
    fx = fy = fz = mx = my = mz = 0.0
    for i in range(nodes.shape[0]):
        x, y, z = nodes[i, X], nodes[i, Y], nodes[i, Z]
        ax, ay, az = axis_of(pose, nodes[i], members)
        sx = pose.vx + pose.wy * z - pose.wz * y
        sy = pose.vy + pose.wz * x - pose.wx * z
        sz = pose.vz + pose.wx * y - pose.wy * x
        rx, ry, rz = -sx, -sy, -sz
        k = i * channels
        if waves is not None:
            u, v, w = to_body(pose, water[k], water[k + 1], water[k + 2])
            rx, ry, rz = rx + u, ry + v, rz + w
        if current is not None:
            height = pose.z + pose.r31 * x + pose.r32 * y + pose.r33 * z
            cu, cv = current_at(height, members.depth, current)
            u, v, w = to_body(pose, cu, cv, 0.0)
            rx, ry, rz = rx + u, ry + v, rz + w
        along = rx * ax + ry * ay + rz * az
        rx, ry, rz = rx - along * ax, ry - along * ay, rz - along * az
        across = nodes[i, DRAG] * sqrt(rx * rx + ry * ry + rz * rz)
        axial = nodes[i, AXIAL_DRAG] * abs(along) * along
        px, py, pz = across * rx, across * ry, across * rz
        if members.inertial:
            # acceleration of the section by its angular velocity; the rest is on the left-hand side
            cx = pose.wy * sz - pose.wz * sy
            cy = pose.wz * sx - pose.wx * sz
            cz = pose.wx * sy - pose.wy * sx
            turn = cx * ax + cy * ay + cz * az
            px -= nodes[i, ADDED] * (cx - turn * ax)
            py -= nodes[i, ADDED] * (cy - turn * ay)
            pz -= nodes[i, ADDED] * (cz - turn * az)
            axial -= nodes[i, AXIAL_ADDED] * turn
            if waves is not None:
                du, dv, dw = to_body(pose, water[k + 3], water[k + 4], water[k + 5])
                surge = du * ax + dv * ay + dw * az
                px += nodes[i, FROUDE] * (du - surge * ax)
                py += nodes[i, FROUDE] * (dv - surge * ay)
                pz += nodes[i, FROUDE] * (dw - surge * az)
                axial += nodes[i, AXIAL_ADDED] * surge + nodes[i, AREA] * water[k + 6]
        px, py, pz = px + axial * ax, py + axial * ay, pz + axial * az
        fx += px
        fy += py
        fz += pz
        mx += y * pz - z * py
        my += z * px - x * pz
        mz += x * py - y * px
    return Wrench(fx, fy, fz, mx, my, mz)
