"""A kick that can be swung: posture and velocity at the touch, found with the stops around it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.chain import Chain
from kickdyn.planning.equations import FEASIBLE
from kickdyn.planning.kept_stop import Ask, kept_stop
from kickdyn.planning.search import Found, Search
from kickdyn.planning.stop_problem import EAGER, OPTIONS, SHORT, Solved, Stop, Stopper
from kickdyn.planning.swing_joints import LONGEST, Joints, joints_of
from kickdyn.planning.swing_phase import SwingPhase, part_of
from kickdyn.robot.leg import Posture

GRIDS = ((12, 0.03), (24, 0.01))
"""Intervals of each stop, and share of the torque limits left over for torques between so many.

The second is asked where the first falls short of the goal, or of the limits between its nodes. It
has as many as `plan_swing` takes, and contains the nodes of the first.
"""

SMOOTH = 1e-3
"""Weight of the swing's effort against the objective: it picks one of the swings there are."""

INSIDE = 0.2
"""How far from the ends of the range the search starts, over the range."""

STARTS = 3

LEFT = 0.006
"""Share of the torque limits left over on the fine grid: more than `plan_swing` leaves at first."""

TIGHTER = 0.1
"""How much slack is added at once, at most."""

MOST_SLACK = 0.5
"""Beyond that, tightening the torques has failed."""


class SwungKick(NamedTuple):
    """A kick, and the backswing and follow-through that were found with it."""

    kick: Found
    parts: tuple[SwingPhase, SwingPhase]

    @property
    def over(self) -> float:
        """How far torques on the fine grid are above what they shall be, over their limits."""
        return max(part.torque_use for part in self.parts) - (1.0 - LEFT)


def with_swing(
    search: Search, found: Found, objective: str, longest: float = LONGEST
) -> SwungKick | None:
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
    coarse = _Problem(search, joints, found, objective, longest, *GRIDS[0])
    best: SwungKick | None = None
    draw = np.random.default_rng(0)
    for number in range(STARTS):
        q = found.posture.q[search.qs]
        if number:
            q = q + draw.normal(0.0, 0.3, len(q))
        one = coarse.solve(coarse.guess(q), coarse.slack)
        if one is not None and (best is None or one.kick.share > best.kick.share + 1e-6):
            best = one
        if best is not None and best.kick.share == 1.0:
            break
    if best is None or (best.kick.share == 1.0 and best.over <= 0.0):
        return best
    kept = []
    for nodes, slack in reversed(GRIDS):
        problem = _Problem(search, joints, found, objective, longest, nodes, slack)
        one = problem.kept(best)
        kept += [] if one is None else [one]
        if one is not None and one.kick.share >= best.kick.share - 1e-6:
            break
    return max(kept, key=lambda one: one.kick.share) if kept else coarse.slowed(best)


