"""Planning a kick of a ball that moves: where it is met, and how."""

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import (
    CANDIDATES,
    FASTEST_BALL,
    IN_GROUND,
    LONGEST_WAIT,
    SHORTEST_COURSE,
    IncomingBall,
    Reach,
    state_at,
    waits_in_plane,
    waits_in_reach,
)
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_problem import KickProblem, best_from, keep_above, keep_apart, solve_kick
from kickdyn.planning.kick_steps import (
    STRONGEST,
    ImpactTask,
    KickSettings,
    SolvedKick,
    checked_contact,
    checked_leg,
    checked_objective,
    one_thread,
)
from kickdyn.planning.kick_terms import OBJECTIVES, BallPosition, Objective
from kickdyn.planning.launch import Launch
from kickdyn.planning.meeting import Meeting
from kickdyn.robot.collisions import find_self_collisions
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.leg import Leg

MENDINGS = 3
"""Number of times that a kick in which bodies collide is planned again at most."""

TOUCHING_STARTS, TOUCHING_TIMES, STRONGEST_STARTS, LAUNCHES = 2, 4, 16, 3
"""Numbers of postures at the ball from which the strongest kick is sought, of the most promising
times for which it is, of such postures at the best time then, and of times for which launches are
planned to find where a leg faces."""


