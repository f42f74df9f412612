"""Reading the table of an evaluation, with its checks, for reports and scores."""

from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.errors import InputError, unknown
from fowt_env.training.evaluation.run_case import PARKED, REFERENCE

KEY = ["controller", "case", "seed"]  # of a run
WORDS = ["status", "reason", "events", "warning"]  # columns of text beside those of KEY
WEIGHT = "weight_[-]"  # share of a run's case in the lifetime; NaN, or no such column: every case alike
TABLES = ("results.csv", "metrics.csv")  # of a folder: the first that exists


def read_results(paths, needed=(), cases=None, parked=True):
    """Return a DataFrame of the runs of fowt evaluate: controller, case, status, reason, seed, metrics.

    paths    a results folder or CSV file, or a sequence of them, whose runs are joined
    needed   columns of metrics that each of them must have
    cases    names of the cases to keep; None: all
    parked   whether the runs of parked turbines are kept, which have no controller
    A missing or infinite metric is NaN; other columns of text are left out. A run in several tables counts
    once. The runs of the reference are left out.
    Raises: InputError for any other table, for an unknown case, and if two tables have different metrics of
    the same run.
    """
    paths = [paths] if isinstance(paths, str | Path) else paths
    tables = [_read_one(Path(path), needed) for path in paths]
    shared = [name for name in tables[0] if all(name in table for table in tables)]
    table = pd.concat(tables, ignore_index=True)
    table = table.drop_duplicates([name for name in shared if name != "reason"])
    twice = table[table.duplicated(KEY)]
    if len(twice):
        name, case, seed = twice.iloc[0][KEY]
        raise InputError(f"results: {name} on {case}, seed {seed}, is there twice with different metrics")
    table = table[table["controller"] != REFERENCE]
    if not parked:
        table = table[table["controller"] != PARKED]
    if cases is not None:
        known = list(dict.fromkeys(table["case"]))
        if wrong := [name for name in cases if name not in known]:
            raise unknown("case of the evaluation", wrong[0], known)
        table = table[table["case"].isin(cases)]
    return table.reset_index(drop=True)


def case_shares(table, cases):
    """Return the shares (cases,) of the lifetime, with sum 1; equal if the table has no weights."""
    if WEIGHT not in table or not np.isfinite(table[WEIGHT].to_numpy(dtype=np.float64)).all():
        return np.full(len(cases), 1.0 / max(1, len(cases)))
    share = table.groupby("case")[WEIGHT].first().reindex(cases).to_numpy(dtype=np.float64)
    return share / share.sum() if share.sum() > 0.0 else np.full(len(cases), 1.0 / len(cases))


def _read_one(path, needed):
    """Return the checked table of one folder or file. Raises: InputError."""
    files = [path / name for name in TABLES] if path.is_dir() else [path]
    file = next((file for file in files if file.is_file()), None)
    where = f"table {str(file)!r}"
    if file is None:
        lack = "contains no results.csv" if path.is_dir() else "is no such file or folder"
        raise InputError(f"results {str(path)!r} {lack}: make it with fowt evaluate --out FOLDER")
    try:
        texts = pd.read_csv(file, dtype=str, keep_default_na=False, encoding="utf-8")
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(f"{where} cannot be read: {error}") from None
    missing = [name for name in (*KEY, "status", *needed) if name not in texts.columns]
    if missing:
        raise InputError(f"{where} lacks the columns {', '.join(missing)}")
    if texts.empty:
        raise InputError(f"{where} has no runs")
    columns = {name: texts[name] for name in ("controller", "case", "status")}
    columns["reason"] = texts.get("reason", "")
    try:
        columns["seed"] = pd.to_numeric(texts["seed"]).astype(int)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{where}: column seed must contain whole numbers ({error})") from None
    for name in texts.columns.difference([*KEY, *WORDS], sort=False):
        numbers = pd.to_numeric(texts[name].replace("", "nan"), errors="coerce")
        filled = ~texts[name].str.lower().isin(["", "nan"])
        if numbers.notna().sum() == filled.sum():  # else a column of text
            columns[name] = numbers.astype(float).replace([np.inf, -np.inf], np.nan)
        elif name in needed:
            raise InputError(f"{where}: column {name} must contain numbers")
    table = pd.DataFrame(columns)
    if table.duplicated(KEY).any():
        raise InputError(f"{where}: a controller, case and seed occur twice")
    return table
