"""Strip loads of a long-crested sea in under a microsecond, close to those of loads/morison.py.

Three ideas replace the sum of every component at every node (theory.md, 5.4):

1. A wave field of one heading is analytic: with zeta = Z' + i xi (stretched height, horizontal
   distance along the heading from a reference point), u + i w = sum v_j z_j exp(k_j zeta), where
   z_j = exp(i P_j) at the reference point. A tilted axis is a straight line in the complex plane.
2. As a function of log k, exp(k zeta) is smooth on the same scale at every depth. So each component
   is handed to the BAND nearest of a few fixed wave numbers K_m, half an octave apart, with the
   weights of Lagrange interpolation in log k: 300 components become 18 in everything that follows.
3. K_m and K_{m+2} differ by a factor 2: exp(K_{m+2} zeta) is the square of exp(K_m zeta).

Phasors are computed anew from time and place, by a polynomial that runs in vector registers. So the
load is stateless: no drift, no step length to agree on, nothing to save with a state. Every section
is cut at the instantaneous surface, whichever section that meets.

Errors against the plain sum, rms over the rms of a load, JONSWAP Hs 7.5 m Tp 10 s: 2e-4 or less
to 10 deg of tilt (BAND 4: 1e-3), 5e-3 at 30 deg. Time for 315 components on one core of a cloud
machine: 0.79 microseconds, of which phasors 0.16, sums 0.27, nodes 0.14, loads 0.05, the rest handing
over arguments.
"""

from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.vector_sums import SUM_LANES, crossed_sums, lane_dot
from fowt_env.plant.hydro.diffraction import TERMS, coefficient_series
from fowt_env.plant.hydro.morison import StripLoad, current_at
from fowt_env.plant.hydro.waves import elevation, ramp_factor
from fowt_env.plant.state import NO_LOAD, Wrench, add

BAND = 6  # wave numbers K that share one component; 4: 1e-3, 6: 1e-4, 8: 4e-5 of one component
RATIO = sqrt(2.0)  # of neighbouring K; the squaring chains need a square root of 2
EXTRA = 1  # K beyond the shortest and the longest component, so that interpolation is not one-sided there
START = 0.06  # largest |K zeta| at which a squaring chain starts; exp(5) then errs by 1e-8
ECHO = 12.0  # 2 K (depth below the keel) beyond which the seabed's reflection (6e-6) is left out
REACH = 1.5  # largest k xi of the cubic expansion of the surface about the reference point
LANES = 16  # nodes computed side by side; a hull with more of them takes several blocks
SURFACE_NODES = 4  # Gauss nodes of the surface section
# Gauss nodes of a section below: this + this * ln(depth ratio); 3 of the taper, 8 of the cylinder of OC3
NODES_AT_LEAST, NODES_PER_LOG = -2, 4.2
# in still water a node costs next to nothing, and a decay's drag may turn its sign along the hull
STILL_REFINEMENT = 2

# rows of a block of Lanes.table: the section's ends (body z), the node's share of the wet height
# above the bottom, its weight's share of it, and its diameter D0 + D1 z
BOTTOM, TOP, SHARE, SPREAD, D0, D1, N_TABLE = range(7)
# rows of FastWaves.component: k / 2 pi, omega / 2 pi, phase / 2 pi
WAVE_TURNS, RATE_TURNS, TURN = range(3)
# rows of FastWaves.band: components FIRST <= j < LAST (multiples of 8) reach K_m; where their weights begin
FIRST, LAST, OFFSET = range(3)
# rows of FastWaves.number: K; rho / K; from rates to elevation; exp(-2 K h), the seabed's reflection
WAVE_NUMBER, PRESSURE, HEIGHT, ECHO_FACTOR = range(4)
# rows of a block of lanes
Z, WEIGHT, AR, AI, BR, BI, U, W, DU, DW, P, CU, CV, N_ROWS = range(14)
# rows of the compressed wave field
VR, VI, GR, GI, N_FIELD = range(5)


class Lanes(NamedTuple):
    """Quadrature nodes of the hull, LANES to a block; unused ones have no weight.

    Few arrays on purpose: a call hands over seven words for each of them.
    """

    table: np.ndarray  # (blocks, N_TABLE * LANES), rows BOTTOM to D1 (below) one after the other
    keel: int  # lane that holds the keel, without weight
    density: float
    added_mass_coefficient: float
    drag_coefficient: float
    heave_added_mass: float  # A33, kg
    axial_drag: float  # 0.5 rho C_Dz A of the keel, kg/m
    keel_z: float
    keel_area: float
    top_z: float
    depth: float
    instantaneous_position: bool
    instantaneous_surface: bool
    wheeler: bool


