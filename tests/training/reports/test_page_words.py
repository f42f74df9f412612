import pandas as pd
import pytest

from fowt_env.training.evaluation.metric_names import SHORT, short_name
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.reports.metric_words import about_metric
from fowt_env.training.reports.page_words import (
    case_conditions,
    conditions_table,
    conditions_text,
    content_policy,
    lost_list,
    lost_runs,
    page_lead,
    page_title,
    provenance,
)

EVIL = "<img src=x onerror=alert(1)>"
CASE = {
    "wind": {"kind": "ntm", "speed": 18.0, "class": "B"},
    "sea": {"kind": "jonswap", "Hs": 1.86, "Tp": 7.94, "gamma": 1.0},
    "platform": "oc3_hywind",
    "fault": {"kind": "grid_loss", "time": 260.0},
    "shift": {"mooring_stiffness": 0.8},
    "duration": 650.0,
    "skip": 50.0,
    "sensors": "standard",
}


def table(cases=("a", "b"), status="ok", reason=""):
    row = {"controller": "pi", "status": status, "reason": reason, "stopped_[s]": 41.25}
    return pd.DataFrame([row | {"case": case, "seed": seed} for case in cases for seed in (1, 2, 4)])


@pytest.mark.parametrize(
    ("manifest", "cases", "title"),
    [
        ({}, ["a", "b"], "Controllers: a, b"),
        ({"cases": {"a": CASE}}, list("abcd"), "Controllers on oc3_hywind: 4 load cases"),
        ({"cases": {"a": {"platform": "/home/x/mine.toml"}}}, ["a"], "Controllers on mine: a"),
        ({"suite": {"name": "dlc", "version": 3}}, ["a"], "Controllers: suite dlc, version 3"),
        ({"cases": {"a": CASE, "b": {"platform": "iea15"}}}, ["a", "b"], "Controllers on 2 platforms: a, b"),
    ],
)
def test_the_title_is_what_was_evaluated(manifest, cases, title):
    assert page_title(manifest, cases) == title


def test_the_lead_counts_what_the_table_holds():
    text = page_lead(table(), {"created": "2026-11-22T23:58:12+0000"})
    assert text == "1 controller · 2 cases · seeds 1, 2, 4 · 6 runs · evaluated 2026-11-22"


def test_conditions_are_wind_sea_events_length_sensors_and_seeds():
    (row,) = case_conditions(table(["a"]), {"cases": {"a": CASE}}, {"a": 0.25})
    assert row["wind"] == "normal turbulence (NTM) 18 m/s, class B"
    assert row["sea"] == "JONSWAP Hs 1.86 m, Tp 7.94 s, gamma 1"
    assert row["events"] == "grid loss at 260 s, shift mooring stiffness 0.8"
    assert (row["duration (s)"], row["scored from (s)"], row["seeds"]) == ("650", "50", "1, 2, 4")
    assert row["fraction of lifetime"] == "25.0 %"
    assert conditions_text(row).endswith("650 s, scored from 50 s; standard sensors; seeds 1, 2, 4")


def test_cases_without_a_description_or_with_a_strange_one_still_have_a_row():
    strange = {"wind": EVIL, "sea": {"kind": EVIL}, "fault": EVIL, "duration": EVIL, "platform": None}
    rows = case_conditions(table(["a", "b"]), {"cases": {"a": strange, "c": 3}})
    assert rows[1] == {"case": "b", "seeds": "1, 2, 4"}
    text = conditions_table(rows)
    assert "<img" not in text and "&lt;img" in text


def test_lost_runs_have_the_time_and_the_reason():
    lost = lost_runs(table(["a"], "tripped", f"overspeed {EVIL}"))
    assert lost[0] == ("pi", "a", 1, f"tripped at 41.2 s: overspeed {EVIL}")
    told = lost_runs(table(["a"], "tripped", "overspeed trip at 41.2 s"))
    assert told[0][3] == "tripped: overspeed trip at 41.2 s"  # the time once
    text = lost_list(lost, 3)
    assert "3 of 3 runs lost" in text and "<img" not in text
    assert lost_list([], 3) == ""


def test_the_provenance_names_the_folder_and_escapes_what_the_manifest_says(tmp_path):
    manifest = {"versions": {EVIL: EVIL}, "cases": {"a": {"trip": 1.3}}}
    text = provenance(tmp_path, table(), manifest, None)
    assert tmp_path.name in text and "1.3 times rated rotor speed" in text and "<img" not in text


def test_every_metric_is_explained_with_unit_and_direction():
    for metric in METRICS:
        assert " better" in about_metric(metric) and "Unit: " in about_metric(metric)
    assert about_metric("GenPwr_capped_mean_[kW]").endswith("Unit: kW. More is better.")
    assert set(SHORT) <= set(METRICS)
    assert short_name("novelty_rate_[-]") == "novelty rate" and "Novelty rate" in about_metric(
        "novelty_rate_[-]"
    )


def test_the_policy_holds_the_hash_of_each_script_as_a_browser_reads_it():
    """Of `alert('Hello, world.');`: the example of the Content Security Policy specification."""
    digest = "'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='"
    assert f"script-src {digest};" in content_policy(["alert('Hello, world.');"])
    assert content_policy(["a\r\nb\rc"]) == content_policy(["a\nb\nc"])
    nothing = content_policy(styles=["p{}"])
    assert "default-src 'none'; script-src 'none'; style-src 'sha256-" in nothing
    assert "unsafe" not in nothing and "unsafe-eval" not in content_policy(["a"], dynamic_styles=True)
