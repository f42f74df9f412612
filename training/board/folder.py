"""The folder of a standing board: its settings, its frozen suites, its submissions, what was judged.

board.toml            seeds, limits, and the suites of each regime
suites/*.toml         copies of the suites, taken when the board was made: a later version changes no board
submissions/NAME/     what was added
runs/                 results folders of the public seeds, one for each suite and kind of preview
history.csv           a row for every submission, regime and judging
board.csv, index.html what was judged last
"""

import json
import shutil
import time
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field

from fowt_env.descriptions.files import raise_problems, read_toml
from fowt_env.descriptions.records import Positive, Record, validate
from fowt_env.descriptions.turbine import Turbine
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.board.isolated import TimeLimits
from fowt_env.training.board.submission import CARD, read_submission
from fowt_env.training.evaluation.cases import FOLDER as SUITES
from fowt_env.training.evaluation.cases import Seeds, Suite, read_suite
from fowt_env.training.evaluation.scaling import turbine_of
from fowt_env.training.evaluation.seeds import TEST

SETTINGS = "board.toml"
DEFAULT_PLATFORM = "oc3_hywind"  # of the suites
ENTRIES = Path(__file__).parent / "entries"  # cards of the package's own controllers
REGIMES = (  # name, suites: of a new board
    ("in distribution", ("above_rated",)),
    ("gusts", ("gusts", "settling")),
    ("off design", ("shifted",)),
)


class Regime(Record):
    """Suites that are read together: the winds a controller was made for, gusts, plants that it does not
    know."""

    name: str
    suites: Annotated[tuple[str, ...], BeforeValidator(tuple)] = Field(min_length=1)


class BoardFile(Record):
    """The text of board.toml."""

    title: str
    platform: str | None = None  # on which its suites run; None: that of each suite
    baseline: str = "gspi_oc3"
    seeds: Seeds
    call_limit: Positive = 0.1  # s, of one call of a controller's act()
    prepare_limit: Positive = 300.0  # s
    memory: Positive = 4e9  # bytes
    regime: tuple[Regime, ...]


class Board:
    """A board's folder. Raises: InputError for a folder that is none, or whose settings cannot be used."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        path = self.folder / SETTINGS
        if not path.is_file():
            raise InputError(
                f"board {str(folder)!r}: has no {SETTINGS}: make one with fowt leaderboard add, or give"
                f" another"
                " --board"
            )
        self.settings, problems = validate(BoardFile, read_toml(path, "board"))
        raise_problems(f"board {str(folder)!r}", problems)
        names = [name for regime in self.settings.regime for name in regime.suites]
        for name in names:
            if names.count(name) > 1:
                problems.append(f"regime: suite {name!r} is named twice")
            elif not self._suite_path(name).is_file():
                problems.append(f"regime: there is no suites/{name}.toml")
        raise_problems(f"board {str(folder)!r}", sorted(set(problems)))

    def _suite_path(self, name):
        return self.folder / "suites" / f"{name}.toml"

    def suite(self, name: str) -> Suite:
        """The board's own copy of a suite."""
        return read_suite(self._suite_path(name), self.settings.platform)

    @property
    def turbine(self) -> Turbine:
        """Turbine of the board's platform, which controllers are made for."""
        return turbine_of(self.settings.platform or DEFAULT_PLATFORM)

    @property
    def limits(self) -> TimeLimits:
        """Limits of controllers that run in a process of their own."""
        s = self.settings
        return TimeLimits(prepare=s.prepare_limit, call=s.call_limit, memory=s.memory)

    def submissions(self) -> list:
        """Submissions of the board, by name."""
        folder = self.folder / "submissions"
        return (
            [read_submission(path) for path in sorted(folder.iterdir()) if path.is_dir()]
            if folder.is_dir()
            else []
        )

    def add(self, source: Path | str) -> str:
        """Copy a submission into the board; its name. Nothing of it is run.

        Raises: InputError where it is not sound, or one of another content has its name.
        """
        submission = read_submission(source)
        place = self.folder / "submissions" / submission.name
        if place.exists():
            if read_submission(place).digest == submission.digest:
                return submission.name
            raise InputError(
                f"submission {submission.name!r}: the board has another one of this name, which is kept: give"
                f" {CARD} another name"
            )
        place.parent.mkdir(parents=True, exist_ok=True)
        waiting = place.with_name(f".{submission.name}-{time.monotonic_ns()}")
        try:
            shutil.copytree(source, waiting, ignore=shutil.ignore_patterns("__pycache__"))
            waiting.rename(place)
        except BaseException:
            shutil.rmtree(waiting, ignore_errors=True)
            raise
        return submission.name


def new_board(
    folder: Path | str, title: str = "Controllers of floating wind turbines", platform: str | None = None
) -> Board:
    """A new board with the package's own controllers as its first submissions.

    platform: a name or a path, to whose turbine the suites are scaled; None: the suites' own.
    Raises: InputError where there is one already, and for a platform that cannot be read.
    """
    folder = Path(folder)
    if platform is not None:
        turbine_of(platform)
    if (folder / SETTINGS).exists():
        raise InputError(f"board {str(folder)!r}: is there already")
    seeds = read_suite(REGIMES[0][1][0]).seeds
    (folder / "suites").mkdir(parents=True, exist_ok=True)
    lines = [
        f'title = "{title}"',
        'baseline = "gspi_oc3"',
        f"seeds = {list(seeds)} # public",
        "call_limit = 0.1 # s",
    ]
    if platform is not None:
        lines.insert(1, f"platform = {json.dumps(str(platform))}")
    for name, suites in REGIMES:
        lines += ["", "[[regime]]", f'name = "{name}"', f"suites = {list(suites)}".replace("'", '"')]
        for suite in suites:
            shutil.copy(SUITES / f"{suite}.toml", folder / "suites")
    with replacing(folder / SETTINGS) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    board = Board(folder)
    for entry in sorted(ENTRIES.iterdir()):
        if entry.is_dir():
            board.add(entry)
    return board


def read_seeds(path: Path | str) -> tuple[int, ...]:
    """The organiser's secret seeds: a text file of whole numbers, a line each. Raises: InputError."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"secret seeds {str(path)!r}: there is no such file")
    words = path.read_text(encoding="utf-8").split()
    if not words or not all(word.isdigit() for word in words):
        raise InputError(f"secret seeds {str(path)!r}: must hold whole numbers, one a line")
    seeds = tuple(int(word) for word in words)
    if len(set(seeds)) < len(seeds):
        raise InputError(f"secret seeds {str(path)!r}: a seed stands there twice")
    for seed in seeds:
        if seed in TEST:
            raise InputError(
                f"secret seeds {str(path)!r}: {seed} is a published one: take seeds from {TEST.stop} on"
            )
    return seeds
