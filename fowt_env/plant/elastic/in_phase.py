"""Advances the twist of the shaft and the bending of the blades in phase exactly, within Adams steps.

Blades that bend in phase turn the hub, and with the spring of the shaft they swing at 11 and 24 rad/s on the
NREL 5 MW. With the twist q and the mean deflections c of the blades, z = (q, c),

    z'' = g - A z - B z'

where A and B are those of a nacelle at rest, from the solution for a unit twist (shaft.py) and the modal mass
of a blade, with the damping by the wind in B, and g, the rest of z'', is smooth. A step extrapolates g as a
cubic, with the share of the generator torque as it is known over the step, and solves for z exactly. The
impulses on shaft and modes that make the difference from the Adams formula turn the hub, too, so that
momentum about the shaft is kept. A and B need not be exact: every step finds g anew from past z, z' and z'',
so that the order stays 4.
"""

from fowt_env.plant.adams import extrapolated, interpolated, moulton
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.elastic.shaft import (
    MOBILITY,
    MOBILITY_BEGUN,
    SHARE,
    advance_twist,
    keep_smooth,
    share_over,
    smooth_of,
)
from fowt_env.plant.state import BLADES, State

# rows of RotorScratch.in_phase, (N_IN_PHASE, 1 + n): mean accelerations of the modes by a unit one of the
# twist; z; z' and g, of four steps each, latest first; g at the end of the step; two for means and series
REACTION, Z, RATE, REST, REST_AFTER, SERIES = 0, 1, 2, 6, 10, 11
N_IN_PHASE = 13
SPRING, DECAY = 0, 1  # entries of RotorScratch.in_phase_matrix: A, B
STEP, MOBILE, HUB, MODES = 0, 1, 2, 3  # entries of RotorScratch.found, of the last matrices
DRIFT = 0.02  # of k and e relative to those, up to which the matrices stay
SHORT = 0.25  # square of the angle of the fastest oscillation, and decay, in a part of a step that has a
TERMS = 14  # power series of so many terms


@kernel
def _put_mean(row, first, blades, out):
    """Fill out (1 + n,) from entry 1 on with the means over the blades of row, from its entry `first` on."""
    n = len(blades.beam.count)
    for j in range(n):
        total = 0.0
        for number in range(BLADES):
            total += row[first + n * number + j]
        out[1 + j] = total / BLADES


@kernel
def _find_matrices(mobility, e, blades, shaft, work):
    """Fill A and B for the mobility of the twist and the accelerations e (1 + n,) of the modes by it.

    The air's force on a blade in motion turns no hub: what it adds to the torque of the rotor is what the
    modal acceleration takes away.
    """
    n, k, hub = len(blades.beam.count), mobility, work.found[HUB]
    A, B = work.in_phase_matrix[SPRING], work.in_phase_matrix[DECAY]
    A[0, 0], B[0, 0] = k * shaft.stiffness, k * shaft.damping
    for j in range(n):
        pull = drag = 0.0
        for i in range(n):
            pull += BLADES * k * blades.beam.stiffness[j, i] * e[1 + i]
            drag += BLADES * k * blades.beam.damping[j, i] * e[1 + i]
        A[0, 1 + j], B[0, 1 + j] = pull, drag
        A[1 + j, 0], B[1 + j, 0] = e[1 + j] * A[0, 0], e[1 + j] * B[0, 0]
        for i in range(n):
            A[1 + i, 1 + j] = blades.spring[i, j] + e[1 + i] * pull / hub
            B[1 + i, 1 + j] = blades.decay[i, j] + e[1 + i] * drag / hub


