r"""A kick that the leg can swing to from rest and stop after: one problem with both stops.

The strike is part of it. With the joint velocity :math:`v^-` before and :math:`v^+` after, the
impulse :math:`p` on the ball and its share :math:`s`,

.. math::
    M (v^+ - v^-) = -s\, J^T p, \qquad n \cdot (u_b - J v^+) = e\, n \cdot J v^-,

with the velocity :math:`u_b` of the ball's contact point, and no sliding just after where the
contact has friction.
"""

import math
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.ball_clearance import BallClearance
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.kick_problem import KickProblem, KickSolution, solve_kick
from kickdyn.planning.kick_terms import (
    BallPosition,
    Facing,
    JointRange,
    KickPoint,
    Objective,
    SpeedLimit,
    StrikeVelocity,
    TorqueLimit,
)
from kickdyn.planning.objectives import KineticEnergy
from kickdyn.planning.problem import TOLERANCE
from kickdyn.planning.stop_problem import (
    EAGER,
    OPTIONS,
    SHORT,
    StopEquations,
    point_function,
    torque_function,
)
from kickdyn.planning.swing_phase import LONGEST, SwingPhase, swing_chain
from kickdyn.restitution import rows_of
from kickdyn.robot.leg import Posture

NODES = 24
"""Intervals of each stop, as many as `plan_swing` takes; half as many with five joints or more, for
which building the problem alone would take 5 s."""

SLACKS = (0.04, 0.1, 0.2, 0.3)
"""Shares of the torque limits left over, for torques between the solver's points, tried in turn:
from the posture of the kick without a swing first, then from others near it. Those that a solution
shows to be too small are left out."""

BUDGET = 54_000
"""Iterations of Ipopt for one joint, after which no further solution is sought; for n joints, n^3
times fewer. An iteration takes 0.018 s of a processor with six joints."""

KNOWN_TERMS = (JointRange, StrikeVelocity, BallPosition, SpeedLimit, TorqueLimit, Facing)
"""Terms of a kick that the problem of a kick with its swing contains."""

Phases = tuple[SwingPhase, SwingPhase]


def solve_with_swing(problem: KickProblem, objective: Objective) -> tuple[KickSolution, Phases]:
    """Return the best kick such that the leg can swing to it from rest and stop, and both phases.

    It is sought near the kick without a swing.

    Args:
        problem: of a leg on a fixed base, with limits.
        objective: `JointSpeed` or `KineticEnergy`.

    Raises:
        InvalidInput: the solver finds none at all, or a joint has no limit.
    """
    problem, start, _ = solve_kick(problem, objective)
    # the plan's check reports what is inside the ball
    problem = problem.without(term for term in problem.terms if isinstance(term, BallClearance))
    variables = problem.variables
    swing, best, needed = _SwingKickProblem(problem, start, objective), [], 0.0
    draw = np.random.default_rng(0)
    for number, slack in enumerate(SLACKS):
        spread = draw.normal(0.0, 0.3 if number else 0.0, variables.n)
        if slack < min(needed, SLACKS[-1]):
            continue
        solved = swing.solve(start.posture.q[variables.qs] + spread, slack)
        if solved is not None:
            excess = max(phase.torque_use for phase in solved[1]) - 1.0
            needed = slack + excess
            if excess <= 0.0:
                best.append(solved)
                if solved[0].share == 1.0:
                    break
        if swing.iterations > BUDGET / variables.n**3:
            break
    if not best:
        raise InvalidInput(f"{variables.leg.name} finds no posture that it can swing to")
    point, phases = max(best, key=lambda solved: solved[0].share)
    binding = ("swing",) if point.share < start.share - 1e-6 else ()
    return KickSolution(problem, point, binding), phases


