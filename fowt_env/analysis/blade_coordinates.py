"""Moves the states of three bending blades between blades and multi-blade coordinates.

A quantity q_i of the blades i = 1, 2, 3 at the azimuths psi_i is q_i = q_0 + q_c cos psi_i + q_s sin psi_i,
psi = 0 up: q_0 is its mean, q_c the tilt and q_s the yaw component. A state vector in multi-blade coordinates
has the mean in the states of all blades, and an array `cyclic` (k, 2) the components q_c and q_s.
"""

from math import pi

import numpy as np

from fowt_env.plant.advance import output
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import BLADES, State

TURN = 2.0 * pi / BLADES  # rad, the period of a rotor of three equal blades
HARMONICS = 2  # components besides the mean


def bending_states(scene):
    """Return (2 n, 3) indices of deflections, then velocities, of n bending modes by blade; (0, 3): rigid."""
    blades = scene.model.blades
    if blades is None:
        return np.zeros((0, BLADES), dtype=int)
    n = len(blades.beam.count)
    of_blades = blades.first + n * np.arange(BLADES) + np.arange(n)[:, None]
    return np.concatenate([of_blades, of_blades + BLADES * n])


def waves_of(azimuth):
    """Return the (2, 3) cosines and sines of the blades' azimuths, the first at an azimuth (rad)."""
    psi = azimuth + TURN * np.arange(BLADES)
    return np.array([np.cos(psi), np.sin(psi)])


def coordinates(x, states):
    """Return (state vector in multi-blade coordinates, cyclic (k, 2)) of a state vector at its azimuth."""
    of_blades, mean = x[states], x.copy()
    mean[states] = of_blades.mean(axis=1)[:, None]
    return mean, of_blades @ waves_of(x[State.AZIMUTH]).T * (2.0 / BLADES)


def placed(x, azimuth, states, cyclic):
    """Return the state vector at an azimuth (rad) of one in multi-blade coordinates."""
    y = x.copy()
    y[State.AZIMUTH] = azimuth
    y[states] += cyclic @ waves_of(azimuth)
    return y


def turned_to(x, azimuth, states):
    """Return a state vector moved to another azimuth (rad), with its multi-blade coordinates unchanged."""
    mean, cyclic = coordinates(x, states)
    return placed(mean, azimuth, states, cyclic)


class CyclicMean:
    """Averages the rates of a scene with bending blades over the azimuth, in multi-blade coordinates."""

    def __init__(self, scene, data, handle):
        self.states, self.data, self.handle = bending_states(scene), data, handle
        self.dx, self.row = np.zeros(scene.n_state), np.zeros(len(scene.channels))

    def __call__(self, x, cyclic, u, azimuths, mean):
        """Fill mean (n_state,) at a state; return the rates (k, 2) of cyclic, zero in a periodic state.

        azimuths: samples of TURN.
        """
        states, turned = self.states, np.zeros_like(cyclic)
        mean[:] = 0.0
        for azimuth in x[State.AZIMUTH] + TURN * np.arange(azimuths) / azimuths:
            self.data.cache[LoadCache.VALID] = 0.0
            output(self.handle, placed(x, azimuth, states, cyclic), u, 0.0, self.dx, self.row)
            mean += self.dx / azimuths
            turned += self.dx[states] @ waves_of(azimuth).T * (2.0 / BLADES / azimuths)
        mean[states] = mean[states].mean(axis=1)[:, None]
        # d(q_c cos psi + q_s sin psi)/dt: the coordinates do not rotate with the blades
        return turned + x[State.ROTOR_SPEED] * np.array([-cyclic[:, 1], cyclic[:, 0]]).T
