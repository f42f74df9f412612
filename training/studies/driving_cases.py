"""Compares the driving runs of a load table with runs of their decks in OpenFAST: extremes and fatigue loads.

    STUDY = python -m fowt_env.training.studies.driving_cases
    STUDY make DECKS FOLDER --platform oc3_hywind   makes a load table of the deck, and its driving runs
    STUDY openfast FOLDER/driving                   runs their decks in OpenFAST, one after the other
    STUDY table FOLDER/driving --skip 240           compares the runs
    STUDY heave DECKS FOLDER --plot heave.png       heave of OC3-Hywind in the waves of a storm alone

The driving runs of any table serve that was made with `fowt loads --fidelity elastic --sensors exact --deck
model.fst`. Of `make` the options are those of the deck: loads across the axis of the spar at rest, and a
skewed wake for VolturnUS-S. A finished run is not repeated.

The largest and smallest value and the 1 Hz damage-equivalent load of channels that both runs have, after the
transient, by the comparison of `fowt compare`. Differences of extremes are in % of the largest magnitude in
OpenFAST. Blades are taken together, as in a load table: the extremes over all blades, the mean of their
damage-equivalent loads. Limits are those of the acceptance of load tables: 5 %, fairleads 10 %.
"""

import re
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from fowt_env.descriptions.checks import parse_names
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.errors import InputError, unknown
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import read_series, write_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.evaluation.metrics import TIME
from fowt_env.training.loads.decks import write_driving
from fowt_env.training.loads.matrix import expanded
from fowt_env.training.loads.records import HOUR
from fowt_env.training.loads.run import finished_runs, run_matrix
from fowt_env.training.loads.site import climate_of, read_site
from fowt_env.training.loads.tables import load_tables
from fowt_env.training.reports.compare import compare
from fowt_env.training.studies import transfer
from fowt_env.training.validation import openfast_cases
from fowt_env.training.validation.reference import openfast_decks
from fowt_env.visual.style import COLOURS, INK, head, new_figure, save_figure, style_axes
from fowt_env.weather.waves import jonswap

TENSION = re.compile(r"T\[(\d+)\]_\[(k?N)\]")  # of MAP++ at a fairlead
DONE = "openfast.txt"  # time of a finished run of OpenFAST
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
SITES = {"oc3_hywind": "norway_5", "iea15_volturnus_s": "gulf_of_maine"}
OPTIONS = {"oc3_hywind": {"strip_axis": "undisplaced"}}  # of build_scene, beside those of transfer.SUBJECTS
CONTROLLER = "rosco"
STEP = 0.025  # s, of OpenFAST
HEAVE = "PtfmHeave_[m]"
DIFFERENCES = ("largest_%", "smallest_%", "DEL_%")
COLUMNS = ("case", "part", "channel", "unit", "largest", "largest_other", "smallest", "smallest_other", "DEL",
           "DEL_other", *DIFFERENCES, "correlation")  # fmt: skip


def named(frame):
    """Return an output of OpenFAST with the tensions of MAP++ named as here."""
    tensions = {column: match for column in frame if (match := TENSION.fullmatch(column))}
    return frame.rename(columns={column: f"FAIRTEN{m[1]}_[{m[2]}]" for column, m in tensions.items()})


def finished(folder):
    """Return whether OpenFAST has run the deck in the folder of a driving run to its end."""
    return (folder / DONE).exists()


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


def write_base_deck(decks, platform, folder):
    """Write the elastic deck of a platform with a wake that lags, for driving runs; return its model.fst."""
    transfer.check_decks(platform, decks)
    subject = transfer.SUBJECTS[platform]
    # wind, sea and controller are those of each run: here they only switch on what needs them
    settings = {
        "t": 0.0, "dt": STEP, "dtout": transfer.OUTPUT_DT, "dbemt": 2, "wind": 12.0, "sea": (2.0, 8.0),
        "control": True, "control_dt": f"{STEP:g}", "channels": transfer.CHANNELS, **subject.elastic,
    }  # fmt: skip
    getattr(openfast_decks, subject.deck)(decks).write(folder, settings)
    return folder / "model.fst"


