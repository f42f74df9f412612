"""Shared parts of the commands of fowt: the application, messages on stderr, exit codes, progress."""

import functools
import inspect
import re
import time
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich import progress as bars
from rich.console import Console
from rich.markup import escape
from typer.core import TyperGroup

from fowt_env.errors import ControllerError, InputError, SimulationStopped
from fowt_env.files.tables import table_path, write_table
from fowt_env.training.cli.tables import out

EXIT_STOPPED, EXIT_INPUT, EXIT_INTERRUPTED = 1, 2, 130
STUDIES = "fowt_env.training.studies"  # not in the wheel
LINE_EVERY = 30.0  # s between two lines of progress where there is no terminal for a bar
OUTPUTS = {  # parameters of commands that name what is written -> how they are checked ahead
    "out_path": {},
    "out_folder": {"folder": True},
    "plot": {"option": "--plot"},
    "report": {"option": "--report"},
}
err = Console(stderr=True, emoji=False, highlight=False, soft_wrap=True)
MODULES = (  # that add their commands to the app
    "simulate", "listing", "check", "evaluate", "validate", "doctor", "warmup", "cache", "benchmark",
    "design", "plot", "report", "scores", "leaderboard", "import_deck", "hydro", "train",
)  # fmt: skip
GROUPS = {  # of fowt --help: heading -> its commands, in the order in which they are shown
    "Run": ("simulate", "trim", "plot", "animate", "check", "import", "hydro"),
    "Design": ("linearize", "design"),
    "Evaluate": ("evaluate", "report", "scores", "leaderboard"),
    "Train": ("train", "export-policy"),
    "Set up": ("list", "doctor", "warmup", "cache"),
    "Develop": ("validate", "paper", "benchmark"),
}
START = (  # first examples in fowt --help
    ("fowt simulate --wind 18 --plot run.png", "one run: statistics and a picture"),
    ("fowt list", "names: platforms, seas, controllers"),
    ("fowt evaluate --controllers pi,lqr", "compare controllers"),
    ("fowt COMMAND --help", "options, and examples to copy"),
)


class Overview(TyperGroup):
    """The commands in their groups, a line each, so that all of them fit on one screen."""

    def format_help(self, ctx, formatter):
        """Print the help of the whole command."""
        out.print(f"[bold]fowt[/bold]  {self.help}  [dim](--version)[/dim]\n")
        width = max(len(command) for command, _ in START)
        for command, text in START:
            out.print(f"  [cyan]{command:{width}}[/cyan]  # {text}")
        names = max(map(len, self.commands))
        headings = max(map(len, GROUPS))
        for group, commands in self.by_group().items():
            out.print()
            for number, command in enumerate(commands):
                first = " ".join(self.commands[command].help.split("\n\n")[0].split()).removesuffix(".")
                heading = f"[bold]{group if number == 0 else '':{headings}}[/bold]"
                out.print(f"{heading}  [cyan]{command:{names}}[/cyan]  # {escape(first)}")

    def by_group(self):
        """Return {heading: names of its commands}."""
        return {group: [name for name in names if name in self.commands] for group, names in GROUPS.items()}


new_folders: list[Path] = []  # that the running command may make
app = typer.Typer(
    name="fowt",
    cls=Overview,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Floating wind turbines: simulate, control, compare, train.",
)


@app.callback(invoke_without_command=True)
def version_option(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
):
    """Options of the command as a whole."""
    if version:
        from fowt_env import __version__

        out.print(__version__)
        raise typer.Exit


def add_group(name, text, **options):
    """Return a new group of commands of the app, with its help text."""
    made = typer.Typer(rich_markup_mode="rich", help=text, **(options or {"no_args_is_help": True}))
    app.add_typer(made, name=name)
    return made


def command(group=app):
    """Return a decorator that adds a function to a group of commands, with its errors `reported`.

    The command has the name of the function, without an ending "_command". The docstring is the help, and
    below its line "Examples:" the epilog, in which lines that begin with "fowt" are examples.
    """

    def coloured(line):
        return f"[cyan]{escape(line[1])}[/cyan]{escape(line[2])}\n"

    def add(function):
        text, _, examples = inspect.cleandoc(function.__doc__).partition("\n\nExamples:\n")
        epilog = re.sub(r"^(fowt .*?)((?:  # .*)?)$", coloured, examples, flags=re.M)
        name = function.__name__.removesuffix("_command").replace("_", "-")
        options = {"name": name, "help": text, "epilog": f"[bold]Examples[/bold]\n\n{epilog}"}
        return group.command(**options)(reported(function))

    return add


