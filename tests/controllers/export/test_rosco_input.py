"""DISCON.IN of a law of this package: ROSCO reads it, and controls as the law does."""

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.controllers import make
from fowt_env.controllers.export.library import export_rosco, prepared
from fowt_env.controllers.export.rosco_input import rosco_values
from fowt_env.controllers.pi import PI, PISettings
from fowt_env.controllers.rosco import SCHEDULE, Discon, Rosco, find_library
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement

TURBINE = read_turbine("nrel5mw")
DT = 0.1


def needs_library():
    try:
        find_library()
    except InputError as error:
        pytest.skip(str(error))


def read_back(path):
    """Return ROSCO with a written file as its only input."""
    return Rosco(Discon(path), DT, "read back")


def test_the_file_has_the_gains_and_limits_of_the_law():
    controller, turbine = prepared("pi", "oc3_hywind", DT)
    values, settings = rosco_values(controller, turbine, 1.225), controller.settings
    assert values["PC_RefSpd"] == pytest.approx(122.9096, rel=1e-4)
    # the slope of the law's command over a lasting error, by its own scheduled steady state
    for pitch in (0.0, 0.1, 0.3):
        step = 1e-6
        schedule = lambda p: 1.0 / (1.0 + p / settings.gain_schedule_pitch)  # noqa: E731
        integral = pitch / (schedule(pitch) * settings.KI)  # that holds this pitch at no error
        solved = pitch
        for _ in range(200):  # the gains follow the command
            solved = schedule(solved) * settings.KI * (integral + step)
        gain = np.interp(pitch, SCHEDULE, values["PC_GS_KI"])
        assert -gain == pytest.approx((solved - pitch) / step, rel=3e-3, abs=1e-9)
    assert values["PC_GS_KP"][0] == -settings.KP and values["PC_MinPit"] == settings.pitch_minimum


@pytest.mark.parametrize(("name", "rotor", "pitch"), [("pi", 0.03, 0.03), ("floating_feedback", 0.03, 0.03)])
def test_rosco_with_the_file_controls_as_the_law_does_above_rated(name, rotor, pitch, tmp_path):
    """Deviations of the two runs from each other over those from their means, in turbulence and waves."""
    needs_library()
    path = tmp_path / "DISCON.IN"
    export_rosco(name, path, control_dt=DT)
    scene = build_scene("oc3_hywind", wind="ntm:18:B", sea="paper_wind_wave", seed=3, duration=700.0)
    here = simulate(scene, controller=name, duration=200.0)
    there = simulate(scene, controller=read_back(path), duration=200.0)
    for channel, allowed in (("RotSpeed_[rpm]", rotor), ("BldPitch1_[deg]", pitch)):
        ours, theirs = here[channel][400:], there[channel][400:]
        assert np.sqrt(np.mean((ours - theirs) ** 2)) < allowed * ours.std(), channel


class Both:
    """Lets a law control and ROSCO listen; keeps the blade pitch (deg) that each commands."""

    name = "both"
    information = (*Measurement._fields, "plant_model")

    def __init__(self, law, rosco):
        self.parts, self.pitches = (law, rosco), []

    def prepare(self, scene):
        for part in self.parts:
            part.prepare(scene)

    def reset(self, measurement):
        for part in self.parts:
            part.reset(measurement)

    def act(self, measurement):
        commands = [part.act(measurement) for part in self.parts]
        self.pitches.append([np.degrees(command[1]) for command in commands])
        return commands[0]


def test_rosco_replays_the_measurements_of_the_law_within_a_tenth_of_a_degree(tmp_path):
    """In open loop, where the integrals of small differences remain."""
    needs_library()
    path = tmp_path / "DISCON.IN"
    export_rosco("pi", path, control_dt=DT)
    scene = build_scene("oc3_hywind", wind="ntm:18:B", sea="paper_wind_wave", seed=3, duration=700.0)
    both = Both(make("pi", scene.turbine, DT), read_back(path))
    simulate(scene, controller=both, duration=100.0)
    ours, theirs = np.array(both.pitches).T
    assert ours.std() > 1.0 and np.abs(ours - theirs).max() < 0.1


def test_what_rosco_lacks_is_refused_or_said(tmp_path):
    for name in ("lqr", "mpc", "ipc", "policy:ppo_lqr"):
        with pytest.raises(InputError, match="to ROSCO: only the PI laws"):
            export_rosco(name, tmp_path / "DISCON.IN")
    law = PI(PISettings.published(TURBINE, speed_filter_corner=np.inf), DT)
    with pytest.raises(InputError, match="speed_filter_corner = inf"):
        rosco_values(law, TURBINE, 1.225)
    sentences = export_rosco("floating_feedback", tmp_path / "DISCON.IN")
    assert any("torque_gain = -68.55 N m per m/s is left out" in sentence for sentence in sentences)
    assert "torque_gain" in (tmp_path / "DISCON.IN").read_text()
