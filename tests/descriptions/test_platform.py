"""Descriptions: the built-in files load and agree with published figures; wrong input is reported in full."""

import math
from pathlib import Path

import numpy as np
import pytest

from fowt_env.descriptions import platform as description
from fowt_env.descriptions.builtin import names
from fowt_env.descriptions.files import MAX_BYTES
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.sea_state import (
    iec_gamma,
    joint_sea_state,
    joint_tables,
    read_sea_state,
    sea_state_of,
    sea_states,
)
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError

PLATFORM = description.DATA / "platforms" / "oc3_hywind.toml"
TURBINE = description.DATA / "turbines" / "nrel5mw" / "turbine.toml"
BLADE = TURBINE.parent / "blade.csv"


def platform_text(*changes):
    """Text of the built-in platform file with (old, new) replacements."""
    return changed(PLATFORM.read_text(), changes)


def turbine_text(*changes):
    """Text of the built-in turbine file with its blade named from the built-in folder, and replacements."""
    text = TURBINE.read_text().replace('"blade', '"nrel5mw/blade')
    return changed(text.replace('"polars"', '"nrel5mw/polars"'), changes)


def changed(text, changes):
    for old, new in changes:
        assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
        text = text.replace(old, new)
    return text


def write(folder, name, text):
    path = folder / name
    path.write_text(text)
    return path


def message(read, argument):
    """Text of the InputError that read(argument) raises."""
    with pytest.raises(InputError) as caught:
        read(argument)
    return str(caught.value)


def blade_message(folder, blade, *changes):
    """(path, text of the InputError) of a turbine file with a blade file beside it."""
    write(folder, "blade.csv", blade)
    path = write(folder, "mine.toml", turbine_text(('"nrel5mw/blade.csv"', '"blade.csv"'), *changes))
    return path, message(read_turbine, path)


def hull_volume(hull):
    """Displaced volume at rest, m3: conical sections up to still water."""
    z = [*(height for height in hull.z if height < 0.0), 0.0]
    a = [*(d for height, d in zip(hull.z, hull.diameter, strict=True) if height < 0.0), hull.diameter[-1]]
    sections = zip(z[:-1], z[1:], a[:-1], a[1:], strict=True)
    return sum(math.pi / 12.0 * (top - low) * (d**2 + d * e + e**2) for low, top, d, e in sections)


# --------------------------------------------------------------------------- built-in files


@pytest.mark.parametrize("name", names("platforms"))
def test_every_built_in_platform_loads_with_its_turbine(name):
    platform = read_platform(name)
    assert platform.name == name
    assert read_turbine(platform.turbine).name == platform.turbine


@pytest.mark.parametrize("name", names("turbines"))
def test_every_built_in_turbine_loads(name):
    turbine = read_turbine(name)
    assert turbine.name == name
    assert set(turbine.gains) in ({"oc3", "land"}, set())  # none published: derived


def test_oc3_weight_equals_buoyancy_less_mooring_preload_within_100_N():
    platform = read_platform("oc3_hywind")
    turbine = read_turbine(platform.turbine)
    mass = platform.ballast.mass + platform.tower.mass + turbine.nacelle.mass + turbine.rotor.mass
    volume = hull_volume(platform.hull)
    site = platform.environment
    assert mass == 8066048.0
    assert volume == pytest.approx(platform.published["displaced_volume"], abs=0.01)
    buoyancy = site.water_density * site.gravity * volume
    preload = 3 * 535727.3  # elastic catenary at rest, N; independent of the file
    assert abs(buoyancy - mass * site.gravity - preload) < 100.0
    assert platform.published["mooring_preload"] == pytest.approx(preload, abs=10.0)
    assert platform.published["weight"] == pytest.approx(mass * site.gravity, abs=10.0)
    assert platform.published["buoyancy"] == pytest.approx(buoyancy, abs=100.0)


