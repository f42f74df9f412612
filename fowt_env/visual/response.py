"""Plots box plots of runs, the steady schedule, response amplitude operators (RAOs) and Campbell diagrams.

As in time_series.py every function returns a matplotlib Figure and writes the figure to `path` unless None.
Needs matplotlib: pip install "fowt-env[plot]".
"""

import numpy as np
from scipy.signal import csd, welch

from fowt_env.descriptions.units import RPM
from fowt_env.errors import InputError
from fowt_env.visual.style import (
    COLOURS,
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
from fowt_env.visual.time_series import PANELS, TIME, even_step, named_runs

WAVE = "Wave1Elev_[m]"
WIND = "Wind_[m/s]"  # column of `fowt model trim --out`
WHISKERS = (1.0, 99.0)  # percentiles
HATCHES = ("", "/////", "....", "xxxx")  # of boxes, for each further round of colours
ENERGETIC = 0.02  # of the peak of the wave spectrum: minimum wave energy for the estimate of an RAO
COHERENT = 0.5  # coherence above which an RAO is drawn solid
RAO_RANGE = (0.015, 0.3)  # Hz: from below the resonances of spars and semi-submersibles to the end of waves
CAMPBELL_RANGE = 10.0
BOXES = tuple(
    panel for panel in PANELS if panel[1] not in ("Wind1VelX_[m/s]", "Wave1Elev_[m]", "GenTq_[kN-m]")
)
SCHEDULE = (
    ("rotor speed (rpm)", "RotSpeed_[rpm]"),
    ("blade pitch (deg)", "BldPitch1_[deg]"),
    ("power (kW)", "GenPwr_[kW]"),
    ("thrust (kN)", "RotThrust_[kN]"),
    ("generator torque (kN m)", "GenTq_[kN-m]"),
    ("platform pitch (deg)", "PtfmPitch_[deg]"),
    ("tip deflection (m)", "OoPDefl1_[m]"),  # of bending blades, here and below
    ("root flap moment (kN m)", "RootMyb1_[kN-m]"),
    ("root edge moment (kN m)", "RootMxb1_[kN-m]"),
)
MOTION_CHANNELS = (
    ("surge (m/m)", "PtfmSurge_[m]"),
    ("heave (m/m)", "PtfmHeave_[m]"),
    ("platform pitch (deg/m)", "PtfmPitch_[deg]"),
    ("fairlead tension (kN/m)", "FAIRTEN1_[kN]"),
)


def _grid(panels, columns, width, height):
    """Return (figure, panels in reading order) of a grid; unused grid cells stay empty."""
    rows = -(-len(panels) // columns)
    figure = new_figure(width * columns, 0.7 + height * rows)
    cells = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in cells[len(panels) :]:
        axes.set_visible(False)
    for axes in cells[: len(panels)]:
        style_axes(axes)
    return figure, cells[: len(panels)]


def _shown(panels, frames, what):
    """Return the panels whose channel is in at least one frame. Raises: InputError if there are none."""
    shown = [panel for panel in panels if any(panel[1] in frame.columns for frame in frames)]
    if not shown:
        raise InputError(f"nothing to plot: no {what} has {', '.join(channel for _, channel in panels)}")
    return shown


def plot_boxes(cases, path=None, title=None, skip=0.0):
    """Plot boxes of the samples of runs {case: {label: frame}}: one panel per channel, one box per run.

    Boxes span the quartiles, whiskers WHISKERS percentiles. The first `skip` seconds are omitted.
    """
    if not cases:
        raise InputError("nothing to plot: there are no cases")
    kept = {case: named_runs(runs, skip) for case, runs in cases.items()}
    labels = list(dict.fromkeys(label for runs in kept.values() for label in runs))
    panels = _shown(BOXES, [frame for runs in kept.values() for frame in runs.values()], "run")
    figure, cells = _grid(panels, min(3, len(panels)), 4.2, 2.4)
    width = 0.8 / len(labels)
    for axes, (name, channel) in zip(cells, panels, strict=True):
        for place, (number, label) in enumerate(zip(style_numbers(labels), labels, strict=True)):
            frames = [runs.get(label, ()) for runs in kept.values()]
            having = [i for i, frame in enumerate(frames) if channel in frame]
            if not having:
                continue
            values = [frames[i][channel].to_numpy() for i in having]
            at = [i + width * (place - 0.5 * (len(labels) - 1)) for i in having]
            colour = COLOURS[number % len(COLOURS)]
            boxes = axes.boxplot(
                values, positions=at, widths=0.8 * width, whis=WHISKERS, showfliers=False,
                patch_artist=True, manage_ticks=False, label=label, medianprops={"color": INK},
            )  # fmt: skip
            for box in boxes["boxes"]:
                box.set(facecolor=colour, alpha=0.65, edgecolor=colour)
                box.set_hatch(HATCHES[number // len(COLOURS) % len(HATCHES)])
            for line in (*boxes["whiskers"], *boxes["caps"]):
                line.set(color=colour, linewidth=0.9)
        axes.set_ylabel(name, fontsize=8, color=INK)
        named = list(kept) != [""]
        axes.set_xticks(np.arange(len(kept)) if named else [], list(kept) if named else [], fontsize=8)
        axes.grid(False, axis="x")
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.set_xlim(-0.6, len(kept) - 0.4)
    head_of(figure, cells, labels, title)
    return save_figure(figure, path)


def plot_schedule(points, path=None, title=None, *, rated_wind=None):
    """Plot steady operating points over wind speed, of one table or {label: table} of `fowt model trim`.

    rated_wind: m/s, marked by a line; None: not marked.
    """
    tables = points if isinstance(points, dict) else {"": points}
    for label, table in tables.items():
        if WIND not in table.columns or len(table) < 2:
            which = f"schedule {label!r}" if label else "the schedule"
            raise InputError(f"{which}: needs a column {WIND!r} and at least two rows")
    panels = _shown(SCHEDULE, list(tables.values()), "table")
    figure, cells = _grid(panels, min(3, len(panels)), 3.6, 2.2)
    for axes, (name, channel) in zip(cells, panels, strict=True):
        for number, (label, table) in enumerate(tables.items()):
            if channel in table.columns:
                order = np.argsort(table[WIND].to_numpy())
                line = table[WIND].to_numpy()[order], table[channel].to_numpy()[order]
                axes.plot(*line, linewidth=1.3, marker="o", ms=3, label=label, **line_style(number))
        if rated_wind is not None:
            axes.axvline(rated_wind, color=SOFT, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1)
        axes.set_title(name, fontsize=9, color=INK, loc="left")
        axes.set_xlabel("wind (m/s)", fontsize=8, color=INK)
        axes.ticklabel_format(axis="y", useOffset=False)
    if rated_wind is not None:
        for axes in cells[: min(3, len(cells))]:
            note(axes, f"rated {rated_wind:g} m/s", (rated_wind, 1.0), (3, -8))
    head_of(figure, cells, list(tables), title)
    return save_figure(figure, path)


def plot_campbell(campbell, path=None, title=None, *, harmonics=(1, 3, 6), rated_speed=None):
    """Plot an analysis.campbell.Campbell: frequencies over rotor speed, with multiples of the rotor's (1P).

    rated_speed: rad/s, marked by a line; None: not marked. Modes above CAMPBELL_RANGE times the lowest
    frequency, as a stiff shaft has, are not shown.
    """
    if len(campbell.rotor_speed) < 2:
        raise InputError("Campbell diagram: needs at least two rotor speeds")
    speed = campbell.rotor_speed / RPM
    figure = new_figure(8.6, 5.4)
    axes = figure.subplots()
    highest = CAMPBELL_RANGE * min(values.min() for values in campbell.frequency.values())
    shown = {mode: values for mode, values in campbell.frequency.items() if values.max() <= highest}
    style_axes(axes)
    top = 1.05 * max(values.max() for values in shown.values())
    for harmonic in harmonics:
        axes.plot(speed, harmonic * speed / 60.0, color=SOFT, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1)
        note(axes, f"{harmonic}P", (speed[-1], min(harmonic * speed[-1] / 60.0 / top, 1.0)), (3, -3))
    for number, (mode, values) in enumerate(shown.items()):
        axes.plot(speed, values, linewidth=1.3, label=mode, **line_style(number))
    if rated_speed is not None and speed[0] <= rated_speed / RPM <= speed[-1]:
        axes.axvline(rated_speed / RPM, color=SOFT, linewidth=0.9, linestyle=":", zorder=1)
        note(axes, f"rated {rated_speed / RPM:.4g} rpm", (rated_speed / RPM, 1.0), (3, -8))
    axes.set_xlim(speed[0], speed[-1])
    axes.set_ylim(0.0, top)
    axes.set_xlabel("rotor speed (rpm)", fontsize=8, color=INK)
    axes.set_ylabel("frequency (Hz)", fontsize=8.5, color=INK)
    head_of(figure, [axes], list(shown), title)
    return save_figure(figure, path)


def response_operator(frame, channel, skip=0.0, segment=None):
    """Return (frequency Hz, amplitude per metre of wave, coherence) of a channel where waves have energy.

    The estimate is |S_wc| / S_ww from Welch's cross-spectrum (H1), the linear response to waves. Wind lowers
    the coherence, which is 1 for a linear system without noise; at low coherence the amplitude is uncertain
    and tends to be too large. segment: seconds per window; None: an eighth of the record.
    Raises: InputError for a missing channel, a record without waves, or uneven times.
    """
    frequency, amplitude, _, coherence, energetic = _estimate(frame, channel, skip, segment)
    return frequency[energetic], amplitude[energetic], coherence[energetic]


def _estimate(frame, channel, skip, segment):
    """Return (frequency, amplitude, phase lead in deg, coherence, whether waves have energy), (n,) each.

    At all frequencies above zero; arguments and errors as response_operator.
    """
    for name in (TIME, WAVE, channel):
        if name not in frame.columns:
            raise InputError(f"response operator: the run has no column {name!r}")
    kept = frame[frame[TIME] >= frame[TIME].iloc[0] + skip]
    time = kept[TIME].to_numpy()
    if len(time) < 64:
        raise InputError(f"response operator: {len(time)} rows remain; must be at least 64")
    step = even_step("response operator", time)
    wave, motion = kept[WAVE].to_numpy(), kept[channel].to_numpy()
    if np.ptp(wave) < 1e-9:
        raise InputError("response operator: the run has no waves")
    length = (time[-1] - time[0]) / 8.0 if segment is None else segment
    samples = int(min(len(time), max(32, round(length / step))))
    settings = {"fs": 1.0 / step, "nperseg": samples, "detrend": "linear"}
    frequency, power = welch(wave, **settings)
    _, answer = welch(motion, **settings)
    _, cross = csd(wave, motion, **settings)
    with np.errstate(invalid="ignore", divide="ignore"):
        coherence = np.abs(cross) ** 2 / (power * answer)
        amplitude = np.abs(cross) / power
    result = frequency, amplitude, np.degrees(np.angle(cross)), coherence, power > ENERGETIC * power.max()
    return tuple(values[1:] for values in result)


def broken_at_wraps(x, degrees):
    """Return (x, angles in [-180, 180) deg) of a line, interrupted where the angle crosses +-180 deg."""
    x, angle = np.asarray(x, dtype=float), (np.asarray(degrees) + 180.0) % 360.0 - 180.0
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > 180.0) + 1
    return np.insert(x, jumps, np.nan), np.insert(angle, jumps, np.nan)


def plot_raos(runs, path=None, title=None, skip=0.0, segment=None, platform_pitch_period=None):
    """Plot amplitude, phase and coherence of responses to waves over frequency, of {label: frame} or a frame.

    Lines are solid where the waves have energy and the coherence exceeds 0.5, faint elsewhere. The phase is
    the lead of the response over the wave, in [-180, 180) deg. A line marks the platform-pitch resonance of
    a period (s).
    """
    runs = named_runs(runs if isinstance(runs, dict) else {"": runs})
    panels = _shown(MOTION_CHANNELS, list(runs.values()), "run")
    figure = new_figure(3.4 * len(panels) + 0.4, 6.4)
    grid = figure.subplots(3, len(panels), sharex=True, squeeze=False, height_ratios=(2.0, 1.2, 0.8))
    for column, (name, channel) in enumerate(panels):
        highest = 0.0
        for number, (label, frame) in zip(style_numbers(runs), runs.items(), strict=True):
            if channel not in frame.columns:
                continue
            frequency, amplitude, phase, coherence, energetic = _estimate(frame, channel, skip, segment)
            highest = max(highest, amplitude[energetic].max())
            style = line_style(number)
            for kept, look in (
                (energetic, {"lw": 0.9, "alpha": 0.3}),
                (energetic & (coherence > COHERENT), {"lw": 1.5, "label": label}),
            ):
                grid[0, column].plot(frequency, np.where(kept, amplitude, np.nan), **look, **style)
                line = broken_at_wraps(frequency, np.where(kept, phase, np.nan))
                grid[1, column].plot(*line, **look, **style)
            grid[2, column].plot(frequency, coherence, linewidth=1.1, **style)
        for axes in grid[:, column]:
            style_axes(axes)
            axes.fill_between(
                frequency, 0, 1, where=~energetic, step="mid", color=UNSCORED, zorder=0, linewidth=0,
                transform=axes.get_xaxis_transform(),
            )  # fmt: skip
            if platform_pitch_period is not None:
                axes.axvline(1.0 / platform_pitch_period, color=SOFT, linewidth=0.9, linestyle="--", zorder=1)
        grid[0, column].set_title(name, fontsize=9, color=INK, loc="left")
        grid[0, column].set_ylim(0.0, 1.08 * highest)
        grid[1, column].set_ylim(-180.0, 180.0)
        grid[1, column].set_yticks(range(-180, 181, 90))
        grid[2, column].set_ylim(0.0, 1.0)
        grid[2, column].set_xlabel("frequency (Hz)", fontsize=8, color=INK)
    for axes, text in zip(grid[:, 0], ("amplitude", "phase (deg)", "coherence"), strict=True):
        axes.set_ylabel(text, fontsize=8.5, color=INK)
    grid[0, 0].set_xlim(*RAO_RANGE)
    if platform_pitch_period is not None:
        position = (1.0 / platform_pitch_period, 0.02)
        note(grid[0, 0], "platform-pitch resonance", position, (3, 0), rotation=90)
    figure.align_ylabels(grid[:, 0])
    title = title or "Response per metre of wave amplitude (grey: waves without energy)"
    head_of(figure, grid[0], list(runs), title)
    return save_figure(figure, path)
