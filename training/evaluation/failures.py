"""Detects lost runs (failed, tripped, or with too little energy) and imputes their penalties in a score.

A lost run has no metrics in tables and plots. In a score it counts as PENALTY times the reference's metrics
of the same case and seed: ending a run early never improves a score, and other controllers do not affect it.
"""

import numpy as np

from fowt_env.training.evaluation.metrics import METRICS, better
from fowt_env.training.evaluation.run_case import FAILED, LOST_POWER, OK, REFERENCE, TRIPPED

BASELINES = ("gspi_oc3", "pi")  # default baseline: the first of these that was evaluated
ENERGY = "energy_[kWh]"
LEAST_ENERGY = 0.5  # fraction of the reference's energy below which a run has lost power
# A score of lost runs only is PENALTY**2 = 100. The worst runs that still ended normally, with limit cycles
# and oscillating commands, scored 10, at up to 10 times the reference's loads and 43 times its pitch travel.
PENALTY = 10.0
KINDS = {"failed": FAILED, "tripped": TRIPPED, "lost_power": LOST_POWER}  # name of the count: status


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

    directions (metrics,): -1 if less is better, 1 if more is better, 0 if neither (result NaN).
    """
    directions = np.asarray(directions)
    more = figures + (PENALTY - 1.0) * np.abs(figures)
    less = np.where(figures > 0.0, figures / PENALTY, figures * PENALTY)
    return np.where(directions < 0, more, np.where(directions > 0, less, np.nan))


def penalised(table, base, metrics=METRICS):
    """Return the table of an evaluation with penalties for lost runs, from the metrics of `base`.

    Where a run of `base` is lost, lost runs of other controllers in that case and seed also have NaN. A
    metric that a run lacks but the run of `base` has gets a penalty, too.
    """
    metrics = [name for name in metrics if name in table.columns]
    result = known_figures(table, metrics)
    rows = result[result["controller"] == base].set_index(["case", "seed"])[metrics]
    base_values = rows.reindex(table.set_index(["case", "seed"]).index).to_numpy(dtype=np.float64)
    values = result[metrics].to_numpy(dtype=np.float64)
    counted = (table["controller"] != base).to_numpy()[:, None] & ~np.isfinite(values)
    result[metrics] = np.where(counted, penalties(base_values, [better(name) for name in metrics]), values)
    return result


def with_lost_power(table, faulty=()):
    """Return the table of an evaluation with the status LOST_POWER for runs with too little energy.

    The limit is LEAST_ENERGY of the reference's energy in the same case and seed; without a reference, of the
    first of BASELINES that was evaluated. faulty: names of cases with a fault, which are not checked.
    """
    names = set(table["controller"])
    base = next((name for name in (REFERENCE, *BASELINES) if name in names), None)
    if base is None:
        return table
    rows = table[(table["controller"] == base) & (table["status"] == OK)]
    base_energy = rows.set_index(["case", "seed"])[ENERGY]
    keys = table.set_index(["case", "seed"]).index
    reference_energy = base_energy.reindex(keys).to_numpy(dtype=np.float64)
    energies = table[ENERGY].to_numpy(dtype=np.float64)
    lost = (reference_energy > 0.0) & (energies < LEAST_ENERGY * reference_energy)
    lost &= ((table["status"] == OK) & ~table["case"].isin(list(faulty))).to_numpy()
    if not lost.any():
        return table
    table = table.copy()
    table.loc[lost, "status"] = LOST_POWER
    table.loc[lost, "reason"] = [
        f"lost power: {mine:.4g} kWh, less than half of the {other:.4g} kWh of {base}"
        for mine, other in zip(energies[lost], reference_energy[lost], strict=True)
    ]
    return table
