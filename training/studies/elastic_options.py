"""Measures which option of a scene moves which figure, one option at a time, at fidelity "elastic".

    python -m fowt_env.training.studies.elastic_options --out runs/elastic_options.csv
    python -m fowt_env.training.studies.elastic_options --out runs/elastic_options.csv --report

Each option is a kind of scene of its own, which takes a minute or two to compile. Finished rows are kept: the
same command continues a stopped study.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd

from fowt_env.errors import unknown
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import read_table, write_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.evaluation.metrics import damage_equivalent_load

PLATFORMS = ("oc3_hywind", "iea15_volturnus_s")
WIND, SEA = "ntm:18:B", "jonswap:7.5:10"
DURATION, SETTLED, STEP = 700.0, 100.0, 0.05  # s
SEEDS = (1, 2, 3, 4)
BASE = "fidelity elastic"
VARIANTS = {  # changed against BASE: options
    BASE: {},
    "rigid blades": {"blades": "rigid"},
    "one flap mode": {"blades": "modes"},
    "rigid tower": {"tower": "rigid"},
    "rigid shaft": {"shaft": "rigid"},
    "no dynamic inflow": {"dynamic_inflow": False},
    "unsteady airfoils": {"unsteady_airfoils": "hgm"},
    "tower influence": {"tower_potential": "potential", "tower_shadow": "powles"},
    "moving lines": {"mooring": "dynamic"},
    "second-order waves": {"second_order": "full"},
}
ALONE = {"second-order waves": ("iea15_volturnus_s",)}  # variants that only these platforms have
DEVIATIONS = {
    "RotSpeed_[rpm]": "rotor speed", "GenPwr_[kW]": "power", "PtfmSurge_[m]": "surge",
    "PtfmPitch_[deg]": "platform pitch",
}  # fmt: skip
LOADS = {  # channel: (words, exponent)
    "RootMyc1_[kN-m]": ("blade root, flap", 10), "RootMxc1_[kN-m]": ("blade root, edge", 10),
    "RotTorq_[kN-m]": ("shaft torque", 4), "LSSTipMys_[kN-m]": ("shaft bending", 4),
    "TwrBsMyt_[kN-m]": ("tower base, fore-aft", 4), "TwrBsMxt_[kN-m]": ("tower base, side-side", 4),
    "FAIRTEN2_[kN]": ("line 2", 3),
}  # fmt: skip


def variants_of(platform):
    """Return the names of the variants that a platform has."""
    return [name for name in VARIANTS if platform in ALONE.get(name, (platform,))]


def figures(platform, variant, seeds=SEEDS, duration=DURATION, progress=None):
    """Return {channel: mean over the seeds of its standard deviation or 1 Hz damage-equivalent load}."""
    options = {"fidelity": "elastic", "pitch": "individual"} | VARIANTS[variant]
    scene = build_scene(platform, wind=WIND, sea=SEA, duration=duration, **options)
    rows = []
    for seed in seeds:
        frame = simulate(
            scene.with_weather(seed=seed), "pi", duration=duration, control_dt=STEP, output_dt=STEP
        )
        frame = frame[frame["Time_[s]"] >= SETTLED]
        row = {channel: frame[channel].std() for channel in DEVIATIONS}
        for channel, (_, exponent) in LOADS.items():
            row[channel] = damage_equivalent_load(frame[channel].to_numpy(), duration - SETTLED, exponent)
        rows.append(row)
        if progress is not None:
            progress(f"{platform}, {variant}, seed {seed}")
    return pd.DataFrame(rows).mean().to_dict()


def changes(table):
    """Return the figures of a table of main() as changes against BASE, %, with BASE's own figures first."""
    parts = []
    for _, rows in table.groupby("platform", sort=False):
        rows = rows.set_index(["platform", "variant"])
        base = rows.xs(BASE, level="variant").iloc[0]
        parts.append(
            pd.concat([rows[rows.index.get_level_values("variant") == BASE], 100.0 * (rows / base - 1.0)])
        )
    return pd.concat(parts)


def markdown(table):
    """Return the changes as a markdown table, a row per platform and option."""
    cells = []
    for (platform, variant), row in changes(table).iterrows():
        if variant == BASE and not (row == 0.0).any():
            cells.append((platform, "value", *(f"{value:.4g}" for value in row)))
        elif variant != BASE:
            cells.append(("", variant, *(f"{value:+.1f}" for value in row)))
    words = [f"std {name}" for name in DEVIATIONS.values()] + [f"DEL {name}" for name, _ in LOADS.values()]
    return markdown_table(("platform", "change, %", *words), cells)


def main(arguments=None):
    """Measure the missing rows, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default="runs/elastic_options.csv", help="table of figures")
    parser.add_argument("--platform", action="append", help="only this platform")
    parser.add_argument("--report", action="store_true", help="print the changes without measuring")
    args = parser.parse_args(arguments)
    table = read_table(args.out) if Path(args.out).is_file() else pd.DataFrame()
    if args.report:
        print(markdown(table))
        return
    known = set() if table.empty else set(zip(table["platform"], table["variant"], strict=True))
    for platform in args.platform or PLATFORMS:
        if platform not in PLATFORMS:
            raise unknown("platform", platform, PLATFORMS)
        for variant in variants_of(platform):
            if (platform, variant) in known:
                continue
            row = {"platform": platform, "variant": variant}
            row |= figures(platform, variant, progress=lambda text: print(text, file=sys.stderr))
            table = pd.concat([table, pd.DataFrame([row])], ignore_index=True)
            Path(args.out).parent.mkdir(parents=True, exist_ok=True)
            write_table(table, args.out)


if __name__ == "__main__":
    main()
