"""What a solution keeps on a grid finer than its points, and the motion that it is."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.motion.limits import (
    Limit,
    RestingTorqueLimit,
    when,
)
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_problem import MotionProblem
from kickdyn.motion.motion_program import MotionSolution, integration_weights
from kickdyn.motion.separation import ALLOWED, Conditions, Surroundings
from kickdyn.motion.weight_shift import Feet, WeightShift, least_by_name

POINTS, FINER = (2, 4), 10
"""Points of the solver in each interval far from the impact and near it, and how much finer limits
are checked."""

REACHED = 2e-3
"""Margin beyond its reserve at which a limit counts as reached."""

UNSOLVED = 1.0
"""Violation that a solution counts with whose equations do not hold."""

LOADED, NAMED = 0.5, 6
"""Torque over its limit from which on a joint at rest counts among those that are overloaded, and
number of limits in the sentence on those that reduce the share of a motion."""


@dataclass(frozen=True, eq=False)
class Margins:
    """Distances from limits, by CasADi's function of q, v and a of joints, all rows stacked."""

    function: Any
    limits: Sequence[Limit]
    joints: Sequence[str]

    def rows(self, q: Array, v: Array, a: Array) -> Array:
        """Return the distances at several moments, shape `(moments, k)`."""
        return np.asarray(self.function.map(len(q))(q.T, v.T, a.T)).T

    def margins(self, q: Array, v: Array, a: Array) -> dict[str, float]:
        """Return the least distance of each label."""
        names = (name for limit in self.limits for name in limit.names)
        return least_by_name(names, self.rows(q[None], v[None], a[None])[0].tolist())


SHIFTS = 0.6, 0.8, 1.0, 1.4, 2.0, 3.0
"""Durations of the shift of the weight that are tried [s]."""


def shift_weight(problem: MotionProblem, feet: Feet, last: Array) -> WeightShift | None:
    """Return the shortest shift of the weight that keeps all limits, or else the longest one.

    It ends in the posture `last`; None if no posture has the weight between both feet.
    """
    limits, still = problem.limits_of_shift(), np.zeros(problem.n)
    force, moment = np.split(np.asarray(limits[0][0](last, still, still)[1]).ravel(), 2)
    centre = np.array([-moment[1], moment[0]]) / force[2]
    anchors = np.array([centre, feet.other.sole.mean(axis=0)])
    initial = problem.stand_on_both(last, anchors.mean(axis=0))
    if initial is None:
        return None
    for duration in SHIFTS:
        shift = WeightShift(feet, initial, last, anchors, duration, limits)
        if not shift.warnings():
            break
    return shift


class Nearness:
    """The `gaps` of bodies, and of the ball before the impact, at each time of a solution."""

    def __init__(
        self,
        problem: MotionProblem,
        solution: MotionSolution,
        times: list[Array],
        surroundings: Surroundings | None = None,
    ) -> None:
        self._surroundings = near = surroundings or problem.surroundings
        self._times = np.concatenate(times)
        self._q = problem.splines.values(times, 0) @ solution.coefficients
        ball = problem.ball_centre(problem.splines.at_impact()[0] @ solution.coefficients)
        swing = len(times[0])
        self.gaps = [near.gaps(q, ball if k < swing else None) for k, q in enumerate(self._q)]

    def conditions(self, points: list[Array]) -> list[Conditions]:
        """Return conditions at some of the times, and at those at which bodies are nearest."""
        chosen = np.isin(self._times.round(12), np.concatenate(points).round(12))
        return self._surroundings.conditions(self.gaps, self._times, self._q, chosen)


