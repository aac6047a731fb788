"""Planning a kick: from a goal back to the posture and the joint velocity that meet it."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground, Surface
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.plane import Plane
from kickdyn.planning.backswing import solve_with_backswing
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_problem import kick_problem, solve_kick
from kickdyn.planning.kick_terms import Objective, SpeedLimit, TorqueLimit
from kickdyn.planning.launch import Launch, OutOfReach, fly_to_target, plan_launch
from kickdyn.planning.objectives import OBJECTIVES, KickObjective, LandingScatter
from kickdyn.planning.passes import Pass, plan_pass
from kickdyn.planning.stance import Balance
from kickdyn.planning.swing_phase import check_solver
from kickdyn.robot.kicking_chain import check_free_joints, with_angles
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import is_floating

FARTHEST_BALL = 1e9
"""Farthest that a ball may lie from the world's origin, along each axis [m]."""


@validation.check_arguments
def plan_kick(
    leg: Leg,
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    objective: str = KickObjective.JOINT_SPEED,
    contact: Contact | None = None,
    ball_position: ArrayLike | None = None,
    limits: bool = True,
    surface: str | Surface | None = None,
    uncertainty: Mapping[str, float] | None = None,
    swing: bool = False,
    solver: str = "slsqp",
) -> KickPlan:
    r"""Find posture and joint velocity that strike a ball at rest so that it meets a goal.

    The launch :math:`(v_b, \omega_b)`, the impulse :math:`p = m v_b`, the normal and the foot
    velocity follow from each other in closed form. A nonlinear program then chooses posture and
    joint velocity by the objective, and `strike` and `fly` verify the plan.

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
        objective: a `KickObjective`. `scatter` needs an `uncertainty`; it is searched from the
            plans of all other objectives, so that it scatters no more than theirs.
        contact: restitution, friction and offset of the contact, without a normal. With None, the
            restitution is 0.8 as in the paper's Table 2 and the friction 0.4. Where the restitution
            depends on the speed of approach u, u (1 + e) must increase with u; without friction,
            the ball gets no spin and the foot is free across the normal.
        ball_position: height of the ball's centre [m, world frame], or its position, shape `(3,)`,
            which leaves only the self-motion of a redundant leg free. With None both are free; the
            command `kickdyn plan` lays the ball at the foot of the straight leg, at a height of
            -0.7042 for `Leg.human()`.
        limits: whether limits of speed and torque hold; those of the joints' range always do. An
            infinite one always holds, its use is 0, and `joint-speed` counts it as 100 rad/s; one
            of 0 is refused, or none with `limits=False`.
        surface: surface of the ground, for a ball that is played along the ground as by
            `plan_pass`; the goal is then a time and a target at the height of the ball.
        uncertainty: standard deviations by source, as for `kickdyn.planning.scatter.scatter`.
        swing: whether the leg must be able to come there from rest, and to rest afterwards, within
            its limits and a second each: `plan_swing` then finds the motion. For objectives
            `joint-speed` and `kinetic-energy`, with limits; needs `pip install "kickdyn[swing]"`.
            A robot that stands on one foot needs nothing more: its plan has a `backswing`, from
            rest to the impact, see below.
        solver: name of the solver of the nonlinear program, `slsqp`.

    A robot that stands on one foot kicks a ball that lies on the same ground, the plane z = 0. The
    foot lies on it as it does while all joints are at 0 and the base is upright; without a `sole`
    of the `Support`, its sole is what the shapes of the file have within 2 mm of the ground. At the
    impact, the centre of mass is above the sole, the kicking foot above the ground, the trunk
    (the body of the floating base) at most 30 degrees from upright, and, where there is such a
    posture, the ground can supply the support's impulse: `impact.footing` says whether.

    With `swing=True`, such a robot also has a `backswing`: from a posture in which it stands at
    rest, with its centre of mass above the sole, to the impact, within the joints' ranges and
    speeds, the trunk at most 45 degrees from upright and the kicking foot above the ground. Torques
    and the force of the ground keep their limits where there is such a motion; `status` says
    whether they do, and `warnings` names those that do not. The motion after the impact is not
    planned.

    Raises:
        OutOfReach: a goal that no launch meets, with the nearest there is.
        InvalidInput: a leg that cannot kick in that direction or whose postures cannot reach the
            ball; a spin for which friction is too low; an unknown objective; a leg with loops,
            which tie joints together that a plan chooses one by one; a standing robot for which no
            backswing is found with `swing=True`; a leg with stiff joints, whose effective mass the
            plan does not know (`strike`, `collide` and sweeps know both).

    Example:
        >>> import kickdyn as kd
        >>> plan = kd.plan_kick(kd.Leg.human(), kd.Goal(20, time=1.2), kd.Ball(), kd.Air())
        >>> str(plan.status), round(plan.impact.ball_after.speed, 1)
        ('met', 19.6)
    """
    leg = with_angles(leg)
    check_free_joints(leg, "kicks are planned")
    objective = _checked_objective(objective, uncertainty, limits=limits, swing=swing)
    contact, position = _checked_contact(contact), _checked_ball_position(ball_position)
    if is_floating(leg):
        position = _lying_on_ground(position, ball)
    elif swing:
        check_solver()

    # several threads sum in another order, which moves postures by up to 2e-5 rad, and take 5 times
    # as long for matrices of 100 rows
    with threadpool_limits(1, "blas"):
        launch: Launch | Pass
        if surface is None:
            launch = _plan_flight_launch(goal, ball, air)
        else:
            launch = _plan_pass_launch(goal, ball, air, surface)
        target = impact_target_for(launch.velocity, launch.spin, ball, contact)
        problem = kick_problem(leg, target, position, limits=limits, solver=solver)
        cost: Objective = (
            OBJECTIVES[objective]()
            if uncertainty is None
            else LandingScatter(launch.state, ball, air, uncertainty)
        )
        phases = backswing = None
        if not swing:
            solution = solve_kick(problem, cost)
        elif problem.standing is not None:
            solution, backswing = solve_with_backswing(problem, cost)
        else:
            from kickdyn.planning.swing_kick import solve_with_swing  # it needs CasADi

            solution, phases = solve_with_swing(problem, cost)

        problem, point = solution.problem, solution.point
        q, v = problem.on_robot(point)
        impact = strike(problem.robot.posture(q), v, ball, target.contact)
        met = point.share == 1.0
        path: Flight | Course
        if surface is None:
            time = launch.time if met else None
            path = fly_to_target(impact.ball_after, goal, ball, air, time)
        else:
            start = impact.ball_after
            ground = Ground(float(start.position[2]) - ball.radius, surface)
            plane = Plane(start.position + goal.target, -goal.ahead, "centre")
            path = follow(start, ball, air, ground, plane=plane)
    balance = problem.find(Balance)
    return KickPlan(
        goal=goal,
        launch=launch,
        objective=objective,
        value=cost.quantity(point),
        share=point.share,
        impact_target=target,
        impact=impact,
        path=path,
        speed_use=float(SpeedLimit(problem.variables).use(point).max()),
        torque_use=float(TorqueLimit(problem.variables).use(point).max()),
        binding=(*solution.binding, *(x for term in problem.terms for x in term.binding(point))),
        ball_is_placed=position is not None,
        heading=problem.heading,
        phases=phases,
        backswing=backswing,
        balance=None if balance is None else balance.distance(point.posture),
    )


