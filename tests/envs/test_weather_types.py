"""Weather of an episode: one compiled kind for all that an environment takes; refusals change nothing."""

import numba
import numpy as np
import pytest
from episodes import QUICK, quick
from gymnasium.error import ResetNeeded

from fowt_env.analysis.trim import mean_derivative
from fowt_env.descriptions.sea_state import JointTable
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.envs.episode import act, act_physical, start_episode
from fowt_env.envs.episode_batch import act_all
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError, PlantWarning
from fowt_env.plant.compile import handle

NTM = {"kind": "ntm", "speed": 16.0, "class": "B"}
JONSWAP = {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
CROSSING = {"kind": "components", "omega": [0.6, 0.9], "amplitude": [1.0, 0.5], "heading": [0.0, 30.0]}
U, Y, Z = np.full((2000, 9, 7), 15.0), np.linspace(-75.0, 75.0, 7), np.linspace(10.0, 170.0, 9)
BOX = {"kind": "box", "u": U, "y": Y, "z": Z, "dt": 0.5, "speed": 15.0}
FROZEN = np.array([0.0, 900.0])
FROZEN.flags.writeable = False
EPISODES = [
    {"wind": NTM, "sea": JONSWAP},
    {"wind": 14.0, "sea": None},
    {"wind": {"kind": "etm", "speed": 14.0, "class": "A"}, "sea": {"kind": "regular", "H": 2.0, "T": 8.0}},
    {"wind": {"kind": "eog", "speed": 14.0}, "sea": JONSWAP | {"Hs": 0.0}},
    {"wind": {"kind": "series", "time": FROZEN, "speed": [12.0, 15.0]}, "sea": CROSSING | {"heading": 40.0}},
    {"wind": {"kind": "steps", "speeds": [13.0, 15.0], "every": 50.0}, "sea": "still"},
    {"wind": "ntm:16:B", "sea": "jonswap:4:9"},
    {"wind": BOX, "sea": JONSWAP},  # rotor-averaged for the table: a series
]
ENTRIES = (act, act_physical, act_all, start_episode, mean_derivative)


def compiled():
    """How many forms of the entries there are; 0 where nothing is compiled."""
    known = (*ENTRIES, getattr(handle, "_filled_handle", None))
    return sum(len(getattr(entry, "signatures", ())) for entry in known)


def kind(env):
    return numba.typeof(env._config), numba.typeof(env._episode)


def test_no_wind_or_sea_has_anything_compiled():
    env = quick()
    env.reset(seed=0)
    env.step((0.0, 0.0))
    before, own = compiled(), kind(env)
    for options in (*EPISODES, {}):
        env.reset(options=options)
        env.step((0.0, 0.0))
        assert kind(env) == own and compiled() == before, options


@pytest.mark.parametrize("threads", [1, min(2, numba.config.NUMBA_NUM_THREADS)])
def test_a_batch_of_mixed_weather_has_the_bits_of_single_environments(threads):
    n, steps = len(EPISODES), 15
    given = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, n, 2))
    batch = FowtVectorEnv(n, threads=threads, **QUICK)
    batch.reset(seed=3)  # in other weather, all of it with a sea
    for turned in (EPISODES, EPISODES[::-1]):
        first, _ = batch.reset(seed=3, options=turned)
        results = [batch.step(row) for row in given]
        for i, options in enumerate(turned):
            single = quick()
            observation, _ = single.reset(seed=3 + i, options=options)
            assert np.array_equal(observation, first[i])
            for k in range(steps):
                observation, reward, *_ = single.step(given[k, i])
                assert np.array_equal(results[k][0][i], observation) and results[k][1][i] == reward


REFUSED = [
    ({"wind": None}, "needs a wind"),
    ({"sea": CROSSING}, "several headings cannot be summed fast"),
    ({"sea": {"kind": "regular", "H": 400.0, "T": 12.0}}, "water depth"),
    ({"wind": {"kind": "series", "time": [0.0, 60.0], "speed": [12.0, 12.0]}}, "ends at 60 s"),
    ({"wind": 18.0, "offsets": {"PtfmPitch": 100.0}}, "must be inside"),
    ({"wind": NTM | {"speed": (13.0, 11.0)}}, "the low end must not exceed the high end"),
    ({"wind": NTM, "sea": JONSWAP | {"Hs": (2.0, -1.0)}}, "sea.Hs"),
    ({"offsets": {"PtfmPitch": (3.0, 2.0)}}, "offsets"),
]


@pytest.mark.parametrize(("options", "message"), REFUSED)
def test_a_refused_reset_leaves_an_environment_in_its_episode(options, message):
    env, untouched = quick(action_mode="setpoint"), quick(action_mode="setpoint")
    for each in (env, untouched):
        each.reset(seed=5)
        each.step((0.3, -0.2))
    for seed in (None, 77):
        with pytest.raises(InputError, match=message):
            env.reset(seed=seed, options=options)
        assert np.array_equal(env.step((0.1, 0.2))[0], untouched.step((0.1, 0.2))[0])
        assert env.channels() == untouched.channels() and env.np_random_seed == 5
    assert np.array_equal(env.reset()[0], untouched.reset()[0])  # draws go on as if nothing had been asked


