"""Tests whether the order of controllers holds on other plants, sensors and turbulence.

    python -m fowt_env.training.studies.robust_order --seeds 1001 --out results/robust.csv

Each row of the table is a suite with one change of VARIATIONS. Masses and drag differ from the plant of the
designs; sensors, wake, rotor model and platform are known to them. The rank correlation (Spearman) is that of
the scores with those of the unchanged suite. Finished runs are read from the file, so that the command
resumes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from scipy.stats import spearmanr

from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import read_table, write_table
from fowt_env.training.evaluation.cases import mean_speed, read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import leaderboard, score_text
from fowt_env.training.evaluation.plant_perturbation import PlantPerturbation

LAWS = ("gspi_oc3", "floating_feedback", "rosco_float", "lqr", "mpc")
WINDS = (12.0, 14.0, 18.0, 22.0)  # m/s, of the suite's own turbine
UNCHANGED = "as the suite"


@dataclass(frozen=True)
class Variation:
    """Defines the changes of a suite: of its platform, and of the fields, options and wind of its cases."""

    platform: str | None = None
    fields: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    wind: Mapping[str, Any] = field(default_factory=dict)

    def applied(self, case):
        """Return the changed Case."""
        changes = dict(self.fields)
        if self.wind:
            wind = case.wind | self.wind
            if wind["kind"] != "ntm":
                wind.pop("sigma", None)
            changes["wind"] = wind
        return replace(case, options=case.options | self.options, **changes)


def _shifted(**factors):
    return Variation(fields={"shift": PlantPerturbation(**factors)})


VARIATIONS = {
    UNCHANGED: Variation(),
    "exact sensors": Variation(fields={"sensors": "exact"}),
    "noise of 2 % of the range": _shifted(noise=0.02),
    "dynamic inflow": Variation(options={"dynamic_inflow": True}),
    "rotor bem": Variation(options={"rotor": "bem"}),
    "elastic": Variation(options={"fidelity": "elastic"}),
    "upper mass +10 %": _shifted(upper_mass=1.1),
    "upper mass -10 %": _shifted(upper_mass=0.9),
    "drag +10 %": _shifted(drag=1.1),
    "drag -10 %": _shifted(drag=0.9),
    "nrel5mw_oc4_semi": Variation("nrel5mw_oc4_semi"),
    "nrel5mw_iti_barge": Variation("nrel5mw_iti_barge"),
    "iea15_volturnus_s": Variation("iea15_volturnus_s"),
    "extreme turbulence": Variation(wind={"kind": "etm"}),
    "Kaimal at a point": Variation(wind={"average": "point"}),
}


def varied(suite, name, winds=WINDS):
    """Return the Suite of a variation with the cases of some mean winds (m/s, of the suite's turbine)."""
    variation = VARIATIONS[name]
    whole = read_suite(suite)
    places = [i for i, case in enumerate(whole.cases) if mean_speed(case) in winds]
    if not places:
        raise InputError(f"winds = {list(winds)}: suite {whole.name!r} has no case with such a mean wind")
    other = read_suite(suite, variation.platform)
    return replace(other, cases=tuple(variation.applied(other.cases[i]) for i in places))


def scores_of(suite, table):
    """Return ({controller: score text}, {controller: score}) by a Suite's score and limits."""
    entries = leaderboard(table, score=suite.score, limits=suite.limits)["controllers"]
    which = "winds" if suite.score.by == "winds" else "lifetime"
    texts, values = {}, {}
    for entry in entries:
        score = entry["score"]
        values[entry["controller"]] = np.nan if score["mean"] is None else score["mean"]  # no run has ended
        texts[entry["controller"]] = score_text(score | {which: score}, which)
    return texts, values


def rank_correlation(scores, reference):
    """Return Spearman's rank correlation of {controller: score} with that of the reference."""
    names = list(reference)
    return float(spearmanr([scores[name] for name in names], [reference[name] for name in names]).statistic)


def main(
    controllers: Annotated[str, typer.Option(help="Controllers, comma-separated.")] = ",".join(LAWS),
    variations: Annotated[str, typer.Option(help="Names of VARIATIONS, comma-separated; default: all.")] = "",
    suite: Annotated[str, typer.Option(help="Suite with a score.")] = "above_rated",
    winds: Annotated[str, typer.Option(help="Mean winds, m/s.")] = ",".join(f"{wind:g}" for wind in WINDS),
    seeds: Annotated[str, typer.Option(help="Weather seeds.")] = "1001",
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    out: Annotated[str, typer.Option(help="CSV file of all runs, which is continued.")] = "robust_order.csv",
):
    """Print the score of each controller under each variation, its order and the rank correlation."""
    names, laws = [name for name in variations.split(",") if name] or list(VARIATIONS), controllers.split(",")
    if unknown := [name for name in names if name not in VARIATIONS]:
        raise InputError(f"variations = {unknown}: must be of {list(VARIATIONS)}")
    chosen, numbers = tuple(float(wind) for wind in winds.split(",")), parse_whole_numbers(seeds, "seeds")
    known = read_table(out) if Path(out).exists() else pd.DataFrame({"variation": [], "controller": []})
    rows, nominal = [], None
    for name in [UNCHANGED, *(name for name in names if name != UNCHANGED)]:
        changed = varied(suite, name, chosen)
        done = known[known["variation"] == name]
        missing = [law for law in laws if law not in set(done["controller"])]
        if missing:
            made = evaluate(missing, changed, seeds=numbers, jobs=jobs, reference=done.empty)
            done = pd.concat([done, made.assign(variation=name)], ignore_index=True)
            known = pd.concat([known[known["variation"] != name], done], ignore_index=True)
            write_table(known, out)
        texts, values = scores_of(changed, done.drop(columns="variation"))
        nominal = values if nominal is None else nominal
        order = sorted(laws, key=lambda law: (np.isnan(values[law]), values[law]))
        rows.append(
            (
                name,
                *(texts[law] for law in laws),
                " < ".join(order),
                f"{rank_correlation(values, nominal):.2f}",
            )
        )
        print(rows[-1], flush=True)
    print(
        markdown_table(("", *(f"`{law}`" for law in laws), "order", "rank correlation"), rows, aligned=True)
    )


if __name__ == "__main__":
    typer.run(main)
