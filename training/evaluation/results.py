"""The results folder of an evaluation, which can be interrupted and resumed.

    manifest.json                              settings: versions, suite, cases, controllers
    runs/<controller>/<case>_seed<n>.parquet   time series of one run, its row of the table in the metadata
    results.csv                                one row per run, columns evaluate.COLUMNS
    leaderboard.json                           means, intervals and paired differences (leaderboard.py)

A run is finished when its Parquet file exists, which is written whole or not at all. results.csv and
leaderboard.json are made from those files, so an interrupted evaluation loses and repeats nothing.
"""

import hashlib
import io
import json
import re
import time
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

import fowt_env
from fowt_env.descriptions.checks import is_number, is_whole
from fowt_env.descriptions.files import parse_json
from fowt_env.errors import InputError
from fowt_env.files.atomic import remove_leftovers, replacing
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation import provenance
from fowt_env.training.evaluation.failures import with_lost_power
from fowt_env.training.evaluation.guard import printable
from fowt_env.training.evaluation.locks import locked
from fowt_env.training.evaluation.run_case import FAILED, STATUSES

FORMAT = 4  # version of the folder's files
MANIFEST = {  # types of the keys of manifest.json, beside its format
    "fowt_env": str, "plant": str, "versions": dict, "created": str, "suite": dict | None, "options": dict,
    "cases": dict, "seeds": list, "controllers": dict,
}  # fmt: skip
ROW_KEY = b"fowt_env.row"
TABLE_EVERY = 2.0  # s between rewritings of results.csv while runs go on
PLAIN_NAME = re.compile(r"[a-z0-9_][a-z0-9_.-]{0,99}")  # distinct on every file system
LONGEST_NAME = 500
TEXTS = ("controller", "case", "status", "reason", "events", "warning")  # of a row; the others are numbers


def run_file(folder, label, case, seed):
    """Return the path of a run's time series; a name that is no plain file name gets a hash."""
    return Path(folder) / file_name(label) / f"{file_name(case)}_seed{seed}.parquet"


def file_name(text):
    """Return a name itself if it is a PLAIN_NAME, else its readable characters and a hash."""
    if PLAIN_NAME.fullmatch(text):
        return text
    readable = re.sub(r"[^A-Za-z0-9_.-]", "_", text).lstrip(".")[:80]
    return f"{readable}-{hashlib.sha256(text.encode('utf-8')).hexdigest()[:6]}"


def check_name(what, name):
    """Check the name of a controller or case. Raises: InputError."""
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > LONGEST_NAME:
        shown = printable(name) if isinstance(name, str) else type(name).__name__
        raise InputError(f"{what} {shown!r} must be a printable text of at most {LONGEST_NAME} characters")


def run_content(frame, row):
    """Return the Parquet file of a run as bytes: its time series (None: no rows), its row in the metadata."""
    if frame is None:
        frame = pd.DataFrame({"Time_[s]": pd.Series(dtype="float64")})
    table = pa.Table.from_pandas(frame, preserve_index=False)
    content = io.BytesIO()
    pq.write_table(
        table.replace_schema_metadata({**table.schema.metadata, ROW_KEY: _json(row).encode()}), content
    )
    return content.getvalue()


def write_run(content, path):
    """Write the file of a run, of the bytes of `run_content`, whole or not at all; return its path."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return path


def read_row(path):
    """Return the row {column: value} of a run's file. Raises: InputError for any other file."""
    try:
        metadata = pq.read_schema(path).metadata or {}
        row = parse_json(metadata[ROW_KEY].decode("utf-8"))
        _check_row(row)
    except (KeyError, ValueError, RecursionError, OSError, MemoryError, pa.ArrowException) as error:
        raise InputError(
            f"{str(path)!r} is no run of an evaluation ({error!s:.300}); remove it to run it again"
        ) from None
    row |= {name: printable(row[name]) for name in ("reason", "warning")}
    return {key: float("nan") if value is None else value for key, value in row.items()}


def _check_row(row):
    """Check the row of a run. Raises: ValueError."""
    if not isinstance(row, dict) or {*TEXTS, "seed"} - set(row):
        raise ValueError(f"its row lacks one of {', '.join((*TEXTS, 'seed'))}")
    for name, value in row.items():
        if name in TEXTS:
            sound = isinstance(value, str)
        elif name == "seed":
            sound = is_whole(value) and 0 <= value < 2**63
        else:
            sound = value is None or is_number(value)
        if not sound:
            raise ValueError(f"its row has {name} = {printable(repr(value))}")
    for name in ("controller", "case"):
        check_name(f"its row's {name}", row[name])
    if row["status"] not in STATUSES:
        raise ValueError(f"its row has status = {printable(row['status'])!r}, none of {', '.join(STATUSES)}")


def _json(value, **options):
    """Return JSON text with null for NaN and infinity."""
    return json.dumps(finite(value), allow_nan=False, **options)