@pytest.mark.parametrize(("options", "message"), REFUSED)
def test_a_refused_reset_leaves_every_environment_of_a_batch(options, message):
    batch, untouched = (FowtVectorEnv(3, threads=1, **QUICK) for _ in range(2))
    rows = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 3, 2))
    for each in (batch, untouched):
        each.reset(seed=5)
        each.step(rows[0])
    with pytest.raises(InputError, match=f"^environment 2: .*{message}"):
        batch.reset(seed=9, options=[{"sea": None}, {}, options])
    with pytest.raises(InputError, match=f"^environment 0: .*{message}"):
        batch.reset(options=options)
    assert np.array_equal(batch.step(rows[1])[0], untouched.step(rows[1])[0])
    assert np.array_equal(batch.reset()[0], untouched.reset()[0])
    assert np.array_equal(batch.step(rows[2])[0], untouched.step(rows[2])[0])


def test_an_environment_in_still_water_refuses_a_sea_and_goes_on():
    env = quick(task="steady")
    env.reset(seed=1)
    assert env.scene.model.hydro.waves is None
    own = kind(env)
    with pytest.raises(InputError, match="sea = .*built in still water cannot gain a sea.*FowtEnv"):
        env.reset(options={"sea": JONSWAP})
    env.step((0.0, 0.0))
    env.reset(options={"wind": NTM, "sea": None})
    assert kind(env) == own


def test_a_box_of_full_field_wind_and_a_series_are_not_exchanged():
    for env, wind in ((FowtEnv(), BOX), (FowtEnv(wind=BOX, sea="still"), 15.0)):
        with pytest.raises(InputError, match="wind = .*cannot gain or lose its box"):
            env.reset(seed=1, options={"wind": wind})
        assert env.np_random_seed != 1
        with pytest.raises(ResetNeeded):
            env.step((0.0, 0.0))


CALM_BELOW_24 = JointTable(wind=(0.0, 24.0, 25.0), Hs=(0.0, 0.0, 3.0), Tp=(8.0, 8.0, 8.0))


@pytest.mark.parametrize(
    ("sea", "waves"),
    [
        (None, False),
        ("still", False),
        (JONSWAP | {"Hs": 0.0}, False),
        (JONSWAP | {"Hs": (0.0, 0.0)}, False),
        (JONSWAP | {"Hs": (0.0, 2.0)}, True),
        ({"kind": "regular", "H": (0.0, 1e-9), "T": 8.0}, True),
        ({"kind": "joint", "table": CALM_BELOW_24}, True),
        (CROSSING, True),
    ],
)
def test_the_kind_follows_from_all_that_a_task_can_draw(sea, waves):
    task = Task("ranges", {"kind": "steady", "speed": (4.0, 24.0)}, sea, rotor="table")
    env = FowtEnv(task, wave_components=20)
    assert task.has_sea == waves and (env.scene.model.hydro.waves is not None) == waves
    drawn = [task.draw(np.random.default_rng(seed)) for seed in range(3)]
    for episode in drawn:
        scene = env.scene.with_weather(episode.wind, episode.sea, episode.weather_seed)
        assert numba.typeof(scene.model) == numba.typeof(env.scene.model)


def test_a_snapshot_of_still_water_is_not_for_an_environment_with_a_sea():
    env, still = quick(task="steady", sea=JONSWAP), quick(task="steady")
    for each in (env, still):
        each.reset(seed=7)
    with pytest.raises(InputError, match="kind of weather"):
        env.set_state(still.get_state())
    batch = FowtVectorEnv(2, threads=1, task="steady", sea=JONSWAP, **QUICK)
    batch.reset(seed=1)
    before = batch.get_state()
    with pytest.raises(InputError, match="kind of weather"):
        batch.set_state([env.get_state(), still.get_state()])
    for old, new in zip(before, batch.get_state(), strict=True):
        assert all(map(np.array_equal, old.arrays, new.arrays))


def test_texts_are_weathers_of_tasks_and_resets():
    env = quick(wind="ntm:16:B", sea="jonswap:4:9")
    assert env.task.wind == NTM and env.task.sea == JONSWAP
    texts, mappings = (
        {"weather_seed": 3, "wind": w, "sea": s} for w, s in (("ntm:16:B", "jonswap:4:9"), (NTM, JONSWAP))
    )
    first, again = env.reset(seed=1, options=texts)[1], env.reset(seed=1, options=mappings)[1]
    assert first["sampled"] == again["sampled"]
    with pytest.raises(InputError, match=r"wind = 'ntm16': must be .*ntm:18:B"):
        env.reset(options={"wind": "ntm16"})
    with pytest.raises(InputError, match="an episode needs a wind"):
        env.reset(options={"wind": "none"})


def test_a_physical_command_in_degrees_is_warned_of_once():
    env = quick()
    env.reset(seed=1, options={"wind": 18.0})
    with pytest.warns(
        PlantWarning, match="step_physical: commanded blade pitch 14.8 rad = 848 deg"
    ) as caught:
        for _ in range(15):
            env.step_physical(43093.0, 14.8)
    assert len(caught) == 1