def _lying_on_ground(position: float | Array | None, ball: Ball) -> float | Array:
    """Return the position of a ball that lies on the ground z = 0, or raise `InvalidInput`."""
    height = ball.radius if position is None else np.atleast_1d(position)[-1]
    if abs(height - ball.radius) > 1e-9:
        raise InvalidInput(
            f"the ball's centre is at a height of {height:g} m: a standing robot kicks a ball that "
            f"lies on its ground, at {ball.radius:g} m"
        )
    return ball.radius if position is None else position


def _checked_objective(
    name: str, uncertainty: Mapping[str, float] | None, *, limits: bool, swing: bool
) -> KickObjective:
    """Return the objective, or raise `InvalidInput` where it does not go with the rest."""
    objective = validation.choice("objective", name, KickObjective)
    if (uncertainty is None) != (objective != KickObjective.SCATTER):
        raise InvalidInput(
            f"objective is {objective} and uncertainty is {uncertainty!r}: scatter needs an "
            "uncertainty, and no other objective takes one"
        )
    if swing:
        if objective not in (KickObjective.JOINT_SPEED, KickObjective.KINETIC_ENERGY):
            raise InvalidInput(
                f"objective is {objective}: with swing=True (--swing) it must be joint-speed or "
                "kinetic-energy"
            )
        if not limits:
            raise InvalidInput("limits is False: a swing is planned within limits")
    return objective


def _checked_ball_position(position: ArrayLike | None) -> float | Array | None:
    """Return the height or the position of the ball's centre; None where it is free."""
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


def _plan_flight_launch(goal: Goal, ball: Ball, air: Air | None) -> Launch:
    """Return the launch into the air, without the part of the spin that is along it."""
    across = goal
    for _ in range(30):
        launch = plan_launch(across, ball, air)
        if launch.limit is not None:
            raise OutOfReach(f"the goal is {launch.summary}", launch.limit, launch)
        direction = launch.velocity / launch.speed
        along = float(launch.spin @ direction)
        if abs(along) <= 1e-12 * max(math.hypot(*launch.spin), 1e-300):
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
