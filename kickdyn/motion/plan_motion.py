"""Planning the motion of a kick: starts, points added where limits are broken, a verdict."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.limits import (
    FRICTION,
    INSIDE,
    Apart,
    Clearance,
    Friction,
    Impulse,
    Limit,
    MuscleTorqueLimit,
    Pressure,
    PressureCentre,
    RangeLimit,
    SpeedLimit,
    Tilt,
    TorqueLimit,
    Twist,
    when,
)
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_problem import KickTask, MotionProblem, Solution
from kickdyn.motion.separation import ALLOWED, Conditions, Surroundings, with_former
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

ASIDE, ASIDE_TIMES, ASIDE_DRAWN = 0.02, 40, 400
"""Distance of limbs that stay aside of a motion from other bodies [m], and numbers of times at
which it is checked and of postures of a limb that are drawn."""

FAR = 0.02
"""Violation of a limit from which on a solution is only a start for another one."""

ROUNDS, ITERATIONS = 4, 350
"""Solutions with points added where limits are broken, and iterations of all solutions from which
on no other one is begun."""

NAMED = 3
"""Number of limits in the sentence on what holds a motion back."""

FULL, NEARLY, HOPE, LEAST_SHARE = 0.98, 0.9, 0.6, 0.05
"""Shares of the launch: from which on the whole launch is sought; from which on the motion of the
legs is one to start from; below which legs alone are given up; and below which there is no kick."""

TIGHTER = {"mu_init": 1e-3, "max_iter": 150, "constr_viol_tol": 1e-7}
"""Options of Ipopt for a solution that others follow near it."""

FIRST = {**TIGHTER, "tol": 1e-2, "compl_inf_tol": 2e-3}
"""Options of Ipopt for the first solution of a start: another one follows in any case."""

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
    time; all others join in where those do not reach the whole launch. Limbs in the way of that
    motion are put aside at the start.

    Args:
        task: the kick.
        near: motion of the same robot for nearly the same kick, as the only one to start from.

    Raises:
        InvalidInput: a joint without limits, or a robot that cannot stand at rest or touch the ball
            within its limits.
    """
    _check_limits(task.leg)
    legs = task.leg if task.standing is None else kicking_chain(task.leg).leg
    if legs.joint_names == task.leg.joint_names:
        return _plan(task, _Near(near), STARTS)
    if near is not None and near.joints != legs.joint_names:
        return _plan(task, _Near(near), 0)
    planned = first = _plan(replace(task, leg=legs), _Near(near), 0)
    if first.keeps_limits and not _overloads(first.motion):
        return first
    if near is not None and not first.keeps_limits:
        return first
    if first.share > NEARLY:
        aside = _limbs_aside(task, first.motion, _idle_limbs(task.leg, legs))
        planned = _plan(task, _Near(first.motion, aside, first.share), 0)
        if planned.keeps_limits:
            return planned
    other = _plan(task, _Near(None), 1)
    return max(other, planned, key=lambda motion: (motion.keeps_limits, motion.share))


def _overloads(motion: Motion) -> bool:
    """Return whether joints that stay at rest take more than their torque limits."""
    limit = motion.robot.effort_limit
    times = np.linspace(motion.begin, motion.end, HELD_TIMES)
    largest = np.max([np.abs(motion.torque(t)) for t in times], axis=0)
    return bool((largest > np.where(limit > 0.0, limit, np.inf)).any())


def _idle_limbs(robot: Leg, legs: Leg) -> list[list[int]]:
    """Return the limbs that legs do not move, as the joints of each, which carry nothing else."""
    model, limbs = robot.model, []
    parents = [int(parent) for parent in model.parents]
    for tip in set(range(1, model.njoints)) - {*parents}:
        limb = [tip]
        while (joint := parents[limb[-1]]) and parents.count(joint) == 1:
            limb.append(joint)
        if not {str(model.names[joint]) for joint in limb} & {*legs.joint_names}:
            limbs.append(limb)
    return limbs


def _frames_of(leg: Leg, joints: Sequence[int]) -> list[str]:
    """Return the frames that joints carry."""
    return [str(frame.name) for frame in leg.model.frames if int(frame.parentJoint) in joints]


