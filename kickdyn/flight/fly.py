"""The flight of a ball, from launch to landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from kickdyn import checks
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.ballistic import ballistic, time_to_fall
from kickdyn.flight.forces import downward, is_ballistic, rates
from kickdyn.flight.integrate import METHOD, Arc, fly_until, tolerances
from kickdyn.ground import Ground


@dataclass(frozen=True, eq=False)
class Flight:
    """A ball's way through the air; all times count from the launch.

    Attributes:
        launch: the start.
        apex: the highest point; the launch if the ball never rises.
        landing: the end, a node too: on the ground, or back at the height of the launch.
        status: `landed`, or `aloft` where the time limit came first; `landing` is then merely the
            last state.
        method: how it was computed.
        evaluations: of the acceleration; 0 for the closed form.
    """

    launch: BallState
    apex: BallState
    landing: BallState
    status: str
    method: str
    evaluations: int
    _trajectory: Callable[[Array], Array] = field(repr=False)

    @property
    def duration(self) -> float:
        """Time from launch to landing [s]."""
        return float(self.landing.time)

    @property
    def range(self) -> float:
        """Horizontal distance from launch to landing [m]."""
        return float(np.hypot(*(self.landing.position - self.launch.position)[:2]))

    @property
    def height(self) -> float:
        """Height of the apex above the launch [m]."""
        return float(self.apex.position[2] - self.launch.position[2])

    def sample(self, t: ArrayLike) -> BallState:
        """Return the ball at one time or many.

        Args:
            t: since the launch, from 0 to `duration`, a number or shape `(n,)` [s].

        Raises:
            InvalidInput: a time outside the flight.
        """
        times = checks.floats("t", t, unit="s")
        if times.ndim > 1:
            raise InvalidInput(f"t has shape {times.shape}: it must be a number or (n,)")
        outside = times[(times < 0) | (times > self.duration)]
        if outside.size:
            raise InvalidInput(
                f"t is {float(outside.flat[0]):g} s: the flight lasts from 0 to {self.duration:g} s"
            )
        moved = self._trajectory(np.atleast_1d(times)).reshape(*times.shape, 6)
        spin = np.broadcast_to(self.launch.spin, (*times.shape, 3))
        return BallState(self.launch.position + moved[..., :3], moved[..., 3:], spin, times)


def fly(
    state: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    time_limit: float = 1000.0,
) -> Flight:
    """Let a ball fly.

    What is not named is not computed: without air a formula answers (Eqs. 24-25), with air
    scipy's DOP853 does, with lift only if the ball spins. The spin stays as it was at the launch.

    Args:
        state: the launch, as `Impact.ball` gives it; its time is not used.
        ball: mass and radius.
        air: None is the vacuum.
        ground: where the flight ends; None ends it back at the height of the launch.
        tol: relative tolerance of the integration, 1e-13 to 1e-2, of the flight's own lengths and
            speeds.
        time_limit: after which a ball that will not come down is left alone [s].

    Raises:
        InvalidInput: an array of states, a ball that starts inside the ground, a bad tolerance.
        KickdynError: the integrator gave up.
    """
    if not isinstance(ball, Ball):
        raise InvalidInput(f"ball is {ball!r}: it must be a kickdyn.Ball")
    if state.position.shape != (3,):
        raise InvalidInput(f"launch has shape {state.position.shape}: fly takes one state, (3,)")
    tol = checks.number("tol", tol, at_least=1e-13, at_most=1e-2)
    time_limit = checks.number("time limit", time_limit, above=0, unit="s")
    drop = _drop(state, ball, ground)
    g = downward(ball, air)
    if air is None or (is_ballistic(air, state.spin) and g > 0.0):
        return _fall(state, g, drop, time_limit)
    return _integrate(state, ball, air, g, drop, tol, time_limit)


def _drop(state: BallState, ball: Ball, ground: Ground | None) -> float:
    """Return how far below the launch the flight ends [m]."""
    if ground is None:
        return 0.0
    gap = float(state.position[2]) - ball.radius - ground.height
    if gap < -1e-9 * max(ball.radius, abs(ground.height)):  # more than rounding
        raise InvalidInput(
            f"the ball starts {-gap:g} m inside the ground: its centre must be at or above "
            f"{ground.height + ball.radius:g} m"
        )
    return max(gap, 0.0)


def _fall(state: BallState, g: float, drop: float, time_limit: float) -> Flight:
    rise = float(state.velocity[2])
    end = time_to_fall(rise, drop, g)
    landed = end <= time_limit
    end = min(end, time_limit)
    nodes = ballistic(state.velocity, g, np.array([min(max(rise / g, 0.0), end), end]))
    if landed:
        nodes[1, 2] = -drop  # by definition; the formula says so but for rounding
    return Flight(
        launch=_at(state, 0.0, np.concatenate([np.zeros(3), state.velocity])),
        apex=_at(state, min(max(rise / g, 0.0), end), nodes[0]),
        landing=_at(state, end, nodes[1]),
        status="landed" if landed else "aloft",
        method="closed form",
        evaluations=0,
        _trajectory=partial(ballistic, state.velocity, g),
    )


def _integrate(
    state: BallState,
    ball: Ball,
    air: Air,
    g: float,
    drop: float,
    tol: float,
    time_limit: float,
) -> Flight:
    # The state is the displacement from the launch, so that a hop of 1e-20 m at a height of 100 m
    # is one. The way up ends at the apex, and only the way down looks for the landing: the event
    # that marks it would otherwise be zero at the very start.
    motion = rates(ball, air, state.spin)
    begin = np.concatenate([np.zeros(3), state.velocity])
    speed, wind = math.hypot(*state.velocity), math.hypot(*air.wind)
    rtol, atol = tolerances(speed, drop, g, wind, tol)
    rise = float(state.velocity[2])
    rises = rise > 0.0 or (rise == 0.0 and motion(0.0, begin.tolist())[5] > 0.0)
    arcs: list[Arc] = []
    if rises:
        arcs.append(fly_until(lambda y: float(y[5]), motion, (0.0, begin), time_limit, rtol, atol))
    apex = (arcs[0].end, arcs[0].state) if rises else (0.0, begin)
    if (not rises and drop > 0.0) or (rises and arcs[0].reached):
        arcs.append(fly_until(lambda y: float(y[2]) + drop, motion, apex, time_limit, rtol, atol))
    nodes = [(0.0, begin), *((arc.end, arc.state) for arc in arcs)]
    crests = [crest for arc in arcs for crest in arc.crests]
    highest = max([*nodes, *crests], key=lambda node: float(node[1][2]))
    end, last = nodes[-1][0], nodes[-1][1].copy()
    landed = not arcs or arcs[-1].reached
    if landed:
        last[2] = -drop  # by definition; the event's root says so but for rounding
    effects = [name for name in ("drag", "lift") if getattr(air, name) is not None]
    return Flight(
        launch=_at(state, 0.0, begin),
        apex=_at(state, *highest),
        landing=_at(state, end, last),
        status="landed" if landed else "aloft",
        method=f"{METHOD}, rtol {rtol:g}, {' and '.join(effects) or 'buoyancy only'}",
        evaluations=sum(arc.evaluations for arc in arcs),
        _trajectory=partial(_piecewise, arcs, begin),
    )


def _piecewise(arcs: list[Arc], begin: Array, t: Array) -> Array:
    moved = np.tile(begin, (len(t), 1))
    began = -math.inf
    for arc in arcs:
        inside = (t > began) & (t <= arc.end)
        if inside.any():
            moved[inside] = arc.trajectory(t[inside]).T
        began = arc.end
    return moved


def _at(launch: BallState, time: float, moved: Array) -> BallState:
    return BallState(launch.position + moved[:3], moved[3:], launch.spin, time)
