"""Implements fowt connect export: writes a controller as a library, as C code or as ROSCO's input file."""

from typing import Annotated

from typer import Argument, Option

from fowt_env.errors import InputError
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.console import command, connect, note, output, progress_bar, wrote
from fowt_env.training.cli.simulate import CONTROLLER

LIBRARIES = (".so", ".dll", ".dylib")
AGAIN = "Run the law in a Python process, even if it is available in C."


@command(connect)
def export(
    controller: Annotated[str, Argument(help=CONTROLLER.partition(" none:")[0])],
    dll: Annotated[str | None, Option(help="Output library with the Bladed interface: .so.")] = None,
    c_folder: Annotated[str | None, Option("--c", help="Output folder of law.h and law.c, C99.")] = None,
    rosco: Annotated[str | None, Option(help="Output file of ROSCO: .IN.")] = None,
    platform: shared.PlatformOption = "oc3_hywind",
    control_dt: Annotated[float, Option(help="Control period, s; a multiple of the host's.")] = 0.1,
    python: Annotated[bool, Option("--python", help=AGAIN)] = False,
):
    """Export a controller for OpenFAST, a PLC or ROSCO.

    Examples:
    fowt connect export gspi_oc3 --dll libgspi.so  # a library that OpenFAST loads in place of DISCON
    fowt connect export mpc --dll libmpc.so --platform iea15_volturnus_s  # runs in Python beside the host
    fowt connect export mine:Hold --dll libmine.so  # your own Python controller
    fowt connect export policy:ppo_lqr --c plc  # C99 without allocation: law.h and law.c
    fowt connect export design:mine.json --rosco DISCON.IN  # gains and limits of a PI law for ROSCO

    The PI laws, floating_feedback, ipc, lqr and agents on these become C code, all others run in a Python
    process that the library starts and ends. A C compiler is needed: gcc, clang or pip install ziglang.
    docs/guides/export.md has the settings of OpenFAST.
    """
    from fowt_env.controllers.export import library

    if dll is None and c_folder is None and rosco is None:
        raise InputError("fowt connect export: needs --dll libmine.so, --c FOLDER or --rosco DISCON.IN")
    output(dll, "--dll", endings=LIBRARIES)
    output(c_folder, "--c", folder=True)
    output(rosco, "--rosco", endings=(".IN", ".in"))
    with progress_bar("exporting"):
        if dll is not None:
            language = library.export_library(controller, dll, platform, control_dt, python)
        if c_folder is not None:
            sources = library.export_sources(controller, c_folder, platform, control_dt)
        if rosco is not None:
            notes = library.export_rosco(controller, rosco, platform, control_dt)
    if dll is not None:
        wrote(dll)
        note(
            f"the law runs in {language}; in ServoDyn: PCMode 5, VSContrl 5, DLL_FileName, and a DLL_DT that"
            f" divides {control_dt:g} s"
        )
    if c_folder is not None:
        wrote(*sources)
    if rosco is not None:
        for sentence in notes:
            note(sentence)
        wrote(rosco)
