"""Writes the files of `fowt dev paper`: time series, statistics, claims, and plots as in the paper."""

from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

import fowt_env
from fowt_env.descriptions.platform import read_platform
from fowt_env.files.atomic import replacing
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import write_table
from fowt_env.training.studies.paper import load_cases
from fowt_env.visual.style import COLOURS, INK, new_figure, save_figure, style_axes
from fowt_env.visual.time_series import TIME, plot_run, spectrum

LABELS = {
    load_cases.SURGE: "surge (m)",
    "PtfmHeave_[m]": "heave (m)",
    load_cases.PITCH: "platform pitch (deg)",
    "FAIRTEN1_[kN]": "tension 1 (kN)",
    "FAIRTEN2_[kN]": "tension 2 (kN)",
}
# platform, largest offset m
PULLS = {"1:50 model": (load_cases.PLATFORM, 0.25), "OC3-Hywind": ("oc3_hywind", 20.0)}


def _axes(figure, rows, columns=1, xlabel=None, **options):
    """Return styled axes (rows, columns) of a figure; the lowest row has x labels."""
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for number, one in enumerate(axes.ravel()):
        style_axes(one, xlabel if number >= (rows - 1) * columns else None)
    return axes


def _groups(runs):
    """Return {group: [case]} of the groups with at least one run."""
    available = {name: [case for case in cases if case in runs] for name, cases in load_cases.GROUPS.items()}
    return {name: cases for name, cases in available.items() if cases}


def box_plots(runs, channel, path=None):
    """Draw box plots of a channel per case, as Figs 8, 10 and 12: quartiles, median and extremes."""
    groups = _groups(runs)
    figure = new_figure(9.0, 3.2)
    panels = _axes(figure, 1, len(groups), sharey=True)[0]
    for axes, (name, cases) in zip(panels, groups.items(), strict=True):
        values = [load_cases.settled(runs[case])[channel].to_numpy() for case in cases]
        axes.boxplot(values, tick_labels=cases, whis=(0, 100), medianprops={"color": COLOURS[1]})
        style_axes(axes, title=name, ylabel=LABELS[channel] if axes is panels[0] else None)
    return save_figure(figure, path)


def time_series(runs, channel, path=None, window=(0.0, 200.0)):
    """Draw time series of a channel, a panel per case."""
    figure = new_figure(9.0, 0.6 + 0.9 * len(runs))
    rows = _axes(figure, len(runs), xlabel="time (s, model scale)", sharex=True)[:, 0]
    for axes, (case, frame) in zip(rows, runs.items(), strict=True):
        part = frame[frame[TIME].between(*window)]
        axes.plot(part[TIME], part[channel], color=COLOURS[0], linewidth=0.8)
        axes.set_ylabel(case, fontsize=8, color=INK)
        axes.margins(x=0.0)
    figure.suptitle(LABELS[channel], fontsize=10, color=INK, x=0.01, ha="left")
    return save_figure(figure, path)


def spectra(runs, channel, natural, path=None):
    """Draw power spectra of a channel, a panel per group, with the natural frequencies marked."""
    groups = _groups(runs)
    figure = new_figure(9.0, 0.6 + 2.2 * len(groups))
    panels = _axes(figure, len(groups), xlabel="frequency (Hz, model scale)", sharex=True)[:, 0]
    for axes, (name, cases) in zip(panels, groups.items(), strict=True):
        top = 0.0
        for number, case in enumerate(cases):
            frequency, density = load_cases.case_spectrum(runs[case], channel)
            axes.loglog(frequency[1:], density[1:], color=COLOURS[number], linewidth=0.9, label=case)
            top = max(top, density[1:].max())
        for motion in ("surge", "heave", "platform_pitch"):
            axes.axvline(natural[motion], color=INK, linestyle=":", linewidth=0.8)
        axes.set(xlim=(0.03, 3.0), ylim=(1e-10 * top, 4.0 * top))
        axes.set_title(f"{name}  (dotted: surge, pitch, heave)", fontsize=9, color=INK, loc="left")
        axes.legend(fontsize=8, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)
    figure.supylabel(f"power density of {LABELS[channel][:-1]}²/Hz)", fontsize=9, color=INK)
    return save_figure(figure, path)