def matrix_of(platform, dlc, seconds, transient, conditions=None):
    """Return (Matrix, SiteFile) of the elastic load table of a platform with the options of its deck.

    conditions: beginnings of the names of the conditions that are run, e.g. "dlc1.3_u24", None: all.
    Raises: InputError if no condition begins so.
    """
    site = read_site(SITES[platform])
    site = site.model_copy(update={"design": site.design.model_copy(update={"transient": transient})})
    subject = transfer.SUBJECTS[platform]
    matrix = expanded(
        subject.plant, site, (CONTROLLER,), dlc=dlc, seeds=1, hours=seconds / HOUR, fidelity="elastic",
        sensors="exact",
    )  # fmt: skip
    more = subject.options | OPTIONS.get(platform, {})
    if not subject.shaft:
        more = more | {"shaft": "rigid"}
    cases = tuple(
        replace(load, case=replace(load.case, options=load.case.options | more))
        for load in matrix.cases
        if conditions is None or load.name.startswith(tuple(conditions))
    )
    if not cases:
        names = ", ".join(dict.fromkeys(load.name for load in matrix.cases))
        raise InputError(f"conditions = {','.join(conditions)!r}: must be beginnings of {names}")
    return replace(matrix, cases=cases), site


app = typer.Typer(help=__doc__.splitlines()[0], no_args_is_help=True, add_completion=False)


@app.command()
def make(
    decks: Annotated[Path, typer.Argument(help="Folder of the public decks of openfast_decks.py.")],
    folder: Annotated[Path, typer.Argument(help="Folder of the load table.")],
    platform: transfer.Platform = "oc3_hywind",
    dlc: Annotated[str, typer.Option(help="Design load cases, comma-separated.")] = "1.3,1.6,6.1",
    conditions: Annotated[
        str | None, typer.Option(help="Beginnings of names of conditions, comma-separated. Default: all.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Length of a run after its transient, s.")] = 600.0,
    transient: Annotated[float, typer.Option(help="Transient of a run, s.")] = 240.0,
    count: Annotated[int, typer.Option(min=1, help="Number of driving runs.")] = 4,
    jobs: Annotated[int, typer.Option(min=1, help="Runs at the same time.")] = 1,
):
    """Make a load table of a platform with one seed and ROSCO, and write the decks of its driving runs."""
    if platform not in SITES:
        raise unknown("platform", platform, SITES)
    deck = folder / "deck" / "model.fst"
    if not deck.exists():
        write_base_deck(decks, platform, deck.parent)
    wanted = None if conditions is None else parse_names(conditions)
    matrix, site = matrix_of(platform, dlc, seconds, transient, wanted)
    controllers = {CONTROLLER: CONTROLLER}
    print(f"{len(matrix.runs)} runs here, about 5 s each")
    statuses = run_matrix(matrix, controllers, folder / "table", jobs=jobs)
    print(", ".join(f"{number} {status}" for status, number in statuses.items()))
    done = {case.key: run for case, run in finished_runs(matrix, folder / "table")}
    turbine = turbine_of(read_platform(transfer.SUBJECTS[platform].plant))
    results = load_tables(matrix.cases, done, climate=climate_of(site, turbine))
    for place in write_driving(folder, results, controllers, deck, count):
        print(place)


@app.command()
def openfast(
    folder: Annotated[Path, typer.Argument(help="Folder `driving` of a load table.")],
    executable: Annotated[str, typer.Option("--openfast", help="OpenFAST v5.0.0.")] = "openfast",
):
    """Run the decks of driving runs in OpenFAST, those without a finished run."""
    executable = transfer.program("OpenFAST", executable)
    waiting = [
        each for each in sorted(folder.iterdir()) if (each / "model.fst").exists() and not finished(each)
    ]
    print(f"{len(waiting)} runs of OpenFAST")

    def work(place):
        seconds = transfer.run_deck(executable, place)
        (place / DONE).write_text(f"{seconds:.0f} s\n", encoding="utf-8")

    if failed := transfer.at_once(work, waiting, 1):
        raise InputError(f"{failed} runs of OpenFAST failed; their inputs and outputs are in {folder}")


