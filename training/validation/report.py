"""Writes reports of a validation: tables (CSV and Markdown) and plots of the compared series."""

from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.files.atomic import remove_leftovers, replacing
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import write_table
from fowt_env.training.validation.comparison import Channel
from fowt_env.visual.style import COLOURS, INK, LINES, new_figure, save_figure, style_axes
from fowt_env.visual.time_series import TIME, spectrum

LABELS = {
    Channel.SURGE: "surge\n(m)", "PtfmSway_[m]": "sway\n(m)", Channel.HEAVE: "heave\n(m)",
    "PtfmRoll_[deg]": "roll\n(deg)", Channel.PITCH: "platform pitch\n(deg)", "PtfmYaw_[deg]": "yaw\n(deg)",
    Channel.SPEED: "rotor speed\n(rpm)", Channel.BLADE: "blade pitch\n(deg)",
    Channel.THRUST: "thrust\n(N)", Channel.TORQUE: "torque\n(N m)", "FAIRTEN1_[kN]": "tension 1\n(kN)",
    "TTDspFA_[m]": "tower top\n(m)", "TwrBsMyt_[kN-m]": "tower base\n(kN m)",
    "OoPDefl1_[m]": "tip, out of\nplane (m)", "RootMyb1_[kN-m]": "root, flap\n(kN m)",
    "RootMxb1_[kN-m]": "root, edge\n(kN m)", "RotTorq_[kN-m]": "shaft\n(kN m)",
}  # fmt: skip
TURNING = (*Channel.PLANE, Channel.SPEED, Channel.BLADE)
OPERATING, WAVE = (*TURNING, Channel.TENSIONS[0]), (*Channel.PLANE, Channel.TENSIONS[0])
BENDING = (Channel.PITCH, Channel.SPEED, "TTDspFA_[m]", "TwrBsMyt_[kN-m]")
ELASTIC = (
    Channel.SPEED, "OoPDefl1_[m]", "RootMyb1_[kN-m]", "RootMxb1_[kN-m]", "RotTorq_[kN-m]", "TwrBsMyt_[kN-m]"
)  # fmt: skip
WAKE = (Channel.THRUST, Channel.TORQUE)
WHOLE, LONG, SHORT = (0.0, 600.0), (100.0, 400.0), (100.0, 200.0)  # s
TURBULENCE = "turbulence of 18 m/s, {}; waves, Hs 7.5 m"
STEADY, UNIFORM = "steady wind of {} m/s", TURBULENCE.format("uniform over the rotor")
TOWER = TURBULENCE.format("uniform over the rotor, bending tower")
ALL_BEND = ("elastic, turb_18mps", TURBULENCE.format("bending blades and tower"), ELASTIC, SHORT, True)
WAVES = (
    ("waves_Hs7.5", "irregular waves, Hs 7.5 m", Channel.PLANE, LONG, True),
    (
        "waves_Hs7.5_qtf",
        "irregular waves, Hs 7.5 m, with difference-frequency loads",
        Channel.PLANE,
        LONG,
        True,
    ),
)
PLOTS = {  # platform: ((case, title, channels, time range in s, whether spectra are plotted), ...)
    "oc3_hywind": (
        ("float_steady_8mps", STEADY.format(8), OPERATING, WHOLE, False),
        ("float_steady_18mps", STEADY.format(18), OPERATING, WHOLE, False),
        ("float_windsteps_12_24", "wind steps from 12 to 24 m/s", OPERATING, (0.0, 1300.0), False),
        ("regwave_H3T5", "regular wave, H 3 m, T 5 s", WAVE, (560.0, 600.0), True),
        (
            "regwave_H3T5_displaced", "regular wave, H 3 m, T 5 s, wave loads at the displaced position",
            WAVE, (560.0, 600.0), True,
        ),
        ("turb_18mps_Hs7.5_uniform", UNIFORM, OPERATING, LONG, True),
        ("turb_18mps_Hs7.5_uniform_flex", TOWER, BENDING, SHORT, True),
        ("turb_18mps_Hs7.5_box", TURBULENCE.format("full field"), OPERATING, LONG, True),
        ALL_BEND,
    ),
    "iea15_volturnus_s": (
        ("regwave_H4T9", "regular wave, H 4 m, T 9 s", Channel.PLANE, (410.0, 500.0), False),
        *WAVES,
        ("float_steady_12mps", STEADY.format(12), TURNING, WHOLE, False),
        ("float_steady_18mps", STEADY.format(18), TURNING, WHOLE, False),
        ("turb_18mps_Hs7.5_uniform", UNIFORM, TURNING, LONG, True),
        ("turb_18mps_Hs7.5_uniform_tower", TOWER, BENDING, SHORT, True),
        ("wake_pitch_step", "dynamic inflow after a step of blade pitch", WAKE, (10.0, 100.0), False),
        (
            "wake_wind_step_18mps", "dynamic inflow after a step of wind at 18 m/s",
            WAKE, (10.0, 100.0), False,
        ),
        ALL_BEND,
    ),
    "nrel5mw_oc4_semi": WAVES,
}  # fmt: skip
HERE, THERE = "fowt_env", "OpenFAST"
COST_PLOTS = {  # file -> (title, {legend: run})
    "costs_rotor": ("rotor models, 18 m/s uniform turbulence and Hs 7.5 m", {
        "BEM": "uniform wind, no skewed wake", "table": "uniform wind, rotor table",
        "BEM, skewed wake, dynamic inflow": "uniform wind, dynamic inflow",
    }),
    "costs_wind": ("wind over the rotor, 18 m/s turbulence and Hs 7.5 m", {
        "full field": "full-field wind", "rotor-averaged": "rotor-averaged wind",
        "hub wind blown uniformly": "uniform wind",
    }),
    "costs_waves": ("wave kinematics, 18 m/s uniform turbulence and Hs 7.5 m", {
        "instantaneous, Wheeler": "uniform wind, instantaneous wave kinematics",
        "fixed, still water": "uniform wind",
    }),
}  # fmt: skip


