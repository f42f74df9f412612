"""Plots an evaluation: metrics over cases, the Pareto plot of a leaderboard, and the runs of each case."""

import json

import numpy as np

from fowt_env.descriptions.platform import Platform, read_platform, turbine_of
from fowt_env.descriptions.ratings import ratings
from fowt_env.errors import InputError
from fowt_env.files.tables import read_table
from fowt_env.training.design.linear_bound import efficient
from fowt_env.training.evaluation.cases import Case, mean_speed
from fowt_env.training.evaluation.failures import known_figures, lost_text
from fowt_env.training.evaluation.metrics import mean_exponent
from fowt_env.training.evaluation.results import file_name, run_file
from fowt_env.training.evaluation.run_case import OK, REFERENCE
from fowt_env.training.reports.metric_words import counted
from fowt_env.training.reports.terminal import PRINTED_METRICS
from fowt_env.visual.response import plot_boxes
from fowt_env.visual.style import (
    COLOURS,
    FAINT,
    INK,
    SOFT,
    head,
    new_figure,
    save_figure,
    short_names,
    style_axes,
    style_numbers,
)
from fowt_env.visual.time_series import TIME, plot_runs, plot_spectra

TITLES = {name: title for _, name, _, _, title in PRINTED_METRICS}
UPRIGHT = 6  # characters of a case's name that fit horizontally below a group of marks
# candidate positions of a label around its mark: directions (right, up) and distances (points)
SIDES = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0)])
WAYS = np.array([0.0, 10.0, 22.0, 36.0, 52.0, 70.0])
ROOM = 0.6  # fraction of the spacing of cases that the marks of one case may occupy


def metric_title(name):
    """Return the title of a metric's panel, from TITLES or else its name and unit."""
    if name in TITLES:
        return TITLES[name]
    text, _, unit = name.rpartition("_[")
    return f"{text.replace('_', ' ')} ({unit[:-1].replace('-', ' ')})" if text else name.replace("_", " ")