STORM = {"significant_height": 15.4, "peak_period": 13.9, "gamma": 2.0}  # m, s
STORM_PHASES = "waves_hs7.5_tp10.csv.gz"  # of validation/reference: frequencies and phases
STORM_END, STORM_SKIP = 420.0, 60.0  # s


def storm_components():
    """Return the DataFrame of wave components (rad/s, m, deg) of STORM with the phases of a stored sea."""
    found = openfast_cases.table(STORM_PHASES)
    omega = found["omega_rad_s"].to_numpy()
    amplitude = np.sqrt(2.0 * jonswap(omega, **STORM) * np.gradient(omega))
    return found.assign(amplitude_m=amplitude)


@app.command()
def heave(
    decks: Annotated[Path, typer.Argument(help="Folder of the public decks of openfast_decks.py.")],
    folder: Annotated[Path, typer.Argument(help="New folder of the run of OpenFAST.")],
    executable: Annotated[str, typer.Option("--openfast", help="OpenFAST v5.0.0.")] = "openfast",
    plot: Annotated[Path | None, typer.Option(help="Picture of the heave.")] = None,
):
    """Compare the heave of rigid OC3-Hywind in a storm without wind, by both axes of the strips."""
    executable, components = transfer.program("OpenFAST", executable), storm_components()
    deck = openfast_decks.Oc3(decks)
    deck.write(folder, {"t": STORM_END, "dt": STEP, "dtout": transfer.OUTPUT_DT, "waves": True}, components)
    print(f"OpenFAST: {transfer.run_deck(executable, folder):.0f} s")
    series = {"OpenFAST": read_series(folder / "model.out")}
    for axis in ("displaced", "undisplaced"):
        scene = build_scene(
            transfer.SUBJECTS["oc3_hywind"].plant, sea=transfer.sea_here(components), strip_axis=axis,
            duration=STORM_END,
        )  # fmt: skip
        series[f"fowt_env, strip_axis {axis}"] = simulate(
            scene, duration=STORM_END, dt=STEP, output_dt=transfer.OUTPUT_DT, initial={"start": "zero"}
        )
    time, reference = (series["OpenFAST"][name].to_numpy() for name in (TIME, HEAVE))
    counted, rows = time >= STORM_SKIP, []
    for name, frame in series.items():
        values = np.interp(time, frame[TIME], frame[HEAVE])[counted]
        figures = values.std(), values.mean(), values.max(), values.min()
        rows.append([name, *(f"{value:.3f}" for value in figures),
                     f"{np.corrcoef(values, reference[counted])[0, 1]:.4f}"])  # fmt: skip
    print(markdown_table(["heave, m", "std", "mean", "largest", "smallest", "correlation"], rows))
    if plot is not None:
        save_figure(_picture(series), plot)


def _picture(series):
    """Return the figure of the heave of {name: DataFrame}."""
    figure = new_figure(10.5, 4.2)
    axes = figure.subplots()
    style_axes(axes, "time (s)", "heave (m)")
    looks = zip(series.values(), (COLOURS[1], COLOURS[0], INK), ("-", "-", "--"), strict=True)
    handles = [axes.plot(each[TIME], each[HEAVE], line, color=colour)[0] for each, colour, line in looks]
    axes.set_xlim(STORM_SKIP, 300.0)
    head(figure, "OC3-Hywind in waves of Hs 15.4 m, no wind", handles, tuple(series))
    return figure


def _shown(value, digits):
    return "" if isinstance(value, float) and value != value else f"{value:.{digits}}"


@app.command()
def table(
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
    figures = pd.DataFrame(rows, columns=list(COLUMNS))
    for case, rows in figures.groupby("case", sort=False):
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
        for part, key, limit, inside, count, median, most in within(figures)
    ]
    print(markdown_table(heads, lines))
    if out_path is not None:
        write_table(figures, out_path)


if __name__ == "__main__":
    app()
