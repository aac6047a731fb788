"""The bodies and the contact problem that an impact law solves, and the solution it returns."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import Triple, cross3
from kickdyn.core.validation import Array, read_only
from kickdyn.robot.leg import Posture


class Body:
    """A body of an impact with k contacts: its share of the Delassus matrix.

    As it stands, it is an obstacle at rest that no impulse moves: the ground or a wall.
    """

    is_free: bool = False  # whether the body can move in every direction

    def delassus(self, axes: Array) -> Array:
        """Return the share of the Delassus matrix in contact axes, shape `(3 k, 3 k)` [1/kg].

        The rotations from contact axes, with the normal last, to world axes are `(k, 3, 3)`.
        """
        return np.zeros((3 * len(axes), 3 * len(axes)))

    def inverse_mass(self, direction: Array) -> float:
        """Return the share of the inverse effective mass at a single contact [1/kg].

        The impulse acts along a unit vector, `(3,)`, without turning a ball.
        """
        return 0.0


@dataclass(eq=False)
class BallBody(Body):
    """A ball, which is touched on its surface."""

    ball: Ball  # mass m, radius r and inertia I_b
    normals: tuple[Array, ...]  # of the contacts
    sides: tuple[float, ...] = (1.0,)  # of the ball at the contacts, -1, 0 or 1

    @property
    def is_free(self) -> bool:  # type: ignore[override]
        """Whether the ball is no obstacle."""
        return self.ball.mass < math.inf

    def delassus(self, axes: Array) -> Array:
        r"""Return the share of the Delassus matrix in contact axes, shape `(3 k, 3 k)` [1/kg].

        Contacts i and j whose second body is the ball have the block

        .. math:: \frac1m I + \frac{r^2}{I_b} (n_i \cdot n_j\, I - n_j n_i^T) .

        It is diagonal for i = j: a ball that hardly resists turning takes no digits from the
        normal.
        """
        along, turning = 1.0 / self.ball.mass, self.ball.turning
        diagonal = _diagonal(along + turning, along)
        if len(axes) == 1:
            return diagonal
        matrix = np.kron(np.diag(np.abs(self.sides)), diagonal)
        inward = [side * rotation[:, 2] for side, rotation in zip(self.sides, axes, strict=True)]
        for i, j in combinations(range(len(axes)), 2):
            angular = inward[i].dot(inward[j]) * np.eye(3) - np.outer(inward[j], inward[i])
            block = self.sides[i] * self.sides[j] * (along * np.eye(3) + turning * angular)
            rows, columns = slice(3 * i, 3 * i + 3), slice(3 * j, 3 * j + 3)
            matrix[rows, columns] = axes[i].T @ block @ axes[j]
            matrix[columns, rows] = matrix[rows, columns].T
        return matrix

    def inverse_mass(self, direction: Array) -> float:
        return 1.0 / self.ball.mass

    def after(self, before: BallState, impulses: Array, tangential_impulses: Array) -> BallState:
        r"""Return the ball just after impulses at the contacts, shape `(k, 3)` [N s].

        Only their parts across the normals, of the same shape, turn it:

        .. math:: v^+ = v + \frac1m \sum \pm p_i, \qquad
                  \omega^+ = \omega - \frac{r}{I_b} \sum n_i \times p_i .
        """
        vx, vy, vz = before.velocity.tolist()
        wx, wy, wz = before.spin.tolist()
        mass, gain = self.ball.mass, self.ball.radius / self.ball.inertia
        for i, side in enumerate(self.sides):
            if side:
                px, py, pz = impulses[i].tolist()
                vx, vy, vz = vx + side * px / mass, vy + side * py / mass, vz + side * pz / mass
                tx, ty, tz = cross3(self.normals[i].tolist(), tangential_impulses[i].tolist())
                wx, wy, wz = wx - gain * tx, wy - gain * ty, wz - gain * tz
        velocity, spin = np.array((vx, vy, vz)), np.array((wx, wy, wz))
        return BallState.computed(before.position, velocity, spin)


@lru_cache
def _diagonal(across: float, along: float) -> Array:
    """Return a matrix in contact axes, stored because numpy takes longer to make it."""
    return read_only(np.diag((across, across, along)))


@dataclass(eq=False)
class LegBody(Body):
    """A leg, or another articulated body, in a posture; a planar one cannot leave its plane."""

    posture: Posture  # its inertia, supports and loops
    jacobian: Array  # of the contact points, shape `(3 k, nv)`
    # F with F F^T = J M^-1 J^T, shape `(3 k, n)` [kg^-1/2, world frame]; the rows of a contact have
    # the sign of its side, or all of them have the wrong sign
    factor: Array
    sides: tuple[float, ...] = (-1.0,)  # of the leg at the contacts, -1 or 1

    def delassus(self, axes: Array) -> Array:
        # The rows of the factor are rotated, not their products: a foot that is much more mobile
        # across the normal takes no digits from the normal.
        if len(axes) == 1:  # several take 3 us more
            rows = axes[0].T.dot(self.factor)
        else:
            blocks = zip(axes, np.split(self.factor, len(axes)), strict=True)
            rows = np.concatenate([rotation.T.dot(block) for rotation, block in blocks])
        product: Array = rows.dot(rows.T)
        return product

    def inverse_mass(self, direction: Array) -> float:
        row = direction.dot(self.factor)
        return float(row.dot(row))

    def jump(self, impulses: Array) -> tuple[Array, Array]:
        """Return the jump of the joint velocity and the impulses of the leg's constraints."""
        pushes = np.array(self.sides)[:, None] * impulses
        return self.posture.respond(pushes.ravel() @ self.jacobian)


