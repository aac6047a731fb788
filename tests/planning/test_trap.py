"""Balls that are trapped: left at rest, or with a wished velocity."""

import numpy as np
import pytest

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
        (G1, ASIDE, (0.0, 0.0, 0.0)),
        (G1, ASIDE, (0.3, -0.4, 0.2)),
    ],
    ids=["rolling", "dropping", "aside", "slow"],
)
def test_a_trapped_ball_has_the_wished_velocity(leg, incoming, velocity):
    plan = kd.plan_trap(leg, incoming, BALL, AIR, velocity=velocity)
    posture, before = plan.leg.posture(plan.q), plan.meeting.ball
    course = kd.follow(incoming, BALL, AIR, plan.meeting.ground, 1e-12)
    ball = course.sample(plan.meeting.time - incoming.time)
    normal = plan.impact.contact.normal
    assert posture.contact_point + BALL.radius * normal == pytest.approx(ball.position, abs=1e-9)
    hit = kd.strike(
        posture, plan.v, BALL, plan.impact.contact, ball_velocity=ball.velocity, ball_spin=ball.spin
    )
    assert hit.ball_after.velocity == pytest.approx(velocity, abs=1e-9)
    assert hit.impulse == pytest.approx(BALL.mass * (velocity - ball.velocity), abs=1e-9)
    # the spin along the impulse stays, and friction takes of the rest what it can
    along = hit.impulse / np.linalg.norm(hit.impulse)
    assert hit.ball_after.spin @ along == pytest.approx(before.spin @ along, abs=1e-9)
    left = np.linalg.norm(hit.ball_after.spin - (hit.ball_after.spin @ along) * along)
    pressed = hit.impulse @ normal
    rubbed = np.linalg.norm(hit.impulse - pressed * normal)
    assert left < 1e-9 or rubbed == pytest.approx(0.4 * pressed, rel=1e-8)
    assert plan.velocity_error < 1e-9
    assert plan.path.launch.velocity == pytest.approx(velocity, abs=1e-9)


def test_a_foot_with_restitution_retreats():
    retreats = []
    for restitution in (0.1, 0.5, 0.9):
        contact = kd.Contact(restitution=restitution, friction=0.4)
        come = kd.IncomingBall(ROLLING, meet_at=5.7)
        plan = kd.plan_trap(HUMAN, come, BALL, AIR, contact=contact)
        n, before = plan.impact.contact.normal, plan.meeting.ball.velocity
        retreats.append(float(plan.impact.foot_velocity @ n))
        rigid = (n @ before) + n @ plan.impact_target.velocity_change(plan.impact.posture) / (
            1 + restitution
        )
        assert retreats[-1] == pytest.approx(rigid, abs=1e-9)
    assert retreats[0] > retreats[1] > retreats[2]
    assert retreats[2] < 0.0


def test_the_report_of_a_trap(tmp_path):
    plan = kd.plan_trap(HUMAN, ROLLING, BALL, AIR)
    report = PlanReport(plan)
    assert report.sentences()[0].startswith("The foot leaves the ball at rest, with a spin of")
    assert report.table()[0] == "ball    (0.0000, 0.0000, 0.0000) m/s after the contact"
    document = report.to_json()
    assert document["goal"] == {"velocity": [0.0, 0.0, 0.0]}
    assert document["velocity_error"] < 1e-9
    assert document["meeting"]["landing_slopes"] is None
    assert "velocity error" in str(plan)
    for name in ("aim", "landing_error", "time_error"):
        with pytest.raises(kd.InvalidInput, match="the plan is a trap: it has no target"):
            getattr(plan, name)
    later = kd.follow(ROLLING, BALL, AIR, plan.meeting.ground).sample(0.04)
    seen = kd.BallState(later.position, 1.002 * later.velocity, later.spin, 5.04)
    again = plan.replan(incoming=seen)
    assert again.impact.ball_after.velocity == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_ball_that_already_moves_so_is_refused():
    with pytest.raises(kd.InvalidInput, match="already has the velocity"):
        kd.plan_trap(HUMAN, kd.BallState((0.3, 0, -0.7042)), BALL, AIR)
    with pytest.raises(kd.InvalidInput, match=r"speed after the contact is 101.*at most 100"):
        kd.plan_trap(HUMAN, ROLLING, BALL, AIR, velocity=(101, 0, 0))
