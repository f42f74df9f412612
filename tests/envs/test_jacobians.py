"""Jacobians of control periods: their products against central differences of whole runs."""

import numpy as np
import pytest
from episodes import INDIVIDUAL, quick

from fowt_env.descriptions.units import DEGREE
from fowt_env.envs import FowtEnv, PeriodJacobians
from fowt_env.envs.jacobians import SETTLING
from fowt_env.errors import InputError
from fowt_env.plant.advance import forget
from fowt_env.plant.state import State

PERIODS = 12
SPEEDS = {State.VX: 0.3, State.VY: 0.2, State.VZ: 0.1, State.WX: 0.02, State.WY: 0.03, State.WZ: 0.02}
FEATHER = 0.05 * DEGREE  # rad between successive commands: below the rate limit of the drive


def begun(env, change=0.0, state=None):
    """Reset an environment, with platform speeds at which drag has no corner, and a change of one state."""
    env.reset(seed=4)
    run = env.unwrapped._episode
    for index, speed in SPEEDS.items():
        run.x[index] += speed
    if state is not None:
        run.x[state] += change
    forget(env.unwrapped.scene.handle(run.data))


def commands(env):
    """Return (PERIODS, m) commands about those in force at the start."""
    begun(env)
    random = np.random.default_rng(0)
    given = np.tile(env.unwrapped._episode.u, (PERIODS, 1))
    given[:, 0] *= 1.0 + 1e-3 * random.normal(size=PERIODS)
    given[:, 1:] += FEATHER * random.uniform(-1.0, 1.0, (PERIODS, given.shape[1] - 1))
    return given


def reached(env, given):
    """Return the state (n_state,) after the commands."""
    for command in given:
        env.unwrapped.step_physical(*command)
    return env.unwrapped._episode.x.copy()


def chained(env, given):
    """Return (names, product of the state Jacobians, effect of a constant change of each command)."""
    followed = PeriodJacobians(env, memories=True)
    begun(followed)
    state = command = 0.0
    for values in given:
        jacobian = followed.step_physical(*values)[-1]["jacobian"]
        if np.ndim(state) == 0:
            state = np.eye(len(jacobian.states))
        state = jacobian.state @ state
        command = jacobian.state @ command + jacobian.command if np.ndim(command) else jacobian.command
    return jacobian.states, state, command


def central(env, given, size, **which):
    """Return the central difference (n_state,) of the final state."""
    ends = []
    for sign in (1.0, -1.0):
        values = given.copy()
        if "state" in which:
            begun(env, sign * size, which["state"])
        else:
            begun(env)
            values[:, which["command"]] += sign * size
        ends.append(reached(env, values))
    return (ends[0] - ends[1]) / (2.0 * size)


@pytest.mark.parametrize("settings", [
    pytest.param({}, id="collective"),
    pytest.param(INDIVIDUAL, id="individual", marks=pytest.mark.nightly),
])  # fmt: skip
def test_products_of_jacobians_are_central_differences_of_runs(settings):
    env = quick(**settings)
    given = commands(env)
    names, state, command = chained(env, given)
    assert names[:2] == ("surge", "sway") and len(names) == env.scene.n_state
    sizes = np.where(np.isin(range(len(names)), [3, 4, 5, 10, 11, 12, *env.scene.pitch_states]), 0.1, 1.0)
    for i, size in enumerate(sizes):
        expected = central(env, given, 1e-6 * size, state=i)
        np.testing.assert_allclose(state[:, i] * size / sizes, expected * size / sizes, atol=2e-6)
    for k, size in enumerate([1e4, *[0.1] * (given.shape[1] - 1)]):
        expected = central(env, given, 1e-5 * size, command=k)
        np.testing.assert_allclose(command[:, k] * size / sizes, expected * size / sizes, atol=2e-6)


