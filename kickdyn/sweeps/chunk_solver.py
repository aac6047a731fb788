"""All variables of a range of postures: a compiled kernel, flights, and a check of both."""

from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.laws import find_law
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import VARIABLES, describe, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel_model import KernelModel
from kickdyn.sweeps.sweep_kick import (
    FLIGHT_TOLERANCE,
    Kick,
    PostureOutcome,
    PostureStatus,
    kick_from,
)

KERNEL_FROM = 2000
"""Postures of a grid from which a kernel is used: compiling it takes seconds the first time."""

CHUNK = 262_144
"""Postures per chunk, roughly."""

BLOCK = 32_768
"""Postures of a chunk that are computed at a time: intermediate results take less memory."""

SLOW_CHUNK = 512
"""Postures per chunk where each of them is one `kick_from`: about a second."""

AGREEMENT = 1e-9
"""Relative difference between kernel and `kick_from` at which a sweep stops."""

_CARRY = list(VARIABLES).index("carry")
_CHECKED = ("effective_mass", "impulse", "ball_speed", "worst_joint_impulse", "speed_use", "carry")


class ChunkSolver:
    """Computes all variables of ranges of postures; safe to call from several threads.

    A grid of at least `KERNEL_FROM` postures is computed by a compiled kernel. Where there is none
    (a floating base, supports, loops, wind that changes with height, a law without a kernel),
    and where the kernel marks a posture as doubtful, it is `kick_from`, a thousand times slower.

    `tolerance` is the largest error of a carry [m], where balls of the air are interpolated between
    flights (`CarryTable`); 0 flies every ball, to 1e-8 of the carry.

    Attributes:
        leg, grid, kick: the arguments.
        chunk: number of postures to compute at a time.
        carry_tolerance: `tolerance` where carries are interpolated, else 0.
    """

    def __init__(self, leg: Leg, grid: Grid, kick: Kick, tolerance: float = 0.0) -> None:
        tolerance = validation.number("tolerance", tolerance, at_least=0, unit="m")
        self.leg, self.grid, self.kick = leg, grid, kick
        windy = kick.air is not None and callable(kick.air.wind)
        few = grid.size < KERNEL_FROM
        slow = few or windy or not find_law(kick.law).has_kernel
        self._model = None if slow else KernelModel.of(leg, kick)
        self.chunk = SLOW_CHUNK if self._model is None else CHUNK
        planar = self._model is not None and self._model.planar
        self.carry_tolerance = tolerance if planar and kick.air is not None else 0.0
        self._kernel: Callable[[int, int], Array] | None = None
        self._table: Callable[[Array, Array, Array], NDArray[np.bool_]] | None = None

    def describe(self) -> xr.Dataset:
        """Return coordinates and provenance of the sweep, see `dataset.describe`."""
        return describe(self.leg, self.grid, self.kick, self.carry_tolerance)

    def compile(self) -> None:
        """Compile what is not on disk yet."""
        if self._model is None:
            return
        from kickdyn.flight.compiling import compiled_rates  # numba is needed by large grids only
        from kickdyn.flight.march import compiled_march
        from kickdyn.sweeps.carry_table import compiled_evaluate
        from kickdyn.sweeps.kernel import compiled_kernel

        compiled_kernel()
        if self.kick.air is not None:
            compiled_march()
            compiled_rates(self.kick.ball, self.kick.air)
            if self.carry_tolerance > 0.0:
                compiled_evaluate()

    def prepare(self) -> None:
        """Compile the kernel and fly the balls of the carry table; to be called before threads."""
        if self._model is None:
            return
        self.compile()
        from kickdyn.sweeps.kernel import Kernel

        self._kernel = Kernel(self._model, self.leg, self.grid)
        if self.carry_tolerance > 0.0:
            from kickdyn.sweeps.carry_table import CarryTable

            self._table = CarryTable(self._model, self.carry_tolerance)

    def __call__(self, first: int, count: int) -> tuple[Array, NDArray[np.int8]]:
        """Return variables and status flags of `count` postures from number `first` on.

        The variables are in the order of `VARIABLES`, shape `(len(VARIABLES), count)`. Raises
        `KickdynError` where the kernel and `kick_from`, or it and Pinocchio's solver, disagree:
        one posture of each range is checked, the first that the kernel computes or that has an
        impact.
        """
        rows = np.full((len(VARIABLES), count), np.nan)
        status, doubtful = np.zeros(count, np.int8), np.ones(count, bool)
        if self._model is not None:
            for begin in range(0, count, BLOCK):
                k = slice(begin, begin + BLOCK)
                doubtful[k] = self._compute(self._model, first + begin, rows[:, k], status[k])
        sure = np.flatnonzero(~doubtful)
        if sure.size:
            _confirm(self._verify(first, int(sure[0]), rows))
        confirmed = bool(sure.size)
        for i in np.flatnonzero(doubtful).tolist():
            outcome = self._outcome(first + i)
            if outcome is None:
                status[i] = PostureStatus.NOT_CLOSED.flag
                continue
            rows[:, i] = list(variables_of(outcome, self.kick).values())
            status[i] = outcome.status.flag
            if not confirmed and outcome.impact is not None:
                _confirm(outcome)
                confirmed = True
        return rows, status

    def _compute(
        self, model: KernelModel, first: int, rows: Array, status: NDArray[np.int8]
    ) -> NDArray[np.bool_]:
        """Fill in what kernel and flights give; return which postures are doubtful."""
        from kickdyn.flight.batch import fly_many
        from kickdyn.sweeps.carry_table import launches
        from kickdyn.sweeps.kernel import NORMAL, TANGENT, fill_variables

        assert self._kernel is not None
        kick = self.kick
        answer = self._kernel(first, len(status))
        doubtful = fill_variables(answer, model, rows, status)
        to_fly = np.ones(len(status), bool)
        if self._table is not None:
            to_fly = self._table(answer[NORMAL], answer[TANGENT], rows[_CARRY])
        flown = np.flatnonzero(to_fly & ~doubtful)
        if flown.size:
            balls = launches(model, answer[:3, flown].T)
            flights = fly_many(balls, kick.ball, kick.air, tol=FLIGHT_TOLERANCE)
            rows[_CARRY, flown] = flights.range.values
            doubtful[flown[flights.status.values != 0]] = True
        return doubtful

    def _outcome(self, number: int) -> PostureOutcome | None:
        """Return the kick from one posture of the grid; None where its loops cannot be closed."""
        try:
            q = self.grid.configuration(self.leg, number)
        except InvalidInput:
            return None
        return kick_from(self.leg.posture(q), self.kick)

    def _verify(self, first: int, i: int, rows: Array) -> PostureOutcome:
        """Return what `kick_from` computes for a posture of a chunk; raise where it is not that."""
        outcome = self._outcome(first + i)
        assert outcome is not None  # no kernel serves loops
        row = np.array(list(variables_of(outcome, self.kick).values()))
        for k, name in enumerate(VARIABLES):
            tolerance = AGREEMENT * abs(row[k])
            if k == _CARRY:  # both flights are wrong by up to 1e-8 of the carry; a launch that is
                # level but for rounding comes down at once
                tolerance = 1e-7 * abs(row[k]) + (self.carry_tolerance or 1e-9)
            if name in _CHECKED and not abs(rows[k, i] - row[k]) <= tolerance:
                raise KickdynError(
                    f"posture {first + i}: the sweep has {name} {float(rows[k, i])!r}, a single "
                    f"kick {float(row[k])!r}"
                )
        return outcome


def _confirm(outcome: PostureOutcome) -> None:
    """Raise `KickdynError` where Pinocchio's `impulseDynamics` finds another impulse.

    It knows no friction, so both solve the frictionless contact of a posture. It loses as many
    digits as the condition of the leg's inertia has, some of which the closed form keeps, and
    is not asked for legs of a thousandth of the ball's mass or less.
    """
    hit = outcome.impact
    if hit is None or hit.effective_mass < 1e-3 * hit.ball.mass:
        return
    contact = Contact(hit.contact.normal, hit.contact.restitution)
    closed = strike(hit.posture, hit.v_before, hit.ball, contact)
    engine = strike(hit.posture, hit.v_before, hit.ball, contact, engine="pinocchio")
    gap = float(np.linalg.norm(engine.impulse - closed.impulse))
    tolerance = max(AGREEMENT, 1e3 * float(np.finfo(float).eps) * hit.condition)
    if not gap <= tolerance * float(np.linalg.norm(closed.impulse)):
        raise KickdynError(
            f"{hit.posture!r}: without friction the impulse is {closed.impulse.tolist()} N s "
            f"in closed form, {engine.impulse.tolist()} N s by pin.impulseDynamics: "
            "the two should agree, please report this posture"
        )
