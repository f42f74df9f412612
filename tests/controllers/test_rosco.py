"""The ROSCO library in the loop: its deck, instances that do not disturb each other, and what it does."""

import os
import pickle
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.controllers import make
from fowt_env.controllers.rosco import (
    ENTRY,
    Discon,
    Rosco,
    RoscoSettings,
    Table,
    deck,
    find_library,
    pitch_gains,
    poles,
    rotor_table,
)
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import ControllerError, InputError, PlantWarning
from fowt_env.plant.measurement import Measurement

needs_library = pytest.mark.skipif(
    find_spec("rosco") is None,
    reason="needs the ROSCO library: pip install --no-deps rosco",
)
RATED = Measurement(*[0.0] * len(Measurement._fields))._replace(
    rotor_speed=1.267109,
    generator_speed=122.9096,
    generator_torque=43093.55,
    wind_speed=18.0,
    blade_pitch=0.26,
)


@pytest.fixture(scope="module")
def scene():
    return build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard")


def started(scene, name="rosco"):
    controller = make(name, scene.turbine, 0.1)
    controller.prepare(scene)
    controller.reset(RATED)
    return controller


def answers(controller, speeds):
    return [
        controller.act(RATED._replace(time=0.1 * k, generator_speed=speed, rotor_speed=speed / 97.0))
        for k, speed in enumerate(speeds)
    ]


def test_the_proportional_gain_is_negative_over_the_whole_schedule(scene):
    proportional, integral = pitch_gains(scene.turbine)
    assert (proportional < 0.0).all() and (integral < 0.0).all()
    assert proportional[0] == -0.006275604


def test_the_estimator_and_the_torque_loop_are_those_of_roscos_own_deck(turbine):
    """DISCON.IN of ROSCO's Test_Cases/NREL-5MW, written by its toolbox 2.10.1 from the OpenFAST files.

    Within 0.5 %: the blades' inertia in its deck is that of another table of masses (0.4 %).
    """
    found = deck(turbine, 1.225, rotor_table(turbine, 1.225), RoscoSettings())
    assert found["WE_Jtot"] == pytest.approx(43702538.057, rel=5e-3)
    assert found["VS_KP"] == pytest.approx(-6.97771e2, rel=5e-3)
    assert found["VS_KI"] == pytest.approx(-1.04507e2, rel=5e-3)


@pytest.mark.parametrize(
    ("wind", "pole"), [(4.738, -0.02601), (8.214, -0.04509), (17.293, -0.1422), (24.093, -0.4133)]
)
def test_the_poles_are_those_of_roscos_own_deck(turbine, wind, pole):
    """WE_FOPoles of the same file; that turbine has constant power above rated, which adds P/(omega^2 J).

    Within 5 %: its best tip-speed ratio is 7.50 and ours 7.68, and the slopes come from unlike tables.
    """
    ours = np.interp(wind, *poles(turbine, 1.225, rotor_table(turbine, 1.225)))
    if wind > turbine.rated_wind_speed:
        ours += 43093.55 * 97.0 / (1.267109 * 43702538.057)
    assert ours == pytest.approx(pole, rel=0.05)


@needs_library
def test_instances_in_one_process_do_not_disturb_each_other(scene):
    up, down = 123.0 + np.linspace(0.0, 8.0, 60), 123.0 - np.linspace(0.0, 8.0, 60)
    alone = answers(started(scene), up)
    first, second = started(scene), started(scene)
    together = []
    for k in range(60):
        for controller, speeds in ((second, down), (first, up)):
            m = RATED._replace(time=0.1 * k, generator_speed=speeds[k], rotor_speed=speeds[k] / 97.0)
            answer = controller.act(m)
        together.append(answer)
    assert together == alone


@needs_library
def test_a_pickled_one_starts_afresh_once_prepared(scene):
    speeds = 123.0 + np.linspace(0.0, 5.0, 20)
    original = started(scene, "rosco_float")
    twin = pickle.loads(pickle.dumps(original))
    with pytest.raises(InputError, match="prepare"):
        twin.reset(RATED)
    twin.prepare(scene)
    twin.reset(RATED)
    assert answers(twin, speeds) == answers(original, speeds)


