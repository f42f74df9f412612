"""Computes the statics of an undisplaced platform, and differences and mode names for other analyses."""

from math import pi
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.dynamics import derivative
from fowt_env.plant.hydro.member_buoyancy import displaced
from fowt_env.plant.line_dynamics import line_states
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import N_RIGID, State, pose_of

TILT_STEP = 1e-4  # rad, of the slope of the righting moment


class Statics(NamedTuple):
    """Holds statics of an undisplaced platform in still water without wind, SI, in body axes."""

    weight: float  # N
    buoyancy: float  # N
    volume: float  # m3 of water of the same weight
    pull: float  # of all lines, downwards, N
    mass_centre: np.ndarray  # (3,), m
    buoyancy_centre: np.ndarray  # (3,), m; nan in z if a potential-flow body does not specify it
    metacentric_height: np.ndarray  # (2,) in roll and pitch, of the water alone, m
    tension: np.ndarray  # (n_lines,) at the fairleads, N


@entry
def mean_derivative(handle, x, u, azimuths, dx, mean):
    """Fill mean (n_state,) with dx averaged over the azimuths."""
    start = x[State.AZIMUTH]
    mean[:] = 0.0
    for i in range(azimuths):
        x[State.AZIMUTH] = start + i * (2.0 * pi / 3.0) / azimuths
        derivative(0.0, x, u, model_of(handle), data_of(handle), dx)
        for j in range(x.shape[0]):
            mean[j] += dx[j] / azimuths
    x[State.AZIMUTH] = start


def rotation_of(pose):
    """Return the rotation matrix (3, 3) of a Pose, from body to inertial components."""
    return np.array([[getattr(pose, f"r{i}{j}") for j in (1, 2, 3)] for i in (1, 2, 3)])


def central_difference(evaluate, array, index, step):
    """Return the central difference of evaluate(), which returns new arrays, by entries of an array."""
    keep, sides = np.array(array[index]), []
    for sign in (1.0, -1.0):
        array[index] = keep + sign * step
        sides.append(evaluate())
    array[index] = keep
    return (sides[0] - sides[1]) / (2.0 * step)


def named_periods(values, shapes, names):
    """Return {name: undamped natural period s} of modes x'' = value x; inf without restoring.

    Each mode, a column of shapes (n, n) >= 0, is named by its largest unassigned row, dominant modes first.
    """
    periods, free = {}, set(range(len(names)))
    for mode in np.argsort(-shapes.max(axis=0)):
        row = max(free, key=lambda i: shapes[i, mode])
        free.discard(row)
        square = -values[mode].real
        periods[names[row]] = float(2.0 * pi / np.sqrt(square)) if square > 1e-9 else float("inf")
    return {name: periods[name] for name in names}


def with_hanging_lines(scene):
    """Return the scene whose moving lines hang as catenaries, with a model of the same types."""
    if not line_states(scene.model.mooring):
        return scene
    return scene.with_model({"mooring.dynamics.resting": True})


class Evaluation:
    """Evaluates a scene's loads; at(x) stores them in data."""

    def __init__(self, scene):
        scene = with_hanging_lines(scene)
        self.data = scene.data()
        self.handle = scene.handle(self.data)
        self.u = np.zeros(scene.n_commands)
        self.dx, self.mean = np.zeros(scene.n_state), np.zeros(scene.n_state)

    def at(self, x, block):
        """Return the wrench (6,) of an entry of LoadCache at a state."""
        mean_derivative(self.handle, x, self.u, 1, self.dx, self.mean)
        return self.data.cache[block : block + 6].copy()


def statics(scene):
    """Return the Statics of a scene without fluctuations; without hydrodynamics buoyancy is zero."""
    body, site, evaluation = scene.model.rigid_body, scene.platform.environment, Evaluation(scene)
    rest = np.zeros(scene.n_state)
    water = evaluation.at(rest, LoadCache.HYDRO)
    pull = -evaluation.data.cache[LoadCache.MOORING + 2]
    tension = evaluation.data.lines[:, 2].copy()
    mass = body.mass_matrix
    centre = np.array([mass[1, 5], -mass[0, 5], mass[0, 4]]) / body.mass
    heights = []
    for motion in (State.ROLL, State.PLATFORM_PITCH):
        righting = []
        for side in (-TILT_STEP, TILT_STEP):
            x = rest.copy()
            x[motion] = side
            load = evaluation.at(x, LoadCache.HYDRO)
            about = load[3:] - np.cross(centre, load[:3])  # the weight has no moment about the centre of mass
            righting.append(about[motion - State.ROLL])
        slope = (righting[1] - righting[0]) / (2.0 * TILT_STEP)
        heights.append(-slope / water[2] if water[2] > 0.0 else float("nan"))
    return Statics(
        weight=body.mass * body.gravity,
        buoyancy=float(water[2]),
        volume=float(water[2] / (site.water_density * body.gravity)),
        pull=float(pull),
        mass_centre=centre,
        buoyancy_centre=_buoyancy_centre(scene.model.hydro, water),
        metacentric_height=np.array(heights),
        tension=tension,
    )


def _buoyancy_centre(hydro, water):
    """Return the centre of buoyancy (3,) of the undisplaced platform from its water load; nan if unknown."""
    if hydro is None or not water[2] > 0.0:
        return np.full(3, np.nan)
    volume = moment = 0.0
    if hydro.hull is not None:
        hull, area = hydro.hull, pi * hydro.hull.radius**2
        volume += hull.volume_below - area * hull.z_join
        moment += hull.moment_below - 0.5 * area * hull.z_join**2
    if hydro.members is not None and hydro.members.bodies is not None:
        part, _, _, first = displaced(pose_of(np.zeros(N_RIGID)), hydro.members.bodies)
        volume += part
        moment += first
    matrices = hydro.matrices
    known = matrices is None or not (matrices.stiffness.any() or matrices.water_stiffness.any())
    z = moment / volume if known and volume > 0.0 else float("nan")
    return np.array([-water[4] / water[2], water[3] / water[2], z])