def test_oc3_tower_inertia_is_that_of_its_published_mass_distribution():
    density = np.array(
        [4667.0, 4345.28, 4034.76, 3735.44, 3447.32, 3170.4, 2904.69, 2650.18, 2406.88, 2174.77, 1953.87]
    )
    section = [24443.7, 20952.2, 17847.0, 15098.5, 12678.6, 10560.1, 8717.2, 7124.9, 5759.8, 4599.3, 3622.1]
    tower = read_platform("oc3_hywind").tower
    stations = np.linspace(tower.base_height, tower.top_height, 11)
    z = np.linspace(tower.base_height, tower.top_height, 20001)
    m, j = np.interp(z, stations, density), np.interp(z, stations, section)
    mass = np.trapezoid(m, z)
    center = np.trapezoid(m * z, z) / mass
    assert mass == pytest.approx(tower.mass, rel=1e-7)
    assert center == pytest.approx(tower.cm_height, abs=0.06)
    assert np.trapezoid(m * (z - center) ** 2 + j, z) == pytest.approx(tower.inertia[1], rel=1e-7)
    assert 2.0 * np.trapezoid(j, z) == pytest.approx(tower.inertia[2], rel=1e-6)


def test_oc3_lines_are_symmetric_and_reach_from_seabed_to_spar():
    platform = read_platform("oc3_hywind")
    assert len(platform.lines) == 3
    for line, azimuth in zip(platform.lines, (0.0, 120.0, 240.0), strict=True):
        assert math.hypot(*line.anchor[:2]) == pytest.approx(853.87, rel=1e-12)
        assert math.hypot(*line.fairlead[:2]) == pytest.approx(5.2, rel=1e-12)
        assert math.degrees(math.atan2(line.anchor[1], line.anchor[0])) % 360.0 == pytest.approx(azimuth)
        assert (line.anchor[2], line.fairlead[2]) == (-320.0, -70.0)
    assert platform.lines[1].anchor[1] == -platform.lines[2].anchor[1]
    assert platform.lines[1].anchor[0] == platform.lines[2].anchor[0]


def test_nrel5mw_units_are_converted_once():
    turbine = read_turbine("nrel5mw")
    assert turbine.rated_rotor_speed == pytest.approx(1.267109, abs=5e-7)
    assert turbine.overspeed == pytest.approx(1.3 * turbine.rated_rotor_speed, rel=1e-12)
    assert turbine.pitch_drive.rate_limit == pytest.approx(0.1396263, abs=5e-8)
    assert turbine.pitch_drive.maximum == pytest.approx(math.pi / 2.0, rel=1e-15)
    assert turbine.rotor.blades == 3
    law = turbine.torque_law
    assert law.rated_torque == pytest.approx(law.rated_power / law.rated_speed, rel=1e-6)
    assert law.rated_speed == pytest.approx(97.0 * turbine.rated_rotor_speed, rel=1e-6)


def test_nrel5mw_blade_has_the_19_evaluated_stations_and_whole_polars():
    blade = read_turbine("nrel5mw").blade
    assert len(blade.radius) == len(blade.chord) == len(blade.twist) == len(blade.airfoil) == 19
    assert blade.radius[[0, 1, -2, -1]].tolist() == [1.55, 2.8667, 61.6333, 62.95]
    assert (blade.chord[0], blade.chord[-1]) == (3.542, 1.419)
    assert np.degrees(blade.twist[[0, -1]]) == pytest.approx([13.308, 0.106])
    assert set(blade.polars) == set(blade.airfoil)
    assert len(blade.polars) == 8
    for polar in blade.polars.values():
        assert (polar[0, 0], polar[-1, 0]) == (-np.pi, np.pi)
        assert (np.diff(polar[:, 0]) > 0.0).all()
        assert (polar[:, 2] >= 0.0).all()
        assert polar[0, 1:] == pytest.approx(polar[-1, 1:])
    naca = blade.polars["NACA64_A17"]
    assert np.interp(0.0, naca[:, 0], naca[:, 1]) == pytest.approx(0.442)


# --------------------------------------------------------------------------- wrong values in files


