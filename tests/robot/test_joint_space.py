"""Articulated bodies agree with M where M has digits, and with 50 digits where it has none."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia, random_rotation
from extremes.extreme_impacts import BENT, chain
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.leg_response import foot_wrench
from kickdyn.robot.joint_space import ArticulatedBodies

KINDS = {
    "floating": pin.JointModelFreeFlyer, "ball": pin.JointModelSpherical,
    "planar": pin.JointModelPlanar, "slide": pin.JointModelPY,
    "skew": lambda: pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])),
    "screw": lambda: pin.JointModelHelicalUnaligned(np.array([0.6, 0.0, 0.8]), 0.3),
    "angles": pin.JointModelSphericalZYX}  # fmt: skip
PARENTS = (0, 1, 2, 1, 4, 4)
"""Numbers of the joints that carry joints 1 to 6: a tree, branch by branch."""


@pytest.mark.parametrize("root", KINDS)
@pytest.mark.parametrize("seed", range(2))
def test_responses_are_those_of_the_joint_space_inertia(root, seed):
    rng = np.random.default_rng(seed)
    model = pin.Model()
    for k, kind in enumerate([root, *rng.choice(list(KINDS), size=5)]):
        offset = pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3))
        joint = model.addJoint(PARENTS[k], KINDS[kind](), offset, f"joint{k + 1}")
        model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
    model.armature = rng.uniform(0, 0.3, size=model.nv) * (rng.random(model.nv) < 0.5)
    model.gravity.setZero()
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-0.7, 0.7, size=model.nv))
    data = model.createData()
    bodies = ArticulatedBodies(model, data, q)
    inertia = pin.crba(model, data, q)
    rounding = closed_form(np.linalg.cond(inertia))
    for joint in (3, 6):
        rows = pin.computeJointJacobian(model, data, q, joint)
        factor = bodies.delassus_factor(joint, np.eye(6))
        agrees(factor @ factor.T, rows @ np.linalg.solve(inertia, rows.T), rounding)
        push = rng.normal(size=6)
        jump, transmitted, left_over = bodies.respond(joint, push)
        agrees(jump, np.linalg.solve(inertia, rows.T @ push), rounding)
        outside = [pin.Force(push if k == joint else np.zeros(6)) for k in range(model.njoints)]
        pin.rnea(model, data, q, np.zeros(model.nv), jump, outside)
        forces = np.array([data.f[k].vector for k in range(1, model.njoints)])
        # a joint of six degrees of freedom transmits nothing
        np.testing.assert_allclose(transmitted, forces, rtol=0, atol=rounding * np.abs(push).max())
        np.testing.assert_allclose(left_over, 0.0, atol=rounding * np.abs(push).max())


@pytest.mark.parametrize("offset", [None, (0.1, 0.0, 0.05)])
def test_only_ill_conditioned_legs_need_articulated_bodies(offset):
    sound = kd.Leg.human().posture([0.2, 0.3, 0.1]).with_contact_offset(offset)
    assert not sound.is_ill_conditioned
    leg = chain((0.01, 1.0, 1.0))
    posture = leg.posture(BENT).with_contact_offset(offset)
    assert posture.is_ill_conditioned
    wrenches = np.array([foot_wrench(posture, axis) for axis in np.eye(3)])
    rows = posture.articulated_bodies.delassus_factor(leg.contact_joint, wrenches)
    agrees(posture.delassus(), rows @ rows.T, closed_form())
