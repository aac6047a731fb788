"""Balls that move before they are kicked."""

import math
import pickle

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.intercepting_kick import KickSettings
from kickdyn.planning.kick_problem import SOLVERS
from kickdyn.planning.moving_kick import Interceptor
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.plan_report import PlanReport

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


@pytest.mark.parametrize(
    ("leg", "hip", "ball", "goal"),
    [
        (
            G1, (1.5, -0.4, 0.2), kd.BallState((0.35, 0.08, -0.5), (-2.0, 0.6, 1.0)),
            kd.Goal((4.0, 1.0, 0.2), time=0.8, spin=(3.0, -5.0, 2.0)),
        ),
        (
            G1, (1.1, 0.3, 0.0), kd.BallState((0.4, -0.08, -0.6), (-3.0, 0.3, 0.5), (2, 9, 1)),
            kd.Goal((6.0, 0.5, 0.2), time=0.8),
        ),
        (
            HUMAN, (2.0, 0.0, 0.2), kd.BallState((0.5, 0.0, -0.7), (-3.0, 0.0, 0.5)),
            kd.Goal((15.0, 0.0, 0.2), time=0.8),
        ),
    ],
    ids=["g1", "g1 spinning", "human"],
)  # fmt: skip
def test_a_plan_is_the_same_in_a_frame_that_moves_with_the_hip(leg, hip, ball, goal):
    """In a vacuum, where nothing tells the frames apart."""
    hip = np.array(hip)
    there = kd.Goal(goal.target - hip * goal.time, time=goal.time, spin=goal.spin)
    seen = kd.BallState(ball.position, ball.velocity - hip, ball.spin)
    here, other = (
        kd.plan_kick(moved, aim, BALL, incoming=kd.IncomingBall(state, meet_at=0.0))
        for moved, aim, state in ((leg.with_base_velocity(hip), goal, ball), (leg, there, seen))
    )
    assert here.share == other.share == 1.0
    assert here.q == pytest.approx(other.q, abs=1e-11)
    assert here.v == pytest.approx(other.v, abs=1e-11)
    assert here.launch.velocity == pytest.approx(other.launch.velocity + hip, abs=1e-11)
    after = other.impact.ball_after.velocity + hip
    assert here.impact.ball_after.velocity == pytest.approx(after, abs=1e-11)
    assert here.impact.ball_after.spin == pytest.approx(other.impact.ball_after.spin, abs=1e-11)
    assert here.impact.impulse == pytest.approx(other.impact.impulse, abs=1e-11)
    assert here.impact.worst_joint[1] == pytest.approx(other.impact.worst_joint[1], abs=1e-11)


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


def test_a_ball_that_no_posture_touches_is_refused_at_once(monkeypatch):
    """It passes within the reach of the hip, but too far aside of the foot on the ground."""
    starts, solve = [], SOLVERS["slsqp"]
    monkeypatch.setitem(SOLVERS, "slsqp", lambda *args: starts.append(args) or solve(*args))
    beside = kd.BallState((0.55, -1.0, -0.6825), (0.0, 1.5, 0.0))
    with pytest.raises(kd.InvalidInput, match=r"no posture in which its foot touches the ball at"):
        kd.plan_kick(G1, kd.Goal((5, 0, 0), time=0.8), BALL, AIR, incoming=beside)
    assert len(starts) == 4


def test_wrong_balls_are_refused():
    with pytest.raises(kd.InvalidInput, match="speed of the incoming ball is 101"):
        kd.IncomingBall(kd.BallState(velocity=(101, 0, 0)))
    with pytest.raises(kd.InvalidInput, match=r"must be finite \[s, of a place m\]"):
        kd.IncomingBall(ROLLING, meet_at=(math.nan, 0, 0))
    with pytest.raises(kd.InvalidInput, match="several states"):
        kd.IncomingBall(kd.BallState(velocity=[(1, 0, 0)] * 2))
    with pytest.raises(kd.InvalidInput, match="meet_at is 1 s: it must be at least 5 s"):
        kd.IncomingBall(ROLLING, meet_at=1.0)
    with pytest.raises(kd.InvalidInput, match=r"at most 8\.\d+ s, when the ball comes to rest"):
        kd.plan_trap(HUMAN, kd.IncomingBall(ROLLING, meet_at=14.0), BALL, AIR)
    for other in ({"motion": True}, {"ball_position": -0.7}):
        with pytest.raises(kd.InvalidInput, match="exclude each other"):
            kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, AIR, incoming=ROLLING, **other)
    with pytest.raises(kd.InvalidInput, match="the plan is for a ball at rest"):
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


def test_a_plan_beyond_limits_says_what_is_reached():
    goal = kd.Goal(45, time=1.2)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, incoming=ROLLING)
    before, after = plan.meeting.ball.velocity, plan.impact.ball_after
    assert 0.3 < plan.share < 1.0
    # the share is of the change of velocity, and the ball leaves with what that gives
    assert after.velocity == pytest.approx(before + plan.share * (plan.launch.velocity - before))
    kicks = [meeting for meeting in plan.meetings if meeting.impact is not None]
    assert plan.share == max(meeting.share for meeting in kicks)
    report = PlanReport(plan)
    verdict, meeting = report.sentences()[:2]
    assert f"{plan.share:.0%} of the change of velocity" in verdict
    assert f"{after.speed:.3g} m/s in place of {plan.launch.speed:.3g} m/s" in verdict
    heads = {line[:8].strip(): line for line in report.table()}
    assert f"{after.speed:.4f} m/s" in heads["reached"]
    assert f"{plan.launch.speed:.4f} m/s" in heads["wished"]
    # the target stays where it is in the world
    assert plan.target_position == pytest.approx(ROLLING.position + goal.target, abs=1e-9)
    assert "the target (47, 0, -0.7042) m in the world frame" in verdict
    assert "m from the target (45 m from where it was seen)" in meeting


