"""The summary of a sweep of any size: counts, the best postures, the front, marginals, a sample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import DECIMALS
from kickdyn.sweeps.queries import blocks, chosen_postures, condition, front_of, shown_unit
from kickdyn.sweeps.sweep_kick import PostureStatus

BEST = 10
"""Postures of highest ball speed that are kept."""

SAMPLE = 4000
"""Postures of the random sample."""

BINS = 200
"""Values of a joint that a marginal distinguishes; of more, neighbours go together."""


class Summary:
    """Reduces a sweep chunk by chunk; memory does not grow with the grid.

    `counts` and `residual` are of all computed postures; all else is of those whose status is `ok`
    and that fulfil the condition. Postures are rows of `columns`: joints [deg; m], then variables.

    Args:
        described: coordinates and attributes of the sweep, see `dataset.describe`.
        where: a condition, see `queries.condition`.
        detailed: whether marginals and a sample are wanted, as a plot needs them.

    Attributes:
        counts: number of postures by status.
        residual: largest residual of restitution and momentum; nan without any impact.
        chosen: number of postures that count.
        best: rows of the `BEST` postures of highest ball speed, the fastest first.
        worst: number of the posture of lowest ball speed, -1 without any.
        front: rows (ball speed, worst joint impulse, number) that no other posture beats in both.
        sample: rows of a random sample of `SAMPLE` postures.
        marginals: over one or two joints, see `Marginal`.
    """

    def __init__(
        self, described: xr.Dataset, where: str | None = None, *, detailed: bool = True
    ) -> None:
        ordered = described["status"].dims if "status" in described else described.dims
        self.joints = [str(name) for name in ordered]
        self.axes = {name: shown_values(described, name) for name in self.joints}
        self.units = {name: shown_unit(described, name) for name in self.joints}
        self.attributes, self.where = dict(described.attrs), where
        self.columns = (*self.joints, *VARIABLES)
        self.counts = {status.value: 0 for status in PostureStatus}
        self.residual, self.chosen, self.worst = math.nan, 0, -1
        self.best = self.sample = np.empty((0, len(self.columns)))
        self.best_numbers = np.empty(0, np.int64)
        self.front = np.empty((0, 3))
        self._lowest, self._draws = math.inf, np.empty(0)
        self._random = np.random.default_rng(0)
        varied = [name for name in self.joints if len(self.axes[name]) > 1] or self.joints[:1]
        longest = sorted(varied, key=lambda name: -len(self.axes[name]))[:3]
        pairs = combinations([name for name in varied if name in longest], 2)
        over: list[tuple[str, ...]] = [*((name,) for name in self.joints), *pairs]
        self._detailed = detailed
        self.marginals = {names: Marginal(self.axes, names) for names in over if detailed}
        if where is not None:  # refuse what cannot be read before any posture is computed
            first = described.isel({name: slice(0, 1) for name in self.joints})
            one = (self.joints, np.ones([1] * len(self.joints)))
            ones = dict.fromkeys((*VARIABLES, "status"), one)
            condition(xr.Dataset(ones, first.coords).assign_attrs(first.attrs), where)

    @property
    def postures(self) -> int:
        """Number of postures that are computed."""
        return sum(self.counts.values()) - self.counts[PostureStatus.NOT_COMPUTED]

    def add(self, block: xr.Dataset) -> None:
        """Add the next postures, in the order of the grid."""
        first = sum(self.counts.values())
        flags = block["status"].values.ravel()
        found = np.bincount(flags + 1, minlength=len(PostureStatus))
        for status in PostureStatus:
            self.counts[status.value] += int(found[status.flag + 1])
        for name in ("restitution_residual", "momentum_residual"):
            largest = np.fmax.reduce(block[name].values, axis=None)
            self.residual = float(np.fmax(self.residual, largest))
        places = chosen_postures(block, self.where)
        self.chosen += places.size
        if not places.size:
            return
        speed = block["ball_speed"].values.ravel()[places]
        load = block["worst_joint_impulse"].values.ravel()[places]
        slowest = int(speed.argmin())
        if speed[slowest] < self._lowest:
            self._lowest, self.worst = float(speed[slowest]), first + int(places[slowest])
        self._add_best(first, block, places, speed)
        points = np.column_stack([speed, load, first + places])
        self.front = front_of(np.vstack([self.front, points]))
        if self._detailed:
            self._add_details(first, block, places, speed)

    def _add_details(
        self, first: int, block: xr.Dataset, places: NDArray[np.intp], speed: Array
    ) -> None:
        """Add postures to the sample and to the marginals."""
        self._add_sample(block, places)
        index = dict(zip(self.joints, np.unravel_index(places, block["status"].shape), strict=True))
        start = np.unravel_index(first, [len(axis) for axis in self.axes.values()])
        for name, begin in zip(self.joints, start, strict=True):
            index[name] = index[name] + begin
        for marginal in self.marginals.values():
            marginal.add(index, speed)

    def _add_best(self, first: int, block: xr.Dataset, places: NDArray[np.intp], v: Array) -> None:
        """Keep the postures of highest ball speed v [m/s]; of equals, the first."""
        near = np.flatnonzero(v >= np.partition(v, -min(BEST, v.size))[-min(BEST, v.size)])
        rows = np.vstack([self.best, self._rows(block, places[near])])
        numbers = np.append(self.best_numbers, first + places[near])
        order = np.argsort(-rows[:, self.columns.index("ball_speed")], kind="stable")[:BEST]
        self.best, self.best_numbers = rows[order], numbers[order]

    def _add_sample(self, block: xr.Dataset, places: NDArray[np.intp]) -> None:
        """Keep the postures that draw the smallest random numbers."""
        draws = self._random.random(places.size)
        limit = self._draws.max() if self._draws.size >= SAMPLE else 1.0
        near = np.flatnonzero(draws < limit)
        draws = np.append(self._draws, draws[near])
        order = np.argsort(draws)[:SAMPLE]
        self._draws = draws[order]
        self.sample = np.vstack([self.sample, self._rows(block, places[near])])[order]

    def _rows(self, block: xr.Dataset, places: NDArray[np.intp]) -> Array:
        """Return rows of `columns` of postures of a block."""
        index = np.unravel_index(places, block["status"].shape)
        axes = [shown_values(block, name)[i] for name, i in zip(self.joints, index, strict=True)]
        return np.column_stack([*axes, *(block[name].values.ravel()[places] for name in VARIABLES)])

    def as_json(self) -> dict[str, Any]:
        """Return what is kept of the postures as plain values, columns with an entry for each."""
        axes, shape = self.axes.items(), [len(axis) for axis in self.axes.values()]
        index = np.unravel_index(self.front[:, 2].astype(np.int64), shape)
        front = {name: axis[i].tolist() for (name, axis), i in zip(axes, index, strict=True)}
        return {
            "best": _columns(self.columns, self.best),
            "front": {**front, **_columns(("ball_speed", "worst_joint_impulse"), self.front)},
            "marginals": {name: self.marginals[name,].as_json() for name in self.joints},
            "sample": _columns(self.columns, self.sample[:1000]),
        }


class Marginal:
    """The highest and the mean ball speed for each value of one or two joints.

    Args:
        axes: values of every joint.
        over: the joints that are kept; at most `BINS` values of each are distinguished.

    Attributes:
        values: of each joint, or their means where neighbours go together.
        count: number of postures.
    """

    def __init__(self, axes: dict[str, Array], over: tuple[str, ...]) -> None:
        self.over = over
        self._bin_of = {
            name: np.arange(len(axes[name])) * min(BINS, len(axes[name])) // len(axes[name])
            for name in over
        }
        self.values = {
            name: np.bincount(bins, axes[name]) / np.bincount(bins)
            for name, bins in self._bin_of.items()
        }
        shape = [len(values) for values in self.values.values()]
        self._best, self._total = np.full(shape, -np.inf), np.zeros(shape)
        self.count = np.zeros(shape, np.int64)

    @property
    def best(self) -> Array:
        """Highest ball speed [m/s], one axis per joint, nan where there is no posture."""
        return np.where(self.count > 0, self._best, np.nan)

    @property
    def mean(self) -> Array:
        """Mean ball speed [m/s], nan where there is no posture."""
        with np.errstate(invalid="ignore"):
            return self._total / self.count

    def add(self, index: dict[str, NDArray[np.intp]], speed: Array) -> None:
        """Add postures by their places along each joint, shape `(n,)`."""
        cells = tuple(self._bin_of[name][index[name]] for name in self.over)
        cell = np.ravel_multi_index(cells, self.count.shape)
        np.maximum.at(self._best.reshape(-1), cell, speed)
        self._total.reshape(-1)[:] += np.bincount(cell, speed, self.count.size)
        self.count.reshape(-1)[:] += np.bincount(cell, minlength=self.count.size)

    def as_json(self) -> dict[str, Any]:
        """Return the values of the joints, `best`, `mean` and `count` as plain values."""
        columns = {**self.values, "best": self.best, "mean": self.mean}
        return {**{k: _plain(v) for k, v in columns.items()}, "count": self.count.tolist()}


def summarize(data: xr.Dataset, where: str | None = None) -> Summary:
    """Return the summary of a dataset, in memory or in a store."""
    summary = Summary(data, where)
    for _, block in blocks(data):
        summary.add(block)
    return summary


def shown_values(data: xr.Dataset, name: str) -> Array:
    """Return the values of a joint [deg; m]."""
    if shown_unit(data, name) != "deg":
        return np.asarray(data[name].values)
    return np.asarray(np.round(np.degrees(data[name].values), DECIMALS) + 0.0)  # no -0


def _columns(names: Sequence[str], rows: Array) -> dict[str, list[float | None]]:
    """Return columns of rows by name, as plain values."""
    return {name: _plain(column) for name, column in zip(names, rows.T, strict=False)}


def _plain(values: Array) -> list[float | None]:
    """Return numbers as a list, None where one is not finite."""
    return [each if math.isfinite(each) else None for each in values.tolist()]
