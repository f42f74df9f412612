"""What is said of a platform at rest: closed forms, published figures, and files that cannot be meant."""

import json
import re
from math import pi, sqrt

import numba
import numpy as np
import pytest
from floaters import TENDON, edited, semi, spar, tension_leg
from plant_helpers import state
from typer.testing import CliRunner

import fowt_env
from fowt_env.analysis.check import _at_own_frequency, check_platform
from fowt_env.analysis.linear_model import natural_periods
from fowt_env.analysis.wave_excitation import wave_force
from fowt_env.descriptions.builtin import names
from fowt_env.descriptions.platform import Line, read_platform
from fowt_env.scene.geometry import geometry_faults
from fowt_env.training import cli
from fowt_env.training.cli import app  # noqa: F401


@pytest.fixture(scope="module")
def oc3():
    return check_platform("oc3_hywind")


def test_oc3_fits_and_has_its_published_figures(oc3, platform):
    published = platform.published
    assert oc3.faults == ()
    assert oc3.statics.weight == pytest.approx(published["weight"], rel=1e-6)
    assert oc3.statics.buoyancy == pytest.approx(published["buoyancy"], rel=1e-6)
    assert oc3.statics.pull == pytest.approx(published["mooring_preload"], rel=1e-6)
    assert oc3.statics.mass_centre[2] == pytest.approx(-78.0, abs=0.01)
    for motion, period in published["natural_periods"].items():
        name = "platform pitch" if motion == "pitch" else motion
        assert oc3.periods[name] == pytest.approx(period, rel=4e-3)


def test_metacentric_height_is_that_of_the_waterplane(oc3, platform):
    radius = 0.5 * platform.hull.diameter[-1]
    still = oc3.statics
    own = 0.25 * pi * radius**4 / still.volume
    wanted = still.buoyancy_centre[2] + own - still.mass_centre[2]
    assert still.metacentric_height == pytest.approx([wanted, wanted], rel=1e-5)


def test_frequencies_of_blades_and_shaft_are_told_at_rest_and_at_rated_speed(oc3, turbine):
    flap, torsion = oc3.rotor["first flapwise, collective"], oc3.rotor["drivetrain torsion"]
    assert flap.standstill == pytest.approx(0.7, abs=0.02)  # NREL/TP-500-38060, Table 9-1: 0.6993 Hz
    assert flap.rated > 1.05 * flap.standstill  # stiffened by the rotation
    ends = oc3.rotor["first edgewise, progressive"].rated - oc3.rotor["first edgewise, regressive"].rated
    assert ends == pytest.approx(turbine.rated_rotor_speed / pi, rel=0.03)
    assert torsion.rated > 3.0 and not any("tower" in mode for mode in oc3.rotor)
    assert check_platform("oc3_hywind", blades="modes", shaft="torsion").periods == oc3.periods


def test_periods_are_those_of_the_linear_model(oc3):
    known = natural_periods(fowt_env.build_scene("oc3_hywind", fidelity="reference"))
    for motion, period in known.items():  # the linear model's rotor is free to turn, which roll feels
        assert oc3.periods[motion.replace("platform_", "platform ")] == pytest.approx(period, rel=2e-3)


@pytest.mark.nightly
def test_a_spar_of_members_floats_as_the_spar_does(oc3):
    found = check_platform(spar())
    assert found.faults == ()
    assert found.statics.buoyancy == pytest.approx(oc3.statics.buoyancy, rel=1e-12)
    assert found.statics.metacentric_height == pytest.approx(oc3.statics.metacentric_height, rel=1e-9)
    for motion in ("surge", "heave"):
        assert found.rest[motion] == pytest.approx(oc3.rest[motion], abs=1e-7)
    for motion in ("surge", "sway", "heave", "roll", "platform pitch"):  # its yaw lacks the delta lines
        assert found.periods[motion] == pytest.approx(oc3.periods[motion], rel=5e-4)


