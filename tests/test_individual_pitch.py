"""Individual pitch between the plant and its users."""

from math import cos, pi, radians, sin

import numpy as np
import pytest
from laws import PITCH, TORQUE, Recorder
from naive.sensors import NaiveSensors

import fowt_env
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.multiblade import linearize_blades
from fowt_env.control import view_of
from fowt_env.descriptions.sensors import Sensor, SensorChain, built_in_chains
from fowt_env.envs.env import FowtEnv
from fowt_env.envs.observations import BLADE_CHANNELS
from fowt_env.envs.safety import SafetyLayer
from fowt_env.envs.vector_env import FowtVectorEnv
from fowt_env.errors import ControllerError, InputError
from fowt_env.plant.measurement import (
    N_BLADE_MEASUREMENTS,
    N_MEASUREMENTS,
    BladeMeasurement,
    Measurement,
)
from fowt_env.weather.sensor_noise import draw_noise, draw_sensors

CYCLE = 0.01  # rad
TRIP = dict.fromkeys(("overpower", "acceleration", "pitch_deviation"), False) | {
    "overspeed": {"limit": 1.0001}
}
BLADE_PITCHES = ("BldPitch1_[deg]", "BldPitch2_[deg]", "BldPitch3_[deg]")
ENV = {"task": "steady", "wind": 18.0, "duration": 3.0, "pitch": "individual"}


@pytest.fixture(scope="module")
def scene():
    return fowt_env.build_scene(wind=18.0, fidelity="standard", pitch="individual")


@pytest.fixture(scope="module")
def collective_scene():
    return fowt_env.build_scene(wind=18.0, fidelity="standard")


def run(scene, controller, **options):
    return fowt_env.simulate(scene, controller, **{"duration": 6.0} | options)


class Cyclic:
    """Commands of each blade that turn with the rotor."""

    individual = True

    def __init__(self, ahead=0.0, tilt=CYCLE, yaw=0.0):
        self.ahead, self.tilt, self.yaw = ahead, tilt, yaw

    def reset(self, measurement):
        self.torque, self.pitch = measurement.generator_torque, measurement.blade_pitch
        self.rows = []

    def act(self, measurement):
        self.rows.append([*measurement, *measurement.blades])
        psi = [measurement.blades.azimuth + self.ahead + 2.0 * pi * blade / 3.0 for blade in range(3)]
        return (self.torque, *(self.pitch + self.tilt * cos(a) + self.yaw * sin(a) for a in psi))


class CompiledCyclic(Recorder):
    def __init__(self, information=("azimuth",), preview_times=(), size=CYCLE):
        super().__init__(information, preview_times, 61, size)


class Baseline(CompiledCyclic):
    def __init__(self, turbine, control_dt):
        super().__init__()


class Fixed(Cyclic):
    """The same command at all times."""

    def __init__(self, *command):
        self.command = command

    def act(self, measurement):
        return self.command


# Commands


def test_every_blade_goes_where_it_is_commanded_with_the_lag_of_its_actuator(scene):
    start = fowt_env.trim(scene).state[scene.pitch_states[0]]
    wanted = start + np.array([0.01, -0.02, 0.003])
    frame = run(scene, Fixed(TORQUE, *wanted))
    lag = scene.turbine.pitch_drive.time_constant
    assert 0.0 < lag < 1.0
    time = frame["Time_[s]"].to_numpy()[:, None]
    expected = wanted + (start - wanted) * np.exp(-time / lag)
    np.testing.assert_allclose(np.radians(frame[list(BLADE_PITCHES)]), expected, rtol=0.0, atol=1e-9)


def test_a_compiled_law_and_one_in_python_give_the_same_run(scene):
    law = Cyclic()
    law.reset = lambda measurement: setattr(law, "rows", [])
    law.torque, law.pitch = TORQUE, PITCH
    frames = [run(scene, controller) for controller in (law, CompiledCyclic())]
    np.testing.assert_array_equal(*frames)
    assert np.ptp(frames[0][list(BLADE_PITCHES)].to_numpy(), axis=1).max() > 0.9


