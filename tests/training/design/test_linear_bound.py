"""The table of the performance limit: what it asks for, fractions of it, and the stored one."""

import numpy as np
import pandas as pd
import pytest

from fowt_env import build_scene
from fowt_env.errors import InputError
from fowt_env.training.design import bound_control
from fowt_env.training.design.bound_control import Information
from fowt_env.training.design.linear_bound import (
    BOUND,
    INFORMATION,
    RATIOS,
    bound_table,
    efficient,
    fraction_of_bound,
    information_sets,
    ratio_table,
    winds_of,
)
from fowt_env.training.design.plots import plot_bound


@pytest.fixture(scope="module")
def windy():
    return build_scene("oc3_hywind", wind=18.0, fidelity="reference")


def fronts(information, speed, pitch):
    """A bound_table of these ratios at 18 m/s."""
    ratios = {"speed_ratio_[-]": speed, "pitch_ratio_[-]": pitch}
    return pd.DataFrame({"wind_[m/s]": 18.0, "information": information} | ratios)


def test_bad_wishes_are_named(windy):
    with pytest.raises(InputError, match="wind = 10.0: must be above 11.4"):
        bound_table(windy, (10.0,))
    for key in ("travel", "power", "torque_std", "torque_travel"):
        with pytest.raises(InputError, match=f"{key} = -1.0: must be positive"):
            bound_table(windy, (18.0,), **{key: -1.0})
    with pytest.raises(InputError, match="unknown information 'mesured'.*measured"):
        bound_table(windy, (18.0,), ("mesured",))
    with pytest.raises(InputError, match="information = 'measured_lidar': needs a lidar"):
        bound_table(windy, (18.0,), ("measured_lidar",))
    with pytest.raises(InputError, match="distance = 71 m: lidar .four_beam_pulsed. measures at "):
        bound_table(windy, (18.0,), ("measured_lidar",), lidar="four_beam_pulsed", distance=71.0)


def test_the_winds_are_even_ones_above_rated_up_to_cut_out(windy):
    assert winds_of(windy.turbine) == (12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0)


def test_information_is_every_combination_of_what_is_known_ahead_and_moved():
    found = information_sets((3.0,))
    assert len(found) == 3 * 2 * 2 + 2
    assert found["measured_lidar_pitch_only"].lidar and not found["measured_lidar_pitch_only"].torque
    assert not any(known.lidar for name, known in found.items() if "lidar" not in name)
    assert found["full"] == Information("plant, wind and waves")
    assert found["speed_preview_3_pitch_only"] == Information(
        "rotor speed and blade pitch, wind 3 s ahead; no torque", ("rotor_speed", "blade_pitch"), 3.0, False
    )


@pytest.mark.nightly
def test_with_the_wind_known_exactly_sensors_change_little(windy):
    """Why the usual table has previews for all states alone."""
    names = ("full_preview_3", "measured_preview_3", "speed_preview_3")
    table = bound_table(windy, (18.0,), names, fractions=(0.3, 0.8)).dropna()
    for column in ("speed_ratio_[-]", "pitch_ratio_[-]"):
        all_states, *others = (table[table["information"] == name][column].to_numpy() for name in names)
        for other in others:
            np.testing.assert_allclose(other, all_states, rtol=0.01)


@pytest.mark.nightly
def test_limits_and_noise_shape_the_front(windy):
    def least(**settings):
        table = bound_table(windy, (18.0,), ("measured",), fractions=(0.5,), **settings)
        return table.iloc[1]

    plain, freer, noisy = least(), least(travel=1.2), least(noise=dict.fromkeys(
        ("rotor_speed", "blade_pitch", "platform_pitch", "platform_pitch_rate", "nacelle_acceleration"), 0.05
    ))  # fmt: skip
    assert plain["blade_pitch_travel_[deg/s]"] * 1.2 == pytest.approx(
        freer["blade_pitch_travel_[deg/s]"], rel=0.01
    )
    assert freer["speed_ratio_[-]"] < plain["speed_ratio_[-]"] < noisy["speed_ratio_[-]"]
    calm = least(sea={"kind": "still"})
    assert calm["PtfmPitch_std_[deg]"] < plain["PtfmPitch_std_[deg]"]


def test_a_table_says_how_well_its_weather_is_fitted(windy):
    table = bound_table(windy, (18.0,), ("full",), fractions=(0.3, 0.7))
    assert table["fit_difference_[%]"].between(0.0, 4.0).all()
    (fits,) = table.attrs["fits"].to_dict("records")
    assert fits["wind_[m/s]"] == 18.0 and 0.0 < fits["wind_error_[%]"] < 5.0
    assert fits["elevation_error_[%]"] < 10.0 and fits["surge_drag_[kN-s/m]"] > 10.0


