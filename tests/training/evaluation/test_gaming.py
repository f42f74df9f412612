"""Ways of looking better than one is: each ends below its honest twin on the leaderboard, or beyond a limit.

The first part judges figures by the headline suite, the second runs laws (gaming_laws.py): on the rigid
turbine, and with the mark nightly on the elastic one of the suite.
"""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from gaming_laws import GAMERS, TWIN, Recogniser, listed_winds

from fowt_env.control import make
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import RPM
from fowt_env.training.evaluation import bootstrap
from fowt_env.training.evaluation import leaderboard as board_module
from fowt_env.training.evaluation.cases import Case, Limits, read_suite
from fowt_env.training.evaluation.evaluate import COLUMNS, evaluate
from fowt_env.training.evaluation.failures import PENALTY, penalised, with_lost_power
from fowt_env.training.evaluation.leaderboard import leaderboard
from fowt_env.training.evaluation.metric_names import short_name
from fowt_env.training.evaluation.metrics import METRICS, better
from fowt_env.training.evaluation.run_case import REFERENCE
from fowt_env.training.evaluation.seeds import drawn_seeds
from fowt_env.training.reports.scores import agent_scores


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    """Ranks need no intervals to three digits."""
    for module, name in ((board_module, "resample_weights"), (bootstrap, "resample_weights")):
        drawn = getattr(module, name)
        few = lambda n, resamples=200, random_seed=1, drawn=drawn: drawn(n, 200, random_seed)  # noqa: E731
        monkeypatch.setattr(module, name, few)


HEADLINE = read_suite("above_rated_elastic")
SPEED, LEAN, ENERGY = "RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "GenPwr_capped_mean_[kW]"
TRAVEL, TORQUE, SHAFT = "blade_pitch_travel_[deg/s]", "torque_travel_[kN-m/s]", "RotTorq_DEL_[kN-m]"
TOWER, ROOT = "TwrBsMyt_DEL_[kN-m]", "RootMyb_DEL_[kN-m]"
POWER, PEAK, PAST = "GenPwr_mean_[kW]", "GenPwr_max_[kW]", "rotor_speed_above_limit_[s]"
HELD_SPEED, HELD_TORQUE = "RotSpeed_mean_[rpm]", "GenTq_mean_[kN-m]"
LOADS = (SHAFT, TOWER, ROOT)
TYPICAL = dict.fromkeys(METRICS, 1.0) | {
    POWER: 4900.0, ENERGY: 4800.0, PEAK: 5700.0, "energy_[kWh]": 800.0, TORQUE: 0.1, PAST: 0.0,
    HELD_SPEED: 12.1, HELD_TORQUE: 43.09355,
}  # fmt: skip

KNOWN = {}  # hashes of runs: what entries() has found


def table(**controllers):
    """An evaluation of the headline suite: {name: function of (wind, seed) that changes typical figures}.

    A figure "status" is that of the run; with "failed" it has none of the others. The reference has the
    typical figures, and so has gspi_oc3.
    """
    rows = []
    for case in HEADLINE.cases:
        for seed in range(1, 9):
            gusty = 1.0 + 0.02 * case.wind["speed"] + 0.05 * seed
            typical = dict.fromkeys((REFERENCE, "gspi_oc3"), lambda wind, seed: {})
            for name, change in {**typical, **controllers}.items():
                row = {
                    metric: value * (gusty if metric in (SPEED, LEAN) else 1.0)
                    for metric, value in TYPICAL.items()
                }
                factors = change(case.wind["speed"], seed)
                status = factors.pop("status", "ok")
                past = factors.pop(PAST, 0.0)
                row = {metric: np.nan if status == "failed" else value * factors.get(metric, 1.0)
                       for metric, value in row.items()} | {PAST: past}  # fmt: skip
                about = {"controller": name, "case": case.name, "seed": seed, "status": status, "reason": ""}
                rows.append(
                    dict.fromkeys(COLUMNS, 0.0) | row | about | {"weight_[-]": HEADLINE.weights[case.name]}
                )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def entries(runs):
    """{controller: entry} of the leaderboard of the headline suite, which takes seconds and is kept."""
    key = tuple(pd.util.hash_pandas_object(runs))
    if key not in KNOWN:
        board = leaderboard(runs, score=HEADLINE.score, limits=HEADLINE.limits)
        KNOWN[key] = {entry["controller"]: entry for entry in board["controllers"]}
    return KNOWN[key]