def plot_evaluation(table, metrics, path=None, title=None):
    """Plot one panel per metric: a group of marks for each case, one mark per controller.

    table      the DataFrame of training.evaluation.evaluate.evaluate; lost runs are omitted and counted
    metrics    column names; marks: mean over the seeds; bars: minimum to maximum
    """
    metrics = [name for name in metrics if name in table.columns]
    if not metrics or table.empty:
        raise InputError("nothing to plot: the table has no rows or none of the metrics")
    cases = list(dict.fromkeys(table["case"]))
    controllers = list(dict.fromkeys(table["controller"]))
    columns = min(3 if len(cases) * len(controllers) <= 40 else 2, len(metrics))
    rows = -(-len(metrics) // columns)
    figure = new_figure((12.5 if columns > 1 else 6.5), 1.0 + 1.9 * rows)
    panels = list(figure.subplots(rows, columns, sharex=True, squeeze=False).flat)
    known = known_figures(table, metrics)
    step = ROOM / max(len(controllers), 4)
    per_case = 12.0 * 72.0 / columns / max(1, len(cases)) / 4.5  # characters
    turned = max(map(len, cases)) > max(UPRIGHT, per_case)
    for axes, name in zip(panels, metrics, strict=False):
        style_axes(axes)
        axes.grid(False, axis="x")
        numbered = zip(style_numbers(controllers), controllers, strict=True)
        for index, (number, controller) in enumerate(numbered):
            groups = known[known["controller"] == controller].groupby("case")[name]
            mean, low, high = (getattr(groups, what)().reindex(cases) for what in ("mean", "min", "max"))
            offset = step * (index - 0.5 * (len(controllers) - 1))
            axes.errorbar(
                np.arange(len(cases)) + offset, mean,
                yerr=np.maximum([mean - low, high - mean], 0.0),  # the mean of equal values is rounded
                color=COLOURS[number % len(COLOURS)], marker=MARKS[number % len(MARKS)], markersize=4,
                linestyle="none", elinewidth=1.0, capsize=0, label=controller,  # cases have no order: no line
            )  # fmt: skip
        for edge in np.arange(0.5, len(cases) - 1):
            axes.axvline(edge, color=FAINT, linewidth=0.8, zorder=0)
        axes.set_title(metric_title(name), fontsize=9, color=INK, loc="left")
        rotation = {"rotation": 90} if turned else {}
        axes.set_xticks(np.arange(len(cases)), cases, fontsize=8, **rotation)
        axes.set_xlim(-0.5, len(cases) - 0.5)
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.tick_params(axis="x", labelbottom=True, length=0)
    for axes in panels[len(metrics) :]:
        axes.set_visible(False)
    lost = int((table["status"] != OK).sum())
    texts = short_names(controllers)
    heading = [title] if title else []
    if lost:
        heading.append(f"{lost} of {len(table)} runs were lost and are left out")
    handles = panels[0].get_legend_handles_labels()[0]
    head(figure, "; ".join(heading), handles, [texts[name] for name in controllers])
    return save_figure(figure, path)


TRADE = {  # what a controller gives and takes, a column each: {theme: {metric: title}}
    "motions": {"RotSpeed_std_[rpm]": "rotor speed", "PtfmPitch_std_[deg]": "platform pitch"},
    "fatigue loads": {"RotTorq_DEL_[kN-m]": "shaft torque", "TwrBsMyt_DEL_[kN-m]": "tower base"},
    "power and pitch drive": {
        "GenPwr_std_[kW]": "power deviation",
        "blade_pitch_travel_[deg/s]": "blade-pitch travel",
    },
}


def plot_trade(table, baseline, path=None, title=None, winds=None):
    """Plot motions, loads, power and pitch travel of each controller over those of the baseline, per case.

    table: as of plot_evaluation. Each ratio is of means over the seeds that both controllers finished, with
    the exponents of mean_exponent. winds: {case: mean wind speed in m/s}, the axis if it has all cases once
    each; None: names of the cases. Raises: InputError if no controller shares a case with the baseline.
    """
    cases = list(dict.fromkeys(table["case"]))
    good = table[table["status"] == OK].set_index(["controller", "case", "seed"])
    others = [name for name in dict.fromkeys(table["controller"]) if name != baseline]
    base = good.xs(baseline) if baseline in good.index else good.iloc[:0].droplevel(0)
    figure = new_figure(12.5, 5.6)
    panels = figure.subplots(2, len(TRADE), sharex=True, squeeze=False)
    speeds = [(winds or {}).get(case) for case in cases]
    windy = None not in speeds and len(set(speeds)) == len(cases)
    places, ticks = (speeds, [f"{speed:g}" for speed in speeds]) if windy else (np.arange(len(cases)), cases)
    drawn = False
    for column, (theme, metrics) in enumerate(TRADE.items()):
        for axes, metric in zip(panels[:, column], metrics, strict=True):
            style_axes(axes)
            axes.axhline(1.0, color=SOFT, linewidth=0.9, linestyle=(0, (5, 3)))
            power = mean_exponent(metric)
            for number, name in zip(style_numbers(others), others, strict=True):
                if name not in good.index:
                    continue
                own = good.xs(name)[metric]
                both = own.index.intersection(base.index)
                means = [(values.loc[both] ** power).groupby("case").mean() for values in (own, base[metric])]
                ratio = (means[0] / means[1]).reindex(cases) ** (1.0 / power)
                drawn = drawn or bool(np.isfinite(ratio).any())
                axes.plot(
                    places, ratio, color=COLOURS[number % len(COLOURS)], linewidth=1.4,
                    marker=MARKS[number % len(MARKS)], markersize=4, label=name,
                )  # fmt: skip
            axes.set_title(f"{theme}: {metrics[metric]}", fontsize=9, color=INK, loc="left")
            axes.set_xticks(places, ticks, fontsize=8, rotation=0 if windy else 30)
        if windy:
            axes.set_xlabel("mean wind speed (m/s)", fontsize=8, color=SOFT)
    if not drawn:
        raise InputError(f"nothing to plot: no controller shares a case with the baseline {baseline!r}")
    names = short_names(others)
    handles = panels[0, 0].get_legend_handles_labels()[0]
    text = f"ratios to {baseline}, means over seeds"
    head(figure, f"{title}: {text}" if title else text, handles, [names[name] for name in others])
    return save_figure(figure, path)


PARETO_METRICS = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]", "overspeed_[%]")
LARGEST_MARK = 420.0  # points squared, of the controller with the most pitch travel
SMALLEST_MARK = 16.0
MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")  # one more than colours: 56 pairs


