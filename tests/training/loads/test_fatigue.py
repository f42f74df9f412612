"""Lifetime fatigue: equivalent loads, Markov matrices and damage, against closed forms and fatpack."""

import fatpack
import numpy as np
import pytest
from load_runs import HOURS, frame_of, load_case, run_of

from fowt_env.errors import InputError
from fowt_env.training.loads.fatigue import SNCurve, damage, goodman, lifetime_table, markov_matrix
from fowt_env.training.loads.statistics import rainflow_cycles

MOMENT = "TwrBsMyt_[kN-m]"
FATIGUE = {"analysis": "fatigue", "safety": "fatigue", "factor": 1.0}
TIME = 0.1 * np.arange(round(3600.0 * HOURS / 0.1) + 1)


def sinusoid(amplitude, period=10.0, mean=0.0):
    """Return the column of the moment as a cosine."""
    return {MOMENT: mean + amplitude * np.cos(2.0 * np.pi * TIME / period)}


def of(runs, exponent=4, **options):
    """Return {controller: LifetimeLoad} of the moment."""
    rows = lifetime_table(runs, (exponent,), **options)
    return {row.controller: row for row in rows if row.column == MOMENT}


def test_a_sinusoid_over_the_whole_life_has_its_closed_form():
    run = run_of(load_case("1.2", "u8", hours_per_year=8766.0, **FATIGUE), **sinusoid(50.0))
    for exponent in (3, 4, 10):
        found = of([run], exponent, years=20.0, reference_cycles=1e7)["pi"]
        cycles = 20.0 * 8766.0 * 3600.0 / 10.0  # 36 cycles of 10 s in each run
        assert found.value == pytest.approx(100.0 * (cycles / 1e7) ** (1.0 / exponent), rel=1e-9)


def test_conditions_add_their_damage_by_their_hours():
    runs = [
        run_of(load_case("1.2", "u8", hours_per_year=6000.0, **FATIGUE), **sinusoid(10.0)),
        run_of(load_case("1.2", "u16", hours_per_year=2000.0, **FATIGUE), **sinusoid(30.0, 8.0)),
        run_of(load_case("2.4", "fault", hours_per_year=5.0, **FATIGUE), **sinusoid(90.0, 12.0)),
        run_of(load_case("1.3", "etm", hours_per_year=0.0), **sinusoid(500.0)),
        run_of(load_case("1.1", "u8", hours_per_year=6000.0), **sinusoid(500.0)),  # ultimate
    ]
    parts = {
        "1.2": 6000.0 * 360.0 * 20.0**4 + 2000.0 * 450.0 * 60.0**4,
        "2.4": 5.0 * 300.0 * 180.0**4,
    }
    found = of(runs, years=25.0, reference_cycles=1e7)["pi"]
    assert found.value == pytest.approx((25.0 * sum(parts.values()) / 1e7) ** 0.25, rel=1e-9)
    assert dict(found.share) == pytest.approx(
        {k: v / sum(parts.values()) for k, v in parts.items()}, rel=1e-9
    )


def test_the_ratio_of_controllers_is_paired():
    runs = []
    for seed in range(1, 7):
        for label, factor in (("pi", 1.0), ("lqr", 0.8)):
            case = load_case("1.2", "u8", label, seed, hours_per_year=1000.0, **FATIGUE)
            runs.append(run_of(case, factor * seed))  # seeds differ far more than the controllers
    found = of(runs, baseline="pi")
    assert found["lqr"].ratio == pytest.approx(0.8, rel=1e-9)
    # every seed has the same ratio, so the interval has no width, though that of the load is wide
    assert found["lqr"].ratio_low == pytest.approx(0.8, rel=1e-9)
    assert found["lqr"].ratio_high == pytest.approx(0.8, rel=1e-9)
    assert found["lqr"].high > 1.2 * found["lqr"].low
    assert np.isnan(found["pi"].ratio)


