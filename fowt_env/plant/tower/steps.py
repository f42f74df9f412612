"""Corrects Adams-Bashforth 4 time steps for the structural force of a flexible tower (theory.md, 6.3)."""

from fowt_env.plant.accelerations import find_modes, rotation_along_shaft, substitute_spd, without_modes
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State
from fowt_env.plant.tower.loads import add_modal, begin_modal
from fowt_env.plant.tower.modes import bend_by_modes, from_nacelle

# factor on the fourth difference of the structural force: error constant of Adams-Bashforth 4 (251/720) minus
# that of Adams-Moulton 4 for the deflections (19/720), so that errors of velocity and position cancel
ELASTIC_WEIGHT = 232.0 / 720.0
# passes, each with the new force: time steps are stable to 0.7/frequency with 1 pass, 1.29 with 2
ELASTIC_ROUNDS = 2


@kernel
def fill_impulse(load, x, bend, tower, still, dx, cache):
    """Copy the deflections of x to `still`; put the generalised forces of a nacelle Wrench into dx.

    Discards the factors of the mass matrix, which is then evaluated at x, not at the last evaluation.
    """
    if bend is None:
        return
    cache[LoadCache.FACTORED] = 0.0
    n, q = len(tower.count), tower.first
    for i in range(n):
        still[q + i] = x[q + i]
        dx[q + n + i] = 0.0
    add_modal(load, bend, tower, dx[q + n :])


@kernel
def add_tower_steps(dt, dx, tower, x):
    """Add dt times the rates in dx to the deflection velocities in x; no-op for a rigid tower."""
    if tower is None:
        return
    v = tower.first + len(tower.count)
    for i in range(v, v + len(tower.count)):
        x[i] += dt * dx[i]


@kernel
def keep_elastic(x, tower, elastic):
    """Insert the structural forces at state x before those of past steps; no-op for a rigid tower."""
    if tower is None:
        return
    for k in range(elastic.shape[0] - 1, 0, -1):
        for i in range(len(tower.count)):
            elastic[k, i] = elastic[k - 1, i]
    begin_modal(x, tower, elastic[0])


@kernel
def correct_elastic(dt, x, history, body, tower, blades, matrix, elastic, still, extra, y):
    """Correct the Adams-Bashforth 4 velocities in y for the structural force of the tower.

    The force is linear in the new deflections and velocities, so its fourth difference with the new state is
    cheap to evaluate: theory.md, 6.3. matrix: factors left by the solve at the beginning of the step; still
    and extra (n_state,): scratch. No-op for a rigid tower. Bending blades and their rotor are not corrected:
    their inertia is in matrix, and neither enters the force.
    """
    if tower is None:
        return
    n, q = len(tower.count), tower.first
    v = q + n
    b, modal = extra[State.VX : State.WZ + 1], extra[v : v + n]
    new, done = still[v : v + n], still[q:v]
    done[:] = 0.0
    bend, t = bend_by_modes(x, tower), tower.shaft
    nx, ny, nz = from_nacelle(bend, t[0], t[1], t[2])
    for _ in range(ELASTIC_ROUNDS):
        for i in range(n):
            y[q + i] = x[q + i] + dt / 24.0 * (
                9.0 * y[v + i] + 19.0 * history[0, q + i] - 5.0 * history[1, q + i] + history[2, q + i]
            )  # fmt: skip
        begin_modal(y, tower, new)
        for i in range(n):
            past = 4.0 * (elastic[0, i] + elastic[2, i]) - 6.0 * elastic[1, i] - elastic[3, i]
            force = ELASTIC_WEIGHT * (new[i] - past)
            modal[i] = force - done[i]
            done[i] = force
        b[:] = 0.0
        without_modes(matrix, b, modal, n)
        if body.platform_fixed:
            b[:] = 0.0
        else:
            substitute_spd(matrix, b)
        find_modes(matrix, b, modal, n)
        for i in range(6):
            y[State.VX + i] += dt * b[i]
        for i in range(n):
            y[v + i] += dt * modal[i]
        if blades is None and not body.rotor_fixed:
            turning = rotation_along_shaft(0.0, 0.0, 0.0, b, modal, bend, tower, nx, ny, nz)
            y[State.ROTOR_SPEED] -= dt * body.coupling / body.rotor_row * turning
