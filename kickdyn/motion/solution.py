"""Solutions of the problem of a motion, and the start of a next one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.motion.separation import Conditions, multipliers_nearby

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