@needs_library
def test_its_greeting_and_its_files_stay_out_of_sight(tmp_path):
    code = (
        "from fowt_env import build_scene, simulate\n"
        "s = build_scene('oc3_hywind', wind=18.0, duration=10.0, fidelity='standard')\n"
        "print('before'); simulate(s, 'rosco', duration=2.0); print('after')\n"
    )
    root = str(Path(__file__).resolve().parents[2])
    env = os.environ | {"PYTHONPATH": root, "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["before", "after"]
    assert not list(tmp_path.glob("fowt_rosco_*"))


@needs_library
def test_its_warnings_stay_out_of_sight(scene, capfd):
    controller = started(scene)
    for k in range(50):  # a rotor at a tenth of its speed: the wind estimator leaves its bounds
        controller.act(RATED._replace(time=0.1 * k, generator_speed=12.0, rotor_speed=0.12))
    needed = sys.modules[Rosco.__module__]._needed
    next(each for each in needed if hasattr(each, "_gfortran_flush_i4"))._gfortran_flush_i4(None)
    print("afterwards")
    assert capfd.readouterr().out == "afterwards\n"


@needs_library
def test_an_entry_of_its_deck_can_be_changed_and_an_unknown_one_is_named(scene):
    changed = Rosco(RoscoSettings(), 0.1, changes={"PC_GS_KP": 0.5 * pitch_gains(scene.turbine)[0]})
    speeds = 123.0 + np.linspace(0.0, 5.0, 20)
    for controller in (changed, twin := pickle.loads(pickle.dumps(changed))):
        controller.prepare(scene)
        controller.reset(RATED)
    softer = answers(changed, speeds)
    assert softer == answers(twin, speeds)
    assert softer[-1][1] < answers(started(scene), speeds)[-1][1]
    with pytest.raises(InputError, match="'PC_GS_PK'. Did you mean 'PC_GS_KP'"):
        Rosco(RoscoSettings(), 0.1, changes={"PC_GS_PK": 1.0}).prepare(scene)


@needs_library
def test_its_log_has_the_name_of_the_controller_and_roscos_extension(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logged = Rosco(RoscoSettings(), 0.1, changes={"LoggingLevel": 1})
    logged.prepare(scene)
    logged.reset(RATED)
    answers(logged, [123.0, 123.0])
    assert [path.name for path in tmp_path.iterdir()] == ["rosco.RO.dbg"]


def test_without_the_library_the_message_says_what_to_install(scene, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match="pip install --no-deps rosco"):
        make("rosco", scene.turbine, 0.1).prepare(scene)


@needs_library
def test_a_broken_library_is_named(scene, tmp_path, monkeypatch):
    broken = tmp_path / "libdiscon.so"
    broken.write_text("no library")
    needed = find_library()[1]
    monkeypatch.setattr(sys.modules[Rosco.__module__], "find_library", lambda: (broken, needed))
    controller = make("rosco", scene.turbine, 0.1)
    controller.prepare(scene)
    with pytest.raises(InputError, match="cannot be used"):
        controller.reset(RATED)


@needs_library
@pytest.mark.parametrize("wind", [13.0, 18.0, 24.0])
def test_it_settles_where_the_published_law_settles(wind):
    scene = build_scene("oc3_hywind", wind=wind, duration=200.0, fidelity="standard")
    last = {name: simulate(scene, name, duration=200.0).iloc[-1] for name in ("rosco", "gspi_oc3")}
    for channel in ("BldPitch1_[deg]", "GenTq_[kN-m]", "RotSpeed_[rpm]"):
        assert last["rosco"][channel] == pytest.approx(last["gspi_oc3"][channel], rel=1e-3)


@needs_library
def test_floating_feedback_damps_the_platform():
    scene = build_scene("oc3_hywind", wind=18.0, duration=300.0, fidelity="standard")
    left = {}
    for name in ("rosco", "rosco_float"):
        frame = simulate(scene, name, duration=300.0, initial={"PtfmPitch": 6.0})
        left[name] = frame["PtfmPitch_[deg]"].iloc[1500:].std()
    assert left["rosco_float"] < 0.5 * left["rosco"]


@pytest.mark.parametrize("key, value", [("mode", 3), ("gain", 0.1), ("low_pass", 0.0), ("high_pass", -1.0)])
def test_settings_out_of_range_are_named(key, value):
    with pytest.raises(InputError, match=key):
        Rosco(RoscoSettings(**{key: value}), 0.1)


@pytest.fixture
def discon():
    """The DISCON.IN of the IEA 15 MW turbine on VolturnUS-S."""
    return Discon(read_turbine("iea15").discon)


def test_a_turbines_own_deck_is_taken_as_it_stands(discon):
    text, table = discon.texts({}, None)
    changed = [
        (old, new) for old, new in zip(discon.text.splitlines(), text.splitlines(), strict=True) if old != new
    ]
    names = {ENTRY.match(new)["name"] for _, new in changed}
    assert names == {"LoggingLevel", "Ext_Interface", "PerfFileName"}
    for old, new in changed:
        assert old.partition("!")[2] == new.partition("!")[2]
    assert "Power coefficient" in table  # the file that the deck names
    assert discon.values["PC_RefSpd"] == "0.791680000000" and discon.mode == 2


def test_an_entry_of_the_deck_can_be_changed_and_a_wrong_one_is_named(discon):
    text, _ = discon.texts({"SS_Mode": 0}, None)
    assert any(line.startswith("0   ") and "SS_Mode" in line for line in text.splitlines())
    with pytest.raises(InputError, match="PC_RefSpeed"):
        discon.texts({"PC_RefSpeed": 1.0}, None)


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("IPC_ControlMode", "1   ! IPC_ControlMode - x", "IPC_ControlMode = 1: must be 0 here"),
        ("Fl_Mode", "3   ! Fl_Mode - x", "Fl_Mode = 3: must be 0, 1 or 2"),
        ("PerfFileName", "", "PerfFileName is missing"),
    ],
)
def test_a_deck_that_needs_more_than_it_is_given_is_refused(tmp_path, discon, old, new, part):
    lines = [new if old in line else line for line in discon.text.splitlines()]
    path = tmp_path / "DISCON.IN"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError) as caught:
        Discon(path)
    assert part in str(caught.value)


