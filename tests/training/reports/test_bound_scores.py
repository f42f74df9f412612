"""Shares of the performance limit on a Pareto front and runs of known place."""

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.evaluation.evaluate import COLUMNS  # noqa: E402
from fowt_env.training.reports.bound_scores import (  # noqa: E402
    bound_fractions,
    bound_markdown,
    declared,
    limit_for,
    read_bound,
)
from fowt_env.training.reports.score_plots import plot_fractions, plot_gust  # noqa: E402

SPEED, LEAN, TRAVEL, POWER = (
    "RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]", "GenPwr_std_[kW]",
)  # fmt: skip


def bound():
    """One wind, fronts of one corner: at half of both deviations with full knowledge."""
    corners = {"full": 0.5, "measured": 0.6, "speed": 0.7, "full_pitch_only": 0.75, "speed_pitch_only": 0.8}
    corners |= {"measured_preview_3": 0.4, "measured_preview_11": 0.25, "speed_preview_11_pitch_only": 0.3}
    rows = [
        {"wind_[m/s]": 18.0, "information": name, "speed_ratio_[-]": place, "pitch_ratio_[-]": place}
        for name, place in corners.items()
    ]
    return pd.DataFrame(rows)


FIVE = ("generator_speed", "blade_pitch", "platform_pitch", "nacelle_acceleration", "generator_torque")


def runs(controllers, cases=("ntm_18",), seeds=(1, 2)):
    """Runs whose figures are {controller: (speed, pitch, travel, power)} times those of gspi_oc3."""
    rows = []
    for case in cases:
        for seed in seeds:
            for name, ratios in ({"gspi_oc3": (1.0,) * 4} | controllers).items():
                row = dict.fromkeys(COLUMNS, 1.0 if name == "gspi_oc3" else 5.0) | {"status": "ok"}
                row |= {"controller": name, "case": case, "seed": seed}
                figures = zip((SPEED, LEAN, TRAVEL, POWER), (seed * ratio for ratio in ratios), strict=True)
                rows.append(row | dict(figures))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def test_a_controller_halfway_to_the_front_reaches_half_of_the_bound():
    found = bound_fractions(runs({"x": (0.75, 0.75, 1.0, 1.0), "on": (0.5, 0.5, 0.9, 1.0)}), bound())
    assert list(found["of_limit_[-]"]) == pytest.approx([0.5, 1.0])
    assert found["within"].all()


def test_a_controller_is_held_against_the_limit_of_what_it_knows_and_moves():
    fronts = bound()
    assert limit_for((*FIVE, "plant_model"), True, fronts) == "measured"
    lidar = fronts.assign(information="measured_lidar")
    assert limit_for((*FIVE, "lidar"), True, lidar) == "measured_lidar"
    assert limit_for((*FIVE, "lidar"), False, lidar) is None
    assert limit_for(("time", "generator_speed", "blade_pitch"), True, fronts) == "speed"
    assert limit_for(("generator_speed", "blade_pitch"), False, fronts) == "speed_pitch_only"
    assert limit_for((*FIVE, "surge"), True, fronts) == "full"
    assert limit_for((*FIVE, "wind_speed"), True, fronts) == "full"
    assert limit_for(("generator_speed", "nacelle_velocity"), False, fronts) == "full_pitch_only"
    # the wind ahead: at least as far as the controller sees, with the wind of now
    ahead = (*FIVE, "wind_speed", "wind_preview")
    assert limit_for(ahead, True, fronts, (1.0, 3.0)) == "measured_preview_3"
    assert limit_for(ahead, True, fronts, (3.0, 5.0)) == "measured_preview_11"
    assert limit_for(ahead, True, fronts) == "measured_preview_11"
    assert (
        limit_for(("generator_speed", "wind_preview"), False, fronts, (9.0,)) == "speed_preview_11_pitch_only"
    )
    # none of the table sees as far, or has its kind, or a lidar
    assert limit_for((*FIVE, "lidar"), True, fronts) is None
    assert limit_for(ahead, True, fronts, (20.0,)) is None
    assert limit_for((*ahead, "surge"), True, fronts) is None
    everything = pd.concat([fronts, fronts.assign(information="full_preview_11")])
    assert limit_for((*ahead, "surge"), True, everything) == "full_preview_11"
    assert limit_for(("generator_speed", "wind_preview"), True, everything, (3.0,)) == "full_preview_11"
    assert limit_for(ahead, True, everything, (3.0,)) == "measured_preview_3"


