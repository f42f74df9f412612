"""Reduces linear models to the states of the rigid bodies, with a lag of the blades, for controller design.

The other states z, z' = A_zz z + A_zx x + B_z u + E_z f, are residualised (Kokotovic, Khalil and O'Reilly,
Singular Perturbation Methods in Control, 1986), because truncation would remove their steady effect:

- flexible tower, wake, second-order pitch drive and generator lag are in equilibrium,
  z = -A_zz^-1 (A_zx x + B_z u + E_z f): a static spring that moves the top mass with the platform, a drive
  with the same lag for slow commands;
- radiation memory, as slow as the platform, is replaced by its complex gain at a frequency w: the real part
  acts with x, the imaginary part over w with dx/dt, which are added mass and damping at w.

Blades that follow their command at once have no state: designs use LEAST_LAG.
"""

from dataclasses import replace

import numpy as np

from fowt_env.analysis.linear_model import MEMORY, VELOCITIES
from fowt_env.errors import InputError
from fowt_env.plant.state import MOTIONS, STATES

LEAST_LAG = 0.05  # s, of a pitch drive that has none
SETTLES = 1e-6  # 1/s, slowest decay of a state that is taken where it comes to rest
NAMES = ("platform_pitch", "surge", "heave")  # of modes that may be the platform's pitch, the likeliest first
FAR = 0.3  # of the undamped frequency, within which its mode is


def with_pitch_lag(model):
    """Return the LinearModel with blades that lag; unchanged if its pitch drive has a time constant."""
    if model.scene.turbine.pitch_drive.lag > 0.0:
        return model
    a, b, blade = model.A.copy(), model.B.copy(), model.index("blade_pitch")
    a[blade], b[blade] = 0.0, 0.0
    a[blade, blade], b[blade, model.inputs.index("blade_pitch_command")] = -1.0 / LEAST_LAG, 1.0 / LEAST_LAG
    return replace(model, A=a, B=b)


def platform_frequency(model):
    """Return the frequency (rad/s) of platform_mode, or the undamped one where no mode oscillates near it."""
    found = platform_mode(model)
    return _undamped(model) if found is None else found.frequency


def platform_mode(model):
    """The Mode of a LinearModel that is the platform's pitch; None where none is near the undamped frequency.

    A hull that pitches about a point far off has one that is named after surge or heave.
    """
    undamped = _undamped(model)
    modes = model.modes()
    for name in NAMES:
        near = [m for m in modes if m.name == name and abs(m.frequency / undamped - 1.0) < FAR]
        if near:
            return min(near, key=lambda mode: abs(mode.frequency - undamped))
    return None


def _undamped(model):
    """Return the frequency (rad/s) of restoring and mass alone in which the pitch has its largest share."""
    model = _settled(model)  # the mass on a flexible tower is the platform's too
    positions = [model.index(name) for name in MOTIONS]
    speeds = [model.index(name) for name in VELOCITIES]
    kinematics, stiffness = model.A[np.ix_(positions, speeds)], model.A[np.ix_(speeds, positions)]
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    arm = model.arm
    size = np.abs(vectors) * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    chosen = np.argmax(size[MOTIONS.index("platform_pitch")] / size.sum(axis=0))
    return float(np.sqrt(max(-values[chosen].real, 1e-6)))


def residualised(model, omega=None):
    """Return the LinearModel with the states of plant.state.STATES alone; unchanged if it has no others.

    omega: rad/s, where added mass and damping of radiation memory are exact; None: platform_frequency of the
    model without its other internal states.
    Raises: InputError if some of those do not come to rest by themselves.
    """
    model = _settled(model)
    memory = [name for name in model.states if name not in STATES]
    if not memory:
        return model
    return _following(model, memory, platform_frequency(model) if omega is None else float(omega))


def _settled(model):
    """Return the LinearModel whose states besides STATES and radiation memory are where they come to rest."""
    names = [name for name in model.states if name not in STATES and not name.startswith(MEMORY)]
    return _following(model, names, 0.0)


def _following(model, names, omega):
    """Return the LinearModel whose states of these names follow the others as at omega, rad/s; 0: at rest."""
    if not names:
        return model
    gone = [model.index(name) for name in names]
    kept = [i for i in range(len(model.states)) if i not in gone]
    own = model.A[np.ix_(gone, gone)]
    if omega == 0.0:
        _check_settling(own, names)
    response = np.linalg.inv(1j * omega * np.eye(len(gone)) - own)

    def moved(drive):
        """Return (with the value, with its rate) of the states that go per what drives them."""
        gain = response @ drive
        return gain.real, gain.imag / omega if omega else np.zeros_like(drive)

    by_state, by_rate = moved(model.A[np.ix_(gone, kept)])
    into, out = model.A[np.ix_(kept, gone)], model.C[:, gone]
    # the inputs change slowly beside the platform: what their rates do to these states is omitted
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


def _check_settling(own, names):
    """Raise InputError unless states of this system matrix come to rest while all others are held."""
    values, vectors = np.linalg.eig(own)
    slowest = np.argmax(values.real)
    if values[slowest].real > -SETTLES:
        name = names[np.argmax(np.abs(vectors[:, slowest]))]
        raise InputError(
            f"linear model: state {name!r} does not come to rest by itself (it goes with"
            f" exp({values[slowest].real:.2g} s^-1 t)): a design that does not keep it would not hold"
        )
