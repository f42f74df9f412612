"""Slow, obvious twin of fowt_env/weather/excitation.py and second_order.py: sums of one term per line.

body: a descriptions.potential_flow.PotentialFlow whose frequencies and headings cover the waves'.
"""

import numpy as np
from scipy.interpolate import RegularGridInterpolator


def excitation(body, omega, heading):
    """(6,) complex force per metre of one wave."""
    axes = body.excitation_omega, body.heading
    return RegularGridInterpolator(axes, body.excitation)((omega, heading))


def first_order(t, body, waves):
    """(6,) force on the undisplaced body."""
    ramp = min(t / waves.ramp, 1.0) if waves.ramp > 0.0 else 1.0
    total = np.zeros(6)
    for j, omega in enumerate(waves.omega):
        heading = np.arctan2(waves.sin_heading[j], waves.cos_heading[j])
        wave = waves.amplitude[j] * np.exp(1j * (omega * t - waves.phase[j]))
        total += (wave * excitation(body, omega, heading)).real
    return ramp * total


def difference_pairs(body, waves):
    """[(omega_i - omega_j, (6,) complex a_i a_j* Q_ij)] of all pairs of waves."""
    qtf, pairs = body.difference_qtf, []
    for i, first in enumerate(waves.omega):
        for j, second in enumerate(waves.omega):
            one = np.arctan2(waves.sin_heading[i], waves.cos_heading[i])
            other = np.arctan2(waves.sin_heading[j], waves.cos_heading[j])
            row = np.argmin(np.abs(qtf.heading - [one, other]).sum(axis=1))
            value = RegularGridInterpolator((qtf.omega, qtf.omega), qtf.value[row])((first, second))
            phase = np.exp(-1j * (waves.phase[i] - waves.phase[j]))
            pairs.append((first - second, waves.amplitude[i] * waves.amplitude[j] * phase * value))
    return pairs


def sum_pairs(body, waves):
    """[(omega_i + omega_j, (6,) complex a_i a_j Q_ij)] of all pairs of waves."""
    qtf, pairs = body.sum_qtf, []
    for i, first in enumerate(waves.omega):
        for j, second in enumerate(waves.omega):
            one = np.arctan2(waves.sin_heading[i], waves.cos_heading[i])
            other = np.arctan2(waves.sin_heading[j], waves.cos_heading[j])
            row = np.argmin(np.abs(qtf.heading - [one, other]).sum(axis=1))
            value = RegularGridInterpolator((qtf.omega, qtf.omega), qtf.value[row])((first, second))
            phase = np.exp(-1j * (waves.phase[i] + waves.phase[j]))
            pairs.append((first + second, waves.amplitude[i] * waves.amplitude[j] * phase * value))
    return pairs


def newman_pairs(body, waves):
    """The same with sqrt(Q_ii Q_jj) for Q_ij of one heading, of its sign where both have one, and else 0."""
    qtf, pairs, own = body.difference_qtf, [], []
    heading = np.arctan2(waves.sin_heading, waves.cos_heading)
    for omega, angle in zip(waves.omega, heading, strict=True):
        row = np.argmin(np.abs(qtf.heading - angle).sum(axis=1))
        own.append(RegularGridInterpolator((qtf.omega, qtf.omega), qtf.value[row])((omega, omega)).real)
    for i, first in enumerate(waves.omega):
        for j, second in enumerate(waves.omega):
            both = (own[i] * own[j] > 0.0) & np.isclose(heading[i], heading[j])
            like = np.where(both, np.sign(own[i]) * np.sqrt(np.abs(own[i] * own[j])), 0.0)
            phase = np.exp(-1j * (waves.phase[i] - waves.phase[j]))
            pairs.append((first - second, waves.amplitude[i] * waves.amplitude[j] * phase * like))
    return pairs


def second_order(t, pairs, cutoff=np.inf):
    """(6,) force of pairs whose difference is below the cutoff."""
    return sum((value * np.exp(1j * omega * t)).real for omega, value in pairs if abs(omega) <= cutoff)
