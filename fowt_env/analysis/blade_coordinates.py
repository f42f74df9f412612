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


def bending_states(scene):
    """Return (2 n, 3) indices of deflections, then velocities, of n bending modes by blade; (0, 3): rigid."""
    blades = scene.model.blades
    if blades is None:
        return np.zeros((0, BLADES), dtype=int)
    n = len(blades.beam.count)
    of_blades = blades.first + n * np.arange(BLADES) + np.arange(n)[:, None]
    return np.concatenate([of_blades, of_blades + BLADES * n])


def waves_of(azimuth):
    """Return the (..., 2, 3) cosines and sines of the blades' azimuths, the first at azimuth (...), rad."""
    psi = np.asarray(azimuth)[..., None] + TURN * np.arange(BLADES)
    return np.stack([np.cos(psi), np.sin(psi)], axis=-2)


def coordinates(x, states):
    """Return (state vector in multi-blade coordinates, cyclic (k, 2)) of a state vector at its azimuth."""
    of_blades, mean = x[states], x.copy()
    mean[states] = of_blades.mean(axis=1)[:, None]
    return mean, of_blades @ waves_of(x[State.AZIMUTH]).T * (2.0 / BLADES)


def placed(x, azimuth, states, cyclic):
    """Return the state vectors (..., n_state) at azimuth (...), rad, of one in multi-blade coordinates."""
    y = np.broadcast_to(x, (*np.shape(azimuth), len(x))).copy()
    y[..., State.AZIMUTH] = azimuth
    y[..., states] += cyclic @ waves_of(azimuth)
    return y


def turned_to(x, azimuth, states):
    """Return a state vector moved to another azimuth (rad), with its multi-blade coordinates unchanged."""
    mean, cyclic = coordinates(x, states)
    return placed(mean, azimuth, states, cyclic)


def blade_waves(tilt, yaw):
    """Return {"regressive", "progressive": wave} of complex components q_c, q_s of a mode exp(i w t).

    q_i = cos(w t - psi_i) runs with the rotation; its q_s lags behind q_c.
    """
    return {"regressive": 0.5 * (tilt - 1j * yaw), "progressive": 0.5 * (tilt + 1j * yaw)}


class CyclicMean:
    """Averages the rates of a scene with bending blades over the azimuth, in multi-blade coordinates."""

    def __init__(self, scene, data, handle):
        self.states, self.data, self.handle = bending_states(scene), data, handle
        self.row = np.zeros(len(scene.channels))

    def __call__(self, x, cyclic, u, azimuths, mean):
        """Fill mean (n_state,) at a state; return the rates (k, 2) of cyclic, zero in a periodic state.

        azimuths: samples of TURN.
        """
        azimuth, states = x[State.AZIMUTH] + TURN * np.arange(azimuths) / azimuths, self.states
        every = placed(x, azimuth, states, cyclic)
        rates = np.zeros_like(every)
        for y, dx in zip(every, rates, strict=True):
            self.data.cache[LoadCache.VALID] = 0.0
            output(self.handle, y, u, 0.0, dx, self.row)
        mean[:] = rates.mean(axis=0)
        mean[states] = mean[states].mean(axis=1)[:, None]
        turned = np.einsum("akb,awb->kw", rates[:, states], waves_of(azimuth)) * (2.0 / BLADES / azimuths)
        # d(q_c cos psi + q_s sin psi)/dt: the coordinates do not rotate with the blades
        return turned + x[State.ROTOR_SPEED] * np.array([-cyclic[:, 1], cyclic[:, 0]]).T
