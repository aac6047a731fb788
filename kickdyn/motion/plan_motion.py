"""Planning the motion of a kick: starts, points added where limits are broken, a verdict."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.limits import (
    FRICTION,
    Apart,
    Clearance,
    Friction,
    Impulse,
    Limit,
    Pressure,
    PressureCentre,
    RangeLimit,
    SpeedLimit,
    Tilt,
    TorqueLimit,
    Twist,
)
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_problem import KickTask, MotionProblem, Solution
from kickdyn.motion.splines import MotionSplines, integration_weights
from kickdyn.robot.ground_clearance import Spheres, extreme_spheres
from kickdyn.robot.kicking_chain import kicking_chain, rest_configuration
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import StandingRobot, joint_spheres

DURATIONS = {False: (0.5, 0.5), True: (0.8, 0.8)}
"""Durations before and after the impact, by whether the robot stands on a foot [s]."""

INTERVALS = {False: (8, 7), True: (14, 12)}
"""Intervals of the splines before and after the impact, likewise."""

POINTS, FINER = (2, 4), 10
"""Points of the solver in each interval far from the impact and near it, and how much finer limits
are checked."""

UNDER, BESIDE = (14, 0.4), (6, 0.6)
"""Numbers of spheres that span the kicking foot downwards and towards the other foot, each of which
has rows at every point, and the cosine of the largest angle to that direction."""

STARTS, SPREAD = 2, 0.2
"""Postures to start from, and the standard deviation of the angles of all but the first [rad]."""

CENTRAL = 0.15
"""Share of a joint's range that the first posture leaves at either end, where it can."""

HELD_TIMES = 200
"""Number of times at which the torques of joints that stay at rest are checked."""

REACHED = 2e-3
"""Margin beyond its reserve at which a limit counts as reached."""

FIRST_SHARE = 0.3
"""Share of the launch at the start."""

ROUNDS = 3
"""Solutions with points added where limits are broken, at most."""

FULL, LEAST_SHARE = 0.99, 0.05
"""Share of the launch from which on the whole launch is sought, and share below which there is no
kick."""

FIRST = {"mu_init": 1e-3, "max_iter": 150, "constr_viol_tol": 1e-7}
"""Options of Ipopt for the first solution of a start."""

NEARBY = {**FIRST, "mu_init": 1e-4, "bound_push": 1e-4, "bound_frac": 1e-4}
"""Options of Ipopt for the first solution near a motion."""

AGAIN = {
    "mu_init": 1e-4,
    "max_iter": 60,
    "constr_viol_tol": 1e-10,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-7,
    "warm_start_bound_frac": 1e-7,
    "warm_start_slack_bound_push": 1e-7,
    "warm_start_slack_bound_frac": 1e-7,
    "warm_start_mult_bound_push": 1e-7,
}
"""Options of Ipopt for the solutions that start from another one."""


