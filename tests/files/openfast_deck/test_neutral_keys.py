"""What a deck has and the plant does not is said: every key is read, neutral, without effect, or reported."""

import re

import pytest
from small_deck import NAMES, set_key, write_deck

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.importer import import_deck
from fowt_env.files.openfast_deck.keys import UNKNOWN
from fowt_env.files.openfast_deck.parser import bare
from fowt_env.files.openfast_deck.report import make_report

MOORED = {"OpenFAST": [("1    CompMooring", "3    CompMooring"), ("map.dat", "moor.dat")]}


def deck_with(folder, part, key, value, **changes):
    """Path of a small deck whose part has a value for a key, in place of its own or as a new line."""
    path = write_deck(folder, **changes)
    set_key(folder / NAMES[part], part, key, value)
    return path


def differences(path):
    """{what the deck has: what is here} of a deck."""
    return dict(make_report(read_deck(path), "x").differences)


def row_of(folder, rows, part, key, value):
    """The one row that a value of a key adds to those of a small deck; rows: function of a deck's path."""
    before = set(rows(write_deck(folder)))
    (row,) = set(rows(deck_with(folder, part, key, value))) - before
    return row


# --------------------------------------------------------------------------- comments


@pytest.mark.parametrize("mark", ["!", "#", "%"])
def test_a_line_that_moordyn_s_file_comments_out_is_not_moored(tmp_path, mark):
    rows = [("2 chain 4 3", f"{mark}2 chain 4 3"), ("3 chain 5 6", f"  {mark} 3 other 5 6")]
    deck = read_deck(write_deck(tmp_path, MoorDyn=rows, **MOORED))
    assert len(deck.lines) == 1
    point = [("6 Vessel", f"6 Vessel -2.5 -4.330127019  -11 0 0 0 0 {mark}")]
    (tmp_path / "other").mkdir()
    changed = read_deck(write_deck(tmp_path / "other", MoorDyn=point, **MOORED))
    assert changed.lines[2].fairlead[2] == -11.0


@pytest.mark.parametrize("mark", ["!", "#", "%"])
def test_a_row_that_hydrodyn_s_file_comments_out_is_not_counted(tmp_path, mark):
    plain = read_deck(write_deck(tmp_path)).hydrodyn.members
    place = tmp_path / NAMES["HydroDyn"]
    text = re.sub(r"(?m)^(PropSetID.*\n.*\n)", rf"\g<1> {mark} 1 11.0 0.5\n", place.read_text())
    assert read_deck(write_deck(tmp_path, HydroDyn=text)).hydrodyn.members == plain


def test_a_key_that_is_commented_out_is_none(tmp_path):
    plain = read_deck(write_deck(tmp_path)).aerodyn.polars
    place = tmp_path / NAMES["AeroDyn"]
    place.write_text(re.sub(r"(?m)^(1 +InCol_Alfa)", r"!3 InCol_Cl\n\1", place.read_text()))
    found = read_deck(tmp_path / NAMES["OpenFAST"]).aerodyn.polars
    assert {name: polar.tolist() for name, polar in found.items()} == {
        name: polar.tolist() for name, polar in plain.items()
    }


def test_a_comment_in_a_table_of_map_is_refused_as_map_takes_it_for_a_row(tmp_path):
    path = write_deck(tmp_path, MAP=[("1 chain 450.0", "!1 chain 300.0 1 2\n1 chain 450.0")])
    with pytest.raises(InputError, match="MAP\\+\\+ has no comments in this table"):
        read_deck(path)
    other = write_deck(tmp_path, MAP=[("repeat 240 120", "! repeat 90\nrepeat 240 120")])
    assert len(read_deck(other).lines) == 3  # where it has them


# --------------------------------------------------------------------------- keys


