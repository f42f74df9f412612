"""The figures of the comparison of individual pitch control, on a table that is written out."""

import pandas as pd
import pytest

from fowt_env.training.studies.individual_pitch import (
    NAMES,
    ROOT,
    SHOWN,
    TRAVEL,
    WEIGHT,
    means,
    ratios,
    trade_off,
)


def table(**roots):
    """Two runs of each controller, with once and twice a root load and a share; more load, less travel."""
    rows = []
    for name, root in roots.items():
        for seed in (1, 2):
            row = {"controller": name, "case": "a", "seed": seed, "status": "ok", "reason": ""}
            row |= dict.fromkeys(SHOWN.values(), 3.0) | {
                ROOT: root * seed,
                TRAVEL: 2.0 - 0.1 * root,
                WEIGHT: float(seed),
            }
            rows.append(row)
    return pd.DataFrame(rows)


def test_damage_adds_up_and_each_is_compared_with_its_own_law():
    figures = means(table(**{name: 10.0 + i for i, name in enumerate(NAMES)}))
    assert figures.loc["pi", ROOT] == pytest.approx(10.0 * ((1.0 + 2.0 * 2.0**10) / 3.0) ** 0.1)
    found = ratios(figures)
    assert found.loc["ipc", "root flapwise"] == pytest.approx(1.1)
    assert found.loc["rosco_ipc", "root flapwise"] == pytest.approx(15.0 / 14.0)
    assert found.loc["rosco", "root flapwise"] == 1.0
    assert found.loc["ipc", "travel"] == pytest.approx(0.9)


def test_root_load_and_travel_are_over_those_of_the_collective_law():
    found = trade_off(means(table(pi=10.0, ipc=6.0, rosco=5.0, **{"bound 0.1": 7.0})))
    assert list(found.index) == ["ipc", "bound 0.1"]
    assert found["root flapwise"].tolist() == pytest.approx([0.6, 0.7])
    assert found["travel"].tolist() == pytest.approx([1.4, 1.3])


def test_a_run_that_failed_is_named():
    runs = table(pi=10.0)
    runs.loc[0, ["status", "reason"]] = ["tripped", "overspeed"]
    with pytest.raises(ValueError, match="overspeed"):
        means(runs)
