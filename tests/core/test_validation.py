"""Values from outside are converted or refused by name; results show theirs and compare by them."""

import copy
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tolerances import closed_form

import kickdyn as kd
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, distance_in_words, format_value
from kickdyn.errors import InvalidInput


@pytest.mark.parametrize("value", [
    2, 2.0, np.float32(2), np.int8(2), np.array(2.0, ">f8"), Fraction(4, 2), Decimal(2)
])  # fmt: skip
def test_number_takes_one_real_number_of_any_type(value):
    assert type(validation.number("x", value)) is float
    assert validation.number("x", value) == 2.0


@pytest.mark.parametrize("value", [
    *(math.nan, math.inf, -math.inf, None, "2", b"2", bytearray(b"2"), True, np.True_),
    *(2j, np.complex128(2), 10**400, 10**5001, [2.0], np.array([2.0]), np.ma.masked, object),
], ids=lambda value: validation.brief(value)[:20])  # fmt: skip
def test_number_refuses_other_values(value):
    with pytest.raises(InvalidInput, match=r"^length is .*\[m\]$") as refused:
        validation.number("length", value, unit="m")
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize(("limits", "inside", "outside", "word"), [
    ({"above": 0}, 5e-324, 0.0, "above 0"), ({"at_least": 0}, 0.0, -5e-324, "at least 0"),
    ({"at_most": 1}, 1.0, 1.0 + 2**-52, "at most 1"),
    ({"at_least": 0, "at_most": 1}, 0.5, -0.1, "at least 0 and at most 1")])  # fmt: skip
def test_number_keeps_its_limits_to_the_last_digit(limits, inside, outside, word):
    assert validation.number("x", inside, **limits) == inside
    with pytest.raises(InvalidInput, match=f"^x is {outside!r}.*{word}"):
        validation.number("x", Fraction(outside), **limits)


@pytest.mark.parametrize("value", [
    [1, 2, 3], (1.0, 2.0, 3.0), range(1, 4), np.array([1, 2, 3], ">f8"),
    np.array([1, 2, 3], "u1"), np.array([3.0, 2.0, 1.0])[::-1], np.ma.array([1.0, 2.0, 3.0]),
    np.array([1.0, 2.0, 3.0])], ids=repr)  # fmt: skip
def test_vector_is_a_new_array_of_native_doubles(value):
    array = validation.vector("x", value, 3)
    assert (type(array), array.dtype, array.dtype.isnative) == (np.ndarray, np.dtype(float), True)
    assert array.tolist() == [1.0, 2.0, 3.0]
    array[0] = 9.0  # neither read-only nor the caller's
    assert next(iter(value)) == 1


@pytest.mark.parametrize(("value", "word"), [
    ([1, 2], r"\(2,\)"), ([[1, 2, 3]], r"\(1, 3\)"), (1.0, r"\(\)"), ([1, 2, math.nan], "nan"),
    (np.array([1, 2, -math.inf]), "-inf"), (np.full(3, np.longdouble("1e400")), "inf"),
    (np.full(1000, math.nan), "nan"), (["1", "2", "3"], "real numbers"),
    ([True, False, True], "real numbers"), ((0, 1, np.bool_(False)), "real numbers"),
    ([1j, 2, 3], "real numbers"), ([None, 2, 3], "real numbers"), ({1, 2, 3}, "real numbers"),
    ([1, [2, 3], 4], "array of numbers"), (np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0]), "masked")
], ids=lambda value: str(value)[:30])  # fmt: skip
def test_vector_refuses_by_name(value, word):
    with pytest.raises(InvalidInput, match=f"^wind .*{word}"):
        validation.vector("wind", value, 3, unit="m/s")


@given(st.lists(st.floats(-1.7e308, 1.7e308), min_size=3, max_size=3).filter(any))
def test_direction_is_unit_and_parallel_whatever_the_length(value):
    unit = validation.direction("n", value)
    largest = max(range(3), key=lambda i: abs(value[i]))
    ratios = [entry / value[largest] for entry in value]
    assert math.hypot(*unit) == pytest.approx(1.0, abs=closed_form())
    assert unit / unit[largest] == pytest.approx(ratios, rel=closed_form(), abs=1e-300)
    assert math.copysign(1, unit[largest]) == math.copysign(1, value[largest])


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_length_is_that_of_every_row_at_any_size(size):
    rows = np.array([[3.0, 0.0, -4.0], [0.0, 0.0, 0.0], [1.0, 2.0, 2.0]])
    assert validation.length(size * rows) == pytest.approx(size * np.array([5.0, 0.0, 3.0]))


class Named(ReprMixin):
    def __init__(self, *rows):
        self._all = rows

    def _rows(self):
        return self._all


def test_rows_have_their_unit_and_html_is_escaped():
    shown = Named(("<b>mass", 1.23456, "kg"), ("way", np.array([1.0, -0.0]), "m"))
    assert [line.split() for line in repr(shown).splitlines()] == [
        ["Named"], ["<b>mass", "1.235", "kg"], ["way", "(1,", "0)", "m"],
    ]  # fmt: skip
    assert "<b>mass" not in shown._repr_html_()
    assert "&lt;b&gt;mass" in shown._repr_html_()


@pytest.mark.parametrize(("value", "text"), [
    (-0.0, "0"), (np.float64(1 / 3), "0.3333"), (np.array([1.0, -0.0, 2.5e-7]), "(1, 0, 2.5e-07)"),
    (np.array([1.0, -7e-23, 2e-11]), "(1, 0, 2e-11)"), (np.array([3e-17, 0.0]), "(3e-17, 0)"),
    (True, "yes"), (np.False_, "no"), (7, "7"), (float("inf"), "inf")])  # fmt: skip
def test_values_have_four_digits_and_no_rounding_errors(value, text):
    assert format_value(value) == text


@pytest.mark.parametrize(("distance", "words"), [
    (2.8e-17, "less than a micrometre"), (4.56e-4, "0.46 mm"), (0.0456, "0.046 m"),
    (12.3, "12 m")])  # fmt: skip
def test_distances_have_two_digits_and_a_unit(distance, words):
    assert distance_in_words(distance) == words


def test_contacts_and_states_are_equal_by_value():
    pairs = (
        (kd.Contact((0, 0, 5), 0.8), kd.Contact([0.0, 0.0, 1.0], 0.8, offset=None)),
        (kd.BallState((-0.0, 1, 0)), kd.BallState(np.array([0.0, 1, 0]))),
        (kd.BallState(velocity=np.ones((2, 3))), kd.BallState(velocity=np.ones((2, 3)))),
    )
    for one, other in pairs:
        assert one == other == copy.deepcopy(one)
        assert hash(one) == hash(other)
        assert one != 0.8
    for other in (((0, 0, 1), 0.8, 0.0, (0, 0, 0)), ((0, 1, 0), 0.8), ((0, 0, 1), 0.7),
                  ((0, 0, 1), 0.8, 0.1)):  # fmt: skip
        assert pairs[0][0] != kd.Contact(*other)
    assert pairs[2][0] != kd.BallState(velocity=(1, 1, 1))
