"""Results show their values in a terminal and in Jupyter, and compare by them."""

import copy
from xml.etree import ElementTree

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.representation import (
    SHOWN_WARNINGS,
    Printed,
    ReprMixin,
    distance_in_words,
    format_value,
    warned,
)

POSTURE = kd.Leg.human().posture(np.radians([5, 10, -5]))
TOUCH = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
V = POSTURE.joint_velocity([5, 0, 2.5])
LAUNCH = kd.BallState((0, 0, 0.11), (12, 9, 8))
RESULTS = {
    "Leg": lambda: POSTURE.leg,
    "Posture": lambda: POSTURE,
    "Ball": kd.Ball,
    "Contact": lambda: kd.Contact((2, 0, 1), 0.8, 0.4, offset=(0, 0, 0.01)),
    "Air": lambda: kd.Air(lift=None),
    "Ground": lambda: kd.Ground(surface="turf"),
    "Plane": lambda: kd.Plane((5, 0, 0), (-1, 0, 0)),
    "Goal": lambda: kd.Goal(20, over=(9.15, 2), beside=(9.15, 1)),
    "Scene": lambda: kd.load_scene("paper_kick"),
    "Impact": lambda: kd.strike(POSTURE, V, kd.Ball(), TOUCH),
    "Sensitivity": lambda: kd.strike(POSTURE, V, kd.Ball(), TOUCH).sensitivity(),
    "Collision": lambda: kd.collide(POSTURE, V, kd.Ball(), TOUCH, tol=1e-6),
    "Flight": lambda: kd.fly(LAUNCH, kd.Ball()),
    "Course": lambda: kd.follow(LAUNCH, kd.Ball(), None, kd.Ground(surface="wet-grass")),
    "Launch": lambda: kd.plan_launch(kd.Goal((20, 0, 0), time=1.5), kd.Ball()),
    "KickPlan": lambda: kd.plan_kick(POSTURE.leg, kd.Goal((20, 0, 0), time=1.5), kd.Ball()),
}


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_shows_a_small_table_of_names_values_and_units(name):
    result = RESULTS[name]()
    page = ElementTree.fromstring(f"<p>{result._repr_html_()}</p>")
    assert page.findtext("table/caption/b") == name
    rows = [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]
    assert 2 <= len(rows) <= 24
    assert all(label for label, _, _ in rows)
    assert repr(result).startswith(name)
    assert "array(" not in repr(result)


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


def test_a_printed_result_is_its_text_in_html():
    class Table(Printed):
        def __str__(self):
            return "a < b"

    assert repr(Table()) == "a < b"
    assert ElementTree.fromstring(Table()._repr_html_()).text == "a < b"


@pytest.mark.parametrize("count", [0, SHOWN_WARNINGS, SHOWN_WARNINGS + 4])
def test_some_warnings_are_shown_and_the_others_counted(count):
    rows = list(warned([f"w{k}" for k in range(count)]))
    shown = [f"w{k}" for k in range(min(count, SHOWN_WARNINGS))]
    assert [text for _, text, _ in rows][: len(shown)] == shown
    assert [" 4 " in text for _, text, _ in rows[SHOWN_WARNINGS:]] == [True] * (count > len(shown))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-0.0, "0"),
        (np.float64(1 / 3), "0.3333"),
        (np.array([1.0, -0.0, 2.5e-7]), "(1, 0, 2.5e-07)"),
        (np.array([1.0, -7e-23, 2e-11]), "(1, 0, 2e-11)"),
        (np.array([3e-17, 0.0]), "(3e-17, 0)"),
        (True, "yes"),
        (np.False_, "no"),
        (7, "7"),
        (float("inf"), "inf"),
    ],
)
def test_values_have_four_digits_and_no_rounding_errors(value, text):
    assert format_value(value) == text


@pytest.mark.parametrize(
    ("distance", "words"),
    [(2.8e-17, "less than a micrometre"), (4.56e-4, "0.46 mm"), (0.0456, "0.046 m"),
     (12.3, "12 m")],
)  # fmt: skip
def test_distances_have_two_digits_and_a_unit(distance, words):
    assert distance_in_words(distance) == words


def test_contacts_and_states_are_equal_by_value_and_their_copies_read_only():
    pairs = (
        (kd.Contact((0, 0, 5), 0.8), kd.Contact([0.0, 0.0, 1.0], 0.8, offset=None)),
        (kd.BallState((-0.0, 1, 0)), kd.BallState(np.array([0.0, 1, 0]))),
        (kd.BallState(velocity=np.ones((2, 3))), kd.BallState(velocity=np.ones((2, 3)))),
    )
    for one, other in pairs:
        assert one == other == copy.deepcopy(one)
        assert hash(one) == hash(other)
        assert one != 0.8
        arrays = [value for value in vars(copy.copy(one)).values() if isinstance(value, np.ndarray)]
        assert arrays
        assert not any(array.flags.writeable for array in arrays)
    assert pairs[0][0] != kd.Contact((0, 0, 1), 0.8, offset=(0, 0, 0))
    assert pairs[0][0] != kd.Contact((0, 1, 0), 0.8)
    assert pairs[2][0] != kd.BallState(velocity=(1, 1, 1))
