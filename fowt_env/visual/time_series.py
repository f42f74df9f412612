"""Plots of runs and of evaluations. Needs matplotlib: pip install "fowt-env[plot]".

Every function returns a matplotlib Figure and, if given a path, writes it there. Figures are made
without pyplot, so nothing global is touched and no display is needed.
"""

from pathlib import Path

import numpy as np
from scipy.signal import welch

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

TIME = "Time_[s]"
# Okabe and Ito's palette: told apart with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
INK, FAINT = "#333333", "#D9D9D9"

# one panel each: axis label, channel; a run that lacks the channel gets no such panel
PANELS = (
    ("wind\n(m/s)", "Wind1VelX_[m/s]"),
    ("wave\n(m)", "Wave1Elev_[m]"),
    ("rotor speed\n(rpm)", "RotSpeed_[rpm]"),
    ("blade pitch\n(deg)", "BldPitch1_[deg]"),
    ("power\n(kW)", "GenPwr_[kW]"),
    ("platform pitch\n(deg)", "PtfmPitch_[deg]"),
    ("surge\n(m)", "PtfmSurge_[m]"),
    ("fairlead\ntension (kN)", "FAIRTEN1_[kN]"),
)
SPECTRA = (
    ("wave elevation", "Wave1Elev_[m]", "m"),
    ("platform pitch", "PtfmPitch_[deg]", "deg"),
    ("rotor speed", "RotSpeed_[rpm]", "rpm"),
)


