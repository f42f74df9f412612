"""Advances the bending of the tower exactly, and damps blades in the wind, within Adams steps.

Tower: in its own modes p the deflections follow p'' = g - w2 p - 2 d p', where g, the rest of their rates, is
smooth. A step extrapolates g as a cubic, solves for the oscillation exactly, and gives platform and rotor the
velocities that an impulse on the tower alone, of the difference from the Adams formula, gives them: momentum
is kept, and the step does not depend on the frequencies of the tower.

Blades: the wind damps flapping at 10 to 20 1/s, edgewise and second flapwise modes oscillate at 6 to 13
rad/s, and Adams-Bashforth 4 alone is stable to 0.3 over the one, and errs in the damping of the other. The
accelerations -S q - D v by structure and by the wind at rated speed, on a hub that gives way by half, are
known well enough: S and D are constant, so the fourth difference of this part, which the formula neglects, is
linear in the new velocities. The order stays 4 whatever S and D are. On a shaft that twists, bending in phase
is exact (in_phase.py), and the correction, for a hub at rest, is that of the differences between blades.
"""

from math import atan2, cos, sin

from fowt_env.plant.adams import extrapolated, interpolated
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.elastic.chain import answer
from fowt_env.plant.elastic.in_phase import note_means, reaction_at, restore_means, twist_over
from fowt_env.plant.elastic.oscillator import swung_by, turn_in
from fowt_env.plant.elastic.shaft import Torsion, rate_by_twist
from fowt_env.plant.elastic.tower import bend_by_modes, kept_bend
from fowt_env.plant.state import BLADES, State

IMPLICIT = 251.0 / 720.0  # factor on the fourth difference of a force: Adams-Moulton 4 less Adams-Bashforth 4
# factor on that of a force linear in deflections: error constant of Adams-Bashforth 4 (251/720) minus that of
# Adams-Moulton 4 for the deflections (19/720), so that errors of velocity and position cancel
ELASTIC_WEIGHT = 232.0 / 720.0
# rows of RotorScratch.swing, of the tower's own modes: square of the frequency, 1/s2, and decay, 1/s; then
# results of turn_in for a step, s
SQUARE, DECAY, STEP, LEFT, COSINE, SINE = range(6)
ROUNDS = 2  # of the impulse on the tower, whose inertia is that at the first step
JACOBI_SWEEPS = 8


@kernel
def begin_swing(steps, x, body, tower, blades, matrix, work, still):
    """Find the tower's own modes with the mass of the last solution, at x, before the first step.

    Not later: a change would break the polynomials through past g. With flexibility G and stiffness L L^T
    they are those of the symmetric L^T G L.
    """
    if tower is None:
        return
    if steps > 0:
        return
    n, bend = len(tower.beam.count), bend_by_modes(x, tower)
    A, W, G = work.impulse, work.from_own, work.to_own
    v = tower.first + n
    for j in range(n):
        still[:] = 0.0
        still[v + j] = 1.0  # N, on a deflection
        answer(0.0, bend, body, tower, blades, matrix, work, still)
        for i in range(n):
            G[i, j] = still[v + i]
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.0
            for k in range(n):
                for m in range(n):
                    A[i, j] += tower.root[k, i] * G[k, m] * tower.root[m, j]
    _find_eigenvectors(A, W)
    L, R = tower.root, tower.flexible_root
    for i in range(n):
        work.swing[SQUARE, i], work.swing[STEP, i] = A[i, i], 0.0
        for j in range(n):
            G[i, j] = 0.0
            for k in range(n):
                G[i, j] += W[k, i] * L[j, k]
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.0
            for k in range(n):
                A[i, j] += G[k, i] * G[k, j] / work.swing[SQUARE, k]
    for j in range(n):  # W to R W, column by column
        for i in range(n):
            still[i] = 0.0
            for k in range(n):
                still[i] += R[i, k] * W[k, j]
        for i in range(n):
            W[i, j] = still[i]
    for i in range(n):  # damping on its own mode: 2 decay = w2 from_own^T D from_own
        damped = 0.0
        for j in range(n):
            for k in range(n):
                damped += W[j, i] * tower.beam.damping[j, k] * W[k, i]
        work.swing[DECAY, i] = 0.5 * work.swing[SQUARE, i] * damped


