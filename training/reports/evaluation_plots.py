"""Plots of an evaluation: metrics over cases, and the Pareto plot of a leaderboard."""

import numpy as np

from fowt_env.errors import InputError
from fowt_env.training.evaluation.failures import failures_as_worst
from fowt_env.visual.style import COLOURS, INK, new_figure, save_figure, style_axes


def plot_evaluation(table, metrics, path=None, title=None):
    """One panel per metric: each case on the x axis, one line per controller, spread over seeds.

    table      the DataFrame of training.evaluation.evaluate.evaluate; failed and tripped runs have the worst
               figures of their case, and are counted
    metrics    column names; marks are the mean over the seeds, bars reach from least to greatest
    """
    metrics = [name for name in metrics if name in table.columns]
    if not metrics or table.empty:
        raise InputError("nothing to plot: the table has no rows or none of the metrics")
    columns = min(3, len(metrics))
    rows = -(-len(metrics) // columns)
    figure = new_figure(4.0 * columns, 0.9 + 2.2 * rows)
    panels = list(figure.subplots(rows, columns, sharex=True, squeeze=False).flat)
    cases = list(dict.fromkeys(table["case"]))
    controllers = list(dict.fromkeys(table["controller"]))
    counted = failures_as_worst(table)
    for axes, name in zip(panels, metrics, strict=False):
        style_axes(axes)
        for index, controller in enumerate(controllers):
            groups = counted[counted["controller"] == controller].groupby("case")[name]
            mean, low, high = (getattr(groups, what)().reindex(cases) for what in ("mean", "min", "max"))
            offset = 0.12 * (index - 0.5 * (len(controllers) - 1))
            axes.errorbar(
                np.arange(len(cases)) + offset,
                mean,
                yerr=np.array([mean - low, high - mean]),
                color=COLOURS[index % len(COLOURS)],
                marker="o",
                markersize=4,
                linewidth=1.0,
                capsize=2,
                label=controller,
            )
        axes.set_title(name.replace("_", " "), fontsize=8, color=INK, loc="left")
        axes.set_xticks(np.arange(len(cases)), cases, rotation=45, ha="right", fontsize=7)
        axes.tick_params(axis="x", labelbottom=True)
    for axes in panels[len(metrics) :]:
        axes.set_visible(False)
    failed = int((table["status"] != "ok").sum())
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=len(controllers),
        fontsize=8,
        frameon=False,
        title=f"{failed} of {len(table)} runs failed or tripped: the worst of their case" if failed else None,
        title_fontsize=8,
    )
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)


PARETO_METRICS = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]", "overspeed_[%]")
LARGEST_MARK = 900.0  # points squared, of the controller that travels most


