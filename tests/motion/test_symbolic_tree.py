"""Dynamics in symbols against Pinocchio."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

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


G1 = kd.Leg.from_robot("g1", base="floating", legs_only=True)
STANDING = StandingRobot(G1.with_supports("left_ankle_roll_link"))
LEGS = {"human": kd.Leg.human(), "slider": slider(), "g1 on a foot": STANDING.leg}


@pytest.mark.parametrize("name", LEGS)
def test_the_symbols_are_those_of_pinocchio(name):
    pin.seed(0)
    leg, draw = LEGS[name], np.random.default_rng(1)
    model, joint = leg.model, leg.contact_joint
    model.armature = draw.uniform(0.0, 0.1, model.nv)
    data, tree = model.createData(), SymbolicTree(model)
    other, local = model.njoints // 2, np.array([0.1, -0.2, 0.3])
    results = {
        "torque": tree.inverse_dynamics()[0], "wrench": tree.inverse_dynamics()[1],
        "no gravity": tree.inverse_dynamics(gravity=False)[0],
        "point": tree.point(joint, leg.contact_lever), "rotation": tree.rotation(joint),
        "turning": tree.angular_velocity(joint), "seen": tree.seen_from(other, joint, ca.DM(local)),
    }  # fmt: skip
    in_symbols = ca.Function("all", [tree.q, tree.v, tree.a], list(results.values()))
    for q, v, a in draw.normal(size=(5, 3, model.nv)):
        pin.forwardKinematics(model, data, q, v)
        torque, wrench = pin.rnea(model, data, q, v, a), -(model.inertias[0] * model.gravity)
        for child in model.children[0]:
            wrench += data.oMi[child].act(data.f[child])
        weight = pin.computeGeneralizedGravity(model, model.createData(), q)
        turning = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED).angular
        expected = {
            "torque": torque, "wrench": wrench.vector, "no gravity": torque - weight,
            "point": leg.posture(q).contact_point, "rotation": data.oMi[joint].rotation,
            "turning": turning, "seen": data.oMi[other].actInv(data.oMi[joint].act(local)),
        }  # fmt: skip
        values = dict(zip(results, in_symbols(q, v, a), strict=True))
        for what, right in expected.items():
            agrees(np.asarray(values[what]).squeeze(), right, closed_form(1e3))
