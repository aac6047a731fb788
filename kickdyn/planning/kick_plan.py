"""A planned kick: the strike and the flight that verify it, and the checks of what needs attention.

A check returns lines. A line says what is the matter, and after a semicolon what can be done.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.leg_response import Footing
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.motion.motion import Motion
from kickdyn.planning.ball_sensitivity import BallSensitivity, sensitivity_to_ball
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.interception import IncomingBall
from kickdyn.planning.kick_terms import KickObjective
from kickdyn.planning.launch import Launch
from kickdyn.planning.meeting import Meeting, meeting_figure
from kickdyn.planning.passes import Pass
from kickdyn.restitution import range_warnings
from kickdyn.robot.collisions import find_ball_overlaps, find_self_collisions
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import listed, lock_remedy
from kickdyn.robot.standing import missing_shapes

MOTION_TIMES = 80
"""Number of configurations of a planned motion in which bodies are compared with the ground, the
ball and each other."""

MOST_NAMED = 3
"""Number of overlaps in a motion that a line names."""

NO_TARGET = "the plan is a trap: it has no target"

OTHER_POSTURE = "another goal, offset or objective gives another posture"
OTHER_HEIGHT = (
    "the ground is level with the ball's lowest point: try another height of the ball "
    "(ball_position, --ball-height)"
)
"""Remedies for bodies that overlap at the impact."""


@dataclass(frozen=True, eq=False, repr=False)
class KickPlan(ReprMixin):
    """A planned kick, verified by `strike` and `fly`.

    Attributes:
        goal: the goal that was asked for, seen from where the ball is kicked; for a receiver who
            runs, the target where he is met; of a trap, the ball as it is wished.
        launch: the launch that meets the goal; of a pass, a `Pass`; of a trap, the ball with the
            spin that it keeps.
        objective: name of the quantity that was minimized or maximized.
        value: value of this quantity.
        share: share of the impulse that is reached, which is the share of the launch speed of a
            ball at rest, and of the change of velocity of one that moves; 1 where the goal is met.
            It is a lower bound, the best of the local optima from some 50 starts; of a ball that
            moves, from some 20 at the best time.
        impact_target: impulse, normal and contact point on the ball.
        impact: the strike, from the planned posture and joint velocity.
        path: the flight from the impact to the plane of the target, or to the ground before it; of
            a pass or a trap, the course.
        speed_use: largest joint speed over its limit, at the impact or in the `motion`.
        torque_use: largest torque over its limit, likewise. Without a motion, the torque is that
            which keeps the speed of the joints, gravity included. In a motion with
            `limits="muscles"`, it is 1 minus the least distance between a torque and the largest
            one at its speed, over the limit at rest.
        binding: limits that are reached, such as `torque of knee`.
        ball_place: height of the ball's centre [m], or its position, shape `(3,)`, as it was given.
            None if it was not: the level of the ground under a leg on a fixed base is not known.
        heading: angle by which `leg` is turned to the left about the vertical [rad]; 0 but for a
            leg whose foot moves in a plane, and a goal aside of it.
        moved: displacement of `leg` across its plane, after the turn by `heading`, to a ball beside
            it, shape `(3,)` [m, world frame]; 0 but for a leg whose foot moves in a plane.
        balance: distance of the centre of mass inside the edge of the sole, seen from above [m];
            None for a leg on a fixed base.
        motion: from rest through the impact to rest, with `motion=True`; else None.
        meeting: where and when a ball that moves is met; None for a ball at rest.
        meetings: those that were considered, by time.
        muscles: whether torque limits fall with speed, `limits="muscles"`.
        corrected_by: `collide` or `mujoco`, by which `refine_kick` has corrected the launch of
            `strike`, or empty.
    """

    goal: Goal | BallState
    launch: Launch | Pass | BallState
    objective: KickObjective
    value: float
    share: float
    impact_target: ImpactTarget
    impact: Impact
    path: Flight | Course
    speed_use: float
    torque_use: float
    binding: tuple[str, ...]
    ball_place: float | Array | None
    heading: float
    moved: Array = field(default_factory=lambda: validation.read_only(np.zeros(3)))
    balance: float | None = None
    motion: Motion | None = None
    meeting: Meeting | None = None
    meetings: tuple[Meeting, ...] = ()
    muscles: bool = False
    corrected_by: str = ""
    _again: "Callable[[KickPlan, IncomingBall], KickPlan] | None" = field(default=None, repr=False)

    def replan(self, *, incoming: BallState | IncomingBall) -> "KickPlan":
        """Return the plan for the same ball seen again, met at the same time by the clock.

        The target stays where it is in the world. The search starts from the posture of this plan;
        if there is none near it, the whole plan is made again for this time. The `time` of
        `incoming` is by the clock of the first one.

        Raises:
            InvalidInput: a plan of a ball at rest, a ball seen after the meeting, or as for
                `plan_kick`.
        """
        if self._again is None or self.meeting is None:
            raise InvalidInput("the ball is at rest: replan needs plan_kick(..., incoming=)")
        validation.check_type(BallState, IncomingBall, incoming=incoming)
        ground = self.meeting.ground
        seen = incoming if isinstance(incoming, BallState) else incoming.state
        if isinstance(incoming, IncomingBall) and incoming.ground is not None:
            ground = incoming.ground
        return self._again(self, IncomingBall(seen, ground, self.meeting.time))

    def plot(self) -> Any:
        """Return a figure of matplotlib: of the motion, or of the meetings with a ball that moves.

        The latter shows the speed use of each meeting, and errors of timing and perception at the
        target. A plan without either raises `InvalidInput`.
        """
        if self.motion is not None:
            return self.motion.plot()
        if self.meeting is None:
            raise InvalidInput("nothing to plot: the plan has no motion, and the ball is at rest")
        return meeting_figure(self)

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        if self.corrected_by:
            yield "corrected by", self.corrected_by, ""
        if self.meeting is not None:
            yield "time of the meeting", self.meeting.time, "s"
            yield "place of the meeting", self.meeting.ball.position, "m"
            if isinstance(self.goal, Goal):
                yield "target in the world frame", self.target_position, "m"
            if self.share < 1.0:
                yield "share of the change of velocity", self.share, ""
        up, left = self.impact_target.contact_offset
        yield "contact above the ball's centre", 1e3 * up, "mm"
        yield "contact to the left of it", round(1e3 * left, 9), "mm"
        if abs(math.degrees(self.heading)) >= 0.005:
            yield "heading", math.degrees(self.heading), "deg"
        if self.moved.any():
            yield "leg moved by", self.moved, "m"
        leg = self.leg
        for name, (value, unit) in leg.display_values(self.q).items():
            speed = float(self.v[leg.velocity_index(name)])
            if value or speed:
                yield name, round(value, 9), f"{unit}, {speed:.4g} {leg.joint_unit(name)}/s"
        yield "impulse on the ball", self.impact.impulse, "N s"
        yield "launch", self.impact.ball_after.velocity, "m/s"
        if self.share < 1.0:
            yield "wished launch", self.launch.velocity, "m/s"
        if isinstance(self.goal, Goal):
            yield "landing error", self.landing_error, "m"
            yield "time error", self.time_error, "s"
        else:
            yield "velocity error", self.velocity_error, "m/s"
        yield f"objective {self.objective}", self.value, self.objective.unit
        yield "share of the speed limit", self.speed_use, ""
        yield "share of the torque limit", self.torque_use, ""
        yield from self.sensitivity_to_ball.rows if self.sensitivity_to_ball else ()
        yield from warned(self.warnings)

    @property
    def leg(self) -> Leg:
        """The leg that kicks: as it was given, or turned by `heading` and `moved`."""
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
    def aim(self) -> Goal:
        """The goal of a kick to a target; a trap raises `InvalidInput`."""
        if not isinstance(self.goal, Goal):
            raise InvalidInput(NO_TARGET)
        return self.goal

    @property
    def target_position(self) -> Array:
        """Where the target is, shape `(3,)` [m, world frame]; of a kick to a target."""
        return np.asarray(self.impact.ball_before.position + self.aim.target)

    @property
    def landing_error(self) -> float:
        """Distance of the path's end from the target [m]; by `strike` in a refined plan, too."""
        end = self.path.landing if isinstance(self.path, Flight) else self.path.rest
        return math.dist(end.position, self.target_position)

    @property
    def time_error(self) -> float:
        """Duration of the path less the time of `launch` [s]; of a kick to a target."""
        if isinstance(self.launch, BallState):
            raise InvalidInput(NO_TARGET)
        return self.path.duration - self.launch.time

    @property
    def velocity_error(self) -> float:
        """Distance of the velocity after the impact from the velocity of `launch` [m/s]."""
        return math.dist(self.impact.ball_after.velocity, self.launch.velocity)

    @cached_property
    def sensitivity_to_ball(self) -> BallSensitivity | None:
        """Change of the launch if the ball lies 1 cm from its place; None for a trap.

        The ball is displaced along and across the horizontal direction of the launch, to either
        side, and the larger change of direction, and of speed, counts. The foot moves as planned,
        after the planned impact with the acceleration just before it. It thus meets the ball with
        another point of the foot, at another time, with another normal and lever, and `strike`
        gives the launch. The differences are from the ball in its place, struck by the same foot.

        The foot is the shapes that strike in `run_in_mujoco`. Where the file has none, or the ball
        is more than 5 cm from where they pass, it is a plane through the contact point, across the
        normal. The displacement is finite, because shapes have facets and edges: a derivative is
        that of one facet.
        """
        if not isinstance(self.goal, Goal):
            return None
        return sensitivity_to_ball(self.impact, self.motion)

    @cached_property
    def status(self) -> PlanStatus:
        """Whether the plan meets the goal and can be carried out, else its worst fault.

        `beyond-limits`: the leg is not fast or strong enough, and this is the kick in the planned
        direction that gives the ball the most speed; or the `motion` does not keep a limit.
        `support-moves`: the foot that the robot stands on does not stay at rest. `collides`: a body
        is inside the ball or another body, or under the ground.
        """
        if self.share < 1.0:
            return PlanStatus.BEYOND_LIMITS
        statuses = [PlanStatus.MET, *(status for status, _ in self._lines)]
        return max(statuses, key=list(PlanStatus).index)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each fault; what can be done about it follows in it after a semicolon.

        Bodies are compared with the ball and with the ground (level, under the ball or under the
        target, whichever is lower). They are the shapes in the leg's file; without any, its frames,
        which are compared with the ground only.
        """
        return tuple(line for _, line in self._lines)

    @property
    def collisions(self) -> tuple[str, ...]:
        """The `warnings` by which the status is `collides`."""
        return tuple(line for status, line in self._lines if status == PlanStatus.COLLIDES)

    @cached_property
    def _lines(self) -> Sequence[tuple[PlanStatus, str]]:
        """The lines of all checks, each with the status of a plan that has it."""
        met, motion = PlanStatus.MET, self.motion
        contact, speed = self.impact.contact, self.impact.approach_speed
        checks = [
            (met, self.path.warnings),
            (met, range_warnings(contact.restitution, speed)),
            (met, check_actuators(self)),
            (met, check_drives(self)),
            (PlanStatus.SUPPORT_MOVES, check_support(self)),
            (PlanStatus.BEYOND_LIMITS, () if motion is None else motion.warnings),
            (met, () if self.balance is None else missing_shapes(self.leg, self.leg.supports[0])),
            *check_overlaps_at_impact(self),
            *((PlanStatus.COLLIDES, lines) for lines in check_overlaps_in_motion(self)),
        ]
        return [(status, line) for status, lines in checks for line in lines]


def check_actuators(plan: KickPlan) -> Sequence[str]:
    """Return a line for the joints that move but that the leg's file does not drive."""
    leg, v = plan.leg, plan.v
    passive = () if leg.file is None else leg.file.passive_joints
    undriven = [x for x in passive if x in leg.single_joints and v[leg.velocity_index(x)]]
    if not undriven:
        return []
    remedies = [listed(undriven), lock_remedy(leg.workspace.model, undriven)]
    return [
        "the plan moves joints that have no actuator in the leg's file: "
        + "; to keep them at rest, ".join(filter(None, remedies))
    ]


