"""The end of a ball's way in a few large steps: for answers to centimetres, not to nanometres."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.ballistic import time_to_fall
from kickdyn.flight.bounce import bounce
from kickdyn.flight.fly import MAX_SPEED
from kickdyn.flight.follow import LEAST_REBOUND, MOST_BOUNCES
from kickdyn.flight.forces import GRAVITY, downward, forces
from kickdyn.flight.roll import roll, slide
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane

PATIENCE = 8
"""Times the flight's length in a vacuum after which a ball is left to the exact engine."""

LONGEST = 1000.0
"""Flight that the exact engine gives up after, too [s]."""

UNRULY = 0.05
"""Share of the fastest speed by which two estimates of a step's change may differ. They do so with
the cube of step over the time that drag slows the ball in: large steps are no use long before they
explode, as with a balloon."""

IN_WIND = 1e-9
"""Relative tolerance of a ball that rolls in the wind, in four steps a flight. It shrinks with the
cube of the steps: what is missed must show when there are twice as many."""

MISGUIDED = 0.1
"""Share of a step by which Newton's may put right where it was cut."""

State = tuple[float, ...]
Rates = Callable[[State], State]


class FlightEnvironment(NamedTuple):
    """What the ball moves through and to.

    Attributes:
        ball, air, plane: as for `fly`.
        ground: as for `follow` where it has a surface, else as for `fly`.
    """

    ball: Ball
    air: Air | None
    ground: Ground | None
    plane: Plane | None


class CoarseEnd(NamedTuple):
    """Where a ball's way ends in large steps.

    Attributes:
        state: there; None where large steps are not for it.
        status: as of `Flight` or `Course`.
        evaluations: of the acceleration.
    """

    state: BallState | None
    status: str
    evaluations: int


def coarse_end(launch: BallState, way: FlightEnvironment, steps: int) -> CoarseEnd:
    """Return where the ball's way ends.

    Classical Runge-Kutta steps of fourth order, `steps` of them in the time the flight would take
    in a vacuum; rolling is a quadrature. How exact that is, twice the steps tell.

    Args:
        launch: the ball at the start.
        way: what it moves through. A plane that the ball meets sliding or rolling is not for this.
        steps: of each flight.
    """
    surface = None if way.ground is None else way.ground.surface
    if surface is None:
        return coarse_path(launch, way, steps)[0]
    assert isinstance(surface, Surface)
    if surface.friction == 0.0:
        return CoarseEnd(None, "", 0)
    state, calls, clock = launch, 0, 0.0
    for _ in range(MOST_BOUNCES):
        (landed, status, more), _ = coarse_path(state, way, steps)
        calls += more
        if landed is None:
            break
        clock += float(landed.time)
        if status == "at-plane":
            there = BallState(landed.position, landed.velocity, landed.spin, clock)
            return CoarseEnd(there, status, calls)
        state = bounce(landed, way.ball, surface)
        if state.velocity[2] < LEAST_REBOUND:
            rest, more = _grounded(state, way, surface, steps, clock)
            return CoarseEnd(rest, "at-rest", calls + more)
    return CoarseEnd(None, "", calls)


