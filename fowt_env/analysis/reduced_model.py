"""Linear models as designs of controllers take them: no memory of waves or wake, blades that lag.

The states of the memory, z, follow the motion x by z' = A_zz z + A_zx x + B_z u + E_z f. At a frequency w
they are a complex gain times x, u and f, whose real part acts with x and whose imaginary part, over w, with
dx/dt.
So the force of the memory becomes the added mass and the damping of that frequency, exactly there and nearly
about it, and the model has the rigid body's states alone. The wake of dynamic inflow follows at once.

Blades that follow their command at once are no state: designs give them LEAST_LAG. A drive with inertia is to
them the lag that trails a slow command as far, and a generator that lags follows at once.
"""

from dataclasses import replace

import numpy as np

from fowt_env.analysis.linear_model import ACTUATOR_STATES, MEMORY, VELOCITIES, WAKE
from fowt_env.plant.state import MOTIONS

LEAST_LAG = 0.05  # s, of a pitch drive that has none
ADDED = tuple(name for name, _ in ACTUATOR_STATES.values())
TORQUE = ACTUATOR_STATES["generator_torque"][0]
NAMES = ("platform_pitch", "surge", "heave")  # of modes that may be the platform's pitch, the likeliest first
FAR = 0.3  # of the undamped frequency, within which its mode is


def with_pitch_lag(model):
    """The LinearModel with blades that lag; itself where its pitch drive has a time constant."""
    if model.scene.turbine.pitch_drive.lag > 0.0:
        return model
    a, b, blade = model.A.copy(), model.B.copy(), model.index("blade_pitch")
    a[blade], b[blade] = 0.0, 0.0
    a[blade, blade], b[blade, model.inputs.index("blade_pitch_command")] = -1.0 / LEAST_LAG, 1.0 / LEAST_LAG
    return replace(model, A=a, B=b)


def without_inertia(model):
    """The LinearModel with a first-order lag of the blades and none of the torque; itself where it is so."""
    lagging = [i for i, name in enumerate(model.states) if name in ADDED]
    if not lagging:
        return model
    kept = [i for i in range(len(model.states)) if i not in lagging]
    a, b, d = model.A.copy(), model.B.copy(), model.D.copy()
    blade, lag = model.index("blade_pitch"), model.scene.turbine.pitch_drive.lag
    if "pitch_rate" in model.states:
        a[blade], b[blade] = 0.0, 0.0
        a[blade, blade] = -1.0 / lag
        b[blade, model.inputs.index("blade_pitch_command")] = 1.0 / lag
    if TORQUE in model.states:
        torque, command = model.index(TORQUE), model.inputs.index("generator_torque")
        b[:, command] += a[:, torque]
        d[:, command] += model.C[:, torque]
    return replace(
        model,
        A=a[np.ix_(kept, kept)],
        B=b[kept],
        C=model.C[:, kept],
        D=d,
        E=model.E[kept],
        states=tuple(model.states[i] for i in kept),
    )


def memory_states(model):
    """Indices of the states of a LinearModel that belong to the memory of radiated waves."""
    return [i for i, name in enumerate(model.states) if name.startswith(MEMORY)]


def platform_frequency(model):
    """Frequency (rad/s) of platform_mode, or the undamped one where no mode oscillates near it."""
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
    """Frequency (rad/s) of restoring and mass alone in which the pitch has its largest share."""
    positions = [model.index(name) for name in MOTIONS]
    speeds = [model.index(name) for name in VELOCITIES]
    kinematics, stiffness = model.A[np.ix_(positions, speeds)], model.A[np.ix_(speeds, positions)]
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    arm = model.arm
    size = np.abs(vectors) * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    chosen = np.argmax(size[MOTIONS.index("platform_pitch")] / size.sum(axis=0))
    return float(np.sqrt(max(-values[chosen].real, 1e-6)))


def without_wake(model):
    """The LinearModel whose wake follows at once, the quasi-steady one; itself without dynamic inflow."""
    wake = [i for i, name in enumerate(model.states) if name.startswith(WAKE)]
    if not wake:
        return model
    kept = [i for i in range(len(model.states)) if i not in wake]
    own = model.A[np.ix_(wake, wake)]
    by_state, by_input, by_force = (
        -np.linalg.solve(own, part) for part in (model.A[np.ix_(wake, kept)], model.B[wake], model.E[wake])
    )
    into, out = model.A[np.ix_(kept, wake)], model.C[:, wake]
    return replace(
        model,
        A=model.A[np.ix_(kept, kept)] + into @ by_state,
        B=model.B[kept] + into @ by_input,
        E=model.E[kept] + into @ by_force,
        C=model.C[:, kept] + out @ by_state,
        D=model.D + out @ by_input,
        F=model.F + out @ by_force,
        states=tuple(model.states[i] for i in kept),
    )


def without_memory(model, omega=None):
    """The LinearModel with added mass and damping for its memory of radiated waves, and without_wake.

    omega: rad/s, where both are exact; None: platform_frequency(model).
    """
    model = without_wake(model)
    memory = memory_states(model)
    if not memory:
        return model
    omega = platform_frequency(model) if omega is None else float(omega)
    kept = [i for i in range(len(model.states)) if i not in memory]
    response = np.linalg.inv(1j * omega * np.eye(len(memory)) - model.A[np.ix_(memory, memory)])

    def moved(drive):
        """(with the value, with its rate) of the memory's states per what drives them."""
        gain = response @ drive
        return gain.real, gain.imag / omega

    by_state, by_rate = moved(model.A[np.ix_(memory, kept)])
    into, out = model.A[np.ix_(kept, memory)], model.C[:, memory]
    # the inputs change slowly beside the platform: what their rates do to the memory is left out
    inertia = np.linalg.inv(np.eye(len(kept)) - into @ by_rate)
    rates = {
        "A": inertia @ (model.A[np.ix_(kept, kept)] + into @ by_state),
        "B": inertia @ (model.B[kept] + into @ moved(model.B[memory])[0]),
        "E": inertia @ (model.E[kept] + into @ moved(model.E[memory])[0]),
    }
    read = model.C[:, kept] + out @ by_state
    return replace(
        model,
        states=tuple(model.states[i] for i in kept),
        C=read + out @ by_rate @ rates["A"],
        D=model.D + out @ (moved(model.B[memory])[0] + by_rate @ rates["B"]),
        F=model.F + out @ (moved(model.E[memory])[0] + by_rate @ rates["E"]),
        **rates,
    )
