"""The search for posture and joint velocity: scipy's SLSQP from several starts."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from kickdyn.core.validation import Array
from kickdyn.planning.equations import FEASIBLE, Equations, Objective
from kickdyn.robot.leg import Posture

NEAR = 1.0
"""How far from the zero configuration starts are drawn [rad]: farther off, legs tangle."""

DRAWN = 80
"""Postures that each start is the best of, by the joint speed it needs."""


class Found(NamedTuple):
    """Posture, joint velocity, the share of the wished-for foot velocity, and the objective."""

    posture: Posture
    v: Array
    share: float
    value: float


class Search(Equations):
    """Looks for posture and joint velocity among those that do what a touch asks for."""

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
        if better is None or not better.value < objective.sign * value:
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
            wish = self.impact_target.foot_velocity(posture)
            v = np.linalg.pinv(posture.jacobian[:, self.vs] * self.speed, rcond=1e-2) @ wish
            off = float(np.linalg.norm(self.astray(posture)))
            off -= float(self.facing(posture).clip(max=0.0).sum())
            rated.append((float(np.abs(v).max()) + off, number, np.array([*q, *v, 1.0])))
        return [start for _, _, start in sorted(rated)[:many]]

    def _from(self, start: Array, objective: Objective, whole: bool) -> Found | None:
        n, size = self.n, 1.0
        if whole:  # of the order of 1
            posture, _ = self.at(start)
            size = abs(objective(posture, self.whole(start[n : 2 * n] * self.speed))) or 1.0
        cost = objective if whole else None
        kept: dict[str, Any] = {"x": None}
        v_most = np.full(n, math.inf)
        if self.limits:
            v_most[np.isfinite(self.fastest)] = 1.0 - FEASIBLE
        bounds = [
            *zip(self.low, self.high, strict=True), *zip(-v_most, v_most, strict=True),
            (1.0, 1.0) if whole else (0.0, 1.0),
        ]  # fmt: skip

        def values(x: Array) -> Array:
            if kept["x"] is None or not np.array_equal(kept["x"], x):
                at = self.at(x)
                kept.update(x=x.copy(), at=at, here=self.values(at, x, cost, size), slopes=None)
            return np.asarray(kept["here"])

        def slopes(x: Array) -> Array:
            here = values(x)
            if kept["slopes"] is None:
                kept["slopes"] = self.slopes(kept["at"], x, here, cost, size)
            return np.asarray(kept["slopes"])

        equal = slice(1, 1 + len(self.asked) + len(self.held))
        room = slice(equal.stop, None)
        held = [
            {"type": kind, "fun": lambda x, s=s: values(x)[s], "jac": lambda x, s=s: slopes(x)[s]}
            for kind, s in (("eq", equal), ("ineq", room))
            if kind == "eq" or self.limits or len(self.contact_normal_cone)
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
