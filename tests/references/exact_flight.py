"""Landing points of a Brazuca with 20 digits, by mpmath."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from kickdyn.aerodynamics import drag, lift
from kickdyn.aerodynamics.coefficient_model import ConstantCoefficient
from kickdyn.aerodynamics.spin_decay import smits_smith
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.forces import downward
from references.exact_leg import context

mp = context(30)
"""Arithmetic of 24 digits or so: a flight needs fewer digits than an impact."""

STEP = 0.2
"""Time step of the extrapolation [s]."""


def acceleration(
    m: Any, ball: Ball, air: Air, velocity: Sequence[Any], spin: Sequence[Any] | None
) -> tuple[list[Any], Any]:
    """Return acceleration and rate of spin decay in still air, in any arithmetic.

    They are those of `acceleration_function` where drag, lift and torque all have constant
    coefficients, and for the drag `brazuca`, the lift `saturating` and the torque `smits-smith`
    between Re 7e4 and 5.1e5, where each of these is one analytic formula. The arithmetic `m` has
    `sqrt` and `exp`: a context of mpmath, or the module of heyoka. Velocity and spin are three of
    its numbers or expressions; without spin (None) there is no lift.
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
    cl, beta = gate * 0.47 * parameter / (0.135 + parameter), smits_smith(1e5, 0.0)
    models = air.drag, air.lift, air.torque
    values = [model.value for model in models if isinstance(model, ConstantCoefficient)]
    if len(values) == 3:
        cd, cl, beta = values
    pull, push = pressure * cd * speed, pressure * cl * speed * speed / across
    ax, ay, az = (push * side - pull * v for side, v in ((mx, vx), (my, vy), (mz, vz)))
    brake = air.density * ball.cross_section * ball.radius**2 / ball.inertia * beta
    creep = 8.0 * math.pi * air.viscosity * ball.radius**3 / ball.inertia
    return [ax, ay, az - downward(ball, air)], brake * speed + creep


def landing(state: BallState, ball: Ball, air: Air) -> Array:
    """Return where a ball is back at the height of its launch, shape `(3,)` [m], to 20 digits."""
    spin = [mp.mpf(float(part)) for part in state.spin]
    turns = bool(state.spin.any())

    def in_time(y: list[Any]) -> list[Any]:
        spin_now = [y[6] * part for part in spin] if turns else None
        rates, decay = acceleration(mp, ball, air, y[3:6], spin_now)
        return [*y[3:6], *rates, -decay * y[6]]

    def in_height(y: list[Any]) -> list[Any]:
        rates = in_time(y)
        return [rate / rates[2] for rate in rates]

    y = [mp.zero] * 3 + [mp.mpf(float(part)) for part in state.velocity] + [mp.one]
    while True:
        after = extrapolated(in_time, y, mp.mpf(STEP))
        if after[2] <= 0:
            break
        y = after
    step = mp.mpf(STEP)
    while y[5] > 0:  # the last step holds apex and landing: up to the apex by halves
        after = extrapolated(in_time, y, step)
        step /= 2
        y = after if after[2] > 0 else y
    down = -y[2]
    for _ in range(4):
        y = extrapolated(in_height, y, down / 4)
    return np.asarray(state.position + np.array([float(y[0]), float(y[1]), 0.0]))


def extrapolated(rates: Any, y: list[Any], step: Any) -> list[Any]:
    """Return the states after one step of Gragg, Bulirsch and Stoer, of order 24."""
    table: list[list[Any]] = []
    counts = range(2, 26, 2)  # of the steps of twelve midpoint rules
    for k, count in enumerate(counts):
        h = step / count
        before, now = y, [a + h * b for a, b in zip(y, rates(y), strict=True)]
        for _ in range(count - 1):
            slope = rates(now)
            before, now = now, [a + 2 * h * b for a, b in zip(before, slope, strict=True)]
        row = [now]
        for j in range(1, k + 1):
            ratio = mp.mpf(counts[k]) ** 2 / counts[k - j] ** 2 - 1
            finer, coarser = row[j - 1], table[k - 1][j - 1]
            row.append([a + (a - b) / ratio for a, b in zip(finer, coarser, strict=True)])
        table.append(row)
    return list(table[-1][-1])
