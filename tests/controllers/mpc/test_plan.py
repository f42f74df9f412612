"""The plan of one period against slow twins: LQ feedback, differences of a plain simulation, a minimiser."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.optimize import minimize

from fowt_env import build_scene
from fowt_env.controllers.lqr.design import N_FEEDBACK, design_models
from fowt_env.controllers.lqr.optimum import generator_inertia
from fowt_env.controllers.mpc.law import PERIOD
from fowt_env.controllers.mpc.model import (
    FILTER,
    LEAN_RATE,
    SPEED,
    SURGE_RATE,
    TORQUE,
    WIND,
    _loads_at,
    _plant,
    cost_rows,
    lq,
    wind_model,
)
from fowt_env.controllers.mpc.plan import (
    BLOCK_ROWS,
    LIMITED,
    RATED_BLOCKS,
    grid_of,
    newton_step,
    shifted,
    work_of,
)
from fowt_env.controllers.mpc.rotor_table import rotor_table
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.controllers.mpc.weights import weights_over
from fowt_env.descriptions.turbine import read_turbine

TURBINE = read_turbine("nrel5mw")
SETTINGS = MPCSettings(horizon=10.0)
WIDE = np.tile([-1e9, 1e9], 6)
UNITS = np.array([0.05, 0.0035, 0.05, 0.0175, 0.063, 0.063])
NOWHERE = np.zeros((0, 2))


@pytest.fixture(scope="module")
def model():
    """WindModel of OC3 at 14 m/s, and the table of its rotor."""
    table = rotor_table(TURBINE, 1.225)
    models = design_models(build_scene("oc3_hywind", wind=14.0, fidelity="standard"))
    (one,) = (m for m in models if m.wind == 14.0)
    weights = weights_over(models, SETTINGS, TURBINE, 0.1)[14.0]
    return wind_model(one, one, weights, TURBINE, table, PERIOD), table


def state(seed, size=1.0):
    """A state that is some way from the trim."""
    scale = np.array([1.0, 0.02, 0.3, 0.003, 0.05, 0.02, 0.03, 0.02, 0.1, 1.0, 1.5, 0.5, 0.5])
    return size * scale * np.random.default_rng(seed).standard_normal(N_FEEDBACK)


def gain_of(model, ahead):
    """The LQ gain, without the wind where that is known ahead."""
    gain = model.K.copy()
    if len(ahead):
        gain[:, FILTER : WIND + 1] = 0.0
    return gain


def solved(model, table, x, moves, nonlinear, ahead=NOWHERE, limits=WIDE):
    """(step, whether limits are kept, Work) of newton_step about moves."""
    grid, work = grid_of(SETTINGS, PERIOD), None
    work = work_of(grid)
    work.states[0] = x
    step = np.zeros_like(moves)
    kept = newton_step(
        model, gain_of(model, ahead), 14.0, table, nonlinear, np.zeros(8), np.zeros(N_FEEDBACK), ahead,
        limits, UNITS, grid, moves, work, step,
    )  # fmt: skip
    return step, kept, work


def plain_cost(model, table, x, moves, nonlinear, ahead):
    """Cost of a plan by simulating it, one array at a time."""
    grid, gain = grid_of(SETTINGS, PERIOD), gain_of(model, ahead)
    rows, total, loads = model.rows[:6], 0.0, np.empty(8)
    for k, block in enumerate(grid.block_of):
        if k < len(ahead):
            x = x.copy()
            x[[FILTER, WIND]] = ahead[k]
        u = moves[2 * block : 2 * block + 2] - gain @ x
        if k > 0:
            total += model.weights[:6] @ (rows @ x) ** 2
        total += model.weights[6:] @ u**2
        change = np.array([x[WIND] + model.motion @ x[[SURGE_RATE, LEAN_RATE]], x[SPEED], x[SPEED + 1]])
        excess = np.zeros(2)
        if nonlinear:
            _loads_at(14.0 + change[0], *(model.trim[SPEED : SPEED + 2] + change[1:]), table, loads)
            excess = (loads - model.loads)[[0, 4]] - [model.loads[1:4] @ change, model.loads[5:8] @ change]
        x = model.A @ x + model.B @ u + model.G @ excess
    return 0.5 * (total + x @ model.P @ x)


def test_without_limits_and_with_linear_loads_the_plan_is_the_lq_feedback(model):
    """Whatever plan it starts from, one step leads to no corrections, to rounding."""
    wind, table = model
    for seed in range(5):
        moves = 0.01 * np.random.default_rng(seed).standard_normal(2 * len(grid_of(SETTINGS, PERIOD).ends))
        step, kept, _ = solved(wind, table, state(seed), moves, nonlinear=False)
        assert kept
        assert np.abs(moves + step).max() < 1e-9


def test_the_feedback_is_that_of_the_riccati_equation(model):
    wind, _ = model
    q, r = wind.rows.T @ np.diag(wind.weights) @ wind.rows, np.diag(wind.weights[6:])
    p = solve_discrete_are(wind.A, wind.B, q, r)
    assert wind.P == pytest.approx(p, rel=1e-6)
    assert wind.K == pytest.approx(
        np.linalg.solve(r + wind.B.T @ p @ wind.B, wind.B.T @ p @ wind.A), rel=1e-6
    )
    assert np.abs(np.linalg.eigvals(wind.A - wind.B @ wind.K)).max() < 1.0


@pytest.mark.parametrize("nonlinear", [False, True])
@pytest.mark.parametrize("foreseen", [False, True])
def test_the_gradient_is_that_of_the_simulated_cost(model, nonlinear, foreseen):
    """Central differences over each move; the table's slopes are those of its own nodes, hence 2 %."""
    wind, table = model
    rng = np.random.default_rng(3)
    ahead = np.cumsum(rng.normal(0.0, 0.4, (8, 2)), axis=0) if foreseen else NOWHERE
    x, grid = state(3), grid_of(SETTINGS, PERIOD)
    moves = rng.normal(0.0, 0.003, 2 * len(grid.ends))
    _, _, work = solved(wind, table, x, moves, nonlinear, ahead)
    gradient = []
    for i in range(len(moves)):
        change = np.zeros_like(moves)
        change[i] = 1e-4
        up, down = (plain_cost(wind, table, x, moves + sign * change, nonlinear, ahead) for sign in (1, -1))
        gradient.append((up - down) / 2e-4)
    within = 2e-2 if nonlinear else 1e-6
    assert work.g == pytest.approx(gradient, rel=within, abs=within * np.abs(gradient).max())