def plot_pareto(board, path=None, title=None, order=()):
    """Plot rotor-speed std (x) against platform-pitch std (y) of each controller, as ratios to the baseline.

    board: mapping of a leaderboard. Bars: intervals of the paired ratios, over the runs that both controllers
    finished; omitted with too few seeds. Area of a mark: mean blade-pitch rate; hollow: the controller has
    lost runs. Stepped line: Pareto front of the controllers without lost runs. Without a baseline the axes
    are in rpm and deg, and bars are the intervals of the means or, with too few seeds, the range over the
    seeds, without caps. order: controllers in the order (and colours) of other plots.
    """
    order = list(dict.fromkeys([*order, *(entry["controller"] for entry in board["controllers"])]))
    numbers, kept = dict(zip(order, style_numbers(order), strict=True)), []
    for entry in board["controllers"]:
        metrics = [entry["metrics"][name] for name in PARETO_METRICS]
        if all(np.isfinite([figure["mean"] for figure in metrics])) and metrics[0]["mean"] > 0.0:
            kept.append((entry, metrics))
    if not kept:
        raise InputError("nothing to plot: no controller has finished a run")
    base = next((metrics for entry, metrics in kept if entry["controller"] == board.get("baseline")), None)
    positions = [_position(entry, metrics, base, board.get("baseline")) for entry, metrics in kept]
    figure = new_figure(9.0, 5.8)
    axes = figure.subplots()
    style_axes(axes)
    points = np.array([point for point, _, _ in positions])
    rates = np.array([metrics[2]["mean"] for _, metrics in kept])
    areas = np.maximum(LARGEST_MARK * rates / max(rates.max(), 1e-9), SMALLEST_MARK)
    whole = [not entry["lost"] for entry, _ in kept]  # a controller with lost runs is not on the front
    front = efficient(points[whole])
    if len(front) > 1:
        axes.step(*front.T, where="post", color=INK, linewidth=0.8, linestyle=":", zorder=1)
    if base is not None:
        for line in (axes.axvline, axes.axhline):
            line(1.0, color=SOFT, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1)
    names = short_names([entry["controller"] for entry, _ in kept])
    marks, drawn = [], set()
    for index, ((entry, metrics), (point, bars, kind)) in enumerate(zip(kept, positions, strict=True)):
        number = numbers[entry["controller"]]
        colour = COLOURS[number % len(COLOURS)]
        square = number // len(COLOURS) % 2  # scatter's s is the bounding box: a circle fills pi/4
        if bars is not None:
            style = {"color": colour, "linewidth": 1.0, "capsize": 0 if kind == "seeds" else 2, "zorder": 2}
            axes.errorbar(*point, xerr=bars[0], yerr=bars[1], **style)
            drawn.add(kind)
        text = f"{names[entry['controller']]}: {rates[index]:.3f} deg/s, {metrics[3]['mean']:.0f} %"
        marks.append(
            axes.scatter(
                *point,
                s=areas[index] * (np.pi / 4.0 if square else 1.0),
                marker="s" if square else "o",
                facecolor="none" if entry["lost"] else colour,
                alpha=0.6,
                edgecolor=colour if entry["lost"] else INK,
                linewidth=1.2 if entry["lost"] else 0.6,
                zorder=3,
                label=text + (f", {lost_text(entry)}" if entry["lost"] else ""),
            )
        )
    over = "" if base is None else f" over that of {names[board['baseline']]}"
    unit = ("", "") if base is not None else (" (rpm)", " (deg)")
    axes.set_xlabel(f"rotor-speed standard deviation{over}{unit[0]}", fontsize=9, color=INK)
    axes.set_ylabel(f"platform-pitch standard deviation{over}{unit[1]}", fontsize=9, color=INK)
    axes.margins(0.1)
    if base is not None:
        _absolute_axes(axes, base[0]["mean"], base[1]["mean"])
    legend = figure.legend(
        handles=marks,
        loc="outside right upper",
        fontsize=8,
        frameon=False,
        title="mean blade-pitch rate (mark area),\noverspeed; hollow: lost runs",
        title_fontsize=8,
        alignment="left",
    )
    for handle in legend.legend_handles:
        handle.set_sizes([40.0])
    level = round(100 * board["interval"]["level"])
    text = f"means over {counted(len(board['cases']), 'case')}"
    text += f"; bars: {level} % intervals of the paired ratio" if "ratio" in drawn else ""
    text += f"; bars: {level} % intervals" if "mean" in drawn else ""
    text += "; lines: range over the seeds, too few for an interval" if "seeds" in drawn else ""
    if base is not None and not drawn:
        text += f"; {counted(len(board.get('seeds', ())), 'seed')}: no interval"
    figure.suptitle(f"{title}\n{text}" if title else text, fontsize=9, color=INK, x=0.01, ha="left")
    labels = [names[entry["controller"]] for entry, _ in kept]
    label_marks(figure, axes, labels, points, areas, positions, base is not None)
    return save_figure(figure, path)


