"""The search for a better last layer of mpc_clone: its optimiser, its candidates, its runs, its costs."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from fowt_env.controllers.mpc.clone import FILE, HIDDEN, N_INPUTS, read_clone
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.studies import search_clone
from fowt_env.training.studies.clone_mpc import write_clone


def test_the_same_seed_searches_alike_from_zero():
    drawn = [search_clone.optimiser(5, 10, seed).ask() for seed in (0, 0, 1)]
    assert np.array_equal(drawn[0], drawn[1]) and not np.array_equal(drawn[0], drawn[2])
    assert len(drawn[0]) == 10
    spread = np.std(search_clone.optimiser(5, 4000, 0).ask(), axis=0)
    assert spread == pytest.approx(search_clone.STEP, rel=0.1)  # four standard errors
    assert np.array_equal(search_clone.optimiser(5, 10, 0).mean, np.zeros(5))


def test_without_cma_the_extra_to_install_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(InputError, match=r"fowt-env\[search\]"):
        search_clone.optimiser(5, 10, 0)


def test_a_candidate_adds_its_vector_times_the_components():
    network, rng = read_clone(FILE)[1], np.random.default_rng(0)
    mean, spread = rng.normal(size=HIDDEN), np.array([0.2, 0.05])
    components = rng.normal(size=(search_clone.COMPONENTS, HIDDEN))
    vector = rng.normal(size=search_clone.UNKNOWNS)
    found = search_clone.changed(network, components, mean, spread, vector)
    x = (network["mean"] + network["scale"] * rng.normal(size=(20, N_INPUTS)) - network["mean"]) / network[
        "scale"
    ]
    for i in range(2):
        x = np.tanh(x @ network[f"weight_{i}"].T + network[f"bias_{i}"])
    shown = np.column_stack([np.ones(20), (x - mean) @ components.T])
    outputs = [x @ each["weight_2"].T + each["bias_2"] for each in (found, network)]
    assert outputs[0] - outputs[1] == pytest.approx(spread * (shown @ vector.reshape(2, -1).T))
    same = search_clone.changed(network, components, mean, spread, 0.0 * vector)
    assert all(np.array_equal(same[name], network[name]) for name in network)


@pytest.mark.nightly
def test_episodes_are_the_runs_of_a_suite_and_candidates_differ():
    suite = read_suite(search_clone.LULLS)
    case = suite.cases[1]
    episodes = search_clone.Episodes([case], 2, 40.0, 10.0)
    one = search_clone.Episodes([case], 1, 40.0, 10.0)
    one.weather([1234])
    episodes.begin_as(one)
    network = read_clone(FILE)[1]
    stronger = network | {"weight_2": 1.2 * network["weight_2"]}
    (kept,), (moved,) = episodes.run([network, stronger])
    one_case = replace(suite, cases=[case])
    table = evaluate("mpc_clone", one_case, seeds=[1234], duration=40.0, skip=10.0)
    row = table[table["controller"] == "mpc_clone"].iloc[0]
    for name in ("RotSpeed_std_[rpm]", "RotTorq_DEL_[kN-m]", "blade_pitch_travel_[deg/s]"):
        assert kept[name] == pytest.approx(row[name], rel=1e-9)
        assert moved[name] != kept[name]


def test_a_lost_run_and_an_exceeded_limit_cost():
    travel, suite = "blade_pitch_travel_[deg/s]", read_suite(search_clone.LULLS)
    run = dict.fromkeys(("RotSpeed_std_[rpm]", travel, "RotTorq_DEL_[kN-m]", "GenPwr_capped_mean_[kW]"), 1.0)
    run |= {"torque_travel_[kN-m/s]": 0.5, "GenPwr_max_[kW]": 5000.0}
    terms = [term for term in suite.score.term if term.metric in ("RotSpeed_std_[rpm]", travel)]
    relative = {**suite.limits.relative, "RotTorq_DEL_[kN-m]": 1.1, "RotSpeed_std_[rpm]": 0.6}
    limits = suite.limits.model_copy(update={"relative": relative | {travel: 1.1}})
    suite = replace(suite, score=suite.score.model_copy(update={"term": terms}), limits=limits)
    better = run | {"RotSpeed_std_[rpm]": 0.5}
    assert search_clone.score_of([better, better], [run, run], suite) == pytest.approx((0.75, 0.0))
    margin = suite.limits.relative[travel] * search_clone.MARGIN
    far = better | {travel: margin + 0.1, "torque_travel_[kN-m/s]": 0.6}
    assert search_clone.score_of([far], [run], suite)[1] == pytest.approx(0.1 + 0.2)
    aim = object.__new__(search_clone.Aim)
    aim.suite, aim.reference, aim.energy = suite, [run, run, None], 0.0
    assert aim.cost({"normal": [better, better, better]}) == pytest.approx(0.75)
    assert aim.cost({"normal": [better, None, better]}) == pytest.approx(0.75 + search_clone.LOST / 3.0)
    score = (0.5 + margin + 0.1) / 2.0
    assert aim.cost({"normal": [far, far, far]}) == pytest.approx(score + search_clone.PRICE * 0.3)
    assert aim.cost({"normal": [None, None, better]}) == search_clone.LOST
    aim.energy, low = 0.95, better | {search_clone.CAPPED: 0.9}
    assert aim.cost({"normal": [low, low, low]}) == pytest.approx(0.75 / 0.9 + search_clone.PRICE * 0.05)
    aim.energy = 0.0
    speed = "overspeed_[%]"
    aim.of_start = {"normal": [better, better, better], "gusts": [run | {speed: 10.0}, run | {speed: 30.0}]}
    gusts = [run | {speed: 5.0}, run | {speed: 9.0}]
    runs = {"normal": [better, better, better], "gusts": gusts}
    assert aim.cost(runs) == pytest.approx(0.5 * (7.0 / 20.0 + 9.0 / 30.0))
    lacking = gusts[1] | {search_clone.CAPPED: search_clone.LEAST_POWER - 0.3}
    more = aim.cost(runs | {"gusts": [gusts[0], lacking]}) - aim.cost(runs)
    assert more == pytest.approx(search_clone.PRICE * 0.3)  # of a single run, not of a mean


def test_what_is_found_has_the_settings_of_its_start(monkeypatch, tmp_path):
    class Calm:
        start = {"normal": None}
        of_start = None

        def __init__(self, *given):
            self.given = given

        def weather(self, first):
            pass

        def costs(self, networks):
            return np.arange(len(networks), dtype=float)

        def cost(self, runs):
            return 1.0

    rng = np.random.default_rng(0)
    layer = (rng.normal(size=(search_clone.COMPONENTS, HIDDEN)), np.zeros(HIDDEN), np.ones(2))
    monkeypatch.setattr(search_clone, "Aim", Calm)
    monkeypatch.setattr(search_clone, "about_layer", lambda episodes: layer)
    settings, network = read_clone(FILE)
    own = settings.model_dump(exclude={"about"}) | {"platform": "elsewhere", "integral_limit": 1.5}
    write_clone(tmp_path / "start.npz", network, own, {"rounds": 7})
    search_clone.main("above", tmp_path / "out", generations=1, candidates=4, start=tmp_path / "start.npz")
    found, arrays = read_clone(tmp_path / "out" / "clone.npz")
    assert (found.platform, found.integral_limit, found.period) == ("elsewhere", 1.5, settings.period)
    assert found.about["start"] == {"rounds": 7} and found.about["aim"] == "above"
    assert not np.array_equal(arrays["weight_2"], network["weight_2"])
    assert np.array_equal(arrays["weight_1"], network["weight_1"])
