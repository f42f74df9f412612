"""Scenes whose blades have a drive of second order with a deadband, and whose generator lags."""

import numpy as np
import pytest
from scipy.linalg import expm

import fowt_env
from fowt_env import InputError
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.reduced_model import residualised
from fowt_env.analysis.trim import trim
from fowt_env.descriptions.turbine import PitchDrive, read_turbine
from fowt_env.plant.advance import advance, output_row
from fowt_env.plant.state import Command, State
from fowt_env.scene.build import build_scene

W, ZETA, LAG = 11.11, 0.6, 0.08
DEADBAND = np.radians(0.05)
DT = 0.1


def turbine_with(drive, lag):
    made = read_turbine("nrel5mw")
    return made.model_copy(
        update={
            "pitch_drive": made.pitch_drive.model_copy(update={"time_constant": None} | drive),
            "drivetrain": made.drivetrain.model_copy(update={"torque_time_constant": lag}),
        }
    )


@pytest.fixture(scope="module")
def scene():
    turbine = turbine_with({"natural_frequency": W, "damping": ZETA, "deadband": DEADBAND}, LAG)
    return build_scene("oc3_hywind", wind=18.0, fidelity="fast", turbine=turbine)


@pytest.fixture(scope="module")
def plain_scene():
    """The same with a first-order lag as long, and a torque that follows at once."""
    turbine = turbine_with({"time_constant": 2.0 * ZETA / W}, None)
    return build_scene("oc3_hywind", wind=18.0, fidelity="fast", turbine=turbine)


class Given:
    """Commands by time: a Python controller of pairs (torque N m, blade pitch rad)."""

    information = ("time", "generator_torque", "blade_pitch")

    def __init__(self, at):
        self.at, self.seen = at, []

    def reset(self, measurement):
        self.seen = []

    def act(self, measurement):
        self.seen.append((measurement.time, measurement.generator_torque, measurement.blade_pitch))
        return self.at(measurement.time)


def test_states_follow_those_of_loads_and_rest_in_a_trim(scene):
    assert [(block.name, block.size) for block in scene.blocks[5:]] == [
        ("pitch_rate", 1), ("followed_pitch", 1), ("generator_torque", 1)
    ]  # fmt: skip
    point = trim(scene)
    pitch = point.state[State.BLADE_PITCH]
    assert point.state[15:] == pytest.approx([0.0, pitch, point.command[Command.GENERATOR_TORQUE]], rel=1e-15)
    assert point["GenTq"] == pytest.approx(1e-3 * point.command[Command.GENERATOR_TORQUE], rel=1e-12)
    x = point.state.copy()
    advance(scene.handle(), x, point.command, 0, 100, DT)
    assert x[[*range(6), 13, 14, 15, 16, 17]] == pytest.approx(
        point.state[[*range(6), 13, 14, 15, 16, 17]], rel=1e-7, abs=1e-7
    )


def test_a_trim_is_that_of_a_drive_residualised(scene, plain_scene):
    with_drive, without = trim(scene), trim(plain_scene)
    assert with_drive.state[:15] == pytest.approx(without.state, rel=1e-9, abs=1e-9)


def test_the_linear_model_has_drive_and_generator(scene):
    model = linearize(scene)
    assert model.states[14:] == ("pitch_rate", "generator_torque_in_force")
    blade, rate, torque = (model.index(n) for n in ("blade_pitch", "pitch_rate", model.states[15]))
    assert model.A[blade, rate] == pytest.approx(1.0, rel=1e-9)
    assert model.A[rate, [blade, rate]] == pytest.approx([-(W**2), -2.0 * ZETA * W], rel=1e-6)
    assert model.B[rate, :2] == pytest.approx([0.0, W**2], rel=1e-6)
    assert model.A[torque, torque] == pytest.approx(-1.0 / LAG, rel=1e-6)
    assert model.B[torque, :2] == pytest.approx([1.0 / LAG, 0.0], rel=1e-6, abs=1e-6)
    ratio, row = scene.turbine.drivetrain.gear_ratio, scene.model.rigid_body.rotor_row
    assert model.A[model.index("rotor_speed"), torque] == pytest.approx(-ratio / row, rel=2e-3)
    assert np.all(model.B[:blade, :2] == 0.0) and model.x0[14:] == pytest.approx(
        [0.0, model.point.command[0]]
    )
    names = {mode.name for mode in model.modes()}
    assert "rotor_speed" not in names and len(names) == 6  # the drive oscillates, and is no motion


def test_the_linear_model_moves_as_the_plant_does(scene):
    model, steps = linearize(scene), 20
    change = np.array([200.0, 1.01 * DEADBAND])
    n = len(model.states)
    system = np.zeros((n + 2, n + 2))
    system[:n, :n], system[:n, n:] = model.A, model.B[:, :2]
    foreseen = expm(steps * DT * system)[:n, n:] @ change
    x, u = model.point.state.copy(), model.point.command + change
    advance(scene.handle(), x, u, 0, 8 * steps, DT / 8)
    rows = [model.index(name) for name in ("rotor_speed", "blade_pitch", "vx", "wy", "platform_pitch")]
    moved = x[[State.ROTOR_SPEED, State.BLADE_PITCH, State.VX, State.WY, State.PLATFORM_PITCH]]
    start = model.x0[rows]
    assert moved - start == pytest.approx(foreseen[rows], rel=0.01)


