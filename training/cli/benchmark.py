"""Implements fowt dev benchmark: speed, compile times, accuracy, evaluation and stability."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from typer import Option

from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.training.cli.arguments import parse_names
from fowt_env.training.cli.console import (
    add_group,
    command,
    dev,
    from_a_clone,
    progress_bar,
    text_progress,
    wrote,
)
from fowt_env.training.cli.options import WHOLE, CsvOption, FolderOption, PlotsOption, SuiteOption
from fowt_env.training.cli.tables import out, print_table, show

benchmarks = add_group("benchmark", "Measure speed, accuracy and stability.", dev)
ScenesOption = Annotated[str, Option(help="Platform of the scenes.")]


@command(benchmarks)
def compile_command(out_path: CsvOption = "results/benchmark/compile.csv"):
    """Time the first run, with compilation, of six kinds of scene.

    Examples:
    fowt dev benchmark compile  # a minute or two; the kernel cache stays unchanged
    """
    from fowt_env.training.benchmarks import compile_time
    from fowt_env.training.benchmarks import speed as bench

    with text_progress("compiling") as progress:
        table = compile_time.session(progress=progress)
    rows = [(row.scene, f"{row.seconds:.1f}", f"{row.processor_seconds:.1f}") for row in table.itertuples()]
    print_table(("scene", "s", "processor s"), rows, "first run of each kind of scene")
    wrote(bench.write_csv(table, out_path))


@command(benchmarks)
def speed(
    kinds: Annotated[str | None, Option(help="Kinds of scene, semicolon-separated; default: all.")] = None,
    seconds: Annotated[float, Option(help="Simulated time of a run, s.")] = 600.0,
    repeats: Annotated[int, Option(help="Repeats; the median is reported.")] = 5,
    platform: ScenesOption = "oc3_hywind",
    starts: Annotated[bool, Option("--starts", help="Also time a first and a later start.")] = False,
    out_path: CsvOption = "results/benchmark/speed.csv",
):
    """Time simulate on each kind of scene, load by load.

    Examples:
    fowt dev benchmark speed  # every kind of scene, load by load (some minutes: each kind is compiled)
    fowt dev benchmark speed --kinds "full, standard;full, fast" --starts  # two kinds, and start times

    [bold]File written[/bold]: speed.csv, with machine, versions, commit and calibration in its header.
    """
    from fowt_env.training.benchmarks import speed as bench

    with text_progress("benchmark", "timing: ") as progress:
        names = parse_names(kinds, ";")
        table = bench.speed(names, seconds, repeats, progress=progress, platform=platform)
        times = bench.start_times() if starts else {}
    rows = [(column, *table[column]) for column in table.columns.drop(["kind", "absent"])]
    print_table(("", *table["kind"]), rows, "CPU time of one thread")
    remarks = [f"{name}: {value:.2f}" for name, value in times.items()]
    for line in remarks:
        out.print(line)
    wrote(bench.write_csv(table, out_path, remarks))


@command(benchmarks)
def tune_command(
    controller: Annotated[str, Option(help="Controller whose first slider is moved.")] = "pi",
    moves: Annotated[int, Option(min=2, help="Number of moves.")] = 40,
    motion: Annotated[bool, Option("--motion", help="Let the turbines move meanwhile.")] = False,
    out_path: CsvOption = "results/benchmark/tune.csv",
):
    """Time the live page from a slider to the picture, in headless Chromium.

    Examples:
    fowt dev benchmark tune  # median and 95 % quantile of 40 moves
    """
    from fowt_env.training.benchmarks import speed as bench
    from fowt_env.training.benchmarks.live_page import delays

    with text_progress("tune") as progress:
        table = delays(controller, moves, motion, progress)
    values = table["delay_[ms]"]
    rows = [(controller, len(values), *(f"{values.quantile(part):.0f}" for part in (0.5, 0.95)))]
    print_table(("controller", "moves", "median ms", "95 % ms"), rows, "from a slider to the picture")
    wrote(bench.write_csv(table, out_path))


@command(benchmarks)
def accuracy(
    seeds: Annotated[str, Option(help=f"Seeds: {WHOLE}.")] = "1,2,3",
    duration: Annotated[float, Option(help="Length of each run, s.")] = 600.0,
    finest: Annotated[float, Option(help="Step of the reference, s.")] = 0.00625,
    axes: Annotated[str | None, Option(help="Axes of the sweep, comma-separated; default: all.")] = None,
    repeats: Annotated[int, Option(min=1, help="Timed repeats of short runs; the median is taken.")] = 5,
    platform: ScenesOption = "oc3_hywind",
    box: Annotated[bool, Option("--box", help="Use the wind of the stored full-field TurbSim box.")] = False,
    out_folder: FolderOption = "results/benchmark",
    plot: PlotsOption = True,
    beside: Annotated[str | None, Option(help="CSV of another platform, added to the figure.")] = None,
):
    """Measure error against run time.

    Varies integrators, steps, rotor models and wave sums.

    Examples:
    fowt dev benchmark accuracy  # every variant, three seeds of 600 s: an hour
    fowt dev benchmark accuracy --seeds 1 --duration 100 --axes "all together"  # a first look
    fowt dev benchmark accuracy --platform iea15_volturnus_s --axes levels  # levels of another platform

    [bold]Files written[/bold]: accuracy.csv (a row after each run; a rerun resumes), accuracy.png.
    """
    from fowt_env.training.benchmarks import accuracy as study
    from fowt_env.training.validation.openfast_cases import box_wind

    chosen = None if axes is None else study.select(parse_names(axes))
    folder = Path(out_folder)
    name = "accuracy" if platform == study.PLATFORM else f"accuracy_{platform}"
    if box and platform != study.PLATFORM:
        raise InputError(
            f"--box: the stored box is for {study.PLATFORM}; omit --box for platform {platform!r}"
        )
    numbers = parse_whole_numbers(seeds, "seeds")
    with text_progress("accuracy") as progress:
        table = study.accuracy(
            numbers,
            duration,
            finest,
            chosen,
            folder / f"{name}.csv",
            wind=box_wind() if box else None,
            repeats=repeats,
            progress=progress,
            platform=platform,
        )
    rows = [
        (
            *(row["variant"], f"{row['worst']:.3g}", row["worst_of"]),
            *(f"{row['real_time_factor']:.0f}", f"{row['kernel_factor']:.0f}", "*" if row["front"] else ""),
        )
        for row in study.accuracy_summary(table).to_dict("records")
    ]
    headings = ("variant", "largest", "channel", "x real time", "kernel only", "Pareto front")
    title = "rms difference relative to standard deviation, and speed of simulate"
    print_table(headings, rows, title, left=(0, 2))
    files = [folder / f"{name}.csv"]
    if plot:
        files.append(folder / f"{name}.png")
        other = None
        if beside is not None:
            its_platform = Path(beside).stem.removeprefix("accuracy").removeprefix("_") or study.PLATFORM
            other = (its_platform, study.read_accuracy(beside))
        study.plot_accuracy(table, files[-1], openfast=platform == study.PLATFORM, beside=other)
    wrote(*files)


@command(benchmarks)
def evaluation(
    count: Annotated[int, Option(help="Number of timed runs.")] = 21,
    suite: SuiteOption = "above_rated",
    controller: Annotated[str, Option(help="Controller.")] = "pi",
    with_ray: Annotated[bool, Option("--ray", help="Also time a local Ray worker.")] = False,
    out_path: CsvOption = "results/benchmark/evaluation.csv",
):
    """Time the runs of an evaluation on one core.

    --ray adds the overhead of distributing the runs.

    Examples:
    fowt dev benchmark evaluation  # 21 runs of the suite above_rated with pi
    fowt dev benchmark evaluation --count 7 --controller lqr --ray  # another controller, and Ray
    """
    from fowt_env.training.benchmarks import evaluation as study
    from fowt_env.training.benchmarks import speed as bench

    with progress_bar("timing runs"):
        table = study.evaluation_cost(count, suite, controller)
        tables = [table, study.ray_cost(controller=controller, suite=suite)] if with_ray else [table]
    for frame in tables:
        show(frame)
    remarks = [f"{row[0]}: {row[1]:.4g} ms" for frame in tables[1:] for row in frame.itertuples(index=False)]
    wrote(bench.write_csv(table, out_path, remarks))


@command(benchmarks)
def stability(
    parts: Annotated[str | None, Option(help="Parts, comma-separated; default: all.")] = None,
    cases: Annotated[int, Option(min=1, help="Number of random scenes and states.")] = 2000,
    steps: Annotated[int, Option(min=1000, help="Number of steps of the long runs.")] = 200_000,
    hostile: Annotated[int, Option(min=1, help="Control periods of each adversarial policy.")] = 600,
    seed: Annotated[int, Option(min=0, help="Random seed.")] = 0,
    out_folder: FolderOption = "results/stability",
    report: Annotated[str | None, Option(help="Report file; default: robustness.md in --out.")] = None,
    replay: Annotated[str | None, Option(help="Only rerun a stored case.")] = None,
):
    """Stress-test the simulator (from a clone).

    Covers time steps, random scenes, adversarial actions, extreme conditions and long runs.

    Examples:
    fowt dev benchmark stability  # every part with small counts: some minutes
    fowt dev benchmark stability --cases 100000 --steps 10000000 --hostile 3000  # as documented: an hour
    fowt dev benchmark stability --parts map,extremes  # two parts; the report also has those in the folder
    fowt dev benchmark stability --replay results/stability/failures/case_0000.json  # rerun a failure

    [bold]Files written[/bold]: PART.json, failures/case_NNNN.json, robustness.md, robustness/PART.csv.
    """
    with from_a_clone("benchmark stability"):
        from fowt_env.training.studies.robustness import study as stress
        from fowt_env.training.studies.robustness.random_cases import replay as run_again

    if replay is not None:
        outcome = run_again(replay)
        out.print(f"reached {outcome.time:.2f} s: {outcome.text}")
        raise typer.Exit(1 if outcome.failure else 0)
    sizes = stress.Sizes(cases=cases, steps=steps, hostile_steps=hostile, seed=seed)
    with text_progress("stability") as progress:
        results = stress.study(out_folder, parse_names(parts), sizes, progress=progress)
    claims = [claim for part in results.values() for claim in part.claims]
    for claim in claims:
        verdict = "[green]holds[/green] " if claim.holds else "[red]MISSED[/red]"
        out.print(f"{verdict} {escape(f'{claim.what} ({claim.count}): {claim.found}')}")
    wrote(stress.write_robustness_report(out_folder, report or Path(out_folder) / "robustness.md"))
    if not all(claim.holds for claim in claims):
        raise typer.Exit(1)
