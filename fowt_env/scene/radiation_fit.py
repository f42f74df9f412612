"""Fits the radiation memory of potential-flow coefficients by a rational approximation, or convolves it.

Both forms use the retardation K(i w) = B(w) + i w (A(w) - A_inf) that follows from B by causality: the A of
files agrees with their B only to some per cent. The rational approximation has real coefficients, stable
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

BAND = (0.15, 2.5)  # rad/s, in which errors are counted: periods of 2.5 to 42 s
OUTSIDE, BELOW = 0.1, 0.6  # weight of higher frequencies, and times frequency (rad/s) of lower ones
FEWEST_KNOWN = 8  # frequencies of a file within BAND
NEGLIGIBLE = 1e-3  # of the geometric mean of the diagonals: weaker coupling is omitted
FEWEST, MOST = 2, 10  # pairs of poles of an entry
ALIKE = 2e-3  # rms in BAND by which the normal K of two blocks may differ to share a fit
ROUNDS = 12  # of relocating poles
EVALUATIONS = 20  # of the nonlinear least squares
POLISHED = 2.0  # times the error that is requested, below which poles are worth them
DECAY = (0.05, 8.0)  # 1/s, of a pole: one of less would outlast SPAN, and is narrower than files resolve
FREQUENCY = (0.01, 8.0)  # rad/s, of a pole
PASSIVE_UP_TO = 10.0  # rad/s
PASSIVE_MARGIN = 1e-4  # least Re K at which residues are held, of its size there
PASSIVE_ROUNDS = 60
CHECKED = 4001  # frequencies up to there at which a fit is judged
NOT_PASSIVE = 1e-4  # of an entry's largest value: beyond it a fit is rejected
SPAN = 60.0  # s of past velocities in a convolution
FADE = 15.0  # s at its end in which K goes to zero: cut off, it would damp slow motions, or drive them
SPACING = 0.005  # rad/s, of the cosine transform: its period of 1257 s is far beyond SPAN
TRANSFORMED = 120.0  # s of K behind the target of a fit
GRID = 0.04  # rad/s, of that target
TAPER = 1.5  # times the last frequency, where the damping has gone to zero
IN_PLANE = (0, 2, 4)


class EntryFit(NamedTuple):
    """How well one entry of K is fitted."""

    order: int  # of its denominator
    error: float  # rms over BAND against the causal K, of its rms there
    passivity: float | None  # least Re K up to PASSIVE_UP_TO over the largest |K|; None off the diagonal


@dataclass(frozen=True, eq=False)
class RadiationFit:
    """K(s) = sum over poles p of r / (s - p) + conj(r) / (s - conj(p)), by entries of K."""

    poles: dict  # {motion: (m,) complex, the upper of each pair}
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
    """Return (n, 6, 6) complex B + i w (A - A_inf) of a PotentialFlow at its frequencies, made symmetric."""
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
    share = np.clip((omega - last) / ((TAPER - 1.0) * last), 0.0, 1.0)
    b = known(np.minimum(omega, last)) * (0.5 + 0.5 * np.cos(np.pi * share))[:, None]
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
    """(n, 2 m) response at s of the real residues: first those of the real parts, then of the imaginary."""
    first, second = 1.0 / (s[:, None] - poles), 1.0 / (s[:, None] - poles.conj())
    return np.hstack([first + second, 1j * (first - second)])


def _free(poles):
    """Return (2 m, 2 m - 1) residues that keep K(0) = 0."""
    at_zero = _columns(np.zeros(1, complex), poles).real
    return np.linalg.svd(at_zero)[2][1:].T


def _real(a):
    """Return the real and imaginary rows one above the other."""
    return np.concatenate([a.real, a.imag])


def _fitted(s, f, w, poles):
    """Return (n, e) the fit of least squares with K(0) = 0."""
    base = _columns(s, poles) @ _free(poles)
    x = np.linalg.lstsq(_real(base * w[:, None]), _real(f * w[:, None]), rcond=1e-12)[0]
    return base @ x


def _relocated(s, f, w, poles):
    """Return the poles after one round of relaxed vector fitting, in pairs; all stable."""
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
    """Return the upper poles of `count` pairs within DECAY and FREQUENCY; two real ones become a pair."""
    upper = list(poles[poles.imag > 1e-9])
    real = np.sort(np.abs(poles[np.abs(poles.imag) <= 1e-9].real))
    upper += [complex(-np.sqrt(a * b), 0.5 * (b - a)) for a, b in zip(real[::2], real[1::2], strict=False)]
    upper += [complex(-a, 0.3 * a) for a in real[len(real) // 2 * 2 :]]
    return _bounded(np.array(upper[:count]))


def _bounded(poles):
    """Return the poles moved into DECAY and FREQUENCY, with room for differences."""
    decay = np.clip(np.abs(poles.real), 1.001 * DECAY[0], 0.999 * DECAY[1])
    return -decay + 1j * np.clip(poles.imag, 1.001 * FREQUENCY[0], 0.999 * FREQUENCY[1])


def _fit_poles(omega, f, w, count, starts, wanted):
    """Return (largest error, poles) of the best of `count` pairs that vector fitting finds.

    What is below `wanted` is polished by nonlinear least squares.
    """
    s, band = 1j * omega, _in_band(omega)

    def error(poles):
        return float(_rms((_fitted(s, f, w, poles) - f)[band]).max())

    def unpacked(x):
        return -np.exp(x[:count]) + 1j * np.exp(x[count:])

    def residuals(x):
        return _real((_fitted(s, f, w, unpacked(x)) - f) * w[:, None]).ravel()

    middle = np.linspace(BAND[0], BAND[1] + 0.1, count)
    found = []
    for start in (-0.1 * middle + 1j * middle, *starts):
        poles, rounds = _bounded(start), 0
        while poles.size == count and rounds <= ROUNDS:
            found.append((error(poles), poles))
            poles, rounds = _relocated(s, f, w, poles), rounds + 1
    best = min(found, key=itemgetter(0))
    if best[0] > wanted:
        return best
    bounds = np.log(np.repeat([DECAY, FREQUENCY], count, axis=0)).T
    x = np.log(np.r_[-best[1].real, best[1].imag])
    polished = unpacked(least_squares(residuals, x, bounds=bounds, max_nfev=EVALUATIONS).x)
    return min(best, (error(polished), polished), key=itemgetter(0))


# ---------------------------------------------------------------- passivity


def _constrained(left, right, rows, least):
    """x of least |left x - right| with rows x >= least, by Lawson and Hanson's least-distance programming.

    None where no x fulfils it.
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
    """Frequencies (rad/s) at which Re K is held positive, and its size there: w^2, and 1/w^2 far up."""
    middle = np.r_[np.arange(0.05, BAND[1], 0.002), np.arange(BAND[1], PASSIVE_UP_TO + 0.01, 0.01)]
    omega = np.unique(np.r_[np.geomspace(1e-3, 0.05, 10), middle, 20.0, 50.0])
    return omega, omega**2 / (omega**2 + 0.3**2) / (1.0 + (omega / 3.0) ** 2)


