"""Computes stability margins of a linear model under a linear controller at the plant's input.

With G from the controller's commands to the measurements and the law u = K y, the sensitivity is
S = (I - K G)^-1 and the loop transfer L = -K G. With one input opened and the others closed,
1 + L_i = 1/S_ii. Sources: Skogestad and Postlethwaite, Multivariable Feedback Control, 2nd ed. (2005),
sections 2.4 and 6.2 (margins, peak of S); Seiler, Packard and Gahinet, An introduction to disk margins, IEEE
Control Systems 40(5), 2020.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan, degrees, inf
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import schur
from scipy.optimize import brentq, minimize_scalar

from fowt_env.analysis.linear_model import LinearModel, chosen
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError

MOVED = ("generator_torque", "blade_pitch_command")  # inputs that a controller may move
LOWEST, HIGHEST = 1e-4, 1e3  # rad/s, of the search
PER_DECADE = 400  # frequencies, with additional ones about each pole
AROUND_POLE = np.linspace(-4.0, 4.0, 41)  # in units of the pole's real part
TOLERANCE = 1e-10  # rad/s over rad/s, of a crossing


class LinearLaw(NamedTuple):
    """Defines a linear controller dx/dt = A x + B y, u = C x + D y, plant outputs y and plant inputs u."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, r)
    C: np.ndarray  # (m, n)
    D: np.ndarray  # (m, r)
    outputs: tuple[str, ...]  # (r) y: outputs or states of the LinearModel
    inputs: tuple[str, ...]  # (m) u: inputs of the LinearModel


class LoopMargins(NamedTuple):
    """Holds the margins of one input with its loop opened and the others closed; inf: unlimited."""

    gain: float  # smallest destabilising factor above 1 on the loop gain
    gain_reduction: float  # largest destabilising factor below 1; 0: none
    phase: float  # deg, smallest destabilising lag or lead
    delay: float  # s, smallest destabilising delay
    modulus: float  # least |1 + L|: distance of the Nyquist curve from -1
    gain_frequency: float  # rad/s; frequencies of the margins above
    gain_reduction_frequency: float
    phase_frequency: float
    delay_frequency: float
    modulus_frequency: float


@dataclass(frozen=True)
class Margins:
    """Holds the stability margins of a closed loop."""

    stable: bool  # whether the closed loop is stable; if not, margins are distances to a stability boundary
    loops: dict[str, LoopMargins]  # by input
    sensitivity_peak: float  # Ms: largest singular value of S over frequency, inputs scaled as by least_size
    peak_frequency: float  # rad/s
    disk: float  # alpha: radius of the symmetric disk margin, 1 over the largest singular value of (S - T)/2

    @property
    def modulus(self) -> float:
        """Return 1/Ms: for one input, the least distance of the Nyquist curve from -1."""
        return 1.0 / self.sensitivity_peak

    @property
    def gain(self) -> float:
        """Return the smallest gain margin of the inputs, each opened alone."""
        return min(loop.gain for loop in self.loops.values())

    @property
    def phase(self) -> float:
        """Return the smallest phase margin (deg) of the inputs, each opened alone."""
        return min(loop.phase for loop in self.loops.values())

    @property
    def disk_gain(self) -> tuple[float, float]:
        """Return the disk gain margin (low, high): gain factors that may vary independently in all inputs."""
        half = 0.5 * self.disk
        if half >= 1.0:
            return 0.0, inf
        return (1.0 - half) / (1.0 + half), (1.0 + half) / (1.0 - half)

    @property
    def disk_phase(self) -> float:
        """Return the disk phase margin (deg): phases up to it may vary independently in all inputs."""
        return degrees(2.0 * atan(0.5 * self.disk))