def _limbs_aside(
    task: KickTask, motion: Motion, limbs: Sequence[Sequence[int]]
) -> dict[str, float]:
    """Return angles of the joints of limbs that are in the way of a motion of the legs, by name.

    Of angles that are drawn, they are those nearest to rest that keep all bodies of a limb by
    `ASIDE` from the other ones; where none do, the limb stays at rest.
    """
    leg, rest, draw = task.leg, rest_configuration(task.leg), np.random.default_rng(0)
    moved = [leg.joint_names.index(name) for name in motion.joints]
    times = np.linspace(motion.begin, motion.end, ASIDE_TIMES)
    postures = np.tile(rest, (len(times), 1))
    postures[:, moved] = [motion.joint_state(t)[0] for t in times]
    lower, upper = leg.model.lowerPositionLimit, leg.model.upperPositionLimit
    every = Surroundings(task.robot, leg, task.target.ball.radius)
    at_rest = {gap.frames for gap in every.gaps(rest, None, ASIDE)}
    aside: dict[str, float] = {}
    for limb in limbs:
        columns = [leg.joint_names.index(str(leg.model.names[joint])) for joint in limb]
        near, order = every.only(_frames_of(leg, limb)), list(range(len(times)))
        room = 0.05 * (upper - lower)[columns]
        drawn = draw.uniform(
            (lower[columns] + room), (upper[columns] - room), (ASIDE_DRAWN, len(columns))
        )
        far = np.linalg.norm(drawn - rest[columns], axis=1)
        for angles in [rest[columns], *drawn[np.argsort(far)]]:
            postures[:, columns] = angles
            hit = next((row for row in order if _touches(near, postures[row], at_rest)), None)
            if hit is None:
                break
            order.remove(hit)  # most other angles fail there too
            order.insert(0, hit)
        else:
            postures[:, columns] = angles = rest[columns]
        if (angles != rest[columns]).any():
            aside |= {leg.joint_names[n]: float(x) for n, x in zip(columns, angles, strict=True)}
    return aside


def _touches(near: Surroundings, q: Array, at_rest: Collection[tuple[str, str]]) -> bool:
    """Return whether bodies are nearer than `ASIDE`, or inside each other if they are at rest."""
    gaps = near.gaps(q, None, ASIDE)
    return any(gap.place.depth > 0.0 or gap.frames not in at_rest for gap in gaps)


@dataclass(frozen=True, eq=False)
class _Near:
    """What to start from.

    Attributes:
        motion: None is a posture at rest.
        others: values of joints that have no spline there, other than at rest.
        share: of the launch, that it reaches.
    """

    motion: Motion | None
    others: Mapping[str, float] = field(default_factory=dict)
    share: float = 1.0


def _plan(task: KickTask, near: _Near, starts: int) -> PlannedMotion:
    """Return the best motion of all joints of a task.

    Args:
        task: the kick.
        near: what to start from.
        starts: number of starts at most; with 0, there is one, and limits between points are not
            sought where it does not reach the whole launch.
    """
    stands = task.standing is not None
    splines = MotionSplines(*DURATIONS[stands], INTERVALS[stands])
    limits, of_impulse = _limits_of(task)
    problem = MotionProblem(task, splines, limits, of_impulse)
    verdicts = []
    for rest, start in islice(_starts(problem, near), max(starts, 2 if near.motion else 1)):
        if start.multipliers is not None:
            verdicts.append(_solve_again(problem, start))
            if verdicts[-1].keeps_limits:
                break
            continue
        verdicts.append(_solve(problem, rest, start, near.motion is not None, starts > 0))
        if verdicts[-1].keeps_limits or problem.iterations > ITERATIONS:
            break
    return _best(verdicts).planned()


def _best(verdicts: Sequence["_Verdict"]) -> "_Verdict":
    """Return the verdict on the solution that keeps all limits with the largest share, if any."""
    kept = [verdict for verdict in verdicts if verdict.broken == 0.0]
    return max(kept or verdicts, key=lambda verdict: verdict.solution.share - verdict.broken)


def _solve_again(problem: MotionProblem, start: Solution) -> "_Verdict":
    """Return the verdict on the solution next to the one of nearly the same kick."""
    assert start.multipliers is not None
    apart = [conditions for conditions, _ in start.multipliers.apart]
    solution = problem.solve(
        start,
        start.rest,
        start.times,
        relaxation=0.0,
        shares=(1.0, 1.0),
        options=AGAIN,
        apart=apart,
    )
    return _Verdict(problem, solution)


def _solve(
    problem: MotionProblem, rest: Array, start: Solution, moves: bool, partly: bool
) -> "_Verdict":
    """Return the verdict on the solution from unknowns to start from.

    Both ends are near a posture at rest; `moves` says whether the start is a motion, and `partly`
    whether a share of the launch is of use.
    """
    apart = _Nearness(problem, start, start.times).conditions(start.times)
    solution = problem.solve(
        start,
        rest,
        start.times,
        relaxation=Impulse.relaxation,
        shares=(0.0, 1.0),
        options=NEARBY if moves else FIRST,
        apart=apart,
    )
    if (HOPE if not partly else 0.0) < solution.share <= FULL:
        solution = problem.solve(
            replace(solution, multipliers=None),
            rest,
            start.times,
            relaxation=Impulse.relaxation,
            shares=(0.0, 1.0),
            options=TIGHTER,
            apart=apart,
        )
    verdict, full = _Verdict(problem, solution), solution.share > FULL
    verdicts: list[_Verdict] = []  # the first solution keeps its limits at the points only
    for _ in range(ROUNDS):
        if solution.share < LEAST_SHARE or not (full or partly):
            break
        if problem.iterations > ITERATIONS and verdicts:
            break
        far, times = verdict.broken > FAR, verdict.add_points(solution.times)
        apart = with_former(verdict.nearness.conditions(times), apart if solution.feasible else ())
        if far:
            solution = replace(solution, multipliers=None)
        solution = problem.solve(
            solution,
            rest,
            times,
            relaxation=0.0,
            shares=(1.0, 1.0) if full and not far else (0.0, 1.0),
            options=TIGHTER if far else AGAIN,
            apart=apart,
        )
        verdict, full = _Verdict(problem, solution), solution.share > FULL
        verdicts.append(verdict)
        if verdict.broken == 0.0 and (solution.share == 1.0 or not full):
            break
    return _best(verdicts or [verdict])


