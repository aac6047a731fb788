"""Planning a kick: from a goal back to the posture and the joint velocity that meet it."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.ground import Surface
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_record import RecordedMotion
from kickdyn.planning.goal import Goal
from kickdyn.planning.interception import IncomingBall
from kickdyn.planning.kick_limits import Balance, KickMuscleTorqueLimit
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_problem import MUSCLES, KickProblem, kick_problem, solve_kick
from kickdyn.planning.kick_steps import (
    Chosen,
    ImpactTask,
    KickSettings,
    check_has_drives,
    checked_contact,
    checked_leg,
    checked_objective,
    one_thread,
    path_to_target,
)
from kickdyn.planning.kick_terms import OBJECTIVES, BallPosition, Facing
from kickdyn.planning.moving_kick import plan_interception
from kickdyn.robot.collisions import disabled_pairs
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import is_floating
from kickdyn.robot.surgery import turn_body

if TYPE_CHECKING:
    from kickdyn.motion.kick_task import KickTask

FARTHEST_BALL = 1e9
"""Farthest that a ball may lie from the world's origin, along each axis [m]."""

ON_GROUND = 1e-6
"""Difference of a ball's height from its radius up to which it lies on the ground [m]."""

BOTH_FEET = "both-feet"
"""Motion that starts and ends on both feet."""


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
    limits: bool | str = True,
    surface: str | Surface | None = None,
    motion: Any = False,
) -> KickPlan:
    r"""Find posture and joint velocity that strike a ball at rest so that it meets a goal.

    The launch :math:`(v_b, \omega_b)`, the impulse :math:`p = m v_b`, the normal and the foot
    velocity follow from each other in closed form. A nonlinear program then chooses posture and
    joint velocity by the objective, bodies of the robot out of the ball and out of each other, and
    `strike` and `fly` verify the plan.

    Args:
        leg: a leg on a fixed base, without supports or loops, and without mimic joints in the
            kicking limb; one whose foot moves in a plane, as ours do, is turned about the vertical
            towards the launch, by the plan's `heading`, and moved to a given `ball_position` beside
            its plane, by `moved`. Or a robot on a floating base that stands
            on one flat support, see below, without loops and mimic joints. The plan's q has one
            angle for each continuous joint.
        goal: the goal, seen from where the ball lies. The component of its spin along the launch is
            left out, because a ball at rest takes spin across it only.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum.
        objective: a `KickObjective`; None is `joint-speed`, or `torque-squared`, the only one with
            a motion.
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
            position.
        limits: whether limits of speed and torque hold; limits of the joints' range always do. A
            joint without a limit of speed has the largest of the other joints, or, where none has
            one, none, and `joint-speed` counts it as 100 rad/s; an infinite torque always holds,
            and its use is 0; a limit of 0 is refused, or none with `limits=False`. With
            `limits="muscles"`, the largest torque falls with the speed at which the joint turns in
            its direction, as with muscles (Hill 1938): it is :math:`(1 - u) / (1 + 4 u)` of the
            limit at the share u of the speed limit.
        surface: surface of the ground, for a ball that is played along the ground as by
            `plan_pass`; the goal is then a time and a target at the height of the ball.
        motion: whether to plan the whole motion: from rest to the impact, and to rest again. It
            needs torque limits of all joints that move, and `pip install "kickdyn[motion]"`. With
            `"both-feet"`, a standing robot starts and ends at rest on both feet. A `Motion` of the
            same robot, or a `RecordedMotion` that `read_motion` has read with the time of its
            impact, is where the search starts, and the only start. From a recorded motion, a
            standing robot starts on one foot.

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
    where the `Support` names none) and the moment about the vertical. All limits are checked at ten
    times as many times as the solver's; `warnings` names those that do not hold, with when and by
    how much. Where the whole launch cannot be reached, `share` is what can.

    With `incoming`, the ball's path is followed to where the leg reaches it, and kicks are planned
    for several times on it; `plan.meeting` is the one of the least `speed_use`, and `plan.meetings`
    has all. A base that moves is in its place at the time of the meeting. Where the goal names no
    other spin, the kick stops the ball's spin as far as friction allows; without it, the spin
    stays. A leg whose foot moves in a plane is moved to the ball, by the plan's `moved`, if the
    ball does not cross this plane, or if every kick where it does is beyond the limits.

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
    leg = checked_leg(leg)
    near = motion if isinstance(motion, Motion | RecordedMotion) else None
    if near is not None:
        _check_start(near, leg)
    elif not isinstance(motion, bool | np.bool_) and not (
        isinstance(motion, str) and motion == BOTH_FEET
    ):
        shown = validation.brief(motion)
        raise InvalidInput(
            f"motion is {shown}: it must be True, False, {BOTH_FEET!r} or a motion to start from, "
            "as plan.motion"
        )
    named = checked_objective(objective, limits=limits, motion=bool(motion))
    contact, position = checked_contact(contact), _checked_ball_position(ball_position)
    settings = KickSettings(leg, goal, ball, air, contact, named, limits, surface)
    if is_floating(leg):
        position = _lying_on_ground(position, ball)
    if motion:
        leg.check_base_at_rest("a motion from rest to rest")
        check_has_drives(leg)
    if incoming is not None:
        if motion or ball_position is not None:
            other = "motion" if motion else "ball_position"
            raise InvalidInput(f"incoming and {other} exclude each other: give one of them")
        moving_ball = incoming if isinstance(incoming, IncomingBall) else IncomingBall(incoming)
        return plan_interception(moving_ball, settings)
    disabled_pairs(leg)  # a faulty SRDF is refused now, not by the checks of the finished plan
    with one_thread():
        task = ImpactTask.make(settings, goal, BallState(), position)
        problem = task.problem()
        if not motion:
            return task.kick(*solve_kick(problem, OBJECTIVES[named])).plan()
        both_feet = near.shift is not None if isinstance(near, Motion) else motion == BOTH_FEET
        chosen = _plan_motion(problem, near, both_feet=both_feet)
        try:
            return task.plan(problem, chosen, task.strike(chosen))
        except NoImpact:
            if near is None:
                raise
            raise InvalidInput(
                "no kick was found next to this motion: plan with motion=True"
            ) from None


def replan_motion(plan: KickPlan, velocity: ArrayLike, contact: Contact | None = None) -> KickPlan:
    """Return a plan with a motion near another one, whose `strike` gives another launch.

    It serves to correct a launch by what a contact that takes time, or a simulator, makes of it.
    The velocity of the ball after `strike` has the shape `(3,)` [m/s, world frame]; without a
    contact, it is the plan's.
    """
    if plan.motion is None:
        raise InvalidInput("the plan has no motion: plan it with motion=True")
    wished = validation.vector("velocity", velocity, 3, unit="m/s")
    ball, contact = plan.impact.ball, contact or plan.impact_target.contact
    leg, after = plan.leg, plan.impact.ball_after
    position = plan.ball_place
    if position is not None and not is_floating(leg):
        position = plan.impact.ball_before.position
    with one_thread():
        target = impact_target_for(wished, after.spin, ball, contact)
        problem = kick_problem(leg, target, position, limits=MUSCLES if plan.muscles else True)
        both_feet = plan.motion.shift is not None
        posture, v, outcome = _plan_motion(problem, plan.motion, both_feet=both_feet)
        impact = strike(posture, v, ball, target.contact)
        path = _path_like(plan, impact)
    return replace(plan, impact_target=target, impact=impact, path=path, **outcome)


def replan_turned(plan: KickPlan, velocity: Array, contact: Contact | None = None) -> KickPlan:
    """Return the plan of `replan_motion`, where a standing robot is turned to another azimuth."""
    if not is_floating(plan.leg):
        return replan_motion(plan, velocity, contact)
    before = plan.impact.ball_after.velocity
    turn = math.atan2(velocity[1], velocity[0]) - math.atan2(before[1], before[0])
    turn = math.remainder(turn, math.tau)
    rotation = pin.rpy.rpyToMatrix(0.0, 0.0, turn)
    return turn_plan(replan_motion(plan, rotation.T @ velocity, contact), turn)


def turn_plan(plan: KickPlan, angle: float) -> KickPlan:
    """Return a plan whose standing robot, with its motion, is turned about the ball by an angle.

    The angle is to the left, about the vertical [rad]. The launch turns with the robot, and nothing
    else changes: gravity and the ground are the same in all directions.
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
    return path_to_target(impact, plan.aim, flight.air, surface)