class Interceptor:
    """The kicks of a moving ball by a leg, by the time since the ball was seen.

    Args:
        settings: of the kick.
        incoming: the ball, with its ground.
        near: a launch near those that are sought.
        longest: for how long the ball is followed [s].
        reach: of a leg that has to face the ball; None of one that does already.
    """

    def __init__(
        self,
        settings: KickSettings,
        incoming: IncomingBall,
        near: Launch | None = None,
        longest: float = LONGEST_WAIT,
        reach: Reach | None = None,
    ) -> None:
        self.settings, self.incoming = settings, incoming
        self.course = incoming.course(settings.ball, settings.air, longest)
        self._near, self._reach = near, reach
        self._objective = OBJECTIVES[settings.objective]
        self._known = dict[float, ImpactTask | InvalidInput]()
        self._problems, self._kicks = dict[float, KickProblem](), dict[float, SolvedKick]()

    def at(self, wait: float) -> ImpactTask:
        """Return the task of the foot at a time since the ball was seen [s].

        Raises:
            InvalidInput: there is no such kick, with the reason.
        """
        if wait not in self._known:
            try:
                self._known[wait] = self._task(wait)
            except InvalidInput as error:
                self._known[wait] = error
        result = self._known[wait]
        if isinstance(result, InvalidInput):
            raise result
        return result

    def escaping(self, wait: float) -> str:
        """Return that the ball moves away from the foot, as the end of a sentence, if it does."""
        try:
            kick = self.at(wait)
        except InvalidInput:
            return ""
        away = float(kick.before.velocity @ kick.target.contact.normal)
        if away > 0.0:
            return f"; the ball moves away from the foot at {away:.3g} m/s"
        speed, velocity = math.hypot(*kick.launch.velocity), kick.before.velocity
        ahead = float(kick.launch.velocity @ velocity) / (speed or 1.0)
        if ahead > speed > 0.0:
            return (
                f"; the ball is faster than its launch must be, {ahead:.3g} m/s in place of "
                f"{speed:.3g} m/s in its direction, so that the foot has to brake it from ahead"
            )
        return ""

    def changes(self, waits: Array) -> Array:
        """Return the changes of the ball's velocity by kicks, shape `(n, 3)` [m/s].

        It is 0 without a launch, and for a leg that is not turned, for which it does not count.
        Launches are planned for `LAUNCHES` of the rising times `(n,)` [s], and interpolated.
        """
        before, goal = self.course.sample(waits).velocity, self.settings.goal
        if isinstance(goal, BallState):
            return np.asarray(goal.velocity - before)
        if self._reach is None or self._reach.across is None:
            return np.zeros(before.shape)
        chosen = np.unique(np.linspace(0.0, len(waits) - 1.0, LAUNCHES).astype(int))
        times, velocities = list[float](), list[Array]()
        for wait in waits[chosen].tolist():
            with suppress(InvalidInput):
                velocities.append(self.at(wait).launch.velocity)
                times.append(wait)
        if not times:
            return np.zeros(before.shape)
        rows = np.array(velocities).T
        return np.column_stack([np.interp(waits, times, row) for row in rows]) - before

    def beside(self, wait: float) -> float:
        """Return the ball's distance to the left of the impulse through the origin [m], or nan."""
        with suppress(InvalidInput):
            task = self.at(wait)
            x, y, _ = task.before.position.tolist()
            return float(task.ahead[0] * y - task.ahead[1] * x)
        return math.nan

    def kicks(self, waits: list[float]) -> tuple[dict[float, SolvedKick], dict[float, str]]:
        """Return kicks by the time since the ball was seen, and at other times why there is none.

        From the time whose postures are best, the solution is followed to its neighbours, and to
        the middle between them and the best one. Where no kick gives the whole launch, the
        strongest one is returned.
        """
        reasons, like = dict[float, str](), None
        self._problems, self._kicks = dict[float, KickProblem](), dict[float, SolvedKick]()
        kicks, problems = self._kicks, self._problems
        for wait in waits:
            try:
                self._check_facing(self.at(wait))
                problems[wait] = like = self.at(wait).problem(like)
            except InvalidInput as error:
                reasons[wait] = str(error)
        if problems:
            ratings = {wait: problem.rating for wait, problem in problems.items()}
            best = min(problems, key=ratings.__getitem__)
            self._seek(best, problems[best], problems[best].starts())
        if kicks:
            self._follow()
            missed = "no posture near the other meetings gives this launch"
        else:
            reasons = self._seek_strongest() | reasons
            missed = "no posture gives this launch"
        reasons |= {wait: missed for wait in problems if wait not in kicks | reasons}
        return kicks, reasons

    def _seek_strongest(self) -> dict[float, str]:
        """Add the strongest kicks from postures at the ball; return why there are none."""
        kicks, problems = self._kicks, self._problems
        touching, reasons = dict[float, KickProblem](), dict[float, str]()
        for wait, problem in problems.items():
            at_ball = problem.at_ball(TOUCHING_STARTS)
            if len(at_ball.drawn):
                touching[wait] = at_ball
            else:
                ball = problem.find(BallPosition)
                place = "" if ball is None else f" {ball.place}"
                reasons[wait] = (
                    f"{self.settings.leg.name} has no posture in which its foot touches the "
                    f"ball{place}"
                )
        ranks = {
            wait: (not problem.may_meet(problem.drawn[0]), problem.rating)
            for wait, problem in touching.items()
        }
        order = sorted(touching, key=ranks.__getitem__)
        for wait in order[:TOUCHING_TIMES]:
            self._seek(wait, problems[wait], touching[wait].starts(), STRONGEST)
        if order and not kicks:
            best = order[0]
            try:
                kicks[best] = self.at(best).kick(*solve_kick(touching[best], self._objective))
            except InvalidInput as error:
                return {best: str(error)} | reasons
        if kicks:
            self._follow(STRONGEST)
            best = min(kicks, key=lambda wait: kicks[wait].rank)
            problem, point = kicks[best].problem, kicks[best].point
            starts = [x for _, _, x in problem.at_ball(STRONGEST_STARTS).rated()]
            self._seek(best, problem, [point.x, *starts], STRONGEST)
        return reasons

    def _check_facing(self, task: ImpactTask) -> None:
        """Refuse a ball behind a leg that is turned to the impulse."""
        if self._reach is None or self._reach.across is None:
            return
        behind = float(task.ahead @ (self._reach.centre - task.before.position))
        if behind > self.settings.ball.radius:
            raise InvalidInput(
                f"the ball is {behind:.3g} m behind the hip of a leg that faces along its change "
                "of velocity"
            )

    def _seek(
        self,
        wait: float,
        problem: KickProblem,
        starts: list[Array],
        objective: Objective | None = None,
    ) -> None:
        """Add the kick at a time that is best by an objective, if one is near the starts."""
        point = best_from(problem, objective or self._objective, starts)
        if point is not None and objective is not None and point.share > 1.0 - 1e-6:
            point = best_from(problem, self._objective, [point.x]) or point
        if point is not None:
            self._kicks[wait] = self.at(wait).kick(problem, point)

    def _follow(self, objective: Objective | None = None) -> None:
        """Add the kicks at times before and after the best one, each from its neighbour."""
        kicks, problems = self._kicks, self._problems
        first = min(kicks, key=lambda wait: kicks[wait].rank)
        times = list(problems)
        number = times.index(first)
        for side in (times[number + 1 :], times[:number][::-1]):
            last = first
            for wait in side:
                if wait not in kicks:
                    self._seek(wait, problems[wait], [kicks[last].point.x], objective)
                if wait not in kicks:
                    break
                last = wait
        if len(times) < CANDIDATES:
            return
        best = min(kicks, key=lambda wait: kicks[wait].rank)
        number = times.index(best)
        for other in (*times[max(number - 1, 0) : number], *times[number + 1 : number + 2]):
            middle = 0.5 * (best + other)
            with suppress(InvalidInput):
                problem = self.at(middle).problem(problems[best])
                self._seek(middle, problem, [kicks[best].point.x], objective)

    def _task(self, wait: float) -> ImpactTask:
        s, incoming, goal = self.settings, self.incoming, self.settings.goal
        before = state_at(incoming, self.course, wait)
        if isinstance(goal, Goal):
            goal = goal.seen_from(before.position - incoming.state.position, wait)
            if s.surface is not None:
                assert incoming.ground is not None
                above = float(before.position[2]) - s.ball.radius - incoming.ground.height
                if abs(above) > IN_GROUND:
                    raise InvalidInput(
                        f"the ball is {above:.3g} m above the ground where it is met: a pass along "
                        "the ground is for a ball that rolls"
                    )
                if abs(goal.target[2]) <= IN_GROUND:  # it lies as the ball does, but for rounding
                    goal = replace(goal, target=goal.target * [1.0, 1.0, 0.0])
        task = ImpactTask.make(s, goal, before, before.position, incoming, self._near)
        self._near = task.launch if isinstance(task.launch, Launch) else None
        return task


