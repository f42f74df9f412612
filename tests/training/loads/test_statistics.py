"""Statistics of a run: cycles, extremes, peaks and constraints, against libraries and plain twins."""

import io

import numpy as np
import pandas as pd
import pytest
import rainflow
from load_runs import SCENE, frame_of
from pCrunch import AeroelasticOutput, FatigueParams

from fowt_env.errors import InputError
from fowt_env.training.evaluation.metrics import damage_equivalent_load
from fowt_env.training.loads.statistics import (
    BINS,
    EXPONENTS,
    MOMENTS,
    MOST_PEAKS,
    PEAK_LEVEL,
    PEAK_SEPARATION,
    RunStatistics,
    cycles_of,
    direction_column,
    independent_peaks,
    rainflow_cycles,
    run_statistics,
)


@pytest.fixture(scope="module")
def frame():
    return frame_of(1)


@pytest.fixture(scope="module")
def found(frame):
    return run_statistics(frame, SCENE, 60.0)


@pytest.mark.parametrize("kind", ["smooth", "noise", "plateaus", "ramp", "two values"])
def test_cycles_are_those_of_the_library(kind):
    random = np.random.default_rng(3)
    noise = random.normal(size=4000)
    values = {
        "smooth": np.convolve(noise, np.ones(20), "valid"),
        "noise": noise,
        "plateaus": np.round(noise),
        "ramp": np.arange(50.0),
        "two values": np.array([1.0, 1.0, 2.0, 2.0, 1.0]),
    }[kind]
    theirs = np.array([cycle[:3] for cycle in rainflow.extract_cycles(values)])
    np.testing.assert_array_equal(rainflow_cycles(values), theirs)


def test_a_sinusoid_has_one_cycle_per_period_with_its_double_amplitude():
    time = np.arange(0.0, 1000.0, 0.1)
    cycles = cycles_of(7.0 + 3.0 * np.cos(2.0 * np.pi * time / 10.0))
    # 100 periods: at the crests and troughs of samples, so exact
    for exponent, total in zip(EXPONENTS, cycles.sums, strict=True):
        assert total == pytest.approx(100.0 * 6.0**exponent, rel=6e-3)  # the ends are half cycles
    assert cycles.count == pytest.approx(100.0, abs=0.6)
    # all cycles but those of the ends are in one cell: range 6, mean 7
    i, j, halves = cycles.cells[np.argmax(cycles.cells[:, 2])]
    assert i * cycles.width <= 6.0 <= (i + 1) * cycles.width + 1e-9
    assert j * cycles.mean_width <= 7.0 + 1e-9 and 7.0 - 1e-9 <= (j + 1) * cycles.mean_width
    assert halves >= 196


