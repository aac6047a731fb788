"""Sums without rounding: in whatever order numbers come, the same to the last bit.

A float64 is split at fixed powers of 2^`WIDTH` into whole numbers, which are summed in 64 bits:
the superaccumulator of Kulisch, a few limbs of it (Kulisch and Miranker, Computer Arithmetic in
Theory and Practice, 1981).
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput

WIDTH = 30
"""Bits of a limb's summand: 2^33 of them fit in 64 bits, and 2^23 at a time in a float64."""


class ExactSum:
    """Sums of finite numbers, one per cell.

    Args:
        cells: how many sums.
    """

    def __init__(self, cells: int) -> None:
        self.cells = cells
        self.limbs: dict[int, NDArray[np.int64]] = {}

    def add(self, cell: NDArray[np.int64], values: Array) -> None:
        """Add numbers to their cells, shapes `(n,)`, n at most 2^23; raise on nan and inf."""
        if not np.isfinite(values).all():
            raise InvalidInput("a sum of what is not finite was asked for")
        rest = values.copy()
        power = int(np.frexp(rest)[1].max(initial=-WIDTH)) // WIDTH
        while rest.any():
            part = np.trunc(np.ldexp(rest, -WIDTH * power))
            if part.any():
                self._limb(power)[:] += np.bincount(cell, part, self.cells).astype(np.int64)
                rest -= np.ldexp(part, WIDTH * power)
            power -= 1

    def merge(self, other: ExactSum) -> None:
        """Add another's sums."""
        for power, limb in other.limbs.items():
            self._limb(power)[:] += limb

    def _limb(self, power: int) -> NDArray[np.int64]:
        return self.limbs.setdefault(power, np.zeros(self.cells, np.int64))

    def mean(self, counts: NDArray[np.int64]) -> Array:
        """Return every sum over its count, rounded once; nan where the count is 0."""
        result = np.full(self.cells, np.nan)
        if not self.limbs:
            result[counts > 0] = 0.0
            return result
        lowest = min(self.limbs)
        scale = Fraction(2) ** (WIDTH * lowest)
        for i in np.flatnonzero(counts).tolist():
            whole = sum(int(limb[i]) << WIDTH * (k - lowest) for k, limb in self.limbs.items())
            result[i] = float(whole * scale / int(counts[i]))
        return result
