"""Splines of a motion against differences, and dynamics in symbols against Pinocchio."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.motion.motion_program import MotionSplines, SymbolicTree
from kickdyn.robot.standing import StandingRobot

SPLINES = MotionSplines(0.5, 0.7, (6, 4))
COEFFICIENTS = np.random.default_rng(0).normal(size=(SPLINES.size, 2))


def values(t, order=0):
    sides = [np.array([t]), np.zeros(0)] if t <= 0 else [np.zeros(0), np.array([t])]
    return (SPLINES.values(sides, order) @ COEFFICIENTS)[0]


def test_a_motion_starts_and_ends_at_rest_and_does_not_jump_at_the_impact():
    for t in (-0.5, 0.7):
        for order in (1, 2):
            assert values(t, order) == pytest.approx(np.zeros(2), abs=closed_form(1e4))
    agrees(values(-0.5), COEFFICIENTS[0], closed_form(10))
    agrees(values(0.7), COEFFICIENTS[-1], closed_form(10))
    q, before, jump = SPLINES.at_impact() @ COEFFICIENTS
    first, second = SPLINES.motion(COEFFICIENTS)
    agrees(first(0.0), q, closed_form(10))
    agrees(second(0.0), q, closed_form(10))
    agrees(before, first(0.0, 1), closed_form(10))
    agrees(jump, second(0.0, 1) - first(0.0, 1), closed_form(10))
    assert np.abs(jump).min() > 0.1


@pytest.mark.parametrize("t", [-0.31, -0.04, 0.02, 0.4])
def test_derivatives_are_those_of_differences(t):
    h = 1e-3  # differences of the fourth order are exact for cubics
    for order in (0, 1, 2):
        wide, close = ((values(t + k * h, order) - values(t - k * h, order)) for k in (2, 1))
        agrees(values(t, order + 1), (8 * close - wide) / (12 * h), closed_form(1e4))


def test_coefficients_are_those_of_a_motion():
    agrees(SPLINES.coefficients(*SPLINES.motion(COEFFICIENTS)), COEFFICIENTS, closed_form())


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
