"""The commands that score agents over baselines and against the performance limit: scores."""

from typing import Annotated

import typer

from fowt_env.errors import InputError
from fowt_env.training.cli.arguments import parse_sea, parse_wind
from fowt_env.training.cli.console import app, note, out, output, progress_bar, reported

scores = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Compare agents with baselines, from saved evaluations.",
)
app.add_typer(scores, name="scores")

FoldersArgument = Annotated[
    list[str], typer.Argument(metavar="RESULTS...", help="Folders or results.csv of fowt evaluate.")
]
GroupOption = Annotated[
    list[str] | None,
    typer.Option(
        "--group", metavar="NAME=LABEL,LABEL", help="Training seeds of one configuration; repeatable."
    ),
]
AgentsOption = Annotated[
    str | None, typer.Option(help="Controllers to score, comma-separated; default: all but the baselines.")
]
CasesOption = Annotated[str | None, typer.Option(help="Cases that count, comma-separated; default: all.")]


def _names(text):
    """List of the names in a text with commas; None for None."""
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _groups(texts):
    """{name: labels} of the texts of --group. Raises: InputError."""
    found = {}
    for text in texts or ():
        name, equals, labels = text.partition("=")
        if not (name.strip() and equals and _names(labels)):
            raise InputError(f"--group {text!r}: must be NAME=LABEL,LABEL")
        if name.strip() in found:
            raise InputError(f"--group {text!r}: the name is there twice")
        found[name.strip()] = _names(labels)
    return found


def _runs(results, cases):
    """Table of the runs that controllers are scored on. Raises: InputError."""
    from fowt_env.training.evaluation.metrics import METRICS
    from fowt_env.training.evaluation.results_table import read_results

    return read_results(results, METRICS, _names(cases), parked=False)


def _shown(text, tables, out_path):
    """Print the markdown text, and write it with its tables where a path is given."""
    from fowt_env.training.reports.scores import write_scores

    out.print(text, highlight=False, markup=False, soft_wrap=True)
    if out_path is not None:
        note("wrote " + ", ".join(str(path) for path in write_scores(tables, text, out_path)))


OutOption = Annotated[
    str | None, typer.Option("--out", metavar="STEM", help="Write STEM.md and the tables as STEM*.csv.")
]
BASELINES_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt evaluate --controllers policy:ppo_lqr,gspi_oc3,rosco_float --out results/rl[/cyan]

[cyan]fowt scores baselines results/rl --against gspi_oc3,rosco_float --out results/rl/scores[/cyan]

[cyan]fowt scores baselines results/rl --group lqr=policy:ppo_lqr,policy:ppo_lqr_seed1[/cyan]

Each figure: ratio of lifetime means on the same runs, its 95 % interval, and its verdict against the targets:
missed, first, then (or met), with * where that is no chance finding (p at most 0.05 after Holm's correction
for all targets). A lost run counts ten times the baseline's figures in the same case and seed."""


@scores.command(name="baselines", epilog=BASELINES_EXAMPLES)
@scores.command(name="rivals", hidden=True)  # its former name
@reported
def over_baselines(
    results: FoldersArgument,
    against: Annotated[str, typer.Option(help="Baselines, comma-separated.")] = "gspi_oc3,rosco_float",
    group: GroupOption = None,
    agents: AgentsOption = None,
    cases: CasesOption = None,
    out_path: OutOption = None,
):
    """Agents over baselines, with a verdict on each target."""
    from fowt_env.training.reports.scores import agent_counts, agent_scores, scores_markdown

    output(out_path)
    table = _runs(results, cases)
    chosen = _names(against), _groups(group), _names(agents)
    found, counts = agent_scores(table, *chosen), agent_counts(table, *chosen)
    _shown(scores_markdown(found, counts), {"": found, "counts": counts}, out_path)


CASES_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt evaluate --suite shifted --controllers policy:ppo_lqr,gspi_oc3 --out results/shifted[/cyan]

[cyan]fowt scores cases results/shifted --out results/shifted/scores[/cyan]  # every shifted plant by itself

[cyan]fowt scores cases results/gusts --figures "RotSpeed_max_[rpm],PtfmPitch_max_[deg]"[/cyan]  # any metric

[cyan]fowt scores cases results/sea_states --each[/cyan]  # one row per sea state"""