WRONG_PLATFORMS = [  # what is replaced in the file, by what, and what the message has
    ("mass = 7466330.0", "mass = -5.0", "ballast.mass", "-5.0", "must be a number > 0"),
    ("mass = 7466330.0", "mass = nan", "ballast.mass", "nan", "must be a number > 0"),
    ("mass = 7466330.0", 'mass = "7466330"', "ballast.mass", "'7466330'", "must be a number > 0"),
    ("mass = 7466330.0", "mass = true", "ballast.mass", "True", "must be a number > 0"),
    ("cm_depth = 89.9155", "cm_depth = nan",
     "ballast.cm_depth", "nan", "must be a number >= -100000 and <= 100000"),
    ("cm_depth = 89.9155", "", "ballast.cm_depth", "missing", "must be a number >= -100000 and <= 100000"),
    ("cm_depth = 89.9155", "cm_dept = 89.9155", "ballast.cm_dept", "unknown key", "'cm_depth'"),
    ("[hydro]", "[hydr]", "hydr: unknown key", "Did you mean 'hydro'?", "hydro is missing"),
    ("4229230000.0, 164", "-1.0, 164", "ballast.inertia.2", "-1.0", "must be a number >= 0"),
    ("shear_exponent = 0.14", "shear_exponent = 1.5", "environment.shear_exponent", ">= 0 and <= 1"),
    ("[-120.0, -12.0", "[-12.0, -120.0", "hull", "-120.0", "must increase"),
    ("[-120.0, -12.0", "[-420.0, -12.0", "hull.z.1", "-420.0", ">= -water_depth = -320.0"),
    ("6.5, 6.5]", "1e200, 1e200]", "hull.diameter.3", "1e+200", "> 0 and <= 10000"),
    ("6.5, 6.5]", "6.5]", "hull", "same length", "4 and 3"),
    ("anchor_z = -320.0", "anchor_z = -321.0", "lines.1.anchor", "-321.0", "between -water_depth"),
    ("anchor_z = -320.0", "anchor_z = -60.0", "lines.3.anchor", "-60.0", "below its fairlead at -70.0"),
    ("azimuth_deg = [0.0", 'azimuth_deg = ["0"', "mooring.azimuth_deg.1", "'0'", "a finite number"),
    ("azimuth_deg =", "azimuth_dg =", "mooring.azimuth_dg: unknown key", "'azimuth_deg'"),
    ("[mooring]", "[moorings]", "moorings: unknown key", "Did you mean 'mooring'?"),
    ("length = 902.2", "length = 0", "mooring.length", "= 0", "must be a number > 0"),
    ("top_height = 87.6", "top_height = 9.0", "top_height = 9.0", "must be > base_height = 10.0"),
    ('turbine = "nrel5mw"', 'turbine = "nrel5mv"', "turbine:", "'nrel5mv'", "Did you mean 'nrel5mw'?"),
    ('turbine = "nrel5mw"', "turbine = 5", "turbine = 5", "must be text"),
    ("[published]", "[[published]]", "published = [{", "must be a table"),
    ("[published]", "[published", "not valid TOML", "line"),
    ("linear_damping = [1.0e5,", "linear_damping = [", "hydro.linear_damping.6 is missing", "a number >= 0"),
]  # fmt: skip
WRONG_TURBINES = [
    ("blades = 3 ", "blades = 3.5 ", "rotor.blades = 3.5", "a whole number >= 1 and <= 6"),
    ("blades = 3 ", "blades = 0 ", "rotor.blades = 0", "a whole number >= 1 and <= 6"),
    ("rate_limit_deg_per_s = 8.0", "rate_limit_deg_per_s = -8.0", "rate_limit_deg_per_s = -8.0", "> 0"),
    ("rate_limit_deg_per_s = 8.0", "", "rate_limit (or rate_limit_deg_per_s) is missing", "> 0"),
    ("rate_limit_deg_per_s = 8.0", "rate_limit_deg = 8.0", "rate_limit_deg: unknown key"),
    ("minimum_deg = 0.0", "minimum_deg = 0.0\nminimum = 0.0", "minimum_deg: given twice"),
    ("minimum_deg = 0.0", "minimum_deg = 95.0", "pitch_drive", "must exceed minimum"),
    ("rated_rotor_speed_rpm = 12.1", "rated_rotor_speed_rpm = false", "rated_rotor_speed_rpm = False"),
    ("overspeed_rpm = 15.73", "overspeed_rpm = 12.0", "overspeed", "must be > rated_rotor_speed"),
    ("rated_wind_speed = 11.4", "rated_wind_speed = 2.0", "rated_wind_speed = 2.0", "between"),
    ("efficiency = 0.944", "efficiency = 1.2", "drivetrain.generator_efficiency = 1.2", "> 0 and <= 1"),
    ("KP = 0.01882681", "KP = -0.01882681", "gains.land.KP = -0.01882681", "> 0"),
    ("transition_speed = 121.6805", "transition_speed = 12.0", "transition_speed = 12.0", "must be"),
    ("max_torque = 47402.91", "max_torque = 4.0", "max_torque = 4.0", ">= rated_torque"),
    ("tip_radius = 63.0", "tip_radius = 1.0", "tip_radius = 1.0", "hub_radius = 1.5"),
    ("tip_radius = 63.0", "tip_radius = 62.9", "blade.radius.19 = 62.95", "tip_radius = 62.9"),
    ("stations =", "station =", "blade.station: unknown key", "'stations'"),
    ('"nrel5mw/blade.csv"', '"nowhere.csv"', "blade file", "nowhere.csv", "does not exist"),
    ('"nrel5mw/polars"', '"nowhere"', "blade.polars", "'nowhere'", "no CSV files"),
    ("[blade]", "[blades]", "blades: unknown key", "'blade'", "blade is missing"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("read", "text", "change"),
    [
        *((read_platform, platform_text, change) for change in WRONG_PLATFORMS),
        *((read_turbine, turbine_text, change) for change in WRONG_TURBINES),
    ],
)
def test_a_wrong_value_names_file_key_value_and_range(tmp_path, read, text, change):
    old, new, *parts = change
    path = write(tmp_path, "mine.toml", text((old, new)))
    found = message(read, path)
    assert [part for part in (str(path), *parts) if part not in found] == []


def test_all_problems_of_a_file_come_in_one_message(tmp_path):
    text = platform_text(
        ("mass = 7466330.0", "mass = -5.0"),
        ("drag_coefficient = 0.6", "drag_coefficent = 0.6"),
        ("EA = 384243000.0", "EA = 0.0"),
        ("water_depth = 320.0", 'water_depth = "deep"'),
    )
    lines = message(read_platform, write(tmp_path, "mine.toml", text)).splitlines()
    assert "5 problems" in lines[0]  # the misspelt key is unknown, and the right one missing
    for key in (
        "ballast.mass",
        "hydro.drag_coefficent",
        "hydro.drag_coefficient",
        "mooring.EA",
        "environment.water",
    ):
        assert sum(key in line for line in lines) >= 1


def test_turbine_problems_in_toml_and_blade_come_in_one_message(tmp_path):
    blade = BLADE.read_text().replace("DU40_A17", "DU40_A71")
    found = blade_message(tmp_path, blade, ("mass = 240000.0", "mass = -1"))[1]
    assert "nacelle.mass = -1" in found
    assert "unknown airfoil 'DU40_A71'. Did you mean 'DU40_A17'?" in found


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (("1.55,3.542,", "1.45,3.542,"), ["radius.1 = 1.45", "hub_radius = 1.5"]),
        (("62.95,1.419,", "63.5,1.419,"), ["radius.19 = 63.5", "tip_radius = 63.0"]),
        (("11.7500,4.557,", "11.7500,nan,"), ["line 14", "chord_m = nan", "must be a number > 0"]),
        (("11.7500,4.557,", "11.7500,-4.557,"), ["line 14", "chord_m = -4.557", "must be a number > 0"]),
        (("11.7500,4.557,", "11.7500,wide,"), ["line 14", "chord_m = wide", "must be a number > 0"]),
        (("11.7500,4.557,", "7.5,4.557,"), ["line 14", "radius_m = 7.5", "must increase"]),
        (("11.7500,4.557,13.308", "11.7500,4.557,200"), ["twist_deg = 200", ">= -180 and <= 180"]),
        (("radius_m,chord_m", "radius,chord_m"), ["columns are radius, chord_m", "expected radius_m"]),
        (("11.7500,4.557,", "11.7500,4.557,1.0,"), ["line 14 has 5 cells"]),
        (("13.308,DU40_A17", "13.308,"), ["line 14", "unknown airfoil ''"]),
    ],
)
def test_a_wrong_blade_file_names_line_column_value_and_range(tmp_path, change, parts):
    path, text = blade_message(tmp_path, changed(BLADE.read_text(), [change]))
    for part in [str(path), *parts]:
        assert part in text
    assert str(tmp_path / "blade.csv") in text or "blade.radius" in text


