"""Planning a kick: from a goal back to the posture and the joint velocity that meet it."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground, Surface
from kickdyn.impact.constraint_impulses import check_free_joints, check_unconstrained
from kickdyn.impact.strike import strike
from kickdyn.plane import Plane
from kickdyn.planning.backswing import Backswing, find_backswing
from kickdyn.planning.goal import Arc, Goal, PlanStatus
from kickdyn.planning.impact_target import ImpactTarget, impact_target_for
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_program import (
    FEASIBLE,
    Cost,
    KickObjective,
    KickProgram,
    KickSolution,
    explain_infeasible,
    scatter_cost,
    turn_leg,
)
from kickdyn.planning.launch import Launch, OutOfReach, fly_to_target, plan_launch
from kickdyn.planning.passes import plan_pass
from kickdyn.planning.stance import Stance
from kickdyn.planning.swing_phase import check_solver
from kickdyn.restitution import checked_restitution
from kickdyn.robot.kicking_chain import (
    KickingChain,
    kicking_chain,
    with_angles,
)
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import StandingRobot, is_floating

LIFT = 100.0
"""Largest upward acceleration of the kicking foot of a standing robot in its backswing [m/s2].

It is a choice, about ten times gravity: with less, fewer kicks have a backswing; with more, the
backswing takes more torque.
"""

TRIED = 2
"""Postures at the impact for which a backswing is sought, the best ones first."""

FAR = 1e9
"""Farthest that a ball may lie from the world's origin, along each axis [m]."""


