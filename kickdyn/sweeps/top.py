"""The first few postures of a sweep, by a number or drawn by lot."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.sweeps.block import Block, Numbers

_MIX = (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)


class Top:
    """The postures of largest value among the blocks seen so far; of equals, the first.

    Args:
        most: how many are kept.
        value: of a block's postures, shape `(n,)`: an `Expression`, or `lot(seed)`.
        columns: joints and results kept with them.

    Attributes:
        values: shape `(n,)`, descending.
        numbers: of the postures, shape `(n,)`.
        rows: shape `(n, len(columns))`, angles in degrees.
    """

    def __init__(
        self, most: int, value: Callable[[Block], Array], columns: Sequence[str] = ()
    ) -> None:
        self._most, self._value, self.columns = most, value, tuple(columns)
        self.values: Array = np.empty(0)
        self.numbers: Numbers = np.empty(0, np.int64)
        self.rows: Array = np.empty((0, len(self.columns)))

    def update(self, block: Block) -> None:
        """See postures; where the value is nan, the posture does not count."""
        values = np.broadcast_to(self._value(block), block.numbers.shape)
        kept = ~np.isnan(values)
        if len(self.values) == self._most:
            kept &= values >= self.values[-1]
        if np.count_nonzero(kept) > self._most:
            kept &= values >= -np.partition(-values[kept], self._most - 1)[self._most - 1]
        if not kept.any():
            return
        rows = np.empty((np.count_nonzero(kept), len(self.columns)))
        for i, name in enumerate(self.columns):
            rows[:, i] = block(name)[kept]
        self._see(values[kept], block.numbers[kept], rows)

    def merge(self, other: Top) -> None:
        """See what another has seen."""
        self._see(other.values, other.numbers, other.rows)

    def _see(self, values: Array, numbers: Numbers, rows: Array) -> None:
        values = np.concatenate([self.values, values])
        numbers = np.concatenate([self.numbers, numbers])
        first = np.lexsort((numbers, -values))[: self._most]
        self.values, self.numbers = values[first], numbers[first]
        self.rows = np.concatenate([self.rows, rows])[first]


def lot(seed: int = 0) -> Callable[[Block], Array]:
    """Return a value by lot, so that `Top` is a random sample; it depends on the number alone.

    Splitmix64 (Steele, Lea, Flood 2014, DOI 10.1145/2660193.2660195): every number another lot, as
    a stride would not be, which can fall in step with a joint.
    """

    def drawn(block: Block) -> Array:
        mixed = _mixed(block.numbers.astype(np.uint64), np.uint64(seed))
        return mixed.astype(np.float64) * 2.0**-53

    return drawn


def _mixed(numbers: NDArray[np.uint64], seed: np.uint64) -> NDArray[np.uint64]:
    step, first, second = (np.uint64(each) for each in _MIX)
    with np.errstate(over="ignore"):
        x = numbers * step + (seed + np.uint64(1)) * second
        x = (x ^ (x >> np.uint64(30))) * first
        x = (x ^ (x >> np.uint64(27))) * second
    return np.asarray((x ^ (x >> np.uint64(31))) >> np.uint64(11))
