"""Implements fowt model hydro: computes potential-flow coefficients of a hull from its panel mesh."""

from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Argument, Option

from fowt_env.descriptions.checks import check_number, parse_numbers
from fowt_env.training.cli.console import command, model, output, text_progress, wrote
from fowt_env.training.cli.options import RANGE
from fowt_env.training.cli.tables import print_table


@command(model)
def hydro(
    mesh: Annotated[Path, Argument(help="Panel mesh in metres, z up from still water, normals outward.")],
    depth: Annotated[float, Option(help="Water depth, m.")],
    out_file: Annotated[Path, Option("--out", help="Output coefficients (.npz).")] = Path("hydro.npz"),
    omega: Annotated[str, Option(help=f"Frequencies, rad/s: {RANGE}.")] = "0.05:3:0.05",
    heading: Annotated[str, Option(help=f"Wave directions (of travel), deg: {RANGE}.")] = "-180:180:30",
    density: Annotated[float, Option(help="Water density, kg/m3.")] = 1025.0,
    gravity: Annotated[float, Option(help="Gravitational acceleration, m/s2.")] = 9.80665,
    lid: Annotated[bool, Option("--lid/--no-lid", help="Close the interior water plane with a lid.")] = True,
):
    """Compute wave loads of a hull from its panel mesh.

    Capytaine solves for added mass, damping, wave excitation and hydrostatics.

    Examples:
    fowt model hydro semi.gdf --depth 200 --out hydro.npz  # 0.05 to 3 rad/s, waves from -180 to 180 deg
    fowt model hydro spar.stl --depth 320 --omega 0.1:2.5:0.1 --heading 0  # fewer frequencies and headings

    In the platform file: \\[potential_flow] coefficients = "hydro.npz" and displaced_volume, which is
    printed. A boundary-value problem with 3000 panels takes a second; each frequency has six and one per
    heading. A lid on the interior water plane removes irregular frequencies.
    """
    from fowt_env.analysis.panel_method import solve_mesh
    from fowt_env.descriptions.potential_flow import coefficient_arrays
    from fowt_env.files.atomic import replacing

    output(out_file, endings=(".npz",))
    check_number("--depth", depth, 0.0, low_open=True)
    with text_progress("solving", "solving: ") as report:
        body = solve_mesh(
            mesh,
            parse_numbers(omega, "--omega"),
            np.radians(parse_numbers(heading, "--heading")),
            water_depth=depth,
            water_density=check_number("--density", density, 0.0, low_open=True),
            gravity=check_number("--gravity", gravity, 0.0, low_open=True),
            lid=lid,
            report=report,
        )
    with replacing(out_file) as path, path.open("wb") as file:
        np.savez_compressed(file, **coefficient_arrays(body))
    added = ((0, "surge", "kg"), (2, "heave", "kg"), (4, "platform pitch", "kg m2"))
    rows = [
        ("displaced_volume", f"{body.volume:.6g}", "m3"),
        ("centre_of_buoyancy", f"{body.centre_of_buoyancy[0]:.4g}, {body.centre_of_buoyancy[1]:.4g}", "m"),
        ("draft", body.draft, "m"),
        ("stiffness in heave", f"{body.stiffness[2, 2]:.5g}", "N/m"),
    ]
    for i, name, unit in added:
        rows.append(
            (f"added mass {name} at infinite frequency", f"{body.added_mass_infinite[i, i]:.5g}", unit)
        )
    print_table(("quantity", "value", "unit"), rows)
    wrote(out_file)
