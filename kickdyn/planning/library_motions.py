"""Motions of a library of kicks: the first one, those next to others, and checks in between.

Each is a task for a worker of an executor: arguments are a pickle of what all tasks share, and
arrays.
"""

import math
import pickle
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.kick_task import KickTask
from kickdyn.motion.motion import SETTLING
from kickdyn.motion.motion_program import (
    MotionSolution,
    MotionSplines,
    Multipliers,
    integration_weights,
    joint_axis,
)
from kickdyn.motion.plan_motion import continue_motion, motion_problem, plan_motion
from kickdyn.motion.separation import ALLOWED as DEEPEST
from kickdyn.motion.separation import Conditions
from kickdyn.motion.verdict import POINTS, Verdict
from kickdyn.planning.kick import motion_task
from kickdyn.planning.kick_problem import kick_problem
from kickdyn.planning.kick_reader import KickReader, launch_velocity
from kickdyn.planning.kick_steps import one_thread
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import is_floating, kicking_chain, rest_configuration

LAUNCH_ERROR, ANGLE_ERROR = 1e-3, math.radians(0.1)
"""Largest error of a launch by `strike`, relative to its speed, and of its direction [rad]."""

ALLOWED_SHARE, ALLOWED_DISTANCE = 0.01, 3e-3
"""What motions between nodes may lack of a limit: a share of it, or a distance or angle [m, rad].
The centre of pressure then still is inside the sole, of which planned motions leave 3 mm free."""

DUALS = "speeds", "impact", "bounds", "points"
"""Arrays of `Multipliers`."""

FACING = 1e-3
"""Cosine by which the normal may leave the cone in which the foot can meet a ball."""


class Found(NamedTuple):
    """A motion, or why there is none."""

    reason: str  # why it does not keep all limits; empty if it does
    margins: Array  # least distances from the limits, each name once, shape `(k,)`
    solution: dict[str, Any]  # of the motion, by `solution_arrays`; empty without one


@dataclass(eq=False)
class Kicks:
    """What all kicks of a library share."""

    robot: Leg  # that kicks
    ball: Ball  # at rest
    contact: Contact  # restitution and friction
    height: float  # of the ball's centre [m]
    joints: tuple[str, ...] = ()  # that move; empty before the first motion is planned
    # values of joints that do not move, other than at rest
    aside: dict[str, float] = field(default_factory=dict)
    # coefficients of the first motion, near which all others are; None before it
    near: Array | None = None
    _like: Any = field(default=None, init=False)
    _reader: KickReader | None = field(default=None, init=False)

    def task(self, point: Array, *, place_is_free: bool = False) -> KickTask:
        """Return the task of the kick at a point of the axes, `(5,)`."""
        target = impact_target_for(launch_velocity(point), np.zeros(3), self.ball, self.contact)
        place: Any = np.array([point[3], point[4], self.height])
        if place_is_free:
            place = self.height
        self._like = problem = kick_problem(self.robot, target, place, like=self._like)
        if problem.heading or problem.moved.any():
            plane = "azimuth must be 0, and the ball's y must be that of its foot"
            raise InvalidInput(f"{self.robot.name} kicks in its plane only: {plane}")
        task = motion_task(problem)
        if self.joints and self.joints != task.leg.joint_names:
            leg = kicking_chain(task.leg, others=self.aside).leg
            task = replace(task, leg=leg, aside=self.aside)
        return task

    def with_exact_impact(self, task: KickTask, coefficients: Array, point: Array) -> Array:
        """Return the nearest coefficients that keep the equations of the impact."""
        if self._reader is None:
            none = dict.fromkeys(("lower", "upper"), np.zeros(5))
            none |= dict.fromkeys(("cell_reasons", "limits"), np.zeros(0, "U1"))
            self._reader = KickReader(none | robot_arrays(task, self))
        return self._reader.with_exact_impact(coefficients, point)[0]


@lru_cache(maxsize=1)
def _unpickled(kicks: bytes) -> Kicks:
    """Return the kicks of a library in a worker, which computes what they share once."""
    return pickle.loads(kicks)  # type: ignore[no-any-return]


