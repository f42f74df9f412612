"""The commands that make things to look at: report."""

from pathlib import Path
from typing import Annotated

import typer

from fowt_env.cli import app, note, progress_bar, reported
from fowt_env.cli_arguments import parse_numbers
from fowt_env.errors import InputError

REPORT_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt report results/demo[/cyan]  results/demo/report.html

[cyan]fowt report results/suite --cases ntm_12,ntm_24 --seeds 1,2 --rate 5 --out page.html[/cyan]

The page works offline: plotly.js and all data are in it."""


@app.command(epilog=REPORT_EXAMPLES)
@reported
def report(
    folder: Annotated[str, typer.Argument(help="Folder that fowt evaluate wrote.")],
    out_path: Annotated[
        str | None, typer.Option("--out", help="The page; default: report.html in the folder.")
    ] = None,
    cases: Annotated[
        str | None, typer.Option(help="Cases whose time series go in, by commas; default: up to 64 runs.")
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(help="Seeds whose time series go in: 1,2; default: the first.")
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Samples per second of the time series; default: 2 or less.")
    ] = None,
    platform: Annotated[
        str | None, typer.Option(help="Whose steady schedule; default: that of the evaluation.")
    ] = None,
    schedule: Annotated[bool, typer.Option("--schedule/--no-schedule", help="Show it.")] = True,
):
    """Make one HTML page of an evaluation: leaderboard, Pareto and box plots, time series, spectra."""
    from training.report_html import write_report

    names = None if cases is None else [name.strip() for name in cases.split(",") if name.strip()]
    numbers = None if seeds is None else parse_numbers(seeds, "seeds")
    if numbers is not None and any(number != int(number) for number in numbers):
        raise InputError(f"seeds = {seeds!r}: must be whole numbers")
    with progress_bar("report", None) as update:
        path = write_report(
            Path(folder),
            out_path,
            names,
            None if numbers is None else [int(number) for number in numbers],
            rate,
            platform,
            schedule,
            lambda done, total, text: update(done, f"report: {text}", total),
        )
    note(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
