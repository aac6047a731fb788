"""Goals: times of flight of the parabola; problems of terms that know nothing of legs."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.planning.goal import nominal_velocity
from kickdyn.planning.problem import TOLERANCE, Bounds, Function, Kind, Problem

G = 9.81


@pytest.mark.parametrize("kind", ["time", "apex", "speed", "over"])
@settings(max_examples=25)
@given(
    target=st.tuples(st.floats(5, 60), st.floats(-20, 20), st.floats(-3, 6)),
    time=st.floats(0.6, 4.0),
    part=st.floats(0.1, 0.9),
)
def test_nominal_times_are_those_of_the_parabola(kind, target, time, part):
    goal = kd.Goal(target, time=1)
    velocity, at = nominal_velocity(goal.target, time), part * time
    agrees(velocity * time - [0, 0, G / 2 * time**2], target, closed_form())
    height = velocity[2] * at - G / 2 * at**2
    falls, apex = velocity[2] - G * time < -0.5, velocity[2] ** 2 / (2 * G)
    assume(velocity[2] > 0.5)
    assume(falls or kind != "apex")
    over = part * goal.distance, height
    wished = {"time": time, "apex": apex, "speed": math.hypot(*velocity), "over": over}[kind]
    times = kd.Goal(target, **{kind: wished}).nominal_times()
    assert min(times, key=lambda t: abs(t - time)) == pytest.approx(time, rel=optimized(1e-7))
    assert len(times) == (2 if kind == "speed" else 1)
    assert times == sorted(times)
    for t in times if kind == "speed" else ():
        other = nominal_velocity(goal.target, t)
        assert math.hypot(*other) == pytest.approx(wished, rel=closed_form(1e4))


@pytest.mark.parametrize(("target", "condition"), [
    (30, {"speed": 17.1}), ((10, 0, 3), {"apex": 2.9}), ((10, 0, 2), {"over": (5, 0.99)})
], ids=["below sqrt(g d) = 17.16 m/s", "apex below the target", "point below the straight line"
])  # fmt: skip
def test_what_the_vacuum_does_not_allow_has_no_nominal_time(target, condition):
    assert kd.Goal(target, **condition).nominal_times() == []


def test_ahead_and_left_are_a_right_handed_pair_towards_the_target():
    goal = kd.Goal((3.0, -4.0, 1.2), time=1)
    assert goal.distance == 5.0
    assert goal.ahead == pytest.approx([0.6, -0.8, 0.0])
    assert goal.left == pytest.approx(np.cross([0, 0, 1], goal.ahead))
    assert (goal.lowest, kd.Goal((3, 0, -2), time=1).lowest) == (0.0, -2.0)


def test_a_goal_seen_from_elsewhere_is_the_same_in_the_world():
    """Points of the flight that start anywhere keep their places, and a receiver has run on."""
    running = np.array([1.0, 2.0, 0.5])
    goal = kd.Goal(
        (20.0, 5.0, 1.0), apex=4.0, beside=(8.0, 1.5), spin=(1, 2, 3), receiver_velocity=running
    )
    moved, delay = np.array([0.6, -0.4, 0.3]), 0.25
    other = goal.seen_from(moved, delay)
    assert moved + other.target == pytest.approx(goal.target + delay * running)
    assert moved[2] + other.apex == pytest.approx(goal.apex)
    place = goal.beside[0] * goal.ahead + goal.beside[1] * goal.left
    seen = other.beside[0] * goal.ahead + other.beside[1] * goal.left
    assert (seen + moved)[:2] == pytest.approx(place[:2])
    over = kd.Goal((20.0, 5.0, 1.0), over=(8.0, 2.0)).seen_from(moved, 0.0).over
    assert over == pytest.approx((8.0 - moved @ goal.ahead, 2.0 - 0.3))
    at = goal.at(0.5)
    assert at.target == pytest.approx(goal.target + 0.5 * running)
    assert not at.receiver_velocity.any()


@pytest.mark.parametrize(("target", "named", "words"), [
    (30, {}, "nothing is given"), (30, {"time": 1, "apex": 2}, "time and apex are given"),
    (30, {"time": -1}, "time is -1.0"), (20, {"time": 1e-300}, "time is 1e-300"),
    (30, {"apex": 0}, "apex is 0"), (30, {"speed": -2}, "speed is -2"),
    (-3, {"time": 1}, "distance is -3.0"), ((0, 0, 3), {"time": 1}, "straight above or below"),
    ((1, 2), {"time": 1}, r"shape \(2,\)"), (2e4, {"time": 1}, "at most 10000 m"),
    (30, {"over": (31, 2)}, "over is at 31 m"),
    (30, {"time": 1, "beside": (0, 2)}, "beside is at 0 m"),
    (math.nan, {"time": 1}, "target is nan"), (30, {"time": 1, "spin": (0, 1)}, "spin has shape"),
    (30, {"time": 1, "arc": "flat"}, "arc is 'flat'.*low, high"),
    (10, {"time": 1, "receiver_velocity": (101, 0, 0)}, "speed of the receiver is .* 100")
])  # fmt: skip
def test_bad_input(target, named, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Goal(target, **named)


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
