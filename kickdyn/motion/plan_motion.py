"""Planning the motion of a kick: starts, points added where limits are broken, a verdict."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.kick_task import KickTask, check_limits, check_sole
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_file import file_joints, positions_of
from kickdyn.motion.motion_problem import MotionProblem
from kickdyn.motion.motion_program import MotionSolution, MotionSplines
from kickdyn.motion.motion_record import RecordedMotion
from kickdyn.motion.separation import Conditions, Surroundings, with_former
from kickdyn.motion.verdict import FINER, POINTS, Nearness, Verdict, best_of
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import kicking_chain, rest_configuration

ASIDE, ASIDE_DRAWN = 0.02, 400
"""Distance of limbs that stay aside of a motion from other bodies [m], and number of postures of a
limb that are drawn."""


def idle_limbs(robot: Leg, legs: Leg) -> list[list[int]]:
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


def frames_of(leg: Leg, joints: Sequence[int]) -> list[str]:
    """Return the frames that joints carry."""
    return [str(frame.name) for frame in leg.model.frames if int(frame.parentJoint) in joints]


def limbs_aside(
    task: KickTask, leg: Leg, postures: Array, limbs: list[list[int]]
) -> dict[str, float]:
    """Return angles of the joints of limbs that are in the way of postures `(k, nq)`, by name.

    Of angles that are drawn, they are those nearest to rest that keep all bodies of a limb by
    `ASIDE` from the other ones; where none do, the limb stays at rest. `leg` has the limbs.
    """
    neutral, draw, times = rest_configuration(leg), np.random.default_rng(0), len(postures)
    postures = postures.copy()
    lower, upper = leg.model.lowerPositionLimit, leg.model.upperPositionLimit
    every = Surroundings(task.robot, leg, task.target.ball.radius)
    at_rest = {gap.frames for gap in every.gaps(neutral, None, ASIDE)}
    shifted: dict[str, float] = {}
    for limb in limbs:
        columns = [leg.joint_names.index(str(leg.model.names[joint])) for joint in limb]
        pairs, order = every.only(frames_of(leg, limb)), list(range(times))
        room = 0.05 * (upper - lower)[columns]
        size = ASIDE_DRAWN, len(columns)
        drawn = draw.uniform(lower[columns] + room, upper[columns] - room, size) - neutral[columns]
        drawn *= draw.uniform(0.0, 1.0, (ASIDE_DRAWN, 1))  # many of them near rest
        for change in [0.0 * drawn[0], *drawn[np.argsort(np.linalg.norm(drawn, axis=1))]]:
            angles = neutral[columns] + change
            postures[:, columns] = angles
            hit = next((row for row in order if _touches(pairs, postures[row], at_rest)), None)
            if hit is None:
                break
            order.remove(hit)  # most other angles fail there too
            order.insert(0, hit)
        else:
            postures[:, columns] = angles = neutral[columns]
        if (angles != neutral[columns]).any():
            shifted |= {leg.joint_names[n]: float(x) for n, x in zip(columns, angles, strict=True)}
    return shifted


def _touches(near: Surroundings, q: Array, at_rest: Collection[tuple[str, str]]) -> bool:
    """Return whether bodies are nearer than `ASIDE`, or inside each other if they are at rest."""
    gaps = near.gaps(q, None, ASIDE)
    return any(gap.place.depth > 0.0 or gap.frames not in at_rest for gap in gaps)


DURATIONS = {False: (0.5, 0.5), True: (0.8, 0.8)}
"""Durations before and after the impact, by whether the robot stands on a foot [s]."""

INTERVALS = {False: (8, 7), True: (14, 12)}
"""Intervals of the splines before and after the impact, likewise."""

STARTS, SPREAD = 2, 0.2
"""Postures to start from, and the standard deviation of the angles of all but the first [rad]."""

CENTRAL = 0.15
"""Share of a joint's range that the first posture leaves at either end, where it can."""

ASIDE_TIMES = 40
"""Number of times at which limbs are aside of other bodies."""

FIRST_SHARE = 0.3
"""Share of the launch at the start."""

FAR = 0.02
"""Violation of a limit from which on a solution is only a start for another one."""

ROUNDS = 5
"""Solutions with points added where limits are broken."""

MOST_WORK, LEGS_WORK, LEAST_ITERATIONS = 14000, 4500, 10
"""Iterations of Ipopt times joints that move: of a plan, and of its legs alone, at most. Fewer
iterations than the last number are not begun. An iteration takes about 8 ms for each joint."""

