"""Implements fowt dev leaderboard: a public ranking of submitted controllers, re-run by its organiser."""

import shlex
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fowt_env.training.cli.console import add_group, command, dev, note, out, output, progress_bar
from fowt_env.training.cli.options import JobsOption
from fowt_env.training.cli.tables import print_table

board_app = add_group("leaderboard", "Keep a public ranking of submitted controllers.", dev)

PLATFORM = "Platform (name or path) of a new board, to which its suites are scaled."
DRAWN = "Hash from which the public seeds are drawn, instead of the board's seeds."
WITHIN = "Command that starts each Python file, e.g. in a container; {folder}: folder of the file."
BoardOption = Annotated[Path, Option("--board", help="Folder of the board.")]


@command(board_app)
def add_command(
    submissions: Annotated[list[Path], Argument(help="Submission folders, each with a card.toml.")],
    board: BoardOption = Path("board"),
    platform: Annotated[str | None, Option(help=PLATFORM)] = None,
):
    """Check submissions and copy them into the board.

    The submitted code is not run.

    Examples:
    fowt dev leaderboard add my_controller  # into ./board; a new board starts with the package's controllers

    A submission is a folder with card.toml and the controller named in the card:

        name = "my_controller"
        author = "A. Researcher"
        licence = "MIT"
        controller = "controller.py:Mine"      # or "policy.npz"
        information = ["generator_speed", "blade_pitch"]
        tuning = "gains by hand, seeds 1001 to 1004"
    """
    from fowt_env.training.board.folder import SETTINGS, Board, new_board
    from fowt_env.training.board.submission import CODE, read_submission

    kinds = [read_submission(folder).kind for folder in submissions]
    if not (board / SETTINGS).exists():
        output(board, "--board", folder=True)
        created = new_board(board, platform=platform)
        first = ", ".join(each.name for each in created.submissions())
        note(f"created the board {board} with the controllers of the package: {first}")
    for kind, folder in zip(kinds, submissions, strict=True):
        name = Board(board).add(folder)
        trusted = " --trust-code (once you have read its code)" if kind in CODE else ""
        note(f"added {name}; judge it with: fowt dev leaderboard run --board {board}{trusted}")


@command(board_app)
def seeds_command(
    path: Annotated[Path, Argument(help="New file, readable only by you.")],
    count: Annotated[int, Option(help="Number of seeds.")] = 6,
):
    """Draw an organiser's secret seeds, too large to guess, with a salt.

    Examples:
    fowt dev leaderboard seeds seeds.txt  # publish the printed SHA-256, and keep the file
    """
    from fowt_env.training.board.folder import write_secret_seeds

    digest = write_secret_seeds(path, count)
    out.print(digest)
    note(f"wrote {count} seeds to {path}; publish the SHA-256 above, which does not reveal them")


@command(board_app)
def run_command(
    board: BoardOption = Path("board"),
    jobs: JobsOption = 1,
    draw_seeds: Annotated[str | None, Option(help=DRAWN)] = None,
    secret: Annotated[Path | None, Option(help="File of leaderboard seeds; -: standard input.")] = None,
    private: Annotated[Path | None, Option(help="Folder for the runs of the secret seeds.")] = None,
    trust_code: Annotated[bool, Option("--trust-code", help="Run submitted code.")] = False,
    within: Annotated[str | None, Option(help=WITHIN)] = None,
):
    """Run every submission on the board's frozen suites and write the page of the board.

    Examples:
    fowt dev leaderboard run --jobs 2  # all submissions on the board's seeds
    fowt dev leaderboard run --draw-seeds $COMMIT  # seeds from a commit
    fowt dev leaderboard run --secret seeds.txt --private private --trust-code  # also on secret seeds

    Python files and libraries run only with [bold]--trust-code[/bold], each in a separate process, with your
    user's permissions: read them first, or run them in a container with [bold]--within[/bold]
    (docs/guides/leaderboard.md). The same command resumes an interrupted run.
    """
    from fowt_env.training.board.folder import Board
    from fowt_env.training.board.judge import judge
    from fowt_env.training.board.page import write_board

    holder = Board(board)
    output(private, "--private", folder=True)
    words = shlex.split(within or "")
    with progress_bar("judging") as update:
        judged = judge(holder, jobs, secret, private, trust_code, update, draw_seeds, words)
    written = write_board(judged)
    for name, why in judged.left_out.items():
        note(f"left out: {name}: {why}")
    note(f"wrote {', '.join(path.name for path in written)} in {board}")


@command(board_app)
def show_command(
    board: BoardOption = Path("board"),
    regime: Annotated[str | None, Option(help="Regime; default: the first of the board.")] = None,
):
    """Print the board as last judged.

    Examples:
    fowt dev leaderboard show  # the board in ./board, its first regime
    """
    from fowt_env.training.board.page import board_rows

    title, headings, rows = board_rows(board, regime)
    print_table(headings, rows, title)
