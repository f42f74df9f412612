"""Corrects Adams-Bashforth 4 steps for the stiffness of the tower and the damping of blades by the wind.

The structural force of the tower is linear in the new deflections, so its fourth difference with the new
state is cheap to evaluate (theory.md, 6.3).

The wind damps flapping at 10 to 20 1/s, and Adams-Bashforth 4 alone is stable to 0.3 over its step. The
damping D of a rotor at rated speed is known well enough: for the part -D v of the forces the explicit formula
is replaced by Adams-Moulton 4, which is linear in the new velocities. With D dt as large as the actual
damping the limit becomes 0.3 + 0.8 D dt, also where the wind damps less, and the order stays 4.
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
        for i in range(elastic.shape[1]):
            elastic[k, i] = elastic[k - 1, i]
    elastic_force(x, tower, elastic[0])


@kernel
def correct_elastic(dt, x, history, body, tower, blades, matrix, work, elastic, still, extra, y):
    """Correct the Adams-Bashforth 4 velocities in y for the structural force of the tower.

    matrix: factors left by the solve at the beginning of the step; still and extra (n_state,): scratch. No-op
    for a rigid tower, and with bending blades, whose short steps resolve the tower.
    """
    if tower is None:
        return
    if blades is not None:
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
        y[State.ROTOR_SPEED] += dt * answer(0.0, bend, body, tower, matrix, work, b, modal)
        for i in range(6):
            y[State.VX + i] += dt * b[i]
        for i in range(n):
            y[v + i] += dt * modal[i]


@kernel
def _nothing_to_damp(dt, history, blades, work, y):
    return


@kernel
def _extrapolated(i, history):
    """Return the rate of state i at the end of a step, by the cubic through the last four."""
    return 4.0 * (history[0, i] + history[2, i]) - 6.0 * history[1, i] - history[3, i]


@inlined_kernel
def _damp(dt, history, blades, work, y):
    n, a, b = len(blades.beam.count), work.mass, work.probe_rest
    size = BLADES * n
    for number in range(BLADES):
        q = blades.first + n * number
        for i in range(n):
            b[i] = y[size + q + i] - _extrapolated(q + i, history)
            for j in range(n):
                a[i, j] = IMPLICIT * dt * blades.decay[i, j]
            a[i, i] += 1.0
        for i in range(n):  # Gauss elimination: diagonally dominant
            for k in range(i + 1, n):
                factor = a[k, i] / a[i, i]
                for j in range(i + 1, n):
                    a[k, j] -= factor * a[i, j]
                b[k] -= factor * b[i]
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                b[i] -= a[i, j] * b[j]
            b[i] /= a[i, i]
            y[size + q + i] = b[i] + _extrapolated(q + i, history)


# (dt, history, blades, work, y): velocities of the deflections in y, by Adams-Bashforth 4, corrected; history
# of the derivatives of four steps, latest first
damp_blades = chosen_by_class("blades", {type(None): _nothing_to_damp, BladeModes: _damp})
