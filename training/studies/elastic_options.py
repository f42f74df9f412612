"""Measures which option of a scene moves which figure, one option at a time, at fidelity "elastic".

    python -m fowt_env.training.studies.elastic_options --out runs/elastic_options.csv
    python -m fowt_env.training.studies.elastic_options --out runs/elastic_options.csv --report
    python -m fowt_env.training.studies.elastic_options --openfast    the same in OpenFAST's runs

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
from fowt_env.training.validation.openfast_cases import reference, table

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


STORED_UNTIL = 400.0  # s, end of the stored runs with dynamic inflow
STORED_LOADS = {  # as LOADS, of bending blades
    "RootMyb1_[kN-m]": ("blade root, flap", 10), "RootMxb1_[kN-m]": ("blade root, edge", 10),
    "RotTorq_[kN-m]": ("shaft torque", 4), "LSSTipMya_[kN-m]": ("shaft bending", 4),
    "TwrBsMyt_[kN-m]": ("tower base, fore-aft", 4), "TwrBsMxt_[kN-m]": ("tower base, side-side", 4),
}  # fmt: skip
STORED_SERIES = {  # option and turbine: (run without, run with it), each (case, subfolder)
    "tower modes, IEA 15 MW": (
        ("turb_18mps_Hs7.5_uniform", "iea15_volturnus_s"),
        ("turb_18mps_Hs7.5_uniform_tower", "iea15_volturnus_s"),
    ),
    "blades and second tower modes, IEA 15 MW": (
        ("turb_18mps_Hs7.5_uniform_tower", "iea15_volturnus_s"),
        ("iea15_turb_18mps", "elastic"),
    ),
    "blades, tower and shaft, NREL 5 MW": (
        ("turb_18mps_Hs7.5_uniform", ""),
        ("turb_18mps_Hs7.5_uniform_flex", ""),
    ),
}


def _stored_figures(frame, end=None):
    """Return {channel: standard deviation or damage-equivalent load} of a stored run from SETTLED on."""
    time = frame["Time_[s]"]
    frame = frame[(time >= SETTLED - 1e-6) & (time <= (time.iloc[-1] if end is None else end) + 1e-6)]
    duration = frame["Time_[s]"].iloc[-1] - frame["Time_[s]"].iloc[0]
    loads = {channel: exponent for channel, (_, exponent) in STORED_LOADS.items() if channel in frame}
    found = {channel: frame[channel].std(ddof=0) for channel in DEVIATIONS if channel in frame}
    return found | {c: damage_equivalent_load(frame[c].to_numpy(), duration, m) for c, m in loads.items()}


def openfast_changes():
    """Return a DataFrame of changes (%) by options in OpenFAST's stored runs at 18 m/s, 10 Hz."""
    rows = {}
    for words, runs in STORED_SERIES.items():
        without, changed = (_stored_figures(reference(case, None, place)) for case, place in runs)
        rows[words] = {c: 100.0 * (changed[c] / without[c] - 1.0) for c in changed if c in without}
    for name, words in (("iea15", "IEA 15 MW"), ("nrel5mw", "NREL 5 MW")):
        stored = table(f"elastic/{name}_turbulent.csv.gz").set_index(["case", "channel"])
        stored = stored.loc[f"{name}/turb_18mps_dbemt"]
        without = _stored_figures(reference(f"{name}_turb_18mps", None, "elastic"), STORED_UNTIL)
        rows[f"dynamic inflow, {words}"] = {
            c: 100.0 * (stored.loc[c, "DEL_10Hz" if c in STORED_LOADS else "std"] / value - 1.0)
            for c, value in without.items()
        }
    return pd.DataFrame(rows).T


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


def markdown(figures):
    """Return the figures of main() as a markdown table: those of BASE, and changes against them, %."""
    cells = []
    for platform, rows in figures.groupby("platform", sort=False):
        rows = rows.drop(columns="platform").set_index("variant")
        base = rows.loc[BASE]
        cells.append((platform, "value", *(f"{value:.4g}" for value in base)))
        for variant, row in rows.drop(index=BASE).iterrows():
            cells.append(("", variant, *(f"{value:+.1f}" for value in 100.0 * (row / base - 1.0))))
    return markdown_table(("platform", "change, %", *_words(LOADS)), cells)


def _words(loads):
    """Return the names of the columns of a table."""
    return [f"std {name}" for name in DEVIATIONS.values()] + [f"DEL {name}" for name, _ in loads.values()]


def main(arguments=None):
    """Measure the missing rows, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", default="runs/elastic_options.csv", help="table of figures")
    parser.add_argument("--platform", action="append", help="only this platform")
    parser.add_argument("--openfast", action="store_true", help="print the changes in OpenFAST's stored runs")
    parser.add_argument("--report", action="store_true", help="print the changes without measuring")
    args = parser.parse_args(arguments)
    if args.openfast:
        rows = openfast_changes().reindex(columns=[*DEVIATIONS, *STORED_LOADS])
        cells = [(words, *("" if pd.isna(v) else f"{v:+.1f}" for v in row)) for words, row in rows.iterrows()]
        print(markdown_table(("change, %", *_words(STORED_LOADS)), cells))
        return
    rows = read_table(args.out) if Path(args.out).is_file() else pd.DataFrame()
    if args.report:
        print(markdown(rows))
        return
    known = set() if rows.empty else set(zip(rows["platform"], rows["variant"], strict=True))
    for platform in args.platform or PLATFORMS:
        if platform not in PLATFORMS:
            raise unknown("platform", platform, PLATFORMS)
        for variant in variants_of(platform):
            if (platform, variant) in known:
                continue
            row = {"platform": platform, "variant": variant}
            row |= figures(platform, variant, progress=lambda text: print(text, file=sys.stderr))
            rows = pd.concat([rows, pd.DataFrame([row])], ignore_index=True)
            Path(args.out).parent.mkdir(parents=True, exist_ok=True)
            write_table(rows, args.out)


if __name__ == "__main__":
    main()