@kernel
def _find_eigenvectors(A, W):
    """Turn the symmetric A (n, n) into its eigenvalues on the diagonal, with eigenvectors W: Jacobi."""
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            W[i, j] = 1.0 if i == j else 0.0
    for _ in range(JACOBI_SWEEPS):
        for p in range(n - 1):
            for q in range(p + 1, n):
                angle = 0.5 * atan2(2.0 * A[p, q], A[q, q] - A[p, p])
                c, s = cos(angle), sin(angle)
                for k in range(n):
                    A[k, p], A[k, q] = c * A[k, p] - s * A[k, q], s * A[k, p] + c * A[k, q]
                for k in range(n):
                    A[p, k], A[q, k] = c * A[p, k] - s * A[q, k], s * A[p, k] + c * A[q, k]
                for k in range(n):
                    W[k, p], W[k, q] = c * W[k, p] - s * W[k, q], s * W[k, p] + c * W[k, q]


@kernel
def _keep_turns(dt, swing):
    """Keep what a free oscillation of the tower's own modes does in a step, until the step changes."""
    for i in range(swing.shape[1]):
        if swing[STEP, i] != dt:
            swing[STEP, i] = dt
            swing[LEFT, i], swing[COSINE, i], swing[SINE, i] = turn_in(dt, swing[SQUARE, i], swing[DECAY, i])


@kernel
def keep_swing(x, tower, blades, shaft, work, dx):
    """Put g, smooth and without the twist, of the rates dx at x, in place of the deflections' rates in dx."""
    if tower is None:
        return
    n, q, reaction = len(tower.beam.count), tower.first, reaction_at(x, blades, shaft, work)
    for i in range(n):
        p = rate = smooth = 0.0
        for j in range(n):
            p += work.to_own[i, j] * x[q + j]
            rate += work.to_own[i, j] * x[q + n + j]
            steady = dx[q + n + j] - rate_by_twist(q + n + j, reaction, shaft, work, dx)
            smooth += work.to_own[i, j] * steady
        dx[q + i] = smooth + work.swing[SQUARE, i] * p + 2.0 * work.swing[DECAY, i] * rate


@kernel
def swing_on(dt, x, order, history, body, tower, blades, shaft, matrix, work, still, extra, y):
    """Advance the tower by the g of the last `order` steps; y has the Adams-Bashforth velocities."""
    if tower is None:
        return
    _keep_turns(dt, work.swing)
    twist, reaction = twist_over(dt, x, blades, shaft, work)
    for i in range(tower.first, tower.first + len(tower.beam.count)):
        c = extrapolated(order, history[0, i], history[1, i], history[2, i], history[3, i])
        _swing_mode(i - tower.first, dt, x, y, c, twist, reaction, tower, shaft, work, still)
    _move_tower(kept_bend(tower, work), body, tower, blades, matrix, work, still, extra, y)


@kernel
def swing_again(dt, x, order, new, history, body, tower, blades, shaft, matrix, work, still, extra, y):
    """Advance the tower by the g at the end of the step, too; y has the Adams-Moulton velocities."""
    if tower is None:
        return
    _keep_turns(dt, work.swing)
    twist, reaction = twist_over(dt, x, blades, shaft, work)
    for i in range(tower.first, tower.first + len(tower.beam.count)):
        c = interpolated(order, new[i], history[0, i], history[1, i], history[2, i])
        _swing_mode(i - tower.first, dt, x, y, c, twist, reaction, tower, shaft, work, still)
    _move_tower(bend_by_modes(x, tower), body, tower, blades, matrix, work, still, extra, y)


@inlined_kernel
def _swing_alone(i, dt, x, y, c, twist, reaction, tower, shaft, work, still):
    n, q, over = len(tower.beam.count), tower.first, 1.0 / dt
    p = rate = 0.0
    for j in range(n):
        p += work.to_own[i, j] * x[q + j]
        rate += work.to_own[i, j] * x[q + n + j]
    still[q + i], still[q + n + i] = swung_by(
        p, rate, c[0], c[1] * over, c[2] * over * over, c[3] * over * over * over, dt, work.swing[SQUARE, i],
        work.swing[DECAY, i], work.swing[LEFT, i], work.swing[COSINE, i], work.swing[SINE, i],
    )  # fmt: skip


@inlined_kernel
def _swing_with_twist(i, dt, x, y, c, twist, reaction, tower, shaft, work, still):
    n, q, v, t = len(tower.beam.count), tower.first, tower.first + len(tower.beam.count), shaft.first
    square, over, share = work.swing[SQUARE, i], 1.0 / dt, 0.0
    a, b, d = twist, reaction, 2.0 * work.swing[DECAY, i] / dt
    p = rate = 0.0
    for j in range(n):
        share += work.to_own[i, j] * work.twist[1, v + j]
        p += work.to_own[i, j] * x[q + j]
        rate += work.to_own[i, j] * x[v + j]
    p, rate = swung_by(
        p - share * x[t],
        rate - share * x[t + 1],
        c[0] + share * (b[0] - square * a[0] - d * a[1]),
        (c[1] + share * (b[1] - square * a[1] - 2.0 * d * a[2])) * over,
        (c[2] + share * (b[2] - square * a[2] - 3.0 * d * a[3])) * over * over,
        (c[3] + share * (b[3] - square * a[3])) * over * over * over,
        dt, square, work.swing[DECAY, i], work.swing[LEFT, i], work.swing[COSINE, i], work.swing[SINE, i],
    )  # fmt: skip
    still[q + i], still[v + i] = p + share * y[t], rate + share * y[t + 1]


