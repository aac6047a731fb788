"""All variables of a range of postures, by a compiled kernel and flights."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.laws import find_law
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import VARIABLES, describe, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.sweep_kick import FLIGHT_TOLERANCE, Kick, PostureStatus, kick_from

if TYPE_CHECKING:
    from kickdyn.sweeps.kernel import Kernel, KernelModel

KERNEL_FROM = 2000
"""Postures of a grid from which a kernel is used: compiling it takes seconds the first time."""

CHUNK = 262_144
"""Postures per chunk, roughly."""

BLOCK = 16_384
"""Postures of a chunk that are computed at a time: larger intermediate results take more memory."""

SLOW_CHUNK = 512
"""Postures per chunk where each of them is one `kick_from`: about a second."""

_CARRY = list(VARIABLES).index("carry")


class ChunkSolver:
    """Computes all variables of ranges of postures; safe to call from several threads.

    A grid of at least `KERNEL_FROM` postures is computed by a compiled kernel. Where there is none
    (a base that floats or moves, supports, loops, wind that changes with height, a law without a
    kernel), and where the kernel marks a posture as doubtful, it is `kick_from`, a thousand times
    slower.

    Attributes:
        leg, grid, kick, tolerance: as for `kickdyn.sweep`.
        chunk: number of postures to compute at a time.
        carry_tolerance: `tolerance` where carries are interpolated, else 0.
    """

    def __init__(self, leg: Leg, grid: Grid, kick: Kick, tolerance: float = 0.0) -> None:
        self.tolerance = validation.number("tolerance", tolerance, at_least=0, unit="m")
        self.leg, self.grid, self.kick = leg, grid, kick
        self._model: KernelModel | None = None
        self._kernel: Kernel | None = None
        self._table: Callable[[Array, Array, Array], NDArray[np.bool_]] | None = None
        windy = kick.air is not None and callable(kick.air.wind)
        if grid.size >= KERNEL_FROM and not windy and find_law(kick.law).has_kernel:
            from kickdyn.sweeps import kernel  # numba is needed by large grids only

            self._model = kernel.KernelModel.of(leg, kick)
        self.chunk = SLOW_CHUNK if self._model is None else CHUNK
        planar = self._model is not None and self._model.planar
        self.carry_tolerance = self.tolerance if planar and kick.air is not None else 0.0

    @property
    def seconds(self) -> float:
        """Processor time that the whole grid takes, roughly [s]."""
        seconds = 2e-3 if self._model is None else 0.3e-6 if self.carry_tolerance > 0.0 else 4e-6
        return seconds * self.grid.size

    def describe(self) -> xr.Dataset:
        """Return coordinates and provenance of the sweep, see `dataset.describe`."""
        return describe(self.leg, self.grid, self.kick, self.carry_tolerance)

    def prepare(self) -> None:
        """Compile the kernel and fly the balls of the carry table; to be called before threads."""
        if self._model is None:
            return
        from kickdyn.sweeps.carry_table import CarryTable
        from kickdyn.sweeps.kernel import Kernel

        self._kernel = Kernel(self._model, self.leg, self.grid)
        if self.carry_tolerance > 0.0:
            self._table = CarryTable(self._model, self.carry_tolerance)

    def __call__(self, first: int, count: int) -> tuple[Array, NDArray[np.int8]]:
        """Return the results of n postures from number `first` on.

        These are values in the order of `VARIABLES`, shape `(len(VARIABLES), n)`, and flags of
        `PostureStatus`, shape `(n,)`.
        """
        rows = np.full((len(VARIABLES), count), np.nan)
        status, doubtful = np.zeros(count, np.int8), np.ones(count, bool)
        if self._model is not None:
            for begin in range(0, count, BLOCK):
                k = slice(begin, begin + BLOCK)
                doubtful[k] = self._compute(self._model, first + begin, rows[:, k], status[k])
        for i in np.flatnonzero(doubtful).tolist():
            try:
                q = self.grid.configuration(self.leg, first + i)
            except InvalidInput:
                status[i] = PostureStatus.NOT_CLOSED.flag
                continue
            outcome = kick_from(self.leg.posture(q), self.kick)
            rows[:, i] = list(variables_of(outcome, self.kick).values())
            status[i] = outcome.status.flag
        return rows, status

    def _compute(
        self, model: "KernelModel", first: int, rows: Array, status: NDArray[np.int8]
    ) -> NDArray[np.bool_]:
        """Fill in what kernel and flights give; return which postures are doubtful."""
        from kickdyn.flight.batch import fly_many
        from kickdyn.sweeps.carry_table import launches
        from kickdyn.sweeps.kernel import NORMAL, TANGENT, fill_variables

        assert self._kernel is not None
        answer = self._kernel(first, len(status))
        doubtful = fill_variables(answer, model, rows, status)
        to_fly = ~doubtful
        if self._table is not None:
            to_fly &= self._table(answer[NORMAL], answer[TANGENT], rows[_CARRY])
        flown = np.flatnonzero(to_fly)
        if flown.size:
            balls = launches(model, answer[:3, flown].T)
            flights = fly_many(balls, self.kick.ball, self.kick.air, tol=FLIGHT_TOLERANCE)
            rows[_CARRY, flown] = flights.range.values
            doubtful[flown[flights.status.values != 0]] = True
        return doubtful
