"""Lost runs (failed, tripped, or with too little energy) and their penalties in a score.

A lost run has no metrics in tables and plots. In a score it counts PENALTY times the metrics of the reference
in the same case and seed, so that giving up never pays and a score depends on no other controller.
"""

import numpy as np

from fowt_env.training.evaluation.metrics import METRICS, better
from fowt_env.training.evaluation.run_case import FAILED, LOST_POWER, OK, REFERENCE, TRIPPED

BASELINES = ("gspi_oc3", "pi")  # default baseline: the first of these that was evaluated
ENERGY = "energy_[kWh]"
LEAST_ENERGY = 0.5  # of the reference's in the same case and seed, below which a run has lost power
# A lost run alone has a score of PENALTY**2 = 100. The worst runs that just ended well, with limit cycles and
# oscillating commands, had a score of 10, up to 10 times the reference's loads and 43 times its pitch travel.
PENALTY = 10.0
KINDS = {"failed": FAILED, "tripped": TRIPPED, "lost_power": LOST_POWER}  # count: status


def lost_counts(statuses):
    """Return {name of KINDS: count} of lost runs; an unknown status counts as failed."""
    statuses = np.asarray(statuses)
    counts = {name: int(np.sum(statuses == status)) for name, status in KINDS.items()}
    counts["failed"] += int(np.sum(~np.isin(statuses, (OK, *KINDS.values()))))
    return counts


def lost_text(counts):
    """Return "1 failed, 2 tripped, 1 lost power" of lost_counts, "" for none; other keys are ignored."""
    return ", ".join(f"{counts[name]} {name.replace('_', ' ')}" for name in KINDS if counts[name])


def known_figures(table, metrics=METRICS):
    """Return the table of an evaluation with NaN for the metrics of lost runs."""
    metrics = [name for name in metrics if name in table.columns]
    result = table.copy()
    result[metrics] = table[metrics].where(table["status"] == OK, axis=0)
    return result


def penalties(figures, directions):
    """Return the metrics (..., metrics) of the reference, PENALTY times as bad.

    directions (metrics,): -1 if less is better, 1 if more is, 0 if neither is: NaN.
    """
    directions = np.asarray(directions)
    more = figures + (PENALTY - 1.0) * np.abs(figures)
    less = np.where(figures > 0.0, figures / PENALTY, figures * PENALTY)
    return np.where(directions < 0, more, np.where(directions > 0, less, np.nan))


def penalised(table, base, metrics=METRICS):
    """Return the table of an evaluation with penalties for lost runs, from the metrics of `base`.

    A lost run of `base` has NaN, and so has the lost run of another controller in that case and seed. A
    metric that a run lacks and that of `base` has counts as lost, too.
    """
    metrics = [name for name in metrics if name in table.columns]
    result = known_figures(table, metrics)
    theirs = result[result["controller"] == base].set_index(["case", "seed"])[metrics]
    figures = theirs.reindex(table.set_index(["case", "seed"]).index).to_numpy(dtype=np.float64)
    own = result[metrics].to_numpy(dtype=np.float64)
    counted = (table["controller"] != base).to_numpy()[:, None] & ~np.isfinite(own)
    result[metrics] = np.where(counted, penalties(figures, [better(name) for name in metrics]), own)
    return result


def with_lost_power(table, faulty=()):
    """Return the table of an evaluation with the status LOST_POWER for runs with too little energy.

    That is less than LEAST_ENERGY of the reference's in the same case and seed; without a reference, of the
    first of BASELINES that was evaluated. faulty: names of cases with a fault, in which no run is judged.
    """
    names = set(table["controller"])
    base = next((name for name in (REFERENCE, *BASELINES) if name in names), None)
    if base is None:
        return table
    rows = table[(table["controller"] == base) & (table["status"] == OK)]
    theirs = rows.set_index(["case", "seed"])[ENERGY]
    energy = theirs.reindex(table.set_index(["case", "seed"]).index).to_numpy(dtype=np.float64)
    own = table[ENERGY].to_numpy(dtype=np.float64)
    lost = (energy > 0.0) & (own < LEAST_ENERGY * energy)
    lost &= ((table["status"] == OK) & ~table["case"].isin(list(faulty))).to_numpy()
    if not lost.any():
        return table
    table = table.copy()
    table.loc[lost, "status"] = LOST_POWER
    table.loc[lost, "reason"] = [
        f"lost power: {mine:.4g} kWh, less than half of the {other:.4g} kWh of {base}"
        for mine, other in zip(own[lost], energy[lost], strict=True)
    ]
    return table
