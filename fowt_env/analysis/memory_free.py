"""Linear models without the memory of radiated waves: what it does at one frequency, as mass and damping.

The states of the memory, z, follow the motion x by z' = A_zz z + A_zx x + B_z u + E_z f. At a frequency w
they are a complex gain times x, u and f, whose real part acts with x and whose imaginary part, over w, with
dx/dt.
So the force of the memory becomes the added mass and the damping of that frequency, exactly there and nearly
about it, and the model has the rigid body's states alone.
"""

from dataclasses import replace

import numpy as np

MEMORY = "radiation_"  # with which the names of the memory's states begin
NO_PLATFORM_MODE = 2.0 * np.pi / 30.0  # rad/s, of a model that has no mode of platform pitch


def memory_states(model):
    """Indices of the states of a LinearModel that belong to the memory of radiated waves."""
    return [i for i, name in enumerate(model.states) if name.startswith(MEMORY)]


def platform_frequency(model):
    """Frequency (rad/s) of the slowest mode of a LinearModel that is named platform pitch."""
    found = [mode.frequency for mode in model.modes() if mode.name == "platform_pitch"]
    return min(found) if found else NO_PLATFORM_MODE


def without_memory(model, omega=None):
    """The LinearModel with added mass and damping for its memory of radiated waves; itself without one.

    omega: rad/s, where both are exact; None: platform_frequency(model).
    """
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
