"""The matrix of a load table: numbers counted by hand, hours of a year, factors, events, and bad tables."""

from collections import Counter
from dataclasses import replace
from math import pi

import pytest

from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.wind import checked_keys, read_wind
from fowt_env.errors import InputError
from fowt_env.training.loads.matrix import TABLE, expanded, read_cases
from fowt_env.training.loads.site import YEAR, climate_of, read_site
from fowt_env.weather.wind_field import is_field

# Of the 5 MW turbine (3, 11.4, 25 m/s: 11 bins of 2 m/s) at Norway 5 (3 seas per wind, 2 directions in
# extreme seas): winds x variants, faults, yaw errors, directions x seas x 6 seeds.
COUNTED = {
    "1.1": 11 * 3 * 6, "1.2": 11 * 3 * 6, "1.3": 11 * 6, "1.4": 3 * 2 * 6, "1.5": 11 * 4 * 6,
    "1.6": 11 * 2 * 6, "2.1": 3 * 4 * 6, "2.2": 3 * 2 * 6, "2.3": 3 * 6, "2.4": 3 * 2 * 6, "4.1": 3 * 6,
    "4.2": 3 * 6, "5.1": 3 * 6, "3.1": 3 * 6, "3.2": 3 * 4 * 6, "3.3": 3 * 2 * 2 * 6, "9.1": 3 * 3 * 6,
    "9.2": 3 * 3 * 6, "10.1": 3 * 6, "10.2": 3 * 6,
    "6.1": 3 * 2 * 6, "6.2": 25 * 6, "6.3": 5 * 6, "6.4": 3 * 3 * 6, "7.1": 3 * 6, "7.2": 11 * 2 * 6,
}  # fmt: skip
EVENTS = (
    "3.1",
    "3.2",
    "3.3",
    "1.4",
    "1.5",
    "2.1",
    "2.2",
    "2.3",
    "2.4",
    "4.1",
    "4.2",
    "5.1",
)  # of ten minutes
PARKED = ("6.1", "6.2", "6.3", "6.4", "7.1", "7.2", "10.1", "10.2")


@pytest.fixture(scope="module")
def matrix():
    return expanded("oc3_hywind", "norway_5", ("pi", "pi_land"))


def test_the_numbers_of_runs_are_those_counted_by_hand(matrix):
    expected = {dlc: count * (1 if dlc in PARKED else 2) for dlc, count in COUNTED.items()}
    assert Counter(case.dlc for case in matrix.cases) == expected
    shared = 2 * COUNTED["1.1"]  # 1.1 extrapolates the runs of 1.2
    assert len(matrix.runs) == sum(expected.values()) - shared
    hours = sum(
        count * ((600.0 + 600.0 if dlc in EVENTS else 600.0 + 3600.0) / 3600.0)
        for dlc, count in expected.items()
        if dlc != "1.1"
    )
    assert matrix.hours == pytest.approx(hours, rel=1e-12)
    assert {row[0]: row[3] for row in matrix.counts()} == expected


def test_cases_with_one_key_are_one_run(matrix):
    for case in matrix.cases:
        run = matrix.runs[case.key]
        assert (case.case, case.duration, case.skip) == (run.case, run.duration, run.skip)
    both = [dlc for case in matrix.cases for dlc in [case.dlc] if case.name.startswith("dlc1.2_")]
    assert Counter(both) == {"1.1": 396, "1.2": 396}


def test_every_load_case_of_the_table_is_run_or_named_with_a_reason(matrix):
    run, left = {case.dlc for case in matrix.cases}, {number for number, _, _ in matrix.left_out}
    numbers = [entry.dlc for entry in read_cases().case]
    assert set(numbers) == run | left
    wanted = [
        f"{group}.{n}"
        for group, last in ((1, 6), (2, 4), (3, 3), (4, 2), (6, 4), (7, 2))
        for n in range(1, last + 1)
    ]
    assert {*wanted, "5.1", "9.1", "9.2", "10.1", "10.2"} <= set(numbers)
    assert all(reason for _, _, reason in matrix.left_out)


