"""Sites: joint climates against published figures, fits against what they were drawn from, and bad files."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import kstest, norm, weibull_min

from fowt_env.descriptions.sea_state import joint_tables
from fowt_env.errors import InputError
from fowt_env.training.loads.site import YEAR, Climate, read_site, site_names
from fowt_env.training.loads.site_fit import weibull
from fowt_env.training.loads.site_plot import plot_site

FITTED = ("northern_north_sea", "norway_5")
LARGE = 20_000  # rows of a table


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The path of a CSV table of states drawn from Norway 5, winds at 10 m."""
    wind, Hs, Tp = Climate(read_site("norway_5"), 10.0).sample(LARGE, np.random.default_rng(1001))
    path = tmp_path_factory.mktemp("site") / "states.csv"
    pd.DataFrame({"wind": wind, "Hs": Hs, "Tp": np.clip(Tp, 0.6, 39.0)}).to_csv(path, index=False)
    return path


def test_the_northern_north_sea_has_the_expected_seas_of_bachynski_and_moan():
    """Their table was rounded to a tenth; its row at 18 m/s lies off their own distribution."""
    climate, row = Climate(read_site("northern_north_sea"), 90.0), joint_tables()["north_sea"]
    for speed, Hs, Tp in zip(row.wind, row.Hs, row.Tp, strict=True):
        if speed != 18.0:
            assert climate.expected_sea(speed) == pytest.approx((Hs, Tp), rel=0.015)


def test_the_50_year_sea_of_norway_5_is_that_of_its_separately_fitted_marginal_distribution():
    """Li, Gao and Moan fit Hs alone as well: above 5 m a Weibull distribution of 2.547 m and 1.433."""
    climate = Climate(read_site("norway_5"), 100.0)
    marginal = 2.547 * np.log(50.0 * YEAR) ** (1.0 / 1.433)
    assert climate.marginal_height(1.0 / climate.states(50.0)) == pytest.approx(marginal, rel=0.03)


def test_the_marginal_sea_is_that_of_states_drawn_at_random():
    climate = Climate(read_site("norway_5"), 100.0)
    _, Hs, _ = climate.sample(200_000, np.random.default_rng(1002))
    for exceedance in (0.5, 0.01):
        assert climate.marginal_height(exceedance) == pytest.approx(
            np.quantile(Hs, 1.0 - exceedance), rel=0.01
        )


def test_drawn_winds_have_the_weibull_distribution_at_the_hub():
    climate = Climate(read_site("norway_5"), 119.0)
    wind, _, _ = climate.sample(5000, np.random.default_rng(1003))
    about = climate.site.wind
    scale = about.A * (119.0 / 10.0) ** about.profile_exponent
    assert kstest(wind, weibull_min(about.k, scale=scale).cdf).pvalue > 0.01


@pytest.mark.parametrize("name", FITTED)
def test_the_period_has_the_mean_and_spread_of_the_file(name):
    climate = Climate(read_site(name), 10.0)
    fit = climate.site.sea_fit
    quantiles = (np.arange(20_000) + 0.5) / 20_000
    Tp = climate.period_at(quantiles, 4.0, 12.0)
    usual = fit.wind[0] + fit.wind[1] * 4.0 ** fit.wind[2]
    mean = (fit.period[0] + fit.period[1] * 4.0 ** fit.period[2]) * (1.0 + fit.slope * (12.0 - usual) / usual)
    assert Tp.mean() == pytest.approx(mean, rel=1e-3)
    assert Tp.std() / Tp.mean() == pytest.approx(
        fit.spread[0] + fit.spread[1] * np.exp(4.0 * fit.spread[2]), rel=1e-2
    )


@pytest.mark.parametrize("name", site_names())
def test_the_seas_of_a_wind_add_up_to_one_and_to_the_expected_height(name):
    climate = Climate(read_site(name), 90.0)
    seas = climate.seas(13.0)
    assert sum(sea.probability for sea in seas) == pytest.approx(1.0, abs=1e-12)
    mean = sum(sea.probability * sea.Hs for sea in seas)
    assert mean == pytest.approx(climate.expected_sea(13.0)[0], rel=2e-3)


