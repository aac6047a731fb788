r"""The unknowns of a kick, and what the foot and the joints must keep in it, as terms.

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
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.leg_derivatives import leg_derivatives
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.planning.problem import TOLERANCE, Bounds, Function, Kind
from kickdyn.robot.human_body import muscle_share, muscle_share_slope
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.model_validation import frames_by_name
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

WITHOUT_LIMITS = "it has one without its speed and torque limits"
"""The explanation of a limit of speed or torque."""


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

    @cached_property
    def frames(self) -> dict[str, int]:
        """Numbers of the leg's frames by name."""
        return frames_by_name(self.leg.workspace.model)

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


class Objective(Function[KickPoint]):
    """A quantity that a kick makes least, or most; its derivatives are differences.

    Attributes:
        maximized: whether the quantity is made most.
    """

    kind = Kind.OBJECTIVE
    maximized = False

    @abstractmethod
    def quantity(self, point: KickPoint) -> float:
        """Return the quantity."""

    def value(self, point: KickPoint) -> Array:
        quantity = self.quantity(point)
        return np.array([-quantity if self.maximized else quantity])

    def slope(self, point: KickPoint) -> Array:
        count = len(point.x) - 1  # the share does not count
        return slope_by_differences(self, point, count, DIFFERENCE_STEP)


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
        return variables.slope(
            self.rows @ by_q, self.rows @ (jacobian / size), self.rows @ by_share
        )

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
        x[: variables.n] = np.clip(
            q - np.linalg.pinv(rows, rcond=1e-6) @ residual, variables.lower, variables.upper
        )
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
        x[: variables.n] = np.clip(
            q - step / max(1.0, 2.0 * float(np.abs(step).max())), variables.lower, variables.upper
        )
        point = variables.point(x)
    return place_exactly(ball, point)


class TorqueLimit(KickTerm):
    """The torque that keeps the joints' speed, gravity included, is within its limit."""

    kind, margin, rates_starts = Kind.INEQUALITY, 2 * TOLERANCE, False
    explanation = WITHOUT_LIMITS

    def __init__(self, variables: KickVariables) -> None:
        leg = variables.leg
        self._names, self._vs = variables.names, variables.vs
        self.limit = _usable(leg.effort_limit[self._vs])
        self._model, self._data = leg.model, leg.model.createData()
        self._still = np.zeros(leg.nv)

    def torque(self, posture: Posture, v: Array) -> Array:
        """Return the torque of the joints that move the foot, shape `(n,)` [N m]."""
        return np.asarray(pin.rnea(self._model, self._data, posture.q, v, self._still)[self._vs])

    def use(self, point: KickPoint) -> Array:
        """Return the torques over their limits, shape `(n,)`."""
        return np.abs(self.torque(point.posture, point.v)) / self.limit

    def residual(self, posture: Posture, v: Array) -> Array:
        use = self.torque(posture, v) / self.limit
        return 1.0 - use * use

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        gain = -2 * (self.torque(posture, v) / self.limit**2)[:, None]
        by_q, by_v = self.torque_derivatives(posture, v)
        return gain * by_q, gain * by_v

    def torque_derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        """Return the derivatives of the torque by q and v of the leg, shape `(n, nv)` each."""
        by_q, by_v, _ = pin.computeRNEADerivatives(
            self._model, self._data, posture.q, v, self._still
        )
        shape = (len(v), len(v))
        return np.reshape(by_q, shape)[self._vs], np.reshape(by_v, shape)[self._vs]

    def binding(self, point: KickPoint) -> list[str]:
        return _reached("torque", self._names, self.use(point))


