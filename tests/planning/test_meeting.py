"""How exact perception and timing must be for a ball that moves."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.meeting import error_that_matters

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
ASIDE = kd.BallState((1.5, 0.6, -0.58), (-2.0, -0.9, 0.0), (8.0, -17.0, 3.0))
FLYING = kd.BallState((4.0, 0.0, -0.3), (-9.0, 0.0, 1.5), (0.0, 5.0, 0.0))


def landing(plan, incoming, goal, late=0.0):
    """Where the ball passes the target if the foot moves straight on as planned."""
    posture, velocity = plan.impact.posture, plan.impact.foot_velocity
    course = kd.follow(incoming, BALL, AIR, plan.meeting.ground, 1e-12)
    planned = plan.meeting.time - incoming.time
    low, high = planned - 2e-3, planned + 2e-3
    for _ in range(80):
        t = 0.5 * (low + high)
        foot = posture.contact_point + velocity * (t - planned - late)
        apart = course.sample(t).position - foot
        low, high = (t, high) if math.hypot(*apart) > BALL.radius else (low, t)
    before = course.sample(t)
    contact = kd.Contact(apart, plan.impact.contact.restitution, plan.impact.contact.friction)
    hit = kd.strike(
        posture, plan.v, BALL, contact, ball_velocity=before.velocity, ball_spin=before.spin
    ).ball_after
    start = kd.BallState(before.position, hit.velocity, hit.spin)
    wall = kd.Plane(plan.meeting.ball.position + plan.goal.target, -plan.goal.ahead, "centre")
    path = kd.fly(start, BALL, AIR, kd.Ground(-50.0), 1e-12, plane=wall)
    return path.landing.position


def test_derivatives_of_the_landing():
    goal, h = kd.Goal((4, 1, 0), time=0.8), 2e-6
    plan = kd.plan_kick(G1, goal, BALL, AIR, incoming=ASIDE)
    slopes = plan.meeting.landing_slopes

    def moved(place, velocity):
        return kd.BallState(ASIDE.position + place, ASIDE.velocity + velocity, ASIDE.spin)

    late = [landing(plan, ASIDE, goal, late=sign * h) for sign in (1, -1)]
    difference = (late[0] - late[1]) / (2 * h)
    assert slopes.time == pytest.approx(difference, abs=1e-6 * np.abs(difference).max())
    for axis in np.eye(3)[:2]:
        for kind, rows in ((0, slopes.place), (1, slopes.velocity)):
            ends = [
                landing(plan, moved(*((sign * h * axis, 0 * axis)[:: 1 - 2 * kind])), goal)
                for sign in (1, -1)
            ]
            difference = (ends[0] - ends[1]) / (2 * h)
            size = np.abs(difference).max()
            assert rows @ axis == pytest.approx(difference, abs=1e-6 * size)
    assert slopes.tolerances[0] == pytest.approx(0.1 / np.linalg.norm(slopes.time))


def test_an_error_without_effect_is_infinite():
    """Such as of the time in which a ball at rest is met by a foot that moves along the normal."""
    assert error_that_matters(np.array([0.0, 20.0, 0.0])) == pytest.approx(0.005)
    assert error_that_matters(np.array([1e-9, 0.0, 0.0])) == math.inf
    rests = kd.BallState((0.5, 0.0, -0.7042))
    plan = kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=rests)
    timing, _, place = plan.meeting.landing_slopes.tolerances
    assert timing == math.inf
    assert 1e-4 < place < 0.01


def test_the_picture_of_the_meetings():
    plan = kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=ROLLING)
    left, right, _ = plan.plot().axes
    kicks = [meeting.time for meeting in plan.meetings if meeting.impact is not None]
    assert left.lines[1].get_xdata().tolist() == kicks
    ends = [line.get_xydata()[-1] for line in right.lines[1:]]
    assert [math.hypot(*end) for end in ends] == pytest.approx([10.0] * len(ends), rel=2e-2)
    late = plan.meeting.landing_slopes.tolerances[0]
    assert right.lines[1].get_label() == f"foot {1e3 * late:.2g} ms late"
    with pytest.raises(kd.InvalidInput, match="nothing to plot"):
        kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, AIR).plot()
