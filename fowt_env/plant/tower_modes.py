"""A tower that bends in its first, or first two, modes in each direction."""

from typing import NamedTuple

import numpy as np


class TowerModes(NamedTuple):
    """Integrals along the tower, of its n modes: fore-aft, side-side, and again for the second ones.

    Shapes are 1 at the top; the state has the displacement of the top in each mode, m, and its rate.
    """

    first: int  # index of the first deflection in the state; the velocities follow the n deflections
    fore_aft: np.ndarray  # (n,) 1.0 of a fore-aft mode, 0.0 of a side-side one
    top_height: float  # m, of the tower top above the body origin
    slope: np.ndarray  # (n,) 1/m, of each shape at the top
    first_moment: np.ndarray  # (n,) kg, of the tower's line mass times the shape
    height_moment: np.ndarray  # (n,) kg m, with the height above the body origin
    mass: np.ndarray  # (n, n) kg, of the tower's line mass times the product of two shapes, of any direction
    stiffness: np.ndarray  # (n, n) N/m, structural; zero between the directions, as the next two
    damping: np.ndarray  # (n, n) N s/m, structural
    weight_stiffness: np.ndarray  # (n, n) kg/m: mass above times the product of slopes, over the height
    drag_shape: np.ndarray  # (points, n) shapes at the points of aero.tower_drag.TowerDrag
