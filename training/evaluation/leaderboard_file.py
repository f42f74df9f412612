"""Writes leaderboard.json of a results folder, and checks such a file before use in a page.

The whole file is checked at once, since another version may have written it; unknown keys are ignored.
"""

import json
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from fowt_env.descriptions.records import validate
from fowt_env.errors import InputError
from fowt_env.training.evaluation.bootstrap import LEAST_SEEDS, LEVEL
from fowt_env.training.evaluation.cases import Limits, Score
from fowt_env.training.evaluation.failures import KINDS, lost_text
from fowt_env.training.evaluation.leaderboard import leaderboard
from fowt_env.training.evaluation.results import write_json

COPIED = ("format", "fowt_env", "plant", "versions", "suite", "options", "created")  # keys from the manifest

WholeNumber = Annotated[int, Field(ge=0, le=10**9)]
FiniteNumber = Annotated[float, Field(ge=-1e300, le=1e300)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True)


class Statistic(_Part):
    """Holds a mean or a difference with the ends of its interval (null: no interval).

    A difference also has percent, relative to the baseline's mean, and a two-sided p-value.
    """

    mean: FiniteNumber | None
    low: FiniteNumber | None = None
    high: FiniteNumber | None = None
    percent: FiniteNumber | None = None
    p: Annotated[float, Field(ge=0, le=1)] | None = None


class Figures(_Part):
    """Holds run counts and metrics of a controller, over all cases or in one."""

    runs: WholeNumber
    failed: WholeNumber
    tripped: WholeNumber = 0
    lost_power: WholeNumber = 0
    metrics: dict[str, Statistic]
    difference: dict[str, Statistic]

    @property
    def lost(self):
        """Return the number of lost runs."""
        return self.failed + self.tripped + self.lost_power

    @property
    def lost_text(self):
        """Return the lost runs as "1 failed, 2 tripped", or "" without lost runs."""
        return lost_text({name: getattr(self, name) for name in KINDS})


class ScoreFigures(Statistic):
    """Holds the score that ranks, that of lifetime means, and the mean of those of single cases."""

    lifetime: Statistic | None = None
    winds: Statistic | None = None


class LeaderboardEntry(Figures):
    """Holds the results of a controller; beyond, undecided: limits that are exceeded and not decided."""

    controller: str
    rank: WholeNumber | None = None
    beyond: list[str] = []
    undecided: list[str] = []
    held: bool | None = None
    score: ScoreFigures | None = None
    cases: dict[str, Figures] = {}


class Interval(_Part):
    """Holds the level and method of the confidence intervals."""

    level: Annotated[float, Field(gt=0, lt=1)] = LEVEL
    method: str = ""
    least_seeds: Annotated[int, Field(ge=1, le=10**9)] = LEAST_SEEDS


class LeaderboardFile(_Part):
    """Defines the content of leaderboard.json."""

    baseline: str | None
    interval: Interval = Interval()
    penalty: FiniteNumber | None = None
    controllers: list[LeaderboardEntry]


def check_leaderboard(content, path):
    """Return the LeaderboardFile of parsed JSON. Raises: InputError that names the first wrong keys."""
    board, problems = validate(LeaderboardFile, content)
    if problems:
        raise InputError(
            f"{str(path)!r} does not match this version ({'; '.join(problems[:3])}): run fowt evaluate on the"
            " folder again, or remove the file to show the means of results.csv"
        )
    return board


def write_leaderboard(table, folder, baseline=None):
    """Return the leaderboard of a results folder, and write it to the folder's leaderboard.json.

    Suite, score and limits are read from the folder's manifest.json.
    Raises: InputError for a baseline that was not evaluated.
    """
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    suite = manifest["suite"] or {}
    rules = {
        key: None if suite.get(key) is None else kind(**suite[key])
        for key, kind in (("score", Score), ("limits", Limits))
    }
    board = {key: manifest[key] for key in COPIED} | leaderboard(table, baseline, **rules)
    write_json(board, folder / "leaderboard.json")
    return board