@pytest.mark.parametrize("content", ["", "# only a comment\n", "radius_m,chord_m,twist_deg,airfoil\n"])
def test_an_empty_blade_file_is_refused(tmp_path, content):
    text = blade_message(tmp_path, content)[1]
    assert str(tmp_path / "blade.csv") in text
    assert "expected the columns radius_m, chord_m, twist_deg, airfoil" in text


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("-180,0,1,0\n90,0,1,0\n", ["-180 to 90 deg", "must cover -180 to 180 deg"]),
        ("-90,0,1,0\n180,0,1,0\n", ["-90 to 180 deg", "must cover -180 to 180 deg"]),
        ("-180,0,1,0\n10,0,1,0\n10,0,1,0\n180,0,1,0\n", ["10 deg after 10 deg", "must increase"]),
        ("-180,0,1,0\n20,0,1,0\n10,0,1,0\n180,0,1,0\n", ["10 deg after 20 deg", "must increase"]),
        ("-180,0,1,0\n180,nan,1,0\n", ["line 3", "cl = nan", "a finite number"]),
        ("-190,0,1,0\n180,0,1,0\n", ["alpha_deg = -190", ">= -180 and <= 180"]),
        ("", ["no rows"]),
    ],
)
def test_a_wrong_polar_is_refused(tmp_path, content, parts):
    polar = write(tmp_path, "flat.csv", "alpha_deg,cl,cd,cm\n" + content)
    blade = "radius_m,chord_m,twist_deg,airfoil\n2,3,4,flat\n60,1,0,flat\n"
    text = blade_message(tmp_path, blade, ('"nrel5mw/polars"', '"."'))[1]
    for part in [str(polar), *parts]:
        assert part in text


