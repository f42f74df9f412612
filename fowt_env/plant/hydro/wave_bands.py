"""Computes wave kinematics of a long-crested sea by a few wave numbers (theory.md, 5.4).

1. A wave field of one heading is analytic: with zeta = Z' + i xi (stretched height, distance along the
   heading), u + i w = sum v_j z_j exp(k_j zeta), z_j = exp(i P_j) at a reference point.
2. exp(k zeta) is smooth in log k at every depth, so each component is distributed, by Lagrange weights, to
   the BAND nearest of a few fixed wave numbers K_m, half an octave apart: 300 components become 18.
3. K_m and K_{m+2} differ by a factor 2: exp(K_{m+2} zeta) is the square of exp(K_m zeta).

Phasors are evaluated from time and position at each call, by a vectorised polynomial: the load has no memory.
Every section is cut at the instantaneous surface. Errors against the plain sum, rms over the rms of a load,
Hs 7.5 m, Tp 10 s: 2e-4 or less to 10 deg of tilt (BAND 4: 1e-3), 5e-3 at 30 deg.
"""

from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.vector_sums import SUM_LANES, crossed_sums, lane_dot
from fowt_env.plant.hydro.diffraction import TERMS, coefficient_series
from fowt_env.plant.hydro.strip_quadrature import (
    AI,
    AR,
    BI,
    BLOCK,
    BOTTOM,
    BR,
    D0,
    D1,
    DU,
    DW,
    N_ROWS,
    N_TABLE,
    TOP,
    P,
    U,
    W,
    Z,
    aligned,
)
from fowt_env.plant.hydro.waves import elevation, ramp_factor

BAND = 6  # wave numbers K that share one component; 4: 1e-3, 6: 1e-4, 8: 4e-5 of one component
RATIO = sqrt(2.0)  # of neighbouring K; the squaring chains need a square root of 2
EXTRA = 1  # K outside the shortest and the longest component, so that interpolation is not one-sided there
START = 0.06  # largest |K zeta| at which a squaring chain starts; exp(5) then errs by 1e-8
REFLECTION_REACH = 12.0  # 2 K (depth below the keel) above which the seabed's reflection (6e-6) is neglected
REACH = 1.5  # largest k xi of the cubic expansion of the surface about the reference point

# rows of WaveBands.component: k / 2 pi, omega / 2 pi, phase / 2 pi
WAVE_TURNS, RATE_TURNS, TURN = range(3)
# rows of WaveBands.band: components FIRST <= j < LAST (multiples of 8) contribute to K_m; weight offset
FIRST, LAST, OFFSET = range(3)
# rows of WaveBands.number: K; rho / K; from rates to elevation; exp(-2 K h), the seabed's reflection
WAVE_NUMBER, PRESSURE, HEIGHT, REFLECTION = range(4)
# rows of the compressed wave field
VR, VI, GR, GI, N_FIELD = range(5)


class WaveBands(NamedTuple):
    """Holds a sea of one heading in the form of the squaring chains; only component[TURN] is random."""

    component: np.ndarray  # (3, n) rows WAVE_TURNS to TURN; n padded with zeros to a multiple of 8
    band: np.ndarray  # (3, M) int64, rows FIRST to OFFSET
    weight: np.ndarray  # (2, sum of bands) Lagrange weight times a omega / (1 - exp(-2 k h)); and omega
    number: np.ndarray  # (4, M) rows WAVE_NUMBER to REFLECTION; M even
    n_reflected: int  # K whose reflection from the seabed reaches the keel, even
    lead: int  # squarings of the chains' start, in addition to four, to K_0
    cos_heading: float
    sin_heading: float
    ramp: float
    reach: float  # m, see REACH


class BandDiffraction(NamedTuple):
    """Holds the inertia coefficient over 1 + C_A (diffraction.py) of every K at every node; 1 at the keel."""

    series: np.ndarray  # (blocks, M, 2 TERMS BLOCK): powers of z - centre, real parts first
    centre: np.ndarray  # (blocks, BLOCK) body z


