"""Creates and reads the folder of a leaderboard: settings, frozen suites, submissions and results.

board.toml            seeds, limits, and the suites of each regime
suites/*.toml         copies of the suites when the board was created, independent of later versions
submissions/NAME/     added submissions
runs/                 results folders of the public seeds, one per suite, kind of preview and drawn seeds
history.csv           a row for every submission, suite and evaluation
board.csv, index.html results of the last evaluation
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
DEFAULT_PLATFORM = "oc3_hywind"  # platform of the suites
SALT = re.compile("salt [0-9a-f]{32,}")
ENTRIES = Path(__file__).parent / "entries"  # cards of the package's controllers
REGIMES = (  # (name, suites) of a new board
    ("in distribution", ("above_rated",)),
    ("gusts", ("gusts", "settling")),
    ("off design", ("shifted",)),
)


class Regime(Record):
    """Groups suites of one kind of conditions: design winds, gusts, or perturbed plants."""

    name: str
    suites: Annotated[tuple[str, ...], BeforeValidator(tuple)] = Field(min_length=1)


class BoardFile(Record):
    """Defines the content of board.toml."""

    title: str
    platform: str | None = None  # platform of the suites; None: as in each suite
    baseline: str = "gspi_oc3"
    seeds: Seeds
    call_limit: Positive = 0.1  # s, per call of a controller's act()
    prepare_limit: Positive = 300.0  # s
    memory: Positive = 4e9  # bytes
    regime: tuple[Regime, ...]


class Board:
    """Represents a board's folder. Raises: InputError for any other folder, or for unusable settings."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        path = self.folder / SETTINGS
        if not path.is_file():
            raise InputError(
                f"board {str(folder)!r}: has no {SETTINGS}: create one with fowt dev leaderboard add, or"
                " another --board"
            )
        where = f"board {str(folder)!r}"
        self.settings = checked_record(BoardFile, read_toml(path, "board"), where)
        count = Counter(name for regime in self.settings.regime for name in regime.suites)
        problems = [f"regime: suite {name!r} is listed twice" for name in count if count[name] > 1]
        lacking = [name for name in count if not self._suite_path(name).is_file()]
        raise_problems(where, [*problems, *(f"regime: there is no suites/{name}.toml" for name in lacking)])

    def _suite_path(self, name):
        return self.folder / "suites" / f"{name}.toml"

    def suite(self, name: str) -> Suite:
        """Return the board's copy of a suite."""
        return read_suite(self._suite_path(name), self.settings.platform)

    @property
    def turbine(self) -> Turbine:
        """Return the turbine of the board's platform, for which controllers are created."""
        return turbine_of(self.settings.platform or DEFAULT_PLATFORM)

    @property
    def limits(self) -> ProcessLimits:
        """Return the limits of isolated controllers."""
        s = self.settings
        return ProcessLimits(prepare=s.prepare_limit, call=s.call_limit, memory=s.memory)

    def submissions(self) -> list:
        """Return the valid submissions of the board, sorted by name."""
        return self.read()[0]

    def read(self) -> tuple[list, dict[str, str]]:
        """Return (valid submissions, {folder: reason of exclusion}), sorted by name.

        Folders with other names, such as unfinished copies, are ignored.
        """
        sound, left_out = {}, {}
        folder = self.folder / "submissions"
        paths = [path for path in folder.iterdir() if NAME.fullmatch(path.name)] if folder.is_dir() else []
        for path in sorted(paths, key=lambda path: (path.name != self.settings.baseline, path.name)):
            try:
                submission = read_submission(path)
                if submission.name != path.name:
                    raise InputError(f"has the name {submission.name!r} in its {CARD}")
                if other := sound.get(alike(submission.name)):
                    raise InputError(f"differs from {other.name!r} only in '_' and '-'")
                sound[alike(submission.name)] = submission
            except InputError as error:
                left_out[path.name] = str(error)
        return sorted(sound.values(), key=lambda each: each.name), left_out

    def add(self, source: Path | str) -> str:
        """Copy a submission into the board without running its code; return its name.

        Raises: InputError if the submission is not valid, or if its name is taken or too similar to another.
        """
        submission = read_submission(source)
        target = self.folder / "submissions" / submission.name
        if target.exists():
            if read_submission(target).digest == submission.digest:
                return submission.name
            raise InputError(
                f"submission {submission.name!r}: the board has another submission of this name: change the"
                f" name in {CARD}"
            )
        others = [each.name for each in self.submissions() if alike(each.name) == alike(submission.name)]
        if others:
            raise InputError(
                f"submission {submission.name!r}: the board has {others[0]!r}, which readers would"
                f" confuse with it: change the name in {CARD}"
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished = target.with_name(f".{submission.name}-{time.monotonic_ns()}")
        try:
            copy_files(source, unfinished)
            unfinished.rename(target)
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise
        return submission.name


def new_board(
    folder: Path | str, title: str = "Controllers of floating wind turbines", platform: str | None = None
) -> Board:
    """Create a board with the package's controllers as first submissions, and return the Board.

    platform: name or path of the platform to which the suites are scaled; None: platform of the suites.
    Raises: InputError if the folder already has a board, and for a platform that cannot be read.
    """
    folder = Path(folder)
    if platform is not None:
        turbine_of(platform)
    if (folder / SETTINGS).exists():
        raise InputError(f"board {str(folder)!r}: exists already")
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
    """Write a file of secret seeds, readable only by this user; return its SHA-256, which may be published.

    A salt in the file prevents recovery of the seeds from the hash.
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
    """Return (secret seeds of the organiser, SHA-256 of the file) from a file of write_secret_seeds.

    path: "-" for standard input, which hides the file's path from other processes.
    Raises: InputError, also for a file without a salt and for seeds that can be guessed.
    """
    where = f"secret seeds {str(path)!r}"
    if str(path) == "-":
        content = sys.stdin.buffer.read()
    elif Path(path).is_file():
        content = Path(path).read_bytes()
    else:
        raise InputError(f"{where}: does not exist; create it with fowt dev leaderboard seeds")
    first, *lines = content.decode("ascii", "replace").split("\n")
    words = [line.strip() for line in lines if line.strip()]
    if not SALT.fullmatch(first.strip()):
        raise InputError(
            f"{where}: must begin with a line of 'salt' and 32 or more hexadecimal digits, without which the"
            " hash would reveal the seeds; create the file with fowt dev leaderboard seeds"
        )
    if not words or not all(word.isdecimal() and len(word) < 20 for word in words):
        raise InputError(f"{where}: must contain whole numbers, one per line, after the salt")
    seeds = tuple(int(word) for word in words)
    if len(set(seeds)) < len(seeds):
        raise InputError(f"{where}: a seed occurs twice")
    if not all(LEAST_SECRET <= seed < DRAWN.stop for seed in seeds):
        raise InputError(
            f"{where}: {min(seeds)} to {max(seeds)}: must be from 2**40 (smaller seeds can be guessed) to"
            " 2**63 - 1"
        )
    return seeds, hashlib.sha256(content).hexdigest()
