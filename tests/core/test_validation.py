import math
from decimal import Decimal
from enum import StrEnum
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kickdyn.core import validation
from kickdyn.errors import InvalidInput


@pytest.mark.parametrize(
    "value",
    [
        2,
        2.0,
        np.float32(2),
        np.int8(2),
        np.array(2.0),
        np.array(2.0, ">f8"),
        Fraction(4, 2),
        Decimal(2),
    ],
)
def test_number_takes_whatever_is_one_real_number(value):
    assert type(validation.number("x", value)) is float
    assert validation.number("x", value) == 2.0


@pytest.mark.parametrize(
    "value",
    [
        *(math.nan, math.inf, -math.inf, None, "2", b"2", bytearray(b"2"), True, np.True_),
        *(2j, np.complex128(2), 10**400, [2.0], np.array([2.0]), np.ma.masked, object),
    ],
    ids=repr,
)
def test_number_refuses_what_is_not(value):
    with pytest.raises(InvalidInput, match=r"^length is .*: it must be a finite number \[m\]$"):
        validation.number("length", value, unit="m")


@pytest.mark.parametrize("kind", [float, np.float64, np.float32, Fraction, Decimal, np.array])
def test_a_number_outside_its_limits_is_shown_as_a_plain_number(kind):
    with pytest.raises(
        InvalidInput, match=r"^length is -2\.5: it must be a finite number above 0$"
    ):
        validation.number("length", kind(-2.5), above=0)


@pytest.mark.parametrize(
    ("limits", "inside", "outside", "said"),
    [
        ({"above": 0}, 5e-324, 0.0, "above 0"),
        ({"at_least": 0}, 0.0, -5e-324, "at least 0"),
        ({"at_most": 1}, 1.0, 1.0 + 2**-52, "at most 1"),
        ({"at_least": 0, "at_most": 1}, 0.5, -0.1, "at least 0 and at most 1"),
    ],
)
def test_number_keeps_its_limits_to_the_last_digit(limits, inside, outside, said):
    assert validation.number("x", inside, **limits) == inside
    with pytest.raises(InvalidInput, match=said):
        validation.number("x", outside, **limits)


@pytest.mark.parametrize(
    "value",
    [
        [1, 2, 3],
        (1.0, 2.0, 3.0),
        range(1, 4),
        np.array([1, 2, 3], ">f8"),
        np.array([1, 2, 3], "<f4"),
        np.array([1, 2, 3], "u1"),
        np.array([3.0, 2.0, 1.0])[::-1],
        np.ma.array([1.0, 2.0, 3.0]),
    ],
    ids=repr,
)
def test_vector_is_native_doubles_of_its_own(value):
    array = validation.vector("x", value, 3)
    assert type(array) is np.ndarray
    assert array.dtype == np.dtype(float)
    assert array.dtype.isnative
    assert array.tolist() == [1.0, 2.0, 3.0]
    array[0] = 9.0  # neither read-only nor the caller's
    assert next(iter(value)) == 1


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([1, 2], r"shape \(2,\): it must be \(3,\)"),
        ([[1, 2, 3]], r"shape \(1, 3\)"),
        (1.0, r"shape \(\)"),
        ([1, 2, math.nan], "nan"),
        ([1, 2, -math.inf], "-inf"),
        (np.full(3, np.longdouble("1e400")), "inf"),
        (np.full(1000, math.nan), "an array with nan in it"),
        (["1", "2", "3"], "real numbers"),
        ([True, False, True], "real numbers"),
        ([1j, 2, 3], "real numbers"),
        ([None, 2, 3], "real numbers"),
        ({1, 2, 3}, "real numbers"),
        ([1, [2, 3], 4], "array of numbers"),
        (np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0]), "masked"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_vector_refuses_by_name(value, said):
    with pytest.raises(InvalidInput, match=f"^wind .*{said}"):
        validation.vector("wind", value, 3, unit="m/s")


LARGEST = 1.7e308


@given(
    st.lists(st.floats(-LARGEST, LARGEST), min_size=3, max_size=3).filter(any),
)
def test_direction_is_unit_and_parallel_whatever_the_length(value):
    unit = validation.direction("n", value)
    assert math.hypot(*unit) == pytest.approx(1.0, abs=1e-15)
    largest = max(range(3), key=lambda i: abs(value[i]))
    ratios = [entry / value[largest] for entry in value]  # independent of any square
    assert unit / unit[largest] == pytest.approx(ratios, rel=1e-15, abs=1e-300)
    assert math.copysign(1, unit[largest]) == math.copysign(1, value[largest])


@pytest.mark.parametrize("value", [[0, 0, 0], [0.0, -0.0, 0.0], [1, 0], [math.nan, 0, 1]])
def test_direction_needs_one(value):
    with pytest.raises(InvalidInput, match=r"^n "):
        validation.direction("n", value)


@pytest.mark.parametrize("value", [True, [True, 0, 1], (0, np.bool_(False)), [[1.0], [True]]])
def test_true_is_no_number_of_an_array(value):
    with pytest.raises(InvalidInput, match="must contain real numbers"):
        validation.floats("x", value)


@pytest.mark.parametrize("digits", [400, 5001])
def test_endless_integers_are_shown_in_brief(digits):
    for check in (validation.number, validation.floats):
        with pytest.raises(InvalidInput) as refused:
            check("x", 10**digits)
        assert len(str(refused.value)) < 400


@pytest.mark.parametrize("value", [None, 1, "no", "", []])
def test_a_flag_is_true_or_false(value):
    assert validation.flag("strict", np.True_) is True
    assert validation.flag("strict", False) is False
    with pytest.raises(InvalidInput, match=r"^strict is .*: it must be True or False"):
        validation.flag("strict", value)


class Colour(StrEnum):
    DARK_RED = "dark-red"
    BLUE = "blue"


def test_choice_takes_the_member_or_its_value():
    for value in (Colour.DARK_RED, "dark-red"):
        assert validation.choice("colour", value, Colour) is Colour.DARK_RED
    for value in ("dark red", None, 3, [1]):
        with pytest.raises(InvalidInput, match=r"colour is .*: it must be one of dark-red, blue"):
            validation.choice("colour", value, Colour)


def test_a_read_only_array_is_a_copy():
    own = np.zeros(3)
    fixed = validation.read_only(own)
    own[0] = 1
    assert fixed.tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        fixed[0] = 1
