"""Other pairs of bodies than leg and ball, and several contacts: by the same laws."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from chains import random_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import root

import kickdyn as kd
from kickdyn.impact.body import BallBody, Body, LegBody
from kickdyn.impact.contact_problem import ContactPoint, ContactProblem
from kickdyn.impact.laws import LAWS, solve_contacts

NEWTON = LAWS["newton"]


def moving(rng, centre, scale=3.0):
    return kd.BallState(centre, scale * rng.normal(size=3), 10 * scale * rng.normal(size=3))


def two_balls(seed, friction=0.3, e=0.7):
    """Balls of other sizes and masses that approach each other, and their contact."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    balls = [kd.Ball(mass=rng.uniform(0.1, 3), radius=rng.uniform(0.05, 0.3)) for _ in range(2)]
    first = moving(rng, np.zeros(3))
    second = moving(rng, (balls[0].radius + balls[1].radius) * n)
    closing = (first.velocity - second.velocity) @ n
    second = kd.BallState(
        second.position, second.velocity + min(0.0, closing - 1.0) * n, second.spin
    )
    bodies = (BallBody(balls[0], first, (n,), (-1.0,)), BallBody(balls[1], second, (n,)))
    spin = balls[0].radius * first.spin + balls[1].radius * second.spin
    point = ContactPoint(n, e, friction, tuple(second.velocity - first.velocity), tuple(spin))
    return ContactProblem((point,), bodies)


def after(problem, solution):
    """The states of the balls and the joint velocities of the legs."""
    return [
        body.after(solution.impulses, solution.tangential_impulses)
        if isinstance(body, BallBody)
        else body.v + body.jump(solution.impulses)[0]
        for body in problem.bodies
        if type(body) is not Body
    ]


def surface_velocity(ball, state, arm):
    return state.velocity + np.cross(state.spin, ball.radius * arm)