def _passive_residues(omega, f, w, poles, places, size, counted):
    """(e, 2 m) residues of the entries at `places` of a (size, size) block with Re K >= 0, least squares.

    counted (e,): what errors of the entries are multiplied with.
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
        for k, (i, j) in enumerate(places):
            matrix[:, i, j] = matrix[:, j, i] = real @ x[k * m : (k + 1) * m]
        values, vectors = np.linalg.eigh(matrix)
        low = values[:, 0]
        if low.min() >= 0.0:
            break
        padded = np.r_[np.inf, low, np.inf]
        dips = np.flatnonzero((low < 0.0) & (low <= padded[:-2]) & (low <= padded[2:]))
        for at in dips:
            v = vectors[at, :, 0]
            factors = [v[i] * v[j] * (1.0 if i == j else 2.0) for i, j in places]
            rows.append(np.concatenate([factor * real[at] for factor in factors]))
            least.append(PASSIVE_MARGIN)
    return np.array([free @ x[k * m : (k + 1) * m] for k in range(len(places))])


# ---------------------------------------------------------------- the whole body


def _blocks(size):
    """Return [motions that are coupled] of the (6, 6) rms of K, those without any omitted."""
    scale = np.sqrt(np.diag(size))
    coupled = size > NEGLIGIBLE * np.outer(scale, scale)
    count, group = connected_components(coupled)
    blocks = ([i for i in np.flatnonzero(group == g).tolist() if size[i, i] > 0.0] for g in range(count))
    return [block for block in blocks if block], coupled


def _fit_block(omega, k, block, coupled, w, asked, known):
    """Return (poles, {entry: residues}) of motions that share poles.

    known: [(normal K, poles, normal residues)] of earlier blocks, to which this one is added; a block that is
    one of them but for scales and signs, as sway and roll are of many floaters, has its fit.
    """
    band = _in_band(omega)
    pairs = [(i, j) for a, i in enumerate(block) for j in block[a:] if i == j or coupled[i, j]]
    scale = {i: np.sqrt(_rms(k[band, i, i])) for i in block}
    own = np.array([_rms(k[band, i, j]) for i, j in pairs])
    f = np.array([k[:, i, j] for i, j in pairs]).T
    units = np.array([scale[i] * scale[j] for i, j in pairs])
    places = [(block.index(i), block.index(j)) for i, j in pairs]
    for normal, poles, found in known:
        if normal.shape == f.shape and len(block) < 3:
            signs = np.where((normal.conj() * f)[band].real.sum(axis=0) < 0.0, -1.0, 1.0)
            if _rms((signs * f / own - normal)[band]).max() < ALIKE:
                return poles, _residues_by_entry(pairs, found, signs * own)
    best, last = (np.inf, None, None), None
    for count in range(FEWEST, MOST + 1):
        starts = () if last is None else (np.append(last, complex(-0.5, 1.0 + 0.2 * (count % 3))),)
        wanted = np.inf if count == MOST else POLISHED * asked
        error, last = _fit_poles(omega, f / own, w, count, starts, wanted)
        if error > best[0]:
            continue  # positive Re K only adds to it
        found = _passive_residues(omega, f / units, w, last, places, len(block), units / own)
        miss = _columns(1j * omega, last) @ found.T - f / units
        error = float((_rms(miss[band]) * units / own).max())
        best = min(best, (error, last, found), key=itemgetter(0))
        if best[0] <= asked:
            break
    _, poles, found = best
    found = found * (units / own)[:, None]
    known.append((f / own, poles, found))
    return poles, _residues_by_entry(pairs, found, own)


def _residues_by_entry(pairs, rows, units):
    """Return {entry: complex residues}, both ways, of rows of their real and imaginary parts."""
    residues = {}
    for (i, j), row, unit in zip(pairs, rows, units, strict=True):
        half = row.size // 2
        residues[i, j] = residues[j, i] = unit * (row[:half] + 1j * row[half:])
    return residues


_FITS = Cache(16)  # (hash of the coefficients, error) -> RadiationFit


def fit_radiation(body, error=0.02):
    """Return the RadiationFit of a PotentialFlow: as many poles as the error asks for, MOST pairs at most.

    error  rms over BAND of an entry, of the entry's rms there
    Warns (PlantWarning) where an entry is left with more than twice that. Raises: InputError if Re K of
    the fit cannot be held positive, or with fewer than FEWEST_KNOWN frequencies within BAND.
    """
    digest = hashlib.sha256()
    for part in (body.omega, body.added_mass, body.damping, body.added_mass_infinite):
        digest.update(np.ascontiguousarray(part).tobytes())
    return _FITS.get((digest.hexdigest(), float(error)), lambda: _fit(body, error))


def _fit(body, asked):
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
    # below the band by what an error is in added mass, which sets the periods of surge, sway and yaw
    w = np.where(band, 1.0, np.where(omega < BAND[0], BELOW / omega, OUTSIDE))
    blocks, coupled = _blocks(size)
    poles, residues, earlier = {}, {}, []
    for block in blocks:
        own, found = _fit_block(omega, k, block, coupled, w, asked, earlier)
        poles |= dict.fromkeys(block, own)
        residues |= found
    fit = RadiationFit(poles, residues, {})
    far = fit.response(np.linspace(0.0, PASSIVE_UP_TO, CHECKED)[1:])
    miss = _rms(fit.response(omega[band]) - k[band])
    for i, j in residues:
        if i <= j:
            margin = float(far[:, i, i].real.min() / np.abs(far[:, i, i]).max()) if i == j else None
            fit.entries[i, j] = EntryFit(2 * poles[j].size, float(miss[i, j] / size[i, j]), margin)
    _check(fit, asked)
    return fit


def _in_band(omega):
    """Return whether frequencies are in BAND."""
    return (omega >= BAND[0] - 1e-6) & (omega <= BAND[1] + 1e-6)


def _rms(values):
    """Return root mean squares over the first axis."""
    return np.sqrt((np.abs(values) ** 2).mean(axis=0))


def _check(fit, asked):
    """Refuse a fit that makes energy, and warn of one that is coarse."""
    for (i, j), entry in fit.entries.items():
        if i == j and entry.passivity < -NOT_PASSIVE:
            raise InputError(
                f"potential_flow: the radiation memory of {MOTIONS[i]} cannot be fitted without making"
                f" energy: the least Re K is {entry.passivity:.2g} of the largest;"
                " use radiation = 'convolution'"
            )
    coarse = [
        f"{MOTIONS[i]}{'' if i == j else f'-{MOTIONS[j]}'} {entry.error:.1%}"
        for (i, j), entry in fit.entries.items()
        if entry.error > 2.0 * asked
    ]
    if coarse:
        warnings.warn(
            f"radiation_error = {asked:g}: {2 * MOST} poles an entry leave {', '.join(coarse)}",
            PlantWarning,
            stacklevel=level_outside(),
        )


# ---------------------------------------------------------------- parts of the model


def build_radiation(body, options, dt, first):
    """Return the memory part of a PotentialFlow or None, as the options have it.

    dt     s, of the steps of a convolution
    first  of the states of a state space in the state vector
    """
    if body is None or options["radiation"] == "none":
        return None
    motions = _motions(options["planar"])
    if options["radiation"] == "convolution":
        return build_convolution(body, dt, motions)
    return build_state_space(fit_radiation(body, options["radiation_error"]), first, motions)


def memory_for_step(memory, body, dt, planar):
    """Return the memory part for steps of dt (s): itself, but for a convolution of another step."""
    if not isinstance(memory, ConvolutionMemory) or abs(memory.dt - dt) <= 1e-9 * dt:
        return memory
    return build_convolution(body, dt, _motions(planar))


def _motions(planar):
    return IN_PLANE if planar else range(6)


def build_state_space(fit, first, motions=range(6)):
    """Return StateSpaceMemory of a RadiationFit, for these motions; None where none of them has a memory."""
    counts = [fit.poles[j].size if j in motions and j in fit.poles else 0 for j in range(6)]
    groups = [whole_groups(count, PAIR_LANES) for count in counts]
    begin = np.concatenate([[0], np.cumsum(groups)]).astype(np.int64)
    if begin[-1] == 0:
        return None
    pole = np.zeros((2, begin[-1]))
    pole[0] = -1.0  # of those that fill a group, which nothing takes
    for j in range(6):
        if groups[j]:
            own = fit.poles[j]
            pole[:, begin[j] : begin[j] + own.size] = own.real, own.imag
    places = [(i, j) for i, j in sorted(fit.residues) if i in motions and j in motions]
    weight = np.zeros((len(places), 2 * max(groups)))
    for e, (i, j) in enumerate(places):
        residue = fit.residues[i, j]
        weight[e, : residue.size] = 2.0 * residue.real
        weight[e, groups[j] : groups[j] + residue.size] = -2.0 * residue.imag
    rows, columns = np.array(places, dtype=np.int64).T.copy()
    return StateSpaceMemory(int(first), begin, pole, np.searchsorted(rows, np.arange(7)), columns, weight)


def build_convolution(body, dt, motions=range(6)):
    """Return ConvolutionMemory of a PotentialFlow over SPAN for steps of dt (s); None without any damping."""
    size = _rms(retardation(body))
    _, coupled = _blocks(size)
    places = [(i, j) for i in motions for j in motions if size[i, i] > 0.0 and (i == j or coupled[i, j])]
    if not places:
        return None
    steps = max(1, round(SPAN / dt))
    n = whole_groups(steps, SUM_LANES)
    time = 0.5 * dt * np.arange(2 * n + 1)
    share = np.clip((time - SPAN + FADE) / FADE, 0.0, 1.0)
    kernel = retardation_kernel(body, time) * (0.5 + 0.5 * np.cos(np.pi * share))[:, None, None]
    now, (rows, columns) = np.zeros((6, 6)), np.array(places, dtype=np.int64).T.copy()
    now[rows, columns] = kernel[0, rows, columns]
    half, whole = np.zeros((len(places), n)), np.zeros((len(places), n))
    half[:, :steps] = dt * kernel[1 : 2 * steps : 2, rows, columns].T
    half[:, 0] *= 0.75
    whole[:, :steps] = dt * kernel[2 : 2 * steps + 2 : 2, rows, columns].T
    return ConvolutionMemory(float(dt), now, rows, columns, half, whole)


class LinearMemory(NamedTuple):
    """z' = A z + B q', F = -C z: the memory of a scene in inertial axes, q' (6,)."""

    A: np.ndarray  # (m, m)
    B: np.ndarray  # (m, 6)
    C: np.ndarray  # (6, m)


def linear_memory(scene):
    """LinearMemory of a scene, None without a memory; for a convolution that of the fit of state_space."""
    hydro = scene.model.hydro
    if hydro is None or hydro.radiation is None:
        return None
    fit = fit_radiation(scene.platform.potential_flow, scene.options["radiation_error"])
    motions = [j for j in _motions(scene.options["planar"]) if j in fit.poles]
    places = [(j, k, pole) for j in motions for k, pole in enumerate(fit.poles[j])]
    a = block_diag(*([[pole.real, -pole.imag], [pole.imag, pole.real]] for _, _, pole in places))
    b, c = np.zeros((len(a), 6)), np.zeros((6, len(a)))
    for start, (j, k, _) in zip(range(0, len(a), 2), places, strict=True):
        b[start, j] = 1.0
        for i in motions:
            if (i, j) in fit.residues:
                residue = fit.residues[i, j][k]
                c[i, start : start + 2] = 2.0 * residue.real, -2.0 * residue.imag
    return LinearMemory(a, b, c)
