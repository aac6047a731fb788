"""Sweeps in files: a Zarr store that is filled chunk by chunk, and netCDF files.

The variable `status` says what is computed: it is -1 (`not-computed`) until a chunk is complete,
because it is written after all other variables of the chunk. The attribute `finished` is 1 once all
chunks are. A store that was stopped at any moment is thus a valid dataset, and can be resumed.

In files, variables have 7 digits (float32); joints have all (float64). Blosc compresses a million
postures of 13 variables in 31 ms from 52 to about 31 MB, with lz4 after the bytes are sorted by
their place in a number. Level 1 of zstd leaves 3 % less in 80 ms, its level 5 another 8 % in 330.

Zarr makes the store and reads it. It writes all chunks in one thread of its own, however many ask
for it, so `SweepStore.write` writes the files of a chunk itself.
"""

import fcntl
import glob
import io
import json
import math
import os
import shutil
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
from kickdyn.sweeps.dataset import STATUS_ATTRIBUTES, VARIABLES, attributes_of, difference
from kickdyn.sweeps.grid import Chunks
from kickdyn.sweeps.sweep_kick import PostureStatus

_NOT_COMPUTED = PostureStatus.NOT_COMPUTED.flag

_BLOSC: dict[str, Any] = {"cname": "lz4", "clevel": 5}
"""How chunks are compressed, after their bytes are shuffled."""


