"""Random contacts for property tests: any leg, however lopsided, any approach."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import kickdyn as kd
from kickdyn.impact.contact_problem import ContactProblem


@dataclass
class BareContact:
    """A contact given by its Delassus matrix alone, as the laws see it."""

    matrix: np.ndarray
    velocity: np.ndarray
    restitution: float
    friction: float
    normal: np.ndarray
    ball: ClassVar = kd.Ball()  # laws ask only whether it can move

    def delassus(self):
        return self.matrix

    def delassus_in(self, axes):
        return axes.T @ self.matrix @ axes

    @property
    def approach_speed(self):
        return -self.normal @ self.velocity

    @property
    def inverse_mass(self):
        return self.normal @ self.matrix @ self.normal


def random_contact(seed, decades=6, friction=None, restitution=None):
    """Any symmetric positive matrix of condition up to 10^decades, mu and e at their ends too."""
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = (turn * 10 ** rng.uniform(-decades / 2, decades / 2, size=3)) @ turn.T
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    velocity = rng.normal(size=3) * 10 ** rng.uniform(-2, 2, size=3)
    velocity -= 2.0 * max(0.0, velocity @ normal) * normal
    mu = rng.choice([0.0, 10 ** rng.uniform(-2, 1), rng.uniform(0, 10)], p=[0.1, 0.5, 0.4])
    e = rng.choice([0.0, 1.0, rng.random()])
    return BareContact(
        (matrix + matrix.T) / 2,
        velocity,
        e if restitution is None else restitution,
        mu if friction is None else friction,
        normal,
    )


def random_problem(seed, friction=None):
    """Any symmetric positive leg, however lopsided, and any ball that comes towards it."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(3, rng.integers(1, 6))) * 10 ** rng.uniform(-1.5, 1.5, size=(3, 1))
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    velocity = rng.normal(size=3) * 10 ** rng.uniform(-2, 2)
    velocity -= (1.0 + rng.random()) * max(0.0, velocity @ normal) * normal
    return ContactProblem(
        normal=normal,
        delassus_factor=rows,
        ball=kd.Ball(mass=10 ** rng.uniform(-2, 1), radius=10 ** rng.uniform(-2, 0)),
        centre_velocity=velocity,
        spin=rng.normal(size=3) * 10 ** rng.uniform(-2, 2),
        restitution=rng.choice([0.0, 1.0, rng.random()]),
        friction=10 ** rng.uniform(-2, 1) if friction is None else friction,
    )


def split(problem, vector):
    """Return the part along the normal, and the rest."""
    normal = float(problem.normal @ vector)
    return normal, vector - normal * problem.normal


def planar_attack(friction, offset, speed=14.0, e=0.8):
    """A particle of a leg that attacks along x; the normal leans by `offset` [rad]."""
    return ContactProblem(
        normal=np.array([math.cos(offset), 0.0, math.sin(offset)]),
        delassus_factor=np.eye(3) / np.sqrt(5.0),
        ball=kd.Ball.paper(),
        centre_velocity=np.array([-speed, 0.0, 0.0]),
        spin=np.zeros(3),
        restitution=e,
        friction=friction,
    )
