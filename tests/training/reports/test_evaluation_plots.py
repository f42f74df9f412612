import numpy as np
import pandas as pd
import pytest

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

from matplotlib.text import Text  # noqa: E402

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.reports import evaluation_plots  # noqa: E402

PNG = b"\x89PNG\r\n\x1a\n"


def test_evaluation_plot_leaves_lost_runs_out_and_says_so(tmp_path):
    columns = {"controller": list("aabb"), "case": list("xyxy"), "seed": 1}
    columns |= {"status": ["ok", "ok", "ok", "failed"], "PtfmPitch_std_[deg]": [1.0, 2.0, 3.0, np.nan]}
    table = pd.DataFrame(columns)
    figure = evaluation_plots.plot_evaluation(table, ["PtfmPitch_std_[deg]"], tmp_path / "metrics.png")
    assert (tmp_path / "metrics.png").read_bytes().startswith(PNG)
    assert "1 of 4 runs were lost and are left out" in figure.legends[0].get_title().get_text()
    drawn = [part.lines[0].get_ydata() for part in figure.axes[0].containers]
    np.testing.assert_array_equal(np.array(drawn, dtype=float), [[1.0, 2.0], [3.0, np.nan]])


@pytest.mark.parametrize("status", ["ok", "failed"])
def test_runs_of_one_figure_are_drawn_although_their_mean_is_rounded(status):
    figures = {"controller": "a", "case": "c", "seed": [1, 2, 3], "status": status, "reason": "", "x": 0.1}
    assert np.mean([0.1, 0.1, 0.1]) > 0.1
    figure = evaluation_plots.plot_evaluation(pd.DataFrame(figures), ["x"])
    (mark,) = figure.axes[0].containers[0].lines[0].get_ydata()
    assert np.isfinite(mark) == (status == "ok")


def test_the_trade_is_of_runs_that_both_finished_with_damage_averaged_by_its_exponent(tmp_path):
    metrics = [metric for column in evaluation_plots.TRADE.values() for metric in column]
    rows = []
    for name, factor in (("a", 1.0), ("b", 0.5)):
        for case in ("x", "y"):
            for seed in (1, 2):
                row = {"controller": name, "case": case, "seed": seed, "status": "ok"}
                rows.append(row | dict.fromkeys(metrics, factor * seed))
    table = pd.DataFrame(rows)
    lost = (table["controller"] == "b") & (table["case"] == "y") & (table["seed"] == 2)
    table.loc[lost, "status"] = "tripped"
    unequal = (table["controller"] == "b") & (table["case"] == "x") & (table["seed"] == 2)
    table.loc[unequal, metrics] = 2.0
    figure = evaluation_plots.plot_trade(table, "a", tmp_path / "trade.png")
    drawn = {axes.get_title(loc="left"): axes.lines[1].get_ydata() for axes in figure.axes}
    damage = ((0.5**4 + 2.0**4) / (1.0 + 2.0**4)) ** 0.25
    np.testing.assert_allclose(drawn["fatigue loads: shaft torque"], [damage, 0.5])
    np.testing.assert_allclose(drawn["power and pitch drive: blade-pitch travel"], [2.5 / 3.0, 0.5])
    assert [tick.get_text() for tick in figure.axes[-1].get_xticklabels()] == ["x", "y"]
    bottom = evaluation_plots.plot_trade(table, "a", winds={"x": 12.0, "y": 16.5}).axes[-1]
    assert bottom.get_xlabel() == "mean wind speed (m/s)"
    assert list(bottom.lines[1].get_xdata()) == [12.0, 16.5]
    with pytest.raises(InputError, match="shares a case with the baseline 'c'"):
        evaluation_plots.plot_trade(table, "c")


def pareto_board(controllers):
    figure = dict.fromkeys(("low", "high", "seed_low", "seed_high"), np.nan)
    entries = []
    for name, (speed, pitch, travel) in controllers.items():
        values = dict(zip(evaluation_plots.PARETO_METRICS, (speed, pitch, travel, 20.0), strict=True))
        figures = {key: figure | {"mean": value, "worst": value} for key, value in values.items()}
        counts = dict.fromkeys(("lost", "failed", "tripped", "lost_power"), 0)
        entries.append({"controller": name, **counts, "metrics": figures})
    return {"controllers": entries, "cases": ["a"], "interval": {"level": 0.95}}


def test_pareto_marks_have_areas_in_the_ratio_of_pitch_travel_and_names_that_do_not_overlap(tmp_path):
    controllers = {f"controller_{i}": (1.0 + 0.004 * i, 0.9, 0.1 * (i + 1)) for i in range(9)}
    controllers["failed"] = (np.nan, np.nan, np.nan)
    figure = evaluation_plots.plot_pareto(pareto_board(controllers), tmp_path / "pareto.png")
    axes = figure.axes[0]
    sizes = [mark.get_sizes()[0] for mark in axes.collections if hasattr(mark, "get_sizes")]
    assert len(sizes) == 9  # what never finished a run has no place
    assert sizes[3] / sizes[0] == pytest.approx(4.0)
    assert sizes[8] / sizes[0] == pytest.approx(9.0 * np.pi / 4.0)  # a square: all of its box
    figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in axes.texts]  # without its leader
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert (tmp_path / "pareto.png").stat().st_size > 10_000