def _words(channel):
    """Return the name of a channel, up to the bracket of its unit, and the unit."""
    name, _, unit = LABELS[channel].rpartition("(")
    return name, unit.removesuffix(")")


def _stack(panels, draw, path, title, xlabel="time (s)", height=1.2, squared=False, notes=()):
    """Plot stacked panels, one per (channel, {legend: frame}), save them to a path and return the figure.

    draw(axes, frame, channel, **style): draws one line. squared: label axes as power densities. notes: what
    tells each panel from another of the same channel, "" or a line for its label.
    """
    figure = new_figure(9.0, 0.8 + height * len(panels))
    shared = all(frames is panels[0][1] for _, frames in panels)
    rows = figure.subplots(len(panels), 1, sharex=shared, squeeze=False)[:, 0]
    for axes, (channel, frames), remark in zip(rows, panels, notes or [""] * len(panels), strict=True):
        style_axes(axes, xlabel=xlabel if axes is rows[-1] else None)
        for number, (legend, frame) in enumerate(frames.items()):
            style = {"color": COLOURS[number], "linewidth": 1.0, "label": legend}
            draw(axes, frame, channel, linestyle=LINES[number and (number - 1) % 3 + 1], **style)
        name, unit = _words(channel)
        unit = f"{unit.replace(' ', '² ')}²/Hz" if squared else unit
        axes.set_ylabel(f"{name}{remark}({unit})", fontsize=8, color=INK)
    ncols = len(panels[0][1])
    rows[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=ncols, fontsize=8, frameon=False)
    figure.align_ylabels(rows)
    figure.suptitle(title, fontsize=10, color=INK, x=0.01, ha="left")
    return save_figure(figure, path)


def _series(axes, frame, channel, window=(0.0, np.inf), **style):
    part = frame[frame[TIME].between(*window)]
    axes.plot(part[TIME], part[channel], **style)
    axes.margins(x=0.0)


def _overlay(frames, channels, window, path, title):
    """Plot time series of {legend: frame}, one panel per channel."""
    return _stack([(c, frames) for c in channels], partial(_series, window=window), path, title)


def _spectra(frames, channels, path, title, start=100.0, segment=None):
    """Plot power spectra of {legend: frame} on logarithmic axes, one panel per channel; segment: s."""
    tops = {}

    def draw(axes, frame, channel, **style):
        part = frame[frame[TIME] >= start]
        frequency, density = spectrum(part[TIME], part[channel], segment)
        axes.loglog(frequency[1:], density[1:], **style)
        top = tops[channel] = max(tops.get(channel, 0.0), density[1:].max())
        axes.set_ylim(1e-8 * top, 4.0 * top)
        axes.set_xlim(frequency[1] / 1.5, 0.7)

    return _stack([(c, frames) for c in channels], draw, path, title, "frequency (Hz)", 1.5, squared=True)


