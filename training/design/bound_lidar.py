"""Models one distance of a nacelle lidar for the performance limit: a delay line and a coloured error.

The reading is the rotor-averaged wind T ahead plus an error that is independent of it. T is the time in which
the wind travels from the measured distance to the rotor, less the mean age of a reading. With the spectra
that simulate the lidar (controllers/mpc/ahead.py), S_RR of the wind and coherence g of wind and reading, the
spectrum of the error is S_RR (1/g^2 - 1): the reading is scaled to unit gain at each frequency, which changes
no information.

In the design the delay line is a chain of second-order Pade approximants, the error white noise through a
filter; deviations in BoundPlant.true use the exact delay and the whole spectrum of the error.
"""

from math import ceil, pi

import numpy as np
from scipy.linalg import block_diag

from fowt_env.controllers.mpc.ahead import BINS, reading_spectra
from fowt_env.descriptions.lidar import read_lidar
from fowt_env.errors import InputError
from fowt_env.training.design.bound_plant import OMEGA, fit_spectrum
from fowt_env.weather.lidar import blocked_share, mean_age
from fowt_env.weather.lidar_gates import represented, travel_distances

SECTION = 1.5  # s of delay in an approximant, whose phase is then exact to 0.02 rad up to 1 rad/s
LEAST_COHERENCE = 0.02  # squared, above the frequencies that matter
FLOOR = 0.01  # m/s, white noise of a reading every 0.1 s besides the error: keeps the filter well posed


class BoundLidar:
    """Holds the wind filter of a BoundPlant with the delay line and the error of a reading as further states.

    plant      BoundPlant
    lead       s, by which the reading is ahead of the rotor
    error      spectrum (n,) over OMEGA of the reading's error, per rad/s; zeros: none

    a (m, m), intensity (m, m) of the noise, output (m,) of the wind at the rotor and reading (m,) are in the
    place of those of plant.wind_filter.
    """

    def __init__(self, plant, lead, error):
        ahead, self.lead = plant.wind_filter, float(lead)
        self.error = np.asarray(error, dtype=float)
        sections = max(1, ceil(self.lead / SECTION))
        a, b, c, d = _pade(self.lead / sections)
        # states: wind filter, sections from the measured distance to the rotor
        chain, into = ahead.a, ahead.output  # output of the chain so far
        for _ in range(sections):
            chain = np.block([[chain, np.zeros((len(chain), 2))], [np.outer(b, into), a]])
            into = np.r_[d * into, c]
        noise, filters = [ahead.intensity, np.zeros((2 * sections, 2 * sections))], [chain]
        size = len(chain)
        if self.error.any():
            made = fit_spectrum(self.error, (3.0, 1.0), (0.3,))
            filters.append(made.a)
            noise.append(made.intensity)
            self.fitted_error = made.density(OMEGA)
            tail = made.output
        else:
            self.fitted_error, tail = np.zeros(OMEGA.size), np.zeros(0)
        self.a, self.intensity = block_diag(*filters), block_diag(*noise)
        self.output = np.r_[into, np.zeros(tail.size)]
        self.reading = np.r_[ahead.output, np.zeros(size - ahead.output.size), tail]
        self.noise = FLOOR**2 * 0.1
        # response of the reading to the wind at the rotor: all-pass sections backwards
        s = 1j * OMEGA * self.lead / sections
        self.fitted_response = ((1.0 + s / 2.0 + s**2 / 12.0) / (1.0 - s / 2.0 + s**2 / 12.0)) ** sections
        self.response = np.exp(1j * OMEGA * self.lead)

    def of(self, weather, plant):
        """Return (response (n,) of the reading to the wind, spectrum (n,) of its error) in a Weather."""
        if weather is plant.fitted:
            return self.fitted_response, self.fitted_error
        return self.response, self.error


def _pade(time):
    """Return (a (2, 2), b (2,), c (2,), d) of the second-order Pade approximant of a delay, s."""
    # (1 - sT/2 + s^2T^2/12)/(1 + sT/2 + s^2T^2/12) = 1 - sT/(1 + sT/2 + s^2T^2/12), states in time / T
    a = np.array([[0.0, 1.0], [-12.0, -6.0]]) / time
    return a, np.array([0.0, 12.0]) / time, np.array([0.0, -1.0]), 1.0


def lidar_of(plant, scene, lidar, distance=None):
    """Return the BoundLidar of a built-in or described lidar at one of its distances, m; None: the farthest.

    Raises: InputError for a distance that the lidar does not have, or that is measured too late to be ahead.
    """
    described = represented(read_lidar(lidar))
    distances, rotor = list(described.distances), scene.turbine.rotor
    distance = distances[-1] if distance is None else float(distance)
    if distance not in distances:
        shown = ", ".join(f"{each:g}" for each in distances)
        raise InputError(f"distance = {distance:g} m: lidar {described.name!r} measures at {shown} m")
    gate, speed = distances.index(distance), plant.wind_speed
    blocked = blocked_share(described, rotor, scene.turbine.blade)
    lead = float(travel_distances(described)[gate]) / speed - mean_age(described, blocked)
    if not lead > 0.0:
        raise InputError(
            f"distance = {distance:g} m: at {speed:g} m/s the wind is at the rotor when it is read"
        )
    rotor_part, cross, own = reading_spectra(described, blocked, speed, rotor.hub_height, rotor.tip_radius)
    coherence = np.abs(cross[:, gate]) ** 2 / (rotor_part * own[:, gate, gate].real)
    coherence = np.clip(coherence, LEAST_COHERENCE, 1.0)
    there = np.interp(OMEGA, 2.0 * pi * BINS, coherence)
    return BoundLidar(plant, lead, plant.true.wind * (1.0 / there - 1.0))
