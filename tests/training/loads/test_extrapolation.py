"""Long-term loads against distributions whose 50-year value is known, and inverse FORM in closed form."""

from dataclasses import replace
from math import exp, expm1, log

import numpy as np
import pytest
from load_runs import SCENE, load_case, run_of
from scipy.optimize import brentq
from scipy.stats import norm

from fowt_env.errors import InputError
from fowt_env.training.loads.extrapolation import (
    Condition,
    block_maxima,
    conditions_of_runs,
    environmental_contour,
    extrapolate,
    form_load,
    gumbel_fit,
    inverse_form,
    reliability_index,
    sphere,
    states_of,
)
from fowt_env.training.loads.site import YEAR, climate_of, read_site
from fowt_env.training.studies import long_term_seas as seas

RATE = 150.0  # peaks per hour above the threshold
WINDS = np.arange(4.0, 25.0, 3.0)
SHARE = 1.0 / len(WINDS)
SCALES = np.linspace(1.0, 1.6, len(WINDS))  # grow with the wind


def peaks_of(kind, random, scale, count):
    """Return peaks above a threshold of 1.4: of a Gaussian process, or exponential (Gumbel maxima)."""
    excess = random.exponential(size=count)
    return scale * (np.sqrt(1.96 + 2.0 * excess) if kind == "gauss" else 1.4 + 0.6 * excess)


def exceedance(kind, load, scale):
    """Return the probability that such a peak exceeds a load."""
    x = max(load / scale, 1.4)
    return exp(-0.5 * (x**2 - 1.96)) if kind == "gauss" else exp(-(x - 1.4) / 0.6)


def truth(kind, years=50.0):
    """Return the load that is exceeded in an hour once in some years."""

    def excess(load):
        hours = sum(-SHARE * expm1(-RATE * exceedance(kind, load, scale)) for scale in SCALES)
        return log(max(hours, 1e-300)) - log(1.0 / (years * YEAR))

    return brentq(excess, 1.5, 100.0)


def sample(kind, seed, runs=6, stored=60, cluster=1):
    """Return the Conditions of one realisation: a few one-hour runs in each wind.

    cluster: number of peaks together, of which the others are up to a twentieth less than the first.
    """
    random = np.random.default_rng([9, seed])
    found = []
    for wind, scale in zip(WINDS, SCALES, strict=True):
        peaks = [peaks_of(kind, random, scale, random.poisson(RATE)) for _ in range(runs)]
        if cluster > 1:
            less = [random.uniform(0.95, 1.0, (cluster - 1, len(each))) for each in peaks]
            peaks = [
                np.concatenate([each, (each * part).ravel()]) for each, part in zip(peaks, less, strict=True)
            ]
        largest = np.array([each.max() for each in peaks])
        kept = tuple(np.sort(each)[-stored:] for each in peaks)
        counts = tuple(map(len, peaks))
        found.append(Condition(f"u{wind:g}", SHARE, kept, counts, largest, np.ones(runs), 0.0, wind))
    return found


@pytest.mark.parametrize("kind", ["gauss", pytest.param("exponential", marks=pytest.mark.nightly)])
def test_the_interval_contains_the_known_value(kind):
    known, inside, ratios = truth(kind), 0, []
    for seed in range(40):
        found = extrapolate(sample(kind, seed))
        inside += found.low <= known <= found.high
        ratios.append(found.value / known)
    assert inside >= 36  # 90 % of 40
    # the mean is not far off either: a wide interval alone would pass
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)
    assert np.std(ratios) < 0.2


def test_peaks_that_come_together_count_once():
    """As in gusts and motions of low frequency: four peaks for one would raise the value of a day by 6 %."""
    for years in (1.0 / 365.25, 50.0):
        known = truth("gauss", years)
        found = [extrapolate(sample("gauss", seed, cluster=4), years=years) for seed in range(20)]
        assert sum(each.low <= known <= each.high for each in found) >= 18
        if years < 1.0:
            assert np.mean([each.value for each in found]) == pytest.approx(known, rel=0.02)


def test_many_runs_give_the_known_value():
    for kind in ("gauss", "exponential"):
        found = extrapolate(sample(kind, 1, runs=120))
        assert found.value == pytest.approx(truth(kind), rel=0.05)
        assert found.governing == "u22" and found.low < found.value < found.high
        shapes = [fit[5] for fit in found.fits]
        assert np.mean(shapes[3:]) == pytest.approx(2.0 if kind == "gauss" else 1.5, abs=0.6)


def test_block_maxima_of_many_runs_give_the_known_value():
    """Largest values of an hour of exponential peaks have a Gumbel distribution."""
    assert block_maxima(sample("exponential", 2, runs=3000)) == pytest.approx(truth("exponential"), rel=0.04)
    blocks = [
        replace(c, largest=c.largest.reshape(-1, 6).max(axis=1), hours=np.full(500, 6.0))
        for c in sample("exponential", 2, runs=3000)
    ]  # the largest of six hours each
    assert block_maxima(blocks) == pytest.approx(truth("exponential"), rel=0.04)
    # a load of less than the conditions' own time is exceeded always
    assert np.isnan(block_maxima(sample("exponential", 2), years=1e-5))
    mode, scale = gumbel_fit(np.random.default_rng(1).gumbel(3.0, 2.0, 200_000))
    assert (mode, scale) == (pytest.approx(3.0, abs=0.02), pytest.approx(2.0, abs=0.02))


