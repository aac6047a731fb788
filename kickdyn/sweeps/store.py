"""Sweeps in files: a Zarr store that is filled chunk by chunk, and netCDF files.

The variable `status` says what is computed: it is -1 (`not-computed`) until a chunk is complete,
because it is written after all other variables of the chunk. The attribute `finished` is 1 once all
chunks are. A store that was stopped at any moment is thus a valid dataset, and can be resumed.
"""

import math
import os
import shutil
import warnings
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.files import replacing
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.sweeps.dataset import STATUS_ATTRIBUTES, VARIABLES, difference
from kickdyn.sweeps.grid import Chunks
from kickdyn.sweeps.sweep_kick import PostureStatus

_NOT_COMPUTED = PostureStatus.NOT_COMPUTED.flag


class SweepStore:
    """A Zarr store that chunks of a sweep are written to.

    `described` has coordinates and attributes of the sweep, see `dataset.describe`; `chunk` is the
    number of postures per chunk, roughly. With `resume`, the store may be there if it is one of the
    same sweep.

    Attributes:
        created: whether the store was not there before.
        chunks: the division of the grid.
    """

    def __init__(
        self, path: str | PathLike[str], described: xr.Dataset, chunk: int, *, resume: bool
    ) -> None:
        zarr = _zarr()
        self._path = _checked_path(path)
        self.created = not self._path.exists()
        try:
            if self.created:
                shape = tuple(described.sizes[name] for name in described.dims)
                self._create(described, Chunks.of(shape, chunk))
            else:
                self._check(described, resume)
        except OSError as error:
            raise InvalidInput(f"{path} cannot be written ({error.strerror or error})") from None
        self._group: Any = zarr.open_group(self._path, mode="r+")
        status: Any = self._group["status"]
        self.chunks = Chunks(status.shape, status.chunks)

    def _check(self, described: xr.Dataset, resume: bool) -> None:
        """Raise `InvalidInput` unless the store is one of this sweep that may be resumed."""
        if not resume:
            raise InvalidInput(f"{self._path} exists: --resume goes on with it, else name another")
        with open_sweep(self._path) as stored:
            if other := difference(stored, described):
                raise InvalidInput(f"{self._path} is of another sweep: {other}")

    def _create(self, described: xr.Dataset, chunks: Chunks) -> None:
        """Make the empty store under another name first, so that a store is complete or absent."""
        if not self._path.resolve().parent.is_dir():  # Zarr would make all missing folders
            raise InvalidInput(f"{self._path} cannot be written (its folder does not exist)")
        draft = self._path.with_name(f".{self._path.name}-draft-{os.getpid()}")
        try:
            described.to_zarr(draft, mode="w", consolidated=False, zarr_format=3)
            group: Any = _zarr().open_group(draft, mode="r+")
            arrays: dict[str, tuple[str, float, dict[str, Any]]] = {
                name: ("f8", math.nan, {"units": unit, "long_name": meaning})
                for name, (unit, meaning) in VARIABLES.items()
            }
            flags = {**STATUS_ATTRIBUTES, "flag_values": STATUS_ATTRIBUTES["flag_values"].tolist()}
            arrays["status"] = ("i1", _NOT_COMPUTED, flags)
            for name, (dtype, fill, attributes) in arrays.items():
                group.create_array(
                    name, shape=chunks.grid_shape, chunks=chunks.shape, dtype=dtype,
                    fill_value=fill, dimension_names=list(described.dims), attributes=attributes,
                    compressors=None,
                )  # fmt: skip
            with warnings.catch_warnings():  # of Zarr, that other readers may not know it
                warnings.simplefilter("ignore")
                _zarr().consolidate_metadata(draft)  # without it, `xr.open_zarr` warns
            draft.rename(self._path)
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that are not computed yet."""
        if self._group.attrs.get("finished"):
            return []
        status, region = self._group["status"], self.chunks.region
        return [k for k in range(len(self.chunks)) if (status[region(k)] == _NOT_COMPUTED).any()]

    def write(self, k: int, rows: Array, status: NDArray[np.int8]) -> None:
        """Write chunk `k`: its variables first, and then its status, each file whole or not."""
        region = self.chunks.region(k)
        shape = tuple(part.stop - part.start for part in region)
        for name, values in zip((*VARIABLES, "status"), (*rows, status), strict=True):
            self._group[name][region] = values.reshape(shape)

    def finish(self) -> None:
        """Record that every chunk is computed."""
        for file in self._path.rglob("*.partial"):  # left by a process that was killed
            file.unlink()
        self._group.attrs["finished"] = 1


@validation.check_arguments
def open_sweep(path: str | PathLike[str]) -> xr.Dataset:
    """Open a sweep from a file: a Zarr store, finished or not, or a netCDF file.

    Args:
        path: the folder or file.

    Returns:
        The dataset that `kickdyn.sweep` describes, read when its values are asked for. With dask
        installed, `.chunk()` makes xarray compute on a store larger than memory.

    Raises:
        InvalidInput: there is no such file, or it is not a sweep.
    """
    file = _checked_path(path)
    if not file.exists():
        raise InvalidInput(f"{path}: there is no such sweep")
    try:
        data: xr.Dataset
        if file.is_dir():
            _zarr()
            data = xr.open_zarr(file, consolidated=False, chunks=None)
        else:
            data = xr.open_dataset(file, engine="h5netcdf")
    except (OSError, ValueError, KeyError, AttributeError) as error:
        reason = " ".join(str(error).split())[:100]
        raise InvalidInput(f"{path} cannot be read as a sweep ({reason})") from None
    lacking = [name for name in (*VARIABLES, "status") if name not in data]
    if lacking:
        raise InvalidInput(f"{path} is not a sweep: it has no {lacking[0]}")
    ordered = data[[*VARIABLES, "status"]]
    ordered.set_close(data.close)
    return ordered


def check_netcdf_name(path: str | PathLike[str]) -> None:
    """Raise `InvalidInput` unless the name ends in `.nc`."""
    if Path(path).suffix != ".nc":
        raise InvalidInput(
            f"{path} has no known ending: a sweep is written as .nc (netCDF 4) or .zarr (a store)"
        )


def save_netcdf(data: xr.Dataset, path: str | PathLike[str]) -> None:
    """Write a dataset as netCDF 4, which `open_sweep` reads, or raise `InvalidInput`."""
    check_netcdf_name(path)
    with replacing(path) as draft:
        data.to_netcdf(draft, engine="h5netcdf")


def _checked_path(path: str | PathLike[str]) -> Path:
    """Return the path, or raise `InvalidInput` where it cannot be one."""
    if "\0" in str(path):
        raise InvalidInput(f"path is {path!r}: it must be the name of a folder or file")
    return Path(path)


def _zarr() -> Any:
    """Return the module zarr, or raise `InvalidInput` where it is not installed."""
    try:
        import zarr
    except ImportError:
        raise InvalidInput('a Zarr store needs zarr: pip install "kickdyn[store]"') from None
    return zarr
