import warnings

import numba
import numpy as np
import pytest
from floaters import edited
from naive import rigid_body
from plant_helpers import state
from typer.testing import CliRunner

import fowt_env
from fowt_env import errors
from fowt_env.analysis import trim as trim_module
from fowt_env.analysis.equilibrium import check_equilibrium, evaluated
from fowt_env.analysis.trim import AZIMUTHS, mean_derivative, trim, without_fluctuations
from fowt_env.descriptions.builtin import names
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.plant.hydro.hydrostatics import hydrostatic_load
from fowt_env.plant.mooring import SUSPENDED, mooring_load
from fowt_env.plant.rigid_body import gravity_load
from fowt_env.plant.state import State, pose_of
from fowt_env.training.cli import app as cli


@pytest.fixture(scope="module")
def at_rest(still_scene):
    return trim(still_scene)


@pytest.fixture(scope="module")
def in_wind(storm_scene):
    return trim(storm_scene)


def test_trim_in_still_water_has_the_known_offsets(at_rest):
    # model-choices.md, OC3-Hywind; the overhanging rotor leaves a small lean upwind
    assert at_rest["PtfmSurge"] == pytest.approx(-0.0503, abs=5e-5)
    assert at_rest["PtfmHeave"] == pytest.approx(0.125e-3, abs=1e-6)
    assert at_rest["PtfmPitch"] == pytest.approx(-0.0422, abs=5e-5)
    for name in ("PtfmSway", "PtfmRoll", "PtfmYaw", "RotSpeed", "RotTorq", "GenPwr"):
        assert at_rest[name] == pytest.approx(0.0, abs=1e-9)


def test_vertical_loads_at_zero_offset_leave_44_newtons(still_scene):
    model, data = still_scene.model, still_scene.data()
    pose = pose_of(state())
    up = gravity_load(pose, model.rigid_body).fz + hydrostatic_load(pose, model.hydro.hull, data.counters).fz
    up += mooring_load(pose, model.mooring, data.lines, data.counters).fz
    assert up == pytest.approx(44.0, abs=5.0)


def test_mooring_tension_at_trim_is_the_published_preload(at_rest, platform):
    published = platform.published["mooring"]["fairlead_tension"] / 1e3
    assert np.mean([at_rest[f"FAIRTEN{i}"] for i in (1, 2, 3)]) == pytest.approx(published, rel=1e-4)


def test_platform_stays_at_trim_in_still_water(still_scene):
    frame = fowt_env.simulate(still_scene, controller=None, duration=100.0)
    for column in ("PtfmSurge_[m]", "PtfmSway_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]", "PtfmYaw_[deg]"):
        assert np.ptp(frame[column]) < 1e-9


def remaining(scene, point):
    """Azimuth-averaged derivative at an operating point."""
    handle = without_fluctuations(scene).handle()
    dx, mean = np.zeros(scene.n_state), np.zeros(scene.n_state)
    mean_derivative(handle, point.state.copy(), point.command.copy(), AZIMUTHS, dx, mean)
    return mean


def test_trim_in_wind_is_at_rest_on_average(storm_scene, in_wind):
    left = remaining(storm_scene, in_wind)
    moving = [i for i in range(storm_scene.n_state) if i != State.AZIMUTH]
    assert np.abs(left[moving]).max() < 1e-8
    assert left[State.AZIMUTH] == pytest.approx(in_wind.state[State.ROTOR_SPEED], rel=1e-14)


def test_trim_above_rated_holds_rated_speed_and_power(in_wind, turbine):
    assert in_wind["RotSpeed"] == pytest.approx(12.1, rel=1e-12)
    assert in_wind["GenPwr"] == pytest.approx(5000.0, rel=1e-4)
    assert 14.0 < in_wind["BldPitch1"] < 16.0
    assert in_wind.command[0] == pytest.approx(turbine.torque_law.rated_torque, rel=1e-12)
    assert in_wind.wind_speed == 18.0


def test_trim_in_wind_leans_and_drifts_with_the_thrust(in_wind):
    # means of a free OpenFAST run in the same steady wind, still water
    assert in_wind["PtfmSurge"] == pytest.approx(14.441, rel=0.05)
    assert in_wind["PtfmPitch"] == pytest.approx(2.829, rel=0.05)


