"""Landing points of a Brazuca by heyoka's Taylor integrator, and its equations of motion."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kickdyn.aerodynamics import drag, lift
from kickdyn.aerodynamics.spin_decay import smits_smith
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.forces import downward


def acceleration(
    m: Any, ball: Ball, air: Air, velocity: Sequence[Any], spin: Sequence[Any] | None
) -> tuple[list[Any], Any]:
    """Return acceleration and rate of spin decay in still air, in any arithmetic.

    They are those of `acceleration_function` for the drag `brazuca`, the lift `saturating` and the
    torque `smits-smith` between Re 7e4 and 5.1e5, where each of these is one analytic formula. The
    arithmetic `m` has `sqrt` and `exp`: a module of heyoka or a context of mpmath. Velocity and
    spin are three of its numbers or expressions; without spin (None) there is no lift.
    """
    vx, vy, vz = velocity
    speed = m.sqrt(vx * vx + vy * vy + vz * vz)
    fit = drag.BALLS["brazuca"]
    v = 2 * ball.radius * air.density / air.viscosity / drag.REYNOLDS_PER_SPEED * speed
    beyond, slope = v - fit.v_min, (fit.b_max - fit.b_min) / (fit.v_max - fit.v_min)
    crisis = (fit.a - fit.b_min) / (1.0 + m.exp((v - fit.v_c) / fit.v_s))
    level = crisis + fit.b_min + slope * beyond / (1.0 + m.exp(-beyond / fit.v_s))
    pressure = 0.5 * air.density * ball.cross_section / ball.mass
    if spin is None:
        pull = pressure * level * speed
        return [-pull * vx, -pull * vy, -pull * vz - downward(ball, air)], 0.0 * speed
    wx, wy, wz = spin
    mx, my, mz = wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx
    across = m.sqrt(mx * mx + my * my + mz * mz)
    parameter = ball.radius * across / (speed * speed)
    part = (parameter / drag.SPIN_DRAG_LIMIT) ** 2.0
    eighth = m.sqrt(m.sqrt(m.sqrt(1.0 + part * part * part * part)))
    cd = level + drag.SPIN_DRAG * parameter / eighth
    gate = (fit.a - level) / (fit.a - lift.LEAST_DRAG)
    cl = gate * 0.47 * parameter / (0.135 + parameter)
    pull, push = pressure * cd * speed, pressure * cl * speed * speed / across
    ax, ay, az = (push * side - pull * v for side, v in ((mx, vx), (my, vy), (mz, vz)))
    beta = air.density * ball.cross_section * ball.radius**2 / ball.inertia * smits_smith(1e5, 0.0)
    creep = 8.0 * math.pi * air.viscosity * ball.radius**3 / ball.inertia
    return [ax, ay, az - downward(ball, air)], beta * speed + creep


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
            spin[:] = spins[i]
            steps += ta.propagate_until(100.0)[3]
            landed[i] = state[:3]
        return states.position + landed, steps

    return fly
