r"""The unknowns of a kick, its objectives, and what the foot must keep in it, as terms.

The unknowns are :math:`q` and :math:`v` of the joints that move the foot, and the share
:math:`s \le 1` of the foot velocity that is reached. A kick keeps

.. math::
    J(q)\,v = s\,u(q), \quad x(q) + r n = x_{ball}, \quad
    |\tau_i(q, v)| \le \tau_{max,i}, \quad |v_i| \le v_{max,i}, \quad q_{min} \le q \le q_{max}.

:math:`u(q)` is the foot velocity of the impact target, :math:`x` the contact point, :math:`n` its
normal and :math:`\tau` the torque that keeps the joint velocity, gravity included.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Self

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.impact.leg_derivatives import leg_derivatives
from kickdyn.impact.leg_response import joint_impulses
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.planning.problem import Function, Kind
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.standing import (
    UNLIMITED,
    assumed_speed_limit,
    kicking_chain,
    rest_configuration,
)

DIFFERENCE_STEP = 1e-7
"""Step of the unknowns in the differences that stand for derivatives."""

STAYS_AWAY = 0.9
"""Share of its distance from a ball that a foot keeps in a step where it does not come to it."""

TURNS, FACES = 8, 0.05
"""Steps by which a foot is turned to a ball, and the cosine that they seek."""


class KickVariables:
    """The unknowns of a kick of a leg: q, v over its scale, and the share, shape `(2n + 1,)`.

    Attributes:
        leg: on a fixed base.
        target: impulse and contact that the foot must bring about.
        names: of the joints that move the foot.
        n, size: numbers of these joints and of the unknowns, 2 n + 1.
        qs, vs: indices of these joints in q and v of the leg, shape `(n,)`.
        lower, upper: range of these joints, a half turn from 0 at most, shape `(n,)` [rad; m for
            prismatic joints].
        velocity_scale: speed limits, or `UNLIMITED`, shape `(n,)` [rad/s].
    """

    def __init__(self, leg: Leg, target: ImpactTarget) -> None:
        chain = kicking_chain(leg)
        self.leg, self.target = leg, target
        self.names, self.qs, self.vs = chain.leg.joint_names, chain.qs, chain.vs
        self.n = len(self.names)
        self.size = 2 * self.n + 1
        self.lower = np.maximum(chain.leg.lower, -math.pi)
        self.upper = np.minimum(chain.leg.upper, math.pi)
        limit = assumed_speed_limit(chain.leg)
        self.velocity_scale = np.where(np.isfinite(limit), limit, UNLIMITED)
        self._rest = rest_configuration(leg)

    def for_target(self, target: ImpactTarget) -> "KickVariables":
        """Return the unknowns of another kick of the same leg."""
        other = copy(self)
        other.target = target
        return other

    def posture(self, q: Array) -> Posture:
        """Return the posture for coordinates of the joints that move the foot, shape `(n,)`."""
        configuration = self._rest.copy()
        configuration[self.qs] = q
        return self.leg.posture(configuration).with_contact_offset(self.target.contact.offset)

    def point(self, x: Array) -> "KickPoint":
        """Return the point at which the terms of a kick are evaluated."""
        return KickPoint(self, x)

    def slope(self, by_q: Array, by_v: Array | None = None, by_share: Array | None = None) -> Array:
        """Return derivatives by the unknowns, `(k, 2n + 1)`.

        They are made from those by the leg's q and v, shape `(k, nv)`, and by the share, `(k,)`.
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
    """The unknowns of a kick with the posture and the velocities that follow from them."""

    variables: KickVariables  # which unknowns these are
    x: Array  # unknowns, shape `(2n + 1,)`

    @cached_property
    def posture(self) -> Posture:
        """The posture of the leg at the impact."""
        return self.variables.posture(self.x[: self.variables.n])

    @cached_property
    def v(self) -> Array:
        """The joint velocity of the leg just before the impact, shape `(nv,)` [rad/s]."""
        variables = self.variables
        velocity = np.zeros(variables.leg.nv)
        velocity[variables.vs] = self.x[variables.n : -1] * variables.velocity_scale
        return velocity

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
        """Return its derivatives by q and v, shape `(k, nv)` each; None if v does not count."""


def slope_by_differences(
    function: Function[KickPoint], point: KickPoint, count: int, step: float
) -> Array:
    """Return the slope of a function of the first `count` unknowns by forward differences."""
    value = function.value(point)
    slope = np.zeros((len(value), len(point.x)))
    for i in range(count):
        x = point.x.copy()
        x[i] += step
        slope[:, i] = (function.value(point.variables.point(x)) - value) / step
    return slope


class Objective(Function[KickPoint]):
    """A quantity that a kick minimizes; its derivatives are differences.

    Attributes:
        quantity: function of a point.
        sign: 1, or -1 of a quantity that is maximized.
    """

    kind = Kind.OBJECTIVE

    def __init__(self, quantity: Callable[[KickPoint], float], sign: float = 1.0) -> None:
        self.quantity, self.sign = quantity, sign

    def value(self, point: KickPoint) -> Array:
        return np.array([self.sign * self.quantity(point)])

    def slope(self, point: KickPoint) -> Array:
        count = len(point.x) - 1  # the share does not count
        return slope_by_differences(self, point, count, DIFFERENCE_STEP)


