"""Implements fowt model check: a platform at rest, and contradictions in its file."""

import json
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape
from typer import Argument, Option

from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.console import EXIT_STOPPED, command, model, out
from fowt_env.training.cli.options import OptionOption
from fowt_env.training.cli.tables import print_table

SETTLED = 1e-8  # m or deg: what the search for rest leaves of a displacement that is zero
SPEEDS = ("at rest", "at rated speed")  # of a check.RotorFrequency


@command(model)
def check(
    platform: Annotated[str, Argument(help="Platform: a built-in name or the path of a TOML file.")],
    option: OptionOption = None,
    as_json: Annotated[bool, Option("--json", help="Print JSON in SI units and degrees.")] = False,
):
    """Check a platform: weight, stability, natural periods.

    Prints the platform at rest without wind, and contradictions in the platform file.

    Examples:
    fowt model check mine.toml  # weight against buoyancy, stability, pretension, rest, natural periods
    fowt model check oc3_hywind --json  # the same as JSON

    [bold]Exit code[/bold]: 0 if the platform is consistent, 1 if not, 2 if the file cannot be read.
    """
    from fowt_env.analysis.check import check_platform

    result = check_platform(platform, **parse_pairs(option, "option"))
    if as_json:
        out.print_json(json.dumps(_plain(result)))
    else:
        print_table(("at rest", "value", "unit"), _rows(result), str(platform), left=(0, 2))
        print_faults(result.faults)
    if result.faults:
        raise typer.Exit(EXIT_STOPPED)


def print_faults(faults):
    """Print the contradictions in a platform file, or that none were found."""
    for fault in faults:
        out.print(f"[yellow]{escape(fault)}[/yellow]")
    if not faults:
        out.print("[green]no contradictions found[/green]")


def _rows(result):
    """Return (name, value, unit) of the values of a Check."""
    still = result.statics
    rows = [
        ("weight", still.weight / 1e3, "kN"),
        ("buoyancy", still.buoyancy / 1e3, "kN"),
        ("displaced volume", still.volume, "m3"),
        ("mooring force, downwards", still.pull / 1e3, "kN"),
        ("buoyancy minus weight and mooring force", (still.buoyancy - still.weight - still.pull) / 1e3, "kN"),
        ("draft", result.draft, "m"),
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
    settled = {motion: x if abs(x) > SETTLED else 0.0 for motion, x in (result.rest or {}).items()}
    rows += [(f"rest, {motion}", x, units.get(motion, "deg")) for motion, x in settled.items()]
    rows += [(f"natural period, {motion}", period, "s") for motion, period in (result.periods or {}).items()]
    for mode, values in result.tower.items():
        rows += [(f"tower, {mode}, {base}", value, "Hz") for base, value in values._asdict().items()]
    for mode, values in result.rotor.items():
        rows += [(f"{mode}, {speed}", value, "Hz") for speed, value in zip(SPEEDS, values, strict=True)]
    return [row for row in rows if not np.isnan(row[1])]


def _plain(result):
    """Return a Check as a mapping for JSON, with None for values that are not finite."""
    from fowt_env.training.evaluation.results import finite

    still = {name: np.asarray(value).tolist() for name, value in result.statics._asdict().items()}
    tower = {mode: values._asdict() for mode, values in result.tower.items()}
    rest = {"rest": result.rest, "natural_periods": result.periods, "tower_frequencies": tower}
    rest["rotor_frequencies"] = {mode: values._asdict() for mode, values in result.rotor.items()}
    return finite(
        {"platform": result.label, "draft": result.draft, **still, **rest, "faults": list(result.faults)}
    )