def test_a_tension_leg_platform_rests_on_its_tendons():
    found = check_platform(tension_leg())
    still, (length, _, stiffness) = found.statics, TENDON
    assert found.faults == ()
    assert still.pull == pytest.approx(8 * 3833338.083, rel=2e-6)
    # heave: eight springs and the waterplane against mass and the added mass of a half sphere
    area = pi * 81.0
    spring = 8 * stiffness / length + 1025.0 * 9.80665 * area
    mass = still.weight / 9.80665 + 1025.0 * 2.0 / 3.0 * pi * 729.0
    assert found.periods["heave"] == pytest.approx(2.0 * pi * sqrt(mass / spring), rel=2e-3)
    left = still.buoyancy - still.weight - still.pull
    assert found.rest["heave"] == pytest.approx(left / spring, rel=1e-3)
    # the published platform (Matha, 2010): heave 2.29 s, surge 60.6 s, yaw 10.3 s, with panel added mass
    assert found.periods["heave"] == pytest.approx(2.29, rel=0.02)
    assert found.periods["surge"] == pytest.approx(60.6, rel=0.08)
    assert found.periods["yaw"] == pytest.approx(10.3, rel=0.05)


@pytest.mark.nightly
@pytest.mark.parametrize("wind", [8.0, 11.4, 24.0])
def test_a_tension_leg_platform_finds_its_rest_in_wind(wind):
    point = fowt_env.trim(fowt_env.build_scene(tension_leg(), wind=wind, fidelity="standard"))
    assert abs(point["PtfmPitch"]) < 0.5 and 0.5 < point["PtfmSurge"] < 6.0
    # tendons of this length set down by the square of the drift
    drop = 0.5 * point["PtfmSurge"] ** 2 / TENDON[0]
    calm = fowt_env.trim(fowt_env.build_scene(tension_leg(), fidelity="standard"))["PtfmHeave"]
    assert point["PtfmHeave"] == pytest.approx(calm - drop, abs=0.01)


def test_a_semi_of_members_floats_upright():
    found = check_platform(semi())
    assert found.faults == ()
    assert abs(found.rest["heave"]) < 0.2 and abs(found.rest["platform pitch"]) < 0.2
    inertia = sum(36.0 * pi * (9.0 + x * x) for x in (14.4, -28.8, 14.4)) + 0.25 * pi * 3.25**4
    still = found.statics
    height = still.buoyancy_centre[2] + inertia / still.volume - still.mass_centre[2]
    assert still.metacentric_height[1] == pytest.approx(height, rel=2e-3)


NONSENSE = {  # key, value, words of the faults; test_trim.py has more, which trims are refused or warned for
    "too much ballast": ("mass", "8.47e6", ("weighs 88944 kN", "9843 kN (1004 t) too heavy")),
    "lines far too short": ("length", "500.0", ("45.3 m below the sea bed", "shorter than the distance")),
    "azimuths in radians": (
        "azimuth_deg", "[0.0, 2.0944, 4.18879]", ("look like radians", "equilibrium is 199.9 m off"),
    ),
    "fairleads in dm": ("fairlead_radius", "52.0", ("52 m from the tower axis", "the hull reaches 4.7 m")),
    "anchors too high": ("anchor_z", "-120.0", ("200 m above the sea bed",)),
}  # fmt: skip


@pytest.mark.parametrize("name", NONSENSE)
def test_what_cannot_be_meant_is_a_fault_with_figures(name, tmp_path):
    key, value, words = NONSENSE[name]
    found = " ".join(check_platform(edited(tmp_path, key, value)).faults)
    for word in words:
        assert word in found, found


def test_the_added_mass_is_that_of_the_modes_own_frequency():
    """One heaving mass whose added mass falls with frequency: the period solves its equation."""

    class Potential:
        omega = np.array([0.1, 2.0])
        added_mass = np.stack([np.diag([4e6] * 6), np.diag([1e6] * 6)])
        added_mass_infinite = np.diag([1e6] * 6)
        added_mass_zero = None

    mass, spring = np.diag([9e6 + 1e6] * 3 + [1e9] * 3), np.diag([-1e5, -2e5, -5e6, -1e8, -2e8, -3e8])
    same = {"moved": np.eye(6), "slopes": spring, "height": 0.0, "arm": 10.0}
    period = _at_own_frequency("heave", 2.0 * pi * sqrt(1e7 / 5e6), mass, Potential, same)
    omega = 2.0 * pi / period
    added = 4e6 - 3e6 * (omega - 0.1) / 1.9
    assert omega == pytest.approx(sqrt(5e6 / (9e6 + added)), rel=1e-6)


