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

Beside a rotor that is held, a tower feels all of the torque by which blades in phase twist the shaft. Its
step (steps.py) then takes twist and torque as cubics with the values of z at both ends and its integrals,
which are exact, too. A shaft that swings too fast for the step bends the tower by its share e of the twist: A
and B then contain what this bending does. A free rotor keeps most of the torque to itself: what is left of it
is extrapolated with the tower's g.
"""

from fowt_env.plant.adams import extrapolated, interpolated, moulton, with_integrals
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.elastic.chain import FREE, answer
from fowt_env.plant.elastic.shaft import (
    MOBILITY,
    MOBILITY_BEGUN,
    SHARE,
    advance_twist,
    keep_smooth,
    share_over,
    smooth_of,
)
from fowt_env.plant.elastic.tower import bend_by_modes
from fowt_env.plant.state import BLADES, State

# rows of RotorScratch.in_phase, (N_IN_PHASE, 1 + n): mean accelerations of the modes by a unit one of the
# twist; z; z' and g, of four steps each, latest first; g at the end of the step; two for means and series
REACTION, Z, RATE, REST, REST_AFTER, SERIES = 0, 1, 2, 6, 10, 11
SPRING, DECAY = 0, 1  # entries of RotorScratch.in_phase_matrix: A, B
STEP, MOBILE, HUB, MODES = 0, 1, 2, 3  # entries of RotorScratch.found, of the last matrices
DRIFT = 0.02  # of k and e relative to those, up to which the matrices stay
SHORT = 0.25  # square of the angle of the fastest oscillation, and decay, in a part of a step that has a
UNRESOLVED = 1.0  # square of the angle in a step from which on a shaft swings too fast for the tower
TERMS = 14  # power series of so many terms
NO_CUBIC = (0.0, 0.0, 0.0, 0.0)


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
def _add_tower(dt, x, body, tower, blades, matrix, work, still):
    """Add to A and B the springs and dampers of a tower that the twist bends by its share e alone.

    So it does where the shaft swings too fast for a step, and for the tower's own modes: the rest of its
    bending is then smooth. For a slower shaft this share would itself be an oscillation in g.
    """
    if tower is None:
        return
    if work.place[FREE] > 0.0 or work.in_phase_matrix[SPRING, 0, 0] * dt * dt < UNRESOLVED:
        return
    n, m, e, reaction = len(tower.beam.count), len(blades.beam.count), work.twist[1], work.in_phase[REACTION]
    v, first, bend = tower.first + n, blades.first + BLADES * m, bend_by_modes(x, tower)
    for part in range(2):
        of_tower = tower.beam.stiffness if part == SPRING else tower.beam.damping
        out, torque = work.in_phase_matrix[part], 0.0
        still[:] = 0.0
        for i in range(n):
            for j in range(n):
                still[v + i] += of_tower[i, j] * e[v + j]
            torque += e[v + i] * still[v + i]
        answer(0.0, bend, body, tower, blades, matrix, work, still)
        pull = work.shaft_torque[MOBILITY_BEGUN] * torque
        out[0, 0] += pull
        for j in range(m):
            out[1 + j, 0] += reaction[1 + j] * pull
            for number in range(BLADES):
                out[1 + j, 0] += still[first + m * number + j] / BLADES


@kernel
def fill_propagator(dt, work):
    """Fill work.propagator with what A and B make of z and load over a step dt (s).

    (4 N, 6 N): (z, dt z') at the end, and the first and second integral of z over s, 0 to 1 over the step,
    by z, dt z' and the coefficients of dt2 g as a cubic in s. A power series over a part of the step, 2^-k
    of it, is doubled k times.
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
            P[2 * size + i, column] = part * now[i] + 0.5 * part * part * after[i]
            P[3 * size + i, column] = part * part * (0.5 * now[i] + part * after[i] / 6.0)
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
                area = power * part * part * after[i] / (term + 3)
                P[2 * size + i, column] += area
                P[3 * size + i, column] += area * part / (term + 4)
            power *= part
    for _ in range(doublings):
        _double(part, P, Q)
        part *= 2.0


@kernel
def _double(part, P, Q):
    """Make a propagator P over a part of a step one over twice this part; Q: work array."""
    size = P.shape[0] // 4
    twice = 2 * size
    for i in range(4 * size):
        for column in range(6 * size):
            total = 0.0
            if i >= twice:  # integrals over the first half
                total = P[i, column]
            if i >= 3 * size:
                total += part * P[i - size, column]
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
    for i in range(4 * size):
        for column in range(6 * size):
            P[i, column] = Q[i, column]


@kernel
def _renew(steps, dt, x, body, tower, blades, shaft, matrix, work, still):
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
        _add_tower(dt, x, body, tower, blades, matrix, work, still)
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
def _put_past(steps, dt, x, history, past, blades, shaft, model, matrix, work, still):
    """Fill z, z' and g of the beginning of the step and of past steps, by matrices of this step."""
    _renew(steps, dt, x, model.rigid_body, model.tower, blades, shaft, matrix, work, still)
    rows, size = work.in_phase, BLADES * len(blades.beam.count)
    for k in range(past.shape[0] - 1, -1, -1):  # the latest last, whose z stays
        _put_rest(
            past[k], past[k, size], past[k, size + 1], history[k], rows[Z], rows[RATE + k], rows[REST + k],
            blades, shaft, work,
        )  # fmt: skip


@inlined_kernel
def _put_load(i, share, c0, c1, c2, c3, dt, work):
    """Put dt2 times the cubic of entry i of g, and of the share of the generator torque, into work."""
    row, k = work.propagated[0], work.shaft_torque[MOBILITY_BEGUN]
    size, square = work.in_phase.shape[1], dt * dt
    if i == 0:
        c0, c1, c2 = c0 + k * share[0], c1 + k * share[1], c2 + k * share[2]
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
    for i in range(4 * size):
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
def _no_reaction(x, blades, shaft, work):
    return 0.0


@inlined_kernel
def _reaction(x, blades, shaft, work):
    if shaft is None:
        return 0.0
    if work.place[FREE] > 0.0:
        return 0.0
    n, K, e, total = len(blades.beam.count), blades.beam.stiffness, work.twist[0], 0.0
    first = blades.first + BLADES * n
    for j in range(n):
        bent = shaken = 0.0
        for number in range(BLADES):
            shaken += e[first + n * number + j]
            for i in range(n):
                bent += K[j, i] * x[blades.first + n * number + i]
        total += shaken * bent / BLADES
    return work.shaft_torque[MOBILITY] * total


@inlined_kernel
def _slow_twist_over(dt, x, blades, shaft, work):
    if shaft is None:
        return NO_CUBIC, NO_CUBIC
    return (x[shaft.first], dt * x[shaft.first + 1], 0.0, 0.0), NO_CUBIC


@inlined_kernel
def _twist_over(dt, x, blades, shaft, work):
    if shaft is None:
        return NO_CUBIC, NO_CUBIC
    if work.place[FREE] > 0.0:
        return (x[shaft.first], dt * x[shaft.first + 1], 0.0, 0.0), NO_CUBIC
    n, K, e = len(blades.beam.count), blades.beam.stiffness, work.in_phase[REACTION]
    before, after, size = work.propagated[0], work.propagated[1], 1 + n
    begun = ended = area = moment = 0.0
    for j in range(1, 1 + n):
        pull = 0.0
        for i in range(n):
            pull += BLADES * work.shaft_torque[MOBILITY_BEGUN] * e[1 + i] * K[i, j - 1]
        begun, ended = begun + pull * before[j], ended + pull * after[j]
        area, moment = area + pull * after[2 * size + j], moment + pull * after[3 * size + j]
    twist = with_integrals(before[0], after[0], after[2 * size], after[3 * size])
    return twist, with_integrals(begun, ended, area, moment)


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
def _twist_on(steps, dt, x, u, order, history, past, blades, shaft, model, matrix, work, still, y):
    h0, h1, h2, h3 = history[0], history[1], history[2], history[3]
    c0, c1, c2, c3 = extrapolated(
        order, smooth_of(shaft, h0), smooth_of(shaft, h1), smooth_of(shaft, h2), smooth_of(shaft, h3)
    )
    advance_twist(x, u, dt, c0, c1, c2, c3, shaft, model, work, y)


@inlined_kernel
def _swing_on(steps, dt, x, u, order, history, past, blades, shaft, model, matrix, work, still, y):
    if shaft is None:
        return
    _put_past(steps, dt, x, history, past, blades, shaft, model, matrix, work, still)
    share = share_over(x, u, shaft, model, work, y)
    rows = work.in_phase
    for i in range(rows.shape[1]):
        c0, c1, c2, c3 = extrapolated(
            order, rows[REST, i], rows[REST + 1, i], rows[REST + 2, i], rows[REST + 3, i]
        )
        _put_load(i, share, c0, c1, c2, c3, dt, work)
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
    share = share_over(x, u, shaft, model, work, y)
    rows = work.in_phase
    for i in range(rows.shape[1]):
        c0, c1, c2, c3 = interpolated(
            order, rows[REST_AFTER, i], rows[REST, i], rows[REST + 1, i], rows[REST + 2, i]
        )
        _put_load(i, share, c0, c1, c2, c3, dt, work)
    _move(dt, order, blades, shaft, work, y)


# (x, blades, shaft, work) -> acceleration of the twist, 1/s2, less its sign, by the stiffness of blades in
# phase: what the rigid shaft of the last solution passes on to the nacelle from a rotor that is held
reaction_at = chosen_by_class("blades", {type(None): _no_reaction, BladeModes: _reaction})
# (dt, x, blades, shaft, work) -> coefficients (4) in s, 0 to 1 over the step from x, of the twist, rad, and
# of reaction_at: by z of twist_on beside a rotor that is held, else at the rate at x, and none
twist_over = chosen_by_class("blades", {type(None): _slow_twist_over, BladeModes: _twist_over})
# (x, blades, shaft, past, work, dx): after an evaluation of the rates dx at x, keeps what twist_on needs of
# it, before what past steps left
keep_twist = chosen_by_class("blades", {type(None): _keep_torque, BladeModes: _keep_twist})
# (y, blades, shaft, work, new): the same for twist_again, of the rates new at the predicted end y of a step
keep_twist_after = chosen_by_class("blades", {type(None): _keep_torque_after, BladeModes: _keep_rest_after})
# (steps, dt, x, u, order, history, past, blades, shaft, model, matrix, work, still, y): advances the twist,
# and blades in phase, by the loads of the last `order` steps; y has the velocities of Adams-Bashforth; still:
# work array
twist_on = chosen_by_class("blades", {type(None): _twist_on, BladeModes: _swing_on})
# (dt, x, u, order, new, history, blades, shaft, model, work, y): by the load at the end of the step, too; y
# has the velocities of Adams-Moulton
twist_again = chosen_by_class("blades", {type(None): _twist_again, BladeModes: _swing_again})
