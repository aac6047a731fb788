"""The end of a ball's way in a few large steps: for answers to centimetres, not to nanometres."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.flight.ballistic import time_to_fall
from kickdyn.flight.bounce import bounce
from kickdyn.flight.follow import LEAST_REBOUND, MOST_BOUNCES
from kickdyn.flight.forces import GRAVITY, downward, forces
from kickdyn.flight.roll import roll, slide
from kickdyn.ground import Ground, Surface
from kickdyn.plane import Plane

PATIENCE = 8
"""Times the flight's length in a vacuum after which a ball is left to the exact engine."""

IN_WIND = 1e-8
"""Relative tolerance of a ball that rolls in the wind."""

State = tuple[float, ...]
Rates = Callable[[State], State]


class Way(NamedTuple):
    """What the ball moves through and to.

    Attributes:
        ball, air, plane: as for `fly`.
        ground: as for `follow` where it has a surface, else as for `fly`.
    """

    ball: Ball
    air: Air | None
    ground: Ground | None
    plane: Plane | None


def coarse_end(launch: BallState, way: Way, steps: int) -> tuple[BallState | None, int]:
    """Return where the ball's way ends, and the evaluations that took; None if it is not for this.

    Classical Runge-Kutta steps of fourth order, `steps` of them in the time the flight would take
    in a vacuum; rolling is a quadrature. How exact that is, twice the steps tell.

    Args:
        launch: the ball at the start.
        way: what it moves through. A plane on a ground with a surface is not for this.
        steps: of each flight.
    """
    surface = None if way.ground is None else way.ground.surface
    if surface is None:
        end, _, calls = coarse_path(launch, way, steps)
        return end, calls
    assert isinstance(surface, Surface)
    if way.plane is not None or surface.friction == 0.0:
        return None, 0
    state, calls, clock = launch, 0, 0.0
    for _ in range(MOST_BOUNCES):
        landed, _, more = coarse_path(state, way, steps)
        calls += more
        if landed is None:
            return None, calls
        clock += float(landed.time)
        state = bounce(landed, way.ball, surface)
        if state.velocity[2] < LEAST_REBOUND:
            return _grounded(state, way, surface, steps, clock), calls + steps
    return None, calls


def coarse_path(
    launch: BallState, way: Way, steps: int
) -> tuple[BallState | None, list[State], int]:
    """Return the end of one flight, the nodes before it, and the evaluations.

    A node is displacement, velocity, and spin over that of the launch.
    """
    drop, rise = drop_of(launch, way), float(launch.velocity[2])
    nodes: list[State] = [(0.0, 0.0, 0.0, *launch.velocity.tolist(), 1.0)]
    if drop <= 0.0 and rise <= 0.0:
        return BallState(launch.position, launch.velocity, launch.spin), nodes, 0
    g = downward(way.ball, way.air)
    values = [_falling((0.0, 0.0, 1.0), drop)]
    longest = time_to_fall(rise, drop, g)
    if way.plane is not None:
        normal, gap = way.plane.normal, way.plane.gap(way.ball, launch.position)
        values.append(_falling(tuple(normal.tolist()), gap))
        closing = -float(normal @ launch.velocity)
        longest = min(longest, gap / closing) if closing > 0.0 else longest
    if not 0.0 < longest < math.inf:
        return None, nodes, 0
    rates, step, calls = _rates(way, launch), longest / steps, 0
    for number in range(PATIENCE * steps):
        before = nodes[-1]
        after = _step(rates, before, step)
        calls += 4
        passed = [value for value in values if value(after) <= 0.0]
        if not passed:
            nodes.append(after)
            continue
        found = [_reach(rates, before, after, step, value) for value in passed]
        reached = [part for part in found if part is not None]
        if len(reached) < len(passed):
            break
        late, end = min(reached)
        calls += 7 * len(passed)
        return _whole(launch, end, number * step + late), [*nodes, end], calls
    return None, nodes, calls


def drop_of(launch: BallState, way: Way) -> float:
    """Return how far below the launch the flight ends [m]."""
    if way.ground is None:
        return 0.0
    return max(float(launch.position[2]) - way.ball.radius - way.ground.height, 0.0)


def _rates(way: Way, launch: BallState) -> Rates:
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


def _step(rates: Rates, y: State, h: float) -> State:
    a = rates(y)
    b = rates(_along(y, a, 0.5 * h))
    c = rates(_along(y, b, 0.5 * h))
    d = rates(_along(y, c, h))
    sixth = h / 6.0
    return tuple(
        s + sixth * (p + 2.0 * (q + r) + t) for s, p, q, r, t in zip(y, a, b, c, d, strict=True)
    )


def _along(y: State, slope: State, h: float) -> State:
    return tuple([s + h * r for s, r in zip(y, slope, strict=True)])


def _falling(normal: State, gap: float) -> Callable[[State], float]:
    nx, ny, nz = normal
    return lambda y: gap + nx * y[0] + ny * y[1] + nz * y[2]


def _reach(
    rates: Rates, before: State, after: State, step: float, value: Callable[[State], float]
) -> tuple[float, State] | None:
    """Return when, in a step, a value falls to 0, and the state there.

    By the cubic through both ends, a step to its root, and one of Newton's from there.
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
    state = _step(rates, before, high * step)
    slope = rates(state)
    fall = value(slope) - level
    more = -value(state) / fall if fall < 0.0 else 0.0
    return high * step + more, _along(state, slope, more)


def _whole(launch: BallState, end: State, time: float) -> BallState:
    return BallState(
        launch.position + np.array(end[:3]), np.array(end[3:6]), end[6] * launch.spin, time
    )


def _grounded(
    state: BallState, way: Way, surface: Surface, steps: int, clock: float
) -> BallState | None:
    """Return the ball at rest, after it slid and rolled; None where the wind keeps it rolling."""
    sliding = slide(state, way.ball, way.air, surface)
    if sliding is not None:
        state, clock = sliding.end, clock + sliding.duration
    air, ball = way.air, way.ball
    still = air is None or air.density == 0.0
    if air is not None and not still and (callable(air.wind) or air.wind.any()):
        rolling = roll(state, ball, air, surface, IN_WIND)  # its way bends
        end = rolling.end
        clock += rolling.duration
        return None if rolling.blown else BallState(end.position, (0, 0, 0), (0, 0, 0), clock)
    vx, vy, _ = state.velocity.tolist()
    speed = math.hypot(vx, vy)
    if speed == 0.0:
        return BallState(state.position, (0, 0, 0), (0, 0, 0), clock)
    along = np.array([vx, vy, 0.0]) / speed
    nodes, weights = _gauss(max(steps, 4))
    speeds = speed * nodes
    slowing = np.full(len(nodes), surface.rolling_deceleration)
    if air is not None and not still:
        acting, height = forces(ball, air), float(state.position[2])
        share = 1.0 / (1.0 + ball.inertia / (ball.mass * ball.radius**2))  # of what rolls
        for i, v in enumerate(speeds.tolist()):
            ax, ay, _, _ = acting(height, v * along[0], v * along[1], 0.0, 0.0, 0.0, 0.0)
            slowing[i] -= share * (ax * along[0] + ay * along[1])
    distance = speed * float(weights @ (speeds / slowing))  # dx = v dv / slowing
    clock += speed * float(weights @ (1.0 / slowing))
    return BallState(state.position + distance * along, (0, 0, 0), (0, 0, 0), clock)


@lru_cache(maxsize=16)
def _gauss(number: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss and Legendre on 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(number)
    return 0.5 * (nodes + 1.0), 0.5 * weights