def test_one_pitch_for_all_blades_goes_to_all(scene, collective_scene):
    own, other = run(scene, "pi"), run(collective_scene, "pi")
    first, second, third = (own[name] for name in BLADE_PITCHES)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, third)
    assert np.ptp(first) > 1e-4
    np.testing.assert_allclose(own[other.columns], other, rtol=1e-6, atol=1e-6)


def test_a_held_command_holds_each_blade_where_it_began(scene):
    frame = run(scene, None, duration=2.0, initial={"BldPitch2": 10.0, "BldPitch3": 12.0})
    np.testing.assert_allclose(frame[list(BLADE_PITCHES[1:])], [[10.0, 12.0]] * len(frame), atol=1e-12)
    with pytest.raises(InputError, match="initial\\['BldPitch3'\\] = 95 deg: must be in"):
        run(scene, None, initial={"BldPitch3": 95.0})


def test_an_emergency_stop_feathers_each_blade_from_where_it_is(scene):
    start = {"BldPitch1": 12.0, "BldPitch2": 10.0, "BldPitch3": 15.0}
    frame = run(scene, "pi", protection=TRIP, initial=start | {"RotSpeed": 12.2}, duration=2.0)
    assert frame.attrs["tripped"] == 0.0
    end = frame[list(BLADE_PITCHES)].iloc[-1].to_numpy()
    np.testing.assert_allclose(end - end[0], [0.0, -2.0, 3.0], atol=1e-6)
    assert end[0] > 25.0


def test_what_needs_single_blades_is_refused_where_there_is_one_pitch(collective_scene):
    class Eager(Cyclic):
        def prepare(self, scene):
            raise AssertionError("prepared")

    with pytest.raises(InputError, match="'Eager': commands the pitch of each blade.*pitch='individual'"):
        run(collective_scene, Eager())
    with pytest.raises(InputError, match="'recorder': commands the pitch of each blade"):
        FowtEnv(
            **ENV | {"pitch": "collective", "action_mode": "residual", "baseline": f"{__name__}:Baseline"}
        )

    class Curious(Fixed):
        individual = False
        information = ("rotor_speed", "root_in_plane_2")

    with pytest.raises(InputError, match="declares 'root_in_plane_2', which is measured with individual"):
        run(collective_scene, Curious(TORQUE, PITCH))
    with pytest.raises(InputError, match="unknown channel of initial 'BldPitch2'"):
        run(collective_scene, None, initial={"BldPitch2": 10.0})


@pytest.mark.parametrize("returned", [(TORQUE, 0.1), (TORQUE, 0.1, 0.1), (TORQUE, 0.1, 0.1, np.nan), 0.1])
def test_answers_that_are_not_four_numbers_are_refused(scene, returned):
    class Wrong(Fixed):
        def act(self, measurement):
            return returned

    with pytest.raises(
        ControllerError, match="act\\(\\) must return four finite numbers.*pitch of each blade"
    ):
        run(scene, Wrong())


# Measurements


def test_a_compiled_law_reads_fields_of_blades_behind_the_wind_ahead_and_only_those_it_declares(scene):
    declared = ("azimuth", "root_in_plane_3", "blade_pitch_2", "wind_preview", "rotor_speed")
    law = CompiledCyclic(declared, preview_times=(1.0, 3.0))
    frame = run(scene, law)
    seen, first = law.seen(), N_MEASUREMENTS + 2
    fields = dict(zip(BladeMeasurement._fields, seen[:, first : first + N_BLADE_MEASUREMENTS].T, strict=True))
    assert {name for name, values in fields.items() if np.isfinite(values).all()} == set(declared[:3])
    np.testing.assert_allclose(seen[:, N_MEASUREMENTS:first], 18.0)
    rows = frame.iloc[: len(seen)]
    np.testing.assert_allclose(fields["root_in_plane_3"], 1e3 * rows["RootMxc3_[kN-m]"], rtol=1e-9)
    in_force = seen[:, -4:]
    assert np.isfinite(in_force[:, 2]).all() and np.isnan(in_force[:, [0, 1, 3]]).all()
    np.testing.assert_array_equal(law.act(view_of(law)(seen[-1, :-4].tolist()))[1:], law.command[1:])


