"""What a controller or a run does to others of its evaluation, and to the results folder: nothing."""

import json
import os
import re
import signal
import subprocess
import sys
import threading

import numpy as np
import pandas as pd
import pytest
import stub_plant
from copied_code import LOOKS, copied_code, edit
from typer.testing import CliRunner

import fowt_env
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.layout import PACKAGE, installed_path, module_path
from fowt_env.training.cli import app as cli
from fowt_env.training.cli.console import EXIT_STOPPED
from fowt_env.training.evaluation import engines, guard, provenance, results
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.evaluate import COLUMNS, evaluate, score
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.evaluation.results import (
    LONGEST_NAME,
    check_name,
    read_row,
    run_content,
    run_file,
    write_run,
)

CALM = Case("calm", 16.0)
SHORT = {"duration": 4.0, "skip": 1.0}


@pytest.fixture
def plant(monkeypatch):
    stub_plant.install(monkeypatch)
    monkeypatch.setattr(engines, "GRACE", 0.5)
    monkeypatch.setattr(engines, "kernels_compiled", lambda: True)  # else the first run is done here


def rows_of(controllers, cases=(CALM,), **options):
    """{controller: row} of an evaluation of kinds of stub_plant."""
    table = evaluate(controllers, list(cases), **SHORT | options)
    assert list(table.columns) == list(COLUMNS)
    return table.set_index("controller", drop=False).to_dict("index")


FAILURES = {
    stub_plant.Exits: "SystemExit: 0",
    stub_plant.Interrupts: "KeyboardInterrupt",
    stub_plant.Unborn: "SystemExit: 3",
    stub_plant.Mute: "Odd: its message cannot be read",
    stub_plant.Smuggles: r"FileNotFoundError: none\udcff\x1b[31m \u202efound",
    stub_plant.Floods: "controller 'Floods' returned [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ...] at t = 0.000 s:"
    " act()"
    " must return two finite numbers, (generator torque in N m on the high-speed shaft, blade pitch in rad)",
    stub_plant.Nameless: None,
}


# of an exception in act: then the type stands in what names controller, time and line
RAISED = re.compile(r"controller '(\w+)' raised (\w+) in act\(\) at t = 1\.100 s, stub_plant\.py line \d+: ")


