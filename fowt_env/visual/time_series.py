"""Plots time series and spectra of runs. Needs matplotlib: pip install "fowt-env[plot]".

Every function returns a matplotlib Figure and writes the figure to `path` unless `path` is None. Figures are
created without pyplot: no global state, no display.
"""

import numpy as np
from scipy.signal import welch

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.ratings import OVERSPEED, RATED_POWER, RATED_SPEED
from fowt_env.errors import InputError
from fowt_env.visual.style import (
    FAINT,
    INK,
    SOFT,
    UNSCORED,
    head_of,
    line_style,
    new_figure,
    note,
    save_figure,
    style_axes,
    style_numbers,
)

TIME = "Time_[s]"

# axis label and channel of each panel; a run without the channel has no such panel
PANELS = (
    ("wind\n(m/s)", "Wind1VelX_[m/s]"),
    ("wave\n(m)", "Wave1Elev_[m]"),
    ("rotor speed\n(rpm)", "RotSpeed_[rpm]"),
    ("blade pitch\n(deg)", "BldPitch1_[deg]"),
    ("generator\ntorque (kN m)", "GenTq_[kN-m]"),
    ("power\n(kW)", "GenPwr_[kW]"),
    ("platform pitch\n(deg)", "PtfmPitch_[deg]"),
    ("surge\n(m)", "PtfmSurge_[m]"),
    ("fairlead\ntension (kN)", "FAIRTEN1_[kN]"),
    ("tip deflection\n(m)", "OoPDefl1_[m]"),  # of bending blades, here and below
    ("root flap\nmoment (kN m)", "RootMyb1_[kN-m]"),
    ("root edge\nmoment (kN m)", "RootMxb1_[kN-m]"),
)
MARKED = {  # channel: horizontal lines (text, rating) in the panel
    "RotSpeed_[rpm]": (("rated", RATED_SPEED), ("trip", OVERSPEED)),
    "GenPwr_[kW]": (("rated", RATED_POWER),),
}
STEADY = 1e-6  # of the mean: signals with a smaller range are treated as constant
SPECTRA = (
    ("wind", "Wind1VelX_[m/s]", "(m/s)"),
    ("wave elevation", "Wave1Elev_[m]", "m"),
    ("platform pitch", "PtfmPitch_[deg]", "deg"),
    ("rotor speed", "RotSpeed_[rpm]", "rpm"),
    ("tower-base moment", "TwrBsMyt_[kN-m]", "(kN m)"),
    ("blade-root flap moment", "RootMyb1_[kN-m]", "(kN m)"),
    ("blade-root edge moment", "RootMxb1_[kN-m]", "(kN m)"),
)


def named_runs(runs, skip=0.0):
    """Return runs {label: frame}, without their first `skip` seconds.

    Raises: InputError without runs, and for a run without time column or with fewer than two rows.
    """
    if not runs:
        raise InputError("nothing to plot: there are no runs")
    for label, frame in runs.items():
        if TIME not in frame.columns or len(frame) < 2:
            which = f"run {label!r}" if label else "the run"
            raise InputError(f"{which}: needs a column {TIME!r} and at least two rows")
    if skip == 0.0:
        return runs
    return named_runs({label: f[f[TIME] >= f[TIME].iloc[0] + skip] for label, f in runs.items()})


def _lines(runs, channel):
    """Return [(label, style, frame)] of a channel; a single unlabelled entry if all runs agree (weather)."""
    numbered = zip(style_numbers(runs), runs.items(), strict=True)
    lines = [(label, line_style(i), f) for i, (label, f) in numbered if channel in f.columns]
    if len(lines) > 1:
        first = lines[0][2]
        if all(f[channel].equals(first[channel]) and f[TIME].equals(first[TIME]) for _, _, f in lines[1:]):
            return [(None, {"color": INK, "linestyle": "-"}, first)]
    return lines


def _stacked(heights):
    """Return (figure, [panels] of these heights, inches) with a common time or frequency axis."""
    figure = new_figure(9.0, 0.9 + sum(heights))
    rows = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axes in rows:
        style_axes(axes)
    return figure, rows


def _ends(lines, channel):
    """Return (least, largest) value of a channel in the lines of a panel."""
    series = [frame[channel] for _, _, frame in lines]
    return min(values.min() for values in series), max(values.max() for values in series)


def _is_flat(low, high):
    """Return whether a signal is constant up to rounding."""
    return high - low <= STEADY * max(abs(low), abs(high))


def plot_run(frame, path=None, title=None, *, skip=0.0, ratings=None):
    """Plot stacked time series of one run: wind, wave, rotor, actuators, power, motions, mooring.

    skip, ratings: as for plot_runs.
    """
    return plot_runs({"": frame}, path, title, skip=skip, ratings=ratings)


