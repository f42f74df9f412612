"""Compares each controller of an evaluation with the limit of linear control at its own spending.

    fowt evaluate --suite above_rated_elastic --controllers gspi_oc3,lqr,mpc --out results/elastic --of-limit

The limit is that of training/design/linear_bound.py on the plant of each case (rigid or elastic), for the
inputs of the controller, its pitch travel and power deviation over those of gspi_oc3, and its deviation and
mean rate of torque. Of all linear controllers with this information that spend no more, it has the least
rotor-speed and platform-pitch deviations in the ratio that the controller has; "of its limit" is the
controller's deviation over it: 1 at the limit, 1.2 for 20 % more of both.

Winds near rated are omitted, where lulls bring the turbine below rated and no linear limit holds.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from fowt_env.controllers.lqr.design import SENSORS, equivalent_wind
from fowt_env.controllers.lqr.optimum import NO_LULLS
from fowt_env.errors import InputError, muted
from fowt_env.files.tables import read_table
from fowt_env.scene.build import build_scene
from fowt_env.training.design.bound_control import (
    Deviations,
    Information,
    Problem,
    baseline_deviations,
    noise_of,
    towards,
)
from fowt_env.training.design.bound_lidar import lidar_of
from fowt_env.training.design.bound_plant import BoundPlant
from fowt_env.training.design.linear_bound import RATIOS, ratio_table
from fowt_env.training.evaluation.cases import mean_speed
from fowt_env.training.evaluation.results_table import KEY
from fowt_env.training.evaluation.run_case import OK, REFERENCE
from fowt_env.training.reports.bound_scores import (
    BASELINE,
    TORQUE_TRAVEL,
    WIND,
    declared,
    known_by,
    moves_torque,
)

FILE = "of_limit.csv"  # in a results folder
OF_LIMIT = "of_limit_[-]"
TORQUE = "GenTq_std_[kN-m]"
LEAST_TORQUE = 1e-3  # of rated torque and of it per second: limits of the torque that no controller is below


@dataclass
class _Wind:
    """Holds plant, noise and solved Problems of one case."""

    case: object
    plant: BoundPlant
    scene: object
    base: Deviations
    problems: dict

    def problem(self, information, lidar):
        """Return the Problem of an Information, made once."""
        if information not in self.problems:
            reader = lidar_of(self.plant, self.scene, lidar) if information.lidar else None
            noise = None
            if information.sensors is not None and self.case.sensors != "exact":
                noise = noise_of(self.case.sensors, self.scene.turbine)
            self.problems[information] = Problem(self.plant, information, noise, reader)
        return self.problems[information]


def own_limits(table, cases, lidar=None, information=None, progress: Callable | None = None):
    """Return a DataFrame with the limit of each controller at its own spending, per case.

    table        of an evaluation with gspi_oc3
    cases        the Cases of the evaluation; those with a mean wind where the linear limit holds are used
    lidar        lidar that controllers with this input read
    information  {label: (inputs, preview_times)}; other controllers: as bound_scores.declared
    Columns: controller, case, wind, ratios to gspi_oc3 (RATIOS), torque_std and torque travel, of rated, the
    ratios of the limit (limit_speed_[-], limit_pitch_[-]) and OF_LIMIT, NaN without a limit: why.
    Raises: InputError without gspi_oc3, and without a case at a wind of the limit.
    """
    good = table[(table["status"] == OK) & (table["controller"] != REFERENCE)]
    base = good[good["controller"] == BASELINE]
    if base.empty:
        raise InputError("results: the limit at own spending needs runs of gspi_oc3")
    used = [case for case in cases if _holds(case) and case.name in set(base["case"])]
    if not used:
        raise InputError("results: no case at a wind where the linear limit holds")
    names = list(dict.fromkeys(good["controller"]))
    rows, total = [], len(used) * len(names)
    for number, case in enumerate(used):
        wind, why = None, ""
        try:
            wind = _wind(case)
        except InputError as error:
            why = str(error)
        for index, name in enumerate(names, 1):
            row = _spent(good, base, name, case)
            if row is not None:
                row |= {"limit_speed_[-]": float("nan"), "limit_pitch_[-]": float("nan"),
                        OF_LIMIT: float("nan"), "why": why}  # fmt: skip
                if wind is not None:
                    inputs = (information or {}).get(name) or declared(name)
                    row |= _limit(wind, row, inputs, moves_torque(good, base, [name]), lidar)
                rows.append(row)
            if progress is not None:
                progress(number * len(names) + index, total)
    return pd.DataFrame(rows)


def _holds(case):
    """Return whether the linear limit holds for a Case: a mean wind above the lulls of rated wind."""
    speed = mean_speed(case)
    if speed is None or case.parked or case.fault is not None:
        return False
    with muted():
        turbine = build_scene(case.platform, wind=speed, **case.options).turbine
    above = equivalent_wind(turbine, speed) >= NO_LULLS - 1e-6
    return above and speed <= turbine.cut_out_wind_speed


def _wind(case):
    """Return the _Wind of a Case. Raises: InputError as BoundPlant."""
    speed = mean_speed(case)
    with muted():
        scene = build_scene(case.platform, wind=speed, **case.options)
    plant = BoundPlant(scene, speed, case.sea)
    return _Wind(case, plant, scene, baseline_deviations(plant, plant.true), {})


def _spent(good, base, name, case):
    """Return what a controller reached and spent in a case, over gspi_oc3 on the same seeds; None: no run."""
    runs = good[(good["controller"] == name) & (good["case"] == case.name)]
    shared = runs.merge(base[KEY[1:]], on=KEY[1:])[KEY[1:]]
    if shared.empty:
        return None
    pair = [frame.merge(shared, on=KEY[1:]) for frame in (base.assign(controller=BASELINE), runs)]
    speed = mean_speed(case)
    row = {"controller": name, "case": case.name, WIND: speed}
    own = name if name != BASELINE else f"{BASELINE} "
    both = pd.concat([pair[0], pair[1].assign(controller=own)]).rename(columns={"controller": "variant"})
    ratios = ratio_table(both.assign(case=f"case_{speed:g}")).iloc[0]
    row |= {column: float(ratios[column]) for column in RATIOS}
    return row | {TORQUE: float(pair[1][TORQUE].mean()), TORQUE_TRAVEL: float(pair[1][TORQUE_TRAVEL].mean())}


def _limit(wind, row, inputs, torque, lidar):
    """Return the ratios of the limit for a row of _spent."""
    fields, times = inputs
    base, law = wind.base, wind.plant.turbine.torque_law
    sees = "lidar" in fields
    kind, (text, sensors) = known_by(fields)
    ahead = max(times, default=None) if "wind_preview" in fields else None
    chosen = Information(kind if ahead is None else f"{text}, preview", sensors, ahead, torque)
    if sees:
        chosen = Information("sensors and lidar", SENSORS, None, torque, True)
    rated = 1e-3 * law.rated_torque  # kN m
    limits = replace(
        base,
        travel=row["travel_ratio_[-]"] * base.travel,
        power=row["power_ratio_[-]"] * base.power,
        torque=max(row[TORQUE] / rated, LEAST_TORQUE),
        torque_travel=max(row[TORQUE_TRAVEL] / rated, LEAST_TORQUE),
    )
    own = replace(
        base,
        rotor_speed=row["speed_ratio_[-]"] * base.rotor_speed,
        platform_pitch=row["pitch_ratio_[-]"] * base.platform_pitch,
    )
    try:
        best = towards(wind.problem(chosen, lidar), limits, own)[1]
    except InputError as error:
        return {"why": str(error)}
    ratios = own.rotor_speed / best.rotor_speed, own.platform_pitch / best.platform_pitch
    return {
        "limit_speed_[-]": best.rotor_speed / base.rotor_speed,
        "limit_pitch_[-]": best.platform_pitch / base.platform_pitch,
        OF_LIMIT: float(min(ratios)),
    }


def read_limits(folder):
    """Return the table of own_limits in a results folder; None if there is none."""
    path = Path(folder) / FILE
    return read_table(path) if path.is_file() else None


def limit_texts(limits):
    """Return {controller: "1.07 (1.02 to 1.12)"}: mean and range over the winds of own_limits."""
    found = {}
    for name, here in limits.groupby("controller", sort=False):
        values = here[OF_LIMIT].dropna()
        found[name] = (
            f"{values.mean():.2f} ({values.min():.2f} to {values.max():.2f})" if len(values) else "-"
        )
    return found
