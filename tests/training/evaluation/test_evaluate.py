from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from fowt_env.descriptions.faults import Fault
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError, PlantWarning
from fowt_env.training.evaluation.cases import (
    Case,
    Score,
    ScoreTerm,
    Suite,
    all_cases,
    named_cases,
    read_suite,
)
from fowt_env.training.evaluation.evaluate import COLUMNS, evaluate, mean_ratios, summary
from fowt_env.training.evaluation.leaderboard import leaderboard
from fowt_env.training.evaluation.metrics import METRICS

GUSTY = Case(
    "gusty",
    {"kind": "ntm", "speed": 18.0, "class": "B"},
    {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0, "gamma": 2.0},
)
CALM = Case("calm", 16.0)
SHORT = {"duration": 20.0, "skip": 5.0}


class Frozen:
    """A controller that never moves, at module level so that worker processes can load it."""

    def reset(self, measurement):
        self.command = (measurement.generator_torque, measurement.blade_pitch)

    def act(self, measurement):
        return self.command


class Runaway(Frozen):
    """No torque and no blade pitch: the rotor runs away."""

    def act(self, measurement):
        return 0.0, 0.0


class Broken(Frozen):
    """Returns NaN after ten seconds."""

    def act(self, measurement):
        return (float("nan"), 0.0) if measurement.time > 10.0 else self.command


class Crashing(Frozen):
    """Has a bug of its own."""

    def act(self, measurement):
        raise KeyError("lost")


class Unusable(Frozen):
    """Raises an InputError when prepared, reset or asked, as one does whose library is missing."""

    def __init__(self, moment):
        def fail(given):
            raise InputError(f"no library in {moment}")

        setattr(self, moment, fail)


class Degrees(Frozen):
    """Blade pitch in degrees."""

    def act(self, measurement):
        return self.command[0], np.degrees(self.command[1])


@pytest.mark.installation
def test_every_controller_meets_the_same_wind_and_waves():
    table = evaluate(["pi", "pi_land"], [GUSTY], seeds=(1, 2), **SHORT)
    assert list(table.columns) == list(COLUMNS) and len(table) == 4
    assert (table["status"] == "ok").all()
    weather = table[["case", "seed", "Wind1VelX_mean_[m/s]", "Wind1VelX_std_[m/s]", "Wave1Elev_std_[m]"]]
    assert len(weather.drop_duplicates()) == 2  # one realisation per seed
    assert table.groupby("seed")["BldPitch1_std_[deg]"].nunique().eq(2).all()  # and controllers that differ


def test_a_rotor_beyond_the_turbine_s_overspeed_has_failed_when_an_environment_would_end():
    options = {"duration": 40.0, "skip": 5.0}
    row = evaluate({"runaway": Runaway()}, [replace(CALM, trip=None)], **options).iloc[0]
    assert row["status"] == "failed" and row["reason"].startswith("overspeed")
    assert np.isnan(row["RotSpeed_std_[rpm]"])
    env = FowtEnv(wind=16.0, duration=40.0)
    env.reset(options={"wind": 16.0, "sea": None, "offsets": {}})
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step_physical(0.0, 0.0)
    assert info["termination"] == row["reason"] and info["time"] == pytest.approx(row["stopped_[s]"])
    stuck = Case("stuck", 16.0, fault=Fault(kind="grid_loss", time=10.0), trip=None)
    gone_on = evaluate({"runaway": Runaway()}, [stuck], **options).iloc[0]
    assert gone_on["status"] == "ok" and gone_on["overspeed_[%]"] > 100.0


def test_a_rotor_beyond_the_trip_is_no_good_run_and_says_when_and_why():
    options = {"duration": 40.0, "skip": 5.0}
    row = evaluate({"runaway": Runaway()}, [CALM], **options).iloc[0]
    assert row["status"] == "tripped" and 0.0 < row["stopped_[s]"] < 40.0
    assert row["reason"] == f"overspeed trip at {row['stopped_[s]']:.1f} s: rotor speed above 1.3 of rated"
    assert row["overspeed_[%]"] > 25.0  # the figures are those of what happened
    later = evaluate({"runaway": Runaway()}, [replace(CALM, trip=1.6)], **options).iloc[0]
    assert later["stopped_[s]"] > row["stopped_[s]"]
    assert evaluate("pi", [CALM], **options).iloc[0]["status"] == "ok"