@pytest.mark.parametrize(
    ("part", "key", "value", "deck", "here"),
    [
        ("ElastoDyn", "GenDOF", "False", "fixed rotor speed", "free"),
        ("ElastoDyn", "PtfmSgDOF", "False", "platform surge disabled", "free"),
        ("ElastoDyn", "PtfmYDOF", "False", "platform yaw disabled", "planar"),
        ("ElastoDyn", "NacYaw", "30", "nacelle yawed out of the wind", "along x"),
        ("ElastoDyn", "NewKey", "3", "NewKey 3 (ElastoDyn)", "ignored"),
        ("AeroDyn", "TipLoss", "False", "no tip loss", "included"),
        ("AeroDyn", "Skew_Mod", "1", "skewed-wake correction", "skewed_wake"),
        ("AeroDyn", "Wake_Mod", "0", "no induction", "induction always on"),
        ("AeroDyn", "DBEMT_Mod", "2", "dynamic wake", "dynamic_inflow"),
        ("AeroDyn", "UA_Mod", "3", "unsteady airfoil", "quasi-steady"),
        ("ServoDyn", "VSContrl", "4", "generator torque by another law", "DISCON.IN"),
        ("ServoDyn", "PCMode", "0", "no pitch control", "controller of a run"),
        ("ServoDyn", "TPitManS(1)", "10", "override of the blade pitch", "run"),
        ("ServoDyn", "NumTStC", "2", "tuned mass dampers", "none"),
        ("ServoDyn", "BPCutoff", "2", "low pass", "none"),
        ("SeaState", "MCFD", "5", "MacCamy-Fuchs", "diffraction"),
        ("SeaState", "WvDiffQTF", "True", "second-order wave kinematics", "first order"),
        ("HydroDyn", "ExctnMod", "0", "no wave excitation", "always included"),
        ("HydroDyn", "WaveDisp", "1", "displaced members", "kinematics_position"),
        ("InflowWind", "PropagationDir", "20", "another direction", "along x"),
        ("AeroDyn", "Skew_Mod", "-1", "cross-flow wind removed", "included"),
    ],
)
def test_what_the_plant_does_not_have_is_said(tmp_path, part, key, value, deck, here):
    row = row_of(tmp_path, lambda path: differences(path).items(), part, key, value)
    assert deck in row[0] and f"{key} {value}" in row[0]
    assert here in row[1]


@pytest.mark.parametrize(
    ("part", "key", "value", "allowed"),
    [
        ("OpenFAST", "MirrorRotor", "True", "False"),
        ("OpenFAST", "NRotors", "2", "1"),
        ("ElastoDyn", "PtfmRefxt", "3", "tower axis"),
        ("tower", "NTwCMass", "2", "TMassDen"),
        ("ServoDyn", "VSContrl", "0", "--discon"),
        ("HydroDyn", "PtfmHvF", "False", "True"),
        ("HydroDyn", "NAddDOF", "1", "0"),
        ("HydroDyn", "PtfmRefY", "10", "tower axis"),
        ("AeroDyn", "ADBlFile(2)", '"another.dat"', "blade 1"),
    ],
)
def test_what_would_be_another_machine_is_refused(tmp_path, part, key, value, allowed):
    with pytest.raises(InputError) as caught:
        read_deck(deck_with(tmp_path, part, key, value))
    for text in (NAMES[part], key, bare(value), allowed):
        assert text in str(caught.value)


def simple_members(text, column, value, model="1", tapered=False):
    """HydroDyn's text with one member more, outside of the body, whose coefficients are the simple ones."""
    text = re.sub(
        r"(SimplCd .*SimplCpMG)\n(\(-\).*)\n(.*)", rf"\1 {column}\n\2 (-)\n\3 {value}", text, count=1
    )
    text = re.sub(r"(?m)^(\S+)( +NJoints)", lambda found: f"{int(found[1]) + 2}{found[2]}", text)
    text = re.sub(r"(?m)^(JointID.*\n.*\n)", r"\g<1>81 30.0 0.0 -5.0 1 0\n82 30.0 0.0 -15.0 1 0\n", text)
    text = re.sub(r"(?m)^(\S+)( +NPropSets)", lambda found: f"{int(found[1]) + 2}{found[2]}", text)
    text = re.sub(r"(?m)^(PropSetID.*\n.*\n)", r"\g<1>81 3.0 0.1\n82 2.0 0.1\n", text)
    text = re.sub(r"(?m)^(\S+)( +NMembers)", lambda found: f"{int(found[1]) + 1}{found[2]}", text)
    row = f"81 81 82 81 {82 if tapered else 81} 1.0 {model} 1 FALSE"
    return re.sub(r"(?m)^(MemberID +MJointID1.*\n.*\n)", rf"\g<1>{row}\n", text)


def test_the_buoyancy_coefficient_of_a_member_must_be_1(tmp_path):
    write_deck(tmp_path)
    text = (tmp_path / NAMES["HydroDyn"]).read_text()
    read_deck(write_deck(tmp_path, HydroDyn=simple_members(text, "SimplCb", 1.0)))
    with pytest.raises(InputError, match="member 81: simplcb = 0.5: must be 1"):
        read_deck(write_deck(tmp_path, HydroDyn=simple_members(text, "SimplCb", 0.5)))
    # of coefficients that no member outside of the body has
    read_deck(write_deck(tmp_path, HydroDyn=simple_members(text, "SimplCb", 0.5, model="2")))