def test_the_controllers_run_the_same_conditions_with_the_same_seeds(matrix):
    of = {
        label: [replace(case, controller="") for case in matrix.cases if case.controller == label]
        for label in ("pi", "pi_land")
    }
    assert of["pi"] == of["pi_land"] and len(of["pi"]) == sum(
        n for d, n in COUNTED.items() if d not in PARKED
    )
    assert {case.controller for case in matrix.cases if case.dlc in PARKED} == {"parked"}


def test_production_idling_and_repair_add_up_to_a_year(matrix):
    climate = climate_of(read_site("norway_5"), read_turbine("nrel5mw"))
    inside = float(climate.below(25.0) - climate.below(3.0))
    hours = Counter()
    for case in matrix.cases:
        if case.controller in ("pi", "parked"):
            hours[case.dlc] += case.hours_per_year
    assert hours["1.2"] == pytest.approx(0.95 * YEAR * inside, rel=1e-12)
    assert hours["7.2"] == pytest.approx(0.05 * YEAR * inside, rel=1e-12)
    assert hours["6.4"] == pytest.approx(YEAR * (1.0 - inside), rel=1e-12)
    assert hours["1.1"] == hours["1.2"]  # weights of the extrapolation
    # events of ten minutes: 20 faults and 1000 stops a year
    assert hours["2.4"] == pytest.approx(20.0 / 6.0, rel=1e-12)
    assert hours["4.1"] == pytest.approx(1000.0 / 6.0, rel=1e-12)
    assert hours["3.1"] == pytest.approx(1000.0 / 6.0, rel=1e-12)
    assert set(hours) - {dlc for dlc in hours if hours[dlc]} == set(COUNTED) - {
        "3.1",
        "1.1",
        "1.2",
        "2.4",
        "4.1",
        "6.4",
        "7.2",
    }


def test_the_hours_of_a_bin_are_its_probability(matrix):
    climate = climate_of(read_site("norway_5"), read_turbine("nrel5mw"))
    at_12 = [
        case
        for case in matrix.cases
        if case.dlc == "1.2" and case.wind_speed == 12.0 and case.controller == "pi"
    ]
    assert {case.wind_bin for case in at_12} == {(11.0, 13.0)} and len(at_12) == 18
    expected = 0.95 * YEAR * float(climate.below(13.0) - climate.below(11.0))
    assert sum(case.hours_per_year for case in at_12) == pytest.approx(expected, rel=1e-12)


def test_factors_and_classes_are_those_of_weis(matrix):
    of = {case.dlc: (case.factor, case.safety) for case in matrix.cases}
    normal, abnormal, fatigue = (1.35, "normal"), (1.1, "abnormal"), (1.0, "fatigue")
    assert of.pop("1.1") == (1.25, "normal")
    for dlc, found in of.items():
        expected = abnormal if dlc in ("2.2", "2.3", "6.2", "7.1", "9.1", "9.2", "10.1", "10.2") else normal
        assert found == (fatigue if dlc in ("1.2", "2.4", "3.1", "4.1", "6.4", "7.2") else expected), dlc
    assert all((case.analysis == "fatigue") == (case.safety == "fatigue") for case in matrix.cases)


def test_each_seed_has_its_event_at_another_azimuth(matrix):
    stops = [
        case
        for case in matrix.cases
        if case.dlc == "5.1" and case.controller == "pi" and case.wind_speed == 25.0
    ]
    times = [case.case.fault.time for case in sorted(stops, key=lambda case: case.seed)]
    third = 2.0 * pi / 3.0 / read_turbine("nrel5mw").rated_rotor_speed
    assert times[0] == 660.0
    assert times == pytest.approx([660.0 + third * i / 6 for i in range(6)], abs=0.05 + 1e-9)
    gusts = [case for case in matrix.cases if case.dlc == "2.3" and case.controller == "pi"]
    assert {round(case.case.fault.time - case.case.wind["start"], 6) for case in gusts} == {4.0}