CONTINUED = 200
"""Iterations of Ipopt for a motion next to another one, at most: 8 to 60 are usual."""

ROWS = 300
"""Conditions of bodies that take as long as a joint in an iteration."""

WHOLE, FULL, NEARLY, HOPE, LEAST_SHARE = 0.998, 0.98, 0.9, 0.6, 0.05
"""Shares of the launch: from which on the whole launch is sought, far from a motion that keeps its
limits and near one; from which on the motion of the legs is improved, and one to start from; below
which legs alone are given up, and all joints after two solutions; and below which there is no
kick."""

TIGHTER = {"mu_init": 1e-3, "max_iter": 150, "constr_viol_tol": 1e-7}
"""Options of Ipopt for a solution that others follow near it."""

FIRST = {**TIGHTER, "mu_init": 0.1, "tol": 1e-2, "compl_inf_tol": 2e-3}
"""Options of Ipopt for the first solution of a start: another one follows in any case."""

NEARBY = {**FIRST, "mu_init": 1e-3, "bound_push": 1e-4, "bound_frac": 1e-4}
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


class _Work:
    """Iterations of Ipopt, times the joints that move, that a plan may still take."""

    def __init__(self, most: int) -> None:
        self.left = most

    def iterations(self, joints: int) -> int:
        """Return the remaining iterations of a problem; 0 for fewer than are of use."""
        count = self.left // joints
        return count if count >= LEAST_ITERATIONS else 0


def plan_motion(task: KickTask, near: Motion | RecordedMotion | None = None) -> Verdict:
    """Return the verdict on the best motion of a kick, from rest to rest.

    The joints between the feet of a standing robot are tried first, which takes a fraction of the
    time; limbs in the way of their motion are put aside of it. All joints move where those do not
    reach the whole launch. With a motion `near`, of nearly the same kick, it is the only start.

    Raises:
        InvalidInput: a joint without limits, a sole that is too narrow, or a robot that cannot
            stand at rest or touch the ball within its limits.
    """
    check_limits(task.leg)
    if task.standing is not None:
        check_sole(task.standing)
    work = _Work(MOST_WORK)
    if isinstance(near, RecordedMotion):
        near = fitted_motion(near, task)
    angles = {} if near is None else near.aside
    legs = task
    if task.standing is not None:
        legs = replace(task, leg=kicking_chain(task.leg, others=angles).leg, aside=angles)
    if legs.leg.joint_names == task.leg.joint_names:
        return _plan(task, near, STARTS, work)
    if near is not None and near.joints != legs.leg.joint_names:
        return _plan(task, near, 0, work)
    of_legs = _Work(LEGS_WORK)
    planned = legs_only = _plan(legs, near, 0, of_legs, whole=task.leg)
    work.left -= LEGS_WORK - of_legs.left
    if legs_only.is_met or near is not None:
        return legs_only
    if legs_only.solution.share > NEARLY:
        planned = _plan(task, legs_only.motion, 0, work, share=legs_only.solution.share)
        if planned.is_met:
            return planned
    others = [planned, legs_only]
    if work.iterations(task.leg.nv):
        others.append(_plan(task, None, 1, work))
    return max(others, key=lambda motion: motion.rank)


def fitted_motion(recorded: RecordedMotion, task: KickTask) -> Motion:
    """Return the splines that are nearest to a recorded motion in the sense of least squares.

    The joints between the feet of a standing robot move, or all joints of a leg. Before and after
    the recording, the robot is at rest.
    """
    assert recorded.contact is not None
    names, positions = file_joints(recorded.leg), positions_of(recorded.leg, recorded.q)
    times, leg = recorded.t - recorded.contact, task.leg
    stands = task.standing is not None
    joints = kicking_chain(leg).leg.joint_names if stands else leg.joint_names
    splines = MotionSplines(*DURATIONS[stands], INTERVALS[stands])
    sampled = splines.times(*(FINER * count for count in POINTS))
    values = np.column_stack([
        np.interp(np.concatenate(sampled), times, positions[:, names.index(name)])
        for name in joints
    ])  # fmt: skip
    coefficients = np.linalg.lstsq(splines.values(sampled, 0), values, rcond=None)[0]
    before, after = splines.motion(np.asarray(coefficients))
    return Motion(task.robot, joints, before, after)


