"""Implements fowt model campbell: natural frequencies of a flexible turbine over its rotor speed."""

from typing import Annotated

import numpy as np
from typer import Argument, Option

from fowt_env.descriptions.checks import parse_numbers
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.training.cli.console import command, model, output, save_table, wrote
from fowt_env.training.cli.options import RANGE, PlotOption, TableOption
from fowt_env.training.cli.tables import print_table

SHOWN = 5  # most rotor speeds in the printed table
HARMONICS = (1, 3, 6)
DEFAULT_STEPS = 24


@command(model)
def campbell(
    platform: Annotated[str, Argument(help="Platform: a built-in name or the path of a TOML file.")],
    speeds: Annotated[
        str | None, Option(help=f"Rotor speeds, rpm: {RANGE}; default: 0 to 1.2 times rated.")
    ] = None,
    pitch: Annotated[float, Option(help="Blade pitch, deg.")] = 0.0,
    blades: Annotated[str, Option(help="Blades: modes2, modes or rigid.")] = "modes2",
    tower: Annotated[str, Option(help="Tower: modes2, modes or rigid.")] = "modes2",
    shaft: Annotated[str, Option(help="Shaft: torsion or rigid.")] = "torsion",
    generator: Annotated[str, Option(help="Generator: free, or fixed to the mean rotation.")] = "free",
    out_path: TableOption = None,
    plot: PlotOption = None,
):
    """Compute natural frequencies over rotor speed.

    The Campbell diagram of a platform's turbine on a fixed base, in still air: modes of blades, tower and
    drivetrain.

    Examples:
    fowt model campbell iea15_volturnus_s --plot campbell.png  # 0 to 9.07 rpm, with lines at 1P, 3P and 6P
    fowt model campbell nrel5mw_oc4_semi --speeds 6.9:12.1:0.4 --pitch 5 --out campbell.csv
    fowt model campbell iea15_volturnus_s --tower rigid --generator fixed  # the rotor alone

    Frequencies are those in the fixed frame: the regressive and progressive mode of a rotor lie about one
    rotor frequency (1P) below and above that of the rotating blade. The platform file needs \\[tower.modes],
    the turbine file \\[blade_structure] and \\[shaft_torsion], unless the part is rigid.
    """
    import pandas as pd

    from fowt_env.analysis import campbell as analysis
    from fowt_env.descriptions.platform import read_platform, turbine_of
    from fowt_env.files.tables import TABLE_SUFFIXES

    output(out_path, endings=TABLE_SUFFIXES)
    described = read_platform(platform)
    turbine = turbine_of(described)
    rated = turbine.rated_rotor_speed
    at = np.linspace(0.0, 1.2 * rated, DEFAULT_STEPS + 1)
    if speeds is not None:
        at = RPM * np.array(parse_numbers(speeds, "--speeds"))
    found = analysis.campbell(
        described, turbine, at, blades=blades, tower=tower, shaft=shaft, generator=generator,
        blade_pitch=pitch * DEGREE,
    )  # fmt: skip
    rows = np.unique(np.linspace(0, len(at) - 1, SHOWN).round().astype(int))
    headings = ["mode", *(f"{at[i] / RPM:.4g} rpm\nHz" for i in rows), "damping\n%"]
    lines = [
        (mode, *(values[i] for i in rows), 100.0 * found.damping[mode][rows[-1]])
        for mode, values in found.frequency.items()
    ]
    title = f"{turbine.name} on the tower of {platform}, base fixed, blade pitch {pitch:g} deg"
    print_table(headings, lines, title)
    crossed = [
        (f"{harmonic}P", mode, speed / RPM)
        for harmonic in HARMONICS
        for mode, speed in found.crossings(harmonic)
    ]
    if crossed:
        print_table(("excitation", "excites", "at rpm"), crossed, "Resonances", left=(0, 1))
    columns = {"RotSpeed_[rpm]": at / RPM}
    for mode, values in found.frequency.items():
        columns |= {f"{mode}_[Hz]": values, f"{mode}, damping_[%]": 100.0 * found.damping[mode]}
    save_table(pd.DataFrame(columns), out_path)
    if plot is not None:
        from fowt_env.visual.response import plot_campbell

        plot_campbell(found, plot, title, harmonics=HARMONICS, rated_speed=rated)
    wrote(plot)
