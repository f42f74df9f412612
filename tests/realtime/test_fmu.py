"""The FMU of the plant passes a checker and gives the rows of simulate."""

import json
import zipfile

import numpy as np
import pytest
from command_line import fowt

import fowt_env
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.realtime.fmu import PLANT, write_fmu

SCENE = {"platform": "oc3_hywind", "wind": "ntm:18:B", "sea": None, "seed": 2, "duration": 700.0}
RUN = {"duration": 6.0, "control_dt": 0.1}
STEPS = 60
TIME = 0.1 * np.arange(STEPS)
TORQUE, PITCH = 43.0 + 0.3 * np.sin(TIME), 14.9 + np.sin(0.5 * TIME)


@pytest.fixture(scope="module")
def fmpy():
    pytest.importorskip("pythonfmu", reason="PythonFMU is not installed: the extra `fmu` is missing")
    return pytest.importorskip("fmpy", reason="FMPy, the checker of FMUs, is not installed")


@pytest.fixture(scope="module")
def plant(fmpy, tmp_path_factory):
    return write_fmu(tmp_path_factory.mktemp("fmu") / "plant.fmu", SCENE, RUN)


class Replay:
    """The inputs of the FMU as a controller of simulate."""

    information = ()

    def reset(self, measurement):
        self.left = iter(zip(TORQUE.tolist(), PITCH.tolist(), strict=True))

    def act(self, measurement):
        torque, pitch = next(self.left)
        return torque * 1e3, pitch * DEGREE


def result(fmpy, plant, **options):
    """Rows of all outputs at each communication point."""
    rows = list(zip(TIME, TORQUE, PITCH, strict=True))
    names = ("time", "command.GenTq", "command.BlPitchC1")
    inputs = np.array(rows, dtype=[(name, "f8") for name in names])
    settings = {"stop_time": 6.0, "step_size": 0.1, "output_interval": 0.1, "input": inputs} | options
    return fmpy.simulate_fmu(str(plant), **settings)


def test_a_checker_has_no_objection(fmpy, plant):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(plant)) == []
    about = fmpy.read_model_description(str(plant))
    assert about.fmiVersion == "2.0" and about.coSimulation.modelIdentifier == "FloatingTurbine"
    assert about.defaultExperiment.stepSize == "0.1" and about.defaultExperiment.stopTime == "6.0"
    inputs = [v for v in about.modelVariables if v.causality == "input"]
    assert [v.name for v in inputs] == ["command.GenTq", "command.BlPitchC1"]
    assert float(inputs[0].start) == pytest.approx(43.09355)
    assert "rotor speed, rpm" in [v.description for v in about.modelVariables if v.name == "RotSpeed"]


def test_the_outputs_are_the_rows_of_simulate(fmpy, plant):
    scene = fowt_env.build_scene(**SCENE)
    expected = fowt_env.simulate(scene, Replay(), 6.0)
    outputs = result(fmpy, plant)
    assert len(outputs) == STEPS + 1
    np.testing.assert_allclose(outputs["Time"], expected["Time_[s]"], atol=1e-12)
    for column in ("RotSpeed_[rpm]", "PtfmPitch_[deg]", "PtfmSurge_[m]", "BldPitch1_[deg]", "FAIRTEN1_[kN]"):
        got = outputs[column.partition("_[")[0]]
        # FMPy interpolates its inputs at the communication points, with rounding
        np.testing.assert_allclose(got, expected[column], rtol=1e-9, err_msg=column)
    np.testing.assert_allclose(outputs["GenTq"][1:], expected["GenTq_[kN-m]"][:-1], rtol=1e-9)


@pytest.mark.parametrize("options", [{"step_size": 0.05, "output_interval": 0.05}, {"stop_time": 6.2}])
def test_a_step_that_the_plant_cannot_make_fails(fmpy, plant, options):
    with pytest.raises(fmpy.fmi1.FMICallException, match="DoStep failed"):
        result(fmpy, plant, **options)


def test_a_step_is_of_whole_control_periods_from_the_time_of_the_plant(fmpy, plant, tmp_path):
    from fowt_env.realtime.fmu_slave import FloatingTurbine

    with zipfile.ZipFile(plant) as content:
        content.extract(f"resources/{PLANT}", tmp_path)
    slave = FloatingTurbine(instance_name="one", resources=str(tmp_path / "resources"))
    slave.setup_experiment(10.0, None, None)
    slave.enter_initialization_mode()
    before = list(slave._values)
    for start, step, message in ((10.0, 0.15, "whole control periods"), (10.1, 0.1, "the plant is at 10 s")):
        with pytest.raises(InputError, match=message):
            slave.do_step(start, step)
    assert slave._values == before
    assert slave.do_step(10.0, 0.2) and slave._values[0] == pytest.approx(0.2)


def test_an_fmu_of_another_version_is_refused(fmpy, plant, tmp_path):
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(plant) as old, zipfile.ZipFile(other, "w") as new:
        for item in old.infolist():
            content = old.read(item)
            if item.filename.endswith(PLANT):
                content = json.dumps(json.loads(content) | {"fowt_env": "0.0.1"}).encode()
            new.writestr(item, content)
    with pytest.raises(fmpy.fmi1.FMICallException, match="InitializationMode"):
        result(fmpy, other)


def test_the_command_writes_an_fmu_and_refuses_another_name(fmpy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stderr = fowt("connect", "fmu", "oc3_hywind", "plant.fmu", "--duration", "5", "--control-dt", "0.05")[1]
    assert "wrote plant.fmu" in stderr and "0.05 s" in stderr
    assert zipfile.is_zipfile("plant.fmu")
    assert "must end with .fmu" in fowt("connect", "fmu", "oc3_hywind", "plant.zip", code=2)[1]
    assert [path.name for path in tmp_path.iterdir()] == ["plant.fmu"]


def test_without_its_library_the_message_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setattr("fowt_env.realtime.fmu.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"fowt-env\[fmu\]"):
        write_fmu(tmp_path / "plant.fmu", SCENE, RUN)
