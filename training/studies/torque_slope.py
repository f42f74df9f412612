"""Measures how the generator torque of controllers follows rotor speed, with power quality beside it.

Reads the runs of a results folder of `fowt evaluate`. The slope is that of the least-squares line of torque
over rotor speed, each over its rated value, after the time that is not scored: 0 is constant torque, -1
constant power; a torque with a positive slope damps the rotor, at the cost of power deviation.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from fowt_env.descriptions.platform import turbine_of
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import read_table
from fowt_env.training.evaluation.evaluate import run_file
from fowt_env.training.evaluation.run_case import OK

SHOWN = {
    "rotor speed std, rpm": "RotSpeed_std_[rpm]", "power std, kW": "GenPwr_std_[kW]",
    "torque travel, kN m/s": "torque_travel_[kN-m/s]", "shaft DEL, kN m": "RotTorq_DEL_[kN-m]",
}  # fmt: skip


def slope(frame, turbine, skip):
    """Return the slope of torque over rotor speed, each over its rated value, of a run after skip s."""
    late = frame[frame["Time_[s]"] >= skip]
    speed = late["RotSpeed_[rpm]"] * (np.pi / 30.0 / turbine.rated_rotor_speed)
    torque = late["GenTq_[kN-m]"] * (1e3 / turbine.torque_law.rated_torque)
    return float(np.cov(torque, speed)[0, 1] / np.var(speed, ddof=1))


def rows_of(folder, platform, skip):
    """Return the rows of the table: case, controller, means over the seeds of the slope and of SHOWN."""
    turbine, table = turbine_of(platform), read_table(Path(folder) / "results.csv")
    rows = []
    for (case, name), runs in table[table["status"] == OK].groupby(["case", "controller"], sort=False):
        frames = [pd.read_parquet(run_file(Path(folder) / "runs", name, case, seed)) for seed in runs["seed"]]
        slopes = [slope(frame, turbine, skip) for frame in frames]
        means = [runs[metric].mean() for metric in SHOWN.values()]
        rows.append([case, name, f"{np.mean(slopes):+.2f}", *(f"{mean:.3g}" for mean in means)])
    return rows


def main(
    folder: Annotated[str, typer.Argument(help="Results folder of fowt evaluate.")],
    platform: Annotated[str, typer.Option(help="Platform of the runs.")] = "oc3_hywind",
    skip: Annotated[float, typer.Option(help="Time at the start that is not used, s.")] = 200.0,
):
    """Print slope of torque over speed, speed and power deviation, torque travel and shaft load per wind."""
    print(markdown_table(["case", "controller", "slope", *SHOWN], rows_of(folder, platform, skip)))


if __name__ == "__main__":
    typer.run(main)
