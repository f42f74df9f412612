"""The limit at a controller's own spending: one on the front is at 1, one with more deviation above."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from fowt_env.controllers.lqr.design import SENSORS
from fowt_env.errors import InputError
from fowt_env.scene.build import build_scene
from fowt_env.training.design.bound_control import (
    Information,
    Problem,
    baseline_deviations,
    front,
    noise_of,
)
from fowt_env.training.design.bound_lidar import lidar_of
from fowt_env.training.design.bound_plant import BoundPlant
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import COLUMNS
from fowt_env.training.reports.own_limits import OF_LIMIT, limit_texts, own_limits, read_limits

CASES = [case for case in read_suite("above_rated").cases if case.name in ("ntm_12", "ntm_18")]
FIVE = Information("five", SENSORS)
GSPI = {
    "RotSpeed_std_[rpm]": 0.9, "PtfmPitch_std_[deg]": 0.8, "blade_pitch_travel_[deg/s]": 0.1,
    "GenPwr_std_[kW]": 400.0, "GenTq_std_[kN-m]": 0.0, "torque_travel_[kN-m/s]": 0.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def plant():
    scene = build_scene("oc3_hywind", wind=18.0, fidelity="standard")
    return BoundPlant(scene, 18.0, CASES[1].sea), scene


def point(plant, information, lidar=None, travel=1.1, torque_travel=0.01):
    """{metric: value} of a controller on the front with its own spending, over GSPI."""
    base = baseline_deviations(plant, plant.true)
    limits = replace(base, travel=travel * base.travel, torque=0.03, torque_travel=torque_travel)
    problem = Problem(plant, information, noise_of("standard", plant.turbine), lidar)
    ((_, best, _),) = front(problem, limits, (0.7,))
    ratios = {
        "RotSpeed_std_[rpm]": best.rotor_speed / base.rotor_speed,
        "PtfmPitch_std_[deg]": best.platform_pitch / base.platform_pitch,
        "blade_pitch_travel_[deg/s]": best.travel / base.travel,
        "GenPwr_std_[kW]": best.power / base.power,
    }
    found = {name: GSPI[name] * ratio for name, ratio in ratios.items()}
    rated = 1e-3 * plant.turbine.torque_law.rated_torque
    return found | {
        "GenTq_std_[kN-m]": best.torque * rated,
        "torque_travel_[kN-m/s]": best.torque_travel * rated,
    }


def table(**controllers):
    rows = []
    for case in ("ntm_12", "ntm_18"):
        for name, figures in ({"gspi_oc3": GSPI} | controllers).items():
            row = dict.fromkeys(COLUMNS, np.nan) | {"status": "ok", "case": case, "seed": 1}
            rows.append(row | {"controller": name} | figures)
    return pd.DataFrame(rows)


def more(figures, factor):
    """The same spending for more deviation of rotor speed and platform pitch."""
    names = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]")
    return figures | {name: factor * figures[name] for name in names}


def test_a_controller_on_the_front_of_its_own_spending_is_at_its_limit(plant):
    on = point(plant[0], FIVE)
    runs = table(on=on, above=more(on, 1.2))
    known = {name: (SENSORS, ()) for name in ("on", "above")}
    found = own_limits(runs, CASES, information=known).set_index("controller")
    assert set(found["case"]) == {"ntm_18"}  # not 12 m/s, where it does not hold
    assert found.loc["on", OF_LIMIT] == pytest.approx(1.0, abs=0.01)
    assert found.loc["above", OF_LIMIT] == pytest.approx(1.2, abs=0.015)
    assert 1.05 < found.loc["gspi_oc3", OF_LIMIT] < 1.6
    texts = limit_texts(found.reset_index())
    assert texts["above"].startswith(f"{found.loc['above', OF_LIMIT]:.2f} (")


def test_a_controller_with_a_lidar_has_the_limit_of_that_lidar(plant):
    model, scene = plant
    lidar = lidar_of(model, scene, "circular_cw")
    with_it = point(model, Information("lidar", SENSORS, lidar=True), lidar)
    known = {"x": ((*SENSORS, "lidar"), ()), "blind": (SENSORS, ())}
    found = own_limits(table(x=with_it, blind=with_it), CASES, "circular_cw", known).set_index("controller")
    assert found.loc["x", OF_LIMIT] == pytest.approx(1.0, abs=0.01)
    assert found.loc["blind", OF_LIMIT] < 0.85  # better than five sensors permit


def test_what_lacks_a_limit_is_named(plant, tmp_path):
    with pytest.raises(InputError, match="needs runs of gspi_oc3"):
        own_limits(table().assign(controller="x"), CASES)
    with pytest.raises(InputError, match="no case at a wind where the linear limit holds"):
        own_limits(table(), CASES[:1])
    greedy = GSPI | {"blade_pitch_travel_[deg/s]": 1e-6, "torque_travel_[kN-m/s]": 1.0}
    found = own_limits(table(x=greedy), CASES, information={"x": (SENSORS, ())}).set_index("controller")
    assert np.isnan(found.loc["x", OF_LIMIT]) and "no gains meet the limits" in found.loc["x", "why"]
    assert read_limits(tmp_path) is None
