"""Other pairs of bodies than leg and ball, several contacts, and relative motion at a contact."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form, differenced, optimized

import kickdyn as kd
from kickdyn.impact.contact_phases import contact_motion, free_rise, free_sliding, slip_direction
from kickdyn.impact.contact_problem import BallBody, Body, ContactPoint, ContactProblem
from kickdyn.impact.laws import LAWS, solve_contacts

NEWTON = LAWS["newton"]


def two_balls(seed, friction=0.3, e=0.7):
    """The contact of balls of different sizes and masses that approach, and their states."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    balls = [kd.Ball(mass=rng.uniform(0.1, 3), radius=rng.uniform(0.05, 0.3)) for _ in range(2)]
    velocities, spins = 3.0 * rng.normal(size=(2, 3)), 30.0 * rng.normal(size=(2, 3))
    closing = (velocities[0] - velocities[1]) @ n
    velocities[1] += min(0.0, closing - 1.0) * n
    states = [kd.BallState(np.zeros(3), v, w) for v, w in zip(velocities, spins, strict=True)]
    bodies = BallBody(balls[0], (n,), (-1.0,)), BallBody(balls[1], (n,))
    spin = balls[0].radius * spins[0] + balls[1].radius * spins[1]
    point = ContactPoint(n, e, friction, tuple(velocities[1] - velocities[0]), tuple(spin))
    return ContactProblem((point,), bodies), states


def states_after(problem, states, solution):
    """The states of the balls, which are the first bodies."""
    impulses = solution.impulses, solution.tangential_impulses
    return [b.after(x, *impulses) for b, x in zip(problem.bodies, states, strict=False)]


@pytest.mark.parametrize("law", ["newton", "stronge"])
@pytest.mark.parametrize("friction", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("seed", range(5))
def test_two_balls_collide(seed, friction, law):
    """Closed form: spheres have no coupling, so that restitution and friction are separate."""
    problem, states = two_balls(seed, friction)
    (first, second), n = problem.bodies, problem.contacts[0].normal
    solution = solve_contacts(problem, LAWS[law])
    m1, m2 = first.ball.mass, second.ball.mass
    u = states[1].velocity + np.cross(states[1].spin, -second.ball.radius * n)
    u -= states[0].velocity + np.cross(states[0].spin, first.ball.radius * n)
    closing = -u @ n
    pressing, sliding = 1.7 * closing * m1 * m2 / (m1 + m2), u + closing * n
    mobility = sum(1 / b.ball.mass + b.ball.radius**2 / b.ball.inertia for b in problem.bodies)
    size = min(np.linalg.norm(sliding) / mobility, friction * pressing)
    impulse = pressing * n - size * sliding / np.linalg.norm(sliding)
    agrees(solution.impulses[0], impulse, closed_form(10))
    one, two = states_after(problem, states, solution)
    agrees(m1 * (one.velocity - states[0].velocity), -impulse, closed_form(10))
    agrees(m2 * (two.velocity - states[1].velocity), impulse, closed_form(10))
    for body, before, state, lever, p in (
        (first, states[0], one, first.ball.radius * n, -impulse),
        (second, states[1], two, -second.ball.radius * n, impulse),
    ):
        spin = before.spin + np.cross(lever, p) / body.ball.inertia
        agrees(state.spin, spin, closed_form(10))


def two_contacts(seed, friction=0.3):
    """A ball that touches a wall and, on the other side of a contact, a second ball."""
    rng = np.random.default_rng(seed)
    n, m = rng.normal(size=(2, 3))
    n, m = n / np.linalg.norm(n), m / np.linalg.norm(m)
    balls = [kd.Ball(rng.uniform(0.1, 3), rng.uniform(0.05, 0.3)) for _ in range(2)]
    spins, velocities = 30 * rng.normal(size=(2, 3)), 3 * rng.normal(size=(2, 3))
    states = [kd.BallState(np.zeros(3), v, w) for v, w in zip(velocities, spins, strict=True)]
    bodies = (
        BallBody(balls[0], (n, m), (1.0, -1.0)),
        BallBody(balls[1], (n, m), (0.0, 1.0)),
        Body(),
    )
    surface = [balls[0].radius * spins[0], balls[0].radius * spins[0] + balls[1].radius * spins[1]]
    speeds = [velocities[0], velocities[1] - velocities[0]]
    contacts = [
        ContactPoint(normal, 0.5, friction, tuple(u), tuple(w))
        for normal, u, w in zip((n, m), speeds, surface, strict=True)
    ]
    return ContactProblem(tuple(contacts), bodies), states


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 38, 53])  # the last ones push one that recedes
def test_several_contacts_are_one_multibody_system(seed):
    """Delassus matrix, velocities and jumps by the Jacobian of both balls at both contacts."""
    problem, states = two_contacts(seed)
    one, two, _ = problem.bodies
    (n, m), (r1, r2) = one.normals, (one.ball.radius, two.ball.radius)
    jacobian, identity = np.zeros((6, 12)), np.eye(3)
    jacobian[:3, :6] = np.hstack([identity, r1 * pin.skew(n)])
    jacobian[3:, :6] = np.hstack([-identity, r1 * pin.skew(m)])
    jacobian[3:, 6:] = np.hstack([identity, r2 * pin.skew(m)])
    mass = np.repeat([one.ball.mass, one.ball.inertia, two.ball.mass, two.ball.inertia], 3)
    motion = [np.concatenate([state.velocity, state.spin]) for state in states]
    motion = np.concatenate(motion)
    axes, before = problem.in_contact_axes()
    rotation = np.zeros((6, 6))
    rotation[:3, :3], rotation[3:, 3:] = axes
    rows = rotation.T @ jacobian
    agrees(problem.delassus(axes), (rows / mass) @ rows.T, closed_form())
    agrees(before, rows @ motion, closed_form())
    solution = solve_contacts(problem, NEWTON)
    pressing = np.array([p @ normal for p, normal in zip(solution.impulses, (n, m), strict=True)])
    aimed = (
        before + problem.delassus(axes) @ np.ravel(np.einsum("kij,ki->kj", axes, solution.impulses))
    )[2::3] + 0.5 * np.minimum(before[2::3], 0.0)
    small = optimized(1e-10) * np.abs(before).max() * (1.0 + np.abs(pressing).max())
    assert min(aimed.min(), pressing.min()) > -small  # a contact that recedes is free
    np.testing.assert_allclose(aimed * pressing, 0.0, atol=small)
    after = motion + jacobian.T @ solution.impulses.ravel() / mass
    states = states_after(problem, states, solution)
    result = np.concatenate([[*state.velocity, *state.spin] for state in states])
    agrees(result, after, closed_form(10))
    lost = 0.5 * (motion @ (mass * motion) - after @ (mass * after))
    assert solution.energy_lost == pytest.approx(lost, rel=closed_form(1e4), abs=closed_form(1e4))


