"""How the end depends on the launch, by differences of flights in large steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kickdyn.ball import BallState
from kickdyn.checks import Array
from kickdyn.impact.uncertainty import Uncertainty
from kickdyn.simulation.coarse import Way, coarse_end

STEPS = 4

STEP = 1e-2
"""Of the differences, relative to the speed: above what large steps miss, below what bends."""

CONTACT_SAFETY = 20.0
"""Error of a contact's launch, relative to its size, over the integrator's tolerance, at most; the
largest of some 140 random kicks was 13."""


def slopes(launch: BallState, way: Way) -> tuple[Array, Array] | None:
    """Return the change of the end with velocity and spin of the launch, shape `(3, 3)` each.

    In s and m s; None where large steps do not do.
    """
    base, _ = coarse_end(launch, way, STEPS)
    if base is None:
        return None
    found = []
    for name, size in (
        ("velocity", float(launch.speed)),
        ("spin", float(launch.speed) / way.ball.radius),
    ):
        step, columns = STEP * size, []
        for axis in np.eye(3):
            parts: dict[str, Any] = {
                "position": launch.position,
                "velocity": launch.velocity,
                "spin": launch.spin,
            }
            parts[name] = parts[name] + step * axis
            moved, _ = coarse_end(BallState(**parts), way, STEPS)
            if moved is None:
                return None
            columns.append((moved.position - base.position) / step)
        found.append(np.array(columns).T)
    return found[0], found[1]


def contact_error(launch: BallState, way: Way, tol: float) -> float:
    """Return how far a contact's tolerance can move the end [m]."""
    found = slopes(launch, way)
    if found is None:
        return math.inf
    speed, turning = float(launch.speed), float(np.linalg.norm(launch.spin))
    by_velocity, by_spin = (float(np.linalg.norm(part, 2)) for part in found)
    size = by_velocity * speed + by_spin * max(turning, speed / way.ball.radius)
    size += way.ball.radius  # which the foot moves less than in the contact
    return CONTACT_SAFETY * tol * size


def end_spread(launch: BallState, way: Way, known: Uncertainty) -> float:
    """Return a bound on the standard deviation of the end [m], from those of the launch.

    Velocity and spin depend on the same sources: their parts add up at most.
    """
    found = slopes(launch, way)
    if found is None:
        return math.inf
    parts = zip(found, (known.velocity, known.spin), strict=True)
    return math.fsum(
        math.sqrt(max(float(np.trace(slope @ cov @ slope.T)), 0.0)) for slope, cov in parts
    )
