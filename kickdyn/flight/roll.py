"""What a ball does once it bounces no more: slides until it rolls, rolls until it rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.flight.ballistic import time_to_fall
from kickdyn.flight.bounce import slip
from kickdyn.flight.forces import downward, forces
from kickdyn.flight.integrate import Arc, Event, fly_until
from kickdyn.ground import Surface

LOOSEST = 1e-9
"""Relative tolerance of rolling at most: friction turns with the ball, ever faster as it slows, and
looser steps miss where it rests."""


@dataclass(frozen=True, eq=False)
class Glide:
    """A stretch along the ground; times count from its start.

    Attributes:
        start, end: the ball there.
        kind: `slide` or `roll`.
        at_wall: whether it ended there.
        blown: whether the wind kept it rolling to the time limit.
        evaluations: of the acceleration.
    """

    start: BallState
    end: BallState
    kind: str
    _states: Callable[[Array], BallState]
    at_wall: bool = False
    blown: bool = False
    evaluations: int = 0

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return float(self.end.time)

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at times since the start, a number or shape `(n,)` [s]."""
        moments = validation.times(t, self.duration, f"the {self.kind}")
        states = self._states(np.atleast_1d(moments))
        return states if moments.ndim else _single(states)


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
    time_limit: float = 1000.0,
) -> Glide:
    """Return the stretch from rolling to rest, slowed by the surface and, with air, by drag.

    Drag acts on the mass of a rolling ball, m + I/r^2. A side wind turns its way; a wind that would
    keep it rolling does so to `time_limit`. A wall, normal and gap [m], may end it before.
    """
    tol = min(tol, LOOSEST)
    resistance = surface.rolling_deceleration
    share = 1.0 / (1.0 + ball.inertia / (ball.mass * ball.radius**2))
    acting = None if air is None or air.density == 0 else forces(ball, air)
    height = float(state.position[2])

    def push(u: float, v: float) -> tuple[float, float]:
        if acting is None:
            return 0.0, 0.0
        ax, ay, _, _ = acting(height, u, v, 0.0, 0.0, 0.0, 0.0)
        return share * ax, share * ay

    def rates(_: float, states: Any) -> list[float]:
        u, v = float(states[2]), float(states[3])
        ax, ay = push(u, v)
        speed = math.hypot(u, v)
        return [u, v, ax - resistance * u / speed, ay - resistance * v / speed]

    u, v, _ = state.velocity.tolist()
    wind = push(0.0, 0.0)
    blowing = math.hypot(*wind)
    speed = math.hypot(u, v)
    slow = 1e-7 * max(speed, blowing)  # on what is left then, the forces are constant
    length = max(speed, slow) ** 2 / (2 * resistance)
    atol = tol * np.array([length, length, *2 * [max(speed, slow)]])
    stop = Event(lambda y: math.hypot(y[2], y[3]) - slow)
    events = [stop]
    if wall is not None:
        normal, gap = wall
        if float(normal @ state.velocity) < 0.0:
            events.append(Event(lambda y: gap + float(normal[:2] @ y[:2])))
    arcs: list[Arc] = []
    at, moved = 0.0, np.array([0.0, 0.0, u, v])
    reached = stop if speed <= slow else None
    while True:
        if reached is stop:
            if blowing <= resistance:
                break
            moved = np.array([*moved[:2], *(slow * part / blowing for part in wind)])
        arcs.append(fly_until(events, 2, rates, (at, moved), time_limit, tol, atol))
        at, moved, reached = arcs[-1].end, arcs[-1].state, arcs[-1].reached
        if reached is not stop:
            break
    rests = reached is stop
    left = math.hypot(*moved[2:]) if rests else 0.0
    along = moved[2:] / left if left else np.zeros(2)
    fading = resistance - float(along @ push(0.0, 0.0)) if left else 1.0
    final = at + left / fading if rests else at

    def states(t: Array) -> BallState:
        plane = np.tile(moved[:, None], (1, len(t)))
        began = -1.0
        for arc in arcs:
            inside = (t > began) & (t <= arc.end)
            if inside.any():
                plane[:, inside] = arc.trajectory(t[inside])
            began = arc.end
        if rests:
            late = np.clip(t - at, 0.0, final - at)
            after = late > 0.0
            speeds = left - fading * late
            plane[:2] += np.where(after, 0.5 * (left + speeds) * late, 0.0) * along[:, None]
            plane[2:, after] = speeds[after] * along[:, None]
            plane[2:, t >= final] = 0.0
        u, v = plane[2:]
        still = np.zeros_like(u)
        return BallState(
            state.position + np.column_stack([*plane[:2], still]),
            np.column_stack([u, v, still]),
            np.column_stack([-v, u, still]) / ball.radius,
            t,
        )

    last = _single(states(np.array([final])))
    at_wall = reached is not None and not rests
    blown, calls = not rests and not at_wall, sum(arc.evaluations for arc in arcs)
    return Glide(_with_time(state, 0.0), last, "roll", states, at_wall, blown, calls)


def _with_time(state: BallState, time: float) -> BallState:
    return BallState(state.position, state.velocity, state.spin, time)


def _single(states: BallState) -> BallState:
    time = float(np.asarray(states.time)[0])
    return BallState(states.position[0], states.velocity[0], states.spin[0], time)