def _absolute_axes(axes, speed, pitch):
    """Add secondary axes in rpm and deg at the top and on the right."""
    top = axes.secondary_xaxis("top", functions=(lambda x: x * speed, lambda x: x / speed))
    right = axes.secondary_yaxis("right", functions=(lambda y: y * pitch, lambda y: y / pitch))
    top.set_xlabel("rotor speed, std (rpm)", fontsize=8, color=SOFT)
    right.set_ylabel("platform pitch, std (deg)", fontsize=8, color=SOFT)
    for other in (top, right):
        other.tick_params(colors=SOFT, labelsize=7)
        for spine in other.spines.values():
            spine.set_visible(False)


def _position(entry, metrics, base, baseline):
    """Return a controller's point (2,), bars (2, 2, 1) or None, and the kind of bars ("" without bars)."""
    if base is not None and entry["controller"] == baseline:
        return np.ones(2), None, ""
    if base is not None:
        gaps = [entry["difference"][name] for name in PARETO_METRICS[:2]]
        fractions = [0.01 * gap["percent"] for gap in gaps]
        if np.isfinite(fractions).all():
            point = 1.0 + np.array(fractions)
            ends = [_ratio_ends(gap, fraction) for gap, fraction in zip(gaps, fractions, strict=True)]
            if not np.isfinite(ends).all():
                return point, None, ""
            bars = [[[at - low], [high - at]] for at, (low, high) in zip(point, ends, strict=True)]
            return point, np.maximum(bars, 0.0), "ratio"  # rounding
        return np.array([f["mean"] / b["mean"] for f, b in zip(metrics[:2], base[:2], strict=True)]), None, ""
    point = np.array([figure["mean"] for figure in metrics[:2]])
    for low, high, kind in (("low", "high", "mean"), ("seed_low", "seed_high", "seeds")):
        bars = np.array([[[f["mean"] - f[low]], [f[high] - f["mean"]]] for f in metrics[:2]])
        if np.isfinite(bars).all():
            return point, np.maximum(bars, 0.0), kind
    return point, None, ""


def _ratio_ends(gap, fraction):
    """Return (low, high) of 1 + difference/baseline; a ratio of deviations is never negative."""
    if gap["low"] != gap["low"] or gap["mean"] == 0.0:
        return (np.nan, np.nan) if gap["low"] != gap["low"] else (1.0, 1.0)
    return tuple(max(0.0, 1.0 + fraction * gap[end] / gap["mean"]) for end in ("low", "high"))


