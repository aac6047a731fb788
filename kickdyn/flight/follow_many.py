"""Many balls followed until they rest: the answers of `follow`, in machine code."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.batch import (
    MARCH,
    Flown,
    Rows,
    checked_launches,
    dataset,
    integrate_many,
    landings,
    numbers_of,
    seconds_of_fly,
)  # fmt: skip
from kickdyn.flight.events import (
    Event,
    checked_ends,
    ground_event,
    plane_events,
)
from kickdyn.flight.flight_result import ALOFT, FAILED, FURTHER, LANDED, FlightStatus
from kickdyn.flight.follow import (
    LEAST_REBOUND,
    LOOSEST_ROLLING,
    MOST_BOUNCES,
    bounce,
    check_friction,
    rolling_of,
    slide,
    sliding_of,
    surface_of,
    time_to_rest,
)
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane

_FLYING, _DOWN = -1, -2
"""Statuses of a ball that is in the air, and of one that stays down."""


@validation.check_arguments
def follow_many(
    states: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    plane: Plane | None = None,
    time_limit: float = 1000.0,
    ends: Sequence[Event] = (),
) -> xr.Dataset:
    """Let n balls fly, bounce and roll until they rest, as `follow` does with one.

    Args:
        states: the launches, as for `fly_many`.
        ball: the ball.
        air: the air, as for `fly_many`.
        ground: a ground with a surface, the same for all. None is turf that every ball touches at
            its launch, which must then be at one height.
        tol: relative tolerance of every flight.
        plane: a wall or a goal line that ends the motion.
        time_limit: longest duration of every flight, and of rolling [s].
        ends: further events that end the motion, as for `fly_many`; with them, balls that slide are
            followed one by one.

    Returns:
        A dataset along `flight` in the order of the launches: `position`, `velocity` and `spin` at
        the end, `duration`, horizontal `distance`, number of `bounces`, and `status` by its flag.
        Where the status is `failed`, the numbers are nan.

    Raises:
        InvalidInput: a single state, or as for `follow` and `fly_many`.

    Example:
        >>> import kickdyn as kd
        >>> kicks = kd.BallState(velocity=[(20, 0, 10), (15, 2, 4)], spin=(0, -30, 0))
        >>> paths = kd.follow_many(kicks, kd.Ball(), kd.Air())
        >>> paths.distance.values.round(1).tolist(), paths.bounces.values.tolist()
        ([76.2, 44.2], [8, 6])
    """
    tol, time_limit = checked_launches(states, "follow", tol, time_limit)
    height = states.position[:, 2]
    if ground is None:
        if len(height) and np.ptp(height) > 0.0:
            raise InvalidInput("launches have unequal heights: follow_many needs a ground for them")
        ground = Ground(float(height[0] if len(height) else 0.0) - ball.radius, "turf")
    surface = surface_of(ground, ball)
    check_friction(surface)
    events = *plane_events(ball, plane), *checked_ends(ends)
    names: list[str] = [FlightStatus.AT_REST, FlightStatus.ALOFT, FlightStatus.FAILED]
    names += [FlightStatus.BOUNCING, FlightStatus.BLOWN, *(event.name for event in events)]
    balls = _Balls(states, ball, air, surface, events)
    balls.bounce_all(ground, tol, time_limit)
    balls.slide_all()
    balls.roll_all(tol, time_limit)
    return balls.dataset(names)


AT_REST, NOT_DOWN, LOST, BOUNCING, BLOWN, FIRST_END = range(6)
"""Flags of the statuses; flags of the ends follow."""


class _Balls:
    """The states of n balls on their way, and how their motion ended."""

    def __init__(
        self, states: BallState, ball: Ball, air: Air | None, surface: Surface,
        ends: tuple[Event, ...],
    ) -> None:  # fmt: skip
        n = len(states.position)
        self.launch, self.ball, self.air, self.surface = states, ball, air, surface
        self.ends = ends
        self.position, self.velocity = states.position.copy(), states.velocity.copy()
        self.spin, self.time = states.spin.copy(), np.zeros(n)
        self.bounces, self.status = np.zeros(n, np.int64), np.full(n, _FLYING, np.int8)

    def states(self, rows: Any) -> BallState:
        """Return the balls of some rows."""
        return BallState.computed(self.position[rows], self.velocity[rows], self.spin[rows])

    def bounce_all(self, ground: Ground, tol: float, time_limit: float) -> None:
        """Fly and bounce until every ball stays down or has ended."""
        events = ground_event(self.ball, ground), *self.ends
        while (rows := np.flatnonzero(self.status == _FLYING)).size:
            pays = MARCH.pays(len(rows) * seconds_of_fly(tol))
            end, status = landings(
                self.states(rows), self.ball, self.air, events, tol, time_limit, machine_code=pays
            )
            self.position[rows], self.velocity[rows] = end.position, end.velocity
            self.spin[rows] = end.spin
            self.time[rows] += end.time
            flags = np.array([_FLYING, NOT_DOWN, LOST, *range(FIRST_END, FIRST_END + 100)])
            self.status[rows] = flags[status]
            landed = rows[status == LANDED]
            after = bounce(self.states(landed), self.ball, self.surface)
            rises = after.velocity[:, 2] >= LEAST_REBOUND
            given_up = rises & (self.bounces[landed] == MOST_BOUNCES)
            self.status[landed[given_up]] = BOUNCING  # it ends as it lands
            self.status[landed[~rises]] = _DOWN
            self.bounces[landed[rises & ~given_up]] += 1
            goes_on = landed[~given_up]
            self.velocity[goes_on] = after.velocity[~given_up]
            self.spin[goes_on] = after.spin[~given_up]

    def slide_all(self) -> None:
        """Let friction turn sliding into rolling."""
        down = np.flatnonzero(self.status == _DOWN)
        sliding = sliding_of(self.states(down), self.ball, self.air, self.surface)
        time = np.asarray(sliding.duration)
        if self.ends:
            for i in down[time > 0.0].tolist():
                self._slide_one(i)
        else:
            end = sliding.sample(time)
            self.position[down], self.velocity[down] = end.position, end.velocity
            self.spin[down] = end.spin
            self.time[down] += time
        self.velocity[down, 2] = 0.0

    def _slide_one(self, i: int) -> None:
        state = self.states(i)
        ends = [end.launched(state) for end in self.ends]
        phase = slide(state, self.ball, self.air, self.surface, ends)
        if phase is None:
            return
        end = phase.end
        self.position[i], self.velocity[i], self.spin[i] = end.position, end.velocity, end.spin
        self.time[i] += phase.duration
        if phase.reached is not None:
            self.status[i] = FIRST_END + [end.name for end in self.ends].index(phase.reached)

    def roll_all(self, tol: float, time_limit: float) -> None:
        """Let balls roll to rest, by the equations of `follow.roll`."""
        rows = np.flatnonzero(self.status == _DOWN)
        if not rows.size:
            return
        from kickdyn.flight.compiling import compiled_rolling

        begin, n = self.states(rows), len(rows)
        rolling = rolling_of(begin, self.ball, self.air, self.surface)
        ends = [end.launched(begin) for end in (rolling.slow_event, *self.ends)]
        tol = min(tol, LOOSEST_ROLLING)
        scales = [tol * np.maximum(size, 1e-300) for size in (rolling.length, rolling.speed)]
        velocity = begin.velocity * [1.0, 1.0, 0.0]
        scene = np.column_stack([begin.position[:, 2], rolling.direction, np.zeros((n, 2))])
        # as `roll`: those that are slow at once are not integrated
        rolled = Flown(np.zeros((n, 8)), np.full(n, LANDED, np.int8), np.zeros(n, np.int64))
        rolled.nodes[:, 4:7] = velocity
        moves = np.asarray(rolling.speed > rolling.slowest)
        if moves.any():
            resistance = self.surface.rolling_deceleration
            moving = integrate_many(
                compiled_rolling(self.ball, rolling.air, resistance, rolling.straight),
                ends, numbers_of(ends, n)[moves], (scene[moves], velocity[moves]),
                [*(scale[moves] for scale in scales), math.inf], tol, time_limit,
            )  # fmt: skip
            rolled.put(moves, moving)
        self._stop(rows, rolled, rolling.wind)

    def _stop(self, rows: NDArray[np.intp], rolled: Flown, wind: Array) -> None:
        """Put in where balls that have become slow rest, and where others end."""
        nodes, status = rolled.nodes, rolled.status
        velocity, slow = nodes[:, 4:7], status == LANDED
        remaining = time_to_rest(velocity[:, :2], wind, self.surface.rolling_deceleration)
        blown = (slow & (remaining == math.inf)) | (status == ALOFT)
        flags = np.where(
            slow, AT_REST, np.where(status == FAILED, LOST, FIRST_END - FURTHER + status)
        )
        self.status[rows] = np.where(blown, BLOWN, flags)
        rests = slow & ~blown
        late = np.where(rests, remaining, 0.0)
        self.position[rows] += nodes[:, 1:4] + 0.5 * late[:, None] * velocity
        self.velocity[rows] = np.where(rests[:, None], 0.0, velocity)
        u, v = self.velocity[rows, 0], self.velocity[rows, 1]
        self.spin[rows] = np.column_stack([-v, u, np.zeros(len(rows))]) / self.ball.radius
        self.time[rows] += nodes[:, 0] + late

    def dataset(self, names: list[str]) -> xr.Dataset:
        """Return the ends as a dataset."""
        lost = self.status == LOST
        offset = self.position - self.launch.position
        rows: Rows = [
            ("position", self.position, "m", "centre of the ball at the end"),
            ("velocity", self.velocity, "m/s", "velocity at the end"),
            ("spin", self.spin, "rad/s", "spin at the end"),
            ("duration", self.time, "s", "time from launch to end"),
            ("distance", np.hypot(offset[:, 0], offset[:, 1]), "m", "horizontal, launch to end"),
        ]
        for _, values, *_ in rows:
            values[lost] = math.nan
        rows.append(("bounces", self.bounces, "1", "bounces"))
        attributes = {"title": "courses of a ball", "warnings": "; ".join(self.ball.warnings)}
        return dataset(rows, self.status, names, attributes)
