"""Plots the learning curve of a training run."""

from fowt_env.visual.style import COLOURS, new_figure, save_figure, style_axes

PANELS = (
    ("reward", "validation return"),
    ("rotor_speed_std_ratio", "rotor-speed std / baseline"),
    ("platform_pitch_std_ratio", "platform-pitch std / baseline"),
    ("blade_pitch_travel_ratio", "blade-pitch travel / baseline"),
)


def plot_learning_curve(label, rows, curve, path):
    """Plot returns of the training episodes and validations of a run over decisions; return the path.

    rows: of the validations, a panel for each of PANELS; curve: rows of returns of the training.
    Raises: InputError if matplotlib is missing.
    """
    figure = new_figure(8.0, 10.0)
    axes = figure.subplots(1 + len(PANELS), 1, sharex=True)
    lines = [(curve, "return", "training return", ""), *((rows, *panel, ".") for panel in PANELS)]
    for axis, (table, name, text, marker) in zip(axes, lines, strict=True):
        steps = [row["decisions"] / 1e3 for row in table]
        axis.plot(steps, [row[name] for row in table], label=label, color=COLOURS[0], marker=marker)
        if name.endswith("ratio"):
            axis.axhline(1.0, color="0.6", linewidth=0.8)
        axis.set_ylabel(text, fontsize=8)
        style_axes(axis)
    axes[-1].set_xlabel("decisions (thousands)")
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=3)
    save_figure(figure, path)
    return path
