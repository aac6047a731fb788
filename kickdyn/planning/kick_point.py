r"""The unknowns of a kick, and what its terms evaluate.

The unknowns are :math:`q` and :math:`v` of the joints that move the foot, and the share
:math:`s \le 1` of the foot velocity that is reached.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.problem import Function, Kind
from kickdyn.robot.kicking_chain import kicking_chain, rest_configuration
from kickdyn.robot.leg import Leg, Posture

UNLIMITED = 100.0
"""Scale of the speed of a joint without a limit [rad/s]."""


STEP = 1e-7
"""Step of the unknowns in the differences that stand for derivatives."""


class KickVariables:
    """The unknowns of a kick of a leg: q, v over its scale, and the share, shape `(2n + 1,)`.

    Attributes:
        leg: on a fixed base.
        target: impulse and contact that the foot must bring about.
        names: of the joints that move the foot.
        qs, vs: indices of these joints in q and v of the leg, shape `(n,)`.
        lower, upper: range of these joints, shape `(n,)` [rad; m for prismatic joints].
        velocity_scale: speed limits, or `UNLIMITED`, shape `(n,)` [rad/s].
    """

    def __init__(self, leg: Leg, target: ImpactTarget) -> None:
        chain = kicking_chain(leg)
        self.leg, self.target = leg, target
        self.names, self.qs, self.vs = chain.names, chain.qs, chain.vs
        self.lower, self.upper = chain.lower, chain.upper
        limit = chain.velocity_limit
        self.velocity_scale = np.where(np.isfinite(limit) & (limit > 0.0), limit, UNLIMITED)
        self._rest = rest_configuration(leg)

    @property
    def n(self) -> int:
        """Number of joints that move the foot."""
        return len(self.names)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 2 * self.n + 1

    def posture(self, q: Array) -> Posture:
        """Return the posture for coordinates of the joints that move the foot, shape `(n,)`."""
        configuration = self._rest.copy()
        configuration[self.qs] = q
        return self.leg.posture(configuration).with_contact_offset(self.target.contact.offset)

    def whole_velocity(self, v: Array) -> Array:
        """Return the joint velocity of the leg, shape `(nv,)`, all other joints at rest."""
        velocity = np.zeros(self.leg.nv)
        velocity[self.vs] = v
        return velocity

    def unknowns(self, q: Array, v: Array, share: float) -> Array:
        """Return the unknowns for q and v of the joints that move the foot, and the share."""
        return np.array([*q, *(v / self.velocity_scale), share])

    def point(self, x: Array) -> "KickPoint":
        """Return what the terms of a kick evaluate."""
        return KickPoint(self, x)

    def slope(self, by_q: Array, by_v: Array | None = None, by_share: Array | None = None) -> Array:
        """Return derivatives by the unknowns, shape `(k, 2n + 1)`.

        Args:
            by_q: derivatives by the leg's q, shape `(k, nv)`.
            by_v: derivatives by the leg's v, shape `(k, nv)`.
            by_share: derivatives by the share, shape `(k,)`.
        """
        slope = np.zeros((len(by_q), self.size))
        slope[:, : self.n] = by_q[:, self.vs]
        if by_v is not None:
            slope[:, self.n : -1] = by_v[:, self.vs] * self.velocity_scale
        if by_share is not None:
            slope[:, -1] = by_share
        return slope


@dataclass(frozen=True, eq=False)
class KickPoint:
    """The unknowns of a kick with the posture and the velocities that follow from them.

    Attributes:
        variables: which unknowns these are.
        x: unknowns, shape `(2n + 1,)`.
    """

    variables: KickVariables
    x: Array

    @cached_property
    def posture(self) -> Posture:
        """The posture of the leg at the impact."""
        return self.variables.posture(self.x[: self.variables.n])

    @cached_property
    def v(self) -> Array:
        """The joint velocity of the leg just before the impact, shape `(nv,)` [rad/s]."""
        n, scale = self.variables.n, self.variables.velocity_scale
        return self.variables.whole_velocity(self.x[n : 2 * n] * scale)

    @property
    def share(self) -> float:
        """Share of the foot velocity that is reached."""
        return float(self.x[-1])

    @cached_property
    def ball_centre(self) -> Array:
        """Centre of a ball that the foot touches, shape `(3,)` [m, world frame]."""
        target = self.variables.target
        return np.asarray(self.posture.contact_point + target.ball.radius * target.contact.normal)

    @cached_property
    def velocity_change(self) -> Array:
        """Change of the contact points' relative velocity in the impact, shape `(3,)` [m/s]."""
        return self.variables.target.velocity_change(self.posture)


class KickTerm(Function[KickPoint]):
    """A term that depends on posture and joint velocity, but not on the share."""

    def value(self, point: KickPoint) -> Array:
        return self.residual(point.posture, point.v)

    def slope(self, point: KickPoint) -> Array:
        return point.variables.slope(*self.derivatives(point.posture, point.v))

    @abstractmethod
    def residual(self, posture: Posture, v: Array) -> Array:
        """Return the value at a posture and joint velocity of the leg, shape `(k,)`."""

    @abstractmethod
    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array | None]:
        """Return its derivatives by q and v, shape `(k, nv)` each; None where v does not count."""


class Objective(Function[KickPoint]):
    """A cost of a kick; its derivatives are differences.

    Attributes:
        unit: of the cost.
    """

    kind = Kind.OBJECTIVE
    unit = ""

    @abstractmethod
    def cost(self, point: KickPoint) -> float:
        """Return what is to be least; what shall be most is below 0."""

    def value(self, point: KickPoint) -> Array:
        return np.array([self.cost(point)])

    def slope(self, point: KickPoint) -> Array:
        cost, slope = self.cost(point), np.zeros((1, len(point.x)))
        for i in range(len(point.x) - 1):  # the share does not count
            x = point.x.copy()
            x[i] += STEP
            slope[0, i] = (self.cost(point.variables.point(x)) - cost) / STEP
        return slope