def test_whatever_a_controller_raises_costs_its_own_run_and_the_folder_stays_sound(
    plant, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    kinds = {kind.__name__: kind if kind is stub_plant.Unborn else kind() for kind in FAILURES}
    kinds = {"before": stub_plant.Still(), **kinds, "after": stub_plant.Still()}
    rows = rows_of(kinds, folder="out")
    for kind, reason in FAILURES.items():
        row = rows[kind.__name__]
        assert row["status"] == "failed" and np.isnan([row[name] for name in METRICS]).all()
        assert row["reason"].isprintable() and 0 < len(row["reason"]) <= 500
        raised = RAISED.match(row["reason"])
        said = row["reason"] if raised is None else f"{raised[2]}: {row['reason'][raised.end() :]}"
        assert raised is None or raised[1] == kind.__name__
        assert reason is None or said == reason
    assert rows["before"]["status"] == rows["after"]["status"] == "ok"
    assert rows["Interrupts"]["stopped_[s]"] == pytest.approx(1.0)  # its last row
    again = rows_of({"before": stub_plant.Still()}, folder="out")  # what is there is read, and sound
    assert again.keys() == rows.keys() and again["Smuggles"]["reason"] == rows["Smuggles"]["reason"]


def test_a_controller_that_ends_its_worker_process_costs_its_own_run(plant, tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "ATTEMPTS", 2)
    kinds = {"dies": stub_plant.Dies(), "exits": stub_plant.Exits(), "still": stub_plant.Still()}
    rows = rows_of(kinds, folder=tmp_path, jobs=2)
    assert rows["dies"]["reason"] == "its worker process ended 2 times, the last time alone, with exit code 0"
    assert rows["exits"]["reason"] == "SystemExit: 0" and rows["still"]["status"] == "ok"
    assert read_row(run_file(tmp_path / "runs", "dies", "calm", 1))["status"] == "failed"


@pytest.mark.parametrize("kind", [stub_plant.Signalled, stub_plant.Deaf])
def test_ctrl_c_ends_an_evaluation_whatever_a_controller_makes_of_it(plant, kind):
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        evaluate({"one": stub_plant.Still(), "hit": kind()}, [CALM], **SHORT)
    assert signal.getsignal(signal.SIGINT) is handler


def test_a_programs_own_handler_of_sigterm_ends_an_evaluation(plant):
    before = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(143))
    try:
        with pytest.raises(SystemExit, match="143"):
            evaluate({"hit": stub_plant.Terminated()}, [CALM], **SHORT)
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("kind", [stub_plant.Sleeps, stub_plant.Swallows])
def test_a_run_over_the_time_limit_fails_with_its_rows_and_the_others_go_on(
    plant, tmp_path, kind, monkeypatch
):
    monkeypatch.setattr(guard, "AGAIN", 0.1)
    kinds = {"late": kind(), "still": stub_plant.Still()}
    rows = rows_of(kinds, folder=tmp_path, time_limit=0.2)
    assert rows["late"]["reason"] == "time limit: more than 0.2 s of wall clock"
    assert rows["late"]["stopped_[s]"] == pytest.approx(1.0) and rows["still"]["status"] == "ok"
    assert len(pd.read_parquet(run_file(tmp_path / "runs", "late", "calm", 1))) == 11
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_run_that_never_comes_back_to_python_is_ended_with_its_worker(plant):
    kinds = {"endless": stub_plant.Compiled(), "still": stub_plant.Still()}
    rows = rows_of(kinds, jobs=2, time_limit=0.5)
    assert rows["endless"]["reason"] == "time limit: more than 0.5 s of wall clock"
    assert rows["still"]["status"] == "ok"


def test_a_run_without_a_time_limit_or_outside_the_main_thread_ends_as_any_other(plant):
    found = []
    thread = threading.Thread(target=lambda: found.append(rows_of({"a": stub_plant.Still()}, time_limit=9.0)))
    thread.start()
    thread.join()
    unlimited = rows_of({"a": stub_plant.Still()}, time_limit=None)
    assert found[0]["a"] == pytest.approx(unlimited["a"], nan_ok=True)
    with pytest.raises(InputError, match="time_limit"):
        rows_of({"a": stub_plant.Still()}, time_limit=0.0)


