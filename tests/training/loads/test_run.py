"""The runs of a load table: resumed after a kill, refused with other settings, lost runs as rows."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import fowt_env
from fowt_env.errors import InputError
from fowt_env.training.loads import run
from fowt_env.training.loads.matrix import expanded
from fowt_env.training.loads.records import read_run, run_path
from fowt_env.training.loads.run import Task, finished_runs, lost, run_matrix, simulated
from fowt_env.training.loads.site import read_site
from fowt_env.weather import wind_field
from fowt_env.weather.wind_field import WindBox

SCRIPT = """
import sys
sys.path.insert(0, sys.argv[3])
from test_run import quick
from fowt_env.training.loads.run import run_matrix
if __name__ == "__main__":
    run_matrix(quick("pi", dlc="1.3"), {"pi": "pi"}, sys.argv[1], jobs=int(sys.argv[2]))
"""


class Broken:
    """A controller that raises an error when it acts."""

    def reset(self, measurement):
        """Do nothing."""

    def act(self, measurement):
        """Raise an error."""
        raise ValueError("no law")


def quick(*controllers, dlc="1.3", wind="rotor-averaged", seeds=1, hours=0.05):
    """The Matrix of runs of three minutes after 20 s of transient."""
    site = read_site("norway_5")
    design = site.design.model_copy(update={"transient": 20.0, "bin_width": 2.0})
    mine = site.model_copy(update={"design": design})
    return expanded("oc3_hywind", mine, controllers, dlc=dlc, seeds=seeds, hours=hours, wind=wind)


def files(folder):
    return {path: path.stat().st_mtime_ns for path in Path(folder).glob("runs/*/[!.]*.zip")}


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The folder of a table of 11 runs in extreme turbulence, and the counts of their statuses."""
    folder = tmp_path_factory.mktemp("table")
    return folder, run_matrix(quick("pi"), {"pi": "pi"}, folder)


def test_every_run_has_its_statistics(table):
    folder, statuses = table
    matrix = quick("pi")
    assert statuses == Counter({"ok": 11})
    found = list(finished_runs(matrix, folder))
    assert [case.key for case, _ in found] == [finished.key for _, finished in found] == list(matrix.runs)
    for case, finished in found:
        statistics = finished.statistics
        assert statistics.duration == pytest.approx(180.0, abs=0.2)
        assert statistics.mean[list(statistics.channels).index("Wind1VelX_[m/s]")] == pytest.approx(
            case.wind_speed, rel=0.25
        )


def test_finished_runs_are_not_repeated_and_a_controller_is_added(table):
    folder, _ = table
    before = files(folder)
    assert run_matrix(quick("pi"), {"pi": "pi"}, folder)["ok"] == 11
    assert files(folder) == before
    one = quick("pi_land", dlc="1.3")
    run_matrix(one, {"pi_land": "pi_land"}, folder)
    after = files(folder)
    assert len(after) == 22 and all(after[path] == when for path, when in before.items())


@pytest.mark.parametrize(("change", "message"), [
    ({"hours": 0.06}, "was made with another case .*: duration = 200.0, now 236"),
    ({"wind": "full-field"}, "was made with another case .*: wind"),
])  # fmt: skip
def test_a_folder_of_other_settings_is_refused(table, change, message):
    with pytest.raises(InputError, match=message):
        run_matrix(quick("pi", **change), {"pi": "pi"}, table[0])


def test_a_folder_of_other_sources_or_another_platform_is_refused(table, monkeypatch):
    monkeypatch.setattr(run, "_digest", lambda platform: "other")
    with pytest.raises(InputError, match="was made with another version of the platform file"):
        run_matrix(quick("pi"), {"pi": "pi"}, table[0])
    monkeypatch.undo()
    monkeypatch.setattr(run.provenance, "plant_code", lambda start: "other")
    with pytest.raises(InputError, match="was made with another version of the sources"):
        run_matrix(quick("pi"), {"pi": "pi"}, table[0])


def test_a_folder_of_another_law_under_the_same_name_is_refused(table):
    with pytest.raises(InputError, match="controller 'pi' or its code has changed"):
        run_matrix(quick("pi"), {"pi": "pi_land"}, table[0])


def test_the_code_of_the_statistics_is_part_of_the_sources():
    files = {path.name for path in run.provenance.plant_files(Path(run.__file__))}
    assert {"statistics.py", "rollout.py", "run_case.py"} <= files


def test_a_failing_controller_has_rows_with_the_reason(tmp_path):
    matrix = quick("broken", dlc="5.1")
    statuses = run_matrix(matrix, {"broken": Broken()}, tmp_path)
    assert statuses == Counter({"failed": 3})
    for _, finished in finished_runs(matrix, tmp_path):
        assert "no law" in finished.reason and finished.statistics is None
    assert run_matrix(matrix, {"broken": Broken()}, tmp_path) == Counter({"failed": 3})
    before = files(tmp_path)
    run_matrix(matrix, {"broken": Broken()}, tmp_path, retry_failed=True)
    assert all(files(tmp_path)[path] != when for path, when in before.items())


