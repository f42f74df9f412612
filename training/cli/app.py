"""The `fowt` command: simulate, evaluate, trim, list, validate, paper. Thin: it parses, calls, prints."""

import functools
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.columns import Columns
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from fowt_env.descriptions.checks import parse_numbers, parse_whole_numbers
from fowt_env.errors import ControllerError, InputError, SimulationStopped, unknown
from fowt_env.files.tables import SERIES_SUFFIXES, table_path, write_table
from fowt_env.training.cli.arguments import parse_pairs, parse_sea, parse_wind
from fowt_env.training.cli.doctor import DOCTOR_EXAMPLES, doctor
from fowt_env.training.cli.tables import figure, print_table, table_width

EXIT_STOPPED, EXIT_INPUT, EXIT_INTERRUPTED = 1, 2, 130
STUDIES = "fowt_env.training.studies"  # left out of the wheel
ROUNDING = 1e-9  # a standard deviation below this fraction of the mean is none

out = Console()
err = Console(stderr=True)

app = typer.Typer(
    name="fowt",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Floating wind turbines under control: simulate, compare controllers, find operating points.",
    epilog="Start with  [bold]fowt simulate --wind 18 --plot run.png[/bold] ,"
    " and see  [bold]fowt COMMAND --help[/bold]  for examples.",
)


@app.callback(invoke_without_command=True)
def version_option(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
):
    """Options of the command as a whole."""
    if version:
        from fowt_env import __version__

        out.print(__version__, highlight=False)
        raise typer.Exit


def main():
    """Entry point of the console script."""
    app()


def reported(command):
    """The command with errors as one clear line on stderr, and an exit code that says what happened."""

    @functools.wraps(command)
    def run(*args, **kwargs):
        try:
            with warnings.catch_warnings():
                warnings.showwarning = _show_warning
                return command(*args, **kwargs)
        except (SimulationStopped, ControllerError) as error:
            fail(error, EXIT_STOPPED)
        except InputError as error:
            fail(error, EXIT_INPUT)
        except (OSError, ImportError) as error:
            fail(error, EXIT_INPUT)
        except KeyboardInterrupt:
            fail("interrupted", EXIT_INTERRUPTED)
        except (SystemExit, GeneratorExit) as error:  # of a controller or a library, not the command's own
            fail(f"ended early by {type(error).__name__}: {error}", EXIT_STOPPED)

    return run


@contextmanager
def from_a_clone(command):
    """Around imports of the studies. Raises: InputError that names the command where they are missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(STUDIES):
            raise
        raise InputError(
            f"fowt {command}: needs a clone of the repository, whose folder training/studies is not installed"
            " with the package: pip install -e . in the clone"
        ) from None


def _show_warning(message, *where):
    """Print a warning in yellow on stderr, without the line of code that it came from."""
    err.print(f"[yellow]Warning: {escape(str(message))}[/yellow]", soft_wrap=True, highlight=False)


def fail(message, code):
    """Print the message in red on stderr and end with the exit code."""
    err.print(f"[red][bold]Error:[/bold] {escape(str(message))}[/red]", soft_wrap=True, highlight=False)
    raise typer.Exit(code)


def note(message):
    """Print a remark on stderr, so that stdout holds results alone."""
    err.print(f"[dim]{escape(message)}[/dim]", soft_wrap=True, highlight=False)


@contextmanager
def progress_bar(description, total):
    """A bar on stderr that disappears when done; yields update(done, text=None, total=None).

    A compilation meanwhile is announced above the bar.
    """
    from fowt_env.plant.compile.announcement import compilation_announced

    def say(text):
        err.print(f"[yellow]{text}[/yellow]", soft_wrap=True, highlight=False)

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    bar = Progress(*columns, TimeElapsedColumn(), console=err, transient=True)
    with bar, compilation_announced(say):
        task = bar.add_task(description, total=total)

        def update(done, text=None, total=None):
            bar.update(task, completed=done, description=text or description, total=total)

        yield update


PlatformOption = Annotated[str, typer.Option(help="Platform: a built-in name or a path to a TOML file.")]
OptionOption = Annotated[
    list[str] | None, typer.Option("--option", metavar="KEY=VALUE", help="Scene option; repeatable.")
]
RotorOption = Annotated[
    str | None, typer.Option(help="Rotor model: bem, lookup or table; default: that of the fidelity.")
]
SIMULATE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt simulate --wind 18 --sea paper_wind_wave --plot run.png[/cyan]  steady wind, irregular sea

[cyan]fowt simulate --wind ntm:18:B --seed 3 --controller pi_land --out run.csv[/cyan]  turbulence, land gains

[cyan]fowt simulate --wind none --sea regular:3:5 --controller none --start zero[/cyan]  waves alone

[cyan]fowt simulate --wind none --start zero --controller none --initial PtfmSurge=10[/cyan]  free decay

[cyan]fowt simulate --wind '{"kind": "etm", "speed": 18, "class": "A"}'[/cyan]  any wind, as JSON"""


