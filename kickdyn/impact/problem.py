"""What an impact law is given, and what it answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kickdyn.ball import Ball
from kickdyn.checks import Array


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """One contact point, just before the impact; world frame.

    Attributes:
        normal: unit vector from the foot into the ball, shape `(3,)`.
        leg_delassus: J M^-1 J^T of the leg, shape `(3, 3)` [1/kg].
        ball: the ball, a rigid shell.
        centre_velocity: of the ball's centre relative to the foot's contact point [m/s].
        spin: of the ball [rad/s].
        restitution: coefficient e.
        friction: coefficient mu.
    """

    normal: Array
    leg_delassus: Array
    ball: Ball
    centre_velocity: Array
    spin: Array
    restitution: float
    friction: float

    @property
    def velocity(self) -> Array:
        """Velocity of the ball's contact point relative to the foot's, shape `(3,)` [m/s]."""
        return self.centre_velocity - self.ball.radius * cross(self.spin, self.normal)

    def delassus(self) -> Array:
        """Return leg and ball together, shape `(3, 3)` [1/kg]; the shell may turn."""
        turn = self.ball.radius**2 / self.ball.inertia
        ball = -turn * self.normal[:, None] * self.normal
        ball.flat[::4] += 1.0 / self.ball.mass + turn
        return self.leg_delassus + ball

    def along_normal(self) -> tuple[float, float]:
        """Return speed of approach [m/s] and inverse mass [1/kg]; turning has no part in them."""
        n = self.normal
        give = float(n.dot(self.leg_delassus).dot(n)) + 1.0 / self.ball.mass
        return -float(n.dot(self.centre_velocity)), give


class Solution(NamedTuple):
    """What a law decides.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        sticking: whether friction could hold the contact points together; False without any.
        energy_lost: kinetic energy that leaves leg and ball [J].
    """

    impulse: Array
    sticking: bool
    energy_lost: float


Law = Callable[[ContactProblem], Solution]


def frictionless(problem: ContactProblem) -> Solution:
    """Return the impulse of Eq. (10), along the normal; law `paper` has another."""
    n, e = problem.normal, problem.restitution
    approach, give = problem.along_normal()
    p = (1.0 + e) * approach / give
    return Solution(p * n, False, 0.5 * p * (1.0 - e) * approach)


def contact_axes(n: Array, u: Array) -> Array:
    """Return a rotation whose third column is n and whose first is along the sliding, if any."""
    across = u - n.dot(u) * n
    if max(map(abs, across.tolist())) <= 1e-12 * max(map(abs, u.tolist())):
        across = np.zeros(3)
        across[int(np.argmin(np.abs(n)))] = 1.0
        across -= n.dot(across) * n
    first = across / math.hypot(*across.tolist())
    return np.array([first, cross(n, first), n]).T


def cross(a: Array, b: Array) -> Array:
    """Return the cross product; numpy's takes ten times as long on two vectors."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