# --------------------------------------------------------------------------- names and paths


def test_a_misspelt_name_suggests_the_nearest():
    assert "Did you mean 'oc3_hywind'" in message(read_platform, "oc3_hywnd")
    assert "Did you mean 'nrel5mw'" in message(read_turbine, "NREL5MW")
    assert "Did you mean 'oc3_5_2'" in message(read_sea_state, "oc3_5.2")
    assert "Did you mean 'north_sea'" in message(lambda table: joint_sea_state(table, 9.0), "north_see")
    assert "Did you mean 'platforms'?" in message(names, "platform")


@pytest.mark.parametrize("argument", [None, 5, True, ["oc3_hywind"], b"oc3_hywind"])
def test_what_is_no_name_is_refused(argument):
    assert "must be a built-in name or a path" in message(read_platform, argument)


def test_a_missing_file_a_folder_and_a_huge_file_are_refused(tmp_path):
    assert "does not exist" in message(read_platform, tmp_path / "no.toml")
    assert "not a regular file" in message(read_platform, tmp_path)
    huge = write(tmp_path, "huge.toml", "#" * (MAX_BYTES + 1))
    assert f"at most {MAX_BYTES}" in message(read_platform, huge)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    assert "not UTF-8" in message(read_platform, binary)
    assert "cannot be read" in message(read_platform, "a/" + "b" * 5000 + ".toml")
    assert "\\x00" in message(read_platform, "a/\0.toml")


def test_a_users_platform_file_works_like_the_built_in_one(tmp_path):
    path = write(tmp_path, "mine.toml", platform_text())
    assert read_platform(path) == read_platform(str(path)) == read_platform("oc3_hywind")


def test_a_platform_may_give_its_lines_one_by_one_and_no_lines(tmp_path):
    text = PLATFORM.read_text()
    start, end = text.index("[mooring]"), text.index("[published]")
    line = "[[lines]]\nanchor = [800, 0, -320]\nfairlead = [5, 0, -70]\n"
    line += "length = 900\nwet_weight = 700\nEA = 4e8\n"
    one = read_platform(write(tmp_path, "one.toml", text[:start] + line + text[end:]))
    assert [item.anchor for item in one.lines] == [(800.0, 0.0, -320.0)]
    assert read_platform(write(tmp_path, "none.toml", text[:start] + text[end:])).lines == ()
    both = message(read_platform, write(tmp_path, "both.toml", text[:end] + line + text[end:]))
    assert "lines: given twice" in both
    wrong = message(
        read_platform, write(tmp_path, "w.toml", text[:start] + line.replace("900", "-1") + text[end:])
    )
    assert "lines.1.length = -1: must be a number > 0" in wrong


def test_a_platform_may_name_a_turbine_beside_itself(tmp_path):
    (tmp_path / "rotor").mkdir()
    turbine = write(tmp_path / "rotor", "mine.toml", turbine_text(('name = "nrel5mw"', 'name = "mine"')))
    change = ('turbine = "nrel5mw"', 'turbine = "rotor/mine.toml"')
    platform = read_platform(write(tmp_path, "platform.toml", platform_text(change)))
    assert Path(platform.turbine) == turbine.resolve()
    assert read_turbine(platform.turbine).name == "mine"