@app.command(epilog=SIMULATE_EXAMPLES)
@reported
def simulate(
    platform: PlatformOption = "oc3_hywind",
    wind: Annotated[
        str,
        typer.Option(
            help="m/s, KIND:SPEED[:CLASS] (ntm:18:B), JSON, a .csv of time and speed, a .wnd or .hh, or none."
        ),
    ] = "18",
    sea: Annotated[
        str, typer.Option(help="Name, jonswap:HS:TP[:GAMMA], regular:H:T, JSON, or none (still water).")
    ] = "none",
    controller: Annotated[
        str, typer.Option(help="Name, module:Name, design:FILE or none (constant command).")
    ] = "pi",
    duration: Annotated[float, typer.Option(help="Length of the run, s.")] = 600.0,
    dt: Annotated[float | None, typer.Option(help="Physics step, s; default: that of the fidelity.")] = None,
    control_dt: Annotated[float, typer.Option(help="Control period, s; a multiple of dt.")] = 0.1,
    output_dt: Annotated[float, typer.Option(help="Output period, s; a multiple of dt.")] = 0.1,
    seed: Annotated[int, typer.Option(help="Seed of wind and waves.")] = 0,
    fidelity: Annotated[
        str,
        typer.Option(
            help="reference, standard (1000 times faster, within 0.1 %), or fast (rotor as a table)."
        ),
    ] = "standard",
    rotor: RotorOption = None,
    start: Annotated[str, typer.Option(help="trim (steady state of the mean wind) or zero.")] = "trim",
    initial: Annotated[
        list[str] | None, typer.Option(metavar="CHANNEL=VALUE", help="Start value, OpenFAST units; repeats.")
    ] = None,
    option: OptionOption = None,
    out_path: Annotated[str | None, typer.Option("--out", help="Series: .csv, .parquet or .outb.")] = None,
    plot: Annotated[str | None, typer.Option(help="Stacked plot of the run, e.g. run.png.")] = None,
):
    """Simulate one run, print its statistics, and save its time series and plot."""
    import fowt_env

    if out_path is not None:
        table_path(out_path, SERIES_SUFFIXES)  # a wrong ending should not cost a run
    options = {"duration": max(700.0, duration), **parse_pairs(option, "option")}
    scene = fowt_env.build_scene(
        platform,
        wind=parse_wind(wind),
        sea=parse_sea(sea),
        seed=seed,
        rotor=rotor,
        fidelity=fidelity,
        **options,
    )
    title = f"{platform} · wind {wind} · sea {sea} · controller {controller} · seed {seed}"
    with progress_bar("simulating", 1.0) as update:
        try:
            frame = fowt_env.simulate(
                scene,
                controller=None if controller.lower() == "none" else controller,
                duration=duration,
                dt=dt,
                control_dt=control_dt,
                output_dt=output_dt,
                start=start,
                initial=parse_pairs(initial, "initial") or None,
                progress=update,
            )
        except (SimulationStopped, KeyboardInterrupt) as error:
            rows = getattr(error, "frame", None)  # what there is of the run
            if rows is not None and len(rows):
                _save_run(rows, out_path, None, title)
            raise
    _print_channels(frame, title)
    _note_limits(frame, scene.turbine)
    _save_run(frame, out_path, plot, title)


