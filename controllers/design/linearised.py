"""Linearises a sampled control law by differences, and closes its loop around a linear model.

The law is the map from its memory, its last command and a measurement to the next memory and command. The
closed loop is that of the sampled law: inputs are held over the control period. Margins are computed after
the bilinear transform of plant and law, which maps the unit circle to the imaginary axis at the frequency
2/T tan(w T/2), and so preserves stability and margins of gain and phase. Source: Franklin, Powell and
Workman, Digital Control of Dynamic Systems, 3rd ed. (1998), section 7.4.
"""

from typing import Any, NamedTuple

import numpy as np

from fowt_env.analysis.linear_model import LinearModel
from fowt_env.analysis.margins import MOVED, LinearLaw, Margins, margins
from fowt_env.analysis.trim import without_fluctuations
from fowt_env.control import CompiledController
from fowt_env.control.protocol import call_law
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement
from fowt_env.run.simulation import build_run

STEP = 1e-6  # relative, of the differences
SETTLING = 60.0  # s from the trim, after which a law has left its start; short, as a loop may be unstable
EXOGENOUS = ("time", "wind_speed", "wave_elevation")  # measurements that the commands do not change


class SampledLoop(NamedTuple):
    """Holds a linear model and a law, sampled every dt, and their closed loop."""

    plant: tuple  # (A, B, C, D) from MOVED to outputs, at the control instants
    law: tuple  # (A, B, C, D) from outputs to MOVED
    outputs: tuple[str, ...]
    dt: float  # s

    def matrix(self) -> np.ndarray:
        """Return the system matrix of the closed loop, states of the plant and then of the law."""
        (a, b, c, _), (al, bl, cl, dl) = self.plant, self.law
        return np.block([[a + b @ dl @ c, b @ cl], [bl @ c, al]])

    def poles(self) -> np.ndarray:
        """Return the poles of the closed loop in continuous time, rad/s: log(z)/dt without those at z = 0."""
        return self.modes()[0]

    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (poles (k,), eigenvectors (states, k)) of the closed loop."""
        z, vectors = np.linalg.eig(self.matrix())
        kept = np.abs(z) > 1e-6
        return np.log(z[kept].astype(complex)) / self.dt, vectors[:, kept]

    def margins(self) -> Margins | None:
        """Return the margins at the commands that the law moves; None if it moves none of them."""
        moved = [i for i in range(len(MOVED)) if np.any(self.law[2][i]) or np.any(self.law[3][i])]
        if not moved:
            return None
        a, b, c, d = self.plant
        plant = bilinear((a, b[:, moved], c, d[:, moved]), self.dt)
        law = bilinear((*self.law[:2], self.law[2][moved], self.law[3][moved]), self.dt)
        inputs = tuple(MOVED[i] for i in moved)
        names = tuple(f"state_{i}" for i in range(len(a)))
        return margins(_Matrices(*plant, names, inputs, self.outputs), LinearLaw(*law, self.outputs, inputs))


class _Matrices(NamedTuple):
    """Holds what margins() reads of a LinearModel."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple
    inputs: tuple
    outputs: tuple