@kernel
def fill_propagator(dt, work):
    """Fill work.propagator with what A and B make of z and load over a step dt (s).

    (2 N, 6 N): (z, dt z') at the end by z, dt z' and the coefficients of dt2 g as a cubic in s, 0 to 1 over
    the step. A power series over a part of the step, 2^-k of it, is doubled k times.
    """
    A, B = work.in_phase_matrix[SPRING], work.in_phase_matrix[DECAY]
    P, Q = work.propagator[0], work.propagator[1]
    size, series, square, decay = A.shape[0], work.in_phase, 0.0, 0.0
    for i in range(size):
        square += A[i, i] * dt * dt
        decay += B[i, i] * dt
    part, doublings = 1.0, 0
    while square * part * part > SHORT or decay * part > SHORT:
        part *= 0.5
        doublings += 1
    now, after = series[SERIES], series[SERIES + 1]
    for column in range(6 * size):
        j, kind = column % size, column // size  # 0: z, 1: dt z', 2 to 5: power of s
        for i in range(size):
            now[i] = 1.0 if kind == 0 and i == j else 0.0
            after[i] = 1.0 if kind == 1 and i == j else 0.0
            P[i, column], P[size + i, column] = now[i] + part * after[i], after[i]
        power = part
        for term in range(TERMS):  # now, after: coefficients of s^term, s^(term + 1)
            for i in range(size):
                total = 1.0 if kind == 2 + term and i == j else 0.0
                for k in range(size):
                    total -= dt * dt * A[i, k] * now[k] + dt * (term + 1) * B[i, k] * after[k]
                Q[i, column] = total / ((term + 1) * (term + 2))
            for i in range(size):
                now[i], after[i] = after[i], Q[i, column]
                P[size + i, column] += (term + 2) * power * after[i]
                P[i, column] += power * part * after[i]
            power *= part
    for _ in range(doublings):
        _double(part, P, Q)
        part *= 2.0


@kernel
def _double(part, P, Q):
    """Make a propagator P over a part of a step one over twice this part; Q: work array."""
    twice = P.shape[0]
    size = twice // 2
    for i in range(twice):
        for column in range(6 * size):
            total = 0.0
            for k in range(twice):
                total += P[i, k] * P[k, column]
            if column >= twice:  # the cubic in the second half: of (part + s)^power, by the binomials
                j, power, choose = column % size, column // size - 2, 1.0
                shift = part**power
                for lower in range(power + 1):
                    total += choose * shift * P[i, twice + lower * size + j]
                    choose *= (power - lower) / (lower + 1.0)
                    shift /= part
            Q[i, column] = total
    for i in range(twice):
        for column in range(6 * size):
            P[i, column] = Q[i, column]


@kernel
def _renew(steps, dt, blades, shaft, work):
    """Find matrices and propagator for this step where they have drifted, and before the first step."""
    e, found, k = work.in_phase[REACTION], work.found, work.shaft_torque[MOBILITY_BEGUN]
    n, hub, least, most = len(blades.beam.count), work.twist[1, State.ROTOR_SPEED], 0.0, 0.0
    _put_mean(work.twist[1], blades.first + BLADES * n, blades, e)
    for j in range(1, 1 + n):
        least = max(least, abs(e[j] - found[MODES + j]))
        most = max(most, abs(found[MODES + j]))
    if (
        steps == 0 or found[STEP] != dt or least > DRIFT * most or abs(k - found[MOBILE]) > DRIFT * k
        or abs(hub - found[HUB]) > DRIFT * hub
    ):  # fmt: skip
        found[STEP], found[MOBILE], found[HUB] = dt, k, hub
        for j in range(1, 1 + n):
            found[MODES + j] = e[j]
        _find_matrices(k, e, blades, shaft, work)
        fill_propagator(dt, work)


@kernel
def _put_rest(bent, twist, share, dx, z, rate, rest, blades, shaft, work):
    """Fill z, z' and g (1 + n,) of a state of the rates dx, with the deflections bent of the blades.

    share: acceleration of the twist by the generator torque, 1/s2, which is not in g.
    """
    A, B, n = work.in_phase_matrix[SPRING], work.in_phase_matrix[DECAY], len(blades.beam.count)
    first, size = blades.first, BLADES * n
    _put_mean(bent, 0, blades, z)
    _put_mean(dx, first, blades, rate)
    _put_mean(dx, first + size, blades, rest)
    z[0], rate[0], rest[0] = twist, dx[shaft.first], dx[shaft.first + 1] - share
    for i in range(1 + n):
        total = rest[i]
        for j in range(1 + n):
            total += A[i, j] * z[j] + B[i, j] * rate[j]
        rest[i] = total


@inlined_kernel
def _put_past(steps, dt, history, past, blades, shaft, work):
    """Fill z, z' and g of the beginning of the step and of past steps, by matrices of this step."""
    _renew(steps, dt, blades, shaft, work)
    rows, size = work.in_phase, BLADES * len(blades.beam.count)
    for k in range(past.shape[0] - 1, -1, -1):  # the latest last, whose z stays
        _put_rest(
            past[k], past[k, size], past[k, size + 1], history[k], rows[Z], rows[RATE + k], rows[REST + k],
            blades, shaft, work,
        )  # fmt: skip