def test_fields_of_blades_that_are_not_declared_raise(scene):
    class Some(Cyclic):
        information = ("azimuth", "generator_torque", "blade_pitch")

        def act(self, measurement):
            self.blades = measurement.blades
            return super().act(measurement)

    law = Some()
    run(scene, law, duration=1.0)
    assert np.isfinite(law.blades.azimuth) and np.isnan(tuple(law.blades)[1:]).all()
    for ask in (lambda: law.blades.root_in_plane_1, lambda: law.blades[7]):
        with pytest.raises(ControllerError, match="'Some' reads 'root_in_plane_1' at t = 0.900 s"):
            ask()


def test_blades_of_a_scene_with_one_pitch_are_not_there(collective_scene):
    class Asking(Fixed):
        individual = False

        def act(self, measurement):
            return measurement.blades

    with pytest.raises(ControllerError, match="the scene has one pitch for all blades"):
        run(collective_scene, Asking())
    law = CompiledCyclic()
    with pytest.raises(InputError, match="fields of single blades, which the measurement lacks"):
        law.act(Measurement(*np.ones(N_MEASUREMENTS)))


def test_readings_of_blades_are_those_of_the_chain_with_noise_of_their_own(scene):
    fields = Measurement._fields + BladeMeasurement._fields
    standard = built_in_chains()["standard"]
    late = {"root_in_plane_2": Sensor(noise=1e3, time_constant=0.2, delay=0.3), "azimuth": Sensor(step=0.01)}
    chain = SensorChain("own", dict(standard.sensors) | late)
    shown = (*chain.available, *chain.available_of_blades)
    true, read = CompiledCyclic(fields, size=0.0), CompiledCyclic(shown, size=0.0)
    run(scene, true, initial={"BldPitch2": 10.0})
    run(scene, read, initial={"BldPitch2": 10.0}, sensors=chain)
    std = np.array([chain.sensors[name].noise if name in chain.sensors else 0.0 for name in fields])
    noise, white = draw_sensors(chain, 0.1, scene.seed, 61, True).noise, draw_noise(std, scene.seed, 61)
    np.testing.assert_array_equal(noise[:, :N_MEASUREMENTS], draw_noise(std[:N_MEASUREMENTS], scene.seed, 61))
    for i, name in enumerate(fields):  # white noise, and the drift of strain gauges, almost constant in 6 s
        slow = noise[:, i] - white[:, i]
        drift = chain.sensors[name].drift if name in chain.sensors else 0.0
        assert np.ptp(slow) <= 0.5 * drift and (slow != 0.0).all() == (drift > 0.0)
    plain = draw_noise(np.ones(len(fields)), scene.seed, 61)
    own = plain[:, N_MEASUREMENTS:].ravel()
    assert abs(np.corrcoef(plain[:, :N_MEASUREMENTS].ravel()[: own.size], own)[0, 1]) < 0.15
    twin = NaiveSensors(chain, 0.1, noise)
    for measured, reading in zip(true.seen(), read.seen(), strict=True):
        wanted = twin.read(dict(zip(fields, measured[:-4], strict=True)))
        for name, got in zip(fields, reading[:-4], strict=True):
            assert got == pytest.approx(wanted.get(name, np.nan), rel=1e-9, abs=1e-9, nan_ok=True), name
    with pytest.raises(InputError, match="declares 'hub_yaw_moment', which the sensor chain"):
        run(scene, CompiledCyclic(("azimuth", "hub_yaw_moment")), sensors="standard")


# Environments


def individual(**settings):
    return FowtEnv(**ENV | {"action_mode": "individual"} | settings)


