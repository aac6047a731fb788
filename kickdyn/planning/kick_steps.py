"""Steps of planning a kick: its settings, the launch, the task of the foot, the plan of a state."""

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground, Surface
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import (
    ImpactTarget,
    impact_target_for,
    planar_spin,
    struck_spin,
)
from kickdyn.plane import Plane
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import IncomingBall, Reach, reach_of
from kickdyn.planning.kick_limits import (
    Balance,
    KickMuscleTorqueLimit,
    KickSpeedLimit,
    KickTorqueLimit,
)
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_problem import MUSCLES, KickProblem, kick_problem
from kickdyn.planning.kick_terms import (
    OBJECTIVES,
    BallPosition,
    KickObjective,
    KickPoint,
    LargestShare,
    Objective,
    StrikeVelocity,
    place_exactly,
)
from kickdyn.planning.launch import Launch, OutOfReach, fly_to_target, plan_launch
from kickdyn.planning.meeting import Meeting
from kickdyn.planning.passes import Pass, plan_pass
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.names import MAX_FAULTY, listed
from kickdyn.robot.standing import with_angles

LONGEST_COURSE = 10.0
"""Time for which each flight, and rolling, of a trapped ball is followed at most [s]."""

MOST_LAUNCHES, SAME_SPIN = 50, 1e-12
"""Of the search for a launch with the spin that the foot gives it: largest number of launches, of
which a ball of 6 m/s needs up to 26, and relative difference of the spin at which it ends."""

STRONGEST = LargestShare()
"""The objective of kicks that cannot give the whole change of velocity."""

