"""Strip (Morison) loads of waves, current and own motion on the hull, theory.md Eqs (16)-(17).

Nodes lie in equal cells of two Gauss points per hull section. Along the axis the complex amplitude
of a component is exp(kappa z), so it is carried from node to node by multiplication instead of an
exponential, sine and cosine each; tests compare this with the plain sum (tests/naive).
"""

from math import cos, exp, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.hydro.diffraction import factor_at
from fowt_env.plant.hydro.waves import NEGLIGIBLE, elevation, ramp_factor
from fowt_env.plant.state import Wrench

CELLS_PER_DRAFT = (
    60  # at least, below the surface section (2 m of OC3): 1e-5 of the first harmonic at T = 5 s
)
SURFACE_CELLS = 4  # cells between the last joint and the moving surface
SURFACE_ROUNDS = 8  # fixed-point rounds for the surface on the axis; slope*tilt contracts by 10 or more
SURFACE_TOLERANCE = 1e-10  # m
EXTINCT = 1e-24  # squared magnitude (1e-12 of the surface value) below which a component is dropped
GAUSS_OFFSET = 0.5 * (1.0 - 1.0 / sqrt(3.0))  # first two-point Gauss node in a unit cell
GAUSS_GAP = 1.0 / sqrt(3.0)

# rows of the node scratch array
U, V, W, DU, DV, DW, P = range(7)


class Strips(NamedTuple):
    """Strip description of the hull. Sections run downwards from the surface one.

    Each is cut at the water surface: nodes above it would meet the short waves of a linear sea where
    their kinematics grow without bound.
    """

    section_top: np.ndarray  # (m,) body z; the first is still water, in place of the hull's top
    section_bottom: np.ndarray  # (m,)
    cells: np.ndarray  # (m,) int64
    first_node: np.ndarray  # (m,) int64
    diameter_bottom: np.ndarray  # (m,)
    diameter_slope: np.ndarray  # (m,) per metre of height
    nodes: int
    density: float
    added_mass_coefficient: float
    drag_coefficient: float
    heave_added_mass: float  # A33, kg
    axial_drag_coefficient: float
    keel_z: float
    keel_area: float
    top_z: float  # of the hull: the surface integral ends there
    depth: float
    instantaneous_position: bool
    instantaneous_surface: bool
    wheeler: bool


class Current(NamedTuple):
    """Steady current: velocity at the surface and power-law decay to the seabed (exponent 0: uniform)."""

    u: float
    v: float
    exponent: float


class StripLoad(NamedTuple):
    """Hydrodynamic wrench without the added-mass part, and that part's integrals S_k (kg m^k), A33."""

    wrench: Wrench
    s0: float
    s1: float
    s2: float
    a33: float


def build_strips(hull, hydro, *, density, depth, position, surface, stretching, cell=None):
    """Strips from description.Hull and description.Hydro with the three kinematics switches.

    cell: longest cell below the surface section, m; None: a share of the draft, so that models of any
    scale are cut alike.
    """
    z = list(hull.z)
    if cell is None:
        cell = -z[0] / CELLS_PER_DRAFT
    tops, bottoms, diameters = [], [], []
    for i in range(len(z) - 2, -1, -1):
        tops.append(z[i + 1])
        bottoms.append(z[i])
        diameters.append((hull.diameter[i], hull.diameter[i + 1]))
    tops[0] = 0.0
    cells, first, nodes = [], [], 0
    for number, (top, bottom) in enumerate(zip(tops, bottoms, strict=True)):
        n = SURFACE_CELLS if number == 0 else max(2, int(np.ceil((top - bottom) / cell - 1e-9)))
        cells.append(n)
        first.append(nodes)
        nodes += 2 * n
    lower, upper = np.array(diameters).T
    slope = (upper - lower) / np.subtract(tops, bottoms)
    return Strips(
        np.array(tops, dtype=np.float64),
        np.array(bottoms, dtype=np.float64),
        np.array(cells, dtype=np.int64),
        np.array(first, dtype=np.int64),
        np.ascontiguousarray(lower),
        np.ascontiguousarray(slope),
        nodes,
        float(density),
        float(hydro.added_mass_coefficient),
        float(hydro.drag_coefficient),
        float(hydro.heave_added_mass),
        float(hydro.axial_drag_coefficient),
        float(hull.z[0]),
        float(0.25 * pi * hull.diameter[0] ** 2),
        float(hull.z[-1]),
        float(depth),
        position == "instantaneous",
        surface == "instantaneous",
        stretching == "wheeler",
    )


@kernel
def axis_surface(t, pose, strips, waves):
    """(z_surf, eta): body z where the axis meets the water surface, and the elevation there."""
    eta = 0.0
    if not strips.instantaneous_position:
        if waves is not None:
            eta = elevation(t, 0.0, 0.0, waves)
        z = eta if strips.instantaneous_surface else 0.0
        return min(max(z, strips.keel_z), strips.top_z), eta
    tilt = max(pose.r33, 0.1)
    z = -pose.z / tilt
    if waves is not None:
        for _ in range(SURFACE_ROUNDS):
            eta = elevation(t, pose.x + pose.r13 * z, pose.y + pose.r23 * z, waves)
            if not strips.instantaneous_surface:
                break
            new = (eta - pose.z) / tilt
            change = abs(new - z)
            z = new
            if change < SURFACE_TOLERANCE:
                break
    return min(max(z, strips.keel_z), strips.top_z), eta


