"""Closed form against Pinocchio's impulseDynamics, and against its constraint solver."""

import numpy as np
import pinocchio as pin
import pytest
from chains import by_pinocchio, random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, optimized

import kickdyn as kd

seeds = st.integers(0, 2**32 - 1)
LEGS = {"human": kd.Leg.human(), "testbed": kd.Leg.testbed()}


def check_same(kick, options):
    impact, peer = kd.strike(*kick, **options), by_pinocchio(*kick, **options)
    tolerance = closed_form(impact.posture.condition)
    size = np.linalg.norm(peer.impulse)
    agrees(impact.impulse, peer.impulse, tolerance)
    agrees(impact.v_after, peer.v_after, tolerance)
    agrees(impact.joint_impulses, peer.joint_impulses, tolerance)
    assert impact.energy_lost == pytest.approx(peer.energy_lost, rel=tolerance)
    speed = np.abs(peer.ball_before.velocity).max() + size / impact.ball.mass
    np.testing.assert_allclose(
        impact.ball_after.velocity, peer.ball_after.velocity, atol=tolerance * speed
    )
    agrees(impact.ball_after.spin, peer.ball_after.spin, tolerance)
    for result in (impact, peer):
        assert result.momentum_residual <= tolerance
        assert result.restitution_residual <= 10 * tolerance


@pytest.mark.parametrize("name", [*LEGS, "chain", "offset"])
@given(seed=seeds)
@settings(max_examples=40)
def test_same_as_impulse_dynamics(name, seed):
    rng = np.random.default_rng(seed)
    (posture, v, ball, contact), options = random_kick(rng, LEGS.get(name) or random_leg(rng))
    if name == "offset":
        lever = rng.uniform(-0.2, 0.2, size=3)
        closing = posture.with_contact_offset(lever).point_velocity(v) - options["ball_velocity"]
        contact = kd.Contact(closing, rng.uniform(0, 1), 0.0, lever)
    check_same((posture, v, ball, contact), options)


def test_same_for_a_particle_with_rotors_and_on_a_base_that_moves():
    (posture, v, ball, contact), options = random_kick(np.random.default_rng(1), LEGS["human"])
    particle = kd.Ball(inertia_factor=np.inf)
    check_same((posture, v, particle, contact), options)
    geared = LEGS["human"].with_armature({"hip": 0.3, "knee": 0.2}).posture(posture.q)
    check_same((geared, v, ball, contact), options)
    bare, heavy = (kd.strike(p, v, ball, contact, **options) for p in (posture, geared))
    assert np.linalg.norm(heavy.impulse) > np.linalg.norm(bare.impulse)
    base = LEGS["human"].with_base_velocity((4, 0.3, -0.2), (0.3, -2, 1))
    kick = base.posture([0.7, 0.5, -0.3]), [6.6, -14.5, 6.6], ball, kd.Contact((2, 0, 1), 0.8)
    check_same(kick, {"ball_velocity": (1, 2, 0.5), "ball_spin": (3, 4, 5)})


@pytest.mark.parametrize(
    ("friction", "arguments", "words"),
    [
        (0.4, {"engine": "pinocchio"}, r"friction is 0\.4"),
        (0.0, {"engine": "pinocchio", "law": "paper"}, "'paper'.*'newton' or 'stronge'"),
        (0.0, {"engine": "bullet"}, "engine is 'bullet'"),
    ],
)
def test_bad_input(friction, arguments, words):
    kick, options = random_kick(np.random.default_rng(1), LEGS["human"], friction=friction)
    with pytest.raises(kd.InvalidInput, match=words):
        kd.strike(*kick, **arguments, **options)


def by_constraint(posture, v, ball, contact, ball_velocity, ball_spin):
    """The same impact by a point contact without friction and Pinocchio's PGS solver.

    Pinocchio 4 calls `impulseDynamics` with a Jacobian unsupported and names `RigidConstraintModel`
    instead, of which it takes the velocity of the first body only: wrong for a ball that moves.
    """
    leg, n = posture.leg, contact.normal
    model, joint = leg.model, leg.contact_joint
    free = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    rigid = pin.Inertia(ball.mass, np.zeros(3), ball.inertia * np.eye(3))
    model.appendBodyToJoint(free, rigid, pin.SE3.Identity())
    data = model.createData()
    q = np.concatenate([posture.q, posture.contact_point + ball.radius * n, [0, 0, 0, 1]])
    before = np.concatenate([v, ball_velocity, ball_spin])
    pin.forwardKinematics(model, data, q)
    axes = np.linalg.svd(n.reshape(1, 3))[2][[1, 2, 0]].T
    axes[:, 2] = n
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    frame = pin.SE3(axes, posture.contact_point)
    places = [data.oMi[i].actInv(frame) for i in (joint, free)]
    point = pin.PointContactConstraintModel(model, joint, places[0], free, places[1])
    point.setFriction(0.0)
    models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    models.append(pin.ConstraintModel(point))
    datas.append(models[0].createData())
    inertia = pin.crba(model, data, q, pin.Convention.WORLD)
    models[0].calc(model, data, datas[0])
    rows = pin.getConstraintsJacobian(model, data, models, datas)
    closing = rows @ before
    closing[2] *= 1.0 + contact.restitution
    operator = pin.DelassusOperatorDense(np.asfortranarray(rows @ np.linalg.solve(inertia, rows.T)))
    options, result = pin.PGSSolverSettings(), pin.PGSSolverResult()
    for kind in ("feasibility", "complementarity"):
        setattr(options, f"absolute_{kind}_tol", 1e-13)
        setattr(options, f"relative_{kind}_tol", 1e-13)
    pin.PGSConstraintSolver(3).solve(operator, closing, models, datas, options, result)
    impulse = result.retrieveConstraintImpulses()
    return axes @ impulse, (before + np.linalg.solve(inertia, rows.T @ impulse))[: leg.nv]


@pytest.mark.parametrize("seed", range(8))
def test_the_constraint_solver_agrees(seed):
    rng = np.random.default_rng(seed)
    kick, options = random_kick(rng, random_leg(rng) if seed % 2 else LEGS["human"])
    peer = by_pinocchio(*kick, **options)
    impulse, v_after = by_constraint(*kick, **options)
    agrees(peer.impulse, impulse, optimized(1e-10))
    agrees(peer.v_after, v_after, optimized(1e-10))
