"""Linear models of a scene about an operating point, by central differences of the nonlinear plant."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fowt_env.errors import InputError, unknown
from fowt_env.jit import entry
from fowt_env.state import State
from fowt_env.steady import AZIMUTHS, calm, mean_derivative, trim

STATES = (
    "surge", "sway", "heave", "roll", "platform_pitch", "yaw",
    "vx", "vy", "vz", "wx", "wy", "wz", "rotor_speed", "blade_pitch",
)  # fmt: skip
STATE_INDEX = tuple(State[name.upper()] for name in STATES)
# velocity steps are small because quadratic drag leaves a false damping proportional to them
STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-7, 1e-7, 1e-7, 1e-4, 1e-5])
INPUTS = ("generator_torque", "blade_pitch_command", "wind_speed")
INPUT_STEPS = np.array([1.0, 1e-5, 1e-3])
MOTIONS = ("surge", "sway", "heave", "roll", "platform_pitch", "yaw")


@dataclass(frozen=True)
class LinearModel:
    """dx/dt = A dx + B du about an operating point, azimuth-averaged (SI, radians).

    A (14, 14) and B (14, 3) with the names in states and inputs; point is the OperatingPoint.
    """

    A: np.ndarray
    B: np.ndarray
    states: tuple
    inputs: tuple
    point: object
    cm_height: float  # of the whole turbine, body z, m
    arm: float  # m, half the draft: weighs angles against translations when modes are named

    def index(self, name):
        """Row of a state. Raises: InputError for an unknown name."""
        if name not in self.states:
            raise unknown("state", name, self.states)
        return self.states.index(name)

    def modes(self):
        """[Mode] of the plant without control, slowest first."""
        return modes(self.A, self.states, self.cm_height, self.arm)


class Mode(NamedTuple):
    """One oscillating mode."""

    name: str  # the state with the largest share
    period: float  # s
    damping_ratio: float
    frequency: float  # rad/s


def modes(a, names, cm_height, arm):
    """[Mode] of a system matrix a (n, n) with these state names, slowest first.

    A mode is named by its largest motion: translations of the centre of mass (at the water line a
    platform-pitch mode moves more in surge than in pitch), angles times arm (m), rotor speed times arm/12 s.
    """
    values, vectors = np.linalg.eig(a)
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag <= 1e-6:
            continue
        part = dict(zip(names, vector, strict=True))
        share = {
            "surge": abs(part["surge"] + cm_height * part["platform_pitch"]),
            "sway": abs(part["sway"] - cm_height * part["roll"]),
            "heave": abs(part["heave"]),
            "roll": arm * abs(part["roll"]),
            "platform_pitch": arm * abs(part["platform_pitch"]),
            "yaw": arm * abs(part["yaw"]),
            "rotor_speed": arm / 12.0 * abs(part["rotor_speed"]),
        }
        name = max(share, key=share.get)
        found.append(
            Mode(name, float(2.0 * np.pi / value.imag), float(-value.real / abs(value)), float(abs(value)))
        )
    return sorted(found, key=lambda mode: -mode.period)


@entry
def _shifted(box, x, u, azimuths, dx, mean, index, step, out):
    """Azimuth-averaged derivative with one state moved by step, into out (n_state,)."""
    keep = x[index]
    x[index] = keep + step
    mean_derivative(box, x, u, azimuths, dx, mean)
    x[index] = keep
    out[:] = mean


def linearize(scene, operating_point=None):
    """LinearModel of a scene about an operating point (default: its floating trim).

    The wind input moves the hub wind with its shear; waves are flat. Drag has no linear part at rest
    in still water, so viscous damping is absent there. Dynamic inflow is not linearised.

    Raises: InputError if the scene has dynamic inflow.
    """
    if scene.model.wake is not None:
        raise InputError("linearize: build the scene with dynamic_inflow=False")
    point = trim(scene) if operating_point is None else operating_point
    held = point.platform == "fixed"
    body = scene.model.body._replace(platform_held=held)
    steady = calm(scene, point.wind_speed).with_model(body=body)
    box = steady.box()
    x, u = point.state.copy(), point.command.copy()
    x[State.BLADE_PITCH] = point.state[State.BLADE_PITCH]
    dx, mean = np.zeros_like(x), np.zeros_like(x)
    up, down = np.zeros_like(x), np.zeros_like(x)
    rows = list(STATE_INDEX)
    a = np.empty((len(rows), len(rows)))
    for j, index in enumerate(rows):
        _shifted(box, x, u, AZIMUTHS, dx, mean, int(index), STEPS[j], up)
        _shifted(box, x, u, AZIMUTHS, dx, mean, int(index), -STEPS[j], down)
        a[:, j] = (up[rows] - down[rows]) / (2.0 * STEPS[j])
    b = np.zeros((len(rows), len(INPUTS)))
    for j in range(2):
        for sign, out in ((1.0, up), (-1.0, down)):
            moved = u.copy()
            moved[j] += sign * INPUT_STEPS[j]
            mean_derivative(box, x, moved, AZIMUTHS, dx, mean)
            out[:] = mean
        b[:, j] = (up[rows] - down[rows]) / (2.0 * INPUT_STEPS[j])
    if point.wind_speed is not None:
        step = INPUT_STEPS[2]
        for sign, out in ((1.0, up), (-1.0, down)):
            other = calm(scene, point.wind_speed + sign * step).with_model(body=body).box()
            mean_derivative(other, x, u, AZIMUTHS, dx, mean)
            out[:] = mean
        b[:, 2] = (up[rows] - down[rows]) / (2.0 * step)
    cm_height = body.s_z / body.mass
    arm = -0.5 * scene.platform.hull.z[0]
    return LinearModel(a, b, STATES, INPUTS, point, cm_height, arm)


def natural_periods(scene):
    """{motion: undamped natural period s} of the six motions about the trim, from stiffness and mass.

    A motion without restoring (no moorings) gets inf. Modes are named by their largest motion, angles
    weighted with half the draft.
    """
    model = linearize(scene)
    n = len(MOTIONS)
    # velocities are body components, so positions move with kinematics K: q' = K v, v' = S q
    kinematics = model.A[:n, n : 2 * n]
    stiffness = model.A[n : 2 * n, :n]
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    scale = np.array([1.0, 1.0, 1.0, model.arm, model.arm, model.arm])
    shapes = np.abs(vectors) * scale[:, None]
    periods = {}
    free = set(range(n))
    for motion in np.argsort(-shapes.max(axis=0)):  # most clear-cut modes first
        order = np.argsort(-shapes[:, motion])
        name = next(i for i in order if i in free)
        free.discard(name)
        square = -values[motion].real
        periods[MOTIONS[name]] = float(2.0 * np.pi / np.sqrt(square)) if square > 1e-9 else float("inf")
    return {motion: periods[motion] for motion in MOTIONS}
