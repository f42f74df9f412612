"""fowt benchmark: speed, compile times, accuracy, evaluation and stability."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.training.cli.console import app, from_a_clone, note, out, output, progress_bar, reported, show
from fowt_env.training.cli.tables import figure, print_table

benchmarks = typer.Typer(
    no_args_is_help=True, rich_markup_mode="rich", help="Measure speed, accuracy and stability."
)
app.add_typer(benchmarks, name="benchmark")
SPEED_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark speed[/cyan]  # every kind of scene, load by load (some minutes: each kind is compiled)

[cyan]fowt benchmark speed --kinds "full, standard;full, fast" --starts[/cyan]  # two kinds, and start times

[bold]File written[/bold]: speed.csv, headed by machine, versions, commit and calibration."""
ACCURACY_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark accuracy[/cyan]  # every variant, three seeds of 600 s: an hour

[cyan]fowt benchmark accuracy --seeds 1 --duration 100 --axes "all together"[/cyan]  # a first look

[cyan]fowt benchmark accuracy --platform iea15_volturnus_s --axes levels[/cyan]  # another platform's levels

[bold]Files written[/bold]: accuracy.csv (a row as each run ends; a rerun resumes), accuracy.png."""


COMPILE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark compile[/cyan]  # a minute or two; kernels of other runs are left as they are"""


@benchmarks.command(name="compile", epilog=COMPILE_EXAMPLES)
@reported
def compile_command(
    out_path: Annotated[str, typer.Option("--out", help="CSV to write.")] = "results/benchmark/compile.csv",
):
    """Time the first run of six kinds of scene: compiling."""
    from fowt_env.training.benchmarks import compile_time
    from fowt_env.training.benchmarks import speed as bench

    output(out_path)
    with progress_bar("compiling", None) as update:
        table = compile_time.session(progress=lambda text, done, total: update(done, text, total))
    rows = [(row.scene, f"{row.seconds:.1f}", f"{row.processor_seconds:.1f}") for row in table.itertuples()]
    print_table(out, ("scene", "s", "processor s"), rows, "first run of each kind of scene")
    note(f"wrote {bench.write_csv(table, out_path)}")


@benchmarks.command(epilog=SPEED_EXAMPLES)
@reported
def speed(
    kinds: Annotated[
        str | None, typer.Option(help="Kinds of scene, semicolon-separated; default: all.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Simulated seconds of a run.")] = 600.0,
    repeats: Annotated[int, typer.Option(help="Repeats; the median counts.")] = 5,
    platform: Annotated[str, typer.Option(help="Platform of the scenes.")] = "oc3_hywind",
    starts: Annotated[bool, typer.Option("--starts", help="Also time the first and a later start.")] = False,
    out_path: Annotated[str, typer.Option("--out", help="CSV to write.")] = "results/benchmark/speed.csv",
):
    """Time simulate on each kind of scene, load by load."""
    from fowt_env.training.benchmarks import speed as bench

    names = None if kinds is None else [name.strip() for name in kinds.split(";") if name.strip()]
    output(out_path)
    with progress_bar("benchmark", None) as update:
        table = bench.speed(
            names,
            seconds,
            repeats,
            progress=lambda text, done, total: update(done, f"timing: {text}", total),
            platform=platform,
        )
        times = bench.start_times() if starts else {}
    rows = [(column, *map(figure, table[column])) for column in table.columns.drop(["kind", "absent"])]
    print_table(out, ("", *table["kind"]), rows, "CPU time of one thread")
    remarks = [f"{name}: {value:.2f}" for name, value in times.items()]
    for line in remarks:
        out.print(line, highlight=False)
    note(f"wrote {bench.write_csv(table, out_path, remarks)}")


STABILITY_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark stability[/cyan]  # every part on small counts: some minutes

[cyan]fowt benchmark stability --cases 100000 --steps 10000000 --hostile 3000[/cyan]  # as documented: an hour

[cyan]fowt benchmark stability --parts map,extremes[/cyan]  # two parts; the report joins those of the folder

[cyan]fowt benchmark stability --replay results/stability/failures/case_0000.json[/cyan]  # a failure again

