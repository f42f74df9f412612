"""Environments whose blades, tower and shaft bend: snapshots, observations, faults of single blades."""

import numpy as np
import pytest

import fowt_env
from fowt_env.envs import FowtEnv, FowtVectorEnv

SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
ELASTIC = {"blades": "modes2", "tower": "modes2", "shaft": "torsion"}
WEATHER = {"wind": 18.0, "sea": SEA, "duration": 60.0}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def env():
    return FowtEnv(**WEATHER, **ELASTIC)


def actions(env, count):
    rng = np.random.default_rng(0)
    return rng.uniform(-0.2, 0.2, (count, *env.action_space.shape))


@pytest.mark.nightly
def test_a_snapshot_continues_bit_for_bit_also_in_another_environment(env):
    env.reset(seed=1)
    todo = actions(env, 40)
    for action in todo[:20]:
        env.step(action)
    snapshot = env.get_state()

    def rest(here):
        here.set_state(snapshot)
        steps = [here.step(action)[:2] for action in todo[20:]]
        return [*map(np.append, *zip(*steps, strict=True)), here._episode.x.copy()]

    there = FowtEnv(**WEATHER, **ELASTIC)
    there.reset(seed=7)
    first, again, other = rest(env), rest(env), rest(there)
    for a, b, c in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(a, c)


def test_an_episode_begins_bent_and_is_observed_as_a_rigid_turbine(env):
    plain = FowtEnv(**WEATHER)
    assert [entry.name for entry in env.observed] == [entry.name for entry in plain.observed]
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    channels = env.channels()
    assert channels["OoPDefl1"] > 0.5 and channels["Q_DrTr"] > 1e-3
    hold = observation[:2]
    speeds = [env.step(hold)[-1] and env.channels()["RotSpeed"] for _ in range(30)]
    assert np.ptp(speeds) < 1.0


def test_offsets_of_the_azimuth_turn_the_bent_blades(env):
    env.reset(seed=1, options={"offsets": {"Azimuth": 0.0}})
    start = env.channels()
    env.reset(seed=1, options={"offsets": {"Azimuth": 120.0}})
    turned = env.channels()
    assert turned["Azimuth"] == pytest.approx(120.0)
    assert turned["OoPDefl1"] == pytest.approx(start["OoPDefl2"], rel=1e-9)


@pytest.mark.nightly
def test_a_vector_environment_steps_as_single_ones(env):
    together = FowtVectorEnv(num_envs=2, **WEATHER, **ELASTIC)
    first, _ = together.reset(seed=3)
    alone, _ = env.reset(seed=3)
    np.testing.assert_array_equal(first[0], alone)
    for action in actions(env, 5):
        both = together.step(np.tile(action, (2, 1)))[0]
        np.testing.assert_array_equal(both[0], env.step(action)[0])


@pytest.mark.nightly
def test_a_runaway_blade_bends_alone_and_the_turbine_stops(elastic_scene):
    faults = [{"kind": "pitch_runaway", "time": 5.0, "towards": "fine", "blades": [2]}]
    frame = fowt_env.simulate(elastic_scene, "gspi_oc3", duration=20.0, faults=faults)
    late = frame[frame["Time_[s]"] > 8.0]
    assert late["OoPDefl2_[m]"].mean() > late["OoPDefl1_[m]"].mean() + 0.5
    assert np.isfinite(frame.to_numpy()).all()


def test_grid_loss_and_emergency_stop_leave_a_finite_turning_twist(elastic_scene):
    faults = [{"kind": "grid_loss", "time": 5.0, "delay": 0.2}]
    frame = fowt_env.simulate(elastic_scene, "gspi_oc3", duration=30.0, faults=faults)
    assert np.isfinite(frame.to_numpy()).all()
    assert frame["GenTq_[kN-m]"].iloc[-1] == 0.0 and frame["BldPitch1_[deg]"].iloc[-1] > 60.0
    twist = frame.loc[frame["Time_[s]"] > 25.0, "Q_DrTr_[rad]"]
    assert abs(twist.mean()) < 0.2 * frame["Q_DrTr_[rad]"].iloc[0]
