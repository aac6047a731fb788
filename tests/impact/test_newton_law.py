"""Newton's law with Coulomb's cone: its conditions, root finding, and Pinocchio's cone solvers."""

import itertools
import math

import numpy as np
import pinocchio as pin
import pytest
from chains import random_kick, random_leg
from contacts import BareContact, by_newton, random_contact, random_problem, split
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import kickdyn as kd

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("draw", [random_problem, random_contact])
@given(seed=seeds)
@settings(max_examples=1500, derandomize=True, deadline=None)
def test_it_keeps_restitution_and_coulombs_cone(draw, seed):
    problem = draw(seed)
    impulse, sticking, _, _ = by_newton(problem)
    before, jump = problem.velocity, problem.delassus() @ impulse
    scale = np.linalg.norm(problem.delassus()) * np.linalg.norm(impulse) + np.abs(before).max()
    u_before, _ = split(problem, before)
    u_after, sliding = split(problem, before + jump)
    pressing, friction = split(problem, impulse)
    assert u_after == pytest.approx(-problem.restitution * u_before, abs=1e-12 * scale)
    assert pressing > 0
    size, cone = np.linalg.norm(friction), problem.friction * pressing
    if sticking:
        assert size <= cone * (1 + 1e-12)
        assert np.abs(sliding).max() <= 1e-12 * scale
    else:
        assert size == pytest.approx(cone, rel=1e-12, abs=1e-15 * pressing)
        opposed = -np.linalg.norm(sliding) * size
        assert float(sliding @ friction) == pytest.approx(
            opposed, abs=1e-12 * scale * (size + 1e-3 * pressing)
        )


def solutions(contact):
    """Every impulse that meets the law's conditions, by scanning the cone and root finding."""
    axes = np.linalg.svd(contact.normal.reshape(1, 3))[2][[1, 2, 0]].T
    axes[:, 2] = contact.normal
    g, mu = axes.T @ contact.matrix @ axes, contact.friction
    free = axes.T @ contact.velocity
    free[2] *= 1 + contact.restitution
    stick = -np.linalg.solve(g, free)
    found = [axes @ stick] if np.hypot(*stick[:2]) <= mu * stick[2] else []

    def slip(angle):
        way = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = g[2] @ way
        return way, resistance, resistance * free[:2] - free[2] * (g @ way)[:2]

    def across(angle):
        way, _, sliding = slip(angle)
        return way[0] * sliding[1] - way[1] * sliding[0]

    grid = np.linspace(0.0, 2 * math.pi, 721) + 1e-4
    for low, high in itertools.pairwise(grid):
        if across(low) * across(high) <= 0:
            way, resistance, sliding = slip(brentq(across, low, high, xtol=1e-15))
            if resistance > 0 and sliding @ way[:2] <= 0:
                found.append(axes @ (-free[2] / resistance * way))
    return found


@pytest.mark.parametrize("seed", range(150))
def test_it_is_among_the_solutions_of_root_finding(seed):
    contact = random_contact(seed, decades=3, friction=[0.2, 0.6, 3.0][seed % 3])
    impulse = by_newton(contact).impulse
    found = solutions(contact)
    apart = [np.abs(other - impulse).max() / np.linalg.norm(impulse) for other in found]
    assert min(apart) <= 1e-9


def test_strong_friction_can_leave_a_choice():
    """Stick and two slips all satisfy the law; the stick is taken."""
    contact = random_contact(143, decades=6, friction=5.0)
    assert len(solutions(contact)) == 3
    assert by_newton(contact).sticking


def test_of_several_slips_the_one_that_loses_most_is_taken():
    contact = random_contact(5195, decades=4, friction=3.0)
    _, sticking, lost, _ = by_newton(contact)
    losses = [-p @ (contact.velocity + contact.matrix @ p / 2) for p in solutions(contact)]
    assert len(losses) == 3
    assert max(losses) > min(losses) + 0.1 * abs(min(losses))
    assert not sticking
    assert lost == pytest.approx(max(losses), rel=1e-9)


