"""Quadratic programs against a solver of another kind."""

import numpy as np
import pytest

pytest.importorskip("osqp", reason='OSQP is not installed: pip install "fowt-env[mpc]"')

from fowt_env.controllers.mpc import solver  # noqa: E402
from fowt_env.controllers.mpc.solver import SOFT, Program  # noqa: E402

MOVES, ROWS = 8, 12


def program(seed):
    """(H, g, C, low, high) with costs of very different sizes, as those of torque and pitch are."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((MOVES, MOVES)) * np.tile([1.0, 50.0], MOVES // 2)
    c = rng.standard_normal((ROWS, MOVES)) * np.tile([1.0, 50.0], MOVES // 2)
    return (
        root.T @ root + np.eye(MOVES),
        20.0 * rng.standard_normal(MOVES),
        c,
        -rng.random(ROWS),
        rng.random(ROWS),
    )


def newton(h, g, c, low, high):
    """The minimum, by Newton's method with the violated limits as further terms of the cost."""
    z = -np.linalg.solve(h, g)

    def cost(z):
        return 0.5 * z @ h @ z + g @ z + SOFT * np.sum((c @ z - np.clip(c @ z, low, high)) ** 2)

    for _ in range(200):
        beyond = c @ z - np.clip(c @ z, low, high)
        met = beyond != 0.0
        slope = h @ z + g + 2.0 * SOFT * c[met].T @ beyond[met]
        step, size = -np.linalg.solve(h + 2.0 * SOFT * c[met].T @ c[met], slope), 1.0
        while cost(z + size * step) > cost(z) and size > 1e-9:
            size *= 0.5
        z = z + size * step
    return z


def test_solutions_are_those_of_newtons_method_whatever_was_solved_before():
    """To 2e-3 of the step without limits, in units in which the cost is even."""
    one = Program(MOVES, ROWS)
    for seed in range(20):
        h, g, c, low, high = program(seed)
        start = -np.linalg.solve(h, g)
        found = one.solve(h, g, c, low, high, start)
        scale = np.sqrt(np.diag(h))
        assert np.abs(scale * (found - newton(h, g, c, low, high))).max() < 2e-3 * np.abs(scale * start).max()
        assert np.array_equal(found, Program(MOVES, ROWS).solve(h, g, c, low, high, start))


def test_limits_that_contradict_each_other_have_a_solution():
    h, g, c, low, high = program(0)
    c[1], low[1], high[1], low[0], high[0] = c[0], 1.0, 2.0, -2.0, -1.0
    assert Program(MOVES, ROWS).solve(h, g, c, low, high, np.zeros(MOVES)) is not None


def test_what_is_not_solved_is_none(monkeypatch):
    monkeypatch.setitem(solver.SETTINGS, "max_iter", 1)
    h, g, c, low, high = program(1)
    assert Program(MOVES, ROWS).solve(h, g, c, low, high, np.zeros(MOVES)) is None
    monkeypatch.undo()
    assert Program(MOVES, ROWS).solve(h, np.full(MOVES, np.nan), c, low, high, np.zeros(MOVES)) is None
