"""Reads and writes the results folder of an evaluation, which can be interrupted and resumed.

    manifest.json                              settings: versions, suite, cases, controllers
    runs/<controller>/<case>_seed<n>.parquet   time series of one run, with its table row in the metadata
    results.csv                                one row per run, columns evaluate.COLUMNS
    leaderboard.json                           means, intervals and paired differences (leaderboard.py)

A run is finished when its Parquet file exists, which is written atomically. results.csv and leaderboard.json
are made from the Parquet files, so an interrupted evaluation neither loses nor repeats a finished run.
"""

import hashlib
import io
import json
import re
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

import fowt_env
from fowt_env.descriptions.files import parse_json
from fowt_env.descriptions.records import validate
from fowt_env.errors import InputError
from fowt_env.files.atomic import remove_leftovers, replacing
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation import provenance
from fowt_env.training.evaluation.failures import with_lost_power
from fowt_env.training.evaluation.guard import printable
from fowt_env.training.evaluation.locks import locked
from fowt_env.training.evaluation.run_case import FAILED, STATUSES

FORMAT = 4  # version of the folder's files
ROW_KEY = b"fowt_env.row"
TABLE_EVERY = 2.0  # s between updates of results.csv during an evaluation
PLAIN_NAME = re.compile(r"[a-z0-9_][a-z0-9_.-]{0,99}")  # distinct on every file system
LONGEST_NAME = 500


def run_file(folder, label, case, seed):
    """Return the path of a run's time series; a name that is not a PLAIN_NAME gets a hash."""
    return Path(folder) / file_name(label) / f"{file_name(case)}_seed{seed}.parquet"


def file_name(text):
    """Return a PLAIN_NAME unchanged, or the readable characters of another name and a hash."""
    if PLAIN_NAME.fullmatch(text):
        return text
    readable = re.sub(r"[^A-Za-z0-9_.-]", "_", text).lstrip(".")[:80]
    return f"{readable}-{hashlib.sha256(text.encode('utf-8')).hexdigest()[:6]}"


def check_name(what, name):
    """Return the name of a controller or case. Raises: InputError for an unusable name."""
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > LONGEST_NAME:
        shown = printable(name) if isinstance(name, str) else type(name).__name__
        raise InputError(f"{what} {shown!r} must be a printable text of at most {LONGEST_NAME} characters")
    return name


def run_content(frame, row):
    """Return the Parquet file of a run as bytes: time series (None: no rows), table row in the metadata."""
    if frame is None:
        frame = pd.DataFrame({"Time_[s]": pd.Series(dtype="float64")})
    table = pa.Table.from_pandas(frame, preserve_index=False)
    content = io.BytesIO()
    pq.write_table(
        table.replace_schema_metadata({**table.schema.metadata, ROW_KEY: _json(row).encode()}), content
    )
    return content.getvalue()


def write_run(content, path):
    """Write the bytes of `run_content` to the file of a run atomically; return its path."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return path


class _Row(BaseModel):
    """Defines the row of a run; further columns are numbers."""

    model_config = ConfigDict(strict=True, extra="allow")
    __pydantic_extra__: dict[str, float | None]
    controller: Annotated[str, AfterValidator(lambda name: check_name("the name", name))]
    case: Annotated[str, AfterValidator(lambda name: check_name("the name", name))]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    status: Literal[STATUSES]
    reason: str
    events: str
    warning: str


class _Manifest(BaseModel):
    """Defines manifest.json, except for its format."""

    model_config = ConfigDict(strict=True)
    fowt_env: str
    plant: str
    versions: dict
    created: str
    suite: dict | None
    options: dict
    cases: dict[str, dict]
    seeds: list[int]
    controllers: dict


def read_row(path):
    """Return the row {column: value} from a run's file. Raises: InputError for any other file."""
    try:
        metadata = pq.read_schema(path).metadata or {}
        row = parse_json(metadata[ROW_KEY].decode("utf-8"))
        problems = validate(_Row, row)[1]
    except (KeyError, ValueError, RecursionError, OSError, MemoryError, pa.ArrowException) as error:
        problems = [str(error)]
    if problems:
        raise InputError(
            f"{str(path)!r} is not a run of an evaluation ({printable(problems[0]):.300}); remove it to run"
            " it again"
        )
    row |= {name: printable(row[name]) for name in ("reason", "warning")}
    return {key: float("nan") if value is None else value for key, value in row.items()}


def _json(value, **options):
    """Return JSON text with null for NaN and infinity."""
    return json.dumps(finite(value), allow_nan=False, **options)