def test_a_controller_that_leaves_the_working_folder_takes_nothing_with_it(plant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = rows_of({"wanders": stub_plant.Wanders(), "still": stub_plant.Still()}, folder="out")
    assert os.getcwd() == str(tmp_path) and rows["wanders"]["status"] == rows["still"]["status"] == "ok"
    assert len(list(tmp_path.glob("out/runs/*/calm_seed1.parquet"))) == 2


def test_a_command_that_is_ended_from_inside_says_so_and_does_not_return_0(monkeypatch):
    monkeypatch.setattr(fowt_env, "simulate", lambda *arguments, **options: sys.exit(0))
    result = CliRunner().invoke(cli.app, ["simulate", "--duration", "5", "--wind", "none"])
    assert result.exit_code == EXIT_STOPPED and "SystemExit: 0" in result.stderr


def test_the_command_goes_through_to_its_leaderboard_and_says_what_failed_and_what_was_rare(plant, tmp_path):
    kinds = ",".join(f"{stub_plant.__name__}:{name}" for name in ("Exits", "Still"))
    words = f"--controllers {kinds} --cases steady_16 --seeds 1,2 --duration 4 --skip 1 --no-plot --out"
    result = CliRunner().invoke(cli.app, ["evaluate", *words.split(), str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert result.stderr.count("stub_plant:Exits, steady_16, seed") == 2
    assert result.stderr.count("SystemExit: 0") == 2
    assert "1 of 4 runs had rare numerical events" in result.stderr
    board = json.loads((tmp_path / "leaderboard.json").read_text())
    assert [entry["failed"] for entry in board["controllers"]] == [0, 2]


# ------------------------------------------------------------------ names


def test_no_two_names_have_one_file():
    names = ["c2:A", "c2_A", "C2_A", "c2_a", "c2 A", "c2/A", "..", ".", ".hidden", "hidden", "pi", "PI"]
    names += ["policy:runs/ppo/0/best.npz", "policy:runs/ppo_0/best.npz", "größe", "gr__e"]
    names += ["x" * 300, "x" * 301, "ß" * 300]
    for place in (
        lambda name: run_file("runs", name, "calm", 1),
        lambda name: run_file("runs", "pi", name, 1),
    ):
        paths = [place(name) for name in names]
        assert len({str(path).casefold() for path in paths}) == len(names)
        for path in paths:
            assert len(path.parts) == 3 and not {"..", "."} & set(path.parts)
            assert all(len(os.fsencode(part)) < 150 and not part.startswith(".") for part in path.parts)
    assert str(run_file("runs", "gspi_oc3", "ntm_18", 2)) == "runs/gspi_oc3/ntm_18_seed2.parquet"
    assert run_file("runs", "policy:ppo_lqr", "a", 1).parent.name.startswith("policy_ppo_lqr-")


def test_names_whose_files_would_meet_all_the_same_are_refused_with_both_of_them(plant, tmp_path):
    meets = run_file("runs", "c2:A", "calm", 1).parent.name.lower()
    with pytest.raises(InputError, match=f"'c2:A' in case 'calm' and controller '{meets}'"):
        evaluate({"c2:A": stub_plant.Still(), meets: stub_plant.Still()}, [CALM], folder=tmp_path, **SHORT)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "name", ["", " ", "a\nb", "a\x1b[31m", "a\udcff", "\u202ea", "x" * (LONGEST_NAME + 1), 7]
)
def test_names_that_no_table_can_hold_are_refused_before_anything_runs(plant, tmp_path, name):
    for label, case in ((name, "calm"), ("a", name)):
        with pytest.raises(InputError, match="must be a printable text of at most 500 characters"):
            evaluate({label: stub_plant.Still()}, [Case(case, 16.0)], folder=tmp_path, **SHORT)
    with pytest.raises(InputError, match="two have the name 'Still'"):
        evaluate([stub_plant.Still(), stub_plant.Still()], [CALM], **SHORT)
    assert not list(tmp_path.iterdir())
    for name in ("pi", "policy:ppo_lqr", "mine:Mine", "größe", "a b"):
        check_name("name", name)


# ------------------------------------------------------------------ rows and folders


def written_row(tmp_path, **changes):
    """Path of a run file whose row has been changed."""
    row = dict.fromkeys(COLUMNS, 1.5) | {"controller": "pi", "case": "calm", "seed": 1, "status": "ok"}
    row = row | {"reason": "", "events": "", "warning": ""} | changes
    row = {name: value for name, value in row.items() if value is not Ellipsis}
    return write_run(run_content(None, row), tmp_path / "runs" / "pi" / "calm_seed1.parquet")


@pytest.mark.parametrize(
    "changes",
    [
        {"controller": ["x"]}, {"controller": None}, {"controller": "a\x1bb"}, {"case": 5}, {"case": ...},
        {"seed": "1"}, {"seed": 1.0}, {"seed": True}, {"seed": -1}, {"seed": 2**63}, {"seed": None},
        {"status": "fine"}, {"status": ...}, {"reason": 5}, {"reason": None}, {"events": {}},
        {"warning": None},
        {"scored_[s]": "long"}, {METRICS[0]: [1.0]}, {METRICS[0]: True}, {METRICS[0]: 10**400},
    ],
)  # fmt: skip
def test_a_row_with_a_wrong_type_is_refused_by_its_files_name(tmp_path, changes):
    path = written_row(tmp_path, **changes)
    with pytest.raises(InputError, match=r"calm_seed1.parquet' is not a run of an evaluation \(.*remove it"):
        read_row(path)


def test_a_row_of_a_file_elsewhere_is_refused_and_a_strangers_reason_made_printable(plant, tmp_path):
    path = written_row(tmp_path, status="failed", reason="a\x1b[31m\nb" + "c" * 900)
    assert read_row(path)["reason"] == "a\\x1b[31m b" + "c" * 485 + " ..."
    path.rename(path.with_name("calm_seed2.parquet"))
    with pytest.raises(InputError, match="calm_seed2.parquet' contains the run pi, calm, 1: remove it"):
        with results.open_results(tmp_path, SETTINGS, COLUMNS):
            pass


SETTINGS = {"suite": None, "options": {}, "cases": {}, "seeds": [], "controllers": {}}


@pytest.mark.parametrize("package", ["numpy", "numba", "machine", "rainflow"])
def test_a_folder_and_a_ray_worker_of_other_versions_are_refused_with_both_of_them(tmp_path, package):
    def opened():
        with results.open_results(tmp_path, SETTINGS, COLUMNS):
            pass

    opened()
    path, versions = tmp_path / "manifest.json", provenance.versions()
    manifest, other = json.loads(path.read_text()), versions | {package: "0.1"}
    assert manifest["versions"] == versions
    path.write_text(json.dumps(manifest | {"versions": other}))
    here = re.escape(f"{package} {versions[package]}")
    with pytest.raises(InputError, match=f"made with {package} 0.1, not {here}: choose"):
        opened()
    with pytest.raises(InputError, match=f"{package} 0.1 here and {here} at the worker"):
        score(None, here=other)
    less = {name: version for name, version in versions.items() if name != package}
    path.write_text(json.dumps(manifest | {"versions": less | {"pandas": "0.1"}}))  # affects no metric
    opened()
    assert json.loads(path.read_text())["versions"] == versions | {"pandas": "0.1"}


def test_a_row_is_that_of_the_scored_part_of_its_file_by_the_figures_of_its_own_turbine(plant, tmp_path):
    small = Case("small", 5.0, platform="oc3_froude_10mw")
    table = evaluate({"a": stub_plant.Still()}, [small], duration=30.0, skip=7.0, folder=tmp_path)
    row, run = table.iloc[0], pd.read_parquet(run_file(tmp_path / "runs", "a", "small", 1))
    turbine = read_turbine(read_platform("oc3_froude_10mw").turbine)
    rated_rpm = turbine.rated_rotor_speed * 30.0 / np.pi
    limit = np.degrees(turbine.pitch_drive.rate_limit)
    assert abs(rated_rpm - 12.1) > 1.0 and abs(limit - 8.0) > 0.5  # not what metrics takes by itself
    time = run["Time_[s]"].to_numpy()
    kept = run[time > 7.0 - 0.05]
    assert len(kept) == 231 and row["scored_[s]"] == 23.0
    assert row["PtfmPitch_mean_[deg]"] == pytest.approx(np.average(kept["PtfmPitch_[deg]"]), rel=1e-12)
    over = 100.0 * (kept["RotSpeed_[rpm]"].max() - rated_rpm) / rated_rpm
    assert over > 0.0 and row["overspeed_[%]"] == pytest.approx(over, rel=1e-9)
    rates = np.abs(np.diff(kept["BldPitch1_[deg]"])) / 0.1
    assert row["actuator_duty_[%]"] == pytest.approx(100.0 * rates.mean() / limit, rel=1e-9)


# ------------------------------------------------------------------ what shapes a run


USED = """
import sys
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.run_case import Run, scored
from fowt_env.training.evaluation.plant_perturbation import PlantPerturbation
sea = {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0}
wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
case = Case("c", wind, sea, shift=PlantPerturbation(noise=0.01))
row, _ = scored(Run("constant", "constant", case, 1, 1.0, 0.1, {}, None))
assert row["status"] == "ok", row["reason"]
others = [name for name in sys.modules if name.startswith("fowt_env.controllers")]
names = {name for name in sys.modules if name.startswith("fowt_env.")} - set(others)
print(*{sys.modules[name].__file__ for name in {*names, "fowt_env.controllers.constant"}}, sep="\\n")
"""


def printed(program, code, folder):
    """Words that a program prints with the sources of a folder."""
    options = {"env": os.environ | {"PYTHONPATH": str(code)}, "cwd": folder}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_what_a_run_imports_is_in_the_hash_of_the_plant_and_what_people_look_at_is_not(tmp_path):
    words = printed(USED, PACKAGE.parent, tmp_path)
    files = {str(path) for path in provenance.plant_files()}
    # of the program above, of agents, and of controllers, whose own hash has it
    others = (
        "training.evaluation.cases", "training.evaluation.carried", "training.evaluation.scaling",
        "envs.decisions", "analysis.reduced_model", "analysis.threads",
    )  # fmt: skip
    used = set(words) - {str(module_path(f"fowt_env.{name}")) + ".py" for name in others}
    assert used <= files and len(used) > 40
    names = {installed_path(path).relative_to(PACKAGE).as_posix() for path in provenance.plant_files()}
    data = "data/platforms/oc3_hywind.toml"
    assert {data, "training/evaluation/metrics.py", "training/evaluation/plant_perturbation.py"} <= names
    looks = ("visual", "training/cli", "training/reports", "controllers/pi")
    assert not [name for name in names if name.startswith(looks)]


CODES = """
import sys
sys.path.insert(0, "")
from fowt_env.controllers import CONTROLLERS
from fowt_env.training.evaluation.provenance import controller_code, plant_code
print("plant", plant_code())
for name in (*CONTROLLERS, "policy:agent.npz", "own:Law"):
    print(name, controller_code(name)["code"])
"""
OWN = "from fowt_env.controllers.pi import pi as Law\nfrom fowt_env.envs import FowtEnv\n"


def codes(code, folder):
    """{what is hashed in a manifest: its hash} of a copy of the sources."""
    words = printed(CODES, code, folder)
    return dict(zip(words[::2], words[1::2], strict=True))


@pytest.mark.nightly
def test_an_edit_of_a_text_or_a_plot_voids_no_results_and_one_of_what_shapes_a_run_does(tmp_path):
    code = copied_code(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "agent.npz").write_bytes(b"")
    before = codes(code, tmp_path)

    def changed_by(*places):
        for place in places:
            edit(code / place)
        after = codes(code, tmp_path)
        return {name for name in before if after[name] != before[name]}

    assert changed_by(*LOOKS) == set()
    pi = {"pi", "pi_land", "pi_land_power", "pi_tuned", "pi_unscheduled", "own:Law", "policy:agent.npz"}
    after_law = changed_by("fowt_env/controllers/pi.py")
    assert pi <= after_law and not {"plant", "constant"} & after_law
    assert "plant" in changed_by("fowt_env/scene/build.py")


PROJECT = {
    "mine.py": "from gains import K\nimport shared.filters as f\nclass Law:\n"
    "    def reset(self, m):\n        from late import x\n    def act(self, m):\n        return 1.0, K\n",
    "gains.py": "K = 0.1\n",
    "late.py": "import numpy\nx = 1\n",
    "shared/__init__.py": "",
    "shared/filters.py": "from . import corner\nfrom .deep.far import y\n",
    "shared/corner.py": "",
    "shared/deep/far.py": "y = 2\n",
    "other.py": "",
}


@pytest.mark.parametrize("how", ["name", "object", "class"])
def test_an_edit_of_what_a_controllers_module_imports_from_its_project_changes_its_code(
    tmp_path, monkeypatch, how
):
    for name, text in PROJECT.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    if how == "name":
        controller = "mine:Law"
    else:
        import mine

        controller = mine.Law if how == "class" else mine.Law()
    known = provenance.controller_code(controller)["code"]
    assert provenance.controller_code(controller)["code"] == known
    for name in PROJECT:
        path = tmp_path / name
        before = path.read_text()
        path.write_text(before + "EDITED = True\n")
        assert (provenance.controller_code(controller)["code"] != known) == (name != "other.py"), name
        path.write_text(before)
    assert provenance.controller_code(controller)["code"] == known
    for name in ("mine", "gains", "late", "shared", "shared.filters", "shared.corner"):
        sys.modules.pop(name, None)