@inlined_kernel
def _put_load(i, begun, ended, c0, c1, c2, c3, dt, work):
    """Put dt2 times the cubic of entry i of g, and of the share of the generator torque, into work."""
    row, k = work.propagated[0], work.shaft_torque[MOBILITY_BEGUN]
    size, square = work.in_phase.shape[1], dt * dt
    if i == 0:
        c0, c1 = c0 + k * begun, c1 + k * (ended - begun)
    at = 2 * size + i
    row[at], row[at + size], row[at + 2 * size], row[at + 3 * size] = (
        square * c0, square * c1, square * c2, square * c3,
    )  # fmt: skip
    row[i], row[size + i] = work.in_phase[Z, i], dt * work.in_phase[RATE, i]


@kernel
def _move(dt, order, blades, shaft, work, y):
    """Give y the exact twist, and velocities by the impulses that make up for the Adams formula."""
    P, rows, e, n = work.propagator[0], work.in_phase, work.twist[1], len(blades.beam.count)
    row, done, size, q = work.propagated[0], work.propagated[1], 1 + n, shaft.first
    first = blades.first + BLADES * n
    mean, change, M = rows[SERIES], rows[SERIES + 1], blades.beam
    for i in range(2 * size):
        total = 0.0
        for j in range(6 * size):
            total += P[i, j] * row[j]
        done[i] = total
    _put_mean(y, first, blades, mean)
    mean[0] = y[q + 1]
    for i in range(size):
        rate = done[size + i] / dt
        change[i] = rate - mean[i]
        if i > 0:
            work.offset[i - 1] = done[i] - rows[Z, i] - dt * moulton(order, rate, i, rows[RATE:])
    # the impulse p on the modes, relative to a free hub, speeds the hub by k e p
    k, reaction = work.shaft_torque[MOBILITY_BEGUN], rows[REACTION]
    free = k * (1.0 / e[State.ROTOR_SPEED] - 1.0)
    pushed = own = 0.0
    for i in range(n):
        for j in range(n):
            mass = BLADES * (M.A[i, j] + M.B[i, j]) * reaction[1 + i]
            pushed += mass * (change[1 + j] - reaction[1 + j] * change[0])
            own += mass * reaction[1 + j]
    pushed *= k / (1.0 + free * own)
    twisting = change[0] - pushed
    for i in range(State.VX, y.shape[0]):
        y[i] += e[i] * twisting
    y[State.ROTOR_SPEED] += pushed
    for number in range(BLADES):
        at = first + n * number
        for j in range(n):
            y[at + j] += change[1 + j] - e[at + j] * twisting
    y[q], y[q + 1] = done[0], done[size] / dt


@kernel
def note_means(blades, shaft, work, y):
    """Keep the mean velocities of the modes in y for restore_means; no-op for a rigid shaft."""
    if shaft is None:
        return
    _put_mean(y, blades.first + BLADES * len(blades.beam.count), blades, work.in_phase[SERIES])


@kernel
def restore_means(blades, shaft, work, y):
    """Shift the velocities of the modes in y to their means at note_means; no-op for a rigid shaft."""
    if shaft is None:
        return
    n = len(blades.beam.count)
    first, wanted, mean = blades.first + BLADES * n, work.in_phase[SERIES], work.in_phase[SERIES + 1]
    _put_mean(y, first, blades, mean)
    for number in range(BLADES):
        for j in range(n):
            y[first + n * number + j] += wanted[1 + j] - mean[1 + j]


@kernel
def shift_means(blades, shaft, work, y):
    """Shift the deflections in y, by Adams-Moulton, to exact means; no-op for a rigid shaft."""
    if shaft is None:
        return
    n = len(blades.beam.count)
    for number in range(BLADES):
        for j in range(n):
            y[blades.first + n * number + j] += work.offset[j]


@inlined_kernel
def _keep_torque(x, blades, shaft, past, work, dx):
    keep_smooth(shaft, work, dx)


