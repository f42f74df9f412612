"""Implements fowt evaluate: compares controllers on the cases of a suite."""

import json
from pathlib import Path
from typing import Annotated

from rich.markup import escape
from typer import Option

from fowt_env.analysis.threads import one_thread
from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.errors import InputError, unknown
from fowt_env.files.tables import write_table
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.console import (
    command,
    err,
    note,
    progress_bar,
    resumable,
)
from fowt_env.training.cli.tables import out, print_table, table_width

MOST_CASES = 12  # largest number of cases whose conditions are printed
CONTROLLERS = "Names, policy:NAME, design:FILE, dll:FILE.so or module:Name, comma-separated."
CASES = "Cases or suites, comma-separated; with --suite: a selection of its cases. Default: above_rated."
PLATFORM = "Platform (name or path), to which winds and limits are scaled. Default: the suite's."
SEEDS = f"{shared.WHOLE}, the same for each controller. Default: the suite's, else 1."
DRAWN = "Hash from which the suite's seeds are drawn, e.g. of the commit that freezes the entries."
PREVIEW = "Wind preview: exact, or measured by the lidar four_beam_pulsed or circular_cw."
SENSORS = "Sensors: exact, or the name of a sensor chain. Default: that of each case."
BASELINE = "Controller of the paired differences. Default: gspi_oc3, else pi."
OF_LIMIT = "Compute the limit of linear control at each controller's travel, power and torque (seconds each)."
TEXT = str | None


@command()
@one_thread
def evaluate_command(
    controllers: Annotated[str, Option(help=CONTROLLERS)] = "pi",
    suite: Annotated[TEXT, Option(help="Suite: a name of fowt list suites, or a TOML file.")] = None,
    cases: Annotated[TEXT, Option(help=CASES)] = None,
    platform: Annotated[TEXT, Option(help=PLATFORM)] = None,
    seeds: Annotated[TEXT, Option(help=SEEDS)] = None,
    draw_seeds: Annotated[TEXT, Option(help=DRAWN)] = None,
    duration: Annotated[
        float | None, Option(help="Length of a run, s. Default: the suite's, or 660.")
    ] = None,
    skip: Annotated[float | None, Option(help="Unscored start, s. Default: the suite's, or 60.")] = None,
    preview: Annotated[str, Option(help=PREVIEW)] = "exact",
    sensors: Annotated[TEXT, Option(help=SENSORS)] = None,
    baseline: Annotated[TEXT, Option(help=BASELINE)] = None,
    jobs: shared.JobsOption = 1,
    engine: shared.EngineOption = "processes",
    address: shared.AddressOption = None,
    time_limit: Annotated[float, Option(help="Wall-clock limit of a run, s; 0: none.")] = 3600.0,
    retry_failed: Annotated[bool, Option("--retry-failed", help="Repeat failed runs in the folder.")] = False,
    out_folder: shared.FolderOption = "results/evaluation",
    plot: shared.PlotsOption = True,
    of_limit: Annotated[bool, Option("--of-limit", help=OF_LIMIT)] = False,
):
    """Compare controllers on load cases: a leaderboard.

    Also writes intervals, metrics by case, the time series of all runs, and plots.

    Examples:
    fowt evaluate --suite above_rated --controllers pi,pi_land --jobs 2  # the main comparison
    fowt evaluate --controllers pi,pi_land --cases ntm_18,paper_18 --seeds 1,2,3 --jobs 2
    fowt evaluate --suite mysuite.toml --controllers pi,mymodule:Mine --baseline pi  # your own cases
    fowt evaluate --suite above_rated --platform nrel5mw_oc4_semi --out results/oc4
    fowt evaluate --suite above_rated --sensors exact --out results/exact  # without noise and delay
    fowt evaluate --controllers pi,mymodule:Mine --out results/mine --retry-failed  # repeat failed runs
    fowt evaluate --suite above_rated --draw-seeds $COMMIT --out results/drawn  # seeds from a commit

    [bold]Files written[/bold]: runs/CONTROLLER/CASE_seedN.parquet, results.csv (a row per run),
    leaderboard.json, manifest.json (the settings), summary.csv (means by case) and plots; with --of-limit
    of_limit.csv: rotor-speed and platform-pitch deviations over the least ones of linear control with the
    same inputs, travel, power and torque, by case. The column "of its limit" is its mean and range over the
    winds above the lulls near rated. The same command resumes an interrupted evaluation and adds further
    controllers, cases or seeds to the folder.
    """
    from fowt_env.controllers import controller_names
    from fowt_env.training.evaluation.cases import chosen_cases
    from fowt_env.training.evaluation.evaluate import evaluate, summary
    from fowt_env.training.evaluation.leaderboard_file import write_leaderboard
    from fowt_env.training.evaluation.seeds import with_drawn_seeds
    from fowt_env.training.reports.evaluation_plots import evaluation_plots
    from fowt_env.training.reports.own_limits import FILE, own_limits, read_limits

    folder = Path(out_folder)
    chosen = chosen_cases(suite, cases, platform)
    numbers = None if seeds is None else parse_whole_numbers(seeds, "seeds")
    if draw_seeds is not None:
        if suite is None or seeds is not None:
            raise InputError("--draw-seeds: needs a --suite, and no --seeds")
        chosen = with_drawn_seeds(chosen, draw_seeds)
    if baseline is not None and baseline not in (names := controller_names(controllers)):
        raise unknown("baseline among --controllers", baseline, names)
    where = f"in {folder / 'results.csv'}; the same command resumes the evaluation"
    with resumable("evaluating", lambda done: f"the {done} finished runs are {where}") as update:
        table = evaluate(
            controllers,
            chosen,
            duration=duration,
            skip=skip,
            seeds=numbers,
            jobs=jobs,
            progress=lambda done, total, _: update(done, total, f"evaluating, {done} of {total} runs done"),
            folder=folder,
            engine=engine,
            address=address,
            time_limit=time_limit or None,
            sensors=sensors,
            retry_failed=retry_failed,
            **({} if preview == "exact" else {"preview": preview}),
        )
    _print_conditions(folder, suite)
    board = write_leaderboard(table, folder, baseline)
    means = summary(table)
    write_table(means, folder / "summary.csv")
    if of_limit:
        with progress_bar("computing limits") as update:
            cases_of = getattr(chosen, "cases", chosen)
            limits = own_limits(table, cases_of, None if preview == "exact" else preview, progress=update)
        write_table(limits, folder / FILE)
    _print_evaluation(table, means, board, read_limits(folder))
    plots = []
    if plot:
        try:
            with progress_bar("plotting"):
                plots = evaluation_plots(table, board, folder)
        except InputError as error:  # without matplotlib
            note(f"no plots: {error}")
    if draw_seeds is not None:
        note(f"seeds drawn from {chosen.drawn['hash']}: {chosen.drawn['rule']}")
    note(f"wrote results.csv, leaderboard.json, summary.csv, runs/ and {len(plots)} plots in {folder}")


