"""A planned kick: the strike and the flight that verify it, and the checks of what needs attention.

A check is a function of a plan that returns lines. A line says what is the matter. What can be done
about it follows after a semicolon.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.leg_response import Footing
from kickdyn.impact.unilateral import unilateral_strike
from kickdyn.planning.backswing import Backswing
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.launch import Launch
from kickdyn.planning.objectives import OBJECTIVES, KickObjective
from kickdyn.planning.passes import Pass
from kickdyn.planning.swing_phase import SwingPhase
from kickdyn.restitution import range_warnings
from kickdyn.robot.collisions import find_ball_overlaps, find_self_collisions
from kickdyn.robot.ground_clearance import (
    Depth,
    find_depths,
)
from kickdyn.robot.kicking_chain import rest_configuration
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import listed, lock_remedy
from kickdyn.robot.standing import hold_support, missing_shapes

APPROACH_TIMES, BACKSWING_TIMES = 10, 40
"""Numbers of configurations of the approach at the velocity of the impact, and of a planned
backswing, whose bodies are compared with the ground."""


@dataclass(frozen=True, eq=False, repr=False)
class KickPlan(ReprMixin):
    """A planned kick, verified by `strike` and `fly`.

    Attributes:
        goal: the goal that was asked for.
        launch: the launch that meets the goal; of a pass, a `Pass`.
        objective: name of the quantity that was minimized or maximized.
        value: value of this quantity.
        share: share of the launch speed that is reached; 1 where the goal is met.
        impact_target: impulse, normal and contact point on the ball.
        impact: the strike, from the planned posture and joint velocity.
        path: the flight from the impact to the plane of the target, or to the ground before it; of
            a pass, the course.
        speed_use: largest joint speed at the impact over its limit.
        torque_use: largest torque at the impact over its limit. The torque is that which keeps the
            speed of the joints, gravity included.
        binding: limits that are reached, such as `torque of knee`; `swing` where a harder kick has
            no motion from rest and to rest; `torque of knee in the backswing` where that takes more
            than the limit.
        ball_is_placed: whether the height of the ball was given. If not, the level of the ground
            under a leg on a fixed base is not known.
        heading: angle by which `leg` is turned to the left about the vertical [rad]; 0 but for a
            leg whose foot moves in a plane, and a goal aside of it.
        phases: backswing and follow-through that `swing=True` found with the kick; `plan_swing`
            starts from these.
        balance: distance of the centre of mass inside the edge of the sole, seen from above [m];
            None for a leg on a fixed base.
        backswing: motion from rest to the impact of a robot that stands on one foot, with
            `swing=True`; else None.
    """

    goal: Goal
    launch: Launch | Pass
    objective: KickObjective
    value: float
    share: float
    impact_target: ImpactTarget
    impact: Impact
    path: Flight | Course
    speed_use: float
    torque_use: float
    binding: tuple[str, ...]
    ball_is_placed: bool
    heading: float
    phases: tuple[SwingPhase, SwingPhase] | None = None
    balance: float | None = None
    backswing: Backswing | None = None

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "posture", self.q, "rad"
        yield "joint velocity", self.v, "rad/s"
        yield "impulse on the ball", self.impact.impulse, "N s"
        yield "launch", self.impact.ball_after.velocity, "m/s"
        yield "landing error", self.landing_error, "m"
        yield "time error", self.time_error, "s"
        yield f"objective {self.objective}", self.value, OBJECTIVES[self.objective].unit
        yield "share of the speed limit", self.speed_use, ""
        yield "share of the torque limit", self.torque_use, ""
        yield from warned([line.partition("; ")[0] for line in self.warnings])

    def _picture(self) -> str:
        return self.path._picture()

    @property
    def leg(self) -> Leg:
        """The leg that kicks: as it was given, or turned by `heading`."""
        return self.impact.posture.leg

    @property
    def q(self) -> Array:
        """Posture at the impact, shape `(nq,)` [rad]."""
        return self.impact.posture.q

    @property
    def v(self) -> Array:
        """Joint velocity just before the impact, shape `(nv,)` [rad/s]."""
        return self.impact.v_before

    @property
    def landing_error(self) -> float:
        """Distance of the path's end from the target [m]."""
        end = self.path.landing if isinstance(self.path, Flight) else self.path.rest
        off = end.position - self.impact.ball_after.position - self.goal.target
        return float(np.linalg.norm(off))

    @property
    def time_error(self) -> float:
        """Duration of the path less the time of `launch` [s]."""
        return self.path.duration - self.launch.time

    @cached_property
    def status(self) -> PlanStatus:
        """Whether the plan meets the goal and can be carried out, else its worst fault.

        `beyond-limits`: the leg is not fast or strong enough, and this is the kick in the planned
        direction that gives the ball the most speed; or, with a `share` of 1, the `backswing` takes
        more than the torque limits. `support-moves`: the foot that the robot stands on does not
        stay at rest. `collides`: a body is inside the ball or another body, or under the ground.
        """
        too_strong = self.backswing is not None and self.backswing.too_strong
        if self.share < 1.0 or too_strong:
            return PlanStatus.BEYOND_LIMITS
        faults = [CHECKS[check] for check, lines in self._lines.items() if lines]
        return max([PlanStatus.MET, *faults], key=list(PlanStatus).index)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The lines of `CHECKS`; what can be done about a line follows in it after a semicolon.

        Bodies are compared with the ball and with the ground (level, under the ball or under the
        target, whichever is lower). They are the shapes in the leg's file; without any, its frames,
        which are compared with the ground only.
        """
        return tuple(line for lines in self._lines.values() for line in lines)

    @cached_property
    def _lines(self) -> "dict[Check, Sequence[str]]":
        return {check: check(self) for check in CHECKS}

    @property
    def too_fast_after(self) -> dict[str, float]:
        """Speed over limit of the joints that exceed it just after the impact, by name."""
        limit, after = self.leg.velocity_limit, np.abs(self.impact.v_after)
        fast = [(name, i) for name, i in self._moving() if limit[i] and after[i] > limit[i]]
        return {name: float(after[i] / limit[i]) for name, i in fast}

    @property
    def into_stop(self) -> tuple[str, ...]:
        """Joints at an end of their range that move on beyond it just after the impact."""
        joints, values = [], self.leg.joint_values(self.q)
        for name, i in self._moving():
            (low, high), v = self.leg.joint_range(name), self.impact.v_after[i]
            if (values[name] - low < 1e-6 and v < 0.0) or (high - values[name] < 1e-6 and v > 0.0):
                joints.append(name)
        return tuple(joints)

    def _moving(self) -> list[tuple[str, int]]:
        """Return the joints that move just after the impact, with their index in v."""
        leg, speed = self.leg, np.abs(self.impact.v_after)
        every = [(name, leg.velocity_index(name)) for name in leg.single_joints]
        return [(name, i) for name, i in every if speed[i] > 1e-9 * speed.max()]


def check_path(plan: KickPlan) -> Sequence[str]:
    """Return the warnings of the flight."""
    return plan.path.warnings


def check_restitution_range(plan: KickPlan) -> Sequence[str]:
    """Return a line where the restitution is used outside its range of speeds."""
    return range_warnings(plan.impact.contact.restitution, plan.impact.approach_speed)


def check_idle_joints(plan: KickPlan) -> Sequence[str]:
    """Return a line for the joints that the kick does not move and that cannot be at 0."""
    leg, v = plan.leg, plan.v
    rest, planned = leg.display_values(rest_configuration(leg)), leg.display_values(plan.q)
    idle = [
        f"{name} at {value:.4g} {unit}"
        for name, (value, unit) in rest.items()
        if value and value == planned[name][0] and v[leg.velocity_index(name)] == 0.0
    ]
    if not idle:
        return []
    return [
        "joints that the kick does not move stay at 0 or, where their range does not contain it, "
        f"at the nearest value in the range: {listed(idle)}"
    ]


def check_actuators(plan: KickPlan) -> Sequence[str]:
    """Return a line for the joints that move but that the leg's file does not drive."""
    leg, v = plan.leg, plan.v
    passive = () if leg.file is None else leg.file.passive_joints
    moved = [x for x in passive if x in leg.single_joints and v[leg.velocity_index(x)]]
    if not moved:
        return []
    remedies = [listed(moved), lock_remedy(leg.workspace.model, moved)]
    return [
        "the plan moves joints that have no actuator in the leg's file: "
        + "; to keep them at rest, ".join(filter(None, remedies))
    ]


