"""Landing points by heyoka's Taylor integrators, and the equations of motion they take."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from references.exact_flight import acceleration


def equations(hy: Any, ball: Ball, air: Air) -> list[tuple[Any, Any]]:
    """Return the equations of motion in still air as heyoka's expressions: see `acceleration`.

    The states are displacement, velocity and spin over that of the launch, which is `par[0:3]`.
    """
    names = hy.make_vars("x", "y", "z", "vx", "vy", "vz", "left")
    velocity, left = names[3:6], names[6]
    accelerations, decay = acceleration(
        hy, ball, air, velocity, [left * hy.par[i] for i in range(3)]
    )
    return list(zip(names, [*velocity, *accelerations, -decay * left], strict=True))


def heyoka_landings(
    ball: Ball, air: Air, tol: float
) -> Callable[[BallState], tuple[Array, int]] | None:
    """Return a function of many launches: landing points and steps; None without heyoka.

    The flights end at the height of their launch.
    """
    try:
        import heyoka as hy
    except ImportError:
        return None
    z = hy.make_vars("z")
    event = hy.t_event(z, direction=hy.event_direction.negative)
    start = [0.0] * 5 + [1.0, 1.0]
    ta = hy.taylor_adaptive(equations(hy, ball, air), start, tol=tol, t_events=[event])

    def fly(states: BallState) -> tuple[Array, int]:
        """Return landing points, shape `(n, 3)` [m], and the number of steps of all."""
        landed = np.empty_like(states.position)
        begin = np.column_stack([0 * states.position, states.velocity, np.ones(len(landed))])
        spins = states.spin
        state, spin, steps = ta.state, ta.pars, 0
        for i in range(len(begin)):
            ta.reset_cooldowns()
            ta.time = 0.0
            state[:] = begin[i]
            state[2] = 1e-14  # from 0 it overlooks a landing within the first step
            spin[:] = spins[i]
            steps += ta.propagate_until(100.0)[3]
            landed[i] = state[:3]
        return states.position + landed, steps

    return fly


def heyoka_batch_landings(
    ball: Ball, air: Air, tol: float, ending: str, width: int = 8
) -> Callable[[BallState, Array], tuple[Array, int]] | None:
    """Return a function of many launches and their flight times [s]: landing points and steps.

    `width` flights are integrated at once with vector instructions; None without heyoka. The
    `ending` says how a flight finds its end: `event` is a terminal event, at which all flights of
    the batch stop, so that those still in the air are continued; `dense output` integrates to 1 %
    beyond the flight time and finds the root on the interpolant, by Newton's method for the batch
    at once; `known time` integrates for the flight time and finds nothing, a lower limit.
    """
    try:
        import heyoka as hy
    except ImportError:
        return None
    options: dict[str, Any] = {"pars": np.ones((3, width)), "tol": tol}
    if ending == "event":
        down = hy.event_direction.negative
        options["t_events"] = [hy.t_event_batch(hy.make_vars("z"), direction=down)]
    ta = hy.taylor_adaptive_batch(equations(hy, ball, air), np.ones((7, width)), **options)
    goes_on = hy.taylor_outcome.success

    def to_event() -> tuple[Array, int]:
        """Return landing points and steps of the loaded flights, each up to its event."""
        ends, steps = np.full(width, 100.0), 0
        for _ in range(width):
            ta.propagate_until(ends)
            outcomes = np.array([result[0] != goes_on for result in ta.propagate_res])
            steps += sum(result[3] for result in ta.propagate_res)
            ends = np.where(outcomes, np.minimum(ends, ta.time), ends)
            if outcomes.all():
                break
        return ta.state[:3], steps

    def to_root(times: Array) -> tuple[Array, int]:
        """Return landing points, read off the interpolant, and steps of the loaded flights."""
        end = 1.01 * times
        path = ta.propagate_until(end, c_output=True)[0]
        for _ in range(6):
            state = path(end)
            late = state[2] / state[5]
            end = end - late
            if np.abs(late).max() < 1e-6:  # the error is its square
                break
        return path(end)[:3], sum(result[3] for result in ta.propagate_res)

    def fly(states: BallState, times: Array) -> tuple[Array, int]:
        """Return landing points `(n, 3)` [m] and the steps of all; n is a multiple of `width`."""
        moved, steps = np.empty_like(states.position), 0
        for first in range(0, len(moved), width):
            these = slice(first, first + width)
            ta.set_time(0.0)
            ta.state[:3], ta.state[3:6], ta.state[6] = 0.0, states.velocity[these].T, 1.0
            ta.pars[:] = states.spin[these].T
            if ending == "event":
                ta.state[2] = 1e-12  # from 0 it overlooks a landing within the first step
                ta.reset_cooldowns()
                landed, taken = to_event()
            elif ending == "dense output":
                landed, taken = to_root(times[these])
            else:
                ta.propagate_until(times[these])
                landed, taken = ta.state[:3], sum(result[3] for result in ta.propagate_res)
            moved[these], steps = landed.T, steps + taken
        return states.position + moved, steps

    return fly
