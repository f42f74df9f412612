"""Integrates mass, stiffness and weight of the tower along its bending modes (theory.md, section 2.8)."""

import numpy as np

from fowt_env.errors import InputError
from fowt_env.plant.aero.tower_drag import POINTS
from fowt_env.plant.elastic.tower import TowerModes
from fowt_env.scene.beam import BeamNodes, Shapes, integrated, shape_values, summed
from fowt_env.scene.mass import top_mass_matrix

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
    curvature = shape_values(shapes, middle, 2) / height**2
    stiffness = _stiffness(bending, middle, curvature, fore_aft, cell, count)
    nodes, generalised = _nodes(tower, shapes, fore_aft, middle, cell)
    beam = integrated(nodes, stiffness, _damping(bending, stiffness, generalised, count))
    slope = shape_values(shapes, [1.0], 1)[0] / height
    shortening = np.ascontiguousarray(nodes.shapes.S[:, :, -1])
    drag_points = 0.5 * (np.polynomial.legendre.leggauss(POINTS)[0] + 1.0)  # points of build_tower_drag
    return TowerModes(
        first=int(first_state),
        top_height=float(tower.top_height),
        slope=slope,
        shortening=shortening,
        beam=beam._replace(mass=0.0, first=0.0, second=0.0),
        drag_shape=np.ascontiguousarray(shape_values(shapes, drag_points)),
        **stiffness_roots(stiffness - _softening(platform, turbine, beam, slope, shortening)),
    )


def _nodes(tower, shapes, fore_aft, middle, cell):
    """Return the BeamNodes of a tower, elements and the mass at the top, and (n, n) modal mass without that.

    The shortening is a sum of half elements, as ElastoDyn's.
    """
    bending, height = tower.modes, tower.top_height - tower.base_height
    at = np.append(middle, 1.0)
    mass = cell * np.interp(middle, bending.height_fraction, bending.mass_density)
    values, slope = shape_values(shapes, at).T, shape_values(shapes, at, 1).T / height
    axes = np.column_stack([fore_aft, ~fore_aft]).astype(float)  # (n, 2)
    U, turned = values[:, None] * axes[..., None], slope[:, None] * axes[..., None]
    S = summed(np.einsum("iak,jak->ijk", turned, turned)[..., :-1], cell)[..., 1:]
    length = np.append(np.full(len(middle), cell), 0.0)
    z = tower.base_height + height * at
    nodes = BeamNodes(z, z + 0.5 * length, length, np.append(mass, bending.top_mass), Shapes(U, turned, S))
    return nodes, np.einsum("k,ik,jk->ij", mass, values[:, :-1], values[:, :-1])


def _softening(platform, turbine, beam, slope, shortening):
    """Return the (n, n) stiffness, N/m, that the weight takes from an upright tower."""
    top, along = top_mass_matrix(platform, turbine), np.arange(len(slope)) % 2
    arm = top[0, 4] / top[0, 0] - platform.tower.top_height  # of nacelle and rotor above the tower top
    tilting = arm * np.outer(slope, slope) * np.equal.outer(along, along)
    return platform.environment.gravity * (beam.S0 + top[0, 0] * (shortening + tilting))


def stiffness_roots(stiffness):
    """Return root and flexible_root of TowerModes for an (n, n) stiffness, that of the weight included."""
    root = np.linalg.cholesky(stiffness)
    return {"root": root, "flexible_root": np.ascontiguousarray(np.linalg.inv(root.T))}


def tower_states(modes):
    """Return the number of states of TowerModes or None: deflections and their velocities."""
    return 0 if modes is None else 2 * len(modes.beam.count)


def tower_frequency(modes, body, structure):
    """Return the largest natural frequency (rad/s) of TowerModes on the dry floater; 0 for None (rigid).

    Straight tower and fixed rotor, without added mass and weight, which would lower the frequency. body: the
    RigidBody of the whole turbine.
    """
    if modes is None:
        return 0.0
    mass, _ = _masses(modes, body, structure)
    flexibility = np.linalg.inv(mass)[6:, 6:]
    return float(np.sqrt(np.linalg.eigvals(flexibility @ modes.beam.stiffness).real.max()))


def nacelle_mobility(modes, body, structure, turbine):
    """Return the angular acceleration about the shaft of a nacelle by a torque on it, 1/(kg m2).

    On the dry floater, with a straight tower and a rotor that is free to turn. modes: TowerModes, or None.
    """
    rotor = turbine.rotor
    mass, moved = _masses(modes, body, structure)
    about = np.cos(rotor.shaft_tilt) * moved[3] - np.sin(rotor.shaft_tilt) * moved[5]
    return float(about @ np.linalg.solve(mass - rotor.inertia * np.outer(about, about), about))


def _masses(modes, body, structure):
    """Return (mass matrix (6 + n, 6 + n) of platform and tower, (6, 6 + n) velocities of the nacelle)."""
    if modes is None:
        return body.mass_matrix, np.eye(6)
    beam, n, height, slope = modes.beam, len(modes.slope), modes.top_height, modes.slope
    along = np.arange(n) % 2 == 0
    # velocity of the body origin as a point of the nacelle, and angular velocity
    moved = np.hstack([np.eye(6), np.zeros((6, n))])
    moved[0, 6:], moved[1, 6:] = along * (1.0 - slope * height), ~along * (1.0 - slope * height)
    moved[3, 6:], moved[4, 6:] = -slope * ~along, slope * along
    lower, coupling = structure.lower.mass_matrix, np.zeros((6, n))
    coupling[0], coupling[1], coupling[3], coupling[4] = beam.a, beam.b, -beam.f, beam.e
    mass = moved.T @ (body.mass_matrix - lower) @ moved
    return mass + np.block([[lower, coupling], [coupling.T, beam.A + beam.B]]), moved


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
