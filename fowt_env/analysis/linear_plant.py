"""Computes rates and outputs of a plant in the states of its linear models, averaged over the azimuth.

States of single blades are in multi-blade coordinates (analysis/blade_coordinates.py): the mean is one state
of the model, tilt and yaw components are two more.
"""

from math import cos, pi, sin

import numpy as np

from fowt_env.analysis.blade_coordinates import bending_states, coordinates
from fowt_env.analysis.trim import AZIMUTHS
from fowt_env.plant.channels import N_FIXED, Out, measure, record
from fowt_env.plant.compile.decorators import entry, inlined_kernel
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.dynamics import evaluate_loads, loads_of, respond
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import BLADES, N_COMMANDS, STATE_INDEX, STATES, Command, State
from fowt_env.scene.blade_beam import MODES

# velocity steps are small because quadratic drag leaves a false damping proportional to them
STATE_STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-7, 1e-7, 1e-7, 1e-4, 1e-5])
TOWER = ("tower_fore_aft", "tower_side_side", "tower_fore_aft_2", "tower_side_side_2")  # deflections
TOWER_BLOCKS = {"tower_deflection": ("", 1e-3), "tower_velocity": ("_rate", 1e-5)}  # name suffixes, steps
BLADE_BLOCKS = {"blade_deflection": ("", 1e-3), "blade_velocity": ("_rate", 1e-4)}  # of the modes of MODES
TWIST_STATES = ("shaft_twist", "shaft_twist_rate")  # blocks of the scene's state vector
TWIST_STEP = 1e-5  # rad and rad/s
ACTUATOR_STATES = {  # block of the scene's state vector: (name of its state in a linear model, step)
    "pitch_rate": ("pitch_rate", 1e-5),
    "generator_torque": ("generator_torque_in_force", 1.0),
}
WAKE = "wake_"  # prefix of the states of dynamic inflow, four per annulus
WAKE_STEP = 1e-3  # m/s, of the differences
CYCLIC = ("tilt_", "yaw_")  # prefixes of the cosine and sine components of states of single blades
MEASURED = (
    "rotor_speed", "generator_speed", "blade_pitch", "surge", "heave", "platform_pitch",
    "platform_pitch_rate", "nacelle_acceleration", "nacelle_velocity",
)  # fmt: skip
RECORDED = {  # output: column of the output row, SI
    "power": Out.GENPWR,
    "rotor_thrust": Out.RTFLDFXH,
    "tower_base_moment": Out.TWRBSMYT,
}
NOT_TURNING = ("hub_tilt_moment", "hub_yaw_moment", "yaw_bearing_tilt_moment", "yaw_bearing_yaw_moment")
OF_ROOTS = ("root_out_of_plane", "root_in_plane")
MOMENTS = (*NOT_TURNING, *(f"{name}{part}" for name in OF_ROOTS for part in ("", "_tilt", "_yaw")))


def bending_names(scene):
    """Return the names of the blades' bending modes and of their rates; () for rigid blades."""
    modes = MODES[scene.options["blades"]]
    return tuple(name + end for end, _ in BLADE_BLOCKS.values() for name in modes)


def cyclic_names(names):
    """Return the names of the cosine and sine components of states of single blades."""
    return tuple(f"{part}{name.removeprefix('blade_')}" for name in names for part in CYCLIC)


def plant_states(scene):
    """Return (names, indices in the state vector, difference steps) of the states, except radiation memory.

    A state of each blade has the indices of all blades, which move together; its cyclic components are not
    listed.
    """
    rows = [(name, [int(i)], step) for name, i, step in zip(STATES, STATE_INDEX, STATE_STEPS, strict=True)]
    pitch = STATES.index("blade_pitch")
    rows[pitch] = ("blade_pitch", list(scene.pitch_states), STATE_STEPS[pitch])
    modes = MODES[scene.options["blades"]]
    for name, first, size, *_ in scene.blocks:
        if name == "wake":
            each = size // scene.turbine.rotor.blades
            indices = (list(range(first + k, first + size, each)) for k in range(each))
            rows += [(f"{WAKE}{k}", blades, WAKE_STEP) for k, blades in enumerate(indices, 1)]
        elif name in TOWER_BLOCKS:
            end, step = TOWER_BLOCKS[name]
            rows += [(mode + end, [first + k], step) for k, mode in enumerate(TOWER[:size])]
        elif name in BLADE_BLOCKS:
            end, step = BLADE_BLOCKS[name]
            indices = (list(range(first + k, first + size, len(modes))) for k in range(len(modes)))
            rows += [(mode + end, blades, step) for mode, blades in zip(modes, indices, strict=True)]
        elif name in TWIST_STATES:
            rows.append((name, [first], TWIST_STEP))
        elif name in ACTUATOR_STATES:
            state, step = ACTUATOR_STATES[name]
            rows.append((state, list(range(first, first + size)), step))
    return tuple(zip(*rows, strict=True))


def multiblade_point(scene, state):
    """Return (state vector in multi-blade coordinates, {state of single blades: (2,) cosine, sine})."""
    mean, cyclic = coordinates(state, bending_states(scene))
    return mean, dict(zip(bending_names(scene), cyclic, strict=True))


@inlined_kernel
def fill_response(x, u, force, model, data, dx, measurement, row):
    """Fill state rates, measurement and output row under u and additional hull forces (6,)."""
    evaluate_loads(0.0, x, model, data, dx)
    for j in range(6):
        data.cache[LoadCache.TOTAL + j] += force[j]
        data.cache[LoadCache.HYDRO + j] += force[j]
    respond(x, u, model, data, dx)
    measure(model, data, x, dx, u, 0.0, measurement)
    record(model, data, x, dx, u, 0.0, loads_of(data, dx), row)


