"""What a ball does on level ground: it bounces, slides until it rolls, and rolls until it rests."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.flight.equations import FINEST
from kickdyn.flight.events import Event
from kickdyn.flight.forces import acceleration_function, downward
from kickdyn.flight.integrate import Arc, Tolerance, integrate, trajectory
from kickdyn.ground import Surface
from kickdyn.restitution import restitution_at, restitution_for


@dataclass(frozen=True, eq=False)
class GroundPhase:
    """A ball sliding or rolling along the ground; times count from the start of the phase.

    Attributes:
        start, end: the ball at the start and at the end of the phase.
        kind: `slide` or `roll`.
        reached: name of the event that ended the phase, such as `at-plane`; None where none did.
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


def slip(state: BallState, ball: Ball) -> tuple[float, float]:
    r"""Return :math:`v - r\, \omega \times e_z`, the x and y velocity of the lowest point [m/s]."""
    vx, vy, _ = state.velocity.tolist()
    wx, wy, _ = state.spin.tolist()
    return vx - ball.radius * wy, vy + ball.radius * wx


def bounce(state: BallState, ball: Ball, surface: Surface) -> BallState:
    r"""Return the ball just after it touched the ground, from its state just before.

    The normal impulse is :math:`m (1 + e) |v_z|`, with e at the speed :math:`|v_z|`. The
    tangential one, against the slip u, is :math:`m (1 + e_t) |u| / (1 + m r^2 / I)` where the ball
    grips, which turns u into :math:`-e_t u`, and :math:`\mu` times the normal one where that is
    less. Energy never rises: each of the two is a passive collision of its own.
    """
    vx, vy, vz = state.velocity.tolist()
    wx, wy, wz = state.spin.tolist()
    ux, uy = slip(state, ball)
    sliding = math.hypot(ux, uy)
    e = restitution_at(restitution_for(surface.restitution, ball), -vz)
    normal = (1.0 + e) * -vz  # impulse over mass
    shell = ball.mass * ball.radius**2 / ball.inertia  # 3/2
    grip = (1.0 + surface.tangential_restitution) * sliding / (1.0 + shell)
    share = min(grip, surface.friction * normal) / sliding if sliding else 0.0
    turn = shell / ball.radius * share
    return BallState(
        state.position,
        (vx - share * ux, vy - share * uy, -e * vz),
        (wx - turn * uy, wy + turn * ux, wz),
        state.time,
    )


def slide(
    state: BallState,
    ball: Ball,
    air: Air | None,
    surface: Surface,
    ends: Sequence[Event] = (),
) -> GroundPhase | None:
    r"""Return the phase in which friction turns sliding into rolling; None if it rolls already.

    The deceleration :math:`\mu g` is constant, and lasts :math:`|u| / (\mu g (1 + m r^2 / I))` with
    the slip u; the air is left out. One of the events in `ends` may end the phase before.
    """
    ux, uy = slip(state, ball)
    sliding = math.hypot(ux, uy)
    if sliding <= 1e-9 * max(math.hypot(*state.velocity), 1e-300):
        return None
    deceleration = surface.friction * downward(ball, air)
    shell = ball.mass * ball.radius**2 / ball.inertia
    level = np.array([state.velocity[0], state.velocity[1], 0.0])
    along = np.array([ux, uy, 0.0]) / sliding
    across = np.array([-along[1], along[0], 0.0])  # turned towards rolling
    velocity_change = deceleration * along
    with np.errstate(invalid="ignore"):  # refused by BallState
        spin_change = shell / ball.radius * deceleration * across

    def states(t: Array) -> BallState:
        t = t[:, None]
        with np.errstate(over="ignore", invalid="ignore"):  # refused by BallState
            moved = level * t - 0.5 * velocity_change * t * t
            spin = state.spin + spin_change * t
        return BallState(state.position + moved, level - velocity_change * t, spin, t[:, 0])

    def rates(_: float, moving: Array) -> list[float]:
        return [*moving[3:6].tolist(), *(-velocity_change).tolist(), 0.0]

    duration, reached = sliding / (deceleration * (1.0 + shell)), None
    if ends:
        speed = math.hypot(*level) + sliding
        sizes = np.array([*3 * [speed * duration], *3 * [speed], 1.0])
        begin = 0.0, np.array([0.0, 0.0, 0.0, *level, 1.0])
        arc = integrate(
            rates, begin, ends, duration, Tolerance(FINEST, np.maximum(FINEST * sizes, 1e-300))
        )
        duration, reached = arc.end, arc.reached
    end = _first(states(np.array([duration])))
    start = BallState(state.position, state.velocity, state.spin)
    return GroundPhase(start, end, "slide", states, reached.name if reached else None)


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

    Rolling, a force of the air accelerates the ball by its :math:`1 / (1 + I / (m r^2))`, since it
    also turns the ball. A wind that is stronger than the surface's resistance does not let the ball
    rest: the phase ends where the ball turns, or at `time_limit`. One of the events in `ends` may
    end the phase before.
    """
    resistance = surface.rolling_deceleration
    share = 1.0 / (1.0 + ball.inertia / (ball.mass * ball.radius**2))
    height = float(state.position[2])
    acting = None if air is None or air.density == 0 else acceleration_function(ball, air)

    def push(u: float, v: float) -> tuple[float, float]:
        if acting is None:
            return 0.0, 0.0
        ax, ay, _, _ = acting(height, u, v, 0.0, 0.0, 0.0, 0.0)
        return share * ax, share * ay

    def rates(_: float, rolling: Array) -> list[float]:
        u, v = float(rolling[3]), float(rolling[4])
        ax, ay = push(u, v)
        braking = resistance / math.hypot(u, v)
        return [u, v, 0.0, ax - braking * u, ay - braking * v, 0.0, 0.0]

    u, v, _ = state.velocity.tolist()
    begin, speed = np.array([0.0, 0.0, 0.0, u, v, 0.0, 1.0]), math.hypot(u, v)
    wind = push(0.0, 0.0)
    slowest = 1e-7 * max(speed, math.hypot(*wind))
    is_slow = Event("slow", lambda y, _: math.hypot(y[3], y[4]) - slowest)  # forces are constant
    arc = Arc(0.0, begin, is_slow, [], 0, [])
    if speed > slowest:
        # Friction turns with the ball, ever faster as it slows: looser steps miss where it rests.
        tol = min(tol, 1e-9)
        sizes = np.array([*3 * [speed * (speed / (2.0 * resistance))], *3 * [speed], 1.0])
        tolerance = Tolerance(tol, np.maximum(tol * sizes, 1e-300))
        arc = integrate(rates, (0.0, begin), [is_slow, *ends], time_limit, tolerance)
    slow_time, slow = arc.end, arc.state
    duration = slow_time
    blown = arc.reached is None or (arc.reached is is_slow and math.hypot(*wind) > resistance)
    if arc.reached is is_slow and not blown and (slow_speed := math.hypot(*slow[3:5])):
        against = resistance - float(slow[3:5] @ wind) / slow_speed
        duration += slow_speed / against
    rolled = trajectory(arc, begin)

    def states(t: Array) -> BallState:
        moved = rolled(np.minimum(t, slow_time))
        late = np.maximum(t - slow_time, 0.0)
        left = 1.0 - late / max(duration - slow_time, 1e-300)  # of the speed
        x, y = moved[:2] + 0.5 * (1.0 + left) * late * slow[3:5, None]
        u, v = moved[3:5] * left
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
