"""The interface of an environment is that of simulate: information, trips, faults, wind ahead."""

import numpy as np
import pandas as pd
import pytest
from episodes import NTM
from laws import PITCH, TORQUE, Recorder

import fowt_env
from fowt_env.controllers import make
from fowt_env.descriptions.faults import Fault
from fowt_env.envs import EpisodeSettings, FowtEnv, FowtVectorEnv, InterfaceSettings
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.training.evaluation.case_environment import environment_settings
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.run_case import Run, run_metrics, scored
from fowt_env.weather.lidar_gates import lidar_gates

STILL = {"task": "steady", "wind": 16.0, "duration": 20.0, "fidelity": "fast"}
RUNAWAY = {"kind": "pitch_runaway", "time": 0.0, "towards": "fine"}


@pytest.mark.parametrize("protection", [pytest.param(None, marks=pytest.mark.nightly), "turbine"])
@pytest.mark.parametrize("commands", [(), ("generator_torque", "blade_pitch")])
def test_the_baseline_of_an_environment_reads_nan_where_it_does_not_declare(protection, commands):
    law = Recorder(("rotor_speed", *commands))
    env = FowtEnv(**STILL, action_mode="residual", baseline=law, protection=protection)
    env.reset(seed=1)
    env.step(np.zeros(2))
    read = law.seen(env.view().baseline_memory)[-1, [-2, -1, Measure.ROTOR_SPEED, Measure.PLATFORM_PITCH]]
    assert np.isfinite(read).tolist() == [bool(commands)] * 2 + [True, False]


def test_environments_of_a_batch_do_not_share_the_memory_of_a_baseline():
    batch = FowtVectorEnv(2, **STILL, action_mode="residual", baseline=Recorder(("rotor_speed",)))
    memories = [env._episode.memory for env in batch.envs]
    assert not np.shares_memory(*memories)


def test_a_law_reads_its_last_command_and_not_what_a_fault_made_of_it():
    """lqr predicts with the command in force; a drive that runs away does not show it another one."""
    law, other = (Recorder(("rotor_speed", "generator_torque", "blade_pitch")) for _ in range(2))
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="fast")
    fowt_env.simulate(scene, law, 1.0, faults=RUNAWAY)
    env = FowtEnv(**STILL, action_mode="residual", baseline=other, faults=RUNAWAY)
    env.reset(seed=1)
    for _ in range(3):
        env.step(np.zeros(2))
    assert law.seen()[-1, -1] == other.seen(env.view().baseline_memory)[-1, -1] == PITCH
    assert env.view().in_force[1] == env.scene.turbine.pitch_drive.minimum


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


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=() if case.name == "turbulent" else pytest.mark.nightly)
        for case in CASES
    ],
)
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


LIDAR = {"wind": {"kind": "ntm", "speed": 16.0, "class": "B"}, "duration": 20.0, "fidelity": "fast"}
LEADS = (1.5, 4.0)


@pytest.mark.parametrize("preview", ["exact", "four_beam_pulsed"])
def test_the_wind_ahead_of_observation_and_baseline_is_that_of_simulate(preview):
    task = Task("ahead", wind=LIDAR["wind"], duration=20.0, offsets={}, wind_preview=LEADS,
                observation=("rotor_speed", "wind_preview"))  # fmt: skip
    env = FowtEnv(task, fidelity="fast", preview=preview)
    env.reset(seed=1)
    ahead = []
    for _ in range(200):
        ahead.append(env.view().ahead)
        env.step_physical(TORQUE, PITCH)
    law = Recorder(("wind_preview",), LEADS, calls=200)
    fowt_env.simulate(env.scene, law, 20.0, preview=preview)
    np.testing.assert_array_equal(np.array(ahead), law.seen()[:, N_MEASUREMENTS:-2])
    if preview == "exact":
        hub = FowtEnv(task, fidelity="fast")
        hub.reset(seed=1)
        assert np.abs(hub.view().ahead - ahead[0]).max() < 1e-9  # rotor-averaged wind is that at the hub


