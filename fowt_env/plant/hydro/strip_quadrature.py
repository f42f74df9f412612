"""Defines the quadrature nodes of the hull for the strip loads of wave bands, grouped in blocks."""

from math import log
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel

BLOCK = 16  # nodes computed together; a hull with more nodes has several blocks
SURFACE_NODES = 4  # Gauss nodes of the surface section
# Gauss nodes of a lower section: first + second * ln(depth ratio); 3 of the taper, 8 of the cylinder of OC3
NODES_AT_LEAST, NODES_PER_LOG = -2, 4.2
# in still water a node costs next to nothing, and the drag of a decay test may change sign along the hull
STILL_REFINEMENT = 2
# rows of a block of StripQuadrature.table: the section's ends (body z), the node's fraction of the wet height
# above the bottom, its weight as a fraction of that height, and its diameter D0 + D1 z
BOTTOM, TOP, HEIGHT_FRACTION, WEIGHT_FRACTION, D0, D1, N_TABLE = range(7)
# rows of a block of BandScratch.nodes
Z, WEIGHT, AR, AI, BR, BI, U, W, DU, DW, P, CU, CV, N_ROWS = range(14)


class StripQuadrature(NamedTuple):
    """Holds the quadrature nodes of the hull, BLOCK to a block; unused nodes have zero weight.

    The arrays are few on purpose: a call passes seven words for each.
    """

    table: np.ndarray  # (blocks, N_TABLE * BLOCK), rows BOTTOM to D1 (below) concatenated
    keel: int  # node at the keel, of zero weight
    density: float
    added_mass_coefficient: float
    drag_coefficient: float
    heave_added_mass: float  # A33, kg
    axial_drag: float  # 0.5 rho C_Dz A of the keel, kg/m
    keel_z: float
    keel_area: float
    top_z: float
    depth: float
    instantaneous_position: bool
    instantaneous_surface: bool
    wheeler: bool
    undisplaced_axis: object  # as Strips


def build_quadrature(hull, strips, refinement=1):
    """Return the StripQuadrature of a descriptions.platform.Hull with the constants of its exact Strips.

    refinement: factor on the number of nodes below the surface section.
    """
    columns = []
    sections = list(zip(hull.z[:-1], hull.z[1:], hull.diameter[:-1], hull.diameter[1:], strict=True))[::-1]
    for number, (bottom, top, lower, upper) in enumerate(sections):
        if number == 0:
            fraction, weight_fraction = _gauss(SURFACE_NODES)
            lower = upper  # a cylinder: the water plane of hydrostatics.py cuts it
        else:
            # Gauss in the logarithm of depth: wave motion at depth D varies over D
            stretch = log(bottom / top)
            at, weight = _gauss(refinement * (NODES_AT_LEAST + round(NODES_PER_LOG * stretch)))
            z = top * np.exp(stretch * at)
            fraction, weight_fraction = (z - bottom) / (top - bottom), -weight * z * stretch / (top - bottom)
        slope = (upper - lower) / (top - bottom)
        for a, b in zip(fraction, weight_fraction, strict=True):
            columns.append((bottom, top, a, b, lower - slope * bottom, slope))
    keel = len(columns)
    count = -(-(keel + 1) // BLOCK) * BLOCK
    columns += [(hull.z[0], hull.z[1], 0.0, 0.0, hull.diameter[0], 0.0)] * (count - keel)
    table = np.array(columns).T.reshape(N_TABLE, -1, BLOCK).transpose(1, 0, 2)
    return StripQuadrature(
        aligned(table.reshape(-1, N_TABLE * BLOCK)),
        keel,
        strips.density,
        strips.added_mass_coefficient,
        strips.drag_coefficient,
        strips.heave_added_mass,
        0.5 * strips.density * strips.axial_drag_coefficient * strips.keel_area,
        strips.keel_z,
        strips.keel_area,
        strips.top_z,
        strips.depth,
        strips.instantaneous_position,
        strips.instantaneous_surface,
        strips.wheeler,
        strips.undisplaced_axis,
    )


def _gauss(n):
    """Return Gauss-Legendre nodes and weights (n,) on [0, 1], in ascending order."""
    x, w = np.polynomial.legendre.leggauss(n)
    return 0.5 * (1.0 + x), 0.5 * w


def aligned(values):
    """Return a copy of a float64 array aligned to 64 bytes, for the fastest vector loads."""
    values = np.asarray(values, dtype=np.float64)
    raw = np.empty(values.size + 8)
    start = (-raw.ctypes.data // 8) % 8
    copy = raw[start : start + values.size].reshape(values.shape)
    copy[...] = values
    return copy


@kernel
def place_nodes(z_surf, table, node):
    """Fill body z and weight of a block's nodes for the surface at z_surf; table: of the block."""
    for n in range(BLOCK):
        bottom = table[BOTTOM * BLOCK + n]
        wet = min(max(z_surf, bottom), table[TOP * BLOCK + n]) - bottom
        node[Z * BLOCK + n] = bottom + wet * table[HEIGHT_FRACTION * BLOCK + n]
        node[WEIGHT * BLOCK + n] = wet * table[WEIGHT_FRACTION * BLOCK + n]
