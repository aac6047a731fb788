"""A ball followed until it rests: flight, bounces, sliding, rolling."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import ArrayLike
from kickdyn.flight.events import Event, checked_ends, plane_events
from kickdyn.flight.flight_result import Flight, FlightStatus, flight_warnings
from kickdyn.flight.fly import check_single, fly
from kickdyn.flight.ground_motion import (
    GroundPhase,
    bounce,
    check_friction,
    roll,
    slide,
    surface_of,
)
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane

LEAST_REBOUND = 0.15
"""Upward speed after a bounce below which the ball stays down [m/s]; it would hop about 1 mm."""

MOST_BOUNCES = 200
"""After which a ball that hardly loses energy is given up."""


@dataclass(frozen=True, eq=False, repr=False)
class Course(ReprMixin):
    """The motion of a ball until it rests or reaches a plane; times count from the launch.

    Attributes:
        status: `at-rest`; `at-plane`; `aloft`, where the ball did not come down before the time
            limit; `bouncing`, where it still bounces after `MOST_BOUNCES`; `blown`, where the wind
            does not let it rest; or the name of one of `ends`.
        flights: the flights, one before each bounce.
        bounces: the ball just after each bounce.
        ground_phases: the phases of sliding and rolling; empty if there are none.
    """

    status: str
    flights: tuple[Flight, ...]
    bounces: tuple[BallState, ...]
    ground_phases: tuple[GroundPhase, ...]
    _follow_again: "Callable[[], Course]" = field(repr=False)

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "launch", self.flights[0].launch.velocity, "m/s"
        yield "bounces", len(self.bounces), ""
        yield "distance", self.distance, "m"
        yield "duration", self.duration, "s"
        yield "end", self.rest.position, "m"
        yield from warned(self.warnings)

    def __reduce__(self) -> "tuple[Callable[[], Course], tuple[()]]":
        """Pickle the inputs of the course; unpickling follows it again, to the same last bit."""
        return self._follow_again, ()

    @property
    def launch(self) -> BallState:
        """The ball at the launch."""
        return self.flights[0].launch

    @cached_property
    def rest(self) -> BallState:
        """The last state of the ball, at rest unless the status says otherwise."""
        last = self.ground_phases[-1].end if self.ground_phases else self.flights[-1].landing
        return BallState(last.position, last.velocity, last.spin, self.duration)

    @property
    def distance(self) -> float:
        """Horizontal distance from launch to rest [m]."""
        return float(np.hypot(*(self.rest.position - self.launch.position)[:2]))

    @cached_property
    def duration(self) -> float:
        """Time from launch to rest [s]."""
        flown = sum(flight.duration for flight in self.flights)
        return flown + sum(phase.duration for phase in self.ground_phases)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Those of the flights; shares are of their common duration."""
        return flight_warnings(self.flights)

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at times since the launch, 0 to `duration`, a number or `(n,)` [s]."""
        asked = validation.times(t, self.duration, "the course")
        times = np.atleast_1d(asked)
        position, velocity, spin = (np.zeros((len(times), 3)) for _ in range(3))
        pieces: Sequence[Flight | GroundPhase] = (*self.flights, *self.ground_phases)
        began = 0.0
        for number, piece in enumerate(pieces):
            last = number == len(pieces) - 1
            inside = (times >= began) & ((times < began + piece.duration) | last)
            if inside.any():
                states = piece.sample(np.clip(times[inside] - began, 0.0, piece.duration))
                position[inside], velocity[inside] = states.position, states.velocity
                spin[inside] = states.spin
            began += piece.duration
        if asked.ndim == 0:
            return BallState(position[0], velocity[0], spin[0], float(asked))
        return BallState(position, velocity, spin, times)


@validation.check_arguments
def follow(
    state: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    plane: Plane | None = None,
    time_limit: float = 1000.0,
    ends: Sequence[Event] = (),
) -> Course:
    """Let a ball fly, bounce and roll until it rests.

    Args:
        state: the ball at the launch, above the ground or on it.
        ball: the ball; its mass, radius and inertia count.
        air: the air; None is the vacuum.
        ground: a ground with a surface. None is turf that the ball touches at its launch, so that
            the first flight ends at the height of the launch, as in `fly`.
        tol: relative tolerance of every flight.
        plane: a wall or a goal line that ends the motion, be it flying, sliding or rolling.
        time_limit: longest duration of every flight, and of rolling [s].
        ends: further events that end the motion, be it flying, sliding or rolling.

    Raises:
        InvalidInput: ground without a surface, or without the friction that ends sliding, or as for
            `fly`.

    Example:
        >>> import kickdyn as kd
        >>> kick = kd.BallState(velocity=(20, 0, 10), spin=(0, -30, 0))
        >>> course = kd.follow(kick, kd.Ball(), kd.Air())
        >>> str(course.status), len(course.bounces), round(course.distance, 1)
        ('at-rest', 8, 76.2)
    """
    check_single(state, "follow")
    if ground is None:
        ground = Ground(float(state.position[2]) - ball.radius, "turf")
    start, surface = state, surface_of(ground, ball)
    further = checked_ends(ends)
    one_flight = partial(fly, ball=ball, air=air, ground=ground, tol=tol, plane=plane,
                         time_limit=time_limit, ends=further)  # fmt: skip
    flights, bounces, status = _bouncing(state, ball, surface, one_flight)
    phases: list[GroundPhase] = []
    if status is None:  # it stays down, slides and rolls
        check_friction(surface)
        state = bounce(flights[-1].landing, ball, surface)
        all_ends = *plane_events(ball, plane), *further
        sliding = slide(state, ball, air, surface, [end.launched(state) for end in all_ends])
        if sliding is not None:
            phases.append(sliding)
            state = sliding.end
        if sliding is None or sliding.reached is None:
            launched = [end.launched(state) for end in all_ends]
            phases.append(roll(state, ball, air, surface, tol, launched, time_limit))
        status = phases[-1].reached or FlightStatus.AT_REST
        status = FlightStatus.BLOWN if phases[-1].blown else status
    again = partial(follow, start, ball, air, ground, tol, plane=plane, time_limit=time_limit,
                    ends=further)  # fmt: skip
    return Course(status, tuple(flights), tuple(bounces), tuple(phases), again)


def _bouncing(
    state: BallState, ball: Ball, surface: Surface, one_flight: Callable[[BallState], Flight]
) -> tuple[list[Flight], list[BallState], str | None]:
    flights: list[Flight] = []
    bounces: list[BallState] = []
    clock = 0.0
    while True:
        flights.append(one_flight(state))
        if flights[-1].status is not FlightStatus.LANDED:
            return flights, bounces, flights[-1].status
        clock += flights[-1].duration
        state = bounce(flights[-1].landing, ball, surface)
        if state.velocity[2] < LEAST_REBOUND:
            return flights, bounces, None
        if len(bounces) == MOST_BOUNCES:
            return flights, bounces, FlightStatus.BOUNCING
        bounces.append(BallState(state.position, state.velocity, state.spin, clock))