def _note_limits(frame, turbine):
    """Say where a run was at the generator's limits, and that its rotor passed the turbine's overspeed."""
    from fowt_env.descriptions.units import RPM

    limited = frame["GenTqLim_[-]"].mean()
    if limited > 0.0:
        note(
            f"generator torque at its range or rate limit for {100.0 * limited:.1f} % of the run: it was"
            " commanded more than it can follow"
        )
    fastest, limit = frame["RotSpeed_[rpm]"].max(), turbine.overspeed / RPM
    if fastest > limit:
        note(
            f"rotor speed of up to {fastest:.2f} rpm is beyond the turbine's overspeed of {limit:g} rpm,"
            " where an environment ends and an evaluation counts the run as failed"
        )


def show(frame, title=None):
    """Print a DataFrame, its columns of texts to the left."""
    rows = [list(map(figure, row)) for row in frame.itertuples(index=False)]
    texts = [i for i, name in enumerate(frame.columns) if frame[name].map(type).eq(str).any()]
    keys = max([i + 1 for i in texts if i < 2], default=1)
    print_table(out, list(frame.columns), rows, title, keys, left=texts)


def _save_run(frame, out_path, plot, title):
    """Write the requested time series and plot, and print where."""
    if out_path is not None:
        note(f"wrote {write_table(frame, out_path)} ({len(frame)} rows)")
    if plot is not None:
        from fowt_env.visual.time_series import plot_run

        plot_run(frame, plot, title)
        note(f"wrote {plot}")


def _print_channels(frame, title):
    """Print mean, standard deviation and range of the main channels."""
    from fowt_env.visual.time_series import PANELS

    rows = []
    for channel in dict.fromkeys([*(channel for _, channel in PANELS), "GenTq_[kN-m]", "RotThrust_[kN]"]):
        if channel in frame.columns:
            x = frame[channel]
            mean, deviation = x.mean(), x.std(ddof=0)
            if deviation < ROUNDING * abs(mean):
                deviation = 0.0  # what the sums of a constant leave
            values = (mean, deviation, x.min(), x.max())
            rows.append((channel.replace("_", " "), *map(figure, values)))
    print_table(out, ("channel", "mean", "std", "min", "max"), rows, title)


EVALUATE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt evaluate --suite above_rated --controllers pi,pi_land --jobs 2[/cyan]  the headline comparison

[cyan]fowt evaluate --controllers pi --cases above_rated[/cyan]  the PI of Eq. (8), 12 to 24 m/s, one seed

[cyan]fowt evaluate --controllers pi,pi_land --cases ntm_18,paper_18 --seeds 1,2,3 --jobs 2[/cyan]

[cyan]fowt evaluate --suite mysuite.toml --controllers pi,mymodule:Mine --baseline pi[/cyan]  your own cases