def check_support(plan: KickPlan) -> Sequence[str]:
    """Return a line for each support that lifts off, slips or tips."""
    return [
        f"{name} {state.replace('-', ' ')}; the plan assumes that it stays at rest, which takes an "
        "impulse that the ground cannot supply (kd.unilateral_strike computes the impact with "
        "ground that can only push)"
        for name, state in plan.impact.footing.items()
        if state not in (Footing.STANDS, Footing.TURNS)
    ]


def check_twist(plan: KickPlan) -> Sequence[str]:
    """Return a line for each support whose friction cannot supply the moment about the vertical.

    G1's foot then twists a little, which changes the ball's velocity by about 1e-3 m/s.
    """
    impact = plan.impact
    turning = [name for name, state in impact.footing.items() if state == Footing.TURNS]
    if not turning:
        return ()
    try:
        free = unilateral_strike(impact.posture, impact.v_before, impact.ball, impact.contact)
    except KickdynError as error:
        return [f"it is unknown whether the foot stands ({error})"]
    change = float(np.linalg.norm(free.ball_after.velocity - impact.ball_after.velocity))
    return [
        f"{listed(turning)} turns about the vertical, because friction cannot supply the moment: "
        f"this changes the ball's velocity by {change:.2g} m/s; kd.unilateral_strike computes this "
        "impact"
    ]


def check_backswing(plan: KickPlan) -> Sequence[str]:
    """Return the warnings of the backswing."""
    return () if plan.backswing is None else plan.backswing.warnings