[bold]Files written[/bold]: PART.json, failures/case_NNNN.json, robustness.md, robustness/PART.csv."""


@benchmarks.command(epilog=ACCURACY_EXAMPLES)
@reported
def accuracy(
    seeds: Annotated[str, typer.Option(help="1,2,3 or 1:6:1 (6 included).")] = "1,2,3",
    duration: Annotated[float, typer.Option(help="Length of each run, s.")] = 600.0,
    finest: Annotated[float, typer.Option(help="Step of the reference, s.")] = 0.00625,
    axes: Annotated[
        str | None, typer.Option(help="Axes of the sweep, comma-separated; default: all.")
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="Timed repeats of short runs; the median counts.")] = 5,
    platform: Annotated[str, typer.Option(help="Platform of the scenes.")] = "oc3_hywind",
    box: Annotated[
        bool, typer.Option("--box", help="Wind of the stored full-field TurbSim box instead.")
    ] = False,
    out_folder: Annotated[
        str, typer.Option("--out", help="Folder for what is written.")
    ] = "results/benchmark",
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plot.")] = True,
    beside: Annotated[
        str | None, typer.Option(help="CSV of another platform, whose points are drawn beside these.")
    ] = None,
):
    """Measure error against run time.

    Over integrators, steps, rotor models and wave sums.
    """
    from fowt_env.training.benchmarks import accuracy as study
    from fowt_env.training.validation.openfast_cases import box_wind

    chosen = None if axes is None else study.select([name.strip() for name in axes.split(",")])
    folder = Path(output(out_folder, folder=True))
    name = "accuracy" if platform == study.PLATFORM else f"accuracy_{platform}"
    if box and platform != study.PLATFORM:
        raise InputError(
            f"--box: the stored box is {study.PLATFORM}'s; leave it out for platform {platform!r}"
        )
    numbers = parse_whole_numbers(seeds, "seeds")
    with progress_bar("accuracy", None) as update:
        table = study.accuracy(
            numbers,
            duration,
            finest,
            chosen,
            folder / f"{name}.csv",
            wind=box_wind() if box else None,
            repeats=repeats,
            progress=lambda text, done, total: update(done, text, total),
            platform=platform,
        )
    rows = []
    for row in study.accuracy_summary(table).to_dict("records"):
        speeds = (f"{row['real_time_factor']:.0f}", f"{row['kernel_factor']:.0f}")
        figures = (f"{row['worst']:.3g}", row["worst_of"], *speeds)
        rows.append((row["variant"], *figures, "*" if row["front"] else ""))
    headings = ("variant", "worst", "of", "x real time", "kernel alone", "Pareto front")
    title = "rms difference over standard deviation, and speed of simulate"
    print_table(out, headings, rows, title, left=(0, 2))
    files = [folder / f"{name}.csv"]
    if plot:
        files.append(folder / f"{name}.png")
        other = None
        if beside is not None:
            whose = Path(beside).stem.removeprefix("accuracy").removeprefix("_") or study.PLATFORM
            other = (whose, study.read_accuracy(beside))
        study.plot_accuracy(table, files[-1], openfast=platform == study.PLATFORM, beside=other)
    note("wrote " + ", ".join(map(str, files)))


EVALUATION_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt benchmark evaluation[/cyan]  # 21 runs of the suite above_rated with pi

[cyan]fowt benchmark evaluation --count 7 --controller lqr --ray[/cyan]  # another controller, and Ray"""


@benchmarks.command(epilog=EVALUATION_EXAMPLES)
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
    """Time the runs of an evaluation on one core.

    With --ray also the overhead of distributing them.
    """
    from fowt_env.training.benchmarks import evaluation as study
    from fowt_env.training.benchmarks import speed as bench

    output(out_path)
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
    """Stress-test the simulator (from a clone).

    Steps, random scenes, adversarial actions, extremes, long runs.
    """
    with from_a_clone("benchmark stability"):
        from fowt_env.training.studies.robustness import study as stress
        from fowt_env.training.studies.robustness.random_cases import replay as run_again

    if replay is not None:
        outcome = run_again(replay)
        out.print(f"reached {outcome.time:.2f} s: {outcome.text}", highlight=False)
        raise typer.Exit(1 if outcome.failure else 0)
    chosen = None if parts is None else [name.strip() for name in parts.split(",") if name.strip()]
    sizes = stress.Sizes(cases=cases, steps=steps, hostile_steps=hostile, seed=seed)
    output(out_folder, folder=True)
    output(report, "--report")
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
