"""Controllers in a process of their own: the same commands, and nothing but what they declare."""

import pytest

import fowt_env
from fowt_env.errors import ControllerError
from fowt_env.training.board.isolated import IsolatedFactory, TimeLimits

SOUND = """
class Mine:
    def __init__(self, turbine, control_dt):
        self.rated = turbine.rated_rotor_speed * turbine.drivetrain.gear_ratio
        self.torque = turbine.torque_law.rated_torque

    def reset(self, measurement):
        self.integral = measurement.blade_pitch

    def act(self, measurement):
        error = measurement.generator_speed - self.rated
        self.integral += 1e-4 * error
        return self.torque, self.integral + 5e-3 * error
"""


def factory(folder, source, information=("generator_speed", "blade_pitch"), **limits):
    (folder / "mine.py").write_text(source)
    return IsolatedFactory(str(folder), "mine.py", "Mine", "mine", information, (), TimeLimits(**limits))


def run(controller, duration=20.0):
    return fowt_env.simulate(fowt_env.build_scene("oc3_hywind", wind=18.0), controller, duration)


def test_commands_are_those_of_the_same_controller_here(tmp_path):
    there = run(factory(tmp_path, SOUND))
    scope = {}
    exec(SOUND, scope)
    here = run(scope["Mine"])
    assert (there["BldPitch1_[deg]"] == here["BldPitch1_[deg]"]).all()
    assert there["BldPitch1_[deg]"].std() > 0.0


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("raise ValueError('no')", r"act\(\) raised ValueError: no"),
        ("import os; os._exit(3)", "its process ended in act"),
        ("import time; time.sleep(5)", "act.. took longer than 0.2 s"),
        ("raise SystemExit(0)", "raised SystemExit"),
        ("return 'many', 'words'", "act"),
        ("return 1.0, float('nan')", "must return two finite numbers"),
        ("bytearray(10**11)", "raised MemoryError"),
    ],
)
def test_what_a_controller_does_ends_its_run_alone(tmp_path, body, words):
    source = SOUND.replace("error = measurement.generator_speed - self.rated", body)
    with pytest.raises(ControllerError, match=words):
        run(factory(tmp_path, source, call=0.2))


def test_a_controller_does_not_see_what_the_caller_holds(tmp_path, monkeypatch):
    monkeypatch.setenv("SECRET_SEEDS", "41")
    probe = "import os, sys; raise ValueError(str(os.environ.get('SECRET_SEEDS')) + os.path.expanduser('~'))"
    source = SOUND.replace("error = measurement.generator_speed - self.rated", probe)
    with pytest.raises(ControllerError, match="raised ValueError: None.*fowt-submission-"):
        run(factory(tmp_path, source))


def test_a_process_starts_anew_for_each_run_and_leaves_nothing(tmp_path):
    source = SOUND.replace(
        "self.integral = measurement.blade_pitch",
        "import pathlib; left = pathlib.Path('left'); assert not left.exists(); left.touch();"
        " self.integral = measurement.blade_pitch",
    )
    made = factory(tmp_path, source)
    run(made, 2.0)
    run(made, 2.0)
    assert not (tmp_path / "left").exists()
