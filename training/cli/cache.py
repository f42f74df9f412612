"""fowt cache: what is kept on disk to save time, and its removal."""

from typing import Annotated

import typer
from rich.markup import escape
from typer import Option

from fowt_env.errors import InputError
from fowt_env.training.cli.console import app, command, note, out, reported
from fowt_env.training.cli.tables import print_table

cache = typer.Typer(
    invoke_without_command=True, rich_markup_mode="rich", help="Show or clear what is kept on disk."
)
app.add_typer(cache, name="cache")


@cache.callback()
@reported
def show(context: typer.Context):
    """Show the folder of compiled kernels and full-field wind, and how large they are."""
    if context.invoked_subcommand is not None:
        return
    from fowt_env.training.cli import health

    parts = health.cache_parts()
    if not parts:
        raise InputError("no cache: neither FOWT_CACHE_DIR nor a home folder says where")
    out.print(escape(str(health.cache_root())), highlight=False, soft_wrap=True)
    rows = [(part.what, str(len(part.paths)), f"{part.megabytes:.1f}") for part in parts]
    print_table(out, ("", "folders or files", "MB"), rows, left=(0,))


@command(cache)
def clear(
    every: Annotated[bool, Option("--all", help="Kernels of this version too.")] = False,
    wind_boxes: Annotated[bool, Option("--wind-boxes", help="Full-field wind too.")] = False,
    yes: Annotated[bool, Option("--yes", "-y", help="Do not ask.")] = False,
):
    """Remove compiled kernels of other versions and of submissions; what this package did not make stays.

    Examples:
    fowt cache clear  # compiled kernels of other versions, and those of a leaderboard's submissions
    fowt cache clear --all  # this version's too: the next run compiles them again
    fowt cache clear --wind-boxes --yes  # full-field wind besides, without a question
    """
    from fowt_env.training.cli import health

    wanted = ["other versions", "submissions", *["this version"] * every, *["wind boxes"] * wind_boxes]
    parts = [part for part in health.cache_parts() if part.what in wanted and part.paths]
    if not parts:
        note("nothing to remove")
        return
    text = " and ".join(f"{part.what} ({part.megabytes:.1f} MB)" for part in parts)
    if (every or wind_boxes) and not yes and not typer.confirm(f"Remove {text}?", err=True):
        raise typer.Exit(1)
    kept = health.remove(parts)
    note(f"removed {text}")
    if kept:
        raise InputError(f"could not be removed: {', '.join(map(str, kept))}")