def test_members_and_lines_in_wrong_places_are_named():
    low = semi().members[0].model_copy(update={"start": (14.4, 25.0, -220.0)})
    with pytest.warns(fowt_env.PlantWarning, match="ember 1 reaches down to z = -220 m, below the sea bed"):
        fowt_env.build_scene(semi(members=(low, *semi().members[1:])), fidelity="reference")
    inside = Line(
        anchor=(-60.0, 0.0, -200.0), fairlead=(70.0, 0.0, -14.0), length=300.0, wet_weight=1e3, EA=1e9
    )
    with pytest.warns(fowt_env.PlantWarning, match="he anchor of line 1 is closer to the tower axis"):
        fowt_env.build_scene(semi(lines=(inside,)), fidelity="reference")


def test_one_platform_is_warned_of_once():
    dry = tuple(
        member.model_copy(update={"start": (x, y, 30.0), "end": (x, y, 40.0)})
        for member, (x, y) in zip(semi().members[:3], ((1.0, 0.0), (2.0, 0.0), (3.0, 0.0)), strict=True)
    )
    with pytest.warns(fowt_env.PlantWarning, match="ll 3 members lie above the water"):
        fowt_env.build_scene(semi(members=dry, lines=()), fidelity="reference")
    fowt_env.build_scene(semi(members=dry, lines=()), fidelity="reference")


# the command


def run(*arguments):
    environment = {"COLUMNS": "200", "NO_COLOR": "1"}
    return CliRunner().invoke(cli.app.app, ["model", "check", *arguments], env=environment)


def test_the_command_prints_figures_and_ends_well_where_all_fits():
    result = run("oc3_hywind")
    assert result.exit_code == 0 and "no contradictions found" in result.stdout
    for words in (
        r"weight +79100 +kN",
        r"natural period, heave +30\.83 +s",
        r"tension of line 3 +911\.1 +kN",
        r"rest, sway +0 +m",
        r"rest, heave +0\.0001253 +m",
        r"rest, yaw +0 +deg",
    ):
        assert re.search(words, result.stdout), result.stdout


def test_the_command_fails_where_something_does_not_fit(tmp_path):
    result = run(str(edited(tmp_path, "mass", "4e6")), "--json")
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert found["rest"]["heave"] == pytest.approx(51.7, abs=0.1)
    assert any("too light" in fault for fault in found["faults"])


def test_the_command_refuses_a_file_that_cannot_be_read(tmp_path):
    assert run(str(tmp_path / "none.toml")).exit_code == 2


def test_built_in_platforms_have_no_fault_of_geometry():
    for name in names("platforms"):
        assert geometry_faults(read_platform(name)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", names("platforms"))
def test_built_in_platforms_fit(name):
    assert check_platform(name).faults == ()


# what else takes a hull of members


@pytest.mark.parametrize("position", ["fixed", "instantaneous"])
@pytest.mark.parametrize("attitude", [{}, {"roll": 0.05, "platform_pitch": 0.1, "yaw": 0.6}])
def test_a_spar_of_members_has_the_wave_force_of_its_strips(attitude, position):
    same = {"kinematics_position": position, "surface": "swl", "stretching": "none", "strip_length": 1.0}
    omega = np.array([0.9, 0.3, 0.6, 1.5])
    strips, members = (
        wave_force(fowt_env.build_scene(hull, fidelity="reference", **same), state(**attitude), omega)
        for hull in ("oc3_hywind", spar())
    )
    for columns in (slice(0, 3), slice(3, 6)):
        scale = np.abs(strips[:, columns]).max(axis=1)
        assert (np.abs(members[:, columns] - strips[:, columns]).max(axis=1) < 1e-3 * scale).all()


def test_planar_scenes_need_members_on_both_sides():
    fowt_env.build_scene(semi(), planar=True, fidelity="reference")
    with pytest.raises(fowt_env.InputError, match="member from .* has no mirror image"):
        fowt_env.build_scene(semi(members=semi().members[1:]), planar=True, fidelity="reference")


def test_other_weather_keeps_the_types_of_members():
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
    scene = fowt_env.build_scene(semi(), sea=sea, fidelity="standard", duration=100.0)
    series = scene.model.hydro.members.series.values
    assert series.shape[0] > 100
    odd = {"omega": [0.5, 0.50002, 1.0], "amplitude": [1.0] * 3, "phase": [0.0] * 3}
    for other in (None, {"kind": "components", "heading": 0.0} | odd):
        there = scene.with_weather(None, other, 2)
        assert numba.typeof(there.handle()) == numba.typeof(scene.handle())
    again = scene.with_weather(None, sea, 0)
    assert np.array_equal(again.model.hydro.members.series.values, series)
