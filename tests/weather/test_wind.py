import numpy as np
import pytest

from fowt_env.descriptions.iec import ntm_sigma, ntm_sigma_distribution
from fowt_env.descriptions.wind import KINDS, read_wind
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind import LOWEST_HEIGHT, NO_WIND, wind_at, wind_now
from fowt_env.plant.compile.decorators import kernel
from fowt_env.weather.wind import build_wind, make_series, mean_wind, nominal_speed

pytestmark = pytest.mark.installation

SITE = {
    "reference_height": 90.0, "rotor_diameter": 126.0, "shear_exponent": 0.14, "seed": 1, "duration": 100.0,
}  # fmt: skip
GUSTS = ("eog", "edc", "ecd", "ews")


def build(spec, **changes):
    return build_wind(spec, **(SITE | changes))


def series_of(time, value, period=0.0, shear_exponent=0.14):
    return make_series(
        time, value, reference_height=90.0, reference_length=126.0, shear_exponent=shear_exponent,
        period=period,
    )  # fmt: skip


@kernel
def hub_wind(t, series):
    return wind_at(t, 0.0, 0.0, 90.0, wind_now(t, series), series, None)


# --- kernels


def test_absent_wind_is_exactly_zero():
    assert build(None) is None and wind_now(3.0, None) == NO_WIND
    assert hub_wind(3.0, None) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("uniform", [True, False])
def test_interpolation_equals_that_of_numpy(uniform):
    generator = np.random.default_rng(2)
    time = np.linspace(-3.0, 40.0, 101) if uniform else np.sort(generator.uniform(-3.0, 40.0, 101))
    series = series_of(time, generator.normal(size=(101, 5)))
    assert (series.inverse_step > 0.0) is uniform
    inside = generator.uniform(-10.0, 50.0, 500)
    for t in np.concatenate([inside, time, [time[0], time[-1], -1e9, 1e9, np.inf, -np.inf]]):
        wanted = [np.interp(t, time, column) for column in series.value.T]
        np.testing.assert_allclose(wind_now(t, series), wanted, rtol=0.0, atol=1e-11)


def test_not_a_number_of_time_stays_inside_the_series_and_one_sample_is_constant_wind():
    series = series_of(np.arange(4.0), np.ones((4, 5)))
    assert wind_now(np.nan, series).u == 1.0
    assert wind_now(np.nan, series._replace(period=3.0)).u == 1.0
    series = series_of([5.0], [[11.0, 1.0, 2.0, 3.0, 4.0]])
    assert {wind_now(t, series) for t in (-1.0, 5.0, 100.0)} == {(11.0, 1.0, 2.0, 3.0, 4.0)}


def test_a_repeating_series_repeats_without_a_jump():
    series = build({"kind": "ntm", "speed": 18.0})
    period = series.period
    assert period >= 600.0 and np.array_equal(series.value[0], series.value[-1])
    for t in (0.03, 77.77, period - 0.01):
        for laps in (-1, 1, 3):
            np.testing.assert_allclose(wind_now(t + laps * period, series), wind_now(t, series), atol=1e-9)
    before, after = wind_now(period - 1e-9, series), wind_now(period + 1e-9, series)
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_horizontal_wind_follows_the_power_law_and_vertical_does_not():
    series = series_of([0.0], [[10.0, -4.0, 1.5, 0.0, 0.0]])
    now = wind_now(0.0, series)
    for height in (10.0, 27.0, 90.0, 153.0):
        factor = (height / 90.0) ** 0.14
        found = wind_at(0.0, 3.0, -7.0, height, now, series, None)
        assert found == pytest.approx((10.0 * factor, -4.0 * factor, 1.5), rel=1e-14)


def test_points_at_and_below_the_water_see_the_lowest_wind():
    series = series_of([0.0], [[10.0, 0.0, 0.0, 8.0, 0.0]])
    now = wind_now(0.0, series)
    floor = wind_at(0.0, 0.0, 0.0, LOWEST_HEIGHT, now, series, None)
    assert np.isfinite(floor[0])
    for height in (0.5, 0.0, -20.0):
        assert wind_at(0.0, 0.0, 0.0, height, now, series, None) == floor