@validation.check_arguments
def plan_kick(
    leg: Leg,
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    objective: str = KickObjective.JOINT_SPEED,
    restitution: float | str | ArrayLike = 0.8,
    friction: float = 0.4,
    spin: ArrayLike = (0.0, 0.0, 0.0),
    offset: ArrayLike | None = None,
    ball_height: float | None = None,
    ball_at: ArrayLike | None = None,
    limits: bool = True,
    arc: str = Arc.LOW,
    turn: bool = True,
    surface: str | Surface | None = None,
    uncertainty: Mapping[str, float] | None = None,
    swing: bool = False,
) -> KickPlan:
    r"""Find posture and joint velocity that strike a ball at rest so that it meets a goal.

    The launch :math:`(v_b, \omega_b)`, the impulse :math:`p = m v_b`, the normal and the foot
    velocity follow from each other in closed form. A nonlinear program then chooses posture and
    joint velocity by the objective, and `strike` and `fly` verify the plan.

    Args:
        leg: a leg on a fixed base, without supports or loops, and without mimic joints in the
            kicking limb; or a robot on a floating base that stands on one flat support, see below,
            without loops and mimic joints. The plan's q has one angle for each continuous joint.
        goal: the goal, seen from where the ball lies.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum.
        objective: a `KickObjective`. `scatter` needs an `uncertainty`; it is searched from the
            plans of all other objectives, so that it scatters no more than theirs.
        restitution: restitution of the contact, as for `Contact`; 0.8 as the paper's Table 2. Where
            it depends on the speed of approach u, u (1 + e) must increase with u.
        friction: friction of the contact; 0 gives no spin and leaves the foot free across the
            normal.
        spin: spin of the launch, shape `(3,)` [rad/s, world frame]. The component along the launch
            is left out, because a ball at rest takes spin across it only.
        offset: position of the contact point in the leg's contact frame, as for `Contact`.
        ball_height: height of the ball's centre [m, world frame]. With None it is free; the command
            `kickdyn plan` lays the ball at the foot of the straight leg, -0.7042 for `Leg.human()`.
        ball_at: position of the ball's centre, in place of its height, shape `(3,)` [m, world
            frame]. Only the self-motion of a redundant leg remains free.
        limits: whether limits of speed and torque hold; those of the joints' range always do. An
            infinite one always holds, its use is 0, and `joint-speed` counts it as 100 rad/s; one
            of 0 is refused, or none with `limits=False`.
        arc: `low` or `high`, where two launches meet the goal.
        turn: whether a leg whose foot moves in a plane, as ours do, may be turned about the
            vertical towards the launch; the plan says by how much.
        surface: surface of the ground, for a ball that is played along the ground as by
            `plan_pass`; the goal is then a time and a target at the height of the ball.
        uncertainty: standard deviations by source, as for `kickdyn.planning.scatter.scatter`.
        swing: whether the leg must be able to come there from rest, and to rest afterwards, within
            its limits and a second each: `plan_swing` then finds the motion. For objectives
            `joint-speed` and `kinetic-energy`, with limits; needs `pip install "kickdyn[swing]"`.
            A robot that stands on one foot needs nothing more: its plan has a `backswing`, from
            rest to the impact, see below.

    A robot that stands on one foot kicks a ball that lies on the same ground, the plane z = 0. The
    foot lies on it as it does while all joints are at 0 and the base is upright; without a `sole`
    of the `Support`, its sole is what the shapes of the file have within 2 mm of the ground. At the
    impact, the centre of mass is above the sole, the kicking foot above the ground, the trunk
    (the body of the floating base) at most 30 degrees from upright, and, where there is such a
    posture, the ground can supply the support's impulse: `impact.footing` says whether.

    With `swing=True`, such a robot also has a `backswing`: from a posture in which it stands at
    rest, with its centre of mass above the sole, to the impact, within the joints' ranges and
    speeds, the trunk at most 45 degrees from upright and the kicking foot above the ground. Torques
    and the force of the ground keep their limits where there is such a motion; `warnings` names
    those that do not, and torques above their limits make the status `beyond-limits`. The motion
    after the impact is not planned.

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
    standing = StandingRobot(leg) if is_floating(leg) else None
    if standing is None:
        check_unconstrained(leg, "kicks from a fixed base are planned")
    objective = _checked_objective(objective, uncertainty, limits=limits, swing=swing)
    if swing and standing is None:
        check_solver()
    ball_position = _checked_ball_position(ball_height, ball_at)
    if standing is not None:
        ball_position = _lying_on_ground(ball_position, ball)
    offset = None if offset is None else validation.vector("contact offset", offset, 3, unit="m")
    wished_spin = validation.vector("spin", spin, 3, unit="rad/s")

    if surface is None:
        launch = _plan_flight_launch(goal, ball, air, wished_spin, arc)
    else:
        launch = _plan_pass_launch(goal, ball, air, wished_spin, surface)
    target = impact_target_for(
        launch.velocity, launch.spin, ball, checked_restitution(restitution), friction, offset
    )
    chain = kicking_chain(leg if standing is None else standing.leg, branches=True)
    scatter = None if uncertainty is None else scatter_cost(target, launch, air, uncertainty)
    backswing = None
    if standing is None:
        program = KickProgram(chain.leg, target, ball_position, limits=limits, turn=turn)
        solution = _solve(program, objective, scatter)
    elif swing:
        program, solution, backswing = _solve_with_backswing(
            standing, chain, target, ball_position, objective
        )
    else:
        program, solution = _solve_standing(
            standing, chain, target, ball_position, limits, objective, scatter
        )
    cost = scatter or program.cost(objective)
    static_share, phases = solution.share, None  # the share without regard to a swing
    if swing and standing is None:
        from kickdyn.planning.swing_kick import solve_with_swing

        solution, phases = solve_with_swing(program, solution, objective)
    if standing is None:
        robot = turn_leg(leg, program.heading) if program.heading else leg
        q, v = chain.whole(robot, solution.posture.q, solution.v)
    else:
        robot = standing.robot
        q, v = standing.whole(*chain.whole(standing.leg, solution.posture.q, solution.v))
    impact = strike(robot.posture(q), v, ball, target.contact)

    speed = np.abs(solution.v[program.vs]) / program.velocity_limit
    torque = np.abs(program.torque(solution.posture.q, solution.v)) / program.torque_limit
    met = solution.share == 1.0
    over = {} if backswing is None else backswing.too_strong
    return KickPlan(
        status=PlanStatus.MET if met and not over else PlanStatus.BEYOND_LIMITS,
        goal=goal,
        launch=launch,
        objective=objective,
        value=abs(cost(solution.posture, solution.v)),
        share=solution.share,
        impact_target=target,
        impact=impact,
        path=_carry_out(impact.ball_after, goal, launch.time if met else None, ball, air, surface),
        speed_use=float(speed.max()),
        torque_use=float(torque.max()),
        binding=(
            *(["swing"] if solution.share < static_share - 1e-6 else []),
            *_reached("speed", program.names, speed),
            *_reached("torque", program.names, torque),
            *(f"torque of {name} in the backswing" for name in over),
        ),
        heading=program.heading,
        phases=phases,
        backswing=backswing,
        balance=None if program.stance is None else program.stance.balance(solution.posture),
    )


def _solve(program: KickProgram, objective: KickObjective, scatter: Cost | None) -> KickSolution:
    """Return the solution of a program for an objective, or for a cost of scatter."""
    if scatter is not None:
        return _solve_scatter(program, scatter)
    return _feasible(program, program.solve(program.cost(objective)))


def _solve_standing(
    standing: StandingRobot,
    chain: KickingChain,
    target: ImpactTarget,
    ball_position: float | Array | None,
    limits: bool,
    objective: KickObjective,
    scatter: Cost | None,
) -> tuple[KickProgram, KickSolution]:
    """Return the solution of a standing robot, and its program.

    Where no posture that meets the goal has a support's impulse that ground can supply, the foot is
    held.
    """

    def program(impulse: Array | None) -> KickProgram:
        """Return the program, where the ground must supply the support's impulse or not."""
        stance = Stance(standing, impulse)
        return KickProgram(chain.leg, target, ball_position, limits=limits, stance=stance)

    stands = program(target.impulse)
    found = stands.solve_whole(
        stands.cost(KickObjective.JOINT_SPEED if scatter is not None else objective)
    )
    if found is None:
        held = program(None)
        return held, _solve(held, objective, scatter)
    return stands, found if scatter is None else _solve_scatter(stands, scatter)


