"""Computes mooring lines as quasi-static elastic catenaries on a flat seabed with friction (theory.md, 5.5).

Equations (18)(19) and (18t)(19t) are solved in non-dimensional form, with h = H/(wL), v = V/(wL),
kappa = wL/EA, and X, Z the spans over L. One unknown is eliminated in closed form, which leaves one
strictly increasing scalar equation per regime; the regime is known before the first iteration. So a
bracketed Newton iteration converges to the unique solution from any start.
"""

from math import asinh, expm1, hypot, log1p, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.events import Counter
from fowt_env.plant.state import NO_LOAD, Wrench

# regimes, as written to the last column of `lines`; LOST: the line broke at its fairlead and exerts no load
SLACK, TOUCHDOWN, SUSPENDED, LOST = 0, 1, 2, 3
REGIME = 5  # that column

N_LINE = 6  # columns of `lines`: H, V, fairlead tension, anchor tension, length on seabed, regime

# The error after a Newton step is about the square of that step, so stopping on this relative step
# leaves rounding errors only, and a result that is independent of the start.
LAST_STEP = 3e-8
# Newton needs 2 or 3 steps from a warm start, at most a dozen from a cold one; then the bracket is halved.
NEWTON_STEPS = 30
MAX_STEPS = 120  # enough halvings (of the logarithm) for any bracket of finite doubles
BRACKET_WIDTH = 4e-16  # relative: no double is left in between
DEEPEST_SAG = 300.0  # above any root for spans that NEGLIGIBLE lets through; its sinh is finite
# m: spacing of a LineTable, and its range inwards and outwards of the line's spans at rest
TABLE_X, TABLE_Z = 0.5, 1.0
TABLE_INWARD, TABLE_OUTWARD, TABLE_HEIGHT = 60.0, 32.0, 30.0
# A table is checked between its points, up to this many from the spans at rest. Above this relative error of
# the tension, as of a tendon, which goes slack within a metre, the line is solved instead.
TRIED_X, TRIED_Z, TABLE_ERROR = 16, 4, 2e-2
NEGLIGIBLE = 1e-100  # spans over L below this count as zero, far below the rounding of any real span


class LineTable(NamedTuple):
    """Holds the fairlead tensions of n lines over their spans, C1 in both: four times as fast as Newton.

    tension: (n, distances, heights, 2) H and V, N, in steps of TABLE_X, TABLE_Z metres from origin.
    """

    origin: np.ndarray  # (n, 2) horizontal and vertical span of the first point, m; nan: a line without table
    tension: np.ndarray


class Mooring(NamedTuple):
    """Holds all mooring lines of a platform: anchors in inertial, fairleads in body coordinates."""

    anchor: np.ndarray  # (n, 3), m
    fairlead: np.ndarray  # (n, 3), m
    length: np.ndarray  # (n,), unstretched, m
    weight: np.ndarray  # (n,), in water per unstretched length, N/m
    EA: np.ndarray  # (n,), N
    friction: np.ndarray  # (n,), seabed friction coefficient C_B
    table: object = None  # LineTable, or None: every line is solved
    dynamics: object = None  # line_dynamics.LineDynamics, or None: lines are quasi-static


class Catenary(NamedTuple):
    """Holds the state of a mooring line: tensions in N, lengths in m (unstretched)."""

    H: float  # horizontal tension at the fairlead
    V: float  # vertical tension at the fairlead, pulling down
    fairlead_tension: float
    anchor_tension: float
    seabed_length: float
    regime: int
    converged: bool


def build_mooring(lines, tabulated=False):
    """Return the Mooring of a platform's `Line` records (tabulated: with a LineTable); None without lines."""
    if not lines:
        return None

    def column(name):
        return np.ascontiguousarray([getattr(line, name) for line in lines], dtype=np.float64)

    mooring = Mooring(
        anchor=column("anchor"),
        fairlead=column("fairlead"),
        length=column("length"),
        weight=column("wet_weight"),
        EA=column("EA"),
        friction=column("seabed_friction"),
    )
    return mooring._replace(table=_line_table(mooring)) if tabulated else mooring


