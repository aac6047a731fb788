"""Planning a kick: from a goal back to the posture and the joint velocity that meet it."""

import math
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin
from threadpoolctl import threadpool_limits

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground, Surface
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import ImpactTarget, impact_target_for
from kickdyn.motion.motion import Motion
from kickdyn.plane import Plane
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import (
    CANDIDATES,
    TRIED,
    IncomingBall,
    Meeting,
    reach_of,
    state_at,
    waits_in_plane,
    waits_in_reach,
)
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_problem import KickProblem, best_from, kick_problem, solve_kick
from kickdyn.planning.kick_terms import (
    BallPosition,
    Facing,
    KickPoint,
    Objective,
    SpeedLimit,
    StrikeVelocity,
    TorqueLimit,
    place_exactly,
)
from kickdyn.planning.launch import Launch, OutOfReach, fly_to_target, plan_launch
from kickdyn.planning.objectives import OBJECTIVES, KickObjective
from kickdyn.planning.passes import Pass, plan_pass
from kickdyn.planning.stance import Balance
from kickdyn.robot.collisions import disabled_pairs
from kickdyn.robot.kicking_chain import with_angles
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.standing import is_floating
from kickdyn.robot.surgery import turn_body

FARTHEST_BALL = 1e9
"""Farthest that a ball may lie from the world's origin, along each axis [m]."""