@pytest.mark.parametrize(("lost", "omitted"), [(1, []), (2, ["full at 18 m/s, share 0.7"])])
def test_a_point_that_does_not_converge_is_searched_from_the_start_and_then_named(
    windy, monkeypatch, lost, omitted
):
    searches = []

    def met(problem, limits, fraction, multipliers, aim=None):
        searches.append((fraction, multipliers is bound_control.START))
        found = converged(problem, limits, fraction, multipliers, aim)
        count = sum(searched == 0.7 for searched, _ in searches)
        return (found[0], None, *found[2:]) if 1 <= count <= lost and fraction == 0.7 else found

    converged = bound_control._met
    monkeypatch.setattr(bound_control, "_met", met)
    table = bound_table(windy, (18.0,), ("full",), fractions=(0.3, 0.7))
    assert searches == [(0.3, True), (0.7, False), (0.7, True)]
    assert table.attrs["omitted"] == omitted
    assert list(table["share_[-]"].dropna()) == ([0.3] if omitted else [0.3, 0.7])


def test_efficient_points_are_those_that_no_other_betters():
    points = [(1.0, 1.0), (0.5, 2.0), (0.6, 0.9), (2.0, 0.9), (0.5, 3.0), (3.0, 0.1)]
    np.testing.assert_array_equal(efficient(points), [(0.5, 2.0), (0.6, 0.9), (3.0, 0.1)])


def test_the_fraction_of_the_bound_is_one_on_the_front_and_none_at_the_baseline():
    table = fronts("full", [0.5, 0.6, 0.9], [0.9, 0.6, 0.5])
    assert fraction_of_bound(table, 18.0, 0.6, 0.6) == pytest.approx(1.0)
    assert fraction_of_bound(table, 18.0, 0.8, 0.8) == pytest.approx(0.5)
    assert fraction_of_bound(table, 18.0, 0.75, 1.0) == pytest.approx(0.5)  # straight to the left
    assert np.isnan(fraction_of_bound(table, 18.0, 1.1, 1.0))


def runs_table():
    rows = [
        ("ntm_18", "gspi_oc3", 1, 1.0, 0.8, 300.0, 0.1),
        ("ntm_18", "gspi_oc3", 2, 3.0, 0.8, 300.0, 0.1),
        ("ntm_18", "a", 1, 0.5, 0.4, 150.0, 0.05),
        ("ntm_18", "a", 2, 2.5, 0.4, 150.0, 0.15),
    ]
    return pd.DataFrame(rows, columns=["case", "variant", "seed", *RATIOS.values()])


def small_front():
    return fronts(["full", "full", "measured", "measured"], [0.5, 0.9, 0.7, 0.9], [0.9, 0.5, 0.9, 0.6])


def test_ratios_are_of_means_over_seeds():
    (row,) = ratio_table(runs_table(), small_front()).to_dict("records")
    assert row["wind_[m/s]"] == 18.0 and row["variant"] == "a"
    assert row["speed_ratio_[-]"] == pytest.approx(0.75)
    assert row["pitch_ratio_[-]"] == pytest.approx(0.5)
    assert row["travel_ratio_[-]"] == pytest.approx(1.0)
    assert 0.0 < row["of_bound_[-]"] < row["of_measured_[-]"]


def test_runs_that_cannot_be_compared_are_named():
    with pytest.raises(InputError, match="column 'seed' is missing"):
        ratio_table(runs_table().drop(columns="seed"))
    with pytest.raises(InputError, match="case 'ntm_18' has no wind speed in its name or no gspi_oc3"):
        ratio_table(runs_table().query("variant == 'a'"))


def test_the_plot_shows_fronts_and_points_of_the_winds_that_have_both(tmp_path):
    pytest.importorskip("matplotlib")
    at_18, at_20 = small_front(), small_front().assign(**{"wind_[m/s]": 20.0})
    both = pd.concat([at_18, at_20])
    figure = plot_bound(both, INFORMATION, path=tmp_path / "b.png")
    assert [axes.get_title() for axes in figure.axes][:2] == ["18 m/s", "20 m/s"]
    assert [len(axes.lines) for axes in figure.axes[:2]] == [2, 2]
    with_points = plot_bound(both, INFORMATION, ratio_table(runs_table()))
    assert [axes.get_title() for axes in with_points.axes if axes.get_title()] == ["18 m/s"]
    assert (tmp_path / "b.png").stat().st_size > 1000
    with pytest.raises(InputError, match="nothing to plot"):
        plot_bound(at_20, INFORMATION, ratio_table(runs_table()))


def test_the_published_fronts_are_those_of_today(windy):
    """training/design/data/linear_bound.csv, as fowt design bound wrote it."""
    stored = pd.read_csv(BOUND)
    assert set(stored["information"]) == {"gspi_oc3", *INFORMATION}
    assert set(stored["wind_[m/s]"]) == set(winds_of(windy.turbine))
    chosen = ("full", "speed_pitch_only", "full_preview_11")
    stored = stored[(stored["wind_[m/s]"] == 18.0) & stored["information"].isin(["gspi_oc3", *chosen])]
    fresh = bound_table(windy, (18.0,), chosen)
    fresh, stored = (table.sort_values(["information", "share_[-]"]) for table in (fresh, stored))
    assert list(stored["information"]) == list(fresh["information"])
    for name in ("speed_ratio_[-]", "pitch_ratio_[-]", "RotSpeed_std_[rpm]"):
        np.testing.assert_allclose(fresh[name], stored[name], rtol=0.01)
