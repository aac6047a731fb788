"""Where the ball's path ends: to an accuracy, exactly, and how that depends on the launch."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.flight_result import Flight, FlightStatus
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course, follow
from kickdyn.flight.forces import is_ballistic
from kickdyn.impact.uncertainty import Uncertainty
from kickdyn.scene.coarse_flight import CoarseEnd, coarse_end
from kickdyn.scene.scene import FlightEnvironment

ENDS = (FlightStatus.LANDED, FlightStatus.AT_PLANE, FlightStatus.AT_REST)
"""Statuses of a path that has an end; any other says why the integration was given up."""

FINEST = 1e-9
"""Relative tolerance of the exact integrators where everything is modelled."""

STEPS = (4, 8, 16, 32, 64)
"""Numbers of large steps in a flight that are tried one after the other."""

DIFFERENCE = 1e-2
"""Step of the differences, relative to the speed: above what large steps miss, below curvature."""

CONTACT_SAFETY = 20.0
"""Relative error of a compliant contact's launch over the integrator's tolerance, at most; the
largest of some 140 random kicks was 13."""


class FlightEnd(NamedTuple):
    """Where the ball's path ends, and how that was found.

    Attributes:
        state: there.
        status: as of `Flight` or `Course`.
        path: None where large steps were used.
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
        """Whether the path came to an end at all."""
        return self.status in ENDS


def approximate_end(
    launch: BallState,
    environment: FlightEnvironment,
    accuracy: float,
    four_steps: BallState | None = None,
) -> FlightEnd:
    """Find where the ball's path ends, in as few large steps as the accuracy allows.

    The error is estimated as three times what doubling the steps moves the end by. This may be
    little by accident, so the change of the velocity counts, too, and the estimate falls to 1/16 at
    most when the steps are doubled, as they are of fourth order. Where 64 steps do not suffice, or
    the ball bounces, the exact integrators are used.

    The accuracy is that of the end's position [m]; `four_steps` is the end found in the first of
    `STEPS`, where that is known already.
    """
    _, air, ground, _ = environment
    closed_form = (ground is None or ground.surface is None) and is_ballistic(air, launch.spin)
    if closed_form:
        return exact_end(launch, environment, FINEST)
    last, evaluations, error = four_steps, 0, 0.0
    for steps in STEPS if last is None else STEPS[1:]:
        state, status, more, _ = coarse_end(launch, environment, steps)
        evaluations += more
        if state is None:
            break
        if last is not None:
            apart = math.dist(state.position, last.position)
            apart = max(apart, math.dist(state.velocity, last.velocity) * float(state.time) / 8.0)
            error = max(3.0 * apart, error / 16.0)
            if error <= accuracy:
                method = f"{steps} Runge-Kutta steps"
                return FlightEnd(state, status, None, method, evaluations, partial(float, error))
        last = state
    exact = exact_end(launch, environment, FINEST)
    return exact._replace(evaluations=exact.evaluations + evaluations)


def exact_end(launch: BallState, environment: FlightEnvironment, tol: float) -> FlightEnd:
    """Find where the ball's path ends, by `fly`, or `follow` where the ground has a surface."""
    ball, air, ground, plane = environment
    if ground is None or ground.surface is None:
        path = fly(launch, ball, air, ground, tol, plane=plane)
        error = partial(getattr, path, "error")
        return FlightEnd(path.landing, path.status, path, path.method, path.evaluations, error)
    course = follow(launch, ball, air, ground, tol, plane=plane)

    def by_refinement() -> float:
        """Return the error by a course with a finer tolerance [m]."""
        finer = follow(launch, ball, air, ground, 1e-2 * tol, plane=plane)
        if finer.status != course.status:
            return math.inf
        return 2.0 * float(np.linalg.norm(finer.rest.position - course.rest.position))

    evaluations = sum(flight.evaluations for flight in course.flights)
    evaluations += sum(phase.evaluations for phase in course.ground_phases)
    method = f"flight, bounces and rolling, relative tolerance {tol:g}"
    return FlightEnd(course.rest, course.status, course, method, evaluations, by_refinement)