def test_the_share_is_of_the_own_limit_and_torque_shows_in_its_travel():
    table = runs({"lqr": (0.8, 0.8, 1.0, 1.0), "pi": (0.9, 0.9, 1.0, 1.0), "x": (0.9, 0.9, 1.0, 1.0)})
    table.loc[table["controller"] == "pi", "torque_travel_[kN-m/s]"] = 1.2
    found = bound_fractions(table, bound(), information={"x": ((*FIVE, "wind_preview"), (3.0,))})
    assert list(found["limit"]) == ["measured", "speed_pitch_only", "measured_preview_3"]
    assert list(found["of_limit_[-]"]) == pytest.approx([0.5, 0.5, 1.0 / 6.0])
    assert "| `lqr` | measured | 0.50 |" in bound_markdown(found)


@pytest.mark.parametrize(
    ("ratios", "information", "text"),
    [
        ((0.75, 0.75, 1.0, 1.0), {}, "| `x` | full | 0.50 |"),
        ((0.75, 0.75, 1.3, 1.0), {}, "| `x` | full | [0.50] |"),
        ((0.75, 0.75, 1.0, 1.1), {}, "| `x` | full | [0.50] |"),
        ((1.1, 1.2, 1.0, 1.0), {}, "| `x` | full | worse |"),
        ((0.8, 0.8, 1.0, 1.0), {"x": ((*FIVE, "wind_preview"), (30.0,))}, "| `x` | none | - |"),
    ],
)
def test_more_travel_or_power_is_marked_and_what_has_no_share_says_so(ratios, information, text):
    found = bound_fractions(runs({"x": ratios}), bound(), information=information)
    assert text in bound_markdown(found)
    assert found["within"].all() == (max(ratios[2:]) == 1.0)
    assert np.isfinite(found["of_limit_[-]"]).all() == ("0.50" in text)


def test_code_of_the_user_s_own_is_not_run_to_ask_what_it_knows():
    assert declared("no_such_module:Law") == declared("x") == (("surge",), ())
    assert "nacelle_acceleration" in declared("lqr")[0]


def test_a_group_has_its_mean_and_the_range_of_its_training_seeds():
    agents = {"a": (0.7, 0.7, 1.0, 1.0), "b": (0.8, 0.8, 1.0, 1.0)}
    found = bound_fractions(runs(agents), bound(), {"both": ["a", "b"]})
    assert list(found["seed_of"]) == ["a", "b", ""]
    assert list(found["of_limit_[-]"]) == pytest.approx([0.6, 0.4, 0.5])
    assert "| `both` | full | 0.50 (0.40 to 0.60) |" in bound_markdown(found)


def test_a_failed_run_takes_its_pair_along():
    table = runs({"x": (0.75, 0.75, 1.0, 1.0)})
    table.loc[(table["controller"] == "x") & (table["seed"] == 2), "status"] = "failed"
    assert bound_fractions(table, bound())["speed_ratio_[-]"].iloc[0] == 0.75
    table["status"] = "failed"
    with pytest.raises(InputError, match="no run of gspi_oc3"):
        bound_fractions(table, bound())


def test_cases_of_two_kinds_are_not_mixed():
    with pytest.raises(InputError, match="several kinds"):
        bound_fractions(runs({"x": (0.7, 0.7, 1.0, 1.0)}, ("ntm_18", "soft_18")), bound())


def test_the_picture_has_a_panel_per_wind_and_a_mark_for_each_agent_and_training_seed(tmp_path):
    agents = {"a": (0.7, 0.7, 1.0, 1.0), "b": (0.8, 0.8, 1.3, 1.0), "far": (0.5, 4.0, 1.0, 1.0)}
    table = runs(agents, ("ntm_14", "ntm_18"))
    found = bound_fractions(table, read_bound(), {"both": ["a", "b"]})
    figure = plot_fractions(found, read_bound(), tmp_path / "shares.png")
    assert (tmp_path / "shares.png").stat().st_size > 10_000
    drawn = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in drawn] == ["14 m/s", "18 m/s"]
    # gspi_oc3, two seeds and their mean, and the one beyond the frame, which is written in the corner
    shown = [[marks for marks in axes.collections if len(marks.get_offsets())] for axes in drawn]
    assert [len(marks) for marks in shown] == [5, 5]
    assert all([text.get_text() for text in axes.texts] == ["0.50, 4.00"] for axes in drawn)


def test_a_gust_is_drawn_for_every_controller_within_its_seconds(tmp_path):
    time = np.arange(0.0, 20.0, 0.1)
    frames = {
        name: pd.DataFrame({"Time_[s]": time, "Wind1VelX_[m/s]": 18.0, "RotSpeed_[rpm]": time + k})
        for k, name in enumerate("abcdefghij")
    }  # fmt: skip
    figure = plot_gust(frames, tmp_path / "gust.png", start=5.0, end=10.0)
    wind, speed = figure.axes
    assert len(wind.lines) == 1 and len(speed.lines) == 10
    assert len({(line.get_color(), line.get_linestyle()) for line in speed.lines}) == 10
    assert speed.lines[0].get_xdata()[[0, -1]] == pytest.approx([5.0, 10.0])