def reported(function):
    """Return a command that checks its OUTPUTS, prints errors in one line and sets the exit code."""

    @functools.wraps(function)
    def run(*args, **kwargs):
        new_folders.clear()
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda message, *_: err.print(
                    f"[yellow]Warning: {escape(str(message))}[/yellow]"
                )
                for name, rules in OUTPUTS.items():
                    if isinstance(kwargs.get(name), str):
                        output(kwargs[name], **rules)
                return function(*args, **kwargs)
        except (SimulationStopped, ControllerError) as error:
            fail(error, EXIT_STOPPED)
        except (InputError, OSError, ImportError) as error:
            fail(error, EXIT_INPUT)
        except KeyboardInterrupt:
            fail("interrupted", EXIT_INTERRUPTED)
        except (SystemExit, GeneratorExit) as error:
            if isinstance(error.__context__, BrokenPipeError):  # the reader of the output has closed it
                raise typer.Exit(EXIT_STOPPED) from None
            # raised by a controller or a library, not by the command itself
            fail(f"ended early by {type(error).__name__}: {error}", EXIT_STOPPED)
        finally:
            announce_folders()

    return run


def announce_folders():
    """Print which of the missing folders have been made, once."""
    for folder in new_folders:
        if folder.is_dir():
            note(f"made the folder {folder}")
    new_folders.clear()


@contextmanager
def from_a_clone(command):
    """Wrap imports of the studies. Raises: InputError that names the command if they are not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(STUDIES):
            raise
        raise InputError(
            f"fowt {command}: needs a clone of the repository, whose folder training/studies is not installed"
            " with the package: pip install -e . in the clone"
        ) from None


def fail(message, code):
    """Print the message in red on stderr, as its last line, and end with the exit code."""
    announce_folders()
    err.print(f"[red][bold]Error:[/bold] {escape(str(message))}[/red]")
    raise typer.Exit(code)


def note(message):
    """Print a remark on stderr, so that stdout has only results."""
    err.print(f"[dim]{escape(message)}[/dim]")


def wrote(*paths):
    """Print on stderr which files have been written, but for those that are None."""
    if any(paths):
        note(f"wrote {', '.join(str(path) for path in paths if path is not None)}")


def output(path, option="--out", folder=False, endings=()):
    """Return the path of an option (None: None), once its folder exists or may be made.

    endings: those that the file may have; (): any. A missing folder may be made in the working folder alone,
    and so may the last part of an option that names a folder; `reported` says at the end what has been made.
    Raises: InputError that names the option, the path and the missing folder.
    """
    if path is None:
        return None
    if endings:
        table_path(path, endings, option)
    place = Path(path) if folder else Path(path).parent
    if place.is_dir():
        return path
    if place.exists():
        raise InputError(f"{option} {str(path)!r}: cannot be written: {str(place)!r} is a file, not a folder")
    inside = place.resolve().is_relative_to(Path.cwd())
    if not inside and not (folder and place.parent.is_dir()):
        missing = place.parent if folder else place
        raise InputError(
            f"{option} {str(path)!r}: cannot be written: there is no folder {str(missing)!r}; make it"
            " first: folders are made in the working folder alone"
        )
    if place not in new_folders:
        new_folders.append(place)
    return path


@contextmanager
def progress_bar(description, total=None, every=LINE_EVERY):
    """Show a bar on stderr that disappears when done; yield update(done, total=None, text=None).

    Without a terminal (a file, a pipe, a batch job) it is a line each `every` seconds.
    """
    columns = (
        *(bars.SpinnerColumn(), bars.TextColumn("{task.description}"), bars.BarColumn()),
        *(bars.TaskProgressColumn(), bars.TimeElapsedColumn()),
    )
    hidden = not err.is_terminal
    bar = bars.Progress(*columns, console=err, transient=True, disable=hidden)
    task = bar.add_task(description, total=total)
    began = printed = time.monotonic()

    def update(done, total=None, text=None):
        nonlocal printed
        bar.update(task, completed=done, description=text or description, total=total)
        now, whole = time.monotonic(), bar.tasks[0].total
        if hidden and now - printed >= every:
            printed = now
            share = f", {100.0 * done / whole:.0f} %" if whole else ""
            note(f"{now - began:.0f} s{share}: {text or description}")

    with bar:
        yield update


@contextmanager
def text_progress(description, label=""):
    """Show a progress bar; yield progress(text, done, total), as some studies call it."""
    with progress_bar(description) as update:
        yield lambda text, done, total: update(done, total, f"{label}{text}")


def save_table(frame, path):
    """Write a table to the path of an option and say so; None: nothing."""
    if path is not None:
        wrote(write_table(frame, path))
