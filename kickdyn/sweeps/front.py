"""The Pareto front of a sweep: postures that no other beats in both of two numbers."""

from __future__ import annotations

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.sweeps.block import Block
from kickdyn.sweeps.expression import Expression


class Front:
    """The front of the blocks seen so far; of equals, the first posture.

    Args:
        more: number of which more is better.
        less: number of which less is better.

    Attributes:
        points: shape `(n, 3)`: more, less and the posture's number, the most first.
    """

    def __init__(self, more: Expression, less: Expression) -> None:
        self._more, self._less = more, less
        self.points: Array = np.empty((0, 3))

    def update(self, block: Block) -> None:
        """See postures; where a number is nan, the posture does not count."""
        terms = (self._more(block), self._less(block), block.numbers)
        self._see(np.stack(np.broadcast_arrays(*terms), axis=-1, dtype=np.float64))

    def merge(self, other: Front) -> None:
        """See what another has seen."""
        self._see(other.points)

    def _see(self, points: Array) -> None:
        points = points[~np.isnan(points).any(axis=1)]
        if len(self.points):  # most are beaten by what is known: no need to sort them
            rising = self.points[::-1]
            rival = np.searchsorted(rising[:, 0], points[:, 0])
            load = np.append(rising[:, 1], np.inf)[rival]
            points = points[points[:, 1] <= load]
        self.points = front(np.concatenate([self.points, points]))


def front(points: Array) -> Array:
    """Return the rows (more, less, number) that no other beats in both, the most first."""
    if not len(points):
        return points
    ordered = points[np.lexsort((points[:, 2], points[:, 1], -points[:, 0]))]
    lightest = np.minimum.accumulate(ordered[:, 1])
    kept = np.concatenate([[True], lightest[1:] < lightest[:-1]])
    return np.asarray(ordered[kept])
