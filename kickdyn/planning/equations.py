"""What posture and joint velocity must do for a touch, with derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.leg_derivatives import leg_slopes
from kickdyn.planning.heading import heading_for, turned
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.robot.leg import Leg, Posture

FEASIBLE = 1e-4
"""How far constraints may be missed, each over its own scale; velocities are then made exact, and
limits are kept this far away."""

STEP = 1e-7
"""Of the differences that stand for an objective's derivatives, where it has none."""

UNLIMITED = 100.0
"""What the speed of a joint without a limit counts in, in the objective `joint speed` [rad/s]."""

NOTHING_HELD = np.zeros(0)


@dataclass(frozen=True)
class Objective:
    """What a search makes least, of posture and joint velocity.

    Attributes:
        value: the objective.
        slope: its derivatives by q and by v, shape `(nv,)` each; None leaves them to differences.
        by_velocity: whether the joint velocity counts.
        sign: -1 for what shall be most.
    """

    value: Callable[[Posture, Array], float]
    slope: Callable[[Posture, Array], tuple[Array, Array]] | None = None
    by_velocity: bool = True
    sign: float = 1.0

    def __call__(self, posture: Posture, v: Array) -> float:
        """Return the value."""
        return self.value(posture, v)


class Equations:
    """Postures and joint velocities of a leg that do what a touch asks for.

    The unknowns are q and v of the joints that move the foot, and the share of the foot's velocity
    that is reached; the others stay at 0.

    Args:
        leg: on a fixed base, all of its joints that move the foot of one degree of freedom.
        impact_target: what the foot must do.
        ball_position: height of the ball's centre, or where it is, shape `(3,)` [m, world frame];
        None
            leaves it free.
        limits: whether limits of speed and torque hold.
        turn: whether a leg whose foot moves in a plane may be turned towards the launch.

    Attributes:
        leg: the leg, turned by `heading` [rad].
        basis: directions that its foot can move in at all, orthonormal rows.
        contact_normal_cone: of the leg, no rows where that is unknown or the contact is elsewhere
        on the foot:
            any side of it may then turn to the ball.
    """

    def __init__(
        self,
        leg: Leg,
        impact_target: ImpactTarget,
        ball_position: float | Array | None,
        limits: bool,
        turn: bool = True,
    ) -> None:
        self.leg, self.impact_target, self.limits = leg, impact_target, limits
        self.heading = 0.0
        model = leg.model
        self._model, self._data = model, model.createData()
        joints = [int(j) for j in model.supports[leg.contact_joint] if j > 0]
        if any(model.nqs[j] != 1 for j in joints):
            raise InvalidInput(f"{leg.name} is moved by joints without one angle: none is planned")
        self.qs = np.array([int(model.idx_qs[j]) for j in joints])
        self.vs = np.array([int(model.idx_vs[j]) for j in joints])
        self.names = tuple(str(model.names[j]) for j in joints)
        self.n = len(joints)
        self.rest = leg.configuration()
        self.low = np.maximum(leg.lower[self.qs], -math.pi)
        self.high = np.minimum(leg.upper[self.qs], math.pi)
        self.fastest, self.effort = self._limits()
        self.speed = np.where(np.isfinite(self.fastest), self.fastest, UNLIMITED)
        known = leg.contact_normal_cone is not None and impact_target.contact.offset is None
        self.contact_normal_cone = (
            leg.contact_normal_cone
            if known and leg.contact_normal_cone is not None
            else np.zeros((0, 3))
        )
        self._draw = np.random.default_rng(0)
        self.basis = self._directions()
        if turn and self._leaves(impact_target.impulse):
            heading = heading_for(self.basis, impact_target.impulse)
            if heading is not None:
                self.leg, self.heading = turned(leg, heading), heading
                self._model = self.leg.model
                self._data = self._model.createData()
                self.basis = self._directions()
        self._check_directions()
        self._hold_ball(ball_position)

    def _limits(self) -> tuple[Array, Array]:
        """Return limits of speed and torque; where they are lifted, one of 0 is none."""
        found = []
        for what, every in (
            ("speed", self.leg.velocity_limit),
            ("torque", self.leg.effort_limit),
        ):
            own = every[self.vs]
            if self.limits and not (own > 0.0).all():
                name = self.names[int(np.argmin(own > 0.0))]
                raise InvalidInput(
                    f"{what} limit of {name} is {own.min():g}: it must be above 0, or all limits "
                    "lifted (limits=False, --no-limits)"
                )
            found.append(np.where(own > 0.0, own, np.inf))
        return found[0], found[1]

    def _directions(self) -> Array:
        stacked = np.hstack([self.posture(self._any()).jacobian for _ in range(8)])
        left, gains, _ = np.linalg.svd(stacked)
        return np.asarray(left[:, gains > 1e-9 * gains[0]].T)

    def _leaves(self, wish: Array) -> bool:
        """Return whether a direction leaves those of the foot."""
        lost = wish - self.basis.T @ (self.basis @ wish)
        return bool(np.linalg.norm(lost) > 1e-6 * np.linalg.norm(wish))

    def _check_directions(self) -> None:
        wish, normal = self.impact_target.impulse, self.impact_target.contact.normal
        if self._leaves(wish):
            raise InvalidInput(
                f"{self.leg.name} cannot kick so: its foot moves in a plane only, and the launch "
                f"{(wish / self.impact_target.ball.mass).round(4).tolist()} m/s leaves that"
            )
        if self._leaves(normal):
            raise InvalidInput(
                f"{self.leg.name} cannot give this spin: its foot moves in a plane only, and side "
                "spin takes a foot that moves aside (a robot's leg, such as g1, does)"
            )

    def _any(self) -> Array:
        return np.asarray(self._draw.uniform(self.low, self.high))

    def posture(self, q: Array) -> Posture:
        """Return the posture for the angles of the joints that move the foot."""
        whole = self.rest.copy()
        whole[self.qs] = q
        return self.leg.posture(whole).with_contact_offset(self.impact_target.contact.offset)

    def whole(self, v: Array) -> Array:
        """Return the joint velocity of the whole leg."""
        full = np.zeros(self.leg.nv)
        full[self.vs] = v
        return full

    def torque(self, q: Array, v: Array) -> Array:
        """Return the torque that keeps joint speeds as they are, gravity included [N m]."""
        zero = np.zeros(self.leg.nv)
        return np.asarray(pin.rnea(self._model, self._data, q, v, zero)[self.vs])

    def _hold_ball(self, ball_position: float | Array | None) -> None:
        self.ball_position, self.held = np.zeros(3), np.zeros((0, 3))
        if isinstance(ball_position, float | int):
            self.ball_position[2], self.held = ball_position, np.array([[0.0, 0.0, 1.0]])
        elif ball_position is not None:
            self.ball_position, self.held = ball_position, self.basis
            off = self._apart(self.posture(self._any()))
            beside = float(np.linalg.norm(off - self.basis.T @ (self.basis @ off)))
            if beside > FEASIBLE * self.impact_target.ball.radius:
                raise InvalidInput(
                    f"the ball at {ball_position.tolist()} m is {beside:.4g} m beside the plane "
                    f"that the foot of {self.leg.name} moves in"
                )

    def _apart(self, posture: Posture) -> Array:
        """Return how far the ball would be from where it lies [m]."""
        contact = self.impact_target.contact
        centre = posture.contact_point + self.impact_target.ball.radius * contact.normal
        return np.asarray(centre - self.ball_position)

    def astray(self, posture: Posture) -> Array:
        """Return how far the ball would be from where it is held, in its radii."""
        return np.asarray(self.held @ self._apart(posture) / self.impact_target.ball.radius)

    def facing(self, posture: Posture) -> Array:
        """Return by how much the foot turns its front to the ball: 0 or more where it does."""
        ways = [
            posture.with_contact_offset(row).contact_point - posture.contact_point
            for row in self.contact_normal_cone
        ]
        return np.reshape(ways, (-1, 3)) @ self.impact_target.contact.normal

    def at(self, x: Array) -> tuple[Posture, Array]:
        """Return the posture and the foot velocity that is asked for there."""
        posture = self.posture(x[: self.n])
        return posture, self.impact_target.foot_velocity(posture)

    def _velocity(self, x: Array) -> Array:
        return self.whole(x[self.n : 2 * self.n] * self.speed)

    @property
    def asked(self) -> Array:
        """Directions in which the foot's velocity is given, as rows."""
        contact = self.impact_target.contact
        return self.basis if contact.friction > 0.0 else contact.normal[None]

    def values(
        self, at: tuple[Posture, Array], x: Array, cost: Objective | None, size: float
    ) -> Array:
        """Return objective, equalities, inequalities; velocities count in their limits."""
        posture, wish = at
        v, share = self._velocity(x), float(x[-1])
        missed = (posture.jacobian @ v - share * wish) / math.sqrt(wish @ wish)
        values = [-share if cost is None else cost.sign * cost(posture, v) / size]
        values += list(self.asked @ missed)
        values += list(self.astray(posture))
        if self.limits:
            used = self.torque(posture.q, v) / self.effort
            values += list(1.0 - 2 * FEASIBLE - used * used)
        values += list(self.facing(posture))
        return np.array(values)

    def slopes(
        self, at: tuple[Posture, Array], x: Array, here: Array, cost: Objective | None, size: float
    ) -> Array:
        """Return the derivatives of `values` by the unknowns, one row each."""
        posture, wish = at
        v, share, n, at_v = self._velocity(x), float(x[-1]), self.n, slice(self.n, 2 * self.n)
        impulse, kic = self.impact_target.impulse, posture.jacobian
        v_after = v + posture.solve(-impulse.dot(kic))
        leg = leg_slopes(posture, v, v_after, impulse, NOTHING_HELD)
        given = leg.foot_q - leg.foot_q_after - kic @ leg.v_after_q  # of J M^-1 J^T p by q
        wish_q = self.impact_target.foot_gain @ given
        fast = math.sqrt(wish @ wish)
        missed = np.zeros((3, len(x)))
        off = np.outer(kic @ v - share * wish, wish @ wish_q) / fast**2
        missed[:, :n] = ((leg.foot_q - share * wish_q - off) / fast)[:, self.vs]
        missed[:, at_v], missed[:, -1] = kic[:, self.vs] * (self.speed / fast), -wish / fast
        rows = [self._cost_slope(posture, v, x, float(here[0]), cost, size), *self.asked @ missed]
        for row in self.held @ kic[:, self.vs] / self.impact_target.ball.radius:
            rows.append(np.append(row, np.zeros(n + 1)))
        if self.limits:
            zero = np.zeros(self.leg.nv)
            by_q, by_v, _ = pin.computeRNEADerivatives(self._model, self._data, posture.q, v, zero)
            used = (self._data.tau[self.vs] / self.effort**2)[:, None]
            both = np.ix_(self.vs, self.vs)
            room = np.zeros((n, len(x)))
            room[:, :n] = -2 * used * np.reshape(by_q, (zero.size, -1))[both]
            room[:, at_v] = -2 * used * np.reshape(by_v, (zero.size, -1))[both] * self.speed
            rows += list(room)
        for row in self.contact_normal_cone:
            turning = self.impact_target.contact.normal @ (
                posture.with_contact_offset(row).jacobian - kic
            )
            rows.append(np.append(turning[self.vs], np.zeros(n + 1)))
        return np.array(rows)

    def _cost_slope(
        self, posture: Posture, v: Array, x: Array, here: float, cost: Objective | None, size: float
    ) -> Array:
        n, slope = self.n, np.zeros(len(x))
        if cost is None:
            slope[-1] = -1.0
        elif cost.slope is not None:
            by_q, by_v = cost.slope(posture, v)
            by_q, by_v = by_q[self.vs], by_v[self.vs] * self.speed
            slope[: 2 * n] = cost.sign / size * np.concatenate([by_q, by_v])
        else:
            for i in range(2 * n if cost.by_velocity else n):
                there = x.copy()
                there[i] += STEP
                moved = self.posture(there[:n]) if i < n else posture
                there_cost = cost.sign * cost(moved, self._velocity(there)) / size
                slope[i] = (there_cost - here) / STEP
        return slope

    def exact(self, posture: Posture, v: Array, share: float) -> Array:
        """Return v with the last digits of the foot's velocity put right."""
        wish = share * self.impact_target.foot_velocity(posture)
        rows = posture.jacobian[:, self.vs]
        missed = wish - rows @ v[self.vs]
        if self.impact_target.contact.friction == 0.0:
            rows = (self.impact_target.contact.normal @ rows)[None]
            missed = np.array([self.impact_target.contact.normal @ missed])
        return v + self.whole(np.linalg.pinv(rows * self.speed, rcond=1e-9) @ missed * self.speed)
