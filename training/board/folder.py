"""The folder of a leaderboard: settings, frozen suites, submissions and results.

board.toml            seeds, limits, and the suites of each regime
suites/*.toml         copies of the suites from when the board was made, independent of later versions
submissions/NAME/     added submissions
runs/                 results folders of the public seeds, one for each suite, kind of preview and drawing
history.csv           a row for every submission, regime and judging
board.csv, index.html results of the last judging
"""

import hashlib
import json
import os
import re
import secrets
import shutil
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field

from fowt_env.descriptions.files import raise_problems, read_toml
from fowt_env.descriptions.platform import turbine_of
from fowt_env.descriptions.records import Positive, Record, checked_record
from fowt_env.descriptions.turbine import Turbine
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.board.isolated import ProcessLimits, copy_files
from fowt_env.training.board.submission import CARD, NAME, alike, read_submission
from fowt_env.training.evaluation.cases import FOLDER as SUITES
from fowt_env.training.evaluation.cases import Seeds, Suite, read_suite
from fowt_env.training.evaluation.seeds import DRAWN, LEAST_SECRET, new_secret_seeds

SETTINGS = "board.toml"
DEFAULT_PLATFORM = "oc3_hywind"  # of the suites
SALT = re.compile("salt [0-9a-f]{32,}")
ENTRIES = Path(__file__).parent / "entries"  # cards of the package's controllers
REGIMES = (  # name, suites: of a new board
    ("in distribution", ("above_rated",)),
    ("gusts", ("gusts", "settling")),
    ("off design", ("shifted",)),
)


class Regime(Record):
    """Suites of one kind of conditions: design winds, gusts, or perturbed plants."""

    name: str
    suites: Annotated[tuple[str, ...], BeforeValidator(tuple)] = Field(min_length=1)


class BoardFile(Record):
    """The text of board.toml."""

    title: str
    platform: str | None = None  # of its suites; None: that of each suite
    baseline: str = "gspi_oc3"
    seeds: Seeds
    call_limit: Positive = 0.1  # s, of one call of a controller's act()
    prepare_limit: Positive = 300.0  # s
    memory: Positive = 4e9  # bytes
    regime: tuple[Regime, ...]


class Board:
    """A board's folder. Raises: InputError for any other folder, or for unusable settings."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        path = self.folder / SETTINGS
        if not path.is_file():
            raise InputError(
                f"board {str(folder)!r}: has no {SETTINGS}: make one with fowt leaderboard add, or choose"
                " another --board"
            )
        where = f"board {str(folder)!r}"
        self.settings = checked_record(BoardFile, read_toml(path, "board"), where)
        count = Counter(name for regime in self.settings.regime for name in regime.suites)
        problems = [f"regime: suite {name!r} is named twice" for name in count if count[name] > 1]
        lacking = [name for name in count if not self._suite_path(name).is_file()]
        raise_problems(where, [*problems, *(f"regime: there is no suites/{name}.toml" for name in lacking)])

    def _suite_path(self, name):
        return self.folder / "suites" / f"{name}.toml"

    def suite(self, name: str) -> Suite:
        """Return the board's copy of a suite."""
        return read_suite(self._suite_path(name), self.settings.platform)

    @property
    def turbine(self) -> Turbine:
        """Turbine of the board's platform, for which controllers are made."""
        return turbine_of(self.settings.platform or DEFAULT_PLATFORM)

    @property
    def limits(self) -> ProcessLimits:
        """Limits of isolated controllers."""
        s = self.settings
        return ProcessLimits(prepare=s.prepare_limit, call=s.call_limit, memory=s.memory)

    def submissions(self) -> list:
        """Return the valid submissions of the board, by name."""
        return self.read()[0]

    def read(self) -> tuple[list, dict[str, str]]:
        """Return (valid submissions, {folder: why it is left out}), by name.

        Folders that are no submissions, such as unfinished copies, are ignored.
        """
        sound, left_out = {}, {}
        folder = self.folder / "submissions"
        paths = [path for path in folder.iterdir() if NAME.fullmatch(path.name)] if folder.is_dir() else []
        for path in sorted(paths, key=lambda path: (path.name != self.settings.baseline, path.name)):
            try:
                found = read_submission(path)
                if found.name != path.name:
                    raise InputError(f"is called {found.name!r} in its {CARD}")
                if other := sound.get(alike(found.name)):
                    raise InputError(f"has nearly the name of {other.name!r}")
                sound[alike(found.name)] = found
            except InputError as error:
                left_out[path.name] = str(error)
        return sorted(sound.values(), key=lambda each: each.name), left_out

    def add(self, source: Path | str) -> str:
        """Copy a submission into the board without running it; return its name.

        Raises: InputError if it is not valid, or if a different one has its name or nearly its name.
        """
        submission = read_submission(source)
        place = self.folder / "submissions" / submission.name
        if place.exists():
            if read_submission(place).digest == submission.digest:
                return submission.name
            raise InputError(
                f"submission {submission.name!r}: the board has a different one of this name: change the name"
                f" in {CARD}"
            )
        others = [each.name for each in self.submissions() if alike(each.name) == alike(submission.name)]
        if others:
            raise InputError(
                f"submission {submission.name!r}: the board has {others[0]!r}, which readers would"
                f" confuse with it: change the name in {CARD}"
            )
        place.parent.mkdir(parents=True, exist_ok=True)
        waiting = place.with_name(f".{submission.name}-{time.monotonic_ns()}")
        try:
            copy_files(source, waiting)
            waiting.rename(place)
        except BaseException:
            shutil.rmtree(waiting, ignore_errors=True)
            raise
        return submission.name