def plot_pareto(board, path=None, title=None):
    """Rotor-speed against platform-pitch deviation of each controller; the mark's area is its pitch travel.

    board: mapping of a leaderboard. Bars are its intervals, or, with too few seeds for
    one, lines without ends the range over the seeds; the stepped line joins the controllers that no other
    betters in both deviations. The legend gives travel and greatest overspeed.
    """
    entries = []
    for entry in board["controllers"]:
        figures = [entry["metrics"][name] for name in PARETO_METRICS]
        if all(np.isfinite([figure["mean"] for figure in figures])) and figures[0]["mean"] > 0.0:
            entries.append((entry["controller"], entry["failed"] + entry["tripped"], figures))
    if not entries:
        raise InputError("nothing to plot: no controller has finished a run")
    figure = new_figure(9.0, 5.6)
    axes = figure.subplots()
    style_axes(axes)
    axes.margins(0.12)
    points = np.array([[f["mean"] for f in figures[:3]] for _, _, figures in entries])
    areas = np.maximum(LARGEST_MARK * points[:, 2] / max(points[:, 2].max(), 1e-9), 4.0)
    front = _undominated(points[:, :2])
    if len(front) > 1:
        axes.step(*front.T, where="post", color=INK, linewidth=0.8, linestyle=":", zorder=1)
    marks, drawn = [], set()
    for number, ((name, failed, figures), (x, y, travel)) in enumerate(zip(entries, points, strict=True)):
        colour = COLOURS[number % len(COLOURS)]
        square = number // len(COLOURS) % 2  # its area is the whole box of its size, a circle's pi/4 of it
        for low, high, cap in (("low", "high", 2), ("seed_low", "seed_high", 0)):
            bars = np.array([[[f["mean"] - f[low]], [f[high] - f["mean"]]] for f in figures[:2]])
            if np.isfinite(bars).all():
                bars = np.maximum(bars, 0.0)  # rounding
                style = {"color": colour, "linewidth": 1.0, "capsize": cap, "zorder": 2}
                axes.errorbar(x, y, xerr=bars[0], yerr=bars[1], **style)
                drawn.add(low)
                break
        lost = f", {failed} lost" if failed else ""
        marks.append(
            axes.scatter(
                [x],
                [y],
                s=[areas[number] * (np.pi / 4.0 if square else 1.0)],
                marker="s" if square else "o",
                color=colour,
                alpha=0.55,
                edgecolor=colour,
                zorder=3,
                label=f"{name}: {travel:.3f} deg/s, {figures[3]['worst']:.0f} %{lost}",
            )
        )
    axes.set_xlabel("standard deviation of rotor speed (rpm)", fontsize=9, color=INK)
    axes.set_ylabel("standard deviation of platform pitch (deg)", fontsize=9, color=INK)
    legend = figure.legend(
        handles=marks,
        loc="outside right upper",
        fontsize=8,
        frameon=False,
        title="pitch travel, greatest overspeed",
        title_fontsize=8,
        alignment="left",
    )
    for handle in legend.legend_handles:
        handle.set_sizes([40.0])
    level = round(100 * board["interval"]["level"])
    cases = len(board["cases"])
    text = f"means over {cases} case{'' if cases == 1 else 's'}; area of a mark: pitch travel"
    text += f"; bars: {level} % intervals" if "low" in drawn else ""
    text += "; lines: range over the seeds, too few for an interval" if "seed_low" in drawn else ""
    axes.set_title(text, fontsize=8, color=INK, loc="left")
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    _label_marks(figure, axes, [name for name, _, _ in entries], points[:, :2], areas)
    return save_figure(figure, path)


def _undominated(points):
    """The points (n, 2) that no other betters in both figures, from left to right."""
    kept = [p for p in points if not ((points <= p).all(axis=1) & (points < p).any(axis=1)).any()]
    return np.array(sorted(map(tuple, kept)))


def _label_marks(figure, axes, names, points, areas):
    """Write each name beside its mark, where it covers no other mark or name if there is such a place."""
    figure.draw_without_rendering()  # settles the layout, and with it where the marks are
    size = 8.0
    per_point = figure.dpi / 72.0
    centres = axes.transData.transform(points) / per_point  # in points
    radii = 0.5 * np.sqrt(areas)
    taken = [
        (x - r, y - r, x + r, y + r) for (x, y), r in zip(centres, radii, strict=True)
    ]  # boxes, in points

    def overlap(one, other):
        wide = min(one[2], other[2]) - max(one[0], other[0])
        high = min(one[3], other[3]) - max(one[1], other[1])
        return max(0.0, wide) * max(0.0, high)

    for name, point, (x, y), r in zip(names, points, centres, radii, strict=True):
        width, height = 0.6 * size * len(name), 1.2 * size
        places = []
        for way in (1.0, 2.2, 3.6):
            for dx, dy in ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1)):
                gap = 0.75 * r * way + 2.0 if dx else r * way + 2.0
                left = x + dx * gap - (width if dx < 0 else 0.0 if dx else 0.5 * width)
                low = y + dy * gap - (height if dy < 0 else 0.0)
                places.append((left, low, left + width, low + height))
        best = min(places, key=lambda place: sum(overlap(place, other) for other in taken))
        taken.append(best)
        axes.annotate(
            name,
            point,
            xytext=(best[0] - x, best[1] - y),
            textcoords="offset points",
            fontsize=size,
            color=INK,
            annotation_clip=False,
        ).set_in_layout(False)
