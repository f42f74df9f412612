"""The interface of an environment is that of simulate: information, trips, faults, wind ahead."""

import pickle
from copy import deepcopy

import numpy as np
import pandas as pd
import pytest

import fowt_env
from fowt_env.control import CompiledController
from fowt_env.controllers import make
from fowt_env.descriptions.faults import Fault
from fowt_env.envs import EpisodeSettings, FowtEnv, FowtVectorEnv, InterfaceSettings
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.measurement import Measure
from fowt_env.training.evaluation.case_environment import environment_settings
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.run_case import Run, run_metrics, scored

STILL = {"task": "steady", "wind": 16.0, "duration": 20.0, "fidelity": "fast"}
RUNAWAY = {"kind": "pitch_runaway", "time": 0.0, "towards": "fine"}


@control_kernel
def keep_input(parameters, memory, measurement, command):
    """Keep the command in force and two measured quantities, and command rated torque at 0.26 rad."""
    memory[0], memory[1] = command[0], command[1]
    memory[2], memory[3] = measurement[Measure.ROTOR_SPEED], measurement[Measure.PLATFORM_PITCH]
    command[0], command[1] = 43093.55, 0.26


class RotorSpeedLaw(CompiledController):
    """A law that declares the rotor speed alone, and keeps what it reads."""

    kernel = staticmethod(keep_input)
    information = ("rotor_speed",)

    def __init__(self):
        super().__init__("rotor speed law", np.zeros(1), 4)

    def reset(self, measurement):
        """Forget what was read."""
        self.memory[:] = 0.0


class CommandLaw(RotorSpeedLaw):
    """The same law, which declares the command in force too."""

    information = ("rotor_speed", "generator_torque", "blade_pitch")


@pytest.mark.parametrize("protection", [None, "turbine"])
def test_the_baseline_of_an_environment_reads_nan_where_it_does_not_declare(protection):
    for law, declared in ((RotorSpeedLaw, False), (CommandLaw, True)):
        env = FowtEnv(**STILL, action_mode="residual", baseline=law(), protection=protection)
        env.reset(seed=1)
        env.step(np.zeros(2))
        read = env.view().baseline_memory
        assert np.isfinite(read).tolist() == [declared, declared, True, False]


def test_environments_of_a_batch_do_not_share_the_memory_of_a_baseline():
    batch = FowtVectorEnv(2, **STILL, action_mode="residual", baseline=RotorSpeedLaw())
    memories = [env._episode.memory for env in batch.envs]
    assert not np.shares_memory(*memories)


def test_a_law_reads_its_last_command_and_not_what_a_fault_made_of_it():
    """lqr predicts with the command in force; a drive that runs away does not show it another one."""
    law, scene = CommandLaw(), fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="fast")
    fowt_env.simulate(scene, law, 1.0, faults=RUNAWAY)
    env = FowtEnv(**STILL, action_mode="residual", baseline=CommandLaw(), faults=RUNAWAY)
    env.reset(seed=1)
    for _ in range(3):
        env.step(np.zeros(2))
    assert law.memory[1] == env.view().baseline_memory[1] == 0.26
    drive = env.scene.turbine.pitch_drive
    assert env.view().in_force[1] == drive.minimum


