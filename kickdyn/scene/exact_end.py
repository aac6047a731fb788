"""The end of a ball's way by the exact engine, and what it says of itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from kickdyn.ball import BallState
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course, follow
from kickdyn.scene.coarse_flight import FlightEnvironment

ENDS = ("landed", "at-plane", "at-rest")
"""What a way can end with; all else is where it was given up."""


class End(NamedTuple):
    """Where the ball's way ends, and how that was found.

    Attributes:
        state: there.
        status: as of `Flight` or `Course`.
        path: None where large steps did.
        method: in words.
        evaluations: of the acceleration.
        error: estimates what the integrator misses [m].
    """

    state: BallState
    status: str
    path: Flight | Course | None
    method: str
    evaluations: int
    error: Callable[[], float]

    @property
    def ended(self) -> bool:
        """Whether the ball came to an end at all."""
        return self.status in ENDS


def followed(launch: BallState, way: FlightEnvironment, tol: float) -> End:
    """Follow the ball to the end of its way.

    Args:
        launch: the ball at the start.
        way: what it moves through, and to.
        tol: relative tolerance.

    Raises:
        KickdynError: as `fly` and `follow` do.
    """
    ball, air, ground, plane = way
    if ground is None or ground.surface is None:
        path = fly(launch, ball, air, ground, tol, plane=plane)
        calls, error = path.evaluations, partial(getattr, path, "error")
        return End(path.landing, path.status, path, path.method, calls, error)
    course = follow(launch, ball, air, ground, tol, plane=plane)

    def again() -> float:
        finer = follow(launch, ball, air, ground, 1e-2 * tol, plane=plane)
        if finer.status != course.status:
            return math.inf
        return 2.0 * float(np.linalg.norm(finer.rest.position - course.rest.position))

    calls = sum(flight.evaluations for flight in course.flights)
    calls += sum(glide.evaluations for glide in course.glides)
    return End(course.rest, course.status, course, f"followed, tol {tol:g}", calls, again)