def plot_runs(runs, path=None, title=None, *, skip=0.0, ratings=None, panels=PANELS):
    """Plot stacked time series of several runs {label: frame} in common panels.

    skip      s from the start, shaded as not scored
    ratings   {name: value} of descriptions.ratings.ratings, drawn as lines in rotor speed and power;
              None: attrs["ratings"] of the first frame, which simulate sets
    panels    (label, channel) of each panel; panels whose channel is in no run are omitted
    """
    runs = named_runs(runs)
    check_number("skip", skip, 0.0)
    channels = ", ".join(channel for _, channel in panels)
    panels = [panel for panel in panels if any(panel[1] in frame.columns for frame in runs.values())]
    if not panels:
        raise InputError(f"nothing to plot: none of {channels} is in the run")
    first = next(iter(runs.values()))
    ratings = first.attrs.get("ratings", {}) if ratings is None else ratings
    start = first[TIME].iloc[0]
    drawn = [_lines(runs, channel) for _, channel in panels]
    ends = [_ends(lines, channel) for lines, (_, channel) in zip(drawn, panels, strict=True)]
    figure, rows = _stacked([0.75 if _is_flat(*end) else 1.1 for end in ends])
    for axes, (label, channel), lines, (low, high) in zip(rows, panels, drawn, ends, strict=True):
        for text, style, frame in lines:
            axes.plot(frame[TIME], frame[channel], linewidth=0.9, label=text, **style)
        axes.ticklabel_format(axis="y", useOffset=False)
        if _is_flat(low, high):
            middle, half = 0.5 * (low + high), max(0.05 * abs(low), 0.5)
            axes.set_ylim(middle - half, middle + half)
        for text, rating in MARKED.get(channel, ()):
            if rating in ratings:
                level, words = ratings[rating], f"{text}\n{ratings[rating]:.4g}"
                axes.axhline(level, color=SOFT, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1)
                note(axes, words, (1.0, level), (4, 0), "axes", va="center", annotation_clip=False)
        if skip > 0.0:
            axes.axvspan(start, start + skip, color=UNSCORED, zorder=0, linewidth=0)
        axes.set_ylabel(label, fontsize=8, color=INK)
        axes.margins(x=0.0)
    if skip > 0.0:
        note(rows[0], "not scored", (start, 1.0), (3, -9))
    rows[-1].set_xlabel("time (s)", fontsize=9, color=INK)
    figure.align_ylabels(rows)
    head_of(figure, rows, runs, title)
    return save_figure(figure, path)


def spectrum(time, value, segment=None):
    """Return (frequency Hz, one-sided power spectral density) by Welch's method, Hann windows, mean removed.

    time must be evenly spaced. segment: seconds per window; None: a third of the record.
    """
    time, value = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    step = even_step("spectrum", time)
    length = (time[-1] - time[0]) / 3.0 if segment is None else segment
    samples = int(min(len(value), max(8, round(length / step))))
    return welch(value, fs=1.0 / step, nperseg=samples, detrend="constant")


def even_step(what, time):
    """Return the step (s) of evenly spaced times. Raises: InputError for other times."""
    steps = np.diff(time)
    step = steps.mean()
    if np.abs(steps - step).max() > 1e-3 * step:
        raise InputError(f"{what}: the times must be evenly spaced")
    return step


def plot_spectra(runs, path=None, title=None, skip=0.0, platform_pitch_period=None):
    """Plot the power spectral densities of SPECTRA of {label: frame} or of one frame.

    Channels that are missing or constant in every run have no panel. Vertical lines mark the wave peak, 1P
    (mean rotor speed of the first run) and the natural frequency of a platform-pitch period (s). The first
    `skip` seconds are omitted.
    """
    runs = named_runs(runs if isinstance(runs, dict) else {"": runs}, skip)
    present = [entry for entry in SPECTRA if any(entry[1] in frame for frame in runs.values())]
    shown = [entry for entry in present if any(_varies(frame.get(entry[1])) for frame in runs.values())]
    if not shown:
        names = ", ".join(channel for _, channel, _ in SPECTRA)
        why = f"{names} are constant" if present else f"none of {names} is in the run"
        raise InputError(f"nothing to plot: {why}")
    figure, rows = _stacked([1.7] * len(shown))
    marks = frequency_marks(next(iter(runs.values())), platform_pitch_period)
    for axes, (label, channel, unit) in zip(rows, shown, strict=True):
        top = 0.0
        for text, style, frame in _lines(runs, channel):
            frequency, density = spectrum(frame[TIME], frame[channel])
            axes.plot(frequency[1:], density[1:], linewidth=1.1, label=text, **style)
            top = max(top, density[1:].max())
        axes.set_yscale("log")
        axes.set_ylim(top * 1e-6, top * 4.0)
        for number, (_, at) in enumerate(marks):
            axes.axvline(at, color=SOFT, linewidth=0.9, linestyle=("--", ":", "-.")[number % 3], zorder=1)
        axes.set_ylabel(f"{label}\n{unit}²/Hz", fontsize=8, color=INK)
        axes.grid(True, which="minor", axis="x", color=FAINT, linewidth=0.3)
    near = ""
    for name, at in sorted(marks, key=lambda mark: mark[1]):
        near = "" if near else "\n"  # adjacent labels alternate between two heights
        look = {"fontsize": 7.5, "color": INK, "ha": "center", "annotation_clip": False}
        note(rows[0], f"{name} {at:.3g} Hz{near}", (at, 1.0), (0, 3), **look)
    rows[-1].set_xscale("log")
    rows[-1].set_xlim(0.005, 0.5)
    ticks = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
    rows[-1].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    rows[-1].set_xticks([], minor=True)
    rows[-1].set_xlabel("frequency (Hz)", fontsize=9, color=INK)
    figure.align_ylabels(rows)
    head_of(figure, rows, runs, title)
    return save_figure(figure, path)


def _varies(series):
    """Return whether a column exists and varies by more than rounding."""
    return series is not None and np.ptp(series) > STEADY * np.abs(series).max()


def frequency_marks(frame, platform_pitch_period=None):
    """Return [(name, Hz)] of the platform-pitch natural frequency, the wave peak and 1P, if known."""
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