def static_pulls(path=None):
    """Draw restoring force and line tensions over offset, as Fig. 5, of the model and OC3-Hywind."""
    figure = new_figure(9.0, 6.4)
    for row, (name, (platform, reach)) in zip(_axes(figure, 2, 2), PULLS.items(), strict=True):
        unit, factor = ("N", 1.0) if platform == load_cases.PLATFORM else ("kN", 1e-3)
        for axes, direction in zip(row, ("surge", "sway"), strict=True):
            table = load_cases.static_pull(read_platform(platform), direction, np.linspace(-reach, reach, 81))
            offset = table["offset_[m]"]
            axes.plot(offset, factor * table["force_[N]"], color=INK, label="restoring force")
            for number, column in enumerate(c for c in table if c.startswith("tension")):
                # lines of equal tension lie on each other
                style = {
                    "color": COLOURS[number],
                    "linewidth": 1.2,
                    "linestyle": ("-", "--", ":")[number % 3],
                }
                label = column.removesuffix("_[N]").replace("_", " ")
                axes.plot(offset, factor * table[column], label=label, **style)
            style_axes(axes, f"{direction} (m)", f"force, tension ({unit})")
            axes.set_title(f"{name}: {direction}", fontsize=9, color=INK, loc="left")
            axes.legend(fontsize=7, frameon=False)
    return save_figure(figure, path)


def decays(full, path=None):
    """Draw the surge and pitch decays of Figs 13 and 14."""
    figure = new_figure(9.0, 4.4)
    rows = _axes(figure, 2, xlabel="time (s)")[:, 0]
    for axes, (name, (_, _, channel, _)) in zip(rows, load_cases.DECAYS.items(), strict=True):
        axes.plot(full[name][TIME], full[name][channel], color=COLOURS[0], linewidth=1.0)
        style_axes(axes, ylabel=LABELS[channel])
        axes.margins(x=0.0)
    return save_figure(figure, path)


def regular_waves(full, path=None):
    """Draw Fig. 15: surge, pitch and tension in the regular wave, with spectra, for four wave kinematics."""
    channels = (load_cases.SURGE, load_cases.PITCH, "FAIRTEN1_[kN]")
    figure = new_figure(9.0, 6.4)
    panels = _axes(figure, len(channels), 2)
    for (series, spectral), channel in zip(panels, channels, strict=True):
        for combination, colour in zip(load_cases.COMBINATIONS, COLOURS, strict=False):
            surface = combination[1].replace("swl", "still-water")
            frame, label = full[combination], f"{combination[0]} position, {surface} surface"
            part = frame[frame[TIME].between(420.0, 450.0)]
            series.plot(part[TIME], part[channel], color=colour, linewidth=0.9, label=label)
            part = frame[frame[TIME] >= 260.0]
            frequency, density = spectrum(part[TIME], part[channel], segment=100.0)
            spectral.semilogy(frequency[1:], density[1:], color=colour, linewidth=0.9)
        spectral.set_xlim(0.0, 0.7)
        spectral.set_ylim(1e-18 * density.max(), 10.0 * density.max())
        unit = channel.partition("_[")[2].removesuffix("]")
        style_axes(spectral, ylabel=f"{unit}²/Hz")
        style_axes(series, ylabel=LABELS[channel])
        series.margins(x=0.0)
    style_axes(series, "time (s)")
    style_axes(spectral, "frequency (Hz)")
    lines, labels = series.get_legend_handles_labels()
    figure.legend(lines, labels, fontsize=8, frameon=False, loc="outside upper center", ncols=2)
    return save_figure(figure, path)


def double_frequency_table(full):
    """Return a Markdown table of second over first harmonics for the four wave kinematics."""
    ratios = ("surge, 2nd/1st", "pitch, 2nd/1st")
    header = ("position", "surface", "surge (m)", "pitch (deg)", *ratios, "theory.md")
    rows = []
    for combination, expected in zip(load_cases.COMBINATIONS, load_cases.EXPECTED_DOUBLE, strict=True):
        harmonics = load_cases.double_frequency(full[combination])
        (surge, surge2), (pitch, pitch2) = harmonics[load_cases.SURGE], harmonics[load_cases.PITCH]
        theory = f"{expected[0]:.2f} %, {expected[1]:.2f} %"
        sizes = f"{surge:.4f}", f"{pitch:.4f}", f"{surge2:.2f} %", f"{pitch2:.2f} %"
        rows.append((*combination[:2], *sizes, theory))
    return markdown_table(header, rows)


