"""Computes natural frequencies of a flexible tower, clamped at its base and on its floating platform."""

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from fowt_env.plant.state import State
from fowt_env.scene.mass import top_mass_matrix
from fowt_env.scene.tower import build_tower_modes

NAMES = {  # mode in each direction -> names, fore-aft and side-side
    0: ("first fore-aft", "first side-side"),
    1: ("second fore-aft", "second side-side"),
}


Bending = namedtuple("Bending", "fore_aft mass stiffness inertia weight damping top_motion")


class TowerFrequency(NamedTuple):
    """Holds the undamped natural frequencies of one bending mode, Hz, with the rotor locked."""

    clamped: float
    floating: float  # on the platform at rest


def tower_frequencies(scene, mass, slopes, kinematics, count=None):
    """Return {mode: TowerFrequency} of a scene's platform; empty if its file has no [tower.modes].

    mass        (6, 6) of the rigid turbine with the added mass, about the body origin
    slopes      (6, 6) derivatives of the loads by the motions
    kinematics  (6, 6) derivatives of the motions' rates by the velocities
    count       of modes in each direction; None: all modes in the file
    """
    modes = scene.platform.tower.modes
    if modes is None:
        return {}
    count = len(modes.fore_aft) if count is None else count
    tower = bending(scene.platform, scene.turbine, count)
    fore_aft, modal_mass, stiffness, inertia, weight = tower[:5]
    n = len(fore_aft)
    whole = np.block([[mass, inertia], [inertia.T, modal_mass]])
    restoring = np.block([[-slopes, weight], [weight.T, stiffness]])
    moved = np.eye(6 + n)
    moved[:6, :6] = kinematics
    frequencies = {}
    for along in (True, False):
        rows = np.flatnonzero(fore_aft == along)
        block = np.ix_(rows, rows)
        clamped = _frequencies(np.linalg.solve(modal_mass[block], stiffness[block]))[0]
        values, vectors = _frequencies(moved @ np.linalg.solve(whole, restoring))
        size = np.abs(vectors[6:])
        mine = [k for k in np.argsort(values)[-n:] if size[rows, k].max() == size[:, k].max()]
        for number, (low, k) in enumerate(zip(np.sort(clamped), mine, strict=True)):
            frequencies[NAMES[number][0 if along else 1]] = TowerFrequency(float(low), float(values[k]))
    return {name: frequencies[name] for pair in NAMES.values() for name in pair if name in frequencies}


def _frequencies(matrix):
    """Return ((n,) Hz, (n, n) shapes) of x'' = -matrix x; 0 Hz without restoring."""
    squares, shapes = np.linalg.eig(matrix)
    return np.sqrt(np.maximum(squares.real, 0.0)) / (2.0 * np.pi), shapes


def bending(platform, turbine, count):
    """Return the Bending of an upright tower: linear equations of n deflections q coupled to the platform.

    fore_aft (n,) bool; mass (n, n) kg; stiffness (n, n) N/m, including weight; inertia and weight (6, n):
    terms of the platform's equations in q'' and q; damping (n, n) N s/m; top_motion (6, n): velocity of the
    body origin as a point of the nacelle, and angular velocity of the nacelle, per q'. Nacelle and rotor are
    one rigid body at the tower top.
    """
    tower = build_tower_modes(platform, turbine, count, 0)
    gravity, height, slope = platform.environment.gravity, tower.top_height, tower.slope
    along, beam = (np.arange(len(slope)) % 2 == 0).astype(float), tower.beam
    across, first, height_moment = 1.0 - along, beam.a + beam.b, beam.e + beam.f
    top = top_mass_matrix(platform, turbine)
    moved = np.zeros((6, len(slope)))  # velocity of the top body, referred to the body origin
    moved[0], moved[1] = along * (1.0 - slope * height), across * (1.0 - slope * height)
    moved[3], moved[4] = -across * slope, along * slope
    aligned = np.outer(along, along) + np.outer(across, across)
    arm = top[0, 4] / top[0, 0] - height  # height of the top body's centre of mass above the tower top
    hanging = beam.S0 + top[0, 0] * (tower.shortening + arm * np.outer(slope, slope) * aligned)
    inertia = top @ moved
    inertia[0] += along * first
    inertia[1] += across * first
    inertia[3] -= across * height_moment
    inertia[4] += along * height_moment
    aside = gravity * (first + top[0, 0] * (1.0 + arm * slope))
    weight = np.zeros_like(inertia)
    weight[State.ROLL], weight[State.PLATFORM_PITCH] = across * aside, -along * aside
    mass, stiffness = beam.A + beam.B + moved.T @ top @ moved, beam.stiffness - gravity * hanging
    return Bending(along == 1.0, mass, stiffness, inertia, weight, beam.damping, moved)
