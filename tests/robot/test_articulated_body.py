"""Articulated bodies agree with M where M has digits, and with 50 digits where it has none."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia, random_rotation
from extremes.extreme_impacts import BENT, SPEEDS, answers, chain
from references.exact_impact import exact_impact, given

import kickdyn as kd
from kickdyn.impact.leg_response import foot_wrench
from kickdyn.robot.articulated_body import ArticulatedBodies

KINDS = {
    "floating": pin.JointModelFreeFlyer,
    "ball": pin.JointModelSpherical,
    "planar": pin.JointModelPlanar,
    "slide": pin.JointModelPY,
    "skew": lambda: pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])),
    "angles": pin.JointModelSphericalZYX,
}


def branched(rng, first):
    """A tree of any joints with rotors; the foot hangs from one of two branches."""
    model = pin.Model()
    model.name = "tree"
    parents = []
    for k, kind in enumerate([first, *rng.choice(list(KINDS), size=5)]):
        parent = parents[(0, 0, 1, 0, 3, 3)[k]] if k else 0
        offset = pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3))
        parents.append(model.addJoint(parent, KINDS[kind](), offset, f"joint{k + 1}"))
        model.appendBodyToJoint(parents[-1], random_inertia(rng), pin.SE3.Identity())
    model.armature = rng.uniform(0, 0.3, size=model.nv) * (rng.random(model.nv) < 0.5)
    return model, parents


@pytest.mark.parametrize("first", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_it_is_what_the_joint_space_inertia_says(first, seed):
    rng = np.random.default_rng(seed)
    model, parents = branched(rng, first)
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-0.7, 0.7, size=model.nv))
    data = model.createData()
    bodies = ArticulatedBodies(model, data, q)
    inertia = pin.crba(model, data, q)
    for joint in (parents[-1], parents[2]):
        rows = pin.computeJointJacobian(model, data, q, joint)
        direct = rows @ np.linalg.solve(inertia, rows.T)
        give = bodies.delassus_factor(joint, np.eye(6))
        assert give @ give.T == pytest.approx(direct, abs=1e-10 * np.abs(direct).max())
        push = rng.normal(size=6)
        jump, transmitted, left_over = bodies.respond(joint, push)
        expected = np.linalg.solve(inertia, rows.T @ push)
        assert jump == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
        outside = [pin.Force(push if k == joint else np.zeros(6)) for k in range(model.njoints)]
        model.gravity.setZero()
        pin.rnea(model, data, q, np.zeros(model.nv), jump, outside)
        forces = np.array([data.f[k].vector for k in range(1, model.njoints)])
        assert transmitted == pytest.approx(forces, abs=1e-10 * np.abs(forces).max())
        assert np.abs(left_over).max() < 1e-12 * np.abs(push).max()


@pytest.mark.parametrize("lengths", [(0.1, 1, 1), (0.01, 1, 1), (1e-3, 1e3, 1), (1, 1e-3, 1e3)])
def test_a_short_link_costs_no_digits(lengths):
    hit = kd.strike(
        chain(lengths).posture(BENT), SPEEDS, kd.Ball(), kd.Contact((2, 0.3, 1), 0.8, 0.4)
    )
    exact = exact_impact(*given(hit))
    for name, found in answers(hit).items():
        assert exact[name].error(found) < 2e-14, name
    assert hit.momentum_residual < 1e-12


def test_a_sound_leg_is_left_to_the_joint_space_inertia():
    posture = kd.Leg.human().posture([0.2, 0.3, 0.1])
    assert not posture.is_ill_conditioned
    posture.delassus()
    assert "articulated_bodies" not in vars(posture)


def test_a_point_elsewhere_on_the_foot_is_judged_anew():
    leg = chain((0.01, 1.0, 1.0))
    posture = leg.posture(BENT)
    moved = posture.with_contact_offset((0.1, 0.0, 0.05))
    pushes = np.array([foot_wrench(moved, axis) for axis in np.eye(3)])
    rows = moved.articulated_bodies.delassus_factor(leg.contact_joint, pushes)
    assert moved.is_ill_conditioned
    assert moved.delassus() == pytest.approx(rows @ rows.T, rel=1e-14)
    assert posture.delassus() != pytest.approx(moved.delassus(), rel=1e-3)
