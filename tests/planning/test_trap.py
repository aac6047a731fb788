"""Balls that are trapped: left at rest, or with a wished velocity."""

import numpy as np
import pytest
from tolerances import agrees, optimized

import kickdyn as kd
from kickdyn.planning.plan_report import PlanReport

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
ASIDE = kd.BallState((1.2, 0.5, -0.2), (-2.0, -0.9, 1.0), (8.0, -17.0, 3.0))
DROPPING = kd.BallState((2.2, 0.0, -0.3), (-5.0, 0.0, 0.3), (0.0, 6.0, 0.0))


@pytest.mark.parametrize(
    ("leg", "incoming", "velocity"),
    [
        (HUMAN, ROLLING, (0.0, 0.0, 0.0)),
        (HUMAN, DROPPING, (0.5, 0.0, 0.0)),
        pytest.param(G1, ASIDE, (0.3, -0.4, 0.2), marks=pytest.mark.slow),
    ],
    ids=["rolling", "dropping", "aside"],
)
def test_a_trapped_ball_has_the_wished_velocity(leg, incoming, velocity):
    plan = kd.plan_trap(leg, incoming, BALL, AIR, velocity=velocity)
    posture = plan.leg.posture(plan.q)
    course = kd.follow(incoming, BALL, AIR, plan.meeting.ground, 1e-12)
    ball = course.sample(plan.meeting.time - incoming.time)
    normal = plan.impact.contact.normal
    assert posture.contact_point + BALL.radius * normal == pytest.approx(ball.position, abs=1e-8)
    hit = kd.strike(
        posture, plan.v, BALL, plan.impact.contact, ball_velocity=ball.velocity, ball_spin=ball.spin
    )
    assert hit.ball_after.velocity == pytest.approx(velocity, abs=1e-8)
    agrees(hit.impulse, BALL.mass * (np.array(velocity) - ball.velocity), optimized(1e-9))
    # the spin along the impulse stays, and friction takes of the other part what it can
    along = hit.impulse / np.linalg.norm(hit.impulse)
    assert hit.ball_after.spin @ along == pytest.approx(ball.spin @ along, abs=1e-7)
    remaining = np.linalg.norm(np.cross(hit.ball_after.spin, along))
    pressed = hit.impulse @ normal
    rubbed = np.linalg.norm(hit.impulse - pressed * normal)
    assert remaining < 1e-7 or rubbed == pytest.approx(0.4 * pressed, rel=1e-7)
    assert plan.velocity_error < 1e-8
    assert not plan.leg.outside_range(plan.q)


def test_a_foot_with_restitution_retreats():
    """Along the normal it has the speed n v0 + n W p / (1 + e)."""
    retreats = []
    for restitution in (0.1, 0.5, 0.9):
        contact = kd.Contact(restitution=restitution, friction=0.4)
        incoming = kd.IncomingBall(ROLLING, meet_at=5.7)
        plan = kd.plan_trap(HUMAN, incoming, BALL, AIR, contact=contact)
        n, before = plan.impact.contact.normal, plan.meeting.ball.velocity
        change = plan.impact_target.velocity_change(plan.impact.posture)
        retreats.append(float(plan.impact.foot_velocity @ n))
        assert retreats[-1] == pytest.approx(n @ before + n @ change / (1 + restitution), abs=1e-8)
    assert retreats[0] > retreats[1] > retreats[2]
    assert retreats[2] < 0.0


def test_a_leg_is_turned_to_a_ball_from_behind():
    comes = kd.BallState((-1.5, 0.0, -0.7042), (2.0, 0.0, 0.0), (0.0, 2.0 / BALL.radius, 0.0))
    plan = kd.plan_trap(HUMAN, comes, BALL, AIR)
    assert abs(plan.heading) == pytest.approx(np.pi)
    assert plan.impact.ball_after.velocity == pytest.approx(np.zeros(3), abs=1e-8)


def test_a_trap_has_no_target_and_is_planned_again():
    plan = kd.plan_trap(HUMAN, kd.IncomingBall(ROLLING, meet_at=5.7), BALL, AIR)
    report = PlanReport(plan).to_json()
    assert report["goal"] == {"velocity": [0.0, 0.0, 0.0]}
    assert report["velocity_error"] == plan.velocity_error
    assert report["meeting"]["landing_slopes"] is None
    assert "at rest" in PlanReport(plan).sentences()[0]
    for name in ("aim", "landing_error", "time_error"):
        with pytest.raises(kd.InvalidInput, match="no target"):
            getattr(plan, name)
    later = kd.follow(ROLLING, BALL, AIR, plan.meeting.ground).sample(0.04)
    again = plan.replan(
        incoming=kd.BallState(later.position, 1.002 * later.velocity, later.spin, 5.04)
    )
    assert again.impact.ball_after.velocity == pytest.approx(np.zeros(3), abs=1e-8)
    assert again.meeting.time == pytest.approx(5.7)


@pytest.mark.parametrize(
    ("state", "velocity", "words"),
    [
        (kd.BallState((0.3, 0, -0.7042)), (0, 0, 0), "already has the velocity"),
        (ROLLING, (101, 0, 0), "101.*at most 100"),
    ],
)
def test_bad_input(state, velocity, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_trap(HUMAN, state, BALL, AIR, velocity=velocity)
