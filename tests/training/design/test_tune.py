"""The search of settings: the objective on real runs, the search on a made-up one, and what it writes."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.controllers.floating_feedback import floating_feedback
from fowt_env.controllers.pi import pi_tuned
from fowt_env.controllers.rosco import rosco_float
from fowt_env.controllers.tuned import tuned
from fowt_env.errors import InputError
from fowt_env.training.design import tune as module
from fowt_env.training.design.tune import LOST, PENALTY, Objective, spaces, tune, write_tuned
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import leaderboard

SUITE = """
version = 1
description = "short winds"
source = "none"
wind = "rotor-averaged"
duration = 60.0
skip = 20.0

[[case]]
name = "ntm_{speed}"
speed = [14, 18]
wind = {kind = "ntm", class = "B", sigma = "drawn"}

[site]
A = 11.284
k = 2.0
source = "none"
"""


@pytest.fixture
def suite(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SUITE)
    return path


class Idle:
    """A controller that lets the rotor run away."""

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return 0.0, 0.0


def test_the_controllers_have_what_the_file_holds(turbine):
    for name, make in {"pi_tuned": pi_tuned, "floating_feedback": floating_feedback}.items():
        mine = spaces()[name].make(tuned(name), turbine, 0.1)
        np.testing.assert_array_equal(mine.parameters, make(turbine, 0.1).parameters)
    mine = spaces()["rosco_float"].make(tuned("rosco_float"), turbine, 0.1)
    assert mine.settings == rosco_float(turbine, 0.1).settings
    for name in ("lqr", "mpc"):
        assert dict(spaces()[name].start) == pytest.approx(tuned(name), rel=1e-3), name


@pytest.mark.parametrize("name", sorted(spaces()))
def test_a_place_is_its_settings_and_back(name):
    space = spaces()[name]
    place = np.linspace(0.1, 0.9, len(space.ranges))
    np.testing.assert_allclose(space.place(space.settings(place)), place, atol=1e-12)
    ends = space.settings(np.ones(len(space.ranges)))
    assert ends == pytest.approx({key: high for key, (_, high) in space.ranges.items()})


def test_the_cost_is_the_mean_of_the_lifetime_ratios_of_the_leaderboard(suite):
    objective = Objective(suite, seeds=(1001, 1002))
    found = objective("floating_feedback")
    table = pd.concat([objective.base, evaluate("floating_feedback", objective.suite, seeds=(1001, 1002))])
    entries = leaderboard(table, "gspi_oc3")["controllers"]
    (entry,) = (one for one in entries if one["controller"] == "floating_feedback")
    for key, metric in module.FIGURES.items():
        assert found[key] == pytest.approx(1.0 + entry["difference"][metric]["percent"] / 100.0, rel=1e-9)
    aims = 0.5 * (found["rotor_speed_ratio"] + found["platform_pitch_ratio"])
    assert found["cost"] == pytest.approx(aims + PENALTY * found["beyond"]) and found["lost"] == 0.0


SCORE = """
[score]
baseline = "gspi_oc3"
power = "GenPwr_capped_mean_[kW]"

[[score.term]]
metric = "RotSpeed_std_[rpm]"
weight = 1.0