NO_VELOCITY: Triple = (0.0, 0.0, 0.0)
"""Velocity of contact points at rest [m/s]."""


class ContactPoint(NamedTuple):
    """A point at which two bodies touch."""

    normal: Array  # n, unit vector from the first body into the second, `(3,)` [world frame]
    restitution: float  # coefficient e
    friction: float  # Coulomb's coefficient mu
    # of the second body at the contact minus the first's, without what spins of balls add [m/s]
    centre_velocity: Triple = NO_VELOCITY
    surface_spin: Triple = NO_VELOCITY  # sum of radius times spin of the balls that touch [m/s]

    @property
    def velocity(self) -> Triple:
        r"""Relative velocity u of the contact points [m/s].

        :math:`u = u_c - r\, \omega \times n` with the `centre_velocity` :math:`u_c`.
        """
        if self.surface_spin is NO_VELOCITY:
            return self.centre_velocity
        u, v, w = self.centre_velocity
        x, y, z = cross3(self.surface_spin, self.normal.tolist())
        return u - x, v - y, w - z

    @property
    def approach_speed(self) -> float:
        """Speed of approach along the normal [m/s]; a spin, however fast, costs it no digits."""
        x, y, z = self.normal.tolist()
        u, v, w = self.centre_velocity
        return float(-(x * u + y * v + z * w))


class ContactProblem(NamedTuple):
    r"""Bodies just before an impact, and the k points at which they touch.

    Impulses p, stacked, change the relative velocities of the contact points by :math:`G p`. The
    Delassus matrix G is the sum of the bodies' shares; for a leg that strikes a ball it is

    .. math:: G = J M^{-1} J^T + \frac{1}{m} I + \frac{r^2}{I_b} (I - n n^T) .
    """

    contacts: tuple[ContactPoint, ...]
    bodies: tuple[Body, ...]  # that touch at them

    def inverse_mass(self, direction: Array) -> float:
        """Return the inverse effective mass of a single contact along a unit vector [1/kg]."""
        return sum(body.inverse_mass(direction) for body in self.bodies)

    def in_contact_axes(self) -> tuple[Array, list[float]]:
        """Return rotations from contact axes to the world's, and velocities in these axes.

        The rotations have shape `(k, 3, 3)` (see `tangents`), the velocities length 3 k [m/s].
        """
        entries: list[float] = []
        before: list[float] = []
        for contact in self.contacts:
            x, y, z = normal = contact.normal.tolist()
            u, v, w = contact.centre_velocity
            along = x * u + y * v + z * w  # without spins: fast ones would cost its digits
            u, v, w = velocity = contact.velocity
            (a, b, c), (d, e, f) = tangents(normal, velocity)
            entries += (a, d, x, b, e, y, c, f, z)
            before += (a * u + b * v + c * w, d * u + e * v + f * w, along)
        return np.array(entries).reshape(-1, 3, 3), before

    def delassus(self, axes: Array) -> Array:
        """Return G in contact axes, shape `(3 k, 3 k)` [1/kg]; `axes` is `(k, 3, 3)`."""
        total = self.bodies[0].delassus(axes)
        for body in self.bodies[1:]:
            total = total + body.delassus(axes)
        return total


