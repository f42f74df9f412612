"""Tunes all baselines by one search: same objective, seeds, sensors, limits and number of evaluations.

    fowt design search rosco_float --budget 40 --out results/tune

Settings are evaluated on the cases of a suite with validation seeds (1000 and above, never used for scoring).
The cost is the aim over gspi_oc3 on the same runs, plus PENALTY times the relative excess over the suite's
limits, in each wind, and over LIMITS, plus LOST times the fraction of lost runs. The aim "motions" is the
mean of the lifetime deviations of rotor speed and platform pitch; "scores" is the mean of the suite's two
scores, and EACH limits each wind. The current settings come first, then up to half of the budget
in a Sobol sequence, then the Nelder-Mead method from the best. OUT/tune_NAME.csv is written after each.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import minimize
from scipy.stats import qmc

from fowt_env.controllers.floating_feedback import FeedbackSettings, FloatingFeedback
from fowt_env.controllers.lqr.design import LQGSettings
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.mpc.law import MPC
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.controllers.pi import PI, PISettings
from fowt_env.controllers.rosco import Rosco, RoscoSettings
from fowt_env.controllers.tuned import TUNED, tuned
from fowt_env.descriptions.checks import check_whole_number
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import write_table
from fowt_env.scene.build import build_scene
from fowt_env.training.evaluation.bootstrap import lifetime_means
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.failures import penalised, with_lost_power
from fowt_env.training.evaluation.leaderboard import decisions, leaderboard
from fowt_env.training.evaluation.metrics import EXPONENTS, METRICS, better
from fowt_env.training.evaluation.results_table import case_shares
from fowt_env.training.evaluation.run_case import CONTROL_DT, OK, REFERENCE
from fowt_env.training.evaluation.seeds import VALIDATION

BASELINE = "gspi_oc3"
SUITE, SEEDS, BUDGET = "above_rated", (1001, 1002), 40
AIMS = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]")
FIGURES = {
    "rotor_speed_ratio": "RotSpeed_std_[rpm]", "platform_pitch_ratio": "PtfmPitch_std_[deg]",
    "travel_ratio": "blade_pitch_travel_[deg/s]", "shaft_ratio": "RotTorq_DEL_[kN-m]",
    "energy_ratio": "GenPwr_capped_mean_[kW]", "power_std_ratio": "GenPwr_std_[kW]",
}  # fmt: skip
# ratios to the baseline, stricter than the suite's: an optimum at a limit exceeds it on other seeds
LIMITS = {"blade_pitch_travel_[deg/s]": 0.98, "RotTorq_DEL_[kN-m]": 1.05, "GenPwr_capped_mean_[kW]": 0.995}
EACH = {  # of each wind
    "blade_pitch_travel_[deg/s]": (1.2,), "RotTorq_DEL_[kN-m]": (1.2,), "GenPwr_std_[kW]": (1.05,),
    "RotSpeed_std_[rpm]": (1.0,),
}  # fmt: skip
MOTIONS, SCORES = "motions", "scores"  # aims of a search
PENALTY = 10.0  # 1 % above a limit costs as much as 10 % of the deviations
LOST = 5.0
FIRST_STEP = 0.12  # size of the initial simplex in the unit cube


@dataclass(frozen=True)
class Space:
    """Defines the search space of a controller: {setting: (low, high)}, logarithmic if low is positive.

    start: the current settings. make(settings, turbine, control_dt): returns the controller.
    """

    ranges: Mapping[str, tuple[float, float]]
    start: Mapping[str, float]
    make: Callable[..., Any]

    def settings(self, point):
        """Return {setting: value} of a point (n,) in the unit cube."""
        x = dict(zip(self.ranges, np.clip(point, 0.0, 1.0), strict=True))
        return {
            key: float(low * (high / low) ** x[key] if low > 0.0 else low + (high - low) * x[key])
            for key, (low, high) in self.ranges.items()
        }

    def place(self, settings):
        """Return the point (n,) of settings in the unit cube, clipped to the cube."""
        low, high = np.array(list(self.ranges.values())).T
        value = np.clip([settings[key] for key in self.ranges], low, high)
        with np.errstate(all="ignore"):
            logarithmic = np.log(value / low) / np.log(high / low)
        return np.where(low > 0.0, logarithmic, (value - low) / (high - low))


def scaled_pi(settings, turbine):
    """Return the published PISettings of a turbine times {setting: factor}."""
    published = PISettings.published(turbine)
    return published.changed(**{name: getattr(published, name) * factor for name, factor in settings.items()})


def _pi(settings, turbine, control_dt):
    return PI(scaled_pi(settings, turbine), control_dt, "pi_tuned")


_LQR = {
    "share": (0.0, 0.9), "share_growth": (-0.04, 0.04), "travel": (0.85, 1.05), "travel_cap": (0.11, 0.18),
    "travel_near_rated": (0.15, 0.35), "shaft": (0.4, 1.5), "shaft_near_rated": (0.03, 0.12),
    "torque_rate": (0.03, 2.0), "schedule_time": (60.0, 250.0),
}  # fmt: skip
_MPC = {
    "platform_pitch": (0.5, 2.0), "surge": (0.25, 1.5), "shaft": (0.08, 0.5), "power": (0.02, 0.5),
    "travel": (0.8, 1.2), "shaft_near_rated": (0.01, 0.06), "torque_rate": (0.02, 0.5),
    "schedule_time": (100.0, 400.0),
}  # fmt: skip


_FEEDBACK = {
    "pitch_gain": (0.01, 0.3), "low_pass": (0.05, 0.6), "high_pass": (0.005, 0.04),
    "torque_gain": (-400.0, 400.0),
}  # fmt: skip
_ROSCO = {
    "kp": (0.3, 3.0), "ki": (0.1, 2.0), "gain": (-0.3, 0.0), "low_pass": (0.05, 0.6),
    "high_pass": (0.003, 0.04),
}  # fmt: skip
FACTORS = {"KP": (0.3, 4.0), "KI": (0.05, 3.0), "gain_schedule_pitch": (0.3, 4.0)}


def spaces():
    """Return {name: Space} of the baselines."""

    def of(record, ranges):
        return ranges, {key: getattr(record, key) for key in ranges}

    def predictive(name, **ahead):
        def law(settings, turbine, dt):
            return MPC(turbine, dt, MPCSettings(**settings), name, **ahead)

        return Space(*of(MPCSettings(), _MPC), law)

    def feedback(settings, turbine, dt):
        return FloatingFeedback(PISettings.published(turbine), FeedbackSettings(**settings), dt)

    return {
        "floating_feedback": Space(_FEEDBACK, tuned("floating_feedback"), feedback),
        "lqr": Space(*of(LQGSettings(), _LQR), lambda s, t, dt: LQR(t, dt, LQGSettings(**s))),
        "mpc": predictive("mpc"),
        "mpc_lidar": predictive("mpc_lidar", lidar=True),
        "mpc_preview": predictive("mpc_preview", preview=True),
        "pi_tuned": Space(FACTORS, tuned("pi_tuned"), _pi),
        "rosco_float": Space(
            _ROSCO, tuned("rosco_float"),
            lambda s, t, dt: Rosco(RoscoSettings(mode=1, **s), dt, "rosco_float"),
        ),
    }  # fmt: skip


class Objective:
    """Computes the cost of controllers on the cases of a suite with some validation seeds."""

    def __init__(self, suite=SUITE, seeds=SEEDS, platform=None, aim=MOTIONS, **engine):
        if any(seed < VALIDATION.start for seed in seeds):
            raise InputError(
                f"seeds = {list(seeds)}: must be {VALIDATION.start} or more, which are not used for scoring"
            )
        if aim not in (MOTIONS, SCORES):
            raise unknown("aim", aim, (MOTIONS, SCORES))
        self.suite, self.seeds, self.engine, self.aim = read_suite(suite, platform), tuple(seeds), engine, aim
        self.turbine = build_scene(self.suite.cases[0].platform).turbine
        self.base = evaluate(BASELINE, self.suite, seeds=self.seeds, reference=BASELINE, **engine)

    def __call__(self, controller):
        """Return {"cost", FIGURES over the baseline's, "lost", "beyond"} of a controller."""
        made = evaluate(
            {"candidate": controller}, self.suite, seeds=self.seeds, reference=False, **self.engine
        )
        made = with_lost_power(pd.concat([self.base, made], ignore_index=True))
        runs = made[made["controller"] == "candidate"]
        table = penalised(made, REFERENCE)
        tuned, base = (self._means(table[table["controller"] == name]) for name in ("candidate", REFERENCE))
        ratio = tuned / base
        lost = float((runs["status"] != OK).mean())
        limits = self.suite.limits
        others = {name: limit for name, limit in limits.relative.items() if name not in LIMITS}
        each = limits.case_relative | (EACH if self.aim == SCORES else {})
        limits = limits.model_copy(update={"relative": others, "case_relative": each})
        beyond = [-better(name) * (ratio[name] / limit - 1.0) for name, limit in LIMITS.items()]
        beyond += [each.excess for each in decisions(made, "candidate", limits)]
        excess = sum(max(0.0, each) for each in beyond)
        aims = [ratio[name] for name in AIMS] if self.aim == MOTIONS else self._scores(made)
        cost = float(np.mean(aims)) + PENALTY * excess + LOST * lost
        result = {"cost": cost if np.isfinite(cost) else 2.0 * LOST}
        result |= {key: float(ratio[name]) for key, name in FIGURES.items()}
        return result | {"lost": lost, "beyond": float(excess)}

    def _scores(self, table):
        """Return the suite's scores of the candidate: of the lifetime, and mean of the winds."""
        entries = leaderboard(table, score=self.suite.score)["controllers"]
        (entry,) = (each for each in entries if each["controller"] == "candidate")
        return [entry["score"][key]["mean"] for key in ("lifetime", "winds")]

    def _means(self, runs):
        """Return a Series of the lifetime means of METRICS over the runs of one controller."""
        cases = [case.name for case in self.suite.cases]
        index = pd.MultiIndex.from_product([cases, self.seeds], names=["case", "seed"])
        values = runs.set_index(["case", "seed"])[list(METRICS)].reindex(index).to_numpy(dtype=np.float64)
        values = values.reshape(len(cases), len(self.seeds), len(METRICS))
        weights = np.ones((1, len(self.seeds)))
        means = lifetime_means(values, weights, case_shares(self.base, cases), EXPONENTS)[0]
        return pd.Series(means, index=list(METRICS))


def tune(name, budget=BUDGET, out=None, report=None, **objective):
    """Return (best settings, metrics of these, DataFrame of all evaluations in order) of a baseline.

    budget     number of evaluations
    out        folder of tune_NAME.csv; None: not written
    report     called as report(number, row) after each evaluation
    objective  arguments of Objective
    Raises: InputError for an unknown name, seeds of the suites, or a budget below 4.
    """
    known = spaces()
    if name not in known:
        raise unknown("controller to tune", name, known)
    check_whole_number("budget", budget, 4)
    space, judge, rows = known[name], Objective(**objective), []

    def cost(point):
        settings = space.settings(point)
        row = settings | judge(space.make(settings, judge.turbine, CONTROL_DT))
        # outside the cube: cost of the nearest point inside plus the distance
        row["cost"] += float(np.sum(np.abs(point - np.clip(point, 0.0, 1.0))))
        rows.append(row)
        if out is not None:
            write_table(pd.DataFrame(rows), Path(out) / f"tune_{name}.csv")
        if report is not None:
            report(len(rows), row)
        return row["cost"]

    start = space.place(space.start)
    spread = qmc.Sobol(len(start), seed=0).random_base2(int(np.log2(0.5 * budget)))
    tried = [start, *spread]
    costs = [cost(place) for place in tried]
    best = tried[int(np.argmin(costs))]
    steps = FIRST_STEP * np.diag(np.where(best > 1.0 - FIRST_STEP, -1.0, 1.0))
    simplex = np.vstack([best, best + steps])
    options = {"maxfev": budget - len(tried), "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-4}
    minimize(cost, best, method="Nelder-Mead", options=options)
    table = pd.DataFrame(rows)
    chosen = table.loc[table["cost"].idxmin()]
    figures = {key: float(chosen[key]) for key in ("cost", *FIGURES, "lost", "beyond")}
    return {key: float(chosen[key]) for key in space.ranges}, figures, table


def write_tuned(name, settings, figures, budget, objective, path=TUNED):
    """Write settings into tuned.toml, replacing those of the same controller."""
    import tomllib

    stored = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    seeds, aim = list(objective.get("seeds", SEEDS)), objective.get("aim", MOTIONS)
    stored[name] = {
        "settings": {key: float(f"{value:.4g}") for key, value in settings.items()},
        "figures": {key: round(value, 4) for key, value in figures.items()},
        "search": {"suite": objective.get("suite", SUITE), "seeds": seeds, "budget": budget}
        | ({} if aim == MOTIONS else {"aim": aim}),
    }
    lines = [
        "# Settings optimised by `fowt design search NAME`. Ratios are to gspi_oc3 on the seeds searched.",
    ]
    for controller in sorted(stored):
        for section, values in stored[controller].items():
            lines += ["", f"[{controller}.{section}]"]
            lines += [f"{key} = {value!r}".replace("'", '"') for key, value in values.items()]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
