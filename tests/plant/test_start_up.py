"""Start-ups of a parked turbine against a wrapper around the controller, ROSCO's own, and in environments."""

import numpy as np
import pandas as pd
import pytest
from laws import Delegate
from naive.faults import Started

import fowt_env
from fowt_env.controllers import make
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import build_torque_curve, generator_torque
from fowt_env.run.stepped import SteppedRun

DT = 0.1
TIME, SPEED, PITCH, TORQUE = "Time_[s]", "RotSpeed_[rpm]", "BldPitch1_[deg]", "GenTq_[kN-m]"
START = {"kind": "start_up", "time": 5.0}
FAST = START | {"rate": 4.0}
CONNECT = 670.0 / 1173.7 * 12.1  # rpm of the rotor: VS_CtInSp of the NREL 5 MW


@pytest.fixture(scope="module")
def scene():
    return fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="standard")


def run(scene, controller="pi", duration=60.0, faults=FAST, **options):
    return fowt_env.simulate(scene, controller, duration=duration, faults=faults, **options)


@pytest.mark.parametrize("name", ["pi", "lqr"])
def test_a_start_is_a_wrapper_that_idles_pitches_and_hands_over(scene, name):
    turbine = scene.turbine
    drive, curve = turbine.pitch_drive, build_torque_curve(turbine.torque_law)
    limits = (
        drive.maximum, drive.minimum, 4.0, CONNECT * np.pi / 30.0, curve.region3_start_speed,
        curve.region3_min_pitch,
    )  # fmt: skip
    twin = Started(
        make(name, turbine, DT), 5.0, limits, lambda speed: generator_torque(speed, 0.0, curve), DT
    )
    expected = fowt_env.simulate(scene, twin, duration=60.0, initial="parked")
    frame = run(scene, name)
    columns = [name for name in frame if name != "GenTqLim_[-]"]  # the wrapper's limit is its own command
    np.testing.assert_allclose(frame[columns], expected[columns], rtol=1e-9, atol=1e-9)
    assert frame.attrs["connected"] == pytest.approx(twin.connected)
    assert frame[TORQUE].iloc[-1] > 20.0


def test_the_stages_of_a_start(scene):
    frame = run(scene, faults=START, duration=220.0)
    time, connected = frame[TIME], frame.attrs["connected"]
    idle, after = frame[time < 5.0 - 1e-9], frame[time >= connected - 1e-9]
    assert (idle[PITCH] == 90.0).all() and idle[SPEED].abs().max() < 0.5 and idle[SPEED].iloc[0] == 0.0
    pitching = frame[(time > 7.0) & (time < connected - 1e-9)]
    np.testing.assert_allclose(np.diff(pitching[PITCH]) / DT, -1.0, rtol=1e-4)  # start_rate
    assert not frame.loc[time < connected - 1e-9, TORQUE].any()
    assert pitching[SPEED].max() < CONNECT <= after[SPEED].iloc[0]
    slow = after[(after[SPEED] < 11.9) & (after[TIME] < connected + 60.0 - 1e-9)]
    curve = build_torque_curve(scene.turbine.torque_law)
    allowed = [generator_torque(v * 97.0 * np.pi / 30.0, 0.0, curve) * 1e-3 for v in slow[SPEED]]
    assert (slow[TORQUE] <= np.array(allowed) + 1e-9).all() and slow["GenTqLim_[-]"].any()
    loaded = after[(after[TIME] > connected + 62.0) & (after[SPEED] < 11.8)]
    assert loaded[TORQUE].min() > 43.0  # in wind above rated, where a rotor at 10 rpm would have 25 kN m
    assert frame[SPEED].max() < 1.1 * 12.1 and frame.attrs["stop"] is None
    assert frame[time > 170.0][SPEED].mean() == pytest.approx(12.1, abs=0.2)


def test_a_python_controller_and_commands_from_outside_start_as_a_compiled_one(scene):
    compiled, delegate = run(scene), run(scene, Delegate(scene.turbine, DT))
    pd.testing.assert_frame_equal(compiled, delegate, check_exact=True)
    stepped = SteppedRun(scene, 60.0, DT, faults=FAST)
    assert stepped.is_stopping  # starts: commands are ignored
    while stepped.is_stopping:
        stepped.advance((40.0, 5.0))
    assert stepped.time == pytest.approx(compiled.attrs["connected"])
    rows = len(compiled[compiled[TIME] < stepped.time - 1e-9])
    pd.testing.assert_frame_equal(stepped.frame()[:rows], compiled[:rows], check_exact=True)