def test_the_wind_column_is_the_effect_of_a_faster_wind():
    sea = {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0}  # not the one that goes with the wind
    winds = {speed: quick(wind=speed, sea=sea) for speed in (18.0, 18.0 + 1e-4, 18.0 - 1e-4)}
    env = winds[18.0]
    given = commands(env)
    followed = PeriodJacobians(env)
    begun(followed)
    start, effect = env._episode.x.copy(), 0.0
    for values in given:
        jacobian = followed.step_physical(*values)[-1]["jacobian"]
        effect = jacobian.wind + (jacobian.state @ effect if np.ndim(effect) else 0.0)
    ends = []
    for speed in (18.0 + 1e-4, 18.0 - 1e-4):
        begun(winds[speed])
        winds[speed]._episode.x[:] = start
        ends.append(reached(winds[speed], given))
    np.testing.assert_allclose(effect, (ends[0] - ends[1]) / 2e-4, atol=1e-7)


def test_a_shifted_plant_moves_away_as_the_jacobians_of_the_other_say():
    """Also what the time step keeps of past steps: without it the first step would be wrong by a half."""
    env, other = PeriodJacobians(quick(), memories=True), PeriodJacobians(quick(), memories=True)
    given = commands(env)
    for followed in (env, other):
        begun(followed)
        for values in given[:4]:
            jacobian = followed.step_physical(*values)[-1]["jacobian"]
    np.testing.assert_array_equal(jacobian.end, env.unwrapped._episode.x[env._columns.moving])
    change = np.random.default_rng(1).normal(size=len(jacobian.states)) * 1e-5
    moving = env._columns.moving
    env.shift(change)
    left = change
    for values in given[4:]:
        left = other.step_physical(*values)[-1]["jacobian"].state @ left
        assert env.step_physical(*values)[-1]["jacobian"] is not None
        found = env.unwrapped._episode.x - other.unwrapped._episode.x
        np.testing.assert_allclose(found[moving], left, atol=2e-9)


def test_changes_that_cannot_be_made_are_refused():
    env = PeriodJacobians(quick())
    env.reset(seed=4)
    n = len(env.step(env.unwrapped.last_action)[-1]["jacobian"].states)
    for wrong in (np.zeros(n + 1), np.full(n, np.nan)):
        with pytest.raises(InputError, match=f"{n} finite numbers"):
            env.shift(wrong)
    env.unwrapped.set_state(env.unwrapped.get_state())
    env.step(env.unwrapped.last_action)
    other = PeriodJacobians(quick())
    other.reset(seed=5)
    other.unwrapped.set_state(env.unwrapped.get_state())
    with pytest.raises(InputError, match="no Jacobian is known"):
        other.shift(np.zeros(n))


def test_a_jacobian_is_missing_until_the_columns_know_the_past_and_then_the_same():
    """After set_state the multistep scheme has a past that the columns did not follow."""
    env, other = PeriodJacobians(quick()), PeriodJacobians(quick())
    given = commands(env)[0]
    for followed in (env, other):
        begun(followed)
    for _ in range(4):
        assert env.step_physical(*given)[-1]["jacobian"] is not None
    other.unwrapped.set_state(env.unwrapped.get_state())
    for _ in range(SETTLING):
        env.step_physical(*given)
        assert other.step_physical(*given)[-1]["jacobian"] is None
    whole = env.step_physical(*given)[-1]["jacobian"]
    later = other.step_physical(*given)[-1]["jacobian"]
    np.testing.assert_allclose(later.state, whole.state, atol=3e-6)
    assert np.array_equal(env.unwrapped._episode.x, other.unwrapped._episode.x)


def test_the_environment_itself_is_unchanged():
    env, alone = PeriodJacobians(quick()), quick()
    for each in (env, alone):
        each.reset(seed=2)
    action = np.array([0.1, -0.2])
    for _ in range(5):
        observation, reward, *_ = env.step(action)
        expected = alone.step(action)
        assert np.array_equal(observation, expected[0]) and reward == expected[1]


def test_decisions_of_several_periods_are_refused():
    with pytest.raises(InputError, match="needs decisions=None"):
        PeriodJacobians(FowtEnv(decisions={"hold": 5}))