def test_each_line_is_lost_in_turn_and_compartments_are_flooded_from_the_start():
    water = ({"mass": 1e5, "point": (0.0, 5.0, -10.0)}, {"mass": 2e5, "point": (0.0, -5.0, -10.0)})
    both = expanded("oc3_hywind", "norway_5", ("pi",), dlc="9.1,9.2,9.3", seeds=1, compartments=water)
    events = {case.dlc: [] for case in both.cases}
    for case in both.cases:
        if case.wind_speed == 25.0:
            events[case.dlc].append(case.case.fault)
    assert [(fault.line, fault.time) for fault in events["9.1"]] == [(1, 660.0), (2, 660.0), (3, 660.0)]
    assert [(fault.line, fault.time) for fault in events["9.2"]] == [(1, 0.0), (2, 0.0), (3, 0.0)]
    assert [(fault.mass, fault.time) for fault in events["9.3"]] == [(1e5, 0.0), (2e5, 0.0)]
    assert not both.left_out
    without = expanded("oc3_hywind", "norway_5", ("pi",), dlc="9.3", seeds=1)
    assert [number for number, _, _ in without.left_out] == ["9.3"] and not without.cases


def test_a_start_is_the_supervisors_unless_the_site_wants_the_controllers_own():
    site = read_site("norway_5")
    own = site.model_copy(update={"design": site.design.model_copy(update={"start": "controller"})})
    for mine, by, length in ((site, "supervisor", 600.0), (own, "controller", 2400.0)):
        cases = expanded("oc3_hywind", mine, ("rosco",), dlc="3.1,3.2", seeds=1).cases
        assert {case.case.fault.by for case in cases} == {by}
        assert {case.duration - case.skip for case in cases} == {length}
        gusts = {case.case.wind["start"] - case.case.fault.time for case in cases if case.dlc == "3.2"}
        assert gusts == {40.0, 70.0, 100.0, 130.0}


def test_waves_come_at_the_misalignment_from_the_wind(matrix):
    for case in matrix.cases:
        direction = case.case.wind.get("direction", 0.0)
        assert direction == case.wind_direction == case.yaw_error
        assert case.case.sea["heading"] == case.wave_direction
        assert (case.case.sea["Hs"], case.case.sea["Tp"]) == (case.Hs, case.Tp)
    assert {case.misalignment for case in matrix.cases if case.dlc == "6.1"} == {0.0, 30.0}
    assert {case.misalignment for case in matrix.cases if case.dlc == "6.3"} == {0.0}


@pytest.mark.parametrize("kind", ["full-field", "rotor-averaged"])
def test_all_winds_and_seas_can_be_built_and_turbulence_is_of_the_kind_asked_for(kind):
    cases = expanded("oc3_hywind", "norway_5", wind=kind, seeds=1).cases
    for case in cases:
        spec = case.case.wind
        (checked_keys if is_field(spec) else read_wind)(spec)
        sea_state_of(case.case.sea)
        turbulent = spec["kind"] in ("mann", "ntm", "etm", "ewm")
        assert is_field(spec) == (turbulent and kind == "full-field")
    models = {case.dlc: case.case.wind.get("model", case.case.wind["kind"]) for case in cases}
    wanted = {
        "1.2": "ntm",
        "1.3": "etm",
        "1.4": "ecd",
        "1.5": "ews",
        "2.3": "eog",
        "4.1": "steady",
        "6.1": "ewm",
    }
    assert {dlc: models[dlc] for dlc in wanted} == wanted