def label_marks(figure, axes, names, points, areas, positions, ratios=False):
    """Write each name next to its mark, if possible without covering a mark, bar or other name.

    names: "" for a mark without one; points (n, 2) in data units; areas of the marks, points squared;
    positions: [(any, bars (2, 2, 1) about the point or None, any)]; ratios: whether lines cross at (1, 1).
    """
    from matplotlib.patheffects import withStroke

    figure.draw_without_rendering()  # fixes the layout and the positions of the marks
    size, per_point = 8.0, figure.dpi / 72.0

    def placed(where):
        return axes.transData.transform(where) / per_point

    centres, radii = placed(points), 0.5 * np.sqrt(areas)
    taken = [(x - r, y - r, x + r, y + r) for (x, y), r in zip(centres, radii, strict=True)]  # in points
    for point, (_, bars, _) in zip(points, positions, strict=True):
        if bars is not None:
            low, high = placed([point - bars[:, 0, 0], point + bars[:, 1, 0]])
            x, y = placed([point])[0]
            taken += [(low[0], y - 1.0, high[0], y + 1.0), (x - 1.0, low[1], x + 1.0, high[1])]
    frame = axes.get_window_extent().extents / per_point
    if ratios:  # lines through the baseline
        (x, y), (left, low, right, high) = placed([(1.0, 1.0)])[0], frame
        taken += [(x - 1, low, x + 1, high), (left, y - 1, right, y + 1)]

    def overlap(boxes, others):
        """Return the common areas (n, m)."""
        sides = np.minimum(boxes[:, None, 2:], others[:, 2:]) - np.maximum(boxes[:, None, :2], others[:, :2])
        return np.maximum(sides, 0.0).prod(axis=2)

    diagonal = SIDES.all(axis=1)
    for name, point, centre, r in zip(names, points, centres, radii, strict=True):
        if not name:
            continue
        shape = np.array([0.58 * size * len(name), 1.25 * size])
        gaps = np.where(diagonal, 0.75, 1.0) * r + 2.5 + WAYS[:, None] * np.where(diagonal, 0.7, 1.0)
        low = (centre + gaps[:, :, None] * SIDES - 0.5 * (1.0 - SIDES) * shape).reshape(-1, 2)
        boxes = np.hstack([low, low + shape])
        outside = shape.prod() - overlap(boxes, frame[None])[:, 0]
        cost = overlap(boxes, np.array(taken)).sum(axis=1) + 20.0 * outside + 0.15 * WAYS.repeat(len(SIDES))
        best = int(np.argmin(cost))
        taken.append(tuple(boxes[best]))
        leader = {"arrowstyle": "-", "color": SOFT, "linewidth": 0.6, "shrinkA": 0, "shrinkB": float(r)}
        axes.annotate(
            name, point, low[best] - centre, textcoords="offset points", fontsize=size, color=INK, zorder=5,
            annotation_clip=False, arrowprops=leader if best >= len(SIDES) else None,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        ).set_in_layout(False)  # fmt: skip


def evaluation_plots(table, board, folder):
    """Plot the results of a folder from its table and leaderboard; return the paths.

    pareto.png: rotor-speed against platform-pitch deviation; trade.png (several controllers and cases, and a
    baseline): motions, loads and power over the baseline's; metrics.png: the controllers over all cases;
    boxes.png, timeseries_CASE.png and spectra_CASE.png: quartiles, series and spectra of the first seed of
    each case that succeeded.
    """
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    table = table[table["controller"] != REFERENCE]
    good = table[table["status"] == OK]
    if good.empty:
        return []
    paths = [folder / "pareto.png", folder / "metrics.png"]
    plot_pareto(board, paths[0], order=table["controller"].unique())
    baseline = board.get("baseline")
    several = good["controller"].nunique() > 1 and good["case"].nunique() > 1
    if several and baseline in set(good["controller"]):
        paths.append(folder / "trade.png")
        winds = {
            case: mean_speed(Case(case, wind=about["wind"])) for case, about in manifest["cases"].items()
        }
        plot_trade(table, baseline, paths[-1], winds=winds)
    names = [name for _, name, *_ in PRINTED_METRICS]
    plot_evaluation(table, names, paths[1], "Mean over seeds, with their range")
    boxes = {}
    for case, about in manifest["cases"].items():
        rows = good[good["case"] == case]
        if rows.empty:
            continue
        seed = rows["seed"].iloc[0]
        names = rows.loc[rows["seed"] == seed, "controller"]
        runs = {name: read_table(run_file(folder / "runs", name, case, seed)) for name in names}
        name = file_name(case)
        paths += [folder / f"timeseries_{name}.png", folder / f"spectra_{name}.png"]
        title = f"{case}, seed {seed}"
        plot_runs(runs, paths[-2], title, skip=about["skip"], ratings=ratings(turbine_of(about["platform"])))
        period = platform_pitch_period(about["platform"])
        plot_spectra(runs, paths[-1], title, about["skip"], platform_pitch_period=period)
        boxes[case] = {name: frame[frame[TIME] >= about["skip"]] for name, frame in runs.items()}
    paths.append(folder / "boxes.png")
    plot_boxes(boxes, paths[-1], "First seed of each case: quartiles, and 1 to 99 %")
    return paths


def platform_pitch_period(platform):
    """Return the published natural period in platform pitch, s, or None."""
    description = platform if isinstance(platform, Platform) else read_platform(platform)
    return description.published.get("natural_periods", {}).get("pitch")
