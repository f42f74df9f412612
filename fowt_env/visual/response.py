"""Plots of what runs and operating points have in common: box plots, steady schedule, RAOs.

As in time_series.py every function returns a matplotlib Figure and, if given a path, writes it there.
Needs matplotlib: pip install "fowt-env[plot]".
"""

import numpy as np
from scipy.signal import csd, welch

from fowt_env.errors import InputError
from fowt_env.visual.style import COLOURS, INK, new_figure, save_figure, style_axes
from fowt_env.visual.time_series import TIME, named_runs

WAVE = "Wave1Elev_[m]"
WIND = "Wind_[m/s]"  # column of `fowt trim --out`
WHISKERS = (1.0, 99.0)  # percentiles
HATCHES = ("", "/////", "....", "xxxx")  # of boxes, for each further round of colours
ENERGETIC = 0.02  # of the peak of the wave spectrum: an RAO is shown where the waves have more
BOXES = (
    ("rotor speed\n(rpm)", "RotSpeed_[rpm]"),
    ("power\n(kW)", "GenPwr_[kW]"),
    ("blade pitch\n(deg)", "BldPitch1_[deg]"),
    ("platform pitch\n(deg)", "PtfmPitch_[deg]"),
    ("surge\n(m)", "PtfmSurge_[m]"),
    ("fairlead\ntension (kN)", "FAIRTEN1_[kN]"),
)
SCHEDULE = (
    ("rotor speed (rpm)", "RotSpeed_[rpm]"),
    ("blade pitch (deg)", "BldPitch1_[deg]"),
    ("power (kW)", "GenPwr_[kW]"),
    ("thrust (kN)", "RotThrust_[kN]"),
    ("generator torque (kN m)", "GenTq_[kN-m]"),
    ("platform pitch (deg)", "PtfmPitch_[deg]"),
)
MOTION_CHANNELS = (
    ("surge\n(m/m)", "PtfmSurge_[m]"),
    ("heave\n(m/m)", "PtfmHeave_[m]"),
    ("platform pitch\n(deg/m)", "PtfmPitch_[deg]"),
    ("fairlead tension\n(kN/m)", "FAIRTEN1_[kN]"),
)