[bold]Files written[/bold]: runs/CONTROLLER/CASE_seedN.parquet, results.csv (a row per run), leaderboard.json
(means, intervals, paired differences, versions), manifest.json (the settings), summary.csv (means by
case), pareto.png, metrics.png, boxes.png, timeseries_CASE.png, spectra_CASE.png. The same command
resumes where it was stopped; further controllers, cases or seeds are added to the folder."""


@app.command(name="evaluate", epilog=EVALUATE_EXAMPLES)
@reported
def evaluate_command(
    controllers: Annotated[
        str, typer.Option(help="Names, policy:NAME, design:FILE or module:Name, comma-separated.")
    ] = "pi",
    suite: Annotated[
        str | None, typer.Option(help="Suite: a name of fowt list suites, or a path to a TOML file.")
    ] = None,
    cases: Annotated[
        str | None,
        typer.Option(
            help="Cases or suites, comma-separated; with --suite: those of its cases. Default: above_rated."
        ),
    ] = None,
    seeds: Annotated[
        str | None,
        typer.Option(help="1,2,3 or 1:6:1, same for each controller. Default: the suite's, else 1."),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Length of each run, s. Default: the suite's, else 660.")
    ] = None,
    skip: Annotated[
        float | None, typer.Option(help="Seconds at the start not scored. Default: the suite's, else 60.")
    ] = None,
    baseline: Annotated[
        str | None, typer.Option(help="Controller of the paired differences. Default: gspi_oc3, else pi.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Worker processes.")] = 1,
    engine: Annotated[str, typer.Option(help="processes, or ray.")] = "processes",
    address: Annotated[str | None, typer.Option(help="Address of a running Ray cluster.")] = None,
    time_limit: Annotated[
        float, typer.Option(help="Wall-clock seconds after which a run fails; 0: never.")
    ] = 3600.0,
    out_folder: Annotated[
        str, typer.Option("--out", help="Folder for what is written.")
    ] = "results/evaluation",
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plots.")] = True,
):
    """Score controllers on load cases: a leaderboard with intervals, metrics by case, the runs, and plots."""
    from fowt_env.training.evaluation.evaluate import evaluate, summary
    from fowt_env.training.reports.terminal import chosen_cases, write_leaderboard

    folder = Path(out_folder)
    chosen = chosen_cases(suite, cases)
    numbers = None if seeds is None else parse_whole_numbers(seeds, "seeds")
    if baseline is not None and baseline not in (names := [name.strip() for name in controllers.split(",")]):
        raise unknown("baseline among --controllers", baseline, names)
    finished = 0
    with progress_bar("evaluating", None) as update:

        def report(done, total, _):
            nonlocal finished
            finished = done
            update(done, f"evaluating, {done} of {total} runs done", total)

        try:
            table = evaluate(
                controllers,
                chosen,
                duration=duration,
                skip=skip,
                seeds=None if numbers is None else [int(number) for number in numbers],
                jobs=jobs,
                progress=report,
                folder=folder,
                engine=engine,
                address=address,
                time_limit=time_limit or None,
            )
        except KeyboardInterrupt:
            place = f"in {folder / 'results.csv'}; the same command continues with the others"
            fail(f"interrupted; the {finished} finished runs are {place}", EXIT_INTERRUPTED)
    board = write_leaderboard(table, folder, baseline)
    means = summary(table)
    write_table(means, folder / "summary.csv")
    _print_evaluation(table, means, board)
    plots = _evaluation_plots(table, board, folder) if plot else []
    note(f"wrote results.csv, leaderboard.json, summary.csv, runs/ and {len(plots)} plots in {folder}")


def _print_evaluation(table, means, board):
    """Print metrics by case and the leaderboard, and on stderr what failed or passed a limit of the score."""
    from fowt_env.training.reports.terminal import leaderboard_rows, summary_rows

    width = table_width(out) or float("inf")
    headings, rows, failures = summary_rows(means, width)
    print_table(out, headings, rows, keys=2, left=(0, 1), red=_places(failures))
    out.print()
    title, headings, rows, remarks = leaderboard_rows(board, width)
    print_table(out, headings, rows, title, red=_places(e["failed"] for e in board["controllers"]))
    for remark in remarks:
        out.print(remark, markup=False, highlight=False, soft_wrap=True)
    for row in table[table["status"] != "ok"].to_dict("records"):
        run = f"{row['controller']}, {row['case']}, seed {row['seed']}"
        err.print(
            f"[red]failed: {escape(run)}: {escape(row['reason'])}[/red]", soft_wrap=True, highlight=False
        )
    eventful = table[table["events"] != ""]
    if len(eventful):
        note(f"{len(eventful)} of {len(table)} runs had rare numerical events: column events of results.csv")
    for entry in board["controllers"]:
        if entry["score"] and not entry["score"]["valid"]:
            note(f"no valid score of {entry['controller']}: {entry['score']['why']}")


def _places(flags):
    """Numbers of the flags that are set."""
    return [place for place, flag in enumerate(flags) if flag]


def _evaluation_plots(table, board, folder):
    """Paths of the plots made; none, with a note, where matplotlib is missing."""
    from fowt_env.training.reports.terminal import evaluation_plots

    try:
        with progress_bar("plotting", None):
            return evaluation_plots(table, board, folder)
    except InputError as error:
        note(f"no plots: {error}")
        return []


TRIM_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt trim[/cyan]  the floating turbine from cut-in to cut-out

[cyan]fowt trim --winds 8,11.4,18 --fixed --out steady.csv[/cyan]  fixed platform, into a file

[cyan]fowt trim --plot schedule.png[/cyan]  the steady schedule as a picture"""
TRIM_CHANNELS = (
    "RotSpeed",
    "BldPitch1",
    "GenTq",
    "GenPwr",
    "RotThrust",
    "PtfmSurge",
    "PtfmHeave",
    "PtfmPitch",
    "FAIRTEN1",
)