def _line_table(mooring):
    """Return the LineTable of a Mooring about the spans of its lines at rest."""
    span = mooring.anchor - mooring.fairlead
    rest = np.column_stack([np.hypot(span[:, 0], span[:, 1]), -span[:, 2]])
    first = rest - [TABLE_INWARD, 0.5 * TABLE_HEIGHT]
    first[:, 0] = np.maximum(first[:, 0], TABLE_X)
    counts = (int((TABLE_INWARD + TABLE_OUTWARD) / TABLE_X) + 1, int(TABLE_HEIGHT / TABLE_Z) + 1)
    tension = np.zeros((len(rest), *counts, 2))
    _fill_tensions(first, tension, mooring)
    table = LineTable(np.ascontiguousarray(first), tension)
    for i, (x_f, z_f) in enumerate(rest):
        if not _table_error(x_f, z_f, i, mooring, table) <= TABLE_ERROR:
            first[i] = np.nan
    return table._replace(origin=np.ascontiguousarray(first))


@kernel
def _fill_tensions(origin, tension, mooring):
    """Fill tension with the solutions at the points of a LineTable."""
    for i in range(tension.shape[0]):
        for j in range(tension.shape[1]):
            for k in range(tension.shape[2]):
                line = catenary(
                    origin[i, 0] + TABLE_X * j,
                    origin[i, 1] + TABLE_Z * k,
                    mooring.length[i],
                    mooring.weight[i],
                    mooring.EA[i],
                    mooring.friction[i],
                    0.0,
                )
                tension[i, j, k, 0] = line.H
                tension[i, j, k, 1] = line.V


@kernel
def suspended_residual(mu, X, Z, k):
    """Return (f, df/dmu, v, dv/dmu) of a line clear of the seabed; f = 0 solves theory.md Eqs. (18)(19).

    mu = (X - kappa h)/(2h) is the sag parameter (0 straight, growing with sag) and k = kappa/2.
    With it h = X/(2(mu + k)) and v = 1/2 + Z/(2(tanh mu + k)), and the length of the catenary,
    (Z - 2kv + k)^2 + (2h sinh mu)^2 = 1, is the remaining equation. f increases with mu.
    No difference of nearly equal terms occurs, however taut the line.
    """
    e = expm1(mu)
    s = 0.5 * (e + e / (1.0 + e))
    c = 1.0 + e - s
    t = s / c
    tk = 1.0 / (t + k)
    mk = 1.0 / (mu + k)
    dt = 1.0 / (c * c)
    P = Z * t * tk
    Q = X * s * mk
    length = sqrt(P * P + Q * Q)
    dP = Z * k * dt * tk * tk
    dQ = X * (c - s * mk) * mk
    dv = -0.5 * Z * dt * tk * tk
    return length - 1.0, (P * dP + Q * dQ) / length, 0.5 + 0.5 * Z * tk, dv


@kernel
def touchdown_residual(h, Z, kappa, friction, s, excess):
    """Return (f, df/dh, v, dv/dh) of a line on the seabed; f = 0 solves theory.md Eqs. (18t)(19t).

    s: hanging length of the slack line; excess = X - (1 - s) > 0, the span in excess of the slack one.
    (19t) is quadratic in v^2 and gives v(h) > s. The rest of (18t), less its slack limit, has
    the factor h in each term (through v - s = h drop), so that h keeps its digits as it vanishes.
    f increases with h.
    """
    q = 2.0 * Z * (Z + 2.0 * h)
    q /= 1.0 + kappa * (Z + h) + sqrt(1.0 + kappa * (2.0 * (Z + h) + kappa * h * h))
    v = sqrt(q)
    a = sqrt(h * h + q)
    ah = 1.0 / (a + h)
    lift = q * ah  # a - h
    angle = log1p((v + lift) / h)  # asinh(v/h)
    drop = v * (1.0 + h / (a + v)) * ah / (1.0 + 0.5 * kappa * (s + v))
    b = max(1.0 - v, 0.0)
    p = b if h >= friction * b else h / friction  # length on the seabed that is under tension
    grip = kappa * friction * p
    f = h * (angle + kappa * (v + p) - drop) - 0.5 * grip * p - excess
    dv = v * ah / (1.0 + kappa * a)
    slope = angle - v / a + kappa * (v + p) + (grip - lift / a) * dv
    return f, slope, v, dv


