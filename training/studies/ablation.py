"""Compares agents with different information, action mode and algorithm, changing one setting at a time.

    python -m fowt_env.training.studies.ablation --out runs/ablation [--only direct,estimate]
    python -m fowt_env.training.studies.ablation --out runs/ablation --report docs/figures/rl_ablation.png

The same command continues a stopped run. Runs are much shorter than those of the shipped agents: they
compare the variants of ablation.yml and do not show the best performance of each.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd
import yaml
from scipy.stats import t

from fowt_env.errors import InputError, unknown
from fowt_env.files.markdown import markdown_table
from fowt_env.training.rl.train import Training, resolve
from fowt_env.visual.style import COLOURS, new_figure, save_figure, style_axes

TABLE = Path(__file__).with_suffix(".yml")
KEYS = ("steps", "seeds", "common", "variants")
OWN_KEYS = ("label", "algo", "steps", "seeds", "set")
FIGURES = {
    "rotor_speed_std_ratio": "rotor-speed std",
    "platform_pitch_std_ratio": "platform-pitch std",
    "blade_pitch_travel_ratio": "blade-pitch travel",
    "shaft_power_std_ratio": "power std",
}
COLUMNS = FIGURES | {"capped_power_mean_ratio": "power up to rated"}  # of the table; FIGURES are plotted


def read_table(path=TABLE):
    """Read a file and return {variant: {OWN_KEYS: value}}, with common values. Raises: InputError."""
    table = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    variants = table["variants"]
    checks = {f"key of variant {name!r} of {path}": (keys, OWN_KEYS) for name, keys in variants.items()}
    for what, (keys, known) in {f"key of {path}": (table, KEYS), **checks}.items():
        for key in keys:
            if key not in known:
                raise unknown(what, key, known)
    shared = {"algo": "ppo", "steps": table["steps"], "seeds": table["seeds"]}
    return {n: shared | keys | {"set": table["common"] | keys.get("set", {})} for n, keys in variants.items()}


def variant_of(table, name):
    """Return the entry of a variant in the table. Raises: InputError for an unknown name."""
    if name not in table:
        raise unknown("variant", name, table)
    return table[name]


def settings_of(table, name, seed, steps=None):
    """Return the resolved settings of a variant and seed. Raises: InputError."""
    variant = variant_of(table, name)
    return resolve(variant["algo"], "above_rated", seed, steps or variant["steps"], variant["set"])


def folder_of(out, name, seed):
    """Return the folder of the run of a variant and seed."""
    return Path(out) / f"{name}_{seed}"


def decisions_done(folder):
    """Return the number of decisions in the newest checkpoint of a run's folder; 0 without one."""
    steps = [int(p.name.removeprefix("step_")) for p in Path(folder).glob("checkpoints/step_*")]
    return max(steps, default=0)


def run_variant(table, name, seed, out, steps=None, report=None):
    """Train or continue the run of a variant and seed; return whether the run is complete."""
    settings, folder = settings_of(table, name, seed, steps), folder_of(out, name, seed)
    if decisions_done(folder) >= settings["steps"]:
        return True
    return Training(settings, folder, resume=(folder / "settings.yml").exists()).run(report)


def ablation_rows(table, out):
    """Return a DataFrame with a row per validated variant and seed: metrics of the best policy."""
    rows = []
    for name, seed in ((name, seed) for name, variant in table.items() for seed in variant["seeds"]):
        path = folder_of(out, name, seed) / "validation.csv"
        if path.is_file():
            validated = pd.read_csv(path)
            last = validated.iloc[-1]
            row = {"variant": name, "label": table[name]["label"], "seed": seed}
            row |= validated.loc[validated["score"].idxmin()].to_dict()
            rows.append(row | {f"{key}_trained": last[key] for key in ("decisions", "seconds")})
    if not rows:
        raise InputError(f"{out}: no variant has been validated yet")
    return pd.DataFrame(rows)


def plot_ablation(rows, path):
    """Plot ablation_rows, a line per variant and a dot per seed; return the path."""
    position, labels = pd.factorize(rows["label"])
    figure = new_figure(10.0, 1.2 + 0.33 * len(labels))
    axes = figure.subplots(1, len(FIGURES), sharey=True)
    for axis, (name, title), colour in zip(axes, FIGURES.items(), COLOURS, strict=False):
        axis.plot(rows[name], position, "o", color=colour)
        axis.axvline(1.0, color="0.6", linewidth=0.8)
        style_axes(axis, title=title)
    axes[0].set_yticks(range(len(labels)), labels, fontsize=8)
    axes[0].invert_yaxis()
    figure.supxlabel("ratio to gspi_oc3 on the validation episodes", fontsize=8)
    save_figure(figure, path)
    return path


def markdown(rows):
    """Return ablation_rows as a markdown table: means over seeds, 95 % interval of the mean score."""
    cells = []
    for label, group in rows.groupby("label", sort=False):
        mean, n = group.mean(numeric_only=True), len(group)
        score = f"{mean['score']:.3f}"
        if n > 1:
            score += f" ± {t.ppf(0.975, n - 1) * group['score'].sem():.3f}"
        trained = f"{mean['decisions_trained'] / 1e3:.0f} k", f"{mean['seconds_trained']:.0f}"
        cells.append(
            (label, *(f"{mean[c]:.3f}" for c in COLUMNS), f"{mean['failed']:.2f}", score, n, *trained)
        )
    return markdown_table(("", *COLUMNS.values(), "failed", "score", "seeds", "decisions", "s"), cells)


def main(arguments=None):
    """Train or continue the selected variants, or report the validated ones."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default="runs/ablation", help="folder of the runs")
    parser.add_argument("--table", default=str(TABLE), help="file of variants")
    parser.add_argument("--only", help="variants, comma-separated")
    parser.add_argument("--steps", type=int, help="decisions of each run (default: from the file)")
    parser.add_argument("--report", metavar="PICTURE", help="plot and print results without training")
    args = parser.parse_args(arguments)
    table = read_table(args.table)
    if args.report:
        rows = ablation_rows(table, args.out)
        print(plot_ablation(rows, args.report))
        print(markdown(rows))
        return
    for name in args.only.split(",") if args.only else table:
        for seed in variant_of(table, name)["seeds"]:

            def report(done, total, text, name=name, seed=seed):
                print(f"\r{name} {seed}: {done}/{total}: {text}  ", end="", file=sys.stderr)

            if not run_variant(table, name, seed, args.out, args.steps, report):
                sys.exit(f"stopped; the same command continues with {name}, seed {seed}")


if __name__ == "__main__":
    main()