def test_steps_from_period_to_period_reach_the_optimum_of_the_nonlinear_problem(model):
    """Four steps in place, against a general minimiser of the simulated cost."""
    wind, table = model
    x, moves = state(5), np.zeros(2 * len(grid_of(SETTINGS, PERIOD).ends))
    for _ in range(4):
        step, _, work = solved(wind, table, x, moves, nonlinear=True)
        moves = moves + step
    scale = 1.0 / np.sqrt(np.diag(work.H))
    best = minimize(lambda z: plain_cost(wind, table, x, z * scale, True, NOWHERE), np.zeros_like(moves))
    start, reached = (plain_cost(wind, table, x, m, True, NOWHERE) for m in (np.zeros_like(moves), moves))
    assert best.fun < reached + 1e-9 < start
    assert reached - best.fun < 0.05 * (start - best.fun)


def test_limited_quantities_are_those_of_the_prediction(model):
    """Rows of the program: what a change of plan does to the rates and to torque, pitch command and speed."""
    wind, table = model
    x, grid = state(7), grid_of(SETTINGS, PERIOD)
    limits = np.array([-0.3, 0.3, -0.14, 0.14, -0.5, 0.1, -0.15, 1.4, -1.2, 0.19, 0.0, 1.45])
    moves = np.zeros(2 * len(grid.ends))
    _, _, work = solved(wind, table, x, moves, False, limits=limits)
    _, _, later = solved(wind, table, x, moves + 1e-3, False, limits=limits)
    linear = np.ones(len(work.low), dtype=bool)
    linear[2 * RATED_BLOCKS + len(LIMITED) :: BLOCK_ROWS] = False  # the power, which is a product
    for which, within in ((linear, 1e-9), (~linear, 1e-3)):
        moved = (work.low - work.C @ np.full_like(moves, 1e-3))[which]
        assert moved == pytest.approx(later.low[which], rel=within, abs=within)
    row = 2 * RATED_BLOCKS + BLOCK_ROWS * (len(grid.ends) - 1)
    for place, name in enumerate(LIMITED):
        reached = work.states[-1, name]
        assert work.high[row + place] == pytest.approx((limits[5 + 2 * place] - reached) / UNITS[2 + place])
    power = (wind.trim[[TORQUE, SPEED]] + work.states[-1, [TORQUE, SPEED]]).prod()
    assert work.high[row + len(LIMITED)] == pytest.approx((1.45 - power) / UNITS[-1])
    first = -(wind.K @ x)
    assert work.low[:2] == pytest.approx((limits[[0, 2]] - first) / UNITS[:2])


def test_a_plan_one_period_on_keeps_its_moves():
    grid = grid_of(SETTINGS, PERIOD)
    moves = np.arange(2.0 * len(grid.ends))
    later = np.zeros_like(moves)
    shifted(moves, grid, later)
    old, new = moves[0::2][grid.block_of], later[0::2][grid.block_of]
    assert list(later[:6]) == [2.0, 3.0, 4.0, 5.0, 6.0, 7.0]  # blocks of one period
    assert new.sum() == pytest.approx(old[1:].sum() + old[-1])


def test_the_feedback_holds_for_any_period():
    models = design_models(build_scene("oc3_hywind", wind=14.0, fidelity="standard"))
    (one,) = (m for m in models if m.wind == 18)
    weights = weights_over(models, SETTINGS, TURBINE, 0.1)[18.0]
    a, b = _plant(one, TURBINE)
    rows = cost_rows(a, TURBINE.rated_rotor_speed, generator_inertia(TURBINE, one.torque))
    rates = []
    for period in (0.1, 0.5):
        gain, _ = lq(a, b, rows, period * weights, period)
        rates.append(np.linalg.eigvals(a - b @ gain).real.max())
    assert rates[0] == pytest.approx(rates[1], rel=0.1)
