"""Plots the learning curve of a training run."""

from fowt_env.visual.style import COLOURS, new_figure, save_figure, style_axes

PANELS = (
    ("reward", "validation return"),
    ("rotor_speed_std_ratio", "rotor-speed std / baseline"),
    ("platform_pitch_std_ratio", "platform-pitch std / baseline"),
    ("blade_pitch_travel_ratio", "blade-pitch travel / baseline"),
)


def plot_learning_curve(label, rows, path):
    """Plot the validation rows of a run over decisions, one panel per ratio; return the path.

    Raises: InputError if matplotlib is missing.
    """
    figure = new_figure(8.0, 9.0)
    axes = figure.subplots(len(PANELS), 1, sharex=True)
    for axis, (name, text) in zip(axes, PANELS, strict=True):
        steps = [row["decisions"] / 1e6 for row in rows]
        axis.plot(steps, [row[name] for row in rows], label=label, color=COLOURS[0], marker=".")
        if name.endswith("ratio"):
            axis.axhline(1.0, color="0.6", linewidth=0.8)
        axis.set_ylabel(text, fontsize=8)
        style_axes(axis)
    axes[-1].set_xlabel("decisions (millions)")
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=3)
    save_figure(figure, path)
    return path