@scores.command(name="cases", epilog=CASES_EXAMPLES)
@reported
def by_cases(
    results: FoldersArgument,
    against: Annotated[str, typer.Option(help="The baseline.")] = "gspi_oc3",
    group: GroupOption = None,
    agents: AgentsOption = None,
    cases: CasesOption = None,
    figures: Annotated[
        str, typer.Option(help="Figures or metrics whose tables are made, comma-separated.")
    ] = "rotor-speed std,platform-pitch std,blade-pitch travel,tower-base DEL",
    each: Annotated[bool, typer.Option("--each", help="Every case by itself, winds too.")] = False,
    out_path: OutOption = None,
):
    """Agents over one baseline, on each kind of case.

    The winds of a kind together; failed runs are counted.
    """
    from fowt_env.training.reports.scores import by_kind, figures_named, kinds_markdown

    output(out_path)
    table, chosen = _runs(results, cases), figures_named(_names(figures))
    found, counts = by_kind(table, against, _groups(group), _names(agents), chosen, each)
    _shown(kinds_markdown(found, counts), {"": found, "counts": counts}, out_path)


BOUND_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt scores bound results/rl --plot results/rl/bound.png --out results/rl/bound[/cyan]

Limit: that for what the controller knows and moves; the names are those of fowt design bound --help.
In brackets: more blade-pitch travel or power deviation than gspi_oc3, which the limit does not allow."""


@scores.command(epilog=BOUND_EXAMPLES)
@reported
def bound(
    results: FoldersArgument,
    group: GroupOption = None,
    agents: AgentsOption = None,
    cases: CasesOption = None,
    table_path: Annotated[
        str | None, typer.Option("--bound", help="Limit: CSV of fowt design bound; default: the package's.")
    ] = None,
    plot: Annotated[str | None, typer.Option(help="Picture of all controllers and Pareto fronts.")] = None,
    out_path: OutOption = None,
):
    """Share of the limit of linear control that each reaches."""
    from fowt_env.training.reports.bound_scores import bound_fractions, bound_markdown, read_bound
    from fowt_env.training.reports.score_plots import plot_fractions

    output(out_path)
    output(plot, "--plot")
    fronts = read_bound(table_path)
    found = bound_fractions(_runs(results, cases), fronts, _groups(group), _names(agents))
    _shown(bound_markdown(found), {"": found}, out_path)
    if plot is not None:
        plot_fractions(found, fronts, plot)
        note(f"wrote {plot}")


FAULTS_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt evaluate --suite faults --controllers pi,gspi_oc3,rosco_float,lqr --out results/faults[/cyan]

[cyan]fowt scores faults results/faults[/cyan]

Survived: no capsize, blow-up or error, and within the suite's limits of rotor speed and platform pitch. A
trip is no failure here; the last table counts them."""


@scores.command(epilog=FAULTS_EXAMPLES)
@reported
def faults(results: FoldersArgument, cases: CasesOption = None, out_path: OutOption = None):
    """Which controllers survive which faults.

    With the largest motions and loads, and the trips.
    """
    from fowt_env.training.reports.survival import survival, survival_markdown

    output(out_path)
    found = survival(_runs(results, cases))
    _shown(survival_markdown(found), {"": found}, out_path)


GUST_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt scores gust gust.png --controllers pi,gspi_oc3,rosco_float,lqr,policy:ppo_lqr[/cyan]"""


@scores.command(epilog=GUST_EXAMPLES)
@reported
def gust(
    plot: Annotated[str, typer.Argument(help="The picture.")],
    controllers: Annotated[
        str, typer.Option(help="Comma-separated; see fowt list controllers.")
    ] = "gspi_oc3,rosco_float,lqr",
    wind: Annotated[
        str, typer.Option(help="As of fowt simulate --help.")
    ] = '{"kind": "eog", "speed": 18, "class": "B", "start": 200}',
    sea: Annotated[str, typer.Option(help="As of fowt simulate --help.")] = "jonswap:4:10",
    seed: Annotated[int, typer.Option(help="Seed of the waves.")] = 1,
    start: Annotated[float, typer.Option(help="First second that is shown.")] = 190.0,
    end: Annotated[float, typer.Option(help="Last second, where the runs end.")] = 280.0,
    fidelity: Annotated[str, typer.Option(help="reference, standard or fast.")] = "standard",
):
    """One picture of a gust under several controllers."""
    import fowt_env
    from fowt_env.training.reports.score_plots import plot_gust

    output(plot, "PLOT")
    names = list(dict.fromkeys(_names(controllers)))
    if not 0.0 <= start < end:
        raise InputError(f"start = {start:g} s: must be 0 or more and below end = {end:g} s")
    scene = fowt_env.build_scene(
        wind=parse_wind(wind), sea=parse_sea(sea), seed=seed, fidelity=fidelity, duration=max(700.0, end)
    )
    runs = {}
    with progress_bar("simulating", len(names)) as update:
        for number, name in enumerate(names, 1):
            runs[name] = fowt_env.simulate(scene, controller=name, duration=end)
            update(number, name)
    plot_gust(runs, plot, start=start, end=end)
    note(f"wrote {plot}")