@app.command(epilog=TRIM_EXAMPLES)
@reported
def trim(
    platform: PlatformOption = "oc3_hywind",
    winds: Annotated[str, typer.Option(help="Steady winds, m/s: 8,11.4,18 or START:STOP:STEP.")] = "4:24:1",
    fixed: Annotated[bool, typer.Option("--fixed", help="Fix the platform.")] = False,
    rotor: RotorOption = None,
    option: OptionOption = None,
    out_path: Annotated[str | None, typer.Option("--out", help="All channels: .csv or .parquet.")] = None,
    plot: Annotated[str | None, typer.Option(help="Plot of the schedule, e.g. schedule.png.")] = None,
):
    """Print the steady operating point over wind speed."""
    import pandas as pd

    import fowt_env

    if out_path is not None:
        table_path(out_path)
    speeds = parse_numbers(winds, "winds")
    options = parse_pairs(option, "option")
    rows = []
    with progress_bar("trimming", len(speeds)) as update:
        for number, speed in enumerate(speeds, 1):
            scene = fowt_env.build_scene(platform, wind=speed, rotor=rotor, **options)
            point = fowt_env.trim(scene, platform="fixed" if fixed else "floating")
            rows.append({"wind": speed, **point})
            update(number, f"wind {speed:g} m/s")
    units = {channel.name: channel.unit for channel in scene.channels}
    title = f"{platform}, {'fixed' if fixed else 'floating'}, steady wind"
    shown = [name for name in TRIM_CHANNELS if name in rows[0]]
    headings = ["wind\nm/s", *(f"{name}\n{units.get(name, '')}" for name in shown)]
    lines = [(f"{row['wind']:g}", *(figure(row[name]) for name in shown)) for row in rows]
    print_table(out, headings, lines, title, left=())
    names = {"wind": "Wind_[m/s]"} | {name: f"{name}_[{unit}]" for name, unit in units.items()}
    points = pd.DataFrame(rows).rename(columns=names)
    if out_path is not None:
        note(f"wrote {write_table(points, out_path)}")
    if plot is not None:
        from fowt_env.visual.response import plot_schedule

        plot_schedule(points, plot, title)
        note(f"wrote {plot}")


@app.command(name="list")
@reported
def list_names(
    kind: Annotated[
        str, typer.Argument(help="platforms, turbines, seas, controllers, agents, suites or cases; or all.")
    ] = "all",
):
    """List the names that the other commands accept."""
    from fowt_env.controllers import CONTROLLERS
    from fowt_env.controllers.policy.controller import shipped_agents
    from fowt_env.descriptions.platform import names
    from fowt_env.training.evaluation.cases import all_cases, read_suite, suite_names

    known = {
        "platforms": lambda: names("platforms"),
        "turbines": lambda: names("turbines"),
        "seas": lambda: names("sea_states"),
        "controllers": lambda: list(CONTROLLERS),
        "agents": lambda: [f"policy:{name}" for name in shipped_agents()],
        "suites": lambda: [f"{suite} ({len(read_suite(suite).cases)} cases)" for suite in suite_names()],
        "cases": lambda: list(all_cases()),
    }
    if kind != "all" and kind not in known:
        raise unknown("kind of name", kind, ("all", *known))
    for heading in known if kind == "all" else (kind,):
        out.print(f"[bold]{heading}[/bold]")
        if heading == "controllers":
            _print_controllers(CONTROLLERS)
            continue
        out.print(Columns(map(escape, known[heading]()), padding=(0, 3), expand=False), highlight=False)


def _print_controllers(factories):
    """Print the controllers: name, what each is, and what it uses."""
    from fowt_env.controllers import information

    rows = [
        (name, factory.__doc__.splitlines()[0], ", ".join(information(name)))
        for name, factory in factories.items()
    ]
    print_table(out, ("name", "what it is", "what it uses"), rows, prose=(1, 2))


app.command(epilog=DOCTOR_EXAMPLES)(reported(doctor))

VALIDATE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt validate --case decays,steady[/cyan]  the quick ones

[cyan]fowt validate[/cyan]  every figure against OpenFAST

[cyan]fowt validate --case all --bts turbsim_18mps.bts[/cyan]  with the cheaper choices, from the full box

