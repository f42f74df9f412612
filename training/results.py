"""The folder of an evaluation: every run once, whatever interrupts it.

    manifest.json                              what was asked for: versions, suite, cases, controllers
    runs/<controller>/<case>_seed<n>.parquet   time series of one run, its row of the table in the metadata
    results.csv                                one row per run, columns training.evaluate.COLUMNS
    leaderboard.json                           means, intervals and paired differences (training.leaderboard)

A run is done when its Parquet file is there, and that file appears whole or not at all. results.csv and
leaderboard.json are made from those files, so an interrupted evaluation loses and repeats nothing.
"""

import ast
import fcntl
import hashlib
import importlib.util
import inspect
import json
import os
import platform as machine
import re
import sys
import time
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

import fowt_env
from fowt_env.errors import InputError
from fowt_env.outputs import remove_leftovers, replacing, write_table
from fowt_env.textfiles import parse_json

FORMAT = 1  # of the folder; raised when files or their meaning change
MANIFEST = {  # what each key of manifest.json holds, beside its format
    "fowt_env": str, "plant": str, "versions": dict, "created": str, "suite": dict | None, "options": dict,
    "cases": dict, "seeds": list, "controllers": dict,
}  # fmt: skip
ROW_KEY = b"fowt_env.row"
TABLE_EVERY = 2.0  # s between rewritings of results.csv while runs go on
PACKAGES = ("numpy", "numba", "scipy", "pandas", "rainflow", "rosco", "hipersim")
SHAPING = ("metrics.py", "faults.py", "shifts.py", "randomisation.py")  # of this package, what shapes figures
# sources that shape no figure of a run
UNRELATED = ("cli.py", "cli_arguments.py", "cli_scores.py", "plots.py", "plots_scores.py", "warmup.py")


def run_file(folder, label, case, seed):
    """Path of a run's time series; characters that files cannot or should not bear become _."""
    safe = [re.sub(r"[^\w.-]", "_", text) for text in (label, case)]
    return Path(folder) / safe[0] / f"{safe[1]}_seed{seed}.parquet"


def parquet_of(frame, row):
    """Arrow table of a run (None: no rows) with its row of results in the metadata."""
    if frame is None:
        frame = pd.DataFrame({"Time_[s]": pd.Series(dtype="float64")})
    table = pa.Table.from_pandas(frame, preserve_index=False)
    return table.replace_schema_metadata({**table.schema.metadata, ROW_KEY: _json(row).encode()})


def write_run(frame, row, path):
    """The path written: the run's time series and row, whole or not at all."""
    with replacing(path) as temporary:
        pq.write_table(parquet_of(frame, row), temporary)
    return path


def read_row(path):
    """Row {column: value} in a run's file. Raises: InputError for a file that write_run did not write."""
    try:
        metadata = pq.read_schema(path).metadata or {}
        row = json.loads(metadata[ROW_KEY])
        if not isinstance(row, dict) or {"controller", "case", "seed"} - set(row):
            raise ValueError("its row lacks controller, case or seed")
    except (KeyError, ValueError, RecursionError, OSError, MemoryError, pa.ArrowException) as error:
        raise InputError(
            f"{str(path)!r} is no run of an evaluation ({error!s:.300}); remove it to run it again"
        ) from None
    return {key: float("nan") if value is None else value for key, value in row.items()}


def _json(value, **options):
    """JSON text in which NaN is null, since JSON has none."""
    return json.dumps(_finite(value), allow_nan=False, **options)


def _finite(value):
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def write_json(value, path):
    """The path written, whole or not at all."""
    with replacing(path) as temporary:
        Path(temporary).write_text(_json(value, indent=1) + "\n", encoding="utf-8")
    return path