def statistics_table(runs):
    """Return a Markdown table of pitch and surge per case."""
    surge = ("surge mean", "std", "min", "max (m)")
    header = ("case", "pitch mean", "std", "min", "max (deg)", *surge, "thrust mean (N)")
    cells, columns = [], ["mean", "std", "min", "max"]
    for case, rows in load_cases.statistics(runs).groupby("case", sort=False):
        rows = rows.set_index("channel")
        pitch = (f"{value:.2f}" for value in rows.loc[load_cases.PITCH, columns])
        surge = (f"{value:.3f}" for value in rows.loc[load_cases.SURGE, columns])
        cells.append([case, *pitch, *surge, f"{rows.loc['RtFldFxh_[N]', 'mean']:.2f}"])
    return markdown_table(header, cells)


def periods_table():
    """Return a Markdown table of the natural periods of the 1:50 model, compared with Table 1."""
    published = read_platform(load_cases.PLATFORM).published["natural_periods"]
    rows = []
    scene = fowt_env.build_scene(load_cases.PLATFORM, fidelity="reference")
    for motion, period in fowt_env.natural_periods(scene).items():
        printed = published[motion.removeprefix("platform_")]
        difference = f"{100.0 * (period / printed - 1.0):+.2f} %"
        rows.append((motion, f"{printed:.2f}", f"{period:.3f}", difference))
    return markdown_table(("motion", "paper, computed (s)", "here (s)", "difference"), rows)


def write_paper_report(study, folder, plot=True):
    """Write all results of a study into a folder and return the paths."""
    folder = Path(folder)
    written = f"{datetime.now(UTC):%Y-%m-%d}, version {fowt_env.__version__}"
    paths, text = [], ["# All claims of the paper", "", f"{written}: `fowt dev paper all,full_scale`.", ""]
    if study.runs:
        for case, frame in study.runs.items():
            paths.append(Path(write_table(frame, folder / "runs" / f"{case}.parquet")))
        paths.append(Path(write_table(load_cases.statistics(study.runs), folder / "statistics.csv")))
        text += ["## Natural periods of the 1:50 model", "", periods_table(), "", "## Claims", ""]
        rows = [(c.figure, c.text, c.found, "holds" if c.holds else "FAILS") for c in study.claims]
        text += [markdown_table(("figure", "claim of the paper", "result here", "verdict"), rows), ""]
        text += ["## Statistics, model scale", "", statistics_table(study.runs), ""]
    if study.full:
        text += ["## Double frequency, H 3 m, T 5 s, full scale", "", double_frequency_table(study.full), ""]
    images = _plots(study, folder) if plot else []
    if images:
        text += ["## Plots", "", *(f"![{path.stem.replace('_', ' ')}]({path.name})" for path in images), ""]
    with replacing(folder / "paper.md") as temporary:
        temporary.write_text("\n".join(text))
    return [*paths, folder / "paper.md", *images]


def _plots(study, folder):
    """Write all plots and return their paths."""
    plots = {}
    if study.runs:
        natural = load_cases.natural_frequencies()
        for name, channel in (("pitch", load_cases.PITCH), ("surge", load_cases.SURGE)):
            plots[f"box_{name}"] = partial(box_plots, study.runs, channel)
            plots[f"spectra_{name}"] = partial(spectra, study.runs, channel, natural)
            plots[f"series_{name}"] = partial(time_series, study.runs, channel)
        plots["static_pull"] = static_pulls
    if study.full:
        plots["full_decays"] = partial(decays, study.full)
        plots["full_regular_wave"] = partial(regular_waves, study.full)
        plots["full_wind_and_waves"] = partial(
            plot_run, study.full["wind and waves"], title="18 m/s, Hs 7.5 m, Tp 10 s"
        )
    for name, make in plots.items():
        make(path=folder / f"{name}.png")
    return [folder / f"{name}.png" for name in plots]