def check_drives(plan: KickPlan) -> Sequence[str]:
    """Return a line for the motion of a standing robot whose joints have no rotors."""
    if plan.motion is None or plan.balance is None or plan.leg.model.armature.any():
        return []
    return [
        "no joint has the inertia of a rotor, so that the motion asks more of real drives than "
        "planned; give their drives (Leg.with_drives, --drives FILE)"
    ]


def check_support(plan: KickPlan) -> Sequence[str]:
    """Return a line for each support that lifts off, slips or tips."""
    return [
        f"{name} {state.replace('-', ' ')}; the plan assumes that it stays at rest, which requires "
        "an impulse that the ground cannot supply (kd.unilateral_strike computes the impact with "
        "ground that can only push)"
        for name, state in plan.impact.footing.items()
        if state not in (Footing.STANDS, Footing.TURNS)
    ]


Overlaps = Callable[[KickPlan, Array, float], Mapping[str, float]]
"""From a plan, and q at a time [s], to how deep bodies overlap with something [m] by name, the
deepest first."""


def check_overlaps_at_impact(plan: KickPlan) -> Iterator[tuple[PlanStatus, Sequence[str]]]:
    """Yield lines for bodies that overlap at the impact, with the status of such a plan.

    Where the height of the ball is free, the ground is assumed under it, and the line is a warning.
    """
    remedy = OTHER_POSTURE if plan.balance is not None else OTHER_HEIGHT
    if plan.meeting is not None and plan.balance is None:
        remedy = f"the ground is at z = {plan.meeting.ground.height:.4g} m, and " + (
            "so it is in every meeting with a kick"
            if len(plan.meetings) > 1
            else "another time or place of the meeting, or lower ground, can avoid this"
        )
    other_point = "another contact point (offset, --offset) or a flatter launch can avoid this"
    on_ground = PlanStatus.COLLIDES if plan.ball_place is not None else PlanStatus.MET
    overlaps: Sequence[tuple[Overlaps, str, str, PlanStatus]] = (
        (_in_ball, "inside the ball", other_point, PlanStatus.COLLIDES),
        (_in_each_other, "inside each other", OTHER_POSTURE, PlanStatus.COLLIDES),
        (_under_ground, "under the ground", remedy, on_ground),
    )
    for find, where, remedy, status in overlaps:
        bodies = [f"{name} by {depth:.3f} m" for name, depth in find(plan, plan.q, 0.0).items()]
        line = f"bodies are {where} at the impact: {listed(bodies)}; {remedy}"
        yield status, [line] if bodies else []