def test_a_deck_of_rosco_2_9_gets_what_2_10_needs_with_a_warning_and_a_change_of_it(tmp_path, discon):
    path = tmp_path / "DISCON.IN"
    lines = [line for line in discon.text.splitlines() if "F_VSRefSpdCornerFreq" not in line]
    assert len(lines) == len(discon.text.splitlines()) - 1
    path.write_text("\n".join(lines))
    with pytest.warns(PlantWarning, match="of ROSCO 2.9, .*F_VSRefSpdCornerFreq = 0.20944 is used"):
        old = Discon(path)
    assert not discon.added

    def entry(text):
        return [match["value"] for line in text.splitlines() if (match := ENTRY.match(line))
                and match["name"] == "F_VSRefSpdCornerFreq"]  # fmt: skip

    for changes, value in (({}, "0.20944"), ({"F_VSRefSpdCornerFreq": 0.3}, "0.3")):
        assert entry(old.texts(changes, lambda: Table(*np.ones((2, 2)), *np.ones((3, 2, 2))))[0]) == [value]


def test_an_entry_that_rosco_misses_is_named_with_its_file_and_the_installed_version(tmp_path, discon, scene):
    path = tmp_path / "DISCON.IN"
    path.write_text("\n".join(line for line in discon.text.splitlines() if "! PC_RefSpd" not in line))
    controller = Rosco(Discon(path), 0.1)
    controller.prepare(scene)
    with pytest.raises(ControllerError, match=f"PC_RefSpd.* for '{path}'; installed is ROSCO 2"):
        controller.reset(RATED)


def test_the_individual_variant_switches_a_decks_own_gains_on_and_nothing_else(tmp_path, discon):
    individual = Discon(discon.path, individual=True)
    one, other = discon.texts({}, None)[0].splitlines(), individual.texts({}, None)[0].splitlines()
    (line,) = [new for old, new in zip(one, other, strict=True) if old != new]
    assert ENTRY.match(line)["name"] == "IPC_ControlMode" and line.split()[0] == "1"
    path = tmp_path / "DISCON.IN"
    lines = ["2   ! IPC_ControlMode - x" if "IPC_ControlMode" in x else x for x in discon.text.splitlines()]
    path.write_text("\n".join(lines))
    assert not Discon(path, individual=True).switched  # 1P and 2P, as the file has it


@needs_library
def test_the_feedback_of_a_deck_is_given_the_slope_of_the_platforms_pitch_rate(scene, discon):
    """A rate that rises by 0.004 rad/s a second reaches the library as 0.004 rad/s2."""
    controller = Rosco(discon, 0.1)
    controller.prepare(scene)  # of which a deck of its own takes no more than the turbine
    rated = RATED._replace(
        rotor_speed=0.79168, generator_speed=0.79168, generator_torque=1.9e7, blade_pitch=0.25
    )
    controller.reset(rated)
    seen = []
    for k in range(1, 5):
        controller.act(rated._replace(time=0.1 * k, platform_pitch_rate=0.004 * 0.1 * k))
        seen.append(controller._swap.records[82])
    assert seen == pytest.approx([0.004] * 4, rel=1e-5)


def test_the_feedback_of_a_deck_needs_no_more_than_sensors_have():
    controller = make("rosco", read_turbine("iea15"), 0.1)
    assert "platform_pitch_rate" in controller.information
    assert "nacelle_pitch_acceleration" not in controller.information
    assert make("rosco_float", read_turbine("iea15"), 0.1).information == controller.information