class FastWaves(NamedTuple):
    """A sea of one heading, prepared for the squaring chains; component[TURN] alone is random."""

    component: np.ndarray  # (3, n) rows WAVE_TURNS to TURN; n padded with zeros to a multiple of 8
    band: np.ndarray  # (3, M) int64, rows FIRST to OFFSET
    weight: np.ndarray  # (2, sum of bands) Lagrange weight times a omega / (1 - exp(-2 k h)); and omega
    number: np.ndarray  # (4, M) rows WAVE_NUMBER to ECHO_FACTOR; M even
    n_echo: int  # K whose reflection from the seabed reaches the keel, even
    lead: int  # squarings of the chains' start, beyond four, to reach K_0
    cos_heading: float
    sin_heading: float
    ramp: float
    reach: float  # m, see REACH


class LaneDiffraction(NamedTuple):
    """Coefficient over 1 + C_A (loads/diffraction.py) of every K at every lane; 1 at the keel's."""

    series: np.ndarray  # (blocks, M, 2 TERMS LANES): powers of z - centre, real parts first
    centre: np.ndarray  # (blocks, LANES) body z


class FastScratch(NamedTuple):
    """Scratch of fast_morison_load; nothing in it carries over between calls."""

    phasor: np.ndarray  # (2, n_components)
    field: np.ndarray  # (N_FIELD, M)
    lanes: np.ndarray  # (blocks, N_ROWS * LANES)


