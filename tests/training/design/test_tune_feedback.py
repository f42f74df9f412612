"""Choosing among settings: the figures of a grid, what is ruled out, and where the stored choice lies."""

import tomllib
from dataclasses import asdict

import numpy as np
import pandas as pd
import pytest

from fowt_env.controllers.floating_feedback import FeedbackSettings, FloatingFeedback
from fowt_env.controllers.pi import PISettings
from fowt_env.controllers.tuned import TUNED
from fowt_env.errors import InputError
from fowt_env.training.design import tune_feedback
from fowt_env.training.design.tune_feedback import (
    FEEDBACK_GRID,
    FIGURES,
    GRIDS,
    TRAVEL,
    TUNABLE,
    settings_of,
    training_case,
    tune,
    tuned_text,
)
from fowt_env.training.evaluation.evaluate import evaluate

SHORT = {"duration": 90.0, "winds": (17.0,), "seeds": (1001,)}


@pytest.fixture
def small(monkeypatch):
    """A grid of three: hardly any feedback, some, and far too much."""
    grid = FEEDBACK_GRID | {"pitch_gain": (0.001, 0.05, 0.5), "low_pass": (0.3,)}
    monkeypatch.setattr(tune_feedback, "FEEDBACK_GRID", grid)
    return grid


def test_a_grid_is_every_combination():
    assert settings_of({"a": (1, 2), "b": (3,)}) == [{"a": 1, "b": 3}, {"a": 2, "b": 3}]


def test_a_small_grid_has_the_figures_of_single_evaluations_and_rules_out_travel(small, turbine):
    table = tune("floating_feedback", **SHORT)
    assert len(table) == 3 and list(table.columns[:4]) == list(small)
    wild = table[table["pitch_gain"] == 0.5].iloc[0]
    assert wild["unfed_travel"] > TRAVEL and np.isnan(wild["cost"]) and table.index[-1] == wild.name
    calm = table.dropna()
    assert (calm["unfed_travel"] <= TRAVEL).all() and calm["cost"].is_monotonic_increasing
    np.testing.assert_allclose(calm["cost"], 0.5 * (calm["platform_pitch"] + calm["rotor_speed"]))
    best = FeedbackSettings(**{key: float(table.iloc[0][key]) for key in small})
    law = FloatingFeedback(PISettings.published(turbine), best, 0.1)
    rows = evaluate(
        {"gspi_oc3": "gspi_oc3", "best": law}, [training_case(17.0)], duration=90.0, seeds=(1001,)
    ).set_index("controller")
    for key, column in FIGURES.items():
        assert table.iloc[0][key] == rows.loc["best", column] / rows.loc["gspi_oc3", column]


def test_a_failed_setting_is_never_chosen(small, monkeypatch):
    def failing(turbine):
        found = tune_feedback.feedback_settings(turbine)
        found[1][1].parameters[:] = float("nan")
        return found

    monkeypatch.setitem(TUNABLE, "floating_feedback", failing)
    table = tune("floating_feedback", **SHORT)
    assert np.isnan(table.set_index("pitch_gain").loc[0.05, "cost"])
    assert table.iloc[0]["pitch_gain"] == 0.001


def test_a_grid_without_any_usable_setting_is_said():
    rows = pd.DataFrame([dict.fromkeys((*FEEDBACK_GRID, *FIGURES, "unfed_travel", "cost"), float("nan"))])
    with pytest.raises(InputError, match="no setting ran"):
        tuned_text({"floating_feedback": rows})


def test_the_text_written_gives_the_settings_back():
    settings = {"pitch_gain": 0.03, "low_pass": 0.2, "high_pass": 0.02, "torque_gain": 0.0}
    figures = dict.fromkeys((*FIGURES, "unfed_travel", "cost"), 0.9)
    read = tomllib.loads(tuned_text({"floating_feedback": pd.DataFrame([settings | figures])}))
    assert read["floating_feedback"] == {"settings": settings, "figures": figures}
    assert asdict(FeedbackSettings(**read["floating_feedback"]["settings"]))["pitch_gain"] == 0.03


def test_an_unknown_controller_is_named():
    with pytest.raises(InputError, match="Did you mean 'rosco_float'"):
        tune("rosco_flot")


@pytest.mark.parametrize("name", sorted(TUNABLE))
def test_the_stored_choice_lies_inside_its_grid_and_within_the_travel(name):
    stored = tomllib.loads(TUNED.read_text())[name]
    assert set(stored["settings"]) == set(GRIDS[name])
    for key in ("pitch_gain" if "pitch_gain" in GRIDS[name] else "gain", "low_pass"):
        values = sorted(GRIDS[name][key])
        scale = 90.0 if stored["settings"].get("mode") == 2 and key == "gain" else 1.0
        assert scale * values[0] < stored["settings"][key] < scale * values[-1]
    assert stored["figures"]["unfed_travel"] <= TRAVEL
    assert stored["figures"]["cost"] < 1.0


def test_the_command_writes_the_grids_and_the_choice(tmp_path, monkeypatch):
    def stored(name, **engine):
        assert engine["jobs"] == 3 and engine["engine"] == "processes"
        values = {key: grid[0] for key, grid in GRIDS[name].items()}
        return pd.DataFrame([values | dict.fromkeys((*FIGURES, "unfed_travel", "cost"), 0.5)])

    monkeypatch.setattr(tune_feedback, "tune", stored)
    monkeypatch.setattr(tune_feedback, "TUNED", tmp_path / "tuned.toml")
    tune_feedback.main(["--jobs", "3", "--out", str(tmp_path / "grids")])
    read = tomllib.loads((tmp_path / "tuned.toml").read_text())
    assert {name: read[name]["settings"]["low_pass"] for name in read} == dict.fromkeys(TUNABLE, 0.05)
    assert pd.read_csv(tmp_path / "grids" / "tune_rosco_float.csv")["cost"].tolist() == [0.5]


@pytest.mark.slow
def test_ray_tunes_to_the_same_table(small):
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'fowt-env[ray]'")
    from fowt_env.training.evaluation.engines import session

    with session("ray", jobs=2):
        spread = tune("floating_feedback", jobs=2, engine="ray", **SHORT)
    pd.testing.assert_frame_equal(spread, tune("floating_feedback", **SHORT), check_exact=True)
