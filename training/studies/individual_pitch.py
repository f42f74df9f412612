"""Computes load reduction and pitch travel of individual pitch control, and its effect on platform motion.

Runs the suite `ipc` with the controllers of NAMES and `ipc_constrained` with other BOUNDS. Prints metrics
relative to the same law with collective pitch (lifetime means over winds and seeds), and root load, travel
and load of the pitch bearings over those of `pi`, over the lifetime and in each wind.
"""

import argparse

import pandas as pd

from fowt_env.controllers.ipc.law import FlapwiseIPC, IPCSettings
from fowt_env.controllers.pi import PISettings
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.metrics import mean_exponent
from fowt_env.training.evaluation.run_case import CONTROL_DT
from fowt_env.training.evaluation.seeds import with_drawn_seeds

SUITE, PLATFORM = "ipc", "oc3_hywind"
NAMES = {  # controller -> same law with collective pitch
    "pi": "pi", "ipc": "pi", "ipc_constrained": "pi", "ipc_floating": "pi",
    "rosco": "rosco", "rosco_ipc": "rosco",
}  # fmt: skip
BOUNDS = (0.1, 0.14, 0.2, 0.3)  # of IPCSettings
TRAVEL, ROOT, WEIGHT = "each_blade_travel_[deg/s]", "RootMyb_DEL_[kN-m]", "weight_[-]"
OUT_OF_PLANE, BEARING = "RootMyc_DEL_[kN-m]", "PitchBrg_DEL_[kN-m]"
SHOWN = {
    "root flapwise": ROOT, "root out of plane": OUT_OF_PLANE, "root edgewise": "RootMxb_DEL_[kN-m]",
    "shaft bending": "LSSTipMya_DEL_[kN-m]", "pitch bearing": BEARING,
    "bearing tilt": "YawBrMyp_DEL_[kN-m]", "bearing yaw": "YawBrMzp_DEL_[kN-m]",
    "tower base": "TwrBsMyt_DEL_[kN-m]", "platform pitch": "PtfmPitch_std_[deg]",
    "platform yaw": "PtfmYaw_std_[deg]", "platform roll": "PtfmRoll_std_[deg]",
    "platform sway": "PtfmSway_std_[m]", "rotor speed": "RotSpeed_std_[rpm]", "power": "GenPwr_mean_[kW]",
}  # fmt: skip
PAID = ("root flapwise", "root out of plane", "travel", "pitch bearing")  # what is spared, and what it costs


def means(table):
    """Return a DataFrame of the lifetime means of SHOWN and TRAVEL over the runs of each controller.

    Raises: ValueError if a run failed or tripped.
    """
    bad = table[table["status"] != "ok"]
    if len(bad):
        bad = bad[["controller", "case", "seed", "reason"]]
        raise ValueError(f"runs that were not completed:\n{bad}")
    metrics = [*SHOWN.values(), TRAVEL]
    powers = pd.Series({metric: mean_exponent(metric) for metric in metrics})
    shares = table.set_index("controller")[WEIGHT]
    values = (table.set_index("controller")[metrics] ** powers).mul(shares, axis=0)
    total = shares.groupby("controller", sort=False).sum()
    return values.groupby("controller", sort=False).sum().div(total, axis=0) ** (1.0 / powers)


def ratios(figures):
    """Return a DataFrame of SHOWN relative to the collective law, and travel (deg/s); figures: of means."""
    table = figures.loc[list(NAMES)] / figures.loc[list(NAMES.values())].to_numpy()
    table = table.rename(columns={metric: name for name, metric in SHOWN.items()})[list(SHOWN)]
    table.insert(0, "travel", figures[TRAVEL])
    return table.rename_axis(None)


def trade_off(figures):
    """Return a DataFrame of PAID of the laws with the mean pitch of pi, over those of pi."""
    found = figures.filter(regex="^ipc|^bound", axis=0) / figures.loc["pi"]
    metrics = [{**SHOWN, "travel": TRAVEL}[name] for name in PAID]
    return found[metrics].set_axis(PAID, axis=1).rename_axis(None)


def main(arguments=None):
    """Run the suite and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--platform", default=PLATFORM)
    seeds = parser.add_mutually_exclusive_group()
    seeds.add_argument("--seeds", type=int, nargs="+", help="weather seeds; those of the suite by default")
    seeds.add_argument("--draw-seeds", help="hash from which the seeds are drawn, as by fowt evaluate")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", help="results folder; a later run continues")
    args = parser.parse_args(arguments)
    published = PISettings.published(read_turbine(read_platform(args.platform).turbine))
    laws = {name: name for name in NAMES}
    laws |= {f"bound {b:g}": FlapwiseIPC(published, IPCSettings(bound=b), CONTROL_DT) for b in BOUNDS}
    options = {"jobs": args.jobs, "folder": args.out} | ({"seeds": args.seeds} if args.seeds else {})
    suite = read_suite(SUITE, args.platform)
    if args.draw_seeds is not None:
        suite = with_drawn_seeds(suite, args.draw_seeds)
    table = evaluate(laws, suite, **options)
    print(ratios(means(table)).round(3).to_string())
    for name, part in [("lifetime", table), *table.groupby("case", sort=False)]:
        print(f"{name}\n{trade_off(means(part)).round(3).to_string()}")


if __name__ == "__main__":
    main()