Chosen = tuple[Posture, Array, dict[str, Any]]
"""The robot's posture and joint velocity at the impact, and further attributes of `KickPlan`."""


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which matrices are multiplied by one thread.

    Several threads sum in another order, which moves postures by up to 2e-5 rad, and take 5 times
    as long for matrices of 100 rows.
    """
    context: AbstractContextManager[Any] = _blas().limit(limits=1, user_api="blas")
    return context


@cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController()  # it looks through all loaded libraries, which takes 2 ms


def checked_leg(leg: Leg) -> Leg:
    """Return the leg with one angle for each continuous joint; refuse stiff joints."""
    if leg.stiff_joints:
        raise InvalidInput(
            f"{leg.name} has stiff joints ({', '.join(leg.stiff_joints)}): kicks are planned for "
            "legs whose joints are free (Leg.with_stiff_joints() without names frees them)"
        )
    return with_angles(leg)


def check_has_drives(leg: Leg) -> None:
    """Raise `InvalidInput` for a leg of a file without drives, which a motion needs."""
    if leg.file is None or not leg.file.lacks_drives or leg.model.armature.any():
        return
    names = leg.single_joints
    unlimited = [n for n in names if not 0.0 < leg.effort_limit[leg.velocity_index(n)] < np.inf]
    limits = f", and torque limits of {listed(unlimited, MAX_FAULTY)}" if unlimited else ""
    raise InvalidInput(
        f"{leg.name} has no drives: a motion needs the rotor inertias of "
        f"{listed(names, MAX_FAULTY)}{limits}; give them (Leg.with_drives, --drives FILE), "
        "or drives=False (--drives none) for joints without rotors"
    )


def checked_objective(
    name: str | None, *, limits: bool | str = True, motion: bool = False
) -> KickObjective:
    """Return the objective of a plan; raise `InvalidInput` for one that does not fit."""
    default = KickObjective.TORQUE_SQUARED if motion else KickObjective.JOINT_SPEED
    objective = default if name is None else validation.choice("objective", name, KickObjective)
    if motion != (objective == KickObjective.TORQUE_SQUARED):
        raise InvalidInput(
            f"objective is {objective}: a motion (motion=True, --motion) has the objective "
            f"{KickObjective.TORQUE_SQUARED}, which is for motions only"
        )
    if limits not in (True, False, MUSCLES):
        shown = validation.brief(limits)
        raise InvalidInput(f"limits is {shown}: it must be True, False or {MUSCLES!r}")
    if motion and not limits:
        raise InvalidInput("limits is False: a motion is planned within limits")
    return objective


def checked_contact(contact: Contact | None) -> Contact:
    """Return the contact of a plan, or the default; raise `InvalidInput` for one with a normal."""
    if contact is None:
        return Contact(restitution=0.8, friction=0.4)
    if contact.normal is not None:
        raise InvalidInput(
            f"the contact has the normal {contact.normal.tolist()}: plan_kick computes the normal, "
            "so give a contact without one, Contact(restitution=..., friction=...)"
        )
    return contact


@dataclass(frozen=True)
class KickSettings:
    """The arguments of `plan_kick` or `plan_trap` but for the place and motion of the ball."""

    leg: Leg
    goal: Goal | BallState
    ball: Ball
    air: Air | None
    contact: Contact
    objective: KickObjective = KickObjective.JOINT_SPEED
    limits: bool | str = True
    surface: str | Surface | None = None

    @cached_property
    def reach(self) -> Reach:
        """The points at which the foot can be, roughly."""
        return reach_of(self.leg, self.ball)

    def spin_after(self, goal: Goal | BallState, velocity: Array, before: BallState) -> Array:
        """Return the spin nearest to a goal's that a ball with a velocity after the kick can have.

        Where the goal names a spin, it may need more friction than there is.
        """
        base, limited = self.leg.base_velocity, not goal.spin.any()
        if self.contact.friction == 0.0 and limited:
            return before.spin
        task = velocity, goal.spin, self.ball, self.contact, before
        if self.reach.across is not None:
            return planar_spin(*task, np.zeros(3) if base is None else base[:3], limited=limited)
        return struck_spin(*task, limited=limited)


def launch_for(
    settings: KickSettings, goal: Goal, before: BallState, near: Launch | None = None
) -> Launch | Pass:
    """Return the launch that meets a goal, of a ball that moves as `before`.

    In the air, it keeps the spin along the impulse.
    """
    s = settings
    if s.contact.friction == 0.0 and before.spin.any() and not goal.spin.any():
        goal = replace(goal, spin=before.spin)
    if s.surface is not None:
        launch = plan_pass(goal, s.ball, s.air, surface=s.surface)
        if launch.limit is not None:
            raise OutOfReach(f"the pass is out of reach: {launch.summary}", launch.limit, launch)
        along = abs(float(goal.spin @ launch.velocity)) / launch.speed
        if along > 1e-9 * math.hypot(*goal.spin) and not before.velocity.any():
            raise InvalidInput(
                f"spin has {along:g} rad/s along the pass: a ball at rest takes spin across its "
                "launch only"
            )
        return launch
    flight = plan_launch(goal, s.ball, s.air, struck=before, near=near)
    if flight.limit is not None:
        raise OutOfReach(f"the goal is {flight.summary}", flight.limit, flight)
    return flight


def _with_spin_after(
    settings: KickSettings, goal: Goal, launch: Launch | Pass, before: BallState,
    near: Launch | None,
) -> Launch | Pass:  # fmt: skip
    """Return the launch that meets a goal with the spin that the foot gives it, by iteration."""
    for _ in range(MOST_LAUNCHES):
        spin = settings.spin_after(goal, launch.velocity, before)
        size = math.hypot(*spin, *before.spin)
        if math.dist(spin, launch.spin) <= SAME_SPIN * size:
            return launch
        launch = launch_for(settings, replace(goal, spin=spin), before, near)
    raise InvalidInput(
        f"no launch was found that has the spin which the foot gives a ball of {before.speed:.3g} "
        "m/s; without friction (friction=0, --friction 0) the spin stays"
    )


@dataclass(frozen=True, eq=False)
class ImpactTask:
    """What the foot must do to a ball at rest, or to one that is met at a time."""

    settings: KickSettings  # of the kick
    # seen from where the ball is struck; of a trap, the motion that is wished
    goal: Goal | BallState
    # that meets the goal; of a trap, the motion that the ball can get
    launch: Launch | Pass | BallState
    target: ImpactTarget  # impulse and contact, with the ball just before
    # position or height of the ball's centre [m, world frame]; None is free
    place: float | Array | None
    incoming: IncomingBall | None = None  # the ball as it was seen; None of a ball at rest

    @classmethod
    def make(
        cls,
        settings: KickSettings,
        goal: Goal | BallState,
        before: BallState,
        place: float | Array | None,
        incoming: IncomingBall | None = None,
        near: Launch | None = None,
    ) -> "ImpactTask":
        """Return the task of a kick; `near` is a launch near the one that meets the goal."""
        s = settings
        launch: Launch | Pass | BallState
        if isinstance(goal, BallState):
            spin = s.spin_after(goal, goal.velocity, before)
            launch = BallState(before.position, goal.velocity, spin, before.time)
        else:
            launch = launch_for(s, goal, before, near)
            moves = s.leg.base_velocity is not None or before.velocity.any() or before.spin.any()
            is_free = not goal.spin.any() or s.reach.across is None
            if moves and is_free and goal.beside is None:
                launch = _with_spin_after(s, goal, launch, before, near)
            goal = goal.at(launch.time)
        target = impact_target_for(launch.velocity, launch.spin, s.ball, s.contact, before)
        return cls(s, goal, launch, target, place, incoming)

    @property
    def before(self) -> BallState:
        """The ball just before the contact, by the clock of `incoming`."""
        return self.target.before

    @property
    def ahead(self) -> Array:
        """Horizontal unit vector along which a leg that is turned faces, shape `(3,)`."""
        x, y, _ = self.target.facing.tolist()
        return np.array([x, y, 0.0]) / (math.hypot(x, y) or 1.0)

    def problem(self, like: KickProblem | None = None) -> KickProblem:
        """Return the problem of the kick, made from one of the same leg."""
        s = self.settings
        return kick_problem(s.leg, self.target, self.place, limits=s.limits, like=like)

    def exactly(self, problem: KickProblem, point: KickPoint) -> KickPoint:
        """Return a point near one, with the position and velocity of the foot exact."""
        position, velocity = problem.find(BallPosition), problem.find(StrikeVelocity)
        assert velocity is not None
        if position is not None:
            point = place_exactly(position, point)
        return velocity.make_exact(point)

    def kick(self, problem: KickProblem, point: KickPoint) -> "SolvedKick":
        """Return the kick of a solution of the problem."""
        point = self.exactly(problem, point)
        chosen = outcome_of(problem, point, OBJECTIVES[self.settings.objective])
        impact, meeting = self.strike(chosen), None
        if self.incoming is not None:
            meeting = Meeting(
                self.before, self.incoming, self.goal, self.settings.air, impact, point.share,
                chosen[2]["speed_use"],
            )  # fmt: skip
        return SolvedKick(self, problem, point, chosen, impact, meeting)

    def strike(self, chosen: Chosen) -> Impact:
        """Return the impact of a state of the robot."""
        posture, v, _ = chosen
        return strike(
            posture, v, self.target.ball, self.target.contact,
            ball_velocity=self.before.velocity, ball_spin=self.before.spin,
        )  # fmt: skip

    def plan(
        self, problem: KickProblem, chosen: Chosen, impact: Impact, meeting: Meeting | None = None
    ) -> KickPlan:
        """Return the plan of a state of the robot, with the path of the ball."""
        s, outcome = self.settings, chosen[2]
        if isinstance(self.launch, BallState):
            assert self.incoming is not None
            path: Flight | Course = follow(
                impact.ball_after, s.ball, s.air, self.incoming.ground, time_limit=LONGEST_COURSE
            )
        else:
            assert isinstance(self.goal, Goal)
            time = self.launch.time if outcome["share"] == 1.0 else None
            level = math.inf if meeting is None else meeting.ground.height
            path = path_to_target(impact, self.goal, s.air, s.surface, time, level)
        return KickPlan(
            goal=self.goal,
            launch=self.launch,
            objective=s.objective,
            impact_target=self.target,
            impact=impact,
            path=path,
            ball_place=self.place,
            heading=problem.heading,
            moved=problem.moved,
            meeting=meeting,
            meetings=() if meeting is None else (meeting,),
            **outcome,
        )


@dataclass(frozen=True, eq=False)
class SolvedKick:
    """A solution of the problem of a kick, before the ball's path is computed."""

    task: ImpactTask
    problem: KickProblem
    point: KickPoint
    chosen: Chosen
    impact: Impact
    meeting: Meeting | None

    @property
    def rank(self) -> tuple[float, float]:
        """Less for a better kick."""
        return -self.point.share, self.chosen[2]["speed_use"]

    @property
    def objective(self) -> Objective:
        """What makes the kick best: the share of the launch, if that is not reached in full."""
        return STRONGEST if self.point.share < 1.0 else OBJECTIVES[self.task.settings.objective]

    def polished(self) -> "SolvedKick":
        """Return the kick with its solution refined to rounding."""
        return self.task.kick(self.problem, self.problem.polish(self.objective, self.point))

    def plan(self) -> KickPlan:
        """Return the plan, with the path of the ball."""
        return self.task.plan(self.problem, self.chosen, self.impact, self.meeting)


