"""What planning a kick answers: the goal, the launch, the strike and the flight."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.launch import Launch
from kickdyn.planning.objectives import SAID, UNITS
from kickdyn.planning.swing_phase import SwingPhase
from kickdyn.robot.leg import Leg

AT_END = 1e-6
"""Distance from the end of a range at which a joint is there [rad; m]."""

STILL = 1e-9
"""Share of the fastest joint's speed below which one stands still."""


@dataclass(frozen=True, eq=False, repr=False)
class KickPlan(ReprMixin):
    """A kick, planned and then carried out by `strike` and `fly`.

    Attributes:
        status: `met`; or `beyond-limits`: the leg is not fast or strong enough, and this is the
            kick in the planned direction that gives the ball the most speed.
        goal: wished for.
        launch: that meets it.
        objective: that was made least; `value` is its value.
        share: of the launch speed that is reached; 1 where `status` is `met`.
        impact_target: impulse, normal and place on the ball.
        hit: the strike, from the planned posture and joint velocity.
        path: the flight from there, to the target's plane or to the ground before it; of a pass,
            the course.
        landing_error: distance of its end from the target [m].
        time_error: how much later than by `launch` it ends [s].
        speed_use, effort_use: largest joint speed and torque at the touch, over their limits; the
            torque is what keeps the joints' speed, gravity included.
        binding: limits that are reached, such as `speed of knee`, or `effort of knee`, its torque;
            `swing` where a harder kick has no way from rest and to rest.
        heading: how far `leg` is turned to the left about the vertical [rad]; 0 but for a leg
            whose foot moves in a plane, and a goal aside of it.
        parts: of the swing that `swing=True` found with it, before and after the impact; from
            there `plan_swing` goes on.
    """

    status: PlanStatus
    goal: Goal
    launch: Launch
    objective: str
    value: float
    share: float
    impact_target: ImpactTarget
    hit: Impact
    path: Flight | Course
    landing_error: float
    time_error: float
    speed_use: float
    effort_use: float
    binding: tuple[str, ...]
    heading: float
    parts: tuple[SwingPhase, SwingPhase] | None = None

    @property
    def leg(self) -> Leg:
        """That kicks: as it was given, or turned by `heading`."""
        return self.hit.posture.leg

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "posture", self.q, "rad"
        yield "joint velocity", self.v, "rad/s"
        yield "impulse on the ball", self.hit.impulse, "N s"
        yield "launch", self.hit.ball_after.velocity, "m/s"
        yield "landing error", self.landing_error, "m"
        yield "time error", self.time_error, "s"
        what = SAID.get(self.objective, self.objective)
        yield what, self.value, UNITS.get(self.objective, "")
        yield "of the speed limit", self.speed_use, ""
        yield "of the torque limit", self.effort_use, ""
        for line in self.warnings:
            yield "warning", line, ""

    def _picture(self) -> str:
        return self.path._picture()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Of `path`: a line for each coefficient used outside its range."""
        return self.path.warnings

    @property
    def after(self) -> dict[str, float]:
        """Joints that run faster than their limit just after the impact, with how many times."""
        limit = self.leg.velocity_limit
        used = {name: abs(self.hit.v_after[i]) / limit[i] for name, i in self._joints() if limit[i]}
        return {name: float(use) for name, use in used.items() if use > 1.0}

    @property
    def into_stop(self) -> tuple[str, ...]:
        """Joints at an end of their range that run on beyond it just after the impact."""
        found, values = [], self.leg.joint_values(self.q)
        for name, i in self._joints():
            (low, high), at, v = self.leg.joint_range(name), values[name], self.hit.v_after[i]
            if (at - low < AT_END and v < 0.0) or (high - at < AT_END and v > 0.0):
                found.append(name)
        return tuple(found)

    def _joints(self) -> list[tuple[str, int]]:
        """Return the joints that move just after the impact, with their place in v."""
        leg = self.leg
        every = [(name, leg.velocity_index(name)) for name in leg.single_joints]
        fast = float(np.abs(self.hit.v_after).max())
        return [(name, i) for name, i in every if abs(self.hit.v_after[i]) > STILL * fast]

    @property
    def q(self) -> Array:
        """Posture at the touch, shape `(nq,)` [rad]."""
        return self.hit.posture.q

    @property
    def v(self) -> Array:
        """Joint velocity at the touch, shape `(nv,)` [rad/s]."""
        return self.hit.v_before
