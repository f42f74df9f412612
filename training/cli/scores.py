"""Implements fowt dev scores: agents relative to baselines and to the performance limit, gusts and faults."""

from typing import Annotated

from typer import Argument, Option

from fowt_env.errors import InputError
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.arguments import parse_names
from fowt_env.training.cli.console import add_group, command, dev, out, output, progress_bar, wrote

scores = add_group("scores", "Compare agents with baselines, from saved evaluations.", dev)
FoldersArgument = Annotated[
    list[str], Argument(metavar="RESULTS...", help="Output folders or results.csv files of fowt evaluate.")
]
GroupOption = Annotated[
    list[str] | None,
    Option(metavar="NAME=LABEL,LABEL", help="Training seeds of one agent; repeatable."),
]
AgentsOption = Annotated[str | None, Option(help="Controllers to score; default: all but the baselines.")]
CasesOption = Annotated[str | None, Option(help="Cases to score, comma-separated; default: all.")]
OutOption = Annotated[str | None, Option("--out", metavar="STEM", help="Write STEM.md and tables STEM*.csv.")]
LIMIT = "Performance limit: CSV of fowt design bound; default: the package's."
FIGURES = (
    "rotor-speed std,platform-pitch std,blade-pitch travel,power std,torque travel,shaft-torque DEL,"
    "tower-base DEL"
)
GUST = '{"kind": "eog", "speed": 18, "class": "B", "start": 200}'


def _groups(texts):
    """Return {name: labels} from the texts of --group. Raises: InputError."""
    groups = {}
    for text in texts or ():
        name, equals, labels = text.partition("=")
        if not (name.strip() and equals and parse_names(labels)):
            raise InputError(f"--group {text!r}: must be NAME=LABEL,LABEL")
        if name.strip() in groups:
            raise InputError(f"--group {text!r}: the name is used twice")
        groups[name.strip()] = parse_names(labels)
    return groups


def _runs(results, cases):
    """Return the table of the runs that are scored. Raises: InputError."""
    from fowt_env.training.evaluation.metrics import METRICS
    from fowt_env.training.evaluation.results_table import read_results

    return read_results(results, METRICS, parse_names(cases), parked=False)


def _shown(text, out_path, ratios, counts=None):
    """Print the markdown text; with a path, also write the text and the tables."""
    from fowt_env.training.reports.scores import write_scores

    out.print(text, markup=False)
    if out_path is not None:
        tables = {"": ratios} if counts is None else {"": ratios, "counts": counts}
        wrote(*write_scores(tables, text, out_path))


@command(scores)
def baselines_command(
    results: FoldersArgument,
    against: Annotated[str, Option(help="Baselines, comma-separated.")] = "gspi_oc3,rosco_float",
    group: GroupOption = None,
    agents: AgentsOption = None,
    cases: CasesOption = None,
    out_path: OutOption = None,
):
    """Score agents against baselines, with a verdict on each target.

    Examples:
    fowt evaluate --controllers policy:ppo_lqr,gspi_oc3,rosco_float --out results/rl
    fowt dev scores baselines results/rl --against gspi_oc3,rosco_float --out results/rl/scores
    fowt dev scores baselines results/rl --group agents=policy:ppo_lqr,policy:runs/mine/best.npz

    Each cell: ratio of lifetime means on the same runs, its 95 % interval, and a verdict against the targets:
    missed, first, then (or met), with * if significant (p at most 0.05 after Holm's correction for all
    targets). A lost run counts ten times the baseline's metrics of the same case and seed.
    """
    from fowt_env.training.reports.scores import agent_counts, agent_scores, scores_markdown

    table = _runs(results, cases)
    chosen = parse_names(against), _groups(group), parse_names(agents)
    ratios, counts = agent_scores(table, *chosen), agent_counts(table, *chosen)
    _shown(scores_markdown(ratios, counts), out_path, ratios, counts)