def first_motion(kicks: Kicks, point: Array) -> tuple[Kicks, Array, Found]:
    """Plan the motion of a launch whose ball lies where it suits this robot best.

    Returns:
        The kicks with the joints that move, the point with the place of the ball, the motion.

    Raises:
        InvalidInput: no motion keeps all limits.
    """
    with one_thread():
        planned = plan_motion(kicks.task(point, place_is_free=True))
        motion, solution = planned.motion, planned.solution
        if not planned.is_met:
            why = motion.warnings[0] if motion.warnings else "bodies are inside each other"
            raise InvalidInput(f"no motion for the middle of the ranges keeps all limits: {why}")
        joints, aside = motion.joints, dict(motion.aside)
        kicks = replace(kicks, joints=joints, aside=aside, near=solution.coefficients)
        problem = motion_problem(kicks.task(point, place_is_free=True))
        posture = problem.splines.at_impact()[0] @ solution.coefficients
        start = np.array([*point[:3], *problem.ball_centre(posture)[:2]])
    kicks = replace(kicks)  # without what this point has
    return kicks, start, next_motion(pickle.dumps(kicks), start, [solution_arrays(solution)])


def next_motion(pickled: bytes, point: Array, starts: list[dict[str, Array]]) -> Found:
    """Return the motion of a kick at a point `(5,)` next to one of others, which are tried in turn.

    `pickled` is of `Kicks`, and `starts` are of `solution_arrays`.
    """
    kicks, found = _unpickled(pickled), Found("there is no motion near it", np.zeros(0), {})
    with one_thread():
        try:
            task = kicks.task(point)
        except InvalidInput as error:
            return found._replace(reason=str(error))
        for start in starts:
            verdict = continue_motion(task, solution_of(start), kicks.near)
            found = _found(verdict)
            if not found.reason:
                break
    return found


def check_between(pickled: bytes, point: Array, coefficients: Array) -> Found:
    """Return what a motion of interpolated coefficients keeps at a point, once its impact is exact.

    `pickled` is of `Kicks`.
    """
    kicks = _unpickled(pickled)
    with one_thread():
        try:
            task = kicks.task(point)
        except InvalidInput as error:
            return Found(str(error), np.zeros(0), {})
        exact = kicks.with_exact_impact(task, coefficients, point)
        problem = motion_problem(task)
        times = problem.splines.times(*POINTS)
        verdict = Verdict(problem, MotionSolution(exact[0], exact, 1.0, times))
        found = _found(verdict, between=True)
        if found.reason:
            return found
        q = problem.splines.at_impact()[0] @ exact
        rows = np.asarray(problem.posture.values(q, [])[0]).ravel()
        if (rows < problem.posture.lower - FACING).any():
            return found._replace(reason="the foot does not face the ball")
        motion = verdict.motion
        posture = motion.robot.posture(motion.q(0.0))
        contact, wished = task.target.contact, launch_velocity(point)
        try:
            launch = strike(posture, motion.v(0.0), kicks.ball, contact).ball_after.velocity
        except KickdynError as error:
            return found._replace(reason=str(error))
    missed = launch - wished
    along = missed @ wished / (wished @ wished)
    aside = math.hypot(*(missed - along * wished)) / math.hypot(*wished)
    if abs(along) > LAUNCH_ERROR or aside > ANGLE_ERROR:
        reason = f"the launch is {100 * along:.2g} % and {math.degrees(aside):.2g} degrees off"
        return found._replace(reason=reason)
    return found


def _found(verdict: Verdict, *, between: bool = False) -> Found:
    """Return a motion with the reason for which it does not count, if any."""
    reason = ""
    if not verdict.solution.feasible:
        reason = "the solver finds no motion near it"
    elif not verdict.keeps_limits:
        problem, lines = verdict.problem, verdict.motion.warnings
        limits = (*problem.limits, *problem.impulse_limits)
        units = np.array([limit.unit for limit in limits for _ in limit.labels])
        margins = np.append(verdict.rows.min(axis=0), verdict.impulse)
        nearly = (margins >= -np.where(units == "", ALLOWED_SHARE, ALLOWED_DISTANCE)).all()
        if not (between and nearly and verdict.deepest <= DEEPEST + ALLOWED_DISTANCE):
            reason = lines[0] if lines else "bodies are inside each other or the ball"
    labels = verdict.problem.row_labels
    numbers = {label: k for k, label in enumerate(dict.fromkeys(labels))}
    least = np.full(len(numbers), math.inf)
    np.minimum.at(least, [numbers[label] for label in labels], verdict.rows.min(axis=0))
    return Found(reason, least, solution_arrays(verdict.solution))


def solution_arrays(solution: MotionSolution) -> dict[str, Any]:
    """Return a solution, from which others start, as arrays for a file."""
    duals = solution.multipliers
    arrays = {
        "rest": solution.rest,
        "coefficients": solution.coefficients,
        "before": solution.times[0],
        "after": solution.times[1],
        "limited": np.array(solution.limited, dtype=str),
    }
    if duals is not None:
        arrays |= {name: getattr(duals, name) for name in DUALS}
        for k, conditions in enumerate(duals.apart):
            named = conditions._asdict().items()
            arrays |= {f"apart_{k}_{name}": np.array(value) for name, value in named}
    if solution.linearized is not None:
        arrays["linearized"] = solution.linearized
    return arrays