class _SwingKickProblem:
    """The problem of a kick and both stops, scaled by the kick `start`; it counts iterations."""

    def __init__(self, problem: KickProblem, start: KickPoint, objective: Objective) -> None:
        unknown = [type(term).__name__ for term in problem.terms if type(term) not in KNOWN_TERMS]
        if unknown:
            raise InvalidInput(f"swing is True: a swing cannot keep the terms {', '.join(unknown)}")
        strike = problem.find(StrikeVelocity)
        assert strike is not None
        self._strike_velocity, self._ball = strike, problem.find(BallPosition)
        self._directions = problem.foot_directions
        facing = problem.find(Facing)
        cone = np.zeros((0, 3)) if facing is None else facing.cone
        self._variables, posture = (variables := problem.variables), start.posture
        self._chain = chain = swing_chain(variables.leg)
        nodes = NODES if variables.n < 5 else NODES // 2
        n, speed, still = variables.n, ca.DM(chain.velocity_limit), ca.DM(variables.n, 1)
        torque, point = torque_function(chain.model), point_function(chain.model)
        q, before, after = (ca.MX.sym(name, n) for name in ("q", "vb", "va"))
        share = ca.MX.sym("share")
        v, w = before * speed, after * speed
        weight = torque(q, still, still)
        self._stops = [StopEquations(chain, nodes, q, away) for away in (-v, w)]
        position = point(q, ca.DM(posture.contact_lever))
        jump = torque(q, still, w - v) - weight  # M (w - v)
        equal = self._strike(posture, position, ca.jacobian(position, q), jump, v, w, share)
        static = torque(q, v, still) / ca.DM(chain.effort_limit)
        levers = [
            posture.with_contact_offset(row).contact_lever - posture.contact_lever for row in cone
        ]
        normal = ca.DM(variables.target.contact.normal)
        facings = [ca.dot(normal, point(q, ca.DM(x)) - point(q, ca.DM(3, 1))) for x in levers]
        effort = self._stops[0].torque_squared + self._stops[1].torque_squared
        cost = ca.sumsqr(before) / n
        if isinstance(objective, KineticEnergy):
            momenta = [(u, torque(q, still, u) - weight) for u in (v, speed)]
            cost = ca.dot(*momenta[0]) / ca.dot(*momenta[1])
        self._solver = ca.nlpsol(
            "kick",
            "ipopt",
            {
                "x": ca.vertcat(*(stop.unknowns for stop in self._stops), q, before, after, share),
                "g": ca.vertcat(
                    *(stop.constraints for stop in self._stops), equal, static, *facings
                ),
                "f": cost + 1e-3 * effort - EAGER * share,  # torque picks one of many swings
            },
            OPTIONS,
        )
        self.iterations = 0
        self._equal = np.zeros(int(equal.numel()))
        self._facing = np.zeros(len(facings))

    def _strike(
        self, posture: Posture, position: Any, jacobian: Any, jump: Any, v: Any, w: Any, share: Any
    ) -> Any:
        """Return the equations of the strike and of the ball's position, scaled to about 1."""
        variables = self._variables
        target, ball, normal = (
            variables.target,
            variables.target.ball,
            variables.target.contact.normal,
        )
        jump = jump + share * (jacobian.T @ ca.DM(target.impulse))
        size = self._chain.velocity_limit * float(posture.inertia.max())
        across = target.impulse - (normal @ target.impulse) * normal
        ball_point = target.impulse / ball.mass + ball.radius**2 / ball.inertia * across
        apart = share * ca.DM(ball_point) - jacobian @ w
        fast = float(np.linalg.norm(ball_point))
        law = ca.dot(normal, apart - _restitution(target, jacobian @ v) * (jacobian @ v)) / fast
        equal = [jump / ca.DM(size), law]
        if target.contact.friction > 0.0:
            rows = _directions_across(self._directions, normal)
            equal += [rows @ apart / fast] if len(rows) else []
        if self._ball is not None:
            off = position + ca.DM(ball.radius * normal - self._ball.centre)
            equal.append(ca.DM(self._ball.rows) @ off / ball.radius)
        return ca.vertcat(*equal)

    def solve(self, q: Array, slack: float) -> tuple[KickPoint, Phases] | None:
        """Return the kick from a posture to start from; None where the solver fails."""
        variables, chain, n = self._variables, self._chain, self._variables.n
        most = np.full(n, 1.0 - TOLERANCE)
        inside = TOLERANCE * (chain.upper - chain.lower)
        low, high = zip(*(stop.bounds(LONGEST, None) for stop in self._stops), strict=True)
        lowest, highest = zip(*(stop.constraint_bounds(slack) for stop in self._stops), strict=True)
        end = self._solver(
            x0=self._guess(q),
            lbx=np.concatenate([*low, chain.lower + inside, -most, -most, [0.0]]),
            ubx=np.concatenate([*high, chain.upper - inside, most, most, [1.0]]),
            lbg=np.concatenate([*lowest, self._equal, -most, self._facing]),
            ubg=np.concatenate([*highest, self._equal, most, self._facing + math.inf]),
        )
        state = self._solver.stats()
        self.iterations += int(state["iter_count"])
        if not state["success"]:
            return None
        x = np.asarray(end["x"]).ravel()
        *unknowns, last = np.split(x, np.cumsum([stop.unknowns.numel() for stop in self._stops]))
        share = 1.0 if x[-1] > 1.0 - 1e-6 else float(x[-1])
        q, v = last[:n], last[n : 2 * n] * chain.velocity_limit
        point = self._strike_velocity.make_exact(variables.point(variables.unknowns(q, v, share)))
        v = point.v[variables.vs]
        back, on = self._stops
        phases = (
            back.phase(-1, q, -v, unknowns[0]),
            on.phase(1, q, v + self._jump(point.posture, share), unknowns[1]),
        )
        return point, phases

    def _guess(self, q: Array) -> Array:
        """Return unknowns to start from, with even decelerations to a posture and from it."""
        variables, chain, speed = self._variables, self._chain, self._chain.velocity_limit
        room = 0.2 * (chain.upper - chain.lower)
        q = np.clip(q, chain.lower + room, chain.upper - room)
        posture = variables.posture(q)
        v = np.linalg.pinv(posture.jacobian[:, variables.vs] * speed, rcond=1e-2)
        v = speed * (v @ variables.target.foot_velocity(posture))
        share = float(min(1.0, 0.5 / np.abs(v / speed).max()))
        v = share * v
        w = v + self._jump(posture, share)
        stops = [
            stop.guess(q, away, SHORT) for stop, away in zip(self._stops, (-v, w), strict=True)
        ]
        return np.concatenate([*stops, q, v / speed, w / speed, [share]])

    def _jump(self, posture: Posture, share: float) -> Array:
        """Return the change of the joints' velocity by the impact, shape `(n,)` [rad/s]."""
        jump = posture.solve(-share * self._variables.target.impulse @ posture.jacobian)
        return np.asarray(jump[self._variables.vs])


def _restitution(target: ImpactTarget, foot: Any) -> Any:
    """Return e for a velocity of the foot: a number, or a piecewise linear CasADi expression."""
    restitution = target.contact.restitution
    if isinstance(restitution, float):
        return restitution
    rows = rows_of(restitution)
    if len({e for _, e in rows}) == 1:
        return rows[0][1]
    speed, e = ca.dot(ca.DM(target.contact.normal), foot), rows[0][1]
    for (low, before), (high, after) in pairwise(rows):
        e += (after - before) / (high - low) * (ca.fmin(ca.fmax(speed, low), high) - low)
    return e


def _directions_across(directions: Array, normal: Array) -> Array:
    """Return directions across the normal that the foot can move in, as rows."""
    _, gains, rows = np.linalg.svd(directions - np.outer(directions @ normal, normal))
    return np.asarray(rows[: len(gains)][gains > 1e-6])