def _solve_with_backswing(
    standing: StandingRobot,
    chain: KickingChain,
    target: ImpactTarget,
    ball_position: float | Array | None,
    objective: KickObjective,
) -> tuple[KickProgram, KickSolution, Backswing]:
    """Return the solution of a standing robot that has a backswing, its program, and that.

    It is sought near the solutions of `_solve_standing`.

    Raises:
        InvalidInput: none is found.
    """

    def program(impulse: Array | None, lift: float | None) -> KickProgram:
        """Return the program, with the support's impulse and the height of the foot or without."""
        stance = Stance(standing, impulse, lift=lift)
        return KickProgram(chain.leg, target, ball_position, stance=stance)

    impulses: list[Array | None] = [target.impulse, None]
    known: list[KickSolution] = []
    while impulses and not known:
        plain = program(impulses[0], None)
        known = plain.solve_all(plain.cost(objective))
        impulses = impulses if known else impulses[1:]
    reason = "no posture reaches the launch within its limits, with or without a backswing"
    if known:
        reason = (
            "its kicking foot would come from under the ground; a flatter launch, or a contact "
            "point (offset) where the foot is heavier, takes a foot that rises less"
        )
    for impulse in impulses:
        lifted = program(impulse, LIFT)
        starts = [plain.unknowns(one) for one in known]
        found = lifted.solve_all(lifted.cost(objective), starts)
        for solution in sorted(found, key=lambda one: one.value)[:TRIED]:
            q, v = solution.posture.q[lifted.qs], solution.v[lifted.vs]
            backswing, reason = find_backswing(standing, q, v)
            if backswing is not None:
                return lifted, solution, backswing
        if found:
            reason = f"{reason} (another goal, offset or objective takes another posture)"
    raise InvalidInput(f"{standing.robot.name} finds no backswing to this kick: {reason}")


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


def _checked_ball_position(
    ball_height: float | None, ball_at: ArrayLike | None
) -> float | Array | None:
    """Return the height or the position of the ball's centre; None where it is free."""
    if ball_at is not None and ball_height is not None:
        raise InvalidInput(f"ball_height is {ball_height!r} beside ball_at: name one of the two")
    if ball_height is not None:
        return validation.number("ball height", ball_height, at_least=-FAR, at_most=FAR, unit="m")
    if ball_at is None:
        return None
    place = validation.vector("ball_at", ball_at, 3, unit="m")
    if np.abs(place).max() > FAR:
        raise InvalidInput(f"ball_at is {place.tolist()} m: it must be within {FAR:g} m")
    return place


