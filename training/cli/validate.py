"""fowt validate and paper: comparison with OpenFAST, and the source paper's load cases."""

from typing import Annotated

from rich.markup import escape
from typer import Argument, Option

from fowt_env.errors import unknown
from fowt_env.training.cli.arguments import parse_names
from fowt_env.training.cli.console import command, from_a_clone, note, out, output, progress_bar, text_first
from fowt_env.training.cli.options import FolderOption, PlotsOption
from fowt_env.training.cli.tables import figure, print_table


@command()
def validate(
    platform: Annotated[
        str,
        Option(
            help="oc3_hywind, iea15_volturnus_s, nrel5mw_iti_barge or nrel5mw_oc4_semi;"
            " docs/results/validation.md lists the references of each."
        ),
    ] = "oc3_hywind",
    case: Annotated[
        str | None,
        Option(
            help="Groups of comparisons, comma-separated; or all. Those of oc3_hywind: decays, steady,"
            " floating, waves, steps, turbulence, tower, costs. Default: all except costs."
        ),
    ] = None,
    out_folder: Annotated[
        str | None,
        Option(
            "--out", help="Folder; default: results/validation, for others than OC3 its subfolder PLATFORM."
        ),
    ] = None,
    reference: Annotated[str | None, Option(help="Folder of the OpenFAST series.")] = None,
    bts: Annotated[str | None, Option(help="Full TurbSim box instead of the stored region.")] = None,
    plot: PlotsOption = True,
):
    """Compare the plant with OpenFAST (from a clone).

    Runs the same cases in both, prints a verdict on every quantity, and makes plots.

    Examples:
    fowt validate --case decays,steady  # the quick ones
    fowt validate  # every comparison with OpenFAST
    fowt validate --platform iea15_volturnus_s  # another platform
    fowt validate --case all --bts turbsim_18mps.bts  # with the cheaper model options, from the full box

    [bold]Files written[/bold]: validation.csv and validation.md (every quantity with its verdict), and plots.
    """
    from fowt_env.training.validation.report import write_validation_report
    from fowt_env.training.validation.validate import PLATFORMS, validate_cases

    if platform not in PLATFORMS:
        raise unknown("platform of a validation", platform, PLATFORMS)
    names = list(PLATFORMS[platform]()[0]) if case == "all" else parse_names(case)
    if out_folder is None:
        out_folder = "results/validation" + ("" if platform == "oc3_hywind" else f"/{platform}")
    output(out_folder, folder=True)
    with progress_bar("validating", None) as update:
        report = text_first(update, "validating: ")
        study = validate_cases(names, folder=reference, bts=bts, report=report, platform=platform)
    lines = []
    for name, rows in study.table().groupby("case", sort=False):
        counts = [int((rows["verdict"] == verdict).sum()) for verdict in ("met", "MISSED", "reported")]
        lines.append((name, str(len(rows)), *map(str, counts)))
    missed = [number for number, line in enumerate(lines) if line[3] != "0"]
    print_table(out, ("case", "figures", "met", "missed", "reported"), lines, platform, red=missed)
    for row in study.rows:
        if row.verdict == "MISSED":
            text = f"{row.case}: {row.quantity}: {row.error:.3g} %, allowed {row.allowed:g} %"
            out.print(f"[red]missed[/red]  {escape(text)}", highlight=False, soft_wrap=True)
    note("wrote " + ", ".join(str(path) for path in write_validation_report(study, out_folder, plot)))


@command()
def paper(
    case: Annotated[str, Argument(help="LC1 to LC12, comma-separated; all; or full_scale.")] = "all",
    out_folder: FolderOption = "results/paper",
    plot: PlotsOption = True,
):
    """Run the source paper's load cases (from a clone).

    Also checks the claims of the paper.

    Examples:
    fowt paper LC5  # one load case of the 1:50 model
    fowt paper all  # LC1 to LC12 with the paper's claims checked
    fowt paper full_scale  # decays, regular wave, wind and waves at full scale

    [bold]Files written[/bold]: runs/CASE.parquet, statistics.csv, paper.md (claims and tables), and plots.
    """
    with from_a_clone("paper"):
        from fowt_env.training.studies.paper.load_cases import run_paper, statistics, wanted_cases
        from fowt_env.training.studies.paper.report import write_paper_report

    output(out_folder, folder=True)
    names = wanted_cases(case)
    with progress_bar("paper", None) as update:
        study = run_paper(names, text_first(update, "paper: "))
    if study.runs:
        values, names = statistics(study.runs), ("mean", "std", "min", "max")
        rows = [
            (row["case"], row["channel"].replace("_", " "), *(figure(row[name]) for name in names))
            for row in values[values["channel"].isin(("PtfmSurge_[m]", "PtfmPitch_[deg]"))].to_dict("records")
        ]
        print_table(out, ("case", "channel", *names), rows, "model scale", keys=2, left=(0, 1))
    for claim in study.claims:
        verdict = "[green]holds[/green]" if claim.holds else "[red]FAILS[/red]"
        text = f"Fig. {claim.figure}: {claim.text}: {claim.found}"
        out.print(f"{verdict}  {escape(text)}", highlight=False, soft_wrap=True)
    note("wrote " + ", ".join(str(path) for path in write_paper_report(study, out_folder, plot)))
