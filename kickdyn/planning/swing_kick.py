"""A kick that can be swung: posture and velocity at the touch, found with the stops around it."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.chain import Chain
from kickdyn.planning.equations import FEASIBLE
from kickdyn.planning.joints import LONGEST, Joints, joints_of
from kickdyn.planning.search import Found, Search
from kickdyn.planning.stop import EAGER, OPTIONS, SHORT, Stop

NODES = 12
"""Intervals of each stop; half as many as `plan_swing` takes, whose nodes contain these."""

SLACK = 0.03
"""Share of the torque limits left over here, for torques between so few nodes."""

SMOOTH = 1e-3
"""Weight of the swing's effort against the objective: it picks one of the swings there are."""

INSIDE = 0.2
"""How far from the ends of the range the search starts, over the range."""

STARTS = 3


def with_swing(
    search: Search, found: Found, objective: str, longest: float = LONGEST
) -> Found | None:
    """Return the best kick near one, such that the leg can swing to it from rest and stop.

    The strike is part of the problem: M (v+ - v-) = -J^T p, restitution along the normal, and no
    sliding just after where the contact has friction, all linear in the share of the impulse p.

    Args:
        search: leg and touch.
        found: a kick that meets the limits at the touch.
        objective: `joint speed` or `effort`, as for `plan_kick`.
        longest: duration of either part of the swing [s].

    Returns:
        None where the solver finds none at all.
    """
    joints = joints_of(search.leg)
    if objective not in OBJECTIVES:
        raise InvalidInput(
            f"objective is {objective!r}: with swing=True choose {' or '.join(OBJECTIVES)}"
        )
    problem = _Problem(search, joints, found, objective, longest)
    best: Found | None = None
    draw = np.random.default_rng(0)
    for number in range(STARTS):
        q = found.posture.q[search.qs]
        if number:
            q = q + draw.normal(0.0, 0.3, len(q))
        one = problem.solve(q, found)
        if one is not None and (best is None or one.share > best.share + 1e-6):
            best = one
        if best is not None and best.share == 1.0:
            break
    return best


class _Problem:
    def __init__(
        self, search: Search, joints: Joints, found: Found, objective: str, longest: float
    ) -> None:
        self._search, self._joints, self._longest = search, joints, longest
        chain, touch = Chain(joints.model, found.posture.contact_lever), search.touch
        n, speed = chain.n, ca.DM(joints.speed)
        q, before, after = (ca.MX.sym(name, n) for name in ("q", "vb", "va"))
        share = ca.MX.sym("share")
        v, w = before * speed, after * speed
        self._stops = [Stop(chain, joints, NODES, q, way) for way in (-v, w)]
        impulse, normal = ca.DM(touch.impulse), touch.contact.normal
        jump = chain.momentum(q, w - v) + share * chain.impulse(q, impulse)
        ball = touch.ball
        across = touch.impulse - (normal @ touch.impulse) * normal
        moved = touch.impulse / ball.mass + ball.radius**2 / ball.inertia * across
        apart = share * ca.DM(moved) - chain.point(q, w)
        fast = float(np.linalg.norm(moved))
        law = ca.dot(normal, apart + touch.contact.restitution * -chain.point(q, v)) / fast
        equal = [jump / (speed * float(found.posture.inertia.max())), law]
        if touch.contact.friction > 0.0:
            across = _across(search.basis, normal)
            equal += [across @ apart / fast] if len(across) else []
        if len(search.held):
            centre = chain.place(q) + ca.DM(ball.radius * normal - search.lies)
            equal.append(ca.DM(search.held) @ centre / ball.radius)
        still = chain.torque(q, v, ca.DM(n, 1)) / ca.DM(joints.effort)
        here = found.posture
        levers = [here.touched_at(row).contact_lever - here.contact_lever for row in search.outward]
        facing = [ca.dot(ca.DM(normal), chain.way(q, ca.DM(lever))) for lever in levers]
        rows = [stop.rows(SLACK) for stop in self._stops]
        equal = ca.vertcat(*equal)
        effort = self._stops[0].effort + self._stops[1].effort
        cost = OBJECTIVES[objective](chain, q, v, speed)
        self._solver = ca.nlpsol(
            "kick",
            "ipopt",
            {
                "x": ca.vertcat(*(stop.unknowns for stop in self._stops), q, before, after, share),
                "g": ca.vertcat(*(row.value for row in rows), equal, still, *facing),
                "f": cost + SMOOTH * effort - EAGER * share,
            },
            OPTIONS,
        )
        sizes, most = int(equal.numel()), np.full(n, 1.0 - FEASIBLE)
        front, most_of = np.zeros(len(facing)), np.full(len(facing), math.inf)
        self._low = np.concatenate([*(row.low for row in rows), np.zeros(sizes), -most, front])
        self._high = np.concatenate([*(row.high for row in rows), np.zeros(sizes), most, most_of])

    def solve(self, q: Array, found: Found) -> Found | None:
        """Return the kick from one start."""
        search, joints, n = self._search, self._joints, len(self._joints.names)
        room = INSIDE * (joints.high - joints.low)
        q = np.clip(q, joints.low + room, joints.high - room)
        posture = search.posture(q)
        v = np.linalg.pinv(posture.jacobian[:, search.vs] * joints.speed, rcond=1e-2)
        v = joints.speed * (v @ search.touch.foot_velocity(posture))
        share = float(min(1.0, 0.5 / np.abs(v / joints.speed).max()))
        v = share * v
        jump, _ = posture.respond(-share * search.touch.impulse.dot(posture.jacobian))
        w = v + jump[search.vs]
        most = np.full(n, 1.0 - FEASIBLE)
        inside = FEASIBLE * (joints.high - joints.low)
        bounds = [stop.bounds(self._longest, None) for stop in self._stops]
        guesses = [
            stop.guess(q, way, min(SHORT, self._longest))
            for stop, way in zip(self._stops, (-v, w), strict=True)
        ]
        ends = [
            [joints.low + inside, -most, -most, [0.0]],
            [joints.high - inside, most, most, [1.0]],
        ]
        result = self._solver(
            x0=np.concatenate([*guesses, q, v / joints.speed, w / joints.speed, [share]]),
            lbx=np.concatenate([*(low for low, _ in bounds), *ends[0]]),
            ubx=np.concatenate([*(high for _, high in bounds), *ends[1]]),
            lbg=self._low,
            ubg=self._high,
        )
        if not self._solver.stats()["success"]:
            return None
        x = np.asarray(result["x"]).ravel()
        share = 1.0 if x[-1] > 1.0 - 1e-6 else float(x[-1])
        at = len(x) - 1 - 3 * n
        posture = search.posture(x[at : at + n])
        velocity = search.exact(posture, search.whole(x[at + n : at + 2 * n] * joints.speed), share)
        return Found(posture, velocity, share, 0.0)


def _across(basis: Array, normal: Array) -> Array:
    """Return directions across the normal that the foot can move in, as rows."""
    _, gains, rows = np.linalg.svd(basis - np.outer(basis @ normal, normal))
    return np.asarray(rows[: len(gains)][gains > 1e-6])


def _joint_speed(chain: Chain, q: Any, v: Any, speed: Any) -> Any:
    return ca.sumsqr(v / speed) / chain.n


def _effort(chain: Chain, q: Any, v: Any, speed: Any) -> Any:
    top = chain.momentum(q, speed)
    return ca.dot(v, chain.momentum(q, v)) / ca.dot(speed, top)


OBJECTIVES = {"joint speed": _joint_speed, "effort": _effort}
"""What can be made least with a swing around it, of the order of 1."""