class _Nearness:
    """Bodies near each other, and near the ball before the impact, at times of a solution.

    Attributes:
        gaps: of them, at each time.
    """

    def __init__(self, problem: MotionProblem, solution: Solution, times: list[Array]) -> None:
        self._problem, self._times = problem, np.concatenate(times)
        self._q = problem.splines.values(times, 0) @ solution.coefficients
        ball = problem.ball_centre(problem.splines.at_impact()[0] @ solution.coefficients)
        swing = len(times[0])
        self.gaps = [
            problem.surroundings.gaps(q, ball if row < swing else None)
            for row, q in enumerate(self._q)
        ]

    def conditions(self, points: list[Array]) -> list[Conditions]:
        """Return conditions at some of the times, and at those at which bodies are nearest."""
        chosen = np.isin(self._times.round(12), np.concatenate(points).round(12))
        return self._problem.surroundings.conditions(self.gaps, self._times, self._q, chosen)


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
        forces = np.asarray(problem.forces.map(len(v))(q.T, v.T, a.T))[: problem.n]
        weights = np.concatenate([integration_weights(times) for times in self.times])
        self.torque_squared = float((forces**2).mean(axis=0) @ weights)
        before, after = pair
        jump = after(0.0, 1) - before(0.0, 1)
        self.impulse = np.asarray(
            problem.impulse_margins(before(0.0), jump, solution.share)
        ).ravel()
        self.nearness = _Nearness(problem, solution, self.times)
        deepest = max((gap.place.depth for gaps in self.nearness.gaps for gap in gaps), default=0.0)
        least = np.concatenate([[0.0], self.rows.min(axis=0), self.impulse + 1e-6])
        self.broken = max(
            -float(least.min()), deepest - ALLOWED, 0.0 if solution.feasible else 1e-3
        )

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
        if solution.share < 1.0 and solution.multipliers is not None:
            lines.insert(0, self._held_back())
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
            solution if solution.share == 1.0 else None,
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

    def _held_back(self) -> str:
        """Return a sentence on the share and on the limits that hold it back most."""
        effects, times = self.problem.effects(self.solution), np.concatenate(self.times)
        columns = {label: row for _, label, row in self._labels(self.problem.limits)}
        names = []
        for label in sorted(effects, key=effects.__getitem__, reverse=True)[:NAMED]:
            t = times[np.argmin(self.rows[:, columns[label]])] if label in columns else 0.0
            names.append(f"{label}{f' ({when(t)})' if label in columns else ''}")
        share = f"the motion reaches {100 * self.solution.share:.0f} % of the launch"
        return f"{share}; limits that hold it back most: {', '.join(names)}" if names else share

    def _labels(self, limits: Sequence[Limit]) -> list[tuple[Limit, str, int]]:
        every = [(limit, label) for limit in limits for label in limit.labels]
        return [(limit, label, row) for row, (limit, label) in enumerate(every)]


def _starts(problem: MotionProblem, near: _Near) -> Iterator[tuple[Array, Solution]]:
    """Yield postures at rest and unknowns to start from.

    Without a motion to start from, the robot stays in a posture that touches the ball.

    Raises:
        InvalidInput: there are none.
    """
    splines, motion = problem.splines, near.motion
    times = splines.times(*POINTS)
    if motion is not None:
        leg = problem.task.leg
        values = {**leg.joint_values(rest_configuration(leg)), **near.others}
        coefficients = np.tile([values[name] for name in leg.joint_names], (splines.size, 1))
        moved = [leg.joint_names.index(name) for name in motion.joints]
        coefficients[:, moved] = splines.coefficients(motion.before, motion.after)
        known = motion.solution
        if known is not None and np.array_equal(known.coefficients, coefficients):
            yield known.rest, known
        yield coefficients[0], Solution(coefficients[0], coefficients, near.share, times)
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
            yield rest, Solution(rest, still, FIRST_SHARE, times)
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
        (
            MuscleTorqueLimit(names, model.effortLimit, task.speed_limit)
            if task.muscles
            else TorqueLimit(names, model.effortLimit)
        ),
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
    limits += [*on_ground[:2], PressureCentre(standing, INSIDE), on_ground[3]]
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
