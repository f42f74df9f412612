"""What a number is, and the one message about a value that cannot be used."""

import math

import numpy as np
import pytest

from fowt_env.descriptions.checks import (
    check_number,
    check_one_of,
    check_whole_number,
    is_number,
    is_whole,
    parse_whole_numbers,
)
from fowt_env.errors import InputError


@pytest.mark.parametrize("value", [0, -1.5, 10**300, np.float32(2.0), np.int64(3)])
def test_a_number_is_one_that_fits_a_float(value):
    assert is_number(value) and check_number("x", value) == float(value)
    assert type(check_number("x", value)) is float


@pytest.mark.parametrize("value", [True, np.True_, "1", None, [1.0], math.nan, math.inf, 10**400, 1j])
def test_what_is_no_number_is_refused_with_key_and_value(value):
    assert not is_number(value)
    with pytest.raises(InputError, match="^x = .*: must be a finite number$"):
        check_number("x", value)


@pytest.mark.parametrize(
    ("limits", "good", "wrong", "allowed"),
    [
        ({"low": 0.0, "high": 2.0}, (0.0, 2.0), (-1e-9, 2.1), "a number in [0, 2]"),
        ({"low": 0.0, "high": 2.0, "low_open": True}, (1e-9, 2.0), (0.0, 2.1), "a number in (0, 2]"),
        ({"low": 0.0, "high": 2.0, "high_open": True}, (0.0, 1.9), (-1.0, 2.0), "a number in [0, 2)"),
        ({"low": 0.5}, (0.5, 1e300), (0.4,), "a number >= 0.5"),
        ({"low": 0.0, "low_open": True}, (1e-300,), (0.0, -1), "a number > 0"),
        ({"high": 0.0, "high_open": True}, (-1e-300,), (0,), "a number < 0"),
        ({"low": 0.0, "infinite": True}, (0.0, math.inf), (-math.inf, math.nan), "a number >= 0"),
        ({"low": 0.0, "allowed": "seconds"}, (1,), (-1,), "seconds"),
    ],
)
def test_a_range_holds_what_it_says(limits, good, wrong, allowed):
    for value in good:
        assert check_number("x", value, **limits) == value
    for value in (*wrong, math.nan):
        with pytest.raises(InputError) as caught:
            check_number("x", value, **limits)
        assert str(caught.value) == f"x = {value!r}: must be {allowed}"


@pytest.mark.parametrize("value", [True, 1.0, "1", None, math.nan, np.float64(1.0)])
def test_a_whole_number_is_one_by_its_type(value):
    assert not is_whole(value)
    with pytest.raises(InputError, match="^n = .*: must be a whole number$"):
        check_whole_number("n", value)


def test_a_whole_number_is_within_its_ends():
    assert [check_whole_number("n", n, 1, 3) for n in (1, 3, np.int32(2))] == [1, 3, 2]
    for n in (0, 4):
        with pytest.raises(InputError, match=f"^n = {n}: must be a whole number from 1 to 3$"):
            check_whole_number("n", n, 1, 3)
    with pytest.raises(InputError, match="^n = 0: must be a whole number >= 1$"):
        check_whole_number("n", 0, 1)


def test_a_choice_is_one_of_a_few_whatever_it_is():
    assert check_one_of("kind", "b", {"a": 1, "b": 2}) == "b"
    for wrong in ("c", 1, None, [], {}):
        with pytest.raises(InputError, match="^kind = .*: must be one of a, b$"):
            check_one_of("kind", wrong, {"a": 1, "b": 2})


def test_a_long_value_is_shortened():
    for value in ("x" * 1000, 10**5000, list(range(1000))):
        with pytest.raises(InputError) as caught:
            check_number("x", value)
        assert len(str(caught.value)) < 120


def test_whole_numbers_of_a_text():
    assert parse_whole_numbers("1:3:1", "seeds") == [1, 2, 3]
    with pytest.raises(InputError, match="seeds = '1,1.5': must be whole numbers"):
        parse_whole_numbers("1,1.5", "seeds")
