r"""A kick that the leg can swing to from rest and stop after: one problem with both stops.

The strike is part of it. With the joint velocity :math:`v^-` before and :math:`v^+` after, the
impulse :math:`p` on the ball and its share :math:`s`,

.. math::
    M (v^+ - v^-) = -s\, J^T p, \qquad n \cdot (u_b - J v^+) = e\, n \cdot J v^-,

with the velocity :math:`u_b` of the ball's contact point, and no sliding just after where the
contact has friction.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.casadi_chain import CasadiChain
from kickdyn.planning.kick_program import FEASIBLE, KickObjective, KickProgram, KickSolution
from kickdyn.planning.stop_problem import EAGER, OPTIONS, SHORT, StopEquations
from kickdyn.planning.swing_phase import LONGEST, SwingPhase, swing_chain
from kickdyn.robot.leg import Posture

NODES = 24
"""Intervals of each stop, as many as `plan_swing` takes; half as many with five joints or more, for
which building the problem alone would take 5 s."""

SLACK = 0.02
"""Share of the torque limits left over at first, for torques between the solver's points."""

STARTS = 3
"""Postures to start from: that of the kick without a swing, and others near it."""

BUDGET = 60_000
"""Iterations of Ipopt for a leg of one joint, after which none are started; for n joints, n^3 times
fewer. An iteration takes 0.017 s of a processor with six joints, 0.003 s with three."""

LEFT = 0.006
"""Share of the torque limits left over on the fine grid: more than `plan_swing` leaves at first."""

Phases = tuple[SwingPhase, SwingPhase]


class SwingKick(NamedTuple):
    """A kick, with the backswing and the follow-through that were found with it."""

    kick: KickSolution
    phases: Phases

    @property
    def excess(self) -> float:
        """How far torques on the fine grid are above what they shall be, over their limits."""
        return max(phase.torque_use for phase in self.phases) - (1.0 - LEFT)


def solve_with_swing(
    program: KickProgram, found: KickSolution, objective: KickObjective
) -> tuple[KickSolution, Phases]:
    """Return the best kick near one, such that the leg can swing to it from rest and stop.

    Args:
        program: leg and impact target.
        found: a kick that keeps the limits at the impact.
        objective: `joint-speed` or `kinetic-energy`.

    Raises:
        InvalidInput: the solver finds none at all, or a joint has no limit.
    """
    problem = _SwingKickProblem(program, found, objective)
    draw, best = np.random.default_rng(0), None
    for number in range(STARTS):
        q = found.posture.q[program.qs]
        if number:
            q = q + draw.normal(0.0, 0.3, len(q))
        one = problem.solve(problem.guess(q), SLACK)
        if one is not None and (best is None or one.kick.share > best.kick.share + 1e-6):
            best = one
        if best is not None and best.kick.share == 1.0:
            break
    best = best and problem.keep_limits(best)
    if best is None:
        spent = " within the iterations that the solver has" if problem.left <= 0 else ""
        raise InvalidInput(f"{program.leg.name} finds no posture that it can swing to{spent}")
    return best.kick, best.phases