def solution_of(arrays: dict[str, Array]) -> MotionSolution:
    """Return the solution from its arrays."""
    duals, apart = None, list[Conditions]()
    while f"apart_{len(apart)}_joints" in arrays:
        joints, *others = (arrays[f"apart_{len(apart)}_{name}"] for name in Conditions._fields)
        first, second = joints.tolist()
        apart.append(Conditions((first, second), *others))
    if "points" in arrays:
        duals = Multipliers(**{name: arrays[name] for name in DUALS}, apart=apart)
    return MotionSolution(
        arrays["rest"],
        arrays["coefficients"],
        1.0,
        [arrays["before"], arrays["after"]],
        duals,
        limited=tuple(arrays["limited"].tolist()),
        linearized=arrays.get("linearized"),
    )


def robot_arrays(task: KickTask, kicks: Kicks) -> dict[str, Any]:
    """Return the arrays of a library that describe robot, ball and splines, see `ARRAYS`."""
    splines, whole = motion_problem(task).splines, task.whole
    at_impact = splines.at_impact()
    states = np.array([at_impact[0], at_impact[1], at_impact[1] + at_impact[2]])
    height = kicks.ball.radius if is_floating(kicks.robot) else kicks.height
    before, after = splines.splines
    return body_arrays(whole) | {
        "robot": np.array(kicks.robot.name),
        "before_knots": before.t, "after_knots": after.t,
        "before_matrix": before.c, "after_matrix": after.c,
        "at_impact": states,
        "from_impact": smooth_changes(splines, states),
        "moving": np.array([whole.velocity_index(name) for name in task.leg.joint_names]),
        "resting": rest_configuration(whole, task.aside),
        "ball": np.array([kicks.ball.mass, kicks.ball.radius, height]),
        "impact": np.array([kicks.contact.restitution, kicks.contact.friction]),
        "settling": np.array(SETTLING),
    }  # fmt: skip


def body_arrays(leg: Leg) -> dict[str, Any]:
    """Return the arrays of a library that describe the bodies and joints of a leg, see `ARRAYS`."""
    model = leg.workspace.model
    bodies = model.inertias[1:]
    axes = [joint_axis(model, joint) for joint in range(1, model.njoints)]
    return {
        "joints": np.array(leg.joint_names),
        "parents": np.array([*model.parents][1:]) - 1,
        "rotations": np.array([place.rotation for place in model.jointPlacements[1:]]),
        "translations": np.array([place.translation for place in model.jointPlacements[1:]]),
        "axes": np.array([linear + turn for linear, turn in axes]),
        "prismatic": np.array([bool(linear.any()) for linear, _ in axes]),
        "masses": np.array([body.mass for body in bodies]),
        "centres": np.array([body.lever for body in bodies]),
        "inertias": np.array([body.inertia for body in bodies]),
        "armature": np.array(model.armature),
        "contact": np.array(leg.contact_joint - 1),
        "contact_point": np.array(leg.posture(leg.configuration()).contact_lever),
    }


def smooth_changes(splines: MotionSplines, states: Array) -> Array:
    r"""Return the map from changes of the state at the impact to those of the coefficients.

    Of all changes with this state, it is the one without a change of both accelerations at the
    impact, which the torques and the ground's wrench follow, with the least
    :math:`\int |\ddot q|^2 dt`. The shape is `(size, 3)`. `states` maps coefficients to position,
    velocity before and after, shape `(3, size)`.
    """
    times = splines.times(8, 8)
    accelerations = splines.values(times, 2)
    weights = np.concatenate([integration_weights(t) for t in times])
    cost = accelerations.T @ (weights[:, None] * accelerations) + 1e-6 * np.eye(splines.size)
    before, after = splines.splines
    rows = np.vstack([states, before(0.0, 2), after(0.0, 2)])
    least = np.linalg.solve(cost, rows.T)
    return np.asarray((least @ np.linalg.inv(rows @ least))[:, :3])


def described(kicks: Kicks, point: Array) -> tuple[dict[str, Any], list[str]]:
    """Return the arrays of robot, ball and splines, and the names of the limits."""
    with one_thread():
        task = kicks.task(point)
        return robot_arrays(task, kicks), list(dict.fromkeys(motion_problem(task).row_labels))
