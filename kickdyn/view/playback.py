"""What moves during a kick, and when the animation shows it."""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.robot.standing import hold_support
from kickdyn.view.marks import pose_of

RATE = 60
"""Pictures per second; what spins faster than half a turn in one cannot be shown anyway."""

FOLLOW_TIME, FLIGHT_TIME = 0.7, 2.1
"""How long the first part after the impact, in the strike's pace, and the flight are shown [s]."""

SWING_LENGTH = 0.6
"""How far the fastest joint swings, before and after the impact each [rad; m if prismatic]."""


@dataclass(frozen=True, eq=False)
class Pace:
    """Which time of the kick each picture shows.

    Attributes:
        times: of each picture, 0 at the impact, shape `(n,)` [s].
        impact: index of the picture of the impact.
        strike: how many times slower than real the strike is shown; below 1 is faster.
        flight: likewise the flight.
        end: index of the last picture; leg and ball rest from the last of `times` until then.
    """

    times: Array
    impact: int
    strike: float
    flight: float
    end: int

    @property
    def knots(self) -> Array:
        """Times of the animation, and of the kick that it shows then, shape `(4, 2)` [s].

        The kick's time is linear in between.
        """
        last = len(self.times) - 1
        numbers = np.unique([0, self.impact, self.impact + round(FOLLOW_TIME * RATE), last])
        return np.column_stack([numbers / RATE, self.times[numbers]])


def kick_pace(impact: Impact, duration: float, backswing: float | None = None) -> Pace:
    """Return the pace that shows strike and flight, of this duration [s], in about four seconds.

    A hard strike takes a hundredth of the flight's time, so it is shown slower; where the flight
    is no longer than the strike, both have one pace. A planned swing takes `backswing` [s] from
    rest to the impact.
    """
    fastest = float(max(np.abs(impact.v_before).max(), np.abs(impact.v_after).max()))
    swing = SWING_LENGTH / fastest if fastest > 0 else math.inf
    alike = duration / (FOLLOW_TIME + FLIGHT_TIME) if duration > 0 else math.inf
    before = 1.2 if backswing is None else 3.0  # shown before the impact [s]
    strike = min(swing / before, alike) if backswing is None else backswing / before
    if not math.isfinite(strike):
        strike = 1.0
    after = max(duration, strike * (FOLLOW_TIME + FLIGHT_TIME))
    flight = (after - strike * FOLLOW_TIME) / FLIGHT_TIME
    moments = np.arange(round((before + FOLLOW_TIME + FLIGHT_TIME) * RATE) + 1) / RATE - before
    times = strike * moments + (flight - strike) * np.maximum(moments - FOLLOW_TIME, 0.0)
    end = len(times) - 1 + round(0.8 * RATE)
    return Pace(times, round(before * RATE), 1 / strike, 1 / flight, end)


def leg_configuration(impact: Impact, time: float) -> Array:
    """Return q at a time from the impact [s], shape `(nq,)`.

    The joints move with the velocity before the impact, and after it come to rest from the
    velocity after it, within their ranges; a floating base, so that the first support stays.
    """
    leg, q = impact.posture.leg, impact.posture.q
    model = leg.workspace.model
    v, shown = impact.v_before, time
    if time > 0:
        v, fastest = impact.v_after, float(np.abs(impact.v_after).max())
        ease = SWING_LENGTH / fastest if fastest > 0 else math.inf
        shown = -ease * math.expm1(-time / ease) if math.isfinite(ease) else time
    moved = np.asarray(pin.integrate(model, q, shown * v))
    # Only a joint of one number has a range; and a posture outside it must not jump back.
    single = np.zeros(model.nq, dtype=bool)
    for joint in model.joints[1:]:
        single[joint.idx_q] = joint.nq == 1
    within = np.clip(moved, np.fmin(leg.lower, q), np.fmax(leg.upper, q))
    return hold_support(impact.posture, np.where(single, within, moved))


def ball_pose(before: BallState, path: Flight | Course, time: float) -> Array:
    """Return the ball's pose at a time from the impact [s], shape `(4, 4)` [m, world frame]."""
    if time < 0:
        return pose_of(pin.exp3(before.spin * time), before.position + before.velocity * time)
    time = min(time, path.duration)
    if isinstance(path, Course):
        times = np.linspace(0.0, time, 65)  # as if the ball turned about one axis
        rotation = pin.exp3(np.trapezoid(path.sample(times).spin, times, axis=0))
    else:
        rotation = path.orientation(time).as_matrix()
    return pose_of(rotation, path.sample(time).position)