@validation.check_arguments
def plan_kick(
    leg: Leg,
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    objective: str | None = None,
    contact: Contact | None = None,
    ball_position: ArrayLike | None = None,
    incoming: BallState | IncomingBall | None = None,
    limits: bool = True,
    surface: str | Surface | None = None,
    motion: bool = False,
    solver: str = "slsqp",
) -> KickPlan:
    r"""Find posture and joint velocity that strike a ball at rest so that it meets a goal.

    The launch :math:`(v_b, \omega_b)`, the impulse :math:`p = m v_b`, the normal and the foot
    velocity follow from each other in closed form. A nonlinear program then chooses posture and
    joint velocity by the objective, bodies of the robot out of the ball and out of each other, and
    `strike` and `fly` verify the plan.

    Args:
        leg: a leg on a fixed base, without supports or loops, and without mimic joints in the
            kicking limb; one whose foot moves in a plane, as ours do, is turned about the vertical
            towards the launch, by the plan's `heading`. Or a robot on a floating base that stands
            on one flat support, see below, without loops and mimic joints. The plan's q has one
            angle for each continuous joint.
        goal: the goal, seen from where the ball lies. The component of its spin along the launch is
            left out, because a ball at rest takes spin across it only.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum.
        objective: a `KickObjective`; None is `joint-speed`, or `torque-squared` with a motion, for
            which there is no other.
        contact: restitution, friction and offset of the contact, without a normal. With None, the
            restitution is 0.8 as in the paper's Table 2 and the friction 0.4. Where the restitution
            depends on the speed of approach u, u (1 + e) must increase with u; without friction,
            the ball gets no spin and the foot is free across the normal.
        ball_position: height of the ball's centre [m, world frame], or its position, shape `(3,)`,
            which leaves only the self-motion of a redundant leg free. With None both are free; the
            command `kickdyn plan` lays the ball at the foot of the straight leg, at a height of
            -0.7042 for `Leg.human()`.
        incoming: a ball that moves, with `position`, in place of `ball_position`; an `IncomingBall`
            names its ground, or the time or place of the meeting. The goal is seen from its
            position. See below.
        limits: whether limits of speed and torque hold; limits of the joints' range always do. An
            infinite one always holds, its use is 0, and `joint-speed` counts it as 100 rad/s; one
            of 0 is refused, or none with `limits=False`.
        surface: surface of the ground, for a ball that is played along the ground as by
            `plan_pass`; the goal is then a time and a target at the height of the ball.
        motion: whether to plan the whole motion: from rest to the impact, and to rest again. It
            chooses posture and joint velocity at the impact, too, and needs torque limits of all
            joints that move, and `pip install "kickdyn[motion]"`. See below.
        solver: name of the solver of the nonlinear program, `slsqp`; a motion has its own, Ipopt.

    A robot that stands on one foot kicks a ball that lies on the same ground, the plane z = 0. The
    foot lies on it as it does while all joints are at 0 and the base is upright; without a `sole`
    of the `Support`, its sole is what the shapes of the file have within 2 mm of the ground. At the
    impact, the centre of mass is above the sole, the kicking foot above the ground, the trunk
    (the body of the floating base) at most 30 degrees from upright, and, where there is such a
    posture, the ground can supply the support's impulse: `impact.footing` says whether.

    With `motion=True`, `plan.motion` is the motion of the whole robot: splines that minimize the
    squared torque, at the same time as the impact that they contain. It keeps ranges, speeds and
    torques of the joints, and bodies apart from each other and, before the impact, out of the ball
    (5 mm inside count as touching); on one foot also the trunk's tilt, the kicking foot above the
    ground and beside the other foot, and, for the force of the ground and for its impulse in the
    impact, the centre of pressure in the sole (for the force, 3 mm from its edge), friction (0.7
    where the `Support` names none) and the moment about the vertical. All limits are checked
    between the solver's points, at ten times as many times. `status` is `met` only if all hold;
    `warnings` names those that do not, with when and by how much. Where the whole launch cannot be
    reached, `share` is what can.

    With `incoming`, the ball's path is followed to where the leg reaches it, and kicks are planned
    for several times on it; `plan.meeting` is the one of the least `speed_use`, and `plan.meetings`
    has all. A base that moves is in its place at the time of the meeting. Where the goal names no
    other spin, the kick stops the ball's spin; without friction, the spin stays.

    Raises:
        OutOfReach: a goal that no launch meets, with the nearest there is.
        InvalidInput: a leg that cannot kick in that direction or whose postures cannot reach the
            ball; a spin for which friction is too low; an unknown objective; a leg with loops,
            which tie joints together that a plan chooses one by one; a robot that cannot stand at
            rest within its limits with `motion=True`; a leg with stiff joints, whose effective mass
            the plan does not know (`strike`, `collide` and sweeps know both).

    Example:
        >>> import kickdyn as kd
        >>> plan = kd.plan_kick(kd.Leg.human(), kd.Goal(20, time=1.2), kd.Ball(), kd.Air())
        >>> str(plan.status), round(plan.impact.ball_after.speed, 1)
        ('met', 19.6)
    """
    leg = with_angles(leg)
    if leg.stiff_joints:
        raise InvalidInput(
            f"{leg.name} has stiff joints ({', '.join(leg.stiff_joints)}): kicks are planned for "
            "legs whose joints are free (Leg.with_stiff_joints() without names frees them)"
        )
    objective = _checked_objective(objective, limits=limits, motion=motion)
    contact, position = _checked_contact(contact), _checked_ball_position(ball_position)
    if is_floating(leg):
        position = _lying_on_ground(position, ball)
    if motion:
        leg.check_base_at_rest("a motion from rest to rest")
    if incoming is not None:
        if motion or ball_position is not None:
            other = "motion=True" if motion else "ball_position"
            raise InvalidInput(f"incoming and {other} exclude each other: give one of them")
        come = incoming if isinstance(incoming, IncomingBall) else IncomingBall(incoming)
        settings = _Settings(goal, ball, air, contact, objective, limits, surface, solver)
        return _plan_interception(leg, come, settings)
    disabled_pairs(leg)  # a faulty SRDF is refused now, not by the checks of the finished plan

    # several threads sum in another order, which moves postures by up to 2e-5 rad, and take 5 times
    # as long for matrices of 100 rows
    with threadpool_limits(1, "blas"):
        launch: Launch | Pass
        if surface is None:
            launch = _plan_flight_launch(goal, ball, air, contact)
        else:
            launch = _plan_pass_launch(goal, ball, air, surface)
        goal = goal.at(launch.time)
        target = impact_target_for(launch.velocity, launch.spin, ball, contact)
        problem = kick_problem(leg, target, position, limits=limits, solver=solver)
        if motion:
            posture, v, outcome = _plan_motion(problem)
        else:
            posture, v, outcome = _plan_posture(problem, OBJECTIVES[objective]())
        impact = strike(posture, v, ball, target.contact)
        time = launch.time if outcome["share"] == 1.0 else None
        path = _path_to_target(impact, goal, air, surface, time)
    return KickPlan(
        goal=goal,
        launch=launch,
        objective=objective,
        impact_target=target,
        impact=impact,
        path=path,
        ball_is_placed=position is not None,
        heading=problem.heading,
        **outcome,
    )