@kernel
def wet_cell(section, z_surf, strips):
    """(top, height of one cell) of a section cut at the surface; a dry section has height 0."""
    top = z_surf
    if section > 0:
        top = min(z_surf, strips.section_top[section])
    return top, max(top - strips.section_bottom[section], 0.0) / strips.cells[section]


@kernel
def strip_kinematics(t, pose, z_surf, eta, strips, waves, kin, diffraction=None):
    """Fill kin (7, n_nodes) with velocity, acceleration (inertial axes) and dynamic pressure at the nodes.

    z_surf, eta   from axis_surface
    diffraction   StripDiffraction or None; scales and turns the nodes' accelerations, not the keel's
    Returns the keel's (p, u, v, w, du, dv, dw), in Pa, m/s and m/s2.
    """
    kin[:] = 0.0
    h = waves.depth
    if strips.instantaneous_position:
        x0, y0, z0, r13, r23, r33 = pose.x, pose.y, pose.z, pose.r13, pose.r23, pose.r33
    else:
        x0 = y0 = z0 = r13 = r23 = 0.0
        r33 = 1.0
    stretch = 1.0
    drop = 0.0
    if strips.wheeler:
        stretch = h / (h + eta)
        drop = stretch * eta
    base_z = stretch * z0 - drop
    kp = ku = kv = kw = kdu = kdv = kdw = 0.0
    for j in range(waves.omega.shape[0]):
        k, om, a = waves.wave_number[j], waves.omega[j], waves.velocity[j]
        cb, sb = waves.cos_heading[j], waves.sin_heading[j]
        phase = k * (x0 * cb + y0 * sb) - om * t + waves.phase[j]
        rate = k * (r13 * cb + r23 * sb)  # phase per metre of axis
        up = k * stretch * r33
        pressure = waves.density * om / k
        bottom_wave = 2.0 * k * (h + strips.keel_z) < NEGLIGIBLE  # the seabed reflection reaches the keel
        alive = True
        for section in range(strips.cells.shape[0]):
            if not alive:
                break
            top, height = wet_cell(section, z_surf, strips)
            cells = strips.cells[section]
            node = strips.first_node[section]
            za = top - GAUSS_OFFSET * height
            m = exp(k * base_z + up * za)
            ar, ai = m * cos(phase + rate * za), m * sin(phase + rate * za)
            gap = GAUSS_GAP * height
            m = exp(-up * gap)
            c, s = cos(rate * gap), -sin(rate * gap)
            br, bi = m * (ar * c - ai * s), m * (ar * s + ai * c)
            m = exp(-up * height)
            qc, qs = cos(rate * height), -sin(rate * height)
            qr, qi = m * qc, m * qs
            # reflected part: exp(-k (Z' + 2h)) with the same phase
            ra = rb = grow = 0.0
            car = cai = cbr = cbi = 0.0
            if bottom_wave:
                grow = exp(up * height)
                ra = exp(-k * base_z - up * za - 2.0 * k * h)
                rb = ra * exp(up * gap)
                car, cai = cos(phase + rate * za), sin(phase + rate * za)
                cbr, cbi = car * c - cai * s, car * s + cai * c
            tapered, gr, gi = False, 1.0, 0.0
            if diffraction is not None:
                tapered = strips.diameter_slope[section] != 0.0
                gr, gi = factor_at(diffraction.series[j, section], 0.0)
            for cell in range(cells):
                for point in range(2):
                    er, ei = (ar, ai) if point == 0 else (br, bi)
                    fr = fi = 0.0
                    if bottom_wave:
                        if point == 0:
                            fr, fi = ra * car, ra * cai
                        else:
                            fr, fi = rb * cbr, rb * cbi
                    even_c, even_s = a * (er + fr), a * (ei + fi)
                    odd_c, odd_s = a * (er - fr), a * (ei - fi)
                    kin[U, node] += even_c * cb
                    kin[V, node] += even_c * sb
                    kin[W, node] += odd_s
                    if diffraction is not None:
                        if tapered:
                            share = GAUSS_OFFSET if point == 0 else 1.0 - GAUSS_OFFSET
                            x = top - height * (cell + share) - diffraction.centre[section]
                            gr, gi = factor_at(diffraction.series[j, section], x)
                        even_s = gr * even_s + gi * even_c
                        odd_c = gr * odd_c - gi * odd_s
                    kin[DU, node] += om * even_s * cb
                    kin[DV, node] += om * even_s * sb
                    kin[DW, node] -= om * odd_c
                    kin[P, node] += pressure * even_c
                    node += 1
                ar, ai = ar * qr - ai * qi, ar * qi + ai * qr
                br, bi = br * qr - bi * qi, br * qi + bi * qr
                if bottom_wave:
                    car, cai = car * qc - cai * qs, car * qs + cai * qc
                    cbr, cbi = cbr * qc - cbi * qs, cbr * qs + cbi * qc
                    ra *= grow
                    rb *= grow
                elif ar * ar + ai * ai < EXTINCT:
                    alive = False
                    break
        if alive:
            zk = strips.keel_z
            m = exp(k * base_z + up * zk)
            r = exp(-k * base_z - up * zk - 2.0 * k * h) if bottom_wave else 0.0
            c, s = cos(phase + rate * zk), sin(phase + rate * zk)
            even, odd = a * (m + r), a * (m - r)
            kp += pressure * even * c
            ku += even * c * cb
            kv += even * c * sb
            kw += odd * s
            kdu += om * even * s * cb
            kdv += om * even * s * sb
            kdw -= om * odd * c
    f = ramp_factor(t, waves.ramp)
    if f != 1.0:
        kin *= f
    return f * kp, f * ku, f * kv, f * kw, f * kdu, f * kdv, f * kdw


