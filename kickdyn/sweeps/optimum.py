"""How flat the best posture of a sweep is: what a degree of each joint costs there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.sweeps.block import Space


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best posture of a sweep and its neighbours on the grid.

    Attributes:
        of: the number that is largest there.
        value: how large.
        angles: the posture [deg; m for prismatic joints].
        units: of the angles.
        step: the grid's, shape `(n,)`, nan for a joint that is held.
        change: of the number, one step down and one step up, shape `(n, 2)`; nan where the grid
            ends or the leg cannot kick so.
        slope: per deg (or m), shape `(n,)`: central, at an end of the grid one-sided, both of
            second order.
        slope_error: how far the slope is off, by the next coarser difference, shape `(n,)`.
        curvature: second derivatives per deg^2, shape `(n, n)`, by differences of neighbours; nan
            where one is missing.
    """

    of: str
    value: float
    angles: dict[str, float]
    units: dict[str, str]
    step: Array
    change: Array
    slope: Array
    slope_error: Array
    curvature: Array

    def __str__(self) -> str:
        """Return a table, one joint per line."""
        head = ("joint", "at", "step", "step down", "step up", "per unit", "+-", "curvature")
        rows: list[tuple[str, ...]] = [head]
        for i, (name, at) in enumerate(self.angles.items()):
            changes = (*self.change[i], self.slope[i])
            rows.append(
                (
                    name,
                    f"{at:.4g} {self.units[name]}",
                    _text(self.step[i], ".4g"),
                    *(_text(each, "+.3g") for each in changes),
                    _text(self.slope_error[i], ".1g"),
                    _text(self.curvature[i, i], "+.3g"),
                )
            )
        wide = [max(len(row[k]) for row in rows) for k in range(len(head))]
        lines = [
            "  ".join(
                each.rjust(w) if k else each.ljust(w)
                for k, (each, w) in enumerate(zip(row, wide, strict=True))
            )
            for row in rows
        ]
        return "\n".join([f"{self.of} = {self.value:.6g}", *lines])


def optimum(
    space: Space, of: str, number: int, around: Callable[[tuple[int, ...]], float]
) -> Optimum:
    """Look around a posture.

    Args:
        space: the joints.
        of: what is looked at, in words.
        number: of the posture.
        around: gives the number looked at by its place on the grid; nan where the leg cannot.
    """
    n, centre = len(space.axes), np.array(np.unravel_index(number, space.shape))

    def at(*moves: tuple[int, int]) -> float:
        place = centre.copy()
        for joint, steps in moves:
            place[joint] += steps
        inside = (place >= 0).all() and (place < space.shape).all()
        return around(tuple(place.tolist())) if inside else np.nan

    value = at()
    step = np.full(n, np.nan)
    slope, error, change = np.full(n, np.nan), np.full(n, np.nan), np.full((n, 2), np.nan)
    curvature = np.full((n, n), np.nan)
    for i, values in enumerate(space.axes.values()):
        if len(values) == 1:
            continue
        step[i] = h = (values[-1] - values[0]) / (len(values) - 1)
        line = [at((i, steps)) for steps in (-2, -1, 0, 1, 2)]
        change[i] = line[1] - value, line[3] - value
        slope[i], error[i] = _slope(line, h)
        curvature[i, i] = (line[1] - 2 * value + line[3]) / h**2
        for j in range(i):
            corners = [at((i, a), (j, b)) for a, b in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
            mixed = (corners[0] + corners[1] - corners[2] - corners[3]) / (4 * h * step[j])
            curvature[i, j] = curvature[j, i] = mixed
    units = {name: space.units[name] for name in space.axes}
    return Optimum(of, value, space.angles(number), units, step, change, slope, error, curvature)


def _slope(line: list[float], h: float) -> tuple[float, float]:
    """Return slope and error at the middle of five values, of which some may be missing."""
    low, lower, mid, upper, high = line
    central = (upper - lower) / (2 * h)
    if not np.isnan(central):
        return central, abs(central - (high - low) / (4 * h)) / 3
    for one, two, sign in ((upper, high, 1), (lower, low, -1)):
        if not np.isnan(two):
            slope = sign * (4 * one - 3 * mid - two) / (2 * h)
            return slope, abs(slope - sign * (one - mid) / h)
        if not np.isnan(one):
            return sign * (one - mid) / h, np.nan
    return np.nan, np.nan


def _text(number: float, form: str) -> str:
    return "-" if np.isnan(number) else format(number, form)
