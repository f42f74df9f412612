"""Suite files: what they expand to, and what is said about wrong ones."""

import json

import numpy as np
import pytest

from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import (
    Case,
    Site,
    all_cases,
    described,
    lifetime_weights,
    named_cases,
    read_suite,
    suite_names,
)

SUITES = ("above_rated", "above_rated_fullfield", "atlas", "dlc", "full_range", "gusts", "oc3", "paper")
HEAD = """
version = 3
description = "d"
source = "s"
wind = "rotor-averaged"
seeds = [1, 2]
duration = 100.0
skip = 20.0
"""


def written(tmp_path, text, head=HEAD):
    path = tmp_path / "mine.toml"
    path.write_text(head + text)
    return path


def test_the_built_in_suites_can_be_read_and_say_where_they_come_from():
    others = {"above_rated_elastic", "above_rated_inflow", "faults", "ipc", "sea_states", "settling"}
    others |= {"shifted", "steady"}
    assert set(SUITES) | others == set(suite_names())
    for name in suite_names():
        suite = read_suite(name)
        assert suite.name == name and suite.description and suite.source and suite.cases and suite.seeds
        json.dumps([described(case) for case in suite.cases], allow_nan=False)


def test_a_name_is_one_case_in_all_suites_with_the_seeds_and_times_of_whoever_runs_it_by_itself():
    known = {name: described(case) for name, case in all_cases().items()}
    shipped = [case for suite in suite_names() for case in read_suite(suite).cases]
    assert all(described(case) == known[case.name] for case in shipped)
    assert any(case.seeds for case in shipped) and any(case.duration for case in shipped)
    for case in all_cases().values():
        assert case.seeds is None and case.duration is None and case.skip is None


def test_the_headline_is_what_the_brief_of_the_benchmark_says():
    suite = read_suite("above_rated")
    assert [case.wind["speed"] for case in suite.cases] == [12, 14, 16, 18, 20, 22, 24]
    assert {(case.wind["kind"], case.wind["class"]) for case in suite.cases} == {("ntm", "B")}
    assert len(suite.seeds) == 6 and suite.duration - suite.skip == 600.0 and suite.skip > 0.0
    assert suite.wind == "rotor-averaged"
    other = read_suite("above_rated_fullfield")
    assert other.wind == "full-field"
    same = zip(suite.cases, other.cases, strict=True)
    assert all(a.wind["speed"] == b.wind["speed"] and a.sea == b.sea for a, b in same)


def test_a_few_lines_make_a_suite_of_ones_own(tmp_path):
    text = """
[[case]]
name = "windy_{speed}"
speed = [13, 17.5]
wind = {kind = "ntm", class = "A"}
sea = {table = "north_sea"}

[[case]]
name = "calm"
wind = 16.0
seeds = 1

[[case]]
name = "texts"
wind = "etm:18:C"
sea = "jonswap:4:9"

[[case]]
name = "file"
wind = "mine.csv"
"""
    (tmp_path / "mine.csv").write_text("time,speed\n0,12\n600,14\n")  # beside the suite, wherever it is run
    suite = read_suite(written(tmp_path, text))
    assert (suite.name, suite.version, suite.seeds) == ("mine", 3, (1, 2))
    assert [case.name for case in suite.cases] == ["windy_13", "windy_17_5", "calm", "texts", "file"]
    assert suite.cases[1].wind == {"kind": "ntm", "class": "A", "speed": 17.5}
    assert 3.1 < suite.cases[1].sea.Hs < 4.1
    assert suite.cases[2].wind == 16.0 and suite.cases[2].seeds == (1,)
    assert suite.cases[3].wind == {"kind": "etm", "speed": 18.0, "class": "C"}
    assert sea_state_of(suite.cases[3].sea).Tp == 9.0
    assert suite.cases[4].wind["speed"].tolist() == [12.0, 14.0]


