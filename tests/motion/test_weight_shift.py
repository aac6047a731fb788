"""The shift of the weight between both feet, against Pinocchio's dynamics of the whole robot."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BSpline
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.motion import plan_motion
from kickdyn.motion.motion import Motion
from kickdyn.motion.verdict import shift_weight
from kickdyn.motion.weight_shift import Feet, split_wrench
from kickdyn.planning import kick

FEET = "left_ankle_roll_link", "right_ankle_roll_link"
ANCHORS = np.array([[0.0, 0.1], [0.05, -0.12]])


@pytest.mark.parametrize("share", [-0.2, 0.0, 0.3, 1.0, 1.4])
def test_the_wrench_is_split_into_parallel_forces_at_both_feet(share):
    """Their centres of pressure are the points of the soles, displaced by the same offset."""
    force, twist = np.array([20.0, -30.0, 300.0]), 4.0
    part = min(max(share, 0.0), 1.0)
    way = ANCHORS[1] - ANCHORS[0]
    across = 0.02 * np.array([-way[1], way[0]]) / np.linalg.norm(way)
    place = across + (1 - share) * ANCHORS[0] + share * ANCHORS[1]
    moment = np.cross([*place, 0.0], force) + twist * np.eye(3)[2]
    parts = split_wrench(np.concatenate([force, moment]), ANCHORS)
    agrees(sum(parts), np.concatenate([force, moment]), closed_form(10))
    for wrench, weight, anchor in zip(parts, (1 - part, part), ANCHORS, strict=True):
        agrees(wrench[:3], weight * force, closed_form(10))
        if weight > 0:
            centre = np.array([-wrench[4], wrench[3]]) / wrench[2]
            right = place - (1 - part) * ANCHORS[0] - part * ANCHORS[1]
            agrees(centre - anchor, right, closed_form(1e4))
            about = wrench[5] - np.cross([*centre, 0.0], wrench[:3])[2]
            assert about == pytest.approx(weight * twist)


@pytest.fixture(scope="module")
def motion():
    """G1 at rest on one foot between shifts of its weight to and from both."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    robot, tasks = robot.with_supports(kd.Support(FEET[0], friction=0.7)), []

    def stop(task, near=None):
        tasks.append(task)
        raise kd.InvalidInput("enough")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_motion, "plan_motion", stop)
        with pytest.raises(kd.InvalidInput, match="enough"):
            kd.plan_kick(robot, kd.Goal(2, time=0.4), kd.Ball(), motion="both-feet")
    task, problem = tasks[0], plan_motion.motion_problem(tasks[0])
    rest, _ = next(plan_motion._starts(problem))
    knots = np.repeat([[-0.3, 0], [0, 0.3]], 4, 1)
    splines = [BSpline(t, np.tile(rest, (4, 1)), 3) for t in knots]
    place, shift = task.standing.placement, shift_weight(problem, problem.feet, rest)
    return Motion(task.robot, task.leg.joint_names, *splines, place, shift=shift)


@pytest.mark.slow
def test_torques_and_the_wrenches_on_both_feet_accelerate_the_robot(motion):
    h, times = 1e-6, np.linspace(motion.begin + 0.01, -0.31, 7)
    model, feet, loaded = motion.robot.model, motion.shift.feet, 0
    data, limit = model.createData(), motion.robot.effort_limit[6:]
    for t in times:
        q, v, force = motion.q(t), motion.v(t), motion.torque(t)
        assert (np.abs(force[6:]) <= limit).all()
        wrenches = motion.foot_wrenches(t)
        agrees(sum(wrenches), motion.ground_wrench(t), closed_form(10))
        soles = feet.standing.sole, feet.other.sole
        for frame, wrench, sole in zip(FEET, wrenches, soles, strict=True):
            number = model.getFrameId(frame)
            pin.forwardKinematics(model, data, q, v)
            assert np.abs(pin.getFrameVelocity(model, data, number).vector).max() < closed_form(100)
            local = pin.updateFramePlacement(model, data, number).actInv(pin.Force(wrench)).vector
            force += pin.computeFrameJacobian(model, data, q, number, pin.LOCAL).T @ local
            if wrench[2] > 1.0:
                loaded += 1
                centre = np.array([-wrench[4], wrench[3]]) / wrench[2]
                assert (centre > sole.min(axis=0) + 3e-3).all()
                assert (centre < sole.max(axis=0) - 3e-3).all()
                assert np.hypot(*wrench[:2]) < 0.7 * wrench[2]
        rate = (motion.v(t + h) - motion.v(t - h)) / (2 * h)
        assert pin.aba(model, data, q, v, force) == pytest.approx(rate, abs=2e-4)  # of differences
        assert min(motion.margins(t).values()) >= 0.0
    assert len(times) < loaded < 2 * len(times)


@pytest.mark.slow
def test_the_weight_goes_from_both_feet_to_one_and_back(motion):
    shift = motion.shift
    weight = 9.81 * pin.computeTotalMass(motion.robot.model)
    at_rest, alone = motion.foot_wrenches(motion.begin), motion.foot_wrenches(0.0)
    assert [wrench[2] for wrench in at_rest] == pytest.approx([weight / 2] * 2, rel=optimized(1e-7))
    assert [wrench[2] for wrench in alone] == pytest.approx([weight, 0.0], abs=optimized(1e-10))
    ends = [motion.begin, -0.3, 0.0, 0.3, motion.end]
    assert [phase[1:] for phase in motion.phases] == [*pairwise(ends)]
    assert motion.begin == pytest.approx(-0.3 - shift.duration)
    for t in (0.1, 0.4):
        agrees(motion.q(0.3 + t), motion.q(-0.3 - t), closed_form(10))
        agrees(motion.v(0.3 + t), -motion.v(-0.3 - t), closed_form(10))
    turn = pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.7), np.array([0.3, 0.1, 0.0]))
    turned = replace(motion, placement=turn * motion.placement)
    for wrench, other in zip(motion.foot_wrenches(-1.0), turned.foot_wrenches(-1.0), strict=True):
        agrees(other, turn.act(pin.Force(wrench)).vector, closed_form(1e4))
    lines = replace(shift, duration=0.25).warnings()
    assert any("centre of pressure" in line for line in lines)


def test_a_motion_on_both_feet_needs_a_support_and_six_joints():
    with pytest.raises(kd.InvalidInput, match="leg_human has no support"):
        kd.plan_kick(kd.Leg.human(), kd.Goal(10, time=1), kd.Ball(), motion=kick.BOTH_FEET)
    leg = kd.Leg.human()
    standing = SimpleNamespace(robot=leg, support=SimpleNamespace(frame="base"))
    with pytest.raises(kd.InvalidInput, match=r"has 3 joints.*six"):
        Feet(leg, standing, None).following()
