"""Builds the waves of a scene as a sum of components, from spectra and random phases.

A component propagates towards its heading: phase P = k (X cos b + Y sin b) - omega t + e, elevation a cos P
(theory.md, 5.4).
"""

from math import pi

import numpy as np

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.errors import InputError
from fowt_env.plant.hydro.waves import Waves

FLAT_PERIOD = 10.0  # s, of the zero-height component that represents still water
RECORDED_PERIODS = (2.0, 40.0)  # s, of the components that represent a recorded elevation
MOST_COMPONENTS = 1_000_000  # limit: more take minutes and gigabytes


def wave_number(omega, depth, gravity):
    """Return the wave numbers k (n,) that solve omega^2 = g k tanh(k depth), to machine precision."""
    omega = np.asarray(omega, dtype=np.float64)
    deep = omega**2 / gravity
    # Guo's explicit approximation is within 1 %; Newton's method then converges in 3-4 steps
    x = omega * np.sqrt(depth / gravity)
    k = x**2 / depth * (1.0 - np.exp(-(x**2.5))) ** -0.4
    for _ in range(20):
        t = np.tanh(k * depth)
        step = (k * t - deep) / (t + k * depth * (1.0 - t * t))
        k = k - step
        if np.all(np.abs(step) <= 1e-15 * k):
            break
    return k


def jonswap(omega, significant_height, peak_period, gamma):
    """Return the one-sided JONSWAP spectrum, m2 s/rad (gamma = 1: Pierson-Moskowitz); theory.md, 5.4."""
    omega = np.asarray(omega, dtype=np.float64)
    peak = 2.0 * pi / peak_period
    sigma = np.where(omega <= peak, 0.07, 0.09)
    shape = gamma ** np.exp(-((omega - peak) ** 2) / (2.0 * sigma**2 * peak**2))
    norm = 1.0 - 0.287 * np.log(gamma)
    short = np.exp(-1.25 * (peak / omega) ** 4)
    return norm * 5.0 / 16.0 * significant_height**2 * peak**4 * omega**-5.0 * short * shape


def build_waves(sea, *, depth, density, gravity, seed, duration, components=None):
    """Return the Waves of a descriptions.platform.SeaState; None for still water.

    components: number of components of a spectrum; default (at least 200) one per harmonic of 1/duration, so
    that the record does not repeat during the run, over the band that contains 99.8 % of the energy.
    """
    if sea is None or sea.kind == "still":
        return None
    if sea.kind == "regular":
        values = (2.0 * pi / sea.T, sea.H / 2.0, sea.phase, np.radians(sea.heading))
        omega, amplitude, phase, heading = (np.array([value]) for value in values)
    elif sea.kind == "components":
        omega = np.asarray(sea.omega, dtype=np.float64)
        amplitude = np.asarray(sea.amplitude, dtype=np.float64)
        phase = np.asarray(sea.phase, dtype=np.float64)
        heading = np.radians(np.broadcast_to(np.asarray(sea.heading, dtype=np.float64), omega.shape))
    else:
        gamma = sea.gamma if sea.kind == "jonswap" else 1.0
        omega, amplitude = _spectral_components(sea.Hs, sea.Tp, gamma, duration, components)
        phase = np.random.default_rng(np.random.SeedSequence([seed, 2])).uniform(0.0, 2.0 * pi, omega.size)
        heading = np.full(omega.size, np.radians(sea.heading))
    if not np.any(amplitude > 0.0):
        return None
    k = wave_number(omega, depth, gravity)
    random = sea.kind not in ("regular", "components")
    return _pack(omega, k, amplitude, phase, heading, depth, density, sea.ramp, random)


def recorded_sea(time, elevation, heading=0.0):
    """Return the sea state of kind "components" whose elevation at the origin is that of a record.

    time (n,) s from 0, equally spaced; elevation (n,) m; heading deg. The components are the harmonics of the
    record with periods of RECORDED_PERIODS: slower changes are tides or second-order waves.
    """
    spacing = (time[-1] - time[0]) / (len(time) - 1)
    omega = 2.0 * pi * np.fft.rfftfreq(len(time), spacing)
    harmonics = np.fft.rfft(elevation) * 2.0 / len(time)
    shortest, longest = RECORDED_PERIODS
    chosen = (omega >= 2.0 * pi / longest) & (omega <= min(2.0 * pi / shortest, 0.99 * pi / spacing))
    harmonics = harmonics[chosen]
    waves = {"omega": omega[chosen], "amplitude": np.abs(harmonics), "phase": -np.angle(harmonics)}
    return {"kind": "components", "heading": heading} | {key: value.tolist() for key, value in waves.items()}


def flat_waves(*, depth, density, gravity):
    """Return Waves of one component of zero height: still water in a scene whose kernels sum waves."""
    omega, none = np.array([2.0 * pi / FLAT_PERIOD]), np.zeros(1)
    k = wave_number(omega, depth, gravity)
    return _pack(omega, k, none, none, none, depth, density, 0.0, False)


def is_flat(waves):
    """Return whether Waves, or None, represent still water."""
    return waves is None or not waves.amplitude.any()


def _pack(omega, k, amplitude, phase, heading, depth, density, ramp, random):
    """Return Waves of plain arrays, sorted by wave number so that loops over the waves may stop early."""
    order = np.argsort(k, kind="stable")
    velocity = amplitude * omega / -np.expm1(-2.0 * k * depth)
    arrays = (omega, k, amplitude, phase, np.cos(heading), np.sin(heading), velocity)
    packed = [np.ascontiguousarray(np.asarray(a, dtype=np.float64)[order]) for a in arrays]
    return Waves(*packed, float(depth), float(density), float(ramp), bool(random))


def _spectral_components(significant_height, peak_period, gamma, duration, components):
    """Return (omega, amplitude) of a spectrum, renormalised so that 4 sqrt(m0) = Hs.

    The band is 0.5 to 5 peak frequencies; the 0.1 % (gamma 3.3) to 0.2 % (gamma 1) of the variance outside
    are restored by the renormalisation.
    """
    if significant_height == 0.0:
        return np.array([2.0 * pi / peak_period]), np.zeros(1)
    peak = 2.0 * pi / peak_period
    low, high = 0.5 * peak, 5.0 * peak
    if components is None:
        components = max(200, int(np.ceil((high - low) * duration / (2.0 * pi))))
    check_whole_number("wave_components", components, 1)
    if components > MOST_COMPONENTS:
        raise InputError(
            f"sea: Tp = {peak_period:g} s over duration = {duration:g} s needs {components} wave components,"
            f" more than {MOST_COMPONENTS}; set wave_components, a longer Tp or a shorter duration"
        )
    step = (high - low) / components
    omega = low + step * (np.arange(components) + 0.5)
    amplitude = np.sqrt(2.0 * jonswap(omega, significant_height, peak_period, gamma) * step)
    amplitude *= significant_height / (4.0 * np.sqrt(np.sum(amplitude**2) / 2.0))
    return omega, amplitude