def coarse_path(
    launch: BallState, way: FlightEnvironment, steps: int
) -> tuple[CoarseEnd, list[State]]:
    """Return the end of one flight, and the nodes up to it.

    A node is displacement, velocity, and spin over that of the launch.
    """
    drop, rise = drop_of(launch, way), float(launch.velocity[2])
    nodes: list[State] = [(0.0, 0.0, 0.0, *launch.velocity.tolist(), 1.0)]
    fastest = math.hypot(*nodes[0][3:6])
    inside = drop < -1e-9 * way.ball.radius and drop < -1e-9 * abs(float(launch.position[2]))
    if inside or not fastest <= MAX_SPEED:  # refused by the exact engine
        return CoarseEnd(None, "", 0), nodes
    if drop <= 0.0 and rise <= 0.0:
        there = BallState(launch.position, launch.velocity, launch.spin)
        return CoarseEnd(there, "landed", 0), nodes
    drop, g = max(drop, 0.0), downward(way.ball, way.air)
    values = [_falling((0.0, 0.0, 1.0), drop)]
    longest = time_to_fall(rise, drop, g)
    if way.plane is not None:
        normal, gap = way.plane.normal, way.plane.gap(way.ball, launch.position)
        values.append(_falling(tuple(normal.tolist()), gap))
        closing = -float(normal @ launch.velocity)
        longest = min(longest, gap / closing) if closing > 0.0 else longest
    if not 0.0 < longest < math.inf:
        return CoarseEnd(None, "", 0), nodes
    rates, step, calls = _rates(way, launch), longest / steps, 0
    fastest = max(fastest, math.sqrt(2.0 * g * drop) if g > 0.0 else 0.0)
    for number in range(min(PATIENCE * steps, math.ceil(LONGEST / step))):
        before = nodes[-1]
        after, unruly = _step(rates, before, step)
        calls += 4
        if not unruly <= UNRULY * fastest:
            break
        passed = [i for i, value in enumerate(values) if value(after) <= 0.0]
        if not passed:
            nodes.append(after)
            continue
        found = [_reach(rates, before, after, step, values[i]) for i in passed]
        calls += 7 * len(passed)
        reached = [(*part, i) for part, i in zip(found, passed, strict=True) if part is not None]
        if number == 0 or len(reached) < len(passed):
            break  # so early the step was no guess of the flight
        late, end, which = min(reached)
        nodes.append(end)
        there = _whole(launch, end, number * step + late)
        return CoarseEnd(there, ("landed", "at-plane")[which], calls), nodes
    return CoarseEnd(None, "", calls), nodes


def drop_of(launch: BallState, way: FlightEnvironment) -> float:
    """Return how far below the launch the flight ends [m]; below 0 inside the ground."""
    if way.ground is None:
        return 0.0
    return float(launch.position[2]) - way.ball.radius - way.ground.height


def _rates(way: FlightEnvironment, launch: BallState) -> Rates:
    height = float(launch.position[2])
    wx, wy, wz = launch.spin.tolist()
    if way.air is None or way.air.density == 0.0:
        return lambda y: (y[3], y[4], y[5], 0.0, 0.0, -GRAVITY, 0.0)
    acting = forces(way.ball, way.air)

    def rates(y: State) -> State:
        _, _, z, vx, vy, vz, left = y
        ax, ay, az, k = acting(height + z, vx, vy, vz, left * wx, left * wy, left * wz)
        return vx, vy, vz, ax, ay, az, -k * left

    return rates


def _step(rates: Rates, y: State, h: float) -> tuple[State, float]:
    """Return the state after a step, and by how much its two middle estimates differ [m/s]."""
    a = rates(y)
    b = rates(_along(y, a, 0.5 * h))
    c = rates(_along(y, b, 0.5 * h))
    d = rates(_along(y, c, h))
    sixth = h / 6.0
    after = tuple(
        [s + sixth * (p + 2.0 * (q + r) + t) for s, p, q, r, t in zip(y, a, b, c, d, strict=True)]
    )
    return after, h * math.hypot(c[3] - b[3], c[4] - b[4], c[5] - b[5])


def _along(y: State, slope: State, h: float) -> State:
    return tuple([s + h * r for s, r in zip(y, slope, strict=True)])


def _falling(normal: State, gap: float) -> Callable[[State], float]:
    nx, ny, nz = normal
    return lambda y: gap + nx * y[0] + ny * y[1] + nz * y[2]