[bold]Files written[/bold]: validation.csv and validation.md (every figure with its verdict), and plots."""


@app.command(epilog=VALIDATE_EXAMPLES)
@reported
def validate(
    case: Annotated[
        str, typer.Option(help="Any of decays, steady, floating, waves, steps, turbulence, costs; or all.")
    ] = "decays,steady,floating,waves,steps,turbulence",
    out_folder: Annotated[
        str, typer.Option("--out", help="Folder for what is written.")
    ] = "results/validation",
    reference: Annotated[str | None, typer.Option(help="Folder of the OpenFAST series.")] = None,
    bts: Annotated[str | None, typer.Option(help="Full TurbSim box instead of the stored region.")] = None,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plots.")] = True,
):
    """Compare this plant with OpenFAST on the same cases: every figure with its verdict, and plots."""
    from fowt_env.training.validation.report import write_validation_report
    from fowt_env.training.validation.validate import GROUPS, validate_cases

    names = list(GROUPS) if case == "all" else [name.strip() for name in case.split(",") if name.strip()]
    with progress_bar("validating", None) as update:
        study = validate_cases(
            names,
            folder=reference,
            bts=bts,
            report=lambda text, done, total: update(done, f"validating: {text}", total),
        )
    lines, missed = [], []
    for name, rows in study.table().groupby("case", sort=False):
        counts = [int((rows["verdict"] == verdict).sum()) for verdict in ("met", "MISSED", "reported")]
        lines.append((name, str(len(rows)), *map(str, counts)))
        missed.append(counts[1])
    headings = ("case", "figures", "met", "missed", "reported")
    print_table(out, headings, lines, "against OpenFAST", red=_places(missed))
    for row in study.rows:
        if row.verdict == "MISSED":
            text = f"{row.case}: {row.quantity}: {row.error:.3g} %, allowed {row.allowed:g} %"
            out.print(f"[red]missed[/red]  {escape(text)}", highlight=False, soft_wrap=True)
    note("wrote " + ", ".join(str(path) for path in write_validation_report(study, out_folder, plot)))


PAPER_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt paper LC5[/cyan]  one load case of the 1:50 model

[cyan]fowt paper all[/cyan]  LC1 to LC12 with the paper's claims checked

[cyan]fowt paper full_scale[/cyan]  decays, regular wave, wind and waves at full scale

[bold]Files written[/bold]: runs/CASE.parquet, statistics.csv, paper.md (claims and tables), and plots."""


@app.command(epilog=PAPER_EXAMPLES)
@reported
def paper(
    case: Annotated[str, typer.Argument(help="LC1 to LC12, comma-separated; all; or full_scale.")] = "all",
    out_folder: Annotated[str, typer.Option("--out", help="Folder for what is written.")] = "results/paper",
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plots.")] = True,
):
    """Run the paper's load cases and check its claims."""
    with from_a_clone("paper"):
        from fowt_env.training.studies.paper.load_cases import run_paper, statistics, wanted_cases
        from fowt_env.training.studies.paper.report import write_paper_report

    names = wanted_cases(case)
    with progress_bar("paper", None) as update:
        study = run_paper(names, lambda text, done, total: update(done, f"paper: {text}", total))
    if study.runs:
        values = statistics(study.runs)
        rows = [
            (
                row["case"],
                row["channel"].replace("_", " "),
                *(figure(row[name]) for name in ("mean", "std", "min", "max")),
            )
            for row in values[values["channel"].isin(("PtfmSurge_[m]", "PtfmPitch_[deg]"))].to_dict("records")
        ]
        headings = ("case", "channel", "mean", "std", "min", "max")
        print_table(out, headings, rows, "model scale", keys=2, left=(0, 1))
    for claim in study.claims:
        verdict = "[green]holds[/green]" if claim.holds else "[red]FAILS[/red]"
        text = f"Fig. {claim.figure}: {claim.text}: {claim.found}"
        out.print(f"{verdict}  {escape(text)}", highlight=False, soft_wrap=True)
    note("wrote " + ", ".join(str(path) for path in write_paper_report(study, out_folder, plot)))


benchmarks = typer.Typer(
    no_args_is_help=True, rich_markup_mode="rich", help="Measure speed, accuracy and stability."
)
app.add_typer(benchmarks, name="benchmark")
SPEED_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark speed[/cyan]  every kind of scene, load by load (some minutes: each kind is compiled)

[cyan]fowt benchmark speed --kinds "full, standard;full, fast" --starts[/cyan]  two kinds, and start times