def ranks(runs):
    return {name: entry["rank"] for name, entry in entries(runs).items()}


def ratios(runs, agent):
    return agent_scores(runs, ["gspi_oc3"], agents=[agent]).set_index("figure")["ratio"]


def scores(runs):
    return {name: entry["score"]["mean"] for name, entry in entries(runs).items()}


def good(wind, seed):
    return {SPEED: 0.8, LEAN: 0.7}


@pytest.mark.parametrize("status", ["failed", "tripped", "lost power"])
def test_a_run_that_is_given_up_where_it_goes_badly_gains_nothing(status):
    def gives_up(wind, seed):
        return good(wind, seed) | ({"status": status} if seed > 3 else {})

    runs = table(honest=good, gamer=gives_up)
    assert ranks(runs)["honest"] < ranks(runs)["gspi_oc3"] < ranks(runs)["gamer"]
    assert (ratios(runs, "gamer") >= ratios(runs, "honest") - 1e-12).drop("energy").all()
    assert ratios(runs, "gamer")["rotor-speed std"] > 0.9  # not the 0.8 of the runs that it likes
    assert scores(runs)["gamer"] > scores(runs)["gspi_oc3"] == 1.0 > scores(runs)["honest"]
    entry = entries(runs)["gamer"]  # what is shown is of the runs that it likes, and is not tested
    assert entry["lost"] == 35 and entry["metrics"][SPEED]["mean"] < 1.3
    assert all(np.isnan(gap["p"]) for gap in entry["difference"].values())
    verdicts = agent_scores(runs, ["gspi_oc3"], agents=["gamer"])["verdict"]
    assert set(verdicts) == {"failed"}


def test_power_beyond_rated_is_no_energy():
    def overproduces(wind, seed):
        return good(wind, seed) | {"GenPwr_mean_[kW]": 1.05, ENERGY: 0.985}

    runs = table(honest=good, gamer=overproduces)
    assert ranks(runs)["honest"] < ranks(runs)["gamer"]
    verdicts = agent_scores(runs, ["gspi_oc3"]).set_index(["agent", "figure"])["verdict"]
    assert verdicts["gamer", "energy"].startswith("missed")
    assert not verdicts["honest", "energy"].startswith("missed")


@pytest.mark.parametrize("spent", [{SHAFT: 1.4}, {TORQUE: 6.0}, {TRAVEL: 1.3}, {PEAK: 1.2}])
def test_rotor_speed_that_is_bought_with_torque_or_pitch_or_power_is_beyond_a_limit(spent):
    def buys(wind, seed):
        return {SPEED: 0.5, LEAN: 0.6} | spent

    runs = table(honest=good, gamer=buys)
    assert ranks(runs)["honest"] < ranks(runs)["gamer"]
    beyond = {name: entry["beyond"] for name, entry in entries(runs).items()}
    (text,) = beyond["gamer"]
    assert text.startswith(short_name(next(iter(spent)))) and not beyond["honest"]


CALM = dict.fromkeys((SPEED, LEAN, TRAVEL, TORQUE, *LOADS), 0.5)


@pytest.mark.parametrize(
    ("gamer", "figure", "least", "most"),
    [
        # only calm winds and seeds; an interquartile mean of these would be 0.8
        (lambda wind, seed: {SPEED: 3.0 if wind == 24.0 or seed == 6 else 0.8, LEAN: 0.7},
         "rotor-speed std", 1.3, 3.0),
        (lambda wind, seed: good(wind, seed) | {SPEED: np.nan}, "rotor-speed std", PENALTY, PENALTY),
        (lambda wind, seed: CALM | {ENERGY: 1e-3}, "energy", 0.0, 0.01),  # parked
    ],
)  # fmt: skip
def test_what_is_left_out_or_given_up_counts(gamer, figure, least, most):
    runs = table(honest=good, gamer=gamer)
    assert ranks(runs)["honest"] < ranks(runs)["gamer"]
    assert least * (1.0 - 1e-12) <= ratios(runs, "gamer")[figure] <= most * (1.0 + 1e-12)


