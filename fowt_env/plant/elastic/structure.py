"""Defines the rigid bodies of a turbine with elastic parts, and the work arrays of its equation of motion."""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.model import RigidBody
from fowt_env.plant.state import BLADES

N_IN_PHASE = 13  # rows of RotorScratch.in_phase, see in_phase.py


@by_reference
class Structure(NamedTuple):
    """Holds the rigid bodies that carry or are carried by elastic parts: floater, nacelle, hub, generator.

    The hub is the rotor without its bending blades, or the whole rotor with rigid ones: a body of revolution
    about the shaft, with its moments about the rotor centre.
    """

    lower: RigidBody  # floater and straight tower
    # nacelle, about the tower top (flexible tower) or the body origin (rigid tower), in nacelle axes
    nacelle_mass: float
    nacelle_moment: np.ndarray  # (3,) kg m
    nacelle_inertia: np.ndarray  # (3, 3) kg m2
    centre: np.ndarray  # (3,) m, of the rotor, from the same point
    tilt_cosine: float
    tilt_sine: float  # of the shaft
    hub_mass: float  # kg
    hub_first: float  # kg m, along the shaft, downwind
    hub_axial: float  # kg m2, about the shaft
    hub_across: float  # kg m2, about a diameter through the rotor centre
    generator_coupling: float  # kg m2, gear ratio times generator inertia
    generator_row: float  # kg m2, square of the gear ratio times generator inertia


@by_reference
class RotorScratch(NamedTuple):
    """Holds the work arrays of a turbine with elastic parts, in platform axes unless said otherwise."""

    bend: np.ndarray  # (13,) tower.Bend of the last evaluation
    turns: np.ndarray  # (3, 4) of each blade: cosine and sine of the azimuth, then of the pitch
    axes: np.ndarray  # (3, 3, 3) of each blade: columns j1, j2, j3
    # of each blade in its axes (reduce_beam)
    moment: np.ndarray  # (3, 3) first moment
    block: np.ndarray  # (3, 6) inertia
    own: np.ndarray  # (3, n, 6) X
    pull: np.ndarray  # (3, 6) bias
    coupling: np.ndarray  # (3, n, 6) X in platform axes, forward-eliminated
    mass: np.ndarray  # (n, n) modal mass
    factors: np.ndarray  # (3, n, n) L and 1/D of the modal mass
    rest: np.ndarray  # (3, n) generalised forces less velocity terms, forward-eliminated
    force: np.ndarray  # (3, n) generalised forces of aerodynamics and structure
    inertia: np.ndarray  # (6, 6) of the rotor about its centre
    bias: np.ndarray  # (6,) of the rotor: force and moment at zero accelerations, with weight
    upper: np.ndarray  # (6, 6) of rotor, free about the shaft, and nacelle, about tower top or body origin
    shaft: np.ndarray  # (6,) inertia times a unit rotor acceleration
    motion: np.ndarray  # (6,) acceleration of the rotor centre
    solved: np.ndarray  # (n,) of the modes of a blade, in steps.py
    particles: np.ndarray  # (4, k) place and accelerations of a blade's particles, for outputs
    hub_load: np.ndarray  # (6,) inertial load and weight of the rotor about its centre
    top_load: np.ndarray  # (6,) of rotor and nacelle about tower top or body origin
    tower_moment: np.ndarray  # (3,) of the bent tower, as moment to rest of a blade, in platform axes
    tower_block: np.ndarray  # (6,)
    tower_coupling: np.ndarray  # (n, 6)
    tower_mass: np.ndarray  # (n, n)
    tower_pull: np.ndarray  # (6,)
    tower_rest: np.ndarray  # (n,)
    sinking: np.ndarray  # (n,) of the tower top, per unit rate of a deflection
    place: np.ndarray  # (7,) tower top or body origin, rotor centre from there, inverse rotor inertia
    axis: np.ndarray  # (3,) direction of the shaft, downwind
    # own modes of the tower, see steps.py: square of the frequency (1/s2) and decay rate (1/s); (n, n) from
    # deflections to them and back; impulse per unit change of the deflections' velocities, kg
    swing: np.ndarray  # (6, n), see steps.py
    to_own: np.ndarray
    from_own: np.ndarray
    impulse: np.ndarray
    twist: np.ndarray  # (2, n_state) accelerations by a unit one of the shaft's twist: now, at the last step
    shaft_torque: np.ndarray  # (4,) see shaft.py
    # of blades on a shaft that twists, see in_phase.py; else empty
    in_phase: np.ndarray  # (in_phase.N_ROW, 1 + n)
    in_phase_matrix: np.ndarray  # (2, 1 + n, 1 + n)
    found: np.ndarray  # (4 + n,)
    propagator: np.ndarray  # (2, 4 + 4 n, 6 + 6 n)
    propagated: np.ndarray  # (2, 6 + 6 n) what it is applied to, and the result
    offset: np.ndarray  # (n,) m, of exact mean deflections from those by Adams-Moulton


def rotor_scratch(structure, tower, blades, shaft, n_state):
    """Return the RotorScratch of a Structure with its elastic parts or None; None without one."""
    if structure is None:
        return None
    n, m = (0 if part is None else len(part.beam.count) for part in (blades, tower))
    z = 0 if blades is None or shaft is None else 1 + n
    shapes = (
        13, (BLADES, 4), (3, 3, 3), (BLADES, 3), (BLADES, 6), (BLADES, n, 6), (BLADES, 6), (BLADES, n, 6),
        (n, n), (BLADES, n, n), (BLADES, n), (BLADES, n), (6, 6), 6,
        (6, 6), 6, 6, n, (4, 1 + 2 * n + n * (n + 1) // 2), 6, 6,
        3, 6, (m, 6), (m, m), 6, m, m, 7, 3, (6, m), (m, m), (m, m), (m, m), (2, n_state), 4,
        (N_IN_PHASE, z), (2, z, z), z and 3 + z, (2, 4 * z, 6 * z), (2, 6 * z), z and n,
    )  # fmt: skip
    return RotorScratch(*(np.zeros(shape) for shape in shapes))