def test_the_extreme_wind_of_an_hour_is_that_of_the_site_over_ten_minutes_less_5_percent(matrix):
    climate = climate_of(read_site("norway_5"), read_turbine("nrel5mw"))
    hour = {case.wind_speed for case in matrix.cases if case.dlc == "6.1"}
    short = {case.wind_speed for case in expanded("oc3_hywind", "norway_5", dlc="6.1", hours=0.2).cases}
    wind, Hs, Tp, _, _ = climate.extreme(50)
    assert sorted(hour | short) == pytest.approx([0.95 * wind, wind], abs=1e-3) and not hour & short
    assert {(case.Hs, case.Tp) for case in matrix.cases if case.dlc == "6.1"} == {
        (round(Hs, 3), round(Tp, 3))
    }


def test_a_site_sets_yaw_errors_directions_classes_and_current():
    text = {
        "direction": (
            {"misalignment": -20.0, "probability": 0.25},
            {"misalignment": 20.0, "probability": 0.75},
        ),
        "current": {"speed": 0.4, "source": ""},
    }
    site = read_site("norway_5")
    design = site.design.model_dump() | {
        "yaw_errors": (-8.0, 8.0),
        "hs_classes": 1,
        "tp_classes": 2,
        "bin_width": 1.0,
    }
    mine = type(site).model_validate(site.model_dump(exclude_none=True) | text | {"design": design})
    cases = expanded("oc3_hywind", mine, dlc="1.2", seeds=2).cases
    assert len(cases) == 22 * 2 * 2 * 2 * 2  # winds, yaw errors, directions, periods, seeds
    shares = Counter()
    for case in cases:
        shares[case.misalignment] += case.hours_per_year
        assert case.case.options["current"] == {
            "speed": 0.4, "heading": case.wave_direction, "exponent": pytest.approx(1.0 / 7.0),
        }  # fmt: skip
    assert shares[20.0] == pytest.approx(3.0 * shares[-20.0])


def test_a_site_of_another_depth_is_remarked():
    assert expanded("oc3_hywind", "norway_5", dlc="5.1").remarks == (
        "the site is 202 m deep and the platform is moored in 320 m, in which the waves are computed",
    )
    assert expanded("iea15_volturnus_s", "gulf_of_maine", dlc="5.1").remarks == ()


@pytest.mark.parametrize(("change", "message"), [
    ({"dlc": "1.7"}, "unknown design load case '1.7'"),
    ({"dlc": ""}, "dlc: at least one"),
    ({"seeds": 0}, r"seeds = 0: must be a whole number in \[1, 1000\]"),
    ({"seeds": True}, "seeds = True"),
    ({"hours": 0.0}, r"hours = 0.0: must be a number in \[0.05, 24\]"),
    ({"wind": "uniform"}, "unknown wind 'uniform'"),
    ({"fidelity": "best"}, "unknown fidelity 'best'"),
    ({"sensors": "perfect"}, "perfect"),
])  # fmt: skip
def test_bad_settings_are_refused_by_name(change, message):
    with pytest.raises(InputError, match=message):
        expanded("oc3_hywind", "norway_5", **change)


@pytest.mark.parametrize(("old", "new", "message"), [
    ('wind = "etm"', 'wind = "etn"', "case.3.wind = 'etn'"),
    ('runs_of = "1.2"', 'runs_of = "1.9"', "case 1.1: runs_of = '1.9'"),
    ('factor = "extrapolated"', 'factor = "half"', "case 1.1: unknown factor 'half'"),
    ('dlc = "1.3"', 'dlc = "1.2"', "case '1.2': defined twice"),
    ('{kind = "emergency_stop",', '{kind = "emergency_brake",', "emergency_brake"),
    ('{kind = "emergency_stop", after = 60.0}', '{kind = "emergency_stop"}', "faults.1.after is missing"),
    ("at = [60.0]", "", "at is missing: the start of the ecd"),
    ('left_out = "No model of ice."', "", "wind is missing: D.1 to D.8 needs it, or left_out"),
    ("value = 1.35", "value = 0.0", "factor.normal.value = 0.0: must be a number > 0"),
])  # fmt: skip
def test_a_bad_table_of_load_cases_is_refused_by_entry(tmp_path, old, new, message):
    text = TABLE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "cases.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_cases(path)
