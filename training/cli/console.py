"""Defines what the fowt commands share: the application, messages on stderr, exit codes, progress bars."""

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
LINE_EVERY = 30.0  # s between lines of progress without a terminal
OUTPUTS = {  # output parameters of commands -> arguments of output(), which checks them before the run
    "out_path": {},
    "out_folder": {"folder": True},
    "plot": {"option": "--plot"},
    "report": {"option": "--report"},
}
err = Console(stderr=True, emoji=False, highlight=False, soft_wrap=True)
MODULES = (  # modules that add commands to the app
    "simulate", "listing", "check", "check_dll", "evaluate", "validate", "doctor", "warmup", "cache",
    "benchmark", "design", "plot", "report", "scores", "leaderboard", "import_deck", "export", "hydro",
    "campbell", "train", "dataset", "serve", "compare", "export_fmu", "tune", "study", "loads", "table",
)  # fmt: skip
GROUPS = {  # headings of fowt --help -> their commands, in the order shown
    "Run": ("simulate", "plot", "compare"),
    "Platform": ("import", "model"),
    "Control": ("tune", "study", "design"),
    "Evaluate": ("evaluate", "report", "loads"),
    "Train": ("train", "dataset"),
    "Connect": ("connect",),
    "Set up": ("list", "doctor", "warmup"),
    "Develop": ("dev",),
}
MOVED = {  # former name of a command: its name now
    **{name: f"model {name}" for name in ("trim", "linearize", "check", "hydro", "campbell", "table")},
    **{name: f"connect {name}" for name in ("check-dll", "export", "serve", "fmu", "export-policy")},
    **{name: f"dev {name}" for name in ("validate", "paper", "benchmark", "scores", "leaderboard", "cache")},
    "animate": "dev animate",
    "design tune": "design search",
}
START = (  # first examples in fowt --help
    ("fowt simulate --wind 18 --plot run.png", "one run: statistics and a plot"),
    ("fowt tune", "move gains on a live page"),
    ("fowt study DECK.fst --controller mine:Law", "your deck, your controller"),
    ("fowt COMMAND --help", "options and examples"),
)
NEXT = (  # what fowt alone suggests: command, and what it is for
    ("fowt simulate --wind ntm:14:B --sea jonswap:4:9 --plot run.png", "a first run, and its picture"),
    ("fowt tune", "move gains and see at once what they do"),
    (
        "fowt evaluate --controllers gspi_oc3,module:Mine",
        "score your controller beside a published one",
    ),
    (
        "fowt study DECK.fst --controller dll:my.so",
        "your OpenFAST model and controller: a verdict",
    ),
    ("fowt train --help", "train an agent"),
    ("fowt --help", "all commands"),
)


class Renamed(TyperGroup):
    """Tells who calls a command by its former name the name that it has now."""

    def resolve_command(self, ctx, args):
        """Return the command of the arguments. Raises: UsageError, for a former name with the present one."""
        parents, parent = [], ctx
        while parent.parent is not None:
            parents.insert(0, parent.info_name)
            parent = parent.parent
        name = " ".join([*parents, args[0]])
        if name in MOVED:
            ctx.fail(f"fowt {name} is now called fowt {MOVED[name]}")
        return super().resolve_command(ctx, args)


class Overview(Renamed):
    """Shows the commands in groups, one line each, so that the help fits on one screen."""

    def format_help(self, ctx, formatter):
        """Print the help of fowt."""
        out.print(f"[bold]fowt[/bold]  {self.help}  [dim](--version)[/dim]\n")
        width = max(len(command) for command, _ in START)
        for command, text in START:
            out.print(f"  [cyan]{command:{width}}[/cyan]  # {text}")
        names = max(map(len, self.commands))
        headings = max(map(len, GROUPS))
        out.print()
        for group, commands in self.by_group().items():
            for number, command in enumerate(commands):
                first = " ".join(self.commands[command].help.split("\n\n")[0].split()).removesuffix(".")
                heading = f"[bold]{group if number == 0 else '':{headings}}[/bold]"
                out.print(f"{heading}  [cyan]{command:{names}}[/cyan]  # {escape(first)}")

    def by_group(self):
        """Return {heading: names of its commands}."""
        return {group: [name for name in names if name in self.commands] for group, names in GROUPS.items()}


new_folders: list[Path] = []  # that the running command may create
app = typer.Typer(
    name="fowt",
    cls=Overview,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Floating wind turbines: simulate, control, compare, train.",
)


@app.callback(invoke_without_command=True)
def version_option(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
):
    """Handle the options of fowt itself."""
    if version:
        from fowt_env import __version__

        out.print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        width = max(len(command) for command, _ in NEXT)
        for command, text in NEXT:
            out.print(f"[cyan]{command:{width}}[/cyan]  # {text}", soft_wrap=True)
        out.print("[dim]A first run of a kind of scene compiles for half a minute to two: fowt warmup.[/dim]")


def add_group(name, text, parent=app, **options):
    """Add a group of commands to the app or a parent group and return it; text: help of the group."""
    options = options or {"no_args_is_help": True}
    group = typer.Typer(cls=Renamed, rich_markup_mode="rich", help=text, **options)
    parent.add_typer(group, name=name)
    return group


