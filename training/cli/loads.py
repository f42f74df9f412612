"""Implements fowt loads: the design load table of a platform at a site."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from rich.markup import escape
from typer import Argument, Option

from fowt_env.analysis.threads import one_thread
from fowt_env.descriptions.checks import check_number, check_whole_number, parse_number
from fowt_env.errors import InputError, unknown
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.console import (
    command,
    err,
    note,
    output,
    progress_bar,
    resumable,
    wrote,
)
from fowt_env.training.cli.tables import out, print_table

PLATFORM = "Platform (name or path of a .toml file) or OpenFAST deck (.fst), which is imported."
SITE = "Site: a name of fowt list sites, a .toml file, or a .csv table with wind, Hs, Tp, which is fitted."
CONTROLLERS = "Names, policy:NAME, design:FILE, dll:FILE.so or module:Name, comma-separated."
DLC = "Design load cases, comma-separated: 1.2,6.1. Default: all that can be run."
HOURS = "Length of a run that is not an event, h (to whole seconds), after its transient."
WIND = (
    "Turbulence: full-field (a box of wind for each run), or rotor-averaged (faster, uniform over the rotor)."
)
DECK = "OpenFAST deck (.fst) that driving runs are written for. Default: PLATFORM, if it is one."
FLOOD = "Compartment that may be flooded: water in it, kg, and its centre from the platform, m; repeatable."
PLOT_SITE = "Plot of the site's climate, e.g. site.png; nothing is run."
CENTURY = "Simulate the hours of production of so many years instead, with rotor-averaged turbulence."
PERIOD = "With --century: return period of the values, years."
DRY_RUN = "Print the matrix, or the hours of --century, and the time; run nothing."
SAMPLE = "With --century: hours of importance sampling instead of all hours."
MOST_LOST = 10  # runs without result that are printed


@command()
@one_thread
def loads_command(
    platform: Annotated[str, Argument(metavar="PLATFORM|DECK.fst", help=PLATFORM)] = "oc3_hywind",
    site: Annotated[str, Option(help=SITE)] = "norway_5",
    controllers: Annotated[str, Option(help=CONTROLLERS)] = "rosco",
    seeds: Annotated[int, Option(help="Realisations of wind and sea of each condition.")] = 6,
    hours: Annotated[float, Option(help=HOURS)] = 1.0,
    dlc: Annotated[str | None, Option(help=DLC)] = None,
    wind: Annotated[str, Option(help=WIND)] = "full-field",
    fidelity: Annotated[str, Option(help="Fidelity: standard, elastic or reference.")] = "standard",
    sensors: Annotated[str, Option(help="Sensors: exact, or the name of a sensor chain.")] = "standard",
    flood: Annotated[list[str] | None, Option(metavar="MASS:X:Y:Z", help=FLOOD)] = None,
    dry_run: Annotated[bool, Option("--dry-run", help=DRY_RUN)] = False,
    baseline: Annotated[
        str | None, Option(help="Controller of the paired differences. Default: first.")
    ] = None,
    years: Annotated[float, Option(help="Lifetime of the fatigue loads, years.")] = 25.0,
    deck: Annotated[str | None, Option(help=DECK)] = None,
    driving: Annotated[int, Option(help="Driving runs that are written for a check in OpenFAST.")] = 10,
    plot_site: Annotated[str | None, Option(help=PLOT_SITE)] = None,
    century: Annotated[float | None, Option(metavar="YEARS", help=CENTURY)] = None,
    return_period: Annotated[float, Option(metavar="YEARS", help=PERIOD)] = 50.0,
    sample: Annotated[int | None, Option(metavar="HOURS", help=SAMPLE)] = None,
    jobs: shared.JobsOption = 1,
    engine: shared.EngineOption = "processes",
    address: shared.AddressOption = None,
    time_limit: Annotated[float, Option(help="Wall-clock limit of a run, s; 0: none.")] = 3600.0,
    retry_failed: Annotated[bool, Option("--retry-failed", help="Repeat failed runs in the folder.")] = False,
    out_folder: shared.FolderOption = "results/loads",
):
    """Make the design load table of a platform at a site.

    The table has extremes with factors, and lifetime fatigue.

    The load cases are those of IEC 61400-3-2 for floating turbines. First the matrix is printed: the runs of
    each load case, what is left out and why, and the time it takes on this machine, measured by short runs.

    Examples:
    fowt loads oc3_hywind --site norway_5 --controllers rosco,mpc --jobs 2  # the whole table
    fowt loads oc3_hywind --dry-run  # its matrix, and how long it takes
    fowt loads deck/model.fst --site mine.toml --dlc 1.2,6.1 --seeds 2 --wind rotor-averaged  # a first look
    fowt loads iea15_volturnus_s --site gulf_of_maine --fidelity elastic  # blades and tower that bend
    fowt loads --site mine.csv --plot-site site.png  # fit a site to a table, and look at it
    fowt loads --century 100 --controllers rosco --jobs 2  # 50-year values without extrapolation: core-days
    fowt loads --century 100 --sample 20000 --controllers rosco --jobs 2  # nearly as good, in core-hours

    [bold]Files written[/bold]: manifest.json (the settings), runs/CONTROLLER/CONDITION_seedN.zip (statistics
    of each run), loads.html (the page), tables/ (CSV, and spreadsheets in the layout of IEA-22's design
    loads), driving/ (the runs that drive the table, with their wind, sea and deck for OpenFAST). The same
    command resumes an interrupted table and adds further controllers, load cases or seeds to the folder.
    docs/guides/load-table.md explains cases and site, docs/guides/load-results.md the results. --century
    writes OUT/century/CONTROLLER: century.csv has the values of --return-period, and those to which the runs
    of DLC 1.1 in OUT extrapolate, if they have been made with --wind rotor-averaged.
    """
    from fowt_env.controllers import controller_names
    from fowt_env.training.loads.matrix import expanded
    from fowt_env.training.loads.output import write_results
    from fowt_env.training.loads.run import check_controllers, expected_seconds, run_matrix
    from fowt_env.training.loads.site import read_site

    output(plot_site, "--plot-site")
    folder = Path(out_folder)
    check_whole_number("--driving", driving, 0)
    check_number("--years", years, 0.0, low_open=True)
    imported = platform if platform.lower().endswith(".fst") else None
    if imported is not None:
        deck = imported if deck is None else deck
        trial = TemporaryDirectory(prefix="fowt-")  # options that are refused, and a dry run, leave nothing
        platform, contradictions = _imported(imported, trial.name)
        for contradiction, consequence in contradictions:
            err.print(f"[yellow]deck: {escape(str(contradiction))}: {escape(str(consequence))}[/yellow]")
    if plot_site is not None:
        _plot_site(platform, site, plot_site)
        return
    if sample is not None and century is None:
        raise InputError("--sample chooses the hours of a century: only with --century")
    labels = controller_names(controllers)
    if baseline is not None and baseline not in labels:
        raise unknown("baseline among --controllers", baseline, labels)
    if century is not None:
        from fowt_env.training.cli.century import show_centuries

        for option, value in (("--dlc", dlc), ("--flood", flood), ("--retry-failed", retry_failed)):
            if value:
                raise InputError(f"{option} is for the load cases: not with --century")
        if imported is not None and not dry_run:
            platform = _kept(imported, folder)
        settings = {"fidelity": fidelity, "sensors": sensors}
        table = {"seeds": seeds, "hours": hours, **settings}
        show_centuries(
            platform, site, labels, century, return_period, sample, folder, settings, table, dry_run=dry_run,
            jobs=jobs, engine=engine, address=address, time_limit=time_limit or None,
        )  # fmt: skip
        return
    cases = {
        "dlc": dlc, "seeds": seeds, "hours": hours, "wind": wind, "fidelity": fidelity, "sensors": sensors,
        "compartments": [_compartment(text) for text in flood or ()],
    }  # fmt: skip
    matrix = expanded(platform, site, labels, **cases)
    named = {label: label for label in labels}
    check_controllers(named, matrix)
    _print_matrix(matrix)
    with progress_bar("measuring the speed"):
        seconds, rates, per_box = expected_seconds(matrix, named, jobs)
    _print_expected(matrix, seconds, rates, per_box, jobs)
    if dry_run:
        return
    if imported is not None:
        matrix = expanded(_kept(imported, folder), site, labels, **cases)
    about = {"site": read_site(site).model_dump(mode="json")}
    where = f"in {folder}; the same command resumes the table"
    with resumable("running", lambda done: f"the {done} finished runs are {where}") as update:

        def report(done, total, run, left):
            text = "" if left is None else f", {_time(left)} left"
            update(done, total, f"{done} of {total} runs done{text}")

        statuses = run_matrix(
            matrix, named, folder, about=about, jobs=jobs, engine=engine, address=address,
            time_limit=time_limit or None, retry_failed=retry_failed, progress=report,
        )  # fmt: skip
    note(f"{', '.join(f'{count} {status}' for status, count in sorted(statuses.items()))}: runs in {folder}")
    _print_lost(matrix, folder)
    with progress_bar("tables") as update:
        _, paths, remarks = write_results(
            folder, matrix, named, read_site(site), baseline=baseline, deck=deck, driving=driving,
            years=years, progress=update,
        )  # fmt: skip
    for remark in remarks:
        note(remark)
    wrote(*paths)


def _imported(deck, folder):
    """Return the path of the platform file of a deck, imported into a folder, and its contradictions."""
    from fowt_env.files.openfast_deck.importer import import_deck

    report = import_deck(deck, str(folder), name="platform", replace_files=True)
    return str(Path(folder, "platform.toml")), report.contradictions


def _kept(deck, folder):
    """Return the path of the platform file of a deck, imported into the folder of the table."""
    path, _ = _imported(deck, folder / "platform")
    note(f"imported {deck} into {folder / 'platform'}; what differs from the deck is in report.md there")
    return path


def _compartment(text):
    """Return {"mass", "point"} of a text MASS:X:Y:Z. Raises: InputError for another text."""
    numbers = [parse_number(part) for part in text.split(":")]
    if len(numbers) != 4 or None in numbers:
        raise InputError(f"--flood {text!r}: must be MASS:X:Y:Z, in kg and m")
    return {"mass": check_number("--flood MASS", numbers[0], 0.0, low_open=True), "point": numbers[1:]}


def _plot_site(platform, site, path):
    """Write the plot of a site at the hub of a platform's turbine, and print its extremes."""
    from fowt_env.descriptions.platform import read_platform, turbine_of
    from fowt_env.training.loads.site import climate_of, read_site
    from fowt_env.training.loads.site_fit import read_scatter
    from fowt_env.training.loads.site_plot import plot_site
    from fowt_env.visual.style import save_figure

    climate = climate_of(read_site(site), turbine_of(read_platform(platform)))
    table = read_scatter(site)[0] if site.lower().endswith(".csv") else None
    rows = []
    for years in (1, 50):
        speed, Hs, Tp, current, source = climate.extreme(years)
        rows.append((f"{years} years", speed, Hs, Tp, current, source))
    headings = ("return period", "wind m/s", "Hs m", "Tp s", "current m/s", "source")
    print_table(headings, rows, climate.site.name, left=(0, 5), prose=(5,))
    save_figure(plot_site(climate, table), path)
    wrote(path)