def _print_conditions(folder, suite):
    """Print wind, sea, event and duration of each case; of many cases, the command that lists them."""
    from fowt_env.training.evaluation.conditions import described_texts

    cases = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["cases"]
    if len(cases) > MOST_CASES:
        note(f"wind and sea of the {len(cases)} cases: fowt list cases {suite or ''}".rstrip())
        return
    rows = [(name, *described_texts(about), about["duration"]) for name, about in cases.items()]
    print_table(("case", "wind", "sea", "s"), rows, left=(0, 1, 2), prose=(1, 2))
    out.print()


def _print_evaluation(table, means, board, limits):
    """Print metrics by case and the leaderboard; on stderr, lost runs and reasons for invalid scores."""
    from fowt_env.training.reports.own_limits import limit_texts
    from fowt_env.training.reports.terminal import leaderboard_rows, summary_rows

    headings, rows, failures = summary_rows(means, table_width())
    print_table(headings, rows, keys=2, left=(0, 1), red=[i for i, lost in enumerate(failures) if lost])
    out.print()
    texts = None if limits is None else limit_texts(limits)
    title, headings, rows, remarks = leaderboard_rows(board, table_width(), texts)
    lost = [i for i, entry in enumerate(board["controllers"]) if entry["lost"]]
    print_table(headings, rows, title, red=lost)
    for remark in remarks:
        out.print(remark, markup=False)
    for row in table[table["status"] != "ok"].to_dict("records"):
        run = f"{row['controller']}, {row['case']}, seed {row['seed']}"
        reason = row["reason"].removeprefix(f"{row['status']}: ")
        err.print(f"[red]{row['status']}: {escape(run)}: {escape(reason)}[/red]")
    eventful = table[table["events"] != ""]
    if len(eventful):
        note(f"{len(eventful)} of {len(table)} runs had rare numerical events: column events of results.csv")
    for entry in board["controllers"]:
        if entry["score"] and not entry["score"]["valid"]:
            note(f"no valid score of {entry['controller']}: {entry['score']['why']}")
