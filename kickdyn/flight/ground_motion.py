"""What a ball does on level ground: it bounces, slides until it rolls, and rolls until it rests."""

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
from kickdyn.flight.forces import acceleration_function, downward, time_to_fall
from kickdyn.flight.integrate import Event, FlightArc, fly_until, joined
from kickdyn.ground import Surface


@dataclass(frozen=True, eq=False)
class GroundPhase:
    """A ball sliding or rolling along the ground; times count from the start of the phase.

    Attributes:
        start, end: the ball at the start and at the end of the phase.
        kind: `slide` or `roll`.
        at_wall: whether the phase ended at a wall.
        blown: whether the wind kept it rolling to the time limit.
        evaluations: number of evaluations of the acceleration.
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
        """Duration of the phase [s]."""
        return float(self.end.time)

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at times since the start of the phase, a number or shape `(n,)` [s].

        Raises:
            InvalidInput: a time outside the phase.
        """
        moments = validation.times(t, self.duration, f"the {self.kind}")
        states = self._states(np.atleast_1d(moments))
        return states if moments.ndim else _first(states)


def slip(state: BallState, ball: Ball) -> tuple[float, float]:
    r"""Return :math:`v - r\, \omega \times e_z`, the x and y velocity of the lowest point [m/s]."""
    vx, vy, _ = state.velocity.tolist()
    wx, wy, _ = state.spin.tolist()
    return vx - ball.radius * wy, vy + ball.radius * wx


def bounce(state: BallState, ball: Ball, surface: Surface) -> BallState:
    r"""Return the ball just after it touched the ground, from its state just before.

    The normal impulse is :math:`m (1 + e) |v_z|`. The tangential one, against the slip u, is
    :math:`m (1 + e_t) |u| / (1 + m r^2 / I)` where the ball grips, which turns u into
    :math:`-e_t u`, and :math:`\mu` times the normal one where that is less. Energy never rises:
    each of the two is a passive collision of its own.
    """
    vx, vy, vz = state.velocity.tolist()
    wx, wy, wz = state.spin.tolist()
    ux, uy = slip(state, ball)
    sliding = math.hypot(ux, uy)
    normal = (1.0 + surface.restitution) * -vz  # impulse over mass
    shell = ball.mass * ball.radius**2 / ball.inertia  # 3/2
    grip = (1.0 + surface.tangential_restitution) * sliding / (1.0 + shell)
    share = min(grip, surface.friction * normal) / sliding if sliding else 0.0
    turn = shell / ball.radius * share
    return BallState(
        state.position,
        (vx - share * ux, vy - share * uy, -surface.restitution * vz),
        (wx - turn * uy, wy + turn * ux, wz),
        state.time,
    )


def slide(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    wall: tuple[Array, float] | None = None,
) -> GroundPhase | None:
    r"""Return the phase in which friction turns sliding into rolling; None if it rolls already.

    The deceleration :math:`\mu g` is constant, and lasts :math:`|u| / (\mu g (1 + m r^2 / I))` with
    the slip u; the air is left out. A wall, normal and gap [m], may end it before.
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
        """Return the sliding ball at times `(n,)` [s]."""
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
    start = BallState(state.position, state.velocity, state.spin)
    return GroundPhase(start, _first(end), "slide", states, reached <= last)


def roll(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    tol: float,
    wall: tuple[Array, float] | None = None,
    time_limit: float = 1000.0,
) -> GroundPhase:
    r"""Return the phase from rolling to rest, slowed by the surface and, with air, by drag.

    .. math:: \dot v = \frac{F}{m + I / r^2} - c \frac{v}{|v|}

    with the force F of the air and the rolling deceleration c of the surface. A side wind turns the
    ball, and a wind that would keep it rolling does so to `time_limit`. A wall, normal and gap [m],
    may end it before.
    """
    # Friction turns with the ball, ever faster as it slows: looser steps miss where it rests.
    tol = min(tol, 1e-9)
    resistance = surface.rolling_deceleration
    share = 1.0 / (1.0 + ball.inertia / (ball.mass * ball.radius**2))
    acting = None if air is None or air.density == 0 else acceleration_function(ball, air)
    height = float(state.position[2])

    def push(u: float, v: float) -> tuple[float, float]:
        """Return the acceleration by the air of a rolling ball [m/s2]."""
        if acting is None:
            return 0.0, 0.0
        ax, ay, _, _ = acting(height, u, v, 0.0, 0.0, 0.0, 0.0)
        return share * ax, share * ay

    def rates(_: float, states: Any) -> list[float]:
        """Return the rates of place and velocity of a rolling ball."""
        u, v = float(states[2]), float(states[3])
        ax, ay = push(u, v)
        speed = math.hypot(u, v)
        return [u, v, ax - resistance * u / speed, ay - resistance * v / speed]

    u, v, _ = state.velocity.tolist()
    wind = push(0.0, 0.0)
    blowing, speed = math.hypot(*wind), math.hypot(u, v)
    slow = 1e-7 * max(speed, blowing)  # the forces are constant from there on to rest
    length = max(speed, slow) ** 2 / (2 * resistance)
    atol = tol * np.array([length, length, *2 * [max(speed, slow)]])
    stop = Event(lambda y: math.hypot(y[2], y[3]) - slow)
    events = [stop]
    if wall is not None and float(wall[0] @ state.velocity) < 0.0:
        normal, gap = wall
        events.append(Event(lambda y: gap + float(normal[:2] @ y[:2])))

    begin = np.array([0.0, 0.0, u, v])
    arcs: list[FlightArc] = []
    at, moved = 0.0, begin
    reached = stop if speed <= slow else None
    while reached is not stop or blowing > resistance:
        if reached is stop:  # and the wind sets it moving again
            moved = np.array([*moved[:2], *(slow * part / blowing for part in wind)])
        arcs.append(fly_until(events, None, rates, (at, moved), time_limit, tol, atol))
        at, moved, reached = arcs[-1].end, arcs[-1].state, arcs[-1].reached
        if reached is not stop:
            break
    rests = reached is stop
    left = math.hypot(*moved[2:]) if rests else 0.0
    along = moved[2:] / left if left else np.zeros(2)
    fading = resistance - float(along @ push(0.0, 0.0)) if left else 1.0
    final = at + left / fading if rests else at
    rolled = joined(arcs, begin)

    def states(t: Array) -> BallState:
        """Return the rolling ball at times `(n,)` [s]."""
        plane = rolled(np.minimum(t, at))
        late = np.clip(t - at, 0.0, final - at)  # in the straight line to rest
        speeds = left - fading * late
        plane[:2] += 0.5 * (left + speeds) * late * along[:, None]
        plane[2:] = np.where(late > 0.0, speeds * along[:, None], plane[2:])
        plane[2:, (t >= final) & rests] = 0.0
        u, v = plane[2:]
        still = np.zeros_like(u)
        return BallState(
            state.position + np.column_stack([*plane[:2], still]),
            np.column_stack([u, v, still]),
            np.column_stack([-v, u, still]) / ball.radius,
            t,
        )

    last = _first(states(np.array([final])))
    at_wall = reached is not None and not rests
    blown, calls = not rests and not at_wall, sum(arc.evaluations for arc in arcs)
    start = BallState(state.position, state.velocity, state.spin)
    return GroundPhase(start, last, "roll", states, at_wall, blown, calls)


def _first(states: BallState) -> BallState:
    """Return the first of many states."""
    time = float(np.asarray(states.time)[0])
    return BallState(states.position[0], states.velocity[0], states.spin[0], time)
