"""Implements fowt import: converts an OpenFAST deck to a platform file."""

from typing import Annotated

import typer
from rich.markup import escape
from typer import Argument, Option

from fowt_env.errors import InputError
from fowt_env.training.cli.check import print_faults
from fowt_env.training.cli.console import EXIT_STOPPED, command, note, out
from fowt_env.training.cli.tables import print_table

Part = Annotated[str | None, Option(help="Part file used instead of the one named in the .fst.")]
PARTS = ("elastodyn", "aerodyn", "servodyn", "hydrodyn", "seastate", "mooring", "inflow")


@command()
def import_command(
    deck: Annotated[str | None, Argument(help="The .fst file; optional with part files.")] = None,
    out_folder: Annotated[str, Option("--out", help="Output folder, created if missing.")] = "imported",
    name: Annotated[str | None, Option(help="Name of platform and turbine; default: that of --out.")] = None,
    elastodyn: Part = None,
    aerodyn: Part = None,
    servodyn: Part = None,
    hydrodyn: Part = None,
    seastate: Part = None,
    mooring: Part = None,
    inflow: Part = None,
    discon: Annotated[str | None, Option(help="ROSCO DISCON.IN, used instead of the deck's.")] = None,
    search: Annotated[list[str] | None, Option(help="Further folder to search; repeatable.")] = None,
    overwrite: Annotated[bool, Option(help="Replace the files of an earlier import.")] = False,
    check: Annotated[bool, Option(help="Check the platform at rest, as fowt model check does.")] = True,
) -> None:
    """Convert an OpenFAST or FAST 8 deck to a platform file.

    Examples:
    fowt import deck/5MW_OC4Semi.fst --out my_semi  # platform.toml, turbine, coefficients and report.md
    fowt import deck.fst --out mine --discon tuned_DISCON.IN  # with other controller settings
    fowt import --elastodyn ED.dat --aerodyn AD.dat --hydrodyn HD.dat --mooring MAP.dat --out mine  # no .fst
    fowt simulate --platform my_semi/platform.toml --wind 14  # simulate the imported platform

    docs/guides/import.md lists what is read, approximated and refused.

    [bold]Exit code[/bold]: 0 if the imported platform is consistent, 1 if it is written but has
    contradictions (see fowt model check), 2 if the deck cannot be imported.
    """
    from fowt_env.analysis.check import check_platform
    from fowt_env.files.openfast_deck.importer import import_deck

    files = (elastodyn, aerodyn, servodyn, hydrodyn, seastate, mooring, inflow)
    parts = dict(zip(PARTS, files, strict=True))
    if deck is None and not any(parts.values()):
        raise InputError(
            "fowt import: needs an .fst file, or part files such as --elastodyn, --aerodyn, --hydrodyn"
        )
    report = import_deck(
        deck, out_folder, parts=parts, search=search or (), discon=discon, name=name, replace_files=overwrite
    )
    print_table(("quantity", "value"), report.figures, report.title, left=(0, 1))
    out.print()
    for columns, rows, title in (
        (("in the deck", "here"), report.differences, "Differences from the deck"),
        (("the deck", "consequence"), report.contradictions, "Contradictions in the deck"),
    ):
        if rows:
            print_table(columns, rows, title, left=(0, 1), prose=(0, 1))
            out.print()
    for line in report.suggestions:
        out.print(escape(line))
    platform = f"{out_folder}/platform.toml"
    note(f"wrote {platform}, turbine/ and report.md")
    if check:
        try:
            faults = check_platform(platform).faults
        except InputError as error:
            faults = (f"The platform cannot be checked: {error}",)
        print_faults(faults)
        if faults:
            note(f"the files are kept; for details: fowt model check {platform}")
            raise typer.Exit(EXIT_STOPPED)
    note(f"next: fowt simulate --platform {platform} --wind 14")