def test_a_ball_that_is_kicked_downwards_flies_to_its_ground():
    seen = kd.BallState((2.0, 0.0, -0.3), (-2.5, 0.0, -5.0))
    plan = kd.plan_kick(HUMAN, kd.Goal((45, 0, 2.0), time=1.2), BALL, AIR, incoming=seen)
    assert plan.share < 1.0
    assert plan.path.duration > 0.1
    assert plan.path.landing.position[2] == pytest.approx(plan.meeting.ground.height + BALL.radius)


@pytest.mark.parametrize("aside", [0.0, 1e-3])
def test_a_lift_with_an_infinite_slope(aside):
    """Of a ball that rolls head-on, nothing but rounding of the spin is along the impulse."""
    air = kd.Air(lift="wang")
    velocity, spin = (-2.0, aside, 0.0), (-aside / BALL.radius, -2.0 / BALL.radius, 0.0)
    seen = kd.BallState((1.5, 0.0, -0.6825), velocity, spin)
    leg, goal = (G1, kd.Goal((4, -0.1, 0), time=0.8)) if aside else (HUMAN, kd.Goal(18, time=1.2))
    plan = kd.plan_kick(leg, goal, BALL, air, incoming=seen)
    assert plan.status == "met"
    assert plan.landing_error < 1e-5


def test_a_ball_in_the_ground_is_refused():
    deep = kd.IncomingBall(ROLLING, kd.Ground(-0.7, "turf"))
    with pytest.raises(kd.InvalidInput, match=r"is 0\.114 m in the ground: .* at least at -0\.59"):
        kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=deep)


def test_a_leg_is_turned_to_a_ball_from_behind():
    comes = kd.BallState((-1.5, 0.0, -0.7042), (2.0, 0.0, 0.0), (0.0, 2.0 / BALL.radius, 0.0))
    plan = kd.plan_trap(HUMAN, comes, BALL, AIR)
    assert abs(math.degrees(plan.heading)) == pytest.approx(180.0)
    assert plan.impact.ball_after.velocity == pytest.approx(np.zeros(3), abs=1e-9)
    rolls_off = kd.BallState((0.3, 0.0, -0.7042), (20.0, 0.0, 0.0))
    message = r"along the change of the ball's velocity, .* seen; the ball is fa"
    with pytest.raises(kd.InvalidInput, match=message):
        kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=rolls_off)


def test_a_meeting_out_of_reach_is_named():
    early = kd.IncomingBall(ROLLING, meet_at=5.3)
    with pytest.raises(kd.InvalidInput, match=r"out of reach at meet_at: it is then, 0\.3 s after"):
        kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=early)


def test_a_fast_ball_is_not_missed_between_samples():
    """It is within reach and before the leg for 10 ms, of the 10 s for which it is followed."""
    fast = kd.BallState((2.0, 0.0, -0.5), (-90.0, 0.0, 0.0))
    plan = kd.plan_trap(HUMAN, fast, BALL, AIR, limits=False)
    assert plan.status == "met"
    assert 0.01 < plan.meeting.time < 0.024
    assert len(plan.meetings) > 3


def test_where_a_ball_is_and_how_it_moves_away():
    settings = KickSettings(
        kd.Goal((9, 1, 0), time=0.9), BALL, AIR, kd.Contact(), KickObjective.JOINT_SPEED,
        True, None, "slsqp",
    )  # fmt: skip
    fast = kd.BallState((0.4, -0.2, -0.6), (18.0, 3.0, 1.0))
    slow = kd.BallState((0.4, -0.2, -0.6), (3.0, 2.5, 3.0))
    for ball, text in (
        (ASIDE, ""),
        (
            fast,
            "; the ball is faster than its launch must be, {ahead:.3g} m/s in place of "
            "{speed:.3g} m/s in its direction, so that the foot has to brake it from ahead",
        ),
        (slow, "; the ball moves away from the foot at {away:.3g} m/s"),
    ):
        incoming = kd.IncomingBall(ball, kd.Ground(-1.0, surface="turf"))
        balls = Interceptor(HUMAN, settings, incoming)
        kick = balls.at(0.1)
        impulse = kick.launch.velocity - kick.before.velocity
        across = np.array([-impulse[1], impulse[0], 0.0]) / np.hypot(*impulse[:2])
        left = float(kick.before.position @ across)
        assert balls.beside(0.1) == pytest.approx(left)
        assert abs(left) > 0.05
        velocity, wish = kick.before.velocity, kick.launch.velocity
        away, speed = velocity @ impulse / np.linalg.norm(impulse), np.linalg.norm(wish)
        expected = text.format(away=away, speed=speed, ahead=velocity @ wish / speed)
        assert balls.escaping(0.1) == expected
