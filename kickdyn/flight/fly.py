"""The flight of a ball, from launch to landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.ballistic import ballistic, time_to_fall
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.forces import GRAVITY, STILL, brakes, downward, is_ballistic
from kickdyn.flight.integrate import METHOD, Arc, Event, fly_until
from kickdyn.flight.state_layout import Motion
from kickdyn.flight.tolerances import tolerances
from kickdyn.flight.validity_ranges import outside, said
from kickdyn.ground import Ground
from kickdyn.plane import Plane

MAX_SPEED = 299_792_458.0
"""In air [m/s], that of light. Tolerances hold up to there; coefficients end far below."""


class _Ends(NamedTuple):
    """Where a flight ends: so far down [m], at a wall (normal and gap [m]), so late [s]."""

    drop: float
    wall: tuple[Array, float] | None
    time_limit: float


def fly(
    state: BallState,
    ball: Ball,
    air: Air | None = None,
    ground: Ground | None = None,
    tol: float = 1e-9,
    *,
    plane: Plane | None = None,
    orientation: bool = False,
    time_limit: float = 1000.0,
    strict: bool = False,
) -> Flight:
    """Let a ball fly.

    What is not named is not computed: without air a formula answers (Eqs. 24-25), with air
    scipy's DOP853 does, with lift only if the ball spins, in as many states as the scene needs.

    Args:
        state: the launch, as `Impact.ball_after` gives it; its time is not used.
        ball: mass and radius.
        air: None is the vacuum.
        ground: where the flight ends; None ends it back at the height of the launch.
        tol: relative tolerance of the integration, 1e-13 to 1e-2, of the flight's own lengths and
            speeds.
        plane: a wall or a goal line, where the flight ends if it comes there first. A ball that
            starts on it flies only if it leaves it.
        orientation: whether `Flight.orientation` will be asked for; where spin decays that costs
            one more state.
        time_limit: after which a ball that will not come down is left alone [s].
        strict: whether a coefficient outside its range is an error; else it is one of `warnings`.

    Raises:
        InvalidInput: an array of states, a ball that starts inside the ground, beyond the plane or
            faster than `MAX_SPEED`, a bad tolerance, or a coefficient outside its range where that
            is an error.
        KickdynError: the integrator gave up.
    """
    check_scene(state, ball, air, ground)
    validation.check_type(Plane, plane=plane, optional=True)
    if state.position.shape != (3,):
        raise InvalidInput(f"launch has shape {state.position.shape}: fly takes one state, (3,)")
    tol = validation.number("tol", tol, at_least=1e-13, at_most=1e-2)
    time_limit = validation.number("time limit", time_limit, above=0, unit="s")
    ends = _Ends(_drop(state, ball, ground), wall_of(plane, ball, state), time_limit)
    scene: dict[str, Any] = {"ball": ball, "air": air, "ground": ground, "plane": plane, "tol": tol}
    made: Callable[..., Flight] = partial(
        Flight,
        **scene,
        turning=orientation,
        _again=partial(fly, state, **scene, time_limit=time_limit),
    )
    g = downward(ball, air)
    unmoved = air is None or is_ballistic(air, state.spin) or _creeps(state, ball, air, ends.drop)
    if air is None or (unmoved and g > 0.0):
        return made(**_fall(state, g, ends))
    if not math.hypot(*state.velocity) <= MAX_SPEED:
        raise InvalidInput(
            f"launch speed is {math.hypot(*state.velocity):g} m/s: in air it must be at most "
            f"{MAX_SPEED:g} m/s, that of light"
        )
    motion = Motion(state, ball, air, orientation)
    wind = _windspeed(air, float(state.position[2]))
    rtol, near, slow = tolerances(state.velocity, ends.drop, wind, ball, air, tol)
    atol = np.array([*3 * [near], *3 * [slow], tol, tol * near / slow])[motion.kept]
    try:
        path = made(**_integrate(state, air, motion, ends, rtol, atol))
    except KickdynError as error:
        if motion.fault is None:
            raise
        kind = type(motion.fault).__name__
        raise KickdynError(
            f"{error}; the air's wind or a coefficient raised {kind}: {motion.fault}"
        ) from motion.fault
    if strict or any(getattr(model, "refuses", False) for model in (air.drag, air.lift)):
        for model, share in outside(path):
            if share > 0 and (strict or model.refuses):
                raise InvalidInput(f"the flight leaves a coefficient's range: {said(model, share)}")
    return path


def check_scene(state: BallState, ball: Ball, air: Air | None, ground: Ground | None) -> None:
    """Raise `InvalidInput` for what is not of the kind a flight needs."""
    validation.check_type(BallState, launch=state)
    validation.check_type(Ball, ball=ball)
    validation.check_type(Air, air=air, optional=True)
    validation.check_type(Ground, ground=ground, optional=True)


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


def _creeps(state: BallState, ball: Ball, air: Air, drop: float) -> bool:
    """Return whether the ball is too slow, all the way, for the air to matter: see `STILL`.

    An integrator would step to lengths that are no numbers any more.
    """
    if callable(air.wind) or air.wind.any() or brakes(air, state.spin):
        return False
    fastest = math.hypot(*state.velocity.tolist(), math.sqrt(2.0 * GRAVITY * drop))
    return 2.0 * ball.radius * air.density / air.viscosity * fastest < STILL


def _windspeed(air: Air, height: float) -> float:
    try:
        return validation.number(
            "wind", math.hypot(*air.wind_at(height)), at_most=MAX_SPEED, unit="m/s"
        )
    except InvalidInput:
        raise
    except Exception as fault:
        raise InvalidInput(
            f"the wind at the launch, {height:g} m high, raised {type(fault).__name__}: {fault}"
        ) from fault


def wall_of(plane: Plane | None, ball: Ball, state: BallState) -> tuple[Array, float] | None:
    """Return a plane's normal and how far the ball still is from reaching it [m]."""
    return None if plane is None else (plane.normal, plane.gap(ball, state.position))