def test_designs_take_the_drive_as_a_lag_as_long(scene, plain_scene):
    reduced, plain = residualised(linearize(scene)), linearize(plain_scene)
    assert reduced.states == plain.states
    for name in ("A", "B", "C", "D", "E", "F"):
        got, wanted = getattr(reduced, name), getattr(plain, name)
        assert got == pytest.approx(wanted, rel=1e-5, abs=1e-6 * np.abs(wanted).max()), name
    assert reduced.x0 == pytest.approx(plain.x0, rel=1e-9, abs=1e-9)
    assert residualised(plain) is plain


def test_the_torque_in_force_lags_and_is_what_is_shown(scene):
    point = trim(scene)
    torque, pitch = point.command
    controller = Given(lambda t: (torque - 1000.0 * (t >= 1.0 - 1e-9), pitch))
    run = fowt_env.simulate(scene, controller, duration=2.0)
    time, shown = run["Time_[s]"].to_numpy(), 1e3 * run["GenTq_[kN-m]"].to_numpy()
    wanted = np.where(time < 1.0, torque, torque - 1000.0 * (1.0 - np.exp(-(time - 1.0) / LAG)))
    assert shown == pytest.approx(wanted, rel=1e-9)
    law, shaft = scene.turbine.torque_law, scene.turbine.drivetrain
    assert 1000.0 < DT * law.max_torque_rate  # so that the lag alone acts
    speed = run["GenSpeed_[rpm]"].to_numpy() * np.pi / 30.0
    power = shaft.generator_efficiency * speed * shown
    assert 1e3 * run["GenPwr_[kW]"].to_numpy() == pytest.approx(power, rel=1e-9)
    seen = np.array(controller.seen)
    assert seen[:, 1] == pytest.approx(shown[: len(seen)], rel=1e-9)


def test_the_rate_limit_of_the_torque_holds_with_the_lag(scene):
    torque, pitch = trim(scene).command
    run = fowt_env.simulate(scene, Given(lambda t: (0.0, pitch)), duration=2.0)
    shown, most = 1e3 * run["GenTq_[kN-m]"].to_numpy(), DT * scene.turbine.torque_law.max_torque_rate
    assert np.abs(np.diff(shown)).max() <= most * (1.0 + 1e-9)
    assert np.diff(shown)[10] == pytest.approx(-most, rel=1e-4)


def test_off_the_grid_the_torque_is_gone_at_once(scene):
    torque, pitch = trim(scene).command
    loss = {"kind": "grid_loss", "time": 0.5}
    run = fowt_env.simulate(scene, Given(lambda t: (torque, pitch)), duration=1.0, faults=loss)
    shown = run["GenTq_[kN-m]"].to_numpy()
    assert np.all(shown[5:] == 0.0) and shown[4] == pytest.approx(1e-3 * torque)


def test_blades_move_alike_whatever_the_step(scene):
    torque, pitch = trim(scene).command
    commands = pitch + np.cumsum(np.random.default_rng(3).normal(0.0, 0.01, 40))
    given = Given(lambda t: (torque, commands[min(round(t / DT), 39)]))
    runs = [fowt_env.simulate(scene, given, duration=4.0, dt=dt)["BldPitch1_[deg]"] for dt in (0.1, 0.0125)]
    assert runs[0].to_numpy() == pytest.approx(runs[1].to_numpy(), abs=1e-10)
    assert np.ptp(runs[0]) > 1.0


def test_outputs_show_the_state_that_is_given(scene):
    point = trim(scene)
    x = point.state.copy()
    x[17] = 1234.0
    row = output_row(scene.handle(), x, point.command, 0.0, len(scene.channels))
    assert scene.values(row[None])[0][[c.name for c in scene.channels].index("GenTq")] == pytest.approx(1.234)


# --------------------------------------------------------------------------- descriptions


LIMITS = {"rate_limit": 0.1, "minimum": 0.0, "maximum": 1.5}


@pytest.mark.parametrize(
    "given, message",
    [
        ({}, "time_constant is missing: must be a number >= 0"),
        ({"natural_frequency": 5.0}, "damping is missing"),
        ({"damping": 0.7}, "time_constant is missing"),
        ({"damping": 0.7, "time_constant": 0.1}, "natural_frequency is missing"),
        (
            {"natural_frequency": 5.0, "damping": 0.7, "time_constant": 0.1},
            "time_constant = 0.1: conflicts with",
        ),
        ({"time_constant": 0.1, "friction": 0.01}, "friction = 0.01: needs natural_frequency"),
        ({"time_constant": 0.1, "acceleration_limit": 1.0}, "acceleration_limit = 1: needs"),
    ],
)
def test_a_drive_is_of_first_or_of_second_order(given, message):
    with pytest.raises(ValueError, match=message):
        PitchDrive(**LIMITS, **given)


def test_the_lag_of_a_drive_is_that_behind_a_ramp():
    assert PitchDrive(**LIMITS, time_constant=0.3).lag == 0.3
    drive = PitchDrive(**LIMITS, natural_frequency=10.0, damping=0.6)
    assert drive.lag == pytest.approx(0.12) and drive.slowed(2.0).lag == pytest.approx(0.24)


def test_a_scene_may_ask_for_the_second_drive_of_a_turbine():
    drive = build_scene(
        "iea15_volturnus_s", pitch_drive="second_order", fidelity="reference"
    ).turbine.pitch_drive
    assert (drive.natural_frequency, drive.damping, drive.time_constant) == (1.5708, 0.707, None)
    assert drive.rate_limit == pytest.approx(0.0349)
    assert (
        build_scene("iea15_volturnus_s", fidelity="reference").turbine.pitch_drive.natural_frequency is None
    )
    bare = read_turbine("liu_1_50")
    with pytest.raises(InputError, match=r"'liu_1_50' has no \[pitch_drive.second_order\]"):
        build_scene("oc3_hywind", turbine=bare, pitch_drive="second_order", fidelity="reference")
