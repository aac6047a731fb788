"""Problems made of terms that know nothing of legs, and what their solver makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from tolerances import closed_form

from kickdyn.planning.problem import TOLERANCE, Bounds, Function, Kind, Problem


class Term(Function):
    """A term of one value, by functions for it and its slope."""

    def __init__(self, kind, value, slope, **numbers):
        self.kind, self._value, self._slope = kind, value, slope
        vars(self).update(numbers)

    def value(self, point):
        return np.array([self._value(point)])

    def slope(self, point):
        return np.array([self._slope(point)])


def distance(*place):
    """Return the objective to be near a place."""
    return Term(Kind.OBJECTIVE, lambda x: (x - place) @ (x - place), lambda x: 2 * (x - place))


def plane(level, kind, **numbers):
    """Return that the first component has a value, or is at least as large."""
    return Term(kind, lambda x: x[0] - level, lambda x: np.eye(len(x))[0], **numbers)


def circle(kind):
    """Return that the place is on the unit circle, or outside of it."""
    return Term(kind, lambda x: x @ x - 1.0, lambda x: 2 * x)


class Box(Bounds):
    def __init__(self, lower, upper):
        self.lower, self.upper = np.array(lower), np.array(upper)


def problem(*terms):
    return Problem(2, lambda x: x, terms)


@pytest.mark.parametrize(("terms", "solution"), [
    ([], (3.0, -1.0)), ([plane(1.0, Kind.EQUALITY)], (1.0, -1.0)),
    ([plane(1.0, Kind.INEQUALITY)], (3.0, -1.0)), ([plane(5.0, Kind.INEQUALITY)], (5.0, -1.0)),
    ([plane(5.0, Kind.INEQUALITY, scale=10.0, margin=0.01)], (5.1, -1.0)),
    ([Box((-1.0, 0.0), (2.0, np.inf))], (2.0, 0.0)),
    ([Box((-9.0, 0.0), (9.0, 9.0)), Box((-np.inf, -9.0), (1.0, 9.0))], (1.0, 0.0))])  # fmt: skip
def test_terms_alone_define_a_problem(terms, solution):
    result = problem(distance(3.0, -1.0), *terms).solve(np.array([20.0, 20.0]))
    assert result == pytest.approx(solution, abs=TOLERANCE)


@pytest.mark.parametrize("kind", [Kind.EQUALITY, Kind.INEQUALITY])
def test_a_polished_solution_is_the_nearest_point_of_the_circle_in_all_digits(kind):
    place, rough = np.array([0.3, -0.4]), np.array([0.6001, -0.79992])
    if kind == Kind.INEQUALITY:  # reached, as a solver leaves it
        rough /= np.linalg.norm(rough)
    polished = problem(distance(*place), circle(kind)).polish(rough)
    assert polished == pytest.approx((0.6, -0.8), abs=closed_form())


def test_a_bound_that_is_reached_stays_so_when_a_solution_is_polished():
    box = Box((-9.0, -9.0), (0.2, 9.0))
    bounded = problem(distance(0.3, -0.4), circle(Kind.EQUALITY), box)
    polished = bounded.polish(np.array([0.2, -0.97979]))
    assert polished == pytest.approx((0.2, -np.sqrt(0.96)), abs=closed_form())


@pytest.mark.parametrize(("kind", "answer", "accepted"), [
    (Kind.EQUALITY, [1.0 + 0.9 * TOLERANCE, 7.0], True),
    (Kind.EQUALITY, [1.0 - 2.0 * TOLERANCE, 7.0], False), (Kind.EQUALITY, [np.nan, 0.0], False),
    (Kind.INEQUALITY, [9.0, 0.0], True), (Kind.INEQUALITY, [1.0 - 0.9 * TOLERANCE, 7.0], True),
    (Kind.INEQUALITY, [1.0 - 2.0 * TOLERANCE, 7.0], False)])  # fmt: skip
def test_what_a_solver_returns_is_judged_by_the_terms(kind, answer, accepted, monkeypatch):
    judged = problem(distance(0.0, 0.0), plane(1.0, kind))
    found = SimpleNamespace(x=np.array(answer))
    monkeypatch.setattr("kickdyn.planning.problem.minimize", lambda *_, **__: found)
    solution = judged.solve(np.zeros(2))
    assert (solution is not None) == accepted