@dataclass(frozen=True)
class _Settings:
    """The arguments of `plan_kick` for a ball that moves."""

    goal: Goal
    ball: Ball
    air: Air | None
    contact: Contact
    objective: KickObjective
    limits: bool
    surface: str | Surface | None
    solver: str


@dataclass(frozen=True)
class _Interception:
    """A ball that is met at a time, and what the foot must do to it."""

    leg: Leg
    settings: _Settings
    incoming: IncomingBall
    before: BallState
    goal: Goal
    launch: Launch | Pass
    target: ImpactTarget

    def problem(self) -> KickProblem:
        """Return the problem of the kick."""
        s = self.settings
        return kick_problem(
            self.leg, self.target, self.before.position, limits=s.limits, solver=s.solver
        )

    @property
    def aside(self) -> Array:
        """Horizontal unit vector across the impulse, to its left, shape `(3,)`."""
        x, y, _ = self.target.impulse.tolist()
        return np.array([-y, x, 0.0]) / (math.hypot(x, y) or 1.0)

    def plan(self, problem: KickProblem, point: KickPoint) -> KickPlan:
        """Return the plan of a solution, and its meeting."""
        s, position = self.settings, problem.find(BallPosition)
        strike_velocity = problem.find(StrikeVelocity)
        if position is not None and strike_velocity is not None:
            point = strike_velocity.make_exact(place_exactly(position, point))
        posture, v, outcome = _outcome(problem, point, OBJECTIVES[s.objective]())
        before = self.before
        impact = strike(
            posture, v, s.ball, self.target.contact,
            ball_velocity=before.velocity, ball_spin=before.spin,
        )  # fmt: skip
        time = self.launch.time if outcome["share"] == 1.0 else None
        meeting = Meeting(
            before, self.incoming, self.goal, s.air, impact, point.share, outcome["speed_use"]
        )
        return KickPlan(
            goal=self.goal,
            launch=self.launch,
            objective=s.objective,
            impact_target=self.target,
            impact=impact,
            path=_path_to_target(impact, self.goal, s.air, s.surface, time),
            ball_is_placed=True,
            heading=problem.heading,
            meeting=meeting,
            meetings=(meeting,),
            _again=partial(_replan, self.leg, s, point.x),
            **outcome,
        )


def _intercept(
    leg: Leg, settings: _Settings, incoming: IncomingBall, course: Course, wait: float
) -> _Interception:
    """Return what a kick takes that meets a ball some time after it was seen."""
    s, before = settings, state_at(incoming, course, wait)
    goal = s.goal.seen_from(before.position - incoming.state.position, wait)
    launch: Launch | Pass
    if s.surface is None:
        launch = _plan_flight_launch(goal, s.ball, s.air, s.contact, before)
    else:
        assert incoming.ground is not None
        above = float(before.position[2]) - s.ball.radius - incoming.ground.height
        if abs(above) > 1e-3:
            raise InvalidInput(
                f"the ball is {above:.3g} m above the ground where it is met: a pass along the "
                "ground is for a ball that rolls"
            )
        launch = _plan_pass_launch(goal, s.ball, s.air, s.surface)
    goal = goal.at(launch.time)
    target = impact_target_for(launch.velocity, launch.spin, s.ball, s.contact, before)
    return _Interception(leg, s, incoming, before, goal, launch, target)


