"""Difference-frequency forces of a sea: the quadratic form against the double sum, and OpenFAST."""

from dataclasses import replace

import numpy as np
import pytest
from naive import excitation as naive
from potential_body import made_up_body, reference, sea_of, volturnus

from fowt_env.errors import InputError, PlantWarning
from fowt_env.plant.hydro.excitation import add_second_order
from fowt_env.plant.state import NO_LOAD
from fowt_env.training.validation.openfast_cases import wave_components
from fowt_env.weather.second_order import build_second_order

BODY = made_up_body()
HARMONIC = {
    "kind": "components",
    "omega": [0.4, 0.6, 0.9, 1.3],
    "amplitude": [0.5, 1.0, 0.4, 0.2],
    "phase": [0.1, 2.0, 4.0, 1.0],
}
TWO_HEADINGS = HARMONIC | {"heading": [60.0, 0.0, 60.0, 0.0]}
UNEVEN = HARMONIC | {"omega": [0.4, 0.6123, 0.94, 1.3371]}
TIMES = np.linspace(0.0, 97.0, 41)


def forces(second, times=TIMES):
    return np.array([add_second_order(t, NO_LOAD, second) for t in times])


def built(sea, method, body=BODY, **given):
    return build_second_order(body, sea_of(sea), method, duration=100.0, **given)


def assert_close(ours, expected, tolerance):
    error = np.sqrt(((ours - expected) ** 2).mean(axis=0))
    assert (error < tolerance * np.abs(expected).max(axis=0)).all(), error / np.abs(expected).max(axis=0)


@pytest.mark.installation
def test_full_forces_are_openfasts_to_2e5_of_their_deviation():
    found = reference()
    sea = sea_of(wave_components())
    second = build_second_order(volturnus(), sea, "full", duration=600.0, cutoff=0.737863)
    there = found[["second_order_Fx_N", "second_order_My_Nm"]].to_numpy()
    ours = forces(second, found["time_s"].to_numpy())[:, [0, 4]]
    error = np.sqrt(((ours - there) ** 2).mean(axis=0)) / there.std(axis=0)
    assert (error < 2e-5).all(), error


@pytest.mark.parametrize("sea", [HARMONIC, TWO_HEADINGS], ids=["one heading", "two headings"])
def test_full_forces_are_the_sum_over_all_pairs(sea):
    second = built(sea, "full")
    body = BODY
    if sea is TWO_HEADINGS:  # the twin takes pairs of headings as they are: give it (60, 0) too
        qtf = BODY.difference_qtf
        crossed = np.conj(qtf.value[1].transpose(1, 0, 2))
        qtf = replace(
            qtf,
            heading=np.vstack([qtf.heading, qtf.heading[1, ::-1]]),
            value=np.concatenate([qtf.value, crossed[None]]),
        )
        body = replace(BODY, difference_qtf=qtf)
    pairs = naive.difference_pairs(body, sea_of(sea))
    assert_close(forces(second), [naive.second_order(t, pairs) for t in TIMES], 1e-5)
    assert second.table.periodic and second.table.span == pytest.approx(20.0 * np.pi)


@pytest.mark.parametrize(
    ("sea", "span", "tolerance"),
    [(HARMONIC, 20.0 * np.pi, 2e-5), (TWO_HEADINGS, 20.0 * np.pi, 2e-5), (UNEVEN, None, 1e-3)],
    ids=["one heading", "two headings", "uneven"],
)
def test_sum_forces_are_added_over_all_pairs(sea, span, tolerance):
    """With the phases of both waves and no conjugate: the double sum of HydroDyn's SumQTF."""
    body = BODY
    if sea is TWO_HEADINGS:  # the twin takes pairs of headings as they are: give it (60, 0) too
        qtf = BODY.sum_qtf
        heading = np.vstack([qtf.heading, qtf.heading[1, ::-1]])
        value = np.concatenate([qtf.value, qtf.value[1].transpose(1, 0, 2)[None]])
        body = replace(BODY, sum_qtf=replace(qtf, heading=heading, value=value))
    both = built(sea, "full_sum", cutoff=0.5 if sea is HARMONIC else None)
    pairs = naive.sum_pairs(body, sea_of(sea))
    differences = forces(built(sea, "full", cutoff=0.5 if sea is HARMONIC else None))
    expected = [naive.second_order(t, pairs) for t in TIMES]
    assert_close(forces(both) - differences, expected, tolerance)
    assert both.table.periodic == (span is not None)
    if span is not None:
        assert both.table.span == pytest.approx(span)
    np.testing.assert_array_equal(both.mean, built(sea, "mean_drift").mean)