@pytest.mark.parametrize(("column", "value"), [("SimplAxCd", 2.0), ("SimplAxCa", 1.0), ("SimplAxCp", 0.5)])
def test_loads_along_a_taper_are_said_to_be_left_out(tmp_path, column, value):
    write_deck(tmp_path)
    text = (tmp_path / NAMES["HydroDyn"]).read_text()
    straight = differences(write_deck(tmp_path, HydroDyn=simple_members(text, column, value)))
    assert not any("taper of member" in what for what in straight)
    tapered = differences(write_deck(tmp_path, HydroDyn=simple_members(text, column, value, tapered=True)))
    assert tapered[f"loads along the taper of member 81 ({column.lower()} {value:g})"] == "left out"


def test_a_switch_of_diffraction_in_a_table_may_be_a_truth(tmp_path):
    write_deck(tmp_path)
    text = (tmp_path / NAMES["HydroDyn"]).read_text()
    plain = differences(write_deck(tmp_path, HydroDyn=simple_members(text, "SimplMCF", "False")))
    assert not any("MacCamy" in what for what in plain)
    said = differences(write_deck(tmp_path, HydroDyn=simple_members(text, "SimplMCF", "True")))
    assert any("MacCamy-Fuchs diffraction of members (simplmcf 1)" in what for what in said)


TYPE, POINT = "chain 0.1 100.0 4.0E8 -1.0 0 2.0 0.8 0.4 0.3\n", "1 Fixed   400 0 -200 0 0 0 0\n"
MAP_TYPE, MAP_NODE = "chain  0.1  100.0  4.0E8  0.7  0 0 0 0\n", "1 fix    400 0 depth 0 0 # # #\n"


@pytest.mark.parametrize(
    ("part", "old", "new", "said"),
    [
        ("MoorDyn", "5 0  -10 0 0", "5 0  -10 1e6 0", ("M = 1e+06", "must be 0")),
        ("MoorDyn", "5 0  -10 0 0", "5 0  -10 0 100", ("V = 100", "must be 0")),
        ("MoorDyn", POINT, 2 * POINT, ("point 1", "one row only")),
        ("MoorDyn", TYPE, 2 * TYPE, ("line type chain", "one row")),
        ("MoorDyn", "1 chain 1 2", "1 chain 1 2 450.0 20 -\n1 chain 1 2", ("line 1", "one row only")),
        ("MoorDyn", "0.001 dtM - step", "150 WtrDpth", ("WtrDpth = 150", "must be 200")),
        ("MoorDyn", "4.0E8 -1.0 0", "4.0E8 -1.0 stiff.dat", ("EI = stiff.dat", "must be a number")),
        ("MAP", "5 0 -10.0 0 0", "5 0 -10.0 1e5 0", ("M = 100000", "must be 0")),
        ("MAP", "5 0 -10.0 0 0", "5 0 -10.0 0 5", ("B = 5", "must be 0")),
        ("MAP", MAP_NODE, 2 * MAP_NODE, ("node 1", "one row only")),
        ("MAP", MAP_TYPE, 2 * MAP_TYPE, ("line type chain", "one row only")),
    ],
)
def test_a_mooring_of_another_kind_is_refused(tmp_path, part, old, new, said):
    path = write_deck(tmp_path, **{part: [(old, new)]} | (MOORED if part == "MoorDyn" else {}))
    with pytest.raises(InputError) as caught:
        read_deck(path)
    for words in (NAMES[part], *said):
        assert words in str(caught.value)


def moordyn_with(folder, after, line):
    """Path of a small deck with a further line below a line of MoorDyn's file that has a text."""
    path = write_deck(folder, **MOORED)
    place = folder / NAMES["MoorDyn"]
    lines = place.read_text().splitlines()
    lines.insert(next(i for i, text in enumerate(lines) if after in text) + 1, line)
    place.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("section", ["EXTERNAL LOADS", "BODIES", "RODS", "CONTROL", "FAILURE"])
