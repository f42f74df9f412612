"""Hours of a site: limits and values of known distributions, weights of strata, and folders."""

from dataclasses import replace
from math import nan

import numpy as np
import pandas as pd
import pytest
from scipy.stats import gumbel_r

from fowt_env.errors import InputError
from fowt_env.training.cli.century import cells
from fowt_env.training.loads import century as module
from fowt_env.training.loads.century import (
    BLOCK,
    DEFENCE,
    STATE,
    Century,
    Sample,
    coverage_remarks,
    coverage_text,
    read_sample,
    return_level,
    run_century,
    tail_shares,
)
from fowt_env.training.loads.site import YEAR, read_site

CENTURY = Century("oc3_hywind", read_site("northern_north_sea"), "pi", sensors="exact")
WEEK = 7.0 / 365.25  # of years
YEARS = 100.0 / YEAR / CENTURY.production  # once in a hundred hours of production


def sample_of(values, weight=None, states=None):
    n = len(values)
    weight = np.ones(n) if weight is None else weight
    states = {key: np.zeros(n) for key in STATE} if states is None else states
    high = np.array(values)[:, None]
    return Sample(("load",), -high, high, weight, np.zeros(n, dtype=int), states, CENTURY.production, 0, 0)


def test_a_value_is_the_order_statistic_of_its_rate_and_its_limits_are_exact_for_poisson_counts():
    values = np.random.default_rng(1).permutation(np.arange(1000.0))
    level = return_level(sample_of(values), "load", "max", YEARS)
    assert level.value == 990.0 and level.exceedances == pytest.approx(10.0)
    # 10 are expected: 18 at or beyond a load are surely more, and 3 beyond it surely less (chi-square limits)
    assert (level.low, level.high) == (982.0, 996.0)
    lower = return_level(sample_of(values), "load", "min", YEARS)
    assert (lower.value, lower.low, lower.high) == (-990.0, -996.0, -982.0)
    short = return_level(sample_of(values[:50]), "load", "max", YEARS)
    assert np.isnan(short.value) and np.isnan(short.high)
    # three more hours than the value's are not enough to exclude loads beyond all of them
    assert np.isnan(return_level(sample_of(values[:300]), "load", "max", YEARS).high)
    with pytest.raises(InputError, match="years = 0"):
        return_level(sample_of(values), "load", "max", 0.0)


@pytest.mark.parametrize("weighted", [False, True])
def test_the_interval_covers_the_value_of_a_known_distribution(weighted):
    """Half of the time in calm, half in storm, whose loads are larger; drawn alike, or 1 to 9."""
    random, covered, estimates = np.random.default_rng(4), 0, []
    share = np.array([0.1, 0.9]) if weighted else np.array([0.5, 0.5])
    level = np.linspace(0.0, 30.0, 30001)
    beyond = 0.5 * gumbel_r.sf(level) + 0.5 * gumbel_r.sf(level, 3.0, 2.0)
    truth = level[np.argmax(beyond < 0.01)]
    for _ in range(300):
        storm = random.random(1500) < share[1]
        values = np.where(storm, random.gumbel(3.0, 2.0, 1500), random.gumbel(0.0, 1.0, 1500))
        weight = 0.5 / share[storm.astype(int)]
        found = return_level(sample_of(values, weight), "load", "max", YEARS)
        covered += found.low <= truth <= found.high
        estimates.append(found.value)
    assert covered / 300 == pytest.approx(0.955, abs=0.035)  # of 95 %, three deviations of 300 draws
    assert np.mean(estimates) == pytest.approx(truth, rel=0.01)


