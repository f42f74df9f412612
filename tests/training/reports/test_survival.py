"""The table of who survives what, from runs with known figures."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.reports.survival import survival, survival_markdown


def runs(*rows):
    """Table of runs: (controller, case, status, reason, changed figures)."""
    common = dict.fromkeys(METRICS, 1.0) | {"seed": 1}
    return pd.DataFrame(
        [common | {"controller": c, "case": case, "status": status, "reason": reason} | changes
         for c, case, status, reason, changes in rows]
    )  # fmt: skip


FAST, STANDING = "overspeed_[%]", "standstill_time_[s]"
DEVIATION, RUNAWAY = "pitch deviation trip at 261.0 s: ...", "overspeed trip at 270.0 s: ..."
TABLE = runs(
    ("a", "stuck_12", "ok", DEVIATION, {FAST: 20.0, "PtfmPitch_min_[deg]": -9.0}),
    ("a", "stuck_9_4", "ok", "", {STANDING: 30.0, "TwrBsMyt_min_[kN-m]": -8e4}),
    ("b", "stuck_12", "ok", RUNAWAY, {FAST: 60.0, STANDING: np.nan}),
    ("b", "stuck_9_4", "failed", "capsize", dict.fromkeys(METRICS, np.nan)),
)


def test_survival_is_neither_failure_nor_a_limit_passed_and_a_trip_is_none():
    found = survival(TABLE).set_index("controller")
    assert list(found["kind"]) == ["stuck", "stuck"]
    assert list(found["survived"]) == [2, 0] and list(found["runs"]) == [2, 2]
    assert list(found["trips"]) == ["1 pitch deviation", "1 overspeed"]
    assert survival(TABLE, {}).set_index("controller").loc["b", "survived"] == 1


def test_figures_are_the_largest_of_both_directions_and_a_missing_standstill_shows():
    found = survival(TABLE).set_index("controller")
    assert found.loc["a", "rotor_speed"] == 120.0 and found.loc["a", "platform_pitch"] == 9.0
    assert found.loc["a", "tower_base"] == pytest.approx(80.0) and found.loc["a", "standstill"] == 30.0
    assert np.isnan(found.loc["b", "standstill"])
    text = survival_markdown(survival(TABLE))
    assert "| stuck | 2 of 2 | 0 of 2 |" in text and "| stuck | 30 | - |" in text
    assert "| stuck | 1 pitch deviation | 1 overspeed |" in text
