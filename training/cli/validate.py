"""fowt validate and paper: the model held against OpenFAST, and the source paper's load cases."""

from typing import Annotated

import typer
from rich.markup import escape

from fowt_env.errors import unknown
from fowt_env.training.cli.console import (
    app,
    from_a_clone,
    note,
    out,
    output,
    progress_bar,
    reported,
)
from fowt_env.training.cli.evaluate import _places
from fowt_env.training.cli.tables import figure, print_table

VALIDATE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt validate --case decays,steady[/cyan]  # the quick ones

[cyan]fowt validate[/cyan]  # every figure against OpenFAST

[cyan]fowt validate --platform iea15_volturnus_s[/cyan]  # another platform's

[cyan]fowt validate --case all --bts turbsim_18mps.bts[/cyan]  # with the cheaper choices, from the full box

[bold]Files written[/bold]: validation.csv and validation.md (every figure with its verdict), and plots."""


@app.command(epilog=VALIDATE_EXAMPLES)
@reported
def validate(
    platform: Annotated[
        str,
        typer.Option(
            help="oc3_hywind, iea15_volturnus_s, nrel5mw_iti_barge or nrel5mw_oc4_semi: what each is compared"
            " with is in docs/results/validation.md."
        ),
    ] = "oc3_hywind",
    case: Annotated[
        str | None,
        typer.Option(
            help="Groups of figures, comma-separated; or all. Those of oc3_hywind: decays, steady, floating,"
            " waves, steps, turbulence, tower, costs. Default: all but costs."
        ),
    ] = None,
    out_folder: Annotated[
        str | None,
        typer.Option(
            "--out",
            help="Folder for what is written; default: results/validation and, but for OC3, the platform.",
        ),
    ] = None,
    reference: Annotated[str | None, typer.Option(help="Folder of the OpenFAST series.")] = None,
    bts: Annotated[str | None, typer.Option(help="Full TurbSim box instead of the stored region.")] = None,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plots.")] = True,
):
    """Compare the plant with OpenFAST (from a clone).

    The same cases in both: every figure with its verdict, and plots.
    """
    from fowt_env.training.validation.report import write_validation_report
    from fowt_env.training.validation.validate import PLATFORMS, validate_cases

    if platform not in PLATFORMS:
        raise unknown("platform of a validation", platform, PLATFORMS)
    names = None if case is None else [name.strip() for name in case.split(",") if name.strip()]
    if case == "all":
        names = list(PLATFORMS[platform]()[0])
    if out_folder is None:
        out_folder = "results/validation" + ("" if platform == "oc3_hywind" else f"/{platform}")
    output(out_folder, folder=True)
    with progress_bar("validating", None) as update:
        study = validate_cases(
            names,
            folder=reference,
            bts=bts,
            report=lambda text, done, total: update(done, f"validating: {text}", total),
            platform=platform,
        )
    lines, missed = [], []
    for name, rows in study.table().groupby("case", sort=False):
        counts = [int((rows["verdict"] == verdict).sum()) for verdict in ("met", "MISSED", "reported")]
        lines.append((name, str(len(rows)), *map(str, counts)))
        missed.append(counts[1])
    headings = ("case", "figures", "met", "missed", "reported")
    print_table(out, headings, lines, platform, red=_places(missed))
    for row in study.rows:
        if row.verdict == "MISSED":
            text = f"{row.case}: {row.quantity}: {row.error:.3g} %, allowed {row.allowed:g} %"
            out.print(f"[red]missed[/red]  {escape(text)}", highlight=False, soft_wrap=True)
    note("wrote " + ", ".join(str(path) for path in write_validation_report(study, out_folder, plot)))


PAPER_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt paper LC5[/cyan]  # one load case of the 1:50 model

[cyan]fowt paper all[/cyan]  # LC1 to LC12 with the paper's claims checked

[cyan]fowt paper full_scale[/cyan]  # decays, regular wave, wind and waves at full scale

[bold]Files written[/bold]: runs/CASE.parquet, statistics.csv, paper.md (claims and tables), and plots."""


@app.command(epilog=PAPER_EXAMPLES)
@reported
def paper(
    case: Annotated[str, typer.Argument(help="LC1 to LC12, comma-separated; all; or full_scale.")] = "all",
    out_folder: Annotated[str, typer.Option("--out", help="Folder for what is written.")] = "results/paper",
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Make the plots.")] = True,
):
    """Run the source paper's load cases (from a clone).

    And check its claims.
    """
    with from_a_clone("paper"):
        from fowt_env.training.studies.paper.load_cases import run_paper, statistics, wanted_cases
        from fowt_env.training.studies.paper.report import write_paper_report

    output(out_folder, folder=True)
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