def _reach(
    rates: Rates, before: State, after: State, step: float, value: Callable[[State], float]
) -> tuple[float, State] | None:
    """Return when, in a step, a value falls to 0, and the state there; None where it is not clear.

    By the cubic through both ends, a step to its root, and one of Newton's from there, which has
    little to put right unless the cubic was no guide.
    """
    start, end = value(before), value(after)
    if start < 0.0:
        return None
    level = value((0.0,) * 7)  # what is constant in it, not to be differentiated
    first = (value(rates(before)) - level) * step
    last = (value(rates(after)) - level) * step
    low, high = 0.0, 1.0
    if start == 0.0:
        if first <= 0.0:
            return None
        low = 1e-3
    for _ in range(30):
        s = 0.5 * (low + high)
        t = 1.0 - s
        cubic = t * t * ((1 + 2 * s) * start + s * first) + s * s * ((3 - 2 * s) * end - t * last)
        low, high = (s, high) if cubic > 0.0 else (low, s)
    state, _ = _step(rates, before, high * step)
    slope = rates(state)
    fall = value(slope) - level
    more = -value(state) / fall if fall < 0.0 else math.inf
    if not abs(more) <= MISGUIDED * step:
        return None
    return high * step + more, _along(state, slope, more)


def _whole(launch: BallState, end: State, time: float) -> BallState:
    return BallState(
        launch.position + np.array(end[:3]), np.array(end[3:6]), end[6] * launch.spin, time
    )


def _grounded(
    state: BallState, way: FlightEnvironment, surface: Surface, steps: int, clock: float
) -> tuple[BallState | None, int]:
    """Return the ball at rest, after it slid and rolled, and the evaluations.

    None where the wind keeps it rolling, or it comes to a plane.
    """
    sliding = slide(state, way.ball, way.air, surface)
    if sliding is not None:
        state, clock = sliding.end, clock + sliding.duration
    air, ball, calls = way.air, way.ball, 0
    still = air is None or air.density == 0.0
    if air is not None and not still and (callable(air.wind) or air.wind.any()):
        if way.plane is not None:
            return None, calls
        tol = max(IN_WIND * (4.0 / steps) ** 3, 1e-13)
        rolling = roll(state, ball, air, surface, tol)  # its way bends
        end, calls = rolling.end, rolling.evaluations
        clock += rolling.duration
        if rolling.blown:
            return None, calls
        return BallState(end.position, (0, 0, 0), (0, 0, 0), clock), calls
    vx, vy, _ = state.velocity.tolist()
    speed, place = math.hypot(vx, vy), state.position
    if speed > 0.0:
        along = np.array([vx, vy, 0.0]) / speed
        nodes, weights = _gauss(max(steps, 4))
        speeds = speed * nodes
        slowing = np.full(len(nodes), surface.rolling_deceleration)
        if air is not None and not still:
            calls = len(nodes)
            acting, height = forces(ball, air), float(state.position[2])
            share = 1.0 / (1.0 + ball.inertia / (ball.mass * ball.radius**2))  # of what rolls
            for i, v in enumerate(speeds.tolist()):
                ax, ay, _, _ = acting(height, v * along[0], v * along[1], 0.0, 0.0, 0.0, 0.0)
                slowing[i] -= share * (ax * along[0] + ay * along[1])
        place = place + speed * float(weights @ (speeds / slowing)) * along  # dx = v dv / slowing
        clock += speed * float(weights @ (1.0 / slowing))
    if way.plane is not None and _meets(way.plane, ball, place):
        return None, calls
    return BallState(place, (0, 0, 0), (0, 0, 0), clock), calls


def _meets(plane: Plane, ball: Ball, place: Array) -> bool:
    """Return whether a ball that comes straight to a place meets the plane, or nearly does."""
    try:
        return plane.gap(ball, place) <= 0.5 * ball.radius
    except InvalidInput:  # beyond it
        return True


@lru_cache(maxsize=16)
def _gauss(number: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss and Legendre on 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(number)
    return 0.5 * (nodes + 1.0), 0.5 * weights
