"""Planning a kick: from a goal back to the posture and the joint velocity that meet it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course, follow
from kickdyn.ground import Ground, Surface
from kickdyn.impact.constraint_impulses import check_free
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.plane import Plane
from kickdyn.planning.equations import FEASIBLE, Objective
from kickdyn.planning.goal import Arc, Goal, PlanStatus
from kickdyn.planning.heading import turned
from kickdyn.planning.impact_target import impact_target_for
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import Launch, OutOfReach, fly_to_target, plan_launch
from kickdyn.planning.limb import Limb, limb_of
from kickdyn.planning.objectives import OBJECTIVES, least_scatter
from kickdyn.planning.passes import plan_pass
from kickdyn.planning.search import Found, Search
from kickdyn.planning.swing_joints import check_solver
from kickdyn.robot.leg import Leg

if TYPE_CHECKING:
    from kickdyn.planning.swing_kick import SwungKick
    from kickdyn.planning.swing_phase import SwingPhase


STARTS = 4
"""Of the search, drawn with a fixed seed."""


def plan_kick(
    leg: Leg,
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    objective: str = "joint speed",
    restitution: float = 0.8,
    friction: float = 0.4,
    spin: ArrayLike = (0.0, 0.0, 0.0),
    offset: ArrayLike | None = None,
    ball_height: float | None = None,
    ball_at: ArrayLike | None = None,
    limits: bool = True,
    arc: str = Arc.LOW,
    turn: bool = True,
    surface: str | Surface | None = None,
    spread: Mapping[str, float] | None = None,
    swing: bool = False,
) -> KickPlan:
    """Find posture and joint velocity that strike a ball at rest so that it meets a goal.

    Goal, launch, impulse, normal and foot velocity follow from each other in closed form; posture
    and joint velocity are what is left, and the objective chooses among them.

    Args:
        leg: on a fixed base, without supports or loops.
        goal: from where the ball lies.
        ball: mass and radius.
        air: None is the vacuum.
        objective: `joint speed`, mean square of speeds over their limits; `joint impulse`, the
            largest linear impulse in a joint [N s], or `most joint impulse`; `foot speed` [m/s]:
            the posture that makes the most impulse of it; `effort`, the kinetic energy that the
            swing must build up [J], not what `plan_swing` calls so; `scatter`, the root mean
            square error of the landing [m] for errors given by `spread`, searched from the plans
            of all other objectives: no more than theirs.
        restitution: of the contact; 0.8 as the paper's Table 2.
        friction: of the contact; 0 gives no spin and leaves the foot free across the normal.
        spin: of the launch, shape `(3,)` [rad/s]; what is not across the launch is left out.
        offset: of the contact point from the leg's frame, as for `Contact`.
        ball_height: of the ball's centre [m, world frame]; free when not named, where `kickdyn
            plan` lays the ball at the straight leg's foot: -0.7042 for `Leg.human()`.
        ball_at: where the ball's centre lies, instead, shape `(3,)` [m, world frame]: what is left
            is self-motion, the way of a redundant leg to kick from one place in many postures.
        limits: whether limits of speed and torque hold; those of the joints' range always do. An
            infinite one always holds, its use is 0, and `joint speed` counts it as 100 rad/s; one
            of 0 is refused, or none with `limits=False`.
        arc: `low` or `high`, where two launches meet the goal.
        turn: whether a leg whose foot moves in a plane, as ours do, may be turned about the
            vertical towards the launch; the plan says by how much.
        surface: of the ground, where the ball is to be played along it, as `plan_pass` does; the
            goal is then a time and a target as high as the ball.
        spread: standard deviation by source, as for `kickdyn.planning.scatter.scatter`.
        swing: whether the leg must be able to come there from rest, and to rest afterwards, within
            its limits and a second each: `plan_swing` then finds the way. For objectives `joint
            speed` and `effort`, with limits; needs `pip install "kickdyn[swing]"`.

    Raises:
        OutOfReach: a goal that no launch meets, with the nearest there is.
        InvalidInput: a leg that cannot kick in that direction or whose postures cannot reach the
            ball; a spin for which friction is too low; an unknown objective.
    """
    check_free(leg, "kicks are planned")
    if objective not in (*OBJECTIVES, "scatter"):
        raise InvalidInput(
            f"objective {objective!r} is unknown: choose {', '.join(OBJECTIVES)}, scatter"
        )
    if (spread is None) != (objective != "scatter"):
        raise InvalidInput(f"objective {objective!r} and spread {spread!r}: scatter needs a spread")
    if ball_height is not None:
        ball_height = validation.number("ball height", ball_height, unit="m")
    if ball_at is not None and ball_height is not None:
        raise InvalidInput(f"ball_height is {ball_height:g} beside ball_at: name one of the two")
    ball_position = (
        ball_height if ball_at is None else validation.vector("ball_at", ball_at, 3, unit="m")
    )
    place = None if offset is None else validation.vector("contact offset", offset, 3, unit="m")
    turning = validation.vector("spin", spin, 3, unit="rad/s")
    ground = None if surface is None else Ground(surface=surface)
    if surface is None:
        launch = _plan_free_launch(goal, ball, air, turning, arc)
    else:
        launch = _plan_pass_launch(goal, ball, air, turning, surface)
    impact_target = impact_target_for(
        launch.velocity, launch.spin, ball, restitution, friction, place
    )
    limb = limb_of(leg)
    search = Search(limb.leg, impact_target, ball_position, limits, turn)
    cost = OBJECTIVES["joint speed" if spread is not None else objective](search, impact_target)
    found = search.run(cost, STARTS)
    if found is not None and spread is not None:
        cost = least_scatter(impact_target, launch, air, spread)
        known = [found]
        if found.share == 1.0:  # what is least for others may scatter less, or lead to what does
            for one in list(OBJECTIVES.values())[1:]:
                other = Search(limb.leg, impact_target, ball_position, limits, turn)
                run = other.run(one(other, impact_target), STARTS)
                known += [run] if run is not None and run.share == 1.0 else []
        found = min((search.improve(one, cost) for one in known), key=lambda one: one.value)
    if found is None:
        there = (
            f"{ball_position:g}"
            if isinstance(ball_position, float)
            else np.asarray(ball_position).tolist()
        )
        where = "" if ball_position is None else f" that touches a ball at {there} m"
        from kickdyn.planning.excluded import why_none

        why = why_none(limb.leg, impact_target, ball_position, limits, turn, STARTS)
        raise InvalidInput(f"{leg.name} has no posture{where} from which it can kick so: {why}")
    binding: tuple[str, ...] = ()
    parts: tuple[SwingPhase, SwingPhase] | None = None
    if swing:
        bare = found.share
        found, parts = _swung(search, found, objective)
        binding = ("swing",) if found.share < bare - 1e-6 else ()
    robot = turned(leg, search.heading) if search.heading else leg
    hit = _struck(robot, limb, search, found)
    plan = _carried_out(search, found, hit, goal, launch, objective, air, cost, ground, binding)
    return replace(plan, parts=parts)


def _swung(search: Search, found: Found, objective: str) -> SwungKick:
    """Return the best kick near one that can be swung."""
    check_solver()
    if not search.limits:
        raise InvalidInput("limits is False: a swing is planned within limits")
    from kickdyn.planning.swing_kick import with_swing

    swung = with_swing(search, found, objective)
    if swung is None:
        raise InvalidInput(f"{search.leg.name} finds no posture that it can swing to")
    return swung


def _plan_free_launch(goal: Goal, ball: Ball, air: Air | None, spin: Array, arc: str) -> Launch:
    """Return the launch in the air whose spin is across it: a ball at rest takes no other."""
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
    """Return the launch of a pass."""
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
    errors = np.array([0.0, found.aside, 0.0, found.time - goal.time])
    return Launch(
        status=PlanStatus.MET,
        goal=goal,
        reached=goal,
        limit=None,
        velocity=found.velocity,
        spin=spin,
        time=found.time,
        errors=errors,
        history=found.velocity[None],
        ball=ball,
        air=air,
    )


def _struck(robot: Leg, limb: Limb, search: Search, found: Found) -> Impact:
    q, v = limb.whole(robot, found.posture.q, found.v)
    return strike(robot.posture(q), v, search.impact_target.ball, search.impact_target.contact)


def _carried_out(
    search: Search,
    found: Found,
    hit: Impact,
    goal: Goal,
    launch: Launch,
    objective: str,
    air: Air | None,
    cost: Objective,
    ground: Ground | None,
    binding: tuple[str, ...],
) -> KickPlan:
    impact_target = search.impact_target
    start = hit.ball_after
    path: Flight | Course
    if ground is None:
        time = launch.time if found.share == 1.0 else None
        path = fly_to_target(start, goal, impact_target.ball, air, time)
        end = path.landing
    else:
        ground = Ground(float(start.position[2]) - impact_target.ball.radius, ground.surface)
        plane = Plane(start.position + goal.target, -goal.ahead, "centre")
        path = follow(start, impact_target.ball, air, ground, plane=plane)
        end = path.rest
    error = float(np.linalg.norm(end.position - start.position - goal.target))
    fast = np.abs(found.v[search.vs]) / search.fastest
    used = np.abs(search.torque(found.posture.q, found.v)) / search.effort
    uses = {"speed of": fast, "effort of": used}
    return KickPlan(
        status=PlanStatus.MET if found.share == 1.0 else PlanStatus.BEYOND_LIMITS,
        goal=goal,
        launch=launch,
        objective=objective,
        value=cost(found.posture, found.v),
        share=found.share,
        impact_target=impact_target,
        hit=hit,
        path=path,
        landing_error=error,
        time_error=path.duration - launch.time,
        speed_use=float(fast.max()),
        effort_use=float(used.max()),
        binding=binding
        + tuple(
            f"{what} {name}"
            for what, use in uses.items()
            for name, share in zip(search.names, use.tolist(), strict=True)
            if share > 1.0 - 10 * FEASIBLE
        ),
        heading=search.heading,
    )
