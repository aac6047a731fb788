"""The flight of a ball, from launch to landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from kickdyn import checks
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.ballistic import ballistic, time_to_fall
from kickdyn.flight.forces import downward, is_ballistic
from kickdyn.flight.integrate import METHOD, Arc, Event, fly_until
from kickdyn.flight.motion import Motion
from kickdyn.flight.ranges import outside, said
from kickdyn.flight.scale import tolerances
from kickdyn.ground import Ground

MAX_SPEED = 299_792_458.0
"""In air [m/s], that of light. Tolerances hold up to there; coefficients end far below."""


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
        ball, air, ground, tol: what was flown, and how exactly.
    """

    ball: Ball
    air: Air | None
    ground: Ground | None
    tol: float
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

    @cached_property
    def error(self) -> float:
        """Estimate of the error of the landing point [m], from a second, more exact flight.

        Twice what the landing moves when the tolerance is 10,000 times tighter (but 1e-13 at
        tightest), and never less than a thousandth of the tolerance's share of the flight's length,
        where both happen to agree. Computed when asked for: it costs that flight.
        """
        length = float(np.abs(self._trajectory(np.linspace(0, self.duration, 33))[:, :3]).max())
        if self.evaluations == 0:
            return 4 * float(np.finfo(float).eps) * length
        finer = fly(self.launch, self.ball, self.air, self.ground, max(self.tol * 1e-4, 1e-13))
        moved = float(np.linalg.norm(self.landing.position - finer.landing.position))
        return max(2 * moved, 1e-3 * self.tol * length, 1e-12 * length)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for each coefficient that was used outside the range it is meant for."""
        return tuple(said(model, share) for model, share in outside(self) if share > 0)

    def arrival(self, x: float) -> BallState | None:
        """Return the ball where it first crosses the plane at `x` [m, world frame]; None if never.

        The height there is `position[2]`; the time is in the state.
        """
        plane = checks.number("x", x, unit="m")
        times = np.linspace(0.0, self.duration, 513)
        gap = self.sample(times).position[:, 0] - plane
        crossed = np.flatnonzero(gap[:-1] * gap[1:] <= 0)
        if not len(crossed):
            return None
        first, then = times[crossed[0]], times[crossed[0] + 1]

        def short(t: float) -> float:
            return float(self.sample(t).position[0]) - plane

        if short(first) == 0.0:
            return self.sample(first)
        return self.sample(brentq(short, first, then, xtol=1e-15))

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
        moved = self._trajectory(np.atleast_1d(times))
        moved = moved.reshape(*times.shape, moved.shape[-1])
        spin = moved[..., 6:] * self.launch.spin
        return BallState(self.launch.position + moved[..., :3], moved[..., 3:6], spin, times)


def fly(
    state: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    time_limit: float = 1000.0,
    strict: bool = False,
) -> Flight:
    """Let a ball fly.

    What is not named is not computed: without air a formula answers (Eqs. 24-25), with air
    scipy's DOP853 does, with lift only if the ball spins, in as many states as the scene needs.

    Args:
        state: the launch, as `Impact.ball` gives it; its time is not used.
        ball: mass and radius.
        air: None is the vacuum.
        ground: where the flight ends; None ends it back at the height of the launch.
        tol: relative tolerance of the integration, 1e-13 to 1e-2, of the flight's own lengths and
            speeds.
        time_limit: after which a ball that will not come down is left alone [s].
        strict: whether a coefficient outside its range is an error; else it is one of `warnings`.

    Raises:
        InvalidInput: an array of states, a ball that starts inside the ground or faster than
            `MAX_SPEED`, a bad tolerance, or a coefficient outside its range where that is an error.
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
        return _fall(state, ball, air, ground, tol, g, drop, time_limit)
    if not math.hypot(*state.velocity) <= MAX_SPEED:
        raise InvalidInput(
            f"launch speed is {math.hypot(*state.velocity):g} m/s: in air it must be at most "
            f"{MAX_SPEED:g} m/s, that of light"
        )
    path = _integrate(state, ball, air, ground, tol, g, drop, time_limit)
    if strict or any(getattr(model, "refuses", False) for model in (air.drag, air.lift)):
        for model, share in outside(path):
            if share > 0 and (strict or model.refuses):
                raise InvalidInput(f"the flight leaves a coefficient's range: {said(model, share)}")
    return path


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