def test_it_can_create_energy():
    """The leg's coupling turns friction into speed along the normal: 21 / 500 J come from nothing.

    Sticking takes the relative velocity from (0.3, -1) to (0, 1).
    """
    matrix = np.array([[4.0, 0.0, -3.0], [0.0, 4.0, 0.0], [-3.0, 0.0, 6.0]])
    contact = BareContact(matrix, np.array([0.3, 0.0, -1.0]), 1.0, 0.8, np.array([0.0, 0.0, 1.0]))
    impulse, sticking, lost, _ = by_newton(contact)
    assert sticking
    assert impulse == pytest.approx([0.28, 0, 71 / 150], rel=1e-14)
    assert lost == pytest.approx(-0.28 * 0.3 / 2, rel=1e-13)


def cone_solver(name):
    if name == "ADMM":
        return pin.ADMMConstraintSolver(3), pin.ADMMSolverSettings(), pin.ADMMSolverResult()
    return pin.PGSConstraintSolver(3), pin.PGSSolverSettings(), pin.PGSSolverResult()


def by_pinocchio(name, hit, ball):
    """The impact of leg and free ball by one of Pinocchio's cone solvers: impulse, residual."""
    leg, contact = hit.posture.leg, hit.contact
    model = leg.model
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    shell = pin.Inertia(ball.mass, np.zeros(3), ball.inertia * np.eye(3))
    model.appendBodyToJoint(joint, shell, pin.SE3.Identity())
    data = model.createData()
    q = np.concatenate([hit.posture.q, hit.ball_after.position, [0, 0, 0, 1]])
    v = np.concatenate([hit.v_before, hit.ball_before.velocity, hit.ball_before.spin])
    pin.forwardKinematics(model, data, q)
    axes = np.linalg.svd(contact.normal.reshape(1, 3))[2][[1, 2, 0]].T
    axes[:, 2] = contact.normal
    axes[:, 0] *= np.linalg.det(axes)
    frame = pin.SE3(axes, hit.posture.contact_point)
    at = [data.oMi[i].actInv(frame) for i in (leg.contact_joint, joint)]
    point = pin.PointContactConstraintModel(model, leg.contact_joint, at[0], joint, at[1])
    point.setFriction(contact.friction)
    models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    models.append(pin.ConstraintModel(point))
    datas.append(models[0].createData())
    pin.crba(model, data, q, pin.Convention.WORLD)  # what the constraint's Jacobian reads
    models[0].calc(model, data, datas[0])
    jacobian = pin.getConstraintsJacobian(model, data, models, datas)
    inertia = np.triu(data.M) + np.triu(data.M, 1).T
    delassus = jacobian @ np.linalg.solve(inertia, jacobian.T)
    free = jacobian @ v
    free[2] *= 1 + contact.restitution
    solver, settings, result = cone_solver(name)
    settings.max_iterations = 20_000
    for kind in ("feasibility", "complementarity"):
        setattr(settings, f"absolute_{kind}_tol", 1e-12)
        setattr(settings, f"relative_{kind}_tol", 1e-12)
    # A fresh operator: the solvers leave their damping in it. Their verdict is not read either.
    solver.solve(pin.DelassusOperatorDense(delassus), free, models, datas, settings, result)
    impulse = result.retrieveConstraintImpulses()
    u = delassus @ impulse + free
    size = np.linalg.norm(impulse[:2])
    across = contact.friction * impulse[2] * np.linalg.norm(u[:2])
    residual = max(
        abs(u[2]), size - contact.friction * impulse[2], abs(u[:2] @ impulse[:2] + across)
    )
    return axes @ impulse, residual


@pytest.mark.parametrize(("solver", "most"), [("ADMM", 1.0), ("PGS", 0.5)])
def test_pinocchios_cone_solvers_agree_where_they_converge(solver, most):
    converged = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        leg = kd.Leg.human() if seed % 2 else random_leg(rng)
        kick, options = random_kick(rng, leg, friction=[0.1, 0.4, 0.8][seed % 3])
        hit = kd.strike(*kick, **options)
        impulse, residual = by_pinocchio(solver, hit, kick[2])
        if residual <= 1e-8:
            converged += 1
            assert np.abs(impulse - hit.impulse).max() <= 1e-7 * np.linalg.norm(hit.impulse)
    assert converged >= most * 40 - 1
