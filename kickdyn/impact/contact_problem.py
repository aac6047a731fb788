"""The contact problem that an impact law solves, and the solution it returns."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kickdyn.ball import Ball
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross3


class ContactProblem(NamedTuple):
    r"""One contact point just before the impact, in the world frame.

    With the relative velocity :math:`u` of the contact points, ball minus foot, an impulse
    :math:`p` on the ball changes it by :math:`G p`, where the Delassus matrix

    .. math:: G = J M^{-1} J^T + \frac{1}{m} I + \frac{r^2}{I_b} (I - n n^T)

    has a share of the leg and one of the ball, whose tangential impulse also turns it.

    Attributes:
        normal: n, unit vector from the foot into the ball, shape `(3,)`.
        delassus_factor: F with F F^T = J M^-1 J^T, shape `(3, k)`; `Posture.delassus_factor`.
        ball: mass m, radius r and inertia I_b.
        centre_velocity: of the ball's centre minus that of the foot's contact point,
            shape `(3,)` [m/s].
        spin: of the ball, shape `(3,)` [rad/s].
        restitution: coefficient e.
        friction: Coulomb's coefficient mu.
    """

    normal: Array
    delassus_factor: Array
    ball: Ball
    centre_velocity: Array
    spin: Array
    restitution: float
    friction: float

    @property
    def velocity(self) -> Array:
        r"""Relative velocity u of the contact points, shape `(3,)` [m/s].

        :math:`u = u_c - r\, \omega \times n` with the centre velocity :math:`u_c`.
        """
        x, y, z = cross3(self.spin.tolist(), self.normal.tolist())
        u, v, w = self.centre_velocity.tolist()
        r = self.ball.radius
        return np.array((u - r * x, v - r * y, w - r * z))

    @property
    def approach_speed(self) -> float:
        """Speed of approach along the normal [m/s]; the spin, however fast, costs it no digits."""
        x, y, z = self.normal.tolist()
        u, v, w = self.centre_velocity.tolist()
        return float(-(x * u + y * v + z * w))

    @property
    def inverse_mass(self) -> float:
        """Inverse effective mass n . G n of leg and ball along the normal [1/kg]."""
        row = self.normal.dot(self.delassus_factor)
        return float(row.dot(row)) + 1.0 / self.ball.mass

    def delassus(self) -> Array:
        """Return G in the world frame, shape `(3, 3)` [1/kg]."""
        turn, n, factor = self.ball.turning, self.normal, self.delassus_factor
        ball = (1.0 / self.ball.mass + turn) * np.eye(3) - turn * np.outer(n, n)
        return np.asarray(factor.dot(factor.T) + ball)

    def delassus_in(self, axes: Array) -> Array:
        """Return G in contact axes, whose third column is the normal, shape `(3, 3)` [1/kg].

        There the ball's share is diagonal, so a ball that hardly resists turning takes no digits
        from the normal. The rows of the factor are rotated, not their products: a foot that is much
        more mobile across the normal takes none either.
        """
        rows = axes.T.dot(self.delassus_factor)
        matrix: Array = rows.dot(rows.T)
        along = 1.0 / self.ball.mass
        across = along + self.ball.turning
        (xx, *_), (_, yy, _), (*_, zz) = matrix.tolist()
        matrix[0, 0], matrix[1, 1], matrix[2, 2] = xx + across, yy + across, zz + along
        return matrix


class Solution(NamedTuple):
    """What an impact law returns.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        sticking: whether friction can stop the contact points from sliding; False without friction.
        energy_lost: kinetic energy that leg and ball lose [J].
        tangential_impulse: part of the impulse across the normal, computed on its own so that it
            keeps its digits, shape `(3,)` [N s].
    """

    impulse: Array
    sticking: bool
    energy_lost: float
    tangential_impulse: Array


@dataclass(frozen=True)
class ImpactLaw:
    """An impact law and what it can do; whoever cannot use a law as it is refuses it.

    Attributes:
        name: the argument `law` of `kickdyn.strike`.
        solve: function that returns the solution of a contact problem.
        several_contacts: whether `kickdyn.unilateral_strike` solves this law, for the ball and all
            points of the feet at once.
        has_slopes: whether `kickdyn.Impact.sensitivity` differentiates this law.
        has_kernel: whether the compiled kernels of sweeps compute this law; other laws are computed
            posture by posture.
        eq_10_without_friction: whether the law is `frictionless` at a friction of 0, so that
            `pin.impulseDynamics` computes it.
    """

    name: str
    solve: Callable[[ContactProblem], Solution]
    several_contacts: bool = False
    has_slopes: bool = False
    has_kernel: bool = False
    eq_10_without_friction: bool = False


def frictionless(problem: ContactProblem) -> Solution:
    r"""Return the impulse along the normal of Eq. (10), :math:`p = (1 + e)\, m_\mathrm{eff}\, u_n`.

    The effective mass is that of leg and ball together. Laws `newton` and `stronge` agree on it.
    """
    e, speed = problem.restitution, problem.approach_speed
    p = (1.0 + e) * speed / problem.inverse_mass
    return Solution(p * problem.normal, False, 0.5 * p * (1.0 - e) * speed, np.zeros(3))


def contact_axes(n: Array, u: Array) -> Array:
    """Return a rotation whose third column is n and whose first is along the sliding, if any.

    It is from contact axes to the axes of the unit normal n and the relative velocity u, both
    `(3,)`.
    """
    nx, ny, nz = normal = n.tolist()
    ux, uy, uz = u.tolist()
    along = ux * nx + uy * ny + uz * nz
    x, y, z = ux - along * nx, uy - along * ny, uz - along * nz
    sliding, speed = max(abs(x), abs(y), abs(z)), max(abs(ux), abs(uy), abs(uz))
    if sliding <= 1e-12 * speed:
        least = min(range(3), key=lambda axis: abs(normal[axis]))
        tangent = [-normal[least] * part for part in normal]
        tangent[least] += 1.0
        x, y, z = tangent
    elif sliding < 0.1 * speed:  # cancellation left rounding along the normal: project once more
        x, y, z = x / sliding, y / sliding, z / sliding
        along = x * nx + y * ny + z * nz
        x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.hypot(x, y, z)
    x, y, z = first = x / length, y / length, z / length
    a, b, c = cross3(normal, first)
    return np.array((x, a, nx, y, b, ny, z, c, nz)).reshape(3, 3)
