"""A sweep to ask questions of, however large: read chunk by chunk, and only what is needed."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from functools import cache, partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
import xarray as xr

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.sweeps.block import Block, Numbers, Space
from kickdyn.sweeps.chunk_layout import Cut
from kickdyn.sweeps.chunk_log import ChunkLog
from kickdyn.sweeps.expression import Expression
from kickdyn.sweeps.front import Front
from kickdyn.sweeps.kick import STATUSES
from kickdyn.sweeps.marginal import Marginal
from kickdyn.sweeps.optimum import Optimum, optimum
from kickdyn.sweeps.run import VARIABLES
from kickdyn.sweeps.top import Top, lot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from kickdyn.sweeps.summary import Line

Region = tuple[slice, ...]


class Reduction(Protocol):
    """What is seen block by block: `Top`, `Front`, `Marginal`."""

    def update(self, block: Block) -> None:
        """See postures."""


class Sweep:
    """A sweep, in memory or on the disk, or those postures of it that fulfil a condition.

    Its answers count the postures that the leg can kick from (status `ok`). Angles are in degrees;
    the dataset itself, `data`, is in SI units.

    Args:
        data: as `kickdyn.sweeps.run.sweep` returns it, or opened lazily.
        name: what to call it.
        parts: the regions of the grid that are computed; None is all of it.
        conditions: that postures must fulfil.

    Attributes:
        data: the dataset, all postures.
        space: its joints.
        postures: how many are computed.
    """

    def __init__(
        self,
        data: xr.Dataset,
        name: str = "sweep",
        parts: Sequence[Region] | None = None,
        conditions: tuple[Expression, ...] = (),
    ) -> None:
        lacking = [each for each in (*VARIABLES, "status") if each not in data]
        if lacking:
            raise InvalidInput(f"{name} is no sweep: it has no {lacking[0]}")
        self.data, self.name, self.conditions = data, name, conditions
        joints = [str(each) for each in data.status.dims]
        axes = {joint: data[joint].values for joint in joints}
        self.space = Space.of(axes, {joint: data[joint].attrs["units"] for joint in joints})
        whole = tuple(slice(0, n) for n in self.space.shape)
        self._parts = [whole] if parts is None else list(parts)
        self.postures = sum(_size(part) for part in self._parts)

    @property
    def finished(self) -> bool:
        """Whether every posture of the grid is computed."""
        return self.postures == self.space.size

    def __repr__(self) -> str:
        about, total = self.data.attrs, self.space.size
        said = f"{self.postures:,} of {total:,} postures, {self.postures / total:.1%}"
        lines = [
            f"<Sweep {self.name}: {about['leg']}, foot {about['foot_speed_m_s']:g} m/s at "
            f"{about['attack_deg']:g} deg, "
            + (f"{total:,} postures>" if self.finished else f"unfinished: {said}>")
        ]
        for name, values in self.space.axes.items():
            unit, n = self.space.units[name], len(values)
            step = f", {n} values each {(values[-1] - values[0]) / (n - 1):.4g}" if n > 1 else ""
            span = f"{values[0]:.4g} to {values[-1]:.4g}" if n > 1 else f"{values[0]:.4g}"
            lines.append(f"  {name}: {span} {unit}{step}")
        lines += [f"  where {each.text}" for each in self.conditions]
        return "\n".join(lines)

    def where(self, condition: str) -> Sweep:
        """Return the postures that fulfil a condition, such as `knee < 30 and carry > 0.1`.

        Raises:
            InvalidInput: as `Expression`.
        """
        added = Expression(condition, self.space.units)
        return Sweep(self.data, self.name, self._parts, (*self.conditions, added))

    def blocks(self) -> Iterator[Block]:
        """Yield the postures that the leg can kick from and that fulfil all conditions."""
        for part in self._parts:
            whole = self._block(part)
            block = whole.pick(self._status(part) == STATUSES.index("ok"))
            for condition in self.conditions:
                block = block.pick(np.broadcast_to(condition(block), block.numbers.shape))
            yield block

    def reduce(self, *reductions: Reduction) -> None:
        """Let reductions see every block, in one pass."""
        for block in self.blocks():
            if block.numbers.size:
                for each in reductions:
                    each.update(block)

    def counts(self) -> dict[str, int]:
        """Return how many postures have each status, whatever the conditions."""
        found = sum(
            (np.bincount(self._status(part), minlength=len(STATUSES)) for part in self._parts),
            start=np.zeros(len(STATUSES), np.int64),
        )
        return dict(zip(STATUSES, found.tolist(), strict=True))

    def count(self) -> int:
        """Return how many postures there are to choose from."""
        return sum(block.numbers.size for block in self.blocks())

    def best(self, of: str = "ball_speed", where: str | None = None) -> xr.Dataset:
        """Return the posture of largest `of`, a result or an expression (`-energy_lost`).

        Raises:
            InvalidInput: as `Expression`; no posture fulfils the conditions.
        """
        found = self.top(1, of, where)
        if not found.sizes["posture"]:
            raise InvalidInput(f"{self._chosen(where).nothing()}: there is no best one")
        return found.isel(posture=0)

    def top(self, most: int = 10, of: str = "ball_speed", where: str | None = None) -> xr.Dataset:
        """Return the `most` postures of largest `of`, the best first, along `posture`."""
        validation.number("most", most, at_least=1, at_most=10**6)
        chosen = self._chosen(where)
        top = Top(most, chosen.value(of))
        chosen.reduce(top)
        return self.rows(top.numbers)

    def front(
        self,
        more: str = "ball_speed",
        less: str = "worst_joint_impulse",
        where: str | None = None,
    ) -> xr.Dataset:
        """Return the postures that no other beats in both numbers, along `posture`."""
        chosen = self._chosen(where)
        found = Front(chosen.value(more), chosen.value(less))
        chosen.reduce(found)
        return self.rows(found.points[:, 2].astype(np.int64))

    def marginal(
        self,
        *joints: str,
        of: str = "ball_speed",
        where: str | None = None,
        bins: int | None = None,
    ) -> xr.Dataset:
        """Return best and mean of a number per value of one or two joints; see `Marginal`."""
        chosen = self._chosen(where)
        found = Marginal(self.space, joints, chosen.value(of), bins)
        chosen.reduce(found)
        return found.dataset()

    def sample(self, most: int = 1000, seed: int = 0, where: str | None = None) -> xr.Dataset:
        """Return `most` postures by lot, along `posture`; a seed always draws the same."""
        validation.number("most", most, at_least=1, at_most=10**6)
        chosen = self._chosen(where)
        drawn = Top(most, lot(seed))
        chosen.reduce(drawn)
        return self.rows(np.sort(drawn.numbers))

    def optimum(self, of: str = "ball_speed", where: str | None = None) -> Optimum:
        """Return what a degree of each joint changes around the best posture.

        Neighbours count whether or not they fulfil the conditions.
        """
        number = int(self.best(of, where)["number"])
        return optimum(self.space, of, number, partial(self._at, self.value(of)))

    def rows(self, numbers: Numbers) -> xr.Dataset:
        """Return postures by their numbers, along `posture`: joints [deg; m] and all results."""
        place = np.unravel_index(numbers, self.space.shape)
        dims = zip(self.space.axes, place, strict=True)
        found = self.data[[*VARIABLES]].isel({name: ("posture", i) for name, i in dims})
        about = {k: v for k, v in self.data.attrs.items() if k not in ("grid", "summary")}
        result = xr.Dataset({"number": ("posture", numbers)}, attrs=about)
        for name, values in self.space.axes.items():
            at = values[self.space.index(name, numbers)]
            result[name] = ("posture", at, {"units": self.space.units[name]})
        for name in VARIABLES:
            result[name] = ("posture", found[name].values, self.data[name].attrs)
        return result

    def plot(self, path: str | PathLike[str] | None = None, lines: Sequence[Line] = ()) -> Figure:
        """Draw heat maps and the front; write them to `path` (.png, .svg, .pdf) if it is given."""
        from kickdyn.sweeps.sweep_plot import save_figure, sweep_figure

        figure = sweep_figure(self, lines)
        if path is not None:
            save_figure(figure, path)
        return figure

    def value(self, of: str) -> Expression:
        """Return a number of this sweep's postures, as typed."""
        return Expression(of, self.space.units, "number")

    def nothing(self) -> str:
        """Return that no posture is left, in words."""
        asked = " and ".join(f"({each.text})" for each in self.conditions)
        return f"{self.name}: no posture that the leg can kick from fulfils {asked or 'anything'}"

    def _chosen(self, where: str | None) -> Sweep:
        return self if where is None else self.where(where)

    def _status(self, part: Region) -> Array:
        return np.asarray(self.data.status[part].values.ravel())

    def _block(self, part: Region) -> Block:
        inside = [np.arange(each.start, each.stop) for each in part]
        numbers = np.ravel_multi_index(np.ix_(*inside), self.space.shape)

        @cache
        def read(name: str) -> Array:
            return np.asarray(self.data[name][part].values.ravel())

        return Block(self.space, numbers.ravel().astype(np.int64), read)

    def _at(self, value: Expression, place: tuple[int, ...]) -> float:
        part = tuple(slice(i, i + 1) for i in place)
        possible = self._status(part)[0] == STATUSES.index("ok")
        found = np.broadcast_to(value(self._block(part)), (1,))
        return float(found[0]) if possible else math.nan


def open_sweep(path: str | PathLike[str]) -> Sweep:
    """Open a sweep that was written with `--out`: a Zarr store, finished or not, or a netCDF file.

    Raises:
        InvalidInput: there is none, or it cannot be read.
    """
    file = Path(path)
    if not file.exists():
        raise InvalidInput(f"{path}: there is no such sweep")
    try:
        if not file.is_dir():
            return Sweep(xr.open_dataset(file, engine="h5netcdf"), str(path))
        with warnings.catch_warnings():  # of the folder that an unfinished store keeps
            warnings.filterwarnings("ignore", "Object at progress is not recognized")
            data = xr.open_zarr(file, consolidated=False, chunks=None)
        cut = Cut(data.status.shape, data.status.encoding["chunks"])
        done = range(len(cut)) if "summary" in data.attrs else ChunkLog(file).done()
        return Sweep(data, str(path), [cut.region(k) for k in done])
    except InvalidInput:
        raise
    except (OSError, ValueError, KeyError, AttributeError) as error:
        why = " ".join(str(error).split())[:100]
        raise InvalidInput(f"{path} cannot be read as a sweep ({why})") from None


def _size(part: Region) -> int:
    return math.prod(each.stop - each.start for each in part)