@pytest.mark.parametrize("name", FITTED)
def test_the_severe_sea_lies_on_the_circle_of_inverse_form(name):
    climate = Climate(read_site(name), 90.0)
    beta = norm.isf(1.0 / climate.states(50.0))
    median = float(climate.wind_at(0.5))
    assert climate.severe_sea(median)[0] == pytest.approx(
        float(climate.height_at(norm.cdf(beta), median)), rel=1e-9
    )
    for u1 in (-2.0, 1.0, 3.0):
        speed = float(climate.wind_at(norm.cdf(u1)))
        u2 = norm.ppf(climate.height_below(climate.severe_sea(speed)[0], speed))
        assert np.hypot(u1, u2) == pytest.approx(beta, rel=1e-6)


def test_the_50_year_wind_of_a_fit_is_converted_from_an_hour_to_ten_minutes():
    climate = Climate(read_site("norway_5"), 10.0)
    hourly = weibull_min.isf(1.0 / (50.0 * YEAR), 2.029, scale=9.409)
    assert climate.extreme(50)[0] == pytest.approx(hourly / 0.95, rel=1e-9)


def test_a_site_of_tables_has_their_rows_and_the_extremes_of_its_class():
    climate = Climate(read_site("gulf_of_maine"), 150.0)
    assert climate.expected_sea(12.0) == (1.16, 7.25)
    assert climate.severe_sea(24.0) == (9.9, 14.1)
    assert climate.expected_sea(40.0) == climate.expected_sea(24.0)
    assert climate.extreme(50)[:4] == (50.0, 10.68, 14.2, 0.0)
    assert climate.extreme(1)[:3] == (40.0, 6.98, 11.7)


@pytest.mark.parametrize("weights", [None, "repeated"])
def test_the_weibull_fit_is_that_of_scipy(weights):
    rng = np.random.default_rng(1004)
    values = weibull_min.rvs(1.8, scale=9.0, size=400, random_state=rng)
    counts = np.ones(400, int) if weights is None else rng.integers(1, 4, 400)
    shape, _, scale = weibull_min.fit(np.repeat(values, counts), floc=0.0)
    assert weibull(values, counts / counts.sum()) == pytest.approx((shape, scale), rel=1e-4)


def test_a_fit_finds_the_climate_that_its_table_was_drawn_from(table):
    """20,000 states: seas within what their sampling allows, about 1 % in the mean and 4 % at 50 years."""
    true, found = (Climate(read_site(name), 10.0) for name in ("norway_5", table))
    assert found.site.wind.A == pytest.approx(true.site.wind.A, rel=0.015)
    for speed in (5.0, 10.0, 15.0):
        assert found.expected_sea(speed) == pytest.approx(true.expected_sea(speed), rel=0.02)
    assert found.extreme(50)[:3] == pytest.approx(true.extreme(50)[:3], rel=0.06)


def test_a_table_of_probabilities_is_one_of_records_with_equal_rows(table, tmp_path):
    states = pd.read_csv(table).round(1)
    counted = states.value_counts().rename("count").reset_index()
    counted.to_csv(tmp_path / "counted.csv", index=False)
    states.to_csv(tmp_path / "states.csv", index=False)
    one, other = (read_site(tmp_path / f"{name}.csv") for name in ("counted", "states"))
    assert one.wind.A == pytest.approx(other.wind.A, rel=1e-9)
    assert one.sea_fit.scale == pytest.approx(other.sea_fit.scale, rel=1e-3)


def test_a_site_file_may_have_a_table_in_place_of_a_distribution(table, tmp_path):
    head = f'name = "mine"\ndescription = ""\ntable = "{table}"\n'
    text = head + '[wind]\nheight = 10.0\n[design]\nsource = "mine"\n'
    (tmp_path / "mine.toml").write_text(text)
    site = read_site(str(tmp_path / "mine.toml"))
    assert site.wind.height == 10.0 and "20000 rows" in site.wind.source
    assert site.wind.k == pytest.approx(2.029, rel=0.02)


