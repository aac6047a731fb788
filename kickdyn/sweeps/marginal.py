"""What one joint, or two, make of a sweep whatever the others do: best and mean per value."""

from __future__ import annotations

import numpy as np
import xarray as xr

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.sweeps.block import Block, Numbers, Space
from kickdyn.sweeps.exact_sum import ExactSum
from kickdyn.sweeps.expression import Expression

_NONE = np.iinfo(np.int64).max


class Marginal:
    """Best and mean of a number over all other joints, of the blocks seen so far.

    Args:
        space: the joints.
        joints: one or two of them.
        of: the number; more is better.
        bins: neighbours among a joint's values go together, so that there are at most so many.

    Raises:
        InvalidInput: no such joint, or not one or two.
    """

    def __init__(
        self, space: Space, joints: tuple[str, ...], of: Expression, bins: int | None = None
    ) -> None:
        unknown = [name for name in joints if name not in space.axes]
        if unknown or not 1 <= len(set(joints)) == len(joints) <= 2:
            raise InvalidInput(
                f"marginals over {', '.join(map(repr, joints)) or 'no joint'}: "
                f"name one or two of {', '.join(space.axes)}"
            )
        self._space, self._of, self.joints = space, of, joints
        sizes = [len(space.axes[name]) for name in joints]
        self._bins = [n if bins is None else min(n, bins) for n in sizes]
        cells = int(np.prod(self._bins))
        self.count: Numbers = np.zeros(cells, np.int64)
        self.best = np.full(cells, -np.inf)
        self.number: Numbers = np.full(cells, _NONE)
        self.total = ExactSum(cells)

    def update(self, block: Block) -> None:
        """See postures."""
        values = np.broadcast_to(self._of(block), block.numbers.shape)
        cell = np.zeros(values.shape, np.int64)
        for name, bins in zip(self.joints, self._bins, strict=True):
            place = self._space.index(name, block.numbers)
            cell = cell * bins + place * bins // len(self._space.axes[name])
        self.total.add(cell, values)
        self.count += np.bincount(cell, minlength=len(self.count))
        before = self.best.copy()
        np.maximum.at(self.best, cell, values)
        self.number[self.best > before] = _NONE
        held = values == self.best[cell]
        np.minimum.at(self.number, cell[held], block.numbers[held])

    def merge(self, other: Marginal) -> None:
        """See what another over the same joints has seen."""
        tied = np.where(self.best == other.best, np.minimum(self.number, other.number), self.number)
        self.number = np.where(other.best > self.best, other.number, tied)
        self.best = np.maximum(self.best, other.best)
        self.count += other.count
        self.total.merge(other.total)

    def coordinates(self) -> dict[str, Array]:
        """Return the joints' values, of a bin the middle [deg; m]."""
        found = {}
        for name, bins in zip(self.joints, self._bins, strict=True):
            values = self._space.axes[name]
            bin_of = np.arange(len(values)) * bins // len(values)
            found[name] = np.bincount(bin_of, values) / np.bincount(bin_of)
        return found

    def best_values(self) -> Array:
        """Return the best over the joints, one axis each; nan where there was no posture."""
        return np.where(self.count > 0, self.best, np.nan).reshape(self._bins)

    def dataset(self) -> xr.Dataset:
        """Return `best`, its posture's `number` (-1: none), `mean` and `count` over the joints."""
        columns = {
            "best": self.best_values(),
            "number": np.where(self.count > 0, self.number, -1),
            "mean": self.total.mean(self.count),
            "count": self.count,
        }
        data = {name: (self.joints, each.reshape(self._bins)) for name, each in columns.items()}
        units = {name: {"units": self._space.units[name]} for name in self.joints}
        coords = {name: (name, each, units[name]) for name, each in self.coordinates().items()}
        return xr.Dataset(data, coords, {"of": self._of.text})