def _print_matrix(matrix):
    """Print the number of runs of each load case, and the load cases that are left out."""
    first = {case.dlc: case for case in reversed(matrix.cases)}
    rows = [
        (dlc, text, first[dlc].analysis, first[dlc].factor, conditions, runs, f"{hours:.1f}")
        for dlc, text, conditions, runs, hours in matrix.counts()
    ]
    headings = ("DLC", "load case", "for", "factor", "conditions", "runs", "h")
    print_table(headings, rows, matrix.source, left=(0, 1, 2), prose=(1,))
    out.print()
    if matrix.left_out:
        print_table(("DLC", "left out", "reason"), matrix.left_out, left=(0, 1, 2), prose=(1, 2))
        out.print()
    for remark in matrix.remarks:
        out.print(escape(remark))


def _print_expected(matrix, seconds, rates, per_box, jobs):
    """Print the number of runs, their hours and the time that they are expected to take."""
    shared_runs = len(matrix.cases) - len(matrix.runs)
    again = f" ({shared_runs} serve two load cases)" if shared_runs else ""
    out.print(f"{len(matrix.runs)} runs{again}, {matrix.hours:.0f} h simulated")
    speeds = ", ".join(f"{label} {rate:,.0f}" for label, rate in rates.items())
    boxes = f"; {per_box:.1f} s for each box of wind" if per_box else ""
    processes = f"{jobs} process" + ("es" if jobs > 1 else "")
    out.print(f"expected: {_time(seconds)} with {processes} (times real time: {escape(speeds)}{boxes})")


def _time(seconds):
    """Return a time as text: 40 s, 12 min, 3.5 h."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


def _print_lost(matrix, folder):
    """Print runs without a result, or that the protection ended, with the reason."""
    from fowt_env.training.loads.run import finished_runs

    ended = {run.key: run for _, run in finished_runs(matrix, folder) if run.status != "ok"}
    for run in list(ended.values())[:MOST_LOST]:
        err.print(f"[red]{run.status}: {escape(', '.join(map(str, run.key)))}: {escape(run.reason)}[/red]")
    if len(ended) > MOST_LOST:
        note(f"and {len(ended) - MOST_LOST} more")