@entry
def _mean_response(
    handle, x, u, force, cyclic, blade_states, azimuths, y, v, dx, measurement, row, rates, turned, measured,
    recorded, moments,
):  # fmt: skip
    """Fill the azimuth means of rates and outputs at a state in multi-blade coordinates.

    cyclic (k + 1, 2): cosine and sine components of the blades' states, whose indices are the rows of
    blade_states (k, 3), and of the pitch commands. turned (k, 2): cosine and sine components of the rates;
    moments: as MOMENTS, or none. y, v, dx, measurement, row: scratch.
    """
    model, data = model_of(handle), data_of(handle)
    rates[:] = 0.0
    turned[:] = 0.0
    measured[:] = 0.0
    moments[:] = 0.0
    recorded[:] = 0.0
    blocks = blade_states.shape[0]
    for i in range(azimuths):
        azimuth = x[State.AZIMUTH] + i * (2.0 * pi / 3.0) / azimuths
        for j in range(len(x)):  # `y[:] = x` would compile the text of its error for seconds
            y[j] = x[j]
        for j in range(len(u)):
            v[j] = u[j]
        y[State.AZIMUTH] = azimuth
        for blade in range(BLADES):
            psi = azimuth + blade * 2.0 * pi / BLADES
            for k in range(blocks):
                y[blade_states[k, blade]] += cyclic[k, 0] * cos(psi) + cyclic[k, 1] * sin(psi)
            if v.shape[0] > N_COMMANDS:
                v[Command.BLADE_PITCH + blade] += cyclic[blocks, 0] * cos(psi) + cyclic[blocks, 1] * sin(psi)
        fill_response(y, v, force, model, data, dx, measurement, row)
        for means, values in ((rates, dx), (measured, measurement), (recorded, row)):
            for j in range(len(values)):
                means[j] += values[j] / azimuths
        for blade in range(BLADES):
            psi = azimuth + blade * 2.0 * pi / BLADES
            c, s = 2.0 * cos(psi) / BLADES / azimuths, 2.0 * sin(psi) / BLADES / azimuths
            for k in range(blocks):
                turned[k, 0] += c * dx[blade_states[k, blade]]
                turned[k, 1] += s * dx[blade_states[k, blade]]
        if moments.shape[0] > 0:
            for j in range(4):
                moments[j] += measurement[N_MEASUREMENTS + BladeMeasure.HUB_TILT_MOMENT + j] / azimuths
            for blade in range(BLADES):
                psi = azimuth + blade * 2.0 * pi / BLADES
                c, s = 2.0 * cos(psi) / BLADES / azimuths, 2.0 * sin(psi) / BLADES / azimuths
                for j in range(2):
                    field = N_MEASUREMENTS + BladeMeasure.ROOT_OUT_OF_PLANE_1 + BLADES * j
                    root = measurement[field + blade]
                    moments[4 + 3 * j] += root / BLADES / azimuths
                    moments[5 + 3 * j] += c * root
                    moments[6 + 3 * j] += s * root
    for k in range(blocks):
        mean = 0.0
        for blade in range(BLADES):
            mean += rates[blade_states[k, blade]] / BLADES
        rates[blade_states[k, 0]] = mean
        # d(q_c cos psi + q_s sin psi)/dt: the coordinates do not rotate with the blades
        turned[k, 0] -= x[State.ROTOR_SPEED] * cyclic[k, 1]
        turned[k, 1] += x[State.ROTOR_SPEED] * cyclic[k, 0]
    data.cache[LoadCache.VALID] = 0.0


class Plant:
    """Computes rates and outputs of a scene without fluctuations at a state, command and hull force."""

    def __init__(self, scene, bladed=(), moments=()):
        """Take the names of the states with cyclic components, and MOMENTS or no further outputs."""
        self.handle = scene.handle()
        self.columns = [*RECORDED.values(), *range(N_FIXED, N_FIXED + scene.n_lines)]
        self.measures = [Measure[name.upper()] for name in MEASURED]
        names, indices, _ = plant_states(scene)
        self.states = [each[0] for each in indices]
        self.wake = [i for i, name in enumerate(names) if name.startswith(WAKE)]
        self.annuli = [indices[i] for i in self.wake]  # averaged over blades, whose rates differ in shear
        of_blades = [indices[names.index(name)] for name in bladed]
        self.blade_states = np.array(of_blades, dtype=int).reshape(len(bladed), BLADES)
        n, fields, rows = scene.n_state, scene.n_measurements, len(scene.channels)
        self.scratch = tuple(map(np.zeros, (n, scene.n_commands, n, fields, rows)))
        self.means = tuple(map(np.zeros, (n, (len(bladed), 2), fields, rows, len(moments))))

    def __call__(self, x, u, force, cyclic):
        """Return the rates of the states and of the cyclic components, then the outputs.

        x: in multi-blade coordinates; cyclic (k + 1, 2): components of the k states of single blades, and of
        the pitch command.
        """
        _mean_response(
            self.handle, x, u, force, cyclic, self.blade_states, AZIMUTHS, *self.scratch, *self.means
        )
        rates, turned, measured, recorded, moments = self.means
        of_states = rates[self.states]
        if self.wake:
            of_states[self.wake] = rates[self.annuli].mean(axis=1)
        return np.r_[of_states, turned.ravel(), measured[self.measures], recorded[self.columns], moments]
