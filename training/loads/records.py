"""Defines the records of a design load table: one run of a load case, and how a finished run is stored.

    runs/<controller>/<name>_seed<n>.zip    run.json: its row; statistics.npz: its RunStatistics

A run is finished when its file exists, which is written atomically. Time series are not kept.
"""

import io
import json
import zipfile
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Literal

from fowt_env.descriptions.files import parse_json
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.guard import printable
from fowt_env.training.evaluation.results import file_name, finite
from fowt_env.training.evaluation.run_case import STATUSES

ANALYSES = ("ultimate", "fatigue", "both")
SAFETY_CLASSES = ("normal", "abnormal", "fatigue")
# how a characteristic extreme follows from the extremes of the realisations of one condition
CHARACTERISTICS = ("largest", "mean", "upper_half", "extrapolated")
HOUR = 3600.0  # s
ROW, STATISTICS = "run.json", "statistics.npz"


@dataclass(frozen=True)
class LoadCase:
    """Defines one run of a design load table: a Case with its seed, controller, class and partial factor.

    Runs with equal dlc and name are realisations of one condition (seeds), for each controller the same.
    Directions are headings towards which wind and waves travel (deg, from +x towards +y) seen from the
    turbine, whose rotor faces -x.
    """

    dlc: str  # number of the design load case, "1.2"
    name: str  # of the condition, without the seed: "dlc1_2_u12_s1"
    description: str
    case: Case  # what is simulated
    controller: str  # label; "parked" for a turbine that is not operating
    seed: int
    duration: float  # s, with the transient at the start
    skip: float  # s of transient, not counted in statistics
    analysis: Literal[ANALYSES]
    safety: Literal[SAFETY_CLASSES]
    factor: float  # partial safety factor for loads; 1 for fatigue
    factor_source: str
    source: str = ""  # of the definition of the design load case
    characteristic: Literal[CHARACTERISTICS] = "largest"
    wind_speed: float | None = None  # m/s, mean at hub height: centre of the wind bin
    wind_bin: tuple[float, float] | None = None  # m/s, edges
    Hs: float = 0.0  # m
    Tp: float = nan  # s
    wind_direction: float = 0.0  # deg
    wave_direction: float = 0.0  # deg
    yaw_error: float = 0.0  # deg, rotor axis relative to the wind
    # h per year that this run stands for: probability of its bin, sea and direction, divided by the number of
    # seeds, or events per year times the length of the run; 0: not in the lifetime's fatigue
    hours_per_year: float = 0.0

    @property
    def misalignment(self):
        """Return the direction of the waves relative to the wind, deg in (-180, 180]."""
        return 180.0 - (180.0 - self.wave_direction + self.wind_direction) % 360.0

    @property
    def hours(self):
        """Return the length of the record that is counted, h."""
        return (self.duration - self.skip) / HOUR

    @property
    def condition(self):
        """Return the key that the realisations of one condition share: (dlc, name)."""
        return self.dlc, self.name

    @property
    def key(self):
        """Return the key of the run within its table: (controller, name, seed)."""
        return self.controller, self.name, self.seed


@dataclass(frozen=True)
class FinishedRun:
    """Holds the outcome of a LoadCase: status and reason, and RunStatistics unless it failed."""

    controller: str
    name: str
    seed: int
    status: Literal[STATUSES]
    reason: str = ""
    stopped: float = nan  # s, time at which protection or an error ended the run
    events: str = ""  # rare numerical events, with their counts
    warning: str = ""
    wall_time: float = nan  # s
    statistics: object = None  # training.loads.statistics.RunStatistics

    @property
    def key(self):
        """Return the key of the run within its table: (controller, name, seed)."""
        return self.controller, self.name, self.seed


ROW_KEYS = tuple(name for name in FinishedRun.__dataclass_fields__ if name != "statistics")


def run_path(folder, key):
    """Return the path of the file of a run with a key (controller, name, seed) in the folder of a table."""
    label, name, seed = key
    return Path(folder) / "runs" / file_name(label) / f"{file_name(name)}_seed{seed}.zip"


def run_content(finished):
    """Return the file of a FinishedRun as bytes: a ZIP archive of its row and its statistics."""
    row = {key: getattr(finished, key) for key in ROW_KEYS}
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(ROW, json.dumps(finite(row), allow_nan=False))
        if finished.statistics is not None:
            with archive.open(STATISTICS, "w") as file:
                finished.statistics.save(file)
    return content.getvalue()


def write_run(content, path):
    """Write the bytes of `run_content` to the file of a run atomically; return its path."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return path


def read_run(path):
    """Return the FinishedRun of a file. Raises: InputError for any other file."""
    try:
        with zipfile.ZipFile(path) as archive:
            row = parse_json(archive.read(ROW).decode("utf-8"))
            values = _checked_row(row)
            statistics = None
            if STATISTICS in archive.namelist():
                from fowt_env.training.loads.statistics import RunStatistics

                statistics = RunStatistics.load(io.BytesIO(archive.read(STATISTICS)))
        return FinishedRun(**values, statistics=statistics)
    except (KeyError, ValueError, TypeError, EOFError, OSError, RecursionError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{str(path)!r} is not a run of a load table ({printable(str(error)):.300}); remove it to run it"
            " again"
        ) from None


def _checked_row(row):
    """Return the values of a row; null as NaN. Raises: ValueError for a row with other keys or types."""
    if not isinstance(row, dict) or set(row) != set(ROW_KEYS):
        raise ValueError(f"{ROW} must have the keys {', '.join(ROW_KEYS)}")
    texts = ("controller", "name", "status", "reason", "events", "warning")
    if not all(isinstance(row[key], str) for key in texts):
        raise ValueError(f"{', '.join(texts)} must be texts")
    if row["status"] not in STATUSES:
        raise ValueError(f"status = {row['status']!r}: must be one of {', '.join(STATUSES)}")
    if type(row["seed"]) is not int or row["seed"] < 0:
        raise ValueError("seed must be a whole number >= 0")
    numbers = {key: nan if row[key] is None else float(row[key]) for key in ("stopped", "wall_time")}
    return row | numbers | {key: printable(row[key]) for key in ("reason", "warning")}