def _plan_interception(leg: Leg, incoming: IncomingBall, settings: _Settings) -> KickPlan:
    """Return the plan of the meeting of least speed use, with all that were considered."""
    s, objective = settings, OBJECTIVES[settings.objective]()
    incoming = incoming.on_ground_of(leg, s.ball)
    with threadpool_limits(1, "blas"):
        course, reach = incoming.course(s.ball, s.air), reach_of(leg, s.ball)
        waits = waits_in_reach(incoming, course, reach)

        def aside(wait: float) -> float:
            try:
                met = _intercept(leg, s, incoming, course, wait)
            except InvalidInput:
                return math.nan
            return float(met.aside @ met.before.position) - reach.beside

        if reach.across is not None:
            waits = waits_in_plane(waits, aside)
        rated: list[tuple[float, float, KickProblem, _Interception]] = []
        reasons: dict[float, str] = {}
        for wait in waits.tolist():
            try:
                task = _intercept(leg, s, incoming, course, wait)
                problem = task.problem()
            except InvalidInput as error:
                reasons[wait] = str(error)
                continue
            rated.append((problem.rated()[0][0], wait, problem, task))
        met: dict[float, KickPlan] = {}
        near: Array | None = None
        rated.sort(key=lambda entry: entry[:2])
        for _, wait, problem, task in rated[:TRIED]:
            starts = problem.starts() if near is None else [near]
            point = best_from(problem, objective, starts)
            reasons[wait] = "no posture near the other meetings gives this launch"
            if point is not None:
                met[wait], near = task.plan(problem, point), point.x
        for _, wait, _, _ in rated[TRIED:]:
            reasons[wait] = "postures are farther from the ball, or faster, than for other meetings"
        for _, wait, problem, task in rated[:2]:
            if not met:
                try:
                    met[wait] = task.plan(*solve_kick(problem, objective))
                except InvalidInput as error:
                    reasons[wait] = str(error)
        if not met:
            first = rated[0][1] if rated else float(waits[0])
            raise InvalidInput(
                f"the ball is met at none of {len(waits)} times within reach: after {first:.3g} s, "
                f"{reasons[first]}"
            )
        best = min(met, key=lambda wait: (-met[wait].share, met[wait].speed_use))
        for wait in _between(best, waits):
            try:
                task = _intercept(leg, s, incoming, course, wait)
                problem = task.problem()
            except InvalidInput:
                continue
            point = None if near is None else best_from(problem, objective, [near])
            if point is not None:
                met[wait] = task.plan(problem, point)
    meetings = [
        plan.meeting for plan in met.values() if plan.meeting is not None
    ] + [
        Meeting(state_at(incoming, course, wait), incoming, s.goal, s.air, reason=reason)
        for wait, reason in reasons.items() if wait not in met
    ]  # fmt: skip
    chosen = min(met.values(), key=lambda plan: (-plan.share, plan.speed_use))
    return replace(chosen, meetings=tuple(sorted(meetings, key=lambda meeting: meeting.time)))


def _between(best: float, waits: Array) -> list[float]:
    """Return the times in the middle between the best one and its neighbours, if there are many."""
    if len(waits) < CANDIDATES:
        return []
    step = float(waits[1] - waits[0])
    return [best - 0.5 * step, best + 0.5 * step]


def _replan(
    leg: Leg, settings: _Settings, near: Array, plan: KickPlan, incoming: IncomingBall
) -> KickPlan:
    """Return the plan of a ball that is seen again, from the unknowns of the last plan."""
    assert isinstance(incoming.meet_at, float)
    wait = incoming.meet_at - float(incoming.state.time)
    with threadpool_limits(1, "blas"):
        try:
            course = incoming.course(settings.ball, settings.air)
            task = _intercept(leg, settings, incoming, course, min(wait, course.duration))
            problem = task.problem()
            point = best_from(problem, OBJECTIVES[settings.objective](), [near])
        except InvalidInput:
            point = None
        if point is not None:
            return task.plan(problem, point)
    return _plan_interception(leg, incoming, settings)


_Chosen = tuple[Posture, Array, dict[str, Any]]
"""The robot's posture and joint velocity at the impact, and further attributes of `KickPlan`."""


def _plan_posture(problem: KickProblem, objective: Objective) -> _Chosen:
    """Return the state at the impact that is best by an objective."""
    return _outcome(*solve_kick(problem, objective), objective)


def _outcome(problem: KickProblem, point: KickPoint, objective: Objective) -> _Chosen:
    """Return the state at the impact of a solution."""
    q, v = problem.on_robot(point)
    balance = problem.find(Balance)
    outcome = {
        "share": point.share,
        "value": objective.quantity(point),
        "speed_use": float(SpeedLimit(problem.variables).use(point).max()),
        "torque_use": float(TorqueLimit(problem.variables).use(point).max()),
        "binding": tuple(name for term in problem.terms for name in term.binding(point)),
        "balance": None if balance is None else balance.distance(point.posture),
    }
    return problem.robot.posture(q), v, outcome