def gives_up_once(wind, seed):
    return good(wind, seed) | ({"status": "tripped"} if wind == 12.0 and seed == 1 else {})


def scored(runs, name):
    """Scores of a controller, with intervals, as bytes: equal where they are equal to the last bit."""
    entry = entries(runs)[name]
    scores = [entry["score"], entry["score"]["lifetime"], entry["score"]["winds"]]
    numbers = np.array([[score[key] for key in ("mean", "low", "high")] for score in scores])
    return numbers.tobytes(), entry["beyond"], entry["undecided"], entry["held"]


@pytest.mark.parametrize("name", ["honest", "gamer"])
def test_a_score_is_the_same_to_the_bit_whoever_else_is_in_the_folder(name):
    """Also beside one that is five times as bad, one that fails, and one with other cases and more seeds."""
    sandbag = dict.fromkeys((SPEED, LEAN, TRAVEL, TORQUE, *LOADS), 5.0)
    others = {
        "sandbag": lambda wind, seed: sandbag,
        "wreck": lambda wind, seed: {"status": "failed"},
        "quits": lambda wind, seed: sandbag | {"status": "tripped"},
    }
    runs = table(honest=good, gamer=gives_up_once, **others)
    alone = runs[runs["controller"].isin([name, REFERENCE])]
    expected = scored(alone, name)
    assert scored(runs, name) == expected
    more = runs[runs["controller"].isin(["sandbag", "gspi_oc3", REFERENCE])]
    more = pd.concat([more.assign(seed=more["seed"] + 8), more.assign(case=more["case"] + "_b")])
    assert scored(pd.concat([more, runs], ignore_index=True), name) == expected
    tripped = runs.copy()  # the published baseline as an entry, which is no reference
    tripped.loc[tripped["controller"] == "gspi_oc3", "status"] = "tripped"
    assert scored(tripped, name) == expected


def test_a_lost_run_counts_a_fixed_multiple_of_the_reference():
    runs = table(
        fails=lambda wind, seed: {"status": "failed"}, trips=lambda wind, seed: {"status": "tripped"}
    )
    found = scores(runs)
    assert found["fails"] == pytest.approx(PENALTY**2, rel=1e-12)  # over a tenth of the energy
    assert found["trips"] == found["fails"] and found["gspi_oc3"] == 1.0


# the worst ratios to the reference of runs that ended well, of laws with limit cycles and commands that swing
JUST_ALIVE = {
    SPEED: 1.5, LEAN: 6.7, TRAVEL: 43.0, SHAFT: 9.7, TOWER: 3.9, ROOT: 1.1, ENERGY: 0.85,
}  # fmt: skip


@pytest.mark.parametrize("given_up", [{12.0}, {24.0}, {12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0}])
def test_giving_up_pays_for_nobody_however_bad_its_run_would_be(given_up):
    for seeds in (1, 8):
        runs = table(
            endures=lambda wind, seed: dict(JUST_ALIVE),
            quits=lambda wind, seed: (
                {"status": "failed"}
                if wind in given_up and seed <= seeds  # noqa: B023
                else dict(JUST_ALIVE)
            ),
        )
        assert scores(runs)["quits"] > scores(runs)["endures"] > 10.0


def test_a_reference_without_a_figure_counts_for_nobody_and_without_one_there_is_no_score():
    runs = table(honest=good, gamer=gives_up_once)
    at = (runs["controller"] == REFERENCE) & (runs["case"] == "elastic_12") & (runs["seed"] == 1)
    runs.loc[at, ["status", *METRICS]] = ["failed", *[np.nan] * len(METRICS)]
    found = scores(runs)
    assert found["gamer"] == found["honest"] and ranks(runs)["gamer"] == 3  # its run is lost all the same
    board = leaderboard(runs[runs["controller"] != REFERENCE], score=HEADLINE.score, limits=HEADLINE.limits)
    for entry in board["controllers"]:
        assert entry["rank"] is None and entry["score"]["mean"] is None
        assert "reference" in entry["score"]["why"]
    assert board["unchecked"] == HEADLINE.limits.relative_metrics != []


