"""Computes strip loads of a long-crested sea from wave bands at quadrature nodes; exact: morison.py."""

from math import pi, sqrt

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.hydro.morison import NO_STRIP_LOAD, StripLoad, current_at
from fowt_env.plant.hydro.strip_quadrature import (
    BLOCK,
    CU,
    CV,
    D0,
    D1,
    DU,
    DW,
    WEIGHT,
    P,
    U,
    W,
    Z,
    place_nodes,
)
from fowt_env.plant.hydro.undisplaced_axis import keel_force, side_force
from fowt_env.plant.hydro.wave_bands import WAVE_NUMBER, chain_start, chain_sums, compress, phasors
from fowt_env.plant.hydro.waves import ramp_factor
from fowt_env.plant.state import NO_LOAD, Wrench, add


@kernel
def band_surface(pose, quadrature, lean, reach, e0, e1, e2, e3):
    """Return (z_surf, eta) as strips.axis_surface, from the surface's Taylor series e0..e3 (see compress).

    lean: distance along the heading per metre of height.
    """
    if not quadrature.instantaneous_position:
        return e0 if quadrature.instantaneous_surface else 0.0, e0
    tilt = max(pose.r33, 0.1)
    if not quadrature.instantaneous_surface:
        return -pose.z / tilt, e0
    eta = e0
    for _ in range(3):
        xi = min(max(lean * eta, -reach), reach)
        value = e0 + xi * (e1 + xi * (0.5 * e2 + xi * e3 / 6.0))
        slope = e1 + xi * (e2 + 0.5 * xi * e3)
        eta -= (eta - value) / max(1.0 - lean * slope, 0.3)
    return (eta - pose.z) / tilt, eta


@kernel
def block_current(pose, depth, current, node):
    """Fill the current at a block's nodes, inertial axes."""
    if current is None:
        return
    for n in range(BLOCK):
        z = node[Z * BLOCK + n]
        cu, cv = current_at(pose.z + pose.r33 * z, depth, current)
        node[CU * BLOCK + n] = cu
        node[CV * BLOCK + n] = cv


@kernel
def block_load(pose, quadrature, table, bands, current, node):
    """Return (Wrench, S_0, S_1, S_2) of a block: Eq. (16) and the pressure on the taper, without the keel."""
    added_line = 0.25 * pi * quadrature.density * quadrature.added_mass_coefficient
    froude_line = 0.25 * pi * quadrature.density * (1.0 + quadrature.added_mass_coefficient)
    drag_line = 0.5 * quadrature.density * quadrature.drag_coefficient
    fx = fy = fz = mx = my = s0 = s1 = s2 = 0.0
    along_x = along_y = 0.0
    if bands is not None:
        along_x = pose.r11 * bands.cos_heading + pose.r21 * bands.sin_heading
        along_y = pose.r12 * bands.cos_heading + pose.r22 * bands.sin_heading
    for n in range(BLOCK):
        z = node[Z * BLOCK + n]
        weight = node[WEIGHT * BLOCK + n]
        d = table[D0 * BLOCK + n] + table[D1 * BLOCK + n] * z
        sx = pose.vx + pose.wy * z
        sy = pose.vy - pose.wx * z
        rx, ry = -sx, -sy
        if bands is not None:
            u, w = node[U * BLOCK + n], node[W * BLOCK + n]
            rx += along_x * u + pose.r31 * w
            ry += along_y * u + pose.r32 * w
        if current is not None:
            cu, cv = node[CU * BLOCK + n], node[CV * BLOCK + n]
            rx += pose.r11 * cu + pose.r21 * cv
            ry += pose.r12 * cu + pose.r22 * cv
        added = weight * added_line * d * d
        if quadrature.undisplaced_axis is not None:
            u = v = du = dv = taper = 0.0
            if bands is not None:
                u, v = bands.cos_heading * node[U * BLOCK + n], bands.sin_heading * node[U * BLOCK + n]
                du, dv = bands.cos_heading * node[DU * BLOCK + n], bands.sin_heading * node[DU * BLOCK + n]
                taper = weight * 0.5 * pi * d * table[D1 * BLOCK + n] * node[P * BLOCK + n]
            if current is not None:
                u, v = u + node[CU * BLOCK + n], v + node[CV * BLOCK + n]
            px, py, pz = side_force(
                pose, z, u, v, du, dv, weight * drag_line * d, added, weight * froude_line * d * d, taper
            )
            fz += pz
        else:
            drag = weight * drag_line * d * sqrt(rx * rx + ry * ry)
            px = drag * rx - added * (pose.wy * pose.vz - pose.wz * sy)
            py = drag * ry - added * (pose.wz * sx - pose.wx * pose.vz)
            if bands is not None:
                du, dw = node[DU * BLOCK + n], node[DW * BLOCK + n]
                froude = weight * froude_line * d * d
                px += froude * (along_x * du + pose.r31 * dw)
                py += froude * (along_y * du + pose.r32 * dw)
                fz += weight * 0.5 * pi * d * table[D1 * BLOCK + n] * node[P * BLOCK + n]
        fx += px
        fy += py
        mx -= z * py
        my += z * px
        s0 += added
        s1 += added * z
        s2 += added * z * z
    return Wrench(fx, fy, fz, mx, my, 0.0), s0, s1, s2