def test_a_markov_matrix_has_every_cycle_of_the_life():
    runs = [
        run_of(load_case("1.2", "u8", hours_per_year=100.0, **FATIGUE)),
        run_of(load_case("1.2", "u16", seed=2, hours_per_year=300.0, **FATIGUE), 7.0),
    ]
    matrix = markov_matrix(runs, MOMENT, years=10.0)
    total = sum(10.0 * case.hours_per_year / HOURS * each.cycles[MOMENT].count for case, each in runs)
    assert matrix.cycles.sum() == pytest.approx(total, rel=1e-12)
    # bins of the calmer run are joined to those of the other: its cycles stay below its largest range
    single = markov_matrix(runs[:1], MOMENT, years=10.0)
    assert single.range_edges[1] < matrix.range_edges[1]
    naive = np.zeros_like(matrix.cycles)
    for (case, _), scale in zip(runs, (1.0, 7.0), strict=True):
        values = frame_of(case.seed, scale=scale)[MOMENT].to_numpy()
        for size, mean, count in rainflow_cycles(values):
            i = min(int(size // matrix.range_edges[1]), len(naive) - 1)
            j = np.searchsorted(matrix.mean_edges, mean, side="right") - 1
            naive[i, j] += 10.0 * case.hours_per_year / HOURS * count
    np.testing.assert_allclose(matrix.cycles, naive, rtol=1e-9)
    with pytest.raises(InputError, match="no fatigue run has its rainflow matrix"):
        markov_matrix(runs, "PtfmPitch_[deg]")


def test_curves_are_those_of_fatpack():
    """Curve D in air of DNV-RP-C203, as pCrunch has it."""
    theirs = fatpack.BiLinearEnduranceCurve(1.0)
    theirs.Nc, theirs.Nd, theirs.m1, theirs.m2 = 10.0**12.164, 1e7, 3.0, 5.0
    ours = SNCurve(3.0, 12.164, 5.0, 1e7)
    stress = np.array([5.0, 20.0, 52.0, 53.0, 80.0, 200.0])
    np.testing.assert_allclose(ours.cycles(stress), theirs.get_endurance(stress), rtol=1e-9)
    linear = fatpack.LinearEnduranceCurve(1.0)
    linear.m, linear.Nc = 4.0, 1e15
    np.testing.assert_allclose(SNCurve(4.0, 15.0).cycles(stress), linear.get_endurance(stress), rtol=1e-9)


def test_the_goodman_correction_is_that_of_fatpack():
    ranges, means = np.array([10.0, 20.0, 5.0]), np.array([30.0, 0.0, 60.0])
    theirs = fatpack.find_goodman_equivalent_stress(ranges, means, 100.0)
    np.testing.assert_allclose(goodman(ranges, means, 100.0), theirs, rtol=1e-12)
    np.testing.assert_array_equal(goodman(ranges, -means, 100.0), goodman(ranges, means, 100.0))
    with pytest.raises(InputError, match="mean load 60 is not below the ultimate load 50"):
        goodman(ranges, means, 50.0)


@pytest.mark.parametrize("ultimate", [None, 400.0])
def test_damage_is_near_that_of_every_cycle(ultimate):
    curve = SNCurve(4.0, 15.0)
    case = load_case("1.2", "u8", hours_per_year=8766.0, **FATIGUE)
    run = run_of(case, 20.0)
    ranges, means, counts = rainflow_cycles(frame_of(1, scale=20.0)[MOMENT].to_numpy()).T
    effective = ranges if ultimate is None else goodman(ranges, means, ultimate)
    expected = 25.0 * 8766.0 / HOURS * np.sum(counts / curve.cycles(0.05 * effective))
    # without correction the sums are exact; with it only the bins of the mean matter
    tolerance = 1e-9 if ultimate is None else 2e-3
    assert damage([run], MOMENT, curve, 0.05, ultimate) == pytest.approx(expected, rel=tolerance)
    assert damage([run], MOMENT, curve, 0.05, 400.0) > damage([run], MOMENT, curve, 0.05)


def test_wrong_settings_are_named():
    run = run_of(load_case("1.2", "u8", hours_per_year=1.0, **FATIGUE))
    with pytest.raises(InputError, match="exponent m = 5: must be one of 3, 4, 6, 8, 10, 12"):
        lifetime_table([run], (5,))
    with pytest.raises(InputError, match="years"):
        lifetime_table([run], (4,), years=0.0)
    assert lifetime_table([run_of(load_case())], (4,)) == []