@pytest.mark.parametrize("law", ["newton", "stronge"])
@pytest.mark.parametrize("friction", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("seed", range(10))
def test_two_balls_collide(seed, friction, law):
    """Closed form: spheres have no coupling, so restitution and friction do not mix."""
    problem = two_balls(seed, friction)
    (first, second), n = problem.bodies, problem.contacts[0].normal
    solution = solve_contacts(problem, LAWS[law])
    m1, m2 = first.ball.mass, second.ball.mass
    u = surface_velocity(second.ball, second.before, -n)
    u -= surface_velocity(first.ball, first.before, n)
    closing = -u @ n
    pressing = 1.7 * closing * m1 * m2 / (m1 + m2)
    across = u + closing * n
    mobility = sum(1 / b.ball.mass + b.ball.radius**2 / b.ball.inertia for b in problem.bodies)
    size = min(np.linalg.norm(across) / mobility, friction * pressing)
    expected = pressing * n - size * across / np.linalg.norm(across)
    (impulse,) = solution.impulses
    assert impulse == pytest.approx(expected, abs=1e-12 * np.linalg.norm(expected))

    states = after(problem, solution)
    momentum = [
        sum(b.ball.mass * state.velocity for b, state in zip(problem.bodies, ball, strict=True))
        for ball in ([b.before for b in problem.bodies], states)
    ]
    assert momentum[1] == pytest.approx(momentum[0], abs=1e-12 * np.abs(momentum[0]).max())
    turned = [
        b.ball.inertia * (state.spin - b.before.spin)
        for b, state in zip(problem.bodies, states, strict=True)
    ]
    assert turned[0] == pytest.approx(first.ball.radius * np.cross(n, -expected), abs=1e-12)
    assert turned[1] == pytest.approx(second.ball.radius * np.cross(-n, expected), abs=1e-12)
    parting = (states[1].velocity - states[0].velocity) @ n
    assert parting == pytest.approx(0.7 * closing, rel=1e-12)


def test_the_sides_can_be_exchanged():
    problem = two_balls(1)
    n = -problem.contacts[0].normal
    bodies = tuple(
        dataclasses.replace(body, normals=(n,), sides=(-body.sides[0],))
        for body in reversed(problem.bodies)
    )
    velocity = tuple(-u for u in problem.contacts[0].centre_velocity)
    point = problem.contacts[0]._replace(normal=n, centre_velocity=velocity)
    other = ContactProblem((point,), bodies)
    solutions = [NEWTON.solve(each) for each in (problem, other)]
    assert solutions[1].impulses == pytest.approx(-solutions[0].impulses, rel=1e-13)
    assert solutions[1].energy_lost == pytest.approx(solutions[0].energy_lost, rel=1e-12)
    states = [*after(problem, solutions[0]), *reversed(after(other, solutions[1]))]
    for state, same in zip(states[:2], states[2:], strict=True):
        assert same.velocity == pytest.approx(state.velocity, rel=1e-13)
        assert same.spin == pytest.approx(state.spin, rel=1e-13)


def test_a_ball_between_two_walls_feels_both():
    """A wedge: the same impulses from either wall, whose sum turns the ball's way round."""
    ball, angle = kd.Ball(), 0.5
    normals = np.array([[np.sin(angle), 0, np.cos(angle)], [-np.sin(angle), 0, np.cos(angle)]])
    before = kd.BallState(np.zeros(3), (0.0, 0.0, -3.0), np.zeros(3))
    contacts = tuple(ContactPoint(n, 0.0, 0.0, (0.0, 0.0, -3.0)) for n in normals)
    problem = ContactProblem(contacts, (BallBody(ball, before, tuple(normals), (1.0, 1.0)), Body()))
    solution = solve_contacts(problem, NEWTON)
    size = ball.mass * 3.0 / (2 * np.cos(angle))
    assert solution.impulses == pytest.approx(size * normals, abs=1e-12)
    (state,) = after(problem, solution)
    assert state.velocity == pytest.approx(np.zeros(3), abs=1e-12)
    assert solution.energy_lost == pytest.approx(0.5 * ball.mass * 9.0, rel=1e-12)


def two_points(seed, friction=0.4, e=0.6):
    """A foot that touches a ball at two points of its surface, and the joint velocity."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, 6)
    posture = leg.posture(rng.uniform(-1, 1, size=leg.nq))
    ball = kd.Ball(mass=0.4, radius=0.1)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    aside = np.cross(n, rng.normal(size=3))
    aside /= np.linalg.norm(aside)
    normals = np.array([np.cos(0.4) * n + side * np.sin(0.4) * aside for side in (1, -1)])
    centre = posture.contact_point + ball.radius * n
    points = centre - ball.radius * normals
    model = leg.model
    data = model.createData()
    pin.computeJointJacobians(model, data, posture.q)
    pin.updateFramePlacements(model, data)
    frame = pin.getFrameJacobian(model, data, leg.frame_id, pin.LOCAL_WORLD_ALIGNED)
    origin = data.oMf[leg.frame_id].translation
    jacobian = np.vstack([frame[:3] - pin.skew(point - origin) @ frame[3:] for point in points])
    v = rng.normal(size=leg.nv)
    v *= np.sign((jacobian @ v)[:3] @ n)
    before = kd.BallState(centre, rng.normal(size=3) - 3 * n, 5 * rng.normal(size=3))
    velocities = [tuple(u) for u in before.velocity - (jacobian @ v).reshape(2, 3)]
    robot = LegBody(posture, v, jacobian, posture.whiten(jacobian).T, (-1.0, -1.0))
    struck = BallBody(ball, before, tuple(normals), (1.0, 1.0))
    spin = tuple(ball.radius * before.spin)
    contacts = tuple(
        ContactPoint(normal, e, friction, velocity, spin)
        for normal, velocity in zip(normals, velocities, strict=True)
    )
    return ContactProblem(contacts, (robot, struck))


def in_one_system(problem):
    """Mass matrix, Jacobian and velocity of leg and free ball as a single multibody system."""
    robot, struck = problem.bodies
    ball, nv = struck.ball, len(robot.v)
    mass = np.zeros((nv + 6, nv + 6))
    mass[:nv, :nv] = robot.posture.inertia
    mass[range(nv, nv + 6), range(nv, nv + 6)] = [ball.mass] * 3 + [ball.inertia] * 3
    rows = [np.hstack([np.eye(3), ball.radius * pin.skew(n)]) for n in struck.normals]
    jacobian = np.hstack([-robot.jacobian, np.vstack(rows)])
    velocity = np.concatenate([robot.v, struck.before.velocity, struck.before.spin])
    return mass, jacobian, velocity


def violations(problem, impulses, mass, jacobian, velocity):
    """Restitution, cones and sliding of Alart and Curnier, from the velocities after."""
    after = velocity + np.linalg.solve(mass, jacobian.T @ impulses.ravel())
    residuals = []
    for contact, p, u0, u1 in zip(
        problem.contacts,
        impulses.reshape(-1, 3),
        (jacobian @ velocity).reshape(-1, 3),
        (jacobian @ after).reshape(-1, 3),
        strict=True,
    ):
        n, e, mu, *_ = contact
        aimed = u1 @ n + e * min(u0 @ n, 0.0)
        pressing = max(0.0, p @ n - aimed)
        target = (p - (p @ n) * n) - (u1 - (u1 @ n) * n)
        size = np.linalg.norm(target)
        friction = target if size <= mu * pressing else mu * pressing / size * target
        residuals.append(p - pressing * n - friction)
    return np.concatenate(residuals)


@pytest.mark.parametrize(("friction", "e"), [(0.0, 0.6), (0.05, 0.6), (0.4, 0.6), (2.0, 0.0)])
@pytest.mark.parametrize("seed", range(8))
def test_a_foot_touches_the_ball_at_two_points(seed, friction, e):
    """Against the mass matrix of leg and ball as one system, and a root finder of its own."""
    problem = two_points(seed, friction, e)
    solution = solve_contacts(problem, NEWTON)
    mass, jacobian, velocity = system = in_one_system(problem)
    scale = np.abs(solution.impulses).max()
    assert scale > 0.0
    assert violations(problem, solution.impulses, *system) == pytest.approx(
        np.zeros(6), abs=1e-10 * max(scale, 1.0)
    )
    found = root(
        lambda p: violations(problem, p, *system), solution.impulses.ravel() * 1.01 + 1e-3
    ).x
    assert violations(problem, found, *system) == pytest.approx(np.zeros(6), abs=1e-8)
    # Impulses along the line between the points cancel: where both stick, they are open.
    expected = jacobian.T @ solution.impulses.ravel()
    assert jacobian.T @ found == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
    joints, state = after(problem, solution)
    all_after = velocity + np.linalg.solve(mass, jacobian.T @ solution.impulses.ravel())
    found = np.concatenate([joints, state.velocity, state.spin])
    assert found == pytest.approx(all_after, abs=1e-11 * np.abs(all_after).max())
    lost = 0.5 * (velocity @ mass @ velocity - all_after @ mass @ all_after)
    assert solution.energy_lost == pytest.approx(lost, abs=1e-11 * velocity @ mass @ velocity)


def test_a_wedged_ball_cannot_bounce():
    """Cones that contain the line between the points: restitution contradicts the rigid bodies."""
    with pytest.raises(kd.KickdynError, match="no impulses found at 2 contacts: the best have a"):
        solve_contacts(two_points(0, friction=2.0), NEWTON)


def test_both_points_press_in_some_of_these():
    pressing = [
        (solve_contacts(two_points(seed), NEWTON).impulses > 0).any(axis=1).all()
        for seed in range(8)
    ]
    assert any(pressing)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=50, derandomize=True, deadline=None)
def test_the_delassus_matrix_of_several_contacts_is_that_of_one_system(seed):
    problem = two_points(seed)
    axes, before = problem.in_contact_axes()
    mass, jacobian, velocity = in_one_system(problem)
    turn = np.zeros((6, 6))
    turn[:3, :3], turn[3:, 3:] = axes
    expected = turn.T @ jacobian @ np.linalg.solve(mass, jacobian.T) @ turn
    assert problem.delassus(axes) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert before == pytest.approx(turn.T @ jacobian @ velocity, abs=1e-11 * np.abs(before).max())


@pytest.mark.parametrize("law", ["paper", "stronge"])
def test_a_law_of_one_contact_refuses_several(law):
    with pytest.raises(
        kd.InvalidInput, match=f"law is '{law}', .* 2 simultaneous contacts.* need 'newton'"
    ):
        solve_contacts(two_points(0), LAWS[law])