class SpeedLimit(Bounds[KickPoint]):
    """The speed of each joint is within its limit, which is kept by `TOLERANCE`.

    A joint without a limit has that of `assumed_speed_limit`.
    """

    explanation = WITHOUT_LIMITS

    def __init__(self, variables: KickVariables) -> None:
        self._names, self._vs = variables.names, variables.vs
        self.limit = assumed_speed_limit(variables.leg)[self._vs]
        most = np.where(np.isfinite(self.limit), 1.0 - TOLERANCE, np.inf)
        self.upper = np.array([*np.full(variables.n, np.inf), *most, np.inf])
        self.lower = -self.upper

    def use(self, point: KickPoint) -> Array:
        """Return the speeds over their limits, shape `(n,)`."""
        return np.abs(point.v[self._vs]) / self.limit

    def binding(self, point: KickPoint) -> list[str]:
        return _reached("speed", self._names, self.use(point))


class JointRange(Bounds[KickPoint]):
    """The range of each joint, and of the share of the foot velocity from the least one on."""

    def __init__(self, variables: KickVariables, least_share: float = 0.0) -> None:
        free = np.full(variables.n, np.inf)
        self.lower = np.array([*variables.lower, *-free, least_share])
        self.upper = np.array([*variables.upper, *free, 1.0])


def check_limits(variables: KickVariables) -> None:
    """Refuse limits of speed or torque that are 0."""
    leg, vs = variables.leg, variables.vs
    for what, limit in (("speed", leg.velocity_limit[vs]), ("torque", leg.effort_limit[vs])):
        if not (limit > 0.0).all():
            name = variables.names[int(np.argmin(limit > 0.0))]
            raise InvalidInput(
                f"{what} limit of {name} is {limit.min():g}: it must be above 0 (Leg.with_drives, "
                "--drives FILE), or, without a motion, all limits lifted (limits=False, "
                "--no-limits)"
            )


def _usable(limit: Array) -> Array:
    """Return limits in which one of 0, which is no limit, is infinite."""
    return np.where(limit > 0.0, limit, np.inf)


def _reached(what: str, names: tuple[str, ...], use: Array) -> list[str]:
    pairs = zip(names, use.tolist(), strict=True)
    return [f"{what} of {name}" for name, share in pairs if share > 1.0 - 10 * TOLERANCE]


class MuscleTorqueLimit(TorqueLimit):
    """The torque that keeps the joints' speed is within what muscles have at this speed.

    Speed limits are those without torque. Rows are the distances from the limits in the positive
    and in the negative direction, shape `(2n,)`.
    """

    def __init__(self, variables: KickVariables) -> None:
        super().__init__(variables)
        limit = variables.leg.velocity_limit[self._vs]
        self._speed_limit = np.where(limit > 0.0, limit, np.inf)

    def _speed(self, v: Array) -> tuple[Array, Array]:
        """Return the signs of the directions, `(2, 1)`, and shortening speeds, shape `(2, n)`."""
        signs = np.array([[1.0], [-1.0]])
        return signs, np.clip(signs * v[self._vs] / self._speed_limit, 0.0, 1.0)

    def use(self, point: KickPoint) -> Array:
        torque = self.torque(point.posture, point.v) / self.limit
        _, speed = self._speed(point.v)
        most = np.where(torque > 0.0, *muscle_share(speed))
        return np.asarray(np.abs(torque) / np.maximum(most, 1e-9))

    def residual(self, posture: Posture, v: Array) -> Array:
        signs, speed = self._speed(v)
        distances = muscle_share(speed) - signs * self.torque(posture, v) / self.limit
        return np.asarray(distances.ravel())

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        by_q, by_v = self.torque_derivatives(posture, v)
        signs, speed = self._speed(v)
        fall = signs * muscle_share_slope(speed) * (speed > 0.0) / self._speed_limit
        rows_q = -signs[:, :, None] * (by_q / self.limit[:, None])
        rows_v = -signs[:, :, None] * (by_v / self.limit[:, None])
        columns = np.arange(len(self._vs))
        rows_v[:, columns, self._vs] += fall
        return rows_q.reshape(-1, len(v)), rows_v.reshape(-1, len(v))
