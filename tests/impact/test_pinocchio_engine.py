"""Closed form against Pinocchio's impulseDynamics, and against its constraint solver."""

import numpy as np
import pinocchio as pin
import pytest
from chains import by_pinocchio, random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.impact.pinocchio_engine import with_ball

seeds = st.integers(0, 2**32 - 1)
LEGS = {"human": kd.Leg.human(), "testbed": kd.Leg.testbed()}


def assert_same(kick, options):
    hit, engine = kd.strike(*kick, **options), by_pinocchio(*kick, **options)
    for ours, theirs in (
        (hit.impulse, engine.impulse),
        (hit.v_after, engine.v_after),
        (hit.ball_after.velocity, engine.ball_after.velocity),
        (hit.ball_after.spin, engine.ball_after.spin),
        (hit.joint_impulses, engine.joint_impulses),
        (hit.energy_lost, engine.energy_lost),
    ):
        assert np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max()
    assert engine.momentum_residual <= 1e-12
    assert engine.restitution_residual <= 1e-12
    assert hit.restitution_residual <= 1e-12
    assert hit.momentum_residual <= 1e-12


@pytest.mark.parametrize("name", LEGS)
@given(seed=seeds)
@settings(max_examples=1000, derandomize=True, deadline=None)
def test_same_on_our_legs(name, seed):
    assert_same(*random_kick(np.random.default_rng(seed), LEGS[name]))


@given(seed=seeds)
@settings(max_examples=1000, derandomize=True, deadline=None)
def test_same_on_random_chains(seed):
    rng = np.random.default_rng(seed)
    assert_same(*random_kick(rng, random_leg(rng)))


@pytest.mark.parametrize("seed", range(40))
def test_same_off_the_frames_origin(seed):
    rng = np.random.default_rng(seed)
    (posture, v, ball, _), options = random_kick(rng, random_leg(rng))
    assert_same(*off_centre(rng, posture, v, ball, options))


def off_centre(rng, posture, v, ball, options, friction=0.0):
    """The same kick with a point elsewhere on the foot, which approaches the ball."""
    offset = rng.uniform(-0.2, 0.2, size=3)
    closing = posture.with_contact_offset(offset).point_velocity(v) - options["ball_velocity"]
    contact = kd.Contact(closing, rng.uniform(0, 1), friction, offset)
    return (posture, v, ball, contact), options


def test_same_for_a_particle():
    (posture, v, _, contact), options = random_kick(np.random.default_rng(1), LEGS["human"])
    particle = kd.Ball(inertia_factor=np.inf)
    assert_same((posture, v, particle, contact), options)


def test_armature_is_honoured():
    model = kd.Leg.human().model
    model.armature = np.array([0.3, 0.2, 0.1])
    leg = kd.Leg.from_model(model, "toe")
    kick, options = random_kick(np.random.default_rng(1), leg)
    assert_same(kick, options)
    bare = kd.strike(kd.Leg.human().posture(kick[0].q), *kick[1:], **options)
    assert np.linalg.norm(kd.strike(*kick, **options).impulse) > np.linalg.norm(bare.impulse)


def test_friction_is_refused():
    kick, options = random_kick(np.random.default_rng(1), LEGS["human"], friction=0.4)
    with pytest.raises(kd.InvalidInput, match=r"friction is 0\.4 .*for friction 0"):
        by_pinocchio(*kick, **options)
    kick, options = random_kick(np.random.default_rng(1), LEGS["human"])
    with pytest.raises(kd.InvalidInput, match=r"law 'paper': .*'newton' or 'stronge'"):
        by_pinocchio(*kick, law="paper", **options)
    with pytest.raises(kd.InvalidInput, match="engine is 'bullet'"):
        kd.strike(*kick, engine="bullet", **options)


def test_separating_bodies_are_not_pulled():
    (posture, v, ball, contact), options = random_kick(np.random.default_rng(1), LEGS["human"])
    away = kd.Contact(-contact.normal, contact.restitution)
    with pytest.raises(kd.NoImpact, match="away from the ball"):
        kd.strike(posture, v, ball, away, engine="pinocchio", **options)


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
    centre = posture.contact_point + ball.radius * n
    q = np.concatenate([posture.q, centre, [0, 0, 0, 1]])
    before = np.concatenate([v, ball_velocity, ball_spin])
    pin.forwardKinematics(model, data, q)
    axes = np.linalg.qr(np.column_stack([n, np.eye(3)[:, np.argsort(abs(n))[:2]]]))[0][:, [1, 2, 0]]
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
    matrix = rows @ np.linalg.solve(inertia, rows.T)
    solver, settings, result = (
        pin.PGSConstraintSolver(3),
        pin.PGSSolverSettings(),
        pin.PGSSolverResult(),
    )
    for kind in ("feasibility", "complementarity"):
        setattr(settings, f"absolute_{kind}_tol", 1e-13)
        setattr(settings, f"relative_{kind}_tol", 1e-13)
    operator = pin.DelassusOperatorDense(np.asfortranarray(matrix))
    assert solver.solve(operator, closing, models, datas, settings, result)
    impulse = result.retrieveConstraintImpulses()
    after = before + np.linalg.solve(inertia, rows.T @ impulse)
    return axes @ impulse, after[: leg.nv]


@pytest.mark.parametrize("seed", range(20))
def test_the_constraint_solver_agrees(seed):
    rng = np.random.default_rng(seed)
    kick, options = random_kick(rng, random_leg(rng) if seed % 2 else LEGS["human"])
    engine = by_pinocchio(*kick, **options)
    impulse, v_after = by_constraint(*kick, **options)
    assert impulse == pytest.approx(engine.impulse, abs=1e-9 * np.abs(engine.impulse).max())
    assert v_after == pytest.approx(engine.v_after, abs=1e-9 * np.abs(engine.v_after).max())


def test_the_model_of_leg_and_ball_is_made_once():
    leg, ball = kd.Leg.human(), kd.Ball()
    posture, contact = leg.posture([0.1, 0.2, 0.3]), kd.Contact((3, 0, 1), 0.8)
    v = posture.joint_velocity((3, 0, 1))
    before = with_ball.cache_info().misses
    hits = [kd.strike(posture, v, ball, contact, engine="pinocchio") for _ in range(3)]
    assert with_ball.cache_info().misses == before + 1
    assert len({tuple(hit.impulse) for hit in hits}) == 1
    light = kd.Ball(mass=0.2)  # another ball, another model
    exact = kd.strike(posture, v, light, contact).impulse
    assert kd.strike(posture, v, light, contact, engine="pinocchio").impulse == pytest.approx(exact)
