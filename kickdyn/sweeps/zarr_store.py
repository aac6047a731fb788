"""A sweep on the disk, chunk by chunk: a Zarr store that survives being killed.

While a sweep is under way, the folder `progress` in the store says which chunks are done, and what
is to be known of them in the end; a finished store has none.
"""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.chunk_layout import Cut
from kickdyn.sweeps.chunk_log import ChunkLog
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kick import STATUSES, Kick
from kickdyn.sweeps.outcomes import interpolated, kernel_scene
from kickdyn.sweeps.provenance import axes, difference, provenance
from kickdyn.sweeps.run import VARIABLES, check_names

CHUNK = 131_072
"""Postures per chunk, about."""

SLOW_CHUNK = 2048
"""The same where every posture is one `kick_from`: about a second."""

_FLAGS = {
    "long_name": "whether the leg can kick so",
    "flag_values": list(range(len(STATUSES))),
    "flag_meanings": " ".join(name.replace(" ", "_") for name in STATUSES),
}


def cut(leg: Leg, grid: Grid, kick: Kick, parts: int = 1) -> Cut:
    """Return the chunks of a sweep, or so many parts of each."""
    most = CHUNK if kernel_scene(leg, kick) else min(CHUNK, SLOW_CHUNK)
    return Cut.of(grid.shape, most // parts)


class Store:
    """Where the chunks of a sweep go.

    Args:
        path: a folder ending in `.zarr`.
        leg: the leg.
        grid: the postures.
        kick: what they share.
        carry_error: that carries may have, see `Outcomes` [m].
        resume: go on with what is there, if it is of the same sweep.

    Raises:
        InvalidInput: something else is there, a store of another sweep or version, or the folder
            cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        leg: Leg,
        grid: Grid,
        kick: Kick,
        carry_error: float = 0.0,
        *,
        resume: bool,
    ) -> None:
        check_names(grid)
        self.path, self._grid = Path(path), grid
        self._notes = ChunkLog(self.path)
        self.cut = cut(leg, grid, kick)
        attributes: dict[str, Any] = {
            **provenance(leg, kick),
            "carry_error_m": interpolated(kernel_scene(leg, kick), kick, carry_error),
            "grid": axes(grid),
        }
        try:
            if self.path.exists():
                self._check(leg, attributes, resume)
            elif not self.path.resolve().parent.is_dir():  # Zarr would make all that is missing
                raise InvalidInput(f"{path} cannot be written (its folder does not exist)")
            else:
                self._make(leg, attributes)
        except OSError as error:
            raise InvalidInput(f"{path} cannot be written ({error.strerror or error})") from None
        import zarr

        self._group: Any = zarr.open_group(self.path, mode="r+")
        if self.summary is not None:  # killed while it tidied up
            self._notes.clear()

    def _check(self, leg: Leg, attributes: dict[str, Any], resume: bool) -> None:
        if not resume:
            raise InvalidInput(f"{self.path} exists: --resume goes on with it, else name another")
        import zarr

        try:
            found = dict(zarr.open_group(self.path, mode="r").attrs)
        except (OSError, ValueError):
            raise InvalidInput(f"{self.path} is no sweep: there is nothing to resume") from None
        units = {name: leg.joint_unit(name) for name in self._grid.axes}
        if other := difference(found, json.loads(json.dumps(attributes)), units):
            raise InvalidInput(f"{self.path} is of another sweep: {other}")

    def _make(self, leg: Leg, attributes: dict[str, Any]) -> None:
        """Make the empty store under another name first: one that is there is whole."""
        import zarr

        draft = self.path.with_name(f".{self.path.name}-draft-{os.getpid()}")
        try:
            group = zarr.open_group(draft, mode="w")
            dims = list(self._grid.axes)
            for name, values in self._grid.axes.items():
                unit = leg.joint_unit(name)
                array = group.create_array(name, data=values, dimension_names=[name])
                array.attrs.update({"units": unit, "long_name": f"{name} joint"})
            kept: dict[str, tuple[Any, Any, dict[str, Any]]] = {
                name: ("f8", math.nan, {"units": unit, "long_name": meaning})
                for name, (unit, meaning) in VARIABLES.items()
            }
            kept["status"] = ("i1", 0, _FLAGS)
            for name, (kind, fill, about) in kept.items():
                group.create_array(
                    name, shape=self._grid.shape, chunks=self.cut.chunk, dtype=kind,
                    fill_value=fill, dimension_names=dims, attributes=about, compressors=None,
                )  # fmt: skip
            group.attrs.update(attributes)
            (draft / "progress").mkdir()
            draft.rename(self.path)
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that are yet to be computed."""
        if self.summary is not None:  # whose notes are gone
            return []
        done = set(self._notes.done())
        return [k for k in range(len(self.cut)) if k not in done]

    def write(
        self, k: int, rows: Array, status: NDArray[np.int8], chunk_summary: dict[str, Any]
    ) -> None:
        """Write a chunk, then that it is done and what is told of it."""
        region = self.cut.region(k)
        shape = tuple(part.stop - part.start for part in region)
        for name, values in zip((*VARIABLES, "status"), (*rows, status), strict=True):
            self._group[name][region] = values.reshape(shape)
        self._notes.write(k, chunk_summary)

    def chunk_summary(self) -> Iterator[dict[str, Any]]:
        """Yield what was told of every chunk, in their order, once all are done."""
        for k in range(len(self.cut)):
            yield self._notes.read(k)

    def abandon(self) -> None:
        """Remove a store that has no chunk: the next attempt shall not find it in its way."""
        if self.summary is None and not self._notes.done():
            shutil.rmtree(self.path)

    @property
    def summary(self) -> dict[str, Any] | None:
        """What was said of the whole sweep, once it is complete."""
        found = self._group.attrs.get("summary")
        return found if isinstance(found, dict) else None

    def finish(self, summary: dict[str, Any]) -> dict[str, Any]:
        """Say that the sweep is complete, and what it comes to."""
        for file in self.path.rglob("*.partial"):  # of a writer that was killed
            file.unlink()
        self._group.attrs["summary"] = summary
        self._notes.clear()
        return summary