@kernel
def keel_load(pose, quadrature, bands, current, node):
    """Return the Wrench of the axial force on the keel: pressure, added mass and drag (theory.md, 5.4)."""
    zk = quadrature.keel_z
    n = quadrature.keel % BLOCK
    if quadrature.undisplaced_axis is not None:
        w = dw = pressure = 0.0
        if bands is not None:
            w, dw = node[W * BLOCK + n], node[DW * BLOCK + n]
            pressure = quadrature.keel_area * node[P * BLOCK + n]
        added = quadrature.heave_added_mass
        fx, fy, fz = keel_force(pose, zk, w, dw, quadrature.axial_drag, added, pressure)
        return Wrench(fx, fy, fz, -zk * fy, zk * fx, 0.0)
    sx = pose.vx + pose.wy * zk
    sy = pose.vy - pose.wx * zk
    force = -quadrature.heave_added_mass * (pose.wx * sy - pose.wy * sx)
    rz = -pose.vz
    if bands is not None:
        along = pose.r13 * bands.cos_heading + pose.r23 * bands.sin_heading
        rz += along * node[U * BLOCK + n] + pose.r33 * node[W * BLOCK + n]
        az = along * node[DU * BLOCK + n] + pose.r33 * node[DW * BLOCK + n]
        force += quadrature.heave_added_mass * az + quadrature.keel_area * node[P * BLOCK + n]
    if current is not None:
        rz += pose.r13 * node[CU * BLOCK + n] + pose.r23 * node[CV * BLOCK + n]
    return Wrench(0.0, 0.0, force + quadrature.axial_drag * abs(rz) * rz, 0.0, 0.0, 0.0)


@kernel
def band_field(t, pose, quadrature, bands, scratch):
    """Fill scratch.field; return (z_surf, eta, height of the reference point on the axis)."""
    z_ref = distance = lean = 0.0
    if quadrature.instantaneous_position:
        tilt = max(pose.r33, 0.1)
        z_ref = -pose.z / tilt
        lean = (pose.r13 * bands.cos_heading + pose.r23 * bands.sin_heading) / tilt
        x, y = pose.x + pose.r13 * z_ref, pose.y + pose.r23 * z_ref
        distance = x * bands.cos_heading + y * bands.sin_heading
    cosine, sine = scratch.phasor[0], scratch.phasor[1]
    phasors(t, distance, bands.component, cosine, sine)
    e0, e1, e2, e3 = compress(
        ramp_factor(t, bands.ramp), bands.band, bands.weight, bands.number, cosine, sine, scratch.field
    )
    z_surf, eta = band_surface(pose, quadrature, lean, bands.reach, e0, e1, e2, e3)
    return z_surf, eta, z_ref


@kernel
def still_surface(pose, quadrature):
    """Return the body z where the axis meets still water."""
    if not quadrature.instantaneous_position:
        return 0.0
    return -pose.z / max(pose.r33, 0.1)


@kernel
def block_kinematics(pose, z_ref, eta, quadrature, bands, field, node, diffraction, block):
    """Fill the kinematics U, W, DU, DW (along the heading and up) and P of a block; still water: nothing."""
    if bands is None:
        return
    stretch = 1.0
    drop = 0.0
    if quadrature.wheeler:
        stretch = quadrature.depth / (quadrature.depth + eta)
        drop = stretch * eta
    scale = bands.number[WAVE_NUMBER, 0] * 0.5 ** (bands.lead + 4)
    if quadrature.instantaneous_position:
        sway = pose.r13 * bands.cos_heading + pose.r23 * bands.sin_heading
        chain_start(pose.z, pose.r33, sway, z_ref, stretch, drop, scale, bands.lead, node)
    else:
        chain_start(0.0, 1.0, 0.0, 0.0, stretch, drop, scale, bands.lead, node)
    chain_sums(bands.number, bands.n_reflected, field, node, diffraction, block)


@kernel
def banded_strip_load(t, pose, quadrature, bands, current, scratch, diffraction=None):
    """Return the StripLoad of morison.morison_load from StripQuadrature and WaveBands (None: still water).

    diffraction: BandDiffraction, or None for the coefficient 1 + C_A.
    """
    if quadrature is None:
        return NO_STRIP_LOAD
    eta = z_ref = 0.0
    if bands is None:
        z_surf = still_surface(pose, quadrature)
    else:
        z_surf, eta, z_ref = band_field(t, pose, quadrature, bands, scratch)
    z_surf = min(max(z_surf, quadrature.keel_z), quadrature.top_z)
    load, s0, s1, s2 = NO_LOAD, 0.0, 0.0, 0.0
    for block in range(scratch.nodes.shape[0]):
        table, node = quadrature.table[block], scratch.nodes[block]
        place_nodes(z_surf, table, node)
        block_kinematics(pose, z_ref, eta, quadrature, bands, scratch.field, node, diffraction, block)
        block_current(pose, quadrature.depth, current, node)
        part, of_block, first, second = block_load(pose, quadrature, table, bands, current, node)
        load = add(load, part)
        s0 += of_block
        s1 += first
        s2 += second
    keel = scratch.nodes[quadrature.keel // BLOCK]
    load = add(load, keel_load(pose, quadrature, bands, current, keel))
    return StripLoad(load, s0, s1, s2, quadrature.heave_added_mass)