def new_figure(width, height):
    """An empty Figure in the house style. Raises: InputError that names the extra to install."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f'plots need matplotlib ({error}): pip install "fowt-env[plot]"') from error
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def style_axes(axes):
    """Light grid, no box, quiet ticks."""
    axes.grid(True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(INK)
    axes.tick_params(colors=INK, labelsize=8)


def save_figure(figure, path):
    """The figure, written to `path` (format by its ending, default PNG) unless that is None."""
    if path is not None:
        path = Path(path)
        if not path.name:
            raise InputError(f"plot file {str(path)!r}: must name a file")
        if not path.suffix:
            path = path.with_suffix(".png")
        supported = figure.canvas.get_supported_filetypes()
        if path.suffix[1:].lower() not in supported:
            allowed = ", ".join(sorted(supported))
            raise InputError(f"plot file {str(path)!r}: unknown ending; allowed: {allowed}")
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=150)
    return figure


def named_runs(runs):
    """{label: frame} with at least one non-empty run, each with a time column."""
    if not runs:
        raise InputError("nothing to plot: no runs were given")
    for label, frame in runs.items():
        if TIME not in frame.columns or len(frame) < 2:
            raise InputError(f"run {label!r}: needs a column {TIME!r} and at least two rows")
    return runs


def _lines(runs, channel):
    """[(legend text, colour, frame)] of a channel; one line for all where the runs agree (the weather)."""
    name = channel.split("_[")[0]
    having = [
        (index, label, frame) for index, (label, frame) in enumerate(runs.items()) if channel in frame.columns
    ]
    if len(having) > 1:
        first = having[0][2]
        if all(f[channel].equals(first[channel]) and f[TIME].equals(first[TIME]) for _, _, f in having[1:]):
            return [(f"{name} · all", INK, first)]
    return [
        (f"{name} · {label}" if label else name, COLOURS[index % len(COLOURS)], frame)
        for index, label, frame in having
    ]


def plot_run(frame, path=None, title=None):
    """Stacked time series of one run: wind, wave, rotor, blade pitch, power, motions, mooring."""
    return plot_runs({"": frame}, path=path, title=title)


def plot_runs(runs, path=None, title=None):
    """Stacked time series of several runs over each other, {label: frame}."""
    runs = named_runs(runs)
    panels = [panel for panel in PANELS if any(panel[1] in frame.columns for frame in runs.values())]
    if not panels:
        wanted = ", ".join(channel for _, channel in PANELS)
        raise InputError(f"nothing to plot: none of {wanted} is in the run")
    figure = new_figure(9.0, 0.9 + 1.15 * len(panels))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (label, channel) in zip(rows, panels, strict=True):
        style_axes(axes)
        for text, colour, frame in _lines(runs, channel):
            axes.plot(frame[TIME], frame[channel], color=colour, linewidth=0.9, label=text)
        axes.set_ylabel(label, fontsize=8, color=INK)
        axes.margins(x=0.0)
        axes.legend(
            loc="upper left",
            bbox_to_anchor=(1.005, 1.0),
            borderaxespad=0.0,
            fontsize=7,
            frameon=False,
            handlelength=1.2,
        )
    rows[-1].set_xlabel("time (s)", fontsize=9, color=INK)
    figure.align_ylabels(rows)
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)


def spectrum(time, value, segment=None):
    """(frequency Hz, one-sided power spectral density): Welch's estimate, Hann windows, mean removed.

    time must be evenly spaced. segment: seconds per window; None: a third of the record.
    """
    time, value = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    steps = np.diff(time)
    step = steps.mean()
    if np.abs(steps - step).max() > 1e-3 * step:
        raise InputError("spectrum: the times must be evenly spaced")
    length = (time[-1] - time[0]) / 3.0 if segment is None else segment
    samples = int(min(len(value), max(8, round(length / step))))
    return welch(value, fs=1.0 / step, nperseg=samples, detrend="constant")


def plot_spectra(runs, path=None, title=None, skip=0.0, platform_pitch_period=None):
    """Spectra of wave, platform pitch and rotor speed of {label: frame} or of one frame.

    Vertical lines mark the wave peak, 1P (mean rotor speed of the first run) and, if its period
    is given (s), the platform-pitch natural frequency. The first `skip` seconds are left out.
    """
    runs = named_runs(runs if isinstance(runs, dict) else {"": runs})
    runs = named_runs({label: f[f[TIME] >= f[TIME].iloc[0] + skip] for label, f in runs.items()})
    shown = [entry for entry in SPECTRA if any(entry[1] in frame.columns for frame in runs.values())]
    if not shown:
        raise InputError(f"nothing to plot: none of {', '.join(entry[1] for entry in SPECTRA)} is in the run")
    figure = new_figure(9.0, 0.9 + 2.1 * len(shown))
    rows = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    marks = frequency_marks(next(iter(runs.values())), platform_pitch_period)
    for axes, (label, channel, unit) in zip(rows, shown, strict=True):
        style_axes(axes)
        top = 0.0
        for text, colour, frame in _lines(runs, channel):
            frequency, density = spectrum(frame[TIME], frame[channel])
            axes.plot(frequency[1:], density[1:], color=colour, linewidth=1.1, label=text)
            top = max(top, density[1:].max())
        if top > 0.0:  # a constant channel has no logarithm
            axes.set_yscale("log")
            axes.set_ylim(top * 1e-6, top * 4.0)
        for number, (_, at) in enumerate(marks):
            axes.axvline(at, color=INK, linewidth=0.9, linestyle=("--", ":", "-.")[number % 3])
        axes.set_ylabel(f"{label}\n({unit}²/Hz)", fontsize=8, color=INK)
        axes.legend(loc="upper right", fontsize=7, frameon=False)
    for number, (name, at) in enumerate(sorted(marks, key=lambda mark: mark[1])):
        rows[0].annotate(
            f"{name} {at:.3g} Hz",
            (at, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3 + 10 * (number % 2)),  # neighbours at two heights
            textcoords="offset points",
            fontsize=7,
            ha="center",
            color=INK,
            annotation_clip=False,
        )
    rows[-1].set_xscale("log")
    rows[-1].set_xlim(0.005, 0.5)
    rows[-1].set_xlabel("frequency (Hz)", fontsize=9, color=INK)
    figure.align_ylabels(rows)
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)


def frequency_marks(frame, platform_pitch_period=None):
    """[(name, Hz)] of the platform-pitch natural frequency, the wave peak and 1P, where there are such."""
    marks = []
    if platform_pitch_period is not None:
        check_number("platform_pitch_period", platform_pitch_period, 0.0, low_open=True)
        marks.append(("platform pitch", 1.0 / platform_pitch_period))
    wave = frame.get("Wave1Elev_[m]")
    if wave is not None and np.ptp(wave) > 1e-6:
        frequency, density = spectrum(frame[TIME], wave)
        marks.append(("wave peak", frequency[np.argmax(density)]))
    speed = frame.get("RotSpeed_[rpm]")
    if speed is not None and speed.mean() > 1e-3:
        marks.append(("1P", speed.mean() / 60.0))
    return marks


def plot_evaluation(table, metrics, path=None, title=None):
    """One panel per metric: each case on the x axis, one line per controller, spread over seeds.

    table      the DataFrame of training.evaluation.evaluate.evaluate; failed runs are left out and counted
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
    good = table[table["status"] == "ok"]
    for axes, name in zip(panels, metrics, strict=False):
        style_axes(axes)
        for index, controller in enumerate(controllers):
            groups = good[good["controller"] == controller].groupby("case")[name]
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
    failed = len(table) - len(good)
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=len(controllers),
        fontsize=8,
        frameon=False,
        title=f"{failed} of {len(table)} runs failed and are not shown" if failed else None,
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
            entries.append((entry["controller"], entry["failed"], figures))
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
        lost = f", {failed} failed" if failed else ""
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