def _decays(study, path):
    """Plot the free decays, each in the displaced motion."""
    panels, notes = [], []
    for case, run in study.cases.items():
        if case in study.runs and case.startswith("decay_"):
            ours, theirs = study.runs[case]
            panels.append((*run.initial, {THERE: theirs, HERE: ours}))
            notes.append("bending tower\n" if "tower" in run.options else "")
    return _stack(panels, _series, path, "free decays", height=1.4, notes=notes)


def _steady(study, path):
    """Plot errors of the steady operating points over wind speed."""
    table = study.table()
    rows = table[table["case"].str.startswith("steady_")]
    figure = new_figure(9.0, 3.2)
    axes = figure.subplots()
    style_axes(axes, "wind (m/s)", "difference from OpenFAST (%)")
    for number, (quantity, chosen) in enumerate(rows.groupby("quantity", sort=False)):
        wind = chosen["case"].str.extract(r"steady_(.*)mps")[0].astype(float)
        channel = f"{quantity}_[{chosen['unit'].iloc[0]}]"
        label = _words(channel)[0].rstrip() if channel in LABELS else quantity
        style = {"color": COLOURS[number % len(COLOURS)], "markersize": 4, "label": label}
        axes.plot(wind, chosen["error"], "o-", **style)
    axes.legend(fontsize=8, frameon=False)
    return save_figure(figure, path)


def _responses(study, path):
    """Plot responses to small waves over frequency, simulated and from the frequency domain."""
    from matplotlib.ticker import NullFormatter

    ours, smooth = study.runs["responses"]
    names = list(ours.columns[1:])
    figure = new_figure(9.0, 3.2)
    for axes, name in zip(figure.subplots(1, len(names)), names, strict=True):
        motion, unit = _words(f"{name}_[{'deg' if name == 'PtfmPitch' else 'm'}]")
        style_axes(axes, "frequency (rad/s)", title=f"{motion.rstrip()} ({unit}/m)")
        axes.semilogy(smooth["omega"], smooth[name], "-", color=COLOURS[0], label="frequency domain")
        axes.semilogy(ours["omega"], ours[name], "o", color=COLOURS[1], markersize=4, label=HERE)
        axes.set_ylim(0.5 * ours[name].min(), 3.0 * ours[name].max())
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.legend(fontsize=8, frameon=False)
    return save_figure(figure, path)


def _poles(study, path):
    """Plot frequencies and damping ratios of the linear models over wind speed."""
    table = study.table()
    table = table[table["case"].str.contains("linear model")]
    wind = table["case"].str.extract(r" at (\S+) ")[0].astype(float)
    figure = new_figure(9.0, 3.6)
    panels = figure.subplots(1, 3)
    for axes, quantity in zip(panels, ("frequency", "damping ratio", "rotor pole"), strict=True):
        chosen = table[table["quantity"].str.contains(quantity)]
        style_axes(axes, "wind (m/s)", title=f"{quantity} ({chosen['unit'].iloc[0]})")
        for colour, (name, part) in zip(COLOURS, chosen.groupby("quantity", sort=False), strict=False):
            x, label = wind[part.index], name.split(" mode")[0]
            axes.plot(x, part["openfast"], "-", color=colour)
            axes.plot(x, part["here"], "o", color=colour, markersize=4, label=label)
    panels[1].legend(fontsize=8, frameon=False)
    figure.suptitle(f"lines: {THERE}; points: {HERE}", fontsize=10, color=INK, x=0.01, ha="left")
    return save_figure(figure, path)


def _generator(study, path, per_decade=12):
    """Plot wind spectra of box and generator, at a point and averaged over the rotor.

    Spectra are averaged over bins of equal width in log frequency.
    """
    box, made = study.runs["spectra of the wind"]
    figure = new_figure(9.0, 3.6)
    axes = figure.subplots()
    style_axes(axes, "frequency (Hz)", "spectrum of u (m²/s²/Hz)")
    edges = np.logspace(-3, 1, 4 * per_decade + 1)
    for colour, (frame, name, line, legend) in enumerate((
        (box, "point", "-", "TurbSim box, mean over the points of the disk"),
        (made, "point", "--", "generator, a point"),
        (box, "rotor", "-", "TurbSim box, rotor average"),
        (made, "rotor", "--", "generator, rotor average"),
    )):  # fmt: skip
        mean = frame.groupby(pd.cut(frame["frequency"], edges, right=False), observed=True).mean()
        style = {"color": COLOURS[colour], "linewidth": 1.2, "label": legend}
        axes.loglog(mean["frequency"], mean[name], line, **style)
    axes.set_xlim(0.002, 2.0)
    axes.legend(fontsize=8, frameon=False)
    return save_figure(figure, path)