def _grid(panels, columns, width, height):
    """(figure, panels in reading order) of a grid whose spare places are empty."""
    rows = -(-len(panels) // columns)
    figure = new_figure(width * columns, 0.7 + height * rows)
    places = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in places[len(panels) :]:
        axes.set_visible(False)
    for axes in places[: len(panels)]:
        style_axes(axes)
    return figure, places[: len(panels)]


def _shown(panels, frames, what):
    """The panels whose channel some frame has. Raises: InputError where there is none."""
    shown = [panel for panel in panels if any(panel[1] in frame.columns for frame in frames)]
    if not shown:
        raise InputError(f"nothing to plot: no {what} has {', '.join(channel for _, channel in panels)}")
    return shown


def _legend(figure, axes, labels):
    """One legend below all panels, where there are names to tell apart."""
    if any(labels):
        handles, names = axes.get_legend_handles_labels()
        figure.legend(
            handles, names, loc="outside lower center", ncols=min(6, len(names)), fontsize=8, frameon=False
        )


def plot_boxes(cases, path=None, title=None, skip=0.0):
    """Box plots of the samples of runs {case: {label: frame}}: one panel per channel, one box per run.

    Boxes span the quartiles, whiskers WHISKERS percentiles. The first `skip` seconds are left out.
    """
    if not cases:
        raise InputError("nothing to plot: no cases were given")
    kept = {}
    for case, runs in cases.items():
        late = {label: f[f[TIME] >= f[TIME].iloc[0] + skip] for label, f in named_runs(runs).items()}
        kept[case] = named_runs(late)
    labels = list(dict.fromkeys(label for runs in kept.values() for label in runs))
    panels = _shown(BOXES, [frame for runs in kept.values() for frame in runs.values()], "run")
    figure, places = _grid(panels, min(3, len(panels)), 4.2, 2.4)
    width = 0.8 / len(labels)
    for axes, (name, channel) in zip(places, panels, strict=True):
        for number, label in enumerate(labels):
            having = [i for i, runs in enumerate(kept.values()) if channel in runs.get(label, ())]
            values = [list(kept.values())[i][label][channel].to_numpy() for i in having]
            if not values:
                continue
            at = [i + width * (number - 0.5 * (len(labels) - 1)) for i in having]
            colour = COLOURS[number % len(COLOURS)]
            boxes = axes.boxplot(
                values,
                positions=at,
                widths=0.8 * width,
                whis=WHISKERS,
                showfliers=False,
                patch_artist=True,
                manage_ticks=False,
                label=label,
                medianprops={"color": INK},
            )
            for box in boxes["boxes"]:
                box.set(facecolor=colour, alpha=0.65, edgecolor=colour)
                box.set_hatch(HATCHES[number // len(COLOURS) % len(HATCHES)])
            for line in (*boxes["whiskers"], *boxes["caps"]):
                line.set(color=colour, linewidth=0.9)
        axes.set_ylabel(name, fontsize=8, color=INK)
        named = list(kept) != [""]
        axes.set_xticks(np.arange(len(kept)) if named else [], list(kept) if named else [], fontsize=8)
        axes.set_xlim(-0.6, len(kept) - 0.4)
    _legend(figure, places[0], labels)
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)


def plot_schedule(points, path=None, title=None):
    """Steady operating points over wind speed, of one table or {label: table} as `fowt trim --out` writes."""
    tables = points if isinstance(points, dict) else {"": points}
    for label, table in tables.items():
        if WIND not in table.columns or len(table) < 2:
            raise InputError(f"schedule {label!r}: needs a column {WIND!r} and at least two rows")
    panels = _shown(SCHEDULE, list(tables.values()), "table")
    figure, places = _grid(panels, min(3, len(panels)), 3.6, 2.2)
    for axes, (name, channel) in zip(places, panels, strict=True):
        for number, (label, table) in enumerate(tables.items()):
            if channel in table.columns:
                order = np.argsort(table[WIND].to_numpy())
                line = table[WIND].to_numpy()[order], table[channel].to_numpy()[order]
                axes.plot(
                    *line, color=COLOURS[number % len(COLOURS)], linewidth=1.3, marker="o", ms=3, label=label
                )
        axes.set_title(name, fontsize=9, color=INK, loc="left")
        axes.set_xlabel("wind (m/s)", fontsize=8, color=INK)
    _legend(figure, places[0], list(tables))
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)


def response_operator(frame, channel, skip=0.0, segment=None):
    """(frequency Hz, amplitude per metre of wave, coherence) of a channel, where the waves have energy.

    The estimate |S_wc| / S_ww from Welch's cross-spectrum (H1): linear response to waves alone.
    Wind lowers the coherence, which is 1 for a linear system without noise; where it is small the amplitude
    is uncertain, and too large rather than too small.
    segment: seconds per window; None: an eighth of the record.
    Raises: InputError for a missing channel, a record without waves, or uneven times.
    """
    for name in (TIME, WAVE, channel):
        if name not in frame.columns:
            raise InputError(f"response operator: the run has no column {name!r}")
    kept = frame[frame[TIME] >= frame[TIME].iloc[0] + skip]
    time = kept[TIME].to_numpy()
    if len(time) < 64:
        raise InputError(f"response operator: {len(time)} rows are left; must be at least 64")
    steps = np.diff(time)
    if np.abs(steps - steps.mean()).max() > 1e-3 * steps.mean():
        raise InputError("response operator: the times must be evenly spaced")
    wave, motion = kept[WAVE].to_numpy(), kept[channel].to_numpy()
    if np.ptp(wave) < 1e-9:
        raise InputError("response operator: the run has no waves")
    length = (time[-1] - time[0]) / 8.0 if segment is None else segment
    samples = int(min(len(time), max(32, round(length / steps.mean()))))
    settings = {"fs": 1.0 / steps.mean(), "nperseg": samples, "detrend": "linear"}
    frequency, power = welch(wave, **settings)
    _, answer = welch(motion, **settings)
    _, cross = csd(wave, motion, **settings)
    inside = power > ENERGETIC * power.max()
    with np.errstate(invalid="ignore", divide="ignore"):
        coherence = np.abs(cross) ** 2 / (power * answer)
    return frequency[inside], (np.abs(cross) / power)[inside], coherence[inside]


def plot_raos(runs, path=None, title=None, skip=0.0, segment=None):
    """Response amplitude operators of motions and tension, estimated from {label: frame} or one frame.

    Solid where the coherence is above one half, faint below: there other things than waves move it.
    """
    runs = named_runs(runs if isinstance(runs, dict) else {"": runs})
    panels = _shown(MOTION_CHANNELS, list(runs.values()), "run")
    figure, places = _grid(panels, min(2, len(panels)), 4.6, 2.4)
    for axes, (name, channel) in zip(places, panels, strict=True):
        for number, (label, frame) in enumerate(runs.items()):
            if channel not in frame.columns:
                continue
            frequency, amplitude, coherence = response_operator(frame, channel, skip, segment)
            colour = COLOURS[number % len(COLOURS)]
            axes.plot(frequency, amplitude, color=colour, linewidth=1.0, alpha=0.3)
            axes.plot(
                frequency,
                np.where(coherence > 0.5, amplitude, np.nan),
                color=colour,
                linewidth=1.6,
                marker=".",
                label=label,
            )
        axes.set_ylabel(name, fontsize=8, color=INK)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("wave frequency (Hz)", fontsize=8, color=INK)
    _legend(figure, places[0], list(runs))
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)
