"""Cubic splines before and after the impact, as linear maps of one row of coefficients."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.interpolate import BSpline

from kickdyn.core.validation import Array
from kickdyn.motion.separation import Conditions, multipliers_nearby

GRADING = 1.3
"""Exponent by which intervals are shorter near the impact, where the motion is fastest."""


DENSE_TIME = 0.1
"""Time from the impact within which there are more points in an interval [s]."""


class MotionSplines:
    """Positions of joints from rest to the impact and from there to rest.

    Velocity and acceleration are 0 at the beginning and at the end; at the impact positions are
    equal. Coefficients that remain have the shape `(size, n)` for n joints.

    Args:
        before, after: durations [s].
        intervals: numbers of intervals between knots before and after the impact.
    """

    def __init__(self, before: float, after: float, intervals: tuple[int, int]) -> None:
        first, second = (np.linspace(0.0, 1.0, count + 1) ** GRADING for count in intervals)
        self.grids = -before * first[::-1], after * second
        # coefficients of both splines are rows of these matrices times the unknown ones
        sizes = len(self.grids[0]) + 2, len(self.grids[1]) + 2
        number = np.concatenate([
            np.maximum(np.arange(sizes[0]) - 2, 0),
            np.minimum(np.arange(sizes[1]) + sizes[0] - 3, sizes[0] + sizes[1] - 6),
        ])  # fmt: skip
        self.size = int(number[-1]) + 1
        self._first = np.unique(number, return_index=True)[1]
        rows = np.eye(self.size)[number]
        self.splines = [
            BSpline(np.concatenate([[grid[0]] * 3, grid, [grid[-1]] * 3]), matrix, 3)
            for grid, matrix in zip(self.grids, np.split(rows, [sizes[0]]), strict=True)
        ]

    def times(self, far: int, near: int) -> list[Array]:
        """Return times in each interval, and both ends, before and after the impact.

        There are `near` times in each interval that begins within `DENSE_TIME` of the impact, and
        `far` in the others.
        """
        return [_between(grid, far, near) for grid in self.grids]

    def values(self, times: list[Array], order: int) -> Array:
        """Return the map from coefficients to a derivative at times before and after, stacked."""
        pairs = zip(self.splines, times, strict=True)
        return np.asarray(np.vstack([spline(t, order) for spline, t in pairs]))

    def at_impact(self) -> Array:
        """Return the map to position, velocity before, and its jump at the impact, `(3, size)`."""
        before, after = self.splines
        v = before(0.0, 1)
        return np.array([before(0.0), v, after(0.0, 1) - v])

    def speed_rows(self) -> Array:
        """Return the map to the coefficients of the velocities, which bound them."""
        rows = np.vstack([spline.derivative().c for spline in self.splines])
        return np.asarray(rows[np.abs(rows).max(axis=1) > 0.0])

    def coefficients(self, before: BSpline, after: BSpline) -> Array:
        """Return the coefficients of a motion with these knots, shape `(size, n)`."""
        return np.asarray(np.vstack([before.c, after.c])[self._first])

    def motion(self, coefficients: Array) -> list[BSpline]:
        """Return both splines for coefficients of shape `(size, n)`."""
        return [BSpline(spline.t, spline.c @ coefficients, 3) for spline in self.splines]


def _between(grid: Array, far: int, near: int) -> Array:
    times = [
        np.linspace(
            begin, end, near if min(abs(begin), abs(end)) < DENSE_TIME else far, endpoint=False
        )
        for begin, end in pairwise(grid.tolist())
    ]
    return np.concatenate([*times, grid[-1:]])


def per_joint(rows: Array, n: int, extra: int) -> Any:
    """Return a map of one joint for all n, as a sparse matrix with `extra` columns of 0."""
    blocks = sp.kron(sp.csr_matrix(rows), sp.eye(n))
    return sp.hstack([blocks, sp.csr_matrix((blocks.shape[0], extra))]).tocsr()


def integration_weights(times: Array) -> Array:
    """Return weights of values at times that integrate them, linear in between [s]."""
    half = np.diff(times) / 2
    return np.append(half, 0.0) + np.insert(half, 0, 0.0)


TOLERANCE = 1e-7
"""Largest violation of a row of a solution; rows have a scale of about 1."""

SAME_TIME = 1e-12
"""Difference up to which times are the same [s]."""


class Multipliers(NamedTuple):
    """Multipliers of a solution.

    Attributes:
        speeds: of the rows of speeds.
        impact: of the rows of the impact.
        bounds: of those of the coefficients and the share.
        points: of the rows of each point and of the bounds of its forces, shape `(points, k)`.
        apart: conditions of bodies with the multiplier of each.
    """

    speeds: Array
    impact: Array
    bounds: Array
    points: Array
    apart: Sequence[tuple[Conditions, Array]]


@dataclass(frozen=True, eq=False)
class Solution:
    """Unknowns that Ipopt returned, with the start of a next solution.

    Attributes:
        rest: posture near which both ends are, shape `(n,)`.
        coefficients: of the splines, shape `(size, n)`.
        share: of the launch.
        times: of the points, before and after the impact [s].
        multipliers: None if a solution does not start from those.
        feasible: whether the rows are in their bounds, within `TOLERANCE`.
        iterations: number of its iterations.
        limited: joints at rest whose torques had rows.
        linearized: coefficients at which the forces of joints that give way in the impact were
            computed for its rows; None if a solution does not start from those.
    """

    rest: Array
    coefficients: Array
    share: float
    times: list[Array]
    multipliers: Multipliers | None = None
    feasible: bool = True
    iterations: int = 0
    limited: tuple[str, ...] = ()
    linearized: Array | None = None


def taken_over(
    start: Solution,
    moments: Array,
    apart: Sequence[Conditions],
    empty: Multipliers,
    forces: int,
) -> tuple[Array, Array]:
    """Return the multipliers of all rows and bounds that those of a solution give.

    Args:
        start: the solution.
        moments: of the points, shape `(k,)` [s].
        apart: conditions of bodies.
        empty: multipliers of the sizes that the problem has, for a solution without any; `points`
            has one row.
        forces: number of forces of a point, whose bounds have the last columns of `points`.
    """
    duals = start.multipliers or empty._replace(
        points=np.zeros((sum(map(len, start.times)), empty.points.shape[1]))
    )
    distance = np.abs(np.concatenate(start.times)[None] - moments[:, None])
    same = distance.min(axis=1) < SAME_TIME
    points = np.where(same[:, None], duals.points[distance.argmin(axis=1)], 0.0)
    former = {conditions.joints: (conditions, values) for conditions, values in duals.apart}
    of_apart = [
        multipliers_nearby(conditions, *former[conditions.joints])
        if conditions.joints in former
        else np.zeros(len(conditions.times))
        for conditions in apart
    ]
    k = empty.points.shape[1] - forces
    rows = np.concatenate([duals.speeds, points[:, :k].ravel(), duals.impact, *of_apart])
    return rows, np.append(duals.bounds, points[:, k:])
