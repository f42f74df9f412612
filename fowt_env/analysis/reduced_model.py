"""Reduces linear models to the rigid-body states, for controller design.

The other states z, z' = A_zz z + A_zx x + B_z u + E_z f, are residualised (Kokotovic, Khalil and O'Reilly,
Singular Perturbation Methods in Control, 1986), because truncation would remove their steady effect:

- flexible tower, wake, second-order pitch drive and generator lag are in equilibrium,
  z = -A_zz^-1 (A_zx x + B_z u + E_z f): a static tower deflection that moves the top mass with the platform,
  and a pitch drive with the same lag for slow commands;
- radiation memory, as slow as the platform, is replaced by its complex gain at a frequency w: the real part
  multiplies x, the imaginary part over w multiplies dx/dt, which gives added mass and damping at w.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from fowt_env.analysis.linear_model import MEMORY, VELOCITIES
from fowt_env.analysis.linear_plant import WAKE
from fowt_env.errors import InputError
from fowt_env.plant.state import MOTIONS, STATES

SETTLES = 1e-6  # 1/s, slowest decay of a state that is replaced by its equilibrium
NAMES = ("platform_pitch", "surge", "heave")  # names that the platform-pitch mode may have, likeliest first
FAR = 0.3  # tolerance of the platform-pitch mode's frequency, as a fraction of the undamped one


def platform_frequency(model):
    """Return the frequency (rad/s) of platform_mode; without such a mode, the undamped frequency."""
    mode = platform_mode(model)
    return _undamped(model) if mode is None else mode.frequency


def platform_mode(model):
    """Return the platform-pitch Mode of a LinearModel; None without a mode near the undamped frequency.

    For a hull that pitches about a distant point, this mode is named after surge or heave.
    """
    undamped = _undamped(model)
    modes = model.modes()
    for name in NAMES:
        near = [m for m in modes if m.name == name and abs(m.frequency / undamped - 1.0) < FAR]
        if near:
            return min(near, key=lambda mode: abs(mode.frequency - undamped))
    return None


def _undamped(model):
    """Return the undamped frequency (rad/s) of the mode with the largest fraction of platform pitch."""
    model = _settled(model)  # so that the mass on a flexible tower moves with the platform
    positions = [model.index(name) for name in MOTIONS]
    speeds = [model.index(name) for name in VELOCITIES]
    kinematics, stiffness = model.A[np.ix_(positions, speeds)], model.A[np.ix_(speeds, positions)]
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    arm = model.arm
    size = np.abs(vectors) * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    chosen = np.argmax(size[MOTIONS.index("platform_pitch")] / size.sum(axis=0))
    return float(np.sqrt(max(-values[chosen].real, 1e-6)))


def residualised(model, omega=None, keep=()):
    """Return the LinearModel reduced to the states of plant.state.STATES; unchanged if there are no others.

    omega: rad/s, at which added mass and damping of radiation memory are exact; None: platform_frequency.
    keep: names of further states that are not replaced.
    Raises: InputError if other internal states are not asymptotically stable.
    """
    model = _settled(model, keep)
    memory = [name for name in model.states if name.startswith(MEMORY)]
    if not memory:
        return model
    return _following(model, memory, platform_frequency(model) if omega is None else float(omega))


def _settled(model, keep=()):
    """Return the LinearModel with all states except STATES, radiation memory and `keep` in equilibrium."""
    kept = {*STATES, *keep}
    names = [name for name in model.states if name not in kept and not name.startswith(MEMORY)]
    return _following(model, names, 0.0)


def with_reduced_wake(model, order):
    """Return the LinearModel with the states of dynamic inflow reduced to `order` balanced ones (wake_1 ...).

    Balanced truncation (Moore, IEEE Trans. Automatic Control 26, 17-32, 1981) of the path from all other
    states and inputs to all other rates and outputs, each scaled to equal size; the steady gain is that of
    the whole wake. Unchanged for a model without dynamic inflow, or with no more states of it.
    """
    wake = [i for i, name in enumerate(model.states) if name.startswith(WAKE)]
    if len(wake) <= order:
        return model
    kept = [i for i in range(len(model.states)) if i not in wake]
    n, m = len(kept), model.B.shape[1]
    within = model.A[np.ix_(wake, wake)]
    into = np.hstack([model.A[np.ix_(wake, kept)], model.B[wake], model.E[wake]])
    out = np.vstack([model.A[np.ix_(kept, wake)], model.C[:, wake]])
    sizes = np.linalg.norm(into, axis=0), np.linalg.norm(out, axis=1)
    equal_in, equal_out = (array / np.where(size > 0.0, size, 1.0) for array, size in (
        (into, sizes[0]), (out.T, sizes[1]),
    ))  # fmt: skip
    reach = _root(solve_continuous_lyapunov(within, -equal_in @ equal_in.T))
    seen = _root(solve_continuous_lyapunov(within.T, -equal_out @ equal_out.T))
    left, values, right = np.linalg.svd(seen.T @ reach)
    scale = values[:order] ** -0.5
    to, back = reach @ right[:order].T * scale, (seen @ left[:, :order] * scale).T
    a, b, c = back @ within @ to, back @ into, out @ to
    steady = out @ -np.linalg.solve(within, into) + c @ np.linalg.solve(a, b)  # lost by the truncation
    rates, reads = steady[:n], steady[n:]
    first = model.A[np.ix_(kept, kept)] + rates[:, :n]
    return replace(
        model,
        states=(*(model.states[i] for i in kept), *(f"{WAKE}{k + 1}" for k in range(order))),
        A=np.block([[first, c[:n]], [b[:, :n], a]]),
        B=np.vstack([model.B[kept] + rates[:, n : n + m], b[:, n : n + m]]),
        E=np.vstack([model.E[kept] + rates[:, n + m :], b[:, n + m :]]),
        C=np.hstack([model.C[:, kept] + reads[:, :n], c[n:]]),
        D=model.D + reads[:, n : n + m],
        F=model.F + reads[:, n + m :],
    )


def _root(gramian):
    """Return a square root R (n, n) of a symmetric positive semidefinite matrix R R^T."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _following(model, names, omega):
    """Return the LinearModel without the named states, replaced by their gain at omega, rad/s; 0: static."""
    if not names:
        return model
    gone = [model.index(name) for name in names]
    kept = [i for i in range(len(model.states)) if i not in gone]
    within = model.A[np.ix_(gone, gone)]
    if omega == 0.0:
        _check_settling(within, names)
    response = np.linalg.inv(1j * omega * np.eye(len(gone)) - within)

    def moved(drive):
        """Return the gains of the removed states from a driving variable and from that variable's rate."""
        gain = response @ drive
        return gain.real, gain.imag / omega if omega else np.zeros_like(drive)

    by_state, by_rate = moved(model.A[np.ix_(gone, kept)])
    into, out = model.A[np.ix_(kept, gone)], model.C[:, gone]
    # inputs change slowly compared with the platform: the gains from their rates are omitted
    inertia = np.linalg.inv(np.eye(len(kept)) - into @ by_rate)
    rates = {
        "A": inertia @ (model.A[np.ix_(kept, kept)] + into @ by_state),
        "B": inertia @ (model.B[kept] + into @ moved(model.B[gone])[0]),
        "E": inertia @ (model.E[kept] + into @ moved(model.E[gone])[0]),
    }
    read = model.C[:, kept] + out @ by_state
    return replace(
        model,
        states=tuple(model.states[i] for i in kept),
        C=read + out @ by_rate @ rates["A"],
        D=model.D + out @ (moved(model.B[gone])[0] + by_rate @ rates["B"]),
        F=model.F + out @ (moved(model.E[gone])[0] + by_rate @ rates["E"]),
        **rates,
    )


def _check_settling(within, names):
    """Raise InputError unless the removed states, of this system matrix, decay with all others fixed."""
    values, vectors = np.linalg.eig(within)
    slowest = np.argmax(values.real)
    if values[slowest].real > -SETTLES:
        name = names[np.argmax(np.abs(vectors[:, slowest]))]
        raise InputError(
            f"linear model: state {name!r} is not asymptotically stable (it changes with"
            f" exp({values[slowest].real:.2g} s^-1 t)): a design without this state would be invalid"
        )