def build_lanes(hull, strips, refinement=1):
    """Lanes of a hull (description.Hull) with the constants of its exact twin, a Strips part.

    refinement: times as many nodes below the surface section.
    """
    columns = []
    sections = list(zip(hull.z[:-1], hull.z[1:], hull.diameter[:-1], hull.diameter[1:], strict=True))[::-1]
    for number, (bottom, top, lower, upper) in enumerate(sections):
        if number == 0:
            share, spread = _gauss(SURFACE_NODES)
            lower = upper  # a cylinder: the water plane of loads/hydrostatics.py cuts it
        else:
            # Gauss in the logarithm of depth: wave motion at depth D varies over D
            stretch = log(bottom / top)
            at, weight = _gauss(refinement * (NODES_AT_LEAST + round(NODES_PER_LOG * stretch)))
            z = top * np.exp(stretch * at)
            share, spread = (z - bottom) / (top - bottom), -weight * z * stretch / (top - bottom)
        slope = (upper - lower) / (top - bottom)
        for a, b in zip(share, spread, strict=True):
            columns.append((bottom, top, a, b, lower - slope * bottom, slope))
    keel = len(columns)
    count = -(-(keel + 1) // LANES) * LANES
    columns += [(hull.z[0], hull.z[1], 0.0, 0.0, hull.diameter[0], 0.0)] * (count - keel)
    table = np.array(columns).T.reshape(N_TABLE, -1, LANES).transpose(1, 0, 2)
    return Lanes(
        _aligned(table.reshape(-1, N_TABLE * LANES)),
        keel,
        strips.density,
        strips.added_mass_coefficient,
        strips.drag_coefficient,
        strips.heave_added_mass,
        0.5 * strips.density * strips.axial_drag_coefficient * strips.keel_area,
        strips.keel_z,
        strips.keel_area,
        strips.top_z,
        strips.depth,
        strips.instantaneous_position,
        strips.instantaneous_surface,
        strips.wheeler,
    )


def _gauss(n):
    """Gauss-Legendre nodes and weights (n,) on [0, 1], from 0 on."""
    x, w = np.polynomial.legendre.leggauss(n)
    return 0.5 * (1.0 + x), 0.5 * w


def can_be_fast(waves, strips):
    """Whether build_fast_waves covers this sea: one heading, and nodes that stay below the surface.

    Without stretching up to the instantaneous surface, or stretched but cut at still water, nodes
    lie above Z' = 0, where a sum of short waves grows without bound: those two keep to the exact path.
    """
    same = np.ptp(waves.cos_heading) == 0.0 and np.ptp(waves.sin_heading) == 0.0
    return bool(same) and strips.wheeler == strips.instantaneous_surface


def build_fast_waves(waves, strips):
    """FastWaves of a Waves part that can_be_fast."""
    k = waves.wave_number
    top = k[-1] * RATIO**EXTRA
    count = max(BAND, int(np.ceil(log(top / k[0]) / log(RATIO) - 1e-9)) + 1 + EXTRA)
    count += count % 2
    grid = top * RATIO ** np.arange(1.0 - count, 1.0)
    start, weights = _lagrange(k, grid)
    size = -(-k.size // 8) * 8
    dense = np.zeros((count, size))
    dense[(start[:, None] + np.arange(BAND)).T, np.arange(k.size)] = (weights * waves.velocity[:, None]).T
    rates = dense * _padded(waves.omega, size)
    reached = [np.flatnonzero(row) for row in dense]
    first = [own[0] // 8 * 8 if own.size else 0 for own in reached]
    last = [-(-(own[-1] + 1) // 8) * 8 if own.size else 0 for own in reached]
    offset = np.concatenate([[0], np.cumsum(np.subtract(last, first))[:-1]])
    ends = list(zip(first, last, strict=True))
    weight = [
        np.concatenate([row[a:b] for row, (a, b) in zip(rows, ends, strict=True)]) for rows in (dense, rates)
    ]
    gravity = waves.omega[0] ** 2 / (k[0] * np.tanh(k[0] * waves.depth))
    echo = np.exp(-2.0 * grid * waves.depth)
    n_echo = int(np.sum(2.0 * grid * (waves.depth + strips.keel_z) < ECHO))
    longest = 1.3 * abs(strips.keel_z) * grid[1]
    return FastWaves(
        _aligned([_padded(a / (2.0 * pi), size) for a in (k, waves.omega, waves.phase % (2.0 * pi))]),
        np.ascontiguousarray([first, last, offset], dtype=np.int64),
        _aligned(weight),
        _aligned([grid, waves.density / grid, (1.0 + echo) / (gravity * grid), echo]),
        n_echo + n_echo % 2,
        max(0, int(np.ceil(np.log2(longest / START))) - 4),
        float(waves.cos_heading[0]),
        float(waves.sin_heading[0]),
        float(waves.ramp),
        float(REACH / k[-1]),
    )


def build_lane_diffraction(sea, lanes):
    """LaneDiffraction of FastWaves and Lanes.

    The coefficient varies with ln K as smoothly as exp(K zeta) does, so the bands carry their product.
    """
    rows = lanes.table.reshape(-1, N_TABLE, LANES).transpose(1, 0, 2).reshape(N_TABLE, -1)
    bottom, top = rows[BOTTOM], rows[TOP]
    lower, upper = rows[D0] + rows[D1] * bottom, rows[D0] + rows[D1] * top
    series = np.zeros((sea.number.shape[1], TERMS, bottom.size), dtype=complex)
    series[:, 0] = 1.0
    for n in range(lanes.keel):
        section = bottom[n], top[n], lower[n], upper[n]
        series[:, :, n] = coefficient_series(sea.number[WAVE_NUMBER], *section)
        series[:, :, n] /= 1.0 + lanes.added_mass_coefficient
    blocks = lanes.table.shape[0]
    parts = np.concatenate([series.real, series.imag], axis=1).reshape(-1, 2 * TERMS, blocks, LANES)
    return LaneDiffraction(
        _aligned(parts.transpose(2, 0, 1, 3).reshape(blocks, -1, 2 * TERMS * LANES)),
        _aligned((0.5 * (bottom + top)).reshape(blocks, LANES)),
    )


def _padded(values, size):
    """(size,) array that begins with the values and goes on with zeros."""
    return np.concatenate([values, np.zeros(size - values.size)])


def _aligned(values):
    """Copy of a float64 array that begins on a 64-byte boundary, where vector loads are fastest."""
    values = np.asarray(values, dtype=np.float64)
    raw = np.empty(values.size + 8)
    start = (-raw.ctypes.data // 8) % 8
    copy = raw[start : start + values.size].reshape(values.shape)
    copy[...] = values
    return copy


def _lagrange(k, grid):
    """(start, weights): each component's first grid index (n,) and its (n, BAND) weights in log k."""
    at = np.log(k / grid[0]) / log(RATIO)
    start = np.clip(np.floor(at + 1e-9).astype(int) - (BAND // 2 - 1), 0, grid.size - BAND)
    local = at - start
    weights = np.ones((k.size, BAND))
    for i in range(BAND):
        for j in range(BAND):
            if i != j:
                weights[:, i] *= (local - j) / (i - j)
    return start, weights


def fast_scratch(sea, lanes):
    """Scratch for a FastWaves (None: still water) and Lanes (None: the exact path, which needs none)."""
    components = 0 if sea is None else sea.component.shape[1]
    numbers = 0 if sea is None else sea.number.shape[1]
    blocks = 0 if lanes is None else lanes.table.shape[0]
    return FastScratch(
        _aligned(np.zeros((2, components))),
        np.zeros((N_FIELD, numbers)),
        _aligned(np.zeros((blocks, N_ROWS * LANES))),
    )


@kernel
def phasors(t, distance, component, cosine, sine):
    """Fill cosine and sine (n,) of every component's phase at a distance along the heading.

    The phase is reduced in turns and halved, to [-pi/2, pi/2]; Taylor polynomials there are within
    1e-8. 0.13 microseconds for 300 components.
    """
    wave_turns, rate_turns, turn = component[WAVE_TURNS], component[RATE_TURNS], component[TURN]
    for j in range(turn.shape[0]):
        phase = wave_turns[j] * distance - rate_turns[j] * t + turn[j]
        r = pi * (phase - np.rint(phase))
        q = r * r
        s = 1.0 / 6227020800.0
        s = -1.0 / 39916800.0 + q * s
        s = 1.0 / 362880.0 + q * s
        s = -1.0 / 5040.0 + q * s
        s = 1.0 / 120.0 + q * s
        s = -1.0 / 6.0 + q * s
        s = r * (1.0 + q * s)
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
def _component_sum(amplitude, cosine):
    """Sum of amplitude (n,) times cosine, whose padding beyond n is left out."""
    n = amplitude.shape[0]
    whole = n - n % SUM_LANES
    total = lane_dot(amplitude, cosine, whole)
    for j in range(whole, n):
        total += amplitude[j] * cosine[j]
    return total


@kernel
def surface_elevation(t, waves, sea, scratch):
    """Surface elevation at the origin, m: by the fast phasors where the scene has them; 0 without waves."""
    if sea is None:
        return elevation(t, 0.0, 0.0, waves)
    if waves is None:
        return 0.0
    phasors(t, 0.0, sea.component, scratch.phasor[0], scratch.phasor[1])
    return ramp_factor(t, sea.ramp) * _component_sum(waves.amplitude, scratch.phasor[0])


@kernel
def compress(scale, band, weight, number, cosine, sine, field):
    """Fill field (N_FIELD, M): complex sums of the components' velocity and rate at each K, times scale.

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
def fast_surface(pose, lanes, lean, reach, e0, e1, e2, e3):
    """(z_surf, eta) as morison.axis_surface, from the surface's Taylor series e0..e3 (see compress).

    lean: distance along the heading per metre of height.
    """
    if not lanes.instantaneous_position:
        return e0 if lanes.instantaneous_surface else 0.0, e0
    tilt = max(pose.r33, 0.1)
    if not lanes.instantaneous_surface:
        return -pose.z / tilt, e0
    eta = e0
    for _ in range(3):
        xi = min(max(lean * eta, -reach), reach)
        value = e0 + xi * (e1 + xi * (0.5 * e2 + xi * e3 / 6.0))
        slope = e1 + xi * (e2 + 0.5 * xi * e3)
        eta -= (eta - value) / max(1.0 - lean * slope, 0.3)
    return (eta - pose.z) / tilt, eta


@kernel
def small_exp(x, y):
    """exp(16 (x + i y)) as (real, imaginary), from Taylor's fifth power at |x + i y| below START."""
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
def chain_start(pose_z, rise, sway, z_ref, stretch, drop, scale, lead, lane):
    """Start both squaring chains of a block: exp(K zeta) for K_0 and K_1; Z' stays below 0.

    scale: K_0 / 2^(lead + 4), see small_exp.
    """
    for n in range(LANES):
        z = lane[Z * LANES + n]
        x = scale * min(stretch * (pose_z + rise * z) - drop, 0.0)
        y = scale * sway * (z - z_ref)
        lane[AR * LANES + n], lane[AI * LANES + n] = small_exp(x, y)
        lane[BR * LANES + n], lane[BI * LANES + n] = small_exp(RATIO * x, RATIO * y)
    for _ in range(lead):
        for n in range(LANES):
            ar, ai = lane[AR * LANES + n], lane[AI * LANES + n]
            br, bi = lane[BR * LANES + n], lane[BI * LANES + n]
            lane[AR * LANES + n], lane[AI * LANES + n] = ar * ar - ai * ai, 2.0 * ar * ai
            lane[BR * LANES + n], lane[BI * LANES + n] = br * br - bi * bi, 2.0 * br * bi


@kernel
def wave_terms(vr, vi, gr, gi, er, ei):
    """(u, w, u', w', rate) of one K: u + i w = v e, u' + i w' = -i g e, pressure = rho / K rate."""
    rate, turn = gr * er - gi * ei, gr * ei + gi * er
    return vr * er - vi * ei, vr * ei + vi * er, turn, -rate, rate


@kernel
def lane_factor(diffraction, block, m, n, z):
    """(real, imaginary) coefficient over 1 + C_A of K_m at body z of a lane."""
    series = diffraction.series
    x = z - diffraction.centre[block, n]
    re, im = 0.0, 0.0
    for i in range(TERMS - 1, -1, -1):
        re = series[block, m, i * LANES + n] + x * re
        im = series[block, m, (TERMS + i) * LANES + n] + x * im
    return re, im


@kernel
def add_echo(number, field, m, lane, diffraction, block):
    """Add the seabed's reflection of K_m and K_{m+1}: conjugate amplitudes times exp(-K (2 h + zeta))."""
    vr, vi, gr, gi = field[VR, m], field[VI, m], field[GR, m], field[GI, m]
    hr, hi, qr, qi = field[VR, m + 1], field[VI, m + 1], field[GR, m + 1], field[GI, m + 1]
    pa, pb = number[PRESSURE, m], number[PRESSURE, m + 1]
    ea, eb = number[ECHO_FACTOR, m], number[ECHO_FACTOR, m + 1]
    for n in range(LANES):
        ar, ai = lane[AR * LANES + n], lane[AI * LANES + n]
        br, bi = lane[BR * LANES + n], lane[BI * LANES + n]
        sa, sb = ea / (ar * ar + ai * ai), eb / (br * br + bi * bi)
        ua, wa, da, za, ra = wave_terms(vr, -vi, gr, -gi, sa * ar, -sa * ai)
        ub, wb, db, zb, rb = wave_terms(hr, -hi, qr, -qi, sb * br, -sb * bi)
        lane[U * LANES + n] += ua + ub
        lane[W * LANES + n] += wa + wb
        if diffraction is not None:
            # conjugate, as the amplitudes are
            fr, fi = lane_factor(diffraction, block, m, n, lane[Z * LANES + n])
            da, za = da * fr + za * fi, za * fr - da * fi
            fr, fi = lane_factor(diffraction, block, m + 1, n, lane[Z * LANES + n])
            db, zb = db * fr + zb * fi, zb * fr - db * fi
        lane[DU * LANES + n] -= da + db
        lane[DW * LANES + n] -= za + zb
        lane[P * LANES + n] += pa * ra + pb * rb


@kernel
def chain_sums(number, n_echo, field, lane, diffraction, block):
    """Water velocity, acceleration and pressure at a block's nodes: two K at a time, then square.

    diffraction: LaneDiffraction, which scales and turns the accelerations, or None.
    """
    for n in range(LANES):
        lane[U * LANES + n] = 0.0
        lane[W * LANES + n] = 0.0
        lane[DU * LANES + n] = 0.0
        lane[DW * LANES + n] = 0.0
        lane[P * LANES + n] = 0.0
    for m in range(0, number.shape[1], 2):
        if m < n_echo:
            add_echo(number, field, m, lane, diffraction, block)
        vr, vi, gr, gi = field[VR, m], field[VI, m], field[GR, m], field[GI, m]
        hr, hi, qr, qi = field[VR, m + 1], field[VI, m + 1], field[GR, m + 1], field[GI, m + 1]
        pa, pb = number[PRESSURE, m], number[PRESSURE, m + 1]
        for n in range(LANES):
            ar, ai = lane[AR * LANES + n], lane[AI * LANES + n]
            br, bi = lane[BR * LANES + n], lane[BI * LANES + n]
            ua, wa, da, za, ra = wave_terms(vr, vi, gr, gi, ar, ai)
            ub, wb, db, zb, rb = wave_terms(hr, hi, qr, qi, br, bi)
            if diffraction is not None:
                fr, fi = lane_factor(diffraction, block, m, n, lane[Z * LANES + n])
                da, za = da * fr - za * fi, za * fr + da * fi
                fr, fi = lane_factor(diffraction, block, m + 1, n, lane[Z * LANES + n])
                db, zb = db * fr - zb * fi, zb * fr + db * fi
            lane[U * LANES + n] += ua + ub
            lane[W * LANES + n] += wa + wb
            lane[DU * LANES + n] += da + db
            lane[DW * LANES + n] += za + zb
            lane[P * LANES + n] += pa * ra + pb * rb
            lane[AR * LANES + n], lane[AI * LANES + n] = ar * ar - ai * ai, 2.0 * ar * ai
            lane[BR * LANES + n], lane[BI * LANES + n] = br * br - bi * bi, 2.0 * br * bi


@kernel
def place_nodes(z_surf, node, lane):
    """Body z and weight of a block's nodes for the surface at z_surf. node: a block of Lanes.table."""
    for n in range(LANES):
        bottom = node[BOTTOM * LANES + n]
        wet = min(max(z_surf, bottom), node[TOP * LANES + n]) - bottom
        lane[Z * LANES + n] = bottom + wet * node[SHARE * LANES + n]
        lane[WEIGHT * LANES + n] = wet * node[SPREAD * LANES + n]


@kernel
def lane_current(pose, depth, current, lane):
    """Current at a block's nodes, inertial axes."""
    if current is None:
        return
    for n in range(LANES):
        z = lane[Z * LANES + n]
        cu, cv = current_at(pose.z + pose.r33 * z, depth, current)
        lane[CU * LANES + n] = cu
        lane[CV * LANES + n] = cv


@kernel
def lane_load(pose, lanes, node, sea, current, lane):
    """StripLoad of a block: Eq. (16) and the pressure on the taper, without the keel."""
    added_line = 0.25 * pi * lanes.density * lanes.added_mass_coefficient
    froude_line = 0.25 * pi * lanes.density * (1.0 + lanes.added_mass_coefficient)
    drag_line = 0.5 * lanes.density * lanes.drag_coefficient
    fx = fy = fz = mx = my = s0 = s1 = s2 = 0.0
    along_x = along_y = 0.0
    if sea is not None:
        along_x = pose.r11 * sea.cos_heading + pose.r21 * sea.sin_heading
        along_y = pose.r12 * sea.cos_heading + pose.r22 * sea.sin_heading
    for n in range(LANES):
        z = lane[Z * LANES + n]
        weight = lane[WEIGHT * LANES + n]
        d = node[D0 * LANES + n] + node[D1 * LANES + n] * z
        sx = pose.vx + pose.wy * z
        sy = pose.vy - pose.wx * z
        rx, ry = -sx, -sy
        if sea is not None:
            u, w = lane[U * LANES + n], lane[W * LANES + n]
            rx += along_x * u + pose.r31 * w
            ry += along_y * u + pose.r32 * w
        if current is not None:
            cu, cv = lane[CU * LANES + n], lane[CV * LANES + n]
            rx += pose.r11 * cu + pose.r21 * cv
            ry += pose.r12 * cu + pose.r22 * cv
        drag = weight * drag_line * d * sqrt(rx * rx + ry * ry)
        added = weight * added_line * d * d
        px = drag * rx - added * (pose.wy * pose.vz - pose.wz * sy)
        py = drag * ry - added * (pose.wz * sx - pose.wx * pose.vz)
        if sea is not None:
            du, dw = lane[DU * LANES + n], lane[DW * LANES + n]
            froude = weight * froude_line * d * d
            px += froude * (along_x * du + pose.r31 * dw)
            py += froude * (along_y * du + pose.r32 * dw)
            fz += weight * 0.5 * pi * d * node[D1 * LANES + n] * lane[P * LANES + n]
        fx += px
        fy += py
        mx -= z * py
        my += z * px
        s0 += added
        s1 += added * z
        s2 += added * z * z
    return StripLoad(Wrench(fx, fy, fz, mx, my, 0.0), s0, s1, s2, 0.0)


@kernel
def keel_load(pose, lanes, sea, current, lane):
    """Axial force on the keel: dynamic pressure, added mass and drag (theory.md, 5.4)."""
    zk = lanes.keel_z
    sx = pose.vx + pose.wy * zk
    sy = pose.vy - pose.wx * zk
    force = -lanes.heave_added_mass * (pose.wx * sy - pose.wy * sx)
    rz = -pose.vz
    n = lanes.keel % LANES
    if sea is not None:
        along = pose.r13 * sea.cos_heading + pose.r23 * sea.sin_heading
        rz += along * lane[U * LANES + n] + pose.r33 * lane[W * LANES + n]
        az = along * lane[DU * LANES + n] + pose.r33 * lane[DW * LANES + n]
        force += lanes.heave_added_mass * az + lanes.keel_area * lane[P * LANES + n]
    if current is not None:
        rz += pose.r13 * lane[CU * LANES + n] + pose.r23 * lane[CV * LANES + n]
    return force + lanes.axial_drag * abs(rz) * rz


@kernel
def fast_field(t, pose, lanes, sea, scratch):
    """(z_surf, eta, height of the reference point on the axis) with scratch.field filled."""
    z_ref = distance = lean = 0.0
    if lanes.instantaneous_position:
        tilt = max(pose.r33, 0.1)
        z_ref = -pose.z / tilt
        lean = (pose.r13 * sea.cos_heading + pose.r23 * sea.sin_heading) / tilt
        x, y = pose.x + pose.r13 * z_ref, pose.y + pose.r23 * z_ref
        distance = x * sea.cos_heading + y * sea.sin_heading
    cosine, sine = scratch.phasor[0], scratch.phasor[1]
    phasors(t, distance, sea.component, cosine, sine)
    e0, e1, e2, e3 = compress(
        ramp_factor(t, sea.ramp), sea.band, sea.weight, sea.number, cosine, sine, scratch.field
    )
    z_surf, eta = fast_surface(pose, lanes, lean, sea.reach, e0, e1, e2, e3)
    return z_surf, eta, z_ref


@kernel
def still_surface(pose, lanes):
    """Body z where the axis meets still water."""
    if not lanes.instantaneous_position:
        return 0.0
    return -pose.z / max(pose.r33, 0.1)


@kernel
def lane_kinematics(pose, z_ref, eta, lanes, sea, field, lane, diffraction, block):
    """Fill a block's U, W, DU, DW (along the heading and up) and P; nothing in still water."""
    if sea is None:
        return
    stretch = 1.0
    drop = 0.0
    if lanes.wheeler:
        stretch = lanes.depth / (lanes.depth + eta)
        drop = stretch * eta
    scale = sea.number[WAVE_NUMBER, 0] * 0.5 ** (sea.lead + 4)
    if lanes.instantaneous_position:
        sway = pose.r13 * sea.cos_heading + pose.r23 * sea.sin_heading
        chain_start(pose.z, pose.r33, sway, z_ref, stretch, drop, scale, sea.lead, lane)
    else:
        chain_start(0.0, 1.0, 0.0, 0.0, stretch, drop, scale, sea.lead, lane)
    chain_sums(sea.number, sea.n_echo, field, lane, diffraction, block)


@kernel
def fast_morison_load(t, pose, lanes, sea, current, scratch, diffraction=None):
    """Strip load as morison.morison_load gives it, from Lanes and FastWaves (None: still water).

    diffraction: LaneDiffraction or None, which leaves 1 + C_A.
    """
    if lanes is None:
        return StripLoad(NO_LOAD, 0.0, 0.0, 0.0, 0.0)
    eta = z_ref = 0.0
    if sea is None:
        z_surf = still_surface(pose, lanes)
    else:
        z_surf, eta, z_ref = fast_field(t, pose, lanes, sea, scratch)
    z_surf = min(max(z_surf, lanes.keel_z), lanes.top_z)
    load, s0, s1, s2 = NO_LOAD, 0.0, 0.0, 0.0
    for block in range(scratch.lanes.shape[0]):
        node, lane = lanes.table[block], scratch.lanes[block]
        place_nodes(z_surf, node, lane)
        lane_kinematics(pose, z_ref, eta, lanes, sea, scratch.field, lane, diffraction, block)
        lane_current(pose, lanes.depth, current, lane)
        part = lane_load(pose, lanes, node, sea, current, lane)
        load = add(load, part.wrench)
        s0 += part.s0
        s1 += part.s1
        s2 += part.s2
    fz = load.fz + keel_load(pose, lanes, sea, current, scratch.lanes[lanes.keel // LANES])
    wrench = Wrench(load.fx, load.fy, fz, load.mx, load.my, 0.0)
    return StripLoad(wrench, s0, s1, s2, lanes.heave_added_mass)