class _SwingKickProblem:
    """The problem of a kick and both stops, scaled by the kick `found`.

    Attributes:
        left: iterations that the solver may still take.
    """

    def __init__(
        self,
        program: KickProgram,
        found: KickSolution,
        objective: KickObjective,
    ) -> None:
        self._program = program
        self._chain = chain = swing_chain(program.leg)
        self._symbols = symbols = CasadiChain(chain.model, found.posture.contact_lever)
        n, speed = symbols.n, ca.DM(chain.velocity_limit)
        self.left, nodes = BUDGET // n**3, NODES if n < 5 else NODES // 2
        q, before, after = (ca.MX.sym(name, n) for name in ("q", "vb", "va"))
        share = ca.MX.sym("share")
        v, w = before * speed, after * speed
        self._stops = [StopEquations(symbols, chain, nodes, q, away) for away in (-v, w)]
        equal = self._strike(found, q, v, w, share)
        static = symbols.torque(q, v, ca.DM(n, 1)) / ca.DM(chain.effort_limit)
        here, normal = found.posture, ca.DM(program.target.contact.normal)
        levers = [
            here.with_contact_offset(row).contact_lever - here.contact_lever
            for row in program.contact_normal_cone
        ]
        facing = [ca.dot(normal, symbols.direction(q, ca.DM(lever))) for lever in levers]
        torque = self._stops[0].torque_squared + self._stops[1].torque_squared
        cost = _symbolic_cost(objective, symbols, q, v, speed)
        self._solver = ca.nlpsol(
            "kick",
            "ipopt",
            {
                "x": ca.vertcat(*(stop.unknowns for stop in self._stops), q, before, after, share),
                "g": ca.vertcat(
                    *(stop.constraints for stop in self._stops), equal, static, *facing
                ),
                "f": cost + 1e-3 * torque - EAGER * share,  # torque picks one of many swings
            },
            OPTIONS,
        )
        self._equal = np.zeros(int(equal.numel()))
        self._facing = np.zeros(len(facing))

    def _strike(self, found: KickSolution, q: Any, v: Any, w: Any, share: Any) -> Any:
        """Return the equations of the strike and of the ball's position, scaled to about 1."""
        program, symbols = self._program, self._symbols
        target, ball, normal = program.target, program.target.ball, program.target.contact.normal
        jump = symbols.momentum(q, w - v) + share * symbols.impulse(q, ca.DM(target.impulse))
        size = self._chain.velocity_limit * float(found.posture.inertia.max())
        across = target.impulse - (normal @ target.impulse) * normal
        ball_point = target.impulse / ball.mass + ball.radius**2 / ball.inertia * across
        apart = share * ca.DM(ball_point) - symbols.point_velocity(q, w)
        fast = float(np.linalg.norm(ball_point))
        approach = symbols.point_velocity(q, v)
        law = ca.dot(normal, apart - target.contact.restitution * approach) / fast
        equal = [jump / ca.DM(size), law]
        if target.contact.friction > 0.0:
            rows = _directions_across(program.directions, normal)
            equal += [rows @ apart / fast] if len(rows) else []
        if len(program.position_rows):
            off = symbols.point_position(q) + ca.DM(ball.radius * normal - program.ball_centre)
            equal.append(ca.DM(program.position_rows) @ off / ball.radius)
        return ca.vertcat(*equal)

    def keep_limits(self, near: SwingKick) -> SwingKick | None:
        """Return a kick near one, whose torques keep their limits between the nodes too.

        As long as they do not, it is solved again with so much more slack.
        """
        slack, found = SLACK, near
        while found.excess > 0.0 and slack < 0.5:
            slack += min(found.excess + LEFT / 2, 0.1)
            found = self.solve(self._unknowns(found), slack) or found
            if self.left <= 0:
                break
        return found if found.excess <= 0.0 else None

    def guess(self, q: Array) -> Array:
        """Return unknowns to start from, with even decelerations to a posture and from it."""
        program, chain, speed = self._program, self._chain, self._chain.velocity_limit
        room = 0.2 * (chain.upper - chain.lower)
        q = np.clip(q, chain.lower + room, chain.upper - room)
        posture = program.posture(q)
        v = np.linalg.pinv(posture.jacobian[:, program.vs] * speed, rcond=1e-2)
        v = speed * (v @ program.target.foot_velocity(posture))
        share = float(min(1.0, 0.5 / np.abs(v / speed).max()))
        v = share * v
        w = v + self._jump(posture, share)
        stops = [
            stop.guess(q, away, SHORT) for stop, away in zip(self._stops, (-v, w), strict=True)
        ]
        return np.concatenate([*stops, q, v / speed, w / speed, [share]])

    def _unknowns(self, near: SwingKick) -> Array:
        """Return a kick with its phases as unknowns."""
        kick, speed = near.kick, self._chain.velocity_limit
        q, v = kick.posture.q[self._program.qs], kick.v[self._program.vs]
        after = v + self._jump(kick.posture, kick.share)
        stops = [
            stop.unknowns_of(phase) for stop, phase in zip(self._stops, near.phases, strict=True)
        ]
        return np.concatenate([*stops, q, v / speed, after / speed, [kick.share]])

    def _jump(self, posture: Posture, share: float) -> Array:
        """Return the change of the joints' velocity by the impact, shape `(n,)` [rad/s]."""
        jump = posture.solve(-share * self._program.target.impulse @ posture.jacobian)
        return np.asarray(jump[self._program.vs])

    def solve(self, x: Array, slack: float) -> SwingKick | None:
        """Return the kick from unknowns to start from.

        None where the solver fails, or has no iterations left.
        """
        if self.left <= 0:
            return None
        chain = self._chain
        most = np.full(len(chain.names), 1.0 - FEASIBLE)
        inside = FEASIBLE * (chain.upper - chain.lower)
        low, high = zip(*(stop.bounds(LONGEST, None) for stop in self._stops), strict=True)
        lowest, highest = zip(*(stop.constraint_bounds(slack) for stop in self._stops), strict=True)
        found = self._solver(
            x0=x,
            lbx=np.concatenate([*low, chain.lower + inside, -most, -most, [0.0]]),
            ubx=np.concatenate([*high, chain.upper - inside, most, most, [1.0]]),
            lbg=np.concatenate([*lowest, self._equal, -most, self._facing]),
            ubg=np.concatenate([*highest, self._equal, most, self._facing + math.inf]),
        )
        state = self._solver.stats()
        self.left -= int(state["iter_count"])
        if not state["success"]:
            return None
        return self._read(np.asarray(found["x"]).ravel())

    def _read(self, x: Array) -> SwingKick:
        """Return unknowns as a kick with its phases."""
        program, n = self._program, len(self._chain.names)
        share = 1.0 if x[-1] > 1.0 - 1e-6 else float(x[-1])
        *stops, last = np.split(x, np.cumsum([stop.unknowns.numel() for stop in self._stops]))
        q = last[:n]
        posture = program.posture(q)
        whole = program.whole_velocity(last[n : 2 * n] * self._chain.velocity_limit)
        velocity = program.with_exact_velocity(posture, whole, share)
        v = velocity[program.vs]
        sides = ((-1, -v), (1, v + self._jump(posture, share)))
        backswing, follow_through = (
            stop.phase(sign, q, away, own)
            for stop, own, (sign, away) in zip(self._stops, stops, sides, strict=True)
        )
        kick = KickSolution(posture, velocity, share, 0.0)
        return SwingKick(kick, (backswing, follow_through))


def _directions_across(directions: Array, normal: Array) -> Array:
    """Return directions across the normal that the foot can move in, as rows."""
    _, gains, rows = np.linalg.svd(directions - np.outer(directions @ normal, normal))
    return np.asarray(rows[: len(gains)][gains > 1e-6])


def _symbolic_cost(
    objective: KickObjective, symbols: CasadiChain, q: Any, v: Any, speed: Any
) -> Any:
    """Return an objective of the order of 1 in symbols."""
    if objective == KickObjective.JOINT_SPEED:
        return ca.sumsqr(v / speed) / symbols.n
    return ca.dot(v, symbols.momentum(q, v)) / ca.dot(speed, symbols.momentum(q, speed))
