"""Random contacts for property tests: any leg, however lopsided, any approach."""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

import kickdyn as kd
from kickdyn.impact.contact_problem import BallBody, Body, ContactPoint, ContactProblem, LegBody
from kickdyn.impact.laws import solve_paper
from kickdyn.impact.newton_law import solve_newton
from kickdyn.impact.stronge_law import solve_stronge


class BareBody(Body):
    """A body given by its Delassus matrix alone, as the laws see it."""

    is_free = True

    def __init__(self, matrix):
        self.matrix = matrix

    def delassus(self, axes):
        return axes[0].T @ self.matrix @ axes[0]

    def inverse_mass(self, direction):
        return direction @ self.matrix @ direction


@dataclass
class BareContact:
    """A contact given by its Delassus matrix alone."""

    matrix: np.ndarray
    velocity: np.ndarray
    restitution: float
    friction: float
    normal: np.ndarray

    def problem(self):
        velocity = tuple(self.velocity.tolist())
        point = ContactPoint(self.normal, self.restitution, self.friction, velocity)
        return ContactProblem((point,), (BareBody(self.matrix),))

    def delassus(self):
        return self.matrix


@dataclass
class LegAndBall:
    """A leg given by the factor of its Delassus matrix, at rest, and a ball that comes to it."""

    normal: np.ndarray
    delassus_factor: np.ndarray
    centre_velocity: np.ndarray
    restitution: float
    friction: float
    ball: kd.Ball = field(default_factory=kd.Ball)
    spin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def problem(self):
        leg = LegBody(None, None, self.delassus_factor)
        before = kd.BallState(np.zeros(3), self.centre_velocity, self.spin)
        spin = tuple((self.ball.radius * before.spin).tolist())
        velocity = tuple(before.velocity.tolist())
        point = ContactPoint(self.normal, self.restitution, self.friction, velocity, spin)
        return ContactProblem((point,), (leg, BallBody(self.ball, (self.normal,))))

    @property
    def velocity(self):
        return self.centre_velocity - self.ball.radius * np.cross(self.spin, self.normal)

    def delassus(self):
        ball, n = self.ball, self.normal
        turning = ball.radius**2 / ball.inertia * (np.eye(3) - np.outer(n, n))
        return self.delassus_factor @ self.delassus_factor.T + np.eye(3) / ball.mass + turning


class SingleSolution(NamedTuple):
    """The solution of a law at a single contact."""

    impulse: np.ndarray
    sticking: bool
    energy_lost: float
    tangential_impulse: np.ndarray


def solve_single(solve, contact):
    (impulse,), (sticking,), energy_lost, (tangential,), _ = solve(contact.problem())
    return SingleSolution(impulse, sticking, energy_lost, tangential)


by_newton = partial(solve_single, solve_newton)
by_stronge = partial(solve_single, solve_stronge)
by_paper = partial(solve_single, solve_paper)


def random_contact(seed, decades=6, friction=None, restitution=None):
    """Any symmetric positive matrix of condition up to 10^decades, mu and e at their ends, too."""
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = (turn * 10 ** rng.uniform(-decades / 2, decades / 2, size=3)) @ turn.T
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    velocity = rng.normal(size=3) * 10 ** rng.uniform(-2, 2, size=3)
    velocity -= 2.0 * max(0.0, velocity @ normal) * normal
    mu = rng.choice([0.0, 10 ** rng.uniform(-2, 1), rng.uniform(0, 10)], p=[0.1, 0.5, 0.4])
    e = rng.choice([0.0, 1.0, rng.random()])
    e, mu = e if restitution is None else restitution, mu if friction is None else friction
    return BareContact((matrix + matrix.T) / 2, velocity, e, mu, normal)


def random_problem(seed, friction=None):
    """Any symmetric positive leg, however lopsided, and any ball that comes towards it."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(3, rng.integers(1, 6))) * 10 ** rng.uniform(-1.5, 1.5, size=(3, 1))
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    velocity = rng.normal(size=3) * 10 ** rng.uniform(-2, 2)
    velocity -= (1.0 + rng.random()) * max(0.0, velocity @ normal) * normal
    ball = kd.Ball(mass=10 ** rng.uniform(-2, 1), radius=10 ** rng.uniform(-2, 0))
    spin, e = rng.normal(size=3) * 10 ** rng.uniform(-2, 2), rng.choice([0.0, 1.0, rng.random()])
    mu = 10 ** rng.uniform(-2, 1) if friction is None else friction
    return LegAndBall(normal, rows, velocity, e, mu, ball, spin)


def split(problem, vector):
    """Return the part along the normal, and the part across it."""
    normal = float(problem.normal @ vector)
    return normal, vector - normal * problem.normal


def planar_attack(friction, offset, speed=14.0, e=0.8):
    """A particle of a leg that attacks along x; the normal leans by `offset` [rad]."""
    normal, velocity = np.array([math.cos(offset), 0.0, math.sin(offset)]), np.array([-speed, 0, 0])
    return LegAndBall(normal, np.eye(3) / np.sqrt(5.0), velocity, e, friction, kd.Ball.paper())


def random_strikes(rng, leg, n, speed_table=False):
    """Contacts of all directions, with spin and offsets: they stick, slip, or there is none."""
    q, v = rng.uniform(-0.6, 0.6, (n, leg.nq)), 5.0 * rng.normal(size=(n, leg.nv))
    contacts, balls = [], []
    for _ in range(n):
        e = [(2.0, 0.8), (20.0, 0.5)] if speed_table else rng.uniform(0, 1)
        friction = float(rng.choice([0.0, 0.05, 0.3, 2.0]))
        contacts.append(kd.Contact(rng.normal(size=3), e, friction, 0.02 * rng.normal(size=3)))
        factor = rng.choice([np.inf, rng.uniform(0.3, 0.6)])
        balls.append(kd.Ball(*rng.uniform((0.2, 0.05), (0.6, 0.15)), factor))
    motion = {"ball_velocity": rng.normal(size=(n, 3)), "ball_spin": 20 * rng.normal(size=(n, 3))}
    return q, v, balls, contacts, motion
