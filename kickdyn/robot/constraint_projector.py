"""Supports and loops at one configuration: what they let through, and what they carry."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.linalg import blas, lapack

from kickdyn.core.read_only import ReadOnly
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import Constraints, Row
from kickdyn.robot.model_validation import listed

HELD_TOLERANCE = 1e-9
"""Share of what the fastest joint could move it by that a held frame may move at, for rounding."""

INDEPENDENT = 1e-9
"""Share of a row, in the metric of inertia, that others must leave for it to count."""


class ConstraintProjector(ReadOnly):
    """Projects on the velocities with A v = 0, orthogonally in the metric of inertia.

    With M = L L^T and W = L^-1 A^T = Q R, a velocity L^-T w is admissible where Q^T w = 0.

    Attributes:
        constraints: of the leg.
        rows: A, shape `(size, nv)` [world axes].
        blocks: where each support's and loop's impulse acts.
        rank: of A; below its number of rows, some are redundant.
        independent: indices of as many rows as the rank.
    """

    def __init__(
        self,
        constraints: Constraints,
        rows: Array,
        blocks: list[Row],
        whitened: Array,
        where: object,
    ) -> None:
        self.constraints, self.rows, self.blocks = constraints, rows, blocks
        self._whitened = whitened
        lengths = [
            math.sqrt(square) for square in np.einsum("ij,ij->j", whitened, whitened).tolist()
        ]
        least = INDEPENDENT * max(lengths)
        self._length = np.array([length if length > least else math.inf for length in lengths])
        packed, pivots, tau, _, _ = lapack.dgeqp3(whitened / self._length)
        steps = min(whitened.shape)
        self.rank = sum(abs(entry) > INDEPENDENT for entry in packed.diagonal().tolist())
        self.independent = pivots[: self.rank] - 1
        self._factor = packed[: self.rank, : self.rank]
        basis, _, _ = lapack.dorgqr(packed[:, :steps], tau)
        self._basis = basis[:, : self.rank]
        if self.rank == rows.shape[1]:
            raise InvalidInput(
                f"{listed(constraints.names)} contradict each other: together they have rank "
                f"{self.rank} of {len(rows)} rows, and leave none of {rows.shape[1]} degrees of "
                f"freedom in {where!r}"
            )
        for array in (rows, self._basis):
            array.setflags(write=False)

    def project(self, whitened: Array) -> Array:
        """Return L^-1 times an impulse, or several as columns, less what the constraints block."""
        return np.asarray(whitened - self._basis.dot(self._basis.T.dot(whitened)))

    def impulses(self, whitened: Array) -> Array:
        """Return the constraints' impulses that answer L^-1 times an impulse, shape `(size,)`."""
        blocked = self._basis.T.dot(whitened)
        if self.rank == len(self.rows):
            scaled = blas.dtrsv(self._factor, -blocked)
            answer = np.empty(self.rank)
            answer[self.independent] = scaled
            return np.asarray(answer / self._length)
        return np.asarray(self._least @ -blocked)

    def moved(self, v: Array) -> tuple[str, float, str] | None:
        """Return what a velocity moves most of what is held, how fast, and in which unit.

        None where that is rounding: of the fastest joint, for those that hold a whole chain still
        have nothing but rounding themselves.
        """
        speeds = abs(self.rows.dot(v)).tolist()
        fastest = max(map(abs, v.tolist()))
        reaches = abs(self.rows).sum(axis=1).tolist()
        for k in range(0, len(speeds), 3):  # a velocity's three parts: one alone may be rounding
            if max(speeds[k : k + 3]) > HELD_TOLERANCE * max(reaches[k : k + 3]) * fastest:
                break
        else:
            return None
        worst = speeds.index(max(speeds))
        at = next(i for i, block in enumerate(self.blocks) if worst < block.at.stop)
        unit = "m/s" if worst - self.blocks[at].at.start < 3 else "rad/s"
        return self.constraints.names[at], speeds[worst], unit

    @cached_property
    def _least(self) -> Array:
        """From Q^T w to the smallest impulses that give it: W's pseudo-inverse on its range."""
        return np.asarray(np.linalg.pinv(self._basis.T @ self._whitened, rcond=INDEPENDENT))
