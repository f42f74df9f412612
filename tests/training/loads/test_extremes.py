"""Design extremes: rules, factors, simultaneous loads, paired differences."""

import numpy as np
import pytest
from load_runs import load_case, run_of

from fowt_env.training.evaluation.bootstrap import RANDOM_SEED, interval
from fowt_env.training.loads.extremes import characteristic, extreme_table, factor_of, flag_table
from fowt_env.training.loads.selection import RESAMPLES

MOMENT = "TwrBsMyt_[kN-m]"


def table(runs, **options):
    """Return {(column, side, controller): Extreme}."""
    return {(row.column, row.side, row.controller): row for row in extreme_table(runs, **options)}


def test_rules_of_the_characteristic_load():
    values = np.array([3.0, 1.0, 5.0, 4.0, 2.0])
    assert characteristic(values, "largest") == 5.0
    assert characteristic(values, "mean") == 3.0
    assert characteristic(values, "upper_half") == 4.0  # of 3, 4 and 5
    assert characteristic(values[:4], "upper_half") == 4.5
    assert characteristic(values[:1], "upper_half") == 3.0


@pytest.fixture(scope="module")
def runs():
    found = []
    for seed in (1, 2, 3, 4, 5):
        for label, scale in (("pi", 2.0), ("lqr", 1.5)):
            found.append(run_of(load_case("1.3", "calm", label, seed), scale))
            changes = {"factor": 1.1, "characteristic": "upper_half"}
            found.append(run_of(load_case("2.1", "fault", label, seed, **changes), 1.2 * scale))
    return found


def test_the_design_load_is_the_largest_of_the_factored_conditions(runs):
    found = table(runs, columns=[MOMENT, "PtfmPitch_[deg]"])
    for label in ("pi", "lqr"):
        for side, sign in (("max", 1.0), ("min", -1.0)):
            loads = {}
            for name, rule, factor in (("calm", "mean", 1.35), ("fault", "upper_half", 1.1)):
                own = [e.value(MOMENT, side) for c, e in runs if (c.name, c.controller) == (name, label)]
                value = sign * characteristic(sign * np.array(own), rule)
                # a load of the other sign relieves: the factor divides it
                loads[name] = value * factor if sign * value > 0.0 else value / factor
            name = max(loads, key=lambda each: sign * loads[each])
            row = found[MOMENT, side, label]
            assert row.factored == pytest.approx(loads[name], rel=1e-12)
            assert row.name == name and row.factor == {"calm": 1.35, "fault": 1.1}[name]


def test_motions_have_no_partial_factor(runs):
    row = table(runs, columns=["PtfmPitch_[deg]"])["PtfmPitch_[deg]", "max", "pi"]
    assert row.factor == 1.0 and row.factored == row.value
    case = load_case()
    assert factor_of(case, "FAIRTEN1_[kN]") == 1.35 and factor_of(case, "TipDxc1_[m]") == 1.0


def test_the_driving_run_is_the_closest_to_the_characteristic_load(runs):
    row = table(runs, columns=[MOMENT])[MOMENT, "max", "pi"]
    own = {c.seed: e for c, e in runs if (c.name, c.controller) == (row.name, "pi")}
    gaps = {seed: abs(each.value(MOMENT, "max") - row.value) for seed, each in own.items()}
    assert row.seed == min(gaps, key=gaps.get)
    driving = own[row.seed]
    assert row.time == driving.value(MOMENT, "time_max") and row.at == driving.at[MOMENT]["max"]
    assert row.largest == max(each.value(MOMENT, "max") for each in own.values())


def test_intervals_and_differences_are_those_of_a_plain_bootstrap(runs):
    """With every condition in each resample, and the same seeds for both controllers."""
    found = table(runs, columns=[MOMENT])
    draws = np.random.default_rng(RANDOM_SEED).integers(5, size=(RESAMPLES, 5))
    drawn = {}
    for label in ("pi", "lqr"):
        for side, sign in (("max", 1.0), ("min", -1.0)):
            loads = []
            for name, rule, factor in (("calm", "mean", 1.35), ("fault", "upper_half", 1.1)):
                own = {c.seed: e for c, e in runs if (c.name, c.controller) == (name, label)}
                values = sign * np.array([own[seed].value(MOMENT, side) for seed in sorted(own)])
                load = np.array([characteristic(values[draw], rule) for draw in draws])
                loads.append(np.where(load > 0.0, load * factor, load / factor))
            drawn[label, side] = sign * np.max(loads, axis=0)
            row = found[MOMENT, side, label]
            low, high = interval(np.array([row.factored]), drawn[label, side][:, None], 5)
            assert (row.low, row.high) == pytest.approx((low[0], high[0]), rel=1e-12)
    row = found[MOMENT, "max", "lqr"]
    gap = row.factored - found[MOMENT, "max", "pi"].factored
    low, high = interval(np.array([gap]), (drawn["lqr", "max"] - drawn["pi", "max"])[:, None], 5)
    assert (row.difference, row.difference_low, row.difference_high) == pytest.approx((gap, low[0], high[0]))
    assert row.difference_high < 0.0  # 1.5 against 2: decided
    assert np.isnan(found[MOMENT, "max", "pi"].difference)
    # unpaired, the difference would be far less certain
    assert row.difference_high - row.difference_low < 0.7 * (row.high - row.low)


def test_a_parked_run_counts_for_every_controller(runs):
    parked = [run_of(load_case("6.1", "storm", "parked", seed), 9.0) for seed in (1, 2, 3, 4)]
    found = table([*runs, *parked], columns=[MOMENT])
    assert found[MOMENT, "max", "pi"].name == found[MOMENT, "max", "lqr"].name == "storm"
    assert found[MOMENT, "max", "lqr"].difference == 0.0
    assert "parked" not in {label for _, _, label in found}


def test_fatigue_runs_have_no_part_in_the_extremes(runs):
    other = run_of(load_case("1.2", "usual", "pi", 1, analysis="fatigue", factor=1.0), 50.0)
    assert table([*runs, other], columns=[MOMENT]) == table(runs, columns=[MOMENT])


def test_the_worst_constraint_is_found(runs):
    worst = {(label, flag.name): (flag, case) for label, flag, case in flag_table(runs)}
    flag, case = worst["pi", "slack line"]
    every = [f for c, e in runs if c.controller == "pi" for f in e.flags if f.name == "slack line"]
    assert flag.value == min(f.value for f in every) and case.controller == "pi"
    flag, _ = worst["pi", "platform pitch"]
    every = [f for c, e in runs if c.controller == "pi" for f in e.flags if f.name == "platform pitch"]
    assert flag.value == max(f.value for f in every)