@inlined_kernel
def _keep_twist(x, blades, shaft, past, work, dx):
    if shaft is None:
        return
    size = BLADES * len(blades.beam.count)
    for k in range(past.shape[0] - 1, 0, -1):
        past[k, size], past[k, size + 1] = past[k - 1, size], past[k - 1, size + 1]
    past[0, size] = x[shaft.first]
    past[0, size + 1] = work.shaft_torque[MOBILITY] * work.shaft_torque[SHARE]


@inlined_kernel
def _keep_torque_after(y, blades, shaft, work, new):
    keep_smooth(shaft, work, new)


@inlined_kernel
def _keep_rest_after(y, blades, shaft, work, new):
    if shaft is None:
        return
    rows, bent = work.in_phase, y[blades.first : blades.first + BLADES * len(blades.beam.count)]
    share = work.shaft_torque[MOBILITY] * work.shaft_torque[SHARE]
    z, rate, rest = rows[SERIES], rows[SERIES + 1], rows[REST_AFTER]
    _put_rest(bent, y[shaft.first], share, new, z, rate, rest, blades, shaft, work)


@inlined_kernel
def _twist_on(steps, dt, x, u, order, history, past, blades, shaft, model, work, y):
    h0, h1, h2, h3 = history[0], history[1], history[2], history[3]
    c0, c1, c2, c3 = extrapolated(
        order, smooth_of(shaft, h0), smooth_of(shaft, h1), smooth_of(shaft, h2), smooth_of(shaft, h3)
    )
    advance_twist(x, u, dt, c0, c1, c2, c3, shaft, model, work, y)


@inlined_kernel
def _swing_on(steps, dt, x, u, order, history, past, blades, shaft, model, work, y):
    if shaft is None:
        return
    _put_past(steps, dt, history, past, blades, shaft, work)
    begun, ended = share_over(x, u, shaft, model, work, y)
    rows = work.in_phase
    for i in range(rows.shape[1]):
        c0, c1, c2, c3 = extrapolated(
            order, rows[REST, i], rows[REST + 1, i], rows[REST + 2, i], rows[REST + 3, i]
        )
        _put_load(i, begun, ended, c0, c1, c2, c3, dt, work)
    _move(dt, order, blades, shaft, work, y)


@inlined_kernel
def _twist_again(dt, x, u, order, new, history, blades, shaft, model, work, y):
    h0, h1, h2 = history[0], history[1], history[2]
    c0, c1, c2, c3 = interpolated(
        order, smooth_of(shaft, new), smooth_of(shaft, h0), smooth_of(shaft, h1), smooth_of(shaft, h2)
    )
    advance_twist(x, u, dt, c0, c1, c2, c3, shaft, model, work, y)


@inlined_kernel
def _swing_again(dt, x, u, order, new, history, blades, shaft, model, work, y):
    if shaft is None:
        return
    begun, ended = share_over(x, u, shaft, model, work, y)
    rows = work.in_phase
    for i in range(rows.shape[1]):
        c0, c1, c2, c3 = interpolated(
            order, rows[REST_AFTER, i], rows[REST, i], rows[REST + 1, i], rows[REST + 2, i]
        )
        _put_load(i, begun, ended, c0, c1, c2, c3, dt, work)
    _move(dt, order, blades, shaft, work, y)


# (x, blades, shaft, past, work, dx): after an evaluation of the rates dx at x, keeps what twist_on needs of
# it, before what past steps left
keep_twist = chosen_by_class("blades", {type(None): _keep_torque, BladeModes: _keep_twist}, inlined=True)
# (y, blades, shaft, work, new): the same for twist_again, of the rates new at the predicted end y of a step
keep_twist_after = chosen_by_class(
    "blades", {type(None): _keep_torque_after, BladeModes: _keep_rest_after}, inlined=True
)
# (steps, dt, x, u, order, history, past, blades, shaft, model, work, y): advances the twist, and blades in
# phase, by the loads of the last `order` steps; y has the velocities of Adams-Bashforth
twist_on = chosen_by_class("blades", {type(None): _twist_on, BladeModes: _swing_on}, inlined=True)
# (dt, x, u, order, new, history, blades, shaft, model, work, y): by the load at the end of the step, too; y
# has the velocities of Adams-Moulton
twist_again = chosen_by_class("blades", {type(None): _twist_again, BladeModes: _swing_again}, inlined=True)