def linear_law(
    model: LinearModel,
    controller: Any,
    outputs: str | Sequence[str] | None = None,
    inputs: str | Sequence[str] | None = None,
) -> LinearLaw:
    """Return the LinearLaw of a controller in any of the forms listed in margins. Raises: InputError."""
    if isinstance(controller, LinearLaw):
        return controller
    known = (*model.outputs, *(name for name in model.states if name not in model.outputs))
    if all(hasattr(controller, name) for name in ("A", "B", "C", "D", "input_labels", "output_labels")):
        if getattr(controller, "dt", 0) not in (0, None):
            raise InputError("controller: is in discrete time; must be in continuous time")
        read = chosen("output", controller.input_labels if outputs is None else outputs, known)
        moved = chosen("input", controller.output_labels if inputs is None else inputs, MOVED)
        matrices = tuple(np.atleast_2d(np.asarray(getattr(controller, n), dtype=float)) for n in "ABCD")
    elif isinstance(controller, tuple) and len(controller) == 2:
        read = chosen("output", "generator_speed" if outputs is None else outputs, known)
        moved = chosen("input", "blade_pitch_command" if inputs is None else inputs, MOVED)
        proportional, integral = (np.array([[float(value)]]) for value in controller)
        matrices = (np.zeros((1, 1)), np.ones((1, 1)), integral, proportional)
    else:
        try:
            gain = np.atleast_2d(np.asarray(controller, dtype=float))
        except (TypeError, ValueError):
            raise InputError(
                f"controller = {controller!r}: must be a control.StateSpace, (KP, KI) or a matrix of gains"
            ) from None
        read = chosen("output", model.states if outputs is None else outputs, known)
        moved = chosen("input", MOVED[-len(gain) :] if inputs is None else inputs, MOVED)
        matrices = (np.zeros((0, 0)), np.zeros((0, gain.shape[1])), np.zeros((len(gain), 0)), gain)
    shape = (len(moved), len(read))
    if matrices[3].shape != shape:
        raise InputError(
            f"controller: is {' x '.join(map(str, matrices[3].shape))}: must be {shape[0]} x {shape[1]},"
            f" from {', '.join(read)} to {', '.join(moved)}"
        )
    return LinearLaw(*matrices, outputs=read, inputs=moved)


def margins(
    model: LinearModel,
    controller: Any,
    outputs: str | Sequence[str] | None = None,
    inputs: str | Sequence[str] | None = None,
) -> Margins:
    """Return the margins of a LinearModel under a linear controller, in continuous time.

    controller: the law u = K y of deviations with the sign used on the turbine (for an LQR, u = -K x, pass
    -K), as

        (KP, KI)             gains of a PI law, by default from generator speed to blade pitch: s, -
        a matrix (m, r)      gains, by default from all states to the blade pitch, or with m = 2 to generator
                             torque and blade pitch
        a control.StateSpace from outputs or states of the model to the model's inputs, by its labels
        a LinearLaw

    outputs, inputs: names of the controller's inputs (outputs or states of the model) and outputs (inputs of
    the model), instead of these defaults.
    A sampled controller lags by half its period plus its computation time: compare with the delay margin.
    Raises: InputError for unknown names, other shapes, and a controller in discrete time.
    """
    law = linear_law(model, controller, outputs, inputs)
    plant = _plant_of(model, law)
    sensitivity = _sensitivity(plant, law)
    poles, *others = (np.linalg.eigvals(a) for a in (closed_loop(plant, law), model.A, law.A))
    grid = _frequencies(np.concatenate([poles, *others]))
    values, half = sensitivity(grid), 0.5 * np.eye(len(law.inputs))

    def at(w):
        return sensitivity(np.array([w]))

    most, where = _largest(lambda w: least_size(at(w))[0], grid, least_size(values))
    # (S - T)/2 = S - I/2
    skew, _ = _largest(lambda w: least_size(at(w) - half)[0], grid, least_size(values - half))
    loops = {
        name: _loop_margins(lambda w, i=i: 1.0 / at(w)[0, i, i] - 1.0, grid, 1.0 / values[:, i, i] - 1.0)
        for i, name in enumerate(law.inputs)
    }
    return Margins(bool(poles.real.max() < 0.0), loops, float(most), float(where), float(1.0 / skew))


def least_size(matrices: np.ndarray) -> np.ndarray:
    """Return the minimum (k,) over diagonal D of the largest singular value of D M D^-1; M (k, m, m), m <= 2.

    The result does not depend on the units of the inputs; it is the structured singular value for
    independent factors on each input. For two inputs the product of the singular values is |det M| for any
    D, so that the larger is least where the sum of squares is: for off-diagonal entries of equal magnitude.
    """
    if matrices.shape[-1] == 1:
        return np.abs(matrices[:, 0, 0])
    b, c = matrices[:, 0, 1], matrices[:, 1, 0]
    size = np.sqrt(np.abs(b) * np.abs(c))
    scaled = matrices.copy()
    scaled[:, 0, 1], scaled[:, 1, 0] = size * np.exp(1j * np.angle(b)), size * np.exp(1j * np.angle(c))
    return np.linalg.norm(scaled, 2, axis=(1, 2))


def _plant_of(model, law):
    """Return (A, B, C, D) of the model from the inputs to the outputs of the law."""
    columns = [model.inputs.index(name) for name in law.inputs]
    signals = (*model.outputs, *model.states)
    rows = [signals.index(name) for name in law.outputs]
    c = np.vstack([model.C, np.eye(len(model.states))])[rows]
    d = np.vstack([model.D, np.zeros((len(model.states), len(model.inputs)))])[np.ix_(rows, columns)]
    return model.A, model.B[:, columns], c, d