def test_a_lifetime_without_one_of_its_winds_has_no_figures_but_a_score():
    runs = table(
        honest=good, gamer=lambda wind, seed: {"status": "failed"} if wind == 18.0 else good(wind, seed)
    )
    board = leaderboard(runs, baseline="gspi_oc3", score=HEADLINE.score)
    entry = next(each for each in board["controllers"] if each["controller"] == "gamer")
    for figure in (entry["metrics"][SPEED], entry["difference"][SPEED]):
        assert np.isnan(figure["mean"])
    assert entry["cases"]["elastic_12"]["metrics"][SPEED]["mean"] > 0.0
    assert entry["score"]["mean"] > 1.0 and entry["score"]["why"] == "8 runs failed"


def test_what_counts_in_place_of_a_lost_run_is_worse_whatever_the_sign():
    runs = table(gamer=lambda wind, seed: {"status": "failed"})
    for sign in (1.0, -1.0):
        for name in (SPEED, ENERGY):
            runs.loc[runs["controller"] == "gspi_oc3", name] = sign * 2.0
        counted = penalised(runs, "gspi_oc3").groupby("controller")[[SPEED, ENERGY]].mean()
        assert counted.loc["gamer", SPEED] > counted.loc["gspi_oc3", SPEED] == sign * 2.0
        assert counted.loc["gamer", ENERGY] < counted.loc["gspi_oc3", ENERGY] == sign * 2.0
    names = (SPEED, SHAFT, ENERGY, "energy_[kWh]", "GenPwr_max_[kW]")
    assert [better(name) for name in names] == [-1, -1, 1, 1, -1]
    assert better("Wind1VelX_std_[m/s]") == better("PtfmPitch_mean_[deg]") == better("GenTq_min_[kN-m]") == 0
    assert np.isnan(
        penalised(runs, "gspi_oc3").set_index("controller").loc["gamer", "PtfmPitch_mean_[deg]"]
    ).all()


def test_a_turbine_that_stands_still_has_lost_power_unless_a_fault_took_it():
    calm = dict.fromkeys((SPEED, LEAN, TRAVEL, TORQUE, SHAFT), 0.02)
    runs = table(
        honest=good,
        stands=lambda wind, seed: calm | {ENERGY: 0.0, "energy_[kWh]": 0.49},
        derated=lambda wind, seed: calm | {"energy_[kWh]": 0.51},
    )
    statuses = with_lost_power(runs).groupby("controller")["status"].unique().str[0]
    assert statuses["stands"] == "lost power" and set(statuses.drop("stands")) == {"ok"}
    assert ranks(with_lost_power(runs))["stands"] == 4
    spared = with_lost_power(runs, faulty=["elastic_12"]).groupby("case")["status"].nunique()
    assert spared["elastic_12"] == 1 and spared["elastic_14"] == 2
    without = runs[runs["controller"] != REFERENCE]
    lost = with_lost_power(without)
    assert (lost["status"] == "lost power").sum() == 56 and "of gspi_oc3" in lost["reason"].max()
    assert with_lost_power(without[without["controller"] != "gspi_oc3"])["status"].eq("ok").all()


# ---------------------------------------------------------- laws of an audit, by the figures that they had