WIND = "wind = 16.0"


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("", ["case is missing"]),
        (f'[[case]]\nname = "a"\n{WIND}\n[[case]]\nname = "a"\n{WIND}', ["'a': defined twice"]),
        (f'[[case]]\nnam = "a"\n{WIND}', ["nam: unknown key. Did you mean 'name'?", "name is missing"]),
        ('[[case]]\nname = "a"\nwind = {kind = "ntn", speed = 12}', ["case.1 (a)", "'ntm'"]),
        ('[[case]]\nname = "a"\nwind = {kind = "ntm"}', ["wind.speed is missing"]),
        ('[[case]]\nname = "a"\nspeed = 12\nwind = {kind = "ntm", speed = 11}', ["set twice"]),
        ('[[case]]\nname = "a"\nspeed = [12, 13]\nwind = {kind = "ntm"}', ["{speed}"]),
        (f'[[case]]\nname = "a"\n{WIND}\nsea = {{table = "north_see", speed = 12}}', ["north_sea"]),
        (f'[[case]]\nname = "a"\n{WIND}\nsea = {{table = "north_sea"}}', ["sea.speed is missing"]),
        (f'[[case]]\nname = "a"\n{WIND}\noptions = {{surfac = "swl"}}', ["'surface'"]),
        (f'[[case]]\nname = "a"\n{WIND}\nskip = 200.0', ["skip = 200", "below duration = 100"]),
        (f'[[case]]\nname = "a"\n{WIND}\nfault = {{kind = "grid_los", time = 50}}', ["'grid_loss'"]),
        (f'[[case]]\nname = "a"\n{WIND}\nfault = {{kind = "grid_loss", time = 500}}', ["fault.time = 500"]),
        ('[[case]]\nname = "a"\nwind = {kind = "mann", speed = 12}', ["does not match"]),
        ('[[case]]\nname = "a"\nparked = true\nfault = {kind = "stuck_pitch", time = 5}', ["parked:"]),
        (f'[[case]]\nname = "a"\n{WIND}\nplatform = "oc3_hywnd"', ["oc3_hywind"]),
        (f'[[case]]\nname = "a"\n{WIND}\nsensors = "standart"', ["standart", "standard"]),
        (f'[[case]]\nname = "a"\n{WIND}\ntrip = 0.9', ["trip", "> 1"]),
        (
            f'[[case]]\nname = "a"\n{WIND}\n[limits.run]\n"RotSpeed_st_[rpm]" = 1.0',
            ["limits", "RotSpeed_std"],
        ),
        (f'[[case]]\nname = "a"\n{WIND}\n[limits.relative]\n"RotSpeed_std_[rpm]" = -1', ["relative", "> 0"]),
        (
            f'[[case]]\nname = "a"\n{WIND}\n[site]\nA = 11.0\nk = 2.0\nsource = "s"',
            ["site: needs cases of two"],
        ),
        (
            f'[[case]]\nname = "a"\n{WIND}\n[score]\nbaseline = "pi"\n'
            '[[score.term]]\nmetric = "x"\nweight = 1',
            ["'x'"],
        ),
    ],
)
def test_a_wrong_suite_is_refused_with_its_case_and_key(tmp_path, text, messages):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        read_suite(path)
    assert "mine.toml" in str(error.value)
    for message in messages:
        assert message in str(error.value)


def test_shares_of_the_lifetime_are_the_probabilities_of_the_bins_that_the_winds_stand_for():
    site = Site(A=10.0, k=2.0, source="s")
    cases = [
        Case("a", 8.0),
        Case("b", {"kind": "ntm", "speed": 12.0}),
        Case("c", {"kind": "ntm", "speed": 12.0}),
    ]
    parked, calm = Case("p", 8.0, parked=True), Case("w", None)
    found = lifetime_weights([*cases, Case("d", 20.0), parked, calm], site)
    # bins 6-10, 10-16, 16-24 m/s of a Rayleigh distribution, by hand
    low, middle, high = (
        np.exp(-((a / 10) ** 2)) - np.exp(-((b / 10) ** 2)) for a, b in ((6, 10), (10, 16), (16, 24))
    )
    total = low + middle + high
    assert found["a"] == pytest.approx(low / total) and found["d"] == pytest.approx(high / total)
    assert found["b"] == found["c"] == pytest.approx(0.5 * middle / total)
    assert found["p"] == found["w"] == 0.0 and lifetime_weights(cases, None) == {}
    headline = read_suite("above_rated").weights
    assert sum(headline.values()) == pytest.approx(1.0) and headline["ntm_12"] > 10.0 * headline["ntm_24"]


def test_a_case_has_the_trip_and_sensors_of_its_suite_unless_it_has_its_own(tmp_path):
    text = """
[[case]]
name = "a"
wind = 16.0

[[case]]
name = "b"
wind = 16.0
trip = false
sensors = "exact"
"""
    a, b = read_suite(written(tmp_path, text, HEAD + 'trip = 1.2\nsensors = "standard"\n')).cases
    assert (a.trip, a.sensors, b.trip, b.sensors) == (1.2, "standard", None, "exact")
    plain = read_suite(written(tmp_path, text)).cases[0]
    assert (plain.trip, plain.sensors) == (1.3, "exact")
    assert {described(case)["sensors"] for case in (a, b)} == {"standard", "exact"}
    faults = [case for case in read_suite("dlc").cases if case.fault is not None]
    assert {case.trip for case in faults} == {None}


def test_an_unknown_case_has_the_five_nearest_and_the_command_that_lists_them():
    with pytest.raises(InputError, match="unknown case 'ntm_81'. Did you mean 'ntm_8'.* Nearest of") as error:
        named_cases("ntm_18,ntm_81")
    assert str(error.value).endswith("; all: fowt list cases, fowt list suites")


def test_a_suite_without_seeds_has_the_first_and_one_that_cannot_be_read_is_named(tmp_path):
    head = HEAD.replace("seeds = [1, 2]\n", "")
    assert read_suite(written(tmp_path, f'[[case]]\nname = "a"\n{WIND}', head)).seeds == (1,)
    with pytest.raises(InputError, match="above_rated"):
        read_suite("above_ratted")
    with pytest.raises(InputError, match="does not exist"):
        read_suite(tmp_path / "none.toml")
    with pytest.raises(InputError, match="not valid TOML"):
        read_suite(written(tmp_path, "", head="version ="))