@pytest.mark.nightly
def test_shares_of_a_stage_follow_the_states_that_matter_and_reduce_the_error():
    """A load that follows the sea: most of the hours of its 1-year value are of high Hs."""
    century, random = CENTURY, np.random.default_rng(7)
    p = century.probabilities
    assert p.sum() == pytest.approx(1.0) and p.min() > 0.0

    def drawn(share, stage, count):
        states = [century.state(share, stage, number) for number in range(count)]
        found = {key: np.array([state[key] for state, *_ in states]) for key in STATE}
        stratum = np.array([each[1] for each in states])
        load = found["Hs"] * (1.0 + 0.1 * random.gumbel(size=count)) + 0.02 * found["wind"]
        return load, stratum, found

    load, stratum, states = drawn(p, 0, 400)
    pilot = sample_of(load, states=states)
    share = tail_shares(pilot, century, 1.0)
    assert share.sum() == pytest.approx(1.0) and (share >= DEFENCE * p - 1e-12).all()
    rough = np.arange(len(p)) % 6 >= 4  # the highest percent of Hs
    assert p[rough].sum() == pytest.approx(0.01) and share[rough].sum() > 0.08
    load, stratum, states = drawn(share, 1, 2000)
    weight = (p / share)[stratum]
    assert weight.mean() == pytest.approx(1.0, abs=0.05) and weight.max() <= 1.0 / DEFENCE + 1e-9
    plain = drawn(p, 2, 2000)[2]["Hs"].mean()
    assert np.average(states["Hs"], weights=weight) == pytest.approx(plain, rel=0.05)
    # the same number of hours, 15 times: spread of the value of a week
    share = tail_shares(pilot, century, WEEK)
    values = {}
    for name, shares in (("plain", p), ("importance", share)):
        values[name] = []
        for stage in range(15):
            load, stratum, _ = drawn(shares, 10 + stage, 300)
            weight = (p / shares)[stratum]
            values[name].append(return_level(sample_of(load, weight), "load", "max", WEEK).value)
    spread = {name: np.nanstd(each) for name, each in values.items()}
    assert spread["importance"] < 0.7 * spread["plain"]
    assert np.mean(values["importance"]) == pytest.approx(np.nanmean(values["plain"]), rel=0.05)
    with pytest.raises(InputError, match="30 hours so far"):
        tail_shares(sample_of(load[:30]), century, 1.0)


@pytest.fixture
def quick(monkeypatch):
    """Hours whose load is Hs, without a simulation; counted."""
    calls = []

    def scored(run, measure):
        calls.append(run)
        height = run.case.sea["Hs"]
        if run.seed % 10 == 0:
            return {"status": "failed"}, None
        status = "tripped" if run.seed % 10 == 1 else "ok"
        stop = 1e3 if status == "tripped" else 0.0
        ends = {"low": np.array([-height - stop]), "high": np.array([height + stop])}
        return {"status": status, "columns": ["load"], **ends}, None

    monkeypatch.setattr(module, "scored", scored)
    return calls


def test_a_sample_is_resumed_extended_and_weighted_over_its_stages(tmp_path, quick):
    sample, _, hours = run_century(CENTURY, tmp_path, [(90, None)])
    assert hours == 90 == len(quick) and sample.hours + sample.lost + sample.tripped == 90
    assert 0 < sample.lost < 30 and 0 < sample.tripped < 30
    np.testing.assert_allclose(sample.weight, 1.0)
    np.testing.assert_array_equal(sample.high[:, 0], sample.states["Hs"].astype(np.float32))
    (tmp_path / "hours" / "0_00001.npz").unlink()  # as if interrupted
    again, _, hours = run_century(CENTURY, tmp_path, [(90, None)])
    assert hours == BLOCK
    np.testing.assert_array_equal(again.high, sample.high)
    more, _, hours = run_century(CENTURY, tmp_path, [(100, None), (60, 1.0)])
    assert hours == 20 + 60  # the last block of the first stage was not full
    assert more.hours + more.lost + more.tripped == 160
    assert more.weight.min() < 0.9 and more.weight.mean() == pytest.approx(1.0, abs=0.2)
    assert np.average(more.states["Hs"] > 8.0) > np.average(sample.states["Hs"] > 8.0)
    with pytest.raises(InputError, match="1 has 100 hours of plain sampling, which cannot become 50"):
        run_century(CENTURY, tmp_path, [(50, None)])
    other = Century("oc3_hywind", CENTURY.site, "pi", sensors="exact", seed=2)
    with pytest.raises(InputError, match="was made with another seed"):
        run_century(other, tmp_path, [(100, None)])
    with pytest.raises(InputError, match="has no hours yet"):
        read_sample(CENTURY, tmp_path / "empty")


def test_a_sample_whose_first_hours_fail_is_refused_with_the_reason(monkeypatch):
    failed = {"status": "failed", "reason": "no gain"}
    monkeypatch.setattr(module, "scored", lambda run, measure: (failed, None))
    with pytest.raises(InputError, match="century with 'pi': its first hours fail: no gain"):
        module.seconds_per_hour(CENTURY)