AUDITED = {  # name: (figures over the reference's, a function of the wind and seed; limits that bar it)
    "under by 12 %": (
        lambda wind, seed: {ENERGY: 0.925, POWER: 0.88, HELD_TORQUE: 0.88}, [ENERGY, HELD_TORQUE],
    ),
    "under by 25 %": (
        lambda wind, seed: {ENERGY: 0.76, POWER: 0.75, HELD_TORQUE: 0.75}, [ENERGY, HELD_TORQUE],
    ),
    "sag": (lambda wind, seed: {HELD_SPEED: 0.96, HELD_TORQUE: 1.04}, [HELD_SPEED, HELD_TORQUE]),
    "overrate": (lambda wind, seed: {POWER: 1.05, HELD_TORQUE: 1.05}, [POWER, HELD_TORQUE]),
    "rare wind derated": (lambda wind, seed: {ENERGY: 0.6} if wind >= 20.0 else {}, [ENERGY]),
    "torque-heavy": (lambda wind, seed: {SPEED: 0.42, SHAFT: 1.44, TORQUE: 6.7}, [SHAFT, TORQUE]),
    "deep torque": (lambda wind, seed: {SHAFT: 1.28, TORQUE: 5.3}, [SHAFT, TORQUE]),
    "shifted travel": (lambda wind, seed: {TRAVEL: 3.4 if wind >= 22.0 else 0.6}, [TRAVEL]),
    "mpc": (
        lambda wind, seed: {
            SHAFT: {12: 1.11, 14: 0.98, 16: 2.82, 18: 2.10, 20: 1.49, 22: 1.16, 24: 1.07}[int(wind)],
            TRAVEL: {12: 0.73, 14: 0.83, 16: 1.05, 18: 1.20, 20: 1.44, 22: 1.68, 24: 1.93}[int(wind)],
        },
        [SHAFT, TRAVEL],
    ),
}  # fmt: skip


OTHERS = {  # as AUDITED
    # at 24 m/s alone, which is 2 % of the lifetime
    "sag where nobody looks": (
        lambda wind, seed: {HELD_SPEED: 0.99, HELD_TORQUE: 1.01} if wind == 24.0 else {},
        [HELD_SPEED, HELD_TORQUE],
    ),
    "faster at less torque": (
        lambda wind, seed: {HELD_SPEED: 1.04, HELD_TORQUE: 0.96, SHAFT: 0.8}, [HELD_SPEED, HELD_TORQUE],
    ),
    # the trip waits a moment: so long the rotor may be faster, and the generator at more power
    "past the trip for a moment": (lambda wind, seed: {PAST: 0.3 if seed == 4 else 0.0}, [PAST]),
    "power in pulses": (lambda wind, seed: {PEAK: 1.2}, [PEAK]),
    # encoders do not see blades that dither by less than their noise; metrics are of the blades
    "travel below the noise of encoders": (lambda wind, seed: {TRAVEL: 1.6}, [TRAVEL]),
    # of eight, so that no interval excludes that the limit is held
    "one bad seed": (lambda wind, seed: {SHAFT: 2.6 if seed == 3 else 0.7}, [SHAFT]),
    # learns the wind in the spin-up that is not scored, and takes in each what is cheap there
    "learns the wind": (
        lambda wind, seed: {ENERGY: 0.97, TOWER: 0.6} if wind >= 16.0 else {TOWER: 1.4, LEAN: 0.4},
        [ENERGY, TOWER],
    ),
    "learns during the run": (lambda wind, seed: {SPEED: 0.5, ROOT: 1.3 + 0.02 * seed}, [ROOT]),
    # capped energy is lost in the other half
    "torque that swings about rated": (lambda wind, seed: {ENERGY: 0.975, "GenPwr_std_[kW]": 1.5}, [ENERGY]),
}  # fmt: skip


@pytest.mark.parametrize("name", [*AUDITED, *OTHERS])
def test_what_an_engineer_would_not_sign_is_beyond_the_limits_that_say_why(name):
    figures, barred = (AUDITED | OTHERS)[name]
    found = entries(table(honest=good, gamer=lambda wind, seed: good(wind, seed) | figures(wind, seed)))
    gamer, honest = found["gamer"], found["honest"]
    named = {re.split(r" over |,| = | \(", text)[0] for text in gamer["beyond"]}
    assert named == set(map(short_name, barred))
    assert honest["held"] and not gamer["held"] and not gamer["score"]["valid"]
    assert honest["rank"] < found["gspi_oc3"]["rank"] < gamer["rank"]