def test_actions_are_the_torque_and_the_pitch_of_each_blade():
    env = individual(observation=("previous_action", *BLADE_CHANNELS), action_mode="individual")
    start, _ = env.reset(seed=1)
    hold = start[:4].astype(float)
    assert env.action_space.shape == (4,) and hold[1] == hold[2] == hold[3]
    action = hold + [0.0, 0.1, -0.1, 0.05]
    for _ in range(20):
        observation, *_, info = env.step(action)
    pitches = np.radians(15.0 * (action[1:] + 1.0))  # 0 to 30 deg
    blades = env.measurement().blades
    np.testing.assert_allclose(blades[1:4], pitches, atol=1e-4)
    entries = {entry.name: value for entry, value in zip(env.observed, observation, strict=True)}
    for entry in env.observed[4:]:
        value = getattr(blades, entry.name) / entry.scale
        assert entries[entry.name] == pytest.approx(value, rel=1e-6, abs=1e-7)
    assert observation[:4] == pytest.approx(action, rel=1e-6)
    channels = env.channels()
    assert channels["RootMyc2"] * 1e3 == pytest.approx(blades.root_out_of_plane_2, rel=1e-9)
    # as far as the drive goes in a period, on the average of the blades
    before = np.array(blades[1:4])
    travel = env.step(hold)[4]["reward/pitch_travel"]
    moved = np.abs(np.array(env.measurement().blades[1:4]) - before).mean()
    assert travel == pytest.approx(-moved / (radians(8.0) * 0.1), rel=1e-9)


def test_actions_of_another_size_are_refused():
    env, batch = individual(), FowtVectorEnv(1, threads=1, **ENV | {"action_mode": "individual"})
    env.reset(seed=3), batch.reset(seed=3)
    with pytest.raises(InputError, match="must be \\(1, 4\\)"):
        batch.step(np.zeros((1, 2)))
    with pytest.raises(InputError, match="action has shape \\(2,\\): must be \\(4,\\)"):
        env.step(np.zeros(2))


def test_the_other_modes_give_their_one_pitch_to_all_blades():
    env = FowtEnv(**ENV | {"action_mode": "residual"})
    env.reset(seed=1, options={"offsets": {"BldPitch1": 1.0}})
    begun = env.measurement().blades
    assert begun.blade_pitch_1 == begun.blade_pitch_2 == begun.blade_pitch_3
    for _ in range(5):
        env.step([0.0, 0.5])
    blades = env.measurement().blades
    assert blades.blade_pitch_1 == blades.blade_pitch_2 == blades.blade_pitch_3 != begun.blade_pitch_1


def test_a_physical_command_is_one_pitch_or_three():
    env = individual()
    env.reset(seed=1)
    for command in ((TORQUE, 0.2, 0.25, 0.3), (TORQUE, 0.25)):
        for _ in range(20):
            env.step_physical(*command)
        wanted = np.broadcast_to(command[1:], 3)
        np.testing.assert_allclose(env.measurement().blades[1:4], wanted, atol=1e-4)
        env.reset(seed=1)
    with pytest.raises(InputError, match="blade_pitch = \\(0.1, 0.2\\): must be one, or 3"):
        env.step_physical(TORQUE, 0.1, 0.2)


def test_the_guard_feathers_all_blades():
    env = SafetyLayer(individual(duration=10.0), overspeed=1.01, baseline="pi")
    env.reset(seed=1)
    fine = np.array([0.0, -1.0, -1.0, -0.9])
    steps = [env.step(fine)[4]["guarded"] for _ in range(80)]
    assert any(steps)
    blades = env.unwrapped.measurement().blades
    assert blades.blade_pitch_1 == pytest.approx(blades.blade_pitch_3, abs=0.01)
    assert blades.blade_pitch_1 > 0.1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"pitch": "collective", "action_mode": "individual"}, "pitch = 'collective': action_mode"),
        (
            {"pitch": "collective", "observation": ("hub_yaw_moment",)},
            "'hub_yaw_moment': is measured only with",
        ),
        (
            {"observation": ("hub_yaw_moment",), "sensors": "standard"},
            "not measured by the sensor chain 'standard'",
        ),
    ],
)
def test_settings_that_do_not_go_together_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        FowtEnv(**ENV | settings)


