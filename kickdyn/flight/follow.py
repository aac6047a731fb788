"""A ball followed until it rests: flight, bounces, sliding, rolling."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.flight.events import Event, checked_ends, plane_events
from kickdyn.flight.flight_result import Flight, FlightStatus, flight_warnings
from kickdyn.flight.fly import check_single, fly
from kickdyn.flight.forces import FINEST, VACUUM, Acceleration, acceleration_function, downward
from kickdyn.flight.integrate import Arc, Integration, Tolerance, solve_one, trajectory
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane
from kickdyn.restitution import restitution_for, rows_of

LOOSEST_ROLLING = 1e-9
"""Largest relative tolerance of rolling. Friction turns with the ball, ever faster as it slows:
looser steps miss where it rests."""


@dataclass(frozen=True, eq=False)
class GroundPhase:
    """A ball sliding or rolling along the ground; times count from the start of the phase.

    Attributes:
        start, end: the ball at the start and at the end of the phase.
        kind: `slide` or `roll`.
        reached: name of the event that ended the phase, such as `at-plane`; None if none did.
        blown: whether the wind does not let it rest.
        evaluations: number of evaluations of the acceleration.
    """

    start: BallState
    end: BallState
    kind: str
    _states: Callable[[Array], BallState]
    reached: str | None = None
    blown: bool = False
    evaluations: int = 0

    @property
    def duration(self) -> float:
        """Duration of the phase [s]."""
        return float(self.end.time)

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at times since the start of the phase, a number or shape `(n,)` [s]."""
        moments = validation.times(t, self.duration, f"the {self.kind}")
        states = self._states(np.atleast_1d(moments))
        return states if moments.ndim else _first(states)


def surface_of(ground: Ground, ball: Ball) -> Surface:
    """Return the surface of a ground that a ball can bounce on, or raise `InvalidInput`."""
    if not isinstance(ground.surface, Surface):
        raise InvalidInput("the ground has no surface: name one, such as Ground(surface='turf')")
    restitution_for(ground.surface.restitution, ball)  # raises where the pressure is unknown
    return ground.surface


def check_friction(surface: Surface) -> None:
    """Raise `InvalidInput` for a surface on which a ball slides for ever."""
    if surface.friction == 0.0:
        raise InvalidInput(f"friction of {surface.name} is 0: it must be above 0 to end sliding")


def slip(state: BallState, ball: Ball) -> Array:
    r"""Return :math:`v - r\, \omega \times e_z` of the lowest point, `(2,)` or `(n, 2)` [m/s]."""
    v, w = state.velocity, state.spin
    return np.stack(
        [v[..., 0] - ball.radius * w[..., 1], v[..., 1] + ball.radius * w[..., 0]], axis=-1
    )


def bounce(state: BallState, ball: Ball, surface: Surface) -> BallState:
    r"""Return one ball or n just after they touched the ground, from their states just before.

    The normal impulse is :math:`m (1 + e) |v_z|`, with e at the speed :math:`|v_z|`. The
    tangential one, against the slip u, is :math:`m (1 + e_t) |u| / (1 + m r^2 / I)` where the ball
    grips, which turns u into :math:`-e_t u`, and :math:`\mu` times the normal one where that is
    less. Energy never rises: each of the two is a passive collision of its own.
    """
    (vx, vy, vz), (wx, wy, wz) = state.velocity.T, state.spin.T
    ux, uy = slip(state, ball).T
    speeds, values = zip(*rows_of(restitution_for(surface.restitution, ball)), strict=True)
    e = np.interp(-vz, speeds, values)
    shell = ball.mass * ball.radius**2 / ball.inertia  # 3/2
    with np.errstate(over="ignore", invalid="ignore"):  # refused by BallState
        sliding, normal = np.hypot(ux, uy), (1.0 + e) * -vz  # impulse over mass
        grip = (1.0 + surface.tangential_restitution) * sliding / (1.0 + shell)
        share = np.minimum(grip, surface.friction * normal) / np.where(sliding > 0, sliding, 1.0)
        turn = shell / ball.radius * share
        velocity = np.array([vx - share * ux, vy - share * uy, -e * vz])
        spin = np.array([wx - turn * uy, wy + turn * ux, wz])
    return BallState(state.position, velocity.T, spin.T, state.time)


class Sliding(NamedTuple):
    """How friction slows one ball that slides, or n; vectors of shape `(3,)` or `(n, 3)`."""

    begin: BallState
    velocity: Array  # along the ground at the start [m/s]
    deceleration: Array  # of the centre [m/s2]
    spin_change: Array  # rate at which the spin changes [rad/s2]
    duration: float | Array  # time until the ball rolls [s]; 0 where it rolls already

    def sample(self, t: Array) -> BallState:
        """Return one ball at n times `(n,)` since the start, or n balls each at its own time."""
        t = t[:, None]
        with np.errstate(over="ignore", invalid="ignore"):  # refused by BallState
            displacement = self.velocity * t - 0.5 * self.deceleration * t * t
            spin = self.begin.spin + self.spin_change * t
        velocity = self.velocity - self.deceleration * t
        return BallState(self.begin.position + displacement, velocity, spin, t[:, 0])