def finite(value):
    """Return a value of mappings, sequences and numbers with None for NaN and infinity."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def write_json(value, path):
    """Write JSON, whole or not at all; return the path."""
    with replacing(path) as temporary:
        Path(temporary).write_text(_json(value, indent=1) + "\n", encoding="utf-8")
    return path


class ResultsFolder:
    """The locked folder of an evaluation, with the rows of its runs.

    settings: {"suite", "options", "cases" {name: description}, "seeds", "controllers" {label: code}}.
    Controllers, cases and seeds may be added to a folder; any other setting must not change.
    again: keys (controller, case, seed) of runs to repeat if they failed.
    """

    def __init__(self, folder, settings, columns, again=()):
        self.name = Path(folder)  # for messages
        self.folder = self.name.absolute()  # a controller may change the working folder
        self.columns = list(columns)
        self.again = frozenset(again)
        self.settings = settings
        self.rows = {}  # (controller, case, seed) -> row
        self.written = 0.0

    def _open(self):
        """Check the folder, join the settings and read the rows of finished runs."""
        wanted = {
            "format": FORMAT,
            "fowt_env": fowt_env.__version__,
            "plant": provenance.plant_code(),
            **{key: self.settings[key] for key in ("suite", "options")},
        }
        wanted = json.loads(_json(wanted))
        old = self._manifest()
        for folder in (self.folder, *self.folder.glob("runs/*/")):
            remove_leftovers(folder)
        for path in sorted(self.folder.glob("runs/*/[!.]*.parquet")):
            row = read_row(path)
            key = row["controller"], row["case"], row["seed"]
            if run_file(self.folder / "runs", *key) != path:
                raise InputError(f"{str(path)!r} contains the run {', '.join(map(str, key))}: remove it")
            if row["status"] != FAILED or key not in self.again:
                self.rows[key] = row
        parts = {key: dict(self.settings[key]) for key in ("cases", "controllers")}
        seeds = list(self.settings["seeds"])
        if old is not None:
            self._compare(old, wanted)
            for key in parts:
                parts[key] = old[key] | parts[key]
            seeds = sorted({*old["seeds"], *seeds})
        elif self.rows or (self.folder / "results.csv").exists():
            raise self._refused("contains runs but no manifest.json")
        created = time.strftime("%Y-%m-%dT%H:%M:%S%z") if old is None else old["created"]
        self.manifest = {
            **wanted,
            "versions": provenance.versions() | ({} if old is None else old["versions"]),
            "created": created,
            "seeds": seeds,
            **parts,
        }
        write_json(self.manifest, self.folder / "manifest.json")

    def _manifest(self):
        path = self.folder / "manifest.json"
        if not path.exists():
            return None
        try:
            old = parse_json(path.read_text(encoding="utf-8"))
        except ValueError:
            raise self._refused("has a manifest.json that is not valid JSON") from None
        if not isinstance(old, dict) or old.get("format") != FORMAT:
            raise self._refused(
                f"has format {old.get('format') if isinstance(old, dict) else None}, not {FORMAT}"
            )
        for key, kind in MANIFEST.items():
            if key not in old or not isinstance(old[key], kind):  # a suite may be null, not absent
                raise self._refused(f"has a manifest.json without a sound {key!r}")
        sound = all(type(seed) is int for seed in old["seeds"])
        if not sound or not all(isinstance(case, dict) for case in old["cases"].values()):
            raise self._refused("has a manifest.json with wrong seeds or cases")
        return old

    def _compare(self, old, wanted):
        """Compare the settings with those of the manifest. Raises: InputError if they do not match."""
        if old["fowt_env"] != wanted["fowt_env"]:
            raise self._refused(f"was made by fowt_env {old['fowt_env']}, this is {wanted['fowt_env']}")
        if old["plant"] != wanted["plant"]:
            raise self._refused("was made by another state of this package's sources")
        if gap := provenance.version_gap(old["versions"], provenance.versions()):
            raise self._refused(f"was made with {gap[0]}, this is {gap[1]}")
        for key in ("suite", "options"):
            if old[key] != wanted[key]:
                raise self._refused(f"was made with {key} {_short(old[key])}, not {_short(wanted[key])}")
        for name, case in json.loads(_json(self.settings["cases"])).items():
            before = old["cases"].get(name, case)
            changed = [key for key in {*before, *case} if before.get(key) != case.get(key)]
            if changed:
                key = sorted(changed)[0]
                raise self._refused(
                    f"was made with another case {name!r}: {key} = {before.get(key)}, now {case.get(key)}"
                )
        for label, code in self.settings["controllers"].items():
            before = old["controllers"].get(label, code)
            done = [row["status"] for key, row in self.rows.items() if key[0] == label]
            if before != code and done:
                place = run_file(self.name / "runs", label, "", 0).parent
                failed = ", or use --retry-failed" if set(done) == {FAILED} else ""
                raise InputError(
                    f"results folder {str(self.name)!r}: controller {label!r} or its code has changed since"
                    f" its runs there; remove {str(place)!r} to run them again, or choose another"
                    f" folder{failed}"
                )

    def _refused(self, why):
        return InputError(
            f"results folder {str(self.name)!r} {why}: choose another folder (--out), or remove this one"
        )

    def add(self, row):
        """Add the row of a run whose file has been written."""
        self.rows[row["controller"], row["case"], row["seed"]] = row
        if time.monotonic() - self.written > TABLE_EVERY:
            self.write()

    def table(self):
        """Return a DataFrame of all runs, by case, seed and controller in the manifest's order."""
        cases, controllers = (
            {name: number for number, name in enumerate(self.manifest[key])}
            for key in ("cases", "controllers")
        )
        order = sorted(
            self.rows, key=lambda key: (cases.get(key[1], 1e9), key[2], controllers.get(key[0], 1e9), key)
        )
        table = pd.DataFrame([self.rows[key] for key in order], columns=self.columns)
        faulty = {name for name, case in self.manifest["cases"].items() if case.get("fault") is not None}
        return with_lost_power(table, faulty) if len(table) else table

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

    Raises: InputError if the folder is in use, or has runs of another version or other settings.
    """
    results = ResultsFolder(folder, settings, columns, again)
    with locked(results.folder, f"results folder {str(folder)!r}", "another evaluation is writing to it"):
        results._open()
        try:
            yield results
        finally:
            if results.rows:
                results.write()
