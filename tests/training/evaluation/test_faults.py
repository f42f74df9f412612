"""Faults in load cases: on the plant, with their protection, and what counts as the controller's."""

import numpy as np
import pytest

import fowt_env
from fowt_env.controllers import make
from fowt_env.descriptions.faults import Fault
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import leaderboard

SHORT = {"duration": 60.0, "skip": 5.0}
STEADY = Case("steady", 16.0)


def row_of(case, controller="pi"):
    return evaluate(controller if isinstance(controller, dict) else str(controller), [case], **SHORT).iloc[0]


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


def test_a_stop_has_the_time_to_standstill_of_its_rows():
    row = row_of(Case("stop", 16.0, fault=Fault(kind="emergency_stop", time=10.0), trip=None))
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="standard")
    frame = fowt_env.simulate(scene, "pi", duration=60.0, faults={"kind": "emergency_stop", "time": 10.0})
    fast = frame["Time_[s]"][frame["RotSpeed_[rpm]"].abs() > 1.21]
    assert row["status"] == "ok" and row["standstill_time_[s]"] == pytest.approx(fast.iloc[-1] - 10.0)
    assert np.isnan(row_of(STEADY)["standstill_time_[s]"])


class Provoking:
    """pi that lets the rotor go at a time, so that the protection stops the turbine."""

    def __init__(self, turbine, at):
        self.inner, self.at = make("pi", turbine, 0.1), at
        self.information = self.inner.information

    def reset(self, measurement):
        self.inner.reset(measurement)

    def act(self, measurement):
        torque, pitch = self.inner.act(measurement)
        return (0.0, 0.0) if measurement.time >= self.at else (torque, pitch)


def test_a_trip_after_a_fault_is_the_case_and_any_other_the_controllers(turbine):
    """Nobody gains by a stop that he provokes: before the fault, or in a fault that he is to live with."""
    loss = Fault(kind="grid_loss", time=20.0)
    frozen = Fault(kind="sensor_freeze", time=20.0, field="platform_pitch")
    cases = [Case(fault.kind, 16.0, fault=fault, trip=1.2) for fault in (loss, frozen)]
    agents = {"pi": "pi", "early": Provoking(turbine, 5.0), "late": Provoking(turbine, 25.0)}
    runs = evaluate(agents, cases, **SHORT)
    status = runs.set_index(["controller", "case"])["status"]
    assert status["early"].tolist() == ["tripped", "tripped"]
    assert status["late", "sensor_freeze"] == "tripped" and status["pi", "sensor_freeze"] == "ok"
    assert status["late", "grid_loss"] == "ok"
    entries = {entry["controller"]: entry for entry in leaderboard(runs)["controllers"]}
    assert [entries[name]["lost"] for name in ("pi", "late", "early")] == [0, 1, 2]


def test_the_reason_names_the_trip_and_its_limit():
    case = Case("stuck", 16.0, fault=Fault(kind="pitch_runaway", time=10.0, towards="feather"), trip=None,
                protection={"pitch_deviation": {"limit_deg": 4.0}})  # fmt: skip
    row = row_of(case)
    assert row["status"] == "ok" and 10.0 < row["stopped_[s]"] < 13.0
    at = row["stopped_[s]"]
    assert (
        row["reason"] == f"pitch deviation trip at {at:.1f} s: a blade pitch more than 4 deg from its command"
    )