class _Problem:
    def __init__(
        self,
        search: Search,
        joints: Joints,
        found: Found,
        objective: str,
        longest: float,
        nodes: int,
        slack: float,
    ) -> None:
        self._search, self._joints, self._longest, self.slack = search, joints, longest, slack
        chain, impact_target = (
            Chain(joints.model, found.posture.contact_lever),
            search.impact_target,
        )
        n, speed = chain.n, ca.DM(joints.speed)
        q, before, after = (ca.MX.sym(name, n) for name in ("q", "vb", "va"))
        share = ca.MX.sym("share")
        v, w = before * speed, after * speed
        self._stops = [Stop(chain, joints, nodes, q, way) for way in (-v, w)]
        impulse, normal = ca.DM(impact_target.impulse), impact_target.contact.normal
        jump = chain.momentum(q, w - v) + share * chain.impulse(q, impulse)
        ball = impact_target.ball
        across = impact_target.impulse - (normal @ impact_target.impulse) * normal
        moved = impact_target.impulse / ball.mass + ball.radius**2 / ball.inertia * across
        apart = share * ca.DM(moved) - chain.point(q, w)
        fast = float(np.linalg.norm(moved))
        law = ca.dot(normal, apart + impact_target.contact.restitution * -chain.point(q, v)) / fast
        equal = [jump / (speed * float(found.posture.inertia.max())), law]
        if impact_target.contact.friction > 0.0:
            across = _across(search.basis, normal)
            equal += [across @ apart / fast] if len(across) else []
        if len(search.held):
            centre = chain.place(q) + ca.DM(ball.radius * normal - search.ball_position)
            equal.append(ca.DM(search.held) @ centre / ball.radius)
        still = chain.torque(q, v, ca.DM(n, 1)) / ca.DM(joints.effort)
        here = found.posture
        levers = [
            here.with_contact_offset(row).contact_lever - here.contact_lever
            for row in search.contact_normal_cone
        ]
        facing = [ca.dot(ca.DM(normal), chain.way(q, ca.DM(lever))) for lever in levers]
        rows = [stop.rows(0.0) for stop in self._stops]
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
        self._equal = np.zeros(int(equal.numel()))
        self._front = np.zeros(len(facing))

    def kept(self, near: SwungKick) -> SwungKick | None:
        """Return a kick near one, whose torques keep their limits between the nodes too.

        Where they do not, it is solved again with so much more slack.
        """
        slack = self.slack
        while slack < MOST_SLACK:
            one = self.solve(self._unknowns(near), slack)
            if one is None or one.over <= 0.0:
                return one
            near, slack = one, slack + min(one.over + LEFT / 2, TIGHTER)
        return None

    def slowed(self, near: SwungKick) -> SwungKick | None:
        """Return a kick from the same posture, at the speed from which it can be stopped."""
        search, joints, kick = self._search, self._joints, near.kick
        chain = Chain(joints.model, kick.posture.contact_lever)
        stopper = Stopper(chain, joints, GRIDS[-1][0], "effort")
        q, v = kick.posture.q[search.qs], kick.v[search.vs]
        ways = (-v, v + self._jump(kick.posture, kick.share))
        share, found = 1.0, list[tuple[SwingPhase, Solved]]()
        for _ in range(2):  # once more for both, at the share of the slower
            found = []
            for part, w in zip(near.parts, ways, strict=True):
                ask = Ask(part.sign, q, w, None)
                found.append(kept_stop(stopper, joints, ask, self._longest, share, part))
                share = found[-1][1].share
            if found[0][1].share == share:
                break
        slow = Found(kick.posture, share * kick.v, share * kick.share, 0.0)
        return SwungKick(slow, (found[0][0], found[1][0]))

    def guess(self, q: Array) -> Array:
        """Return unknowns to start from, with even decelerations to a posture and from it."""
        search, joints = self._search, self._joints
        room = INSIDE * (joints.high - joints.low)
        q = np.clip(q, joints.low + room, joints.high - room)
        posture = search.posture(q)
        v = np.linalg.pinv(posture.jacobian[:, search.vs] * joints.speed, rcond=1e-2)
        v = joints.speed * (v @ search.impact_target.foot_velocity(posture))
        share = float(min(1.0, 0.5 / np.abs(v / joints.speed).max()))
        v = share * v
        w = v + self._jump(posture, share)
        guesses = [
            stop.guess(q, way, min(SHORT, self._longest))
            for stop, way in zip(self._stops, (-v, w), strict=True)
        ]
        return np.concatenate([*guesses, q, v / joints.speed, w / joints.speed, [share]])

    def _unknowns(self, near: SwungKick) -> Array:
        kick, speed = near.kick, self._joints.speed
        q, v = kick.posture.q[self._search.qs], kick.v[self._search.vs]
        after = v + self._jump(kick.posture, kick.share)
        ways = [stop.near(part) for stop, part in zip(self._stops, near.parts, strict=True)]
        return np.concatenate([*ways, q, v / speed, after / speed, [kick.share]])

    def _jump(self, posture: Posture, share: float) -> Array:
        """Return what the impact changes the joints' velocity by."""
        jump, _ = posture.respond(-share * self._search.impact_target.impulse.dot(posture.jacobian))
        return np.asarray(jump[self._search.vs])

    def solve(self, x: Array, slack: float) -> SwungKick | None:
        """Return the kick from unknowns to start from; None where the solver fails."""
        joints = self._joints
        most = np.full(len(joints.names), 1.0 - FEASIBLE)
        inside = FEASIBLE * (joints.high - joints.low)
        bounds = [stop.bounds(self._longest, None) for stop in self._stops]
        rows = [stop.rows(slack) for stop in self._stops]
        ends = [
            [joints.low + inside, -most, -most, [0.0]],
            [joints.high - inside, most, most, [1.0]],
        ]
        result = self._solver(
            x0=x,
            lbx=np.concatenate([*(low for low, _ in bounds), *ends[0]]),
            ubx=np.concatenate([*(high for _, high in bounds), *ends[1]]),
            lbg=np.concatenate([*(row.low for row in rows), self._equal, -most, self._front]),
            ubg=np.concatenate(
                [*(row.high for row in rows), self._equal, most, self._front + math.inf]
            ),
        )
        if not self._solver.stats()["success"]:
            return None
        return self._read(np.asarray(result["x"]).ravel())

    def _read(self, x: Array) -> SwungKick:
        search, joints, n = self._search, self._joints, len(self._joints.names)
        share = 1.0 if x[-1] > 1.0 - 1e-6 else float(x[-1])
        *stops, last = np.split(x, np.cumsum([stop.unknowns.numel() for stop in self._stops]))
        q = last[:n]
        posture = search.posture(q)
        velocity = search.exact(posture, search.whole(last[n : 2 * n] * joints.speed), share)
        v = velocity[search.vs]
        parts = []
        for stop, own, sign, w in zip(
            self._stops, stops, (-1, 1), (-v, v + self._jump(posture, share)), strict=True
        ):
            pulls, end, time = stop.read(own)
            parts.append(part_of(joints, sign, q, w, pulls, time, end))
        return SwungKick(Found(posture, velocity, share, 0.0), (parts[0], parts[1]))


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
