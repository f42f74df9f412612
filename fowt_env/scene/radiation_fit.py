"""Builds the radiation memory of potential-flow coefficients, as a rational approximation or a convolution.

Both forms use the retardation K(i w) = B(w) + i w (A(w) - A_inf) computed from B by causality, as A and B of
files are consistent to a few per cent only. The rational approximation has real coefficients, stable
poles, K(0) = 0 and no direct term; coupled motions share poles. Poles are found by vector fitting (Gustavsen
and Semlyen, IEEE Trans. Power Delivery 14(3), 1999; relaxed as in 21(3), 2006) and nonlinear least squares,
residues by linear least squares with Re K positive semidefinite (theory.md, 5.8).
"""

import hashlib
import warnings
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.linalg import block_diag
from scipy.optimize import least_squares, nnls
from scipy.sparse.csgraph import connected_components

from fowt_env.caches import Cache
from fowt_env.errors import InputError, PlantWarning, level_outside
from fowt_env.plant.compile.vector_sums import PAIR_LANES, SUM_LANES
from fowt_env.plant.hydro.radiation import ConvolutionMemory, StateSpaceMemory, whole_groups
from fowt_env.plant.state import MOTIONS

BAND = (0.15, 2.5)  # rad/s, in which errors are evaluated: periods of 2.5 to 42 s
OUTSIDE, BELOW = 0.1, 0.6  # weight of higher frequencies, and times frequency (rad/s) of lower ones
FEWEST_KNOWN = 8  # least number of frequencies of a file within BAND
NEGLIGIBLE = 1e-3  # over the geometric mean of the diagonals: weaker coupling is omitted
FEWEST, MOST = 2, 10  # pole pairs of an entry
ALIKE = 2e-3  # rms in BAND by which the normal K of two blocks may differ to share a fit
ROUNDS = 12  # of pole relocation
EVALUATIONS = 20  # of the nonlinear least-squares fit
POLISHED = 2.0  # multiple of the requested error below which poles are refined by least squares
DECAY = (0.05, 8.0)  # 1/s, of a pole; slower decay would exceed SPAN and the frequency resolution of files
FREQUENCY = (0.01, 8.0)  # rad/s, of a pole
PASSIVE_UP_TO = 10.0  # rad/s
PASSIVE_MARGIN = 1e-4  # least relative Re K in the constraints on residues
PASSIVE_ROUNDS = 60
CHECKED = 4001  # number of frequencies up to PASSIVE_UP_TO at which a fit is checked
NOT_PASSIVE = 1e-4  # negative Re K over the largest |K| of an entry, above which a fit is rejected
SPAN = 60.0  # s of past velocities in a convolution
FADE = 15.0  # s at the end of SPAN in which K fades to zero: truncation would damp or excite slow motions
SPACING = 0.005  # rad/s, of the cosine transform, with a period of 1257 s, much longer than SPAN
TRANSFORMED = 120.0  # s of K transformed to the target of a fit
GRID = 0.04  # rad/s, frequency step of that target
TAPER = 1.5  # multiple of the last frequency at which the damping is zero
IN_PLANE = (0, 2, 4)


class EntryFit(NamedTuple):
    """Holds the order, error and passivity of the fit of an entry of K."""

    order: int  # of the denominator
    error: float  # rms over BAND against the causal K, relative to the rms of K
    passivity: float | None  # least Re K up to PASSIVE_UP_TO over the largest |K|; None off the diagonal


@dataclass(frozen=True, eq=False)
class RadiationFit:
    """Holds the fit K(s) = sum over poles p of r / (s - p) + conj(r) / (s - conj(p)), by entries of K."""

    poles: dict  # {motion: (m,) complex, positive imaginary part}
    residues: dict  # {(motion, motion): (m,) complex, for the poles of the second; symmetric}
    entries: dict  # {(motion, motion): EntryFit}, first <= second

    def response(self, omega):
        """Return (n, 6, 6) complex K(i omega), omega (n,) rad/s."""
        s = 1j * np.asarray(omega, dtype=float)[:, None]
        result = np.zeros((s.size, 6, 6), dtype=complex)
        for (i, j), residue in self.residues.items():
            pole = self.poles[j]
            result[:, i, j] = (residue / (s - pole) + residue.conj() / (s - pole.conj())).sum(axis=1)
        return result


