"""A plane, and the flights, slides and rolls that end at it."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.ground import Surface

BALL = kd.Ball()
R = BALL.radius
AIRS = {"vacuum": None, "air": kd.Air()}
every_air = pytest.mark.parametrize("air", AIRS.values(), ids=AIRS)


def launch(velocity, at=(0, 0, 0), spin=(0, 0, 0)):
    return kd.BallState(at, velocity, spin)


@settings(max_examples=25)
@given(point=st.tuples(*[st.floats(-9, 9)] * 3), normal=st.tuples(*[st.floats(-9, 9)] * 3),
    metre=st.sampled_from([1e-6, 1.0, 1e6]), depth=st.floats(0.5, 9),
    part=st.sampled_from(["front", "centre", "back"]))  # fmt: skip
def test_gap_is_the_distance_of_the_part_of_the_ball_along_the_normal(
    point, metre, normal, depth, part
):
    """In any unit of length; a billionth beyond the plane is rounding."""
    size = math.hypot(*normal)
    assume(size > 0.1)
    unit, point = np.array(normal) / size, metre * np.array(point)
    ball, plane = kd.Ball(radius=0.3 * metre), kd.Plane(point, normal, part)
    centre = point + metre * (depth * unit + 3.0 * np.cross(unit, (1, 2, 3)))
    right = metre * (depth + {"front": -0.3, "centre": 0.0, "back": 0.3}[part])
    assert plane.gap(ball, centre) == pytest.approx(right, rel=closed_form(100))
    assert plane.normal == pytest.approx(unit, rel=closed_form())
    assert plane.gap(ball, centre - (right + 2e-10 * metre) * unit) == 0.0
    for beyond in (1.0, 1e-6):
        with pytest.raises(kd.InvalidInput, match=f"{part} .*beyond the plane"):
            plane.gap(ball, centre - (right + beyond * metre) * unit)


@pytest.mark.parametrize(("normal", "part", "answer"),
    [((1, 0, 0), "back", True), ((1, 2, 0), "centre", True), ((1, 0, 0), "front", False),
    ((1, 0, 0.01), "back", False)])  # fmt: skip
def test_a_goal_line_is_upright_and_not_reached_by_the_front(normal, part, answer):
    assert kd.Plane((0, 0, 0), normal, part).is_goal_line is answer


@pytest.mark.parametrize(("arguments", "words"), [(((0, 0), (1, 0, 0)), r"point .*\(2,\)"),
    (((0, 0, math.nan), (1, 0, 0)), "point .*finite"),
    (((0, 0, 0), (0, 0, 0)), "normal .*direction"),
    (((0, 0, 0), (1, 0, 0), "middle"), "'middle'.*front, centre, back")])  # fmt: skip
def test_refusals(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Plane(*arguments)


@settings(max_examples=25)
@given(velocity=st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(1, 20)),
    normal=st.tuples(*[st.floats(-1, 1)] * 3), gap=st.floats(0.1, 20))  # fmt: skip
def test_in_a_vacuum_the_ball_is_on_the_plane_at_the_first_root(velocity, normal, gap):
    """The distance to the plane is d + n.v t - n.g t^2/2; it ends at its least positive root."""
    size = math.hypot(*normal)
    assume(size > 0.1)
    n = np.array(normal) / size
    path = kd.fly(launch(velocity), BALL, plane=kd.Plane(-gap * n, normal, "centre"))
    approach, spread = n @ velocity, (n @ velocity) ** 2 + 2 * 9.81 * n[2] * gap
    assume(abs(spread) > 0.01 * (n @ velocity) ** 2)  # it does not graze the plane
    sums = [-approach + sign * math.sqrt(spread) for sign in (1, -1)] if spread > 0 else []
    times = [2 * gap / total for total in sums if total > 1e-6]
    ground = 2 * velocity[2] / 9.81
    assume(all(abs(t - ground) > 1e-6 for t in times))
    first = min([*times, ground])
    assert path.status == ("landed" if first == ground else "at-plane")
    assert path.duration == pytest.approx(first, rel=closed_form(1e4))
    right = np.array(velocity) * first - [0, 0, 9.81 / 2 * first**2]
    length = math.hypot(*velocity) * first + 9.81 / 2 * first**2
    assert path.landing.position == pytest.approx(right, abs=closed_form(1e4) * length)
    assert path.evaluations == 0


@every_air
@pytest.mark.parametrize(("plane", "limit", "status"), [
    (kd.Plane((5, 0, 0), (-1, 0, 0)), 9.0, "at-plane"),
    (kd.Plane((500, 0, 0), (-1, 0, 0)), 9.0, "landed"),
    (kd.Plane((500, 0, 0), (-1, 0, 0)), 0.1, "aloft"),
    (kd.Plane((-5, 0, 0), (1, 0, 0)), 9.0, "landed"),
    (kd.Plane((0, 0, 9), (0, 0.1, -1)), 9.0, "landed")])  # a ceiling above it  # fmt: skip
def test_a_flight_ends_at_the_first_of_plane_ground_and_time_limit(air, plane, limit, status):
    path = kd.fly(launch((25, 0, 8)), BALL, air, plane=plane, time_limit=limit)
    assert path.status == status


@every_air
@pytest.mark.parametrize(("velocity", "normal", "status"), [
    ((5, 0, 9), (-1, 0, 0), "at-plane"),  # into a wall
    ((-5, 0, 9), (-1, 0, 0), "landed"),  # away from it
    ((5, 0, 9), (0, 1, 0), "landed"),  # along it
    ((5, 0, 0), (0, 0, -1), "landed"),  # below a ceiling, from which weight pulls it
    ((5, 0, 0), (0, 0, 1), "at-plane"),  # on a floor, onto which weight pulls it
])  # fmt: skip
def test_a_ball_that_starts_on_a_plane_flies_only_away_from_it(air, velocity, normal, status):
    plane = kd.Plane((0, 0, 0), normal, "centre")
    path = kd.fly(launch(velocity), BALL, air, kd.Ground(-3), plane=plane)
    assert path.status == status
    assert (path.duration > 0) == (status == "landed")


def test_rolling_to_a_wall_has_a_closed_form():
    lane = kd.Ground(surface=Surface("lane", 0.0, 1.0, 0.8))
    rolling = launch((5, 2, 0), (0, 0, R), (-2 / R, 5 / R, 0))
    course = kd.follow(rolling, BALL, None, lane, plane=kd.Plane((4 + R, 0, 0), (-1, 0, 0)))
    speed = math.hypot(5, 2)
    last = math.sqrt(speed**2 - 2 * 0.8 * 4 * speed / 5)
    velocity = last / speed * np.array([5, 2, 0])
    assert (course.status, course.ground_phases[-1].kind) == ("at-plane", "roll")
    assert course.duration == pytest.approx((speed - last) / 0.8, rel=integrated(1e-9))
    agrees(course.rest.position, [4, 4 * 2 / 5, R], integrated(1e-9))
    agrees(course.rest.velocity, velocity, integrated(1e-9))
    agrees(course.rest.spin, np.array([-velocity[1], velocity[0], 0]) / R, integrated(1e-9))
