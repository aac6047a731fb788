"""Plans with a motion that several files of tests use; each takes seconds, and is made once."""

from dataclasses import replace
from functools import cache

from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.motion.motion import Motion

HUMAN, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
SOLE = "left_ankle_roll_link"
SWING = 0.25


@cache
def by_hand():
    """Return a kick of constant accelerations: from rest to the impact, and to rest."""
    plan = kd.plan_kick(HUMAN, kd.Goal(10, time=0.9), BALL, AIR)
    splines = []
    for begin, end, v in ((-SWING, 0.0, plan.v), (0.0, SWING, plan.impact.v_after)):
        half = 0.5 * SWING * v  # Bezier points of a parabola
        points = [plan.q - half, plan.q - half, plan.q] if end == 0.0 else [
            plan.q, plan.q + half, plan.q + half
        ]  # fmt: skip
        splines.append(BSpline([begin] * 3 + [end] * 3, points, 2))
    return replace(plan, motion=Motion(plan.leg, HUMAN.joint_names, *splines))


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