def test_a_controller_with_lost_runs_is_hollow_and_betters_nobody():
    board = pareto_board({"a": (1.0, 1.0, 0.1), "b": (1.2, 0.8, 0.1), "gamer": (0.5, 0.5, 0.1)})
    board["controllers"][2].update(lost=2, tripped=2)
    axes = evaluation_plots.plot_pareto(board).axes[0]
    marks = [mark for mark in axes.collections if hasattr(mark, "get_sizes")]
    assert [len(mark.get_facecolor()) for mark in marks] == [1, 1, 0]
    (front,) = (line for line in axes.lines if line.get_linestyle() == ":")
    assert list(zip(*front.get_data(), strict=True)) == [(1.0, 1.0), (1.2, 0.8)]
    assert marks[2].get_label().endswith(", 2 tripped")


def test_a_pareto_plot_of_failures_alone_is_refused():
    with pytest.raises(InputError, match="nothing to plot"):
        evaluation_plots.plot_pareto(pareto_board({"x": (np.nan, np.nan, np.nan)}))


def test_a_pareto_plot_has_bars_for_intervals_and_the_range_of_the_seeds_where_there_are_none():
    board = pareto_board({"x": (1.0, 0.9, 0.1)})
    (entry,) = board["controllers"]
    for figure in entry["metrics"].values():
        figure.update(seed_low=0.8 * figure["mean"], seed_high=1.2 * figure["mean"])

    def drawn():
        figure = evaluation_plots.plot_pareto(board)
        axes = figure.axes[0]
        ends = np.concatenate(
            [line.vertices for part in axes.containers for bar in part[2] for line in bar.get_paths()]
        )
        caps = sum(len(part[1]) for part in axes.containers)
        return ends[:, 0].min(), ends[:, 0].max(), caps, figure.get_suptitle()

    low, high, caps, title = drawn()
    assert (low, high) == pytest.approx((0.8, 1.2)) and caps == 0
    assert title.startswith("means over 1 case; ") and "range over the seeds" in title and "%" not in title
    for figure in entry["metrics"].values():
        figure.update(low=0.9 * figure["mean"], high=1.1 * figure["mean"])
    low, high, caps, title = drawn()
    assert (low, high) == pytest.approx((0.9, 1.1)) and caps == 4
    assert "bars: 95 % intervals" in title and "range" not in title


def test_pareto_ratios_are_paired_with_the_baseline_and_never_negative():
    board = pareto_board({"base": (1.0, 0.9, 0.1), "x": (0.5, 0.45, 0.2)})
    board |= {"baseline": "base", "seeds": [1, 2]}
    for entry in board["controllers"]:
        half = {"mean": -0.5, "percent": -40.0, "low": -2.0, "high": 0.1}  # of the runs that both finished
        entry["difference"] = dict.fromkeys(evaluation_plots.PARETO_METRICS, half)
    figure = evaluation_plots.plot_pareto(board)
    axes = figure.axes[0]
    points = [mark.get_offsets()[0].tolist() for mark in axes.collections if hasattr(mark, "get_sizes")]
    assert points == [[1.0, 1.0], [0.6, 0.6]]  # not 0.5: the difference says by how much
    (container,) = axes.containers
    ends = np.concatenate([line.vertices for bar in container[2] for line in bar.get_paths()])
    assert ends.min() == 0.0 and ends.max() == pytest.approx(1.0 + 0.4 * 0.1 / 0.5)
    assert "rotor-speed" in axes.get_xlabel() and "platform-pitch" in axes.get_ylabel()
    for entry in board["controllers"]:
        for gap in entry["difference"].values():
            gap.update(low=np.nan, high=np.nan)
    figure = evaluation_plots.plot_pareto(board)
    assert not figure.axes[0].containers and "2 seeds: no interval" in figure.get_suptitle()


def test_evaluation_plot_joins_no_cases_and_says_metrics_in_words():
    columns = {"controller": ["a", "b"] * 3, "case": list("xxyyzz"), "seed": 1, "status": "ok"}
    table = pd.DataFrame(columns | {"RotSpeed_std_[rpm]": 1.0})
    figure = evaluation_plots.plot_evaluation(table, ["RotSpeed_std_[rpm]"])
    (axes,) = figure.axes
    assert axes.get_title(loc="left") == "rotor speed, std (rpm)"
    assert all(part.lines[0].get_linestyle() == "None" for part in axes.containers)
    assert {label.get_rotation() for label in axes.get_xticklabels()} == {0.0}
    reach = np.concatenate([part.lines[0].get_xdata() for part in axes.containers])
    assert np.abs(reach - np.round(reach)).max() < 0.5 * evaluation_plots.ROOM
    assert evaluation_plots.metric_title("GenPwr_min_[kW]") == "GenPwr min (kW)"
