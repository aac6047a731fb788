"""How a grid is cut into chunks of postures that follow each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Cut:
    """The chunks of a grid.

    Attributes:
        shape: of the grid.
        chunk: of a chunk; the last ones of an axis may be smaller.
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]

    @classmethod
    def of(cls, shape: tuple[int, ...], most: int) -> Cut:
        """Cut a grid into chunks of about `most` postures."""
        chunk, room = [1] * len(shape), most
        for axis in range(len(shape) - 1, -1, -1):
            chunk[axis] = -(-shape[axis] // -(-shape[axis] // max(1, room)))  # equal parts
            if chunk[axis] < shape[axis]:
                break
            room //= shape[axis]
        return cls(shape, tuple(chunk))

    @property
    def blocks(self) -> tuple[int, ...]:
        """Number of chunks along each axis."""
        return tuple(-(-n // c) for n, c in zip(self.shape, self.chunk, strict=True))

    def __len__(self) -> int:
        return math.prod(self.blocks)

    def region(self, k: int) -> tuple[slice, ...]:
        """Return where in the grid chunk number `k` lies."""
        index = np.unravel_index(k, self.blocks)
        return tuple(
            slice(int(i) * c, min((int(i) + 1) * c, n))
            for i, c, n in zip(index, self.chunk, self.shape, strict=True)
        )

    def span(self, k: int) -> tuple[int, int]:
        """Return first posture and number of postures of a chunk."""
        region = self.region(k)
        begin = np.ravel_multi_index([part.start for part in region], self.shape)
        return int(begin), math.prod(part.stop - part.start for part in region)
