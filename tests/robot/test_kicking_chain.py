"""The joints of a kick, taken out of a robot, move and weigh as they do in the robot."""

import math

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot.kicking_chain import kicking_chain, rest_configuration, with_angles

G1 = kd.Leg.from_robot("g1")


def test_the_chain_of_a_robot_is_its_leg():
    chain = kicking_chain(G1)
    assert chain.leg.joint_names == tuple(G1.joint_names[i] for i in chain.vs)
    assert [name.startswith("right_") for name in chain.leg.joint_names] == [True] * 6
    assert G1.lower[chain.qs].tolist() == chain.leg.lower.tolist()
    assert G1.velocity_limit[chain.vs].tolist() == chain.leg.velocity_limit.tolist()
    q, v, a = np.random.default_rng(0).normal(0, 0.3, (3, 6))
    whole_q, whole_v = chain.robot_state(G1, q, v)
    whole, alone = G1.posture(whole_q), chain.leg.posture(q)
    rounding = closed_form(whole.condition)
    agrees(alone.contact_point, whole.contact_point, rounding)
    agrees(alone.jacobian @ v, whole.jacobian @ whole_v, rounding)
    agrees(alone.delassus(), whole.delassus(), rounding)
    whole_a = chain.robot_state(G1, q, a)[1]
    torques, whole_torques = (
        pin.rnea(leg.model, leg.model.createData(), *state)
        for leg, state in ((chain.leg, (q, v, a)), (G1, (whole_q, whole_v, whole_a)))
    )
    agrees(torques, whole_torques[chain.vs], rounding)


def test_joints_that_are_taken_out_may_be_elsewhere():
    others = {"left_elbow_joint": 0.4, "left_hip_roll_joint": 0.2}
    chain = kicking_chain(G1, others=others).leg
    whole = G1.configuration(others)
    for frame in ("left_ankle_roll_link", "left_rubber_hand"):
        places = []
        for leg, q in ((chain, chain.configuration()), (G1, whole)):
            model, data = leg.model, leg.model.createData()
            pin.framesForwardKinematics(model, data, q)
            places.append(data.oMf[model.getFrameId(frame)].homogeneous)
        np.testing.assert_allclose(*places, atol=closed_form(10), err_msg=frame)


def add_body(model, parent, joint, name):
    number = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    body = pin.Inertia(1.0, np.array([0, 0, -0.1]), 0.01 * np.eye(3))
    model.appendBodyToJoint(number, body, pin.SE3.Identity())


def test_branches_are_kept_where_an_impact_moves_them():
    model = kd.Leg.human().model
    add_body(model, 1, pin.JointModelRY(), "pendulum on the thigh")
    add_body(model, 0, pin.JointModelSpherical(), "arm on the base")
    robot = kd.Leg.from_model(model, "toe")
    without, with_branch = kicking_chain(robot), kicking_chain(robot, branches=True)
    assert without.leg.joint_names == ("hip", "knee", "ankle")
    assert with_branch.leg.joint_names == ("hip", "knee", "ankle", "pendulum on the thigh")
    n, q = (1.0, 0.0, 0.0), np.array([0.0, 0.3, 0.0, 0.0])
    whole = robot.posture(with_branch.robot_state(robot, q, np.zeros(4))[0]).effective_mass(n)
    assert with_branch.leg.posture(q).effective_mass(n) == pytest.approx(whole)
    assert without.leg.posture(q[:3]).effective_mass(n) > whole + 1e-3


def test_continuous_joints_by_angles_are_the_same_robot():
    robot = floating_leg(np.random.default_rng(3)).with_armature({"hip": 0.2})
    angles = with_angles(robot)
    assert (robot.nq, angles.nq, angles.nv) == (9 + 1, 9, robot.nv)
    q = [0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8, 2.0, -0.4]
    one, other = robot.posture(q), angles.posture(q)
    for name in ("contact_point", "jacobian", "inertia"):
        agrees(getattr(other, name), getattr(one, name), closed_form())
    assert angles.joint_range("hip") == (-math.pi, math.pi)
    assert angles.velocity_limit.tolist() == robot.velocity_limit.tolist()
    assert with_angles(G1) is G1


def test_joints_outside_the_chain_rest_at_the_nearest_value_in_their_range():
    model = kd.Leg.human().model
    for parent, kind, name in (
        (0, pin.JointModelRY(), "elbow"), (4, pin.JointModelRY(), "wrist"),
        (5, pin.JointModelRUBY(), "spinner"), (6, pin.JointModelSpherical(), "ball"),
        (0, pin.JointModelRY(), "arm"),
    ):  # fmt: skip
        add_body(model, parent, kind, name)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    lower[3:5], upper[3:5] = (0.25, -2.0), (1.5, -0.5)
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.addFrame(pin.Frame("hand", 8, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    robot = kd.Leg.from_model(model, "hand")
    rest = rest_configuration(robot)
    assert rest.tolist() == [0, 0, 0, 0.25, -0.5, 1, 0, 0, 0, 0, 1, 0]
    q, v = kicking_chain(robot).robot_state(robot, np.array([0.5]), np.array([2.0]))
    assert q.tolist() == [*rest[:-1], 0.5]
    assert v.tolist() == [*np.zeros(robot.nv - 1), 2.0]


def test_a_floating_base_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"'root_joint' .* base must be fixed"):
        kicking_chain(kd.Leg.from_robot("g1", base="floating"))
