"""Linearises the drag of a hull in a random sea stochastically: damping and wave force.

The drag of a strip, 0.5 rho C_D D |r| r per length with the relative velocity r across the axis, is replaced
by the linear force with the least mean square error. For a Gaussian r its gain is the mean slope, 0.5 rho
C_D D E[|r| I + r r'/|r|], in one direction without current 0.5 rho C_D D sqrt(8/pi) sigma_r (Borgman, 1967,
J. Waterways and Harbors Division 93, 129-156; Price and Wu, 1985). The gain depends on the motion of the
hull, so callers iterate. Column j of a body's quadratic damping matrix is multiplied with sqrt(8/pi) sigma_j
of hull velocity j.
"""

from dataclasses import dataclass, replace
from math import pi
from typing import NamedTuple

import numpy as np

from fowt_env.analysis.statics import rotation_of
from fowt_env.errors import InputError
from fowt_env.plant.hydro.members import AX, AXIAL_DRAG, DRAG
from fowt_env.plant.hydro.strips import GAUSS_OFFSET
from fowt_env.plant.state import State, pose_of
from fowt_env.weather.waves import jonswap, wave_number

SPECTRA = ("jonswap", "pierson_moskowitz", "still")  # kinds of sea with a spectrum, or without waves
BAND = (0.5, 5.0)  # of drawn waves, in peak frequencies
ANGLES = 512  # of the mean over directions: error 1e-5 of the gain if the water moves in one direction
RADII, WIDEST = 64, 7.0  # nodes of the mean over magnitudes, and their range in standard deviations
VELOCITIES = ("vx", "vy", "vz", "wx", "wy", "wz")  # of the hull, body components about the body origin


class HullMotion(NamedTuple):
    """Defines the velocities of a hull (VELOCITIES) in a random sea."""

    waves: object  # (n, 6) complex, per elevation at the hull, or 0.0
    other: object  # (6, 6) covariance of velocities that are independent of the waves, or 0.0


AT_REST = HullMotion(0.0, 0.0)


@dataclass(frozen=True)
class LinearDrag:
    """Holds the linear drag on a hull (SI, body components about the body origin, order of VELOCITIES).

    damping (6, 6): the force is minus damping times the hull's velocities; excitation (n, 6) complex: force
    per elevation at the hull, for a hull at rest. at_rest (6, 6): the damping without waves and motion, due
    to the current, which linear models of the plant already contain. z (m,) and deviation (m,): body z of
    the nodes of strips and members' sides, and standard deviation of the relative velocity there, m/s.
    """

    damping: np.ndarray
    excitation: np.ndarray
    at_rest: np.ndarray
    z: np.ndarray
    deviation: np.ndarray


def elevation_spectrum(sea, omega):
    """Return the one-sided elevation spectrum (n,), m2 s/rad, at increasing omega (n,) rad/s.

    sea: descriptions.SeaState; None: still water. The band is that of drawn waves (BAND), and the trapezoidal
    integral is Hs^2/16. Raises: InputError for a sea without a spectrum.
    """
    omega = np.asarray(omega, dtype=float)
    if sea is None or sea.kind == "still" or sea.height == 0.0:
        return np.zeros(omega.size)
    if sea.kind not in SPECTRA:
        raise InputError(f"sea: kind = {sea.kind!r}: must be one with a spectrum, {', '.join(SPECTRA)}")
    peak = 2.0 * pi / sea.Tp
    inside = (omega >= BAND[0] * peak) & (omega <= BAND[1] * peak)
    density = np.zeros(omega.size)
    density[inside] = jonswap(omega[inside], sea.Hs, sea.Tp, sea.gamma if sea.kind == "jonswap" else 1.0)
    total = np.trapezoid(density, omega)
    if total <= 0.0:
        raise InputError(f"omega: no frequency lies in the band of a sea with Tp = {sea.Tp:g} s")
    return density * sea.Hs**2 / 16.0 / total


class _Drag(NamedTuple):
    """Holds points of a hull with quadratic drag in one or two directions each."""

    factor: np.ndarray  # (m,) N/(m/s)^2
    position: np.ndarray  # (m, 3) body axes, m
    basis: np.ndarray  # (m, k, 3) unit vectors of the directions, body axes