STOPPED = Fault(kind="grid_loss", time=20.0, delay=0.3)
BROKEN = Fault(kind="sensor_bias", time=5.0, field="rotor_speed", value=-0.3)
CASES = [
    Case("turbulent", {"kind": "ntm", "speed": 18.0, "class": "B"}, {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0},
         duration=60.0, skip=20.0, seeds=(3,), sensors="standard"),
    Case("gust", {"kind": "eog", "speed": 14.0, "start": 20.0}, None, duration=60.0, skip=0.0, seeds=(3,),
         trip=1.05),
    Case("grid", 16.0, None, duration=60.0, skip=0.0, seeds=(3,), fault=STOPPED, protection="turbine"),
    Case("biased", 16.0, None, duration=60.0, skip=0.0, seeds=(3,), fault=BROKEN, trip=1.3),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_case_through_an_environment_gives_the_rows_and_metrics_of_evaluate(case):
    row, frame = scored(Run("pi", "pi", case, 3, case.duration, case.skip, {}, None))
    settings = environment_settings(case, case.duration)
    env = FowtEnv(**settings, action_mode="residual")
    env.reset(seed=0, options={"weather_seed": 3})
    law = make("pi", env.scene.turbine, 0.1)
    hand = FowtEnv(**settings)
    hand.reset(seed=0, options={"weather_seed": 3})
    law.reset(hand.measurement())
    ended = False
    while not ended:
        *_, ended, info = env.step(np.zeros(2))
        *_, again, _ = hand.step_physical(*law.act(hand.measurement()))
        assert again == ended
    for one in (env, hand):
        pd.testing.assert_frame_equal(one.frame(), frame, check_exact=True)
        assert one.frame().attrs == frame.attrs
        figures = run_metrics(one.frame(), case, one.scene, case.skip)
        assert figures == pytest.approx({name: row[name] for name in figures}, rel=0.0, abs=0.0, nan_ok=True)
    assert (info["tripped"] is not None) == (case.name == "gust")
    assert info["stopping"] == (case.name in ("gust", "grid"))


def test_a_trip_that_ends_the_run_terminates_the_episode_with_its_name():
    end = {"overspeed": {"limit": 1.02, "stop": "end"}}
    env = FowtEnv(
        **STILL | {"wind": {"kind": "eog", "speed": 14.0, "start": 0.0}}, protection=end, record=True
    )
    env.reset(seed=1)
    reward, ended = 0.0, False
    while not ended:
        _, reward, ended, truncated, info = env.step([0.0, -1.0])
        assert not truncated
    assert info["termination"] == "overspeed (above the limit that ends the run)"
    assert info["trip"] == "overspeed"
    assert info["tripped"] == info["time"] == pytest.approx(0.1 * len(env.frame()))
    assert reward < -50.0 and info["reward/failure"] < 0.0


def test_faults_are_drawn_in_their_ranges_and_replayed_from_the_info():
    fault = {"kind": "sensor_bias", "time": (2.0, 8.0), "field": "rotor_speed", "value": (-0.2, 0.2)}
    env = FowtEnv(**STILL, faults=[fault])
    drawn = [env.reset(seed=seed)[1]["sampled"]["faults"][0] for seed in range(20)]
    times, values = np.array([[one.time, one.value] for one in drawn]).T
    assert 2.0 <= times.min() < 4.0 and 6.0 < times.max() <= 8.0 and values.min() < -0.1 < 0.1 < values.max()
    _, info = env.reset(seed=99, options={"faults": [drawn[3]]})
    assert info["sampled"]["faults"] == (drawn[3],)
    for _ in range(90):
        env.step(np.zeros(2))
        bias = env.measurement().rotor_speed - env.true_measurement().rotor_speed
        late = env.measurement().time >= drawn[3].time - 1e-9
        assert bias == pytest.approx(drawn[3].value if late else 0.0, abs=1e-12)
    with pytest.raises(InputError, match="needs an environment with protection or faults"):
        FowtEnv(**STILL).reset(seed=1, options={"faults": [drawn[0]]})


DRIVES = {"pitch_drive": "second_order", "fidelity": "fast"}
LIDAR = {"wind": {"kind": "ntm", "speed": 16.0, "class": "B"}, "duration": 20.0, "fidelity": "fast"}
LEADS = (1.5, 4.0)


@pytest.mark.parametrize("preview", ["exact", "four_beam_pulsed"])
def test_the_wind_ahead_of_observation_and_baseline_is_that_of_simulate(preview):
    task = Task(name="ahead", wind=LIDAR["wind"], duration=20.0, offsets={}, wind_preview=LEADS,
                observation=("rotor_speed", "wind_preview"))  # fmt: skip
    env = FowtEnv(task, fidelity="fast", preview=preview)
    _, info = env.reset(seed=1)
    seen = [env.measurement().time]
    ahead = [env.view().ahead]

    class Follow:
        """Commands of the environment, and the wind ahead that simulate gives."""

        information, preview_times = ("wind_preview",), LEADS

        def __init__(self):
            self.ahead = []

        def reset(self, measurement):
            pass

        def act(self, measurement):
            self.ahead.append(measurement.wind_preview)
            return 43093.55, 0.26

    for _ in range(200):
        env.step_physical(43093.55, 0.26)
        ahead.append(env.view().ahead)
    scene = env.scene
    law = Follow()
    fowt_env.simulate(scene, law, 20.0, preview=preview)
    np.testing.assert_array_equal(np.array(ahead[:200]), np.array(law.ahead))
    assert len(seen) == 1
    if preview == "exact":
        hub = FowtEnv(task, fidelity="fast")
        hub.reset(seed=1)
        assert np.abs(hub.view().ahead - ahead[0]).max() < 1e-9  # rotor-averaged wind is that at the hub


def test_copies_snapshots_and_batches_keep_trips_faults_and_lidar():
    settings = {"task": Task(name="ahead", wind=LIDAR["wind"], duration=20.0, wind_preview=LEADS,
                             observation=("rotor_speed", "wind_preview")),
                "fidelity": "fast", "preview": "four_beam_pulsed", "protection": "turbine",
                "faults": [RUNAWAY | {"time": (0.5, 6.0)}], "sensors": "standard",
                "record": True}  # fmt: skip
    env = FowtEnv(**settings)
    env.reset(seed=5)
    rng = np.random.default_rng(1)
    for _ in range(30):
        env.step(rng.uniform(-1.0, 1.0, 2))
    snapshot, copy = env.get_state(), deepcopy(env)
    again = pickle.loads(pickle.dumps(env))
    actions = rng.uniform(-1.0, 1.0, (60, 2))
    wanted = [env.step(action)[0] for action in actions]
    assert env.is_stopping
    for other in (copy, again):
        np.testing.assert_array_equal([other.step(action)[0] for action in actions], wanted)
    env.set_state(snapshot)
    np.testing.assert_array_equal([env.step(action)[0] for action in actions], wanted)
    batch = FowtVectorEnv(2, **settings)
    batch.reset(seed=[5, 6])
    single = FowtEnv(**settings)
    single.reset(seed=6)
    for action in actions:
        observations, *_, infos = batch.step(np.array([action, action]))
        np.testing.assert_array_equal(observations[1], single.step(action)[0])
        assert infos["stopping"][1] == single.is_stopping


def test_second_order_drives_and_a_lagging_generator_are_those_of_simulate():
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0, **DRIVES)
    frame = fowt_env.simulate(scene, "pi", 20.0)
    task = Task(name="drives", wind=16.0, duration=20.0, offsets={})
    env = FowtEnv(task, action_mode="residual", record=True, **DRIVES)
    env.reset(seed=1)
    while not env.step(np.zeros(2))[3]:
        pass
    pd.testing.assert_frame_equal(env.frame(), frame, check_exact=True)


def test_records_and_keywords_are_the_same_settings():
    records = {"episode": EpisodeSettings(duration=20.0, wind=16.0),
               "interface": InterfaceSettings(protection="turbine")}  # fmt: skip
    plain = {"task": "steady", "fidelity": "fast"}
    one = FowtEnv(**plain, **records)
    other = FowtEnv(**STILL, protection="turbine")
    for env in (one, other):
        env.reset(seed=3)
    np.testing.assert_array_equal(one.step([0.1, 0.2])[0], other.step([0.1, 0.2])[0])
    with pytest.raises(InputError, match="episode = 20.0: must be EpisodeSettings"):
        FowtEnv(**plain, episode=20.0)
    with pytest.raises(TypeError, match="protecton.*protection"):
        FowtEnv(**STILL, protecton="turbine")