class EndSlopes(NamedTuple):
    """Derivatives of the end's position with respect to the launch.

    Attributes:
        velocity: by the launch's velocity, shape `(3, 3)` [s]; inf where it is not known.
        spin: by its spin, shape `(3, 3)` [m s]; likewise.
        evaluations: of the acceleration.
    """

    velocity: Array
    spin: Array
    evaluations: int

    def contact_error(self, launch: BallState, radius: float, tol: float) -> float:
        """Return how far the relative tolerance of `collide` can move the end [m].

        The slopes are those around the launch; the foot moves less than the radius of the ball.
        """
        if not np.isfinite(self.velocity).all():
            return math.inf
        speed, spin = float(launch.speed), float(np.linalg.norm(launch.spin))
        size = float(np.linalg.norm(self.velocity, 2)) * speed
        size += float(np.linalg.norm(self.spin, 2)) * max(spin, speed / radius)
        return CONTACT_SAFETY * tol * (size + radius)

    def deviation(self, launch: Uncertainty) -> float:
        r"""Return the standard deviation of the end, to first order [m].

        :math:`\sigma = \sqrt{\mathrm{tr}(A V A^T)} + \sqrt{\mathrm{tr}(B W B^T)}` with the slopes A
        and B and the covariances V and W of velocity and spin: both depend on the same sources, so
        their contributions add up at most.
        """
        if not np.isfinite(self.velocity).all():
            return math.inf
        pairs = ((self.velocity, launch.velocity), (self.spin, launch.spin))
        return math.fsum(
            math.sqrt(max(float(np.trace(slope @ cov @ slope.T)), 0.0)) for slope, cov in pairs
        )


def end_slopes(launch: BallState, environment: FlightEnvironment) -> EndSlopes:
    """Return how the end changes with velocity and spin of the launch, by differences.

    Slopes by four and by eight large steps a flight must agree within a tenth; otherwise the exact
    integrators are used, with a relative tolerance of 1e-7.
    """
    evaluations, last = 0, None
    for steps in (4, 8):
        find_end = partial(coarse_end, environment=environment, steps=steps)
        found, more = _differences(launch, environment.ball.radius, find_end)
        evaluations += more
        if found is None:
            break
        agree = last is not None and all(
            np.linalg.norm(a - b) <= 0.1 * np.linalg.norm(b)
            for a, b in zip(last, found, strict=True)
        )
        if agree:
            return EndSlopes(found[0], found[1], evaluations)
        last = found
    find_end = partial(_known_end, environment=environment)
    found, more = _differences(launch, environment.ball.radius, find_end)
    if found is None:
        found = np.full((2, 3, 3), math.inf)
    return EndSlopes(found[0], found[1], evaluations + more)


def _known_end(launch: BallState, environment: FlightEnvironment) -> CoarseEnd:
    """Return the end by the exact integrators; its state is None where there is no end."""
    try:
        end = exact_end(launch, environment, 1e-7)
    except KickdynError:
        return CoarseEnd(None, "", 0)
    return CoarseEnd(end.state if end.ended else None, end.status, end.evaluations)


def _differences(
    launch: BallState, radius: float, find_end: Callable[[BallState], CoarseEnd]
) -> tuple[Array | None, int]:
    """Return the slopes by velocity and spin, None where an end is not known, and evaluations."""
    base, _, evaluations, _ = find_end(launch)
    slopes, speed = np.zeros((2, 3, 3)), float(launch.speed)
    if base is None or speed == 0.0:
        return None, evaluations
    for i, size in enumerate((speed, speed / radius)):
        for k, axis in enumerate(DIFFERENCE * size * np.eye(3)):
            velocity, spin = launch.velocity + axis * (i == 0), launch.spin + axis * (i == 1)
            moved, _, more, _ = find_end(BallState(launch.position, velocity, spin))
            evaluations += more
            if moved is None:
                return None, evaluations
            slopes[i, :, k] = (moved.position - base.position) / (DIFFERENCE * size)
    return slopes, evaluations