def test_linear_shears_add_their_speed_over_one_reference_length():
    series = series_of([0.0], [[10.0, 0.0, 0.0, 6.0, 4.0]], shear_exponent=0.0)
    now = wind_now(0.0, series)
    for y, z, u in ((0.0, 63.0, 13.0), (0.0, -63.0, 7.0), (63.0, 0.0, 12.0), (-63.0, 0.0, 8.0)):
        assert wind_at(0.0, 0.0, y, 90.0 + z, now, series, None)[0] == pytest.approx(u)


# --- kinds of wind


def test_a_number_is_steady_wind_with_the_sites_shear_and_zero_is_still_air():
    still, series = build(0.0), build(18)
    assert still is not None and hub_wind(1.0, still) == (0.0, 0.0, 0.0)
    assert len(series.time) == 1 and series.shear_exponent == 0.14
    assert hub_wind(50.0, series) == pytest.approx((18.0, 0.0, 0.0))


def test_steady_wind_takes_direction_and_updraft():
    series = build({"kind": "steady", "speed": 10.0, "direction": 30.0, "vertical": 2.0})
    assert hub_wind(0.0, series) == pytest.approx((10.0 * np.sqrt(0.75), 5.0, 2.0))


def test_own_series_passes_through_uneven_times():
    time, speed = [0.0, 1.0, 4.0], [10.0, 12.0, 9.0]
    series = build({"kind": "series", "time": time, "speed": speed, "w": [0, 1, 2], "shear_exponent": 0.0})
    assert hub_wind(2.5, series) == pytest.approx((10.5, 0.0, 1.5))
    assert hub_wind(-1.0, series)[0] == 10.0 and hub_wind(9.0, series)[0] == 9.0
    shears = {"v": [1.0], "vertical_shear": [2.0], "horizontal_shear": [-3.0]}
    sheared = build({"kind": "series", "time": [3.0], "speed": [8.0]} | shears)
    assert wind_now(7.0, sheared) == (8.0, 1.0, 0.0, 2.0, -3.0)
    assert series.shear_exponent == 0.0
    assert wind_at(0.0, 0.0, 0.0, 20.0, wind_now(0.0, series), series, None)[0] == 10.0


def test_steps_hold_then_ramp():
    series = build({"kind": "steps", "speeds": [12.0, 13.0, 15.0], "every": 100.0})
    times = np.array([0.0, 99.9, 100.0, 100.05, 100.1, 150.0, 200.0, 200.1, 1000.0])
    wanted = [12.0, 12.0, 12.0, 12.5, 13.0, 13.0, 13.0, 15.0, 15.0]
    assert [wind_now(t, series).u for t in times] == pytest.approx(wanted, abs=1e-9)
    assert wind_now(5.0, build({"kind": "steps", "speeds": [9.0], "every": 10.0})).u == 9.0


@pytest.mark.parametrize("kind", GUSTS)
def test_gusts_wait_for_their_start_and_end_as_the_standard_says(kind):
    assert build({"kind": kind, "speed": 12.0}).time[0] == 60.0
    series = build({"kind": kind, "speed": 12.0, "start": 20.0})
    calm = (12.0, 0.0, 0.0, 0.0, 0.0)
    assert wind_now(0.0, series) == wind_now(20.0, series) == calm
    assert np.abs(np.subtract(wind_now(23.0, series), calm)).max() > 0.5
    end = wind_now(1000.0, series)
    if kind in ("eog", "ews"):
        assert end == pytest.approx(calm, abs=1e-9)
    else:
        turn, speed = np.arctan2(end.v, end.u), np.hypot(end.u, end.v)
        assert turn > 0.4 and speed == pytest.approx(12.0 if kind == "edc" else 27.0)


def test_horizontal_extreme_shear_acts_across_the_rotor():
    series = build({"kind": "ews", "speed": 12.0, "orientation": "horizontal", "sign": -1, "start": 0.0})
    now = wind_now(6.0, series)
    left = wind_at(6.0, 0.0, 63.0, 90.0, now, series, None)[0]
    right = wind_at(6.0, 0.0, -63.0, 90.0, now, series, None)[0]
    # twice the amplitude 2.5 + 0.2 * 6.4 * 2.044 * 3^0.25 = 5.94327
    assert right - left == pytest.approx(2 * 5.94327, abs=1e-4)


def test_extreme_wind_is_steady_and_has_its_own_shear():
    series = build({"kind": "ewm"})
    assert hub_wind(0.0, series)[0] == pytest.approx(70.0) and series.shear_exponent == 0.11
    series = build({"kind": "ewm", "turbine_class": "III", "recurrence": 1, "direction": 90.0})
    assert hub_wind(0.0, series) == pytest.approx((0.0, 42.0, 0.0), abs=1e-12)


