"""Relief of the blades by individual pitch control, its cost in travel, and the motion of the platform.

    python -m fowt_env.training.studies.individual_pitch --platform oc3_hywind

Runs the suite `ipc` with the controllers of NAMES and with `ipc` behind the bounds of BOUNDS. Printed are
figures over those of the same law with one pitch for all blades: means over winds and seeds, with the
exponents of their S-N curves. The shares of a bound are those of `ipc` that it leaves: how much of what that
takes off the blade roots, for how much of what it adds to the travel. controllers.md has the outcome.
"""

import argparse

import numpy as np
import pandas as pd

from fowt_env.controllers.ipc.law import IPC, IPCSettings
from fowt_env.controllers.pi import PISettings
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.metrics import mean_exponent
from fowt_env.training.evaluation.run_case import CONTROL_DT

SUITE, PLATFORM = "ipc", "oc3_hywind"
NAMES = {  # controller -> the one with the same law and one pitch for all blades
    "pi": "pi", "ipc": "pi", "ipc_constrained": "pi", "ipc_floating": "pi",
    "rosco": "rosco", "rosco_ipc": "rosco",
}  # fmt: skip
BOUNDS = (0.05, 0.1, 0.15, 0.2, 0.3)  # of IPCSettings
TRAVEL, ROOT = "each_blade_travel_[deg/s]", "RootMyc_DEL_[kN-m]"
SHOWN = {
    "root out of plane": ROOT, "root in plane": "RootMxc_DEL_[kN-m]",
    "hub tilt": "LSSTipMys_DEL_[kN-m]", "hub yaw": "LSSTipMzs_DEL_[kN-m]",
    "bearing tilt": "YawBrMyp_DEL_[kN-m]", "bearing yaw": "YawBrMzp_DEL_[kN-m]",
    "tower base": "TwrBsMyt_DEL_[kN-m]", "platform pitch": "PtfmPitch_std_[deg]",
    "platform yaw": "PtfmYaw_std_[deg]", "platform roll": "PtfmRoll_std_[deg]",
    "platform sway": "PtfmSway_std_[m]", "rotor speed": "RotSpeed_std_[rpm]", "power": "GenPwr_mean_[kW]",
}  # fmt: skip


def bounded(turbine):
    """Return {name: controller} of ipc behind each of BOUNDS."""
    published = PISettings.published(turbine)
    return {f"bound {b:g}": IPC(published, IPCSettings(bound=b), CONTROL_DT) for b in BOUNDS}


def means(table):
    """Return a DataFrame of the means of SHOWN and the travel of each controller over its runs.

    Raises: ValueError where a run failed or tripped.
    """
    bad = table[table["status"] != "ok"]
    if len(bad):
        raise ValueError(
            f"runs that did not go to their end:\n{bad[['controller', 'case', 'seed', 'reason']]}"
        )
    groups = table.groupby("controller", sort=False)
    columns = {}
    for metric in (*SHOWN.values(), TRAVEL):
        power = mean_exponent(metric)
        columns[metric] = groups[metric].apply(lambda v, p=power: float(np.mean(v**p) ** (1.0 / p)))
    return pd.DataFrame(columns)


def ratios(figures):
    """Return a DataFrame of SHOWN over the collective law's, with the travel itself (deg/s), of means."""
    rows = {}
    for name, baseline in NAMES.items():
        row = figures.loc[name] / figures.loc[baseline]
        rows[name] = {"travel": figures.loc[name, TRAVEL]} | {k: row[metric] for k, metric in SHOWN.items()}
    return pd.DataFrame.from_dict(rows, orient="index")


def trade_off(figures):
    """Return a DataFrame of the shares of ipc's relief and added travel that each bound leaves."""
    relief, travel = figures.loc["pi", ROOT] - figures[ROOT], figures[TRAVEL] - figures.loc["pi", TRAVEL]
    rows = [name for name in figures.index if name == "ipc" or name.startswith("bound")]
    shares = {"share of relief": relief / relief["ipc"], "share of travel": travel / travel["ipc"]}
    return pd.DataFrame(shares).loc[rows]


def study(platform=PLATFORM, seeds=None, jobs=1, folder=None):
    """Return the means of every controller; seeds None: those of the suite."""
    turbine = read_turbine(read_platform(platform).turbine)
    laws = {name: name for name in NAMES} | bounded(turbine)
    options = {} if seeds is None else {"seeds": seeds}
    return means(evaluate(laws, read_suite(SUITE, platform), jobs=jobs, folder=folder, **options))


def main(arguments=None):
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--platform", default=PLATFORM)
    parser.add_argument("--seeds", type=int, nargs="+", help="weather seeds; those of the suite by default")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", help="results folder, which a later run continues")
    given = parser.parse_args(arguments)
    figures = study(given.platform, given.seeds, given.jobs, given.out)
    print(ratios(figures).round(3).to_string())
    print(trade_off(figures).round(3).to_string())


if __name__ == "__main__":
    main()