def test_a_failing_run_is_a_row_with_its_reason_and_the_others_go_on():
    table = evaluate({"broken": Broken(), "crashing": Crashing(), "fine": Frozen()}, [CALM], **SHORT)
    rows = table.set_index("controller")
    assert rows.loc["broken", "status"] == rows.loc["crashing", "status"] == "failed"
    assert "nan" in rows.loc["broken", "reason"] and "KeyError" in rows.loc["crashing", "reason"]
    assert rows.loc["broken", "stopped_[s]"] == pytest.approx(10.1, abs=0.11)
    assert rows.loc[["broken", "crashing"], list(METRICS)].isna().all(axis=None)
    assert rows.loc["fine", "status"] == "ok"
    means = summary(table).set_index("controller")
    assert means.loc["broken", "failed"] == 1 and means.loc["fine", "failed"] == 0
    assert means.loc["fine", "RotSpeed_mean_[rpm]"] == rows.loc["fine", "RotSpeed_mean_[rpm]"]


def test_a_controller_that_cannot_be_used_costs_its_own_runs_only(tmp_path):
    moments = {moment: Unusable(moment) for moment in ("prepare", "reset", "act")}
    table = evaluate({**moments, "fine": Frozen()}, [CALM], folder=tmp_path / "out", **SHORT)
    rows = table.set_index("controller")
    for moment in moments:
        assert rows.loc[moment, "status"] == "failed" and rows.loc[moment, list(METRICS)].isna().all()
        assert rows.loc[moment, "reason"] == f"no library in {moment}"
    assert rows.loc["fine", "status"] == "ok"
    again = evaluate({**moments, "fine": Frozen()}, [CALM], folder=tmp_path / "out", **SHORT)
    pd.testing.assert_frame_equal(again, table)