model = add_group("model", "Check a platform; operating points, modes, linear models.")
connect = add_group("connect", "Export controllers; run the plant for others, as an FMU.")
dev = add_group("dev", "Validate, benchmark, score agents, keep boards, animate.")


def command(group=app):
    """Return a decorator that adds a function to a group of commands, with its errors `reported`.

    The command is named after the function, without the suffix "_command". The docstring is the help and,
    below its line "Examples:", the epilog; lines that begin with "fowt" are examples, others are wrapped to
    the width of the terminal.
    """

    def coloured(line):
        return f"[cyan]{escape(line[1])}[/cyan]{escape(line[2])}\n"

    def wrapped(text):
        return re.sub(r"(?<!\n)\n(?!\n)", " ", text)

    def add(function):
        text, _, examples = inspect.cleandoc(function.__doc__).partition("\n\nExamples:\n")
        epilog = wrapped(re.sub(r"^(fowt .*?)((?:  # .*)?)$", coloured, examples, flags=re.M))
        name = function.__name__.removesuffix("_command").replace("_", "-")
        options = {"name": name, "help": wrapped(text), "epilog": f"[bold]Examples[/bold]\n\n{epilog}"}
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
                if isinstance(kwargs.get("plot"), str):
                    kwargs["plot"] = plot_file(kwargs["plot"])
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


def plot_file(path):
    """Return the path of a plot with its extension. Raises: InputError for an unknown one, before a run."""
    from fowt_env.visual.style import plot_path

    return str(plot_path(path))


def announce_folders():
    """Print which of new_folders have been created, then clear the list."""
    for folder in new_folders:
        if folder.is_dir():
            note(f"created the folder {folder}")
    new_folders.clear()


@contextmanager
def from_a_clone(command):
    """Wrap imports of the studies. Raises: InputError with the command if the studies are not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(STUDIES):
            raise
        raise InputError(
            f"fowt dev {command}: needs a clone of the repository (pip install -e . in the clone):"
            " training/studies is not part of the installed package"
        ) from None


def fail(message, code):
    """Print the message in red as the last line of stderr and exit with the code."""
    announce_folders()
    err.print(f"[red][bold]Error:[/bold] {escape(str(message))}[/red]")
    raise typer.Exit(code)


def note(message):
    """Print a remark on stderr, so that stdout contains only results."""
    err.print(f"[dim]{escape(message)}[/dim]")


def wrote(*paths):
    """Print the paths of written files on stderr; None is skipped."""
    if any(paths):
        note(f"wrote {', '.join(str(path) for path in paths if path is not None)}")


def output(path, option="--out", folder=False, endings=()):
    """Return the path of an output option whose folder exists or may be created; None: None.

    endings: allowed suffixes; (): any. Missing folders are created in the working folder only; if the option
    names a folder, its last part may be new anywhere. `reported` prints the created folders.
    Raises: InputError with the option, the path and the missing folder.
    """
    if path is None:
        return None
    if endings:
        table_path(path, endings, option)
    dest = Path(path) if folder else Path(path).parent
    if dest.is_dir():
        return path
    if dest.exists():
        raise InputError(f"{option} {str(path)!r}: cannot be written: {str(dest)!r} is a file, not a folder")
    inside = dest.resolve().is_relative_to(Path.cwd())
    if not inside and not (folder and dest.parent.is_dir()):
        missing = dest.parent if folder else dest
        raise InputError(
            f"{option} {str(path)!r}: cannot be written: there is no folder {str(missing)!r}; create it"
            " first: new folders are created in the working folder only"
        )
    if dest not in new_folders:
        new_folders.append(dest)
    return path


@contextmanager
def progress_bar(description, total=None, every=LINE_EVERY):
    """Show a bar on stderr that disappears when done; yield update(done, total=None, text=None).

    Without a terminal (a file, a pipe, a batch job), print a line every `every` seconds instead.
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
            percent = f", {100.0 * done / whole:.0f} %" if whole else ""
            note(f"{now - began:.0f} s{percent}: {text or description}")

    with bar:
        yield update


@contextmanager
def resumable(description, kept):
    """Show a progress bar of work that another call resumes; yield update(done, total, text).

    kept: kept(done) is the text of what is there for that call if the work is interrupted.
    """
    from fowt_env.training.evaluation.engines import WorkersLost

    finished = 0
    with progress_bar(description) as show:

        def update(done, total, text):
            nonlocal finished
            finished = done
            show(done, total, text)

        try:
            yield update
        except KeyboardInterrupt:
            fail(f"interrupted; {kept(finished)}", EXIT_INTERRUPTED)
        except WorkersLost as error:
            fail(error, EXIT_STOPPED)


@contextmanager
def text_progress(description, label=""):
    """Show a progress bar; yield progress(text, done, total), the callback of some studies."""
    with progress_bar(description) as update:
        yield lambda text, done, total: update(done, total, f"{label}{text}")


def save_table(frame, path):
    """Write a table to the path of an option and print the path; None: do nothing."""
    if path is not None:
        wrote(write_table(frame, path))