def replan_motion(plan: KickPlan, velocity: ArrayLike) -> KickPlan:
    """Return a plan with a motion near another one, whose `strike` gives another launch.

    It serves to correct a launch by what a contact that takes time, or a simulator, makes of it.

    Args:
        plan: with a motion.
        velocity: of the ball after `strike`, shape `(3,)` [m/s, world frame].

    Raises:
        InvalidInput: a plan without a motion.
    """
    if plan.motion is None:
        raise InvalidInput("the plan has no motion: plan it with motion=True")
    wished = validation.vector("velocity", velocity, 3, unit="m/s")
    ball, contact = plan.impact.ball, plan.impact_target.contact
    leg, after = plan.leg, plan.impact.ball_after
    position = None
    if plan.ball_is_placed:
        position = ball.radius if is_floating(leg) else plan.impact.ball_before.position
    with threadpool_limits(1, "blas"):
        target = impact_target_for(wished, after.spin, ball, contact)
        problem = kick_problem(leg, target, position)
        posture, v, outcome = _plan_motion(problem, plan.motion)
        impact = strike(posture, v, ball, target.contact)
        path = _path_like(plan, impact)
    return replace(plan, impact_target=target, impact=impact, path=path, **outcome)


def turn_plan(plan: KickPlan, angle: float) -> KickPlan:
    """Return a plan whose standing robot, with its motion, is turned about the ball.

    The launch turns with the robot, and nothing else changes: gravity and the ground are the same
    in all directions.

    Args:
        plan: with a motion of a robot on a floating base.
        angle: to the left, about the vertical through the ball [rad].
    """
    assert plan.motion is not None
    rotation, centre = pin.rpy.rpyToMatrix(0.0, 0.0, angle), plan.impact.ball_before.position
    turn = pin.SE3(rotation, centre - rotation @ centre)
    robot = plan.motion.robot
    robot = robot.with_model(turn_body(robot.model, 0, rotation, centre))
    motion = replace(plan.motion, robot=robot, placement=turn * plan.motion.placement)
    target = plan.impact_target
    contact = replace(target.contact, normal=rotation @ target.contact.normal)
    target = replace(target, impulse=rotation @ target.impulse, contact=contact)
    impact = strike(robot.posture(plan.q), plan.v, target.ball, contact)
    return replace(
        plan,
        impact_target=target,
        impact=impact,
        path=_path_like(plan, impact),
        heading=plan.heading + angle,
        motion=motion,
    )


def _path_like(plan: KickPlan, impact: Impact) -> Flight | Course:
    """Return the path of the ball after another impact of a plan's kick."""
    flight, surface = plan.path, None
    if isinstance(flight, Course):
        flight = flight.flights[0]
        assert flight.ground is not None  # the one that the course was followed on
        surface = flight.ground.surface
    return _path_to_target(impact, plan.goal, flight.air, surface)


def _path_to_target(
    impact: Impact,
    goal: Goal,
    air: Air | None,
    surface: str | Surface | None,
    time: float | None = None,
) -> Flight | Course:
    """Return the flight of a ball, or with a surface its course, to the plane of the target."""
    if surface is None:
        return fly_to_target(impact.ball_after, goal, impact.ball, air, time)
    start, radius = impact.ball_after, impact.ball.radius
    ground = Ground(float(start.position[2]) - radius, surface)
    plane = Plane(start.position + goal.target, -goal.ahead, "centre")
    return follow(start, impact.ball, air, ground, plane=plane)