def _digest(paths):
    """Hash of files, by their order and contents."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(Path(path).read_bytes())
    return digest.hexdigest()[:16]


def plant_code():
    """Hash of all sources and data that shape a run, but for the controllers."""
    package = Path(fowt_env.__file__).parent
    own = Path(__file__).parent
    files = sorted(
        path
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.name not in UNRELATED
    )
    return _digest([*files, *(own / name for name in SHAPING)])


def controller_code(controller):
    """{"name", "code"}: what a controller is called, and a hash of the sources that define it.

    A name of CONTROLLERS: its module, those of the package that this imports, and the package's data;
    "design:FILE", "policy:NAME": the file and the package; "module:Name", a class or an object: the file that
    it comes from.
    """
    from controllers import CONTROLLERS, saved_design
    from controllers.policy import PREFIX, policy_path

    if not isinstance(controller, str):
        kind = (
            controller if inspect.isroutine(controller) or inspect.isclass(controller) else type(controller)
        )
        file = getattr(sys.modules.get(kind.__module__), "__file__", None)
        return {"name": f"{kind.__module__}:{kind.__qualname__}", "code": _digest([file] if file else [])}
    if ":" not in controller:
        return {"name": controller, "code": _digest(_package_files(CONTROLLERS.get(controller)))}
    if controller.startswith(saved_design.PREFIX):
        files = [controller.removeprefix(saved_design.PREFIX), *_package_files(saved_design.load_design)]
        return {"name": controller, "code": _digest(files)}
    if controller.startswith(PREFIX):  # its baseline may be any controller
        files = [policy_path(controller.removeprefix(PREFIX)), *_package_files(None)]
        return {"name": controller, "code": _digest(files)}
    module = controller.partition(":")[0]
    sys.path.insert(0, "")
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        spec = None
    finally:
        sys.path.remove("")
    file = None if spec is None or not spec.has_location else spec.origin
    return {"name": controller, "code": _digest([file] if file else [])}


def _package_files(factory):
    """Sorted files of the package controllers that a factory of it depends on; all of them for any other."""
    import controllers

    folder = Path(controllers.__file__).parent
    files = [path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    data = {path for path in files if path.suffix != ".py"}
    start = getattr(factory, "__module__", None) or ""
    if not start.startswith("controllers."):
        return sorted(files)
    found, names = set(), [start]
    while names:
        path = folder.joinpath(*names.pop().split(".")[1:]).with_suffix(".py")
        if path in found or not path.exists():
            continue
        found.add(path)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("controllers."):
                names.append(node.module)
            elif isinstance(node, ast.Import):
                names += [alias.name for alias in node.names if alias.name.startswith("controllers.")]
    return sorted(found | data)


def versions():
    """{package: version} of what shapes the figures, Python and processor included."""
    found = {
        "fowt_env": fowt_env.__version__,
        "python": machine.python_version(),
        "machine": machine.machine(),
    }
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


class ResultsFolder:
    """A locked folder of an evaluation: what is done in it, and what is added to it.

    settings: {"suite", "options", "cases" {name: description}, "seeds", "controllers" {label: code}}.
    Controllers, cases and seeds may be added to a folder; anything else must be as it was.
    """

    def __init__(self, folder, settings, columns):
        self.folder = Path(folder)
        self.columns = list(columns)
        self.settings = settings
        self.rows = {}  # (controller, case, seed) -> row
        self.written = 0.0

    def _open(self):
        """Check the folder, join the settings and read what is done."""
        wanted = {
            "format": FORMAT,
            "fowt_env": fowt_env.__version__,
            "plant": plant_code(),
            **{key: self.settings[key] for key in ("suite", "options")},
        }
        wanted = json.loads(_json(wanted))
        old = self._manifest()
        remove_leftovers(self.folder)
        for path in self.folder.glob("runs/*/.*.parquet"):  # left by a process that was killed
            path.unlink(missing_ok=True)
        for path in sorted(self.folder.glob("runs/*/*.parquet")):
            row = read_row(path)
            self.rows[row["controller"], row["case"], row["seed"]] = row
        parts = {key: dict(self.settings[key]) for key in ("cases", "controllers")}
        seeds = list(self.settings["seeds"])
        if old is not None:
            self._compare(old, wanted)
            for key in parts:
                parts[key] = old[key] | parts[key]
            seeds = sorted({*old["seeds"], *seeds})
        elif self.rows or (self.folder / "results.csv").exists():
            raise self._refused("holds runs but no manifest.json")
        created = time.strftime("%Y-%m-%dT%H:%M:%S%z") if old is None else old["created"]
        self.manifest = {
            **wanted,
            "versions": versions() if old is None else old["versions"],
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
            raise self._refused("has a manifest.json whose seeds or cases are none")
        return old

    def _compare(self, old, wanted):
        """Raises: InputError where the folder's runs cannot stand beside those now asked for."""
        if old["fowt_env"] != wanted["fowt_env"]:
            raise self._refused(f"was made by fowt_env {old['fowt_env']}, this is {wanted['fowt_env']}")
        if old["plant"] != wanted["plant"]:
            raise self._refused("was made by another state of this package's sources")
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
            if before != code and any(key[0] == label for key in self.rows):
                place = run_file(self.folder / "runs", label, "", 0).parent
                raise InputError(
                    f"results folder {str(self.folder)!r}: the code of controller {label!r} has changed since"
                    f" its runs there; remove {str(place)!r} to run them again, or choose another folder"
                )

    def _refused(self, why):
        return InputError(
            f"results folder {str(self.folder)!r} {why}: choose another folder (--out), or remove this one"
        )

    def add(self, row):
        """Take in the row of a run whose file has been written."""
        self.rows[row["controller"], row["case"], row["seed"]] = row
        if time.monotonic() - self.written > TABLE_EVERY:
            self.write()

    def table(self):
        """DataFrame of all runs of the folder, by case, seed and controller in the order asked for."""
        places = [
            {name: number for number, name in enumerate(self.manifest[key])}
            for key in ("cases", "controllers")
        ]
        order = sorted(
            self.rows, key=lambda key: (places[0].get(key[1], 1e9), key[2], places[1].get(key[0], 1e9), key)
        )
        return pd.DataFrame([self.rows[key] for key in order], columns=self.columns)

    def write(self):
        """Write results.csv."""
        write_table(self.table(), self.folder / "results.csv")
        self.written = time.monotonic()


def _short(value):
    """Text of a setting for a message."""
    if isinstance(value, dict) and "name" in value:
        return f"{value['name']!r} version {value.get('version')}"
    return str(value)


@contextmanager
def open_results(folder, settings, columns):
    """ResultsFolder, locked against other processes while the block runs; results.csv is written at its end.

    Raises: InputError where the folder is in use, or holds runs of another version or other settings.
    """
    results = ResultsFolder(folder, settings, columns)
    if results.folder.exists() and not results.folder.is_dir():
        raise InputError(f"results folder {str(folder)!r}: is a file")
    try:
        results.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"results folder {str(folder)!r}: cannot be written: {error.strerror}") from None
    handle = os.open(results.folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"results folder {str(folder)!r}: another evaluation is writing to it") from None
        results._open()
        try:
            yield results
        finally:
            if results.rows:
                results.write()
    finally:
        os.close(handle)  # and with it the lock, also where the process is killed
