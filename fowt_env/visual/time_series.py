"""Plots of runs: time series and spectra. Needs matplotlib: pip install "fowt-env[plot]".

Every function returns a matplotlib Figure and, if given a path, writes it there. Figures are made
without pyplot, so nothing global is touched and no display is needed.
"""

import numpy as np
from scipy.signal import welch

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError
from fowt_env.visual.style import COLOURS, INK, new_figure, save_figure, style_axes

TIME = "Time_[s]"

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
