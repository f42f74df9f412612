"""The native vector environment: the same bits as single ones, and Gymnasium's autoreset rules."""

import numba
import numpy as np
import pytest
from episodes import BOX, DEGRADED, INDIVIDUAL, ON_LQR, QUICK, WATCHED, actions, quick, same
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.envs.vector_env import of_one
from fowt_env.errors import InputError
from fowt_env.training.evaluation.plant_perturbation import plant_settings

THREADS = min(2, numba.config.NUMBA_NUM_THREADS)


def vector(n, **settings):
    return FowtVectorEnv(n, **(QUICK | {"threads": 1} | settings))


def same_infos(got, expected):
    """Whether infos equal those of a SyncVectorEnv, which spreads the episodes over nested arrays."""
    got, expected = dict(got), dict(expected)
    episodes, spread = got.pop("sampled", None), expected.pop("sampled", None)
    if episodes is not None:
        mask = got["_sampled"]
        assert all(of_one(spread, i) == episodes[i] for i in np.flatnonzero(mask))
        assert all(episodes[i] is None for i in np.flatnonzero(~mask))
    return same(got, expected)


OTHER_PLANT = plant_settings({"added_mass": 1.2, "mooring_stiffness": 0.8, "upper_mass": 1.05})
OWN = [
    {"wind": 10.0, "sea": {"kind": "regular", "H": 2.0, "T": 8.0}},
    {"wind": {"kind": "ntm", "speed": 20.0, "class": "A"}},
    {"reward": {"power": 5.0}},
]


@pytest.mark.parametrize(
    ("settings", "threads"),
    [
        ({"action_mode": "direct"}, 1),
        ({"action_mode": "direct"}, THREADS),
        ({"action_mode": "setpoint"}, THREADS),
        ({"action_mode": "residual"}, 1),
        ({"action_mode": "residual"}, THREADS),
        pytest.param({"fidelity": "fast", "rotor": None}, THREADS, marks=pytest.mark.nightly),
        ({"fidelity": "standard", "rotor": None}, THREADS),
        ({"per_env": OWN}, 1),
        (ON_LQR, 1),
        pytest.param(ON_LQR | {"action_mode": "direct", "baseline": "pi"}, 1, marks=pytest.mark.nightly),
        (ON_LQR | OTHER_PLANT | {"sensors": DEGRADED, "nominal_plant": {"platform": "oc3_hywind"}}, 1),
        (ON_LQR | {"sensors": {"noise": 0.01}}, 1),
        pytest.param(INDIVIDUAL, 1, marks=pytest.mark.nightly),
        pytest.param(WATCHED, 1, marks=pytest.mark.nightly),
        pytest.param(BOX, 2, marks=pytest.mark.nightly),
    ],
)
def test_each_of_the_batch_is_the_single_environment_bit_for_bit(settings, threads):
    n, steps = 3, 30
    batch = vector(n, threads=threads, **settings)
    given = np.random.default_rng(0).uniform(-1.1, 1.1, (steps, *batch.action_space.shape))
    seen = [batch.reset(seed=5)[0]]
    rewards, infos = [], []
    for row in given:
        observations, reward, terminated, truncated, info = batch.step(row)
        assert not terminated.any() and not truncated.any()
        seen.append(observations)
        rewards.append(reward)
        infos.append(info)
    each = settings.get("per_env", [{}] * n)
    for i in range(n):
        single = quick(**{name: value for name, value in settings.items() if name != "per_env"} | each[i])
        assert np.array_equal(seen[0][i], single.reset(seed=5 + i)[0])
        for k in range(steps):
            observation, reward, _, _, info = single.step(given[k, i])
            assert np.array_equal(seen[k + 1][i], observation) and rewards[k][i] == reward
            assert all(infos[k][key][i] == value and infos[k][f"_{key}"][i] for key, value in info.items())
        assert np.array_equal(batch.envs[i].view().state, single.view().state)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_resets_values_and_infos_are_those_of_gymnasium_s_own_vector_environment(mode):
    # one fails by overspeed in time, and all are cut at the end of their duration
    n = 3
    settings = QUICK | {"duration": 8.0, "wind": (17.0, 19.0)}
    batch = FowtVectorEnv(n, autoreset_mode=mode, threads=1, **settings)
    sync = SyncVectorEnv([lambda: FowtEnv(**settings)] * n, autoreset_mode=mode)
    assert batch.metadata["autoreset_mode"] == sync.metadata["autoreset_mode"] == mode
    assert batch.observation_space == sync.observation_space and batch.action_space == sync.action_space
    first, other = batch.reset(seed=2), sync.reset(seed=2)
    assert np.array_equal(first[0], other[0]) and same_infos(first[1], other[1])
    ends = np.zeros(2, dtype=int)
    for k, row in enumerate(actions(170, n, reach=1.1)):
        row[0] = (-1.0, -1.0)  # no torque, blades flat
        got, expected = batch.step(row), sync.step(row)
        for a, b in zip(got[:4], expected[:4], strict=True):
            assert a.dtype == b.dtype and np.array_equal(a, b), k
        assert same_infos(got[4], expected[4]), k
        ends += got[2].sum(), got[3].sum()
    assert ends[0] >= 1 and ends[1] >= 3, ends


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_an_episode_that_fails_in_its_last_step_is_terminated_and_not_truncated(mode):
    options = {"offsets": {"PtfmPitch": 78.0, "RotSpeed": 1.0}}  # it falls over, or turns too fast
    single = quick()
    single.reset(seed=0, options=options)
    steps = next(k for k in range(1, 100) if single.step((0.0, 0.0))[2])
    settings = QUICK | {"duration": round(0.1 * steps, 1)}
    single, batch = FowtEnv(**settings), FowtVectorEnv(2, autoreset_mode=mode, threads=1, **settings)
    single.reset(seed=0, options=options)
    batch.reset(seed=0, options=[options, {}])
    for _ in range(steps):
        *_, terminated, truncated, info = single.step((0.0, 0.0))
        *_, terminations, truncations, _ = batch.step(np.zeros((2, 2)))
    assert (terminated, truncated) == (True, False) and "termination" in info
    assert terminations.tolist() == [True, False] and truncations.tolist() == [False, True]