@kernel
def next_iterate(x, step, low, high, n):
    """Return Newton's iterate, or one inside the bracket (low, high) where Newton leaves it or is slow."""
    new = x + step
    if low < new < high and n < NEWTON_STEPS:
        return new
    if low > 0.0:
        return sqrt(low) * sqrt(high)
    return 0.1 * x


@kernel
def solve_suspended(X, Z, kappa, h0):
    """Return (h, v, converged) of a line clear of the seabed, started from h0 if positive."""
    k = 0.5 * kappa
    if X <= NEGLIGIBLE:
        return 0.0, 0.5 + (Z - 1.0) / kappa, True
    chord = hypot(X, Z)
    low, high = k / (1.2 * chord + k), DEEPEST_SAG  # f(low) < 0, for f + 1 < chord sinh(low)/(low + k)
    mu = X / (2.0 * h0) - k if h0 > 0.0 else 0.0
    if not low < mu < high:
        mu = (6.0 * k) ** (1.0 / 3.0)  # a chord as long as the line
        if chord > 1.0:
            mu = min(mu, k / (chord - 1.0))
        else:
            mu = max(mu, sqrt(3.0 * (1.0 - chord * chord)) / X)
        mu = min(max(mu, low), 0.5 * high)
    for n in range(MAX_STEPS):
        f, slope, v, dv = suspended_residual(mu, X, Z, k)
        step = -f / slope if slope > 0.0 else 0.0
        if slope > 0.0 and abs(step) <= LAST_STEP * mu:
            return X / (2.0 * (mu + step + k)), v + dv * step, True
        if f > 0.0:
            high = mu
        else:
            low = mu
        if high - low <= BRACKET_WIDTH * high:
            return X / (2.0 * (mu + k)), v, True
        mu = next_iterate(mu, step, low, high, n)
    return X / (2.0 * (mu + k)), v, False


@kernel
def solve_touchdown(X, Z, kappa, friction, s, excess, high, h0):
    """Return (h, v, converged) of a line partly on the seabed; h0 is the start if in (0, high), as h is."""
    low = 0.0
    h = h0
    if not low < h < high:
        chord = hypot(X, Z)
        h = 0.5 * high
        if chord < 1.0:
            h = min(h, 0.5 * X * X / sqrt(3.0 * (1.0 - chord * chord)))
    for n in range(MAX_STEPS):
        f, slope, v, dv = touchdown_residual(h, Z, kappa, friction, s, excess)
        step = -f / slope if slope > 0.0 else 0.0
        if slope > 0.0 and abs(step) <= LAST_STEP * h:
            return h + step, v + dv * step, True
        if f > 0.0:
            high = h
        else:
            low = h
        if high - low <= BRACKET_WIDTH * high:
            return h, v, True
        h = next_iterate(h, step, low, high, n)
    return h, v, False


@kernel
def catenary(x_f, z_f, length, weight, EA, friction, h0):
    """Return the Catenary of a line with its anchor on a flat seabed, for any finite spans (theory.md, 5.5).

    x_f >= 0, z_f: horizontal and vertical distance from anchor to fairlead, m. h0: horizontal tension at the
    start of the iteration, N (0: cold start), which changes the result by 1e-12 at most. A fairlead at or
    below the anchor counts as lying on the seabed (V = 0); one straight above the anchor gives H = 0. A slack
    line has no tension on the seabed; elasticity is linear for any stretch. NaN in, NaN out.
    """
    kappa = weight * length / EA
    W = weight * length
    X = x_f / length
    Z = z_f / length
    if Z < 0.0:
        Z = 0.0
    s = 2.0 * Z / (1.0 + sqrt(1.0 + 2.0 * kappa * Z))
    excess = X - 1.0 + s
    if excess <= NEGLIGIBLE:
        V = W * s
        return Catenary(0.0, V, V, 0.0, length * (1.0 - s), SLACK, True)

    # The whole line is just off the seabed (v = 1) where tanh mu = Z - k; more span lifts it.
    zeta = Z - 0.5 * kappa
    high = (excess + Z) / kappa + friction  # s <= Z, and the seabed part alone stretches this far
    suspended = zeta >= 1.0
    if 0.0 < zeta < 1.0:
        h_lift = 0.5 * (1.0 - zeta) * (1.0 + zeta) / zeta
        x_lift = h_lift * (log1p(2.0 * zeta / (1.0 - zeta)) + kappa)
        suspended = X >= x_lift
        high = min(high, h_lift)
    if suspended:
        h, v, converged = solve_suspended(X, Z, kappa, h0 / W)
        v = max(v, 1.0)  # rounding at lift-off
        T_anchor = W * hypot(h, v - 1.0)
        return Catenary(W * h, W * v, W * hypot(h, v), T_anchor, 0.0, SUSPENDED, converged)
    h, v, converged = solve_touchdown(X, Z, kappa, friction, s, excess, high, h0 / W)
    v = min(v, 1.0)
    T_anchor = W * max(h - friction * (1.0 - v), 0.0)
    return Catenary(W * h, W * v, W * hypot(h, v), T_anchor, length * (1.0 - v), TOUCHDOWN, converged)


