"""Faults on a controller of known answers, and on the plant."""

from math import radians

import numpy as np
import pytest

import fowt_env
from fowt_env.controllers import make
from fowt_env.controllers.constant import Constant
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement
from fowt_env.training.evaluation.evaluate import Case, evaluate
from fowt_env.training.evaluation.faults import Fault, FaultedController, faulted, idling

DT = 0.1


class Ramp:
    """Commands that tell the time."""

    name = "ramp"

    def reset(self, measurement):
        self.starts = getattr(self, "starts", 0) + 1

    def act(self, measurement):
        return 1000.0 + measurement.time, 0.2 + 0.001 * measurement.time


def measured(time, blade_pitch=0.25):
    values = dict.fromkeys(Measurement._fields, 0.0)
    return Measurement(**values | {"time": time, "blade_pitch": blade_pitch})


def commands(fault, times, blade_pitch=0.25):
    controller = FaultedController(Ramp(), fault, feathered=radians(90.0), control_dt=DT)
    controller.reset(measured(0.0))
    return [controller.act(measured(time, blade_pitch)) for time in times]


def test_before_the_fault_the_commands_are_the_inner_ones():
    for kind in ("grid_loss", "stuck_pitch", "emergency_stop"):
        assert commands(Fault(kind=kind, time=10.0), [0.0, 9.9]) == [(1000.0, 0.2), (1009.9, 0.2 + 0.0099)]


def test_grid_loss_takes_the_torque_and_leaves_the_pitch():
    torque, pitch = zip(*commands(Fault(kind="grid_loss", time=10.0), [10.0, 30.0]), strict=True)
    assert torque == (0.0, 0.0) and pitch == pytest.approx((0.21, 0.23))


def test_protection_feathers_at_its_rate_after_the_delay_from_the_measured_pitch():
    times = 10.0 + DT * np.arange(200)
    got = commands(Fault(kind="grid_loss", time=10.0, delay=0.5, rate=8.0), times)
    pitch = np.array([command[1] for command in got])
    assert pitch[4] == pytest.approx(0.2 + 0.001 * 10.4)
    np.testing.assert_allclose(pitch[5:95], 0.25 + radians(8.0) * DT * np.arange(1, 91), rtol=1e-12)
    assert pitch[-1] == radians(90.0)
    stop = commands(Fault(kind="emergency_stop", time=10.0), [10.0])[0]
    assert stop == (0.0, 0.25 + radians(8.0) * DT)


def test_a_stuck_pitch_stays_where_it_was_measured_and_the_torque_goes_on():
    fault = Fault(kind="stuck_pitch", time=10.0)
    controller = FaultedController(Ramp(), fault, radians(90.0), DT)
    controller.reset(measured(0.0))
    assert controller.act(measured(10.0, 0.3)) == (1010.0, 0.3)
    assert controller.act(measured(20.0, 0.1)) == (1020.0, 0.3)
    controller.reset(measured(0.0))  # forgets
    assert controller.act(measured(10.0, 0.1)) == (1010.0, 0.1)


def test_the_inner_controller_is_handed_the_scene():
    class Asking(Ramp):
        information = ("wind_preview",)

        def prepare(self, scene):
            self.scene = scene

    inner = Asking()
    controller = FaultedController(inner, Fault(kind="grid_loss", time=1.0), radians(90.0), DT)
    controller.prepare("the scene")
    assert inner.scene == "the scene" and controller.information == ("wind_preview", "blade_pitch")
    FaultedController(Ramp(), Fault(kind="grid_loss", time=1.0), radians(90.0), DT).prepare("any")


def test_a_generator_off_the_grid_has_no_torque_at_once_and_one_that_is_told_none_needs_its_time():
    lost, told = run_with(Fault(kind="grid_loss", time=10.0), 20.0), run_with(None, 20.0, torque=0.0)
    for frame in (lost, told):
        assert frame["GenTq_[kN-m]"].iloc[-1] == 0.0
    torque = lost["GenTq_[kN-m]"].to_numpy()
    assert torque[99] > 40.0 and torque[100] == 0.0 and not lost["GenTqLim_[-]"].any()
    assert np.diff(told["GenTq_[kN-m]"]).min() == pytest.approx(-1.5)
    assert Fault(kind="stuck_pitch", time=10.0).grid_loss is None


def test_wrong_faults_are_refused():
    for wrong in ({"kind": "fire", "time": 1.0}, {"kind": "grid_loss", "time": -1.0}, {"kind": "grid_loss"}):
        with pytest.raises(ValueError):
            Fault(**wrong)


STEADY = Case("steady", 16.0)


def run_with(fault, duration=40.0, torque=None):
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="standard")
    inner = make("pi", scene.turbine, DT) if torque is None else Constant(torque=torque, blade_pitch=0.2)
    controller = faulted(inner, fault, scene.turbine, DT)
    lost = None if fault is None else fault.grid_loss
    return fowt_env.simulate(scene, controller=controller, duration=duration, grid_loss=lost)


def test_a_fault_that_never_comes_gives_the_bits_of_the_compiled_run():
    plain = run_with(None)
    late = run_with(Fault(kind="grid_loss", time=1e6))
    np.testing.assert_array_equal(plain.to_numpy(), late.to_numpy())


def test_the_plant_loses_its_torque_and_the_rotor_is_braked_by_feathering():
    frame = run_with(Fault(kind="emergency_stop", time=10.0))
    time = frame["Time_[s]"]
    assert (frame["GenTq_[kN-m]"][time > 10.2] == 0.0).all()
    rate = np.diff(frame["BldPitch1_[deg]"]) / np.diff(time)
    assert np.abs(rate).max() <= 8.0 + 1e-6
    assert frame["BldPitch1_[deg]"].iloc[-1] == pytest.approx(90.0, abs=0.1)
    assert frame["RotSpeed_[rpm]"].iloc[-1] < 4.0


def test_a_parked_turbine_idles_and_is_run_once_for_all_controllers():
    case = Case(
        "storm", {"kind": "ewm", "turbulent": True}, {"kind": "jonswap", "Hs": 8.0, "Tp": 12.0}, parked=True
    )
    table = evaluate("pi,pi_land", [case, STEADY], duration=30.0, skip=5.0)
    assert table[["controller", "case"]].values.tolist() == [
        ["parked", "storm"], ["pi", "steady"], ["pi_land", "steady"],
    ]  # fmt: skip
    storm = table.iloc[0]
    assert storm["status"] == "ok" and storm["BldPitch1_min_[deg]"] == pytest.approx(90.0)
    assert storm["GenPwr_max_[kW]"] == 0.0 and abs(storm["RotSpeed_mean_[rpm]"]) < 2.0


def test_a_fault_after_the_end_of_the_run_is_refused():
    case = Case("late", 16.0, fault=Fault(kind="grid_loss", time=100.0))
    with pytest.raises(InputError, match="comes at 100 s"):
        evaluate("pi", [case], duration=50.0, skip=5.0)


def test_the_idling_controller_feathers_without_torque(turbine):
    controller = idling(turbine)
    controller.reset(measured(0.0))
    assert controller.act(measured(1.0)) == (0.0, turbine.pitch_drive.maximum)
