"""How exact perception and timing must be for a ball that moves, by differences of landings."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from tolerances import agrees

import kickdyn as kd
from kickdyn.planning.meeting import error_that_matters

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
BOUNCING = kd.BallState((2.0, 0.0, -0.4), (-4.0, 0.0, 0.5), (0.0, 6.0, 0.0), 5.0)
DIFFERENCES = 1e-5  # relative: of differences of landings, which are found by roots


def landing(plan, incoming, late=0.0):
    """Return where the ball passes the target if the foot moves straight on as planned [m]."""
    posture, velocity = plan.impact.posture, plan.impact.foot_velocity
    course = kd.follow(incoming, BALL, AIR, plan.meeting.ground, 1e-12)
    planned = plan.meeting.time - incoming.time

    def apart(t):
        foot = posture.contact_point + velocity * (t - planned - late)
        return course.sample(t).position - foot

    t = brentq(lambda t: math.hypot(*apart(t)) - BALL.radius, planned - 2e-3, planned + 2e-3,
               xtol=1e-15)  # fmt: skip
    before = course.sample(t)
    contact = kd.Contact(apart(t), plan.impact.contact.restitution, plan.impact.contact.friction)
    hit = kd.strike(
        posture, plan.v, BALL, contact, ball_velocity=before.velocity, ball_spin=before.spin
    ).ball_after
    start = kd.BallState(before.position, hit.velocity, hit.spin)
    wall = kd.Plane(plan.meeting.ball.position + plan.goal.target, -plan.goal.ahead, "centre")
    return kd.fly(start, BALL, AIR, kd.Ground(-50.0), 1e-12, plane=wall).landing.position


@pytest.mark.parametrize(("incoming", "meet_at", "goal"), [
    (ROLLING, 5.62, kd.Goal(18, time=1.2)), (BOUNCING, 5.39, kd.Goal((10, 0, 0.3), time=1.0)),
], ids=["rolling", "bouncing"])  # fmt: skip
def test_slopes_of_the_landing_are_differences_of_landings(incoming, meet_at, goal):
    h = 1e-5
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, incoming=kd.IncomingBall(incoming, meet_at=meet_at))
    assert plan.share == 1.0
    slopes = plan.meeting.landing_slopes

    def seen(place, velocity):
        return kd.BallState(
            incoming.position + place, incoming.velocity + velocity, incoming.spin, incoming.time
        )

    ends = [landing(plan, incoming, late=sign * h) for sign in (1, -1)]
    agrees(slopes.time, (ends[0] - ends[1]) / (2 * h), DIFFERENCES)
    free = 2 if incoming is ROLLING else 3  # a ball stays on the ground on which it rolls
    for axis in np.eye(3)[:free]:
        ends = [landing(plan, seen(sign * h * axis, 0 * axis)) for sign in (1, -1)]
        agrees(slopes.place @ axis, (ends[0] - ends[1]) / (2 * h), DIFFERENCES)
        ends = [landing(plan, seen(0 * axis, sign * h * axis)) for sign in (1, -1)]
        agrees(slopes.velocity @ axis, (ends[0] - ends[1]) / (2 * h), DIFFERENCES)
    timing, velocity, place = slopes.tolerances
    assert timing == pytest.approx(0.1 / np.linalg.norm(slopes.time))
    assert velocity == pytest.approx(0.1 / np.linalg.svd(slopes.velocity)[1][0])
    assert place == pytest.approx(0.1 / np.linalg.svd(slopes.place)[1][0])


def test_an_error_without_effect_is_infinite():
    """Such as of the time in which a ball at rest is met by a foot that moves along the normal."""
    assert error_that_matters(np.array([0.0, 20.0, 0.0])) == pytest.approx(0.005)
    assert error_that_matters(np.array([1e-9, 0.0, 0.0])) == math.inf
    rests = kd.BallState((0.5, 0.0, -0.7042))
    plan = kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=rests)
    timing, _, place = plan.meeting.landing_slopes.tolerances
    assert timing == math.inf
    assert 1e-4 < place < 0.01