def test_the_baseline_reads_the_lidar_that_it_would_in_simulate():
    law = Recorder(("rotor_speed", "lidar"), leads=2)
    env = FowtEnv(
        **STILL | {"wind": LIDAR["wind"]}, action_mode="residual", baseline=law, preview="circular_cw"
    )
    env.reset(seed=1)
    env.step(np.zeros(2))
    read = env._baseline.seen()[:2, N_MEASUREMENTS : N_MEASUREMENTS + 2]
    wanted = lidar_gates(env.scene, "circular_cw").series.values[:, :2].T
    np.testing.assert_allclose(read[:, 1], wanted[: len(read), 1], atol=1e-12)
    np.testing.assert_allclose(read[:, 0], wanted[: len(read), 0], atol=0.1)  # without the nacelle's motion


NIGHTLY = pytest.mark.nightly
SLOW = {"kind": "ntm", "speed": 8.0, "class": "B"}
DRIVES = {"pitch_drive": "second_order", "fidelity": "fast", "wind": 16.0}


@pytest.mark.parametrize(
    ("law", "as_baseline", "settings"),
    [
        pytest.param("pi", False, {"rotor": "bem", "fidelity": "reference", "wind": SLOW}, marks=NIGHTLY),
        pytest.param("pi", False, {"rotor": "table", "fidelity": "reference"}, marks=NIGHTLY),
        ("pi", False, {"fidelity": "standard"}),
        pytest.param("pi", True, {"fidelity": "fast"}, marks=NIGHTLY),
        pytest.param("pi", True, DRIVES, marks=NIGHTLY),
        pytest.param("lqr", True, {"rotor": "table"}, marks=NIGHTLY),
    ],
)
def test_the_commands_of_a_law_and_none_beside_a_baseline_give_the_rows_of_simulate(
    law, as_baseline, settings
):
    settings = {"duration": 10.0, "wave_components": 20, "wind": NTM, "record": True} | settings
    envs = [FowtEnv(**settings)]
    if as_baseline:
        envs.append(FowtEnv(action_mode="residual", baseline=law, **settings))
    for env in envs:
        env.reset(seed=1, options={"weather_seed": 7, "offsets": {}})
    hand = envs[0]
    controller = make(law, hand.scene.turbine, 0.1)
    controller.prepare(hand.scene)
    controller.reset(hand.measurement())
    for _ in range(100):
        hand.step_physical(*controller.act(hand.measurement()))
        for base in envs[1:]:
            base.step(np.zeros(2))
    frame = fowt_env.simulate(hand.scene, law, 10.0)
    for env in envs:
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


def test_a_platform_that_sinks_ends_the_episode_where_it_ends_the_run():
    """As in simulate: at the first control instant with the tower's foot below still water."""
    flood = {"kind": "flooded_compartment", "time": 5.0, "mass": 4e6, "point": [0.0, 0.0, -100.0]}
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="fast")
    with pytest.raises(fowt_env.SimulationStopped, match="sunk") as caught:
        fowt_env.simulate(scene, "pi", 20.0, output_dt=0.1, faults=flood)
    env = FowtEnv(**STILL, action_mode="residual", faults=flood)
    env.reset(seed=1)
    for _ in range(round(caught.value.time / 0.1)):
        *_, terminated, truncated, info = env.step(np.zeros(2))
        assert not truncated and terminated == ("sunk" in info.get("termination", ""))
        assert terminated == (10.0 + env.channels()["PtfmHeave"] < 0.0)
    assert terminated


def test_a_baseline_that_nothing_reads_is_announced():
    with pytest.warns(
        fowt_env.PlantWarning, match="baseline = 'lqr': is not used with action_mode = 'setpoint'"
    ):
        FowtEnv(**STILL, action_mode="setpoint", baseline="lqr")
