"""What of a planned kick needs attention: each check is a function of a plan that returns lines.

A line says what is the matter. What can be done about it follows after a semicolon.
"""

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.constraint_impulses import Footing
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.unilateral import unilateral_strike
from kickdyn.planning.backswing import Backswing
from kickdyn.planning.goal import Goal
from kickdyn.restitution import range_warnings
from kickdyn.robot.ground_clearance import (
    LARGEST_MESH,
    Depth,
    body_frames,
    find_depths,
    shapes_of,
)
from kickdyn.robot.kicking_chain import rest_configuration
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import listed, lock_remedy
from kickdyn.robot.standing import hold_support, missing_shapes

TOUCHING = 5e-3
"""Depth up to which a body counts as touching the ball [m].

It is a choice: shapes are simpler than real feet, and a ball is pressed in by more than this.
"""

APPROACH_TIMES, BACKSWING_TIMES = 10, 40
"""Numbers of configurations of the approach at the velocity of the impact, and of a planned
backswing, whose bodies are compared with the ground."""


class CheckedPlan(Protocol):
    """What the checks read of a `KickPlan`."""

    @property
    def goal(self) -> Goal: ...
    @property
    def impact(self) -> Impact: ...
    @property
    def path(self) -> Flight | Course: ...
    @property
    def backswing(self) -> Backswing | None: ...
    @property
    def balance(self) -> float | None: ...


def check_path(plan: CheckedPlan) -> Sequence[str]:
    """Return the warnings of the flight."""
    return plan.path.warnings


def check_restitution_range(plan: CheckedPlan) -> Sequence[str]:
    """Return a line where the restitution is used outside its range of speeds."""
    return range_warnings(plan.impact.contact.restitution, plan.impact.approach_speed)


