"""fowt leaderboard: a standing board of submitted controllers, judged anew by whoever holds it."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from fowt_env.training.cli.console import app, note, out, output, progress_bar, reported
from fowt_env.training.cli.tables import print_table

board_app = typer.Typer(help="Keep a standing board of submitted controllers.", no_args_is_help=True)
app.add_typer(board_app, name="leaderboard")

BoardOption = Annotated[Path, typer.Option("--board", help="Folder of the board.")]

ADD_EXAMPLES = """A submission is a folder with card.toml and the controller that it names:

    name = "my_controller"
    author = "A. Researcher"
    licence = "MIT"
    controller = "controller.py:Mine"      # or "policy.npz"
    information = ["generator_speed", "blade_pitch"]
    tuning = "gains by hand, seeds 1001 to 1004"

[cyan]fowt leaderboard add my_controller[/cyan]  # into ./board, which is made with the package's own
controllers if there is none"""


@board_app.command(name="add", epilog=ADD_EXAMPLES)
@reported
def add_command(
    submissions: Annotated[list[Path], typer.Argument(help="Folders, each with a card.toml.")],
    board: BoardOption = Path("board"),
    platform: Annotated[
        str | None,
        typer.Option(help="Of a board that is made: a name or a path, to which the suites are scaled."),
    ] = None,
):
    """Check submissions and copy them into the board.

    None of their code is run.
    """
    from fowt_env.training.board.folder import SETTINGS, Board, new_board
    from fowt_env.training.board.submission import PYTHON_FILE, read_submission

    kinds = [read_submission(folder).kind for folder in submissions]
    if not (board / SETTINGS).exists():
        output(board, "--board", folder=True)
        made = new_board(board, platform=platform)
        first = ", ".join(each.name for each in made.submissions())
        note(f"made the board {board} with the controllers of the package: {first}")
    for kind, folder in zip(kinds, submissions, strict=True):
        name = Board(board).add(folder)
        trusted = " --trust-code (once you have read its Python file)" if kind == PYTHON_FILE else ""
        note(f"added {name}; judge it with: fowt leaderboard run --board {board}{trusted}")


SEEDS_EXAMPLES = """[cyan]fowt leaderboard seeds seeds.txt[/cyan]  # publish the SHA-256 that it prints, and
keep the file"""


@board_app.command(name="seeds", epilog=SEEDS_EXAMPLES)
@reported
def seeds_command(
    path: Annotated[Path, typer.Argument(help="File that is made; only you can read it.")],
    count: Annotated[int, typer.Option(help="How many seeds.")] = 6,
):
    """Draw an organiser's secret seeds, which are too large to be found by trying, with a salt."""
    from fowt_env.training.board.folder import write_secret_seeds

    digest = write_secret_seeds(path, count)
    out.print(digest, highlight=False)
    note(f"wrote {count} seeds to {path}; publish the SHA-256 above, which says nothing of them")


RUN_EXAMPLES = """[cyan]fowt leaderboard run --jobs 2[/cyan]  # all submissions on the board's seeds

[cyan]fowt leaderboard run --draw-seeds $COMMIT[/cyan]  # seeds from a commit

[cyan]fowt leaderboard run --secret seeds.txt --private private --trust-code[/cyan]  # secret seeds too

Python files run only with [bold]--trust-code[/bold], each in a process of its own, with your user's rights:
read them first, or run them in a container with [bold]--within[/bold] (docs/guides/leaderboard.md). The same
command goes on where it was stopped. Written: index.html, board.csv, history.csv and runs/ in the board's
folder; runs of secret seeds in the folder --private."""


@board_app.command(name="run", epilog=RUN_EXAMPLES)
@reported
def run_command(
    board: BoardOption = Path("board"),
    jobs: Annotated[int, typer.Option(help="Worker processes.")] = 1,
    draw_seeds: Annotated[
        str | None,
        typer.Option(
            "--draw-seeds", help="Hash from which the public seeds are drawn, in place of the board's."
        ),
    ] = None,
    secret: Annotated[
        Path | None, typer.Option(help="File of fowt leaderboard seeds; - reads standard input.")
    ] = None,
    private: Annotated[Path | None, typer.Option(help="Folder for the runs of the secret seeds.")] = None,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="Run submissions that are Python files.")
    ] = False,
    within: Annotated[
        str | None,
        typer.Option(help="Command that starts each Python file, as of a container; {folder}: its folder."),
    ] = None,
):
    """Run every submission on the board's frozen suites and write its page."""
    from fowt_env.training.board.folder import Board
    from fowt_env.training.board.judge import judge
    from fowt_env.training.board.page import write_board

    holder = Board(board)
    output(private, "--private", folder=True)
    words = shlex.split(within or "")
    with progress_bar("judging", None) as update:

        def report(done, total, text):
            update(done, text, total)

        judged = judge(holder, jobs, secret, private, trust_code, report, draw_seeds, words)
    written = write_board(judged)
    for name, why in judged.left_out.items():
        note(f"left out: {name}: {why}")
    note(f"wrote {', '.join(path.name for path in written)} in {board}")


SHOW_EXAMPLES = """[cyan]fowt leaderboard show[/cyan]  # the board in ./board, its first regime"""


@board_app.command(name="show", epilog=SHOW_EXAMPLES)
@reported
def show_command(
    board: BoardOption = Path("board"),
    regime: Annotated[str | None, typer.Option(help="Regime; default: the first of the board.")] = None,
):
    """Print the board as it was judged last."""
    from fowt_env.training.board.page import board_rows

    title, headings, rows = board_rows(board, regime)
    print_table(out, headings, rows, title)