def test_tower_base_carries_the_weight_above_it(at_rest, platform, turbine):
    parts = rigid_body.bodies(platform, turbine)[1:]
    R = rigid_body.rotation(*at_rest.state[3:6])
    base = np.array([0.0, 0.0, platform.tower.base_height])
    weight = [-body.mass * platform.environment.gravity * R[2] for body in parts]
    moment = sum(np.cross(body.centre - base, w) for body, w in zip(parts, weight, strict=True))
    assert at_rest["TwrBsMyt"] * 1e3 == pytest.approx(moment[1], rel=1e-8)
    assert at_rest["TwrBsFzt"] * 1e3 == pytest.approx(sum(w[2] for w in weight), rel=1e-10)
    assert at_rest["TwrBsFxt"] * 1e3 == pytest.approx(sum(w[0] for w in weight), rel=1e-6)


@pytest.mark.parametrize(
    "wind, rotor_speed, blade_pitch, thrust",
    [
        (5.0, 7.508, 0.0, 174.0),
        (8.0, 9.208, 0.0, 387.8),
        (12.0, 12.1, 3.963, 586.2),
        (18.0, 12.1, 14.95, 348.4),
        (24.0, 12.1, 22.141, 280.6),
    ],
)
def test_fixed_platform_works_where_openfast_does(wind, rotor_speed, blade_pitch, thrust, storm_scene):
    scene = fowt_env.build_scene(
        "oc3_hywind", wind=wind, sea=storm_scene.sea, duration=60.0, wave_components=60, shear_exponent=0.0,
        fidelity="reference",
    )  # fmt: skip
    point = trim(scene, platform="fixed")
    assert np.all(point.state[: State.AZIMUTH] == 0.0)
    assert point["RotSpeed"] == pytest.approx(rotor_speed, rel=5e-3)
    assert point["BldPitch1"] == pytest.approx(blade_pitch, abs=0.1)
    assert point["RtFldFxh"] / 1e3 == pytest.approx(thrust, rel=1e-2)


def test_rotor_stands_in_still_air_and_is_feathered_in_a_gale(storm_scene):
    calm_air, gale = (trim(storm_scene.with_weather(wind), platform="fixed") for wind in (0.0, 40.0))
    assert calm_air["RotSpeed"] == 0.0 and calm_air["BldPitch1"] == 0.0
    assert gale["RotSpeed"] == 0.0 and gale["BldPitch1"] == pytest.approx(90.0, rel=1e-12)


def test_weather_of_the_same_mean_has_the_same_trim_which_is_computed_once(storm_scene, monkeypatch):
    computed, compute = [], trim_module._trim
    monkeypatch.setattr(trim_module, "_trim", lambda *a: computed.append(a) or compute(*a))
    plant = storm_scene.with_model({})
    seeds = [plant.with_weather("ntm:18:B", seed=seed) for seed in (1, 2)]
    first, second = (trim(scene, platform="fixed") for scene in seeds)
    assert len(computed) == 1
    alone = compute(seeds[1], "fixed")
    assert np.array_equal(second.state, alone.state) and second.data == alone.data
    first.state[:] = 0.0
    for other in (seeds[0].with_weather(17.0), seeds[0].with_model({"structure": None})):
        trim(other, platform="fixed")
    trim(seeds[0])
    assert len(computed) == 4
    assert np.array_equal(trim(seeds[0], platform="fixed").state, alone.state)


def test_a_scene_without_fluctuations_keeps_its_types(storm_scene):
    quiet = without_fluctuations(storm_scene).model
    assert numba.typeof(quiet) == numba.typeof(storm_scene.model)
    waves = quiet.hydro.waves
    assert np.all(waves.amplitude == 0.0) and np.all(waves.velocity == 0.0)


def test_spar_without_moorings_floats_higher_where_it_is(platform):
    scene = fowt_env.build_scene("oc3_hywind", mooring=False, fidelity="reference")
    point = trim(scene)
    # the lines' 1.607 MN go: 4.8 m of cylinder and taper come out of the water
    assert 3.5 < point["PtfmHeave"] < 5.0
    assert abs(point["PtfmSurge"]) < 1e-6
    left = remaining(scene, point)
    assert np.abs(left[State.VX : State.WZ + 1]).max() < 1e-9