class Solution(NamedTuple):
    """What an impact law returns for k contacts."""

    impulses: Array  # on the second body of each contact, shape `(k, 3)` [N s, world frame]
    # for each contact, whether friction can stop the points from sliding; False without friction
    sticking: tuple[bool, ...]
    energy_lost: float  # kinetic energy that the bodies lose [J]
    # parts of the impulses across the normals, computed separately so that they keep their digits
    tangential_impulses: Array
    residual: float = 0.0  # of an iteration, relative to the largest impulse or velocity


def solution_in_world(
    axes: Array,
    impulses: Sequence[float],
    sticking: tuple[bool, ...],
    energy_lost: float,
    residual: float = 0.0,
) -> Solution:
    """Return the solution of 3 k impulses in contact axes; `axes` is `(k, 3, 3)`."""
    total: list[Triple] = []
    tangential: list[Triple] = []
    for k, ((a, d, x), (b, e, y), (c, f, z)) in enumerate(axes.tolist()):
        p, q, r = impulses[3 * k : 3 * k + 3]
        u, v, w = across = a * p + d * q, b * p + e * q, c * p + f * q
        tangential.append(across)
        total.append((u + x * r, v + y * r, w + z * r))
    return Solution(np.array(total), sticking, energy_lost, np.array(tangential), residual)


@dataclass(frozen=True)
class ImpactLaw:
    """An impact law and its abilities; functions refuse a law that they cannot serve.

    Attributes:
        name: the argument `law` of `kickdyn.strike`.
        solve: function that returns the solution of a problem with a single contact.
        solve_several: the same for several contacts; None for a law that is defined for one.
        differentiate: function such as `kickdyn.impact.sensitivity.sensitivity`, or None.
        has_kernel: whether the compiled kernels of sweeps compute this law.
    """

    name: str
    solve: Callable[[ContactProblem], Solution]
    solve_several: Callable[[ContactProblem], Solution] | None = None
    differentiate: Callable[..., Any] | None = None
    has_kernel: bool = False


def frictionless(problem: ContactProblem) -> Solution:
    r"""Return the impulse along the normal of Eq. (10), :math:`p = (1 + e)\, m_\mathrm{eff}\, u_n`.

    The problem has a single contact, and the effective mass is the one of both bodies. Laws
    `newton` and `stronge` agree on it.
    """
    (contact,) = problem.contacts
    normal, e, speed = contact.normal, contact.restitution, contact.approach_speed
    p = (1.0 + e) * speed / problem.inverse_mass(normal)
    return Solution((p * normal)[None], (False,), 0.5 * p * (1.0 - e) * speed, np.zeros((1, 3)))


def tangents(normal: Triple, u: Triple) -> tuple[Triple, Triple]:
    """Return two directions that make a right-handed frame with a unit normal as the third.

    The first is along the sliding, if any, of the relative velocity u.
    """
    nx, ny, nz = normal
    ux, uy, uz = u
    along = ux * nx + uy * ny + uz * nz
    x, y, z = ux - along * nx, uy - along * ny, uz - along * nz
    sliding, speed = math.hypot(x, y, z), math.hypot(ux, uy, uz)
    if sliding <= 1e-12 * speed:
        sizes = abs(nx), abs(ny), abs(nz)
        least = sizes.index(min(sizes))
        n = normal[least]
        tangent = [-n * nx, -n * ny, -n * nz]
        tangent[least] += 1.0
        x, y, z = tangent
        sliding = math.hypot(x, y, z)
    elif sliding < 0.1 * speed:  # cancellation left rounding along the normal: project once more
        x, y, z = x / sliding, y / sliding, z / sliding
        along = x * nx + y * ny + z * nz
        x, y, z = x - along * nx, y - along * ny, z - along * nz
        sliding = math.hypot(x, y, z)
    first = x / sliding, y / sliding, z / sliding
    return first, cross3(normal, first)
