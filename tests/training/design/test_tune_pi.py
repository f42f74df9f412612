"""The search for the gains of pi_tuned, and that what it found is what the controller has."""

from pathlib import Path

import numpy as np
import pytest

from fowt_env.controllers.pi import TUNED_FACTORS, pi, pi_tuned
from fowt_env.errors import InputError
from fowt_env.training.design import tune_pi
from fowt_env.training.design.tune_pi import FAILED, PENALTY, TRAVEL, WEIGHED, candidate, cost, search
from fowt_env.training.evaluation.engines import session

ONES = dict.fromkeys(tune_pi.FACTORS, 1.0)


def test_factors_of_one_are_the_published_gains(turbine):
    np.testing.assert_array_equal(candidate(turbine, ONES).parameters, pi(turbine, 0.1).parameters)


def test_the_cost_is_the_mean_deviation_and_forbids_more_travel():
    relative = dict.fromkeys(WEIGHED, 0.8) | {TRAVEL: 0.5}
    assert cost(relative) == pytest.approx(0.8)
    assert cost(relative | {TRAVEL: 1.01}) == pytest.approx(0.8 + 0.01 * PENALTY)
    assert cost(None) == FAILED > cost(dict.fromkeys(WEIGHED, 2.0) | {TRAVEL: 1.0})


def test_the_search_starts_from_the_published_gains_and_takes_the_cheapest(monkeypatch):
    import pandas as pd

    def paraboloid(controllers, suite, seeds):
        """Deviations with their least at KP 1.5 times the published, whatever the rest."""
        name, controller = ("pi", None) if controllers == "pi" else next(iter(controllers.items()))
        ratio = 1.0 if controller is None else controller.settings.KP / published
        value = 1.0 + (np.log(ratio) - np.log(1.5)) ** 2
        columns = {"status": ["ok"], **{key: [value] for key in WEIGHED}, TRAVEL: [1.0]}
        return pd.DataFrame(columns)

    from fowt_env.controllers.pi import PISettings
    from fowt_env.scene.build import build_scene

    published = PISettings.published(build_scene("oc3_hywind").turbine).KP
    monkeypatch.setattr(tune_pi, "evaluate", paraboloid)
    factors, relative, tried = search((1001,), evaluations=80)
    assert tried[0][0] == ONES and tried[0][1][TRAVEL] == 1.0
    assert factors["KP"] == pytest.approx(1.5, rel=0.02)
    assert relative == min((pair[1] for pair in tried), key=cost)


@pytest.mark.slow
def test_ray_searches_as_one_process_does():
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'fowt-env[ray]'")
    cases = Path(__file__).with_name("tune_pi_suite.toml")
    serial = search((1001,), cases, evaluations=3)
    with session("ray", jobs=2):
        assert search((1001,), cases, evaluations=3, jobs=2, engine="ray") == serial


def test_seeds_that_the_suites_are_scored_on_are_refused():
    with pytest.raises(InputError, match="1000 or more"):
        search((1, 1001))


def test_pi_tuned_has_the_stored_factors_and_says_how_they_were_found(turbine):
    text = TUNED_FACTORS.read_text()
    assert "fowt_env.training.design.tune_pi" in text and "--seeds 10" in text
    tuned, base = pi_tuned(turbine, 0.1), pi(turbine, 0.1)
    import tomllib

    factors = tomllib.loads(text)
    assert tuned.settings.KP == pytest.approx(base.settings.KP * factors["KP"])
    assert tuned.settings.KI == pytest.approx(base.settings.KI * factors["KI"])
    assert tuned.settings.gain_schedule_pitch == pytest.approx(
        base.settings.gain_schedule_pitch * factors["gain_schedule_pitch"]
    )
    assert factors != ONES
