"""Divides the hull into strips: equal cells of two Gauss points per section, cut at the water surface."""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.hydro.undisplaced_axis import undisplaced
from fowt_env.plant.hydro.waves import elevation

CELLS_PER_DRAFT = 60  # minimum below the surface section (2 m of OC3): 1e-5 of the first harmonic at T = 5 s
SURFACE_CELLS = 4  # cells between the last joint and the moving surface
SURFACE_ROUNDS = 8  # fixed-point iterations of the surface on the axis; slope*tilt contracts by 10 or more
SURFACE_TOLERANCE = 1e-10  # m
GAUSS_OFFSET = 0.5 * (1.0 - 1.0 / sqrt(3.0))  # first two-point Gauss node in a unit cell
GAUSS_GAP = 1.0 / sqrt(3.0)


class Strips(NamedTuple):
    """Holds the strips of the hull. Sections run downwards from the surface section.

    Each section is cut at the water surface: above the surface the kinematics of the short waves of a
    linear sea grow without bound.
    """

    section_top: np.ndarray  # (m,) body z; the first is still water instead of the hull's top
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
    top_z: float  # of the hull: upper limit of the surface integral
    depth: float
    instantaneous_position: bool
    instantaneous_surface: bool
    wheeler: bool
    undisplaced_axis: object  # True: loads across and along the vertical, not the hull's axis; else None


def build_strips(hull, hydro, *, density, depth, position, surface, stretching, cell=None, axis="displaced"):
    """Return the Strips of a Hull and HydroCoefficients (descriptions.platform) with the kinematics options.

    cell: longest cell below the surface section, m; None: a fraction of the draft, so that models of any
    scale have the same division.
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
        undisplaced(axis),
    )


@kernel
def axis_surface(t, pose, strips, waves):
    """Return (z_surf, eta): body z where the axis meets the water surface, and the elevation there."""
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
    """Return (top, height of one cell) of a section cut at the surface; a dry section has height 0."""
    top = z_surf
    if section > 0:
        top = min(z_surf, strips.section_top[section])
    return top, max(top - strips.section_bottom[section], 0.0) / strips.cells[section]