def _plan_motion(problem: KickProblem, near: Motion | None = None) -> _Chosen:
    """Return the state at the impact that a motion from rest to rest contains."""
    if find_spec("casadi") is None:
        raise InvalidInput(
            'motions need the package casadi: install it with pip install "kickdyn[motion]"'
        )
    from kickdyn.motion.motion_problem import KickTask  # it imports CasADi
    from kickdyn.motion.plan_motion import plan_motion

    standing, none = problem.standing, np.zeros((0, 3))
    ball, facing = problem.find(BallPosition), problem.find(Facing)
    leg = problem.limb.leg if standing is None else standing.leg
    task = KickTask(
        problem.robot,
        leg,
        problem.variables.target,
        problem.foot_directions,
        none if ball is None else ball.rows,
        np.zeros(3) if ball is None else ball.centre,
        none if facing is None else facing.axes,
        standing,
    )
    planned = plan_motion(task, near)
    posture = problem.robot.posture(planned.motion.q(0.0))
    outcome = {
        "share": planned.share,
        "value": planned.torque_squared,
        "speed_use": planned.speed_use,
        "torque_use": planned.torque_use,
        "binding": planned.binding,
        "balance": None if standing is None else Balance(standing).distance(posture),
        "motion": planned.motion,
    }
    return posture, planned.motion.v(0.0), outcome


def _lying_on_ground(position: float | Array | None, ball: Ball) -> float | Array:
    height = ball.radius if position is None else np.atleast_1d(position)[-1]
    if abs(height - ball.radius) > 1e-9:
        raise InvalidInput(
            f"the ball's centre is at a height of {height:g} m: a standing robot kicks a ball that "
            f"lies on its ground, at {ball.radius:g} m"
        )
    return ball.radius if position is None else position


def _checked_objective(name: str | None, *, limits: bool, motion: bool) -> KickObjective:
    default = KickObjective.TORQUE_SQUARED if motion else KickObjective.JOINT_SPEED
    objective = default if name is None else validation.choice("objective", name, KickObjective)
    if motion != (objective == KickObjective.TORQUE_SQUARED):
        raise InvalidInput(
            f"objective is {objective}: a motion (motion=True, --motion) has the objective "
            f"{KickObjective.TORQUE_SQUARED}, and nothing else has"
        )
    if motion and not limits:
        raise InvalidInput("limits is False: a motion is planned within limits")
    return objective


def _checked_ball_position(position: ArrayLike | None) -> float | Array | None:
    if position is None:
        return None
    place = validation.floats("ball_position", position, unit="m")
    if place.shape not in ((), (3,)):
        raise InvalidInput(f"ball_position has shape {place.shape}: it must be a height or (3,)")
    if np.abs(place).max() > FARTHEST_BALL:
        raise InvalidInput(
            f"ball_position is {place.tolist()} m: it must be within {FARTHEST_BALL:g} m"
        )
    return place if place.shape else float(place)


def _checked_contact(contact: Contact | None) -> Contact:
    if contact is None:
        return Contact(restitution=0.8, friction=0.4)
    if contact.normal is not None:
        raise InvalidInput(
            f"the contact has the normal {contact.normal.tolist()}: plan_kick computes the normal, "
            "so give a contact without one, Contact(restitution=..., friction=...)"
        )
    return contact


def _plan_flight_launch(
    goal: Goal, ball: Ball, air: Air | None, contact: Contact, before: BallState | None = None
) -> Launch:
    """Return the launch into the air, with the spin along the impulse that the ball has before."""
    before = BallState() if before is None else before
    across = goal
    if contact.friction == 0.0 and before.spin.any():
        across = replace(goal, spin=before.spin)
    for _ in range(30):
        launch = plan_launch(across, ball, air)
        if launch.limit is not None:
            raise OutOfReach(f"the goal is {launch.summary}", launch.limit, launch)
        change = launch.velocity - before.velocity
        direction = change / (math.hypot(*change) or 1.0)
        along = float((launch.spin - before.spin) @ direction)
        if abs(along) <= 1e-12 * max(math.hypot(*launch.spin, *before.spin), 1e-300):
            return launch
        across = replace(goal, spin=launch.spin - along * direction)
    return launch


def _plan_pass_launch(goal: Goal, ball: Ball, air: Air | None, surface: str | Surface) -> Pass:
    launch = plan_pass(goal, ball, air, surface=surface)
    if launch.limit is not None:
        raise OutOfReach(f"the pass is out of reach: {launch.summary}", launch.limit, launch)
    along = abs(float(goal.spin @ launch.velocity)) / launch.speed
    if along > 1e-9 * math.hypot(*goal.spin):
        raise InvalidInput(
            f"spin has {along:g} rad/s along the pass: a ball at rest takes spin across its launch "
            "only"
        )
    return launch