def plan_interception(incoming: IncomingBall, settings: KickSettings) -> KickPlan:
    """Return the plan of the best meeting, with all that were considered.

    It is the one of the least speed use, among those in which no bodies are inside each other, the
    ball or the ground, if there are such.
    """
    s = settings
    incoming = incoming.on_ground_of(s.leg, s.ball)
    with one_thread():
        reach = s.reach
        balls = Interceptor(s, incoming, reach=reach)
        ways = balls.changes, balls.escaping
        waits = waits_in_reach(incoming, balls.course, reach, s.ball.radius, *ways)
        crossing = waits
        if reach.across is not None:
            crossing = waits_in_plane(waits, lambda wait: balls.beside(wait) - reach.beside)
        kicks, reasons = balls.kicks(crossing.tolist())
        if not any(kick.point.share == 1.0 for kick in kicks.values()) and crossing is not waits:
            placed, others = balls.kicks(waits.tolist())  # the leg is placed at the ball
            if not kicks or (placed and _best_rank(placed) < _best_rank(kicks)):
                kicks, reasons = placed, others
        if not kicks:
            earliest = next(iter(reasons))
            several = f"at any of {len(waits)} times within reach"
            sought = several if len(waits) > 1 else "at the only time that was sought"
            raise InvalidInput(
                f"the ball cannot be met {sought}: {earliest:.3g} s after it was seen, "
                f"{reasons[earliest]}{balls.escaping(earliest)}"
            )
        ordered = dict(sorted(kicks.items(), key=lambda item: item[1].rank))
        planned, plan, collisions = _without_collisions(ordered)
    meetings = dict[float, Meeting]()
    for wait, reason in reasons.items():
        ball = state_at(incoming, balls.course, wait)
        meetings[wait] = Meeting(ball, incoming, s.goal, s.air, reason=reason)
    for wait, kick in kicks.items():
        assert kick.meeting is not None
        meetings[wait] = replace(kick.meeting, reason=collisions.get(wait, ""))
    assert plan.meeting is not None
    meetings[planned] = plan.meeting
    return replace(plan, meetings=tuple(meetings[wait] for wait in sorted(meetings)))


def _best_rank(kicks: dict[float, SolvedKick]) -> tuple[float, float]:
    return min(kick.rank for kick in kicks.values())


def _plan_of(kick: SolvedKick) -> KickPlan:
    """Return the plan of a kick, which can be planned again."""
    return replace(kick.plan(), _again=partial(_replan, kick))


def _without_collisions(kicks: dict[float, SolvedKick]) -> tuple[float, KickPlan, dict[float, str]]:
    """Return time and plan of the first kick without collisions, and why not of those before.

    Where bodies collide in all, kicks are planned again with conditions against it.
    """
    plans, collisions = dict[float, KickPlan](), dict[float, str]()
    for wait, kick in kicks.items():
        plans[wait] = _plan_of(kick.polished())
        if not plans[wait].collisions:
            return wait, plans[wait], collisions
        collisions[wait] = plans[wait].collisions[0].partition("; ")[0]
    for wait, kick in kicks.items():
        mended = _mended(kick)
        if mended is not None:
            collisions.pop(wait)
            return wait, mended, collisions
    first = next(iter(plans))
    return first, plans[first], {}