def retardation(body):
    """Return (n, 6, 6) complex B + i w (A - A_inf) of a PotentialFlow at its frequencies, symmetrised."""
    change = body.added_mass - body.added_mass_infinite
    k = body.damping + 1j * body.omega[:, None, None] * change
    return 0.5 * (k + k.transpose(0, 2, 1))


def retardation_kernel(body, time):
    """Return (n, 6, 6) K(t) of a PotentialFlow, 2/pi integral of B(w) cos(w t) dw, N/m ...; time (n,) s.

    B follows monotone cubics from B(0) = 0, and falls to zero within TAPER times the last frequency.
    """
    last = body.omega[-1]
    omega = np.arange(0.0, TAPER * last, SPACING)
    damping = 0.5 * (body.damping + body.damping.transpose(0, 2, 1)).reshape(-1, 36)
    known = PchipInterpolator(np.r_[0.0, body.omega], np.vstack([np.zeros(36), damping]))
    fraction = np.clip((omega - last) / ((TAPER - 1.0) * last), 0.0, 1.0)
    b = known(np.minimum(omega, last)) * (0.5 + 0.5 * np.cos(np.pi * fraction))[:, None]
    b[0] *= 0.5
    kernel = np.cos(np.outer(np.asarray(time, dtype=float), omega)) @ b * (2.0 / np.pi * SPACING)
    return kernel.reshape(-1, 6, 6)


def causal_retardation(body, omega):
    """Return (n, 6, 6) complex K(i omega) of retardation_kernel over TRANSFORMED s; omega (n,) rad/s."""
    step = 0.1 / (TAPER * body.omega[-1])
    time = np.arange(0.0, TRANSFORMED, step)
    kernel = retardation_kernel(body, time).reshape(time.size, 36) * step
    kernel[0] *= 0.5
    used = np.abs(kernel).max(axis=0) > 0.0
    result = np.zeros((omega.size, 36), dtype=complex)
    result[:, used] = np.exp(-1j * np.outer(omega, time)) @ kernel[:, used]
    return result.reshape(-1, 6, 6)


# ---------------------------------------------------------------- vector fitting


def _columns(s, poles):
    """Return the (n, 2 m) response at s to unit residues: m real parts, then m imaginary parts."""
    first, second = 1.0 / (s[:, None] - poles), 1.0 / (s[:, None] - poles.conj())
    return np.hstack([first + second, 1j * (first - second)])


def _free(poles):
    """Return a (2 m, 2 m - 1) basis of the residues with K(0) = 0."""
    at_zero = _columns(np.zeros(1, complex), poles).real
    return np.linalg.svd(at_zero)[2][1:].T


def _real(a):
    """Return the stacked real and imaginary rows."""
    return np.concatenate([a.real, a.imag])


def _fitted(s, f, w, poles):
    """Return the (n, e) least-squares fit with K(0) = 0."""
    base = _columns(s, poles) @ _free(poles)
    x = np.linalg.lstsq(_real(base * w[:, None]), _real(f * w[:, None]), rcond=1e-12)[0]
    return base @ x


def _relocated(s, f, w, poles):
    """Return the stable pole pairs after one round of relaxed vector fitting."""
    columns, free = _columns(s, poles), _free(poles)
    n, m = free.shape
    base, rows = columns @ free, []
    for k in range(f.shape[1]):
        scaled = f[:, k, None] * np.hstack([columns, np.ones((s.size, 1))])
        left = _real(np.hstack([base, -scaled]) * w[:, None])
        rows.append(np.linalg.qr(left, mode="r")[m:, m:])
    size = np.linalg.norm(w[:, None] * f) / s.size
    rows.append(size * np.r_[columns.real.sum(axis=0), s.size][None])
    left = np.vstack(rows)
    right = np.zeros(left.shape[0])
    right[-1] = size * s.size
    x = np.linalg.lstsq(left, right, rcond=1e-12)[0]
    half = poles.size
    a = np.block([
        [np.diag(poles.real), np.diag(poles.imag)],
        [-np.diag(poles.imag), np.diag(poles.real)],
    ])  # fmt: skip
    zeros = np.linalg.eigvals(a - np.outer(np.r_[np.full(half, 2.0), np.zeros(half)], x[:-1]) / x[-1])
    return _pairs(zeros, half)


