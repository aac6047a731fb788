"""How the end depends on the launch, by differences of flights in large steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.uncertainty import Uncertainty
from kickdyn.scene.coarse_flight import FlightEnvironment, coarse_end
from kickdyn.scene.exact_end import followed

ROUGH, FINE = 4, 8
"""Steps of a flight; slopes by the first must confirm those by the second."""

ALIKE = 0.1
"""Of the larger, that slopes by fewer and more steps may differ by."""

TOL = 1e-7
"""Relative tolerance of the exact engine, where large steps do not do."""

STEP = 1e-2
"""Of the differences, relative to the speed: above what large steps miss, below what bends."""

CONTACT_SAFETY = 20.0
"""Error of a contact's launch, relative to its size, over the integrator's tolerance, at most; the
largest of some 140 random kicks was 13."""

Ender = Callable[[BallState], tuple[BallState | None, int]]


class Slopes(NamedTuple):
    """Change of the end with the launch.

    Attributes:
        velocity, spin: by each of them, shape `(3, 3)` [s, m s]; inf where they are not known.
        evaluations: of the acceleration.
    """

    velocity: Array
    spin: Array
    evaluations: int


def slopes(launch: BallState, way: FlightEnvironment, sure: bool = True) -> Slopes:
    """Return the change of the end with velocity and spin of the launch.

    Large steps do, if twice as many agree, where that is to be sure; else the exact engine does.
    """
    calls, last = 0, None
    for steps in (ROUGH, FINE):
        found, more = _differences(launch, way, _in_steps(way, steps))
        calls += more
        if found is None:
            break
        if not sure or (last is not None and _alike(last, found)):
            return Slopes(*found, calls)
        last = found
    found, more = _differences(launch, way, lambda start: _exactly(start, way))
    if found is None:
        found = (np.full((3, 3), math.inf), np.full((3, 3), math.inf))
    return Slopes(*found, calls + more)


def _in_steps(way: FlightEnvironment, steps: int) -> Ender:
    def end(start: BallState) -> tuple[BallState | None, int]:
        state, _, calls = coarse_end(start, way, steps)
        return state, calls

    return end


def _exactly(start: BallState, way: FlightEnvironment) -> tuple[BallState | None, int]:
    try:
        end = followed(start, way, TOL)
    except KickdynError:
        return None, 0
    return (end.state if end.ended else None), end.evaluations


def _alike(some: tuple[Array, Array], others: tuple[Array, Array]) -> bool:
    sizes = [float(np.linalg.norm(other)) for other in others]
    gaps = [float(np.linalg.norm(a - b)) for a, b in zip(some, others, strict=True)]
    return all(gap <= ALIKE * size for gap, size in zip(gaps, sizes, strict=True))


def _differences(
    launch: BallState, way: FlightEnvironment, end: Ender
) -> tuple[tuple[Array, Array] | None, int]:
    base, calls = end(launch)
    if base is None:
        return None, calls
    found = []
    speed = float(launch.speed)
    for name, size in (("velocity", speed), ("spin", speed / way.ball.radius)):
        step, columns = STEP * size, []
        for axis in np.eye(3):
            parts: dict[str, Any] = {
                "position": launch.position,
                "velocity": launch.velocity,
                "spin": launch.spin,
            }
            parts[name] = parts[name] + step * axis
            moved, more = end(BallState(**parts))
            calls += more
            if moved is None:
                return None, calls
            columns.append((moved.position - base.position) / step)
        found.append(np.array(columns).T)
    return (found[0], found[1]), calls


def contact_error(found: Slopes, launch: BallState, way: FlightEnvironment, tol: float) -> float:
    """Return how far a contact's tolerance can move the end [m]."""
    if not np.isfinite(found.velocity).all():
        return math.inf
    speed, turning = float(launch.speed), float(np.linalg.norm(launch.spin))
    by_velocity, by_spin = (float(np.linalg.norm(part, 2)) for part in found[:2])
    size = by_velocity * speed + by_spin * max(turning, speed / way.ball.radius)
    size += way.ball.radius  # which the foot moves less than in the contact
    return CONTACT_SAFETY * tol * size


def end_spread(found: Slopes, known: Uncertainty) -> float:
    """Return the standard deviation of the end [m], from those of the launch, to first order.

    Velocity and spin depend on the same sources: their parts add up at most.
    """
    if not np.isfinite(found.velocity).all():
        return math.inf
    parts = zip(found[:2], (known.velocity, known.spin), strict=True)
    return math.fsum(
        math.sqrt(max(float(np.trace(slope @ cov @ slope.T)), 0.0)) for slope, cov in parts
    )
