"""The end of a ball's path in a few large steps: for answers to centimetres, not to nanometres."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from kickdyn.aerodynamics.coefficient_model import is_known
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.core.gravity import GRAVITY
from kickdyn.flight.equations import MAX_SPEED
from kickdyn.flight.flight_result import FlightStatus
from kickdyn.flight.forces import acceleration_function, downward, time_to_fall
from kickdyn.scene.scene import FlightEnvironment

STAGE_DIFFERENCE = 0.05
"""Share of the fastest speed by which the two middle stages of a step may differ. They do so with
the cube of the step over the time in which drag slows the ball: large steps are useless long before
they diverge, as with a balloon."""

NEWTON = 3
"""Newton steps to where a flight ends within a step."""

State = tuple[float, ...]
Rates = Callable[[State], State]


class CoarseEnd(NamedTuple):
    """Where a flight ends in large steps.

    Attributes:
        state: there; None where large steps do not suffice.
        status: as of `Flight`.
        evaluations: of the acceleration.
        nodes: up to the end: displacement [m], velocity [m/s], and spin over that of the launch.
    """

    state: BallState | None
    status: str
    evaluations: int
    nodes: Sequence[State] = ()


def coarse_end(launch: BallState, environment: FlightEnvironment, steps: int) -> CoarseEnd:
    """Find where a flight ends, in large steps.

    It is integrated with classical Runge-Kutta steps of fourth order, `steps` of them in the time
    that it would take in a vacuum. The error shows when the number of steps is doubled. A ball that
    bounces is left to the exact integrators.
    """
    ball, air, ground, plane = environment
    drop, rise = drop_below(launch, environment), float(launch.velocity[2])
    nodes: list[State] = [(0.0, 0.0, 0.0, *launch.velocity.tolist(), 1.0)]
    fastest = math.hypot(*nodes[0][3:6])
    if _is_left_to_fly(air) or (ground is not None and ground.surface is not None):
        return CoarseEnd(None, "", 0)
    inside = drop < -1e-9 * ball.radius and drop < -1e-9 * abs(float(launch.position[2]))
    if inside or not fastest <= MAX_SPEED:  # refused by the exact integrators
        return CoarseEnd(None, "", 0)
    if drop <= 0.0 and rise <= 0.0:
        end = BallState(launch.position, launch.velocity, launch.spin)
        return CoarseEnd(end, FlightStatus.LANDED, 0)
    drop, g = max(drop, 0.0), downward(ball, air)
    heights = [_height((0.0, 0.0, 1.0), drop)]
    longest = time_to_fall(rise, drop, g)
    if plane is not None:
        gap = plane.gap(ball, launch.position)
        heights.append(_height(tuple(plane.normal.tolist()), gap))
        closing = -float(plane.normal @ launch.velocity)
        longest = min(longest, gap / closing) if closing > 0.0 else longest
    if not 0.0 < longest < math.inf:
        return CoarseEnd(None, "", 0)
    rates, step, evaluations = _rates(environment, launch), longest / steps, 0
    fastest = max(fastest, math.sqrt(2.0 * g * drop) if g > 0.0 else 0.0)
    # given up after 8 durations in a vacuum, or 1000 s, as by the exact integrators
    for number in range(min(8 * steps, math.ceil(1000.0 / step))):
        before = nodes[-1]
        after, difference = _step(rates, before, step)
        evaluations += 4
        if not difference <= STAGE_DIFFERENCE * fastest:
            break
        passed = [i for i, height in enumerate(heights) if height(after) <= 0.0]
        if not passed:
            nodes.append(after)
            continue
        if number == 0:
            break  # the vacuum's duration was no estimate of this flight's
        found = [_crossing(rates, before, after, step, heights[i]) for i in passed]
        evaluations += 5 * NEWTON * len(passed)
        reached = [(*part, i) for part, i in zip(found, passed, strict=True) if part is not None]
        if len(reached) < len(passed):
            break
        late, node, which = min(reached)
        nodes.append(node)
        position = launch.position + np.array(node[:3])
        velocity, spin = np.array(node[3:6]), node[6] * launch.spin
        end = BallState(position, velocity, spin, number * step + late)
        status = (FlightStatus.LANDED, FlightStatus.AT_PLANE)[which]
        return CoarseEnd(end, status, evaluations, nodes)
    return CoarseEnd(None, "", evaluations)


def drop_below(launch: BallState, environment: FlightEnvironment) -> float:
    """Return how far below the launch the flight ends [m]; negative inside the ground."""
    if environment.ground is None:
        return 0.0
    return float(launch.position[2]) - environment.ball.radius - environment.ground.height


def _is_left_to_fly(air: Air | None) -> bool:
    """Return whether a coefficient of the air needs the exact integrators.

    That is one that ends a flight beyond its range, and the user's own, which large steps may pass
    over where it changes within a narrow range of speeds.
    """
    models = () if air is None else (air.drag, air.lift, air.torque)
    return any(
        model is not None and (getattr(model, "refuses", False) or not is_known(model))
        for model in models
    )


def _rates(environment: FlightEnvironment, launch: BallState) -> Rates:
    """Return the function that gives the rate of change of a node."""
    ball, air = environment.ball, environment.air
    height = float(launch.position[2])
    wx, wy, wz = launch.spin.tolist()
    if air is None or air.density == 0.0:
        return lambda y: (y[3], y[4], y[5], 0.0, 0.0, -GRAVITY, 0.0)
    acceleration = acceleration_function(ball, air)

    def rates(y: State) -> State:
        """Return the rates of a state."""
        _, _, z, vx, vy, vz, left = y
        ax, ay, az, k = acceleration(height + z, vx, vy, vz, left * wx, left * wy, left * wz)
        return vx, vy, vz, ax, ay, az, -k * left

    return rates


def _step(rates: Rates, y: State, h: float) -> tuple[State, float]:
    """Return the node after a step, and by how much its two middle stages differ [m/s]."""
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
    """Return y + h slope."""
    return tuple([s + h * r for s, r in zip(y, slope, strict=True)])


def _height(normal: State, gap: float) -> Callable[[State], float]:
    """Return the function that gives the height of a node over what ends the flight [m]."""
    nx, ny, nz = normal
    return lambda y: gap + nx * y[0] + ny * y[1] + nz * y[2]


def _crossing(
    rates: Rates, before: State, after: State, step: float, height: Callable[[State], float]
) -> tuple[float, State] | None:
    """Return when, in a step, the height falls to 0, and the node there; None where unclear."""
    level = height((0.0,) * 7)  # its constant term, which is not differentiated
    time, more = 0.0, step * height(before) / (height(before) - height(after))
    for _ in range(NEWTON):
        time += more
        node, _ = _step(rates, before, time)
        slope = rates(node)
        fall = height(slope) - level
        more = -height(node) / fall if fall < 0.0 else math.inf
        if not abs(more) <= step:
            return None
    return time + more, _along(node, slope, more)