def test_a_section_of_moordyn_that_nothing_here_has_must_be_empty(tmp_path, section):
    head = f"---- {section} ----\nID Object Fext Blin Bquad CSys\n(-) (-) (N) (-) (-) (-)"
    read_deck(moordyn_with(tmp_path, "3 chain 5 6", head))
    with pytest.raises(InputError, match=f"{section.lower()} cannot be represented"):
        read_deck(moordyn_with(tmp_path, "3 chain 5 6", head + "\n1 Point2 1e6|0|0 0|0|0 0|0|0 -"))


@pytest.mark.parametrize(
    ("option", "deck", "here"),
    [
        ("bed.txt WtrDpth", "bathymetry from a file (WtrDpth bed.txt)", "a flat bed at 200 m"),
        ("1 WaterKin", "waves and current on the lines (WaterKin 1)", "none"),
        ("0.3 mu_kA", "friction along the lines on the bed (mu_kA 0.3)", "seabed_friction"),
        ("9.7 g", "g 9.7 of MoorDyn and 9.81 of the site", "9.7 in the weight of the lines"),
        ("1 NewOption", "NewOption 1 (MoorDyn)", "ignored"),
    ],
)
def test_options_of_moordyn_are_said(tmp_path, option, deck, here):
    path = moordyn_with(tmp_path, "OPTIONS", option)
    assert here in differences(path)[deck]
    if option.endswith(" g"):
        heavier = read_deck(write_deck(tmp_path, **MOORED)).lines[0].wet_weight
        read_deck(moordyn_with(tmp_path, "OPTIONS", option))
        assert read_deck(path).lines[0].wet_weight == pytest.approx(heavier * 9.7 / 9.81)


def test_bending_stiffness_and_drag_of_points_are_said(tmp_path):
    path = write_deck(tmp_path, **MOORED)
    place = tmp_path / NAMES["MoorDyn"]
    text = re.sub(r"(?m)^(chain \S+ \S+ \S+ \S+) \S+", r"\1 1e9", place.read_text())
    place.write_text(re.sub(r"(?m)^(2 Coupled.*) \S+ \S+$", r"\1 3 0.5", text))
    found = differences(path)
    assert found["bending stiffness of lines (ei 1e+09)"] == "none"
    assert found["drag of a point on the vessel (cda 3)"] == "none"
    assert found["added mass of a point on the vessel (ca 0.5)"] == "none"


def test_an_anchor_may_lie_on_the_bed_by_a_word(tmp_path):
    path = write_deck(tmp_path, MoorDyn=[("1 Fixed   400 0 -200", "1 Fixed   400 0 SeaBed")], **MOORED)
    assert read_deck(path).lines[0].anchor[2] == -200.0


def test_the_controller_s_file_may_be_that_of_the_first_rotor(tmp_path):
    path = write_deck(tmp_path, OpenFAST=[('"servo.dat"  ServoFile', '"servo.dat"  ServoFile(1)')])
    assert read_deck(path).control["generator_efficiency"] == 0.95
    assert not any(here == UNKNOWN for here in differences(path).values())


def test_a_sea_that_is_cut_off_within_its_spectrum_is_said(tmp_path):
    def words(low, high):
        path = write_deck(tmp_path)
        set_key(tmp_path / NAMES["SeaState"], "SeaState", "WvLowCOff", low)
        set_key(tmp_path / NAMES["SeaState"], "SeaState", "WvHiCOff", high)
        return read_deck(path).sea.words

    peak = 2.0 * 3.14159265 / 10.0  # rad/s, of WaveTp
    assert "cut off" not in words(0.4 * peak, 4.1 * peak)
    assert "cut off below 0.4 and above" in words(0.4, 4.1 * peak)
    assert "and above 2 rad/s" in words(0.0, 2.0)


# --------------------------------------------------------------------------- contradictions


def contradictions(path):
    """[(what the deck says, what follows)] of a deck."""
    return make_report(read_deck(path), "x").contradictions