def test_a_turbine_reads_its_blade_beside_itself_or_from_a_built_in_turbine(tmp_path):
    built_in = read_turbine("nrel5mw")
    borrowed = read_turbine(write(tmp_path, "borrowed.toml", turbine_text()))
    assert np.array_equal(borrowed.blade.chord, built_in.blade.chord)
    write(tmp_path, "blade.csv", BLADE.read_text().replace("11.7500,4.557,", "11.7500,5.0,"))
    own = read_turbine(write(tmp_path, "own.toml", turbine_text(('"nrel5mw/blade.csv"', '"blade.csv"'))))
    assert own.blade.chord[4] == 5.0
    assert built_in.blade.chord[4] == 4.557


def test_si_keys_and_handy_keys_mean_the_same(tmp_path):
    text = turbine_text(
        ("rated_rotor_speed_rpm = 12.1", f"rated_rotor_speed = {12.1 * 2.0 * math.pi / 60.0!r}"),
        ("maximum_deg = 90.0", f"maximum = {math.pi / 2.0!r}"),
    )
    mine, built_in = read_turbine(write(tmp_path, "mine.toml", text)), read_turbine("nrel5mw")
    assert mine.rated_rotor_speed == pytest.approx(built_in.rated_rotor_speed, rel=1e-15)
    assert mine.pitch_drive == built_in.pitch_drive


# --------------------------------------------------------------------------- sea states


def test_every_built_in_sea_state_has_source_and_confidence():
    states = sea_states()
    assert len(states) > 80
    for name, state in states.items():
        assert state.name == name
        assert state.source
        assert state.confidence[0] in "ABCD"
        assert read_sea_state(name) is state


def test_named_sea_states_carry_the_reference_figures():
    assert (read_sea_state("paper_regular").H, read_sea_state("paper_regular").T) == (3.0, 5.0)
    assert (read_sea_state("paper_wind_wave").gamma, read_sea_state("paper_wind_wave").wind) == (3.3, 18.0)
    assert read_sea_state("oc3_5_3").wind == 18.0
    severe = read_sea_state("gulf_of_maine_severe_12")
    assert (severe.kind, severe.wind, severe.Hs, severe.Tp) == ("jonswap", 12.0, 8.5, 13.1)
    assert read_sea_state("wmo_6").Tp == pytest.approx(5.0 * math.sqrt(5.0), rel=1e-3)
    assert read_sea_state("nato_5").wind == pytest.approx(24.5 * 0.514444 * (90.0 / 19.5) ** 0.14, abs=0.01)


