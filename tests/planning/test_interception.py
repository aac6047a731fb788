"""Balls that move before they are kicked."""

import math
import pickle

import numpy as np
import pytest

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
ASIDE = kd.BallState((1.5, 0.6, -0.58), (-2.0, -0.9, 0.0), (8.0, -17.0, 3.0))
FLYING = kd.BallState((4.0, 0.0, -0.3), (-9.0, 0.0, 1.5), (0.0, 5.0, 0.0))


def check(plan, leg, goal, incoming):
    """Follow, strike and fly again, by the public names only."""
    meeting, posture = plan.meeting, plan.leg.posture(plan.q)
    course = kd.follow(incoming, BALL, AIR, meeting.ground, 1e-12)
    wait = meeting.time - incoming.time
    ball = course.sample(wait)
    normal = plan.impact.contact.normal
    touching = posture.contact_point + BALL.radius * normal
    assert touching == pytest.approx(ball.position, abs=1e-9)
    hit = kd.strike(
        posture, plan.v, BALL, plan.impact.contact, ball_velocity=ball.velocity, ball_spin=ball.spin
    )
    assert hit.sticking or not hit.contact.friction
    assert hit.ball_after.velocity == pytest.approx(plan.launch.velocity, abs=1e-9)
    assert hit.ball_after.spin == pytest.approx(plan.launch.spin, abs=1e-8)
    assert hit.impulse == pytest.approx(
        BALL.mass * (plan.launch.velocity - ball.velocity), abs=1e-9
    )
    wall = kd.Plane(incoming.position + goal.target, -goal.ahead, "centre")
    path = kd.fly(hit.ball_after, BALL, AIR, kd.Ground(-20.0), 1e-12, plane=wall)
    assert path.landing.position == pytest.approx(incoming.position + goal.target, abs=1e-6)
    assert path.duration == pytest.approx(goal.time, abs=1e-7)
    assert (plan.q >= leg.lower).all()
    assert (plan.q <= leg.upper).all()
    assert plan.speed_use <= 1.0


@pytest.mark.parametrize(
    ("leg", "goal", "incoming"),
    [
        (HUMAN, kd.Goal(18, time=1.2), ROLLING),
        (G1, kd.Goal((4, 1, 0), time=0.8), ASIDE),
        (HUMAN, kd.Goal((10, 0, 0.3), time=1.0), FLYING),
    ],
    ids=["rolling", "aside", "flying"],
)
def test_the_ball_is_met_where_it_comes(leg, goal, incoming):
    plan = kd.plan_kick(leg, goal, BALL, AIR, incoming=incoming)
    check(plan, leg, goal, incoming)
    kicks = [meeting for meeting in plan.meetings if meeting.share == 1.0]
    assert plan.speed_use == min(meeting.speed_use for meeting in kicks if not meeting.reason)
    assert all(meeting.reason for meeting in plan.meetings if meeting.impact is None)
    copied = pickle.loads(pickle.dumps(plan))
    assert copied.meeting.time == plan.meeting.time


def test_a_plan_is_the_same_in_a_frame_that_moves_with_the_hip():
    """In a vacuum, where nothing tells the frames apart."""
    hip, ball = np.array([1.5, -0.4, 0.2]), kd.BallState((0.35, 0.08, -0.5), (-2.0, 0.6, 1.0))
    goal = kd.Goal((4.0, 1.0, 0.2), time=0.8, spin=(3.0, -5.0, 2.0))
    there = kd.Goal(goal.target - hip * goal.time, time=goal.time, spin=goal.spin)
    seen = kd.BallState(ball.position, ball.velocity - hip)
    plans = [
        kd.plan_kick(leg, aim, BALL, incoming=kd.IncomingBall(state, meet_at=0.0))
        for leg, aim, state in ((G1.with_base_velocity(hip), goal, ball), (G1, there, seen))
    ]
    assert plans[0].q == pytest.approx(plans[1].q, abs=1e-11)
    assert plans[0].v == pytest.approx(plans[1].v, abs=1e-8)  # of the solver
    after = plans[1].impact.ball_after.velocity + hip
    assert plans[0].impact.ball_after.velocity == pytest.approx(after, abs=1e-11)
    assert plans[0].impact.impulse == pytest.approx(plans[1].impact.impulse, abs=1e-11)