def test_the_least_values_are_extrapolated_like_the_negative_largest():
    conditions = sample("gauss", 3)
    up, down = extrapolate(conditions, "max"), extrapolate(conditions, "min")
    assert down.value == -up.value and (down.low, down.high) == (-up.high, -up.low)
    assert down.block == -up.block and down.largest == -up.largest
    np.testing.assert_array_equal(down.curve[:, 0], -up.curve[:, 0])


def test_the_curve_passes_through_the_value():
    found = extrapolate(sample("gauss", 4))
    order = np.argsort(found.curve[:, 0])
    rate = np.exp(np.interp(found.value, found.curve[order, 0], np.log(found.curve[order, 1])))
    assert rate == pytest.approx(1.0 / 50.0, rel=0.05)


def test_a_rarer_condition_counts_less():
    full = extrapolate(sample("gauss", 5)).value
    rare = [
        c if c.wind_speed < 20.0 else Condition(**{**c.__dict__, "share": 1e-6}) for c in sample("gauss", 5)
    ]
    assert extrapolate(rare).value < full
    # ten times the life is one more decade of the curve
    assert extrapolate(sample("gauss", 5), years=500.0).value > full
    with pytest.raises(InputError, match="years"):
        extrapolate(sample("gauss", 5), years=0.0)


def test_conditions_of_runs_take_hours_peaks_and_means():
    runs = []
    for seed in (1, 2, 3, 4):
        for wind in (8.0, 12.0):
            about = {"hours_per_year": 1000.0, "wind_speed": wind, "characteristic": "extrapolated"}
            runs.append(run_of(load_case("1.1", f"u{wind:g}", "pi", seed, **about)))
    first, second = conditions_of_runs(runs, "TwrBsMyt_[kN-m]", "max")
    assert first.share == pytest.approx(4000.0 / 8766.0) and second.wind_speed == 12.0
    each = runs[0][1]
    np.testing.assert_array_equal(first.peaks[0], each.peaks["TwrBsMyt_[kN-m]"]["max"][0])
    assert first.largest[0] == each.value("TwrBsMyt_[kN-m]", "max")
    lower = conditions_of_runs(runs, "TwrBsMyt_[kN-m]", "min")[0]
    assert lower.mean == -first.mean and lower.largest[0] == -each.value("TwrBsMyt_[kN-m]", "min")
    # Gaussian noise: the extrapolated value is above everything that was simulated, but not far
    found = extrapolate([first, second])
    deviation = each.value("TwrBsMyt_[kN-m]", "std")
    assert 4.0 < (found.value - first.mean) / deviation < 9.0 and found.value > found.largest
    with pytest.raises(InputError, match="no condition of the runs has both"):
        conditions_of_runs([run_of(load_case())], "TwrBsMyt_[kN-m]", "max")


def test_a_load_without_peaks_has_no_value():
    flat = Condition("u8", 1.0, (np.empty(0),) * 4, (0,) * 4, np.zeros(4), np.ones(4), 0.0, 8.0)
    assert np.isnan(extrapolate([flat]).value) and extrapolate([flat]).governing == ""


# --------------------------------------------------------------------------- all seas of a wind


@pytest.fixture(scope="module")
def climate():
    return seas.climate()


@pytest.mark.parametrize("load", [pytest.param("wind", marks=pytest.mark.nightly), "waves"])
def test_the_value_of_all_seas_is_not_that_of_the_classes(load, climate):
    """The mean of the upper third of Hs is far below the sea of 50 years."""
    weight = seas.LOADS[load]
    found = seas.compared("gauss", weight, 50.0, range(8), climate)
    ratios, inside = found["all seas"]
    assert inside >= 7 and np.mean(ratios) == pytest.approx(1.0, abs=0.03)
    classes, _ = found["classes"]
    assert np.mean(classes) == pytest.approx(1.0, abs=0.03) if load == "wind" else np.mean(classes) < 0.92
    # of the highest class of Hs, which the rare seas are nearest to
    conditions = seas.sampled("gauss", weight, 1, climate)
    governing = extrapolate(conditions, climate=climate).governing
    assert governing.startswith("u24") if load == "wind" else governing in [c.name for c in conditions[2::3]]


def test_many_runs_give_the_known_value_of_all_seas(climate, monkeypatch):
    monkeypatch.setattr(seas, "RUNS", 60)
    for kind in seas.KINDS:
        found = extrapolate(seas.sampled(kind, 0.5, 3, climate), climate=climate)
        assert found.value == pytest.approx(seas.known_value(kind, 0.5, 50.0, climate), rel=0.03)


