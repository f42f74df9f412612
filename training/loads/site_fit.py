"""Fits the joint distribution of wind, Hs and Tp of a site to a table of sea states."""

import numpy as np
from scipy.optimize import brentq, least_squares

from fowt_env.errors import InputError
from fowt_env.files.tables import read_table

COLUMNS = {  # column of a table: allowed range
    "wind": (0.0, 75.0, "m/s"),
    "Hs": (0.0, 30.0, "m"),
    "Tp": (0.5, 40.0, "s"),
}
WEIGHTS = ("probability", "count")
CLASS_WIDTHS = {"wind": 2.0, "Hs": 1.0}  # of the classes in which conditional distributions are fitted
LEAST_ROWS = 50  # of a table, with weights or without
LEAST_SHARE = 0.002  # of all records, in a class that is used
LEAST_CLASSES = 4  # as many as parameters of a power law and one more


def fitted(path):
    """Return (wind, sea, source): keys of Wind and SeaFit of a table's distribution, and a text on the fit.

    wind: maximum likelihood. Hs | U: maximum likelihood in classes of U, then powers of U by least squares;
    Tp | Hs, U: means of Tp and U in classes of Hs in the same way, the slope over U by linear regression.
    Raises: InputError for a table that cannot be used.
    """
    table, weight = read_scatter(path)
    wind, Hs, Tp = (table[name].to_numpy(dtype=np.float64) for name in COLUMNS)
    where = f"site table {str(path)!r}"
    k, A = weibull(wind, weight)
    speeds, shares, inside = _classes(wind, weight, CLASS_WIDTHS["wind"])
    _check_classes(where, "wind", speeds)
    both = np.array([weibull(Hs[rows], weight[rows]) for rows in inside])
    shape = _power_law(speeds, both[:, 0], shares, 0.2)
    scale = _power_law(speeds, both[:, 1], shares, 1e-3)
    heights, shares, inside = _classes(Hs, weight, CLASS_WIDTHS["Hs"])
    _check_classes(where, "Hs", heights)
    mean = np.array([np.average(Tp[rows], weights=weight[rows]) for rows in inside])
    period = _power_law(heights, mean, shares, 0.5)
    usual = _power_law(
        heights, np.array([np.average(wind[rows], weights=weight[rows]) for rows in inside]), shares, 0.1
    )
    smooth, relative = _at(period, Hs), wind / _at(usual, Hs) - 1.0
    slope = float((weight * (Tp / smooth - 1.0)) @ relative / max(weight @ relative**2, 1e-12))
    rest = Tp / (smooth * np.maximum(1.0 + slope * relative, 0.2))
    deviations = [np.sqrt(np.average((rest[rows] - 1.0) ** 2, weights=weight[rows])) for rows in inside]
    spread = _decay(heights, np.maximum(deviations, 1e-2), shares)
    sea = {"shape": shape, "scale": scale, "period": period, "wind": usual, "slope": slope, "spread": spread}
    return {"A": A, "k": k}, sea, f"fit to {len(table)} rows of {path.name}"


def read_scatter(path):
    """Return (DataFrame with wind, Hs, Tp, weights (rows,) that add up to 1) of a table of sea states.

    Raises: InputError with a line per wrong column.
    """
    table = read_table(path)
    problems = [
        f"column {name!r} is missing: needs {', '.join(COLUMNS)}" for name in COLUMNS if name not in table
    ]
    given = [name for name in WEIGHTS if name in table]
    if len(given) > 1:
        problems.append("has the columns probability and count: one of them at most")
    ranges = COLUMNS | {name: (0.0, np.inf, "") for name in given}
    for name, (low, high, unit) in ranges.items():
        if name not in table:
            continue
        try:
            values = table[name].to_numpy(dtype=np.float64)
        except (TypeError, ValueError):
            problems.append(f"column {name!r}: must contain numbers")
            continue
        wrong = np.flatnonzero(~((values >= low) & (values <= high)))
        if wrong.size:
            text = f"in [{low:g}, {high:g}] {unit}".rstrip() if high < np.inf else "at least 0"
            problems.append(f"column {name!r}, row {wrong[0] + 1}: {values[wrong[0]]:g} must be {text}")
    if not problems and len(table) < LEAST_ROWS:
        problems.append(f"has {len(table)} rows: needs at least {LEAST_ROWS}")
    weight = np.ones(len(table))
    if not problems and given:
        weight = table[given[0]].to_numpy(dtype=np.float64)
        if not weight.sum() > 0.0:
            problems.append(f"column {given[0]!r}: must not be zero in all rows")
    if problems:
        raise InputError(f"site table {str(path)!r}:\n" + "\n".join(f"  {line}" for line in problems))
    return table, weight / weight.sum()


def weibull(values, weight):
    """Return (shape, scale) of the Weibull distribution of weighted values by maximum likelihood."""
    values = np.maximum(values, 1e-3)  # a calm has no logarithm
    logs = np.log(values)
    mean = np.average(logs, weights=weight)
    top = values.max()

    def excess(shape):
        power = weight * (values / top) ** shape
        return power @ logs / power.sum() - mean - 1.0 / shape

    if excess(100.0) < 0.0:  # all values are nearly equal
        return 100.0, float(top)
    shape = brentq(excess, 0.05, 100.0)
    scale = top * np.average((values / top) ** shape, weights=weight) ** (1.0 / shape)
    return float(shape), float(scale)


def _classes(values, weight, width):
    """Return (weighted means, shares, rows) of the classes that have at least LEAST_SHARE of all."""
    number = np.floor(values / width).astype(int)
    centres, shares, inside = [], [], []
    for each in np.unique(number):
        rows = np.flatnonzero((number == each) & (weight > 0.0))
        share = weight[rows].sum()
        if share < LEAST_SHARE:
            continue
        centres.append(np.average(values[rows], weights=weight[rows]))
        shares.append(share)
        inside.append(rows)
    return np.array(centres), np.array(shares), inside


def _check_classes(where, name, centres):
    if len(centres) < LEAST_CLASSES:
        raise InputError(
            f"{where}: {name}: has {len(centres)} classes of {CLASS_WIDTHS[name]:g} with at least"
            f" {100.0 * LEAST_SHARE:g} % of the records: needs {LEAST_CLASSES} for a fit"
        )


def _at(law, x):
    """Return a + b x^c of a power law (a, b, c)."""
    return law[0] + law[1] * x ** law[2]


def _power_law(x, y, weight, least):
    """Return (a, b, c) of a + b x^c through values by weighted least squares, a >= least and b, c >= 0."""
    start = (max(0.5 * y.min(), 2.0 * least), max(np.ptp(y) / max(x.max(), 1.0), 1e-3), 1.0)
    root = np.sqrt(weight)
    bounds = ([least, 0.0, 0.05], [np.inf, np.inf, 4.0])
    found = least_squares(lambda law: root * (_at(law, x) - y), start, bounds=bounds)
    return tuple(map(float, found.x))


def _decay(x, y, weight):
    """Return (a, b, c) of a + b exp(c x) through values by weighted least squares, a > 0, b >= 0, c <= 0."""
    root = np.sqrt(weight)
    bounds = ([1e-3, 0.0, -5.0], [1.0, 1.0, 0.0])
    start = (max(0.5 * y.min(), 2e-3), max(np.ptp(y), 1e-2), -0.2)
    found = least_squares(lambda p: root * (p[0] + p[1] * np.exp(p[2] * x) - y), start, bounds=bounds)
    return tuple(map(float, found.x))