def outcome_of(problem: KickProblem, point: KickPoint, objective: Objective) -> Chosen:
    """Return the state at the impact of a solution."""
    q, v = problem.on_robot(point)
    balance = problem.find(Balance)
    torque = problem.find(KickTorqueLimit) or KickTorqueLimit(problem.variables)
    outcome = {
        "share": point.share,
        "value": objective.quantity(point),
        "speed_use": float(KickSpeedLimit(problem.variables).use(point).max()),
        "torque_use": float(torque.use(point).max()),
        "muscles": isinstance(torque, KickMuscleTorqueLimit),
        "binding": tuple(name for term in problem.terms for name in term.binding(point)),
        "balance": None if balance is None else balance.distance(point.posture),
    }
    return problem.robot.posture(q), v, outcome


def path_to_target(
    impact: Impact,
    goal: Goal,
    air: Air | None,
    surface: str | Surface | None,
    time: float | None = None,
    level: float = math.inf,
) -> Flight | Course:
    """Return the flight of a ball, or with a surface its course, to the plane of the target.

    A flight ends on the ground at the height `level` [m, world frame], see `fly_to_target`.
    """
    if surface is None:
        return fly_to_target(impact.ball_after, goal, impact.ball, air, time, level)
    start, radius = impact.ball_after, impact.ball.radius
    ground = Ground(float(start.position[2]) - radius, surface)
    plane = Plane(start.position + goal.target, -goal.ahead, "centre")
    return follow(start, impact.ball, air, ground, plane=plane)
