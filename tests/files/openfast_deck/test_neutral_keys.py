"""What a deck has and the plant does not is said: every key is read, neutral, without effect, or reported."""

import re
import shutil
from pathlib import Path

import pytest
from small_deck import NAMES, write_deck

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.conversion import platform_rows, stations, turbine_rows
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.importer import import_deck
from fowt_env.files.openfast_deck.keys import KEYS, UNKNOWN
from fowt_env.files.openfast_deck.parser import PartFile, bare, number_of, same_key, truth_of
from fowt_env.files.openfast_deck.report import make_report, markdown

DECKS = Path(__file__).parents[2] / "reference" / "decks"
MOORED = {"OpenFAST": [("1    CompMooring", "3    CompMooring"), ("map.dat", "moor.dat")]}


def deck_with(folder, part, key, value, **changes):
    """Path of a small deck whose part has a value for a key, in place of its own or as a new line."""
    path = write_deck(folder, **changes)
    set_key(folder / NAMES[part], part, key, value)
    return path


def set_key(path, kind, key, value):
    """Give a key of a part file another value."""
    lines = path.read_text(encoding="latin-1").splitlines()
    found = PartFile(path, kind).entries.get(same_key(key))
    text = f"{value} {key} - changed"
    if found is None:
        lines.insert(2, text)
    else:
        lines[found[1]] = text
    path.write_text("\n".join(lines) + "\n", encoding="latin-1")


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
    other = write_deck(tmp_path, MAP=[("repeat 120 240", "! repeat 90\nrepeat 120 240")])
    assert len(read_deck(other).lines) == 3  # where it has them


# --------------------------------------------------------------------------- keys