def continue_motion(task: KickTask, start: MotionSolution, near: Array | None = None) -> Verdict:
    """Return the verdict on the motion of a kick next to the solution of nearly the same kick.

    Both have the same joints and the same local optimum, so motions in between them are nearly
    optimal too. Limits that are broken between the points of the solver get points there. The
    motion is near some coefficients, see `MotionProblem.solve`.
    """
    problem = motion_problem(task, [name for name in start.limited if name in task.resting])
    search = _Search(problem, start.rest, _Work(CONTINUED * problem.n), partly=False, near=near)
    verdict = search.again(start)
    return verdict if verdict.keeps_limits else search.refine(verdict.solution)


def _plan(
    task: KickTask,
    near: Motion | None,
    starts: int,
    work: _Work,
    *,
    whole: Leg | None = None,
    share: float = 1.0,
) -> Verdict:
    """Return the verdict on the best motion of all joints of a task.

    The search starts from a motion `near`, which reaches a share of the launch, or from postures at
    rest, `starts` at most; with 0, there is one, and limits between points are not sought where it
    does not reach the whole launch. All solutions together may take the iterations of `work`. Limbs
    at rest of the `whole` leg are put aside of the motion.
    """
    former = None if near is None else near.solution
    limited = () if former is None else [name for name in former.limited if name in task.resting]
    problem, verdicts = motion_problem(task, limited), list[Verdict]()
    idle = [] if whole is None or former is not None else idle_limbs(whole, task.leg)
    for posture, start in islice(_starts(problem, near, share), max(starts, 2 if near else 1)):
        search = _Search(problem, posture, work, partly=starts > 0)
        if start.multipliers is not None:
            verdicts.append(search.again(start))
        else:
            bodies = [] if whole is None else frames_of(whole, [n for limb in idle for n in limb])
            solution = search.first(start, near is not None, bodies)
            if whole is not None and former is None and solution.share > HOPE:
                search.put_aside(solution, whole, idle)
            verdicts.append(search.refine(solution))
        if verdicts[-1].keeps_limits or not work.iterations(problem.n):
            break
    return best_of(verdicts)


def motion_problem(task: KickTask, limited: Sequence[str] = ()) -> MotionProblem:
    """Return the problem of a kick's motion; `limited` are joints at rest with rows of torque."""
    stands = task.standing is not None
    return MotionProblem(task, MotionSplines(*DURATIONS[stands], INTERVALS[stands]), limited)