def closed_loop(plant: tuple, law: LinearLaw) -> np.ndarray:
    """Return the (n + k, n + k) system matrix of a plant (A, B, C, D) in closed loop with a law."""
    a, b, c, d = plant
    # u = N (Dk C x + Ck xk) with N = (I - Dk D)^-1
    inverse = np.linalg.inv(np.eye(b.shape[1]) - law.D @ d)
    by_plant, by_law = inverse @ law.D @ c, inverse @ law.C
    above = np.hstack([a + b @ by_plant, b @ by_law])
    return np.vstack([above, np.hstack([law.B @ (c + d @ by_plant), law.A + law.B @ d @ by_law])])


def _sensitivity(plant, law):
    """Return the sensitivity S (k, m, m) as a function of frequencies (k,)."""
    of_plant, of_law, one = _response(*plant), _response(*law[:4]), np.eye(plant[1].shape[1])

    def sensitivity(omega):
        s = 1j * np.asarray(omega)
        return np.linalg.inv(one - of_law(s) @ of_plant(s))

    return sensitivity


def _response(a, b, c, d):
    """Return C (sI - A)^-1 B + D (k, outputs, inputs) as a function of s (k,).

    In the coordinates of the complex Schur form of A, whose triangle is solved for all s a row at a time:
    with the hundred states of radiation memory a solution by matrices takes minutes and gigabytes.
    """
    if not len(a):
        return lambda s: np.broadcast_to(d, (len(s), *d.shape))
    triangle, vectors = schur(a, output="complex")
    into, out, n = vectors.conj().T @ b, c @ vectors, len(a)

    def response(s):
        x = np.empty((n, len(s) * b.shape[1]), complex)
        for i in range(n - 1, -1, -1):
            row = (triangle[i, i + 1 :] @ x[i + 1 :]).reshape(len(s), -1)
            x[i] = ((into[i] + row) / (s - triangle[i, i])[:, None]).ravel()
        return (out @ x).reshape(len(out), len(s), -1).swapaxes(0, 1) + d

    return response


def _frequencies(poles):
    """Return the increasing frequencies (rad/s) of the search, refined about each pole."""
    decades = np.log10(HIGHEST / LOWEST)
    even = np.logspace(np.log10(LOWEST), np.log10(HIGHEST), int(decades * PER_DECADE) + 1)
    near = (abs(pole.imag) + AROUND_POLE * max(abs(pole.real), 1e-9) for pole in poles)
    grid = np.unique(np.concatenate([even, *near]))
    return grid[(grid >= LOWEST) & (grid <= HIGHEST)]


def _largest(function: Callable[[float], float], grid, values):
    """Return (largest value, frequency) of a function with values on a grid, refined about the peak."""
    k = int(np.argmax(values))
    low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
    peak = minimize_scalar(
        lambda w: -function(w), bounds=(low, high), method="bounded", options={"xatol": TOLERANCE * high}
    )
    return (-peak.fun, peak.x) if -peak.fun > values[k] else (values[k], grid[k])


def _crossings(function, grid, values):
    """Return the frequencies at which a real function with values on a grid changes sign."""
    cells = np.flatnonzero(np.diff(np.signbit(values)))
    return [brentq(function, grid[k], grid[k + 1], xtol=TOLERANCE * grid[k], rtol=1e-13) for k in cells]


def _loop_margins(loop: Callable[[float], complex], grid, values):
    """Return the LoopMargins of a loop transfer L, a function of frequency with its values on a grid."""
    gains = []  # (factor, frequency) of each crossing of the negative real axis
    for w in _crossings(lambda w: loop(w).imag, grid, values.imag):
        value = loop(w)
        if value.real < 0.0:
            gains.append((1.0 / abs(value), w))
    # (lag in (0, 360) deg from L to -1, frequency) at each crossing of the unit circle
    circle = _crossings(lambda w: abs(loop(w)) - 1.0, grid, np.abs(values) - 1.0)
    phases = [((degrees(np.angle(loop(w))) + 180.0) % 360.0, w) for w in circle]
    up = min((g for g in gains if g[0] > 1.0), default=(inf, inf))
    down = max((g for g in gains if g[0] < 1.0), default=(0.0, 0.0))
    phase = min(((min(lag, 360.0 - lag), w) for lag, w in phases), default=(inf, inf))
    delay = min(((lag * DEGREE / w, w) for lag, w in phases), default=(inf, inf))
    inverse, where = _largest(lambda w: 1.0 / abs(1.0 + loop(w)), grid, 1.0 / np.abs(1.0 + values))
    row = (up[0], down[0], phase[0], delay[0], 1.0 / inverse, up[1], down[1], phase[1], delay[1], where)
    return LoopMargins(*(float(value) for value in row))