def test_extremes_are_those_after_the_transient_with_magnitudes_of_their_largest_value_alone():
    frame = pd.DataFrame(
        {
            "Time_[s]": [0.0, 1.0, 2.0, 3.0],
            "PtfmPitch_[deg]": [9.0, 3.0, 4.0, -3.0],
            "PtfmRoll_[deg]": [-9.0, 4.0, 0.0, 0.0],
            "GenPwr_[kW]": [1.0, 1.0, 1.0, 1.0],
        }
    )
    found = module._extremes(frame, None, None, 1.0)
    assert found["columns"] == ["PtfmPitch", "PtfmRoll", "PtfmTilt"]
    assert found["low"].tolist() == [-3.0, 0.0, 3.0] and found["high"].tolist() == [4.0, 4.0, 5.0]
    sample = replace(sample_of(np.arange(10.0)), columns=tuple(found["columns"]))
    assert [side for column, side in sample.sides if column == "PtfmRoll"] == ["max", "min"]
    assert list(sample.sides)[-1] == ("PtfmTilt", "max")


def test_an_hour_is_a_run_of_its_state(tmp_path):
    block = module.Block(CENTURY, 0, tuple(CENTURY.probabilities), 3, 1)
    found = module.simulated(block)
    state, stratum, seed = CENTURY.state(CENTURY.probabilities, 0, 3)
    assert found["status"].tolist() == ["ok"] and found["stratum"].tolist() == [stratum]
    import fowt_env

    skip = CENTURY.site.design.transient
    scene = fowt_env.build_scene(
        "oc3_hywind", wind={"kind": "ntm", "speed": state["wind"], "class": "B"},
        sea={"kind": "jonswap", "Hs": state["Hs"], "Tp": state["Tp"], "heading": state["misalignment"]},
        seed=seed, duration=skip + 3600.0, fidelity="standard", shear_exponent=CENTURY.site.shear_exponent,
    )  # fmt: skip
    frame = fowt_env.simulate(scene, "pi", duration=skip + 3600.0)
    counted = frame[frame["Time_[s]"] >= skip - 1e-9]
    columns = found["columns"].tolist()
    assert found["high"][0, columns.index("PtfmPitch")] == np.float32(counted["PtfmPitch_[deg]"].max())
    assert found["low"][0, columns.index("TwrBsMyt")] == np.float32(counted["TwrBsMyt_[kN-m]"].min())
    tilt = np.hypot(counted["PtfmPitch_[deg]"], counted["PtfmRoll_[deg]"]).max()
    assert found["high"][0, columns.index("PtfmTilt")] == np.float32(tilt)


def test_the_page_names_the_values_that_the_extrapolation_does_not_cover(tmp_path):
    rows = [
        ("TwrBsMyt", "max", 50.0, True, 8.0, 9.0, 7.0, 9.0),
        ("RotThrust", "min", 50.0, False, -3.0, -2.0, -5.0, -4.0),
        ("RotThrust", "max", 50.0, False, 3.0, nan, 4.0, 5.0),
        ("PtfmRoll", "max", 50.0, False, 1.0, 3.0, 4.0, 5.0),
        ("PtfmYaw", "max", 50.0, None, nan, nan, 4.0, 5.0),
    ]
    limits = ["low", "high", "extrapolated_low", "extrapolated_high"]
    table = pd.DataFrame(rows, columns=["load", "side", "years", "covered", *limits])
    words = (
        "the interval of the extrapolation covers 1 of 4 sampled values; not: RotThrust min, RotThrust max,"
        " PtfmRoll max (within the limits of the sample: RotThrust max)"
    )
    assert coverage_text(table) == words
    assert coverage_text(table[:1]).endswith("1 of 1 sampled values; not: none")
    assert coverage_text(table[4:]) == ""
    (tmp_path / "century" / "pi").mkdir(parents=True)
    table.to_csv(tmp_path / "century" / "pi" / "century.csv", index=False)
    assert coverage_remarks(tmp_path, ("pi", "lqr")) == (f"pi, once in 50 years: {words}",)


def test_a_limit_that_the_hours_do_not_give_is_a_dash_in_the_printed_table():
    assert cells(pd.DataFrame({"load": ["RotThrust"], "low": [np.nan], "high": [1.5]})) == [
        ["RotThrust", "–", 1.5]
    ]