def new_board(
    folder: Path | str, title: str = "Controllers of floating wind turbines", platform: str | None = None
) -> Board:
    """Make a board with the package's controllers as its first submissions, and return it.

    platform: a name or a path, to whose turbine the suites are scaled; None: that of the suites.
    Raises: InputError if there is a board already, and for a platform that cannot be read.
    """
    folder = Path(folder)
    if platform is not None:
        turbine_of(platform)
    if (folder / SETTINGS).exists():
        raise InputError(f"board {str(folder)!r}: is there already")
    seeds = read_suite(REGIMES[0][1][0]).seeds
    (folder / "suites").mkdir(parents=True, exist_ok=True)
    lines = [f"title = {json.dumps(title)}"]
    lines += [] if platform is None else [f"platform = {json.dumps(str(platform))}"]
    lines += ['baseline = "gspi_oc3"', f"seeds = {list(seeds)} # public", "call_limit = 0.1 # s"]
    for name, suites in REGIMES:
        lines += ["", "[[regime]]", f'name = "{name}"', f"suites = {list(suites)}".replace("'", '"')]
        for suite in suites:
            shutil.copy(SUITES / f"{suite}.toml", folder / "suites")
    with replacing(folder / SETTINGS) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    board = Board(folder)
    for card in sorted(ENTRIES.glob(f"*/{CARD}")):
        board.add(card.parent)
    return board


def write_secret_seeds(path: Path | str, count: int) -> str:
    """Write a file of secret seeds that only this user can read; return its SHA-256, which may be published.

    Its salt keeps the hash from revealing the seeds.
    Raises: InputError if the file exists, or for a count below 1.
    """
    if count < 1:
        raise InputError(f"count = {count}: must be at least 1")
    lines = [f"salt {secrets.token_hex(32)}", *map(str, new_secret_seeds(count))]
    content = ("\n".join(lines) + "\n").encode()
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise InputError(f"secret seeds {str(path)!r}: cannot be written: {error.strerror}") from None
    with os.fdopen(handle, "wb") as file:
        file.write(content)
    return hashlib.sha256(content).hexdigest()


def read_seeds(path: Path | str) -> tuple[tuple[int, ...], str]:
    """Return (the organiser's secret seeds, SHA-256 of their file) of a file of write_secret_seeds.

    path: "-" for standard input, which hides the file's path from other processes.
    Raises: InputError, also for a file without a salt and for seeds that can be guessed.
    """
    where = f"secret seeds {str(path)!r}"
    if str(path) == "-":
        content = sys.stdin.buffer.read()
    elif Path(path).is_file():
        content = Path(path).read_bytes()
    else:
        raise InputError(f"{where}: there is no such file; fowt leaderboard seeds makes one")
    first, *lines = content.decode("ascii", "replace").split("\n")
    words = [line.strip() for line in lines if line.strip()]
    if not SALT.fullmatch(first.strip()):
        raise InputError(
            f"{where}: must begin with a line of 'salt' and 32 hexadecimal digits or more, without which its"
            " hash would reveal the seeds; fowt leaderboard seeds makes such a file"
        )
    if not words or not all(word.isdecimal() and len(word) < 20 for word in words):
        raise InputError(f"{where}: must contain whole numbers, one per line, after the salt")
    seeds = tuple(int(word) for word in words)
    if len(set(seeds)) < len(seeds):
        raise InputError(f"{where}: a seed occurs twice")
    if not all(LEAST_SECRET <= seed < DRAWN.stop for seed in seeds):
        raise InputError(
            f"{where}: {min(seeds)} to {max(seeds)}: must be from 2**40, below which a seed can be guessed,"
            " to 2**63 - 1"
        )
    return seeds, hashlib.sha256(content).hexdigest()