def check_idle_joints(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for the joints that the kick does not move and that cannot be at 0."""
    leg, v = _leg(plan), plan.impact.v_before
    rest = rest_configuration(leg)
    values, shown = leg.joint_values(rest), leg.display_values(rest)
    planned = leg.joint_values(plan.impact.posture.q)
    idle = [
        f"{name} at {shown[name][0]:.4g} {shown[name][1]}"
        for name, value in values.items()
        if value and value == planned[name] and v[leg.velocity_index(name)] == 0.0
    ]
    if not idle:
        return []
    return [
        "joints that the kick does not move stay at 0 or, where their range does not contain it, "
        f"at the nearest value in the range: {listed(idle)}"
    ]


def check_actuators(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for the joints that move but that the leg's file does not drive."""
    leg, v = _leg(plan), plan.impact.v_before
    passive = () if leg.file is None else leg.file.passive_joints
    joints = set(passive).intersection(leg.single_joints)
    moved = [name for name in passive if name in joints and v[leg.velocity_index(name)]]
    if not moved:
        return []
    remedies = [listed(moved), lock_remedy(leg.workspace.model, moved)]
    return [
        "the plan moves joints that have no actuator in the leg's file: "
        + "; to keep them at rest, ".join(filter(None, remedies))
    ]


def check_support(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for each support that does not stand.

    Where all have a friction, `unilateral_strike` judges them: `impact.footing` leaves out
    friction's moment about the vertical.
    """
    impact = plan.impact
    lines = [
        f"{name} {state.replace('-', ' ')}; the plan assumes that it stays at rest, which takes an "
        "impulse that the ground cannot supply (kd.unilateral_strike computes the impact with "
        "ground that can only push)"
        for name, state in impact.footing.items()
        if state != Footing.STANDS
    ]
    constraints = _leg(plan).constraints
    supports = () if plan.balance is None or constraints is None else constraints.supports
    if lines or not supports or any(support.friction is None for support in supports):
        return lines
    try:
        free = unilateral_strike(impact.posture, impact.v_before, impact.ball, impact.contact)
    except KickdynError as error:
        return [f"it is unknown whether the foot stands ({error})"]
    change = float(np.linalg.norm(free.ball_after.velocity - impact.ball_after.velocity))
    return [
        f"{name} {state.replace('-', ' ')} if the moment of friction about the vertical is limited "
        f"too: this changes the ball's velocity by {change:.2g} m/s; kd.unilateral_strike computes "
        "this impact"
        for name, state in free.footing.items()
        if state != Footing.STANDS
    ]


def check_backswing(plan: CheckedPlan) -> Sequence[str]:
    """Return the warnings of the backswing."""
    return () if plan.backswing is None else plan.backswing.warnings


def check_shapes(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for each body of a standing robot's kicking limb of unknown shape."""
    leg = _leg(plan)
    if plan.balance is None or leg.constraints is None:
        return []
    return missing_shapes(leg, leg.constraints.supports[0])


def check_ball_overlap(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for the bodies that are inside the ball at the impact, if any."""
    overlaps = [f"{name} by {depth:.3f} m" for name, depth in find_overlaps(plan.impact).items()]
    if not overlaps:
        return []
    return [
        f"bodies are inside the ball at the impact: {listed(overlaps)}; another contact point "
        "(offset, --offset) or a flatter launch can avoid this"
    ]


def check_ground_at_impact(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for the bodies that are under the ground at the impact."""
    depths = _depths_at_impact(plan)
    if not depths:
        return []
    names = [f"{depth.frame} by {depth.depth:.3f} m" for depth in depths]
    remedy = _remedy_of_depths(plan, depths)
    return [f"bodies are under the ground at the impact: {listed(names)}; {remedy}"]


def check_ground_before_impact(plan: CheckedPlan) -> Sequence[str]:
    """Return a line for the bodies of a standing robot that come from under the ground.

    They do so in the backswing; without one, while the foot approaches the ball by the ball's
    radius with the joint velocity of the impact. Bodies under the ground at the impact are left
    out.
    """
    if plan.balance is None:
        return []
    impact, leg = plan.impact, _leg(plan)
    if plan.backswing is not None:
        times = -plan.backswing.duration * np.linspace(0.0, 1.0, BACKSWING_TIMES) ** 2
        motion = [plan.backswing.configuration(time) for time in times]
        when = "bodies are under the ground in the backswing"
        remedy = "another goal, offset or objective takes another motion"
    else:
        duration = impact.ball.radius / math.hypot(*impact.foot_velocity)
        times = np.linspace(0.0, -duration, APPROACH_TIMES)
        q, v, model = impact.posture.q, impact.v_before, leg.workspace.model
        motion = [hold_support(impact.posture, pin.integrate(model, q, t * v)) for t in times]
        when = "bodies come from under the ground if the joints keep the velocity of the impact"
        remedy = "swing=True (--swing) plans the motion, with the foot above the ground"
    at_impact = {depth.frame for depth in _depths_at_impact(plan)}
    names = [
        f"{depth.frame} by {depth.depth:.3f} m ({-1e3 * times[depth.number]:.0f} ms before)"
        for depth in find_depths(leg, motion, _ground_height(plan))
        if depth.frame not in at_impact
    ]
    return [f"{when}: {listed(names)}; {remedy}"] if names else []


CHECKS: tuple[Callable[[CheckedPlan], Sequence[str]], ...] = (
    check_path,
    check_restitution_range,
    check_idle_joints,
    check_actuators,
    check_support,
    check_backswing,
    check_shapes,
    check_ball_overlap,
    check_ground_at_impact,
    check_ground_before_impact,
)
"""The checks of a plan, in the order of their lines."""


def find_overlaps(impact: Impact) -> dict[str, float]:
    """Return how deep bodies are inside the ball at an impact [m], by frame, the deepest first.

    Bodies of the contact joint count where they are deeper in it than the contact point is in them.
    """
    posture, leg, radius = impact.posture, impact.posture.leg, impact.ball.radius
    model, data, centre = leg.workspace.model, leg.workspace.data, impact.ball_before.position
    pin.forwardKinematics(model, data, posture.q)
    depths, feet, allowed = dict[str, float](), list[str](), TOUCHING
    for name, frame in body_frames(leg).items():
        pose = pin.updateFramePlacement(model, data, frame)
        distance = float(np.linalg.norm(pose.translation - centre))
        shapes = shapes_of(leg, name, meshes=distance < LARGEST_MESH + radius)
        bodies = [shape.moved(pose.homogeneous) for shape in shapes]
        depths[name] = max((radius + body.depth_of(centre) for body in bodies), default=0.0)
        if model.frames[frame].parentJoint == leg.contact_joint and depths[name] > TOUCHING:
            feet.append(name)
            point_depth = max(body.depth_of(posture.contact_point) for body in bodies)
            allowed = max(allowed, TOUCHING + point_depth)
    limits = {name: allowed if name in feet else TOUCHING for name in depths}
    overlaps = {name: depth for name, depth in depths.items() if depth > limits[name]}
    return dict(sorted(overlaps.items(), key=lambda item: -item[1]))


def _leg(plan: CheckedPlan) -> Leg:
    """Return the leg that kicks."""
    return plan.impact.posture.leg


def _ground_height(plan: CheckedPlan) -> float:
    """Return the height of the ground, under the ball or under a lower target [m, world frame]."""
    below = min(0.0, float(plan.goal.target[2])) - plan.impact.ball.radius
    return float(plan.impact.ball_before.position[2]) + below


def _depths_at_impact(plan: CheckedPlan) -> list[Depth]:
    """Return the bodies that are under the ground at the impact, the deepest first."""
    q: Array = plan.impact.posture.q
    return list(find_depths(_leg(plan), [q], _ground_height(plan)))


def _remedy_of_depths(plan: CheckedPlan, depths: list[Depth]) -> str:
    """Return what can bring bodies above the ground at the impact, as the end of a sentence."""
    if plan.balance is not None:
        return "another goal, offset or objective takes another posture"
    leg = _leg(plan)
    model = leg.workspace.model
    kicking = list(model.supports[leg.contact_joint])[1:]
    frames = body_frames(leg).items()
    idle = [name for name, i in frames if model.frames[i].parentJoint not in kicking]
    # more than the base is idle: the robot has another leg
    other_leg = len(idle) > 1 and any(depth.frame in idle for depth in depths)
    standing = ", or let the robot stand on its other foot (--support)" if other_leg else ""
    return (
        "the ground is level with the ball's lowest point: try another height of the ball "
        f"(ball_position, --ball-height){standing}"
    )