def finite(value):
    """Return nested mappings and sequences with None for NaN and infinity."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def write_json(value, path):
    """Write a JSON file atomically; return the path."""
    with replacing(path) as temporary:
        Path(temporary).write_text(_json(value, indent=1) + "\n", encoding="utf-8")
    return path


class ResultsFolder:
    """Represents the locked folder of an evaluation, with the rows of its runs.

    settings: {"suite", "options", "cases" {name: description}, "seeds", "controllers" {label: code}}.
    Controllers, cases and seeds may be added to a folder; no other setting may change.
    again: keys (controller, case, seed) of runs to repeat if they failed.
    """

    def __init__(self, folder, settings, columns, again):
        self.name = Path(folder)  # used in messages
        self.folder = self.name.absolute()  # a controller may change the working folder
        self.columns = list(columns)
        self.rows = {}  # (controller, case, seed) -> row
        self.written = 0.0
        fixed = {"fowt_env": fowt_env.__version__, "plant": provenance.plant_code()}
        fixed |= {key: settings[key] for key in ("suite", "options")}
        old = self._manifest()
        for folder in (self.folder, *self.folder.glob("runs/*/")):
            remove_leftovers(folder)
        for path in sorted(self.folder.glob("runs/*/[!.]*.parquet")):
            row = read_row(path)
            key = row["controller"], row["case"], row["seed"]
            if run_file(self.folder / "runs", *key) != path:
                raise InputError(f"{str(path)!r} contains the run {', '.join(map(str, key))}: remove it")
            if row["status"] != FAILED or key not in again:
                self.rows[key] = row
        if old is not None:
            self._compare(old, fixed, settings)
        elif self.rows or (self.folder / "results.csv").exists():
            raise self._refused("contains runs but no manifest.json")
        else:
            old = {"versions": {}, "seeds": [], "cases": {}, "controllers": {}}
            old["created"] = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        self.manifest = {
            "format": FORMAT,
            **json.loads(_json(fixed)),
            "versions": provenance.versions() | old["versions"],
            "created": old["created"],
            "seeds": sorted({*old["seeds"], *settings["seeds"]}),
            **{key: old[key] | dict(settings[key]) for key in ("cases", "controllers")},
        }
        path = self.folder / "manifest.json"
        self._before = path.read_bytes() if path.exists() else None
        write_json(self.manifest, path)

    def _manifest(self):
        path = self.folder / "manifest.json"
        if not path.exists():
            return None
        try:
            old = parse_json(path.read_text(encoding="utf-8"))
        except ValueError:
            raise self._refused("has a manifest.json that is not valid JSON") from None
        version = old.get("format") if isinstance(old, dict) else None
        if version != FORMAT:
            raise self._refused(f"has format {version}, not {FORMAT}")
        if problems := validate(_Manifest, old)[1]:
            raise self._refused(f"has a manifest.json that cannot be used ({problems[0]})")
        return old

    def _compare(self, old, fixed, settings):
        """Compare the settings with those of the manifest. Raises: InputError if they do not match."""
        if old["fowt_env"] != fixed["fowt_env"]:
            raise self._refused(f"was made by fowt_env {old['fowt_env']}, not {fixed['fowt_env']}")
        if old["plant"] != fixed["plant"]:
            raise self._refused("was made with other sources of this package")
        if gap := provenance.version_gap(old["versions"], provenance.versions()):
            raise self._refused(f"was made with {gap[0]}, not {gap[1]}")
        now = json.loads(_json(settings))
        for key in ("suite", "options"):
            if old[key] != now[key]:
                raise self._refused(f"was made with {key} {_short(old[key])}, not {_short(now[key])}")
        for name, case in now["cases"].items():
            before = old["cases"].get(name, case)
            for key in sorted({*before, *case}):
                if before.get(key) != case.get(key):
                    raise self._refused(
                        f"was made with another case {name!r}: {key} = {before.get(key)}, now {case.get(key)}"
                    )
        for label, code in now["controllers"].items():
            done = {row["status"] for key, row in self.rows.items() if key[0] == label}
            if old["controllers"].get(label, code) != code and done:
                runs = run_file(self.name / "runs", label, "", 0).parent
                failed = ", or use --retry-failed" if done == {FAILED} else ""
                raise InputError(
                    f"results folder {str(self.name)!r}: controller {label!r} or its code has changed since"
                    f" its runs there; remove {str(runs)!r} to run them again, or choose another"
                    f" folder{failed}"
                )

    def _refused(self, why):
        return InputError(
            f"results folder {str(self.name)!r} {why}: choose another folder (--out), or remove this one"
        )

    def add(self, row):
        """Add the row of a run after its file has been written."""
        self.rows[row["controller"], row["case"], row["seed"]] = row
        if time.monotonic() - self.written > TABLE_EVERY:
            self.write()

    def table(self):
        """Return a DataFrame of all runs, by case, seed and controller in the manifest's order."""
        table = pd.DataFrame(list(self.rows.values()), columns=self.columns)
        order = table[["seed"]].assign(  # names missing in the manifest come last
            **{
                key: table[key].map({name: index for index, name in enumerate(self.manifest[f"{key}s"])})
                for key in ("case", "controller")
            }
        )
        table = table.loc[order.sort_values(["case", "seed", "controller"]).index].reset_index(drop=True)
        faulty = {name for name, case in self.manifest["cases"].items() if case.get("fault") is not None}
        return with_lost_power(table, faulty)

    def withdraw(self):
        """Restore manifest.json as it was before these settings, or remove it if there was none."""
        path = self.folder / "manifest.json"
        if self._before is None:
            path.unlink()
        else:
            with replacing(path) as temporary:
                temporary.write_bytes(self._before)

    def write(self):
        """Write results.csv."""
        write_table(self.table(), self.folder / "results.csv")
        self.written = time.monotonic()


def _short(value):
    """Return the text of a setting for a message."""
    if isinstance(value, dict) and "name" in value:
        drawn = value.get("drawn")
        seeds = f" with seeds drawn from {drawn['hash'][:12]}" if isinstance(drawn, dict) else ""
        return f"{value['name']!r} version {value.get('version')}{seeds}"
    return str(value)


@contextmanager
def open_results(folder, settings, columns, again=()):
    """Yield the ResultsFolder, locked against other processes; results.csv is written at the end.

    If the block raises InputError before a run is added, as for a controller that refuses the cases, the
    folder is left as it was.
    Raises: InputError if the folder is in use, or has runs of another version or other settings.
    """
    what = f"results folder {str(folder)!r}"
    with locked(Path(folder).absolute(), what, "another evaluation is writing to it"):
        results = ResultsFolder(folder, settings, columns, again)
        finished = len(results.rows)
        try:
            yield results
        except InputError:
            if len(results.rows) == finished:
                results.withdraw()
            raise
        finally:
            if results.rows:
                results.write()