[bold]File written[/bold]: speed.csv, headed by machine, versions, commit and calibration."""
ACCURACY_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark accuracy[/cyan]  every variant, three seeds of 600 s: an hour

[cyan]fowt benchmark accuracy --seeds 1 --duration 100 --axes "all together"[/cyan]  a first look

[bold]Files written[/bold]: accuracy.csv (a row as each run ends; a rerun resumes), accuracy.png."""


@benchmarks.command(epilog=SPEED_EXAMPLES)
@reported
def speed(
    kinds: Annotated[
        str | None, typer.Option(help="Kinds of scene, semicolon-separated; default: all.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Simulated seconds of a run.")] = 600.0,
    repeats: Annotated[int, typer.Option(help="Repeats; the median counts.")] = 5,
    starts: Annotated[bool, typer.Option("--starts", help="Also time the first and a later start.")] = False,
    out_path: Annotated[str, typer.Option("--out", help="CSV to write.")] = "results/benchmark/speed.csv",
):
    """Time each kind of scene: a step, the closed loop, simulate end to end, and each load."""
    from fowt_env.training.benchmarks import speed as bench

    names = None if kinds is None else [name.strip() for name in kinds.split(";") if name.strip()]
    with progress_bar("benchmark", None) as update:
        table = bench.speed(
            names, seconds, repeats, progress=lambda text, done, total: update(done, f"timing: {text}", total)
        )
        times = bench.start_times() if starts else {}
    rows = [(column, *map(figure, table[column])) for column in table.columns.drop(["kind", "absent"])]
    print_table(out, ("", *table["kind"]), rows, "CPU time of one thread")
    remarks = [f"{name}: {value:.2f}" for name, value in times.items()]
    for line in remarks:
        out.print(line, highlight=False)
    note(f"wrote {bench.write_csv(table, out_path, remarks)}")


STABILITY_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark stability[/cyan]  every part on small counts: some minutes

[cyan]fowt benchmark stability --cases 100000 --steps 10000000 --hostile 3000[/cyan]  as documented: an hour

[cyan]fowt benchmark stability --parts map,extremes[/cyan]  two parts; the report joins those of the folder

[cyan]fowt benchmark stability --replay results/stability/failures/case_0000.json[/cyan]  a failure again

