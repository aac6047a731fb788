"""A sweep whose postures are seen and not kept: what is said of the whole, and some of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.block import Block, Numbers, Space
from kickdyn.sweeps.expression import Expression
from kickdyn.sweeps.front import Front
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kick import CARRY_ERROR, STATUSES, Kick
from kickdyn.sweeps.marginal import Marginal
from kickdyn.sweeps.opened import Reduction
from kickdyn.sweeps.progress import Done
from kickdyn.sweeps.provenance import provenance
from kickdyn.sweeps.run import VARIABLES, check_names
from kickdyn.sweeps.stream import stream
from kickdyn.sweeps.summary import Line, extremes
from kickdyn.sweeps.top import Top, lot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEST = 10
"""Postures of highest ball speed that are kept."""

SAMPLE = 1000
"""Postures kept by lot."""

BINS = 1000
"""Values of a joint that a marginal tells apart; of more, neighbours go together."""


class Survey:
    """What remains of a sweep that no store holds; memory does not grow with the grid.

    Counts are of all postures; all else is of those the leg can kick from (status `ok`) that
    fulfil the condition.

    Args:
        leg: the leg.
        grid: the postures.
        kick: what they share.
        where: a condition, such as `knee < 30 and carry > 0.1`.
        draws: whether `plot` will be asked for.

    Attributes:
        counts: postures by status.
        residual: the largest of restitution and momentum.
        chosen: how many there were to choose from.
        top: the `BEST` of highest ball speed, with all their numbers.
        front: the postures that no other beats in both ball speed and worst joint impulse.
        marginals: of ball speed, by joint.
        sample: `SAMPLE` by lot, with all their numbers.

    Raises:
        InvalidInput: as `Expression`, and a joint that has a result's name.
    """

    def __init__(
        self, leg: Leg, grid: Grid, kick: Kick, where: str | None = None, *, draws: bool = False
    ) -> None:
        check_names(grid)
        self._leg, self._grid, self._kick = leg, grid, kick
        self.space = space = Space.of_grid(leg, grid)
        self._condition = None if where is None else Expression(where, space.units)
        value = partial(Expression, units=space.units, kind="number")
        columns = (*space.axes, *VARIABLES)
        self.counts, self.residual, self.chosen = dict.fromkeys(STATUSES, 0), math.nan, 0
        self.top = Top(BEST, value("ball_speed"), columns)
        self._worst = Top(1, value("-ball_speed"))
        self.front = Front(value("ball_speed"), value("worst_joint_impulse"))
        self.marginals = {
            name: Marginal(space, (name,), value("ball_speed"), BINS) for name in space.axes
        }
        self.sample = Top(SAMPLE, lot(), columns)
        self._parts: list[Reduction] = [
            self.top, self._worst, self.front, *self.marginals.values(), self.sample,
        ]  # fmt: skip
        self._picture = None
        if draws:
            from kickdyn.sweeps.sweep_plot import Picture

            self._picture = Picture(space)
            self._parts += self._picture.parts

    def run(
        self,
        *,
        threads: int | None = None,
        carry_error: float = CARRY_ERROR,
        progress: Done | None = None,
    ) -> None:
        """Sweep; arguments as for `stream`, `progress` is told the best as well.

        Raises:
            Unfinished: interrupted; nothing is kept.
        """

        def done(count: int) -> None:
            if progress is not None:
                found = zip(self.top.values[:1], self.top.numbers[:1], strict=True)
                progress(count, next(((float(v), int(n)) for v, n in found), None))

        chunk_summary = stream(
            None, self._leg, self._grid, self._kick,
            threads=threads, carry_error=carry_error, progress=done, see=self.see,
        )  # fmt: skip
        self.counts, self.residual = chunk_summary["counts"], chunk_summary["residual"]

    def see(self, first: int, rows: Array, status: NDArray[np.int8]) -> None:
        """See postures from number `first` on: rows in the order of `VARIABLES`."""
        possible = np.flatnonzero(status == STATUSES.index("ok"))
        place = {name: i for i, name in enumerate(VARIABLES)}
        block = Block(self.space, first + possible, lambda name: rows[place[name], possible])
        if self._condition is not None:
            block = block.pick(np.broadcast_to(self._condition(block), block.numbers.shape))
        self.chosen += block.numbers.size
        if block.numbers.size:
            for each in self._parts:
                each.update(block)

    def lines(self) -> list[Line]:
        """Return the best and the worst posture, if there is any."""
        numbers = [*self.top.numbers[:1].tolist(), *self._worst.numbers.tolist()]
        return extremes(self._leg, self._grid, self._kick, numbers)

    def plot(self, *, lines: Sequence[Line] = ()) -> Figure:
        """Draw heat maps and the front, as `Sweep.plot`; the survey must have been told so."""
        from kickdyn.sweeps.sweep_plot import title

        assert self._picture is not None
        conditions = [] if self._condition is None else [self._condition]
        return self._picture.figure(title(provenance(self._leg, self._kick), conditions), lines)

    def as_json(self) -> dict[str, object]:
        """Return what was kept as plain values, columns of postures; angles in degrees."""
        points = self.front.points
        return {
            "best": _columns(self.top.columns, self.top.rows),
            "front": {
                **self._angles(points[:, 2].astype(np.int64)),
                **_columns(("ball_speed", "worst_joint_impulse"), points[:, :2]),
            },
            "marginals": {name: _marginal(each, name) for name, each in self.marginals.items()},
            "sample": _columns(self.sample.columns, self.sample.rows),
        }

    def _angles(self, numbers: Numbers) -> dict[str, list[float]]:
        axes = self.space.axes.items()
        return {name: values[self.space.index(name, numbers)].tolist() for name, values in axes}


def _columns(names: Sequence[str], rows: Array) -> dict[str, list[float | None]]:
    return {name: _plain(column) for name, column in zip(names, rows.T, strict=True)}


def _marginal(marginal: Marginal, name: str) -> dict[str, Any]:
    found = marginal.dataset()
    numbers = {key: _plain(found[key].values) for key in (name, "best", "mean")}
    return {**numbers, "count": found["count"].values.tolist()}


def _plain(values: Array) -> list[float | None]:
    return [each if math.isfinite(each) else None for each in values.tolist()]
