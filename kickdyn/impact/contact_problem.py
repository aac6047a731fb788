"""The contact problem that an impact law solves, and the solution it returns."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kickdyn.core.mechanics import Triple, cross3
from kickdyn.core.validation import Array
from kickdyn.impact.body import Body

NO_VELOCITY: Triple = (0.0, 0.0, 0.0)
"""Velocity of contact points at rest [m/s]."""


class ContactPoint(NamedTuple):
    r"""A point at which two bodies touch.

    Attributes:
        normal: n, unit vector from the first body into the second, shape `(3,)` [world frame].
        restitution: coefficient e.
        friction: Coulomb's coefficient mu.
        centre_velocity: velocity of the second body at the contact minus the first's, without
            what spins of balls add [m/s, world frame].
        surface_spin: sum of radius times spin, :math:`r\, \omega`, of the balls that touch there
            [m/s, world frame].
    """

    normal: Array
    restitution: float
    friction: float
    centre_velocity: Triple = NO_VELOCITY
    surface_spin: Triple = NO_VELOCITY

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

    Attributes:
        contacts: the contacts.
        bodies: the bodies that touch at them; see `kickdyn.impact.body` for signs.
    """

    contacts: tuple[ContactPoint, ...]
    bodies: tuple[Body, ...]

    def inverse_mass(self, direction: Array) -> float:
        """Return the inverse effective mass of a single contact along a unit vector [1/kg]."""
        return sum(body.inverse_mass(direction) for body in self.bodies)

    def in_contact_axes(self) -> tuple[Array, Array]:
        """Return rotations from contact axes to the world's, and velocities in these axes.

        The rotations have shape `(k, 3, 3)` (see `tangents`), the velocities `(3 k,)` [m/s].
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
        return np.array(entries).reshape(-1, 3, 3), np.array(before)

    def delassus(self, axes: Array) -> Array:
        """Return G in contact axes, shape `(3 k, 3 k)` [1/kg]; `axes` is `(k, 3, 3)`."""
        total = self.bodies[0].delassus(axes)
        for body in self.bodies[1:]:
            total = total + body.delassus(axes)
        return total


class Solution(NamedTuple):
    """What an impact law returns for k contacts.

    Attributes:
        impulses: on the second body of each contact, shape `(k, 3)` [N s, world frame].
        sticking: for each contact, whether friction can stop the points from sliding; False without
            friction.
        energy_lost: kinetic energy that the bodies lose [J].
        tangential_impulses: parts of the impulses across the normals, computed separately so that
            they keep their digits, shape `(k, 3)` [N s].
        residual: residual of an iteration, relative to the largest impulse or velocity; 0 for a
            closed form.
    """

    impulses: Array
    sticking: tuple[bool, ...]
    energy_lost: float
    tangential_impulses: Array
    residual: float = 0.0


def solution_in_world(
    axes: Array,
    impulses: Array,
    sticking: tuple[bool, ...],
    energy_lost: float,
    residual: float = 0.0,
) -> Solution:
    """Return the solution of impulses in contact axes, shape `(3 k,)`; `axes` is `(k, 3, 3)`."""
    if len(axes) == 1:  # several take twice as long
        tangential = axes[0, :, :2].dot(impulses[:2])[None]
        normal = (axes[0, :, 2] * impulses[2])[None]
    else:
        along_axes = axes * impulses.reshape(-1, 1, 3)
        tangential, normal = along_axes[..., 0] + along_axes[..., 1], along_axes[..., 2]
    return Solution(tangential + normal, sticking, energy_lost, tangential, residual)


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
    sliding, speed = max(abs(x), abs(y), abs(z)), max(abs(ux), abs(uy), abs(uz))
    if sliding <= 1e-12 * speed:
        least = min(range(3), key=lambda axis: abs(normal[axis]))
        tangent = [-normal[least] * entry for entry in normal]
        tangent[least] += 1.0
        x, y, z = tangent
    elif sliding < 0.1 * speed:  # cancellation left rounding along the normal: project once more
        x, y, z = x / sliding, y / sliding, z / sliding
        along = x * nx + y * ny + z * nz
        x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.hypot(x, y, z)
    first = x / length, y / length, z / length
    return first, cross3(normal, first)
