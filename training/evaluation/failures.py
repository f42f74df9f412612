"""What runs count for that did not end well: the worst that any controller did on their case."""

import numpy as np

from fowt_env.training.evaluation.metrics import METRICS, better
from fowt_env.training.evaluation.run_case import OK


def failures_as_worst(table, metrics=METRICS):
    """The table of an evaluation, with the worst figures of its case in each run that failed or tripped.

    The worst in a case is taken over all controllers and seeds, of the runs that ended well and of those that
    tripped (their own figures, of a turbine being stopped, may be worse still): the greatest where less is
    better, the least where more is (metrics.better), and what is furthest from the median where neither can
    be said. A run that ended well without a figure that others have gets it, too. So nobody gains by
    stopping, whoever else failed. Where no controller has a figure in a case it stays NaN: those that failed
    there then have none over the lifetime either.
    """
    metrics = [name for name in metrics if name in table.columns]
    values = table[metrics].to_numpy(dtype=np.float64, copy=True)
    ended_well = (table["status"] == OK).to_numpy()
    for rows in table.reset_index(drop=True).groupby("case", sort=False).indices.values():
        pool, ok = values[rows], ended_well[rows]
        for column, name in enumerate(metrics):
            known = pool[np.isfinite(pool[:, column]), column]
            if known.size:
                lacking = ~ok | ~np.isfinite(pool[:, column])
                values[rows[lacking], column] = _worst(known, better(name))
    result = table.copy()
    result[metrics] = values
    return result


def _worst(known, direction):
    """The worst of some finite figures."""
    if direction:
        return known.max() if direction < 0 else known.min()
    return known[np.abs(known - np.median(known)).argmax()]
