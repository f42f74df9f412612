"""Compares the driving runs of a load table with runs of their decks in OpenFAST: extremes and fatigue loads.

    fowt loads ... --fidelity elastic --sensors exact --deck model.fst --out results/loads
    (in each folder of results/loads/driving: openfast model.fst)
    python -m fowt_env.training.studies.driving_cases results/loads/driving --skip 600

The largest and smallest value and the 1 Hz damage-equivalent load of channels that both runs have, after the
transient, by the comparison of `fowt compare`. Differences of extremes are in % of the largest magnitude in
OpenFAST. Blades are taken together, as in a load table: the extremes over all blades, the mean of their
damage-equivalent loads. Limits are those of the acceptance of load tables: 5 %, fairleads 10 %.
"""

import re
from math import nan
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from fowt_env.errors import InputError
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import read_series, write_table
from fowt_env.training.reports.compare import compare

TENSION = re.compile(r"T\[(\d+)\]_\[(k?N)\]")  # of MAP++ at a fairlead
OUTPUTS = ("model.outb", "model.out")
PARTS = {  # part: channels; {} stands for the number of a blade or line
    "rotor": ("RotSpeed", "GenPwr", "RotThrust", "RotTorq", "LSSTipMys", "LSSTipMzs"),
    "tower": ("TwrBsMxt", "TwrBsMyt", "YawBrMyp", "YawBrMzp", "TTDspFA"),
    "platform": ("PtfmSurge", "PtfmHeave", "PtfmPitch", "PtfmRoll", "NcIMUTAxs"),
    "blade root": ("RootMxc{}", "RootMyc{}"),
    "fairlead": ("FAIRTEN{}",),
}
LIMITS = dict.fromkeys(PARTS, 5.0) | {"fairlead": 10.0}  # %
TOGETHER = ("blade root",)  # parts whose channels are taken together
MOST = 10  # blades or lines
DIFFERENCES = ("largest_%", "smallest_%", "DEL_%")
COLUMNS = ("case", "part", "channel", "unit", "largest", "largest_other", "smallest", "smallest_other", "DEL",
           "DEL_other", *DIFFERENCES, "correlation")  # fmt: skip


def named(frame):
    """Return an output of OpenFAST with the tensions of MAP++ named as here."""
    tensions = {column: match for column in frame if (match := TENSION.fullmatch(column))}
    return frame.rename(columns={column: f"FAIRTEN{m[1]}_[{m[2]}]" for column, m in tensions.items()})


def output_of(folder):
    """Return the path of OpenFAST's output in the folder of a driving run, None without one."""
    return next((folder / name for name in OUTPUTS if (folder / name).exists()), None)


def compared(folder, skip):
    """Return [row of COLUMNS] of the folder of a driving run, from `skip` s on."""
    result = compare(read_series(folder / "run.outb"), named(read_series(output_of(folder))), skip)
    rows, found = {row.channel: row for row in result.rows}, []
    for part, patterns in PARTS.items():
        for pattern in patterns:
            numbered = dict.fromkeys(pattern.format(i) for i in range(1, MOST))
            own = [rows[name] for name in numbered if name in rows]
            groups = [own] if part in TOGETHER else [[row] for row in own]
            for group in filter(None, groups):
                name = pattern.format("") if part in TOGETHER else group[0].channel
                found.append([folder.name, part, name, group[0].unit, *values_of(group)])
    return found


def values_of(rows):
    """Return the values of COLUMNS from the largest on, of the compare.Rows of one or several channels."""
    largest = [max(getattr(row, key) for row in rows) for key in ("largest", "largest_other")]
    smallest = [min(getattr(row, key) for row in rows) for key in ("smallest", "smallest_other")]
    loads = [float(np.mean([getattr(row, key) for row in rows])) for key in ("del_1hz", "del_1hz_other")]
    size = max(abs(largest[1]), abs(smallest[1])) or nan
    return [
        *largest, *smallest, *loads, 100.0 * (largest[0] - largest[1]) / size,
        100.0 * (smallest[0] - smallest[1]) / size, 100.0 * (loads[0] - loads[1]) / (loads[1] or nan),
        float(np.mean([row.correlation for row in rows])),
    ]  # fmt: skip


def within(table):
    """Return [(part, figure, limit, within, of, median, largest)] in % of a DataFrame with COLUMNS."""
    found = []
    for part, limit in LIMITS.items():
        for key in DIFFERENCES:
            sizes = table.loc[table["part"] == part, key].abs().dropna()
            if len(sizes):
                inside = int((sizes <= limit).sum())
                found.append((part, key, limit, inside, len(sizes), sizes.median(), sizes.max()))
    return found


def _shown(value, digits):
    return "" if isinstance(value, float) and value != value else f"{value:.{digits}}"


def main(
    folder: Annotated[Path, typer.Argument(help="Folder `driving` of a load table.")],
    skip: Annotated[float, typer.Option(help="Transient at the start, s.")] = 600.0,
    out_path: Annotated[Path | None, typer.Option("--out", help="CSV of the figures.")] = None,
):
    """Print the comparison of the driving runs that OpenFAST has run, and how many are within limits."""
    folders = [each for each in sorted(folder.iterdir()) if each.is_dir() and output_of(each)]
    if not folders:
        raise InputError(f"{str(folder)!r}: OpenFAST has run no deck there")
    rows = []
    for each in folders:
        try:
            rows += compared(each, skip)
        except InputError as error:  # OpenFAST ended within the transient
            print(f"{each.name}: {error}\n")
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    for case, rows in table.groupby("case", sort=False):
        lines = [
            [row["part"], f"{row['channel']}, {row['unit']}", *(_shown(row[k], "4g") for k in COLUMNS[4:10]),
             *(_shown(row[k], "1f") for k in DIFFERENCES), _shown(row["correlation"], "3f")]
            for _, row in rows.iterrows()
        ]  # fmt: skip
        heads = ["part", "channel", "largest", "OpenFAST", "smallest", "OpenFAST", "DEL", "OpenFAST",
                 "largest %", "smallest %", "DEL %", "correlation"]  # fmt: skip
        print(f"{case}\n\n{markdown_table(heads, lines)}\n")
    heads = ["part", "figure", "limit, %", "within", "median, %", "largest, %"]
    lines = [
        [part, key, f"{limit:g}", f"{inside} of {count}", f"{median:.1f}", f"{most:.1f}"]
        for part, key, limit, inside, count, median, most in within(table)
    ]
    print(markdown_table(heads, lines))
    if out_path is not None:
        write_table(table, out_path)


if __name__ == "__main__":
    typer.run(main)
