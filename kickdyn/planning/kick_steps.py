"""Steps of planning a kick: the launch that meets a goal, the outcome of a solution, the path."""

import math
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cache
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
from kickdyn.plane import Plane
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick_problem import MUSCLES, KickProblem
from kickdyn.planning.kick_terms import (
    KickPoint,
    MuscleTorqueLimit,
    Objective,
    SpeedLimit,
    TorqueLimit,
)
from kickdyn.planning.launch import Launch, OutOfReach, fly_to_target, plan_launch
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.passes import Pass, plan_pass
from kickdyn.planning.stance import Balance
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.names import MAX_FAULTY, listed
from kickdyn.robot.standing import with_angles

LONGEST_COURSE = 10.0
"""Time for which each flight, and rolling, of a trapped ball is followed at most [s]."""

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
        raise InvalidInput(
            f"limits is {validation.brief(limits)}: it must be True, False or {MUSCLES!r}"
        )
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


def plan_flight_launch(
    goal: Goal,
    ball: Ball,
    air: Air | None,
    contact: Contact,
    before: BallState | None = None,
    near: Launch | None = None,
) -> Launch:
    """Return the launch into the air, with the spin along the impulse that the ball has before."""
    before = BallState() if before is None else before
    if contact.friction == 0.0 and before.spin.any():
        goal = replace(goal, spin=before.spin)
    launch = plan_launch(goal, ball, air, struck=before, near=near)
    if launch.limit is not None:
        raise OutOfReach(f"the goal is {launch.summary}", launch.limit, launch)
    return launch


def plan_pass_launch(goal: Goal, ball: Ball, air: Air | None, surface: str | Surface) -> Pass:
    """Return the launch along the ground."""
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


def outcome_of(problem: KickProblem, point: KickPoint, objective: Objective) -> Chosen:
    """Return the state at the impact of a solution."""
    q, v = problem.on_robot(point)
    balance = problem.find(Balance)
    torque = problem.find(TorqueLimit) or TorqueLimit(problem.variables)
    outcome = {
        "share": point.share,
        "value": objective.quantity(point),
        "speed_use": float(SpeedLimit(problem.variables).use(point).max()),
        "torque_use": float(torque.use(point).max()),
        "muscles": isinstance(torque, MuscleTorqueLimit),
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