@pytest.mark.parametrize(("leg", "incoming"), [(HUMAN, ROLLING), (G1, ASIDE)], ids=["human", "g1"])
def test_a_ball_that_is_seen_again(leg, incoming):
    goal = kd.Goal(18, time=1.2) if leg is HUMAN else kd.Goal((4, 1, 0), time=0.8)
    plan = kd.plan_kick(leg, goal, BALL, AIR, incoming=incoming)
    later = kd.follow(incoming, BALL, AIR, plan.meeting.ground).sample(0.02)
    seen = kd.BallState(
        later.position + 0.004 * np.eye(3)[0],
        later.velocity * 1.004,
        later.spin,
        incoming.time + 0.02,
    )
    again = plan.replan(incoming=seen)
    assert again.meeting.time == pytest.approx(plan.meeting.time, abs=1e-12)
    assert np.abs(again.q - plan.q).max() < 0.1
    check(again, leg, goal.seen_from(seen.position - incoming.position, 0.02), seen)
    with pytest.raises(kd.InvalidInput, match="it must be at least"):
        plan.replan(incoming=kd.BallState(later.position, later.velocity, time=99.0))


def test_the_meeting_can_be_chosen():
    goal = kd.Goal((4, 1, 0), time=0.8)
    plan = kd.plan_kick(G1, goal, BALL, AIR, incoming=ASIDE)
    kicks = [meeting for meeting in plan.meetings if meeting.share == 1.0]
    other = next(meeting.ball for meeting in kicks if meeting.time != plan.meeting.time)
    for wish in (other.time, other.position):
        chosen = kd.IncomingBall(ASIDE, meet_at=wish)
        made = kd.plan_kick(G1, goal, BALL, AIR, incoming=chosen)
        assert made.meeting.time == pytest.approx(other.time, abs=1e-6)


@pytest.mark.parametrize(
    ("leg", "incoming", "message"),
    [
        (HUMAN, kd.BallState((5, 0, -0.7), (3, 0, 0)), r"never comes within reach: .* nearest"),
        (G1, kd.IncomingBall(ASIDE, meet_at=(1, 2, 3)), r"passes it at a distance of"),
        (HUMAN, kd.BallState((0.4, -0.3, -0.5), (0, 0.6, 0)), "leaves the plane|does not cross it"),
        (HUMAN, kd.BallState((0.3, 0, -0.7), (20, 0, 0)), "moves away from the foot at"),
    ],
)
def test_a_ball_that_cannot_be_met(leg, incoming, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.plan_kick(leg, kd.Goal(14, time=0.6), BALL, AIR, incoming=incoming)


def test_wrong_balls_are_refused():
    with pytest.raises(kd.InvalidInput, match="speed of the incoming ball is 101"):
        kd.IncomingBall(kd.BallState(velocity=(101, 0, 0)))
    with pytest.raises(kd.InvalidInput, match="every entry must be finite"):
        kd.IncomingBall(ROLLING, meet_at=(math.nan, 0, 0))
    with pytest.raises(kd.InvalidInput, match="several states"):
        kd.IncomingBall(kd.BallState(velocity=[(1, 0, 0)] * 2))
    with pytest.raises(kd.InvalidInput, match="meet_at is 1 s: it must be at least 5 s"):
        kd.IncomingBall(ROLLING, meet_at=1.0)
    for other in ({"motion": True}, {"ball_position": -0.7}):
        with pytest.raises(kd.InvalidInput, match="exclude each other"):
            kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, AIR, incoming=ROLLING, **other)
    with pytest.raises(kd.InvalidInput, match="the plan is of a ball at rest"):
        kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, AIR).replan(incoming=ROLLING)


def test_a_meeting_in_which_bodies_collide_is_not_preferred():
    """The cheaper meetings with this ball have the toe in the ground."""
    plan = kd.plan_kick(HUMAN, kd.Goal((16, 0, 0.9), time=1.1), BALL, AIR, incoming=ROLLING)
    assert plan.status == "met"
    cheaper = [meeting for meeting in plan.meetings if meeting.speed_use < plan.speed_use]
    assert cheaper
    assert all("under the ground" in meeting.reason for meeting in cheaper)
    for meeting in cheaper[:1]:
        there = kd.IncomingBall(ROLLING, meet_at=meeting.time)
        other = kd.plan_kick(HUMAN, kd.Goal((16, 0, 0.9), time=1.1), BALL, AIR, incoming=there)
        assert other.status == "collides"
