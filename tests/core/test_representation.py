"""Results show their values in a terminal and in Jupyter, and compare by them."""

import copy

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.representation import ReprMixin, distance_in_words, format_value


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