def test_frequencies_that_are_not_evenly_spaced_make_the_same_sum_and_beyond_the_table_its_mean():
    second = built(UNEVEN, "full")
    pairs = naive.difference_pairs(BODY, sea_of(UNEVEN))
    assert_close(forces(second), [naive.second_order(t, pairs) for t in TIMES], 3e-4)
    assert not second.table.periodic
    beyond = forces(second, [second.table.span + 1.0])[0]
    assert np.allclose(beyond, sum(value.real for omega, value in pairs if omega == 0.0), rtol=1e-9)


def test_a_random_sea_repeats_its_forces_with_the_period_of_the_differences():
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 12.0}
    second = built(sea, "full")
    waves = sea_of(sea)
    assert second.table.span == pytest.approx(2.0 * np.pi / np.diff(waves.omega).mean(), rel=1e-9)
    a, b = forces(second), forces(second, TIMES + 3.0 * second.table.span)
    assert np.allclose(a, b, rtol=1e-6, atol=1e-6 * np.abs(a).max())


def test_differences_above_the_cutoff_make_no_force():
    pairs = naive.difference_pairs(BODY, sea_of(HARMONIC))
    ours = forces(built(HARMONIC, "full", cutoff=0.45))
    assert_close(ours, [naive.second_order(t, pairs, cutoff=0.45) for t in TIMES], 1e-5)
    with pytest.raises(InputError, match="second_order_cutoff = 0.45 rad/s: needs a sea of evenly spaced"):
        built(UNEVEN, "full", cutoff=0.45)
    assert np.array_equal(forces(built(UNEVEN, "full", cutoff=2.0)), forces(built(UNEVEN, "full")))


@pytest.mark.parametrize("sea", [HARMONIC, TWO_HEADINGS], ids=["one heading", "two headings"])
def test_newman_takes_the_roots_of_the_diagonal_heading_by_heading(sea):
    pairs = naive.newman_pairs(BODY, sea_of(sea))
    signs = {np.sign(value.real[0]) for omega, value in pairs if omega == 0.0}
    assert signs == {-1.0, 1.0}  # both occur
    assert_close(forces(built(sea, "newman")), [naive.second_order(t, pairs) for t in TIMES], 1e-5)


@pytest.mark.parametrize("method", ["newman", "full"])
def test_the_mean_drift_is_the_mean_of_each_method(method):
    steady = built(HARMONIC, "mean_drift")
    assert np.ptp(forces(steady), axis=0).max() < 1e-9 * np.abs(steady.mean).max()
    second = built(HARMONIC, method)
    times = np.arange(400) * second.table.span / 400
    assert np.allclose(forces(second, times).mean(axis=0), steady.mean, rtol=1e-6)
    assert np.allclose(forces(steady)[0], steady.mean, rtol=1e-12)


def test_pairs_that_a_file_leaves_out_are_the_conjugates_of_those_that_it_has():
    qtf = made_up_body().difference_qtf
    value = qtf.value.copy()
    value[:, *np.tril_indices(24, -1)] = np.nan
    half = replace(BODY, difference_qtf=replace(qtf, value=value))
    assert np.array_equal(forces(built(HARMONIC, "full", body=half)), forces(built(HARMONIC, "full")))
    value[:, 2, 4] = np.nan
    holed = replace(BODY, difference_qtf=replace(qtf, value=value))
    with pytest.raises(InputError, match="lacks pairs of frequencies"):
        built(HARMONIC, "full", body=holed)
    diagonal = np.where(np.eye(24, dtype=bool)[None, :, :, None], qtf.value, np.nan)
    alone = replace(BODY, difference_qtf=replace(qtf, value=diagonal))
    assert np.allclose(
        built(HARMONIC, "mean_drift", body=alone).mean, built(HARMONIC, "mean_drift").mean, rtol=0.05
    )


def test_headings_that_the_qtf_lacks_are_refused():
    with pytest.raises(InputError, match=r"no pair of headings \(45, 45\) deg; it has \(0, 0\), \(0, 60\)"):
        built(HARMONIC | {"heading": 45.0}, "full")
    built(HARMONIC | {"heading": 360.0}, "full")


def test_energy_beyond_the_qtf_makes_no_force_and_is_warned_of():
    wide = HARMONIC | {"omega": [0.15, 0.6, 0.9, 2.7]}
    narrow = HARMONIC | {"amplitude": [0.0, 1.0, 0.4, 0.0]}
    with pytest.warns(PlantWarning, match=r"20 % of its energy lies outside .* 0\.2 to 2\.5 rad/s"):
        second = built(wide, "full")
    assert np.allclose(forces(second), forces(built(narrow, "full")), rtol=1e-4, atol=1e-2)
    with pytest.warns(PlantWarning, match="100 %"):
        assert not forces(built({"kind": "regular", "H": 2.0, "T": 60.0}, "full")).any()


def test_none_is_asked_for_by_two_names():
    assert built(HARMONIC, None) is None and built(HARMONIC, "none") is None