def test_turbulent_extreme_wind_has_eleven_percent():
    series = build({"kind": "ewm", "turbulent": True, "average": "point"})
    u = series.value[:-1, 0]
    assert u.mean() == pytest.approx(50.0) and u.std() == pytest.approx(5.5, rel=1e-9)


@pytest.mark.parametrize("kind, sigma", [("ntm", ntm_sigma(18.0, "A")), ("etm", 0.32 * 12.88)])
def test_turbulent_wind_has_its_mean_and_point_deviation(kind, sigma):
    series = build({"kind": kind, "speed": 18.0, "class": "a", "average": "point"})
    u = series.value[:-1, 0]
    assert u.mean() == pytest.approx(18.0, rel=1e-12) and u.std() == pytest.approx(sigma, rel=1e-9)


def drawn(seed, speed=18.0, **changes):
    spec = {"kind": "ntm", "speed": speed, "class": "B", "average": "point"} | changes
    return build(spec, seed=seed).value[:-1, 0]


def test_a_drawn_sigma_has_the_standards_mean_deviation_and_90_percent_quantile():
    found = np.array([drawn(seed, sigma="drawn").std() for seed in range(1000, 1400)])
    # IEC 61400-1 ed. 3, 6.3.1.3: E = 0.14 (0.75 18 + 3.8), D = 1.4 0.14; three standard errors of 400
    assert found.mean() == pytest.approx(0.14 * 17.3, abs=3.0 * 0.196 / 20.0)
    assert found.std() == pytest.approx(0.196, rel=0.11)
    # the representative value is the 90 % quantile, rounded by the standard to 5.6 m/s
    assert 0.855 < np.mean(found < ntm_sigma(18.0, "B")) < 0.945
    assert np.exp(np.log(found).mean()) < found.mean()  # skewed as a log-normal is


def test_a_drawn_sigma_is_the_seeds_own_and_changes_nothing_but_the_strength():
    for seed in (1001, 1002):
        plain, other = drawn(seed), drawn(seed, sigma="drawn")
        np.testing.assert_array_equal(drawn(seed, sigma="90%"), plain)  # what a user gets who says nothing
        np.testing.assert_array_equal(drawn(seed, sigma="drawn"), other)
        ratio = other.std() / plain.std()
        np.testing.assert_allclose(other - 18.0, ratio * (plain - 18.0), atol=1e-9)  # the same phases
        assert abs(ratio - 1.0) > 1e-3
    # one place in the distribution for all winds of a seed: gusty at one wind, gusty at all
    places = []
    for speed in (12.0, 24.0):
        mean, deviation = ntm_sigma_distribution(speed, "B")
        spread = np.sqrt(np.log1p((deviation / mean) ** 2))
        sigma = drawn(1003, speed, sigma="drawn").std()
        places.append((np.log(sigma / mean) + 0.5 * spread**2) / spread)
    assert places[0] == pytest.approx(places[1], abs=1e-9)


def test_turbulence_lasts_at_least_as_long_as_asked():
    for duration in (10.0, 700.0, 3601.0):
        series = build({"kind": "ntm", "speed": 12.0}, duration=duration)
        assert max(600.0, duration) <= series.period < 1.1 * max(600.0, duration)
        assert series.time[-1] == pytest.approx(series.period) and series.inverse_step == pytest.approx(10.0)
    assert build({"kind": "ntm", "speed": 12.0, "period": 1200.0}).period == pytest.approx(1200.0)


def test_turned_turbulence_is_the_same_wind_along_its_own_axes():
    plain = build({"kind": "ntm", "speed": 18.0}).value
    turned = build({"kind": "ntm", "speed": 18.0, "direction": -40.0}).value
    c, s = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    np.testing.assert_allclose(c * turned[:, 0] - s * turned[:, 1], plain[:, 0], atol=1e-12)
    np.testing.assert_allclose(s * turned[:, 0] + c * turned[:, 1], plain[:, 1], atol=1e-12)
    np.testing.assert_allclose(turned[:, 3], c * plain[:, 3], atol=1e-12)
    np.testing.assert_allclose(turned[:, 4], c * c * plain[:, 4], atol=1e-12)


