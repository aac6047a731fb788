"""Dynamics in symbols against Pinocchio."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.motion.symbolic_tree import SymbolicTree
from kickdyn.robot.standing import StandingRobot


def slider():
    """Return a prismatic joint, tilted, behind a turning one."""
    model = pin.Model()
    turn = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Random(), "turn")
    slide = model.addJoint(
        turn, pin.JointModelPrismaticUnaligned(np.array([0.6, 0, 0.8])), pin.SE3.Random(), "slide"
    )
    for joint in (turn, slide):
        body = pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3)
        model.appendBodyToJoint(joint, body, pin.SE3.Random())
    model.addFrame(pin.Frame("toe", slide, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.velocityLimit = model.effortLimit = np.full(2, 10.0)
    return kd.Leg.from_model(model, "toe")


def standing(name):
    robot = kd.Leg.from_robot(name, base="floating", legs_only=True)
    foot = {"g1": "left_ankle_roll_link", "talos": "left_sole_link"}[name]
    return StandingRobot(robot.with_supports(foot)).leg


def legs():
    pin.seed(0)
    yield pytest.param(kd.Leg.human(), id="human")
    yield pytest.param(slider(), id="slider")
    for name in ("g1", "talos"):
        yield pytest.param(standing(name), id=name)


@pytest.mark.parametrize("leg", list(legs()))
def test_the_symbols_are_pinocchio_to_rounding(leg):
    draw, model = np.random.default_rng(1), leg.model
    model.armature = draw.uniform(0.0, 0.1, model.nv)
    data, tree = model.createData(), SymbolicTree(model)
    torque, wrench = tree.inverse_dynamics()
    point = tree.point(leg.contact_joint, leg.contact_lever)
    joint = leg.contact_joint
    in_symbols = ca.Function(
        "all",
        [tree.q, tree.v, tree.a],
        [torque, wrench, point, tree.rotation(joint), tree.angular_velocity(joint)],
    )  # fmt: skip
    floating = model_on_a_floating_base(model)
    for _ in range(5):
        q, v, a = draw.normal(size=(3, model.nv))
        values = [np.asarray(value).squeeze() for value in in_symbols(q, v, a)]
        expected = pin.rnea(model, data, q, v, a)
        np.testing.assert_allclose(values[0], expected, rtol=1e-10, atol=1e-10)
        still = np.zeros(6)
        force = pin.rnea(
            floating, floating.createData(), np.concatenate([still, [1.0], q]),
            np.append(still, v), np.append(still, a),
        )[:6]  # fmt: skip
        np.testing.assert_allclose(values[1], force, rtol=1e-9, atol=1e-9)
        pin.forwardKinematics(model, data, q, v)
        posture = leg.posture(q)
        np.testing.assert_allclose(values[2], posture.contact_point, atol=1e-12)
        np.testing.assert_allclose(values[3], data.oMi[joint].rotation, atol=1e-12)
        other, local = model.njoints // 2, np.array([0.1, -0.2, 0.3])
        expected = data.oMi[other].actInv(data.oMi[joint].act(local))
        seen = ca.Function("seen", [tree.q], [tree.seen_from(other, joint, ca.DM(local))])
        np.testing.assert_allclose(np.asarray(seen(q)).ravel(), expected, atol=1e-12)
        turning = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED).angular
        np.testing.assert_allclose(values[4], turning, atol=1e-12)


def model_on_a_floating_base(fixed):
    """Return the model with a floating base at its root, whose torque is the root's wrench."""
    model = pin.Model()
    model.gravity = fixed.gravity
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(1, fixed.inertias[0], pin.SE3.Identity())
    for joint in range(1, fixed.njoints):
        above, place = int(fixed.parents[joint]) + 1, fixed.jointPlacements[joint]
        model.addJoint(above, fixed.joints[joint], place, fixed.names[joint])
        model.appendBodyToJoint(joint + 1, fixed.inertias[joint], pin.SE3.Identity())
    model.armature = np.concatenate([np.zeros(6), fixed.armature])
    return model
