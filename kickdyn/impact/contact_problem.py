"""What an impact law is given, and what it answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kickdyn.ball import Ball
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross3

if TYPE_CHECKING:
    from kickdyn.impact.impact_result import Impact


class ContactProblem(NamedTuple):
    """One contact point, just before the impact; world frame.

    Attributes:
        normal: unit vector from the foot into the ball, shape `(3,)`.
        leg_rows: whose products are the leg's J M^-1 J^T, shape `(3, n)`, see
        `Posture.delassus_factor`.
        ball: the ball, rigid.
        centre_velocity: of the ball's centre relative to the foot's contact point [m/s].
        spin: of the ball [rad/s].
        restitution: coefficient e.
        friction: coefficient mu.
    """

    normal: Array
    leg_rows: Array
    ball: Ball
    centre_velocity: Array
    spin: Array
    restitution: float
    friction: float

    @classmethod
    def of(cls, hit: Impact) -> ContactProblem:
        """Return what the law of a strike was given."""
        return cls(
            normal=hit.contact.normal,
            leg_rows=hit.posture.delassus_factor(),
            ball=hit.ball,
            centre_velocity=hit.ball_before.velocity - hit.foot_velocity,
            spin=hit.ball_before.spin,
            restitution=hit.contact.restitution,
            friction=hit.contact.friction,
        )

    @property
    def velocity(self) -> Array:
        """Velocity of the ball's contact point relative to the foot's, shape `(3,)` [m/s]."""
        x, y, z = cross3(self.spin.tolist(), self.normal.tolist())
        u, v, w = self.centre_velocity.tolist()
        r = self.ball.radius
        return np.array((u - r * x, v - r * y, w - r * z))

    @property
    def leg_delassus(self) -> Array:
        """J M^-1 J^T of the leg, shape `(3, 3)` [1/kg]."""
        rows = self.leg_rows
        matrix: Array = rows.dot(rows.T)
        return matrix

    def delassus(self) -> Array:
        """Return leg and ball together, shape `(3, 3)` [1/kg]; the ball may turn."""
        return self.leg_delassus + ball_delassus(self.ball, self.normal)

    def delassus_in(self, axes: Array) -> Array:
        """Return the same in contact axes, whose third column is the normal.

        There the ball's share is diagonal, and a ball that hardly resists turning takes no digits
        from the normal. Rows are turned, not their products: so a foot that gives way much more
        across the normal takes none either.
        """
        rows = axes.T.dot(self.leg_rows)
        matrix: Array = rows.dot(rows.T)
        along = 1.0 / self.ball.mass
        across = along + self.ball.turning
        (xx, *_), (_, yy, _), (*_, zz) = matrix.tolist()
        matrix[0, 0], matrix[1, 1], matrix[2, 2] = xx + across, yy + across, zz + along
        return matrix

    def along_normal(self) -> tuple[float, float]:
        """Return speed of approach [m/s] and inverse mass [1/kg]; turning has no part in them."""
        x, y, z = self.normal.tolist()
        u, v, w = self.centre_velocity.tolist()
        row = self.normal.dot(self.leg_rows)
        return -(x * u + y * v + z * w), float(row.dot(row)) + 1.0 / self.ball.mass


def ball_delassus(ball: Ball, normal: Array) -> Array:
    """Return the ball's share of the Delassus matrix, shape `(3, 3)` [1/kg].

    Along the normal 1 / m; across it 1 / m + r^2 / I, for a push there turns the ball too.
    """
    turn, (x, y, z) = ball.turning, normal.tolist()
    xx, xy, xz, yy, yz, zz = x * x, x * y, x * z, y * y, y * z, z * z
    along = 1.0 / ball.mass + turn
    share = (
        *(along - turn * xx, -turn * xy, -turn * xz),
        *(-turn * xy, along - turn * yy, -turn * yz),
        *(-turn * xz, -turn * yz, along - turn * zz),
    )
    return np.array(share).reshape(3, 3)


class Solution(NamedTuple):
    """What a law decides.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        sticking: whether friction could hold the contact points together; False without any.
        energy_lost: kinetic energy that leaves leg and ball [J].
        tangential_impulse: the impulse's part across the normal, with its own digits, shape `(3,)`
        [N s].
    """

    impulse: Array
    sticking: bool
    energy_lost: float
    tangential_impulse: Array


Law = Callable[[ContactProblem], Solution]

NO_TANGENTIAL_IMPULSE: Array = np.frombuffer(bytes(24))
"""What a contact without friction does across the normal."""


def frictionless(problem: ContactProblem) -> Solution:
    """Return the impulse of Eq. (10), along the normal; law `paper` has another."""
    n, e = problem.normal, problem.restitution
    approach, give = problem.along_normal()
    p = (1.0 + e) * approach / give
    return Solution(p * n, False, 0.5 * p * (1.0 - e) * approach, NO_TANGENTIAL_IMPULSE)


def contact_axes(n: Array, u: Array) -> Array:
    """Return a rotation whose third column is n and whose first is along the sliding, if any."""
    nx, ny, nz = normal = n.tolist()
    ux, uy, uz = u.tolist()
    along = ux * nx + uy * ny + uz * nz
    x, y, z = ux - along * nx, uy - along * ny, uz - along * nz
    slides, moves = max(abs(x), abs(y), abs(z)), max(abs(ux), abs(uy), abs(uz))
    if slides <= 1e-12 * moves:
        least = min(range(3), key=lambda axis: abs(normal[axis]))
        aside = [-normal[least] * part for part in normal]
        aside[least] += 1.0
        x, y, z = aside
    elif slides < 0.1 * moves:  # what is left cancelled, with rounding along the normal: once more
        x, y, z = x / slides, y / slides, z / slides
        along = x * nx + y * ny + z * nz
        x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.hypot(x, y, z)
    x, y, z = first = x / length, y / length, z / length
    a, b, c = cross3(normal, first)
    return np.array((x, a, nx, y, b, ny, z, c, nz)).reshape(3, 3)