def test_seed_of_the_wind_wins_over_that_of_the_episode():
    spec = {"kind": "ntm", "speed": 18.0}
    one, two = build(spec, seed=1), build(spec, seed=2)
    assert not np.array_equal(one.value, two.value)
    own = [build(spec | {"seed": 5}, seed=seed).value for seed in (1, None)]
    assert np.array_equal(own[0], own[1])
    assert np.array_equal(build(spec, seed=np.random.SeedSequence(1)).value, one.value)


def test_wind_without_chance_needs_no_seed():
    for spec in (18.0, {"kind": "steps", "speeds": [8, 9], "every": 5}, {"kind": "ewm"}):
        assert build(spec, seed=None, duration=None) is not None


def test_checked_specs_and_ready_series_pass_through():
    series = build(9.0)
    assert build(series) is series
    spec = read_wind({"kind": "ntm", "speed": 12.0})
    assert read_wind(spec) is spec
    assert np.array_equal(build(spec).value, build({"kind": "ntm", "speed": 12.0}).value)


def test_every_kind_gives_arrays_fit_for_kernels():
    needs = {"speed": 12.0, "time": [0.0, 1.0], "speeds": [8.0, 9.0], "every": 50.0}
    for kind, keys in ((kind, row.keys.model_fields) for kind, row in KINDS.items()):
        spec = {"kind": kind} | {k: v for k, v in needs.items() if k in keys}
        if kind == "series":
            spec["speed"] = [8.0, 9.0]
        series = build(spec)
        for array in (series.time, series.value):
            assert array.dtype == np.float64 and array.flags.c_contiguous and np.isfinite(array).all()
        assert series.value.shape == (series.time.size, 5) and np.all(np.diff(series.time) > 0.0)
        assert all(type(number) is float for number in series[2:])


# --- the wind an episode starts from


@pytest.mark.parametrize(
    "spec, speed",
    [
        (None, 0.0),
        (18.0, 18.0),
        ({"kind": "steady", "speed": 9.0, "direction": 90.0}, 9.0),
        ({"kind": "steps", "speeds": [12.0, 24.0], "every": 10.0}, 12.0),
        ({"kind": "ntm", "speed": 14.0}, 14.0),
        ({"kind": "ecd", "speed": 11.4, "start": 0.0}, 11.4),
        ({"kind": "ewm", "recurrence": 1}, 56.0),
        # 10 m/s for 30 s, then 30 s of a ramp to 16: (10 * 30 + 13 * 30)/60
        ({"kind": "series", "time": [0.0, 30.0, 60.0, 100.0], "speed": [10, 10, 16, 99]}, 11.5),
    ],
)
def test_nominal_speed_is_what_the_episode_starts_from(spec, speed):
    assert nominal_speed(spec) == pytest.approx(speed, rel=1e-12)


def test_mean_of_turbulence_is_its_nominal_wind():
    series = build({"kind": "ntm", "speed": 16.0, "direction": 20.0})
    mean = mean_wind(series)
    assert len(mean.time) == 1 and mean.period == 0.0 and mean.shear_exponent == series.shear_exponent
    wanted = (16.0 * np.cos(np.radians(20.0)), 16.0 * np.sin(np.radians(20.0)), 0.0, 0.0, 0.0)
    assert wind_now(123.0, mean) == pytest.approx(wanted, abs=1e-9)
    assert nominal_speed(series) == pytest.approx(16.0, rel=1e-9)
    assert mean_wind(None) is None
    # of a gust it is the wind before
    assert wind_now(0.0, mean_wind(build({"kind": "ecd", "speed": 12.0}))).u == pytest.approx(12.0, rel=1e-12)


# --- what is refused, and how