def _fall(
    state: BallState,
    ball: Ball,
    air: Air | None,
    ground: Ground | None,
    tol: float,
    g: float,
    drop: float,
    time_limit: float,
) -> Flight:
    rise = float(state.velocity[2])
    end = time_to_fall(rise, drop, g)
    landed = end <= time_limit
    end = min(end, time_limit)
    nodes = ballistic(state.velocity, g, np.array([min(max(rise / g, 0.0), end), end]))
    if landed:
        nodes[1, 2] = -drop  # by definition; the formula says so but for rounding
    return Flight(
        ball=ball,
        air=air,
        ground=ground,
        tol=tol,
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
    ground: Ground | None,
    tol: float,
    g: float,
    drop: float,
    time_limit: float,
) -> Flight:
    # The way up ends at the apex, and only the way down looks for the landing: the event that marks
    # it would otherwise be zero at the very start.
    motion = Motion(state, ball, air)
    begin, rise, climb = motion.begin, motion.rise, motion.climb
    wind = math.hypot(*air.wind_at(float(state.position[2])))
    rtol, near, slow = tolerances(state.velocity, drop, wind, ball, air, tol)
    atol = np.array([near, near, near, slow, slow, slow, tol], dtype=float)[motion.kept]

    def until(event: Event, start: tuple[float, Array]) -> Arc:
        return fly_until(event, climb, motion.rates, start, time_limit, rtol, atol)

    upward = float(begin[climb])
    rises = upward > 0.0 or (upward == 0.0 and motion.rates(0.0, begin.tolist())[climb] > 0.0)
    arcs = [until(lambda states: float(states[climb]), (0.0, begin))] if rises else []
    apex = (arcs[0].end, arcs[0].state) if rises else (0.0, begin)
    if (not rises and drop > 0.0) or (rises and arcs[0].reached):
        arcs.append(until(lambda states: float(states[rise]) + drop, apex))
    nodes = [(0.0, begin), *((arc.end, arc.state) for arc in arcs)]
    crests = [crest for arc in arcs for crest in arc.crests]
    highest = max([*nodes, *crests], key=lambda node: float(node[1][rise]))
    end, last = nodes[-1][0], nodes[-1][1].copy()
    landed = not arcs or arcs[-1].reached
    if landed:
        last[rise] = -drop  # by definition; the event's root says so but for rounding
    effects = [name for name in ("drag", "lift") if getattr(air, name) is not None]
    return Flight(
        ball=ball,
        air=air,
        ground=ground,
        tol=tol,
        launch=_at(state, 0.0, motion.whole(begin)),
        apex=_at(state, highest[0], motion.whole(highest[1])),
        landing=_at(state, end, motion.whole(last)),
        status="landed" if landed else "aloft",
        method=f"{METHOD}, rtol {rtol:g}, {' and '.join(effects) or 'buoyancy only'}",
        evaluations=sum(arc.evaluations for arc in arcs),
        _trajectory=partial(_piecewise, arcs, motion),
    )


def _piecewise(arcs: list[Arc], motion: Motion, t: Array) -> Array:
    states = np.tile(motion.begin[:, None], (1, len(t)))
    began = -math.inf
    for arc in arcs:
        inside = (t > began) & (t <= arc.end)
        if inside.any():
            states[:, inside] = arc.trajectory(t[inside])
        began = arc.end
    return motion.whole(states).T


def _at(launch: BallState, time: float, moved: Array) -> BallState:
    spin = launch.spin if len(moved) < 7 else moved[6] * launch.spin
    return BallState(launch.position + moved[:3], moved[3:6], spin, time)
