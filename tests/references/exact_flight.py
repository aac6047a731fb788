"""Landing points of a Brazuca with 20 digits, by mpmath."""

from __future__ import annotations

from typing import Any

import numpy as np

from kickdyn.accuracy.heyoka_flight import acceleration
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from references.exact_leg import context

mp = context(30)
"""Arithmetic of 24 digits or so: a flight needs fewer digits than an impact."""

STEP = 0.2
"""Time step of the extrapolation [s]."""


def landing(state: BallState, ball: Ball, air: Air) -> Array:
    """Return where a ball comes back to the height of its launch, shape `(3,)` [m], to 20 digits.

    The midpoint rule is extrapolated. The air must be that of `acceleration`; a ball without spin
    has no lift.
    """
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
    """Return the states after one step of Gragg, Bulirsch and Stoer, of order 24.

    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.9.
    """
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
