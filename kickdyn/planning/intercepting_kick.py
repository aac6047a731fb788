"""A kick of a ball that moves at a time that is chosen: what the foot must do, and the plan."""

import math
from dataclasses import dataclass

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.flight.follow import follow
from kickdyn.ground import Surface
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import IncomingBall
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_problem import KickProblem, kick_problem
from kickdyn.planning.kick_steps import LONGEST_COURSE, Chosen, outcome_of, path_to_target
from kickdyn.planning.kick_terms import (
    BallPosition,
    KickPoint,
    Objective,
    StrikeVelocity,
    place_exactly,
)
from kickdyn.planning.launch import Launch
from kickdyn.planning.meeting import Meeting
from kickdyn.planning.objectives import OBJECTIVES, KickObjective, LargestShare
from kickdyn.planning.passes import Pass
from kickdyn.robot.leg import Leg

STRONGEST = LargestShare()
"""The objective of kicks that cannot give the whole change of velocity."""


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
        return kick_problem(self.leg, self.target, self.before.position, limits=s.limits, like=like)

    @property
    def ahead(self) -> Array:
        """Horizontal unit vector along the impulse, shape `(3,)`."""
        x, y, _ = self.target.impulse.tolist()
        return np.array([x, y, 0.0]) / (math.hypot(x, y) or 1.0)

    def exactly(self, problem: KickProblem, point: KickPoint) -> KickPoint:
        """Return a point near one, with the position and velocity of the foot exact."""
        position, velocity = problem.find(BallPosition), problem.find(StrikeVelocity)
        assert position is not None
        assert velocity is not None
        return velocity.make_exact(place_exactly(position, point))

    def kick(self, problem: KickProblem, point: KickPoint) -> "InterceptingKick":
        """Return the kick of a solution of the problem."""
        s, point = self.settings, self.exactly(problem, point)
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

    @property
    def objective(self) -> Objective | LargestShare:
        """What makes the kick best: the share of the launch, if that is not reached in full."""
        return STRONGEST if self.point.share < 1.0 else OBJECTIVES[self.task.settings.objective]()

    def polished(self) -> "InterceptingKick":
        """Return the kick with its solution refined to rounding."""
        return self.task.kick(self.problem, self.problem.polish(self.objective, self.point))

    def plan(self) -> KickPlan:
        """Return the plan, with the path of the ball."""
        task, s, impact = self.task, self.task.settings, self.impact
        if isinstance(task.goal, Goal):
            assert not isinstance(task.launch, BallState)
            time = task.launch.time if self.meeting.share == 1.0 else None
            path = path_to_target(
                impact, task.goal, s.air, s.surface, time, self.meeting.ground.height
            )
        else:
            ground = task.incoming.ground
            path = follow(impact.ball_after, s.ball, s.air, ground, time_limit=LONGEST_COURSE)
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
            **self.chosen[2],
        )
