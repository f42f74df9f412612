"""Learning curves of one or several runs as a picture."""

import argparse
from pathlib import Path

import pandas as pd

from fowt_env.visual.style import COLOURS, new_figure, save_figure, style_axes

PANELS = (
    ("reward", "validation return"),
    ("rotor_speed_std_ratio", "rotor-speed std / baseline"),
    ("platform_pitch_std_ratio", "platform-pitch std / baseline"),
    ("blade_pitch_travel_ratio", "blade-pitch travel / baseline"),
)


def plot_learning_curve(runs, path):
    """Plot {label: list of validation rows} over decisions, one panel per ratio; return the path.

    Raises: InputError where matplotlib is missing.
    """
    figure = new_figure(8.0, 9.0)
    axes = figure.subplots(len(PANELS), 1, sharex=True)
    for axis, (name, label) in zip(axes, PANELS, strict=True):
        for number, (run, rows) in enumerate(runs.items()):
            steps = [row["decisions"] / 1e6 for row in rows]
            colour, line = COLOURS[number % len(COLOURS)], "-" if number < len(COLOURS) else "--"
            axis.plot(steps, [row[name] for row in rows], label=run, color=colour, marker=".", linestyle=line)
        if name.endswith("ratio"):
            axis.axhline(1.0, color="0.6", linewidth=0.8)
        axis.set_ylabel(label, fontsize=8)
    axes[-1].set_xlabel("decisions (millions)")
    return _finished(figure, axes, path)


def _finished(figure, axes, path):
    """Style the axes, add the legend, write the figure; return the path."""
    for axis in axes:
        style_axes(axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=8, loc="outside lower center", ncols=3)
    save_figure(figure, path)
    return path


def plot_front(runs, path):
    """Plot motions over blade-pitch travel, every validation of the runs, as ratios; return the path.

    runs: {label: list of validation rows}. Large marks: the policy that was kept.
    """
    figure = new_figure(8.0, 4.5)
    axes = figure.subplots(1, 2, sharex=True)
    for axis, (name, label) in zip(axes, PANELS[1:3], strict=True):
        for number, (run, rows) in enumerate(runs.items()):
            colour = COLOURS[number % len(COLOURS)]
            travel = [row["blade_pitch_travel_ratio"] for row in rows]
            axis.plot(travel, [row[name] for row in rows], ".", color=colour, alpha=0.4)
            best = min(rows, key=lambda row: row["score"])
            mark = "o" if number < len(COLOURS) else "s"
            axis.plot(best["blade_pitch_travel_ratio"], best[name], mark, color=colour, label=run)
        axis.axhline(1.0, color="0.6", linewidth=0.8)
        axis.axvline(1.0, color="0.6", linewidth=0.8)
        axis.set_xlabel("blade-pitch travel / baseline")
        axis.set_ylabel(label, fontsize=8)
    return _finished(figure, axes, path)


def main(arguments=None):
    """Plot the learning curves and the Pareto plot of several runs.

    python -m fowt_env.training.rl.learning_curve measured=runs/a preview=runs/b --out results/rl
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", metavar="LABEL=FOLDER")
    parser.add_argument("--out", default="results/rl", help="folder of the pictures")
    given = parser.parse_args(arguments)
    runs = {}
    for text in given.runs:
        label, _, folder = text.rpartition("=")
        table = pd.read_csv(Path(folder) / "validation.csv")
        runs[label or folder] = table.to_dict("records")
    print(plot_learning_curve(runs, Path(given.out) / "rl_learning_curves.png"))
    print(plot_front(runs, Path(given.out) / "rl_front.png"))


if __name__ == "__main__":
    main()