@command(scores)
def cases_command(
    results: FoldersArgument,
    against: Annotated[str, Option(help="Baseline controller.")] = "gspi_oc3",
    group: GroupOption = None,
    agents: AgentsOption = None,
    cases: CasesOption = None,
    figures: Annotated[str, Option(help="Metrics (short or full names), comma-separated.")] = FIGURES,
    each: Annotated[bool, Option("--each", help="Write a row per case instead of per kind of wind.")] = False,
    out_path: OutOption = None,
):
    """Score agents against one baseline on each kind of case.

    All winds of a kind are pooled; failed runs are counted.

    Examples:
    fowt evaluate --suite shifted --controllers policy:ppo_lqr,gspi_oc3 --out results/shifted
    fowt dev scores cases results/gusts --figures "RotSpeed_max_[rpm],PtfmPitch_max_[deg]"  # any metric
    fowt dev scores cases results/sea_states --each  # one row per sea state
    """
    from fowt_env.training.reports.scores import by_kind, figures_named, kinds_markdown

    table, chosen = _runs(results, cases), figures_named(parse_names(figures))
    ratios, counts = by_kind(table, against, _groups(group), parse_names(agents), chosen, each)
    _shown(kinds_markdown(ratios, counts), out_path, ratios, counts)


@command(scores)
def bound(
    results: FoldersArgument,
    group: GroupOption = None,
    agents: AgentsOption = None,
    cases: CasesOption = None,
    table_path: Annotated[str | None, Option("--bound", help=LIMIT)] = None,
    plot: shared.PlotOption = None,
    out_path: OutOption = None,
):
    """Score controllers against the limit of linear control.

    Examples:
    fowt dev scores bound results/rl --plot results/rl/bound.png --out results/rl/bound

    Values in brackets: more blade-pitch travel or power deviation than gspi_oc3, which the limit excludes.
    """
    from fowt_env.training.reports.bound_scores import bound_fractions, bound_markdown, read_bound
    from fowt_env.training.reports.score_plots import plot_fractions

    fronts = read_bound(table_path)
    fractions = bound_fractions(_runs(results, cases), fronts, _groups(group), parse_names(agents))
    _shown(bound_markdown(fractions), out_path, fractions)
    if plot is not None:
        plot_fractions(fractions, fronts, plot)
    wrote(plot)


@command(scores)
def faults(results: FoldersArgument, cases: CasesOption = None, out_path: OutOption = None):
    """Show which controllers survive which faults.

    Also shows the largest motions and loads, and trips.

    Examples:
    fowt evaluate --suite faults --controllers pi,gspi_oc3,rosco_float,lqr --out results/faults
    fowt dev scores faults results/faults

    Survived: no capsize, blow-up or error, and within the suite's limits. A trip is not a failure here.
    """
    from fowt_env.training.reports.survival import survival, survival_markdown

    rates = survival(_runs(results, cases))
    _shown(survival_markdown(rates), out_path, rates)


@command(scores)
def gust(
    image: Annotated[str, Argument(help="Output image.")],
    controllers: Annotated[str, Option(help="Controllers, comma-separated.")] = "gspi_oc3,rosco_float,lqr",
    wind: shared.WindOption = GUST,
    sea: shared.SeaOption = "jonswap:4:10",
    seed: Annotated[int, Option(help="Seed of the waves.")] = 1,
    start: Annotated[float, Option(help="Start of the time axis, s.")] = 190.0,
    end: Annotated[float, Option(help="End of the time axis and of the runs, s.")] = 280.0,
    fidelity: shared.FidelityOption = "standard",
):
    """Plot a gust under several controllers.

    Examples:
    fowt dev scores gust gust.png --controllers pi,gspi_oc3,rosco_float,lqr,policy:ppo_lqr
    """
    from fowt_env.training.cli.simulate import compared_runs
    from fowt_env.training.reports.score_plots import plot_gust

    output(image, "IMAGE")
    if not 0.0 <= start < end:
        raise InputError(f"start = {start:g} s: must be 0 or more and below end = {end:g} s")
    with progress_bar("simulating") as update:
        options = {"wind": wind, "sea": sea, "seed": seed, "fidelity": fidelity}
        _, runs = compared_runs(controllers, end, update, **options)
    plot_gust(runs, image, start=start, end=end)
    wrote(image)