class _Search:
    """Solutions of a problem from one start, whose ends are near a posture at rest, `(n,)`.

    `partly` says whether a share of the launch is of use.
    """

    def __init__(
        self,
        problem: MotionProblem,
        rest: Array,
        work: _Work,
        *,
        partly: bool,
        near: Array | None = None,
    ) -> None:
        self.problem, self.rest, self._work, self._partly = problem, rest, work, partly
        self._near = near

    def _solve(
        self,
        start: MotionSolution,
        times: list[Array],
        apart: Sequence[Conditions],
        options: dict[str, Any],
        shares: tuple[float, float] = (0.0, 1.0),
    ) -> MotionSolution:
        rows = sum(len(conditions.times) for conditions in apart)
        joints = self.problem.n + rows // ROWS
        most = min(options["max_iter"], self._work.iterations(joints))
        solution = self.problem.solve(
            start,
            self.rest,
            times,
            shares=shares,
            options={**options, "max_iter": most},
            apart=apart,
            near=self._near,
        )
        self._work.left -= joints * solution.iterations
        return solution

    def put_aside(self, solution: MotionSolution, whole: Leg, limbs: list[list[int]]) -> None:
        """Put the limbs aside that the motion of a solution would hit."""
        task, splines = self.problem.task, self.problem.splines
        count = ASIDE_TIMES // len(splines.grids)
        times = [np.linspace(grid[0], grid[-1], count) for grid in splines.grids]
        columns = [whole.joint_names.index(name) for name in task.leg.joint_names]
        postures = np.tile(rest_configuration(whole), (sum(map(len, times)), 1))
        postures[:, columns] = splines.values(times, 0) @ solution.coefficients
        angles = limbs_aside(task, whole, postures, limbs)
        if not angles:
            return
        leg = kicking_chain(whole, others=angles).leg
        self.problem = motion_problem(replace(task, leg=leg, aside=angles))
        if self.problem.feet is not None:
            posture = self.problem.stand(self.rest, at_ball=False)
            self.rest = self.rest if posture is None else posture

    def again(self, start: MotionSolution) -> Verdict:
        """Return the verdict on the solution next to the one of nearly the same kick."""
        assert start.multipliers is not None
        times, apart = start.times, start.multipliers.apart
        return Verdict(self.problem, self._solve(start, times, apart, AGAIN, (1.0, 1.0)))

    def first(self, start: MotionSolution, moves: bool, aside: Sequence[str]) -> MotionSolution:
        """Return a solution from unknowns to start from, of limits at few points.

        `moves` says whether they are those of a motion. Bodies at the frames `aside`, which are put
        aside later, do not count.
        """
        problem = self.problem
        surroundings = problem.surroundings.only(aside, others=True)
        apart = Nearness(problem, start, start.times, surroundings).conditions(start.times)
        return self._solve(start, start.times, apart, NEARBY if moves else FIRST)

    def refine(self, solution: MotionSolution) -> Verdict:
        """Return the best verdict on solutions with points added where limits are broken."""
        verdict, full = Verdict(self.problem, solution), solution.share > FULL
        verdicts: list[Verdict] = []  # the first solution keeps its limits at the points only
        nearest = verdict
        for number in range(ROUNDS):
            if solution.share < (LEAST_SHARE if self._partly and number < 2 else NEARLY):
                break
            if not self._work.iterations(self.problem.n):
                break
            nearest = verdict if verdict.broken <= nearest.broken else nearest
            far, times = verdict.broken > FAR, verdict.add_points(solution.times)
            former = [] if solution.multipliers is None else solution.multipliers.apart
            former = [x for x in former if solution.feasible or x.is_of_ball]
            apart = with_former(verdict.nearness.conditions(times), former)
            reaches_all = (full and not far) or solution.share > WHOLE
            shares = (1.0, 1.0) if reaches_all else (0.0, 1.0)
            start = solution if solution.feasible else nearest.solution
            limited = self.problem.limited
            others = [name for name in verdict.overloaded() if name not in limited]
            if others:  # joints at rest whose torques have no rows yet
                self.problem = motion_problem(self.problem.task, (*limited, *others))
            anew = bool(others) or far
            start = replace(start, multipliers=None, linearized=None) if anew else start
            solution = self._solve(start, times, apart, TIGHTER if anew else AGAIN, shares)
            verdict, full = Verdict(self.problem, solution), solution.share > FULL
            verdicts.append(verdict)
            if verdict.broken == 0.0 and (solution.share == 1.0 or not full):
                break
        return best_of(verdicts or [verdict])


def _starts(
    problem: MotionProblem, motion: Motion | None = None, share: float = 1.0
) -> Iterator[tuple[Array, MotionSolution]]:
    """Yield postures at rest and unknowns to start from.

    Without a motion to start from, the robot stays in a posture that touches the ball.

    Raises:
        InvalidInput: there are none.
    """
    splines = problem.splines
    times = splines.times(*POINTS)
    if motion is not None:
        leg = problem.task.leg
        values = {**leg.joint_values(rest_configuration(leg)), **motion.aside}
        coefficients = np.tile([values[name] for name in leg.joint_names], (splines.size, 1))
        columns = [leg.joint_names.index(name) for name in motion.joints]
        coefficients[:, columns] = splines.coefficients(motion.before, motion.after)
        solution = motion.solution
        same = solution is not None and np.array_equal(solution.coefficients, coefficients)
        if solution is not None and same and problem.continues(solution):
            yield solution.rest, solution
        yield coefficients[0], MotionSolution(coefficients[0], coefficients, share, times)
        return
    draw, robot = np.random.default_rng(0), problem.task.robot
    room = CENTRAL * (problem.upper - problem.lower)
    central = np.clip(0.0, problem.lower + room, problem.upper - room)
    reachable = False
    for number in range(STARTS):
        posture = central + draw.normal(0.0, SPREAD if number else 0.0, problem.n)
        posture = np.clip(posture, problem.lower + 0.2 * room, problem.upper - 0.2 * room)
        at_rest = problem.stand(posture, at_ball=False)
        hit = None if at_rest is None else problem.stand(at_rest, at_ball=True)
        if at_rest is not None and hit is not None:
            reachable = True
            yield (
                at_rest,
                MotionSolution(at_rest, np.tile(hit, (splines.size, 1)), FIRST_SHARE, times),
            )
    if not reachable:
        does = "stand at rest" if at_rest is None else "touch the ball at rest"
        raise InvalidInput(
            f"no posture was found in which {robot.name} can {does} within its limits of torque, "
            "range and balance"
        )