def test_disabled_autoreset_leaves_the_resets_to_the_caller():
    env = vector(3, autoreset_mode="Disabled", duration=0.2)
    env.reset(seed=0)
    other = vector(3, autoreset_mode="Disabled", duration=0.3)
    other.reset(seed=0)
    for row in actions(2, 3, reach=1.1):
        observations, _, _, truncated, _ = env.step(row)
    assert truncated.all()
    with pytest.raises(
        ResetNeeded, match=r"environment 0: the episode ended \(end of its duration\) at 0\.2"
    ):
        env.step(np.zeros((3, 2)))
    kept, _ = env.reset(options={"reset_mask": np.array([True, False, True])})
    assert np.array_equal(kept[1], observations[1]) and not np.array_equal(kept[0], observations[0])
    with pytest.raises(ResetNeeded, match="environment 1: the episode ended"):
        env.step(np.zeros((3, 2)))
    for mask in (np.zeros(3, dtype=bool), np.ones(2, dtype=bool), [True] * 3, np.ones(3)):
        with pytest.raises(InputError, match="reset_mask"):
            env.reset(options={"reset_mask": mask})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"per_env": [{}]}, "must be a list of 2 dicts"),
        ({"per_env": [{}, {"observation": ("surge",)}]}, "per_env\\[1\\]: the observation"),
        ({"per_env": [{}, {"action_mode": "residual"}]}, "per_env\\[1\\]: action_mode"),
        ({"per_env": [{}, {"mooring": False}]}, "in the compiled types of mooring"),
        ({"autoreset_mode": "SameStap"}, "Did you mean 'SameStep'"),
        ({"threads": 0}, "threads = 0"),
        ({"num_envs": 0}, "num_envs = 0"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        FowtVectorEnv(**(QUICK | {"num_envs": 2} | settings))


def test_an_unusable_action_is_refused_before_any_environment_moves():
    batch, untouched = vector(3), vector(3)
    batch.reset(seed=0)
    untouched.reset(seed=0)
    for value in (np.nan, np.inf, -np.inf):
        bad = np.zeros((3, 2))
        bad[2, 1] = value
        with pytest.raises(InputError, match="action of environment 2"):
            batch.step(bad)
    for bad in (np.zeros((2, 2)), np.zeros(6), None, "ab", [[0.0, 0.0], [0.0], [0.0, 0.0]]):
        with pytest.raises(InputError, match="actions"):
            batch.step(bad)
    good = np.full((3, 2), 0.2)
    assert np.array_equal(batch.step(good)[0], untouched.step(good)[0])


def test_saturated_actions_are_counted_for_each():
    batch = vector(2)
    batch.reset(seed=0)
    batch.step([[2.0, 0.0], [0.0, 0.0]])
    info = batch.step([[2.0, 0.0], [0.0, -3.0]])[4]
    assert info["saturated_actions"].tolist() == [2, 1]


def test_returned_arrays_are_the_caller_s_own():
    batch = vector(2)
    first = batch.reset(seed=0)[0]
    kept = first.copy()
    second = batch.step(np.ones((2, 2)))
    assert np.array_equal(first, kept)
    for values in second[:4]:
        values[:] = 0
    assert batch.step(np.ones((2, 2)))[0].any()


def test_the_thread_setting_of_numba_is_left_as_it_was():
    before = numba.get_num_threads()
    batch = vector(2, threads=THREADS)
    batch.reset(seed=0)
    batch.step(np.zeros((2, 2)))
    assert numba.get_num_threads() == before


def test_states_of_the_batch_are_saved_and_spread():
    batch = vector(3)
    batch.reset(seed=0)
    given = actions(6, 3, reach=1.1)
    batch.step(given[0])
    saved = batch.get_state()
    expected = [batch.step(row)[0] for row in given]
    batch.set_state(saved)
    assert all(np.array_equal(batch.step(row)[0], e) for row, e in zip(given, expected, strict=True))
    batch.set_state(saved[1])  # what-if: one state, three futures
    futures = [batch.step(np.repeat(row[1:2], 3, axis=0))[0] for row in given]
    assert all(
        np.array_equal(f, np.repeat(e[1:2], 3, axis=0)) for f, e in zip(futures, expected, strict=True)
    )
    with pytest.raises(InputError, match="2 snapshots"):
        batch.set_state(saved[:2])


def test_a_single_environment_moved_through_call_stays_in_the_batch():
    batch = vector(2)
    batch.reset(seed=0)
    batch.call("reset", seed=8, indices=[1])
    single = quick()
    single.reset(seed=8)
    assert np.array_equal(batch.step(np.zeros((2, 2)))[0][1], single.step((0.0, 0.0))[0])


def test_no_step_before_the_first_reset():
    with pytest.raises(ResetNeeded):
        vector(2).step(np.zeros((2, 2)))
