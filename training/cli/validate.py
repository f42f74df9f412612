"""Implements fowt dev validate and fowt dev paper: comparison with OpenFAST, cases of the source paper."""

from typing import Annotated

from rich.markup import escape
from typer import Argument, Option

from fowt_env.errors import unknown
from fowt_env.training.cli.arguments import parse_names
from fowt_env.training.cli.console import command, dev, from_a_clone, out, text_progress, wrote
from fowt_env.training.cli.options import FolderOption, PlotsOption
from fowt_env.training.cli.tables import print_table

PLATFORM = "Platform: oc3_hywind, iea15_volturnus_s, nrel5mw_iti_barge or nrel5mw_oc4_semi."
CASE = "Groups of comparisons in docs/results/validation.md, comma-separated, or all. Default: all but costs."
FOLDER = "Output folder; default: results/validation, or its subfolder PLATFORM if not OC3."


@command(dev)
def validate(
    platform: Annotated[str, Option(help=PLATFORM)] = "oc3_hywind",
    case: Annotated[str | None, Option(help=CASE)] = None,
    out_folder: Annotated[str | None, Option("--out", help=FOLDER)] = None,
    reference: Annotated[str | None, Option(help="Folder of the OpenFAST time series.")] = None,
    bts: Annotated[str | None, Option(help="Full TurbSim box instead of the stored region.")] = None,
    plot: PlotsOption = True,
):
    """Compare the plant with OpenFAST (from a clone).

    Simulates the cases of stored OpenFAST runs, prints a verdict on every quantity and writes plots.

    Examples:
    fowt dev validate --case decays,steady  # quick comparisons
    fowt dev validate  # every comparison with OpenFAST
    fowt dev validate --platform iea15_volturnus_s  # another platform
    fowt dev validate --case all --bts turbsim_18mps.bts  # also the cheaper model options, and the full box

    [bold]Files written[/bold]: validation.csv and validation.md (every quantity with its verdict), and plots.
    """
    from fowt_env.training.validation.report import write_validation_report
    from fowt_env.training.validation.validate import PLATFORMS, validate_cases

    if platform not in PLATFORMS:
        raise unknown("platform of a validation", platform, PLATFORMS)
    names = list(PLATFORMS[platform]()[0]) if case == "all" else parse_names(case)
    if out_folder is None:
        out_folder = "results/validation" + ("" if platform == "oc3_hywind" else f"/{platform}")
    with text_progress("validating", "validating: ") as report:
        study = validate_cases(names, folder=reference, bts=bts, report=report, platform=platform)
    lines = []
    for name, rows in study.table().groupby("case", sort=False):
        counts = [int((rows["verdict"] == verdict).sum()) for verdict in ("met", "MISSED", "reported")]
        lines.append((name, len(rows), *counts))
    missed = [number for number, line in enumerate(lines) if line[3]]
    print_table(("case", "quantities", "met", "missed", "reported"), lines, platform, red=missed)
    for row in study.rows:
        if row.verdict == "MISSED":
            text = f"{row.case}: {row.quantity}: {row.error:.3g} %, allowed {row.allowed:g} %"
            out.print(f"[red]missed[/red]  {escape(text)}")
    wrote(*write_validation_report(study, out_folder, plot))


@command(dev)
def paper(
    case: Annotated[str, Argument(help="LC1 to LC12, comma-separated; all; or full_scale.")] = "all",
    out_folder: FolderOption = "results/paper",
    plot: PlotsOption = True,
):
    """Run the source paper's load cases (from a clone).

    Also checks the results against the claims of the paper.

    Examples:
    fowt dev paper LC5  # one load case of the 1:50 model
    fowt dev paper all  # LC1 to LC12 with the paper's claims checked
    fowt dev paper full_scale  # decays, regular wave, wind and waves at full scale

    [bold]Files written[/bold]: runs/CASE.parquet, statistics.csv, paper.md (claims and tables), and plots.
    """
    with from_a_clone("paper"):
        from fowt_env.training.studies.paper.load_cases import run_paper, statistics, wanted_cases
        from fowt_env.training.studies.paper.report import write_paper_report

    names = wanted_cases(case)
    with text_progress("paper", "paper: ") as report:
        study = run_paper(names, report)
    if study.runs:
        values, names = statistics(study.runs), ["case", "channel", "mean", "std", "min", "max"]
        rows = values[values["channel"].isin(("PtfmSurge_[m]", "PtfmPitch_[deg]"))][names]
        rows = rows.assign(channel=rows["channel"].str.replace("_", " ")).itertuples(index=False)
        print_table(names, rows, "model scale", keys=2, left=(0, 1))
    for claim in study.claims:
        verdict = "[green]holds[/green]" if claim.holds else "[red]FAILS[/red]"
        out.print(f"{verdict}  {escape(f'Fig. {claim.figure}: {claim.text}: {claim.found}')}")
    wrote(*write_paper_report(study, out_folder, plot))
