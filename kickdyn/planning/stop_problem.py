"""Coming to rest from a moving posture within all limits: an optimal control problem for Ipopt.

A kick needs it twice: the follow-through stops from the velocity just after the impact, and the
backswing is a stop from the negative velocity just before, seen backwards in time, in which the
torques of Newton-Euler are the same.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.planning.chain import Chain
from kickdyn.planning.swing_joints import Joints
from kickdyn.planning.swing_phase import SwingPhase

UNIT = 0.1
"""Accelerations are counted in the speed limit over this time [s]: the order of 1."""

SHORTEST = 1e-3
"""Shortest duration [s]."""

AWAY = 1e-7
"""How far positions and speeds stay from their limits, over the limits: Ipopt's rounding."""

EAGER = 100.0
"""Weight of the share against the objective, of the order of 1."""

SHORT = 0.2
"""Duration of the first guess [s]."""

NEARLY = 1e-6
"""How much of the share may be missing."""

OPTIONS = {
    "expand": True,  # into scalars: a quarter faster
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 300, "tol": 1e-8},
}


class Rows(NamedTuple):
    """Constraints with bounds, and what each of an inequality is about: limit and joint."""

    value: Any
    low: Array
    high: Array
    about: list[tuple[str, int]]


class Solved(NamedTuple):
    """A stop: positions and accelerations at the nodes, duration, share of the velocity.

    `value` is the objective's; `about` is the limit and the joint whose widening would raise the
    share most.
    """

    ok: bool
    said: str
    share: float
    value: float
    duration: float
    accelerations: Array
    end: Array
    about: tuple[str, int]
    unknowns: Array