def _plan_flight_launch(goal: Goal, ball: Ball, air: Air | None, spin: Array, arc: str) -> Launch:
    """Return the launch into the air, without the part of the spin that is along it."""
    across = spin
    for _ in range(30):
        launch = plan_launch(goal, ball, air, spin=across, arc=arc)
        if launch.limit is not None:
            raise OutOfReach(f"the goal is {launch.summary}", launch.limit, launch)
        direction = launch.velocity / launch.speed
        along = float(launch.spin @ direction)
        if abs(along) <= 1e-12 * max(math.hypot(*launch.spin), 1e-300):
            return launch
        across = launch.spin - along * direction
    return launch


def _plan_pass_launch(
    goal: Goal, ball: Ball, air: Air | None, spin: Array, surface: str | Surface
) -> Launch:
    """Return the launch of a pass along the ground."""
    found = plan_pass(goal, ball, air, surface=surface, spin=spin)
    if found.limit is not None:
        raise OutOfReach(f"the pass is out of reach: {found.summary}", found.limit, found)
    along = abs(float(spin @ found.velocity)) / math.hypot(*found.velocity)
    if along > 1e-9 * math.hypot(*spin):
        raise InvalidInput(
            f"spin has {along:g} rad/s along the pass: a ball at rest takes spin across its launch "
            "only"
        )
    assert goal.time is not None
    return Launch(
        status=PlanStatus.MET,
        goal=goal,
        reached=goal,
        limit=None,
        velocity=found.velocity,
        spin=spin,
        time=found.time,
        errors=np.array([0.0, found.aside, 0.0, found.time - goal.time]),
        history=found.velocity[None],
        ball=ball,
        air=air,
        limits=None,
    )


def _feasible(program: KickProgram, solution: KickSolution | None) -> KickSolution:
    """Return a solution, or raise `InvalidInput` with the reason why there is none."""
    if solution is not None:
        return solution
    at, where = program.ball_position, ""
    if isinstance(at, np.ndarray):
        where = f" at ({', '.join(f'{part:g}' for part in at)}) m"
    elif at is not None:
        where = f" at a height of {at:g} m"
    raise InvalidInput(
        f"{program.leg.name} has no posture in which it can give a ball{where} the required "
        f"launch; {explain_infeasible(program)}"
    )


def _solve_scatter(program: KickProgram, cost: Cost) -> KickSolution:
    """Return the solution of least scatter near those of all other objectives."""
    found = _feasible(program, program.solve(program.cost(KickObjective.JOINT_SPEED)))
    known = [found]
    if found.share == 1.0:  # the plan of another objective may scatter less, or lead to one
        names = set(KickObjective) - {KickObjective.JOINT_SPEED, KickObjective.SCATTER}
        others = [program.solve(program.cost(name)) for name in sorted(names)]
        known += [one for one in others if one is not None and one.share == 1.0]
    return min((program.improve(one, cost) for one in known), key=lambda one: one.value)


def _carry_out(
    start: BallState,
    goal: Goal,
    time: float | None,
    ball: Ball,
    air: Air | None,
    surface: str | Surface | None,
) -> Flight | Course:
    """Return the path of the ball after the strike, to the target or to its end before."""
    if surface is None:
        return fly_to_target(start, goal, ball, air, time)
    ground = Ground(float(start.position[2]) - ball.radius, surface)
    plane = Plane(start.position + goal.target, -goal.ahead, "centre")
    return follow(start, ball, air, ground, plane=plane)


def _reached(what: str, names: tuple[str, ...], use: Array) -> list[str]:
    """Return the limits that are reached, by joint."""
    return [
        f"{what} of {name}"
        for name, share in zip(names, use.tolist(), strict=True)
        if share > 1.0 - 10 * FEASIBLE
    ]
