"""The transfer study without OpenFAST: weather, decks, series, and tables of figures that are written out."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.sea_state import joint_sea_state, sea_state_of
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.files.tables import read_table, write_table
from fowt_env.training.studies import transfer
from fowt_env.training.studies.transfer import FIGURES, LAWS, Case, report
from fowt_env.weather.waves import build_waves

SEMI = "iea15_volturnus_s"
ROOT = Path(__file__).parents[3]
DECKS = ROOT / "tests" / "reference" / "decks"
CASE = Case(SEMI, "openfast", "lqr", 14.0, 2)
BEGIN = {"PtfmSurge": 12.5, "PtfmHeave": -0.3, "PtfmPitch": 2.5, "RotSpeed": 7.56, "BldPitch1": 10.0}
TURBINE = read_turbine(read_platform("oc3_hywind_openfast").turbine)


@pytest.fixture
def decks(tmp_path):
    """A folder of decks as openfast_decks has it, of those that are stored."""
    root = tmp_path / "decks" / SEMI
    shutil.copytree(DECKS / "IEA-15-240-RWT" / "OpenFAST", root / "OpenFAST")
    shutil.copytree(DECKS / "ROSCO", root / "rosco_v2.10_deck")
    return root.parent


def keys(text):
    """{key: value} of a deck."""
    return {words[1]: words[0].strip('"') for line in text.split("\n") if len(words := line.split()) > 1}


def output(duration=300.0, speed=0.2):
    """An output of OpenFAST whose rotor speed and line tension are sines."""
    time = np.arange(0.0, duration + 0.05, 0.1)
    wave = np.sin(2.0 * np.pi * time / 20.0)
    names = {name: 1.0 for name in ("GenPwr_[kW]", "GenTq_[kN-m]", "PtfmPitch_[deg]", "PtfmSurge_[m]")}
    frame = pd.DataFrame({"Time_[s]": time, "ConvIter_[-]": 1.0, "RotSpeed_[rpm]": 12.1 + speed * wave})
    blades = {f"BldPitch{k}_[deg]": 14.0 + 0.5 * wave for k in (1, 2, 3)}
    lines = {f"T[{k}]_[N]": 9e5 + 1e4 * k * wave for k in (1, 2, 3)} | {"T_a[1]_[N]": 7e5}
    return frame.assign(**names, **blades, **lines)


def test_the_sea_has_the_height_of_its_site_and_is_the_same_in_both_codes():
    components, sea = transfer.sea_components(18.0, 3), joint_sea_state(transfer.SITE, 18.0)
    omega, amplitude, phase = components.to_numpy().T
    assert 4.0 * np.sqrt(0.5 * np.sum(amplitude**2)) == pytest.approx(sea.Hs)
    np.testing.assert_allclose(np.diff(omega), 2.0 * np.pi / 720.0)  # OpenFAST takes harmonics of WaveTMax
    built = build_waves(
        sea_state_of(transfer.sea_here(components)), depth=320.0, density=1025.0, gravity=9.81, seed=0,
        duration=720.0,
    )  # fmt: skip
    for t in (0.0, 33.0):
        theirs = np.sum(amplitude * np.cos(omega * t + np.radians(phase)))
        ours = np.sum(built.amplitude * np.cos(-built.omega * t + built.phase))
        assert ours == pytest.approx(theirs, abs=1e-9)
    assert not np.allclose(phase, transfer.sea_components(18.0, 4)["phase_deg"])


@pytest.mark.parametrize("platform", transfer.SUBJECTS)
def test_the_box_contains_rotor_and_tower_and_lasts_longer_than_the_run(platform):
    values = keys(transfer.box_input(platform, 14.0, 2, 500.0))
    turbine = read_turbine(read_platform(transfer.SUBJECTS[platform].plant).turbine)
    hub, tip = turbine.rotor.hub_height, turbine.rotor.tip_radius
    assert float(values["HubHt"]) == hub and float(values["URef"]) == 14.0
    # a platform at rest; heave and pitch lower the foot of the tower by less than 3 m
    base = read_platform(transfer.SUBJECTS[platform].plant).tower.base_height
    assert 0.0 < hub - 0.5 * float(values["GridHeight"]) < base - 3.0
    assert 0.5 * min(float(values["GridHeight"]), float(values["GridWidth"])) > tip
    assert float(values["UsableTime"]) >= 500.0 + transfer.SPARE
    other = keys(transfer.box_input(platform, 14.0, 3, 500.0))
    assert values["RandSeed1"] != other["RandSeed1"]


def test_a_deck_has_the_box_the_library_the_start_and_the_structure(decks, tmp_path):
    place = tmp_path / "run"
    transfer.write_deck(CASE, tmp_path, decks, tmp_path / "liblqr.so", 500.0, 0.025, BEGIN, place)
    wind, servo, structure = (keys((place / f"{name}.dat").read_text()) for name in ("IW", "SV", "ED"))
    box = transfer.box_path(tmp_path, SEMI, 14.0, 2)
    assert (wind["WindType"], wind["FileName_BTS"]) == ("3", str(box))
    assert (servo["DLL_FileName"], servo["DLL_DT"]) == (str(tmp_path / "liblqr.so"), "0.025")
    assert float(structure["PtfmSurge"]) == 12.5 and float(structure["BlPitch(2)"]) == 10.0
    free = ("FlapDOF1", "FlapDOF2", "EdgeDOF", "TwFADOF2", "TwSSDOF2")
    assert {structure[name] for name in free} == {"True"}
    assert structure["DrTrDOF"] == "False"  # its torsion needs a step below 0.005 s
    waves = (place / "waves.txt").read_text().strip().split("\n")[1:]
    components = transfer.sea_components(14.0, 2)
    assert len(waves) == len(components)
    assert float(waves[0].split()[1]) == pytest.approx(2.0 * components["amplitude_m"][0])
    assert keys((place / "model.fst").read_text())["TMax"] == "500.0"


def test_the_rigid_model_of_openfast_has_no_bending(decks, tmp_path):
    rigid = Case(SEMI, "openfast_rigid", "lqr", 14.0, 2)
    place = tmp_path / "run"
    transfer.write_deck(rigid, tmp_path, decks, tmp_path / "liblqr.so", 500.0, 0.025, BEGIN, place)
    structure = keys((place / "ED.dat").read_text())
    assert {structure[name] for name in ("FlapDOF1", "EdgeDOF", "TwFADOF1", "TwSSDOF2")} == {"False"}


def test_a_kept_run_has_the_figures_of_its_output(tmp_path):
    path = CASE.path(tmp_path)
    transfer.keep_series(path, transfer.named(output()), seconds=60.0, duration=300.0, dt=0.025)
    frame, about = transfer.kept_series(path)
    assert about == {"seconds": 60.0, "duration": 300.0, "dt": 0.025}
    assert "ConvIter_[-]" not in frame and "FAIRTEN3_[kN]" in frame
    assert frame["Time_[s]"].iloc[-1] == 300.0
    values = transfer.figures_of(frame, TURBINE)
    # ten whole periods after the start-up; single precision
    assert values["RotSpeed_std_[rpm]"] == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-3)
    assert values["blade_pitch_travel_[deg/s]"] == pytest.approx(4.0 * 0.5 / 20.0, rel=1e-3)
    # ten cycles of 60 kN in 200 s, m = 3: the worst line
    assert values["FAIRTEN_DEL_[kN]"] == pytest.approx(60.0 * (10.0 / 200.0) ** (1.0 / 3.0), rel=0.02)
    assert values["RotSpeed_mean_[rpm]"] == pytest.approx(12.1, rel=1e-4)


def test_the_runs_of_a_folder_are_collected_by_their_names(tmp_path):
    agent = Case("oc3_hywind", "openfast", "policy:ppo_lqr", 12.5, 4)
    transfer.keep_series(agent.path(tmp_path), transfer.named(output()), duration=300.0)
    ours = Case("oc3_hywind", "rigid", "lqr", 14.0, 1)
    ours.path(tmp_path).parent.mkdir(parents=True)
    write_table(pd.DataFrame([dict.fromkeys(FIGURES.values(), 2.0)]), ours.path(tmp_path))
    (tmp_path / "oc3_hywind" / "wind").mkdir()
    transfer.box_path(tmp_path, "oc3_hywind", 14.0, 1).write_bytes(b"")
    rows = transfer.collected(tmp_path)
    found = {(row.model, row.law, row.wind, row.seed) for row in rows.itertuples()}
    assert found == {("openfast", "policy:ppo_lqr", 12.5, 4), ("rigid", "lqr", 14.0, 1)}
    with pytest.raises(InputError, match="no finished run"):
        transfer.collected(tmp_path / "empty")


def test_a_table_adds_runs_to_a_file_and_keeps_those_of_another_machine(tmp_path):
    """Runs in both are those of the folder; runs without a commit stay without one."""
    theirs, ours = tmp_path / "theirs.csv", tmp_path / "runs"
    write_table(stored(), theirs)
    for law, wind in (("gspi_oc3", 18.0), ("gspi_oc3", 22.0)):
        case = Case("oc3_hywind", "openfast", law, wind, 1)
        transfer.keep_series(case.path(ours), transfer.named(output()), duration=300.0, commit="abc")
    transfer.table(ours, names="rigid", winds="14", out=theirs)
    rows = read_table(theirs).set_index(["model", "law", "wind"])
    assert len(rows) == len(stored()) + 1
    assert list(rows["commit"].dropna().index) == [("openfast", "gspi_oc3", wind) for wind in (18.0, 22.0)]
    assert rows.loc[("openfast", "gspi_oc3", 18.0), "RotSpeed_std_[rpm]"] == pytest.approx(0.1414, abs=1e-3)
    assert rows.loc[("rigid", "mpc", 18.0), "RotSpeed_std_[rpm]"] == 14.0


def test_runs_whose_figures_are_stored_are_not_repeated(decks, tmp_path, monkeypatch, capsys):
    done = tmp_path / "figures.csv"
    write_table(pd.DataFrame([dict(zip(transfer.KEY, (SEMI, "openfast", "pi", 14, 2), strict=True))]), done)
    ran = []
    monkeypatch.setattr(transfer, "start", lambda *_: BEGIN)
    monkeypatch.setattr(transfer, "make_box", lambda *_: None)
    monkeypatch.setattr(transfer, "export_library", lambda law, path, *_: ran.append((law, path.name)))
    monkeypatch.setattr(transfer, "run_openfast", lambda case, *_: ran.append(case))
    options = {"platform": SEMI, "laws": "pi,lqr", "winds": "14", "seeds": "2,3", "done": done}
    arguments = decks, "true", "true", tmp_path / "runs"
    lost = next(decks.rglob("*ServoDyn.dat"))
    lost.rename(lost.with_suffix(".old"))
    with pytest.raises(InputError, match=r"lacks .*ServoDyn.dat; NOTICE"):
        transfer.openfast(*arguments, **options)
    lost.with_suffix(".old").rename(lost)
    assert not ran
    transfer.openfast(*arguments, **options)
    assert "3 of 4 runs" in capsys.readouterr().out
    libraries, runs = ran[:2], ran[2:]
    assert libraries == [("lqr", "liblqr.so"), ("pi", "libpi.so")]  # one each, whatever the weather
    assert {(case.law, case.seed) for case in runs} == {("lqr", 2), ("pi", 3), ("lqr", 3)}
    write_table(pd.DataFrame({"law": ["pi"]}), done)
    with pytest.raises(InputError, match="it has no platform, model, wind, seed"):
        transfer.openfast(*arguments, **options)


def stored(models=("openfast", "rigid"), laws=LAWS, factor=1.0):
    """Rows of two winds; law k has 10 + k in OpenFAST, and here the same but for `factor` on `mpc`."""
    rows = []
    for model in models:
        for number, law in enumerate(laws):
            for wind in (14.0, 18.0):
                value = 10.0 + number
                value *= factor if model == "rigid" and law == "mpc" else 1.0
                row = {"platform": "oc3_hywind", "model": model, "law": law, "wind": wind, "seed": 1}
                rows.append(row | dict.fromkeys(FIGURES.values(), value))
    return pd.DataFrame(rows)


def test_equal_runs_have_equal_ratios_and_order():
    text = report(stored(), "oc3_hywind")
    assert "| ties | rigid | 0 pairs |" in text
    assert "| power std | `lqr` | 130.0 | 130.0 | +0.0 |" in text
    assert "45 of 45" in text
    order = ", ".join(f"`{law}`" for law in LAWS)
    assert f"| fairlead DEL | {order} | 1.00 |" in text
    assert "| tower base DEL | kN-m | 10 | 10 |" in text


def test_each_wind_and_seed_alone_has_its_largest_difference():
    rows = stored()
    metric = FIGURES["fairlead DEL"]
    here = (rows["model"] == "rigid") & (rows["wind"] == 18.0)
    rows.loc[here & (rows["law"] == "lqr"), metric] *= 12.0 / 13.0  # 130 to 120 %
    rows.loc[here & (rows["law"] == "mpc"), metric] *= 14.7 / 14.0  # 140 to 147 %
    text = report(rows, "oc3_hywind")
    assert "| 14 | 1 | 45 of 45 | +0.0, " in text
    assert "| 18 | 1 | 43 of 45 | -10.0, fairlead DEL, `lqr` |" in text
    assert "one seed" not in report(rows, "oc3_hywind", winds=[14.0])


def test_averages_over_laws_of_different_commits_are_named():
    rows = stored()
    rows.loc[(rows["law"] == "mpc") & (rows["wind"] == 18.0), "commit"] = "0123456789"
    text = report(rows, "oc3_hywind")
    assert text.endswith("Averages over runs of different commits: `mpc` (01234567, not recorded).")
    assert "Averages over" not in report(rows, "oc3_hywind", winds=[18.0])


def test_an_exchanged_pair_is_named_with_its_gaps():
    text = report(stored(factor=12.5 / 14.0), "oc3_hywind")  # between rosco_float, 12, and lqr, 13
    assert "| rotor speed std | rigid | `lqr`, `mpc` | -10.0 | +5.0 |" in text
    assert "0.94" in text and "36 of 45" in text
    tie = report(stored(factor=12.8 / 14.0), "oc3_hywind")  # 12 points, of which 2 beyond lqr
    assert "| rotor speed std | rigid | `lqr`, `mpc` | -10.0 | +2.0 |" in tie
    slight = stored()
    slight.loc[slight["law"] == "mpc", list(FIGURES.values())] = 13.1
    slight.loc[(slight["law"] == "mpc") & (slight["model"] == "rigid"), list(FIGURES.values())] = 12.9
    assert "| ties | rigid | 9 pairs |" in report(slight, "oc3_hywind")


def test_the_page_has_the_tables_of_the_stored_figures():
    page = (ROOT / "docs" / "results" / "transfer.md").read_text()
    marks = re.findall(r"<!-- measured: \$STUDY table (\S+)(.*?) -->\n(.*?)(?=\n##+ )", page, re.S)
    assert marks
    for path, options, text in marks:
        chosen = dict(re.findall(r"--(\w+) (\S+)", options))
        names, laws = (chosen[key].split(",") if key in chosen else None for key in ("models", "laws"))
        winds = [float(wind) for wind in chosen["winds"].split(",")] if "winds" in chosen else None
        rows = read_table(ROOT / path)
        assert report(rows, chosen.get("platform", "oc3_hywind"), names, laws, winds) in text


def test_means_over_runs_add_variances_and_damage():
    rows = stored(laws=("gspi_oc3", "lqr"))
    rows.loc[(rows["law"] == "lqr") & (rows["wind"] == 18.0), list(FIGURES.values())] = 20.0
    found = transfer.ratios(transfer.averages(rows)).loc[("openfast", "lqr")]
    assert found["rotor speed std"] == pytest.approx(10.0 * np.sqrt(0.5 * (11.0**2 + 20.0**2)))
    assert found["blade root flap DEL"] == pytest.approx(10.0 * (0.5 * (11.0**10 + 20.0**10)) ** 0.1)
    assert found["pitch travel"] == pytest.approx(10.0 * 15.5)


def test_the_spread_is_over_starts_changed_one_at_a_time_both_ways(tmp_path, monkeypatch, capsys):
    changes = []

    def run(case, folder, duration, change):
        changes.append((case.law, change))
        return output(speed=0.2 if case.law == "gspi_oc3" else 0.1 + 0.1 * change.get("RotSpeed", 0.0))

    monkeypatch.setattr(transfer, "run_here", run)
    choice = {"winds": "14", "seeds": "1", "laws": "lqr,gspi_oc3", "duration": 300.0}
    with pytest.raises(InputError, match="gspi_oc3 14 m/s seed 1: has no wind box"):
        transfer.spread(tmp_path, **choice)
    box = transfer.box_path(tmp_path, "oc3_hywind", 14.0, 1)
    box.parent.mkdir(parents=True)
    box.write_bytes(b"")
    transfer.spread(tmp_path, **choice)
    assert "| rotor speed std | `lqr` | 50.0 | 40.0 | 60.0 |" in capsys.readouterr().out
    assert [law for law, _ in changes] == ["gspi_oc3", "lqr"] * 7
    found = [next(iter(change.items())) for law, change in changes if law == "lqr" and change]
    assert found == [
        ("PtfmPitch", 0.2), ("PtfmPitch", -0.2), ("RotSpeed", 0.2), ("RotSpeed", -0.2), ("PtfmSurge", 1.0),
        ("PtfmSurge", -1.0),
    ]  # fmt: skip


def test_only_weather_with_all_runs_counts():
    rows = stored()
    lost = (rows["model"] == "rigid") & (rows["law"] == "mpc") & (rows["wind"] == 18.0)
    assert "14 m/s: seed 1; ratios" in report(rows[~lost], "oc3_hywind")
    with pytest.raises(InputError, match="--laws"):
        report(rows[rows["law"] != "gspi_oc3"], "oc3_hywind")


def test_a_missing_program_is_refused_before_anything_runs(tmp_path):
    arguments = ["openfast", str(tmp_path), str(tmp_path / "openfast"), "turbsim", str(tmp_path / "runs")]
    with pytest.raises(SystemExit, match=r"OpenFAST = .*no such program"):
        transfer.main(arguments)
    assert not (tmp_path / "runs").exists()


def test_an_unknown_platform_or_model_is_named():
    for options, message in ((["--platform", "oc3"], "oc3_hywind"), (["--models", "stiff"], "rigid")):
        with pytest.raises(SystemExit, match=message):
            transfer.main(["here", "runs", *options])


@pytest.mark.nightly
def test_a_run_here_blows_the_box_and_keeps_its_figures(tmp_path, monkeypatch):
    turbsim = pytest.importorskip("openfast_io.turbsim_file")
    file, path = turbsim.TurbSimFile(), transfer.box_path(tmp_path, "oc3_hywind", 14.0, 1)
    y, z, steps = np.linspace(-72.5, 72.5, 3), np.linspace(5.0, 175.0, 3), 2400
    time = 0.1 * np.arange(steps)
    file["u"] = np.zeros((3, steps, 3, 3))
    file["u"][0] = (14.0 + np.sin(2.0 * np.pi * time / 30.0))[:, None, None]
    file["y"], file["z"], file["t"] = y, z, time
    file["zTwr"], file["uTwr"] = np.zeros(0), np.zeros((3, steps, 0))
    file["zRef"], file["uRef"], file["ID"], file["dt"], file["info"] = 90.0, 14.0, 7, 0.1, "test"
    path.parent.mkdir(parents=True)
    file.write(str(path))
    options = {"winds": "14", "seeds": "1", "laws": "gspi_oc3", "names": "rigid,uniform", "duration": 190.0}
    transfer.here(tmp_path, **options)
    rows = transfer.collected(tmp_path).set_index("model")
    assert rows.loc["rigid", "RotSpeed_mean_[rpm]"] == pytest.approx(12.1, abs=0.5)
    assert rows.loc["rigid", "RootMyc_DEL_[kN-m]"] > 0.0
    # the same wind at all points of the box, three periods; a box moves past the surging rotor
    spread = rows["RotSpeed_std_[rpm]"]
    assert spread["rigid"] == pytest.approx(spread["uniform"], rel=0.02)
    monkeypatch.setattr(transfer, "run_here", None)  # a finished run is not repeated
    transfer.here(tmp_path, **options)
