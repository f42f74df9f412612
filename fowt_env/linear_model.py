"""Linear models of a scene about an operating point, by central differences of the nonlinear plant."""

from dataclasses import dataclass

import numpy as np

from fowt_env.errors import InputError, unknown
from fowt_env.jit import kernel
from fowt_env.state import State
from fowt_env.steady import AZIMUTHS, calm, mean_derivative, trim

STATES = (
    "surge", "sway", "heave", "roll", "platform_pitch", "yaw",
    "vx", "vy", "vz", "wx", "wy", "wz", "rotor_speed", "blade_pitch",
)  # fmt: skip
STATE_INDEX = tuple(State[name.upper()] for name in STATES)
STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-4, 1e-5])
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

    def index(self, name):
        """Row of a state. Raises: InputError for an unknown name."""
        if name not in self.states:
            raise unknown("state", name, self.states)
        return self.states.index(name)

    def modes(self):
        """[(period s, damping ratio, frequency rad/s, shape (n,))] of the oscillating modes, slowest first."""
        values, vectors = np.linalg.eig(self.A)
        found = []
        for value, vector in zip(values, vectors.T, strict=True):
            if value.imag > 1e-6:
                frequency = abs(value)
                found.append((2.0 * np.pi / value.imag, -value.real / frequency, frequency, vector))
        return sorted(found, key=lambda mode: -mode[0])


@kernel
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
    return LinearModel(a, b, STATES, INPUTS, point)


def natural_periods(scene):
    """{motion: undamped natural period s} of the six motions about the trim, from stiffness and mass.

    A motion without restoring (no moorings) gets inf. Modes are named by their largest motion, angles
    weighted with 60 m.
    """
    model = linearize(scene)
    n = len(MOTIONS)
    # velocities are body components, so positions move with kinematics K: q' = K v, v' = S q
    kinematics = model.A[:n, n : 2 * n]
    stiffness = model.A[n : 2 * n, :n]
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    scale = np.array([1.0, 1.0, 1.0, 60.0, 60.0, 60.0])
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
