"""Implements fowt connect fmu: the plant as an FMU for co-simulation."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fowt_env.descriptions.sea_state import sea_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.arguments import parse_fault, parse_pairs, parse_protection
from fowt_env.training.cli.console import command, connect, note, output, wrote
from fowt_env.training.cli.simulate import FAULT, INITIAL, LEAST_WAVES, PROTECTION, REPEATED


@command(connect)
def fmu(
    platform: Annotated[str, Argument(help="Platform: a name or the path of a TOML file.")],
    out_path: Annotated[str, Argument(metavar="OUT.fmu", help="FMU to write.")],
    wind: shared.WindOption = "18",
    sea: shared.SeaOption = "none",
    duration: Annotated[float, Option(help="Longest run, s.")] = 600.0,
    control_dt: Annotated[float, Option(help="Control period, s: the communication step.")] = 0.1,
    dt: Annotated[float | None, Option(help="Physics time step, s; default: at most the period.")] = None,
    seed: Annotated[int, Option(help="Seed of wind and waves.")] = 0,
    fidelity: shared.FidelityOption = "standard",
    start: Annotated[str, Option(help="trim (steady state at the mean wind) or zero.")] = "trim",
    initial: Annotated[REPEATED, Option(metavar="CHANNEL=VALUE", help=INITIAL)] = None,
    fault: Annotated[REPEATED, Option(metavar="KIND:TIME or JSON", help=FAULT)] = None,
    protection: Annotated[str, Option(help=PROTECTION)] = "none",
    option: shared.OptionOption = None,
):
    """Write the plant as an FMU for co-simulation (FMI 2.0).

    For Simulink, OpenModelica, FMPy and others. Inputs are the commands of generator torque and blade pitch,
    outputs all channels, in OpenFAST's units. The host needs this Python with fowt_env: docs, Hardware in the
    loop.

    Examples:
    fowt connect fmu oc3_hywind plant.fmu --wind ntm:18:B --sea jonswap:7.5:10:3.3
    fowt connect fmu iea15_volturnus_s plant.fmu --control-dt 0.05 --option pitch=individual
    """
    from fowt_env.realtime.fmu import write_fmu

    output(out_path, option="OUT.fmu")
    scene = {"platform": _absolute(platform), "wind": wind_of(_absolute(wind)), "sea": sea_of(_absolute(sea))}
    scene |= {"duration": max(LEAST_WAVES, duration), "seed": seed, "fidelity": fidelity}
    run = {"duration": duration, "control_dt": control_dt, "dt": dt}
    run["initial"] = {"start": start} | parse_pairs(initial, "initial")
    run["protection"] = parse_protection(protection)
    run["faults"] = [parse_fault(text) for text in fault or ()]
    wrote(write_fmu(out_path, scene | parse_pairs(option, "option"), run))
    note(f"communication step {control_dt:g} s, or whole multiples of it")


def _absolute(text):
    """Return the absolute path of a text that names a file, any other text unchanged."""
    return str(Path(text).resolve()) if Path(text).is_file() else text