def _check_start(motion: Motion | RecordedMotion, leg: Leg) -> None:
    """Raise `InvalidInput` unless a motion has the joints of a leg, and a time of its impact."""
    mover = motion.robot if isinstance(motion, Motion) else motion.leg
    if mover.joint_names != leg.joint_names:
        raise InvalidInput(
            f"motion has the joints {', '.join(mover.joint_names)}: one that a motion of "
            f"{leg.name} starts from has {', '.join(leg.joint_names)}"
        )
    if isinstance(motion, RecordedMotion):
        if motion.contact is None:
            raise InvalidInput("motion has no impact: read it with its time, read_motion(contact=)")
        if not (motion.begin < motion.contact < motion.end and np.isfinite(motion.q).all()):
            raise InvalidInput(
                f"motion has its impact at {motion.contact:g} s: it must be between its begin, "
                f"{motion.begin:g} s, and its end, {motion.end:g} s, and all positions finite"
            )
        return
    if not (np.isfinite(motion.before.c).all() and np.isfinite(motion.after.c).all()):
        raise InvalidInput("motion has coefficients of splines that are not finite")
    feet = [_feet(robot) for robot in (motion.robot, leg)]
    if feet[0] != feet[1]:
        raise InvalidInput(f"motion kicks with {feet[0]}, and the robot with {feet[1]}")


