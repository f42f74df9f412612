"""Computes strip (Morison) loads of waves, current and motion of the hull, theory.md Eqs (16)-(17).

Nodes lie in equal cells of two Gauss points per hull section. Along the axis the complex amplitude
of a component is exp(kappa z), so one multiplication per node replaces exponential, sine and cosine;
tests compare this with the plain sum (tests/naive).
"""

from math import hypot, pi
from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.hydro.strip_kinematics import DU, DV, DW, P, U, V, W, strip_kinematics
from fowt_env.plant.hydro.strips import GAUSS_OFFSET, axis_surface, wet_cell
from fowt_env.plant.hydro.undisplaced_axis import keel_force, side_force
from fowt_env.plant.hydro.waves import Kinematics
from fowt_env.plant.state import NO_LOAD, Wrench


class Current(NamedTuple):
    """Holds a steady current: surface velocity, power-law decay to the seabed (exponent 0: uniform)."""

    u: float
    v: float
    exponent: float


class StripLoad(NamedTuple):
    """Holds a hydrodynamic wrench without added mass, and the added-mass integrals S_k (kg m^k), A33."""

    wrench: Wrench
    s0: float
    s1: float
    s2: float
    a33: float


NO_STRIP_LOAD = StripLoad(NO_LOAD, 0.0, 0.0, 0.0, 0.0)


@kernel
def current_at(z, depth, current):
    """Return the (u, v) of the current at inertial height z."""
    if current is None:
        return 0.0, 0.0
    fraction = min(max((depth + z) / depth, 0.0), 1.0) ** current.exponent
    return current.u * fraction, current.v * fraction


@kernel
def morison_load(t, pose, strips, waves, current, kin, diffraction=None):
    """Return the StripLoad from keel to surface, Eqs (16)-(17), with the axial terms of theory.md 5.4.

    kin: (7, n_nodes) scratch. diffraction: StripDiffraction, or None for the coefficient 1 + C_A.
    The section-acceleration term is returned as S_k for the left-hand side.
    """
    if strips is None:
        return NO_STRIP_LOAD
    rho, ca = strips.density, strips.added_mass_coefficient
    z_surf, eta = axis_surface(t, pose, strips, waves)
    keel = Kinematics(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if waves is not None:
        keel = strip_kinematics(t, pose, z_surf, eta, strips, waves, kin, diffraction)
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
                area = 0.25 * pi * d * d
                inertia = rho * area * ca
                if strips.undisplaced_axis is not None:
                    du = dv = taper = 0.0
                    if waves is not None:
                        du, dv = kin[DU, n], kin[DV, n]
                        taper = kin[P, n] * (0.5 * pi * d * strips.diameter_slope[section])
                    px, py, pz = side_force(
                        pose, z, u, v, du, dv, 0.5 * rho * strips.drag_coefficient * d, inertia,
                        rho * area * (1.0 + ca), taper,
                    )  # fmt: skip
                    fz += weight * pz
                else:
                    rx = pose.r11 * u + pose.r21 * v + pose.r31 * w - sx
                    ry = pose.r12 * u + pose.r22 * v + pose.r32 * w - sy
                    drag = 0.5 * rho * strips.drag_coefficient * d * hypot(rx, ry)
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
    u, v = keel.u, keel.v
    if current is not None:
        cu, cv = current_at(pose.z + pose.r33 * zk, strips.depth, current)
        u += cu
        v += cv
    axial = 0.5 * rho * strips.axial_drag_coefficient * strips.keel_area
    if strips.undisplaced_axis is not None:
        px, py, pz = keel_force(
            pose, zk, keel.w, keel.dw, axial, strips.heave_added_mass, keel.pressure * strips.keel_area
        )
        fx, fy, fz, mx, my = fx + px, fy + py, fz + pz, mx - zk * py, my + zk * px
    else:
        rz = pose.r13 * u + pose.r23 * v + pose.r33 * keel.w - pose.vz
        az = pose.r13 * keel.du + pose.r23 * keel.dv + pose.r33 * keel.dw
        fz += keel.pressure * strips.keel_area
        fz += strips.heave_added_mass * (az - (pose.wx * sy - pose.wy * sx))
        fz += axial * abs(rz) * rz
    return StripLoad(Wrench(fx, fy, fz, mx, my, 0.0), s0, s1, s2, strips.heave_added_mass)