def test_a_grid_of_waves_that_does_not_reach_the_members_is_said_with_the_remedy(tmp_path):
    def grid(x, y, z='"default"'):
        path = write_deck(tmp_path)
        for key, value in (("X_HalfWidth", x), ("Y_HalfWidth", y), ("Z_Depth", z)):
            set_key(tmp_path / NAMES["SeaState"], "SeaState", key, value)
        return contradictions(path)

    deck = read_deck(write_deck(tmp_path))
    ends = [end for member in deck.hydrodyn.members for end in (member.start, member.end)]
    x, y, z = (max(abs(end[axis]) for end in ends if end[2] < 0.0) for axis in range(3))
    assert grid(x + 1.0, y + 1.0) == []
    assert grid(x + 1.0, y + 1.0, z + 1.0) == []
    ((said, follows),) = grid(x + 1.0, y + 1.0, 0.5 * z)
    assert "Z_Depth" in said and f"{z:.4g}" in said
    moved = simple_members((tmp_path / NAMES["HydroDyn"]).read_text(), "SimplCb", 1.0)  # one member at 30 m
    path = write_deck(tmp_path, HydroDyn=moved)
    set_key(tmp_path / NAMES["SeaState"], "SeaState", "X_HalfWidth", 5)
    set_key(tmp_path / NAMES["SeaState"], "SeaState", "Y_HalfWidth", 40)
    ((said, follows),) = contradictions(path)
    assert said == "a grid of waves up to X_HalfWidth 5 m, members up to 30 m"
    assert "X_HalfWidth 50 m" in follows
    import_deck(path, tmp_path / "out")
    assert "## Contradictions in the deck" in (tmp_path / "out" / "report.md").read_text()


@pytest.mark.parametrize(
    ("part", "key", "value", "said"),
    [
        ("SeaState", "WtrDpth", "190", "WtrDpth 190 in SeaState, "),
        ("SeaState", "WtrDens", "1000", "WtrDens 1000 in SeaState, "),
        ("AeroDyn", "AirDens", "1.0", "AirDens 1 in AeroDyn, "),
        ("ElastoDyn", "TipRad", "54", "blade of 50 m in AeroDyn"),
        ("ElastoDyn", "TowerHt", "85", "tower up to 80 m in AeroDyn"),
        ("DISCON", "! WE_GearboxRatio", "97", "WE_GearboxRatio 97"),
        ("DISCON", "! WE_BladeRadius", "60", "WE_BladeRadius 60"),
        ("DISCON", "! WE_RhoAir", "1.0", "WE_RhoAir 1"),
    ],
)
def test_figures_that_two_files_give_unlike_are_said(tmp_path, part, key, value, said):
    row = row_of(tmp_path, contradictions, part, key, value)
    assert row[0].startswith(said)


def test_coefficients_that_no_body_has_are_said(tmp_path):
    path = write_deck(tmp_path)
    water = tmp_path / "water"
    added = (water / "float.1").read_text()
    (water / "float.1").write_text(re.sub(r"(?m)^0\.0 1 1 .*$", "0.0 1 1 -0.9", added))
    report = import_deck(path, tmp_path / "out")
    assert any("added mass of -" in said and "surge" in said for said, _ in report.contradictions)
    hst = (water / "float.hst").read_text()
    (water / "float.hst").write_text(re.sub(r"\S+$", "0.0", hst, flags=re.MULTILINE))
    report = import_deck(path, tmp_path / "out", replace_files=True)
    assert any("hydrostatic stiffness of zero" in said for said, _ in report.contradictions)


# --------------------------------------------------------------------------- tables of the files


def test_each_line_of_map_is_asked_when_it_breaks(tmp_path):
    """A flag of a line is no value of the flag before it."""
    before = set(differences(write_deck(tmp_path)))
    lines = "1 chain 450.0 1 2 damage_time 1e9\n2 chain 450.0 1 2 plot damage_time 100"
    changed = write_deck(tmp_path, MAP=[("1 chain 450.0 1 2 tension_fair", lines)])
    assert set(differences(changed)) - before == {"line failure at a time (damage_time 100)"}


def test_lines_beyond_the_most_that_are_allowed_are_refused(tmp_path):
    last = "3 chain 5 6 450.0 20 -"
    many = "\n".join([last, *(last.replace("3", str(number), 1) for number in range(4, 1004))])
    with pytest.raises(InputError, match="has 1003 lines"):
        read_deck(write_deck(tmp_path, MoorDyn=[(last, many)], **MOORED))


def test_a_column_that_is_not_known_is_one_row_of_the_report(tmp_path):
    path = write_deck(tmp_path)
    blade = tmp_path / NAMES["AeroDyn blade"]
    head, names, units, *rows = blade.read_text().rstrip().rsplit("\n", 6)
    blade.write_text("\n".join([head, f"{names} NewCol", f"{units} (-)", *(f"{row} 0.5" for row in rows)]))
    found = [deck for deck, here in differences(path).items() if here == UNKNOWN]
    assert found == ["newcol 0.5 (AeroDyn blade)"]