@dataclass(frozen=True, eq=False)
class Margins:
    """Distances from limits, see `Motion.margins`.

    Attributes:
        function: CasADi's, of q, v and a, all rows stacked.
        limits: of the rows.
    """

    function: Any
    limits: Sequence[Limit]

    def rows(self, q: Array, v: Array, a: Array) -> Array:
        """Return the distances at several moments, shape `(moments, k)`."""
        return np.asarray(self.function.map(len(q))(q.T, v.T, a.T)).T

    def margins(self, q: Array, v: Array, a: Array) -> dict[str, float]:
        """Return the least distance of each label."""
        labels = [
            f"{label} [{limit.unit}]" if limit.unit else label
            for limit in self.limits
            for label in limit.labels
        ]
        least: dict[str, float] = {}
        for label, value in zip(labels, self.rows(q[None], v[None], a[None])[0], strict=True):
            least[label] = min(float(value), least.get(label, math.inf))
        return least


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A motion with what it reaches.

    Attributes:
        motion: with a line of warning for each limit that it does not keep.
        share: share of the launch; 1 where all of it is reached.
        torque_squared: integral of the mean of the squared torques over their limits [s].
        torque_use, speed_use: largest torque and speed over their limits.
        binding: names of the limits that are reached.
        keeps_limits: whether it reaches the whole launch and keeps all limits.
    """

    motion: Motion
    share: float
    torque_squared: float
    torque_use: float
    speed_use: float
    binding: tuple[str, ...]
    keeps_limits: bool


def plan_motion(task: KickTask, near: Motion | None = None) -> PlannedMotion:
    """Return the motion of a kick, from rest to rest; the best one where none keeps all limits.

    The joints between the feet of a standing robot are tried first, which takes a fraction of the
    time; all others join in where those do not reach the whole launch.

    Args:
        task: the kick.
        near: motion of the same robot for nearly the same kick, as the only one to start from.

    Raises:
        InvalidInput: a joint without limits, or a robot that cannot stand at rest or touch the ball
            within its limits.
    """
    _check_limits(task.leg)
    if task.standing is None:
        return _plan(task, near, 1.0, STARTS)
    between, share = kicking_chain(task.leg).leg, 1.0
    if between.joint_names == task.leg.joint_names:
        return _plan(task, near, share, STARTS)
    if near is None or near.joints == between.joint_names:
        planned = _plan(replace(task, leg=between), near, share, 0)
        if planned.keeps_limits and not _overloads(planned.motion):
            return planned
        near, share = planned.motion, planned.share
    planned = _plan(task, near, share, 0)
    if planned.keeps_limits:
        return planned
    other = _plan(task, None, 1.0, 1)
    return max(other, planned, key=lambda motion: (motion.keeps_limits, motion.share))


def _plan(task: KickTask, near: Motion | None, share: float, starts: int) -> PlannedMotion:
    """Return the best motion of all joints of a task.

    Args:
        task: the kick.
        near: motion to start from, if any.
        share: of the launch, that it reaches.
        starts: number of starts at most; with 0, there is one, and limits between points are not
            sought where it does not reach the whole launch.
    """
    stands = task.standing is not None
    splines = MotionSplines(*DURATIONS[stands], INTERVALS[stands])
    limits, of_impulse = _limits_of(task)
    problem = MotionProblem(task, splines, limits, of_impulse)
    verdicts = []
    for rest, start, options in islice(_starts(problem, near, share), max(starts, 1)):
        solution = _solve(problem, rest, start, options, partly=starts > 0)
        verdicts.append(_Verdict(problem, solution))
        if verdicts[-1].keeps_limits:
            break
    kept = [verdict for verdict in verdicts if verdict.broken == 0.0]
    best = max(kept or verdicts, key=lambda verdict: verdict.solution.share - verdict.broken)
    return best.planned()


def _overloads(motion: Motion) -> bool:
    """Return whether joints that stay at rest take more than their torque limits."""
    limit = motion.robot.effort_limit
    times = np.linspace(motion.begin, motion.end, HELD_TIMES)
    largest = np.max([np.abs(motion.torque(t)) for t in times], axis=0)
    return bool((largest > np.where(limit > 0.0, limit, np.inf)).any())


def _solve(
    problem: MotionProblem,
    rest: Array,
    start: Solution,
    options: dict[str, Any],
    *,
    partly: bool,
) -> Solution:
    """Return the solution from unknowns to start from, with both ends near a posture at rest.

    `partly` says whether a share of the launch is of use.
    """
    times = start.times
    relaxation = Impulse.relaxation
    solution = problem.solve(
        start, rest, times, relaxation=relaxation, shares=(0.0, 1.0), options=options
    )
    full = solution.share > FULL
    options = AGAIN if full or not problem.impulse_limits else FIRST
    for _ in range(ROUNDS):
        if solution.share < LEAST_SHARE or not (full or partly):
            break
        times = _Verdict(problem, solution).add_points(solution.times)
        shares = (1.0, 1.0) if full else (0.0, 1.0)
        solution = problem.solve(
            solution, rest, times, relaxation=0.0, shares=shares, options=options
        )
        if _Verdict(problem, solution).broken == 0.0:
            break
        options = AGAIN
    return solution


class _Verdict:
    """What a solution keeps on a grid finer than its points.

    Attributes:
        broken: largest violation of a limit, in its unit; 0 where there is none.
        torque_squared: see `PlannedMotion`.
    """

    def __init__(self, problem: MotionProblem, solution: Solution) -> None:
        self.problem, self.solution = problem, solution
        splines = problem.splines
        pair = splines.motion(solution.coefficients)
        self.times = splines.times(*(FINER * count for count in POINTS))
        q, v, a = (
            np.vstack([spline(t, order) for spline, t in zip(pair, self.times, strict=True)])
            for order in range(3)
        )
        self.margins = Margins(problem.margins, problem.limits)
        self.rows = self.margins.rows(q, v, a)
        costs = problem.path.values.map(len(q))(np.hstack([q, v, a]).T, [])[1]
        weights = np.concatenate([integration_weights(times) for times in self.times])
        self.torque_squared = float(weights @ np.asarray(costs).ravel())
        before, after = pair
        jump = after(0.0, 1) - before(0.0, 1)
        self.impulse = np.asarray(
            problem.impulse_margins(before(0.0), jump, solution.share)
        ).ravel()
        least = np.concatenate([[0.0], self.rows.min(axis=0), self.impulse + 1e-6])
        self.broken = max(-float(least.min()), 0.0 if solution.feasible else 1e-3)

    def add_points(self, points: list[Array]) -> list[Array]:
        """Return times with those added at which a row is nearest to its limit."""
        needed = np.concatenate([
            np.full(len(limit.labels), limit.reserve / 2) for limit in self.problem.limits
        ])  # fmt: skip
        needed[[limit.by_splines for limit in self.problem.limits for _ in limit.labels]] = -np.inf
        shortfall = np.max(needed - self.rows, axis=1)
        pair = np.split(shortfall, [len(self.times[0])])
        added = []
        for times, known, lack in zip(self.times, points, pair, strict=True):
            padded = np.pad(lack, 1, constant_values=-np.inf)
            peak = (lack > 0.0) & (lack >= padded[:-2]) & (lack >= padded[2:])
            added.append(np.unique(np.concatenate([known, times[peak]])))
        return added

    def planned(self) -> PlannedMotion:
        """Return the motion with its warnings."""
        problem, solution = self.problem, self.solution
        task = problem.task
        times, labels = np.concatenate(self.times), self._labels(problem.limits)
        lines = []
        for limit, label, row in labels:
            worst = int(np.argmin(self.rows[:, row]))
            if self.rows[worst, row] < 0.0:
                lines.append(limit.describe(label, float(self.rows[worst, row]), times[worst]))
        for _, label, row in self._labels(problem.impulse_limits):
            if self.impulse[row] < -1e-6:
                lines.append(f"{label} is beyond its limit by {-self.impulse[row]:.2g}")
        if not solution.feasible:
            lines.append("the solver finds no motion that keeps the equations of the impact")
        near = self.rows.min(axis=0)
        reached = [label for limit, label, row in labels if near[row] < limit.reserve + REACHED]
        placement = None if task.standing is None else task.standing.placement
        before, after = problem.splines.motion(solution.coefficients)
        motion = Motion(
            task.robot,
            task.leg.joint_names,
            before,
            after,
            placement,
            self.margins,
            tuple(dict.fromkeys(lines)),
        )
        use = 1.0 - self.rows[:, : 2 * problem.n].min(axis=0)  # torques, then speeds
        return PlannedMotion(
            motion,
            solution.share,
            self.torque_squared,
            float(use[: problem.n].max()),
            float(use[problem.n :].max()),
            tuple(dict.fromkeys(reached)),
            self.keeps_limits,
        )

    @property
    def keeps_limits(self) -> bool:
        """Whether the whole launch is reached and all limits are kept."""
        return self.solution.share == 1.0 and self.broken == 0.0

    def _labels(self, limits: Sequence[Limit]) -> list[tuple[Limit, str, int]]:
        every = [(limit, label) for limit in limits for label in limit.labels]
        return [(limit, label, row) for row, (limit, label) in enumerate(every)]


def _starts(
    problem: MotionProblem, near: Motion | None, share: float
) -> Iterator[tuple[Array, Solution, dict[str, Any]]]:
    """Yield postures at rest, unknowns to start from, and options of Ipopt.

    Without a motion to start from, the robot stays in a posture that touches the ball.

    Raises:
        InvalidInput: there are none.
    """
    splines, nothing = problem.splines, (np.zeros(0), np.zeros(0), np.zeros(0))
    times = splines.times(*POINTS)
    if near is not None:
        leg = problem.task.leg
        moved = [leg.joint_names.index(name) for name in near.joints]
        coefficients = np.tile(rest_configuration(leg), (splines.size, 1))
        coefficients[:, moved] = splines.coefficients(near.before, near.after)
        start = Solution(coefficients, share, times, nothing, True, 0)
        yield coefficients[0], start, NEARBY
        return
    draw, robot = np.random.default_rng(0), problem.task.robot
    room = CENTRAL * (problem.upper - problem.lower)
    central = np.clip(0.0, problem.lower + room, problem.upper - room)
    reachable = False
    for number in range(STARTS):
        posture = central + draw.normal(0.0, SPREAD if number else 0.0, problem.n)
        posture = np.clip(posture, problem.lower + 0.2 * room, problem.upper - 0.2 * room)
        rest = problem.stand(posture, at_ball=False)
        hit = None if rest is None else problem.stand(rest, at_ball=True)
        if rest is not None and hit is not None:
            reachable = True
            still = np.tile(hit, (splines.size, 1))
            yield rest, Solution(still, FIRST_SHARE, times, nothing, True, 0), FIRST
    if not reachable:
        does = "stand at rest" if rest is None else "touch the ball at rest"
        raise InvalidInput(
            f"{robot.name} finds no posture in which it can {does} within its limits of torque, "
            "range and balance"
        )


def _limits_of(task: KickTask) -> tuple[list[Limit], list[Impulse]]:
    """Return the limits of a motion and of the ground's impulse."""
    leg, model = task.leg, task.leg.model
    names = leg.joint_names
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    limits: list[Limit] = [
        TorqueLimit(names, model.effortLimit),
        SpeedLimit(names, task.speed_limit),
        RangeLimit(names, lower, upper),
    ]
    standing = task.standing
    if standing is None:
        return limits, []
    friction = FRICTION if standing.support.friction is None else standing.support.friction
    on_ground = [
        Pressure(), Friction(friction), PressureCentre(standing), Twist(standing, friction)
    ]  # fmt: skip
    limits += on_ground
    foot, posture = leg.contact_joint, leg.posture(leg.configuration())
    side = 1.0 if posture.contact_point[1] > standing.sole[:, 1].mean() else -1.0
    edge = float(side * (side * standing.sole[:, 1]).max())
    down, aside = np.array([[0.0, 0.0, -1.0], [0.0, -side, 0.0]]) @ posture.rotation_world_joint
    under = _foot_spheres(standing, down, *UNDER)
    limits.append(Clearance("the kicking foot", foot, under))
    beside = _foot_spheres(standing, aside, *BESIDE)
    limits.append(Apart("the kicking foot", foot, beside, edge, side))
    if carriers := _trunk_carriers(standing, leg):
        pin.forwardKinematics(leg.workspace.model, leg.workspace.data, leg.configuration())
        upright = leg.workspace.data.oMi[carriers[-1]].rotation[2].copy()
        limits.append(Tilt(carriers[-1], upright))
    return limits, [Impulse(limit) for limit in on_ground]