class Stop:
    """A stop in CasADi's symbols: accelerations linear between nodes, the duration free.

    Positions are then cubic and speeds quadratic in time, and their Bezier points bound them: they
    keep their limits everywhere, not at nodes only. Torques keep theirs at nodes and half-way.

    Args:
        chain, joints: that move.
        nodes: intervals.
        q, w: symbols for posture and velocity at the start.
    """

    def __init__(self, chain: Chain, joints: Joints, nodes: int, q: Any, w: Any) -> None:
        n, self.nodes, self.joints = chain.n, nodes, joints
        speed, effort = ca.DM(joints.speed), ca.DM(joints.effort)
        low, width = ca.DM(joints.low), ca.DM(joints.high - joints.low)
        turns, speeds, pulls = (ca.MX.sym(name, n, nodes + 1) for name in ("q", "v", "a"))
        time = ca.MX.sym("t")
        self.unknowns = ca.vertcat(*(ca.vec(x) for x in (turns, speeds, pulls)), time)
        v, a, h = speeds * speed, pulls * (speed / UNIT), time / nodes
        q0, q1, v0, v1, a0, a1 = (part for x in (turns, v, a) for part in (x[:, :-1], x[:, 1:]))
        links = [
            (v1 - v0 - h / 2 * (a0 + a1)) / speed,
            (q1 - q0 - h * v0 - h * h / 6 * (2 * a0 + a1)) / width,
            (turns[:, 0] - q) / width,
            speeds[:, 0] - w / speed,
        ]
        bends = [(q0 + h / 3 * v0 - low) / width, (q1 - h / 3 * v1 - low) / width]
        peaks = (v0 + h / 2 * a0) / speed
        middle = (
            q0 + h / 2 * v0 + h * h / 48 * (5 * a0 + a1),
            v0 + h / 8 * (3 * a0 + a1),
            (a0 + a1) / 2,
        )
        at_nodes = chain.torque.map(nodes + 1)(turns, v, a) / effort
        between = chain.torque.map(nodes)(*middle) / effort
        still = chain.torque(turns[:, -1], ca.DM(n, 1), ca.DM(n, 1)) / effort
        squares = [ca.sum1(used**2) / n for used in (at_nodes, between)]
        self.effort = (
            h / 6 * (ca.sum2(squares[0][:-1]) + ca.sum2(squares[0][1:]) + 4 * ca.sum2(squares[1]))
        )
        self.time = time
        self._parts = [
            ("", ca.vertcat(*map(ca.vec, links)), 0.0, 0.0),
            ("range", ca.vertcat(*map(ca.vec, bends)), AWAY, 1.0 - AWAY),
            ("speed", ca.vec(peaks), -1.0 + AWAY, 1.0 - AWAY),
            ("torque", ca.vertcat(*map(ca.vec, (at_nodes, between, still))), -1.0, 1.0),
        ]

    def rows(self, slack: float) -> Rows:
        """Return all constraints; `slack` is the share of the torque limit that is left over."""
        n = len(self.joints.names)
        sizes = [int(value.numel()) for _, value, _, _ in self._parts]
        scale = [1.0 - slack if what == "torque" else 1.0 for what, *_ in self._parts]
        return Rows(
            ca.densify(ca.vertcat(*(value for _, value, _, _ in self._parts))),
            np.repeat([k * p[2] for k, p in zip(scale, self._parts, strict=True)], sizes),
            np.repeat([k * p[3] for k, p in zip(scale, self._parts, strict=True)], sizes),
            [(p[0], i % n) for p, m in zip(self._parts, sizes, strict=True) for i in range(m)],
        )

    def bounds(self, longest: float, rest: Array | None) -> tuple[Array, Array]:
        """Return bounds of the unknowns.

        Args:
            longest: duration [s].
            rest: posture at the end, shape `(n,)`; None leaves it free.
        """
        n, many = len(self.joints.names), self.nodes + 1
        margin = AWAY * (self.joints.high - self.joints.low)
        low, high = self.joints.low + margin, self.joints.high - margin
        turns = [np.tile(one, (many, 1)) for one in (low, high)]
        turns[0][0], turns[1][0] = -np.inf, np.inf  # the posture at the start is given
        if rest is not None:
            turns[0][-1] = turns[1][-1] = rest
        speeds = np.full((many, n), 1.0 - AWAY)
        speeds[-1] = 0.0
        free = np.full(many * n, np.inf)
        return (
            np.concatenate([turns[0].ravel(), -speeds.ravel(), -free, [SHORTEST]]),
            np.concatenate([turns[1].ravel(), speeds.ravel(), free, [longest]]),
        )

    def guess(self, q: Array, w: Array, time: float) -> Array:
        """Return a stop at even decelerations, cut off at the ends of the range."""
        s = np.linspace(0.0, 1.0, self.nodes + 1)[:, None]
        turns = np.clip(q + w * time * (s - s * s / 2), self.joints.low, self.joints.high)
        speeds = np.clip(w / self.joints.speed, -1, 1) * (1 - s)
        pulls = np.ones_like(s) * (-w / time) / (self.joints.speed / UNIT)
        return np.concatenate([turns.ravel(), speeds.ravel(), pulls.ravel(), [time]])

    def near(self, part: SwingPhase) -> Array:
        """Return the unknowns that come nearest to a part."""
        q, v, a = part.resampled(self.nodes)
        speed = self.joints.speed
        rows = (q, v / speed, a / (speed / UNIT))
        return np.concatenate([*(one.ravel() for one in rows), [part.duration]])

    def read(self, x: Array) -> tuple[Array, Array, float]:
        """Return accelerations `(nodes + 1, n)`, the posture at the end, and the duration."""
        n, many = len(self.joints.names), self.nodes + 1
        turns, _, pulls = x[: 3 * many * n].reshape(3, many, n)
        return pulls * self.joints.speed / UNIT, turns[-1].copy(), float(x[3 * many * n])


