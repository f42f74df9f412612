"""Defines a scene in the form of the kernels: Model is constant while stepping, Data changes.

A part that a scene lacks is None, and a part that has several forms is one of several classes: both are
resolved when a kernel is compiled (compile/variants.py), so that absent parts cost nothing.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.handle import by_reference


class RigidBody(NamedTuple):
    """Holds the mass properties of the whole turbine about the body origin, theory.md Eq. (10)."""

    mass_matrix: np.ndarray  # (6, 6) M1
    mass: float
    s_x: float  # first moments: S = (s_x, s_y, s_z), kg m
    s_y: object  # float, or None where the centre of mass lies in the plane of symmetry
    s_z: float
    gravity: float
    coupling: float  # H = I_rotor + N_g I_g
    rotor_row: float  # I_rx = I_rotor + N_g^2 I_g
    tilt: object  # tilt.Tilt of the shaft, or None where it lies along x
    platform_fixed: bool
    rotor_fixed: bool
    plane: object = None  # True: only surge, heave and platform pitch move; None: all six motions


@by_reference
class Model(NamedTuple):
    """Holds the constants of a plant: one field per physical model."""

    rigid_body: RigidBody
    layout: object  # channels.Layout
    drivetrain: object  # drivetrain.Shaft
    actuator: object  # pitch_actuator.PitchActuator or pitch_drive.PitchDrive
    generator: object  # drivetrain.TorqueLimits
    hydro: object  # hydro.load.Hydro or None
    mooring: object  # mooring.Mooring or None
    aero: object  # aero.load.Aero or None: no aerodynamics
    integrator: object  # a class of integrators.INTEGRATORS
    user: object = None  # user_loads.UserLoads or None
    pitches: object = None  # blade_pitches.BladePitches, or None: one pitch for all blades
    converter: object = None  # drivetrain.TorqueLag, or None: the torque follows its command at once
    tower: object = None  # elastic.tower.TowerModes, or None: a rigid tower
    blades: object = None  # elastic.blades.BladeModes, or None: rigid blades
    shaft: object = None  # elastic.shaft.Torsion, or None: a rigid shaft
    structure: object = None  # elastic.structure.Structure, or None: a rigid turbine


class LoadCache(IntEnum):
    """Enumerates the entries of Data.cache: loads of the last evaluation, which depend on the state alone.

    VALID is 1 while the loads belong to the current state (at TIME), so that an observation and the next step
    share one evaluation. STEPS counts the steps since the start, for the multistep integrators.
    """

    VALID = 0
    STEPS = 1
    TORQUE = 2  # aerodynamic, about the shaft
    THRUST = 3
    TOTAL = 4  # six entries each: sum of all loads, ...
    ROTOR = 10  # with a flexible tower in nacelle axes, about the nacelle frame's origin
    TOWER = 16
    HYDRO = 22  # buoyancy, strips and linear damping
    MOORING = 28
    TIME = 34
    ELEVATED = 35  # 1 while ELEVATION (surface at the origin) belongs to TIME
    ELEVATION = 36
    TORQUE_LIMITED = 37  # 1 in a control period whose torque command the generator could not follow
    MODAL = 38  # elastic.tower.MOST_MODES entries: generalised forces on the tower deflections
    SINES = 42  # six entries, state.fill_sines
    FACTORED = 48  # 1 while Data.matrix holds the factors of the state's mass matrix
    SLOW = 49  # 1 while the loads of water and lines are extrapolated, see slow_loads.py
    ANSWERED = 50  # 1 while Data.stages has rates, see integrators.keep_rates
    COMMAND = 51  # four entries: command of these rates


N_CACHE = 55


@by_reference
class Data(NamedTuple):
    """Holds the variables and work arrays of one plant.

    lines, flood, counters, cache, matrix, history, elastic, samples, radiation, slow and blades persist
    between calls.
    """

    lines: np.ndarray  # (n_lines, 6) mooring warm start and results; a broken line stays mooring.LOST
    flood: np.ndarray  # (6, 6) mass matrix of the water in flooded compartments, body axes; zero: none
    line_work: np.ndarray  # line_dynamics.line_work; empty with quasi-static lines
    counters: np.ndarray  # (N_COUNTERS,)
    kinematics: np.ndarray  # (7, n_nodes) water kinematics at the strip nodes
    bands: object  # hydro.wave_bands.BandScratch, the same for strips with wave bands
    excitation: np.ndarray  # hydro.excitation.excitation_scratch
    member_nodes: np.ndarray  # (n, hydro.members.N_NODE) member nodes that are placed at each evaluation
    member_water: np.ndarray  # (n * N_WATER,) water motion at the member nodes
    added_mass: np.ndarray  # (6, 6) of the last evaluation, symmetric, about the body origin
    matrix: np.ndarray  # (6 + n, 6 + n) factors of mass with added mass; n: modes of the tower
    stages: np.ndarray  # (5, n_state) derivatives and states within a step, and integrators.keep_rates
    cache: np.ndarray  # (N_CACHE,), see LoadCache
    user: np.ndarray  # (user_loads.user_data_size(n),) wrench of each user load, and its inputs
    history: np.ndarray  # (4, n_state) derivatives of past steps, latest first
    elastic: np.ndarray  # (4, n) past deflections of the blades, scene.blade_beam.kept_states, latest first
    samples: np.ndarray  # (4 samples, 7) rotor loads within past steps, latest first
    radiation: np.ndarray  # hydro.radiation.memory_data; empty without radiation memory
    slow: np.ndarray  # (4, slow_loads.N_SLOW) loads of water and lines at past steps, latest first
    # (blades, 6) BladeLoad of each blade, valid with the cache; empty with one pitch for all blades. With
    # bending blades the loads of the stations follow (blade_shape.put_station)
    blades: np.ndarray
    rotor: object = None  # elastic.structure.RotorScratch, or None without a Structure