def _pairs(poles, count):
    """Return the upper poles of `count` pairs within DECAY and FREQUENCY; two real poles form a pair."""
    upper = list(poles[poles.imag > 1e-9])
    real = np.sort(np.abs(poles[np.abs(poles.imag) <= 1e-9].real))
    upper += [complex(-np.sqrt(a * b), 0.5 * (b - a)) for a, b in zip(real[::2], real[1::2], strict=False)]
    upper += [complex(-a, 0.3 * a) for a in real[len(real) // 2 * 2 :]]
    return _bounded(np.array(upper[:count]))


def _bounded(poles):
    """Return the poles clipped to DECAY and FREQUENCY, with a margin for finite differences."""
    decay = np.clip(np.abs(poles.real), 1.001 * DECAY[0], 0.999 * DECAY[1])
    return -decay + 1j * np.clip(poles.imag, 1.001 * FREQUENCY[0], 0.999 * FREQUENCY[1])


def _fit_poles(omega, f, w, count, starts, limit):
    """Return (largest error, poles) of the best `count` pairs of vector fitting.

    Poles with an error below `limit` are refined by nonlinear least squares.
    """
    s, band = 1j * omega, _in_band(omega)

    def error(poles):
        return float(_rms((_fitted(s, f, w, poles) - f)[band]).max())

    def unpacked(x):
        return -np.exp(x[:count]) + 1j * np.exp(x[count:])

    def residuals(x):
        return _real((_fitted(s, f, w, unpacked(x)) - f) * w[:, None]).ravel()

    middle = np.linspace(BAND[0], BAND[1] + 0.1, count)
    candidates = []
    for start in (-0.1 * middle + 1j * middle, *starts):
        poles, rounds = _bounded(start), 0
        while poles.size == count and rounds <= ROUNDS:
            candidates.append((error(poles), poles))
            poles, rounds = _relocated(s, f, w, poles), rounds + 1
    best = min(candidates, key=itemgetter(0))
    if best[0] > limit:
        return best
    bounds = np.log(np.repeat([DECAY, FREQUENCY], count, axis=0)).T
    x = np.log(np.r_[-best[1].real, best[1].imag])
    polished = unpacked(least_squares(residuals, x, bounds=bounds, max_nfev=EVALUATIONS).x)
    return min(best, (error(polished), polished), key=itemgetter(0))


# ---------------------------------------------------------------- passivity


def _constrained(left, right, rows, least):
    """Return x of least |left x - right| with rows x >= least, by Lawson and Hanson's LDP algorithm.

    None if the constraints are infeasible.
    """
    q, r = np.linalg.qr(left)
    free = q.T @ right
    if not len(rows):
        return np.linalg.solve(r, free)
    turned = np.linalg.solve(r.T, np.asarray(rows).T).T
    short = np.asarray(least) - turned @ free
    scale = np.linalg.norm(turned, axis=1)
    matrix = np.vstack([(turned / scale[:, None]).T, short / scale])
    target = np.zeros(matrix.shape[0])
    target[-1] = 1.0
    u, _ = nnls(matrix, target, maxiter=50 * matrix.shape[1] + 1000)
    miss = matrix @ u - target
    if abs(miss[-1]) < 1e-12:
        return None
    return np.linalg.solve(r, free - miss[:-1] / miss[-1])


def _passive_grid():
    """Return (frequencies of the constraints Re K >= 0, rad/s; scale of Re K, w^2, and 1/w^2 at the top)."""
    middle = np.r_[np.arange(0.05, BAND[1], 0.002), np.arange(BAND[1], PASSIVE_UP_TO + 0.01, 0.01)]
    omega = np.unique(np.r_[np.geomspace(1e-3, 0.05, 10), middle, 20.0, 50.0])
    return omega, omega**2 / (omega**2 + 0.3**2) / (1.0 + (omega / 3.0) ** 2)


def _passive_residues(omega, f, w, poles, indices, size, counted):
    """Return (e, 2 m) residues of the entries of a (size, size) block, least squares with Re K >= 0.

    indices: row and column of each entry; counted (e,): weights of the entries' errors.
    """
    s, free = 1j * omega, _free(poles)
    base = _columns(s, poles) @ free
    left, m = _real(base * w[:, None]), free.shape[1]
    rights = _real(f * w[:, None])
    whole = np.kron(np.diag(counted), left)
    right = (rights * counted).T.ravel()
    grid, shape = _passive_grid()
    real = (_columns(1j * grid, poles) @ free).real / shape[:, None]
    rows, least, x = [], [], None
    for _ in range(PASSIVE_ROUNDS):
        new = _constrained(whole, right, rows, least)
        if new is None:
            break
        x = new
        matrix = np.zeros((grid.size, size, size))
        for k, (i, j) in enumerate(indices):
            matrix[:, i, j] = matrix[:, j, i] = real @ x[k * m : (k + 1) * m]
        values, vectors = np.linalg.eigh(matrix)
        low = values[:, 0]
        if low.min() >= 0.0:
            break
        padded = np.r_[np.inf, low, np.inf]
        dips = np.flatnonzero((low < 0.0) & (low <= padded[:-2]) & (low <= padded[2:]))
        for at in dips:
            v = vectors[at, :, 0]
            factors = [v[i] * v[j] * (1.0 if i == j else 2.0) for i, j in indices]
            rows.append(np.concatenate([factor * real[at] for factor in factors]))
            least.append(PASSIVE_MARGIN)
    return np.array([free @ x[k * m : (k + 1) * m] for k in range(len(indices))])


# ---------------------------------------------------------------- the whole body


def _blocks(size):
    """Return ([coupled motions], coupling matrix) of the (6, 6) rms of K, without motions of zero K."""
    scale = np.sqrt(np.diag(size))
    coupled = size > NEGLIGIBLE * np.outer(scale, scale)
    count, group = connected_components(coupled)
    blocks = ([i for i in np.flatnonzero(group == g).tolist() if size[i, i] > 0.0] for g in range(count))
    return [block for block in blocks if block], coupled


def _fit_block(omega, k, block, coupled, w, target, known):
    """Return (poles, {entry: residues}) of a block of motions with common poles.

    known: [(normalised K, poles, residues)] of earlier blocks, to which this block is appended; a block equal
    to an earlier one except for scales and signs, as sway and roll of many floaters, reuses its fit.
    """
    band = _in_band(omega)
    pairs = [(i, j) for a, i in enumerate(block) for j in block[a:] if i == j or coupled[i, j]]
    scale = {i: np.sqrt(_rms(k[band, i, i])) for i in block}
    rms = np.array([_rms(k[band, i, j]) for i, j in pairs])
    f = np.array([k[:, i, j] for i, j in pairs]).T
    units = np.array([scale[i] * scale[j] for i, j in pairs])
    indices = [(block.index(i), block.index(j)) for i, j in pairs]
    for normal, poles, rows in known:
        if normal.shape == f.shape and len(block) < 3:
            signs = np.where((normal.conj() * f)[band].real.sum(axis=0) < 0.0, -1.0, 1.0)
            if _rms((signs * f / rms - normal)[band]).max() < ALIKE:
                return poles, _residues_by_entry(pairs, rows, signs * rms)
    best, last = (np.inf, None, None), None
    for count in range(FEWEST, MOST + 1):
        starts = () if last is None else (np.append(last, complex(-0.5, 1.0 + 0.2 * (count % 3))),)
        limit = np.inf if count == MOST else POLISHED * target
        error, last = _fit_poles(omega, f / rms, w, count, starts, limit)
        if error > best[0]:
            continue  # the constraint Re K >= 0 only increases the error
        rows = _passive_residues(omega, f / units, w, last, indices, len(block), units / rms)
        miss = _columns(1j * omega, last) @ rows.T - f / units
        error = float((_rms(miss[band]) * units / rms).max())
        best = min(best, (error, last, rows), key=itemgetter(0))
        if best[0] <= target:
            break
    _, poles, rows = best
    rows = rows * (units / rms)[:, None]
    known.append((f / rms, poles, rows))
    return poles, _residues_by_entry(pairs, rows, rms)


def _residues_by_entry(pairs, rows, units):
    """Return {entry: complex residues}, symmetric, from rows of real and imaginary parts."""
    residues = {}
    for (i, j), row, unit in zip(pairs, rows, units, strict=True):
        half = row.size // 2
        residues[i, j] = residues[j, i] = unit * (row[:half] + 1j * row[half:])
    return residues


_FITS = Cache(16)  # (hash of the coefficients, error): RadiationFit


def fit_radiation(body, error=0.02):
    """Return the RadiationFit of a PotentialFlow with the fewest poles for an error, at most MOST pairs.

    error  rms over BAND of an entry, relative to the rms of the entry
    Warns (PlantWarning) if the error of an entry is more than twice as large. Raises: InputError if Re K of
    the fit cannot be kept positive, or with fewer than FEWEST_KNOWN frequencies within BAND.
    """
    digest = hashlib.sha256()
    for part in (body.omega, body.added_mass, body.damping, body.added_mass_infinite):
        digest.update(np.ascontiguousarray(part).tobytes())
    return _FITS.get((digest.hexdigest(), float(error)), lambda: _fit(body, error))


def _fit(body, target):
    known = _in_band(body.omega)
    if known.sum() < FEWEST_KNOWN:
        raise InputError(
            f"potential_flow: {known.sum()} frequencies from {BAND[0]} to {BAND[1]} rad/s; the fit of the"
            f" radiation memory needs {FEWEST_KNOWN}; use radiation = 'none' without them"
        )
    omega = np.arange(GRID, TAPER * body.omega[-1], GRID)
    k = causal_retardation(body, omega)
    band = _in_band(omega)
    size = _rms(k[band])
    # below the band weighted by the error in added mass, which determines surge, sway and yaw periods
    w = np.where(band, 1.0, np.where(omega < BAND[0], BELOW / omega, OUTSIDE))
    blocks, coupled = _blocks(size)
    poles, residues, earlier = {}, {}, []
    for block in blocks:
        block_poles, block_residues = _fit_block(omega, k, block, coupled, w, target, earlier)
        poles |= dict.fromkeys(block, block_poles)
        residues |= block_residues
    fit = RadiationFit(poles, residues, {})
    far = fit.response(np.linspace(0.0, PASSIVE_UP_TO, CHECKED)[1:])
    miss = _rms(fit.response(omega[band]) - k[band])
    for i, j in residues:
        if i <= j:
            margin = float(far[:, i, i].real.min() / np.abs(far[:, i, i]).max()) if i == j else None
            fit.entries[i, j] = EntryFit(2 * poles[j].size, float(miss[i, j] / size[i, j]), margin)
    _check(fit, target)
    return fit


def _in_band(omega):
    """Return which frequencies are in BAND."""
    return (omega >= BAND[0] - 1e-6) & (omega <= BAND[1] + 1e-6)


def _rms(values):
    """Return root mean squares over the first axis."""
    return np.sqrt((np.abs(values) ** 2).mean(axis=0))


def _check(fit, target):
    """Raise InputError for a fit that generates energy, and warn of a coarse fit."""
    for (i, j), entry in fit.entries.items():
        if i == j and entry.passivity < -NOT_PASSIVE:
            raise InputError(
                f"potential_flow: the radiation memory of {MOTIONS[i]} cannot be fitted passively:"
                f" the least Re K is {entry.passivity:.2g} of the largest;"
                " use radiation = 'convolution'"
            )
    coarse = [
        f"{MOTIONS[i]}{'' if i == j else f'-{MOTIONS[j]}'} {entry.error:.1%}"
        for (i, j), entry in fit.entries.items()
        if entry.error > 2.0 * target
    ]
    if coarse:
        warnings.warn(
            f"radiation_error = {target:g}: {2 * MOST} poles an entry leave errors of {', '.join(coarse)}",
            PlantWarning,
            stacklevel=level_outside(),
        )


# ---------------------------------------------------------------- parts of the model


def build_radiation(body, options, dt, first):
    """Return the memory part of a PotentialFlow or None, according to the options.

    dt     time step of a convolution, s
    first  index of the first state of a state space in the state vector
    """
    if body is None or options["radiation"] == "none":
        return None
    motions = _motions(options["planar"])
    if options["radiation"] == "convolution":
        return build_convolution(body, dt, motions)
    return build_state_space(fit_radiation(body, options["radiation_error"]), first, motions)


def memory_for_step(memory, body, dt, planar):
    """Return the memory part for steps of dt (s): unchanged, except a convolution of another step."""
    if not isinstance(memory, ConvolutionMemory) or abs(memory.dt - dt) <= 1e-9 * dt:
        return memory
    return build_convolution(body, dt, _motions(planar))


def _motions(planar):
    return IN_PLANE if planar else range(6)


def build_state_space(fit, first, motions=range(6)):
    """Return the StateSpaceMemory of a RadiationFit for these motions; None if no motion has a memory."""
    counts = [fit.poles[j].size if j in motions and j in fit.poles else 0 for j in range(6)]
    groups = [whole_groups(count, PAIR_LANES) for count in counts]
    begin = np.concatenate([[0], np.cumsum(groups)]).astype(np.int64)
    if begin[-1] == 0:
        return None
    pole = np.zeros((2, begin[-1]))
    pole[0] = -1.0  # of padding poles that fill a group, with zero weight
    for j in range(6):
        if groups[j]:
            poles = fit.poles[j]
            pole[:, begin[j] : begin[j] + poles.size] = poles.real, poles.imag
    entries = [(i, j) for i, j in sorted(fit.residues) if i in motions and j in motions]
    weight = np.zeros((len(entries), 2 * max(groups)))
    for e, (i, j) in enumerate(entries):
        residue = fit.residues[i, j]
        weight[e, : residue.size] = 2.0 * residue.real
        weight[e, groups[j] : groups[j] + residue.size] = -2.0 * residue.imag
    rows, columns = np.array(entries, dtype=np.int64).T.copy()
    return StateSpaceMemory(int(first), begin, pole, np.searchsorted(rows, np.arange(7)), columns, weight)


def build_convolution(body, dt, motions=range(6)):
    """Return the ConvolutionMemory of a PotentialFlow over SPAN for steps of dt (s); None without damping."""
    size = _rms(retardation(body))
    _, coupled = _blocks(size)
    entries = [(i, j) for i in motions for j in motions if size[i, i] > 0.0 and (i == j or coupled[i, j])]
    if not entries:
        return None
    steps = max(1, round(SPAN / dt))
    n = whole_groups(steps, SUM_LANES)
    time = 0.5 * dt * np.arange(2 * n + 1)
    fraction = np.clip((time - SPAN + FADE) / FADE, 0.0, 1.0)
    kernel = retardation_kernel(body, time) * (0.5 + 0.5 * np.cos(np.pi * fraction))[:, None, None]
    now, (rows, columns) = np.zeros((6, 6)), np.array(entries, dtype=np.int64).T.copy()
    now[rows, columns] = kernel[0, rows, columns]
    half, whole = np.zeros((len(entries), n)), np.zeros((len(entries), n))
    half[:, :steps] = dt * kernel[1 : 2 * steps : 2, rows, columns].T
    half[:, 0] *= 0.75
    whole[:, :steps] = dt * kernel[2 : 2 * steps + 2 : 2, rows, columns].T
    return ConvolutionMemory(float(dt), now, rows, columns, half, whole)


class LinearMemory(NamedTuple):
    """Holds the memory of a scene in inertial axes: z' = A z + B q', F = -C z, q' (6,)."""

    A: np.ndarray  # (m, m)
    B: np.ndarray  # (m, 6)
    C: np.ndarray  # (6, m)


def linear_memory(scene):
    """Return the LinearMemory of a scene, from the state-space fit also for a convolution; None without."""
    hydro = scene.model.hydro
    if hydro is None or hydro.radiation is None:
        return None
    fit = fit_radiation(scene.platform.potential_flow, scene.options["radiation_error"])
    motions = [j for j in _motions(scene.options["planar"]) if j in fit.poles]
    states = [(j, k, pole) for j in motions for k, pole in enumerate(fit.poles[j])]
    a = block_diag(*([[pole.real, -pole.imag], [pole.imag, pole.real]] for _, _, pole in states))
    b, c = np.zeros((len(a), 6)), np.zeros((6, len(a)))
    for start, (j, k, _) in zip(range(0, len(a), 2), states, strict=True):
        b[start, j] = 1.0
        for i in motions:
            if (i, j) in fit.residues:
                residue = fit.residues[i, j][k]
                c[i, start : start + 2] = 2.0 * residue.real, -2.0 * residue.imag
    return LinearMemory(a, b, c)
