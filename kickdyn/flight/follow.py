"""A ball followed until it rests: flight, bounces, sliding, rolling."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.aerodynamics.coefficient_model import CoefficientModel
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.errors import InvalidInput
from kickdyn.flight.bounce import bounce
from kickdyn.flight.flight_result import Flight, profile
from kickdyn.flight.fly import check_scene, fly, wall_of
from kickdyn.flight.roll import Glide, roll, slide
from kickdyn.flight.validity_ranges import outside, said
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane

LEAST_REBOUND = 0.15
"""Upward speed after a bounce below which the ball stays down [m/s]; it would hop about 1 mm."""

MOST_BOUNCES = 200


@dataclass(frozen=True, eq=False, repr=False)
class Course(ReprMixin):
    """All a ball does until it rests or meets a plane; times count from the launch.

    Attributes:
        status: `at-rest`; `at-plane`, where that ended it; `aloft`, where a flight would not come
            down; `bouncing`, where `MOST_BOUNCES` were not enough; `blown`, where the wind kept the
            ball rolling.
        flights: one before each bounce.
        bounces: the ball just after each touch of the ground that sent it up again.
        glides: slide and roll, if it came to that.
        rest: the last state.
    """

    status: str
    flights: tuple[Flight, ...]
    bounces: tuple[BallState, ...]
    glides: tuple[Glide, ...]
    rest: BallState

    def _rows(self) -> Iterable[Row]:
        yield "status", self.status, ""
        yield "launch", self.flights[0].launch.velocity, "m/s"
        yield "bounces", len(self.bounces), ""
        yield "distance", self.distance, "m"
        yield "duration", self.duration, "s"
        yield "end", self.rest.position, "m"
        for line in self.warnings:
            yield "warning", line, ""

    def _picture(self) -> str:
        return profile(self.sample(np.linspace(0, self.duration, 257)), (*self.bounces, self.rest))

    @property
    def launch(self) -> BallState:
        """The start."""
        return self.flights[0].launch

    @property
    def distance(self) -> float:
        """Horizontal distance from launch to rest [m]."""
        return float(np.hypot(*(self.rest.position - self.flights[0].launch.position)[:2]))

    @property
    def duration(self) -> float:
        """Time from launch to rest [s]."""
        return float(self.rest.time)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for each coefficient used outside its range, by its share of the time aloft."""
        times, of_model = dict[str, float](), dict[str, CoefficientModel]()
        for path in self.flights:
            for model, share in outside(path):
                of_model[model.kind] = model
                times[model.kind] = times.get(model.kind, 0.0) + share * path.duration
        aloft = sum(path.duration for path in self.flights)
        return tuple(said(of_model[kind], t / aloft) for kind, t in times.items() if t > 0.0)

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at one time or many.

        Args:
            t: since the launch, from 0 to `duration`, a number or shape `(n,)` [s].

        Raises:
            InvalidInput: a time outside.
        """
        asked = validation.times(t, self.duration, "the course")
        times = np.atleast_1d(asked)
        position, velocity, spin = (np.zeros((len(times), 3)) for _ in range(3))
        pieces: Sequence[Flight | Glide] = (*self.flights, *self.glides)
        began = 0.0
        for number, piece in enumerate(pieces):
            last = number == len(pieces) - 1
            inside = (times >= began) & ((times < began + piece.duration) | last)
            if inside.any():
                here = piece.sample(np.clip(times[inside] - began, 0.0, piece.duration))
                position[inside], velocity[inside] = here.position, here.velocity
                spin[inside] = here.spin
            began += piece.duration
        if asked.ndim == 0:
            return BallState(position[0], velocity[0], spin[0], float(asked))
        return BallState(position, velocity, spin, times)


def follow(
    state: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    plane: Plane | None = None,
    time_limit: float = 1000.0,
) -> Course:
    """Let a ball fly, bounce and roll until it rests.

    Args:
        state: the launch, above the ground or on it.
        ball: mass, radius and inertia.
        air: None is the vacuum.
        ground: with a surface; None is turf that the ball touches at its launch, so that its first
            flight ends at the height of the launch, as that of `fly` does.
        tol: relative tolerance of every flight.
        plane: a wall or a goal line that ends it all, flying, sliding or rolling.
        time_limit: of every flight, and of rolling [s].

    Raises:
        InvalidInput: ground without a surface, or without the friction that ends sliding, or as for
            `fly`.
    """
    check_scene(state, ball, air, ground)
    if ground is None:
        ground = Ground(float(state.position[2]) - ball.radius, "turf")
    surface = ground.surface
    if not isinstance(surface, Surface):
        raise InvalidInput("the ground has no surface: name one, such as Ground(surface='turf')")
    flights: list[Flight] = []
    bounces: list[BallState] = []
    clock = 0.0
    while True:
        path = fly(state, ball, air, ground, tol, plane=plane, time_limit=time_limit)
        flights.append(path)
        clock += path.duration
        if path.status != "landed":
            return _done(path.status, flights, bounces, [], path.landing, clock)
        state = bounce(path.landing, ball, surface)
        if state.velocity[2] < LEAST_REBOUND:
            break
        if len(bounces) == MOST_BOUNCES:
            return _done("bouncing", flights, bounces, [], path.landing, clock)
        bounces.append(BallState(state.position, state.velocity, state.spin, clock))
    if surface.friction == 0.0:
        raise InvalidInput(f"friction of {surface.name} is 0: the ball would slide for ever")
    glides: list[Glide] = []
    sliding = slide(state, ball, air, surface, wall_of(plane, ball, state))
    if sliding is not None:
        glides.append(sliding)
        state = sliding.end
    if not (glides and glides[-1].at_wall):
        glides.append(roll(state, ball, air, surface, tol, wall_of(plane, ball, state), time_limit))
    clock += sum(glide.duration for glide in glides)
    status = "at-plane" if glides[-1].at_wall else "blown" if glides[-1].blown else "at-rest"
    return _done(status, flights, bounces, glides, glides[-1].end, clock)


def _done(
    status: str,
    flights: list[Flight],
    bounces: list[BallState],
    glides: list[Glide],
    last: BallState,
    clock: float,
) -> Course:
    rest = BallState(last.position, last.velocity, last.spin, clock)
    return Course(status, tuple(flights), tuple(bounces), tuple(glides), rest)
