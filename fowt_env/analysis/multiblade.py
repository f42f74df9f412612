"""Linearises a rotor with individual blade pitch in multi-blade coordinates.

A quantity q_i of the blades i = 1, 2, 3 at the azimuths psi_i is q_i = q_0 + q_c cos psi_i + q_s sin psi_i,
psi = 0 up: q_0 is collective, q_c the tilt and q_s the yaw component. At each azimuth the plant is
differentiated by these coordinates and the outputs are transformed to them; the derivatives are averaged
over the azimuth. Variations at 3P in sheared wind are omitted.
"""

from math import cos, pi, sin

import numpy as np

from fowt_env.analysis.linear_model import (
    CYCLIC,
    FORCE_STEPS,
    INPUT_STEPS,
    LINEAR,
    Plant,
    assembled,
    check_linear,
    fill_response,
    plant_states,
    steady_parts,
    wind_slope,
)
from fowt_env.analysis.statics import central_difference
from fowt_env.analysis.trim import AZIMUTHS, trim, without_fluctuations
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import BLADES, Command, State

CYCLIC_INPUTS = ("tilt_pitch_command", "yaw_pitch_command")
NOT_TURNING = ("hub_tilt_moment", "hub_yaw_moment", "yaw_bearing_tilt_moment", "yaw_bearing_yaw_moment")
OF_ROOTS = ("root_out_of_plane", "root_in_plane")
MOMENTS = (*NOT_TURNING, *(f"{name}{part}" for name in OF_ROOTS for part in ("", "_tilt", "_yaw")))


@entry
def _mean_response(
    handle, x, u, force, cyclic, blade_states, azimuths, y, v, dx, measurement, row, rates, turned, measured,
    moments, recorded,
):  # fmt: skip
    """Fill the azimuth means of rates and outputs at a state with cyclic components.

    cyclic (k + 1, 2): cosine and sine components of the blades' states, whose indices are the rows of
    blade_states (k, 3), and of the pitch commands. turned (k, 2): cosine and sine components of the rates;
    moments: as MOMENTS. y, v, dx, measurement, row: scratch.
    """
    model, data = model_of(handle), data_of(handle)
    rates[:] = 0.0
    turned[:] = 0.0
    measured[:] = 0.0
    moments[:] = 0.0
    recorded[:] = 0.0
    blocks = blade_states.shape[0]
    for i in range(azimuths):
        azimuth = x[State.AZIMUTH] + i * (2.0 * pi / BLADES) / azimuths
        y[:] = x
        v[:] = u
        y[State.AZIMUTH] = azimuth
        for blade in range(BLADES):
            psi = azimuth + blade * 2.0 * pi / BLADES
            for k in range(blocks):
                y[blade_states[k, blade]] += cyclic[k, 0] * cos(psi) + cyclic[k, 1] * sin(psi)
            v[Command.BLADE_PITCH + blade] += cyclic[blocks, 0] * cos(psi) + cyclic[blocks, 1] * sin(psi)
        fill_response(y, v, force, model, data, dx, measurement, row)
        rates += dx / azimuths
        measured += measurement / azimuths
        recorded += row / azimuths
        for j in range(4):
            moments[j] += measurement[N_MEASUREMENTS + BladeMeasure.HUB_TILT_MOMENT + j] / azimuths
        for blade in range(BLADES):
            psi = azimuth + blade * 2.0 * pi / BLADES
            c, s = 2.0 * cos(psi) / BLADES / azimuths, 2.0 * sin(psi) / BLADES / azimuths
            for k in range(blocks):
                turned[k, 0] += c * dx[blade_states[k, blade]]
                turned[k, 1] += s * dx[blade_states[k, blade]]
            for j in range(2):
                root = measurement[N_MEASUREMENTS + BladeMeasure.ROOT_OUT_OF_PLANE_1 + BLADES * j + blade]
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


class _Plant(Plant):
    """Computes rates and outputs of a scene without fluctuations, in multi-blade coordinates."""

    def __init__(self, scene, blade_states):
        super().__init__(scene, scene.n_lines)
        self.blade_states = blade_states
        n, fields, rows = scene.n_state, scene.n_measurements, len(scene.channels)
        self.scratch = tuple(map(np.zeros, (n, scene.n_commands, n, fields, rows)))
        self.means = tuple(map(np.zeros, (n, (len(blade_states), 2), fields, len(MOMENTS), rows)))

    def __call__(self, x, u, force, cyclic):
        """Return the rates of the states and of the cyclic components, then the outputs."""
        _mean_response(
            self.handle, x, u, force, cyclic, self.blade_states, AZIMUTHS, *self.scratch, *self.means
        )
        rates, turned, measured, moments, recorded = self.means
        return np.r_[
            rates[self.states], turned.ravel(), measured[self.measures], recorded[self.columns], moments
        ]


def linearize_blades(scene, operating_point=None):
    """Return the LinearModel of a scene with pitch="individual" in multi-blade coordinates (azimuth mean).

    In addition to the states, inputs and outputs of linearize, the model has the states tilt_pitch and
    yaw_pitch, rad (and tilt_pitch_rate, yaw_pitch_rate for a drive with inertia), the inputs CYCLIC_INPUTS,
    rad, and the outputs MOMENTS, N m: moments at hub and yaw bearing, and mean, cosine (tilt) and sine (yaw)
    components of the blade root moments. States and inputs of linearize are collective. operating_point:
    default, the floating trim of the scene, at which all blades have the same pitch.

    Raises: InputError for a scene with collective pitch, and as linearize.
    """
    if scene.model.pitches is None:
        raise InputError(
            "linearize_blades: the scene has collective pitch; build the scene with pitch='individual'"
        )
    check_linear(scene, [name for name in LINEAR if name != "wake"])  # cyclic wake states are not implemented
    point = trim(scene) if operating_point is None else operating_point
    names, collective, state_steps = plant_states(scene)
    bladed = [i for i, indices in enumerate(collective) if len(indices) == BLADES]
    blade_states = np.array([collective[i] for i in bladed])
    parts = steady_parts(scene, point)
    x, u, force = point.state.copy(), point.command.copy(), np.zeros(6)
    cyclic = np.zeros((len(bladed) + 1, 2))

    def plant_at(speed):
        return _Plant(without_fluctuations(scene, speed).with_model(parts), blade_states)

    plant = plant_at(point.wind_speed)

    def slope(array, index, step):
        return central_difference(lambda: plant(x, u, force, cyclic), array, index, step)

    columns = [slope(x, indices, step) for indices, step in zip(collective, state_steps, strict=True)]
    columns += [slope(cyclic, (k, part), state_steps[i]) for k, i in enumerate(bladed) for part in range(2)]
    inputs = [slope(u, 0, INPUT_STEPS[0]), slope(u, list(range(1, scene.n_commands)), INPUT_STEPS[1])]
    inputs.append(wind_slope(lambda speed: plant_at(speed)(x, u, force, cyclic), point, inputs[0]))
    inputs += [slope(cyclic, (len(bladed), part), INPUT_STEPS[1]) for part in range(2)]
    forces = [slope(force, i, FORCE_STEPS[i]) for i in range(6)]
    states = (*names, *(f"{part}{names[i].removeprefix('blade_')}" for i in bladed for part in CYCLIC))
    return assembled(scene, point, (columns, inputs, forces), states, CYCLIC_INPUTS, MOMENTS)