def check_shapes(plan: KickPlan) -> Sequence[str]:
    """Return a line for each body of a standing robot's kicking limb of unknown shape."""
    leg = plan.leg
    if plan.balance is None or leg.constraints is None:
        return []
    return missing_shapes(leg, leg.constraints.supports[0])


def check_ball_overlap(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are inside the ball at the impact, if any."""
    impact = plan.impact
    depths = find_ball_overlaps(impact.posture, impact.ball_before.position, impact.ball.radius)
    if not depths:
        return []
    overlaps = [f"{name} by {depth:.3f} m" for name, depth in depths.items()]
    return [
        f"bodies are inside the ball at the impact: {listed(overlaps)}; another contact point "
        "(offset, --offset) or a flatter launch can avoid this"
    ]


def check_self_collision(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are inside each other at the impact, if any."""
    pairs = find_self_collisions(plan.leg, plan.q)
    if not pairs:
        return []
    depths = [f"{first} and {other} by {depth:.3f} m" for (first, other), depth in pairs.items()]
    return [
        f"bodies are inside each other at the impact: {listed(depths)}; another goal, offset or "
        "objective takes another posture"
    ]


def check_ground_at_impact(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are under the ground at the impact."""
    return _describe_depths(plan) if plan.ball_is_placed else ()


def check_ground_of_free_ball(plan: KickPlan) -> Sequence[str]:
    """Return the same line where the ground is assumed under a ball whose height is free."""
    return () if plan.ball_is_placed else _describe_depths(plan)


def _describe_depths(plan: KickPlan) -> list[str]:
    names = [f"{depth.frame} by {depth.depth:.3f} m" for depth in _depths_at_impact(plan)]
    if not names:
        return []
    remedy = "another goal, offset or objective takes another posture"
    if plan.balance is None:
        remedy = (
            "the ground is level with the ball's lowest point: try another height of the ball "
            "(ball_position, --ball-height)"
        )
    return [f"bodies are under the ground at the impact: {listed(names)}; {remedy}"]


def check_ground_in_backswing(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are under the ground in the backswing."""
    backswing = plan.backswing
    if backswing is None:
        return ()
    times = -backswing.duration * np.linspace(0.0, 1.0, BACKSWING_TIMES) ** 2
    motion = [backswing.configuration(time) for time in times]
    names = _describe_depths_before(plan, times, motion)
    remedy = "another goal, offset or objective takes another motion"
    return [f"bodies are under the ground in the backswing: {names}; {remedy}"] if names else []


def check_ground_in_approach(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies of a standing robot without a backswing that come from below.

    The foot approaches the ball by the ball's radius with the joint velocity of the impact.
    """
    if plan.balance is None or plan.backswing is not None:
        return ()
    impact, model = plan.impact, plan.leg.workspace.model
    duration = impact.ball.radius / math.hypot(*impact.foot_velocity)
    times = np.linspace(0.0, -duration, APPROACH_TIMES)
    q, v = plan.q, plan.v
    motion = [hold_support(impact.posture, pin.integrate(model, q, t * v)) for t in times]
    names = _describe_depths_before(plan, times, motion)
    when = "bodies come from under the ground if the joints keep the velocity of the impact"
    remedy = "swing=True (--swing) plans the motion, with the foot above the ground"
    return [f"{when}: {names}; {remedy}"] if names else []


def _describe_depths_before(plan: KickPlan, times: Array, motion: Sequence[Array]) -> str:
    """Return the bodies that are under the ground in a motion, but not at the impact."""
    at_impact = {depth.frame for depth in _depths_at_impact(plan)}
    return listed([
        f"{depth.frame} by {depth.depth:.3f} m ({-1e3 * times[depth.number]:.0f} ms before)"
        for depth in find_depths(plan.leg, motion, _ground_height(plan))
        if depth.frame not in at_impact
    ])  # fmt: skip


Check = Callable[[KickPlan], Sequence[str]]

CHECKS: dict[Check, PlanStatus] = {
    check_path: PlanStatus.MET,
    check_restitution_range: PlanStatus.MET,
    check_idle_joints: PlanStatus.MET,
    check_actuators: PlanStatus.MET,
    check_support: PlanStatus.SUPPORT_MOVES,
    check_twist: PlanStatus.MET,
    check_backswing: PlanStatus.SUPPORT_MOVES,
    check_shapes: PlanStatus.MET,
    check_ball_overlap: PlanStatus.COLLIDES,
    check_self_collision: PlanStatus.COLLIDES,
    check_ground_at_impact: PlanStatus.COLLIDES,
    check_ground_of_free_ball: PlanStatus.MET,
    check_ground_in_backswing: PlanStatus.COLLIDES,
    check_ground_in_approach: PlanStatus.MET,
}
"""The checks of a plan, in the order of their lines, and the status of a plan with such a line."""


def _ground_height(plan: KickPlan) -> float:
    """Return the height of the ground, under the ball or under a lower target [m, world frame]."""
    below = min(0.0, float(plan.goal.target[2])) - plan.impact.ball.radius
    return float(plan.impact.ball_before.position[2]) + below


def _depths_at_impact(plan: KickPlan) -> list[Depth]:
    return find_depths(plan.leg, [plan.q], _ground_height(plan))