DIRECTION = "[[direction]]\nmisalignment = 30.0\nprobability = 0.4\n[sea_fit]"
TABLES = '[sea_tables]\nnormal = "gulf_of_maine_normal"\nsevere = "x"\nsource = ""\n[sea_fit]'
BASE = """name = "x"
description = ""
[wind]
A = 10.0
k = 2.0
source = ""
[sea_fit]
shape = [2.0, 0.1, 1.0]
scale = [1.8, 0.1, 1.3]
period = [5.0, 2.0, 0.5]
spread = [0.0, 0.3, -0.1]
source = ""
[design]
source = ""
"""


@pytest.mark.parametrize(("old", "new", "message"), [
    ("A = 10.0", "A = -1.0", "wind.A = -1.0: must be a number > 0"),
    ("k = 2.0", "k = 2.0\nkk = 1", "wind.kk"),
    ("shape = [2.0, 0.1, 1.0]", "shape = [2.0, -0.1, 1.0]", "shape = .* must be at least 0.2"),
    ("spread = [0.0, 0.3, -0.1]", "spread = [0.0, 0.3, 0.5]", r"coefficients of variation in \(0, 2\)"),
    ("[sea_fit]", DIRECTION, "add up to 0.4: must be 1"),
    ("[sea_fit]", TABLES, "'x'"),
    ("[design]", "[design]\navailability = 1.2", "availability = 1.2: must be"),
    ("[design]", "[design]\nbin_width = 3.0", "bin_width = 3.0: must be a number >= 0.5 and <= 2"),
    ("[design]", '[extreme_50]\nsea = "nowhere"\nsource = ""\n[design]', "nowhere"),
    ("[design]", "[design]\nevents = {starts = 3.0}", "events.starts"),
])  # fmt: skip
def test_a_bad_site_file_is_refused_with_key_value_and_range(tmp_path, old, new, message):
    assert old in BASE
    path = tmp_path / "site.toml"
    path.write_text(BASE)
    read_site(str(path))
    path.write_text(BASE.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read_site(str(path))


def test_an_unknown_site_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match="unknown site 'norway'.*norway_5"):
        read_site("norway")


@pytest.mark.parametrize(("change", "message"), [
    (lambda t: t.drop(columns="Tp"), "column 'Tp' is missing"),
    (lambda t: t.assign(Hs=-t["Hs"]), r"column 'Hs', row 1: -.* must be in \[0, 30\] m"),
    (lambda t: t.assign(wind=t["wind"].where(t.index != 7)), "column 'wind', row 8: nan"),
    (lambda t: t.assign(Tp="long"), "column 'Tp': must contain numbers"),
    (lambda t: t.head(20), "has 20 rows: needs at least 50"),
    (lambda t: t.assign(count=0.0), "must not be zero in all rows"),
    (lambda t: t.assign(count=1, probability=1.0), "one of them at most"),
    (lambda t: t.assign(wind=10.0), "wind: has 1 classes"),
])  # fmt: skip
def test_a_bad_table_is_refused_by_column_and_row(table, tmp_path, change, message):
    change(pd.read_csv(table).head(400)).to_csv(tmp_path / "bad.csv", index=False)
    with pytest.raises(InputError, match=message):
        read_site(str(tmp_path / "bad.csv"))


def test_the_plot_shows_the_table_and_the_extremes():
    figure = plot_site(Climate(read_site("norway_5"), 90.0))
    sea = figure.axes[1].get_lines()
    climate = Climate(read_site("norway_5"), 90.0)
    speed = float(sea[1].get_xdata()[40])
    assert sea[1].get_ydata()[40] == pytest.approx(climate.expected_sea(speed)[0])
    assert sea[2].get_ydata()[40] == pytest.approx(climate.severe_sea(speed)[0])


def test_limits_of_constraints_are_the_designers():
    site = read_site("norway_5")
    limits = {"platform_pitch": 10.0, "overspeed": False}
    own = type(site).model_validate(site.model_dump() | {"design": {"source": "x", "limits": limits}})
    assert own.design.constraint_limits == {"platform pitch": 10.0, "overspeed": None}
    assert site.design.constraint_limits == {}
    for wrong, part in (({"platform_tilt": 1.0}, "platform_tilt"), ({"offset": "far"}, "offset"),
                        ({"offset": float("inf")}, "offset")):  # fmt: skip
        with pytest.raises(ValueError, match=part):
            type(site).model_validate(site.model_dump() | {"design": {"source": "x", "limits": wrong}})