@kernel
def _cubic(x):
    """Return the weights of four evenly spaced points at a fraction x from the second to the third, C1."""
    rest = 1.0 - x
    return (
        -0.5 * x * rest * rest,
        1.0 + x * x * (1.5 * x - 2.5),
        x * (0.5 + x * (2.0 - 1.5 * x)),
        -0.5 * x * x * rest,
    )


@kernel
def _tensions(x_f, z_f, i, table):
    """Return (inside, H, V) of line i, interpolated in the table."""
    x, z = (x_f - table.origin[i, 0]) / TABLE_X, (z_f - table.origin[i, 1]) / TABLE_Z
    value = table.tension[i]
    if not (1.0 <= x < value.shape[0] - 2.0 and 1.0 <= z < value.shape[1] - 2.0):
        return False, 0.0, 0.0
    j, k = int(x), int(z)
    across, up = _cubic(x - j), _cubic(z - k)
    H = V = 0.0
    for n in range(4):
        row = value[j - 1 + n]
        a, b, c, d = row[k - 1], row[k], row[k + 1], row[k + 2]
        H += across[n] * (up[0] * a[0] + up[1] * b[0] + up[2] * c[0] + up[3] * d[0])
        V += across[n] * (up[0] * a[1] + up[1] * b[1] + up[2] * c[1] + up[3] * d[1])
    return H > 0.0, H, V


@kernel
def _table_error(x_f, z_f, i, mooring, table):
    """Return the largest error of line i's table about these spans, relative to the fairlead tension."""
    worst = 0.0
    for j in range(-TRIED_X, TRIED_X):
        for k in range(-TRIED_Z, TRIED_Z):
            x, z = x_f + (j + 0.5) * TABLE_X, z_f + (k + 0.5) * TABLE_Z
            inside, H, V = _tensions(x, z, i, table)
            if inside:
                line = catenary(
                    x, z, mooring.length[i], mooring.weight[i], mooring.EA[i], mooring.friction[i], 0.0
                )
                error = hypot(H - line.H, V - line.V)
                worst = max(worst, error / line.fairlead_tension if line.fairlead_tension > 0.0 else error)
    return worst


@kernel
def line_state(x_f, z_f, i, mooring, table, start):
    """Return the Catenary of line i: from the table within its range, else solved from H = start."""
    length, weight, friction = mooring.length[i], mooring.weight[i], mooring.friction[i]
    if table is not None:
        inside, H, V = _tensions(x_f, z_f, i, table)
        if inside:
            W = weight * length
            if V < W:
                anchor = max(H - friction * (W - V), 0.0)
                return Catenary(H, V, hypot(H, V), anchor, length * (1.0 - V / W), TOUCHDOWN, True)
            return Catenary(H, V, hypot(H, V), hypot(H, V - W), 0.0, SUSPENDED, True)
    return catenary(x_f, z_f, length, weight, mooring.EA[i], friction, start)


