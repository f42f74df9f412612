"""What the commands of fowt share: the application, messages on stderr, exit codes, progress."""

import functools
import warnings
from contextlib import contextmanager
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from fowt_env.errors import ControllerError, InputError, SimulationStopped
from fowt_env.training.cli.tables import figure, print_table

EXIT_STOPPED, EXIT_INPUT, EXIT_INTERRUPTED = 1, 2, 130
STUDIES = "fowt_env.training.studies"  # left out of the wheel
out = Console()
err = Console(stderr=True)
app = typer.Typer(
    name="fowt",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Floating wind turbines under control: simulate, compare controllers, find operating points.",
    epilog="Start with  [bold]fowt simulate --wind 18 --plot run.png[/bold] ,"
    " and see  [bold]fowt COMMAND --help[/bold]  for examples.",
)


@app.callback(invoke_without_command=True)
def version_option(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
):
    """Options of the command as a whole."""
    if version:
        from fowt_env import __version__

        out.print(__version__, highlight=False)
        raise typer.Exit


def reported(command):
    """The command with errors as one clear line on stderr, and an exit code that says what happened."""

    @functools.wraps(command)
    def run(*args, **kwargs):
        try:
            with warnings.catch_warnings():
                warnings.showwarning = _show_warning
                return command(*args, **kwargs)
        except (SimulationStopped, ControllerError) as error:
            fail(error, EXIT_STOPPED)
        except InputError as error:
            fail(error, EXIT_INPUT)
        except (OSError, ImportError) as error:
            fail(error, EXIT_INPUT)
        except KeyboardInterrupt:
            fail("interrupted", EXIT_INTERRUPTED)
        except (SystemExit, GeneratorExit) as error:  # of a controller or a library, not the command's own
            fail(f"ended early by {type(error).__name__}: {error}", EXIT_STOPPED)

    return run


@contextmanager
def from_a_clone(command):
    """Around imports of the studies. Raises: InputError that names the command where they are missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(STUDIES):
            raise
        raise InputError(
            f"fowt {command}: needs a clone of the repository, whose folder training/studies is not installed"
            " with the package: pip install -e . in the clone"
        ) from None


def _show_warning(message, *where):
    """Print a warning in yellow on stderr, without the line of code that it came from."""
    err.print(f"[yellow]Warning: {escape(str(message))}[/yellow]", soft_wrap=True, highlight=False)


def fail(message, code):
    """Print the message in red on stderr and end with the exit code."""
    err.print(f"[red][bold]Error:[/bold] {escape(str(message))}[/red]", soft_wrap=True, highlight=False)
    raise typer.Exit(code)


def note(message):
    """Print a remark on stderr, so that stdout holds results alone."""
    err.print(f"[dim]{escape(message)}[/dim]", soft_wrap=True, highlight=False)


@contextmanager
def progress_bar(description, total):
    """A bar on stderr that disappears when done; yields update(done, text=None, total=None).

    A compilation meanwhile is announced above the bar.
    """
    from fowt_env.plant.compile.announcement import compilation_announced

    def say(text):
        err.print(f"[yellow]{text}[/yellow]", soft_wrap=True, highlight=False)

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    bar = Progress(*columns, TimeElapsedColumn(), console=err, transient=True)
    with bar, compilation_announced(say):
        task = bar.add_task(description, total=total)

        def update(done, text=None, total=None):
            bar.update(task, completed=done, description=text or description, total=total)

        yield update


PlatformOption = Annotated[str, typer.Option(help="Platform: a built-in name or a path to a TOML file.")]
OptionOption = Annotated[
    list[str] | None, typer.Option("--option", metavar="KEY=VALUE", help="Scene option; repeatable.")
]
RotorOption = Annotated[
    str | None, typer.Option(help="Rotor model: bem, lookup or table; default: that of the fidelity.")
]


def show(frame, title=None):
    """Print a DataFrame, its columns of texts to the left."""
    rows = [list(map(figure, row)) for row in frame.itertuples(index=False)]
    texts = [i for i, name in enumerate(frame.columns) if frame[name].map(type).eq(str).any()]
    keys = max([i + 1 for i in texts if i < 2], default=1)
    print_table(out, list(frame.columns), rows, title, keys, left=texts)