def test_a_scene_that_cannot_rest_is_refused(bare_scene):
    with pytest.raises(InputError, match="no steady state") as caught:
        trim(bare_scene)
    text = str(caught.value)
    assert "platform 'oc3_hywind' without wind" in text
    assert "Its weight of 79101 kN has no buoyancy: hydrodynamics = False" in text
    assert "There is no restoring in surge and sway: mooring = False" in text
    assert "-79101 kN left in heave: weight -79101" in text


@pytest.fixture
def warned(monkeypatch):
    """Warnings of platforms as in a process that has given none."""
    monkeypatch.setattr(errors, "_issued", set())


def complaint(path, wind=None):
    """(what the trim of a platform file does: "refused" or "warned", its one message)."""
    sea = None if wind is None else {"kind": "regular", "H": 0.1, "T": 2.0}
    scene = fowt_env.build_scene(path, wind=wind, sea=sea, fidelity="reference")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            trim(scene)
        except InputError as error:
            assert not caught
            return "refused", str(error)
    assert [warning.filename for warning in caught] == [__file__]
    return "warned", str(caught[0].message)


SHORT = "3 of 3 mooring lines are shorter than the distance from anchor to fairlead"
SLACK = "all mooring lines hang slack"
NONSENSE = {  # key, value, wind, what becomes of it, words of its message
    "too much ballast": (
        "mass", "8.47e6", None, "refused",
        ("no steady state", "weighs 88944 kN", "9843 kN (1004 t) too heavy", "ballast.mass = 7.46633e+06 kg"),
    ),
    "too little ballast": (
        "mass", "4e6", None, "warned",
        ("heave of 51.7 m, 43% of the draft", "(3466 t) too light", "ballast.mass = 7.46633e+06 kg"),
    ),
    "diameters in dm": (  # it floats on its side, or upside down
        "diameter", "[94.0, 94.0, 65.0, 65.0]", None, "refused or warned",
        ("from upright", "against a buoyancy of 8070814 kN (802921 m3)"),
    ),
    "centre of mass above the water": (
        "cm_depth", "-89.9155", None, "warned",
        ("unstable in", "platform pitch", "of mass is at z = 88.5 m", "cm_depth = -89.9155 m is positive"),
    ),
    "lines too short": (
        "length", "800.0", None, "refused",
        ("keel 1.63 m below the sea bed", "tower base 192 m under water", SHORT, "800 m against 884.7 m"),
    ),
    "lines too long": ("length", "1300.0", None, "warned", (SLACK, "length 1300 m", "848.7 m")),
    "lines too long, in wind": (
        "length", "1300.0", 18.0, "refused", ("in wind of 18 m/s", SLACK, "kN left in surge: rotor"),
    ),
    "azimuths in radians": (
        "azimuth_deg", "[0.0, 2.0944, 4.18879]", None, "warned",
        ("all mooring lines pull to the same side", "(851.6, 62.37) m; azimuth_deg is in degrees"),
    ),
    "weight of the lines in kN": (
        "wet_weight", "0.698094", None, "warned",
        ("pull with 2.91 kN together", "it weighs 79101 kN", "wet_weight 0.698094 N/m"),
    ),
    "no lines": (
        "azimuth_deg", "[]", 18.0, "refused",
        ("no restoring in surge and sway: no mooring lines", "kN left in surge: rotor"),
    ),
    "a mass beyond all numbers": ("mass", "1e300", None, "refused", ("too heavy", "9.81e+297 kN")),
}  # fmt: skip


@pytest.mark.parametrize("name", NONSENSE)
def test_a_platform_that_cannot_be_meant_gets_a_message_that_says_why(name, tmp_path, warned):
    key, value, wind, outcome, words = NONSENSE[name]
    done, text = complaint(edited(tmp_path, key, value), wind)
    assert done in outcome, text
    assert "mine.toml' " in text and len(text) < 1000
    for word in words:
        assert word.lower() in text.lower(), text


