"""Other pairs of bodies than leg and ball, and several contacts: by the same laws."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from chains import random_leg
from scipy.optimize import root
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.impact.body import BallBody, Body, LegBody
from kickdyn.impact.contact_problem import ContactPoint, ContactProblem
from kickdyn.impact.laws import LAWS, solve_contacts

NEWTON = LAWS["newton"]


def two_balls(seed, friction=0.3, e=0.7):
    """Balls of different sizes and masses that approach each other, and their contact."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    balls = [kd.Ball(mass=rng.uniform(0.1, 3), radius=rng.uniform(0.05, 0.3)) for _ in range(2)]
    velocities, spins = 3.0 * rng.normal(size=(2, 3)), 30.0 * rng.normal(size=(2, 3))
    closing = (velocities[0] - velocities[1]) @ n
    velocities[1] += min(0.0, closing - 1.0) * n
    states = [kd.BallState(np.zeros(3), v, w) for v, w in zip(velocities, spins, strict=True)]
    bodies = (BallBody(balls[0], states[0], (n,), (-1.0,)), BallBody(balls[1], states[1], (n,)))
    spin = balls[0].radius * spins[0] + balls[1].radius * spins[1]
    point = ContactPoint(n, e, friction, tuple(velocities[1] - velocities[0]), tuple(spin))
    return ContactProblem((point,), bodies)


def states_after(problem, solution):
    """The states of the balls and the joint velocities of the legs."""
    return [
        body.after(solution.impulses, solution.tangential_impulses)
        if isinstance(body, BallBody)
        else body.v + body.jump(solution.impulses)[0]
        for body in problem.bodies
        if type(body) is not Body
    ]