def _plot_name(case):
    """Return the file name of the plot of a case, without its ending."""
    return case.replace(", ", "_")


def write_plots(study, folder):
    """Write the plots of a study and return their paths."""
    folder, paths = Path(folder), []

    def path(name):
        paths.append(folder / f"{name}.png")
        return paths[-1]

    cases = [*study.runs, *(row.case for row in study.rows)]
    for name, draw, words in (
        ("decays", _decays, "decay_"), ("steady", _steady, "steady_"),
        ("responses", _responses, "responses to small waves"), ("linear", _poles, "linear model at"),
    ):  # fmt: skip
        if any(case.startswith(words) for case in cases):
            draw(study, path(name))
    for case, title, channels, window, spectra in PLOTS.get(study.platform, ()):
        if case in study.runs:
            ours, theirs = study.runs[case]
            frames = {THERE: theirs, HERE: ours}
            _overlay(frames, channels, window, path(_plot_name(case)), title)
            if spectra:
                # of a regular wave: whole periods, so that its harmonics do not leak
                record = (400.0, 100.0) if case.startswith("regwave") else (100.0, None)
                _spectra(frames, channels, path(f"{_plot_name(case)}_spectra"), title, *record)
    if "spectra of the wind" in study.runs:
        channels = (Channel.PITCH, Channel.SURGE, Channel.SPEED)
        for name, (title, runs) in COST_PLOTS.items():
            frames = {legend: study.runs[run][0] for legend, run in runs.items()}
            _overlay(frames, channels, (100.0, 300.0), path(name), title)
            _spectra(frames, channels, path(f"{name}_spectra"), title)
        _generator(study, path("costs_generator"))
    return paths


def markdown(study, plots=()):
    """Return Markdown with one table per case and the plots of that case; other plots come first.

    plots: file names, in the folder of the text
    """
    cases = list(dict.fromkeys(row.case for row in study.rows))
    plots_of = {case: [f"{_plot_name(case)}.png", f"{_plot_name(case)}_spectra.png"] for case in cases}
    others = [name for name in plots if not any(name in names for names in plots_of.values())]

    def images(names):
        links = [f"![{Path(name).stem.replace('_', ' ')}]({name})" for name in names]
        return [*links, ""] if links else []

    def shown(value, digits=5):
        return "" if not np.isfinite(value) else f"{value:.{digits}g}"

    lines = [
        f"# All results of {study.platform}", "",
        f"{datetime.now(UTC):%Y-%m-%d}, version {fowt_env.__version__}: `fowt dev validate --platform"
        f" {study.platform} --case {','.join(study.groups)}`. Quantities without an allowed error are"
        " reported only.", "",
        *images(others),
    ]  # fmt: skip
    for case in cases:
        cells = []
        for row in (row for row in study.rows if row.case == case):
            quantity = f"{row.quantity} ({row.note})" if row.note else row.quantity
            error = shown(row.error, 3)
            error = f"**{error}, missed**" if row.verdict == "MISSED" else error
            values = shown(row.openfast), shown(row.here), error, shown(row.allowed, 6)
            cells.append((quantity, row.unit, *values))
        against = "OpenFAST" if "against" not in case else "reference"
        header = ("quantity", "unit", against, "here", "error %", "allowed %")
        lines += [f"## {case}", "", markdown_table(header, cells), ""]
        lines += images(name for name in plots_of[case] if name in plots)
    return "\n".join(lines)


def write_validation_report(study, folder, plots=True):
    """Write validation.csv, validation.md and (with plots) one or two images per case; return the paths."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    remove_leftovers(folder)
    paths = [write_table(study.table(), folder / "validation.csv"), folder / "validation.md"]
    images = write_plots(study, folder) if plots else []
    with replacing(paths[1]) as temporary:
        temporary.write_text(markdown(study, [path.name for path in images]) + "\n", encoding="utf-8")
    return paths + images
