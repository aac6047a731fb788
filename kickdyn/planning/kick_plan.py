"""A planned kick: the strike and the flight that verify it, and the checks of what needs attention.

A check is a function of a plan that returns lines. A line says what is the matter. What can be done
about it follows after a semicolon.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.leg_response import Footing
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.motion.motion import Motion
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.launch import Launch
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.passes import Pass
from kickdyn.restitution import range_warnings
from kickdyn.robot.collisions import find_ball_overlaps, find_self_collisions
from kickdyn.robot.ground_clearance import Depth, find_depths
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import listed, lock_remedy
from kickdyn.robot.standing import missing_shapes

MOTION_TIMES = 80
"""Number of configurations of a planned motion in which bodies are compared with the ground, the
ball and each other."""

MOST_PAIRS = 3
"""Number of pairs of bodies that a line names."""

Overlap = TypeVar("Overlap")
"""What names an overlap: a frame, for one with the ball, or a pair of frames."""


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
        speed_use: largest joint speed over its limit, at the impact or in the `motion`.
        torque_use: largest torque over its limit, likewise. Without a motion, the torque is that
            which keeps the speed of the joints, gravity included.
        binding: limits that are reached, such as `torque of knee`.
        ball_is_placed: whether the height of the ball was given. If not, the level of the ground
            under a leg on a fixed base is not known.
        heading: angle by which `leg` is turned to the left about the vertical [rad]; 0 but for a
            leg whose foot moves in a plane, and a goal aside of it.
        balance: distance of the centre of mass inside the edge of the sole, seen from above [m];
            None for a leg on a fixed base.
        motion: from rest through the impact to rest, with `motion=True`; else None.
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
    balance: float | None = None
    motion: Motion | None = None

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "posture", self.q, "rad"
        yield "joint velocity", self.v, "rad/s"
        yield "impulse on the ball", self.impact.impulse, "N s"
        yield "launch", self.impact.ball_after.velocity, "m/s"
        yield "landing error", self.landing_error, "m"
        yield "time error", self.time_error, "s"
        yield f"objective {self.objective}", self.value, self.objective.unit
        yield "share of the speed limit", self.speed_use, ""
        yield "share of the torque limit", self.torque_use, ""
        yield from warned([line.partition("; ")[0] for line in self.warnings])

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
        """Distance of the path's end from the target [m]; by `strike` in a refined plan, too."""
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
        direction that gives the ball the most speed; or the `motion` does not keep a limit.
        `support-moves`: the foot that the robot stands on does not stay at rest. `collides`: a body
        is inside the ball or another body, or under the ground.
        """
        if self.share < 1.0:
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


def check_path(plan: KickPlan) -> Sequence[str]:
    """Return the warnings of the flight."""
    return plan.path.warnings


def check_restitution_range(plan: KickPlan) -> Sequence[str]:
    """Return a line where the restitution is used outside its range of speeds."""
    return range_warnings(plan.impact.contact.restitution, plan.impact.approach_speed)


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


def check_motion(plan: KickPlan) -> Sequence[str]:
    """Return a line for each limit that the motion does not keep."""
    return () if plan.motion is None else plan.motion.warnings


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
    return _line_about(
        "bodies are inside the ball at the impact",
        [f"{name} by {depth:.3f} m" for name, depth in depths.items()],
        "another contact point (offset, --offset) or a flatter launch can avoid this",
    )


def check_self_collision(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are inside each other at the impact, if any."""
    depths = find_self_collisions(plan.leg, plan.q)
    return _line_about(
        "bodies are inside each other at the impact",
        [f"{first} and {other} by {depth:.3f} m" for (first, other), depth in depths.items()],
        "another goal, offset or objective takes another posture",
    )