class JointSpeed(Objective):
    """The mean square of the joints' speeds over their limits, with its exact derivatives."""

    def __init__(self) -> None:
        super().__init__(lambda point: float(np.mean(point.x[point.variables.n : -1] ** 2)))

    def slope(self, point: KickPoint) -> Array:
        slope, n = np.zeros((1, len(point.x))), point.variables.n
        slope[0, n:-1] = 2.0 / n * point.x[n:-1]
        return slope


class LargestShare(Objective):
    """The share of the foot velocity that is reached, which is maximized."""

    def __init__(self) -> None:
        super().__init__(lambda point: point.share, -1.0)

    def slope(self, point: KickPoint) -> Array:
        return -np.eye(len(point.x))[-1:]


def _kinetic_energy(point: KickPoint) -> float:
    return 0.5 * float(point.v @ point.posture.inertia @ point.v)


def _foot_speed(point: KickPoint) -> float:
    return math.hypot(*point.posture.point_velocity(point.v))


def _joint_impulse(point: KickPoint) -> float:
    """Return the largest linear impulse that a joint transmits, smoothed [N s]."""
    posture, impulse = point.posture, point.variables.target.impulse
    jump, of_constraints = posture.respond(-impulse @ posture.jacobian)
    transmitted, _ = joint_impulses(posture, jump, -impulse, of_constraints)
    sizes = np.linalg.norm(transmitted[:, :3], axis=1)
    largest = float(sizes.max())
    # the norm of power 12 is the largest within 10 % for six joints
    return largest * math.pow(float(np.sum((sizes / largest) ** 12)), 1 / 12)


class KickObjective(StrEnum):
    r"""Quantity that a kick minimizes, or maximizes if the name begins with `most`.

    With speed limits :math:`v_{max}`, inertia matrix :math:`M`, foot Jacobian :math:`J` and the
    linear impulses :math:`p_i` that the joints transmit:

    Attributes:
        unit: unit of the quantity, or words if it has none.
        term: its term in a problem; None for an objective of a motion.
    """

    unit: str
    term: Objective | None

    def __new__(cls, name: str, unit: str, term: Objective | None) -> Self:
        objective = str.__new__(cls, name)
        objective._value_, objective.unit, objective.term = name, unit, term
        return objective

    JOINT_SPEED = "joint-speed", "(mean square of the joint speeds over their limits)", JointSpeed()
    r""":math:`\frac1n \sum_i (v_i / v_{max,i})^2`."""
    JOINT_IMPULSE = "joint-impulse", "N s", Objective(_joint_impulse)
    r""":math:`\max_i |p_i|` [N s]."""
    KINETIC_ENERGY = "kinetic-energy", "J", Objective(_kinetic_energy)
    r""":math:`\frac12 v^T M v` [J], which the swing must build up."""
    FOOT_SPEED = "foot-speed", "m/s", Objective(_foot_speed)
    r"""Speed of the foot [m/s]: the posture that makes the most impulse of it."""
    MOST_JOINT_IMPULSE = "most-joint-impulse", "N s", Objective(_joint_impulse, -1.0)
    TORQUE_SQUARED = "torque-squared", "s", None
    r""":math:`\int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt` [s], of a motion."""


OBJECTIVES = {objective: objective.term for objective in KickObjective if objective.term}
"""The terms of the objectives of a posture."""


class StrikeVelocity(Function[KickPoint]):
    """The velocity that the foot must have, over its size at the full share.

    Attributes:
        rows: orthonormal directions in which the velocity is given, shape `(k, 3)`: those in which
            the foot can move; without friction, the contact normal alone.
    """

    kind, rates_starts = Kind.EQUALITY, False

    def __init__(self, variables: KickVariables, foot_directions: Array) -> None:
        contact = variables.target.contact
        self.rows = foot_directions if contact.friction > 0.0 else contact.normal[None]

    def value(self, point: KickPoint) -> Array:
        target, change = point.variables.target, point.velocity_change
        full = target.closing_velocity_for(change)
        velocity = point.posture.point_velocity(point.v)
        error = velocity - target.foot_velocity_for(change, point.share)
        return np.asarray(self.rows @ error / math.sqrt(full @ full))

    def slope(self, point: KickPoint) -> Array:
        variables, posture, v, share = point.variables, point.posture, point.v, point.share
        target, jacobian, change = variables.target, posture.jacobian, point.velocity_change
        v_after = v + posture.solve(-target.impulse @ jacobian)
        leg = leg_derivatives(posture, v, v_after, target.impulse, np.zeros(0))
        # the derivative of J M^-1 J^T p by q
        change_q = leg.foot_q - leg.foot_q_after - jacobian @ leg.v_after_q
        full = target.closing_velocity_for(change)
        size, full_q = math.sqrt(full @ full), target.foot_gain(change) @ change_q
        gain = target.foot_gain(share * change)
        error = posture.point_velocity(v) - target.foot_velocity_for(change, share)
        by_size = np.outer(error, full @ full_q) / size**2
        by_q = (leg.foot_q - share * (gain @ change_q) - by_size) / size
        by_share = -(gain @ change) / size
        rows = self.rows
        return variables.slope(rows @ by_q, rows @ (jacobian / size), rows @ by_share)

    def make_exact(self, point: KickPoint) -> KickPoint:
        """Return a point near one, with the foot's velocity exact in all digits."""
        variables, posture, share = point.variables, point.posture, point.share
        scale = variables.velocity_scale
        error = variables.target.foot_velocity(posture, share) - posture.point_velocity(point.v)
        rows = self.rows @ posture.jacobian[:, variables.vs] * scale
        x = point.x.copy()
        x[variables.n : -1] += np.linalg.pinv(rows, rcond=1e-9) @ self.rows @ error
        return variables.point(x)


