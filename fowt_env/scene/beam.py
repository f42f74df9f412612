"""Sums mass and shapes of a beam along its bending modes, for blades and towers.

A particle at the distance z along the beam's axis lies at (U1 q, U2 q, z - q S q / 2): deflections by shapes
times modal coordinates q (m), and the shortening of the bent axis. All integrals are ElastoDyn's sums over
equal elements (subroutine Coeff).
"""

from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.tower_modes import POWERS
from fowt_env.plant.elastic.beam import Beam


class Shapes(NamedTuple):
    """Holds the shapes of n modes at m points of a beam, each per metre of a modal coordinate."""

    U: np.ndarray  # (n, 2, m) -: deflection along x and y
    slope: np.ndarray  # (n, 2, m) 1/m: derivative of the deflection along z
    S: np.ndarray  # (n, n, m) 1/m: the beam is shorter by q S q / 2 up to the point


class BeamNodes(NamedTuple):
    """Holds the particles of a beam, from root to tip: the ends and the midpoints of the elements between."""

    z: np.ndarray  # (m,) m from the beam's origin
    outer: np.ndarray  # (m,) m, outer end of each element
    length: np.ndarray  # (m,) m of each element, 0 at both ends
    mass: np.ndarray  # (m,) kg
    shapes: Shapes


def shape_values(shapes, fraction, derivative=0):
    """Return (points, n) values of shapes, or of their derivatives, at height fractions."""
    power, factor = POWERS.copy(), np.ones(len(POWERS))
    for _ in range(derivative):
        factor = factor * power
        power = power - 1
    return np.asarray(fraction)[:, None] ** power @ (shapes * factor).T


def integrated(nodes, stiffness, damping):
    """Return the Beam of BeamNodes with (n, n) stiffness (N/m) and damping (N s/m)."""
    m, z, (u1, u2), s = nodes.mass, nodes.z, np.swapaxes(nodes.shapes.U, 0, 1), nodes.shapes.S

    def total(axes, *factors):
        return np.ascontiguousarray(np.einsum(axes, *factors))

    return Beam(
        count=(0,) * len(u1),
        mass=float(m.sum()),
        first=float(m @ z),
        second=float(m @ z**2),
        a=u1 @ m,
        b=u2 @ m,
        e=u1 @ (m * z),
        f=u2 @ (m * z),
        A=total("k,ik,jk->ij", m, u1, u1),
        B=total("k,ik,jk->ij", m, u2, u2),
        C=total("k,ik,jk->ij", m, u1, u2),
        S0=total("k,ijk->ij", m, s),
        S1=total("k,ijk->ij", m * z, s),
        P=total("k,ik,jlk->ijl", m, u1, s),
        Q=total("k,ik,jlk->ijl", m, u2, s),
        T=total("k,ijk,lnk->ijln", m, s, s),
        stiffness=np.ascontiguousarray(stiffness),
        damping=np.ascontiguousarray(damping),
    )


def outer_part(nodes, station):
    """Return the BeamNodes outside of a station (m from the origin); a cut element by its outer part."""
    inside = station - (nodes.outer - nodes.length)
    share = np.ones_like(nodes.mass)
    whole = nodes.length > 0.0
    share[whole] = 1.0 - np.clip(inside[whole] / nodes.length[whole], 0.0, 1.0)
    share[~whole] = nodes.z[~whole] >= station
    z = np.where(share < 1.0, nodes.outer - 0.5 * share * nodes.length, nodes.z)

    def moved(values):
        return np.apply_along_axis(lambda row: np.interp(z, nodes.z, row), -1, values)

    return nodes._replace(z=z, mass=share * nodes.mass, shapes=Shapes(*map(moved, nodes.shapes)))


def section_columns(nodes):
    """Return (k, m) functions of BeamNodes of which places and accelerations of the particles are sums.

    Rows: z, the n shapes U1, the n shapes U2, and S of each pair (i, j), j <= i.
    """
    (u1, u2), s = np.swapaxes(nodes.shapes.U, 0, 1), nodes.shapes.S
    return np.vstack([nodes.z, u1, u2, s[np.tril_indices(len(u1))]])


def carried_shapes(nodes, z, node):
    """Return the Shapes at distances z (m,) from the origin, each moved rigidly by the node of this index."""
    shape, slope, shortening = (values[..., node] for values in nodes.shapes)
    away, square = z - nodes.z[node], np.einsum("iak,jak->ijk", slope, slope)
    return Shapes(shape + slope * away, slope, shortening + square * away)


def shapes_between(nodes, z):
    """Return the Shapes of BeamNodes at distances z (m,) from the origin (shapes_at)."""
    left = np.clip(np.searchsorted(nodes.z, z, side="right") - 1, 0, len(nodes.z) - 2)
    weight = np.clip((z - nodes.z[left]) / (nodes.z[left + 1] - nodes.z[left]), 0.0, 1.0)
    both = zip(*(carried_shapes(nodes, z, k) for k in (left, left + 1)), strict=True)
    return Shapes(*((1.0 - weight) * one + weight * two for one, two in both))


def summed(values, length):
    """Return (..., m + 2) integrals of midpoint values (..., m) at the root, at the midpoints, at the tip."""
    ends = np.cumsum(length * values, axis=-1)
    root = np.zeros_like(values[..., :1])
    middles = np.concatenate([root, ends[..., :-1]], axis=-1) + 0.5 * length * values
    return np.concatenate([root, middles, ends[..., -1:]], axis=-1)