@pytest.mark.parametrize("seed", range(4))
def test_free_accelerations_are_derivatives_of_the_motion(seed):
    """Foot and ball on parabolas, in axes that turn with the foot, by central differences."""
    rng = np.random.default_rng(seed)
    reach, arm, ball, ball_spin, foot, spin, bias, turn, gravity = rng.normal(size=(9, 3))

    def motion(t):
        rotation = pin.exp3(spin * t + 0.5 * turn * t * t).T
        acceleration = bias + np.cross(spin, foot)  # of the joint's origin
        origin = foot * t + 0.5 * acceleration * t * t
        centre = arm + reach + ball * t + 0.5 * gravity * t * t
        vectors = ball + gravity * t, ball_spin, foot + acceleration * t, spin + turn * t
        return contact_motion(
            rotation @ (centre - origin) - arm, arm, *(rotation @ vector for vector in vectors)
        )

    h, (point, relative) = 1e-5, motion(0.0)
    expected = (np.array(motion(h)[1]) - motion(-h)[1]) / (2 * h)
    state = reach[2], point, relative, ball, ball_spin, spin, bias, turn, gravity
    agrees([*free_sliding(*state), free_rise(*state)], expected, 100 * differenced())


@pytest.mark.parametrize("seed", range(6))
def test_friction_opposes_the_sliding_that_it_leaves(seed):
    rng = np.random.default_rng(seed)
    root, sliding = rng.normal(size=(2, 2)), rng.normal(size=2)
    mobility = root @ root.T * 10.0 ** -(seed % 3)
    sliding *= 3.0 * np.linalg.norm(mobility) / np.linalg.norm(sliding)  # it does not stick
    x, y, gain = slip_direction(mobility[0, 0], mobility[0, 1], mobility[1, 1], *sliding)
    direction = np.array([x, y])
    assert np.linalg.norm(direction) == pytest.approx(1.0, rel=closed_form())
    assert gain > 0.0
    agrees(mobility @ direction + sliding, -gain * direction, closed_form(100))
