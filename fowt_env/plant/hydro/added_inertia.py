"""Applies a constant added mass, such as potential-flow codes give at infinite frequency (theory.md, 5.6)."""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import Wrench


class AddedInertia(NamedTuple):
    """Holds a constant added mass in body axes about the body origin."""

    matrix: np.ndarray  # (6, 6) symmetric: kg, kg m, kg m2


def build_added_inertia(matrix):
    """Return the AddedInertia of a platform file's (6, 6) rows; None without rows or if all are zero."""
    matrix = np.zeros((6, 6)) if matrix is None else np.ascontiguousarray(matrix, dtype=np.float64)
    return AddedInertia(matrix) if matrix.any() else None


@kernel
def added_inertia_load(pose, inertia):
    """Return the velocity-dependent added-mass load, by Kirchhoff: -(w x p, v x p + w x k), (p, k) = A nu."""
    rate = momentum_rate(pose, 0.0, inertia.matrix, 0.0, None)
    return Wrench(-rate.fx, -rate.fy, -rate.fz, -rate.mx, -rate.my, -rate.mz)
