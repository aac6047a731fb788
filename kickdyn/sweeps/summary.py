"""The summary of a sweep of any size: counts, the best postures, the front, maps and a sample."""

import math
from collections.abc import Collection
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.sweeps.dataset import VARIABLES, with_variables
from kickdyn.sweeps.queries import blocks, chosen_postures, condition, front_of, shown, shown_unit
from kickdyn.sweeps.sweep_kick import PostureStatus

KEPT_POSTURES = 10
"""Postures of highest ball speed that are kept."""

SAMPLE_SIZE = 4000
"""Postures of the random sample."""

T = TypeVar("T")

NEEDED = ("ball_speed", "worst_joint_impulse", "speed_use")
"""Variables that a summary is made from."""

BINS = 200
"""Values of a joint that a map distinguishes; of more, neighbours go together."""


class Summary:
    """Reduces a sweep chunk by chunk; memory does not grow with the grid.

    `counts` and `residual` are of all computed postures; all else is of those whose status is `ok`
    and that fulfil the condition. A posture is a row: ball speed [m/s], largest impulse in a joint
    [N s], number in the grid.

    Args:
        described: coordinates and attributes of the sweep, see `dataset.describe`.
        where: a condition, see `queries.condition`.
        kept: the variables of the sweep, `NEEDED` among them.

    Attributes:
        axes: values of each joint, shape `(k,)` [deg; m].
        units: unit of each joint.
        counts: number of postures by status.
        residual: largest residual of restitution and momentum; nan without any impact.
        chosen: number of postures that count.
        best: the `KEPT_POSTURES` postures of highest ball speed, the fastest first, shape `(n, 3)`.
        worst: number of the posture of lowest ball speed, -1 without any.
        front: postures that no other beats in speed and impulse, the fastest first, `(n, 3)`.
        sample: impulse in a joint, ball speed and speed use of `SAMPLE_SIZE` random postures,
            `(n, 3)`.
        maps: the highest ball speed over pairs of the three joints with most values, or over the
            one joint there is, by the names of the joints.

    Raises:
        InvalidInput: a condition that cannot be read, or variables that do not suffice.
    """

    def __init__(
        self,
        described: xr.Dataset,
        where: str | None = None,
        kept: Collection[str] = tuple(VARIABLES),
    ) -> None:
        for name in NEEDED:
            if name not in kept:
                raise InvalidInput(f"the sweep does not keep {name}: its summary needs it")
        ordered = described["status"].dims if "status" in described else described.dims
        joints = [str(name) for name in ordered]
        self.axes = {name: shown(described, name).values for name in joints}
        self.units = {name: shown_unit(described, name) for name in joints}
        self.attributes, self.where = dict(described.attrs), where
        self.counts = {status.value: 0 for status in PostureStatus}
        self.residual, self.chosen, self.worst = math.nan, 0, -1
        self.best, self.front, self.sample = (np.empty((0, 3)) for _ in range(3))
        self._lowest, self._draws = math.inf, np.empty(0)
        self._random = np.random.default_rng(0)
        varied = [name for name in joints if len(self.axes[name]) > 1]
        longest = sorted(varied, key=lambda name: -len(self.axes[name]))[:3]
        pairs = list(combinations([name for name in varied if name in longest], 2))
        over: list[tuple[str, ...]] = [*pairs] or [tuple([*varied, *joints][:1])]
        self.maps = {names: SpeedMap(self.axes, names) for names in over}
        if where is not None:  # refuse what cannot be read before any posture is computed
            corner = described.isel({name: slice(0, 1) for name in joints})
            rows, status = np.ones((len(VARIABLES), 1)), np.zeros(1, np.int8)
            condition(with_variables(corner, rows, status, kept), where)

    @property
    def postures(self) -> int:
        """Number of postures that are computed."""
        return sum(self.counts.values()) - self.counts[PostureStatus.NOT_COMPUTED]

    def add(self, block: xr.Dataset) -> None:
        """Add the next postures, in the order of the grid."""
        begin = sum(self.counts.values())
        numbers = np.bincount(block["status"].values.ravel() + 1, minlength=len(PostureStatus))
        for status in PostureStatus:
            self.counts[status.value] += int(numbers[status.flag + 1])
        for name in {"restitution_residual", "momentum_residual"} & set(block.data_vars):
            largest = np.fmax.reduce(block[name].values, axis=None)
            self.residual = float(np.fmax(self.residual, largest))
        places = chosen_postures(block, self.where)
        self.chosen += places.size
        if not places.size:
            return
        speed, load, use = (block[name].values.ravel()[places] for name in NEEDED)
        slowest = int(speed.argmin())
        if speed[slowest] < self._lowest:
            self._lowest, self.worst = float(speed[slowest]), begin + int(places[slowest])
        points = np.column_stack([speed, load, begin + places])
        self.front = front_of(np.vstack([self.front, points]))
        few = min(KEPT_POSTURES, speed.size)
        fast = np.vstack([self.best, points[speed >= np.partition(speed, -few)[-few]]])
        self.best = fast[np.argsort(-fast[:, 0], kind="stable")[:KEPT_POSTURES]]
        draws = np.append(self._draws, self._random.random(len(load)))
        smallest = np.argsort(draws)[:SAMPLE_SIZE]  # the smallest of all draws so far
        rows = np.vstack([self.sample, np.column_stack([load, speed, use])])
        self._draws, self.sample = draws[smallest], rows[smallest]
        speeds = np.full(block["status"].shape, np.nan)
        speeds.reshape(-1)[places] = speed
        start = np.unravel_index(begin, [len(axis) for axis in self.axes.values()])
        for speed_map in self.maps.values():
            speed_map.add(dict(zip(self.axes, start, strict=True)), speeds)

    def as_json(self) -> dict[str, Any]:
        """Return the best postures and the front: joints, ball speed and impulse as lists."""
        entries = {}
        for name, rows in (("best", self.best), ("front", self.front)):
            shape = [len(axis) for axis in self.axes.values()]
            index = np.unravel_index(rows[:, 2].astype(np.int64), shape)
            angles = zip(self.axes.items(), index, strict=True)
            values = {joint: axis[i].tolist() for (joint, axis), i in angles}
            entries[name] = {
                **joint_values_by_unit(values, self.units),
                "ball_speed": rows[:, 0].tolist(),
                "worst_joint_impulse": rows[:, 1].tolist(),
            }
        return entries


