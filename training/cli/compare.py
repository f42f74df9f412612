"""Implements fowt compare: two runs, channel by channel."""

from math import isfinite
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fowt_env.display import number_text
from fowt_env.files.tables import TABLE_SUFFIXES, read_series
from fowt_env.training.cli.arguments import parse_names
from fowt_env.training.cli.console import command, note, output, save_table, wrote
from fowt_env.training.cli.tables import out, print_table

FILE = "Run: .outb or .out of OpenFAST, or .outb, .csv or .parquet of fowt."


@command()
def compare(
    mine: Annotated[str, Argument(help=FILE)],
    theirs: Annotated[str, Argument(help="Run to compare with; same formats.")],
    start: Annotated[float | None, Option("--from", help="Start of the compared time, s.")] = None,
    end: Annotated[float | None, Option("--to", help="End of the compared time, s.")] = None,
    channels: Annotated[str | None, Option(help="Channels, e.g. RotSpeed,PtfmPitch; default: all.")] = None,
    out_path: Annotated[str | None, Option("--out", help="Output table: .csv or .parquet.")] = None,
    plot: Annotated[str | None, Option(help="Output plot of series and spectra, e.g. plot.png.")] = None,
):
    """Compare two runs: statistics, fatigue loads, spectra.

    Notes say what differs and what usually causes it. Differences are those of the first run from the second.
    Lag: time by which the first run is later. DEL: 1 Hz damage-equivalent load, m = 10 for blades, 3 for
    mooring chain, 4 for other loads.

    Examples:
    fowt compare run.outb openfast.outb --from 100 --plot compare.png
    fowt compare run.outb openfast.out --channels RotSpeed,BldPitch1,PtfmPitch
    """
    from fowt_env.training.reports.compare import compare as compared
    from fowt_env.training.reports.compare import plot_comparison

    output(out_path, endings=TABLE_SUFFIXES)
    names = tuple(parse_names(channels) or ())
    result = compared(read_series(mine), read_series(theirs), start, end, names)
    low, high = result.window
    steps = " and ".join(f"{step:.4g}" for step in result.steps)
    labels = (mine, theirs) if Path(mine).stem == Path(theirs).stem else (Path(mine).stem, Path(theirs).stem)
    title = f"1: {labels[0]}, 2: {labels[1]}; {low:g} to {high:g} s, steps {steps} s"
    heads = (
        "channel", "mean\n1", "mean\n2", "std\n1", "std\n2", "std\n%", "DEL\n1", "DEL\n2", "DEL\n%", "lag\ns",
        "correlation", "coherence",
    )  # fmt: skip
    rows = []
    for row in result.rows:
        loads = row.del_1hz, row.del_1hz_other
        values = (row.mean, row.mean_other, row.std, row.std_other, _percent(row.std, row.std_other))
        values += (*loads, _percent(*loads))
        pair = (row.lag, row.correlation, row.coherence)
        rows.append((f"{row.channel} {row.unit}", *map(_text, values), *map(_text, pair)))
    print_table(heads, rows, title)
    out.print()
    for number, (which, text) in enumerate(result.notes, 1):
        out.print(f"{number}. [bold]{which}[/bold]: {text}")
    if not result.notes:
        out.print("No difference above 2 % of the mean, 5 % of deviations and fatigue loads, or a lag.")
    for label, alone in zip(labels, result.only, strict=True):
        if alone:
            note(f"in {label} alone: {', '.join(alone)}")
    save_table(result.table(), out_path)
    if plot is not None:
        plot_comparison(result, labels, plot, title, names)
    wrote(plot)


def _percent(mine, theirs):
    """Return the difference of two values in %; NaN without one."""
    return 100.0 * (mine / theirs - 1.0) if theirs and isfinite(theirs) else float("nan")


def _text(value):
    """Return a number with four digits, "" for NaN."""
    return number_text(value) if isfinite(value) else ""
