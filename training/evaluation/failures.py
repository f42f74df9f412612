"""Lost runs: which they are, and what they count for in a score.

A run is lost that failed, that tripped, or that lost power: its turbine stood still, or nearly so. A lost run
has no figure in tables and plots. A score may not leave it out, or giving up would pay; it counts PENALTY
times the figures of the reference there, so that a score depends on nobody else's runs.
"""

import numpy as np

from fowt_env.training.evaluation.metrics import METRICS, better
from fowt_env.training.evaluation.run_case import FAILED, LOST_POWER, OK, REFERENCE, TRIPPED

BASELINES = ("gspi_oc3", "pi")  # whom others are compared with: the first of these that was evaluated
ENERGY = "energy_[kWh]"
LEAST_ENERGY = 0.5  # of the reference's in the same case and seed, below which a run has lost power
# Times the reference's figures that a lost run counts, so that giving up never pays: with it a lost run has a
# score of 100 by itself. The worst of runs that just ended well, under limit cycles and commands that swing,
# had 10 by themselves, up to 10 times the reference in each load, and 43 times its pitch travel.
PENALTY = 10.0
KINDS = {"failed": FAILED, "tripped": TRIPPED, "lost_power": LOST_POWER}  # count: status


def lost_counts(statuses):
    """{name of KINDS: how many of some runs were lost so}; an unknown status counts as failed."""
    statuses = np.asarray(statuses)
    counts = {name: int(np.sum(statuses == status)) for name, status in KINDS.items()}
    counts["failed"] += int(np.sum(~np.isin(statuses, (OK, *KINDS.values()))))
    return counts


def lost_text(counts):
    """Text "1 failed, 2 tripped, 1 lost power" of lost_counts, "" for none; counts may have other keys."""
    return ", ".join(f"{counts[name]} {name.replace('_', ' ')}" for name in KINDS if counts[name])


def known_figures(table, metrics=METRICS):
    """The table of an evaluation with NaN for the metrics of lost runs."""
    metrics = [name for name in metrics if name in table.columns]
    result = table.copy()
    result[metrics] = table[metrics].where(table["status"] == OK, axis=0)
    return result


def penalties(figures, directions):
    """What a lost run counts for: figures (..., metrics) of the reference, PENALTY times as bad.

    directions (metrics,): -1 where less is better, 1 where more is, 0 where neither is: NaN there.
    """
    directions = np.asarray(directions)
    more = figures + (PENALTY - 1.0) * np.abs(figures)
    less = np.where(figures > 0.0, figures / PENALTY, figures * PENALTY)
    return np.where(directions < 0, more, np.where(directions > 0, less, np.nan))


def penalised(table, base, metrics=METRICS):
    """The table of an evaluation in which a lost run counts by the figures of the controller `base` there.

    A lost run of `base` has no figure, nor has then that of another in the same case and seed. A run that
    ended well without a figure that the one of `base` has counts as lost in it.
    """
    metrics = [name for name in metrics if name in table.columns]
    result = known_figures(table, metrics)
    where = ["case", "seed"]
    theirs = result[result["controller"] == base].set_index(where)[metrics]
    places = table.set_index(where).index
    figures = theirs.reindex(places).to_numpy(dtype=np.float64)
    own = result[metrics].to_numpy(dtype=np.float64)
    counted = (table["controller"] != base).to_numpy()[:, None] & ~np.isfinite(own)
    worse = penalties(figures, [better(name) for name in metrics])
    result[metrics] = np.where(counted, worse, own)
    return result


def with_lost_power(table, faulty=()):
    """The table of an evaluation, in which runs with too little energy have the status LOST_POWER.

    That is less than LEAST_ENERGY of what the reference has in the same case and seed; without one, of the
    first of BASELINES that was evaluated. faulty: names of the cases with a fault, where it is the fault
    that costs energy, and no run is judged.
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
