"""Where and when balls are met."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.interception import reach_of, waits_in_reach
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.kicking_chain import rest_configuration

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
        with pytest.raises(kd.InvalidInput, match=r"behind the leg at meet_at: it is 0\.\d+ m"):
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


def test_the_default_ground_of_a_flying_ball_is_under_the_leg_and_beside_it():
    """It is under the foot of the straight leg, or under the other foot of the robot, or lower."""
    toe, ankle = (leg.posture(leg.configuration()).contact_point[2] for leg in (HUMAN, G1))
    ground = kd.IncomingBall(DROPPING).on_ground_of(HUMAN, BALL).ground
    assert ground == kd.Ground(toe, "turf")
    ground = kd.IncomingBall(DROPPING).on_ground_of(G1, BALL).ground
    rest = rest_configuration(G1)
    assert ground.height < ankle - 0.01
    assert find_depths(G1, rest, ground.height) == {}
    assert "left_ankle_roll_link" in find_depths(G1, rest, ground.height + 0.002)
    below = kd.BallState((2.2, 0.0, ground.height), (-5.0, 0.0, 0.3))
    lower = kd.IncomingBall(below).on_ground_of(G1, BALL).ground
    assert lower.height == pytest.approx(ground.height - BALL.radius, abs=1e-12)


@pytest.mark.parametrize(("passes", "beside"), [(0.2, 0.0), (0.2, 0.004), (0.0, 0.0), (0.45, 0.0)])
def test_a_place_on_the_path_gives_the_time(passes, beside):
    """In the middle, at the ends of the path, and a little beside it."""
    flies = kd.BallState((0.4, 0.0, 0.5), (-1.0, 0.0, 0.0), time=2.0)
    ground = kd.Ground(-0.79, "turf")
    point = kd.follow(flies, BALL, None, ground, 1e-12).sample(passes).position
    place = point + np.array([0.0, beside, 0.0])
    meets = kd.IncomingBall(flies, ground, place).on_ground_of(HUMAN, BALL)
    course = meets.course(BALL, None, 0.45)
    reach = reach_of(HUMAN, BALL)
    waits = waits_in_reach(
        meets, course, reach, BALL.radius, lambda t: np.zeros((len(t), 3)), lambda _: ""
    )
    assert waits == pytest.approx([passes], abs=1e-11)