# Linear models in multi-blade coordinates


def test_collective_columns_are_those_of_the_scene_with_one_pitch(scene, collective_scene):
    plain, blades = linearize(collective_scene), linearize_blades(scene)
    n, m = len(plain.states), len(plain.outputs)
    assert blades.states == (*plain.states, "tilt_pitch", "yaw_pitch")
    assert blades.inputs[:3] == plain.inputs and blades.outputs[:m] == plain.outputs
    for name, own in (("A", blades.A[:n, :n]), ("B", blades.B[:n, :3]), ("E", blades.E[:n])):
        wanted = getattr(plain, name)
        np.testing.assert_allclose(own, wanted, rtol=1e-5, atol=1e-8 * np.abs(wanted).max(), err_msg=name)
    for name, own in (("C", blades.C[:m, :n]), ("D", blades.D[:m, :3]), ("F", blades.F[:m])):
        wanted = getattr(plain, name)
        size = np.maximum(np.abs(wanted).max(axis=1, keepdims=True), 1e-9)
        np.testing.assert_allclose(own / size, wanted / size, rtol=1e-5, atol=1e-7, err_msg=name)
    speed, lag = blades.point.state[13], scene.turbine.pitch_drive.time_constant
    drive = np.array([[-1.0 / lag, -speed], [speed, -1.0 / lag]])
    np.testing.assert_allclose(blades.A[n:, n:], drive, rtol=1e-6)
    np.testing.assert_allclose(blades.B[n:, 3:], np.eye(2) / lag, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(blades.A[n:, :n], 0.0, atol=1e-9)
    assert {mode.name for mode in blades.modes()} == {mode.name for mode in plain.modes()}


@pytest.mark.parametrize(("tilt", "yaw"), [(1.0, 0.0), (0.0, 1.0)])
def test_moments_of_cyclic_pitch_are_those_of_a_run_with_it(scene, tilt, yaw):
    model = linearize_blades(scene, fowt_env.trim(scene, platform="fixed"))
    speed, size = model.point.state[13], 1e-3
    still = scene.with_model({"rigid_body.rotor_fixed": True, "rigid_body.platform_fixed": True})
    turn = round(2.0 * pi / speed / 0.01) * 0.01
    means = []
    for amplitude in (size, -size):
        # the command is held for a period, by half of which it would trail the azimuth
        law = Cyclic(0.5 * 0.01 * speed, amplitude * tilt, amplitude * yaw)
        frame = run(still, law, initial="zero", duration=4.0 * turn, dt=0.01, control_dt=0.01, output_dt=0.01)
        last = frame.iloc[-round(turn / 0.01) :]
        psi = np.radians(last["Azimuth_[deg]"].to_numpy())
        root = sum(
            1e3 * last[f"RootMyc{i + 1}_[kN-m]"] * 2.0 / 3.0 * np.cos(psi + i * 2.0 * pi / 3.0)
            for i in range(3)
        )
        means.append([*(1e3 * last[[f"LSSTipM{axis}s_[kN-m]" for axis in "yz"]].mean()), root.mean()])
    found = (np.array(means[0]) - means[1]) / (2.0 * size)
    pitches = -np.linalg.solve(model.A[-2:, -2:], model.B[-2:, 3:] @ [tilt, yaw])
    names = ("hub_tilt_moment", "hub_yaw_moment", "root_out_of_plane_tilt")
    rows = [model.output_index(name) for name in names]
    wanted = model.C[rows, -2:] @ pitches
    np.testing.assert_allclose(found, wanted, atol=0.005 * np.abs(wanted).max())


def test_a_scene_with_one_pitch_has_no_multi_blade_model(collective_scene):
    with pytest.raises(InputError, match="linearize_blades: the scene has collective pitch"):
        linearize_blades(collective_scene)
