"""fowt connect check-dll: records that a library reads and writes, its demands, what makes it unusable."""

import pytest
from bladed_library import built, needs_gcc
from command_line import fowt

from fowt_env.controllers.bladed import check
from fowt_env.controllers.bladed.check import check_dll
from fowt_env.controllers.bladed.controller import BladedLibrary
from fowt_env.controllers.bladed.records import RECORDS

pytestmark = needs_gcc


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return built(tmp_path_factory.mktemp("c"))


@pytest.fixture
def checked(turbine, library, tmp_path):
    """Function that checks the library in a mode."""

    def check(mode, **settings):
        (tmp_path / "mode.IN").write_text(mode)
        return check_dll(BladedLibrary(str(library), str(tmp_path / "mode.IN"), **settings), turbine)

    return check


@pytest.mark.slow
def test_what_a_library_reads_and_writes_is_what_its_source_says(checked):
    found = checked("law")
    assert found.faults == [] and found.exported == ["DISCON"]
    # record 2 decides when the other modes act, which does not change what is written in this one
    assert [record.number for record in found.read] == [3, 4, 19, 20, 22]
    assert [record.number for record in found.written] == [42, 43, 44, 45, 47, 55, 56]
    assert found.overwritten == [] and found.unnamed == []
    assert found.torque == pytest.approx((43093.55, 43093.55), rel=1e-6)
    assert 0.25 < found.pitch[0] < found.pitch[1] < 0.28
    assert 0.0 < found.call <= found.slowest and found.call < 0.05 and found.start > found.call
    assert found.output == "301 calls, last at 29.9 s"


def test_records_that_matter_are_found_in_few_series_and_each_is_tried_alone():
    tried = []

    def matter(group):
        tried.append(group)
        return bool({3, 20, 21} & set(group)) or {40, 41} <= set(group)  # 40 and 41: only together

    assert check._those_that_matter(list(range(64)), matter) == [3, 20, 21]
    assert [3] in tried and len(tried) < 64


def test_a_law_of_the_ratio_of_two_readings_reads_both(checked):
    assert [record.number for record in checked("ratio").read] == [19, 20]


def test_a_library_that_starts_slowly_is_announced(library, turbine, monkeypatch):
    monkeypatch.setattr(check, "SLOW_START", 0.0)
    said = []
    check_dll(BladedLibrary(str(library)), turbine, note=said.append)
    assert len(said) == 1 and str(library) in said[0] and "40 starts" in said[0]


@pytest.mark.slow
def test_writes_beyond_the_named_records_and_into_inputs_are_named(checked):
    found = checked("scribble")
    assert [record.name for record in found.overwritten] == ["rotor_speed"] and found.unnamed == [200]
    assert not found.faults


@pytest.mark.parametrize(
    ("mode", "part"),
    [
        ("random", "two runs of the same series differ in their demands"),
        ("crash", "by SIGSEGV"),
        ("fail", "no wind vane"),
        ("yaw", "the nacelle does not yaw"),
        ("nan", "a demand is not a finite number"),
    ],
)
def test_what_keeps_a_library_from_being_used_is_a_fault(checked, mode, part):
    (fault,) = checked(mode).faults
    assert part in fault


def test_an_endless_loop_is_a_fault_after_the_time_limit(checked):
    (fault,) = checked("hang", limit=0.3).faults
    assert "a call took longer than 0.3 s" in fault


def test_every_record_has_a_name_of_its_own_and_the_numbers_increase():
    numbers = [record.number for record in RECORDS]
    assert numbers == sorted(set(numbers)) and len({record.name for record in RECORDS}) == len(RECORDS)


@pytest.mark.slow
def test_the_command_prints_the_records_and_ends_with_what_it_found(library, tmp_path):
    printed, notes = fowt("connect", "check-dll", str(library))
    assert "usable: the same demands in two runs" in printed and "exports" in printed
    assert "20  generator_speed" in printed and "47  generator_torque_demand" in printed
    assert "301 calls" in notes
    (tmp_path / "fail.IN").write_text("fail")
    printed, _ = fowt("connect", "check-dll", f"{library},{tmp_path / 'fail.IN'}", code=1)
    assert "no wind vane" in printed and "usable" not in printed
    _, error = fowt("connect", "check-dll", str(tmp_path / "fail.IN"), code=2)
    assert "is no shared library (ELF)" in error