class Verdict:
    """What a solution keeps on a grid finer than its points.

    Attributes:
        broken: largest violation of a limit, in its unit; 0 where there is none.
        torque_squared: integral of the mean of the squared torques over their limits [s].
        deepest: largest depth of bodies inside each other or the ball [m].
    """

    def __init__(self, problem: MotionProblem, solution: MotionSolution) -> None:
        self.problem, self.solution = problem, solution
        splines = problem.splines
        self.times = splines.times(*(FINER * count for count in POINTS))
        states = problem.states(self.times, solution.coefficients, solution.share)
        self.margins = Margins(problem.margins, problem.limits, problem.task.whole.joint_names)
        self.rows = self.margins.rows(*states)
        forces = problem.all_forces(states)[: problem.n]
        weights = np.concatenate([integration_weights(times) for times in self.times])
        self.torque_squared = float((forces**2).mean(axis=0) @ weights)
        posture = splines.at_impact()[0] @ solution.coefficients
        self.impulse = np.asarray(problem.impulse_margins(posture, problem.jump(posture))).ravel()
        self.nearness = Nearness(problem, solution, self.times)
        depths = (gap.place.depth for gaps in self.nearness.gaps for gap in gaps)
        self.deepest = max(depths, default=0.0)
        least = np.concatenate([[0.0], self.rows.min(axis=0), self.impulse + 1e-6])
        unsolved = 0.0 if solution.feasible else UNSOLVED
        self.broken = max(-float(least.min()), self.deepest - ALLOWED, unsolved)

    def add_points(self, points: list[Array]) -> list[Array]:
        """Return times with those added at which a row is nearest to its limit."""
        needed = np.concatenate([
            np.full(len(limit.labels), 1.5 * limit.reserve) for limit in self.problem.limits
        ])  # fmt: skip
        needed[[limit.by_splines for limit in self.problem.limits for _ in limit.labels]] = -np.inf
        shortfall = np.max(needed - self.rows, axis=1)
        pair = np.split(shortfall, [len(self.times[0])])
        added = []
        for times, present, lack in zip(self.times, points, pair, strict=True):
            padded = np.pad(lack, 1, constant_values=-np.inf)
            peak = (lack > 0.0) & (lack >= padded[:-2]) & (lack >= padded[2:])
            added.append(np.unique(np.concatenate([present, times[peak]])))
        return added

    @cached_property
    def motion(self) -> Motion:
        """The motion, with a line of warning for each limit that it does not keep."""
        problem, solution, task = self.problem, self.solution, self.problem.task
        times, lines = np.concatenate(self.times), list[str]()
        for row, (limit, label) in enumerate(self._labels(problem.limits)):
            worst = int(np.argmin(self.rows[:, row]))
            if self.rows[worst, row] < 0.0:
                breach = limit.breach(label, float(self.rows[worst, row]))
                lines.append(f"{breach}, {when(times[worst])}")
        labels = self._labels(problem.impulse_limits)
        for margin, (_, label) in zip(self.impulse.tolist(), labels, strict=True):
            if margin < -1e-6:
                lines.append(f"{label} is beyond its limit by {-margin:.2g}")
        if not solution.feasible:
            lines.append("the solver finds no motion that keeps the equations of the impact")
        shift = None if problem.feet is None else shift_weight(problem, problem.feet, solution.rest)
        if shift is not None:
            lines += shift.warnings()
        if solution.share < 1.0 and solution.multipliers is not None:
            lines.insert(0, self._share_line())
        before, after = problem.splines.motion(solution.coefficients)
        return Motion(
            task.robot,
            task.leg.joint_names,
            before,
            after,
            placement=None if task.standing is None else task.standing.placement,
            limits=self.margins,
            warnings=tuple(dict.fromkeys(lines)),
            solution=solution if solution.share == 1.0 else None,
            aside=task.aside,
            shift=shift,
            pushed=problem.pushed(solution.coefficients, solution.share),
        )

    @property
    def binding(self) -> tuple[str, ...]:
        """Names of the limits that are reached."""
        pairs = zip(self._labels(self.problem.limits), self.rows.min(axis=0), strict=True)
        reached = [label for (limit, label), least in pairs if least < limit.reserve + REACHED]
        return tuple(dict.fromkeys(reached))

    @property
    def keeps_limits(self) -> bool:
        """Whether the whole launch is reached and all limits are kept, but for those of a shift."""
        return self.solution.share == 1.0 and self.broken == 0.0

    @cached_property
    def is_met(self) -> bool:
        """The same with the limits of the shift of the weight."""
        return self.keeps_limits and (self.motion.shift is None or not self.motion.shift.warnings())

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """What makes a motion better: limits kept, then the share of the launch."""
        return self.is_met, self.broken == 0.0, self.solution.share - self.broken

    def overloaded(self) -> list[str]:
        """Return the joints at rest that take more than their torque limits, or none.

        Those that take more than `LOADED` of it are among them: they are the next ones.
        """
        joints = self.problem.task.resting
        least = self.rows[:, self._columns(RestingTorqueLimit)].min(axis=0, initial=np.inf)
        return [name for name, margin in zip(joints, least, strict=True)
                if min(least) < 0.0 and margin < 1.0 - LOADED]  # fmt: skip

    def _columns(self, kind: type[Limit]) -> NDArray[np.bool_]:
        """Return which rows are of a kind of limit."""
        return np.array([isinstance(limit, kind) for limit, _ in self._labels(self.problem.limits)])

    def use(self, kind: type[Limit]) -> float:
        """Return the largest torque or speed over its limit."""
        return 1.0 - float(self.rows[:, self._columns(kind)].min())

    def _share_line(self) -> str:
        """Return a sentence on the share and on the limits that reduce it most."""
        effects, times = self.problem.effects(self.solution), np.concatenate(self.times)
        columns = {label: row for row, (_, label) in enumerate(self._labels(self.problem.limits))}
        names = []
        for label in sorted(effects, key=effects.__getitem__, reverse=True)[:NAMED]:
            t = times[np.argmin(self.rows[:, columns[label]])] if label in columns else 0.0
            names.append(f"{label}{f' ({when(t)})' if label in columns else ''}")
        share = f"the motion reaches {100 * self.solution.share:.0f} % of the launch"
        return f"{share}; limits that hold it back most: {', '.join(names)}" if names else share

    def _labels(self, limits: Sequence[Limit]) -> list[tuple[Limit, str]]:
        return [(limit, label) for limit in limits for label in limit.labels]


def best_of(verdicts: Sequence["Verdict"]) -> "Verdict":
    """Return the verdict on the solution that keeps all limits with the largest share, if any."""
    valid = [verdict for verdict in verdicts if verdict.broken == 0.0]
    return max(valid or verdicts, key=lambda verdict: verdict.solution.share - verdict.broken)
