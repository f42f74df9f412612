"""Reads and checks the table of an evaluation, for reports and scores."""

from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.errors import InputError, unknown
from fowt_env.training.evaluation.run_case import PARKED, REFERENCE

KEY = ["controller", "case", "seed"]  # identify a run
WORDS = ["status", "reason", "events", "warning"]  # columns of text in addition to KEY
WEIGHT = "weight_[-]"  # fraction of the lifetime spent in a run's case; NaN, or no such column: equal weights
TABLES = ("results.csv", "metrics.csv")  # files of a results folder: the first that exists is read


def read_results(paths, needed=(), cases=None, parked=True):
    """Return a DataFrame of the runs of fowt evaluate: controller, case, status, reason, seed, metrics.

    paths    a results folder or CSV file, or a sequence of them, whose runs are joined
    needed   columns of metrics that every table must have
    cases    names of the cases to keep; None: all
    parked   whether to keep the runs of parked turbines, which have no controller
    A missing or infinite metric is NaN; other columns of text and the runs of the reference are omitted. A
    run in several tables counts once.
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
        raise InputError(f"results: {name} on {case}, seed {seed}, occurs twice with different metrics")
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
    """Return the fraction (cases,) of the lifetime per case, sum 1; equal if the table has no weights."""
    if WEIGHT not in table or not np.isfinite(table[WEIGHT].to_numpy(dtype=np.float64)).all():
        return np.full(len(cases), 1.0 / max(1, len(cases)))
    weights = table.groupby("case")[WEIGHT].first().reindex(cases).to_numpy(dtype=np.float64)
    return weights / weights.sum() if weights.sum() > 0.0 else np.full(len(cases), 1.0 / len(cases))


def _read_one(path, needed):
    """Return the checked table of one folder or file. Raises: InputError."""
    files = [path / name for name in TABLES] if path.is_dir() else [path]
    file = next((file for file in files if file.is_file()), None)
    where = f"table {str(file)!r}"
    if file is None:
        lack = "contains no results.csv" if path.is_dir() else "does not exist"
        raise InputError(f"results {str(path)!r} {lack}: create it with fowt evaluate --out FOLDER")
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
        if numbers.notna().sum() == filled.sum():  # otherwise a column of text
            columns[name] = numbers.astype(float).replace([np.inf, -np.inf], np.nan)
        elif name in needed:
            raise InputError(f"{where}: column {name} must contain numbers")
    table = pd.DataFrame(columns)
    if table.duplicated(KEY).any():
        raise InputError(f"{where}: a controller, case and seed occur twice")
    return table