def _mended(kick: SolvedKick) -> KickPlan | None:
    """Return the plan of a kick in which bodies collide, where conditions against it are kept."""
    assert kick.meeting is not None
    problem, point, pairs = kick.problem, kick.point, set[tuple[str, str]]()
    ground = kick.meeting.ground.height
    q, initial = problem.on_robot(point)[0], problem.robot.configuration()
    under, always = (find_depths(problem.robot, x, ground) for x in (q, initial))
    if any(abs(depth - always.get(name, 0.0)) < 1e-12 for name, depth in under.items()):
        return None  # such as the other leg, which the kick does not move
    for _ in range(MENDINGS):
        pairs |= find_self_collisions(problem.robot, problem.on_robot(point)[0]).keys()
        trial = keep_apart(problem, pairs) if pairs else problem
        if problem.standing is None:
            trial = keep_above(trial, ground)
        best = best_from(trial, kick.objective, [point.x, *trial.starts()])
        if best is None or best.share < point.share - 1e-6:
            return None
        point = best
        plan = _plan_of(kick.task.kick(trial, best).polished())
        if not plan.collisions:
            return plan
    return None


def _replan(kick: SolvedKick, plan: KickPlan, incoming: IncomingBall) -> KickPlan:
    """Return the plan of a ball that is seen again, from the kick of the last plan."""
    assert isinstance(incoming.meet_at, float)
    assert kick.task.incoming is not None
    settings, task = kick.task.settings, kick.task
    seen, last = incoming.state, kick.task.incoming.state
    if isinstance(settings.goal, Goal):  # the target stays where it is in the world
        later = float(seen.time) - float(last.time)
        goal = settings.goal.seen_from(seen.position - last.position, later)
        settings = replace(settings, goal=goal)
    wait = incoming.meet_at - float(seen.time)
    earlier = task.launch if isinstance(task.launch, Launch) else None
    with one_thread(), suppress(InvalidInput):
        balls = Interceptor(settings, incoming, earlier, max(wait, SHORTEST_COURSE))
        task = balls.at(min(wait, balls.course.duration))
        problem = task.problem(kick.problem)
        start = task.exactly(problem, problem.variables.point(kick.point.x))
        point = best_from(problem, OBJECTIVES[settings.objective], [start.x])
        if point is not None:
            return _plan_of(task.kick(problem, point))
    return plan_interception(incoming, settings)


@validation.check_arguments
def plan_trap(
    leg: Leg,
    incoming: BallState | IncomingBall,
    ball: Ball,
    air: Air | None = None,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    objective: str | None = None,
    contact: Contact | None = None,
    limits: bool | str = True,
) -> KickPlan:
    r"""Find posture and joint velocity with which the foot leaves a moving ball at rest.

    It is a kick with another goal, a velocity v of the ball just after it: the impulse is
    :math:`p = m (v - v_0)`, and along its normal the foot has the velocity
    :math:`n \cdot v_0 + n \cdot W p / (1 + e)`. With restitution e, it retreats from the ball. The
    spin is braked as far as friction can do so; after a ball that rolls, some of it is left.

    Args:
        leg: the leg that kicks, as for `plan_kick`.
        incoming: the ball that moves, as for `plan_kick`.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum.
        velocity: of the ball just after the contact, shape `(3,)` [m/s, world frame].
        objective: a `KickObjective` of the impact; None is `joint-speed`.
        contact: restitution, friction and offset of the contact, as for `plan_kick`.
        limits: whether limits of speed and torque hold, as for `plan_kick`.

    Returns:
        The plan. Its `goal` is the ball with the wished velocity, without spin; `launch` is the
        ball with the spin that is left; `path` is followed to rest, each flight and the rolling for
        10 s at most.

    Raises:
        InvalidInput: a ball that moves so already, and as for `plan_kick`.

    Example:
        >>> import kickdyn as kd
        >>> rolls = kd.BallState((2, 0, -0.7042), (-2.5, 0, 0), (0, -22.77, 0))
        >>> plan = kd.plan_trap(kd.Leg.human(), rolls, kd.Ball(), kd.Air())
        >>> str(plan.status), bool(plan.impact.ball_after.speed < 1e-9)
        ('met', True)
    """
    moving_ball = incoming if isinstance(incoming, IncomingBall) else IncomingBall(incoming)
    wish = validation.vector("velocity", velocity, 3, unit="m/s")
    speed = math.hypot(*wish)
    validation.number("speed after the contact", speed, at_most=FASTEST_BALL, unit="m/s")
    settings = KickSettings(
        checked_leg(leg), BallState(velocity=wish), ball, air, checked_contact(contact),
        checked_objective(objective), limits,
    )  # fmt: skip
    return plan_interception(moving_ball, settings)