def test_sums_and_matrix_count_every_cycle(frame):
    values = frame["TwrBsMyt_[kN-m]"].to_numpy()
    cycles, table = cycles_of(values), rainflow_cycles(values)
    ranges, means, counts = table.T
    for exponent, total in zip(EXPONENTS, cycles.sums, strict=True):
        assert total == pytest.approx(np.sum(counts * ranges**exponent), rel=1e-12)
    assert cycles.cells[:, 2].sum() == 2.0 * counts.sum()
    naive = {}
    for size, mean, count in table:  # one by one
        cell = (min(int(size // cycles.width), BINS - 1), int(mean // cycles.mean_width))
        naive[cell] = naive.get(cell, 0) + 2 * count
    assert {(i, j): n for i, j, n in cycles.cells.tolist()} == naive
    assert ranges.max() <= BINS * cycles.width < 2.0 * ranges.max() + 1e-9


def test_damage_equivalent_loads_are_those_of_the_metrics(frame, found):
    kept = frame[frame["Time_[s]"] >= 60.0]
    for column in ("TwrBsMyt_[kN-m]", "FAIRTEN1_[kN]", "RootMxc1_[kN-m]"):
        expected = damage_equivalent_load(kept[column], found.duration, 4.0)
        total = found.cycles[column].sums[EXPONENTS.index(4)]
        assert (total / found.duration) ** 0.25 == pytest.approx(expected, rel=1e-12)


def test_moments_and_extremes_are_those_of_pcrunch(frame, found):
    kept = frame[frame["Time_[s]"] >= 60.0]
    names = [name.partition("_[")[0] for name in kept.columns]
    theirs = AeroelasticOutput(kept.to_numpy(), names)
    summary, largest = theirs.summary_stats(), theirs.extremes(stat="max")
    for column, name in zip(kept.columns[1:], names[1:], strict=True):
        for statistic in ("min", "max", "mean", "std"):
            assert found.value(column, statistic) == pytest.approx(summary[name][statistic], rel=1e-9)
        assert found.value(column, "time_max") == largest[name]["Time"]
    for column, other in (("TwrBsMyt_[kN-m]", "TwrBsFxt"), ("FAIRTEN1_[kN]", "FAIRTEN2")):
        at = found.at[column]["max"]
        full = next(name for name in at if name.startswith(other))
        assert at[full] == pytest.approx(largest[column.partition("_[")[0]][other], rel=1e-9)
        assert at[column] == found.value(column, "max")
        assert at["Wind1VelX_[m/s]"] == largest[column.partition("_[")[0]]["Wind1VelX"]


@pytest.mark.parametrize("exponent", [3, 4, 10])
def test_damage_is_that_of_pcrunch_where_its_classes_and_bins_are_exact(exponent):
    """Its 257 classes have their middles at the values, its bins at the ranges.

    The series is closed, as pCrunch counts the residue as cycles of a repeated series, and the standard as
    half cycles.
    """
    levels = np.random.default_rng(4).integers(0, 257, 4000)
    levels[[0, 1, -1]] = 256, 0, 256
    values, edges = 10.0 * levels, 10.0 * (np.arange(258) - 0.5)
    theirs = FatigueParams(slope=float(exponent), bins=edges).compute_del(values, 600.0)
    ours = (cycles_of(values).sums[EXPONENTS.index(exponent)] / 600.0) ** (1.0 / exponent)
    assert ours == pytest.approx(theirs, rel=1e-9)


def test_damage_is_near_that_of_pcrunch_which_bins(frame, found):
    """By default pCrunch counts with 256 classes and 100 bins: no reference to more than a per cent."""
    kept = frame[frame["Time_[s]"] >= 60.0]["TwrBsMyt_[kN-m]"].to_numpy()
    theirs = FatigueParams(slope=4.0, ultimate_stress=1e9).compute_del(kept, found.duration)
    ours = (found.cycles["TwrBsMyt_[kN-m]"].sums[EXPONENTS.index(4)] / found.duration) ** 0.25
    assert ours == pytest.approx(theirs, rel=0.02)


def test_moments_in_a_direction_are_projections(frame, found):
    kept = frame[frame["Time_[s]"] >= 60.0]
    x, y = kept["TwrBsMxt_[kN-m]"].to_numpy(), kept["TwrBsMyt_[kN-m]"].to_numpy()
    values = np.cos(np.radians(30.0)) * x + np.sin(np.radians(30.0)) * y
    column = direction_column(("TwrBsMxt", "TwrBsMyt"), 30)
    assert found.value(column, "max") == pytest.approx(values.max(), rel=1e-12)
    assert found.value(column, "time_min") == kept["Time_[s]"].to_numpy()[values.argmin()]
    assert found.at[column]["max"]["TwrBsMxt_[kN-m]"] == x[values.argmax()]
    assert found.cycles[column].sums == pytest.approx(cycles_of(values).sums, rel=1e-12)
    assert found.value("TwrBsMxyt_[kN-m]", "max") == pytest.approx(np.hypot(x, y).max(), rel=1e-12)


def test_peaks_are_those_of_a_plain_search():
    random = np.random.default_rng(8)
    time = 0.1 * np.arange(30_000)
    values = np.convolve(random.normal(size=30_040), np.hanning(41), "valid")[:30_000]
    level, found, k = values.mean() + PEAK_LEVEL * values.std(), [], 0
    while k < len(values):  # the largest value of each stretch from an upcrossing to the next
        if values[k] > level and (k == 0 or values[k - 1] <= level):
            end = k + 1
            while end < len(values) and not (values[end] > level and values[end - 1] <= level):
                end += 1
            top = k + int(np.argmax(values[k:end]))
            found.append((values[top], time[top]))
            k = end
        else:
            k += 1
    kept = []
    for value, when in sorted(found, reverse=True):
        if all(abs(when - other) >= PEAK_SEPARATION for _, other in kept):
            kept.append((value, when))
    peaks, count = independent_peaks(time, values)
    assert count == len(kept) > MOST_PEAKS
    expected = sorted(kept[:MOST_PEAKS], key=lambda pair: pair[1])
    np.testing.assert_array_equal(peaks, [value for value, _ in expected])
    assert independent_peaks(time, np.ones_like(time)) == (pytest.approx([]), 0)


def test_peaks_of_the_least_values_have_their_sign(frame, found):
    values = frame[frame["Time_[s]"] >= 60.0]["TwrBsMyt_[kN-m]"]
    low, high = found.peaks["TwrBsMyt_[kN-m]"]["min"][0], found.peaks["TwrBsMyt_[kN-m]"]["max"][0]
    assert low.min() == values.min() and high.max() == values.max()


def test_constraints_name_the_worst_value_and_its_time():
    time = 0.1 * np.arange(1001)
    bump = np.exp(-(((time - 40.0) / 2.0) ** 2))
    zero = np.zeros_like(time)
    frame = frame_of(
        1, 100.0, **{
            "RotSpeed_[rpm]": 12.1 * (1.0 + 0.25 * bump), "PtfmPitch_[deg]": 6.0 * bump,
            "PtfmRoll_[deg]": zero, "PtfmHeave_[m]": zero, "Wave1Elev_[m]": 11.0 * bump,
            "PtfmSurge_[m]": 30.0 * bump, "PtfmSway_[m]": 40.0 * bump, "FAIRTEN1_[kN]": 900.0 * (1.0 - bump),
            "FAIRTEN2_[kN]": 800.0 + zero,
        },
    )  # fmt: skip
    flags = {flag.name: flag for flag in run_statistics(frame, SCENE, 0.0, {"offset": 45.0}).flags}
    assert flags["overspeed"].value == pytest.approx(1.25) and flags["overspeed"].exceeded
    assert flags["overspeed"].time == pytest.approx(40.0)
    assert flags["platform pitch"].value == pytest.approx(6.0) and not flags["platform pitch"].exceeded
    # deck 10 m at the tower, tilted by 6 deg, less a crest of 11 m
    assert flags["air gap"].value == pytest.approx(10.0 * np.cos(np.radians(6.0)) - 11.0)
    assert flags["air gap"].exceeded
    assert flags["offset"].value == pytest.approx(50.0) and flags["offset"].exceeded
    assert flags["line tension"].value == pytest.approx(900.0) and not flags["line tension"].exceeded
    assert flags["slack line"].value == pytest.approx(0.0, abs=1e-9) and flags["slack line"].exceeded


def test_a_line_that_broke_is_not_slack():
    time = 0.1 * np.arange(1001)
    broken = {"FAIRTEN1_[kN]": np.where(time < 50.0, 900.0, 0.0), "FAIRTEN2_[kN]": 800.0 + np.sin(time)}
    flags = {flag.name: flag for flag in run_statistics(frame_of(1, 100.0, **broken), SCENE, 0.0).flags}
    assert flags["slack line"].value == pytest.approx(799.0 / 800.0, rel=1e-3)
    lost = {"FAIRTEN1_[kN]": np.zeros_like(time), "FAIRTEN2_[kN]": np.zeros_like(time)}
    flags = {flag.name: flag for flag in run_statistics(frame_of(1, 100.0, **lost), SCENE, 0.0).flags}
    assert "slack line" not in flags and flags["line tension"].value == 0.0


def test_stored_statistics_are_the_same_and_small(found, tmp_path):
    found.save(tmp_path / "run.npz")
    again = RunStatistics.load(tmp_path / "run.npz")
    assert again.channels == found.channels and again.flags == found.flags
    assert (again.duration, again.start) == (found.duration, found.start)
    for name in MOMENTS:
        np.testing.assert_array_equal(getattr(again, name), getattr(found, name))
    assert again.at == found.at
    for name, cycles in found.cycles.items():
        np.testing.assert_array_equal(again.cycles[name].sums, cycles.sums)
        np.testing.assert_array_equal(again.cycles[name].cells, cycles.cells)
        assert again.cycles[name].width == cycles.width
    for name, sides in found.peaks.items():
        for side, (values, count) in sides.items():
            assert again.peaks[name][side][1] == count
            np.testing.assert_allclose(again.peaks[name][side][0], values, rtol=1e-7)
    assert (tmp_path / "run.npz").stat().st_size < 60_000


def test_another_file_is_refused():
    with pytest.raises(InputError, match="not the statistics of a run"):
        RunStatistics.load(io.BytesIO(b"x"))
    file = io.BytesIO()
    np.savez(file, about=np.array("{}"))
    file.seek(0)
    with pytest.raises(InputError, match="not the statistics of a run"):
        RunStatistics.load(file)


def test_wrong_input_is_named(frame):
    with pytest.raises(InputError, match="unknown constraint 'ovrspeed'; known are overspeed"):
        run_statistics(frame, SCENE, 0.0, {"ovrspeed": 1.0})
    with pytest.raises(InputError, match="skip = 400 s leaves 0 rows"):
        run_statistics(frame, SCENE, 400.0)
    with pytest.raises(InputError, match="channel PtfmYaw_\\[deg\\] has values that are not finite"):
        run_statistics(frame.assign(**{"PtfmYaw_[deg]": np.nan}), SCENE, 0.0)
    with pytest.raises(InputError, match="first column must be Time"):
        run_statistics(pd.DataFrame({"x": [1.0, 2.0]}), SCENE, 0.0)