def test_without_the_rosco_library_its_runs_fail_and_say_what_to_install(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    rows = evaluate("rosco,pi", [CALM], **SHORT).set_index("controller")
    assert rows.loc["rosco", "status"] == "failed"
    assert "pip install --no-deps rosco" in rows.loc["rosco", "reason"]
    assert rows.loc["pi", "status"] == "ok"


@pytest.mark.installation
def test_table_and_runs_on_disk_are_those_returned(tmp_path):
    out = tmp_path / "deep" / "metrics.csv"
    table = evaluate("pi", [CALM], out=out, runs_folder=tmp_path / "runs", **SHORT)
    written = pd.read_csv(out, keep_default_na=False, na_values={name: [""] for name in METRICS})
    np.testing.assert_allclose(
        written[list(METRICS)].astype(float), table[list(METRICS)].astype(float), rtol=1e-9
    )
    run = pd.read_parquet(tmp_path / "runs" / "pi" / "calm_seed1.parquet")
    assert run["Time_[s]"].iloc[-1] == pytest.approx(20.0)
    assert not [path for path in tmp_path.rglob(".*")]  # no temporary file is left


def test_an_interrupted_evaluation_leaves_its_finished_rows(tmp_path):
    out = tmp_path / "metrics.csv"

    def interrupt(done, total, row):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate("pi", [CALM], seeds=(1, 2, 3), out=out, progress=interrupt, **SHORT)
    assert pd.read_csv(out)["seed"].tolist() == [1, 2]


STOPPED = {"duration": 60.0, "skip": 30.0}


def test_a_stopped_turbine_has_lost_power_and_its_units_are_warned_of_once():
    with pytest.warns(PlantWarning, match="'Degrees': commanded blade pitch .* commands are") as warned:
        table = evaluate({"pi": "pi", "degrees": Degrees()}, [GUSTY], seeds=(1, 2), **STOPPED)
    assert len([each for each in warned if issubclass(each.category, PlantWarning)]) == 1
    rows = table.set_index(["controller", "seed"])
    assert rows.loc["degrees", "status"].tolist() == ["lost power"] * 2
    assert rows.loc["pi", "status"].tolist() == ["ok"] * 2 and (rows.loc["pi", "warning"] == "").all()
    assert "less than half of the" in rows.loc[("degrees", 1), "reason"]
    entries = {entry["controller"]: entry for entry in leaderboard(table)["controllers"]}
    assert entries["degrees"]["lost_power"] == entries["degrees"]["lost"] == 2
    assert np.isnan(entries["degrees"]["difference"]["RotSpeed_std_[rpm]"]["percent"])
    means = summary(table).set_index("controller")
    assert means.loc["degrees", "lost_power"] == 2 and np.isnan(means.loc["degrees", "RotSpeed_std_[rpm]"])


def test_the_reference_of_a_suite_runs_to_its_end_where_its_law_as_an_entry_trips(tmp_path):
    rule = Score(baseline="pi", term=(ScoreTerm(metric="RotSpeed_std_[rpm]", weight=1.0),))
    case = replace(GUSTY, trip=1.01)
    suite = Suite("mine", 1, "d", "s", "rotor-averaged", (1, 2), 20.0, 5.0, (case,), score=rule)
    table = evaluate("pi,pi_land", suite, folder=tmp_path)
    rows = table.set_index(["controller", "seed"])
    assert list(dict.fromkeys(table["controller"])) == ["reference", "pi", "pi_land"]
    assert rows.loc["pi", "status"].tolist() == ["tripped"] * 2
    assert rows.loc["reference", "status"].tolist() == ["ok"] * 2
    free = evaluate("pi", replace(suite, cases=(replace(case, trip=None),)), reference=False)
    own, free = (frame[list(METRICS)] for frame in (rows.loc["reference"], free.set_index("seed")))
    pd.testing.assert_frame_equal(own, free, check_exact=True)
    board = leaderboard(table, score=rule)
    assert [entry["controller"] for entry in board["controllers"]] == ["pi", "pi_land"]
    assert all(np.isfinite(entry["score"]["mean"]) for entry in board["controllers"])
    again = evaluate(
        "pi_land", suite, folder=tmp_path, progress=lambda done, total, row: done < total and 1 / 0
    )
    pd.testing.assert_frame_equal(again, table)
    with pytest.raises(InputError, match="'reference' is reserved for the suite's reference"):
        evaluate({"reference": "pi"}, [CALM], **SHORT)


@pytest.mark.nightly
def test_worker_processes_give_the_same_table_and_warn_of_units_once_for_each_controller():
    controllers = {"pi": "pi", "frozen": Frozen(), "one": Degrees(), "two": Degrees()}
    tables = []
    for jobs in (1, 2):
        with pytest.warns(PlantWarning) as warned:
            tables.append(evaluate(controllers, [GUSTY, CALM], seeds=(1, 3), jobs=jobs, **SHORT))
        assert len([each for each in warned if issubclass(each.category, PlantWarning)]) == 2
    pd.testing.assert_frame_equal(*tables, check_exact=True)


def test_named_suites_hold_their_cases_once():
    cases = named_cases("above_rated, ntm_18,paper_18")
    assert [case.name for case in cases] == [*(c.name for c in read_suite("above_rated").cases), "paper_18"]
    assert {case.name for case in cases} <= set(all_cases())
    assert cases[3].wind == {"kind": "ntm", "speed": 18.0, "class": "B", "sigma": "drawn"}
    heights = [case.sea.Hs for case in cases[:-1]]
    assert heights == sorted(heights) and heights[0] < heights[-1]  # rougher sea in stronger wind


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cases": "above_ratted"}, "above_rated"),
        ({"controllers": ["pie"]}, "'pi'"),
        ({"controllers": []}, "controllers"),
        ({"cases": []}, "at least one"),
        ({"seeds": ()}, "seeds"),
        ({"seeds": (1, 1)}, "differ"),
        ({"cases": [CALM, CALM]}, "differ"),
        ({"jobs": 0}, "jobs = 0"),
        ({"duration": 10.0, "skip": 10.0}, "skip = 10"),
        ({"cases": [Case("late", 16.0, fault=Fault(kind="grid_loss", time=100.0))]}, "occurs at 100 s"),
        ({"out": "table.xlsx"}, "csv"),
        ({"dt": 0.03}, "dt = 0.03"),
        ({"cases": [Case("squall", {"kind": "squall", "speed": 12.0})]}, "squall"),
        ({"controllers": {"local": lambda: None}, "jobs": 2, "seeds": (1, 2)}, "jobs = 2|no arguments|reset"),
    ],
)
def test_settings_that_no_run_could_use_are_named(arguments, message):
    with pytest.raises(InputError, match=message):
        evaluate(**{"controllers": "pi", "cases": [CALM], **SHORT, **arguments})


def test_ratios_are_means_over_the_same_runs_and_a_failed_run_leaves_none():
    rows = [
        {"controller": name, "case": case, "seed": seed, "status": "ok", "x": value, "y": 1.0}
        for name, values in {"a": (1.0, 2.0, 4.0, 8.0), "b": (2.0, 2.0, 2.0, 2.0)}.items()
        for (case, seed), value in zip([("c", 1), ("c", 2), ("d", 1), ("d", 2)], values, strict=True)
    ]
    found = mean_ratios(pd.DataFrame(rows[::-1]), "a", ["x", "y"])
    assert found.loc["b"].tolist() == [np.mean([2.0, 1.0, 0.5, 0.25]), 1.0]
    assert found.loc["a"].tolist() == [1.0, 1.0]
    for lost in ({"x": np.nan}, {"status": "tripped"}):
        part = pd.DataFrame([*rows[:-1], rows[-1] | lost])
        assert np.isnan(mean_ratios(part, "a", ["x"]).loc["b", "x"])
