"""Learning curves of one or several runs as a picture."""

from fowt_env.plots import COLOURS, _new_figure, _save, _style

PANELS = (
    ("reward", "validation return"),
    ("rotor_speed_std_ratio", "rotor-speed std / baseline"),
    ("platform_pitch_std_ratio", "platform-pitch std / baseline"),
    ("blade_pitch_travel_ratio", "blade-pitch travel / baseline"),
)


def plot_learning_curve(runs, path):
    """Path of a plot of {label: list of validation rows} over decisions, one panel per figure.

    Raises: InputError where matplotlib is missing.
    """
    figure = _new_figure(8.0, 9.0)
    axes = figure.subplots(len(PANELS), 1, sharex=True)
    for axis, (name, label) in zip(axes, PANELS, strict=True):
        for number, (run, rows) in enumerate(runs.items()):
            steps = [row["decisions"] / 1e6 for row in rows]
            colour = COLOURS[number % len(COLOURS)]
            axis.plot(steps, [row[name] for row in rows], label=run, color=colour, marker=".")
        if name.endswith("ratio"):
            axis.axhline(1.0, color="0.6", linewidth=0.8)
        axis.set_ylabel(label, fontsize=8)
        _style(axis)
    axes[0].legend(fontsize=8)
    axes[-1].set_xlabel("decisions (millions)")
    _save(figure, path)
    return path
