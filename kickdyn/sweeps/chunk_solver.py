"""All variables of a range of postures, by a compiled kernel and flights."""

from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.batch import MARCH, carries, seconds_of_fly
from kickdyn.impact.laws import find_law
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.carry_table import CarryTable, launches
from kickdyn.sweeps.dataset import VARIABLES, describe, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import KERNEL, NORMAL, TANGENT, Kernel, KernelModel, fill_variables
from kickdyn.sweeps.sweep_kick import FLIGHT_TOLERANCE, Kick, PostureStatus, kick_from

SECONDS_IN_PYTHON = 3e-6
"""Processor time of a posture without its flight, by arrays of Python, roughly [s]."""

STORED_FROM = 2000
"""Postures from which the flights of a stored sweep are machine code, so that it has the same
digits whether or not it was interrupted. In memory, `fly_many`'s rule decides."""

TABLE_FROM = 600
"""Postures from which carries are interpolated: the least table takes 145 flights."""

CHUNK = 262_144
"""Postures per chunk, roughly."""

BLOCK = 16_384
"""Postures of a chunk that are computed at a time: larger intermediate results take more memory."""

SLOW_CHUNK = 512
"""Postures per chunk where each of them is one `kick_from`: about a second."""

_CARRY = list(VARIABLES).index("carry")


class ChunkSolver:
    """Computes all variables of ranges of postures; safe to call from several threads.

    All postures go through `kernel` at once, on arrays or, for millions of them, in machine code.
    Where it does not serve (a base that floats or moves, supports, loops, wind that changes with
    height, a law without a kernel), and where it marks a posture as doubtful, `kick_from` computes
    one after the other, a thousand times slower.

    Attributes:
        leg, grid, kick, tolerance: as for `kickdyn.sweep`.
        chunk: number of postures to compute at a time.
        carry_tolerance: `tolerance` where carries are interpolated, else 0.
    """

    def __init__(
        self, leg: Leg, grid: Grid, kick: Kick, tolerance: float = 0.0, *, stored: bool = False
    ) -> None:
        self.tolerance = validation.number("tolerance", tolerance, at_least=0, unit="m")
        self.leg, self.grid, self.kick = leg, grid, kick
        self._model: KernelModel | None = None
        self._kernel: Kernel | None = None
        self._table: Callable[[Array, Array, Array], NDArray[np.bool_]] | None = None
        windy = kick.air is not None and callable(kick.air.wind)
        if not windy and find_law(kick.law).has_kernel:
            self._model = KernelModel.of(leg, kick)
        self._stored, self._flies_in_machine_code = stored, False
        self.chunk = SLOW_CHUNK if self._model is None else CHUNK
        planar = self._model is not None and self._model.planar
        in_table = planar and kick.air is not None and grid.size >= TABLE_FROM
        self.carry_tolerance = self.tolerance if in_table else 0.0
        self._flight_tolerance = min(max(1e-3 * self.tolerance, FLIGHT_TOLERANCE), 1e-9)

    @property
    def seconds(self) -> float:
        """Processor time that a large grid takes, roughly [s]."""
        seconds = 2e-3 if self._model is None else 0.3e-6 if self.carry_tolerance > 0.0 else 4e-6
        return seconds * self.grid.size

    def describe(self) -> xr.Dataset:
        """Return coordinates and provenance of the sweep, see `dataset.describe`."""
        return describe(self.leg, self.grid, self.kick, self.carry_tolerance)

    def prepare(self) -> None:
        """Compile the kernel and fly the balls of the carry table; to be called before threads."""
        if self._model is None:
            return
        count, tol = self.grid.size, self._flight_tolerance
        if self._stored:
            self._flies_in_machine_code = count >= STORED_FROM
        else:
            self._flies_in_machine_code = count > BLOCK or MARCH.pays(count * seconds_of_fly(tol))
        machine_code = KERNEL.pays(count * SECONDS_IN_PYTHON)
        self._kernel = Kernel(self._model, self.leg, self.grid, machine_code=machine_code)
        if self.carry_tolerance > 0.0 and count > BLOCK:
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
        self, model: KernelModel, first: int, rows: Array, status: NDArray[np.int8]
    ) -> NDArray[np.bool_]:
        """Fill in the results of kernel and flights; return which postures are doubtful."""
        assert self._kernel is not None
        answer = self._kernel(first, len(status))
        doubtful = fill_variables(answer, model, rows, status)
        to_fly, table = ~doubtful, self._table
        if self.carry_tolerance > 0.0 and table is None and to_fly.any():  # of the whole grid
            impulses = answer[NORMAL, to_fly], answer[TANGENT, to_fly]
            table = CarryTable(
                model, self.carry_tolerance, impulses, machine_code=self._flies_in_machine_code
            )
        if table is not None:
            to_fly &= table(answer[NORMAL], answer[TANGENT], rows[_CARRY])
        flown = np.flatnonzero(to_fly)
        if flown.size:
            balls = launches(model, answer[:3, flown].T)
            rows[_CARRY, flown], landed = carries(
                balls, self.kick.ball, self.kick.air, self._flight_tolerance,
                machine_code=self._flies_in_machine_code,
            )  # fmt: skip
            doubtful[flown[~landed]] = True
        return doubtful
