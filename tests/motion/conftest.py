"""Motions of splines that no plan is needed for: a robot on one foot and a leg."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.motion.motion import Motion
from kickdyn.robot.standing import StandingRobot


def spline_motion(robot, joints, placement=None, **options):
    """Return a motion of clamped cubic splines, from -0.53 to 0.61 s."""
    draw = np.random.default_rng(0)
    first, hit, last = draw.uniform(-0.2, 0.2, (3, len(joints)))
    splines = []
    for begin, end, rows in ((-0.53, 0.0, (first, hit)), (0.0, 0.61, (hit, last))):
        knots = np.r_[[begin] * 3, np.linspace(begin, end, 5), [end] * 3]
        table = np.linspace(*rows, 7) + draw.normal(0.0, 0.1, (7, len(joints)))
        table[0], table[-1] = rows
        splines.append(BSpline(knots, table, 3))
    return Motion(robot, joints, *splines, placement, **options)


@pytest.fixture(scope="session")
def make_motion():
    return spline_motion


@pytest.fixture(scope="session")
def walking():
    robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0})
    standing = StandingRobot(robot.with_supports("left_ankle_roll_link"))
    return spline_motion(standing.robot, standing.leg.joint_names, standing.placement)


@pytest.fixture(scope="session")
def swinging():
    leg = kd.Leg.human()
    return spline_motion(leg, leg.joint_names)