class Stopper:
    """Solves stops of one chain from given postures and velocities.

    Args:
        chain, joints: that move.
        nodes: intervals.
        objective: `time` or `effort`.
    """

    def __init__(self, chain: Chain, joints: Joints, nodes: int, objective: str) -> None:
        q, w = ca.MX.sym("q1", chain.n), ca.MX.sym("w1", chain.n)
        share, weights = ca.MX.sym("share"), ca.MX.sym("weights", 2)
        self._stop = Stop(chain, joints, nodes, q, share * w)
        self._rows = self._stop.rows(0.0)
        cost = self._stop.time if objective == "time" else self._stop.effort
        self._solver = ca.nlpsol(
            "stop",
            "ipopt",
            {
                "x": (unknowns := ca.vertcat(self._stop.unknowns, share)),
                "g": self._rows.value,
                "f": weights[0] * cost - weights[1] * share,
                "p": ca.vertcat(q, w, weights),
            },
            OPTIONS,
        )
        self._cost = ca.Function("cost", [unknowns], [cost])

    def near(self, part: SwingPhase) -> Array:
        """Return a part as what `solve` takes for `near`."""
        return np.append(self._stop.near(part), 1.0)

    def as_it_is(self, part: SwingPhase) -> Solved:
        """Return a part as a stop from all of the velocity."""
        x = self.near(part)
        pulls, end, time = self._stop.read(x)
        return Solved(True, "", 1.0, float(self._cost(x)), time, pulls, end, ("", 0), x)

    def solve(
        self,
        q: Array,
        w: Array,
        *,
        longest: float,
        rest: Array | None,
        slack: float,
        most: float = 1.0,
        near: Array | None = None,
    ) -> Solved:
        """Return the stop from the largest share of a velocity, up to `most`.

        A guess of a short stop is tried first; where that falls short of `most`, also a long one,
        and the unknowns `near` which it shall be, in the end with `most` of the velocity at once.
        """

        def run(shares: tuple[float, float], weights: tuple[float, float], x: Array) -> Solved:
            return self._run(q, w, longest, rest, slack, shares, weights, x)

        tried = list[Solved]()
        times = {min(SHORT, longest), longest}
        starts = [self._stop.guess(q, w, time) for time in sorted(times)]
        for first in starts if near is None else [*starts, near[:-1]]:
            both = run((0.0, most), (1.0, EAGER), first)
            if both.ok and both.share > most * (1 - NEARLY):
                return both._replace(share=most)
            alone = run((0.0, most), (0.0, 1.0), both.unknowns[:-1] if both.ok else first)
            if alone.ok and alone.share > most * (1 - NEARLY):
                best = run((most, most), (1.0, 0.0), alone.unknowns[:-1])
                return (best if best.ok else alone)._replace(share=most)
            tried += [both, alone]
        if near is not None:  # which may be a stop from all of it already
            best = run((most, most), (1.0, 0.0), near[:-1])
            if best.ok:
                return best._replace(share=most)
        return max(tried, key=lambda one: (one.ok, one.share))

    def _run(
        self,
        q: Array,
        w: Array,
        longest: float,
        rest: Array | None,
        slack: float,
        shares: tuple[float, float],
        weights: tuple[float, float],
        start: Array,
    ) -> Solved:
        low, high = self._stop.bounds(longest, rest)
        rows = self._stop.rows(slack)
        found = self._solver(
            x0=np.append(start, shares[1]),
            lbx=np.append(low, shares[0]),
            ubx=np.append(high, shares[1]),
            lbg=rows.low,
            ubg=rows.high,
            p=np.concatenate([q, w, weights]),
        )
        state = self._solver.stats()
        x = np.asarray(found["x"]).ravel()
        pulls, end, time = self._stop.read(x)
        about = self._binding(
            np.asarray(found["lam_x"]).ravel(), np.asarray(found["lam_g"]).ravel()
        )
        return Solved(
            bool(state["success"]), str(state["return_status"]), float(x[-1]),
            float(self._cost(x)), time, pulls, end, about, x,
        )  # fmt: skip

    def _binding(self, of_unknowns: Array, of_rows: Array) -> tuple[str, int]:
        """Return the limit and joint whose widening, by a share of its width, would gain most."""
        n, many = len(self._stop.joints.names), self._stop.nodes + 1
        gains: dict[tuple[str, int], float] = {}
        width = self._stop.joints.high - self._stop.joints.low
        bounds = np.abs(of_unknowns[: 2 * many * n]).reshape(2, many, n)
        for joint in range(n):
            gains["range", joint] = float(bounds[0, 1:, joint].sum() * width[joint])
            gains["speed", joint] = float(bounds[1, :-1, joint].sum())
        for about, size in zip(self._rows.about, np.abs(of_rows).tolist(), strict=True):
            if about[0]:
                gains[about] = gains.get(about, 0.0) + size
        return max(gains, key=lambda about: gains[about])