@kernel
def is_lost(i, lines):
    """Return whether line i has broken at its fairlead: it exerts no load from then on."""
    return lines[i, REGIME] == LOST


@kernel
def lose_line(i, lines):
    """Break line i at its fairlead, with no tension left in its row of lines."""
    for column in range(REGIME):
        lines[i, column] = 0.0
    lines[i, REGIME] = LOST


@kernel
def mooring_load(pose, mooring, lines, counters):
    """Return the wrench of all mooring lines, body axes, about the body origin (theory.md, 5.5).

    lines: (n, N_LINE), kept between calls: the next call starts from its H; zeros: cold start; a line of the
    regime LOST is left out.
    counters[MOORING_UNCONVERGED] counts lines that missed the tolerance.
    """
    if mooring is None:
        return NO_LOAD
    fx = fy = fz = mx = my = mz = 0.0
    for i in range(mooring.length.shape[0]):
        if is_lost(i, lines):
            continue
        bx = mooring.fairlead[i, 0]
        by = mooring.fairlead[i, 1]
        bz = mooring.fairlead[i, 2]
        dx = mooring.anchor[i, 0] - (pose.x + pose.r11 * bx + pose.r12 * by + pose.r13 * bz)
        dy = mooring.anchor[i, 1] - (pose.y + pose.r21 * bx + pose.r22 * by + pose.r23 * bz)
        z_f = pose.z + pose.r31 * bx + pose.r32 * by + pose.r33 * bz - mooring.anchor[i, 2]
        x_f = hypot(dx, dy)
        line = line_state(x_f, z_f, i, mooring, mooring.table, lines[i, 0])
        lines[i, 0] = line.H
        lines[i, 1] = line.V
        lines[i, 2] = line.fairlead_tension
        lines[i, 3] = line.anchor_tension
        lines[i, 4] = line.seabed_length
        lines[i, REGIME] = line.regime
        if not line.converged:
            counters[Counter.MOORING_UNCONVERGED] += 1.0
        pull = line.H / x_f if x_f > 0.0 else 0.0  # a vertical line has no horizontal direction
        X = pull * dx
        Y = pull * dy
        Z = -line.V
        px = pose.r11 * X + pose.r21 * Y + pose.r31 * Z
        py = pose.r12 * X + pose.r22 * Y + pose.r32 * Z
        pz = pose.r13 * X + pose.r23 * Y + pose.r33 * Z
        fx += px
        fy += py
        fz += pz
        mx += by * pz - bz * py
        my += bz * px - bx * pz
        mz += bx * py - by * px
    return Wrench(fx, fy, fz, mx, my, mz)


def line_shape(H, V, x_f, length, weight, EA, friction=0.0, n=41):
    """Return (n, 2) points of a line in its vertical plane: distance and height from the anchor, m.

    H, V: fairlead tensions, N, as of `catenary` and the columns of `lines`; x_f: horizontal span, m, of
    a slack line (drawn straight along the seabed, then up).
    The points are evenly spaced in unstretched length, anchor first.
    """
    along = np.linspace(0.0, length, n)
    seabed = min(max(length - V / weight, 0.0), length)
    lifted = np.maximum(along - seabed, 0.0)
    V_low = max(V - weight * length, 0.0)
    stretch = (V_low * lifted + 0.5 * weight * lifted**2) / EA
    if H <= 0.0:
        x = np.where(lifted > 0.0, x_f, x_f * along / max(seabed, 1e-300))
        return np.column_stack([x if V_low == 0.0 else np.full(n, x_f), lifted + stretch])
    grip = friction * weight
    taut = seabed if H >= grip * seabed else H / grip

    def elongation(d):
        """Return the elongation of the last d metres on the seabed; tension falls towards the anchor."""
        return (H - 0.5 * grip * d) * d / EA

    lying = np.minimum(along, seabed)
    x = lying + elongation(taut) - elongation(np.minimum(seabed - lying, taut))
    V_up = V_low + weight * lifted
    x += H / weight * (np.arcsinh(V_up / H) - asinh(V_low / H)) + H * lifted / EA
    z = lifted * (V_up + V_low) / (np.hypot(H, V_up) + hypot(H, V_low)) + stretch
    return np.column_stack([x, z])
