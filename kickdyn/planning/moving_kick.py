"""Planning a kick of a ball that moves: where it is met, and how."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import follow
from kickdyn.ground import Surface
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import ImpactTarget, impact_target_for, trapped_ball
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import (
    CANDIDATES,
    LONGEST_WAIT,
    SHORTEST_COURSE,
    IncomingBall,
    reach_of,
    state_at,
    waits_in_plane,
    waits_in_reach,
)
from kickdyn.planning.kick_plan import KickPlan, check_self_collision
from kickdyn.planning.kick_problem import KickProblem, best_from, kick_problem, solve_kick
from kickdyn.planning.kick_steps import (
    LONGEST_COURSE,
    Chosen,
    one_thread,
    outcome_of,
    path_to_target,
    plan_flight_launch,
    plan_pass_launch,
)
from kickdyn.planning.kick_terms import BallPosition, KickPoint, StrikeVelocity, place_exactly
from kickdyn.planning.launch import Launch
from kickdyn.planning.meeting import Meeting
from kickdyn.planning.objectives import OBJECTIVES, KickObjective
from kickdyn.planning.passes import Pass
from kickdyn.robot.leg import Leg


@dataclass(frozen=True)
class KickSettings:
    """The arguments of `plan_kick` or `plan_trap` but for the leg and the ball that moves."""

    goal: Goal | BallState
    ball: Ball
    air: Air | None
    contact: Contact
    objective: KickObjective
    limits: bool | str
    surface: str | Surface | None
    solver: str


@dataclass(frozen=True, eq=False)
class Interception:
    """A ball that is met at a time, and what the foot must do to it.

    Attributes:
        leg, settings, incoming: what is planned.
        before: the ball just before the contact, by the clock of `incoming`.
        goal: the goal, seen from there; of a trap, the motion that is wished.
        launch: the launch that meets it; of a trap, the motion that the ball can get.
        target: what the foot must do.
    """

    leg: Leg
    settings: KickSettings
    incoming: IncomingBall
    before: BallState
    goal: Goal | BallState
    launch: Launch | Pass | BallState
    target: ImpactTarget

    def problem(self, like: KickProblem | None = None) -> KickProblem:
        """Return the problem of the kick, made from one of the same leg."""
        s = self.settings
        return kick_problem(
            self.leg, self.target, self.before.position, limits=s.limits, solver=s.solver, like=like
        )

    @property
    def ahead(self) -> Array:
        """Horizontal unit vector along the impulse, shape `(3,)`."""
        x, y, _ = self.target.impulse.tolist()
        return np.array([x, y, 0.0]) / (math.hypot(x, y) or 1.0)

    def kick(self, problem: KickProblem, point: KickPoint) -> "InterceptingKick":
        """Return the kick of a solution of the problem."""
        s, position = self.settings, problem.find(BallPosition)
        strike_velocity = problem.find(StrikeVelocity)
        if position is not None and strike_velocity is not None:
            point = strike_velocity.make_exact(place_exactly(position, point))
        chosen = outcome_of(problem, point, OBJECTIVES[s.objective]())
        impact = strike(
            *chosen[:2], s.ball, self.target.contact,
            ball_velocity=self.before.velocity, ball_spin=self.before.spin,
        )  # fmt: skip
        meeting = Meeting(
            self.before, self.incoming, self.goal, s.air, impact, point.share,
            chosen[2]["speed_use"],
        )  # fmt: skip
        return InterceptingKick(self, problem, point, chosen, impact, meeting)


@dataclass(frozen=True, eq=False)
class InterceptingKick:
    """A kick that meets a moving ball, before its path is computed."""

    task: Interception
    problem: KickProblem
    point: KickPoint
    chosen: Chosen
    impact: Impact
    meeting: Meeting

    @property
    def rank(self) -> tuple[float, float]:
        """Less for a better kick."""
        return -self.meeting.share, self.meeting.speed_use

    def plan(self) -> KickPlan:
        """Return the plan, with the path of the ball."""
        task, s, impact = self.task, self.task.settings, self.impact
        if isinstance(task.goal, Goal):
            assert not isinstance(task.launch, BallState)
            time = task.launch.time if self.meeting.share == 1.0 else None
            path = path_to_target(impact, task.goal, s.air, s.surface, time)
        else:
            ground = task.incoming.ground
            after = impact.ball_after
            path = follow(after, s.ball, s.air, ground, time_limit=LONGEST_COURSE)
        return KickPlan(
            goal=task.goal,
            launch=task.launch,
            objective=s.objective,
            impact_target=task.target,
            impact=impact,
            path=path,
            ball_is_placed=True,
            heading=self.problem.heading,
            meeting=self.meeting,
            meetings=(self.meeting,),
            _again=partial(_replan, self),
            **self.chosen[2],
        )


class Interceptor:
    """Where a leg can meet a ball, and what that takes.

    Args:
        leg: that kicks.
        settings: of the kick.
        incoming: the ball, with its ground.
        near: a launch near those that are sought.
        longest: for how long the ball is followed [s].
    """

    def __init__(
        self,
        leg: Leg,
        settings: KickSettings,
        incoming: IncomingBall,
        near: Launch | None = None,
        longest: float = LONGEST_WAIT,
    ) -> None:
        self.leg, self.settings, self.incoming = leg, settings, incoming
        self.course = incoming.course(settings.ball, settings.air, longest)
        self._near = near
        self._objective = OBJECTIVES[settings.objective]()
        self._known: dict[float, Interception | InvalidInput] = {}

    def at(self, wait: float) -> Interception:
        """Return what a kick takes that meets the ball some time after it was seen.

        Raises:
            InvalidInput: there is no such kick, with the reason.
        """
        if wait not in self._known:
            try:
                self._known[wait] = self._task(wait)
            except InvalidInput as error:
                self._known[wait] = error
        known = self._known[wait]
        if isinstance(known, InvalidInput):
            raise known
        return known

    def escaping(self, wait: float) -> str:
        """Return that the ball moves away from the foot, as the end of a sentence, if it does."""
        known = self._known.get(wait)
        if not isinstance(known, Interception):
            return ""
        away = float(known.before.velocity @ known.target.contact.normal)
        return f"; the ball moves away from the foot at {away:.3g} m/s" if away > 0.0 else ""

    def beside(self, wait: float) -> float:
        """Return how far to the left of the impulse through the origin it then is [m], or nan."""
        try:
            task = self.at(wait)
        except InvalidInput:
            return math.nan
        x, y, _ = task.before.position.tolist()
        return float(task.ahead[0] * y - task.ahead[1] * x)

    def kicks(self, waits: list[float]) -> tuple[dict[float, InterceptingKick], dict[float, str]]:
        """Return kicks by the time since the ball was seen, and at other times why there is none.

        From the time whose postures are best, the solution is followed to its neighbours, and to
        the middle between them and the best one. Where no kick gives the whole launch, the
        strongest one is returned.

        Args:
            waits: times, rising [s].
        """
        reasons: dict[float, str] = {}
        problems: dict[float, KickProblem] = {}
        like: KickProblem | None = None
        for wait in waits:
            try:
                problems[wait] = like = self.at(wait).problem(like)
            except InvalidInput as error:
                reasons[wait] = str(error)
        ratings = {wait: problem.rating for wait, problem in problems.items()}
        order = sorted(problems, key=lambda wait: ratings[wait])
        kicks: dict[float, InterceptingKick] = {}
        for wait in order:
            self._seek(kicks, wait, problems[wait], problems[wait].starts())
            if kicks:
                self._follow(kicks, wait, problems)
                break
            reasons[wait] = "no posture gives this launch"
        for wait in problems:
            if kicks and wait not in kicks:
                reasons[wait] = "no posture near the other meetings gives this launch"
        if order and not kicks:
            best = order[0]
            try:
                kicks[best] = self.at(best).kick(*solve_kick(problems[best], self._objective))
            except InvalidInput as error:
                reasons = {best: str(error)} | {**reasons, best: str(error)}
        return kicks, reasons

    def _seek(
        self,
        kicks: dict[float, InterceptingKick],
        wait: float,
        problem: KickProblem,
        starts: Sequence[Array],
    ) -> None:
        """Add the kick at a time if one is near some unknowns to start from."""
        point = best_from(problem, self._objective, starts)
        if point is not None:
            kicks[wait] = self.at(wait).kick(problem, point)

    def _follow(
        self,
        kicks: dict[float, InterceptingKick],
        first: float,
        problems: dict[float, KickProblem],
    ) -> None:
        """Add the kicks at times before and after the first one, each from its neighbour."""
        later = [wait for wait in problems if wait > first]
        earlier = [wait for wait in problems if wait < first]
        for side in (later, earlier[::-1]):
            last = first
            for wait in side:
                self._seek(kicks, wait, problems[wait], [kicks[last].point.x])
                if wait not in kicks:
                    break
                last = wait
        best = min(kicks, key=lambda wait: kicks[wait].rank)
        number = list(problems).index(best)
        times = list(problems)
        if len(times) < CANDIDATES:
            return
        for other in (*times[max(number - 1, 0) : number], *times[number + 1 : number + 2]):
            middle = 0.5 * (best + other)
            try:
                problem = self.at(middle).problem(problems[best])
            except InvalidInput:
                continue
            self._seek(kicks, middle, problem, [kicks[best].point.x])

    def _task(self, wait: float) -> Interception:
        s, incoming = self.settings, self.incoming
        before = state_at(incoming, self.course, wait)
        goal: Goal | BallState
        launch: Launch | Pass | BallState
        if isinstance(s.goal, BallState):
            goal, launch = s.goal, trapped_ball(s.goal, before, s.ball, s.contact)
        else:
            goal = s.goal.seen_from(before.position - incoming.state.position, wait)
            if s.surface is None:
                launch = plan_flight_launch(goal, s.ball, s.air, s.contact, before, self._near)
                self._near = launch
            else:
                _check_on_ground(before, s.ball, incoming)
                launch = plan_pass_launch(goal, s.ball, s.air, s.surface)
            goal = goal.at(launch.time)
        target = impact_target_for(launch.velocity, launch.spin, s.ball, s.contact, before)
        return Interception(self.leg, s, incoming, before, goal, launch, target)


def _check_on_ground(before: BallState, ball: Ball, incoming: IncomingBall) -> None:
    assert incoming.ground is not None
    above = float(before.position[2]) - ball.radius - incoming.ground.height
    if abs(above) > 1e-3:
        raise InvalidInput(
            f"the ball is {above:.3g} m above the ground where it is met: a pass along the ground "
            "is for a ball that rolls"
        )


def plan_interception(leg: Leg, incoming: IncomingBall, settings: KickSettings) -> KickPlan:
    """Return the plan of the best meeting, with all that were considered.

    It is the one of the least speed use, among those in which no bodies are inside each other, the
    ball or the ground, if there are such.
    """
    s = settings
    incoming = incoming.on_ground_of(leg, s.ball)
    with one_thread():
        balls, reach = Interceptor(leg, s, incoming), reach_of(leg, s.ball)
        waits = waits_in_reach(incoming, balls.course, reach, s.goal, s.ball.radius)
        if reach.across is not None:
            waits = waits_in_plane(waits, lambda wait: balls.beside(wait) - reach.beside)
        kicks, reasons = balls.kicks(waits.tolist())
        if not kicks:
            first = next(iter(reasons))
            raise InvalidInput(
                f"the ball is met at none of {len(waits)} times within reach: after {first:.3g} s, "
                f"{reasons[first]}{balls.escaping(first)}"
            )
        plan, collisions = _without_collisions(sorted(kicks.values(), key=lambda kick: kick.rank))
    meetings = [
        replace(kick.meeting, reason=collisions.get(kick.meeting.time, ""))
        for kick in kicks.values()
    ] + [
        Meeting(state_at(incoming, balls.course, wait), incoming, s.goal, s.air, reason=reason)
        for wait, reason in reasons.items() if wait not in kicks
    ]  # fmt: skip
    return replace(plan, meetings=tuple(sorted(meetings, key=lambda meeting: meeting.time)))


def _without_collisions(
    kicks: Sequence[InterceptingKick],
) -> tuple[KickPlan, dict[float, str]]:
    """Return the plan of the first kick without bodies inside others, and why not of those before.

    Where the robot collides with itself in the first, and bodies collide in all, the first is
    planned again with conditions against it.
    """
    plans, collisions = list[KickPlan](), dict[float, str]()
    for kick in kicks:
        plans.append(kick.plan())
        if not plans[-1].collisions:
            return plans[-1], collisions
        collisions[kick.meeting.time] = plans[-1].collisions[0].partition("; ")[0]
    if not check_self_collision(plans[0]):
        return plans[0], {}
    task = kicks[0].task
    again = task.kick(*solve_kick(kicks[0].problem, OBJECTIVES[task.settings.objective]()))
    plan = again.plan()
    return (plan if again.rank[0] <= kicks[0].rank[0] and not plan.collisions else plans[0]), {}


def _replan(kick: InterceptingKick, plan: KickPlan, incoming: IncomingBall) -> KickPlan:
    """Return the plan of a ball that is seen again, from the kick of the last plan."""
    assert isinstance(incoming.meet_at, float)
    settings, task = kick.task.settings, kick.task
    seen, last = incoming.state, task.incoming.state
    if isinstance(settings.goal, Goal):  # the target stays where it is in the world
        later = float(seen.time) - float(last.time)
        goal = settings.goal.seen_from(seen.position - last.position, later)
        settings = replace(settings, goal=goal)
    wait = incoming.meet_at - float(seen.time)
    near = task.launch if isinstance(task.launch, Launch) else None
    with one_thread():
        try:
            balls = Interceptor(task.leg, settings, incoming, near, max(wait, SHORTEST_COURSE))
            task = balls.at(min(wait, balls.course.duration))
            problem = task.problem(kick.problem)
            point = best_from(problem, OBJECTIVES[settings.objective](), [kick.point.x])
        except InvalidInput:
            point = None
        if point is not None:
            return task.kick(problem, point).plan()
    return plan_interception(task.leg, incoming, settings)
