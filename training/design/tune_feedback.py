"""Tune the motion feedback of floating_feedback and rosco_float on training cases.

    python -m fowt_env.training.design.tune_feedback --jobs 2
    python -m fowt_env.training.design.tune_feedback --engine ray --address ray://head:10001

Every setting of a grid runs in the training cases: 13, 17 and 21 m/s, NTM class B with the site's normal
sea, seeds 1001 and 1002, which are apart from the winds and seeds that controllers are scored on. Its
figures are divided by those of gspi_oc3 in the same case and averaged. The best setting has the least mean
of the standard deviations of platform pitch and rotor speed, among those whose blades travel no further than
those of the same law without feedback (UNFED): feedback that buys its damping with the pitch drive does not
count. For floating_feedback that law is gspi_oc3; for rosco_float it is rosco, whose blades travel more than
those of gspi_oc3 before anything is fed back. Writes controllers/tuned.toml, which the controllers read, and
tune_<name>.csv with the whole grid.
"""

import argparse
import sys
from itertools import product
from pathlib import Path

import pandas as pd

from fowt_env.controllers.floating_feedback import FeedbackSettings, FloatingFeedback
from fowt_env.controllers.pi import PISettings
from fowt_env.controllers.rosco import Rosco, RoscoSettings
from fowt_env.controllers.tuned import TUNED
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.engines import session
from fowt_env.training.evaluation.evaluate import evaluate, mean_ratios
from fowt_env.training.evaluation.run_case import CONTROL_DT

WINDS = (13.0, 17.0, 21.0)
SEEDS = (1001, 1002)
SITE = "gulf_of_maine_normal"
BASELINE = "gspi_oc3"
UNFED = {"floating_feedback": "gspi_oc3", "rosco_float": "rosco"}
TRAVEL = 1.0  # most blade-pitch travel, over that of the law without feedback
FIGURES = {
    "platform_pitch": "PtfmPitch_std_[deg]",
    "rotor_speed": "RotSpeed_std_[rpm]",
    "tower_base": "TwrBsMyt_std_[kN-m]",
    "pitch_travel": "blade_pitch_travel_[deg/s]",
}
FEEDBACK_GRID = {
    "pitch_gain": (0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.11, 0.15),
    "low_pass": (0.05, 0.1, 0.15, 0.2, 0.3, 0.4),
    "high_pass": (0.02,),
    "torque_gain": (0.0,),
}
ROSCO_GRID = {
    "mode": (1, 2),
    # per m/s; mode 2: times the hub height
    "gain": (-0.01, -0.02, -0.03, -0.045, -0.06, -0.08, -0.11, -0.15),
    "low_pass": (0.05, 0.1, 0.15, 0.2, 0.3, 0.4),
    "high_pass": (0.01,),
}


def training_case(wind):
    """Case of normal operation at a wind, m/s."""
    turbulent = {"kind": "ntm", "speed": wind, "class": "B"}
    return Case(f"train_{wind:g}", turbulent, joint_sea_state(SITE, wind))


def settings_of(grid):
    """List of {key: value}, every combination of a grid."""
    return [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]


def feedback_settings(turbine):
    """[(settings, controller)] of floating_feedback."""
    published = PISettings.published(turbine)
    return [
        (each, FloatingFeedback(published, FeedbackSettings(**each), CONTROL_DT))
        for each in settings_of(FEEDBACK_GRID)
    ]


def rosco_settings(turbine):
    """[(settings, controller)] of rosco_float; gains of mode 2 are the same motion of the hub."""
    found = []
    for each in settings_of(ROSCO_GRID):
        if each["mode"] == 2:
            each["gain"] = round(each["gain"] * turbine.rotor.hub_height, 6)
        found.append((each, Rosco(RoscoSettings(**each), CONTROL_DT)))
    return found


TUNABLE = {"floating_feedback": feedback_settings, "rosco_float": rosco_settings}
GRIDS = {"floating_feedback": FEEDBACK_GRID, "rosco_float": ROSCO_GRID}


def tune(name, duration=660.0, winds=WINDS, seeds=SEEDS, **engine):
    """DataFrame of a controller's grid, best first: its settings and its FIGURES over those of BASELINE.

    engine: jobs, progress, engine and address of evaluate. Settings with a failed run or with more travel
    than TRAVEL allows (column unfed_travel) come last, with a NaN cost.
    Raises: InputError for an unknown name.
    """
    if name not in TUNABLE:
        raise unknown("controller to tune", name, TUNABLE)
    candidates = TUNABLE[name](read_turbine("nrel5mw"))
    labelled = {str(i): controller for i, (_, controller) in enumerate(candidates)}
    unfed = UNFED[name]
    table = evaluate(
        {BASELINE: BASELINE, unfed: unfed, **labelled},
        [training_case(wind) for wind in winds],
        duration=duration, seeds=seeds, control_dt=CONTROL_DT, **engine,
    )  # fmt: skip
    travel = FIGURES["pitch_travel"]
    ratios, unfed_travel = mean_ratios(table, BASELINE, FIGURES.values()), mean_ratios(table, unfed, [travel])
    rows = []
    for label, (settings, _) in zip(labelled, candidates, strict=True):
        row = settings | {key: ratios.loc[label, column] for key, column in FIGURES.items()}
        row["unfed_travel"] = unfed_travel.loc[label, travel]
        cost = 0.5 * (row["platform_pitch"] + row["rotor_speed"])
        rows.append(row | {"cost": cost if row["unfed_travel"] <= TRAVEL else float("nan")})
    return pd.DataFrame(rows).sort_values("cost", ignore_index=True)


def tuned_text(tables):
    """Text of controllers/tuned.toml for {controller: table of tune()}.

    Raises: InputError where no setting of a table can be chosen.
    """
    lines = [
        "# Settings chosen on training cases by `python -m fowt_env.training.design.tune_feedback`.",
        "# Figures are means over the cases of the ratio to gspi_oc3; unfed_travel of that to the law unfed.",
    ]
    for name, table in tables.items():
        best = table.iloc[0]
        if best["cost"] != best["cost"]:
            raise InputError(f"controller {name!r}: no setting ran with a travel within {TRAVEL:g}")
        lines += ["", f"[{name}.settings]"]
        lines += [f"{key} = {int(best[key]) if key == 'mode' else float(best[key])!r}" for key in GRIDS[name]]
        figures = (*FIGURES, "unfed_travel", "cost")
        lines += ["", f"[{name}.figures]", *(f"{key} = {best[key]:.4f}" for key in figures)]
    return "\n".join(lines) + "\n"


def main(arguments=None):
    """Tune the controllers named, print each grid and write what was chosen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--engine", default="processes", help="where the runs go: processes or ray")
    parser.add_argument("--address", help="of a Ray cluster that is running")
    parser.add_argument("--out", default="results/tune", help="folder of the grids")
    given = parser.parse_args(arguments)
    tables = {}
    with session(given.engine, given.jobs, given.address):
        for name in TUNABLE:
            tables[name] = tune(
                name, jobs=given.jobs, progress=_report, engine=given.engine, address=given.address
            )
            print(f"\n{name}\n{tables[name].round(4).to_string()}")
            write_table(tables[name], Path(given.out) / f"tune_{name}.csv")
    with replacing(TUNED) as temporary:
        temporary.write_text(tuned_text(tables))


def _report(done, total, row):
    print(f"\r{done}/{total}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
