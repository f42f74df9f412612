"""Implements fowt dev cache: shows and clears compiled kernels and other cached files on disk."""

from typing import Annotated

import typer
from rich.markup import escape
from typer import Option

from fowt_env.errors import InputError
from fowt_env.training.cli.console import add_group, command, dev, note, out, reported, wrote
from fowt_env.training.cli.tables import print_table

cache = add_group("cache", "Show or clear the cache on disk.", dev, invoke_without_command=True)


@cache.callback()
@reported
def show(context: typer.Context):
    """Show the folder and the size of compiled kernels and full-field wind."""
    if context.invoked_subcommand is not None:
        return
    from fowt_env.training.cli import health

    parts = health.cache_parts()
    if not parts:
        raise InputError("no cache: neither FOWT_CACHE_DIR nor a home folder is set")
    out.print(escape(str(health.cache_root())))
    rows = [(what, len(paths), f"{health.megabytes(paths):.1f}") for what, paths in parts.items()]
    print_table(("", "folders or files", "MB"), rows)


@command(cache)
def clear(
    every: Annotated[bool, Option("--all", help="Also remove kernels of this version.")] = False,
    wind_boxes: Annotated[bool, Option("--wind-boxes", help="Also remove full-field wind.")] = False,
    yes: Annotated[bool, Option("--yes", "-y", help="Do not ask for confirmation.")] = False,
):
    """Remove compiled kernels of other versions and of submissions; files not created by this package stay.

    Examples:
    fowt dev cache clear  # compiled kernels of other versions, and those of a leaderboard's submissions
    fowt dev cache clear --all  # also those of this version: the next run compiles them again
    fowt dev cache clear --wind-boxes --yes  # also full-field wind, without confirmation
    """
    from fowt_env.training.cli import health

    selected = {"other versions", "submissions"} | ({"this version", "hashes of sources"} if every else set())
    selected |= {"wind boxes"} if wind_boxes else set()
    parts = {what: paths for what, paths in health.cache_parts().items() if what in selected and paths}
    if not parts:
        note("nothing to remove")
        return
    text = " and ".join(f"{what} ({health.megabytes(paths):.1f} MB)" for what, paths in parts.items())
    if (every or wind_boxes) and not yes and not typer.confirm(f"Remove {text}?", err=True):
        raise typer.Exit(1)
    kept = health.remove([path for paths in parts.values() for path in paths])
    note(f"removed {text}")
    if kept:
        raise InputError(f"could not be removed: {', '.join(map(str, kept))}")


@command(cache)
def pack(
    folder: Annotated[str, Option("--out", help="Folder of the pack.")] = "fowt_env/kernels",
):
    """Compile the usual scenes for x86-64-v3 and pack them, for a wheel that starts without compiling.

    Examples:
    fowt dev cache pack  # then python -m build: a wheel with the kernels of this Python version
    """
    from fowt_env.warmup import PACKED, compile_pack

    note(f"compiling {len(PACKED)} kinds of scene: {', '.join(PACKED)}")
    wrote(compile_pack(folder))