def check_self_collision_in_motion(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are inside each other in the motion, but not at 0."""
    if plan.motion is None:
        return ()
    deepest = _deepest_in_motion(lambda q: find_self_collisions(plan.leg, q), plan, plan.motion.end)
    return _line_about(
        "bodies are inside each other in the motion",
        [
            f"{first} and {other} by {depth:.3f} m at {t:.2f} s"
            for (first, other), (depth, t) in deepest
        ],
        "another goal, or another posture of locked joints (--lock), can avoid this",
        MOST_PAIRS,
    )


def check_ball_overlap_in_motion(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are inside the ball before the impact, but not at 0."""
    if plan.motion is None:
        return ()
    before, radius = plan.impact.ball_before, plan.impact.ball.radius
    deepest = _deepest_in_motion(
        lambda q: find_ball_overlaps(plan.leg.posture(q), before.position, radius), plan, 0.0
    )
    return _line_about(
        "bodies are inside the ball before the impact",
        [f"{name} by {depth:.3f} m at {t:.2f} s" for name, (depth, t) in deepest],
        "another goal takes another motion",
    )


def _deepest_in_motion(
    find: Callable[[Array], Mapping[Overlap, float]], plan: KickPlan, end: float
) -> list[tuple[Overlap, tuple[float, float]]]:
    """Return how deep bodies overlap [m] and when [s], the deepest first, without those at 0.

    Overlaps are sought by q at `MOTION_TIMES` times from the beginning of the motion to `end`.
    """
    motion = plan.motion
    if motion is None:
        return []
    at_impact = find(plan.q)
    deepest: dict[Overlap, tuple[float, float]] = {}
    for t in np.linspace(motion.begin, end, MOTION_TIMES).tolist():
        for overlap, depth in find(motion.q(t)).items():
            if overlap not in at_impact:
                deepest[overlap] = max((depth, t), deepest.get(overlap, (0.0, 0.0)))
    return sorted(deepest.items(), key=lambda item: -item[1][0])


def check_ground_at_impact(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are under the ground at the impact."""
    return _line_about_ground(plan) if plan.ball_is_placed else ()


def check_ground_of_free_ball(plan: KickPlan) -> Sequence[str]:
    """Return the same line where the ground is assumed under a ball whose height is free."""
    return () if plan.ball_is_placed else _line_about_ground(plan)


def _line_about_ground(plan: KickPlan) -> Sequence[str]:
    remedy = "another goal, offset or objective takes another posture"
    if plan.balance is None:
        remedy = (
            "the ground is level with the ball's lowest point: try another height of the ball "
            "(ball_position, --ball-height)"
        )
    return _line_about(
        "bodies are under the ground at the impact",
        [f"{depth.frame} by {depth.depth:.3f} m" for depth in _depths(plan, [plan.q])],
        remedy,
    )


def check_ground_in_motion(plan: KickPlan) -> Sequence[str]:
    """Return a line for the bodies that are under the ground in the motion, but not at 0."""
    motion = plan.motion
    if motion is None or not plan.ball_is_placed:
        return ()
    times = np.linspace(motion.begin, motion.end, MOTION_TIMES)
    at_impact = {depth.frame for depth in _depths(plan, [plan.q])}
    return _line_about(
        "bodies are under the ground in the motion",
        [
            f"{depth.frame} by {depth.depth:.3f} m at {times[depth.number]:.2f} s"
            for depth in _depths(plan, [motion.q(t) for t in times])
            if depth.frame not in at_impact
        ],
        "another goal, offset or objective takes another motion",
    )


def _line_about(fault: str, bodies: Sequence[str], remedy: str, most: int = 40) -> Sequence[str]:
    """Return a line with a fault, the bodies that have it and a remedy; none without bodies."""
    return [f"{fault}: {listed(bodies, most)}; {remedy}"] if bodies else ()


Check = Callable[[KickPlan], Sequence[str]]

CHECKS: dict[Check, PlanStatus] = {
    check_path: PlanStatus.MET,
    check_restitution_range: PlanStatus.MET,
    check_actuators: PlanStatus.MET,
    check_support: PlanStatus.SUPPORT_MOVES,
    check_motion: PlanStatus.BEYOND_LIMITS,
    check_shapes: PlanStatus.MET,
    check_ball_overlap: PlanStatus.COLLIDES,
    check_self_collision: PlanStatus.COLLIDES,
    check_ground_at_impact: PlanStatus.COLLIDES,
    check_ground_of_free_ball: PlanStatus.MET,
    check_self_collision_in_motion: PlanStatus.COLLIDES,
    check_ball_overlap_in_motion: PlanStatus.COLLIDES,
    check_ground_in_motion: PlanStatus.COLLIDES,
}
"""The checks of a plan, in the order of their lines, and the status of a plan with such a line."""


def _depths(plan: KickPlan, configurations: Sequence[Array]) -> list[Depth]:
    """Return the bodies under the ground, which is under the ball or under a lower target."""
    below = min(0.0, float(plan.goal.target[2])) - plan.impact.ball.radius
    height = float(plan.impact.ball_before.position[2]) + below
    return find_depths(plan.leg, configurations, height)
