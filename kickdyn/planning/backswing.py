r"""The backswing of a robot that stands on one foot: from rest to the planned impact.

Its unknowns are the joints' accelerations at the nodes, linear in between, and the duration; the
posture and the velocity at the impact are given and the velocity at the start is 0. With
:math:`g \ge 0` for everything that it must keep, least squares find

.. math::
    \min_{\ddot q(t),\, T} \sum_k \Big(
        W^2 \min(g_{kinematic}, 0)^2 + w^2 \min(g_{dynamic}, 0)^2
        + \epsilon^2 (\tau / \tau_{max})^2 \Big)

at the nodes and half-way between them, heights half-way between those too, with
:math:`W \gg w \gg \epsilon`. Kinematic conditions are those of the joints' ranges and speeds, of
the trunk, of the kicking foot above the ground, and of the start, where the robot stands at rest.
They are kept, or there is no backswing. Dynamic ones are the torque limits and what the ground can
supply to the supporting foot. They are kept where the solver finds such a motion;
`Backswing.warnings` names those that are not.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import null_space
from scipy.optimize import least_squares

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.leg_response import Footing, footing
from kickdyn.planning.kick_problem import KickProblem, KickSolution
from kickdyn.planning.kick_terms import JointRange, KickPoint, Objective
from kickdyn.planning.problem import keep_last
from kickdyn.planning.stance import (
    LENGTH,
    TILT,
    Balance,
    Clearance,
    StanceTerm,
    Upright,
    height_slopes,
)
from kickdyn.planning.swing_phase import (
    LONGEST,
    Motion,
    SwingPhase,
    integrate_accelerations,
    make_phase,
)
from kickdyn.robot.ground_clearance import Spheres
from kickdyn.robot.kicking_chain import KickingChain, kicking_chain
from kickdyn.robot.standing import StandingRobot, joint_spheres, kicking_limb

LIFT = 100.0
"""Largest upward acceleration of the kicking foot in the backswing [m/s2].

