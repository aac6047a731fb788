"""A chunk of a sweep, from its number to the disk: what a thread or a worker process does."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.front import front as front_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kick import STATUSES, Kick
from kickdyn.sweeps.outcomes import Outcomes
from kickdyn.sweeps.run import VARIABLES
from kickdyn.sweeps.zarr_store import Store

_NAMES = list(VARIABLES)
_SPEED, _WORST = _NAMES.index("ball_speed"), _NAMES.index("worst_joint_impulse")
_RESIDUALS = slice(_NAMES.index("restitution_residual"), _NAMES.index("momentum_residual") + 1)

_BINS = 256

TOGETHER = 32
"""Chunks that are merged at once: their fronts are thousands of postures each."""


@dataclass(frozen=True, eq=False)
class Job:
    """A sweep into a store, as it is sent to a worker.

    Attributes:
        path: of the store, which is there.
        leg: the leg.
        grid: the postures.
        kick: what they share.
        carry_error: as for `Outcomes`.
    """

    path: str
    leg: Leg
    grid: Grid
    kick: Kick
    carry_error: float

    @cached_property
    def store(self) -> Store:
        """The store, opened; raise `InvalidInput` where it is not seen, or of another version."""
        if not Path(self.path).is_dir():  # seen from here
            raise InvalidInput(f"{self.path} is not there")
        return Store(self.path, self.leg, self.grid, self.kick, self.carry_error, resume=True)

    @cached_property
    def _outcomes(self) -> Outcomes:
        return Outcomes(self.leg, self.grid, self.kick, self.carry_error)

    def prepare(self) -> None:
        """Compile and fit what all chunks need; to be called before there are threads."""
        _ = self.store, self._outcomes

    def __call__(self, k: int) -> int:
        """Compute and write a chunk; return its postures."""
        first, count = self.store.cut.span(k)
        rows, status = self._outcomes(first, count)
        self.store.write(k, rows, status, chunk_summary(first, rows, status))
        return count


def chunk_summary(first: int, rows: Array, status: NDArray[np.int8]) -> dict[str, Any]:
    """Return what is to be known of a chunk that begins with posture `first`.

    All of it is plain but the front, shape `(n, 3)`: thousands of postures.
    """
    counts = np.bincount(status, minlength=len(STATUSES)).tolist()
    about: dict[str, Any] = {
        "counts": dict(zip(STATUSES, counts, strict=True)),
        "residual": float(np.fmax.reduce(rows[_RESIDUALS], axis=None, initial=0.0)),
        "best": None,
        "worst": None,
        "front": np.empty((0, 3)),
    }
    possible = np.flatnonzero(status == STATUSES.index("ok"))
    if possible.size:
        speed, load = rows[_SPEED, possible], rows[_WORST, possible]
        for name, i in (("best", int(speed.argmax())), ("worst", int(speed.argmin()))):
            about[name] = [float(speed[i]), first + int(possible[i])]
        near = _unbeaten(speed, load)
        points = np.column_stack([speed[near], load[near], first + possible[near]])
        about["front"] = front_of(points)
    return about


def _unbeaten(speed: Array, load: Array) -> NDArray[np.intp]:
    """Return which postures may be on the front: sorting them all would take longest of all."""
    low, high = speed.min(), speed.max()
    bins = ((speed - low) * ((_BINS - 1) / max(high - low, 1e-300))).astype(np.int64)
    lightest = np.full(_BINS + 1, np.inf)
    np.minimum.at(lightest, bins, load)
    rival = np.minimum.accumulate(lightest[::-1])[::-1]  # among the faster bins
    return np.flatnonzero(load < rival[bins + 1])


def merged(parts: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return what is to be known of chunks together, as plain values; of equals, the first posture.

    Args:
        parts: of chunks, or merged already.
    """
    waiting: list[dict[str, Any]] = []
    for part in parts:
        waiting.append(part)
        if len(waiting) == TOGETHER:
            waiting = [_together(waiting)]
    whole = _together(waiting)
    points = whole["front"].tolist()
    return {**whole, "front": [[speed, load, int(number)] for speed, load, number in points]}


def _together(parts: list[dict[str, Any]]) -> dict[str, Any]:
    best = [part["best"] for part in parts if part["best"]]
    worst = [part["worst"] for part in parts if part["worst"]]
    points = np.concatenate([np.reshape(part["front"], (-1, 3)) for part in parts])
    return {
        "counts": {name: sum(part["counts"][name] for part in parts) for name in STATUSES},
        "residual": max(part["residual"] for part in parts),
        "best": max(best, key=lambda each: (each[0], -each[1]), default=None),
        "worst": min(worst, default=None),
        "front": front_of(points),
    }