@pytest.mark.parametrize("law", ["newton", "stronge"])
@pytest.mark.parametrize("friction", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("seed", range(5))
def test_two_balls_collide(seed, friction, law):
    """Closed form: spheres have no coupling, so that restitution and friction are separate."""
    problem = two_balls(seed, friction)
    (first, second), n = problem.bodies, problem.contacts[0].normal
    solution = solve_contacts(problem, LAWS[law])
    m1, m2 = first.ball.mass, second.ball.mass
    u = second.before.velocity + np.cross(second.before.spin, -second.ball.radius * n)
    u -= first.before.velocity + np.cross(first.before.spin, first.ball.radius * n)
    closing = -u @ n
    pressing, sliding = 1.7 * closing * m1 * m2 / (m1 + m2), u + closing * n
    mobility = sum(1 / b.ball.mass + b.ball.radius**2 / b.ball.inertia for b in problem.bodies)
    size = min(np.linalg.norm(sliding) / mobility, friction * pressing)
    impulse = pressing * n - size * sliding / np.linalg.norm(sliding)
    agrees(solution.impulses[0], impulse, closed_form(10))
    one, two = states_after(problem, solution)
    agrees(m1 * (one.velocity - first.before.velocity), -impulse, closed_form(10))
    agrees(m2 * (two.velocity - second.before.velocity), impulse, closed_form(10))
    for body, state, lever, p in (
        (first, one, first.ball.radius * n, -impulse),
        (second, two, -second.ball.radius * n, impulse),
    ):
        spin = body.before.spin + np.cross(lever, p) / body.ball.inertia
        agrees(state.spin, spin, closed_form(10))


def test_the_bodies_can_be_exchanged():
    problem = two_balls(1)
    n = -problem.contacts[0].normal
    bodies = tuple(
        dataclasses.replace(body, normals=(n,), sides=(-body.sides[0],))
        for body in reversed(problem.bodies)
    )
    velocity = tuple(-u for u in problem.contacts[0].centre_velocity)
    point = problem.contacts[0]._replace(normal=n, centre_velocity=velocity)
    exchanged = ContactProblem((point,), bodies)
    solutions = [NEWTON.solve(one) for one in (problem, exchanged)]
    agrees(solutions[1].impulses, -solutions[0].impulses, closed_form())
    assert solutions[1].energy_lost == pytest.approx(solutions[0].energy_lost, rel=closed_form(10))
    states = states_after(problem, solutions[0]), states_after(exchanged, solutions[1])[::-1]
    for state, same in zip(*states, strict=True):
        agrees(same.velocity, state.velocity, closed_form())
        agrees(same.spin, state.spin, closed_form())


def test_a_ball_between_two_walls_feels_both():
    """A wedge without friction: m v / (2 cos a) from either wall stops the ball."""
    ball, angle = kd.Ball(), 0.5
    normals = np.array([[np.sin(angle), 0, np.cos(angle)], [-np.sin(angle), 0, np.cos(angle)]])
    before = kd.BallState(np.zeros(3), (0.0, 0.0, -3.0), np.zeros(3))
    contacts = tuple(ContactPoint(n, 0.0, 0.0, (0.0, 0.0, -3.0)) for n in normals)
    problem = ContactProblem(contacts, (BallBody(ball, before, tuple(normals), (1.0, 1.0)), Body()))
    solution = solve_contacts(problem, NEWTON)
    agrees(solution.impulses, ball.mass * 3.0 / (2 * np.cos(angle)) * normals, closed_form(10))
    assert solution.energy_lost == pytest.approx(0.5 * ball.mass * 9.0, rel=closed_form(10))


def two_points(seed, friction=0.4, e=0.6):
    """A foot that touches a ball at two points of its surface."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, 6)
    posture = leg.posture(rng.uniform(-1, 1, size=leg.nq))
    ball = kd.Ball(mass=0.4, radius=0.1)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    tangent = np.cross(n, rng.normal(size=3))
    tangent /= np.linalg.norm(tangent)
    normals = np.array([np.cos(0.4) * n + side * np.sin(0.4) * tangent for side in (1, -1)])
    centre = posture.contact_point + ball.radius * n
    model = leg.model
    data = model.createData()
    pin.computeJointJacobians(model, data, posture.q)
    pin.updateFramePlacements(model, data)
    frame = pin.getFrameJacobian(model, data, leg.frame_id, pin.LOCAL_WORLD_ALIGNED)
    levers = centre - ball.radius * normals - data.oMf[leg.frame_id].translation
    jacobian = np.vstack([frame[:3] - pin.skew(lever) @ frame[3:] for lever in levers])
    v = rng.normal(size=leg.nv)
    v *= np.sign((jacobian @ v)[:3] @ n)
    before = kd.BallState(centre, rng.normal(size=3) - 3 * n, 5 * rng.normal(size=3))
    velocities = before.velocity - (jacobian @ v).reshape(2, 3)
    robot = LegBody(posture, v, jacobian, posture.whiten(jacobian).T, (-1.0, -1.0))
    struck, spin = BallBody(ball, before, tuple(normals), (1.0, 1.0)), ball.radius * before.spin
    contacts = tuple(
        ContactPoint(normal, e, friction, tuple(velocity), tuple(spin))
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
    return mass, jacobian, np.concatenate([robot.v, struck.before.velocity, struck.before.spin])


def violations(problem, impulses, mass, jacobian, velocity):
    """Restitution, cones and sliding of Alart and Curnier, from the velocities after."""
    after = velocity + np.linalg.solve(mass, jacobian.T @ impulses.ravel())
    residuals = []
    for (n, e, mu, *_), p, u0, u1 in zip(
        problem.contacts, impulses.reshape(-1, 3), (jacobian @ velocity).reshape(-1, 3),
        (jacobian @ after).reshape(-1, 3), strict=True,
    ):  # fmt: skip
        pressing = max(0.0, p @ n - u1 @ n - e * min(u0 @ n, 0.0))
        target = (p - (p @ n) * n) - (u1 - (u1 @ n) * n)
        size = np.linalg.norm(target)
        friction = target if size <= mu * pressing else mu * pressing / size * target
        residuals.append(p - pressing * n - friction)
    return np.concatenate(residuals)


@pytest.mark.parametrize(("friction", "e"), [(0.0, 0.6), (0.05, 0.6), (0.4, 0.6), (2.0, 0.0)])
@pytest.mark.parametrize("seed", range(4))
def test_a_foot_touches_the_ball_at_two_points(seed, friction, e):
    """Against the mass matrix of leg and ball as one system, and scipy's root finder."""
    problem = two_points(seed, friction, e)
    axes, before = problem.in_contact_axes()
    mass, jacobian, velocity = system = in_one_system(problem)
    rotation = np.zeros((6, 6))
    rotation[:3, :3], rotation[3:, 3:] = axes
    delassus = rotation.T @ jacobian @ np.linalg.solve(mass, jacobian.T) @ rotation
    agrees(problem.delassus(axes), delassus, closed_form(np.linalg.cond(mass)))
    agrees(before, rotation.T @ jacobian @ velocity, closed_form(10))

    solution = solve_contacts(problem, NEWTON)
    scale = np.abs(solution.impulses).max()
    residual = violations(problem, solution.impulses, *system)
    np.testing.assert_allclose(residual, 0.0, atol=1e-9 * max(scale, 1.0))
    assert scale > 0.0
    start = solution.impulses.ravel() * 1.01 + 1e-3
    search = root(lambda p: violations(problem, p, *system), start)
    np.testing.assert_allclose(search.fun, 0.0, atol=optimized(1e-9))
    # Impulses along the line between the points cancel: where both stick, they are open.
    gained = jacobian.T @ solution.impulses.ravel()
    agrees(jacobian.T @ search.x, gained, optimized(1e-7))
    joints, state = states_after(problem, solution)
    after = velocity + np.linalg.solve(mass, gained)
    agrees(np.concatenate([joints, state.velocity, state.spin]), after, closed_form(1000))
    energy = 0.5 * velocity @ mass @ velocity
    lost = energy - 0.5 * after @ mass @ after
    assert solution.energy_lost == pytest.approx(lost, abs=closed_form(100) * energy)


@pytest.mark.slow
def test_a_wedged_ball_cannot_bounce():
    """Cones that contain the line between the points: restitution contradicts the rigid bodies."""
    with pytest.raises(kd.KickdynError, match="no impulses found at 2 contacts"):
        solve_contacts(two_points(0, friction=2.0), NEWTON)


@pytest.mark.parametrize("law", ["paper", "stronge"])
def test_a_law_of_one_contact_refuses_several(law):
    with pytest.raises(kd.InvalidInput, match=f"'{law}'.* 2 simultaneous contacts.*'newton'"):
        solve_contacts(two_points(0), LAWS[law])