def test_a_run_whose_process_died_is_a_row():
    case = next(iter(quick("pi").runs.values()))
    finished, _ = lost(Task(case, "pi", None, None), "its worker process ended 3 times")
    assert (finished.key, finished.status, finished.reason) == (
        case.key,
        "failed",
        "its worker process ended 3 times",
    )


def test_a_file_of_another_run_is_refused(table, tmp_path):
    matrix = quick("pi")
    first, second = (run_path(table[0], key) for key in list(matrix.runs)[:2])
    content = first.read_bytes()
    try:
        first.write_bytes(second.read_bytes())
        with pytest.raises(InputError, match="contains the run"):
            run_matrix(matrix, {"pi": "pi"}, table[0])
    finally:
        first.write_bytes(content)


@pytest.mark.nightly
def test_a_table_that_was_killed_goes_on_and_ends_with_the_same_statistics(table, tmp_path):
    script, folder = tmp_path / "script.py", tmp_path / "out"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(folder), "1", str(Path(__file__).parent)]
    root = Path(fowt_env.__file__).parent.parent
    environment = os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, start_new_session=True)
    deadline = time.monotonic() + 300.0
    while not files(folder) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stderr.close()
    before = files(folder)
    assert before
    run_matrix(quick("pi"), {"pi": "pi"}, folder)
    after = files(folder)
    assert len(after) == 11 and all(after[path] == when for path, when in before.items())
    for key in quick("pi").runs:
        one, other = (read_run(run_path(place, key)).statistics for place in (folder, table[0]))
        np.testing.assert_array_equal(one.max, other.max)


def test_runs_in_one_turbulence_follow_each_other_and_share_its_file(tmp_path, monkeypatch):
    """1.2, 1.3, 1.6 and 7.2 have the same 11 winds, in two models and three directions."""
    made, kept = [], []

    def noise(n_time, n_side, dx, step, length, seed):
        made.append((round(dx, 3), seed))
        return np.random.default_rng(seed).normal(size=(n_time, n_side, n_side, 3)).astype(np.float32)

    monkeypatch.setattr(wind_field, "mann_turbulence", noise)
    monkeypatch.setattr(run, "scored", lambda each, measure: (_row(each), None))
    matrix = quick("pi", "lqr", dlc="1.2,1.3,1.6,7.2", wind="full-field", seeds=1)
    assert len(matrix.runs) == 11 * (2 * (3 + 1 + 2) + 2)
    run_matrix(
        matrix, {"pi": "pi", "lqr": "lqr"}, tmp_path,
        progress=lambda *_: kept.append(len(list((tmp_path / "boxes").glob("*.npy")))),
    )  # fmt: skip
    assert len(made) == len(set(made)) == 11
    assert max(kept) == 1 and not (tmp_path / "boxes").exists()


def _row(each):
    """The row of a run that was not simulated."""
    assert isinstance(each.case.wind, WindBox)
    return {"status": "failed", "reason": "not run", "events": "", "warning": ""}


def test_the_expected_time_is_proportional_to_the_hours_and_less_with_more_processes(monkeypatch):
    monkeypatch.setattr(run, "_timed", lambda load, controller: 0.1)
    matrix = quick("pi")
    seconds, rates, per_box = run.expected_seconds(matrix, {"pi": "pi"}, 2)
    assert rates == {"pi": pytest.approx(3000.0)} and per_box == 0.0
    assert seconds == pytest.approx(11 * 200.0 / 3000.0 / 2)


def test_a_controller_that_fails_where_the_time_is_measured_is_refused_with_the_reason():
    with pytest.raises(InputError, match="'broken' failed in a run of 300 s of '.*measured: .*no law"):
        run.expected_seconds(quick("broken", dlc="5.1"), {"broken": Broken()})


def test_a_bad_controller_or_an_empty_table_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(InputError, match="'nobody'"):
        run_matrix(quick("nobody"), {"nobody": "nobody"}, tmp_path / "a")
    with pytest.raises(InputError, match="name 'parked' is reserved"):
        run_matrix(quick("parked"), {"parked": "pi"}, tmp_path / "b")
    with pytest.raises(InputError, match="all chosen load cases are left out"):
        run_matrix(quick("pi", dlc="2.5"), {"pi": "pi"}, tmp_path / "c")
    assert not list(tmp_path.iterdir())


def test_a_line_that_is_lost_from_the_start_is_not_called_slack(tmp_path):
    matrix = quick("pi", dlc="9.2")
    run_matrix(matrix, {"pi": "pi"}, tmp_path)
    for case, finished in finished_runs(matrix, tmp_path):
        statistics = finished.statistics
        assert statistics.value(f"FAIRTEN{case.case.fault.line}_[kN]", "max") == 0.0
        (slack,) = (flag for flag in statistics.flags if flag.name == "slack line")
        assert 0.0 < slack.value < 1.0


def test_a_run_is_the_same_alone_and_in_a_table(table):
    key, case = next(iter(quick("pi").runs.items()))
    alone, _ = simulated(Task(case, "pi", None, None))
    np.testing.assert_array_equal(alone.statistics.std, read_run(run_path(table[0], key)).statistics.std)
