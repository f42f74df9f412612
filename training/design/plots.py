"""Plots linear design: poles and damping over the wind, Bode plots, and Pareto fronts of linear control.

As in visual/time_series.py every function returns a matplotlib Figure and writes it to `path` if not None.
Needs matplotlib: pip install "fowt-env[plot]".
"""

from itertools import cycle

import numpy as np

from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import InputError
from fowt_env.training.design.linear_bound import efficient
from fowt_env.visual.style import COLOURS, FAINT, INK, LINES, SOFT, new_figure, save_figure, style_axes

MODE_NAMES = (
    "surge", "sway", "heave", "roll", "platform_pitch", "yaw", "rotor_speed", "blade_pitch", "other",
)  # fmt: skip
MODE_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", "*")
OF_REAL_POLES = ("rotor_speed", "blade_pitch", "surge", "sway", "heave", "roll", "platform_pitch", "yaw")
REAL = 1e-6  # rad/s: a pole with a smaller imaginary part is real
FASTEST = 2.0  # 1/s: poles that decay faster belong to actuators
SLOW = 0.4  # rad/s: surge, platform pitch and heave are slower, yaw is faster
FREQUENCIES = np.geomspace(0.01, 4.0, 4000)  # rad/s; a notch of a damping ratio of 0.001 is followed
BODE = (  # input, output, title, factor to the unit shown, unit
    ("blade_pitch_command", "rotor_speed", "blade pitch to rotor speed", DEGREE / RPM, "rpm/deg"),
    ("generator_torque", "rotor_speed", "torque to rotor speed", 1e3 / RPM, "rpm/(kN m)"),
    ("wind_speed", "platform_pitch", "wind to platform pitch", 1.0 / DEGREE, "deg/(m/s)"),
)
GAIN_RANGE = 60.0  # dB, in every Bode plot, for comparable slopes
WIND = "wind_[m/s]"