class SweepStore:
    """A Zarr store that chunks of a sweep are written to.

    `described` has coordinates and attributes of the sweep, see `dataset.describe`; `variables` are
    those to keep, beside `status`; `chunk` is the number of postures per chunk, roughly. With
    `resume`, the store may be there if it is one of the same sweep.

    Attributes:
        path: the folder.
        variables: names of the variables beside `status`.
        created: whether the store was not there before.
        finished: whether the store was finished when it was opened.
        chunks: the division of the grid.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        described: xr.Dataset,
        variables: Sequence[str],
        chunk: int,
        *,
        resume: bool,
    ) -> None:
        zarr = _zarr()
        self.path, self.variables = check_store(path, resume=resume), tuple(variables)
        self.created = not self.path.exists()
        try:
            if self.created:
                shape = tuple(described.sizes[name] for name in described.dims)
                self._create(described, Chunks.of(shape, chunk))
            else:
                self._check(described)
        except OSError as error:
            reason = error.strerror or error
            if self.created and self.path.exists():
                reason = "another process has made it meanwhile"
            raise InvalidInput(f"{path} cannot be written ({reason})") from None
        self._group: Any = zarr.open_group(self.path, mode="r+")
        self.finished = bool(self._group.attrs.get("finished"))
        self._status = self._group["status"]
        self.chunks = Chunks(self._status.shape, self._status.chunks)

    def _check(self, described: xr.Dataset) -> None:
        """Raise `InvalidInput` unless the store is one of this sweep."""
        with open_sweep(self.path) as stored:
            if other := difference(stored, described, self.variables):
                raise InvalidInput(f"{self.path} is of another sweep: {other}")

    def _create(self, described: xr.Dataset, chunks: Chunks) -> None:
        """Make the empty store under another name first, so that a store is complete or absent."""
        draft = self.path.with_name(f".{self.path.name}-draft-{os.getpid()}")
        try:
            degrees = {  # in the chunks of the variables, as dask asks for
                f"{joint}_deg": {"chunks": (size,)}
                for joint, size in zip(described.dims, chunks.shape, strict=True)
            }
            described.to_zarr(draft, mode="w", consolidated=False, zarr_format=3, encoding=degrees)
            zarr = _zarr()
            group: Any = zarr.open_group(draft, mode="r+")
            arrays: dict[str, tuple[str, float, dict[str, Any]]] = {
                name: ("f4", math.nan, attributes_of(name)) for name in self.variables
            }
            flags = {**STATUS_ATTRIBUTES, "flag_values": STATUS_ATTRIBUTES["flag_values"].tolist()}
            arrays["status"] = ("i1", _NOT_COMPUTED, flags)
            for name, (dtype, fill, attributes) in arrays.items():
                group.create_array(
                    name, shape=chunks.grid_shape, chunks=chunks.shape, dtype=dtype,
                    fill_value=fill, dimension_names=list(described.dims), attributes=attributes,
                    compressors=zarr.codecs.BloscCodec(**_BLOSC, shuffle="shuffle"),
                )  # fmt: skip
            with warnings.catch_warnings():  # of Zarr, that other readers may not know it
                warnings.simplefilter("ignore")
                zarr.consolidate_metadata(draft)  # without it, `xr.open_zarr` warns
            _rewrite_root(draft, finished=0)
            draft.rename(self.path)
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that are not computed yet."""
        if self.finished:
            return []
        status, region = self._status, self.chunks.region
        return [k for k in range(len(self.chunks)) if (status[region(k)] == _NOT_COMPUTED).any()]

    def write(self, k: int, rows: Array, status: NDArray[np.int8]) -> None:
        """Write chunk `k`: its variables first, and then its status, each file whole or not."""
        by_name = dict(zip((*VARIABLES, "status"), (*rows, status), strict=True))
        for name in (*self.variables, "status"):
            self._write_file(k, name, by_name[name])

    def _write_file(self, k: int, name: str, values: NDArray[Any]) -> None:
        """Write the values of an array in chunk `k`, as the metadata of `_create` says."""
        from numcodecs.blosc import SHUFFLE, Blosc  # comes with Zarr

        dtype, fill = ("<i1", _NOT_COMPUTED) if name == "status" else ("<f4", math.nan)
        shape = tuple(axis.stop - axis.start for axis in self.chunks.region(k))
        block = values.reshape(shape).astype(dtype)
        if shape != self.chunks.shape:  # at the end of an axis: files have whole chunks
            padded = np.full(self.chunks.shape, fill, dtype)
            padded[tuple(map(slice, shape))] = block
            block = padded
        index = map(str, np.unravel_index(k, self.chunks.counts))
        file = self.path.joinpath(name, "c", *index)
        file.parent.mkdir(parents=True, exist_ok=True)
        draft = file.with_name(f"{file.name}.{os.getpid()}-{threading.get_ident()}.partial")
        draft.write_bytes(Blosc(**_BLOSC, shuffle=SHUFFLE).encode(block))
        draft.replace(file)

    def finish(self) -> None:
        """Record that every chunk is computed; remove what killed processes left."""
        for file in self.path.rglob("*.partial"):
            file.unlink()
        for draft in self.path.parent.glob(f".{glob.escape(self.path.name)}-draft-*"):
            shutil.rmtree(draft, ignore_errors=True)
        _rewrite_root(self.path, finished=1)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the store, or raise `InvalidInput` while another process fills it.

        The lock ends with the process, however that ends. Where the file system has no locks, two
        processes may fill a store: both write the same values.
        """
        folder = os.open(self.path, os.O_RDONLY)
        try:
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InvalidInput(
                    f"{self.path} is being filled by another process: wait until that has ended"
                ) from None
            except OSError:  # no locks here
                pass
            yield
        finally:
            os.close(folder)


def check_store(path: str | PathLike[str], *, resume: bool) -> Path:
    """Return the path of a store to write; raise `InvalidInput` where it cannot be one.

    With `resume` the store may exist.
    """
    store = _checked_path(path)
    if store.exists() and not resume:
        raise InvalidInput(
            f"{path} exists and is not replaced: add --resume (resume=True in Python) to compute "
            "what is missing in it, remove it, or name another"
        )
    if not store.resolve().parent.is_dir():  # Zarr would make all missing folders
        raise InvalidInput(f"{path} cannot be written (its folder does not exist)")
    return store


@validation.check_arguments
def open_sweep(path: str | PathLike[str]) -> xr.Dataset:
    """Open a sweep from a file: a Zarr store, finished or not, or a netCDF file.

    Args:
        path: the folder or file.

    Returns:
        The dataset that `kickdyn.sweep` describes; that of a store is read when its values are
        asked for. With dask installed, `.chunk()` makes xarray compute on a store larger than
        memory.

    Raises:
        InvalidInput: there is no such file, or it is not a sweep.
    """
    file = _checked_path(path)
    if not file.exists():
        raise InvalidInput(f"{path}: there is no such sweep")
    if file.is_dir():
        _zarr()
    try:
        data: xr.Dataset
        if file.is_dir():
            data = xr.open_zarr(file, consolidated=False, chunks=None)
        else:
            data = xr.load_dataset(file, engine="h5netcdf")  # all of it, with any damage
    except Exception as error:  # h5py and zarr have many kinds for a broken file
        reason = " ".join(str(error).split())[:100]
        raise InvalidInput(f"{path} cannot be read as a sweep ({reason})") from None
    if "status" not in data:
        raise InvalidInput(f"{path} is not a sweep: it has no status")
    ordered = data[[*(name for name in VARIABLES if name in data), "status"]]
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
    how = {"dtype": "f4", "zlib": True, "complevel": 1, "shuffle": True}
    encoding = {name: how for name in VARIABLES if name in data}
    with replacing(path) as draft:
        file = io.BytesIO()  # HDF5 itself crashes where the disk is full
        data.to_netcdf(file, engine="h5netcdf", encoding=encoding)
        # Not getbuffer(): a view that an error keeps crashes Python 3.12.1 when it is collected.
        draft.write_bytes(file.getvalue())


def _rewrite_root(folder: Path, finished: int) -> None:
    """Rewrite the root file of a store: its attribute `finished`, and the order of its arrays.

    Readers list arrays in the order of this file, which Zarr itself writes alphabetically.
    """
    root = json.loads((folder / "zarr.json").read_text())
    root["attributes"]["finished"] = finished
    arrays = root["consolidated_metadata"]["metadata"]
    joints = [n for joint in arrays["status"]["dimension_names"] for n in (joint, f"{joint}_deg")]
    names = [name for name in (*joints, *VARIABLES, "status") if name in arrays]
    root["consolidated_metadata"]["metadata"] = {name: arrays[name] for name in names}
    draft = folder / "status" / "zarr.json.partial"  # not where Zarr looks for arrays
    draft.write_text(json.dumps(root, indent=2))
    draft.replace(folder / "zarr.json")


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
        raise InvalidInput(
            'Zarr stores need the package zarr: install it with pip install "kickdyn[store]"'
        ) from None
    return zarr
