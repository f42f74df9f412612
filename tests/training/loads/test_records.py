"""The records of a load table, and the files of finished runs."""

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.loads import records
from fowt_env.training.loads.records import FinishedRun, LoadCase, read_run, run_content, run_path, write_run

CASE = LoadCase(
    dlc="1.2", name="dlc1_2_12", description="", case=Case("dlc1_2_12"), controller="pi", seed=3,
    duration=4200.0, skip=600.0, analysis="both", safety="fatigue", factor=1.0, factor_source="",
)  # fmt: skip


@pytest.mark.parametrize(("wind", "waves", "expected"), [
    (0.0, 0.0, 0.0), (0.0, 30.0, 30.0), (20.0, 0.0, -20.0), (-170.0, 170.0, -20.0), (0.0, 180.0, 180.0),
])  # fmt: skip
def test_the_misalignment_is_the_waves_direction_seen_from_the_wind(wind, waves, expected):
    case = replace(CASE, wind_direction=wind, wave_direction=waves)
    assert case.misalignment == pytest.approx(expected, abs=1e-12)


def test_the_hours_of_a_run_are_without_its_transient():
    assert CASE.hours == 1.0


def test_a_failed_run_is_read_as_it_was_written(tmp_path):
    run = FinishedRun("mine", CASE.name, 3, "failed", "ValueError: no", 12.5, "", "", 0.25)
    path = write_run(run_content(run), run_path(tmp_path, run.key))
    assert path == run_path(tmp_path, CASE.key).parent.parent / "mine" / "dlc1_2_12_seed3.zip"
    assert read_run(path) == run


def test_a_time_that_is_missing_is_not_a_number(tmp_path):
    run = FinishedRun("pi", CASE.name, 3, "failed", "worker died")
    read = read_run(write_run(run_content(run), tmp_path / "run.zip"))
    assert np.isnan(read.stopped) and np.isnan(read.wall_time)


@pytest.mark.parametrize("change", [
    {"status": "fine"}, {"seed": "3"}, {"seed": -1}, {"reason": None}, {"further": 1},
])  # fmt: skip
def test_a_file_of_another_program_is_refused_by_name(tmp_path, change):
    run = FinishedRun("pi", CASE.name, 3, "ok")
    with zipfile.ZipFile(io.BytesIO(run_content(run))) as archive:
        row = records.parse_json(archive.read(records.ROW).decode())
    path = tmp_path / "run.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(records.ROW, records.json.dumps(row | change))
    with pytest.raises(InputError, match="run.zip' is not a run of a load table"):
        read_run(path)


@pytest.mark.parametrize("cut", [0, 10, -5])
def test_a_damaged_file_is_refused_by_name(tmp_path, cut):
    content = run_content(FinishedRun("pi", CASE.name, 3, "ok"))
    path = tmp_path / "run.zip"
    path.write_bytes(content[:cut])
    with pytest.raises(InputError, match="run.zip' is not a run of a load table"):
        read_run(path)