[bold]Files written[/bold]: a JSON file per part, failures/case_NNNN.json, robustness.md."""


@benchmarks.command(epilog=ACCURACY_EXAMPLES)
@reported
def accuracy(
    seeds: Annotated[str, typer.Option(help="1,2,3 or 1:6:1.")] = "1,2,3",
    duration: Annotated[float, typer.Option(help="Length of each run, s.")] = 600.0,
    finest: Annotated[float, typer.Option(help="Step of the reference, s.")] = 0.00625,
    axes: Annotated[
        str | None, typer.Option(help="Axes of the sweep, comma-separated; default: all.")
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="Timed repeats of short runs; the median counts.")] = 5,
    box: Annotated[
        bool, typer.Option("--box", help="Wind of the stored full-field TurbSim box instead.")
    ] = False,
    out_folder: Annotated[
        str, typer.Option("--out", help="Folder for what is written.")
    ] = "results/benchmark",
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plot.")] = True,
):
    """Measure error against run time over integrators, steps, rotor models and wave sums."""
    from fowt_env.training.benchmarks import accuracy as study
    from fowt_env.training.validation.openfast_cases import box_wind

    chosen = None if axes is None else study.select([name.strip() for name in axes.split(",")])
    folder = Path(out_folder)
    numbers = parse_whole_numbers(seeds, "seeds")
    with progress_bar("accuracy", None) as update:
        table = study.accuracy(
            numbers,
            duration,
            finest,
            chosen,
            folder / "accuracy.csv",
            wind=box_wind() if box else None,
            repeats=repeats,
            progress=lambda text, done, total: update(done, text, total),
        )
    rows = []
    for row in study.accuracy_summary(table).to_dict("records"):
        speeds = (f"{row['real_time_factor']:.0f}", f"{row['kernel_factor']:.0f}")
        figures = (f"{row['worst']:.3g}", row["worst_of"], *speeds)
        rows.append((row["variant"], *figures, "*" if row["front"] else ""))
    headings = ("variant", "worst", "of", "x real time", "kernel alone", "Pareto front")
    title = "rms difference over standard deviation, and speed of simulate"
    print_table(out, headings, rows, title, left=(0, 2))
    files = [folder / "accuracy.csv"]
    if plot:
        study.plot_accuracy(table, folder / "accuracy.png")
        files.append(folder / "accuracy.png")
    note("wrote " + ", ".join(map(str, files)))


@benchmarks.command()
@reported
def evaluation(
    count: Annotated[int, typer.Option(help="Runs that are timed.")] = 21,
    suite: Annotated[str, typer.Option(help="Suite whose cases are run.")] = "above_rated",
    controller: Annotated[str, typer.Option(help="Controller.")] = "pi",
    with_ray: Annotated[bool, typer.Option("--ray", help="Also time a local Ray worker.")] = False,
    out_path: Annotated[
        str, typer.Option("--out", help="CSV to write.")
    ] = "results/benchmark/evaluation.csv",
):
    """Time the runs of an evaluation on one core, and with --ray the overhead of distributing them."""
    from fowt_env.training.benchmarks import evaluation as study
    from fowt_env.training.benchmarks import speed as bench

    with progress_bar("timing runs", None):
        table = study.evaluation_cost(count, suite, controller)
        tables = [table, study.ray_cost(controller=controller, suite=suite)] if with_ray else [table]
    for frame in tables:
        show(frame)
    remarks = [f"{row[0]}: {row[1]:.4g} ms" for frame in tables[1:] for row in frame.itertuples(index=False)]
    note(f"wrote {bench.write_csv(table, out_path, remarks)}")


@benchmarks.command(epilog=STABILITY_EXAMPLES)
@reported
def stability(
    parts: Annotated[str | None, typer.Option(help="Parts, comma-separated; default: all.")] = None,
    cases: Annotated[int, typer.Option(min=1, help="Random scenes and states.")] = 2000,
    steps: Annotated[int, typer.Option(min=1000, help="Steps of the long runs.")] = 200_000,
    hostile: Annotated[int, typer.Option(min=1, help="Control periods of each adversarial policy.")] = 600,
    seed: Annotated[int, typer.Option(min=0, help="Of everything random.")] = 0,
    out_folder: Annotated[
        str, typer.Option("--out", help="Folder for what is written.")
    ] = "results/stability",
    report: Annotated[str | None, typer.Option(help="Report; default: robustness.md in --out.")] = None,
    replay: Annotated[str | None, typer.Option(help="Run a stored case again, nothing else.")] = None,
):
    """Stress-test the simulator: steps, random scenes, adversarial actions, extremes, long runs."""
    with from_a_clone("benchmark stability"):
        from fowt_env.training.studies.robustness import study as stress
        from fowt_env.training.studies.robustness.random_cases import replay as run_again

    if replay is not None:
        outcome = run_again(replay)
        out.print(f"reached {outcome.time:.2f} s: {outcome.text}", highlight=False)
        raise typer.Exit(1 if outcome.failure else 0)
    chosen = None if parts is None else [name.strip() for name in parts.split(",") if name.strip()]
    sizes = stress.Sizes(cases=cases, steps=steps, hostile_steps=hostile, seed=seed)
    with progress_bar("stability", None) as update:
        results = stress.study(
            out_folder, chosen, sizes, progress=lambda text, done, total: update(done, text, total)
        )
    claims = [claim for found in results.values() for claim in found.claims]
    for claim in claims:
        verdict = "[green]holds[/green] " if claim.holds else "[red]MISSED[/red]"
        text = f"{claim.what} ({claim.count}): {claim.found}"
        out.print(f"{verdict} {escape(text)}", highlight=False, soft_wrap=True)
    path = stress.write_robustness_report(out_folder, report or Path(out_folder) / "robustness.md")
    note(f"wrote {path}")
    if not all(claim.holds for claim in claims):
        raise typer.Exit(1)


# these add their commands to the app
from fowt_env.training.cli import design as _design  # noqa: E402, F401
from fowt_env.training.cli import plot as _plot  # noqa: E402, F401
from fowt_env.training.cli import report as _report  # noqa: E402, F401
from fowt_env.training.cli import scores as _scores  # noqa: E402, F401
from fowt_env.training.cli import train as _train  # noqa: E402, F401
