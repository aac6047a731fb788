"""What moves during a kick, and when it is shown."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact

RATE = 60
"""Pictures per second; what spins faster than half a turn in one cannot be shown anyway."""

SWING, FOLLOW, CHANGE, FLY, REST = 1.2, 0.4, 0.6, 1.8, 0.8
"""How long each phase is shown: before and after the impact, change of pace, flight, end [s]."""

SWUNG = 3.0
"""How long a backswing is shown that was planned [s]."""

GROWING = 8
"""Pictures from the impact to arrows of full length."""

TRAVEL = 0.6
"""How far the fastest joint swings, before and after the impact each [rad; m if prismatic]."""


@dataclass(frozen=True, eq=False)
class Pace:
    """Which time of the kick each picture shows.

    Attributes:
        times: of each picture, 0 at the impact, shape `(n,)` [s].
        impact: index of the picture of the impact.
        strike: how many times slower than real the strike is shown; below 1 is faster.
        flight: likewise the flight.
        end: index of the last picture; what moves rests from the last of `times` until then.
    """

    times: Array
    impact: int
    strike: float
    flight: float
    end: int


def pace_of(hit: Impact, duration: float, backswing: float | None = None) -> Pace:
    """Show strike and flight in about four seconds.

    A hard strike is over in a hundredth of the time the ball flies, so the strike is shown
    slower; where the flight is no longer than the strike, both are shown alike.

    Args:
        hit: the impact.
        duration: of the flight [s].
        backswing: of a swing that is shown as planned, from rest [s].
    """
    fastest = float(max(np.abs(hit.v_before).max(), np.abs(hit.v_after).max()))
    swing = TRAVEL / fastest if fastest > 0 else math.inf
    alike = duration / (FOLLOW + CHANGE + FLY) if duration > 0 else math.inf
    strike = min(swing / SWING, alike) if backswing is None else backswing / SWUNG
    before = SWING if backswing is None else SWUNG
    if not math.isfinite(strike):
        strike = 1.0
    after = max(duration, strike * (FOLLOW + CHANGE + FLY))
    flight = (after - strike * (FOLLOW + CHANGE / 2)) / (CHANGE / 2 + FLY)
    moments = np.arange(round((before + FOLLOW + CHANGE + FLY) * RATE) + 1) / RATE - before
    changing = np.clip(moments - FOLLOW, 0.0, CHANGE)
    times = (
        strike * np.minimum(moments, FOLLOW)
        + strike * changing
        + (flight - strike) * changing**2 / (2 * CHANGE)
        + flight * np.maximum(moments - FOLLOW - CHANGE, 0.0)
    )
    return Pace(
        times, round(before * RATE), 1 / strike, 1 / flight, len(times) - 1 + round(REST * RATE)
    )


def shown_at(pace: Pace, time: float) -> float:
    """Return when the animation shows a time since the impact, its arrows grown [s].

    Args:
        pace: of the animation.
        time: since the impact, 0 or more [s]; what is later than the last picture is that one.
    """
    picture = min(int(np.searchsorted(pace.times, time)), len(pace.times) - 1)
    return max(picture, pace.impact + GROWING) / RATE


def leg_configuration(hit: Impact, time: float) -> Array:
    """Return q at a time from the impact, shape `(nq,)`: straight on before, easing off after."""
    leg, q = hit.posture.leg, hit.posture.q
    model = leg.workspace.model
    if time <= 0:
        step = hit.v_before * time
    else:
        fastest = float(np.abs(hit.v_after).max())
        ease = TRAVEL / fastest if fastest > 0 else math.inf
        step = hit.v_after * (-ease * math.expm1(-time / ease) if math.isfinite(ease) else time)
    moved = np.asarray(pin.integrate(model, q, step))
    # Only a joint of one number has a range; and a posture outside it must not jump back.
    single = np.zeros(model.nq, dtype=bool)
    for joint in model.joints[1:]:
        single[joint.idx_q] = joint.nq == 1
    within = np.clip(moved, np.fmin(leg.lower, q), np.fmax(leg.upper, q))
    return np.where(single, within, moved)


def ball_place(before: BallState, path: Flight | Course, time: float) -> Array:
    """Return the ball's placement at a time from the impact, shape `(4, 4)` [m, world frame]."""
    state = before if time < 0 else path.launch
    place = np.eye(4)
    seen = time if time < 0 else min(time, path.duration)
    if isinstance(path, Course):
        place[:3, :3] = pin.exp3(state.spin * seen if time < 0 else _rolled(path, seen))
    elif time >= 0 and path.has_orientation:
        place[:3, :3] = path.orientation(seen).as_matrix()
    else:
        place[:3, :3] = pin.exp3(state.spin * seen)
    place[:3, 3] = (
        before.position + before.velocity * time if time < 0 else path.sample(seen).position
    )
    return place


def _rolled(path: Course, time: float) -> Array:
    """Return how far a ball on the ground has turned `(3,)` [rad], as if about one axis."""
    times = np.linspace(0.0, time, 65)
    spin = path.sample(times).spin
    return np.asarray(np.trapezoid(spin, times, axis=0))