@kernel
def current_at(z, depth, current):
    """(u, v) of the current at inertial height z."""
    if current is None:
        return 0.0, 0.0
    share = min(max((depth + z) / depth, 0.0), 1.0) ** current.exponent
    return current.u * share, current.v * share


@kernel
def morison_load(t, pose, strips, waves, current, kin, diffraction=None):
    """Strip load from the keel to the surface, Eqs (16)-(17), with the axial terms of theory.md 5.4.

    kin: (7, n_nodes) scratch. diffraction: StripDiffraction or None, which leaves 1 + C_A.
    The section-acceleration term is returned as S_k for the left-hand side.
    """
    if strips is None:
        return StripLoad(Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    rho, ca = strips.density, strips.added_mass_coefficient
    z_surf, eta = axis_surface(t, pose, strips, waves)
    kp = ku = kv = kw = kdu = kdv = kdw = 0.0
    if waves is not None:
        kp, ku, kv, kw, kdu, kdv, kdw = strip_kinematics(
            t, pose, z_surf, eta, strips, waves, kin, diffraction
        )
    fx = fy = fz = mx = my = s0 = s1 = s2 = 0.0
    for section in range(strips.cells.shape[0]):
        top, height = wet_cell(section, z_surf, strips)
        weight = 0.5 * height
        for c in range(strips.cells[section]):
            for point in range(2):
                n = strips.first_node[section] + 2 * c + point
                z = top - height * (c + (GAUSS_OFFSET if point == 0 else 1.0 - GAUSS_OFFSET))
                d = strips.diameter_bottom[section] + strips.diameter_slope[section] * (
                    z - strips.section_bottom[section]
                )
                sx = pose.vx + pose.wy * z
                sy = pose.vy - pose.wx * z
                u = v = w = 0.0
                if waves is not None:
                    u, v, w = kin[U, n], kin[V, n], kin[W, n]
                if current is not None:
                    cu, cv = current_at(pose.z + pose.r33 * z, strips.depth, current)
                    u += cu
                    v += cv
                rx = pose.r11 * u + pose.r21 * v + pose.r31 * w - sx
                ry = pose.r12 * u + pose.r22 * v + pose.r32 * w - sy
                area = 0.25 * pi * d * d
                drag = 0.5 * rho * strips.drag_coefficient * d * hypot(rx, ry)
                inertia = rho * area * ca
                px = drag * rx - inertia * (pose.wy * pose.vz - pose.wz * sy)
                py = drag * ry - inertia * (pose.wz * sx - pose.wx * pose.vz)
                if waves is not None:
                    du, dv, dw = kin[DU, n], kin[DV, n], kin[DW, n]
                    froude = rho * area * (1.0 + ca)
                    px += froude * (pose.r11 * du + pose.r21 * dv + pose.r31 * dw)
                    py += froude * (pose.r12 * du + pose.r22 * dv + pose.r32 * dw)
                    fz += weight * kin[P, n] * (0.5 * pi * d * strips.diameter_slope[section])
                fx += weight * px
                s0 += weight * inertia
                s1 += weight * inertia * z
                s2 += weight * inertia * z * z
                fy += weight * py
                mx -= weight * z * py
                my += weight * z * px
    zk = strips.keel_z
    sx = pose.vx + pose.wy * zk
    sy = pose.vy - pose.wx * zk
    if current is not None:
        cu, cv = current_at(pose.z + pose.r33 * zk, strips.depth, current)
        ku += cu
        kv += cv
    rz = pose.r13 * ku + pose.r23 * kv + pose.r33 * kw - pose.vz
    az = pose.r13 * kdu + pose.r23 * kdv + pose.r33 * kdw
    fz += kp * strips.keel_area
    fz += strips.heave_added_mass * (az - (pose.wx * sy - pose.wy * sx))
    fz += 0.5 * rho * strips.axial_drag_coefficient * strips.keel_area * abs(rz) * rz
    return StripLoad(Wrench(fx, fy, fz, mx, my, 0.0), s0, s1, s2, strips.heave_added_mass)