@pytest.mark.parametrize(
    "offsets, kind, words",
    [
        ({"heave": 121.0}, InputError, "its keel 1 m above the water"),
        ({"heave": -201.0}, InputError, "its keel 1 m below the sea bed"),
        ({"platform_pitch": np.radians(85.0)}, InputError, "its tower 85 deg from upright"),
        ({"platform_pitch": np.radians(-25.0)}, UserWarning, "25 deg from upright"),
        ({"heave": -13.0}, InputError, "its tower base 3 m under water"),
        ({"heave": 13.0}, UserWarning, "heave of 13 m, 11% of the draft"),
    ],
)
def test_a_place_is_judged_by_keel_tower_base_tilt_and_heave(offsets, kind, words, still_scene, warned):
    data = still_scene.data()
    data.lines[:, [0, 2, 5]] = 1e6, 1e6, SUSPENDED  # moorings with nothing wrong
    start = evaluated(state(), data)
    stable = -np.eye(6)
    expected = pytest.raises if kind is InputError else pytest.warns
    with expected(kind, match=words):
        check_equilibrium(still_scene, state(**offsets), start, stable, lambda: stable)


def test_runs_and_episodes_are_refused_as_their_trim_is(tmp_path):
    path = edited(tmp_path, "length", "800.0")
    with pytest.raises(InputError, match="keel 1.63 m below the sea bed"):
        fowt_env.simulate(fowt_env.build_scene(path, fidelity="reference"), duration=1.0)
    env = FowtEnv(platform=path)
    for wind in (None, {"kind": "steady", "speed": 18.0}):  # interpolated and exact trims
        with pytest.raises(InputError, match="m below the sea bed and its tower base"):
            env.reset(seed=1, options=None if wind is None else {"wind": wind})


def test_a_platform_is_warned_of_once_whatever_the_wind(tmp_path, warned):
    path = edited(tmp_path, "mass", "4e6")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = FowtEnv(platform=path)
        for seed in range(3):
            env.reset(seed=seed)
        trim(fowt_env.build_scene(path, fidelity="reference"))
    assert len(caught) == 1


def test_the_command_prints_a_warning_as_one_line(tmp_path, warned):
    path = edited(tmp_path, "mass", "4e6")
    arguments = ["simulate", f"--platform={path}", "--wind=none", "--duration=1", "--fidelity=reference"]
    result = CliRunner().invoke(cli.app, arguments, env={"COLUMNS": "80", "NO_COLOR": "1"})
    assert result.exit_code == 0, result.stderr
    shown = [line for line in result.stderr.splitlines() if "heave of 51.7 m" in line]
    assert len(shown) == 1 and shown[0].startswith("Warning: platform ")
    assert "UserWarning" not in result.stderr


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.nightly)
        if name in ("nrel5mw_iti_barge", "nrel5mw_oc4_semi")
        else name
        for name in names("platforms")
    ],
)
def test_built_in_platforms_rest_in_wind_without_a_warning(name, warned):
    platform = read_platform(name)
    rated = read_turbine(platform.turbine).rated_wind_speed
    period = 2.0 if platform.potential_flow is None else 8.0  # within the coefficients of all
    sea = {"kind": "regular", "H": 0.1, "T": period}
    with warnings.catch_warnings():  # without wind test_check.py has them at rest
        warnings.simplefilter("error")
        for share in (0.5, 1.0, 1.6):
            scene = fowt_env.build_scene(name, wind=share * rated, sea=sea, skewed_wake=False)
            trim(scene)


def test_operating_point_is_a_mapping_that_names_what_it_has(at_rest, still_scene):
    assert "PtfmSurge" in at_rest and "Nonsense" not in at_rest
    assert "Time" not in at_rest
    assert len(at_rest) == len(list(at_rest)) == len(still_scene.channels) - 1
    assert at_rest.get("Nonsense") is None
    assert "PtfmSurge" in repr(at_rest)
    with pytest.raises(InputError, match="Did you mean 'PtfmSurge'"):
        at_rest["PtfmSurg"]


def test_unknown_platform_mode_is_refused(still_scene):
    with pytest.raises(InputError, match="Known: fixed, floating"):
        trim(still_scene, platform="flying")