def _trunk_carriers(standing: StandingRobot, leg: Leg) -> list[int]:
    """Return the joints of a leg that carry the trunk, the last one next to it."""
    if not standing.trunk_joint:
        return []
    whole, model = standing.leg.workspace.model, leg.workspace.model
    names = [whole.names[joint] for joint in whole.supports[whole.getJointId(standing.trunk_joint)]]
    return [int(model.getJointId(name)) for name in names[1:] if model.existJointName(name)]


def _foot_spheres(standing: StandingRobot, towards: Array, count: int, cosine: float) -> Spheres:
    """Return spheres that span the kicking foot in a direction, in its joint's axes."""
    body = joint_spheres(standing.robot, standing.robot.contact_joint)
    extremes, beyond = extreme_spheres(body, count, towards, cosine)
    return Spheres(body.centres[extremes], body.radii[extremes] + beyond)


def _check_limits(leg: Leg) -> None:
    """Raise `InvalidInput` for a joint without a limit of torque, or with one of 0."""
    for what, limits, most in (
        ("speed", leg.velocity_limit, math.inf),
        ("torque", leg.effort_limit, 1e6),
    ):
        for name, limit in zip(leg.joint_names, limits.tolist(), strict=True):
            if not 0.0 < limit <= most:
                raise InvalidInput(
                    f"{what} limit of {name} is {limit:g}: a motion needs one, above 0 "
                    "(Leg.with_drives, --drives FILE)"
                )