# (i, dt, x, y, c, twist, reaction, tower, shaft, work, still): puts own mode i and its rate after dt into
# still, with the coefficients c (4) of g. A twist that bends the tower by its share alone leaves the rest
# p - share q, which is smooth: the spring of the tower pulls it back by all of p. twist, reaction: of
# twist_over
_swing_mode = chosen_by_class("shaft", {type(None): _swing_alone, Torsion: _swing_with_twist})


@inlined_kernel
def _move_tower(bend, body, tower, blades, matrix, work, still, extra, y):
    """Give y the deflections of the own modes in still, and their velocities, by an impulse on the tower."""
    n, q = len(tower.beam.count), tower.first
    v = q + n
    for i in range(n):
        y[q + i] = 0.0
        for j in range(n):
            y[q + i] += work.from_own[i, j] * still[q + j]
    for i in range(n):
        still[q + i] = 0.0
        for j in range(n):
            still[q + i] += work.from_own[i, j] * still[v + j]
    for _ in range(ROUNDS):
        extra[:] = 0.0
        for i in range(n):
            for j in range(n):
                extra[v + i] += work.impulse[i, j] * (still[q + j] - y[v + j])
        answer(0.0, bend, body, tower, blades, matrix, work, extra)
        for i in range(State.VX, y.shape[0]):
            y[i] += extra[i]


@kernel
def _no_deflections(x, blades, past):
    return


@inlined_kernel
def _keep(x, blades, past):
    size = BLADES * len(blades.beam.count)
    for i in range(size):
        for k in range(past.shape[0] - 1, 0, -1):
            past[k, i] = past[k - 1, i]
        past[0, i] = x[blades.first + i]


# (x, blades, past): puts the deflections before those of past steps
keep_blades = chosen_by_class("blades", {type(None): _no_deflections, BladeModes: _keep})


@kernel
def _nothing_to_correct(dt, x, history, past, blades, shaft, work, y):
    return


@inlined_kernel
def _correct(dt, x, history, past, blades, shaft, work, y):
    n, a, b = len(blades.beam.count), work.mass, work.solved
    size = BLADES * n
    pull, drag = ELASTIC_WEIGHT * dt, IMPLICIT * dt
    for i in range(n):
        for j in range(n):
            a[i, j] = pull * dt * 9.0 / 24.0 * blades.spring[i, j] + drag * blades.decay[i, j]
        a[i, i] += 1.0
    for i in range(n):  # Gauss elimination: diagonally dominant
        for k in range(i + 1, n):
            a[k, i] /= a[i, i]
            for j in range(i + 1, n):
                a[k, j] -= a[k, i] * a[i, j]
    note_means(blades, shaft, work, y)
    for number in range(BLADES):
        q, at = blades.first + n * number, n * number
        for i in range(n):
            b[i] = y[size + q + i]
        for j in range(n):
            k = q + j
            now, last, before, first = history[0, k], history[1, k], history[2, k], history[3, k]
            # deflection by Adams-Moulton 4 without its new velocity, less the cubic through the last four
            known = x[k] + dt / 24.0 * (19.0 * now - 5.0 * last + before)
            known -= 4.0 * (past[0, at + j] + past[2, at + j]) - 6.0 * past[1, at + j] - past[3, at + j]
            speed = 4.0 * (now + before) - 6.0 * last - first
            for i in range(n):
                b[i] += drag * blades.decay[i, j] * speed - pull * blades.spring[i, j] * known
        for k in range(n):
            for i in range(k + 1, n):
                b[i] -= a[i, k] * b[k]
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                b[i] -= a[i, j] * b[j]
            b[i] /= a[i, i]
            y[size + q + i] = b[i]
    restore_means(blades, shaft, work, y)


# (dt, x, history, past, blades, shaft, work, y): velocities of the deflections in y, by Adams-Bashforth 4
# from x, corrected, but not their means on a shaft that twists; history of the derivatives of four steps and
# past of keep_blades, latest first
correct_blades = chosen_by_class("blades", {type(None): _nothing_to_correct, BladeModes: _correct})