def test_one_class_of_each_wind_is_all_that_is_known(climate):
    """Without classes, as with joint tables, the sea of a condition is that of its wind."""
    conditions = seas.sampled("gauss", 0.5, 1, climate)
    alone = [each for number, each in enumerate(conditions) if number % 3 == 1]
    assert extrapolate(alone, climate=climate).value == pytest.approx(extrapolate(alone).value, rel=1e-6)
    unknown = [replace(each, family=()) for each in conditions]
    assert extrapolate(unknown, climate=climate).value == extrapolate(unknown).value


def test_conditions_of_one_family_differ_in_their_sea_alone():
    runs = []
    for wind in (8.0, 12.0):
        for yaw in (0.0, 8.0):
            for Hs, Tp in ((1.0, 7.0), (1.0, 9.0), (3.0, 8.0), (3.0, 11.0)):
                about = {"hours_per_year": 100.0, "wind_speed": wind, "characteristic": "extrapolated",
                         "yaw_error": yaw, "Hs": Hs, "Tp": Tp}  # fmt: skip
                runs.append(run_of(load_case("1.1", f"u{wind:g}y{yaw:g}h{Hs:g}t{Tp:g}", "pi", 1, **about)))
    families = {}
    for each in conditions_of_runs(runs, "TwrBsMyt_[kN-m]", "max"):
        families.setdefault(each.family, []).append(each.name)
    assert len(families) == 8 and all(len(names) == 2 for names in families.values())
    assert ["u8y0h1t7", "u8y0h3t8"] in families.values() and ["u8y0h1t9", "u8y0h3t11"] in families.values()


# --------------------------------------------------------------------------- inverse FORM


def test_the_reliability_index_is_that_of_the_return_period():
    assert norm.sf(reliability_index(50.0, 1.0)) == pytest.approx(1.0 / (50.0 * 8766.0), rel=1e-9)
    assert reliability_index(50.0, 3.0) < reliability_index(50.0, 1.0)


def test_a_contour_of_normal_variables_is_an_ellipse():
    """Of correlated normal variables, by their Rosenblatt transformation."""
    means, deviations, correlation = np.array([10.0, 3.0]), np.array([4.0, 1.5]), 0.6

    def states(u):
        x = means[0] + deviations[0] * u[:, 0]
        across = correlation * u[:, 0] + np.sqrt(1.0 - correlation**2) * u[:, 1]
        return np.stack([x, means[1] + deviations[1] * across], axis=1)

    points = environmental_contour(states, 50.0, 1.0, 2, 360)
    z = (points - means) / deviations
    radius = (z[:, 0] ** 2 - 2.0 * correlation * z[:, 0] * z[:, 1] + z[:, 1] ** 2) / (1.0 - correlation**2)
    np.testing.assert_allclose(np.sqrt(radius), reliability_index(), rtol=1e-12)


def test_a_linear_response_has_its_largest_value_at_beta_times_its_slope():
    slope = np.array([1.0, -2.0, 0.5])
    for dimensions in (2, 3):
        own = slope[:dimensions]
        value, state, point = inverse_form(
            lambda x, own=own: 7.0 + x @ own, lambda u: u, 50.0, 1.0, dimensions, 200
        )  # fmt: skip
        beta = reliability_index()
        assert value == pytest.approx(7.0 + beta * np.linalg.norm(own), rel=1e-9)
        np.testing.assert_allclose(point, beta * own / np.linalg.norm(own), atol=2e-3)
        np.testing.assert_array_equal(state, point)


def test_points_of_the_sphere_are_spread_evenly():
    for dimensions in (2, 3):
        points = sphere(dimensions, 400)
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=5e-3)
    with pytest.raises(InputError, match="dimensions = 4: must be 2 or 3"):
        sphere(4, 10)


class _Run:
    """Stands for the statistics of a run with one channel."""

    duration = 3600.0

    def __init__(self, largest):
        self.largest = largest

    def value(self, column, statistic):
        return self.largest if statistic == "max" else -self.largest


def test_a_load_by_wind_and_sea_is_found_on_the_contour():
    """A load that is k Hs without scatter is k times the largest Hs on the contour."""
    climate = climate_of(read_site("norway_5"), SCENE.turbine)
    runs = []
    for wind in np.arange(2.0, 27.0, 2.0):
        for Hs in (1.0, 3.0, 8.0, 16.0):
            for seed in (1, 2, 3):
                case = load_case("1.2", f"u{wind:g}h{Hs:g}", "pi", seed, wind_speed=float(wind), Hs=Hs)
                runs.append((case, _Run(100.0 * Hs)))
    load, wind, Hs = form_load(runs, "TwrBsMyt_[kN-m]", "max", climate)
    points = environmental_contour(states_of(climate), 50.0, 1.0, 2, 4000)
    inside = points[(points[:, 0] > 1.0) & (points[:, 0] < 27.0)]
    assert load == pytest.approx(100.0 * inside[:, 1].max(), rel=2e-3)
    assert Hs == pytest.approx(inside[:, 1].max(), rel=2e-3) and 1.0 < wind < 27.0
    assert form_load(runs, "TwrBsMyt_[kN-m]", "min", climate)[0] == pytest.approx(-load, rel=1e-9)