def sliding_of(state: BallState, ball: Ball, air: Air | None, surface: Surface) -> Sliding:
    r"""Return the sliding of one ball or n.

    The deceleration :math:`\mu g` is constant, and lasts :math:`|u| / (\mu g (1 + m r^2 / I))` with
    the slip u; the air is left out.
    """
    u = slip(state, ball)
    size = np.hypot(u[..., 0], u[..., 1])
    slides = size > 1e-9 * np.maximum(validation.length(state.velocity), 1e-300)
    deceleration = surface.friction * downward(ball, air)
    shell = ball.mass * ball.radius**2 / ball.inertia
    along = u / np.where(slides, size, 1.0)[..., None]
    still = np.zeros_like(size)
    with np.errstate(over="ignore", invalid="ignore"):  # refused by BallState
        change = shell / ball.radius * deceleration
        axis = np.stack([-along[..., 1], along[..., 0], still], axis=-1)  # towards rolling
        duration = np.where(slides, size / (deceleration * (1.0 + shell)), 0.0)
        spin_change = change * axis
    braking = deceleration * np.stack([along[..., 0], along[..., 1], still], axis=-1)
    level = state.velocity * [1.0, 1.0, 0.0]
    lasts = duration if duration.ndim else float(duration)
    return Sliding(state, level, braking, spin_change, lasts)


class Rolling(NamedTuple):
    """How one ball that rolls, or n of them, are slowed by the surface and the air."""

    air: Air  # `VACUUM` where it does not act
    acting: Acceleration
    share: float  # of a ball in flight's acceleration, see `rolling_share`
    wind: Array  # acceleration of a ball at rest by the wind, shape `(2,)` [m/s2]
    straight: bool  # whether no wind changes the direction of the motion
    direction: Array  # of the velocity at the start, shape `(2,)` or `(n, 2)`
    speed: float | Array  # at the start [m/s]
    slowest: float | Array  # from which on all forces are taken to be constant [m/s]
    length: float | Array  # about how far the ball rolls [m]

    @property
    def slow_event(self) -> Event:
        """The event that the ball has become as slow as `slowest`."""
        excess = _excess_ahead if self.straight else _excess
        numbers = self.slowest, self.direction[..., 0], self.direction[..., 1]
        return Event("slow", excess, numbers, within_steps=False)


def _excess(state: Any, numbers: Any) -> Any:
    return math.hypot(state[3], state[4]) - numbers[0]


def _excess_ahead(state: Any, numbers: Any) -> Any:
    return numbers[1] * state[3] + numbers[2] * state[4] - numbers[0]


def rolling_acceleration(
    acting: Acceleration, share: float, resistance: float, straight: bool
) -> Callable[[float, float, float, float, float], tuple[float, float]]:
    """Return the acceleration of a ball that rolls [m/s2] as a function that numba can compile.

    Its arguments are height, velocity (2), and the direction of the velocity at the start (2). If
    the ball rolls straight, the surface brakes along that direction, so that the function goes on
    smoothly where the ball comes to rest; else along the velocity.
    """

    def acceleration(
        z: float, u: float, v: float, along_x: float, along_y: float
    ) -> tuple[float, float]:
        ax, ay, _, _ = acting(z, u, v, 0.0, 0.0, 0.0, 0.0)
        if not straight:
            speed = math.hypot(u, v)
            along_x, along_y = u / speed, v / speed
        return share * ax - resistance * along_x, share * ay - resistance * along_y

    return acceleration


def rolling_share(ball: Ball) -> float:
    r"""Return :math:`1 / (1 + I / (m r^2))`: a force on a rolling ball also turns it."""
    return 1.0 / (1.0 + ball.inertia / (ball.mass * ball.radius**2))


def rolling_of(state: BallState, ball: Ball, air: Air | None, surface: Surface) -> Rolling:
    """Return the rolling of one ball or n, all at one height."""
    air = VACUUM if air is None or air.density == 0 else air
    acting, share = acceleration_function(ball, air), rolling_share(ball)
    height = float(np.ravel(state.position[..., 2])[0])
    wind = share * np.array(acting(height, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:2])
    speed = np.hypot(state.velocity[..., 0], state.velocity[..., 1])
    with np.errstate(over="ignore"):  # refused by BallState
        length = speed * (speed / (2.0 * surface.rolling_deceleration))
    sizes = speed, 1e-7 * np.maximum(speed, math.hypot(*wind)), length
    moves = speed[..., None] > 0.0
    direction = np.where(
        moves, state.velocity[..., :2] / np.where(moves, speed[..., None], 1.0), [1, 0]
    )
    numbers = (size if size.ndim else float(size) for size in sizes)
    return Rolling(air, acting, share, wind, not wind.any(), direction, *numbers)