def test_a_stop_ends_a_start(scene):
    frame = run(scene, faults=[FAST, {"kind": "normal_stop", "time": 15.0, "rate": 2.0}])
    after = frame[frame[TIME] >= 15.0 - 1e-9]
    assert 40.0 < after[PITCH].iloc[0] < 60.0 and after[PITCH].iloc[-1] == pytest.approx(90.0, abs=0.1)
    assert (np.diff(after[PITCH])[10:] >= -1e-9).all() and not after[TORQUE].any()
    assert frame.attrs["stop"] == "normal" and "connected" not in frame.attrs


def test_a_wind_that_cannot_turn_the_rotor_leaves_the_turbine_without_torque(scene):
    calm = fowt_env.build_scene("oc3_hywind", wind=1.0, fidelity="standard")
    frame = run(calm, duration=40.0)
    assert not frame[TORQUE].any() and frame[PITCH].iloc[-1] == pytest.approx(0.0, abs=1e-6)
    assert "connected" not in frame.attrs


def test_the_speed_of_connection_and_the_rate_are_the_turbines_or_the_runs(scene):
    frame = run(scene, faults=START, protection={"start_rate_deg_per_s": 6.0, "connect_speed": 0.4})
    early = frame[(frame[TIME] > 7.0) & (frame[TIME] < 10.0)]
    np.testing.assert_allclose(np.diff(early[PITCH]) / DT, -6.0, rtol=1e-4)
    at = frame[frame[TIME] >= frame.attrs["connected"] - 1e-9].iloc[0]
    assert 0.4 * 12.1 <= at[SPEED] < 0.45 * 12.1


def test_rosco_starts_by_its_own_procedure_or_by_the_supervisors(scene):
    """It holds the blades until SU_StartTime, then pitches by its speed loop, without torque for minutes."""
    pytest.importorskip("rosco")
    own = run(scene, "rosco", duration=40.0, faults=START)
    assert (own.loc[own[TIME] < 5.0, PITCH] > 89.9).all() and not own[TORQUE].any()
    assert "connected" not in own.attrs and own[PITCH].iloc[-1] < 85.0 and own[SPEED].iloc[-1] > 0.5
    supervised = run(scene, "rosco", faults=FAST | {"by": "supervisor"})
    assert supervised.attrs["connected"] < 30.0 and supervised[TORQUE].iloc[-1] > 30.0
    with pytest.raises(InputError, match="rate = 4: is a key of the supervisor's start-up"):
        run(scene, "rosco")


def test_starts_that_cannot_be_are_refused(scene):
    with pytest.raises(InputError, match="by = 'controller': controller 'pi' has no start-up of its own"):
        run(scene, faults=START | {"by": "controller"})
    with pytest.raises(InputError, match="start_up at 5, 9 s: must be one in a run"):
        run(scene, faults=[START, START | {"time": 9.0}])


def test_an_environment_starts_its_turbine_as_simulate_does():
    settings = {"action_mode": "residual", "faults": FAST, "record": True}
    env = FowtEnv(**settings)
    wind = {"options": {"wind": 16.0, "sea": None, "offsets": {}}}
    env.reset(seed=1, **wind)
    zero, shown = np.zeros(env.action_space.shape), []
    for _ in range(400):
        shown.append(env.step(zero)[-1]["stopping"])
    frame = env.frame()
    expected = fowt_env.simulate(env.scene, env.baseline, duration=40.0, faults=FAST)
    pd.testing.assert_frame_equal(frame, expected[: len(frame)], check_exact=True)
    assert shown.index(False) + 1 == round(frame.attrs["connected"] / DT) and not any(shown[-50:])
    batch = FowtVectorEnv(2, **settings)
    batch.reset(seed=[1, 1], **wind)
    for _ in range(400):
        batch.step(np.zeros(batch.action_space.shape))
    for other in batch.envs:
        pd.testing.assert_frame_equal(other.frame(), frame, check_exact=True)
