import math
import pickle

import numpy as np
import pytest

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()


@pytest.mark.parametrize(("angle", "spin"), [(0.0, (0, 0, 0)), (0.3, (0, -10, 20))])
def test_the_ball_comes_there_in_time(angle, spin):
    found = kd.plan_pass(kd.Goal((6, 1, 0), time=1.3, spin=spin), BALL, AIR, angle=angle)
    assert found.status == "met"
    ground = kd.Ground(surface="turf")
    state = kd.BallState((0, 0, BALL.radius), found.velocity, spin)
    course = kd.follow(state, BALL, AIR, ground, 1e-11)
    at = course.sample(1.3)
    ahead = np.array([6, 1, 0]) / math.hypot(6, 1)
    assert float(ahead @ at.position) == pytest.approx(math.hypot(6, 1), abs=1e-5)
    assert abs(found.aside) < 1e-6
    assert math.atan2(found.velocity[2], math.hypot(*found.velocity[:2])) == pytest.approx(angle)


def test_too_slow_a_pass_stops_before():
    found = kd.plan_pass(kd.Goal(6, time=30), BALL)
    assert (found.status, found.limit) == ("unreachable", "rolling")
    assert found.summary == (
        f"a slower ball stops before the target; the nearest is {found.time:.4g} s"
    )
    slower = kd.BallState((0, 0, BALL.radius), 0.999 * found.velocity)
    assert kd.follow(slower, BALL).distance < 6


def test_too_fast_a_pass_names_the_speed_limit():
    found = kd.plan_pass(kd.Goal(20, time=0.5), BALL, AIR, speed_limit=10)
    assert (found.status, found.limit) == ("unreachable", "speed-limit")
    assert math.hypot(*found.velocity) == pytest.approx(10)
    assert found.time > 0.5


@pytest.mark.parametrize(
    ("goal", "options", "words"),
    [
        (6, {}, "goal is 6: it must be a kickdyn.Goal"),
        (kd.Goal(6, apex=1), {}, "must have a time"),
        (kd.Goal((6, 0, 1), time=1), {}, "a target as high as the ball"),
        (kd.Goal(6, time=1), {"angle": 1.5}, "angle is 1.5"),
        (kd.Goal(6, time=1), {"speed_limit": 0}, "speed limit is 0"),
        (kd.Goal(6, time=1), {"surface": "sand"}, "'sand' is unknown"),
    ],
)
def test_bad_input(goal, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_pass(goal, BALL, **options)


def test_a_pass_can_be_pickled():
    found = kd.plan_pass(kd.Goal((6, 1, 0), time=1.3), BALL, AIR)
    again = pickle.loads(pickle.dumps(found))
    assert (again.status, again.aside) == (found.status, found.aside)
    assert again.course.sample(0.7).position.tolist() == found.course.sample(0.7).position.tolist()


@pytest.mark.parametrize("condition", [{"time": 2.0}, {"speed": 14.0}])
def test_a_pass_meets_a_receiver_who_runs(condition):
    ball, air, running = kd.Ball(), kd.Air(), np.array([2.0, -1.0, 0.0])
    goal = kd.Goal((18.0, 4.0, 0.0), receiver_velocity=running, **condition)
    made = kd.plan_pass(goal, ball, air)
    assert made.status == "met"
    start = kd.BallState((0, 0, ball.radius), made.velocity)
    course = kd.follow(start, ball, air, kd.Ground(surface="turf"), 1e-10)
    met = course.sample(made.time).position - start.position
    assert met == pytest.approx(goal.target + made.time * running, abs=1e-5)


def test_a_pass_of_a_speed_without_a_time():
    made = kd.plan_pass(kd.Goal((18.0, 4.0, 0.0), speed=14.0), kd.Ball(), kd.Air())
    timed = kd.plan_pass(kd.Goal((18.0, 4.0, 0.0), time=made.time), kd.Ball(), kd.Air())
    assert timed.velocity == pytest.approx(made.velocity, abs=1e-6)
    slow = kd.plan_pass(kd.Goal(18.0, speed=3.0), kd.Ball(), kd.Air())
    assert (slow.status, slow.limit) == ("unreachable", "least-speed")
    fast = kd.plan_pass(kd.Goal(18.0, speed=14.0), kd.Ball(), kd.Air(), speed_limit=10.0)
    assert (fast.status, fast.limit) == ("unreachable", "speed-limit")


@pytest.mark.parametrize(
    ("speed", "end"), [(14.0, "nearest is {:.4g} s"), (4.0, "farthest is {:.4g} m")]
)
def test_a_time_that_bounces_skip(speed, end, monkeypatch):
    """No speed between those of which one arrives before and one after the time has it."""
    monkeypatch.setattr("kickdyn.planning.passes._solve_speed", lambda delay, limit: (speed, None))
    missed = kd.plan_pass(kd.Goal(20, time=2.4), BALL, AIR)
    assert (missed.status, missed.limit) == ("unreachable", "bounce")
    amount = missed.time if speed == 14.0 else missed.course.distance
    assert missed.summary == (
        f"the place where the ball bounces jumps as its speed changes; the {end.format(amount)}"
    )