def time_to_rest(velocity: Array, wind: Array, resistance: float) -> Array:
    """Return the time until slow balls rest [s], all forces on which are constant.

    Velocities have shape `(2,)` or `(n, 2)` [m/s]. Where the acceleration of a ball at rest by the
    wind, `(2,)`, exceeds the resistance of the surface [m/s2], the time is infinite.
    """
    speed = validation.length(velocity)
    if math.hypot(*wind) > resistance:
        return np.full(speed.shape, math.inf)
    return np.asarray(speed / (resistance - velocity @ wind / np.where(speed > 0.0, speed, 1.0)))


def slide(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    ends: Sequence[Event] = (),
) -> GroundPhase | None:
    r"""Return the phase in which friction turns sliding into rolling; None if it rolls already.

    See `sliding_of`. One of the events in `ends` may end the phase before.
    """
    sliding = sliding_of(state, ball, air, surface)
    duration, reached = float(sliding.duration), None
    if duration == 0.0:
        return None

    def rates(moving: list[float]) -> list[float]:
        return [*moving[3:6], *(-sliding.deceleration).tolist(), 0.0]

    if ends:
        speed = math.hypot(*sliding.velocity) + math.hypot(*slip(state, ball))
        sizes = np.array([*3 * [speed * duration], *3 * [speed], 1.0])
        begin = np.array([0.0, 0.0, 0.0, *sliding.velocity, 1.0])
        tolerance = Tolerance(FINEST, np.maximum(FINEST * sizes, 1e-300))
        arc = solve_one(Integration(rates, ends, duration, tolerance).run(begin))
        duration, reached = arc.end, arc.reached
    end = _first(sliding.sample(np.array([duration])))
    start = BallState(state.position, state.velocity, state.spin)
    return GroundPhase(start, end, "slide", sliding.sample, reached.name if reached else None)


def roll(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    tol: float,
    ends: Sequence[Event] = (),
    time_limit: float = 1000.0,
) -> GroundPhase:
    r"""Return the phase from rolling to rest, slowed by the surface and, with air, by drag.

    A force of the air accelerates the ball by its `rolling_share`. A wind that is stronger than the
    surface's resistance does not let the ball rest: the phase ends where the ball turns, or at
    `time_limit`. One of the events in `ends` may end the phase before.
    """
    rolling, resistance = rolling_of(state, ball, air, surface), surface.rolling_deceleration
    height, along = float(state.position[2]), rolling.direction.tolist()
    acceleration = rolling_acceleration(rolling.acting, rolling.share, resistance, rolling.straight)

    def rates(moving: list[float]) -> list[float]:
        u, v = moving[3:5]
        return [u, v, 0.0, *acceleration(height, u, v, *along), 0.0, 0.0]

    begin = np.array([0.0, 0.0, 0.0, *state.velocity[:2], 0.0, 1.0])
    is_slow = rolling.slow_event.launched(state)
    arc = Arc(0.0, begin, is_slow, [], 0, [])
    if rolling.speed > rolling.slowest:
        tol = min(tol, LOOSEST_ROLLING)
        sizes = np.array([*3 * [rolling.length], *3 * [rolling.speed], 1.0])
        tolerance = Tolerance(tol, np.maximum(tol * sizes, 1e-300))
        arc = solve_one(Integration(rates, [is_slow, *ends], time_limit, tolerance).run(begin))
    slow_time, slow = arc.end, arc.state
    duration = slow_time
    remaining = float(time_to_rest(slow[3:5], rolling.wind, resistance))
    blown = arc.reached is None or (arc.reached is is_slow and remaining == math.inf)
    if arc.reached is is_slow and not blown:
        duration += remaining
    rolled = trajectory(arc, begin)

    def states(t: Array) -> BallState:
        columns = rolled(np.minimum(t, slow_time))
        late = np.maximum(t - slow_time, 0.0)
        share = 1.0 - late / max(duration - slow_time, 1e-300)  # of the speed
        x, y = columns[:2] + 0.5 * (1.0 + share) * late * slow[3:5, None]
        u, v = columns[3:5] * share
        still = np.zeros_like(u)
        return BallState(
            state.position + np.column_stack([x, y, still]),
            np.column_stack([u, v, still]),
            np.column_stack([-v, u, still]) / ball.radius,
            t,
        )

    start = BallState(state.position, state.velocity, state.spin)
    end = _first(states(np.array([duration])))
    name = None if arc.reached in (None, is_slow) else arc.reached.name
    return GroundPhase(start, end, "roll", states, name, blown, arc.evaluations)


def _first(states: BallState) -> BallState:
    time = float(np.asarray(states.time)[0])
    return BallState(states.position[0], states.velocity[0], states.spin[0], time)


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
