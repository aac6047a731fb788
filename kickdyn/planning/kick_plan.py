"""A planned kick: the strike and the flight that verify it, and what of it needs attention."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.planning.backswing import Backswing
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.launch import Launch
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.plan_checks import CHECKS
from kickdyn.planning.swing_phase import SwingPhase
from kickdyn.robot.leg import Leg


@dataclass(frozen=True, eq=False, repr=False)
class KickPlan(ReprMixin):
    """A planned kick, verified by `strike` and `fly`.

    Attributes:
        status: `met`; or `beyond-limits`: the leg is not fast or strong enough, and this is the
            kick in the planned direction that gives the ball the most speed; or, with a `share` of
            1, the kick meets the goal but its `backswing` takes more than the torque limits.
        goal: the goal that was asked for.
        launch: the launch that meets the goal.
        objective: objective that was minimized, or maximized if it is `most-joint-impulse`.
        value: value of the objective.
        share: share of the launch speed that is reached; 1 where the goal is met.
        impact_target: impulse, normal and contact point on the ball.
        impact: the strike, from the planned posture and joint velocity.
        path: the flight from the impact to the plane of the target, or to the ground before it; of
            a pass, the course.
        speed_use: largest joint speed at the impact over its limit.
        torque_use: largest torque at the impact over its limit. The torque is that which keeps the
            speed of the joints, gravity included.
        binding: limits that are reached, such as `speed of knee` or `torque of knee`; `swing` where
            a harder kick has no motion from rest and to rest; `torque of knee in the backswing`
            where that takes more than the limit.
        heading: angle by which `leg` is turned to the left about the vertical [rad]; 0 but for a
            leg whose foot moves in a plane, and a goal aside of it.
        phases: backswing and follow-through that `swing=True` found with the kick; `plan_swing`
            starts from these.
        balance: distance of the centre of mass inside the edge of the sole, seen from above [m];
            None for a leg on a fixed base.
        backswing: motion from rest to the impact of a robot that stands on one foot, with
            `swing=True`; else None.
    """

    status: PlanStatus
    goal: Goal
    launch: Launch
    objective: KickObjective
    value: float
    share: float
    impact_target: ImpactTarget
    impact: Impact
    path: Flight | Course
    speed_use: float
    torque_use: float
    binding: tuple[str, ...]
    heading: float
    phases: tuple[SwingPhase, SwingPhase] | None = None
    balance: float | None = None
    backswing: Backswing | None = None

    def _rows(self) -> Iterable[Row]:
        """Return the lines that are shown."""
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

    def _picture(self) -> str:
        """Return a drawing of the path as an SVG."""
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
    def warnings(self) -> tuple[str, ...]:
        """A line for each limit, pose or flight of the plan that needs attention.

        What can be done about it follows after a semicolon; tables and pages leave it out.

        A coefficient of the flight or of the contact used outside its range; joints outside the
        kicking limb that are not at 0, because their range does not contain it; joints that move
        but have no actuator in an MJCF file; bodies that are inside the ball at the impact; bodies
        that are under the ground (level, under the ball or under the target, whichever is lower)
        at the impact. Bodies are the shapes in the leg's file; without any, its frames, which are
        compared with the ground only. Of a standing robot also a body of the kicking limb whose
        shape is not known, a support that does not stand, those of `backswing`, and bodies that are
        under the ground in the backswing; without one, while the foot approaches the ball by the
        ball's radius with the joints' velocity of the impact.
        """
        return tuple(line for check in CHECKS for line in check(self))

    @property
    def too_fast_after(self) -> dict[str, float]:
        """Speed over limit of the joints that exceed it just after the impact, by name."""
        limit, after = self.leg.velocity_limit, self.impact.v_after
        used = {name: abs(after[i]) / limit[i] for name, i in self._moving() if limit[i]}
        return {name: float(use) for name, use in used.items() if use > 1.0}

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
