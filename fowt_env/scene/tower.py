"""Integrates mass, stiffness and weight of the tower along its bending modes (theory.md, section 2.8)."""

import numpy as np

from fowt_env.descriptions.tower_modes import POWERS
from fowt_env.errors import InputError
from fowt_env.plant.aero.tower_drag import POINTS
from fowt_env.plant.tower.modes import TowerModes

MODES = {"rigid": 0, "modes": 1, "modes2": 2}  # option tower: modes in each direction


def modes_asked(options):
    """Return the number of modes in each direction of the options. Raises: InputError in a planar scene."""
    count = MODES[options["tower"]]
    if count and options["planar"]:
        raise InputError(
            f"tower = {options['tower']!r}: the tower also bends sideways; a planar scene needs 'rigid'"
            " (or planar = False)"
        )
    return count


def mode_shapes(modes, count):
    """Return ((n, 5) coefficients, (n,) fore-aft flags) of the modes, n = 2 count; values 1 at the top."""
    pairs = zip(modes.fore_aft[:count], modes.side_side[:count], strict=True)
    shapes = np.array([shape for pair in pairs for shape in pair])
    return shapes / shapes.sum(axis=1, keepdims=True), np.tile([True, False], count)


def shape_values(shapes, fraction, derivative=0):
    """Return (points, n) values of shapes, or of their derivatives, at height fractions."""
    power, factor = POWERS.copy(), np.ones(len(POWERS))
    for _ in range(derivative):
        factor = factor * power
        power = power - 1
    return np.asarray(fraction)[:, None] ** power @ (shapes * factor).T


def build_tower_modes(platform, turbine, count, first_state):
    """Return TowerModes with `count` modes in each direction, states from first_state on; None for count 0.

    Raises: InputError if the platform file lacks the modes.
    """
    if count == 0:
        return None
    tower, bending = platform.tower, platform.tower.modes
    if bending is None or len(bending.fore_aft) < count:
        known = "no [tower.modes]" if bending is None else "first modes alone in [tower.modes]"
        options = list(MODES)
        raise InputError(
            f"tower = {options[count]!r}: the platform {platform.name!r} has {known} in its file; allowed:"
            f" {', '.join(map(repr, options[: count if bending else 1]))}"
        )
    height = tower.top_height - tower.base_height
    shapes, fore_aft = mode_shapes(bending, count)
    middle = bending.middles()
    cell = height / bending.elements
    mass = cell * np.interp(middle, bending.height_fraction, bending.mass_density)
    shape = shape_values(shapes, middle)
    slope = shape_values(shapes, middle, 1) / height
    curvature = shape_values(shapes, middle, 2) / height**2
    alike = np.equal.outer(fore_aft, fore_aft)
    generalised = np.einsum("k,ki,kj->ij", mass, shape, shape)
    stiffness = _stiffness(bending, middle, curvature, fore_aft, cell, count)
    # mass supported by each element: all mass above its midpoint
    top = bending.top_mass + turbine.nacelle.mass + turbine.rotor.mass
    drag_points = 0.5 * (np.polynomial.legendre.leggauss(POINTS)[0] + 1.0)  # points of build_tower_drag
    above = mass[::-1].cumsum()[::-1] - 0.5 * mass + top
    return TowerModes(
        first=int(first_state),
        fore_aft=fore_aft.astype(float),
        top_height=float(tower.top_height),
        slope=shape_values(shapes, [1.0], 1)[0] / height,
        first_moment=mass @ shape + bending.top_mass,
        height_moment=(mass * (tower.base_height + height * middle)) @ shape
        + bending.top_mass * tower.top_height,
        mass=np.ascontiguousarray(generalised + bending.top_mass),
        stiffness=np.ascontiguousarray(stiffness),
        damping=np.ascontiguousarray(_damping(bending, stiffness, generalised, count)),
        weight_stiffness=np.where(alike, np.einsum("k,ki,kj->ij", cell * above, slope, slope), 0.0),
        drag_shape=np.ascontiguousarray(shape_values(shapes, drag_points)),
        count=(0,) * len(shapes),
    )


def tower_states(modes):
    """Return the number of states of TowerModes or None: deflections and their velocities."""
    return 0 if modes is None else 2 * modes.slope.shape[0]


def tower_frequency(modes):
    """Return the largest natural frequency (rad/s) of TowerModes on the dry floater; 0 for None (rigid).

    Straight tower and fixed rotor, without added mass and weight, which would lower the frequency.
    """
    if modes is None:
        return 0.0
    n, along = len(modes.slope), modes.fore_aft
    across, height, first = 1.0 - along, modes.top_height, modes.upper_moment
    cross = np.cross(np.eye(3), first)
    upper = np.block([[modes.upper_mass * np.eye(3), -cross], [cross, modes.upper_inertia]])
    # velocity and angular velocity of the tower top, from six platform motions and the deflections
    moved = np.zeros((6, 6 + n))
    moved[:, :6] = np.eye(6)
    moved[0, 4], moved[1, 3] = height, -height
    moved[[0, 1], 6:] = along, across
    moved[[3, 4], 6:] = -across * modes.slope, along * modes.slope
    mass = moved.T @ upper @ moved
    mass[:6, :6] += modes.lower
    tower = np.zeros((6, n))
    tower[0], tower[1] = along * modes.first_moment, across * modes.first_moment
    tower[3], tower[4] = -across * modes.height_moment, along * modes.height_moment
    mass[:6, 6:] += tower
    mass[6:, :6] += tower.T
    mass[6:, 6:] += modes.mass * (np.outer(along, along) + np.outer(across, across))
    flexibility = np.linalg.inv(mass)[6:, 6:]
    return float(np.sqrt(np.linalg.eigvals(flexibility @ modes.stiffness).real.max()))


def _stiffness(bending, middle, curvature, fore_aft, cell, count):
    """Return the (n, n) modal stiffness, EI times two curvatures, scaled by the modes' stiffness tuners."""
    known = bending.height_fraction
    ones = (1.0,) * count
    tuner = _each(bending.fore_aft_tuner or ones, bending.side_side_tuner or ones, count)
    result = np.zeros((2 * count, 2 * count))
    for along, side in ((False, bending.side_side_stiffness), (True, bending.fore_aft_stiffness)):
        rows = np.flatnonzero(fore_aft == along)
        part, stiffness = curvature[:, rows], np.interp(middle, known, side)
        result[np.ix_(rows, rows)] = np.einsum("k,ki,kj->ij", cell * stiffness, part, part)
    return result * np.sqrt(np.outer(tuner, tuner))


def _damping(bending, stiffness, generalised, count):
    """Return the (n, n) damping 2 zeta K / omega, zeta and omega of the second mode, without top mass.

    ElastoDyn's CTFA and CTSS, which use the frequency of the bare tower without weight.
    """
    ratio = _each(bending.fore_aft_damping, bending.side_side_damping, count)
    bare = np.sqrt(np.diag(stiffness) / np.diag(generalised))
    return stiffness * (2.0 * ratio / bare)


def _each(fore_aft, side_side, count):
    """Return (n,) values of the modes in the order of the plant."""
    return np.column_stack([fore_aft[:count], side_side[:count]]).ravel()
