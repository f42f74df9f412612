"""Implements fowt connect check-dll: what a library with the Bladed interface reads and demands."""

from typing import Annotated

import typer
from rich.markup import escape
from typer import Argument, Option

from fowt_env.training.cli.console import EXIT_STOPPED, command, connect, note, out
from fowt_env.training.cli.tables import print_table

DEGREES = 57.29577951308232  # in a radian


@command(connect)
def check_dll(
    library: Annotated[str, Argument(metavar="PATH[,INPUT_FILE]", help="Library, as after dll: in a name.")],
    turbine: Annotated[str, Option(help="Turbine whose values the library is given: name or TOML file.")] = (
        "nrel5mw"
    ),
    control_dt: Annotated[float, Option(help="Time between two calls, s.")] = 0.1,
):
    """Check a controller library (Bladed DISCON).

    Runs the library in a process of its own on a series of an operating point, without a plant, and prints
    the records that it reads and writes, its demands, its messages and the time of a call. The library's code
    runs with your rights: check only libraries that you trust.

    Examples:
    fowt connect check-dll libdiscon.so,DISCON.IN  # records, demands, messages, time of a call
    fowt connect check-dll discon.so,symbol=discon,pitch=individual  # a demand to each blade
    fowt simulate --controller dll:libdiscon.so,DISCON.IN --wind ntm:18:B  # then run it

    [bold]Exit code[/bold]: 0 if the library can be used, 1 if not, 2 if it cannot be loaded here.
    """
    from fowt_env.control import check_control_dt
    from fowt_env.controllers.bladed import check
    from fowt_env.controllers.bladed.controller import named_library
    from fowt_env.descriptions.turbine import read_turbine

    chosen = named_library(f"dll:{library}")
    result = check.check_dll(chosen, read_turbine(turbine), check_control_dt(control_dt), note)
    rows = [("turbine", f"{turbine} (--turbine)"), *_rows(chosen, result)]
    print_table(("library", "result"), rows, library, left=(0, 1))
    for title, records in (("reads", result.read), ("writes", result.written)):
        rows = [(record.number, record.name, record.unit, record.meaning) for record in records]
        if rows:
            print_table(("record", "name", "unit", "meaning"), rows, f"{title} these records", left=(1, 2, 3))
    if result.output:
        note(f"the library says:\n{result.output}")
    for fault in result.faults:
        out.print(f"[red]{escape(fault)}[/red]")
    if result.faults:
        raise typer.Exit(EXIT_STOPPED)
    out.print("[green]usable: the same demands in two runs, also of two libraries at once[/green]")


def _rows(library, result):
    """Return (what, value) of a DllCheck."""
    exported = [name for name in result.exported if name != library.symbol]
    others = f" and {len(exported)} other functions" if exported else ""
    rows = [("file", "64-bit shared library"), ("exports", f"{library.symbol}{others}")]
    if result.torque is not None:
        low, high = (1e-3 * value for value in result.torque)
        rows.append(("demanded torque", f"{low:.3f} to {high:.3f} kN m"))
        low, high = (DEGREES * value for value in result.pitch)
        rows.append(("demanded pitch", f"{low:.3f} to {high:.3f} deg"))
        rows.append(("loading and first call", f"{1e3 * result.start:.0f} ms"))
        rows.append(("time of a call", f"{1e6 * result.call:.0f} us, at most {1e6 * result.slowest:.0f} us"))
    for what, numbers in (
        ("overwrites inputs", [f"{record.number} {record.name}" for record in result.overwritten]),
        ("writes records without a name", result.unnamed),
    ):
        if numbers:
            rows.append((what, ", ".join(map(str, numbers))))
    return rows