def linear_drag(scene, state, omega, sea, motion=AT_REST):
    """Return the LinearDrag of a scene's hull about a state, for a sea and a motion of the hull.

    omega: (n,) rad/s, increasing, of the sea's spectrum, of motion.waves and of the excitation. sea: a
    descriptions.SeaState with a spectrum, or None. Nodes are those of the exact strips below the mean water
    surface on the axis, and those of members at their undisplaced positions. A quadratic damping matrix is
    linearised with the hull's velocities. A current of the scene is the mean of the relative velocity; its
    effect on the mean drag is omitted. Zero without hydrodynamics.
    Raises: InputError for a sea without a spectrum.
    """
    omega = np.asarray(omega, dtype=float)
    density = elevation_spectrum(sea, omega)
    hydro = scene.model.hydro
    damping, at_rest = np.zeros((6, 6)), np.zeros((6, 6))
    excitation = np.zeros((omega.size, 6), complex)
    heights, deviations = [np.zeros(0)], [np.zeros(0)]
    if hydro is None:
        return LinearDrag(damping, excitation, at_rest, heights[0], deviations[0])
    site = scene.platform.environment
    rotation, height = rotation_of(pose_of(np.ascontiguousarray(state))), float(state[State.HEAVE])
    heading = 0.0 if sea is None else np.radians(float(sea.heading))
    number = wave_number(omega, site.water_depth, site.gravity)
    weight = density * np.gradient(omega) if omega.size > 1 else np.zeros(omega.size)
    for group in (*_of_strips(hydro.strips, height, rotation), *_of_members(hydro.members)):
        # inertial axes with the origin at the hull's mean position
        position = group.position @ rotation.T + [0.0, 0.0, height]
        water = _wave_velocity(omega, number, position, heading, site.water_depth) @ rotation  # (n, m, 3)
        moved = np.einsum("nmj,mij->nmi", water, group.basis)
        flow = _current(hydro.current, position, site.water_depth) @ rotation
        mean = np.einsum("mj,mij->mi", flow, group.basis)
        # velocities of the points in these directions by the hull's velocities
        lever = np.concatenate([group.basis, np.cross(group.position[:, None, :], group.basis)], axis=2)
        hull = np.einsum("mij,nj->nmi", lever, np.broadcast_to(motion.waves, (omega.size, 6)))
        relative = moved - hull
        covariance = np.einsum("n,nmi,nmj->mij", weight, relative, relative.conj()).real
        covariance += np.einsum("mij,jk,mlk->mil", lever, np.broadcast_to(motion.other, (6, 6)), lever)
        gain = group.factor[:, None, None] * mean_slope(mean, covariance)
        damping += np.einsum("mij,mik,mkl->jl", lever, gain, lever)
        excitation += np.einsum("mij,mik,nmk->nj", lever, gain, moved)
        still = group.factor[:, None, None] * mean_slope(mean, np.zeros_like(covariance))
        at_rest += np.einsum("mij,mik,mkl->jl", lever, still, lever)
        if group.basis.shape[1] == 2:
            heights.append(group.position[:, 2])
            deviations.append(np.sqrt(np.trace(covariance, axis1=1, axis2=2)))
    damping += _of_matrix(hydro.matrices, weight, motion)
    return LinearDrag(damping, excitation, at_rest, np.concatenate(heights), np.concatenate(deviations))


def _of_strips(part, height, rotation):
    """Return the [_Drag] of the strips' sides and keel; empty without strips."""
    if part is None or part.shape is None:
        return []
    strips = part.shape
    z, length, diameter = _nodes(strips, height, rotation)
    sides, keel = np.zeros((z.size, 3)), np.zeros((1, 3))
    sides[:, 2], keel[:, 2] = z, strips.keel_z
    across = 0.5 * strips.density * strips.drag_coefficient * diameter * length
    along = np.array([0.5 * strips.density * strips.axial_drag_coefficient * strips.keel_area])
    axes = np.eye(3)
    return [
        _Drag(across, sides, np.broadcast_to(axes[:2], (z.size, 2, 3))),
        _Drag(along, keel, axes[None, 2:]),
    ]


def _of_members(members):
    """Return the [_Drag] of the members' sides and ends; empty without members."""
    if members is None:
        return []
    groups = []
    for column, size in ((DRAG, 2), (AXIAL_DRAG, 1)):
        nodes = members.nodes[members.nodes[:, column] > 0.0]
        if len(nodes):
            axis = nodes[:, AX : AX + 3]
            # rows of V in the singular value decomposition of an axis: the axis and two normals
            basis = np.linalg.svd(axis[:, None, :])[2]
            groups.append(
                _Drag(nodes[:, column], nodes[:, :3], basis[:, 1:] if size == 2 else axis[:, None, :])
            )
    return groups