def _wind_colours(winds):
    """Return {wind: colour} from dark (low wind) to light, and the scale of the colour bar.

    Raises: InputError without winds.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    if not winds:
        raise InputError("nothing to plot: no linear models were given")
    low, high = min(winds), max(winds)
    scale = ScalarMappable(Normalize(low, high if high > low else low + 1.0), "viridis")
    return {wind: scale.to_rgba(wind) for wind in winds}, scale


def plot_poles(models, path=None, title=None):
    """Return a Figure of the poles of {wind: LinearModel} over the wind, all and near the origin.

    Oscillatory poles have the mark of their mode; real poles, of rotor speed and actuators, lie on
    the real axis. Poles that decay faster than FASTEST lie outside and are listed with their value.
    """
    colours, scale = _wind_colours(list(models))
    poles = [(wind, *pole) for wind, model in models.items() for pole in _poles(model)]
    figure = new_figure(11.5, 5.2)
    panels = figure.subplots(1, 2, width_ratios=(1.0, 1.8))
    beyond = [(name, pole) for _, name, pole in poles if pole.real < -FASTEST]
    for axes, slow in zip(panels, (False, True), strict=True):
        style_axes(axes)
        shown = [each for each in poles if each[2].real >= -FASTEST and (not slow or abs(each[2]) < SLOW)]
        for mode in {name for _, name, pole in shown if pole.imag > 0.0}:  # a path over the wind
            path_of = np.array([pole for _, name, pole in shown if name == mode and pole.imag > 0.0])
            axes.plot(path_of.real, path_of.imag, color=SOFT, linewidth=0.7, zorder=2)
        for wind, name, pole in shown:
            style = {"color": colours[wind], "edgecolor": INK, "linewidth": 0.3, "s": 20}
            axes.scatter(pole.real, pole.imag, marker=MODE_MARKERS[MODE_NAMES.index(name)], zorder=3, **style)
        turning = [pole for _, _, pole in shown if pole.imag > 0.0 or not slow]
        _damping_lines(axes, min(p.real for p in turning), max(p.imag for p in turning))
        axes.set_xlabel("real part (1/s)", fontsize=9, color=INK)
    names = {name for _, name, _ in poles} - {name for name, _ in beyond}
    for name, mark in zip(MODE_NAMES, MODE_MARKERS, strict=True):
        if name in names:
            panels[0].scatter([], [], marker=mark, color=SOFT, label=name.replace("_", " "))
    handles, labels = panels[0].get_legend_handles_labels()
    panels[0].set_ylabel("imaginary part (rad/s)", fontsize=9, color=INK)
    panels[0].set_title(f"all slower than {FASTEST:g} 1/s", fontsize=9, color=INK, loc="left", pad=16)
    panels[1].set_title("near the origin", fontsize=9, color=INK, loc="left", pad=16)
    if beyond:
        texts = sorted({f"{name.replace('_', ' ')} at {pole.real:.3g} 1/s" for name, pole in beyond})
        text = f"further left: {', '.join(texts[:3])}"
        panels[0].annotate(text, (0.01, 0.06), xycoords="axes fraction", fontsize=8, color=SOFT)
    _colour_bar(figure, scale, panels, "wind (m/s)")
    figure.legend(
        handles, labels, loc="outside upper center", ncols=len(labels), fontsize=8.5, frameon=False,
        labelcolor=INK, title=f"{title or 'Poles'}: torque and blade pitch held; grey lines: damping ratio",
        title_fontproperties={"size": 11},
    )  # fmt: skip
    return save_figure(figure, path)


def _poles(model):
    """Return [(name, pole rad/s)] of the poles of a LinearModel with non-negative imaginary part.

    Oscillations have the names of model.modes(); a real pole that of the state of OF_REAL_POLES that
    participates most in it.
    """
    values, vectors = np.linalg.eig(model.A)
    left = np.linalg.inv(vectors)
    modes = {complex(-m.damping_ratio * m.frequency, 2.0 * np.pi / m.period): m.name for m in model.modes()}
    entries = []
    for number, value in enumerate(values):
        if value.imag > REAL:
            nearest = min(modes, key=lambda pole: abs(pole - value))
            entries.append((modes[nearest], complex(value)))
        elif abs(value.imag) <= REAL:
            weight = np.abs(vectors[:, number] * left[number])
            states = [(weight[i], name) for i, name in enumerate(model.states) if name in OF_REAL_POLES]
            entries.append((max(states)[1], complex(value.real)))
    return entries


def _colour_bar(figure, scale, axes, label):
    """Draw a colour bar next to axes."""
    bar = figure.colorbar(scale, ax=axes, pad=0.01)
    bar.set_label(label, fontsize=9, color=INK)
    bar.ax.tick_params(labelsize=8, colors=INK)
    bar.outline.set_visible(False)


def _damping_lines(axes, left, top):
    """Set axis limits from the real part `left` and imaginary part `top`; draw lines of constant damping."""
    low, high = min(1.1 * left, -1e-3), 1.1 * max(top, 1e-2)
    axes.set_xlim(low, -0.05 * low)
    axes.set_ylim(-0.03 * high, high)
    axes.axhline(0.0, color=INK, linewidth=0.8, zorder=1)
    axes.axvline(0.0, color=INK, linewidth=0.8, zorder=1)
    named = 0.0
    for damping in (0.5, 0.3, 0.2, 0.1, 0.05, 0.02):
        slope = np.sqrt(1.0 - damping**2) / damping
        axes.plot([0.0, low], [0.0, -slope * low], color="#BBBBBB", linewidth=0.9, zorder=1)
        over = -slope * low >= high
        position = (-high / slope, high) if over else (low, -slope * low)
        if over and position[0] - named < 0.075 * -low and named:
            continue  # no space for its label
        named = position[0] if over else named
        axes.annotate(
            f"{damping:g}", position, fontsize=7, color=SOFT, xytext=(0, 3) if over else (3, 3),
            textcoords="offset points", ha="center" if over else "left", annotation_clip=False,
        )  # fmt: skip


def plot_damping(models, path=None, title=None):
    """Return a Figure of period and damping ratio of every mode over the wind of {wind: LinearModel}."""
    if not models:
        raise InputError("nothing to plot: no linear models were given")
    figure = new_figure(9.0, 5.6)
    panels = figure.subplots(2, 1, sharex=True)
    modes = [(wind, mode) for wind, model in models.items() for mode in model.modes()]
    for colour, mark, name in zip(COLOURS * 2, MODE_MARKERS, MODE_NAMES, strict=False):
        points = [(wind, mode.period, mode.damping_ratio) for wind, mode in modes if mode.name == name]
        if points:
            winds, periods, ratios = zip(*points, strict=True)
            style = {"color": colour, "marker": mark, "markersize": 4, "linewidth": 1.0}
            panels[0].plot(winds, periods, label=name.replace("_", " "), **style)
            panels[1].plot(winds, ratios, **style)
    for axes, label in zip(panels, ("period (s)", "damping ratio"), strict=True):
        style_axes(axes)
        axes.set_ylabel(label, fontsize=9, color=INK)
    panels[0].set_yscale("log")
    panels[0].set_yticks([8, 10, 20, 30, 50, 100, 150], ["8", "10", "20", "30", "50", "100", "150"])
    panels[0].minorticks_off()
    panels[1].axhline(0.0, color=INK, linewidth=0.8)
    panels[1].set_xlabel("wind (m/s)", fontsize=9, color=INK)
    panels[0].legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.suptitle(f"{title or 'Modes over the wind'}: torque and blade pitch held", fontsize=10, color=INK)
    return save_figure(figure, path)


def plot_bode(models, path=None, title=None):
    """Return a Figure of gain (dB) and continuous phase of BODE for {wind: LinearModel}.

    Blade pitch is shown only at winds at which the blade pitch is not at its limit.
    """
    from matplotlib.ticker import MultipleLocator

    colours, scale = _wind_colours(list(models))
    figure = new_figure(12.0, 5.8)
    panels = figure.subplots(2, len(BODE), sharex=True)
    for column, (source, output, name, factor, unit) in enumerate(BODE):
        gain, phase = panels[:, column]
        for wind, model in models.items():
            response = model.response(FREQUENCIES, (source,))[:, model.output_index(output), 0] * factor
            if source == "blade_pitch_command" and model.pitch_rests:
                continue
            gain.semilogx(FREQUENCIES, 20.0 * np.log10(np.abs(response)), color=colours[wind], linewidth=1.0)
            angle = np.degrees(np.unwrap(np.angle(response)))
            started = phase.lines[-1].get_ydata()[0] if phase.lines else (angle[0] + 90.0) % 360.0 - 90.0
            angle -= 360.0 * np.round((angle[0] - started) / 360.0)  # beside the one of the wind before
            phase.semilogx(FREQUENCIES, angle, color=colours[wind], linewidth=1.0)
        gain.set_title(name, fontsize=9.5, color=INK, loc="left")
        gain.set_ylabel(f"gain (dB; 0 dB: 1 {unit})", fontsize=8.5, color=INK)
        phase.set_xlabel("frequency (rad/s)", fontsize=9, color=INK)
        phase.yaxis.set_major_locator(
            MultipleLocator(90.0 if np.ptp(phase.dataLim.intervaly) > 270.0 else 45.0)
        )
        for axes in (gain, phase):
            style_axes(axes)
            axes.grid(True, which="minor", axis="x", color=FAINT, linewidth=0.3)
            axes.set_xlim(FREQUENCIES[0], FREQUENCIES[-1])
        if gain.lines:
            top = max(line.get_ydata().max() for line in gain.lines) + 4.0
            gain.set_ylim(top - GAIN_RANGE, top)
    panels[1, 0].set_ylabel("phase (deg)", fontsize=8.5, color=INK)
    figure.align_ylabels(panels[:, 0])
    _colour_bar(figure, scale, panels, "wind (m/s)")
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return save_figure(figure, path)


def plot_bound(table, names, points=None, path=None, title=None):
    """Return a Figure of the fronts of linear_bound.bound_table relative to gspi_oc3, one panel per wind.

    names: {information: legend text}, in order. points: training.design.linear_bound.ratio_table of simulated
    controllers, coloured by blade-pitch travel relative to gspi_oc3. If points is not None, winds without
    points are omitted.
    """
    winds = sorted(table[WIND].unique())
    if points is not None:
        winds = [wind for wind in winds if wind in set(points[WIND])]
    if not winds:
        raise InputError("nothing to plot: no wind has both a Pareto front and simulated points")
    looks = {
        name: {"label": text, "color": colour, "ls": line, "linewidth": 1.2 if i else 1.6}
        for i, ((name, text), colour, line) in enumerate(
            zip(names.items(), cycle(COLOURS), cycle(LINES), strict=False)
        )
    }
    columns = min(4, len(winds))
    rows = -(-(len(winds) + (len(winds) > 3)) // columns)
    figure = new_figure(3.0 * columns + 0.8, 2.9 * rows + (1.2 if len(winds) <= 3 else 0.5))
    panels = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    if points is not None:  # white at 1, and the ends at the largest difference
        largest = np.abs(points.loc[points[WIND].isin(winds), "travel_ratio_[-]"] - 1.0).max()
        span = max(0.05, float(np.ceil(20.0 * largest) / 20.0))
        travel = {"cmap": "coolwarm", "vmin": 1.0 - span, "vmax": 1.0 + span}
    for axes, wind in zip(panels, winds, strict=False):
        draw_fronts(axes, table, wind, looks, (1.25, 1.15))
        if points is not None:
            shown = points[points[WIND] == wind]
            drawn = axes.scatter(
                shown["speed_ratio_[-]"], shown["pitch_ratio_[-]"], c=shown["travel_ratio_[-]"], **travel,
                s=30, edgecolor=INK, linewidth=0.5, label="lqr, simulated", zorder=5,
            )  # fmt: skip
    if points is not None:
        _colour_bar(figure, drawn, panels, "mean blade-pitch rate relative to gspi_oc3")
    return finish_bound(figure, panels, len(winds), path, title)


def draw_fronts(axes, table, wind, looks, ends):
    """Draw the fronts {information: style} of a bound_table at one wind, within the upper axis limits."""
    style_axes(axes)
    here = table[table[WIND] == wind]
    for information, look in looks.items():
        front = efficient(here[here["information"] == information][["speed_ratio_[-]", "pitch_ratio_[-]"]])
        if len(front):
            axes.plot(*front.T, **look)
    axes.scatter(1.0, 1.0, marker="+", s=70, color=INK, label="gspi_oc3", zorder=4)
    axes.set_xlim(0.0, ends[0])
    axes.set_ylim(0.0, ends[1])
    axes.set_title(f"{wind:g} m/s", fontsize=9, color=INK)


def finish_bound(figure, panels, used, path, title):
    """Complete a grid of deviations relative to gspi_oc3, write it to path and return the Figure.

    Adds labels, title and a legend in the first unused panel, or above the grid; hides other unused panels.
    """
    figure.supxlabel("rotor-speed deviation relative to gspi_oc3", fontsize=9, color=INK)
    figure.supylabel("platform-pitch deviation relative to gspi_oc3", fontsize=9, color=INK)
    if title:
        figure.suptitle(title, fontsize=10, color=INK)
    for axes in panels[used:]:
        axes.set_axis_off()
    columns = panels[0].get_subplotspec().get_gridspec().ncols
    for axes in panels[max(0, used - columns) : used]:  # also above an unused panel
        axes.tick_params(labelbottom=True)
    handles, labels = panels[0].get_legend_handles_labels()
    if len(panels) > used:
        panels[used].legend(handles, labels, fontsize=8, frameon=False, loc="center")
    else:
        columns = 1 if used == 1 else 3
        figure.legend(handles, labels, loc="outside upper center", ncols=columns, fontsize=8, frameon=False)
    return save_figure(figure, path)
