"""fowt check: a platform at rest, and contradictions in its file."""

import json
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape
from typer import Argument, Option

from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.console import EXIT_STOPPED, command, out
from fowt_env.training.cli.options import OptionOption
from fowt_env.training.cli.tables import print_table


@command()
def check(
    platform: Annotated[str, Argument(help="A built-in name or a path to a TOML file.")],
    option: OptionOption = None,
    as_json: Annotated[bool, Option("--json", help="Print JSON in SI units and degrees.")] = False,
):
    """Check a platform: weight, stability, natural periods.

    Prints the platform at rest without wind, and what in its file is contradictory.

    Examples:
    fowt check mine.toml  # weight against buoyancy, stability, pretension, rest, natural periods
    fowt check oc3_hywind --json  # the same for a program

    [bold]Exit code[/bold]: 0 if everything fits, 1 if something does not, 2 if the file cannot be read.
    """
    from fowt_env.analysis.check import check_platform

    found = check_platform(platform, **parse_pairs(option, "option"))
    if as_json:
        out.print_json(json.dumps(_plain(found)))
    else:
        print_table(("at rest", "value", "unit"), _figures(found), str(platform), left=(0, 2))
        print_faults(found.faults)
    if found.faults:
        raise typer.Exit(EXIT_STOPPED)


def print_faults(faults):
    """Print the faults of a platform, or that there are none."""
    for fault in faults:
        out.print(f"[yellow]{escape(fault)}[/yellow]")
    if not faults:
        out.print("[green]everything fits[/green]")


def _figures(found):
    """Return (name, value, unit) of the values of a Check."""
    still = found.statics
    rows = [
        ("weight", still.weight / 1e3, "kN"),
        ("buoyancy", still.buoyancy / 1e3, "kN"),
        ("displaced volume", still.volume, "m3"),
        ("pull of the lines, downwards", still.pull / 1e3, "kN"),
        ("buoyancy less weight and pull", (still.buoyancy - still.weight - still.pull) / 1e3, "kN"),
        ("draft", found.draft, "m"),
        *(
            (f"centre of {what}, {axis}", value, "m")
            for what, centre in (("mass", still.mass_centre), ("buoyancy", still.buoyancy_centre))
            for axis, value in zip("xyz", centre, strict=True)
        ),
        ("metacentric height, roll", still.metacentric_height[0], "m"),
        ("metacentric height, pitch", still.metacentric_height[1], "m"),
        *((f"tension of line {i}", value / 1e3, "kN") for i, value in enumerate(still.tension, 1)),
    ]
    units = dict.fromkeys(("surge", "sway", "heave"), "m")
    rows += [(f"rest, {motion}", x, units.get(motion, "deg")) for motion, x in (found.rest or {}).items()]
    rows += [(f"natural period, {motion}", period, "s") for motion, period in (found.periods or {}).items()]
    for mode, values in found.tower.items():
        rows += [(f"tower, {mode}, {base}", value, "Hz") for base, value in values._asdict().items()]
    return [row for row in rows if not np.isnan(row[1])]


def _plain(found):
    """Return a Check as a mapping for JSON, with None for values that are not finite."""
    from fowt_env.training.evaluation.results import finite

    still = {name: np.asarray(value).tolist() for name, value in found.statics._asdict().items()}
    tower = {mode: values._asdict() for mode, values in found.tower.items()}
    rest = {"rest": found.rest, "natural_periods": found.periods, "tower_frequencies": tower}
    return finite(
        {"platform": found.label, "draft": found.draft, **still, **rest, "faults": list(found.faults)}
    )