def joint_values_by_unit(values: dict[str, T], units: dict[str, str]) -> dict[str, dict[str, T]]:
    """Return joint values as JSON has them: `angles_deg`, and `positions_m` of prismatic joints."""
    kinds = {name: "positions_m" if unit == "m" else "angles_deg" for name, unit in units.items()}
    return {
        kind: {name: value for name, value in values.items() if kinds[name] == kind}
        for kind in sorted(set(kinds.values()))
    }


class SpeedMap:
    """The highest ball speed for each value of one or two joints.

    At most `BINS` values of each joint are distinguished.

    Attributes:
        values: of each joint, or their means where neighbours go together.
        best: highest ball speed [m/s], one axis per joint, nan where there is no posture.
    """

    def __init__(self, axes: dict[str, Array], over: tuple[str, ...]) -> None:
        self._kept = [name in over for name in axes]
        self._bin_of = {
            name: np.arange(len(axes[name])) * min(BINS, len(axes[name])) // len(axes[name])
            for name in over
        }
        self.values = {
            name: np.bincount(bins, axes[name]) / np.bincount(bins)
            for name, bins in self._bin_of.items()
        }
        self.best = np.full([len(values) for values in self.values.values()], np.nan)

    def add(self, start: dict[str, np.intp], speeds: Array) -> None:
        """Add a block of postures: where it starts along each joint, and ball speeds or nan."""
        reduced = tuple(axis for axis, kept in enumerate(self._kept) if not kept)
        lengths = dict(zip(start, speeds.shape, strict=True))
        bins = (b[start[k] : start[k] + lengths[k]] for k, b in self._bin_of.items())
        np.fmax.at(self.best, np.ix_(*bins), np.fmax.reduce(speeds, axis=reduced))


def summarize(data: xr.Dataset, where: str | None = None) -> Summary:
    """Return the summary of a dataset, in memory or in a store."""
    summary = Summary(data, where, [name for name in VARIABLES if name in data])
    for _, block in blocks(data):
        summary.add(block)
    return summary
