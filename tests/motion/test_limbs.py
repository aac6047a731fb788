"""Limbs at rest that are put aside of a motion, by the bodies of the robot that has them so."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.motion import plan_motion
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.kick_task import KickTask
from kickdyn.motion.limbs import ASIDE, frames_of, idle_limbs, limbs_aside
from kickdyn.motion.separation import Surroundings
from kickdyn.robot.collisions import find_self_collisions
from kickdyn.robot.kicking_chain import kicking_chain
from kickdyn.robot.standing import StandingRobot

BALL = kd.Ball()


@pytest.fixture(scope="module")
def task():
    robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0})
    robot, free = robot.with_supports("left_ankle_roll_link"), (np.zeros((0, 3)), np.zeros(3))
    stands, contact = StandingRobot(robot), kd.Contact(friction=0.4)
    target = impact_target_for((4.0, 0.5, 2.0), np.zeros(3), BALL, contact)
    return KickTask(stands.robot, stands.leg, target, np.eye(3), *free, free[0], stands)


@pytest.mark.processor_limit(6)  # it reads the meshes of a robot
def test_a_limb_in_the_way_of_a_motion_is_put_aside_and_others_stay(task):
    """A thigh that is lifted beside the trunk hits the hand of the same side."""
    whole, standing = task.leg, task.standing
    limbs = idle_limbs(whole, kicking_chain(whole).leg)
    names = [{whole.model.names[joint] for joint in limb} for limb in limbs]
    assert [len(limb) for limb in names] == [4, 4]
    hip = {"right_hip_pitch_joint": -2.0, "right_hip_roll_joint": -0.3, "right_knee_joint": 1.5}
    motion = [{name: share * angle for name, angle in hip.items()} for share in (0.0, 0.5, 1.0)]

    def collisions(values):
        q = whole.configuration(values)
        return find_self_collisions(standing.robot, standing.robot_state(q, 0.0 * q)[0])

    angles = limbs_aside(task, whole, np.array([*map(whole.configuration, motion)]), limbs)
    assert collisions(hip)
    assert angles.keys() in names
    assert not any(collisions({**values, **angles}) for values in motion)
    arm = next(limb for limb, joints in zip(limbs, names, strict=True) if joints == angles.keys())
    around = Surroundings(task.robot, whole, BALL.radius).only(frames_of(whole, arm))
    at_rest = {gap.frames for gap in around.gaps(whole.configuration(), None, ASIDE)}
    near = around.gaps(whole.configuration({**hip, **angles}), None, ASIDE)
    assert {gap.frames for gap in near} <= at_rest
    assert not any(map(whole.outside_range, [whole.configuration(angles)]))


def test_limbs_that_a_motion_put_aside_stay_there_when_it_is_planned_again(task, monkeypatch):
    """The centre of mass is that of the robot whose arm is lifted."""
    aside, whole = {"left_shoulder_roll_joint": 0.7}, task.leg
    near = SimpleNamespace(aside=aside, joints=kicking_chain(whole).leg.joint_names)
    planned = lambda task, *_: SimpleNamespace(task=task, keeps_limits=True)  # noqa: E731
    monkeypatch.setattr(plan_motion, "_plan", planned)
    again = plan_motion.plan_motion(task, near).task
    assert again.aside == aside
    place = pin.centerOfMass(whole.model, whole.model.createData(), whole.configuration(aside))
    legs = again.leg
    centre = pin.centerOfMass(legs.model, legs.model.createData(), legs.configuration())
    agrees(centre, place, closed_form(10))