def sampled_loop(model: LinearModel, controller: Any, control_dt: float = 0.1) -> SampledLoop:
    """Return the SampledLoop of a LinearModel and a controller at the model's operating point.

    controller: a CompiledController for this turbine and control period; the law settles
    on the plant in the steady wind, and its memory is lost.
    Raises: InputError for a controller without a compiled law, or one of single blades;
    SimulationStopped where the loop fails within SETTLING.
    """
    if not isinstance(controller, CompiledController) or controller.individual:
        raise InputError(
            f"controller {getattr(controller, 'name', controller)!r}: only a compiled law of collective pitch"
            " can be linearised"
        )
    steady = without_fluctuations(model.scene, model.point.wind_speed)
    run = build_run(steady, controller, SETTLING, control_dt=control_dt, output_dt=SETTLING)
    run.advance(lambda fraction: None)
    run.begin(run.schedule.last)
    reading, command = run.link.law_reading.copy(), run.u[: len(MOVED)].copy()
    memory, size = controller.memory, len(controller.memory)

    def call(values):
        """Return the next memory and command after (memory, command, measurement)."""
        memory[:] = values[:size]
        held = values[size : size + 2].copy()
        call_law(controller.law, controller.parameters, memory, values[size + 2 :].copy(), held)
        return np.concatenate([memory, held])

    rest = np.concatenate([memory, command, reading])
    measured = [name for name in Measurement._fields if name not in EXOGENOUS]
    columns = [*range(size + 2), *(size + 2 + Measurement._fields.index(name) for name in measured)]
    slopes = np.empty((size + 2, len(columns)))
    for place, column in enumerate(columns):
        step = STEP * max(1.0, abs(rest[column]))
        up, down = rest.copy(), rest.copy()
        up[column] += step
        down[column] -= step
        with np.errstate(all="ignore"):
            slopes[:, place] = (call(up) - call(down)) / (2.0 * step)
    slopes = np.where(np.isfinite(slopes), slopes, 0.0)  # fields that the law may not read are NaN
    return _closed(model, slopes, measured, control_dt)


def _closed(model, slopes, measured, dt):
    """Return the SampledLoop of slopes (states, states + measurements) of the law, commands last."""
    size = len(slopes)
    a, b = slopes[:, :size], slopes[:, size:]
    torque = measured.index("generator_torque")  # the torque in force is the last command
    a[:, size - 2] += b[:, torque]
    read = [i for i, name in enumerate(measured) if i != torque and np.any(b[:, i])]
    unknown = [measured[i] for i in read if measured[i] not in (*model.outputs, *model.states)]
    if unknown:
        raise InputError(f"linear model: lacks {', '.join(unknown)}, which the law reads")
    kept = _needed(a, b[:, read])
    al, bl = a[np.ix_(kept, kept)], b[np.ix_(kept, read)]
    rows = [size - 2, size - 1]
    law = al, bl, a[np.ix_(rows, kept)], b[np.ix_(rows, read)]
    outputs = tuple(measured[i] for i in read)
    sampled = model.discretize(dt)
    n, moved = len(model.states), [model.inputs.index(name) for name in MOVED]
    signals = (*model.outputs, *model.states)
    which = [signals.index(name) for name in outputs]
    c = np.vstack([model.C, np.eye(n)])[which]
    d = np.vstack([model.D, np.zeros((n, model.D.shape[1]))])[np.ix_(which, moved)]
    # a measurement precedes the command of its instant: it feels the held command through two more states
    plant = (
        np.block([[sampled.A, np.zeros((n, 2))], [np.zeros((2, n + 2))]]),
        np.vstack([sampled.B[:, moved], np.eye(2)]),
        np.hstack([c, d]),
        np.zeros((len(which), 2)),
    )
    return SampledLoop(plant, law, outputs, dt)


def _needed(a, b):
    """Return the states that a measurement reaches and that reach the commands, the last two states."""
    size = len(a)
    after, before = np.any(b != 0.0, axis=1), np.zeros(size, dtype=bool)
    for row in (size - 2, size - 1):
        before |= a[row] != 0.0
    for _ in range(size):
        after |= (a[:, after] != 0.0).any(axis=1)
        before |= (a[before] != 0.0).any(axis=0)
    return np.flatnonzero(after & before)


def bilinear(matrices, dt):
    """Return (A, B, C, D) of the continuous system that the bilinear transform maps to a sampled one."""
    a, b, c, d = matrices
    inverse = np.linalg.inv(a + np.eye(len(a)))
    root = 2.0 / np.sqrt(dt)
    return (
        2.0 / dt * inverse @ (a - np.eye(len(a))),
        root * inverse @ b,
        root * c @ inverse,
        d - c @ inverse @ b,
    )