It is a choice, about ten times gravity: with less, fewer kicks have a backswing; with more, the
backswing takes more torque.
"""

RESERVE = 0.02
"""Share of the range of each joint that remains at either end at the impact: a joint that is at an
end and moves away from it came from beyond."""

TRIED = 2
"""Postures at the impact for which a backswing is sought, the best ones first."""

NODES = 8
"""Intervals between nodes; their lengths grow with the time from the impact, where the foot's path
is bent most."""

SHORTEST, GUESS = 0.1, 0.3
"""Shortest duration, and the one of the first guess [s]."""

GAP = 2e-3
"""Height above the ground that the solver aims at [m]: between its times, a foot comes lower."""

MARGIN = 5e-3
"""Distance of the centre of mass at the start from the edge of the sole that it aims at [m]."""

LEAN = math.radians(45)
"""Largest angle between the trunk and its direction in the robot that stands upright [rad]: more
than `TILT` at the impact, so that a trunk can come from where it swings back."""

LEAN_MARGIN = (math.cos(LEAN) - math.cos(TILT)) / Upright.scale
"""Value of `Upright`, over its scale, where the trunk is so far from upright."""

SHARE = 0.01
"""Share of each limit (range, speed and torque of a joint, tilt of the trunk) that the solver
leaves over, for what is between its times."""

RANGE, HEIGHT = 0.1, 0.03
"""Scales of kinematic conditions: of joints [rad, m] and of heights and distances [m]."""

WEIGHTS = ((1.0, 0.3, 0.1), (10.0, 0.3, 0.1), (10.0, 0.03, 0.003))
"""Weights of kinematic conditions in their scales, of torques over their limits, and of the
ground's wrench over the robot's weight. Each stage starts from the one before, and is taken only
where that one does not keep a kinematic condition. The last one is for a kick whose foot has a path
only with more torque, or with a wrench that ground cannot supply."""

EASE = 0.01
"""Weight of the torques within their limits."""


@dataclass(frozen=True, eq=False, repr=False)
class Backswing(ReprMixin):
    """The motion of a robot that stands on one foot, from rest to a planned impact.

    Attributes:
        phase: motion of the joints between the supporting foot and the kicking foot; all others
            stay at 0.
        standing: the robot.
    """

    phase: SwingPhase
    standing: StandingRobot

    def _rows(self) -> Iterable[Row]:
        yield "joints", ", ".join(self.joints), ""
        yield "duration", self.duration, "s"
        yield "foot above the ground", self.clearance, "m"
        yield "share of the torque limit", self.phase.torque_use, ""
        yield "share of the speed limit", self.phase.speed_use, ""
        for line in self.warnings:
            yield "warning", line, ""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move."""
        return self.phase.chain.names

    @property
    def duration(self) -> float:
        """From rest to the impact [s]."""
        return self.phase.duration

    def configuration(self, t: float) -> Array:
        """Return q of the whole robot at a time from the impact, shape `(nq,)`; at rest before."""
        return self._state(t)[0]

    def velocity(self, t: float) -> Array:
        """Return v of the whole robot at a time from the impact [s], shape `(nv,)`."""
        return self._state(t)[1]

    def _state(self, t: float) -> tuple[Array, Array]:
        """Return q and v of the whole robot at a time from the impact [s]."""
        time = min(max(validation.number("t", t, unit="s"), -self.duration), 0.0)
        motion, chain = self.phase.sample(time), self.phase.chain
        return self.standing.whole(*chain.whole(self.standing.leg, motion.q[0], motion.v[0]))

    @cached_property
    def clearance(self) -> float:
        """Least height of the kicking limb above the ground on the fine grid [m]."""
        return float(self._heights.min())

    @cached_property
    def _heights(self) -> Array:
        limb, chain = _kicking_limb(self.standing), self.phase.chain
        model, data, heights = chain.model, chain.model.createData(), []
        for q in self.phase.fine.q:
            pin.forwardKinematics(model, data, q)
            heights.append(min(_height(data.oMi[model.getJointId(j)], body) for j, body in limb))
        return np.array(heights)

    @property
    def too_strong(self) -> dict[str, float]:
        """Largest torque over limit of the joints that exceed it, by name."""
        chain = self.phase.chain
        use = (np.abs(self.phase.fine.torque) / chain.effort_limit).max(axis=0)
        every = zip(chain.names, use.tolist(), strict=True)
        return {name: share for name, share in every if share > 1.0}

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for torques above their limits, and one for a support that does not stand.

        `footing` judges the wrench of the ground, gravity included. A foot that turns about the
        vertical counts as standing.
        """
        motion, lines = self.phase.fine, list[str]()
        over = [f"{name} {share:.0%}" for name, share in self.too_strong.items()]
        if over:
            lines.append(f"the backswing takes more than the torque limits: {', '.join(over)}")
        counts = Counter(self._footing(motion))
        total = counts.total()
        del counts[Footing.STANDS], counts[Footing.TURNS]
        if counts:
            off = [f"{state} for {counts[state] / total:.0%}" for state in counts]
            lines.append(
                f"in the backswing, {self.standing.support.frame} {' and '.join(off)} of the "
                "time; the motion takes forces that ground cannot supply"
            )
        return tuple(lines)

    def _footing(self, motion: Motion) -> list[Footing]:
        """Return how the supporting foot would move on ground that only pushes, at each time."""
        model, data = (dynamics := _Dynamics(self.phase.chain)).model, dynamics.data
        place, support = self.standing.placement, self.standing.support
        states = []
        for q, v, a in zip(motion.q, motion.v, motion.a, strict=True):
            wrench = pin.rnea(model, data, *dynamics.floating(q, v, a))[:6]
            moment = wrench[3:] - np.cross(place.translation, wrench[:3])
            at_frame = np.concatenate([wrench[:3], moment])
            states.append(footing(support, at_frame, place.rotation, dynamics.weight))
        return states

    def fault(self) -> str:
        """Return the kinematic condition that is not kept on the fine grid, in a line, or none."""
        phase, chain = self.phase, self.phase.chain
        motion = phase.fine
        out = np.maximum(chain.lower - motion.q, motion.q - chain.upper).max(axis=0)
        fast = (np.abs(motion.v) / chain.velocity_limit).max(axis=0)
        if self.clearance < 0.0:
            when = -1e3 * motion.time[int(np.argmin(self._heights))]
            depth = -self.clearance
            return f"its kicking foot is {depth:.2g} m under the ground {when:.0f} ms before"
        if out.max() > 0.0:
            return f"{chain.names[int(np.argmax(out))]} is {out.max():.2g} rad outside its range"
        if fast.max() > 1.0:
            return f"{chain.names[int(np.argmax(fast))]} is faster than its limit"
        rest, still = motion.q[0], np.zeros(len(chain.names))
        leg = self.standing.leg  # with the joints that stay at 0: one of them may carry the trunk
        wholes = [chain.whole(leg, q, still) for q in motion.q]
        trunk = Upright(self.standing)
        if (
            min(trunk.residual(leg.posture(q), v).item() for q, v in wholes)
            < LEAN_MARGIN * trunk.scale
        ):
            return f"its trunk is more than {math.degrees(LEAN):.0f} deg from upright"
        weight = pin.rnea(chain.model, chain.model.createData(), rest, still, still)
        if Balance(self.standing).distance(leg.posture(wholes[0][0])) < 0.0:
            return "it does not stand at the start: its centre of mass is beside the sole"
        if (np.abs(weight) > chain.effort_limit).any():
            return "it cannot stand at the start within its torque limits"
        return ""


def solve_with_backswing(
    problem: KickProblem, objective: Objective
) -> tuple[KickSolution, Backswing]:
    """Return a solution of a standing robot's problem that has a backswing, and the backswing.

    It is sought near the solutions without one.

    Raises:
        InvalidInput: none is found.
    """
    standing, variables = problem.standing, problem.variables
    assert standing is not None
    variants, known = list(problem.variants()), list[KickPoint]()
    while variants and not (known := variants[0].solve(objective, variants[0].starts())):
        variants.pop(0)
    reason = "no posture reaches the launch within its limits, with or without a backswing"
    if known:
        reason = (
            "its kicking foot would come from under the ground; a flatter launch, or a contact "
            "point (offset) where the foot is heavier, takes a foot that rises less"
        )
    stricter = {Clearance: Clearance(standing, LIFT), JointRange: JointRange(variables, RESERVE)}
    for variant in variants:
        terms = tuple(stricter.get(type(term), term) for term in variant.terms)
        lifted = replace(variant, terms=terms)
        points = lifted.solve(objective, [point.x for point in known])
        for point in sorted(points, key=objective.cost)[:TRIED]:
            q, v = point.posture.q[variables.qs], point.v[variables.vs]
            backswing, reason = find_backswing(standing, q, v)
            if backswing is not None:
                over = (f"torque of {name} in the backswing" for name in backswing.too_strong)
                return KickSolution(lifted, point, tuple(over)), backswing
        if points:
            reason = f"{reason} (another goal, offset or objective takes another posture)"
    raise InvalidInput(f"{standing.robot.name} finds no backswing to this kick: {reason}")


def find_backswing(standing: StandingRobot, q: Array, v: Array) -> tuple[Backswing | None, str]:
    """Return the backswing to a posture and velocity at the impact; else None and the reason.

    Args:
        standing: the robot.
        q: of the joints between the feet, in the order of the kicking chain, shape `(n,)` [rad].
        v: likewise [rad/s].
    """
    problem = _BackswingProblem(standing, q, v)
    reason, x = "", problem.guess()
    for weights in WEIGHTS:
        x = problem.solve(x, weights)
        backswing = Backswing(problem.phase(x), standing)
        reason = backswing.fault()
        if not reason:
            return backswing, ""
    return None, reason


class _Dynamics:
    """A chain on a floating base at its root, whose equations give the ground's wrench too.

    Attributes:
        model, data: of Pinocchio; the torque on the base is the wrench of the ground on the root,
            linear, then angular about the world's origin.
        weight: of the robot [N].
    """

    def __init__(self, chain: KickingChain) -> None:
        fixed, self.model = chain.model, pin.Model()
        model = self.model
        model.gravity = fixed.gravity.copy()
        model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        model.appendBodyToJoint(1, fixed.inertias[0], pin.SE3.Identity())
        for joint in range(1, fixed.njoints):
            above, place = int(fixed.parents[joint]) + 1, fixed.jointPlacements[joint]
            model.addJoint(above, fixed.joints[joint], place, fixed.names[joint])
            model.appendBodyToJoint(joint + 1, fixed.inertias[joint], pin.SE3.Identity())
        model.armature = np.concatenate([np.zeros(6), fixed.armature])
        self.data = model.createData()
        mass = sum(float(body.mass) for body in model.inertias)
        self.weight = mass * float(np.linalg.norm(model.gravity.linear))

    def floating(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return q, v and a with a base at rest at the world's origin."""
        still = np.zeros(6)
        return np.concatenate([still, [1.0], q]), np.append(still, v), np.append(still, a)

    def torques(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        """Return wrench and torques, shape `(6 + n,)`, and their derivatives by q, v and a."""
        model, data = self.model, self.data
        by_q, by_v, by_a = pin.computeRNEADerivatives(model, data, *self.floating(q, v, a))
        mass = np.triu(by_a) + np.triu(by_a, 1).T  # only one half of it is computed
        return data.tau.copy(), by_q[:, 6:].copy(), by_v[:, 6:].copy(), mass[:, 6:]


Weights = tuple[float, float, float]
"""Of kinematic conditions, torques and the ground's wrench, as `WEIGHTS`."""


class _Terms(NamedTuple):
    """Residuals at one time and their derivatives by q, v and a there, of shape `(m, n)`."""

    values: Array
    by_q: Array
    by_v: Array
    by_a: Array


class _BackswingProblem:
    """The least squares of a backswing. Its unknowns are free coordinates of the accelerations.

    With the time :math:`s` from the impact over the duration :math:`T`, the motion is linear in
    the unknowns :math:`y` and in :math:`T`: :math:`q = q_0 - T v_0 c(s) + B(s) y`.
    """

    def __init__(self, standing: StandingRobot, q: Array, v: Array) -> None:
        self._standing = standing
        self._balance, self._upright = Balance(standing), Upright(standing)
        self._chain, self._limb = (chain := kicking_chain(standing.leg)), _kicking_limb(standing)
        self._q, self._away, self._n = q, -v, len(chain.names)
        self._dynamics, self._data = _Dynamics(chain), chain.model.createData()
        self._none = np.zeros((self._n, self._n))
        self._nodes = np.linspace(0.0, 1.0, NODES + 1) ** 2
        count = np.arange(NODES + 1)
        self._times = np.interp(np.arange(4 * NODES + 1) / 4, count, self._nodes)
        of_nodes = integrate_accelerations(np.eye(NODES + 1), self._nodes)  # a, v and q by T^k
        stopping = of_nodes[1](1.0)
        self._free = null_space(stopping[None])
        self._given = -stopping / (stopping @ stopping)
        values = [motion(self._times) for motion in reversed(of_nodes)]
        starts = (self._times, np.ones_like(self._times), np.zeros_like(self._times))
        self._constant = [
            start + value @ self._given for start, value in zip(starts, values, strict=True)
        ]
        self._basis = [value @ self._free for value in values]
        middle, half = (chain.upper + chain.lower) / 2, (chain.upper - chain.lower) / 2
        self._range = middle, half * (1.0 - 2 * SHARE)

    def guess(self) -> Array:
        return np.append(np.zeros(self._free.shape[1] * self._n), GUESS)

    def phase(self, x: Array) -> SwingPhase:
        y, time = x[:-1].reshape(-1, self._n), float(x[-1])
        pulls = (self._free @ y + time * np.outer(self._given, self._away)) / time**2
        rest = self._motion(x)[0][-1]
        return make_phase(self._chain, -1, self._q, self._away, pulls, time * self._nodes, rest)

    def solve(self, x: Array, weights: Weights) -> Array:
        residuals = keep_last(lambda x: self._residuals(x, weights))
        ends = np.full((2, len(x)), np.inf) * [[-1.0], [1.0]]
        ends[:, -1] = SHORTEST, LONGEST
        solution = least_squares(
            lambda x: residuals(x)[0], x, lambda x: residuals(x)[1], ends,
            ftol=1e-4, xtol=1e-5, max_nfev=40,
        )  # fmt: skip
        return np.asarray(solution.x)

    def _motion(self, x: Array) -> list[Array]:
        """Return q, v away from the impact and a at the times, shape `(m, n)` each."""
        y, time = x[:-1].reshape(-1, self._n), x[-1]
        derivatives = [
            (time * np.outer(constant, self._away) + basis @ y) / time**order
            for order, (constant, basis) in enumerate(zip(self._constant, self._basis, strict=True))
        ]
        return [self._q + derivatives[0], *derivatives[1:]]

    def _residuals(self, x: Array, weights: Weights) -> tuple[Array, Array]:
        n, y, time = self._n, x[:-1].reshape(-1, self._n), x[-1]
        q, v, a = self._motion(x)
        still = np.zeros(n)
        terms = [
            self._moving(*state, weights, before=number > 0)
            if number % 2 == 0
            else self._above(state[0], weights[0] / HEIGHT)
            for number, state in enumerate(zip(q, v, a, strict=True))
        ]
        places = np.repeat(np.arange(len(terms)), [len(term.values) for term in terms])
        terms.append(rest := self._resting(q[-1], still, weights[0]))
        places = np.append(places, np.full(len(rest.values), len(q) - 1))
        values = np.concatenate([term.values for term in terms])
        slopes = np.zeros((len(values), len(y), n))
        by_time = np.zeros(len(values))
        for order in range(3):
            by = np.concatenate([term[1 + order] for term in terms])
            gain = self._basis[order][places] / time**order
            slopes += gain[:, :, None] * by[:, None, :]
            shape = self._basis[order] @ y
            moved = (1 - order) * np.outer(self._constant[order], self._away) / time**order
            moved -= order * shape / time ** (order + 1)
            by_time += np.einsum("kn,kn->k", by, moved[places])
        return values, np.column_stack([slopes.reshape(len(values), -1), by_time])

    def _moving(self, q: Array, v: Array, a: Array, weights: Weights, *, before: bool) -> _Terms:
        """Return what counts at a time; kinematic terms only where they can still change."""
        chain, none, (kinematic, of_torque, of_wrench) = self._chain, self._none, weights
        forces, *slopes = self._dynamics.torques(q, v, a)
        use, by_torque = forces[6:] / chain.effort_limit, 1.0 / chain.effort_limit[:, None]
        of_use = [by_torque * slope[6:] for slope in slopes]
        over = [-np.sign(use)[:, None] * slope for slope in of_use]
        terms = [
            _Terms(EASE * use, *(EASE * slope for slope in of_use)),
            _hinged(of_torque, 1.0 - 2 * SHARE - np.abs(use), *over),
            self._wrench(forces[:6], [slope[:6] for slope in slopes], of_wrench),
        ]
        if before:
            middle, half = self._range
            off, fast = q - middle, v / chain.velocity_limit
            by_q, by_v = -np.diag(np.sign(off)), -np.diag(np.sign(v) / chain.velocity_limit)
            terms += [
                _hinged(kinematic / RANGE, half - np.abs(off), by_q, none, none),
                _hinged(kinematic / RANGE, 1.0 - SHARE - np.abs(fast), none, by_v, none),
                self._above(q, kinematic / HEIGHT),
                self._placed(q, kinematic, self._upright, LEAN_MARGIN + SHARE),
            ]
        return _joined(terms)

    def _resting(self, q: Array, still: Array, kinematic: float) -> _Terms:
        """Return what counts of the posture at rest: balance, and the torques that hold it."""
        forces, by_q, *_ = self._dynamics.torques(q, still, still)
        limit, none = self._chain.effort_limit, self._none
        use = forces[6:] / limit
        slope = -np.sign(use)[:, None] * by_q[6:] / limit[:, None]
        held = _hinged(kinematic / RANGE, 1.0 - SHARE - np.abs(use), slope, none, none)
        return _joined([self._placed(q, kinematic, self._balance, MARGIN / LENGTH), held])

    def _above(self, q: Array, weight: float) -> _Terms:
        """Return the heights of the lowest points of the kicking limb's bodies that count."""
        model, data, values, rows = self._chain.model, self._data, [], []
        pin.computeJointJacobians(model, data, q)
        for name, body in self._limb:
            joint = model.getJointId(name)
            pose = data.oMi[joint]
            heights = body.centres @ pose.rotation[2] - body.radii
            lowest = int(np.argmin(heights))
            arm = pose.rotation @ body.centres[lowest]
            jacobian = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            values.append(float(heights[lowest] + pose.translation[2]) - GAP)
            rows.append(height_slopes(jacobian, arm[None])[0])
        none = self._none[: len(rows)]
        return _hinged(weight, np.array(values), np.array(rows), none, none)

    def _placed(self, q: Array, weight: float, term: StanceTerm, gap: float) -> _Terms:
        """Return the values of a term, over its scale, that are less than a gap."""
        leg, chain = self._standing.leg, self._chain
        configuration, still = chain.whole(leg, q, np.zeros(self._n))
        posture = leg.posture(configuration)
        values = term.residual(posture, still) / term.scale
        slopes = term.derivatives(posture, still)[0][:, chain.vs] / term.scale
        none, scale = np.zeros_like(slopes), weight * LENGTH / HEIGHT
        return _hinged(scale, values - gap, slopes, none, none)

    def _wrench(self, wrench: Array, slopes: list[Array], weight: float) -> _Terms:
        """Return how far the ground's wrench is outside what it can supply."""
        sole, friction = self._balance, self._standing.support.friction
        rows = np.zeros((len(sole.normals) + 1, 6))
        rows[0, 2] = 1.0
        rows[1:, 2] = sole.offsets / LENGTH
        rows[1:, 4], rows[1:, 3] = sole.normals.T[0] / LENGTH, -sole.normals.T[1] / LENGTH
        if friction is not None:
            size = float(np.hypot(wrench[0], wrench[1])) or 1.0
            cone = [-wrench[0] / size, -wrench[1] / size, friction, 0.0, 0.0, 0.0]
            rows = np.vstack([rows, cone])
        rows /= self._dynamics.weight
        return _hinged(weight, rows @ wrench, *(rows @ slope for slope in slopes))


def _hinged(weight: float, values: Array, by_q: Array, by_v: Array, by_a: Array) -> _Terms:
    """Return weighted residuals that are 0 where their values are 0 or more."""
    off = weight * (values < 0.0)
    return _Terms(off * values, *(off[:, None] * slope for slope in (by_q, by_v, by_a)))


def _joined(terms: list[_Terms]) -> _Terms:
    return _Terms(*(np.concatenate(rows) for rows in zip(*terms, strict=True)))


def _kicking_limb(standing: StandingRobot) -> list[tuple[str, Spheres]]:
    """Return the bodies of the joints that move the kicking foot but not the supporting one."""
    robot, model = standing.robot, standing.robot.workspace.model
    limb = kicking_limb(robot, standing.support)
    return [(str(model.names[joint]), joint_spheres(robot, joint)) for joint in limb]


def _height(pose: Any, body: Spheres) -> float:
    return float((body.centres @ pose.rotation[2] - body.radii).min() + pose.translation[2])
