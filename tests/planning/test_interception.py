"""Where and when balls are met."""

import pytest

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
ASIDE = kd.BallState((1.2, 0.5, -0.2), (-2.0, -0.9, 1.0), (8.0, -17.0, 3.0))
DROPPING = kd.BallState((2.2, 0.0, -0.3), (-5.0, 0.0, 0.3), (0.0, 6.0, 0.0))


def test_a_ball_behind_the_leg_is_not_met():
    plan = kd.plan_trap(HUMAN, ROLLING, BALL, AIR)
    assert all(meeting.ball.position[0] > -BALL.radius for meeting in plan.meetings)
    for leg, goal in ((HUMAN, kd.Goal(18, time=1.2)), (G1, kd.Goal((6, 1, 0), time=0.9))):
        late = kd.IncomingBall(ROLLING, meet_at=6.2)
        with pytest.raises(kd.InvalidInput, match=r"only behind the leg: it is 0\.\d+ m behind"):
            kd.plan_kick(leg, goal, BALL, AIR, incoming=late)
    overtakes = kd.BallState((-0.7, 0.0, -0.7042), (0.4, 0.0, 0.0), (0.0, 0.4 / BALL.radius, 0.0))
    with pytest.raises(kd.InvalidInput, match="only behind the leg"):
        kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=overtakes)


def test_a_half_volley():
    """The ball is met 20 ms after its bounce."""
    ground = kd.Ground(-0.82, "turf")
    bounce = kd.follow(DROPPING, BALL, AIR, ground, 1e-12).bounces[0]
    goal = kd.Goal((10.0, 0.0, 0.6), time=0.9)
    incoming = kd.IncomingBall(DROPPING, ground, bounce.time + 0.02)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, incoming=incoming)
    assert plan.status == "met"
    assert plan.meeting.ball.velocity[2] > 1.0
    end = plan.path.landing.position
    assert end == pytest.approx(DROPPING.position + goal.target, abs=1e-6)
