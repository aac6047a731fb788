"""Passes along the ground: followed again, and the reasons why there is none."""

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.planning.passes import ACCURACY

BALL, AIR = kd.Ball(), kd.Air()


def place_at(velocity, time, spin=(0, 0, 0), surface="turf"):
    """Return where a ball on the ground is at a time, from its start [m]."""
    state = kd.BallState((0, 0, BALL.radius), velocity, spin)
    course = kd.follow(state, BALL, AIR, kd.Ground(surface=surface), 1e-11)
    return course.sample(time).position - state.position


@pytest.mark.parametrize(("angle", "spin", "surface"), [
    (0.0, (0, 0, 0), "turf"), (0.3, (0, -10, 20), "turf"), (0.0, (0, 0, 0), "carpet")])  # fmt: skip
def test_the_ball_comes_there_in_time(angle, spin, surface):
    goal = kd.Goal((6, 1, 1e-17), time=1.3, spin=spin)  # level, but for rounding
    made = kd.plan_pass(goal, BALL, AIR, angle=angle, surface=surface)
    assert made.status == "met"
    place = place_at(made.velocity, 1.3, spin, surface)
    assert place[:2] == pytest.approx([6, 1], abs=10 * ACCURACY)
    assert made.angle == pytest.approx(angle, abs=closed_form(10))
    assert abs(made.aside) <= ACCURACY


@pytest.mark.parametrize("condition", [{"time": 2.0}, {"speed": 14.0}])
def test_a_pass_meets_a_receiver_who_runs(condition):
    running = np.array([2.0, -1.0, 0.0])
    goal = kd.Goal((18.0, 4.0, 0.0), receiver_velocity=running, **condition)
    made = kd.plan_pass(goal, BALL, AIR)
    assert made.status == "met"
    place = place_at(made.velocity, made.time)
    assert place == pytest.approx(goal.target + made.time * running, abs=10 * ACCURACY)


@pytest.mark.parametrize(("goal", "speed_limit", "limit"), [
    (kd.Goal(6, time=30), 40, "rolling"), (kd.Goal(20, time=0.5), 10, "speed-limit"),
    (kd.Goal(18, speed=14), 10, "speed-limit"), (kd.Goal(18, speed=3), 40, "least-speed")
])  # fmt: skip
def test_a_pass_that_cannot_be_has_a_reason(goal, speed_limit, limit):
    made = kd.plan_pass(goal, BALL, AIR, speed_limit=speed_limit)
    assert (made.status, made.limit) == ("unreachable", limit)
    assert f"{made.time:.4g} s" in made.summary or f"{made.course.distance:.4g} m" in made.summary
    if limit == "speed-limit":
        assert made.speed == pytest.approx(speed_limit)
    if limit == "rolling":  # the slowest ball that arrives: a slower one stops before
        assert made.course.distance == pytest.approx(6, abs=1e-3)
        slower = kd.BallState((0, 0, BALL.radius), 0.999 * made.velocity)
        assert kd.follow(slower, BALL, AIR).distance < 6


@pytest.mark.parametrize(("goal", "options", "words"), [
    (6, {}, "goal is 6"), (kd.Goal(6, apex=1), {}, "apex 1.*must have a time"),
    (kd.Goal((6, 0, 1), time=1), {}, "as high as the ball"),
    (kd.Goal(6, time=1, beside=(3, 1)), {}, "no beside"),
    (kd.Goal(6, time=1), {"angle": 1.5}, "angle is 1.5"),
    (kd.Goal(6, time=1), {"speed_limit": 0}, "speed limit is 0"),
    (kd.Goal(6, time=1), {"surface": "sand"}, "'sand' is unknown")])  # fmt: skip
def test_bad_input(goal, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_pass(goal, BALL, **options)