def test_a_limit_names_the_winds_in_which_it_is_exceeded_and_no_other():
    figures, _ = AUDITED["mpc"]
    shaft, travel = entries(table(gamer=figures))["gamer"]["beyond"]
    cases = [case.name for case in HEADLINE.cases]
    assert [case for case in cases if case in shaft] == ["elastic_16", "elastic_18", "elastic_20"]
    assert [case for case in cases if case in travel] == ["elastic_20", "elastic_22", "elastic_24"]


@pytest.mark.parametrize(
    "traded",
    [
        # within every limit: a quarter worse where it is rare, much better where it is frequent; and reversed
        lambda wind: 0.5 if wind < 16.0 else 1.24,
        lambda wind: 1.24 if wind < 16.0 else 0.5,
        lambda wind: 1.24,  # as bad as the limits allow, with a rotor that is calm
    ],
)
def test_whoever_trades_winds_within_the_limits_has_the_worse_of_two_scores(traded):
    def trades(wind, seed):
        return dict.fromkeys((SPEED, LEAN, TRAVEL, *LOADS), traded(wind))

    runs = table(honest=lambda wind, seed: dict.fromkeys((SPEED, LEAN, TRAVEL, *LOADS), 0.85), gamer=trades)
    found = entries(runs)
    assert found["gamer"]["held"] and found["honest"]["rank"] == 1 < found["gamer"]["rank"]
    score = found["gamer"]["score"]
    assert score["mean"] == max(score["lifetime"]["mean"], score["winds"]["mean"])
    assert found["honest"]["score"]["mean"] == pytest.approx(0.85)


def test_few_seeds_hold_no_limit_and_exceed_it_all_the_same():
    figures, _ = AUDITED["sag"]
    runs = table(honest=good, gamer=lambda wind, seed: good(wind, seed) | figures(wind, seed))
    found = entries(runs[runs["seed"] <= 3])
    assert found["honest"]["held"] is False and not found["honest"]["beyond"]
    assert found["gamer"]["beyond"] and found["honest"]["rank"] < found["gamer"]["rank"]


# ------------------------------------------------------------------ real runs


class Quitter:
    """gspi_oc3 that raises once the rotor is off by so many rpm."""

    def __init__(self, turbine, off=0.3):
        self.inner = make("gspi_oc3", turbine, 0.1)
        self.information = (*self.inner.information, "rotor_speed")
        self.off, self.rated = off * RPM, turbine.rated_rotor_speed

    def reset(self, measurement):
        self.inner.reset(measurement)

    def act(self, measurement):
        if abs(measurement.rotor_speed - self.rated) > self.off:
            raise RuntimeError("enough of this")
        return self.inner.act(measurement)


class LowerSetPoint:
    """gspi_oc3 that is told of a rotor 3 % faster than it is, and so holds one 3 % slower."""

    def __init__(self, turbine):
        self.inner = make("gspi_oc3", turbine, 0.1)
        self.information = self.inner.information

    def _told(self, measurement):
        return measurement._replace(generator_speed=1.03 * measurement.generator_speed)

    def reset(self, measurement):
        self.inner.reset(self._told(measurement))

    def act(self, measurement):
        return self.inner.act(self._told(measurement))


def on_rigid_turbine(suite):
    """The suite on a turbine with rigid parts and without the blade roots, in seconds instead of minutes."""
    terms = tuple(term for term in suite.score.term if term.metric != ROOT)
    loads = {name: bound for name, bound in suite.limits.case_relative.items() if name != ROOT}
    return replace(
        suite,
        cases=tuple(replace(case, options={"fidelity": "standard"}) for case in suite.cases),
        score=suite.score.model_copy(update={"term": terms}),
        limits=suite.limits.model_copy(update={"case_relative": loads}),
    )


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((on_rigid_turbine, (18.0, 22.0), (1001,)), marks=pytest.mark.slow),
        pytest.param((lambda suite: suite, (14.0, 18.0, 22.0), (1001, 1002)), marks=pytest.mark.nightly),
    ],
    ids=["rigid", "elastic"],
)
def played(request):
    """Entries of the laws of GAMERS and their twin in calm, common and rare winds of the headline."""
    plant, winds, seeds = request.param
    whole = plant(HEADLINE)
    cases = tuple(case for case in whole.cases if case.wind["speed"] in winds)
    laws = {TWIN: TWIN} | {law.__name__: law for law in GAMERS}
    runs = evaluate(laws, replace(whole, cases=cases), seeds=seeds)
    board = leaderboard(runs, score=whole.score, limits=whole.limits)
    return {entry["controller"]: entry for entry in board["controllers"]}