def test_gamma_follows_the_iec_rule_where_it_is_not_given():
    assert iec_gamma(6.0, 10.0) == pytest.approx(math.exp(5.75 - 1.15 * 10.0 / math.sqrt(6.0)), rel=1e-14)
    assert iec_gamma(9.0, 3.0 * 3.6) == 5.0
    assert iec_gamma(9.0, 15.0) == pytest.approx(1.0)
    assert iec_gamma(0.0, 10.0) == 1.0
    assert iec_gamma(1.0, 20.0) == 1.0
    assert sea_state_of({"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}).gamma == iec_gamma(6.0, 10.0)
    assert sea_state_of({"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}).gamma == 3.3
    assert sea_state_of({"kind": "jonswap", "Hs": np.float32(6.0), "Tp": np.int64(10)}).Tp == 10.0


@pytest.mark.parametrize("name", names("joint_tables"))
def test_joint_sea_states_equal_the_rows_and_are_linear_between_them(name):
    table = joint_tables()[name]
    for wind, Hs, Tp in zip(table.wind, table.Hs, table.Tp, strict=True):
        state = joint_sea_state(name, wind)
        assert (state.wind, state.Hs, state.Tp) == (wind, Hs, Tp)
        assert read_sea_state(f"{name}_{f'{wind:g}'.replace('.', '_')}").Hs == Hs
    middle = joint_sea_state(name, 0.5 * (table.wind[0] + table.wind[1]))
    assert middle.Hs == pytest.approx(0.5 * (table.Hs[0] + table.Hs[1]), rel=1e-12)
    assert middle.gamma == iec_gamma(middle.Hs, middle.Tp)


@pytest.mark.parametrize("wind", [3.9, 24.1, math.nan, math.inf, "8", True, None])
def test_joint_sea_states_end_with_their_table(wind):
    text = message(lambda speed: joint_sea_state("gulf_of_maine_normal", speed), wind)
    assert "wind_speed" in text
    assert "must be >= 4 and <= 24 m/s" in text


def test_a_sea_state_comes_from_none_a_name_a_mapping_a_file_or_a_record(tmp_path):
    assert sea_state_of(None).kind == "still"
    assert sea_state_of("oc3_4_1") is read_sea_state("oc3_4_1")
    regular = sea_state_of({"kind": "regular", "H": 2, "T": 8, "heading": 30, "ramp": 50.0})
    assert (regular.H, regular.T, regular.heading, regular.ramp, regular.phase) == (2.0, 8.0, 30.0, 50.0, 0.0)
    assert sea_state_of(regular) is regular
    path = write(tmp_path, "sea.toml", 'kind = "regular"\nH = 2\nT = 8\nheading = 30\nramp = 50\n')
    assert sea_state_of(path) == sea_state_of(str(path)) == regular
    table = write(tmp_path, "table.toml", "wind = [4, 8]\nHs = [1, 2]\nTp = [5, 7]\n")
    assert joint_sea_state(table, 6.0).Tp == 6.0


def test_components_are_copied_and_phases_filled():
    omega = np.array([0.5, 1.0])
    state = sea_state_of({"kind": "components", "omega": omega, "amplitude": [1, 2]})
    omega[0] = 99.0
    assert state.omega.tolist() == [0.5, 1.0]
    assert state.amplitude.dtype == np.float64
    assert state.phase.tolist() == [0.0, 0.0]
    both = sea_state_of({"kind": "components", "omega": [1], "amplitude": [1], "phase": [2], "heading": [45]})
    assert (both.phase.tolist(), both.heading.tolist()) == ([2.0], [45.0])


@pytest.mark.parametrize(
    ("spec", "parts"),
    [
        (7, ["sea state = 7", "must be None, a name"]),
        ({}, ["kind is missing", "'still', 'regular', 'jonswap'"]),
        ({"kind": "jonswp"}, ["kind = 'jonswp'", "Did you mean 'jonswap'?"]),
        ({"kind": "jonswap", "hs": 1.0, "Tp": 9.0}, ["hs: unknown key", "'Hs'", "Hs is missing"]),
        ({"kind": "jonswap", "Hs": 1.0, "Tp": 9.0, "H": 2.0}, ["H: unknown key", "kind 'jonswap'"]),
        ({"kind": "jonswap", "Hs": 1.0, "Tp": 9.0, "gamma": 0.5}, ["gamma = 0.5", ">= 1 and <= 10"]),
        ({"kind": "jonswap", "Hs": -1.0, "Tp": 9.0}, ["Hs = -1.0", ">= 0"]),
        ({"kind": "jonswap", "Hs": math.nan, "Tp": 0.0}, ["Hs = nan", "Tp = 0.0", ">= 0.01"]),
        ({"kind": "regular", "H": True, "T": "3"}, ["H = True", "T = '3'", "a number >= 0.01"]),
        ({"kind": "regular", "H": 1.0, "T": 3.0, "heading": math.inf}, ["heading = inf", "finite number"]),
        ({"kind": "regular", "H": 1.0, "T": 3.0, "heading": [1.0]}, ["heading = [1.0]", "one number"]),
        ({"kind": "regular", "H": 1.0, "T": 3.0, "ramp": -1.0}, ["ramp = -1.0", ">= 0"]),
        ({"kind": "still", "Hs": 1.0}, ["Hs: unknown key"]),
        ({"kind": "components", "omega": [1.0, 2.0], "amplitude": [1.0]}, ["same length", "2, 1, 2"]),
        ({"kind": "components", "omega": [1.0, 0.0], "amplitude": [1.0, 1.0]}, ["omega.2 = 0.0", "> 0"]),
        ({"kind": "components", "omega": [1.0], "amplitude": [-1.0]}, ["amplitude.1 = -1.0", ">= 0"]),
        (
            {"kind": "components", "omega": ["a"], "amplitude": [math.nan]},
            ["omega = ['a']", "amplitude = [nan]"],
        ),
    ],
)
def test_a_wrong_sea_state_names_key_value_and_range(spec, parts):
    text = message(sea_state_of, spec)
    for part in parts:
        assert part in text


def test_a_deck_in_place_of_a_platform_file_is_named(tmp_path):
    deck = tmp_path / "model.fst"
    deck.write_text("OpenFAST input file")
    with pytest.raises(InputError, match="is an OpenFAST deck: `fowt import` it first"):
        read_platform(deck)
