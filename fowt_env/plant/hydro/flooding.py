"""Adds the water in flooded compartments to the hydrodynamic load: weight and inertia (theory.md, 5.3).

The water moves with the platform: its free surface is omitted. Loads and added mass of the hull contain it,
as the flooded members of HydroDyn do.
"""

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.hydro.load import HydroLoad
from fowt_env.plant.rigid_body import momentum_rate
from fowt_env.plant.state import Wrench, add


@kernel
def add_point_mass(mass, x, y, z, matrix):
    """Add a point mass (kg) at a point in body axes (m) to a symmetric mass matrix (6, 6)."""
    for i in range(3):
        matrix[i, i] += mass
    matrix[0, 4] += mass * z
    matrix[4, 0] += mass * z
    matrix[1, 3] -= mass * z
    matrix[3, 1] -= mass * z
    matrix[1, 5] += mass * x
    matrix[5, 1] += mass * x
    matrix[2, 4] -= mass * x
    matrix[4, 2] -= mass * x
    matrix[2, 3] += mass * y
    matrix[3, 2] += mass * y
    matrix[0, 5] -= mass * y
    matrix[5, 0] -= mass * y
    matrix[3, 3] += mass * (y * y + z * z)
    matrix[4, 4] += mass * (x * x + z * z)
    matrix[5, 5] += mass * (x * x + y * y)
    matrix[3, 4] -= mass * x * y
    matrix[4, 3] -= mass * x * y
    matrix[3, 5] -= mass * x * z
    matrix[5, 3] -= mass * x * z
    matrix[4, 5] -= mass * y * z
    matrix[5, 4] -= mass * y * z


@kernel
def with_floods(pose, load, gravity, flood, added):
    """Return a HydroLoad with the weight and momentum rate of the water of mass matrix flood (6, 6).

    The matrix is added to added (6, 6). Without water the load is returned unchanged.
    """
    if flood[0, 0] == 0.0:
        return load
    for i in range(6):
        for j in range(6):
            added[i, j] += flood[i, j]
    nx, ny, nz = -gravity * pose.r31, -gravity * pose.r32, -gravity * pose.r33
    mass, sx, sy, sz = flood[0, 0], flood[1, 5], flood[2, 3], flood[0, 4]
    rate = momentum_rate(pose, 0.0, flood, 0.0, None)
    water = Wrench(
        mass * nx - rate.fx,
        mass * ny - rate.fy,
        mass * nz - rate.fz,
        sy * nz - sz * ny - rate.mx,
        sz * nx - sx * nz - rate.my,
        sx * ny - sy * nx - rate.mz,
    )
    return HydroLoad(add(load.buoyancy, water), load.strips, load.damping)
