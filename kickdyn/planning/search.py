"""The search for posture and joint velocity: scipy's SLSQP from several starts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.leg import Leg
from kickdyn.planning.heading import heading_for, turned
from kickdyn.planning.touch import Touch
from kickdyn.posture import Posture

FEASIBLE = 1e-4
"""How far constraints may be missed, each over its own scale; velocities are then made exact, and
limits are kept this far away."""

NEAR = 1.0
"""How far from the zero configuration starts are drawn [rad]: farther off, legs tangle."""

DRAWN = 80
"""Postures that each start is the best of, by the joint speed it needs."""

STEP = 1e-7
"""Of the differences that derivatives are made of; the unknowns are of the order of 1."""

Objective = Callable[[Posture, Array], float]


class Found(NamedTuple):
    """Posture, joint velocity, the share of the wished-for foot velocity, and the objective."""

    posture: Posture
    v: Array
    share: float
    value: float


class Search:
    """Postures and joint velocities of a leg that do what a touch asks for.

    The unknowns are q and v of the joints that move the foot, and the share of the foot's velocity
    that is reached; the others stay at 0.

    Args:
        leg: on a fixed base, all of its joints that move the foot of one degree of freedom.
        touch: what the foot must do.
        ball_height: of the ball's centre [m, world frame]; None leaves it free.
        limits: whether velocity and effort limits hold.
        turn: whether a leg whose foot moves in a plane may be turned towards the launch.

    Attributes:
        leg: the leg, turned by `heading` [rad].
        basis: directions that its foot can move in at all, orthonormal rows.
    """

    def __init__(
        self, leg: Leg, touch: Touch, ball_height: float | None, limits: bool, turn: bool = True
    ) -> None:
        self.leg, self.touch, self.height, self.limits = leg, touch, ball_height, limits
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
        self.speed = np.where(
            np.isfinite(leg.velocity_limit[self.vs]) & (leg.velocity_limit[self.vs] > 0),
            *(leg.velocity_limit[self.vs], 100.0),
        )
        self.effort = leg.effort_limit[self.vs]
        self._draw = np.random.default_rng(0)
        self.basis = self._directions()
        if turn and self._leaves(touch.impulse):
            heading = heading_for(self.basis, touch.impulse)
            if heading is not None:
                self.leg, self.heading = turned(leg, heading), heading
                self._model = self.leg.model
                self._data = self._model.createData()
                self.basis = self._directions()
        self._check_directions()

    def _directions(self) -> Array:
        stacked = np.hstack([self.posture(self._any()).jacobian for _ in range(8)])
        left, gains, _ = np.linalg.svd(stacked)
        return np.asarray(left[:, gains > 1e-9 * gains[0]].T)

    def _leaves(self, wish: Array) -> bool:
        """Return whether a direction leaves those of the foot."""
        lost = wish - self.basis.T @ (self.basis @ wish)
        return bool(np.linalg.norm(lost) > 1e-6 * np.linalg.norm(wish))

    def _check_directions(self) -> None:
        wish, normal = self.touch.impulse, self.touch.contact.normal
        if self._leaves(wish):
            raise InvalidInput(
                f"{self.leg.name} cannot kick so: its foot moves in a plane only, and the launch "
                f"{(wish / self.touch.ball.mass).round(4).tolist()} m/s leaves that"
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
        posture = self.leg.posture(whole)
        offset = self.touch.contact.offset
        return posture if offset is None else posture.touched_at(offset)

    def whole(self, v: Array) -> Array:
        """Return the joint velocity of the whole leg."""
        full = np.zeros(self.leg.nv)
        full[self.vs] = v
        return full

    def torque(self, q: Array, v: Array) -> Array:
        """Return the torque that keeps joint speeds as they are, gravity included [N m]."""
        zero = np.zeros(self.leg.nv)
        return np.asarray(pin.rnea(self._model, self._data, q, v, zero)[self.vs])

    def run(self, objective: Objective, starts: int) -> Found | None:
        """Return the best of several starts; where none is feasible, that of the most share.

        Args:
            objective: of posture and joint velocity, to be least.
            starts: number of them.

        Returns:
            None where no posture is feasible even for the least share.
        """
        begun = self._starts(starts)
        found = [one for x in begun if (one := self._from(x, objective, True)) is not None]
        if not found:
            most = [one for x in begun if (one := self._from(x, objective, False)) is not None]
            if not most:
                return None
            best = max(most, key=lambda one: one.share)
            if best.share < 1.0 - 1e-6:
                return best
            again = self._from(self._unknowns(best), objective, True)
            found = [again or best._replace(share=1.0)]
        return min(found, key=lambda one: one.value)

    def improve(self, found: Found, objective: Objective) -> Found:
        """Return the best near one that was found, or that one."""
        value = objective(found.posture, found.v)
        better = self._from(self._unknowns(found), objective, found.share == 1.0)
        if better is None or not better.value < value:
            return found._replace(value=value)
        return better

    def _unknowns(self, found: Found) -> Array:
        q, v = found.posture.q[self.qs], found.v[self.vs] / self.speed
        return np.array([*q, *v, found.share])

    def _starts(self, many: int) -> list[Array]:
        """Return the postures, of many drawn near zero, that need the least joint speed."""
        rated = []
        low, high = np.maximum(self.low, -NEAR), np.minimum(self.high, NEAR)
        for number in range(DRAWN):
            q = self._draw.uniform(np.minimum(low, self.high), np.maximum(high, self.low))
            posture = self.posture(q)
            wish = self.touch.foot_velocity(posture)
            v = np.linalg.pinv(posture.jacobian[:, self.vs] * self.speed, rcond=1e-2) @ wish
            off = float(np.abs(self._height(posture))) if self.height is not None else 0.0
            rated.append((float(np.abs(v).max()) + off, number, np.array([*q, *v, 1.0])))
        return [start for _, _, start in sorted(rated)[:many]]

    def _height(self, posture: Posture) -> float:
        """Return how far the ball would lie too high, in its radii."""
        radius = self.touch.ball.radius
        centre = posture.contact_point[2] + radius * self.touch.contact.normal[2]
        return float((centre - (self.height or 0.0)) / radius)

    def _at(self, x: Array) -> tuple[Posture, Array]:
        """Return the posture and the foot velocity that is asked for there."""
        posture = self.posture(x[: self.n])
        return posture, self.touch.foot_velocity(posture)

    def _values(self, at: tuple[Posture, Array], x: Array, cost: Objective | None) -> Array:
        """Return objective, equalities, inequalities; velocities count in their limits."""
        posture, wish = at
        v, share = self.whole(x[self.n : 2 * self.n] * self.speed), float(x[-1])
        missed = (posture.jacobian @ v - share * wish) / math.sqrt(wish @ wish)
        n, sticks = self.touch.contact.normal, self.touch.contact.friction > 0.0
        values = [-share if cost is None else cost(posture, v)]
        values += list(self.basis @ missed) if sticks else [float(n @ missed)]
        if self.height is not None:
            values.append(self._height(posture))
        if self.limits:
            used = self.torque(posture.q, v) / self.effort
            values += list(1.0 - 2 * FEASIBLE - used * used)
        return np.array(values)

    def _slopes(
        self, at: tuple[Posture, Array], x: Array, here: Array, cost: Objective | None
    ) -> Array:
        moved = []
        for i, one in enumerate(STEP * np.eye(len(x))):
            there = self._at(x + one) if i < self.n else at  # a posture costs most
            moved.append(self._values(there, x + one, cost))
        return np.ascontiguousarray((np.array(moved) - here).T / STEP)  # SLSQP reads no other

    def _from(self, start: Array, objective: Objective, whole: bool) -> Found | None:
        n, size = self.n, 1.0
        if whole:  # of the order of 1
            posture, _ = self._at(start)
            size = abs(objective(posture, self.whole(start[n : 2 * n] * self.speed))) or 1.0
        cost = (lambda posture, v: objective(posture, v) / size) if whole else None
        kept: dict[str, Any] = {"x": None}
        v_most = 1.0 - FEASIBLE if self.limits else math.inf
        bounds = [
            *zip(self.low, self.high, strict=True), *[(-v_most, v_most)] * n,
            (1.0, 1.0) if whole else (0.0, 1.0),
        ]  # fmt: skip

        def values(x: Array) -> Array:
            if kept["x"] is None or not np.array_equal(kept["x"], x):
                at = self._at(x)
                kept.update(x=x.copy(), at=at, here=self._values(at, x, cost), slopes=None)
            return np.asarray(kept["here"])

        def slopes(x: Array) -> Array:
            here = values(x)
            if kept["slopes"] is None:
                kept["slopes"] = self._slopes(kept["at"], x, here, cost)
            return np.asarray(kept["slopes"])

        rows = 1 if self.touch.contact.friction == 0.0 else len(self.basis)
        equal = slice(1, 1 + rows + (self.height is not None))
        room = slice(equal.stop, None)
        held = [
            {"type": kind, "fun": lambda x, s=s: values(x)[s], "jac": lambda x, s=s: slopes(x)[s]}
            for kind, s in (("eq", equal), ("ineq", room))
            if kind == "eq" or self.limits
        ]
        low, high = np.array(bounds).T
        found = minimize(
            lambda x: values(x)[0], np.clip(start, low, high), jac=lambda x: slopes(x)[0],
            method="SLSQP", bounds=bounds, constraints=held,
            options={"maxiter": 80, "ftol": 1e-7},
        )  # fmt: skip
        x = np.clip(found.x, low, high)
        if not np.isfinite(x).all():
            return None
        here = values(x)
        if np.abs(here[equal]).max() > FEASIBLE or (here[room] < -FEASIBLE).any():
            return None
        posture, v = kept["at"][0], self.whole(x[n : 2 * n] * self.speed)
        return Found(
            posture, self.exact(posture, v, float(x[-1])), float(x[-1]), size * float(here[0])
        )

    def exact(self, posture: Posture, v: Array, share: float) -> Array:
        """Return v with the last digits of the foot's velocity put right."""
        wish = share * self.touch.foot_velocity(posture)
        rows = posture.jacobian[:, self.vs]
        missed = wish - rows @ v[self.vs]
        if self.touch.contact.friction == 0.0:
            rows = (self.touch.contact.normal @ rows)[None]
            missed = np.array([self.touch.contact.normal @ missed])
        return v + self.whole(np.linalg.pinv(rows * self.speed, rcond=1e-9) @ missed * self.speed)
