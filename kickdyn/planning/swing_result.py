"""What planning a swing answers: two parts around an impact, and what proves them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.goal import PlanStatus
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.swing_phase import Motion, SwingPhase


@dataclass(frozen=True, eq=False, repr=False)
class Swing(ReprMixin):
    """A joint trajectory from rest through the impact to rest, with what proves it.

    Attributes:
        status: `met`; or `beyond-limits`: then this is the same kick at `share` of its speed, the
            most from which the leg can be brought there and stopped.
        plan: the kick.
        share: of the planned joint velocity; the ball's launch scales alike.
        limit: what stands in the way, in a line; empty where the plan is met.
        objective: that was made least; `value` is its value [s; 1 for effort, times s].
        joints: names of those that move; all others stay at 0.
        backswing, follow_through: before and after the impact, at which v jumps as `strike` says.
    """

    status: PlanStatus
    plan: KickPlan
    share: float
    limit: str
    objective: str
    value: float
    joints: tuple[str, ...]
    backswing: SwingPhase
    follow_through: SwingPhase

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        if self.limit:
            yield "limit", self.limit, ""
        yield "of the planned speed", self.share, ""
        yield "backswing", self.backswing.duration, "s"
        yield "follow-through", self.follow_through.duration, "s"
        what = "effort (of torques)" if self.objective == "effort" else self.objective
        yield what, self.value, "s"
        yield "of the torque limit", self.torque_use, ""
        yield "of the speed limit", self.speed_use, ""
        yield "range left", self.range_left, "rad"
        yield "defect", self.defect, ""
        yield "impact error", self.impact_error, ""

    def sample(self, t: ArrayLike) -> Motion:
        """Return the motion at rising times from the impact [s]; at 0 it is that just before."""
        time = np.atleast_1d(validation.floats("t", t, unit="s"))
        if (np.diff(time) < 0).any():
            raise InvalidInput(f"t is {time.tolist()}: times must rise")
        parts = (self.backswing.sample(time[time <= 0]), self.follow_through.sample(time[time > 0]))
        return Motion(*(np.concatenate(pair) for pair in zip(*parts, strict=True)))

    def configuration(self, t: float) -> Array:
        """Return q of the whole leg at a time, shape `(nq,)`; at rest before and after."""
        time = min(max(t, -self.backswing.duration), self.follow_through.duration)
        q = self.plan.q.copy()
        q[self.backswing.joints.qs] = self.sample(time).q[0]
        return q

    @cached_property
    def _fine(self) -> tuple[Motion, Motion]:
        return self.backswing.fine(), self.follow_through.fine()

    @property
    def torque_use(self) -> float:
        """Largest torque on the fine grid over its limit."""
        joints = self.backswing.joints
        return max(float((np.abs(part.torque) / joints.effort).max()) for part in self._fine)

    @property
    def speed_use(self) -> float:
        """Largest joint speed on the fine grid over its limit."""
        joints = self.backswing.joints
        return max(float((np.abs(part.v) / joints.speed).max()) for part in self._fine)

    @property
    def range_left(self) -> float:
        """Least distance from an end of the range on the fine grid [rad]; below 0 is outside."""
        joints = self.backswing.joints
        return min(
            float(np.minimum(part.q - joints.low, joints.high - part.q).min())
            for part in self._fine
        )

    @property
    def defect(self) -> float:
        """Largest acceleration on the fine grid that the torques do not give, relative.

        From the articulated-body algorithm, where the torques come from Newton-Euler.
        """
        model, data = self.backswing.joints.model, self.backswing.joints.model.createData()
        worst = 0.0
        for part in self._fine:
            given = [
                pin.aba(model, data, *row) for row in zip(part.q, part.v, part.torque, strict=True)
            ]
            worst = max(worst, float(np.abs(given - part.a).max() / np.abs(part.a).max()))
        return worst

    @property
    def impact_error(self) -> float:
        """Largest difference from the plan just before and just after the impact [rad, rad/s]."""
        at, hit = self.backswing.joints, self.plan.hit
        worst = 0.0
        for part, v in ((self.backswing, hit.v_before), (self.follow_through, hit.v_after)):
            here = part.sample(0.0)
            off = (here.q[0] - self.plan.q[at.qs], here.v[0] - self.share * v[at.vs])
            worst = max(worst, *(float(np.abs(one).max()) for one in off))
        return worst
