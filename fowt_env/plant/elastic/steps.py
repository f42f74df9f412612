"""Corrects Adams-Bashforth 4 steps for the structure of tower and blades and the damping by the wind.

Structural forces are linear in the new deflections, so their fourth differences with the new state are cheap
to evaluate (theory.md, 6.3); the formula neglects these. For the tower they are applied to the whole turbine.

The wind damps flapping at 10 to 20 1/s, edgewise and second flapwise modes oscillate at 6 to 13 rad/s, and
Adams-Bashforth 4 alone is stable to 0.3 over the one, and errs in the damping of the other. The accelerations
-S q - D v by structure and by the wind at rated speed, of a blade on a hub at rest, are known well enough: S
and D are constant, so the fourth difference of this part is linear in the new velocities. The order stays 4
whatever S and D are.
"""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.elastic.chain import answer
from fowt_env.plant.elastic.tower import bend_by_modes, elastic_force
from fowt_env.plant.state import BLADES, State

IMPLICIT = 251.0 / 720.0  # factor on the fourth difference of a force: Adams-Moulton 4 less Adams-Bashforth 4
# factor on the fourth difference of the structural force: error constant of Adams-Bashforth 4 (251/720) minus
# that of Adams-Moulton 4 for the deflections (19/720), so that errors of velocity and position cancel
ELASTIC_WEIGHT = 232.0 / 720.0
# passes, each with the new force: time steps are stable to 0.7/frequency with 1 pass, 1.29 with 2
ELASTIC_ROUNDS = 2


@kernel
def keep_elastic(x, tower, elastic):
    """Insert the structural forces at state x before those of past steps; no-op for a rigid tower."""
    if tower is None:
        return
    for k in range(elastic.shape[0] - 1, 0, -1):
        for i in range(len(tower.beam.count)):
            elastic[k, i] = elastic[k - 1, i]
    elastic_force(x, tower, elastic[0])


@kernel
def correct_elastic(dt, x, history, body, tower, blades, matrix, work, elastic, still, extra, y):
    """Correct the Adams-Bashforth 4 velocities in y for the structural force of the tower.

    matrix: factors left by the solve at the beginning of the step; still and extra (n_state,): scratch. No-op
    for a rigid tower. Bending blades give way, but neither they nor the speed of their rotor are corrected.
    """
    if tower is None:
        return
    n, q = len(tower.beam.count), tower.first
    v = q + n
    b, modal = extra[State.VX : State.WZ + 1], extra[v : v + n]
    new, done = still[v : v + n], still[q:v]
    done[:] = 0.0
    bend = bend_by_modes(x, tower)
    for _ in range(ELASTIC_ROUNDS):
        for i in range(n):
            y[q + i] = x[q + i] + dt / 24.0 * (
                9.0 * y[v + i] + 19.0 * history[0, q + i] - 5.0 * history[1, q + i] + history[2, q + i]
            )  # fmt: skip
        elastic_force(y, tower, new)
        for i in range(n):
            past = 4.0 * (elastic[0, i] + elastic[2, i]) - 6.0 * elastic[1, i] - elastic[3, i]
            force = ELASTIC_WEIGHT * (new[i] - past)
            modal[i] = force - done[i]
            done[i] = force
        b[:] = 0.0
        turning = answer(0.0, bend, body, tower, matrix, work, b, modal)
        if blades is None:
            y[State.ROTOR_SPEED] += dt * turning
        for i in range(6):
            y[State.VX + i] += dt * b[i]
        for i in range(n):
            y[v + i] += dt * modal[i]


@kernel
def _no_deflections(x, blades, past):
    return


@inlined_kernel
def _keep(x, blades, past):
    size = BLADES * len(blades.beam.count)
    column = past.shape[1] - size
    for i in range(size):
        for k in range(past.shape[0] - 1, 0, -1):
            past[k, column + i] = past[k - 1, column + i]
        past[0, column + i] = x[blades.first + i]


# (x, blades, past): puts the deflections before those of past steps, the last columns of past
keep_blades = chosen_by_class("blades", {type(None): _no_deflections, BladeModes: _keep}, inlined=True)


@kernel
def _nothing_to_correct(dt, x, history, past, blades, work, y):
    return


@inlined_kernel
def _correct(dt, x, history, past, blades, work, y):
    n, a, b = len(blades.beam.count), work.mass, work.probe_rest
    size = BLADES * n
    column = past.shape[1] - size
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
    for number in range(BLADES):
        q, at = blades.first + n * number, column + n * number
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


# (dt, x, history, past, blades, work, y): velocities of the deflections in y, by Adams-Bashforth 4 from x,
# corrected; history of the derivatives of four steps and past of keep_blades, latest first
correct_blades = chosen_by_class(
    "blades", {type(None): _nothing_to_correct, BladeModes: _correct}, inlined=True
)
