"""How exact perception and timing must be, and the scatter of landings, by differences."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from tolerances import agrees, closed_form, differenced, integrated

import kickdyn as kd
from kickdyn.planning.meeting import error_that_matters
from kickdyn.planning.scatter import scatter

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


LEG, BRAZUCA = kd.Leg.from_robot("g1", legs_only=True), kd.Air(drag="brazuca")
SMALL = {"speed": 2e-3, "angle": 1e-3, "contact": 1e-4, "restitution": 2e-3}
BENT = LEG.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.6})


def struck(friction):
    """Return a strike whose foot sticks or slips, and whose ball flies up with spin."""
    posture = LEG.posture(BENT)
    v = posture.joint_velocity((7.0, 1.0, 3.0))
    return kd.strike(posture, v, BALL, kd.Contact((0.92, 0.1, 0.25), 0.7, friction))


def across(direction):
    """Return the directions upwards and to the left, across one."""
    along = direction / np.linalg.norm(direction)
    left = np.cross((0, 0, 1.0), along) / np.linalg.norm(along[:2])
    return np.array([np.cross(along, left), left])


def ball_of(hit, speed=0.0, angle=(0, 0), contact=(0, 0), restitution=0.0):
    """Return the ball of a strike with errors of its sources."""
    foot, normal = hit.foot_velocity, hit.contact.normal
    change = foot * speed + np.linalg.norm(foot) * np.asarray(angle) @ across(foot)
    turned = normal - np.asarray(contact) @ across(normal) / BALL.radius
    law = kd.Contact(turned, hit.contact.restitution + restitution, hit.contact.friction)
    v = hit.v_before + hit.posture.joint_velocity(change)
    return kd.strike(hit.posture, v, BALL, law).ball_after


@pytest.mark.parametrize("friction", [0.4, 0.02], ids=["sticks", "slips"])
@pytest.mark.parametrize("source", SMALL)
def test_the_covariance_of_a_source_is_that_of_differences_of_landings(source, friction):
    hit, h = struck(friction), 1e-4 * BALL.radius
    assert hit.sticking == (friction == 0.4)
    result, slopes = scatter(hit, BRAZUCA, **{source: SMALL[source]}), []
    for step in [[h]] if source in ("speed", "restitution") else [[h, 0], [0, h]]:
        both = [sign * np.array(step) for sign in (1, -1)]
        balls = [ball_of(hit, **{source: e if e.size == 2 else float(e[0])}) for e in both]
        ends = [
            kd.fly(ball, BALL, BRAZUCA, tol=1e-12).landing.position - ball.position
            for ball in balls
        ]
        slopes.append((ends[0] - ends[1])[:2] / (2 * h))
    expected = SMALL[source] ** 2 * sum(np.outer(slope, slope) for slope in slopes)
    agrees(result.covariance, expected, 100 * differenced())
    agrees(result.by_source[source], result.covariance, closed_form())


def test_the_covariances_of_independent_sources_add_up():
    hit = struck(0.4)
    result = scatter(hit, BRAZUCA, **SMALL, drag=0.02)
    alone = [
        scatter(hit, BRAZUCA, **{name: size}) for name, size in {**SMALL, "drag": 0.02}.items()
    ]
    agrees(result.covariance, sum(one.covariance for one in alone), closed_form(10))
    assert result.radius == pytest.approx(math.sqrt(sum(one.radius**2 for one in alone)))
    landing = kd.fly(hit.ball_after, BALL, BRAZUCA, tol=1e-12).landing.position
    agrees(result.mean, landing[:2] - hit.ball_after.position[:2], integrated(1e-10))
