"""Landing points to 20 digits: the midpoint rule in mpmath, extrapolated."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

from kickdyn.accuracy.taylor import acceleration
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array

mp: Any = mpmath.MPContext()
"""Its own context: the digits that a flight can use are fewer than an impact's."""
mp.dps = 30

STEP = 0.2  # s
ORDER = 12
"""Midpoint rules that one step extrapolates from: order 24."""


def landing(state: BallState, ball: Ball, air: Air) -> Array:
    """Return where a ball comes back to the height of its launch, shape `(3,)` [m].

    The air must be what `acceleration` knows; a ball without spin has no lift.
    """
    spin = [mp.mpf(float(part)) for part in state.spin]
    turns = bool(state.spin.any())

    def in_time(y: list[Any]) -> list[Any]:
        turned = [y[6] * part for part in spin] if turns else None
        pulled, decay = acceleration(mp, ball, air, y[3:6], turned)
        return [*y[3:6], *pulled, -decay * y[6]]

    def in_height(y: list[Any]) -> list[Any]:
        rates = in_time(y)
        return [rate / rates[2] for rate in rates]

    y = [mp.zero] * 3 + [mp.mpf(float(part)) for part in state.velocity] + [mp.one]
    while True:
        after = extrapolated(in_time, y, mp.mpf(STEP))
        if after[2] <= 0:
            break
        y = after
    if y[5] > 0:  # the last step holds apex and landing: up to the first, half a step at a time
        step = mp.mpf(STEP)
        while y[5] > 0:
            after = extrapolated(in_time, y, step)
            step /= 2
            y = after if after[2] > 0 else y
    down = -y[2]
    for _ in range(4):
        y = extrapolated(in_height, y, down / 4)
    return np.asarray(state.position + np.array([float(y[0]), float(y[1]), 0.0]))


def extrapolated(rates: Any, y: list[Any], step: Any) -> list[Any]:
    """Return the states after one step of Gragg, Bulirsch and Stoer.

    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.9.
    """
    table: list[list[Any]] = []
    counts = [2 * (k + 1) for k in range(ORDER)]
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