def check_overlaps_in_motion(plan: KickPlan) -> Iterator[Sequence[str]]:
    """Yield lines for bodies that overlap in the motion, but not at the impact."""
    motion = plan.motion
    if motion is None:
        return
    times = np.linspace(motion.begin, motion.end, MOTION_TIMES)
    swing = np.linspace(motion.begin, 0.0, MOTION_TIMES)
    locked = "another goal, or another posture of locked joints (--lock), can avoid this"
    goal = "another goal gives another motion"
    other = "another goal, offset or objective gives another motion"
    yield _in_motion(plan, _in_each_other, "inside each other in the motion", locked, times)
    yield _in_motion(plan, _in_ball, "inside the ball before the impact", goal, swing)
    yield check_ball_overlap_after(plan)
    if plan.ball_place is not None:
        yield _in_motion(plan, _under_ground, "under the ground in the motion", other, times)


def check_ball_overlap_after(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies of a moving robot that are in the way of the ball's path."""
    if plan.motion is None:
        return ()
    step = 0.5 * plan.impact.ball.radius / float(plan.impact.ball_after.speed)
    times = np.arange(step, min(plan.motion.end, plan.path.duration), step)
    remedy = "another direction of the launch can avoid this"
    return _in_motion(plan, _in_ball, "in the way of the ball after the impact", remedy, times)


def _in_ball(plan: KickPlan, q: Array, t: float) -> Mapping[str, float]:
    ball = plan.path.sample(t) if t > 0.0 else plan.impact.ball_before
    return find_ball_overlaps(plan.leg.posture(q), ball.position, plan.impact.ball.radius)


def _in_each_other(plan: KickPlan, q: Array, _: float) -> Mapping[str, float]:
    pairs = find_self_collisions(plan.leg, q)
    return {f"{first} and {other}": depth for (first, other), depth in pairs.items()}


def _under_ground(plan: KickPlan, q: Array, _: float) -> Mapping[str, float]:
    """Return depths under the ground, which is under the ball or under a lower target."""
    if plan.meeting is not None:
        height = plan.meeting.ground.height
    else:
        below = min(0.0, float(plan.aim.target[2])) - plan.impact.ball.radius
        height = float(plan.impact.ball_before.position[2]) + below
    return find_depths(plan.leg, q, height)


def _in_motion(plan: KickPlan, find: Overlaps, where: str, remedy: str, t: Array) -> list[str]:
    """Return a line for overlaps at times of the motion [s], without those at 0."""
    motion = plan.motion
    assert motion is not None
    at_impact, deepest = find(plan, plan.q, 0.0), dict[str, tuple[float, float]]()
    for time in t.tolist():
        for name, depth in find(plan, motion.q(time), time).items():
            if name not in at_impact:
                deepest[name] = max((depth, time), deepest.get(name, (0.0, 0.0)))
    ranked = sorted(deepest.items(), key=lambda item: -item[1][0])
    bodies = [f"{name} by {depth:.3f} m at {time:.2f} s" for name, (depth, time) in ranked]
    return [f"bodies are {where}: {listed(bodies, MOST_NAMED)}; {remedy}"] if bodies else []
