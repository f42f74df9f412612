"""Plots agents with baselines and the performance limit, and one gust under many controllers.

As in visual/time_series.py, every function returns a matplotlib Figure and writes it to a path, if any.
"""

from fowt_env.errors import InputError
from fowt_env.training.design.plots import WIND, draw_fronts, finish_bound
from fowt_env.visual.style import COLOURS, INK, new_figure, style_numbers
from fowt_env.visual.time_series import PANELS, TIME, named_runs, plot_runs

AGENT_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*", "p", "h")
FRONTS = {  # line styles of the Pareto fronts
    name: {"color": INK, "linewidth": 1.2, "ls": line, "label": text}
    for name, line, text in (
        ("full", "-", "limit: plant, wind and waves"),
        ("measured", "--", "limit: five sensors"),
        ("full_preview_11", ":", "limit: wind 11 s ahead"),
    )
}
FRAME = 1.3  # upper end of both axes of plot_fractions
HOLLOW = "hollow: more travel or power\ndeviation than gspi_oc3"
GUST = (  # panels of plot_gust
    *(panel for panel in PANELS if panel[1] not in ("Wave1Elev_[m]", "PtfmSurge_[m]")),
    ("tower-base\nmoment (kN m)", "TwrBsMyt_[kN-m]"),
)


def plot_fractions(fractions, bound, path=None, title=None):
    """Plot rotor-speed and platform-pitch deviation relative to gspi_oc3 per wind, with Pareto fronts.

    fractions: bound_scores.bound_fractions; bound: linear_bound.bound_table. Large marks: agents; small ones:
    their training seeds. Hollow: more travel or power deviation than gspi_oc3, so that the limit does not
    apply. Agents outside FRAME are listed in the corner with their ratios.
    """
    winds = sorted(fractions[WIND].unique())
    if not winds:
        raise InputError("nothing to plot: no wind has both a Pareto front and runs")
    columns = min(4, len(winds) + 1)
    rows = -(-(len(winds) + 1) // columns)
    figure = new_figure(3.1 * columns + 0.6, 3.1 * rows + 0.3)
    panels = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    names = list(dict.fromkeys(fractions["agent"]))
    styles = [
        (name, COLOURS[number % len(COLOURS)], AGENT_MARKERS[number % len(AGENT_MARKERS)])
        for name, number in zip(names, style_numbers(names), strict=True)
    ]  # 84 distinct ones
    for axes, wind in zip(panels, winds, strict=False):
        draw_fronts(axes, bound, wind, FRONTS, (FRAME, FRAME))
        at = fractions[fractions[WIND] == wind]
        beyond = 0
        for name, colour, mark in styles:
            beyond += _marks(axes, at[at["agent"] == name], colour, mark, beyond)
            style = {"facecolor": colour, "edgecolor": INK, "linewidth": 0.5}
            axes.scatter([], [], marker=mark, s=46, label=name, **style)  # legend entry
        axes.scatter([], [], marker="o", s=46, facecolor="none", edgecolor=INK, label=HOLLOW)
    return finish_bound(figure, panels, len(winds), path, title)


def _marks(axes, rows, colour, mark, beyond):
    """Draw one agent at one wind; return the number of agents (0 or 1) outside the frame.

    The ratios of such an agent are written in the corner, below those of `beyond` other agents.
    """
    outside = 0
    for row in rows.sort_values("seed_of").to_dict("records"):
        whole = row["seed_of"] == ""
        x, y = row["speed_ratio_[-]"], row["pitch_ratio_[-]"]
        if max(x, y) > FRAME:
            if whole:
                corner = 0.98 * FRAME, (0.96 - 0.06 * beyond) * FRAME
                axes.annotate(f"{x:.2f}, {y:.2f}", corner, fontsize=7, color=colour, ha="right", va="center")
                axes.scatter(0.72 * FRAME, corner[1], marker=mark, s=14, color=colour)
                outside = 1
            continue
        style = {"facecolor": colour, "edgecolor": INK if whole else "white", "linewidth": 0.5}
        if not row["within"]:
            style = {"facecolor": "white" if whole else "none", "edgecolor": colour, "linewidth": 1.2}
        size, level = (46, 6) if whole else (14, 7)  # seeds are drawn above their mean
        axes.scatter(x, y, marker=mark, s=size, zorder=level, **style)
    return outside


def plot_gust(runs, path=None, title=None, start=None, end=None):
    """Plot the time series of {controller: frame} between two times (s), with one legend for all panels."""
    low, high = -float("inf") if start is None else start, float("inf") if end is None else end
    kept = {label: frame[frame[TIME].between(low, high)] for label, frame in named_runs(runs).items()}
    return plot_runs(kept, path, title, panels=GUST)