@pytest.mark.parametrize("law", GAMERS)
def test_a_law_that_games_the_score_is_beyond_a_limit_that_its_twin_is_not(played, law):
    gamer, twin = played[law.__name__], played[TWIN]
    assert not twin["beyond"] and twin["lost"] == 0 and twin["score"]["mean"] < 1.0
    for metric in GAMERS[law]:
        assert any(text.startswith(short_name(metric)) for text in gamer["beyond"]), gamer["beyond"]
    assert twin["rank"] == 1 < gamer["rank"]


def test_who_recognises_listed_seeds_is_better_than_its_twin_on_these_and_equal_on_others():
    suite = on_rigid_turbine(HEADLINE)
    case = next(case for case in suite.cases if case.wind["speed"] == 18.0)
    winds = listed_winds(case, suite.seeds[:3])
    laws = {"gspi_oc3": "gspi_oc3", "recogniser": lambda turbine, dt: Recogniser(turbine, dt, winds)}

    def score(seeds):
        runs = evaluate(laws, [case], seeds=seeds, duration=300.0, skip=80.0, reference="gspi_oc3")
        board = leaderboard(runs, score=suite.score)
        return {entry["controller"]: entry["score"]["mean"] for entry in board["controllers"]}

    assert score(suite.seeds[:2])["recogniser"] < 0.8
    drawn = drawn_seeds("5" * 40, suite.name, suite.version, 2)
    assert score(drawn)["recogniser"] == score(drawn)["gspi_oc3"] == 1.0


def test_a_controller_that_raises_when_the_rotor_is_off_ends_below_its_honest_twin():
    case = Case("ntm_18", {"kind": "ntm", "speed": 18.0, "class": "B"}, None)
    turbine = read_turbine("nrel5mw")
    options = {"duration": 60.0, "skip": 10.0, "seeds": (1001, 1002), "reference": "gspi_oc3"}
    runs = evaluate({"gspi_oc3": "gspi_oc3", "quitter": Quitter(turbine)}, [case], **options)
    lost = runs[runs["controller"] == "quitter"]
    assert (lost["status"] == "failed").any() and "enough of this" in " ".join(lost["reason"])
    board = leaderboard(runs, score=on_rigid_turbine(HEADLINE).score)
    assert [entry["controller"] for entry in board["controllers"]] == ["gspi_oc3", "quitter"]
    quitter = board["controllers"][1]
    assert quitter["score"]["mean"] >= 1.0 and not quitter["score"]["valid"]


def test_a_lower_set_point_loses_energy_and_is_beyond_the_limit_of_settling():
    settling = read_suite("settling")
    case = next(case for case in settling.cases if case.name == "settling_18")
    turbine = read_turbine("nrel5mw")
    runs = evaluate(
        {"gspi_oc3": "gspi_oc3", "low": LowerSetPoint(turbine)}, [case], duration=600.0, skip=0.0
    ).set_index("controller")
    assert runs.loc["gspi_oc3", "RotSpeed_offset_[%]"] < 0.5 < 2.5 < runs.loc["low", "RotSpeed_offset_[%]"]
    board = leaderboard(runs.reset_index(), limits=settling.limits)
    assert [entry["controller"] for entry in board["controllers"]] == ["gspi_oc3", "low"]
    assert "settled rotor-speed offset" in board["controllers"][1]["beyond"][0]


def test_limits_of_the_headline_are_of_metrics_that_there_are_and_hold_for_the_baseline():
    assert isinstance(HEADLINE.limits, Limits) and HEADLINE.limits.baseline == HEADLINE.score.baseline
    entry = leaderboard(table(), limits=HEADLINE.limits)["controllers"][0]
    assert not entry["beyond"] and not entry["undecided"] and entry["held"]
