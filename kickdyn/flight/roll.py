"""What a ball does once it bounces no more: slides until it rolls, rolls until it rests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.flight.ballistic import time_to_fall
from kickdyn.flight.bounce import slip
from kickdyn.flight.forces import downward, forces
from kickdyn.flight.integrate import Event, fly_until
from kickdyn.ground import Surface


@dataclass(frozen=True, eq=False)
class Glide:
    """A stretch along the ground; times count from its start.

    Attributes:
        start, end: the ball there.
        kind: `slide` or `roll`.
        at_wall: whether it ended there.
    """

    start: BallState
    end: BallState
    kind: str
    _states: Any
    at_wall: bool = False

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return float(self.end.time)

    def sample(self, t: Array) -> BallState:
        """Return the ball at many times since the start, shape `(n,)` [s]."""
        return self._states(t)  # type: ignore[no-any-return]


def slide(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    wall: tuple[Array, float] | None = None,
) -> Glide | None:
    """Return the stretch in which friction turns sliding into rolling; None if it rolls already.

    Its deceleration mu g is constant; the air's share of it is left out. A wall, normal and gap
    [m], may end it before.
    """
    ux, uy = slip(state, ball)
    sliding = math.hypot(ux, uy)
    if sliding <= 1e-9 * max(math.hypot(*state.velocity), 1e-300):
        return None
    push = surface.friction * downward(ball, air)
    shell = ball.mass * ball.radius**2 / ball.inertia
    level = np.array([state.velocity[0], state.velocity[1], 0.0])
    along = np.array([ux, uy, 0.0]) / sliding
    across = np.array([-along[1], along[0], 0.0])  # turned towards rolling
    speed_change = push * along
    spin_change = shell / ball.radius * push * across

    def states(t: Array) -> BallState:
        t = t[:, None]
        moved = level * t - 0.5 * speed_change * t * t
        return BallState(
            state.position + moved, level - speed_change * t, state.spin + spin_change * t, t[:, 0]
        )

    if push <= 0.0:
        return None
    last = sliding / (push * (1.0 + shell))
    reached = math.inf
    if wall is not None:
        normal, gap = wall
        reached = time_to_fall(float(normal @ level), gap, float(normal @ speed_change))
    end = states(np.array([min(last, reached)]))
    return Glide(_with_time(state, 0.0), _single(end), "slide", states, reached <= last)


def roll(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    tol: float,
    wall: tuple[Array, float] | None = None,
) -> Glide:
    """Return the stretch from rolling to rest, slowed by the surface and, with air, by drag.

    The ball keeps its direction: a side wind does not turn it. A wall, normal and gap [m], may end
    it before.
    """
    level = np.array([state.velocity[0], state.velocity[1], 0.0])
    speed = math.hypot(*level)
    if speed == 0.0:
        still = BallState(state.position, (0, 0, 0), (0, 0, 0))
        return Glide(still, still, "roll", partial(_resting, still))
    along = level / speed
    axis = np.array([-along[1], along[0], 0.0]) / ball.radius  # spin of rolling over speed
    acting = None if air is None or air.density == 0 else forces(ball, air)
    height = float(state.position[2])

    def rates(_: float, states: Any) -> list[float]:
        v = float(states[1])
        slowing = -surface.rolling_deceleration
        if acting is not None:
            ax, ay, _, _ = acting(height, v * along[0], v * along[1], 0.0, 0.0, 0.0, 0.0)
            slowing += float(ax * along[0] + ay * along[1])
        return [v, min(slowing, -1e-3)]  # a tail wind does not keep it rolling for ever

    longest = speed / 1e-3
    length = speed * speed / (2 * surface.rolling_deceleration)
    atol = tol * np.array([length, speed])
    stop = Event(lambda y: float(y[1]))
    events = [stop]
    if wall is not None:
        normal, gap = wall
        towards = -float(normal @ along)
        if towards > 0.0:
            events.append(Event(lambda y: gap - towards * float(y[0])))
    arc = fly_until(events, 1, rates, (0.0, np.array([0.0, speed])), longest, tol, atol)
    resting = arc.reached is stop or arc.reached is None

    def states(t: Array) -> BallState:
        moved, v = arc.trajectory(np.minimum(t, arc.end))
        v = np.where((t >= arc.end) & resting, 0.0, v)[:, None]
        return BallState(state.position + moved[:, None] * along, v * along, v * axis, t)

    last = _single(states(np.array([arc.end])))
    return Glide(_with_time(state, 0.0), last, "roll", states, not resting)


def _resting(still: BallState, t: Array) -> BallState:
    zeros = np.zeros((len(t), 3))
    return BallState(still.position + zeros, zeros, zeros, t)


def _with_time(state: BallState, time: float) -> BallState:
    return BallState(state.position, state.velocity, state.spin, time)


def _single(states: BallState) -> BallState:
    time = float(np.asarray(states.time)[0])
    return BallState(states.position[0], states.velocity[0], states.spin[0], time)