def _fall(state: BallState, g: float, ends: _Ends) -> dict[str, Any]:
    rise = float(state.velocity[2])
    fall, reach = time_to_fall(rise, ends.drop, g), math.inf
    if ends.wall is not None:
        normal, gap = ends.wall
        reach = time_to_fall(float(normal @ state.velocity), gap, g * float(normal[2]))
    end = min(fall, reach, ends.time_limit)
    status = "landed" if end == fall else "at-plane" if end == reach else "aloft"
    top = min(max(rise / g, 0.0), end)
    nodes = ballistic(state.velocity, g, np.array([top, end]))
    if status == "landed":
        nodes[1, 2] = -ends.drop  # by definition; the formula says so but for rounding
    return {
        "launch": _at(state, 0.0, np.concatenate([np.zeros(3), state.velocity])),
        "apex": _at(state, top, nodes[0]),
        "landing": _at(state, end, nodes[1]),
        "status": status,
        "method": "closed form",
        "evaluations": 0,
        "_trajectory": partial(ballistic, state.velocity, g),
    }


def _integrate(
    state: BallState, air: Air, motion: Motion, ends: _Ends, rtol: float, atol: Array
) -> dict[str, Any]:
    # The way up ends at the apex, and only the way down looks for the landing: the event that marks
    # it would otherwise be zero at the very start.
    begin, rise, climb = motion.begin, motion.rise, motion.climb
    apex = Event(lambda states: float(states[climb]))
    floor = motion.reaching(np.array([0.0, 0.0, 1.0]), ends.drop)
    walls = [] if ends.wall is None else [motion.reaching(*ends.wall)]
    rates = np.array(motion.rates(0.0, begin.tolist()))
    rises = begin[climb] > 0.0 or (begin[climb] == 0.0 and rates[climb] > 0.0)
    nodes, arcs = [(0.0, begin)], []

    def until(event: Event) -> Event | None:
        events, start = [event, *walls], nodes[-1]
        arcs.append(fly_until(events, climb, motion.rates, start, ends.time_limit, rtol, atol))
        nodes.append((arcs[-1].end, arcs[-1].state))
        return arcs[-1].reached

    reached: Event | None = apex
    if ends.drop == 0.0 and not rises:
        reached = floor
    elif any(_passes(wall, begin, rates) for wall in walls):
        reached = walls[0]
    elif rises:
        reached = until(apex)
    if reached is apex:
        reached = until(floor)
    end, last = nodes[-1][0], nodes[-1][1].copy()
    if reached is floor:
        last[rise] = -ends.drop  # by definition; the event's root says so but for rounding
    crests = [crest for arc in arcs for crest in arc.crests]
    highest = max([*nodes, *crests], key=lambda node: float(node[1][rise]))
    spins = bool(state.spin.any())
    acting = {"drag": air.drag, "lift": spins and air.lift, "spin decay": spins and air.torque}
    effects = [name for name, model in acting.items() if model]
    return {
        "launch": _at(state, 0.0, motion.whole(begin)),
        "apex": _at(state, highest[0], motion.whole(highest[1])),
        "landing": _at(state, end, motion.whole(last)),
        "status": "landed" if reached is floor else "at-plane" if reached in walls else "aloft",
        "method": f"{METHOD}, rtol {rtol:g}, {', '.join(effects) or 'buoyancy only'}",
        "evaluations": sum(arc.evaluations for arc in arcs),
        "_trajectory": partial(_piecewise, arcs, motion),
    }


def _passes(wall: Event, begin: Array, rates: Array) -> bool:
    """Return whether a ball that starts on a plane goes through it rather than away."""
    assert wall.rate is not None
    across, pull = wall.rate(begin), wall.rate(rates)
    return wall.value(begin) <= 0.0 and (across < 0.0 or (across == 0.0 and pull < 0.0))


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