def _of_matrix(matrices, weight, motion):
    """Return the (6, 6) linearised quadratic damping of BodyMatrices, which acts on body velocities."""
    if matrices is None or not matrices.quadratic_damping.any():
        return np.zeros((6, 6))
    hull = np.broadcast_to(motion.waves, (weight.size, 6))
    covariance = np.einsum("n,ni,nj->ij", weight, hull, np.conj(hull)).real + motion.other * np.ones((6, 6))
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return matrices.quadratic_damping * np.sqrt(8.0 / pi) * deviation


def with_drag(model, drag):
    """Return the LinearModel with the damping of a LinearDrag in A and C, instead of the current's alone."""
    columns = [model.index(name) for name in VELOCITIES]
    change = drag.damping - drag.at_rest
    a, c = model.A.copy(), model.C.copy()
    a[:, columns] -= model.E @ change
    c[:, columns] -= model.F @ change
    return replace(model, A=a, C=c)


def mean_slope(mean, covariance):
    """Return E[|r| I + r r'/|r|] (m, k, k) of Gaussian vectors r of k = 1 or 2 components.

    mean (m, k); covariance (m, k, k). The average over directions is a sum of even steps; the average over
    magnitudes is exact for zero mean, else by Gauss-Legendre quadrature.
    """
    mean, covariance = np.asarray(mean, dtype=float), np.asarray(covariance, dtype=float)
    size = mean.shape[1]
    values, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    angles = np.array([0.0, pi]) if size == 1 else (np.arange(ANGLES) + 0.5) * 2.0 * pi / ANGLES
    unit = np.stack([np.cos(angles), np.sin(angles)])[:size]
    spread = np.einsum("mij,ja->mai", root, unit)  # r at one standard deviation in each direction
    if not np.any(mean):
        # mean magnitude: of the absolute value of a normal variable, or of a Rayleigh variable
        average = np.sqrt(2.0 / pi) if size == 1 else np.sqrt(0.5 * pi)
        return average * _slopes(spread).mean(axis=1)
    x, weight = np.polynomial.legendre.leggauss(RADII)
    radius = 0.5 * WIDEST * (1.0 + x)
    weight = weight * np.exp(-0.5 * radius**2) * radius ** (size - 1)
    weight /= weight.sum()
    total = np.zeros_like(covariance)
    for r, w in zip(radius, weight, strict=True):
        total += w * _slopes(mean[:, None, :] + r * spread).mean(axis=1)
    return total


def _slopes(r):
    """Return |r| I + r r'/|r| (..., k, k) of vectors (..., k)."""
    size = np.linalg.norm(r, axis=-1)[..., None, None]
    outer = r[..., :, None] * r[..., None, :]
    return size * np.eye(r.shape[-1]) + np.divide(outer, size, out=np.zeros_like(outer), where=size > 0.0)


def _nodes(strips, height, rotation):
    """Return the body z, length and diameter (m,) of the strips' nodes below the mean surface on the axis."""
    surface = min(max(-height / max(rotation[2, 2], 0.1), strips.keel_z), strips.top_z)
    parts = []
    for number, cells in enumerate(strips.cells):
        bottom = strips.section_bottom[number]
        top = surface if number == 0 else min(surface, strips.section_top[number])
        cell = max(top - bottom, 0.0) / cells
        inside = np.array([GAUSS_OFFSET, 1.0 - GAUSS_OFFSET])
        z = top - cell * (np.arange(cells)[:, None] + inside).ravel()
        diameter = strips.diameter_bottom[number] + strips.diameter_slope[number] * (z - bottom)
        parts.append((z, np.full(z.size, 0.5 * cell), diameter))
    return tuple(np.concatenate(parts, axis=1))


def _wave_velocity(omega, number, position, heading, depth):
    """Return the (n, m, 3) complex velocity of linear waves at positions (m, 3), per elevation at origin."""
    along = position[:, 0] * np.cos(heading) + position[:, 1] * np.sin(heading)
    z = np.minimum(position[:, 2], 0.0)
    k, w = number[:, None], omega[:, None]
    phase = np.exp(-1j * k * along)
    below = np.exp(-2.0 * k * (z + depth))
    size = w * np.exp(k * z) / -np.expm1(-2.0 * k * depth) * phase
    across = size * (1.0 + below)
    return np.stack([across * np.cos(heading), across * np.sin(heading), 1j * size * (1.0 - below)], axis=-1)


def _current(current, position, depth):
    """Return the (m, 3) velocity of the current at positions (m, 3)."""
    flow = np.zeros_like(position)
    if current is not None:
        fraction = np.clip((depth + position[:, 2]) / depth, 0.0, 1.0) ** current.exponent
        flow[:, 0], flow[:, 1] = current.u * fraction, current.v * fraction
    return flow