class BandScratch(NamedTuple):
    """Holds the scratch of banded_strip_load; no entry persists between calls."""

    phasor: np.ndarray  # (2, n_components)
    field: np.ndarray  # (N_FIELD, M)
    nodes: np.ndarray  # (blocks, N_ROWS * BLOCK)


def can_use_bands(waves, strips):
    """Return whether build_wave_bands covers this sea: one heading, and nodes that stay below the surface.

    Without stretching up to the instantaneous surface, or stretched but cut at still water, nodes
    lie above Z' = 0, where a sum of short waves grows without bound: these two cases use the exact sum.
    """
    same = np.ptp(waves.cos_heading) == 0.0 and np.ptp(waves.sin_heading) == 0.0
    return bool(same) and strips.wheeler == strips.instantaneous_surface


def build_wave_bands(waves, strips):
    """Return the WaveBands of a Waves part for which can_use_bands is true."""
    k = waves.wave_number
    top = k[-1] * RATIO**EXTRA
    count = max(BAND, int(np.ceil(log(top / k[0]) / log(RATIO) - 1e-9)) + 1 + EXTRA)
    count += count % 2
    grid = top * RATIO ** np.arange(1.0 - count, 1.0)
    start, weights = _lagrange(k, grid)
    size = -(-k.size // 8) * 8
    dense = np.zeros((count, size))
    dense[(start[:, None] + np.arange(BAND)).T, np.arange(k.size)] = (weights * waves.velocity[:, None]).T
    rates = dense * padded(waves.omega, size)
    reached = [np.flatnonzero(row) for row in dense]
    first = [indices[0] // 8 * 8 if indices.size else 0 for indices in reached]
    last = [-(-(indices[-1] + 1) // 8) * 8 if indices.size else 0 for indices in reached]
    offset = np.concatenate([[0], np.cumsum(np.subtract(last, first))[:-1]])
    ends = list(zip(first, last, strict=True))
    weight = [
        np.concatenate([row[a:b] for row, (a, b) in zip(rows, ends, strict=True)]) for rows in (dense, rates)
    ]
    gravity = waves.omega[0] ** 2 / (k[0] * np.tanh(k[0] * waves.depth))
    reflection = np.exp(-2.0 * grid * waves.depth)
    n_reflected = int(np.sum(2.0 * grid * (waves.depth + strips.keel_z) < REFLECTION_REACH))
    longest = 1.3 * abs(strips.keel_z) * grid[1]
    return WaveBands(
        aligned([padded(a / (2.0 * pi), size) for a in (k, waves.omega, waves.phase % (2.0 * pi))]),
        np.ascontiguousarray([first, last, offset], dtype=np.int64),
        aligned(weight),
        aligned([grid, waves.density / grid, (1.0 + reflection) / (gravity * grid), reflection]),
        n_reflected + n_reflected % 2,
        max(0, int(np.ceil(np.log2(longest / START))) - 4),
        float(waves.cos_heading[0]),
        float(waves.sin_heading[0]),
        float(waves.ramp),
        float(REACH / k[-1]),
    )


def build_band_diffraction(bands, quadrature):
    """Return the BandDiffraction of WaveBands and StripQuadrature.

    The coefficient varies with ln K as smoothly as exp(K zeta) does, so the bands represent their product.
    """
    rows = quadrature.table.reshape(-1, N_TABLE, BLOCK).transpose(1, 0, 2).reshape(N_TABLE, -1)
    bottom, top = rows[BOTTOM], rows[TOP]
    lower, upper = rows[D0] + rows[D1] * bottom, rows[D0] + rows[D1] * top
    series = np.zeros((bands.number.shape[1], TERMS, bottom.size), dtype=complex)
    series[:, 0] = 1.0
    for n in range(quadrature.keel):
        section = bottom[n], top[n], lower[n], upper[n]
        series[:, :, n] = coefficient_series(bands.number[WAVE_NUMBER], *section)
        series[:, :, n] /= 1.0 + quadrature.added_mass_coefficient
    blocks = quadrature.table.shape[0]
    parts = np.concatenate([series.real, series.imag], axis=1).reshape(-1, 2 * TERMS, blocks, BLOCK)
    return BandDiffraction(
        aligned(parts.transpose(2, 0, 1, 3).reshape(blocks, -1, 2 * TERMS * BLOCK)),
        aligned((0.5 * (bottom + top)).reshape(blocks, BLOCK)),
    )


def padded(values, size):
    """Return the values padded with zeros to (size,)."""
    return np.concatenate([values, np.zeros(size - values.size)])


def _lagrange(k, grid):
    """Return (start, weights) of components: first grid index (n,), Lagrange weights (n, BAND) in log k."""
    at = np.log(k / grid[0]) / log(RATIO)
    start = np.clip(np.floor(at + 1e-9).astype(int) - (BAND // 2 - 1), 0, grid.size - BAND)
    local = at - start
    weights = np.ones((k.size, BAND))
    for i in range(BAND):
        for j in range(BAND):
            if i != j:
                weights[:, i] *= (local - j) / (i - j)
    return start, weights


def band_scratch(bands, quadrature):
    """Return the BandScratch of WaveBands (None: still water) and a StripQuadrature (None: exact strips)."""
    components = 0 if bands is None else bands.component.shape[1]
    numbers = 0 if bands is None else bands.number.shape[1]
    blocks = 0 if quadrature is None else quadrature.table.shape[0]
    return BandScratch(
        aligned(np.zeros((2, components))),
        np.zeros((N_FIELD, numbers)),
        aligned(np.zeros((blocks, N_ROWS * BLOCK))),
    )


@inlined_kernel
def _half_sine(r):
    """Return the sine of r, within [-pi/2, pi/2], by its Taylor polynomial."""
    q = r * r
    s = 1.0 / 6227020800.0
    s = -1.0 / 39916800.0 + q * s
    s = 1.0 / 362880.0 + q * s
    s = -1.0 / 5040.0 + q * s
    s = 1.0 / 120.0 + q * s
    s = -1.0 / 6.0 + q * s
    return r * (1.0 + q * s)


@kernel
def phasors(t, distance, component, cosine, sine):
    """Fill cosine and sine (n,) of the phase of every component at a distance along the heading.

    The phase is reduced in turns and halved, to [-pi/2, pi/2]; Taylor polynomials there are within
    1e-8. 0.13 microseconds for 300 components.
    """
    wave_turns, rate_turns, turn = component[WAVE_TURNS], component[RATE_TURNS], component[TURN]
    for j in range(turn.shape[0]):
        phase = wave_turns[j] * distance - rate_turns[j] * t + turn[j]
        r = pi * (phase - np.rint(phase))
        q, s = r * r, _half_sine(r)
        c = -1.0 / 87178291200.0
        c = 1.0 / 479001600.0 + q * c
        c = -1.0 / 3628800.0 + q * c
        c = 1.0 / 40320.0 + q * c
        c = -1.0 / 720.0 + q * c
        c = 1.0 / 24.0 + q * c
        c = 1.0 - q * (0.5 - q * c)
        cosine[j] = 1.0 - 2.0 * s * s
        sine[j] = 2.0 * s * c


@kernel
def cosines(t, component, cosine):
    """Fill cosine (n,) of the phase of every component at the origin, as phasors does to the last bit."""
    rate_turns, turn = component[RATE_TURNS], component[TURN]
    for j in range(turn.shape[0]):
        phase = turn[j] - rate_turns[j] * t
        s = _half_sine(pi * (phase - np.rint(phase)))
        cosine[j] = 1.0 - 2.0 * s * s


@kernel
def _component_sum(amplitude, cosine):
    """Return the sum of amplitude (n,) times the first n entries of cosine; the rest is padding."""
    n = amplitude.shape[0]
    whole = n - n % SUM_LANES
    total = lane_dot(amplitude, cosine, whole)
    for j in range(whole, n):
        total += amplitude[j] * cosine[j]
    return total


@kernel
def surface_elevation(t, waves, bands, scratch):
    """Return the surface elevation at the origin, m: by fast phasors where bands exist; 0 without waves."""
    if bands is None:
        return elevation(t, 0.0, 0.0, waves)
    if waves is None:
        return 0.0
    cosines(t, bands.component, scratch.phasor[0])
    return ramp_factor(t, bands.ramp) * _component_sum(waves.amplitude, scratch.phasor[0])


@kernel
def compress(scale, band, weight, number, cosine, sine, field):
    """Fill field (N_FIELD, M) with complex sums of the components' velocity and rate at each K, times scale.

    Returns the elevation at the reference point and its first three derivatives along the heading.
    """
    e0 = e1 = e2 = e3 = 0.0
    for m in range(band.shape[1]):
        a, b = band[FIRST, m], band[OFFSET, m]
        n = band[LAST, m] - a
        vr, vi, gr, gi = crossed_sums(
            weight[0, b : b + n], weight[1, b : b + n], cosine[a : a + n], sine[a : a + n], n
        )
        field[VR, m] = scale * vr
        field[VI, m] = scale * vi
        field[GR, m] = scale * gr
        field[GI, m] = scale * gi
        k = number[WAVE_NUMBER, m]
        height = scale * number[HEIGHT, m]
        e0 += height * gr
        e1 -= height * k * gi
        e2 -= height * k * k * gr
        e3 += height * k * k * k * gi
    return e0, e1, e2, e3


@kernel
def small_exp(x, y):
    """Return exp(16 (x + i y)) as (real, imaginary), by a Taylor series of order 5, |x + i y| below START."""
    er, ei = 1.0 + x / 5.0, y / 5.0
    er, ei = 1.0 + (x * er - y * ei) / 4.0, (x * ei + y * er) / 4.0
    er, ei = 1.0 + (x * er - y * ei) / 3.0, (x * ei + y * er) / 3.0
    er, ei = 1.0 + (x * er - y * ei) / 2.0, (x * ei + y * er) / 2.0
    er, ei = 1.0 + (x * er - y * ei), x * ei + y * er
    er, ei = er * er - ei * ei, 2.0 * er * ei
    er, ei = er * er - ei * ei, 2.0 * er * ei
    er, ei = er * er - ei * ei, 2.0 * er * ei
    return er * er - ei * ei, 2.0 * er * ei


@kernel
def chain_start(pose_z, rise, sway, z_ref, stretch, drop, scale, lead, node):
    """Fill the start of both squaring chains of a block: exp(K zeta) for K_0 and K_1, with Z' below 0.

    scale: K_0 / 2^(lead + 4), see small_exp.
    """
    for n in range(BLOCK):
        z = node[Z * BLOCK + n]
        x = scale * min(stretch * (pose_z + rise * z) - drop, 0.0)
        y = scale * sway * (z - z_ref)
        node[AR * BLOCK + n], node[AI * BLOCK + n] = small_exp(x, y)
        node[BR * BLOCK + n], node[BI * BLOCK + n] = small_exp(RATIO * x, RATIO * y)
    for _ in range(lead):
        for n in range(BLOCK):
            ar, ai = node[AR * BLOCK + n], node[AI * BLOCK + n]
            br, bi = node[BR * BLOCK + n], node[BI * BLOCK + n]
            node[AR * BLOCK + n], node[AI * BLOCK + n] = ar * ar - ai * ai, 2.0 * ar * ai
            node[BR * BLOCK + n], node[BI * BLOCK + n] = br * br - bi * bi, 2.0 * br * bi


@kernel
def wave_terms(vr, vi, gr, gi, er, ei):
    """Return (u, w, u', w', rate) of one K: u + i w = v e, u' + i w' = -i g e, pressure = rho / K rate."""
    rate, turn = gr * er - gi * ei, gr * ei + gi * er
    return vr * er - vi * ei, vr * ei + vi * er, turn, -rate, rate


@kernel
def node_factor(diffraction, block, m, n, z):
    """Return the (real, imaginary) inertia coefficient over 1 + C_A of K_m at body z of a node."""
    series = diffraction.series
    x = z - diffraction.centre[block, n]
    re, im = 0.0, 0.0
    for i in range(TERMS - 1, -1, -1):
        re = series[block, m, i * BLOCK + n] + x * re
        im = series[block, m, (TERMS + i) * BLOCK + n] + x * im
    return re, im


@kernel
def add_reflection(number, field, m, node, diffraction, block):
    """Add the seabed's reflection of K_m and K_{m+1}: conjugate amplitudes times exp(-K (2 h + zeta))."""
    vr, vi, gr, gi = field[VR, m], field[VI, m], field[GR, m], field[GI, m]
    hr, hi, qr, qi = field[VR, m + 1], field[VI, m + 1], field[GR, m + 1], field[GI, m + 1]
    pa, pb = number[PRESSURE, m], number[PRESSURE, m + 1]
    ea, eb = number[REFLECTION, m], number[REFLECTION, m + 1]
    for n in range(BLOCK):
        ar, ai = node[AR * BLOCK + n], node[AI * BLOCK + n]
        br, bi = node[BR * BLOCK + n], node[BI * BLOCK + n]
        sa, sb = ea / (ar * ar + ai * ai), eb / (br * br + bi * bi)
        ua, wa, da, za, ra = wave_terms(vr, -vi, gr, -gi, sa * ar, -sa * ai)
        ub, wb, db, zb, rb = wave_terms(hr, -hi, qr, -qi, sb * br, -sb * bi)
        node[U * BLOCK + n] += ua + ub
        node[W * BLOCK + n] += wa + wb
        if diffraction is not None:
            # conjugate factor, as the amplitudes are conjugate
            fr, fi = node_factor(diffraction, block, m, n, node[Z * BLOCK + n])
            da, za = da * fr + za * fi, za * fr - da * fi
            fr, fi = node_factor(diffraction, block, m + 1, n, node[Z * BLOCK + n])
            db, zb = db * fr + zb * fi, zb * fr - db * fi
        node[DU * BLOCK + n] -= da + db
        node[DW * BLOCK + n] -= za + zb
        node[P * BLOCK + n] += pa * ra + pb * rb


@kernel
def chain_sums(number, n_reflected, field, node, diffraction, block):
    """Fill water velocity, acceleration and pressure at a block's nodes: two K at a time, then square.

    diffraction: BandDiffraction, with complex factors of the accelerations, or None.
    """
    for n in range(BLOCK):
        node[U * BLOCK + n] = 0.0
        node[W * BLOCK + n] = 0.0
        node[DU * BLOCK + n] = 0.0
        node[DW * BLOCK + n] = 0.0
        node[P * BLOCK + n] = 0.0
    for m in range(0, number.shape[1], 2):
        if m < n_reflected:
            add_reflection(number, field, m, node, diffraction, block)
        vr, vi, gr, gi = field[VR, m], field[VI, m], field[GR, m], field[GI, m]
        hr, hi, qr, qi = field[VR, m + 1], field[VI, m + 1], field[GR, m + 1], field[GI, m + 1]
        pa, pb = number[PRESSURE, m], number[PRESSURE, m + 1]
        for n in range(BLOCK):
            ar, ai = node[AR * BLOCK + n], node[AI * BLOCK + n]
            br, bi = node[BR * BLOCK + n], node[BI * BLOCK + n]
            ua, wa, da, za, ra = wave_terms(vr, vi, gr, gi, ar, ai)
            ub, wb, db, zb, rb = wave_terms(hr, hi, qr, qi, br, bi)
            if diffraction is not None:
                fr, fi = node_factor(diffraction, block, m, n, node[Z * BLOCK + n])
                da, za = da * fr - za * fi, za * fr + da * fi
                fr, fi = node_factor(diffraction, block, m + 1, n, node[Z * BLOCK + n])
                db, zb = db * fr - zb * fi, zb * fr + db * fi
            node[U * BLOCK + n] += ua + ub
            node[W * BLOCK + n] += wa + wb
            node[DU * BLOCK + n] += da + db
            node[DW * BLOCK + n] += za + zb
            node[P * BLOCK + n] += pa * ra + pb * rb
            node[AR * BLOCK + n], node[AI * BLOCK + n] = ar * ar - ai * ai, 2.0 * ar * ai
            node[BR * BLOCK + n], node[BI * BLOCK + n] = br * br - bi * bi, 2.0 * br * bi