@pytest.mark.parametrize(
    "spec, words",
    [
        (-1.0, "wind = -1.0 [0, 100] m/s"),
        (float("nan"), "wind = nan [0, 100]"),
        (True, "wind = True number"),
        ("18 m/s", "wind = '18 m/s' KIND:SPEED ntm bts box mann"),
        ([18.0, 19.0], "wind KIND:SPEED"),
        ({"speed": 18.0}, "wind.kind missing steady"),
        ({"kind": "steedy", "speed": 18.0}, "'steedy' Did you mean 'steady'"),
        ({"kind": "steady"}, "wind.speed missing"),
        ({"kind": "steady", "sped": 18.0}, "wind.sped Did you mean 'speed'"),
        ({"kind": "steady", "speed": -2.0}, "wind.speed = -2.0 [0, 100] m/s"),
        ({"kind": "steady", "speed": "fast"}, "wind.speed = 'fast' number"),
        ({"kind": "steady", "speed": 8.0, "direction": 400.0}, "wind.direction = 400.0 [-180, 180] deg"),
        ({"kind": "steady", "speed": 8.0, "shear_exponent": 1.5}, "wind.shear_exponent = 1.5 [0, 1]"),
        ({"kind": "steady", "speed": 8.0, "vertical": np.nan}, "wind.vertical = nan"),
        ({"kind": "series", "time": [], "speed": []}, "wind.time (0,) at least one"),
        ({"kind": "series", "time": [[0.0]], "speed": [1.0]}, "wind.time (1, 1)"),
        ({"kind": "series", "time": [0.0, 1.0], "speed": [1.0]}, "wind.speed 1 values 2"),
        ({"kind": "series", "time": [0.0, 1.0], "speed": [1.0, -2.0]}, "wind.speed[1] = -2.0 [0, 100]"),
        ({"kind": "series", "time": [0.0, 1.0], "speed": [1.0, np.nan]}, "wind.speed[1] = nan"),
        (
            {"kind": "series", "time": [0.0, 1.0, 1.0], "speed": [1, 1, 1]},
            "wind.time[2] = 1.0 strictly increasing",
        ),
        ({"kind": "series", "time": [0.0], "speed": ["a"]}, "wind.speed list of numbers"),
        ({"kind": "steps", "speeds": [], "every": 5.0}, "wind.speeds at least one"),
        ({"kind": "steps", "speeds": [8.0], "every": 0.0}, "wind.every = 0.0 s"),
        ({"kind": "steps", "speeds": [8.0], "every": 5.0, "ramp": 0.0}, "wind.ramp = 0.0 s"),
        ({"kind": "steps", "speeds": [8.0], "every": 5.0, "ramp": 5.0}, "wind.ramp = 5.0 below wind.every"),
        ({"kind": "eog", "speed": 57.0}, "wind.speed = 57.0 below 56 m/s"),
        ({"kind": "edc", "speed": 0.0}, "wind.speed = 0.0 [1, 100]"),
        ({"kind": "edc", "speed": 12.0, "start": -1.0}, "wind.start = -1.0"),
        ({"kind": "ecd", "speed": 12.0, "sign": 2}, "wind.sign = 2 1, -1"),
        ({"kind": "ews", "speed": 12.0, "orientation": "horizontl"}, "Did you mean 'horizontal'"),
        ({"kind": "eog", "speed": 12.0, "turbine_class": "IV"}, "wind.turbine_class 'IV' I, II, III"),
        ({"kind": "ntm", "speed": 0.0}, "wind.speed = 0.0 [1, 100]"),
        ({"kind": "ntm", "speed": 12.0, "class": "D"}, "wind.class 'D' A, A+, B, C"),
        ({"kind": "ntm", "speed": 12.0, "sigma": "free"}, "wind.sigma 'free' 90%, drawn"),
        ({"kind": "etm", "speed": 12.0, "sigma": "drawn"}, "wind.sigma unknown key"),
        ({"kind": "ntm", "speed": 12.0, "seed": -1}, "wind.seed = -1 >= 0"),
        ({"kind": "ntm", "speed": 12.0, "average": "disc"}, "wind.average 'disc' rotor, point"),
        ({"kind": "ntm", "speed": 12.0, "shear_turbulence": 1}, "wind.shear_turbulence = 1 True or False"),
        ({"kind": "ntm", "speed": 12.0, "period": 80.0}, "wind.period = 80.0 duration 100"),
        ({"kind": "ewm", "recurrence": 10}, "wind.recurrence = 10 50, 1"),
        ({"kind": "ewm", "average": "point"}, "wind.average = 'point' wind.turbulent"),
    ],
)
def test_bad_input_is_named_with_its_value_and_range(spec, words):
    with pytest.raises(InputError) as caught:
        build(spec)
    for word in words.split():
        assert word in str(caught.value), str(caught.value)


def test_a_bad_site_is_named_too():
    for key, value in (
        ("seed", None), ("seed", -3), ("duration", float("inf")), ("shear_exponent", float("nan")),
        ("reference_height", 0.0), ("rotor_diameter", -126.0),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"{key} = {value}"):
            build({"kind": "ntm", "speed": 12.0}, **{key: value})