class BallPosition(KickTerm):
    """The position of the ball, in the directions in which it is given.

    Attributes:
        centre: where the ball's centre must be, shape `(3,)` [m, world frame].
        rows: orthonormal directions in which it must be there, shape `(k, 3)`.
    """

    kind = Kind.EQUALITY
    explanation = "it has one for another position of the ball"

    def __init__(self, variables: KickVariables, centre: Array, rows: Array) -> None:
        ball = variables.target.ball
        self.centre, self.rows, self.scale = centre, rows, ball.radius
        self._from_contact = ball.radius * variables.target.contact.normal

    def residual(self, posture: Posture, v: Array) -> Array:
        return np.asarray(self.rows @ (posture.contact_point + self._from_contact - self.centre))

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        return self.rows @ posture.jacobian, None

    @property
    def place(self) -> str:
        """Where the ball is, as a part of a sentence."""
        if len(self.rows) == 1:
            return f"at a height of {self.centre[2]:g} m"
        return f"at ({', '.join(f'{x:g}' for x in self.centre)}) m"


def place_exactly(term: BallPosition, point: KickPoint) -> KickPoint:
    """Return a point near one, with the ball's position exact in all digits.

    Joints at the ends of their ranges stay there.
    """
    variables, missed = point.variables, math.inf
    for _ in range(6):
        residual = term.residual(point.posture, point.v)
        before, missed = missed, float(np.abs(residual).max())
        if missed < 1e-13 or missed > max(STAYS_AWAY * before, 0.01):
            break
        q = point.x[: variables.n]
        rows = term.rows @ point.posture.jacobian[:, variables.vs]
        at_end = (q - variables.lower < 1e-7) | (variables.upper - q < 1e-7)
        rows[:, at_end] = 0.0
        x = point.x.copy()
        placed = q - np.linalg.pinv(rows, rcond=1e-6) @ residual
        x[: variables.n] = np.clip(placed, variables.lower, variables.upper)
        point = variables.point(x)
    return point


class Facing(KickTerm):
    """The contact normal is in the cone of normals with which the foot can meet a ball.

    Attributes:
        axes: rows of the cone, shape `(k, 3)` [frame of the contact joint].
    """

    kind = Kind.INEQUALITY
    explanation = "it has one if another side of the foot may meet the ball"

    def __init__(self, variables: KickVariables, cone: Array) -> None:
        self.cone, self._normal = cone, variables.target.contact.normal
        posture = variables.posture(np.zeros(variables.n))
        levers = [posture.with_contact_offset(row).contact_lever for row in cone]
        self.axes = np.array(levers) - posture.contact_lever  # in the joint's frame

    def residual(self, posture: Posture, v: Array) -> Array:
        return np.asarray(self.axes @ (self._normal @ posture.rotation_world_joint))

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        jacobian = posture.jacobian
        return np.array([
            self._normal @ (posture.with_contact_offset(row).jacobian - jacobian)
            for row in self.cone
        ]), None  # fmt: skip


def turn_to_ball(ball: BallPosition, facing: Facing, point: KickPoint) -> KickPoint:
    """Return a point with a side of the foot at the ball that may meet it, if one is near."""
    variables = point.variables
    for _ in range(TURNS):
        posture, q = point.posture, point.x[: variables.n]
        value = facing.residual(posture, point.v)
        if value.min() > 0.0:
            break
        wrong = value < FACES
        error = np.append(ball.residual(posture, point.v), value[wrong] - FACES)
        slopes = [term.derivatives(posture, point.v)[0][:, variables.vs] for term in (ball, facing)]
        step = np.linalg.pinv(np.vstack([slopes[0], slopes[1][wrong]]), rcond=1e-2) @ error
        x = point.x.copy()
        step /= max(1.0, 2.0 * float(np.abs(step).max()))
        x[: variables.n] = np.clip(q - step, variables.lower, variables.upper)
        point = variables.point(x)
    return place_exactly(ball, point)