[[score.term]]
metric = "blade_pitch_travel_[deg/s]"
weight = 1.0
"""


def test_the_aim_scores_is_the_mean_of_both_scores_of_the_leaderboard(tmp_path, monkeypatch):
    path = tmp_path / "scored.toml"
    path.write_text(SUITE + SCORE)
    monkeypatch.setattr(module, "LIMITS", {})
    objective = Objective(path, seeds=(1001,), aim="scores")
    found = objective("pi_unscheduled")
    runs = [objective.base, evaluate("pi_unscheduled", objective.suite, seeds=(1001,), reference=False)]
    entries = leaderboard(pd.concat(runs), score=objective.suite.score)["controllers"]
    (score,) = (one["score"] for one in entries if one["controller"] == "pi_unscheduled")
    both = [score[key]["mean"] for key in ("lifetime", "winds")]
    assert both[0] != pytest.approx(both[1], rel=1e-3)
    assert found["cost"] == pytest.approx(np.mean(both) + PENALTY * found["beyond"])
    table = pd.concat(runs).pivot(index="case", columns="controller")
    beyond = 0.0
    for metric, (most,) in module.EACH.items():
        ratio = table[metric]["pi_unscheduled"] / table[metric]["reference"]
        beyond += (ratio / most - 1.0).clip(lower=0.0)[np.isfinite(ratio)].sum()
    assert found["beyond"] == pytest.approx(beyond) and beyond > 0.0


def test_what_trips_costs_more_than_what_does_not(suite):
    objective = Objective(suite, seeds=(1001,))
    found = objective(Idle())
    assert found["lost"] == 1.0 and found["cost"] > LOST > objective("pi")["cost"]


def test_beyond_a_limit_costs_in_proportion(suite, monkeypatch):
    objective = Objective(suite, seeds=(1001,))
    plain = objective("pi_unscheduled")
    monkeypatch.setattr(module, "LIMITS", {"blade_pitch_travel_[deg/s]": 1.0})
    one = objective("pi_unscheduled")
    assert one["beyond"] == pytest.approx(one["travel_ratio"] - 1.0) and one["beyond"] > 0.1
    assert plain["beyond"] > one["beyond"]


def test_a_limit_of_each_wind_costs_in_each_wind(tmp_path, monkeypatch):
    path = tmp_path / "limited.toml"
    path.write_text(f'{SUITE}[limits.case_relative]\n"blade_pitch_travel_[deg/s]" = 1.0\n')
    monkeypatch.setattr(module, "LIMITS", {})
    objective = Objective(path, seeds=(1001,))
    found, table = objective("pi_unscheduled"), objective.base
    runs = pd.concat([table, evaluate("pi_unscheduled", objective.suite, seeds=(1001,), reference=False)])
    travel = runs.pivot(index="case", columns="controller", values="blade_pitch_travel_[deg/s]")
    excess = (travel["pi_unscheduled"] / travel["reference"] - 1.0).clip(lower=0.0)
    assert found["beyond"] == pytest.approx(excess.sum()) and (excess > 0.0).any()


def test_the_search_starts_from_the_settings_of_now_and_takes_the_cheapest(monkeypatch, tmp_path):
    class Bowl:
        """Cost with its least at KP 1.5 and KI 0.5."""

        def __init__(self, **asked):
            self.turbine = None

        def __call__(self, controller):
            cost = np.log(controller["KP"] / 1.5) ** 2 + np.log(controller["KI"] / 0.5) ** 2
            return {"cost": cost, **dict.fromkeys(module.FIGURES, 1.0), "lost": 0.0, "beyond": 0.0}

    monkeypatch.setattr(module, "Objective", Bowl)
    space = module.Space(
        {"KP": (0.3, 4.0), "KI": (0.05, 3.0)}, {"KP": 1.0, "KI": 1.0}, lambda settings, *_: settings
    )
    monkeypatch.setattr(module, "spaces", lambda: {"pi_tuned": space})
    seen = []
    settings, figures, table = tune("pi_tuned", 60, tmp_path, lambda number, row: seen.append(number))
    assert dict(table.loc[0, ["KP", "KI"]]) == pytest.approx({"KP": 1.0, "KI": 1.0})
    assert settings == pytest.approx({"KP": 1.5, "KI": 0.5}, rel=0.05)
    assert figures["cost"] == table["cost"].min() and len(table) <= 60
    assert seen == list(range(1, len(table) + 1))
    assert len(pd.read_csv(tmp_path / "tune_pi_tuned.csv")) == len(table)
    path = tmp_path / "tuned.toml"
    path.write_text("[other.settings]\nx = 1.0\n")
    write_tuned("pi_tuned", settings, figures, 60, {}, path)
    import tomllib

    held = tomllib.loads(path.read_text())
    assert held["other"]["settings"] == {"x": 1.0}
    assert held["pi_tuned"]["settings"]["KP"] == pytest.approx(settings["KP"], rel=1e-3)
    assert held["pi_tuned"]["search"] == {"suite": "above_rated", "seeds": [1001, 1002], "budget": 60}
    write_tuned("pi_tuned", settings, figures, 60, {"aim": "scores"}, path)
    assert tomllib.loads(path.read_text())["pi_tuned"]["search"]["aim"] == "scores"


def test_what_cannot_be_searched_is_refused(suite):
    with pytest.raises(InputError, match="unknown controller to tune 'pi'"):
        tune("pi")
    with pytest.raises(InputError, match="budget"):
        tune("pi_tuned", 2)
    with pytest.raises(InputError, match="1000 or more"):
        tune("pi_tuned", suite=suite, seeds=(1,))
    with pytest.raises(InputError, match="unknown aim 'loads'"):
        Objective(suite, aim="loads")