def _feet(leg: Leg) -> str:
    """Return which joint carries the contact frame, and what a robot stands on, as text."""
    joint = leg.model.names[leg.contact_joint]
    stands = ", ".join(support.frame for support in leg.supports)
    return f"{joint} standing on {stands}" if stands else joint


def _plan_motion(
    problem: KickProblem, near: Motion | RecordedMotion | None = None, *, both_feet: bool
) -> Chosen:
    """Return the state at the impact that a motion from rest to rest contains."""
    validation.check_installed("casadi", "motion", "motions")
    from kickdyn.motion.limits import SpeedLimit, TorqueLimit  # these import CasADi
    from kickdyn.motion.plan_motion import plan_motion

    task = motion_task(problem, both_feet=both_feet)
    planned = plan_motion(task, near)
    motion, standing = planned.motion, problem.standing
    posture = problem.robot.posture(motion.q(0.0))
    outcome = {
        "share": planned.solution.share,
        "value": planned.torque_squared,
        "speed_use": planned.use(SpeedLimit),
        "torque_use": planned.use(TorqueLimit),
        "binding": planned.binding,
        "balance": None if standing is None else Balance(standing).distance(posture),
        "motion": motion,
        "muscles": task.muscles,
    }
    return posture, motion.v(0.0), outcome


def motion_task(problem: KickProblem, *, both_feet: bool = False) -> "KickTask":
    """Return the task of the motion that contains the impact of a problem."""
    from kickdyn.motion.kick_task import KickTask  # it imports CasADi

    standing, none = problem.standing, np.zeros((0, 3))
    if both_feet and standing is None:
        raise InvalidInput(
            f"{problem.robot.name} has no support: a motion starts on both feet with a robot on a "
            "floating base that stands on one foot (Leg.with_supports, --support)"
        )
    place, facing = problem.find(BallPosition), problem.find(Facing)
    leg = problem.limb.leg if standing is None else standing.leg
    return KickTask(
        problem.robot,
        leg,
        problem.variables.target,
        problem.foot_directions,
        none if place is None else place.rows,
        np.zeros(3) if place is None else place.centre,
        none if facing is None else facing.axes,
        standing,
        problem.find(KickMuscleTorqueLimit) is not None,
        standing.kicking_foot() if both_feet and standing is not None else None,
    )


def _lying_on_ground(position: float | Array | None, ball: Ball) -> float | Array:
    height = ball.radius if position is None else np.atleast_1d(position)[-1]
    if abs(height - ball.radius) > ON_GROUND:
        raise InvalidInput(
            f"the ball's centre is at a height of {height:g} m: a standing robot kicks a ball that "
            f"lies on its ground, at {ball.radius:g} m"
        )
    return ball.radius if position is None else position


def _checked_ball_position(position: ArrayLike | None) -> float | Array | None:
    if position is None:
        return None
    place = validation.floats("ball_position", position, unit="m")
    if place.shape not in ((), (3,)):
        raise InvalidInput(f"ball_position has shape {place.shape}: it must be a height or (3,)")
    if np.abs(place).max() > FARTHEST_BALL:
        most = f"at most {FARTHEST_BALL:g} m along each axis"
        raise InvalidInput(f"ball_position is {place.tolist()} m: {most}")
    return place if place.shape else float(place)
