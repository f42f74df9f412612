"""Implements fowt model table: power, thrust, tilt and surge over wind and sea, for tools of wind farms."""

from typing import Annotated

from typer import Argument, Option

from fowt_env.descriptions.checks import parse_numbers
from fowt_env.display import number_text
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.console import command, model, output, progress_bar, wrote
from fowt_env.training.cli.simulate import CONTROLLER
from fowt_env.training.cli.tables import print_table


@command(model)
def table(
    platform: Annotated[str, Argument(help="Platform: a name from fowt list platforms or a TOML file.")],
    controller: Annotated[str, Option(help=CONTROLLER)] = "pi",
    winds: Annotated[str, Option(help=f"Mean winds at the hub, m/s: {shared.RANGE}.")] = "4:25:1",
    heights: Annotated[str, Option("--hs", help=f"Significant wave heights, m: {shared.RANGE}.")] = "0,2,4,6",
    periods: Annotated[str, Option("--tp", help=f"Peak periods, s: {shared.RANGE}.")] = "8,10,12",
    option: shared.OptionOption = None,
    seed: Annotated[int, Option(min=0, help="Seed of the waves.")] = 1,
    duration: Annotated[float, Option(help="Length of a run, s; its first third is left out.")] = 1200.0,
    folder: shared.FolderOption = "farm_table",
):
    """Tabulate power, thrust, tilt and surge over wind and sea, for FLORIS.

    Examples:
    fowt model table iea15_volturnus_s  # 22 winds, 4 wave heights, 3 periods: a turbine of FLORIS
    fowt model table oc3_hywind --controller lqr --winds 4:24:2 --hs 0,4 --tp 10 --out oc3

    Runs in steady wind and JONSWAP seas, means after the transient. FLORIS reads the folder by
    turbine_type: !include NAME.yaml and turbine_library_path, with multidim_conditions: {Tp: 10, Hs: 4}.
    """
    from fowt_env.training.loads.farm_table import performance_table, write_floris

    output(folder, "--out", folder=True)
    with progress_bar("simulating") as update:
        found = performance_table(
            platform,
            controller,
            parse_numbers(winds, "--winds"),
            parse_numbers(heights, "--hs"),
            parse_numbers(periods, "--tp"),
            seed=seed,
            duration=duration,
            options=parse_pairs(option, "--option"),
            progress=update,
        )
    paths = write_floris(folder, found)
    frame = found.frame
    least = frame[(frame["Tp_s"] == frame["Tp_s"].min()) & (frame["Hs_m"] == frame["Hs_m"].min())]
    columns = ["wind_m_s", "power_kW", "Cp", "Ct", "tilt_deg", "surge_m"]
    rows = [[number_text(value) for value in row] for row in least[columns].itertuples(index=False)]
    print_table(("wind (m/s)", "power (kW)", "Cp", "Ct", "tilt (deg)", "surge (m)"), rows)
    wrote(*paths)