@pytest.mark.parametrize(
    ("part", "key", "value", "deck", "here"),
    [
        ("ElastoDyn", "GenDOF", "False", "rotor speed held", "free"),
        ("ElastoDyn", "PtfmSgDOF", "False", "surge of the platform held", "free"),
        ("ElastoDyn", "PtfmSwDOF", "False", "sway of the platform held", "planar"),
        ("ElastoDyn", "PtfmHvDOF", "False", "heave of the platform held", "free"),
        ("ElastoDyn", "PtfmRDOF", "False", "roll of the platform held", "planar"),
        ("ElastoDyn", "PtfmPDOF", "False", "pitch of the platform held", "free"),
        ("ElastoDyn", "PtfmYDOF", "False", "yaw of the platform held", "planar"),
        ("ElastoDyn", "NacYaw", "30", "nacelle turned out of the wind", "along x"),
        ("ElastoDyn", "NewKey", "3", "NewKey 3 (ElastoDyn)", "not looked at"),
        ("AeroDyn", "TipLoss", "False", "no tip loss", "with it"),
        ("AeroDyn", "HubLoss", "False", "no hub loss", "with it"),
        ("AeroDyn", "TanInd", "False", "no tangential induction", "with it"),
        ("AeroDyn", "AIDrag", "False", "no drag in the axial induction", "with it"),
        ("AeroDyn", "TIDrag", "False", "no drag in the tangential induction", "with it"),
        ("AeroDyn", "Skew_Mod", "1", "skewed-wake correction", "skewed_wake"),
        ("AeroDyn", "SkewMod", "2", "skewed-wake correction", "skewed_wake"),
        ("AeroDyn", "BEM_Mod", "2", "polar grid", "BEM_Mod 1"),
        ("AeroDyn", "SectAvg", "True", "averaged over sectors", "section"),
        ("AeroDyn", "Wake_Mod", "0", "no induction", "induction is there"),
        ("AeroDyn", "Wake_Mod", "3", "free vortex wake", "momentum"),
        ("AeroDyn", "DBEMT_Mod", "2", "dynamic wake", "dynamic_inflow"),
        ("AeroDyn", "UA_Mod", "3", "unsteady airfoil", "quasi-steady"),
        ("AeroDyn", "AFAeroMod", "2", "unsteady airfoil", "quasi-steady"),
        ("AeroDyn", "TwrShadow", "True", "tower shadow", "no influence"),
        ("AeroDyn", "Buoyancy", "True", "buoyancy of blades", "none"),
        ("ServoDyn", "VSContrl", "4", "generator torque by another law", "DISCON.IN"),
        ("ServoDyn", "PCMode", "0", "no pitch control", "controller of a run"),
        ("ServoDyn", "TPitManS(1)", "10", "override of the blade pitch", "run"),
        ("ServoDyn", "TimGenOf", "50", "generator off", "run"),
        ("ServoDyn", "AfCmode", "5", "airfoils", "none"),
        ("ServoDyn", "NumTStC", "2", "tuned mass dampers", "none"),
        ("ServoDyn", "YawNeut", "8", "nacelle turned", "along x"),
        ("ServoDyn", "BPCutoff", "2", "low pass", "none"),
        ("SeaState", "MCFD", "5", "MacCamy-Fuchs", "diffraction"),
        ("SeaState", "WaveStMod", "1", "stretched", "stretching"),
        ("SeaState", "WaveDirMod", "1", "short-crested", "long-crested"),
        ("SeaState", "WvDiffQTF", "True", "second-order wave kinematics", "first order"),
        ("HydroDyn", "ExctnDisp", "1", "displaced position", "excitation_position"),
        ("HydroDyn", "ExctnMod", "0", "no wave excitation", "it is there"),
        ("HydroDyn", "WaveDisp", "1", "displaced members", "kinematics_position"),
        ("InflowWind", "PropagationDir", "20", "another direction", "along x"),
        ("AeroDyn", "Skew_Mod", "-1", "wind across the rotor taken off", "it is there"),
        ("OpenFAST", "NewSwitch", "1", "NewSwitch 1 (OpenFAST)", "not looked at"),
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
    with pytest.raises(InputError, match="member 81: its simplcb = 0.5: must be 1"):
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


@pytest.mark.parametrize(
    ("part", "start", "said"),
    [
        ("MoorDyn", "2 Coupled   5 0  -10 1e6 0", ("M = 1e+06", "must be 0")),
        ("MoorDyn", "2 Coupled   5 0  -10 0 100", ("V = 100", "must be 0")),
        ("MoorDyn", "1 Fixed   400 0 -200 0 0 0 0\n1 Fixed   400 0 -200", ("point 1", "one row alone")),
        (
            "MoorDyn",
            "chain 0.1 100.0 4.0E8 -1.0 0 2.0 0.8 0.4 0.3\nchain 0.1",
            ("line type chain", "one row"),
        ),
        ("MoorDyn", "1 chain 1 2 450.0 20 -\n1 chain 1 2", ("line 1", "one row alone")),
        ("MoorDyn", "0.001 dtM - step\n150 WtrDpth", ("WtrDpth = 150", "must be 200")),
        ("MoorDyn", "chain 0.1 100.0 4.0E8 -1.0 stiff.dat", ("EI = stiff.dat", "must be a number")),
        ("MAP", "2 Vessel   5 0 -10.0 1e5 0", ("M = 100000", "must be 0")),
        ("MAP", "2 Vessel   5 0 -10.0 0 5", ("B = 5", "must be 0")),
        ("MAP", "1 fix    400 0 depth 0 0 # # #\n1 fix    400", ("node 1", "one row alone")),
        ("MAP", "chain  0.1  100.0  4.0E8  0.7  0 0 0 0\nchain  0.1", ("line type chain", "one row alone")),
    ],
)
def test_a_mooring_of_another_kind_is_refused(tmp_path, part, start, said):
    own = start.rsplit("\n", 1)[-1].split()[:3] if "\n" in start else start.split()[:3]
    path = write_deck(tmp_path, **(MOORED if part == "MoorDyn" else {}))
    text = (tmp_path / NAMES[part]).read_text()
    head = start.split("\n")[0].split()[0]
    lines, last = text.splitlines(), start.split("\n")[-1]
    if "WtrDpth" in start:
        lines.insert(
            next(i for i, line in enumerate(lines) if "OPTIONS" in line) + 1, "150 WtrDpth - of its own"
        )
    else:
        place = next(
            i for i, line in enumerate(lines) if line.split()[:1] == [head] and line.split()[1:2] == own[1:2]
        )
        if "\n" in start:
            lines.insert(place, lines[place])
        else:
            kept = lines[place].split()[len(last.split()) :]
            lines[place] = " ".join([last, *kept])
    (tmp_path / NAMES[part]).write_text("\n".join(lines))
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
        ("1 NewOption", "NewOption 1 (MoorDyn)", "not looked at"),
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
    assert read_deck(path).control.generator_efficiency == 0.95
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
    assert "## Where the deck contradicts itself" in (tmp_path / "out" / "report.md").read_text()


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


# --------------------------------------------------------------------------- the tables


@pytest.mark.parametrize("kind", KEYS)
def test_a_key_is_in_one_list_alone(kind):
    table = KEYS[kind]
    lists = [table.read, frozenset(table.neutral), *table.ignored.values()]
    assert sum(map(len, lists)) == len(frozenset().union(*lists))


def public_decks(root=DECKS):
    """{name: arguments of read_deck} of the public decks, in a folder."""
    iea = root / "IEA-15-240-RWT" / "OpenFAST" / "IEA-15-240-RWT-UMaineSemi"
    rosco, fast = root / "ROSCO" / "Examples" / "Test_Cases", root / "FAST" / "CertTest" / "5MW_Baseline"
    discon = rosco / iea.name.replace("-UMaineSemi", "") / iea.name / f"{iea.name}_DISCON.IN"
    found = {"iea": {"fst": iea / f"{iea.name}.fst", "discon": discon}}
    for floater, mooring in (("OC4DeepCwindSemi", "MAP"), ("ITIBarge4", "MoorDyn")):
        kinds = {"elastodyn": "ElastoDyn", "hydrodyn": "HydroDyn", "servodyn": "ServoDyn", "mooring": mooring}
        parts = {part: fast / f"NRELOffshrBsline5MW_{floater}_{kind}.dat" for part, kind in kinds.items()}
        parts["aerodyn"] = rosco / "NREL-5MW" / "NRELOffshrBsline5MW_Onshore_AeroDyn15.dat"
        found[floater] = {"parts": parts, "folders": (rosco / "NREL-5MW",)}
    return found


def outcome(arguments):
    """All that an import of a deck says and writes, but for WAMIT's coefficients; or the refusal."""
    try:
        deck = read_deck(**arguments)
        rows = platform_rows(deck, "x", "x", "x", "x"), turbine_rows(deck, "x"), stations(deck)
        rows = *rows, {name: polar.tolist() for name, polar in deck.aerodyn.polars.items()}
        return str(rows) + markdown(make_report(deck, "x"))
    except InputError as error:
        return str(error)


def test_no_key_of_a_public_deck_is_unknown():
    for arguments in public_decks().values():
        assert UNKNOWN not in outcome(arguments)


def others(values):
    """Other values for a key."""
    text = bare(values[0])
    if truth_of(text) is not None:
        return [str(not truth_of(text))]
    value = number_of(text)
    if value is None:
        return ['"nowhere"', "False", "3"]
    return [
        f"{number:.12g}"
        for number in (value * 1.03 + 0.001, value + 1, 0, 1, 2, 3, 50, 1e-3)
        if number != value
    ]


_CURRENT = "CurrSSV0 CurrSSDir CurrNSRef CurrNSV0 CurrNSDir CurrDIV CurrDIDir"
WITHOUT_EFFECT = {  # what is read and changes nothing in these decks: why, and the keys of each kind of file
    "a rotor of three blades": {"ElastoDyn": "TeetDOF UndSling"},
    "no current (CurrMod 0)": {"HydroDyn": _CURRENT, "SeaState": _CURRENT},
    "no members that waves must reach": {"SeaState": "X_HalfWidth Y_HalfWidth Z_Depth"},
    "steady wind (WindType 1)": {"InflowWind": "Filename_Uni RefHt_Uni"},
    "a part file in place of that of the .fst": {"OpenFAST": "AeroFile"},
    "torque of a library (VSContrl 5)": {"ServoDyn": "VS_RtGnSp VS_RtTq VS_Rgn2K VS_SlPc"},
    "a DISCON.IN in place of the deck's, or none": {
        "ServoDyn": "DLL_InFile PitManRat1 PitManRat2 PitManRat3"
    },
    "polars of one table": {"polar": "Re"},
}


@pytest.mark.slow
def test_every_key_of_the_public_decks_changes_the_files_or_the_report_or_is_refused(tmp_path, monkeypatch):
    """All but those that are listed as without effect, each in at least one of the decks that have it."""
    moved, still = set(), set()
    shutil.copytree(DECKS, tmp_path / "decks")
    decks = public_decks(tmp_path / "decks")
    # of two rotors with the same keys the one of fewer polars
    decks["iea"]["parts"] = {"aerodyn": decks["ITIBarge4"]["parts"]["aerodyn"]}
    decks["iea"]["folders"] = decks["ITIBarge4"]["folders"]
    for arguments in decks.values():
        files = {}
        original = PartFile.__init__

        def opened(self, path, kind, original=original, files=files):
            original(self, path, kind)
            files.setdefault(Path(path), (kind, self))

        with monkeypatch.context() as context:
            context.setattr(PartFile, "__init__", opened)
            before = outcome(arguments)
        for path, (kind, file) in files.items():
            if kind not in KEYS or (kind == "polar" and ("polar", "numalf") in moved):
                continue
            table = KEYS[kind]
            for key, (written, _, values) in file.entries.items():
                form = table.known(key)
                if (kind, key) in moved or any(form in names for names in table.ignored.values()):
                    continue
                copy = shutil.copy(path, tmp_path / "kept")
                try:
                    for value in others(values):
                        set_key(path, kind, written, value)
                        after = outcome(arguments)
                        shutil.copy(copy, path)
                        if after != before:
                            moved.add((kind, key))
                            break
                    else:
                        still.add((kind, key))
                finally:
                    shutil.copy(copy, path)
    expected = {(kind, same_key(key)) for keys in WITHOUT_EFFECT.values()
                for kind, names in keys.items() for key in names.split()}  # fmt: skip
    assert still - moved == expected
    assert len(moved) > 200


def test_each_line_of_map_is_asked_when_it_breaks(tmp_path):
    """A flag of a line is no value of the flag before it."""
    before = set(differences(write_deck(tmp_path)))
    lines = "1 chain 450.0 1 2 damage_time 1e9\n2 chain 450.0 1 2 plot damage_time 100"
    changed = write_deck(tmp_path, MAP=[("1 chain 450.0 1 2 tension_fair", lines)])
    assert set(differences(changed)) - before == {"a line that breaks (damage_time 100)"}


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
