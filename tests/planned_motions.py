"""Plans with a motion that several files of tests use; each takes seconds, and is made once."""

from functools import cache

import kickdyn as kd

HUMAN, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
SOLE = "left_ankle_roll_link"


@cache
def swinging():
    """Return a kick of the human leg over 20 m."""
    return kd.plan_kick(HUMAN, kd.Goal(20, time=1.2), BALL, AIR, motion=True)


@cache
def standing():
    """Return a kick of G1 on its left foot, whose legs move, over 2 m."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    robot = robot.with_supports(kd.Support(SOLE, friction=0.7))
    return kd.plan_kick(robot, kd.Goal(2, time=0.4), BALL, AIR, motion=True)


@cache
def waist():
    """Return the same of G1 with its waist, which stays at rest, over 3 m."""
    arms = {"*wrist*": 0.0, "*shoulder*": 0.0, "*elbow*": 0.0}
    robot = kd.Leg.from_robot("g1", base="floating", locked=arms)
    robot = robot.with_supports(kd.Support(SOLE, friction=0.7))
    return kd.plan_kick(robot, kd.Goal(3, time=0.4), BALL, AIR, motion=True)
