"""Sweeps in files: a Zarr store that is filled chunk by chunk, and netCDF files.

The variable `status` says what is computed: it is -1 (`not-computed`) until a chunk is complete,
because it is written after all other variables of the chunk. The attribute `finished` is 1 once all
chunks are. A store that was stopped at any moment is thus a valid dataset, and can be resumed.

In files, variables have 7 digits (float32); joints have all (float64). Blosc compresses a million
postures of 13 variables in 31 ms from 52 to about 31 MB; zstd leaves 3 % less in 80 ms. Every chunk
ends with a checksum (CRC-32C), so that damage is noticed when it is read.
"""

import fcntl
import glob
import io
import json
import math
import os
import shutil
import tempfile
import threading
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.files import FileName, checked_ending, replacing
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.sweeps.dataset import STATUS_ATTRIBUTES, VARIABLES, attributes_of, difference
from kickdyn.sweeps.grid import Chunks
from kickdyn.sweeps.sweep_kick import PostureStatus

CODECS = frozenset({"bytes", "blosc", "crc32c", "gzip", "transpose", "zstd"})
"""Codecs of arrays that are read. None of them runs code that a store contains."""

_BLOSC: dict[str, Any] = {"cname": "lz4", "clevel": 5}
"""How chunks are compressed, after their bytes are shuffled."""


class SweepStore:
    """A Zarr store that chunks of a sweep are written to.

    `described` has coordinates and attributes of the sweep, see `dataset.describe`; `chunk` is the
    number of postures per chunk, roughly. With `resume`, a store of the same sweep may exist.

    Attributes:
        path: the folder.
        variables: names of the variables that are kept beside `status`.
        created: whether the store is new.
        finished: whether the store was finished when it was opened.
        chunks: the division of the grid.
        size: number of postures.
    """

    def __init__(
        self,
        path: FileName,
        described: xr.Dataset,
        variables: Sequence[str],
        chunk: int,
        *,
        resume: bool,
    ) -> None:
        zarr = _zarr()
        self.path, self.variables = check_store(path, resume=resume), tuple(variables)
        self._draft_prefix, self.created = f".{self.path.name}-draft-", not self.path.exists()
        try:
            if self.created:
                shape = tuple(described.sizes[name] for name in described.dims)
                self._create(described, Chunks.of(shape, chunk))
            with open_sweep(self.path) as stored:
                if other := difference(stored, described, self.variables):
                    raise InvalidInput(f"{self.path} is of another sweep: {other}")
        except OSError as error:
            reason = error.strerror or error
            if self.created and self.path.exists():
                reason = "another process has made it meanwhile"
            raise InvalidInput(f"{path} cannot be written ({reason})") from None
        self._group: Any = zarr.open_group(self.path, mode="r+", zarr_format=3)
        self.finished = bool(self._group.attrs.get("finished"))
        self._arrays = dict(self._group.arrays())
        status = self._arrays["status"]
        self.chunks = Chunks(status.shape, status.chunks)
        self.size = math.prod(status.shape)

    def _create(self, described: xr.Dataset, chunks: Chunks) -> None:
        """Make the empty store under another name first, so that a store is complete or absent."""
        zarr = _zarr()
        folder = tempfile.mkdtemp(dir=self.path.parent, prefix=self._draft_prefix)
        draft = Path(folder) / "store"
        try:
            compressors = [
                zarr.codecs.BloscCodec(**_BLOSC, shuffle="shuffle"),
                zarr.codecs.Crc32cCodec(),
            ]
            encoding: dict[str, dict[str, Any]] = {
                str(name): {"compressors": compressors} for name in described.coords
            }
            sizes = dict(zip(described.dims, chunks.shape, strict=True))
            for name, coordinate in described.coords.items():
                if name not in sizes:  # in the chunks of the variables, as dask asks for
                    encoding[str(name)] |= {"chunks": (sizes[coordinate.dims[0]],)}
            described.to_zarr(draft, mode="w", consolidated=False, zarr_format=3, encoding=encoding)
            group: Any = zarr.open_group(draft, mode="r+")
            arrays: dict[str, tuple[str, float, dict[str, Any]]] = {
                name: ("f4", math.nan, attributes_of(name)) for name in self.variables
            }
            flags = {**STATUS_ATTRIBUTES, "flag_values": STATUS_ATTRIBUTES["flag_values"].tolist()}
            arrays["status"] = ("i1", PostureStatus.NOT_COMPUTED.flag, flags)
            for name, (dtype, fill, attributes) in arrays.items():
                group.create_array(
                    name, shape=chunks.grid_shape, chunks=chunks.shape, dtype=dtype,
                    fill_value=fill, dimension_names=list(described.dims), attributes=attributes,
                    compressors=compressors,
                )  # fmt: skip
            with warnings.catch_warnings():  # of Zarr, that other readers may not know it
                warnings.simplefilter("ignore")
                zarr.consolidate_metadata(draft)  # without it, `xr.open_zarr` warns
            draft.rename(self.path)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that are not computed yet, or damaged."""
        names = (*self.variables, "status")
        return [
            k for k in range(len(self.chunks))
            if any(_damage(self._file(name, k)) for name in names)
        ]  # fmt: skip

    def _file(self, name: str, k: int) -> Path:
        return self.path / name / "c" / "/".join(map(str, self.chunks.index(k)))

    def count(self, chunks: Iterable[int]) -> int:
        """Return the number of postures of chunks."""
        return sum(self.chunks.span(k)[1] for k in chunks)

    @property
    def computed(self) -> int:
        """Number of postures whose chunk has a status, whether or not that is damaged."""
        numbers = range(len(self.chunks))
        return self.count(k for k in numbers if self._file("status", k).exists())

    def write(self, k: int, rows: Array, status: NDArray[np.int8]) -> None:
        """Write chunk `k`: its variables first, and then its status, each file whole or not.

        The files are as Zarr would write them, which takes twice as long.
        """
        from google_crc32c import value as checksum
        from numcodecs.blosc import SHUFFLE, Blosc

        shape = tuple(axis.stop - axis.start for axis in self.chunks.region(k))
        by_name = dict(zip((*VARIABLES, "status"), (*rows, status), strict=True))
        for name in (*self.variables, "status"):
            array = self._arrays[name]
            block = np.full(array.chunks, array.fill_value, array.dtype)  # files have whole chunks
            block[tuple(map(slice, shape))] = by_name[name].reshape(shape)
            content = Blosc(**_BLOSC, shuffle=SHUFFLE).encode(block)
            file = self._file(name, k)
            if self.path.resolve() not in file.resolve().parents:
                raise InvalidInput(f"{self.path} cannot be written (a folder in it is a link)")
            file.parent.mkdir(parents=True, exist_ok=True)
            draft = file.with_name(f"{file.name}.{os.getpid()}-{threading.get_ident()}.partial")
            draft.write_bytes(content + checksum(content).to_bytes(4, "little"))
            draft.replace(file)

    def finish(self) -> None:
        """Record that every chunk is computed; remove files of killed processes."""
        for file in self.path.rglob("*.partial"):
            file.unlink()
        for draft in self.path.parent.glob(f"{glob.escape(self._draft_prefix)}*"):
            shutil.rmtree(draft, ignore_errors=True)
        self._group.attrs["finished"] = 1

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


def check_store(path: FileName, *, resume: bool) -> Path:
    """Return the path of a store to write; raise `InvalidInput` where it cannot be one.

    With `resume` the store may exist.
    """
    store = _checked_path(path)
    if store.is_symlink():
        raise InvalidInput(f"{path} cannot be written (it is a link: name the folder itself)")
    if store.exists() and not resume:
        raise InvalidInput(
            f"{path} exists and is not replaced: add --resume (resume=True in Python) to compute "
            "what is missing in it, remove it, or name another"
        )
    if not store.parent.is_dir():  # Zarr would make all missing folders
        raise InvalidInput(f"{path} cannot be written (its folder does not exist)")
    return store


@validation.check_arguments
def open_sweep(path: FileName) -> xr.Dataset:
    """Open a sweep from a file: a Zarr store, finished or not, or a netCDF file.

    Args:
        path: the folder or file.

    Returns:
        The dataset that `kickdyn.sweep` describes. The values of a store are read when they are
        asked for. With dask installed, `.chunk()` makes xarray compute on a store larger than
        memory.

    Raises:
        InvalidInput: there is no such file, it is not a sweep, or it is damaged; also where the
            values of a damaged chunk of a store are read.
    """
    file = _checked_path(path)
    if not file.exists():
        raise InvalidInput(f"{path}: there is no such sweep")
    try:
        data: xr.Dataset
        if file.is_dir():
            _zarr()
            store = _checked_store()(file, read_only=True)
            store.checked = _checked_arrays(file)
            data = xr.open_zarr(store, consolidated=False, chunks=None, zarr_format=3)
        else:
            data = xr.load_dataset(file, engine="h5netcdf")  # all of it, with any damage
    except InvalidInput:
        raise
    except Exception as error:  # h5py and zarr have many kinds for a damaged file
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise InvalidInput(f"{path} cannot be read as a sweep ({reason})") from None
    if "status" not in data or "finished" not in data.attrs:
        raise InvalidInput(f"{path} is not a sweep: it has no status")
    ordered = data[[*(name for name in VARIABLES if name in data), "status"]]
    ordered.set_close(data.close)
    return ordered


def _checked_arrays(folder: Path) -> frozenset[str]:
    """Return the names of the arrays of a store whose chunks end with a checksum.

    Raises `InvalidInput` for another format than Zarr's third, of which a codec may run code that
    the store contains, and for codecs that a sweep does not need.
    """
    if not (folder / "zarr.json").is_file():
        raise InvalidInput(f"{folder} cannot be read as a sweep (it has no zarr.json, of Zarr 3)")
    checked = set()
    for file in folder.glob("*/zarr.json"):
        codecs = {codec["name"] for codec in json.loads(file.read_bytes())["codecs"]}
        if unknown := codecs - CODECS:
            names = ", ".join(sorted(map(repr, unknown)))
            raise InvalidInput(f"{folder} is refused: {file.parent.name} has the codec {names}")
        if "crc32c" in codecs:
            checked.add(file.parent.name)
    return frozenset(checked)


@cache
def _checked_store() -> Any:
    """Return the class of stores that name the chunk which is damaged or missing."""
    from zarr.storage import LocalStore

    class CheckedStore(LocalStore):
        checked: frozenset[str]

        async def get(self, key: str, *args: Any, **how: Any) -> Any:
            name, _, index = key.partition("/c/")
            if index and name in self.checked:
                damage = _damage(self.root / key)
                if damage == MISSING and not (self.root / "status" / "c" / index).exists():
                    damage = ""  # not computed yet
                if damage:
                    repair = "compute it again with --resume (resume=True in Python)"
                    if name not in (*VARIABLES, "status"):  # a coordinate
                        repair = "only the whole sweep, computed anew, replaces it"
                    raise InvalidInput(f"{self.root}: chunk {key} {damage}: {repair}")
            return await super().get(key, *args, **how)

    return CheckedStore


MISSING = "is missing"


def _damage(file: Path) -> str:
    """Return the damage of a chunk's file, which ends with a checksum, or nothing."""
    from google_crc32c import value as checksum

    try:
        content = file.read_bytes()
    except FileNotFoundError:
        return MISSING
    stored = int.from_bytes(content[-4:], "little")
    return "" if len(content) > 4 and checksum(content[:-4]) == stored else "is damaged"


def check_netcdf_name(path: FileName) -> None:
    """Raise `InvalidInput` unless the name ends in `.nc`."""
    checked_ending(path, (".nc",), "a sweep is written as .zarr (a store) or, as netCDF 4,")


def save_netcdf(data: xr.Dataset, path: FileName) -> None:
    """Write a dataset as netCDF 4, which `open_sweep` reads, or raise `InvalidInput`."""
    check_netcdf_name(path)
    how = {"dtype": "f4", "zlib": True, "complevel": 1, "shuffle": True, "fletcher32": True}
    encoding = {name: how for name in VARIABLES if name in data}
    with replacing(path) as draft:
        file = io.BytesIO()  # HDF5 itself crashes where the disk is full
        data.to_netcdf(file, engine="h5netcdf", encoding=encoding)
        # Not getbuffer(): a view that an error keeps crashes Python 3.12.1 when it is collected.
        draft.write_bytes(file.getvalue())


def _checked_path(path: FileName) -> Path:
    if "\0" in str(path):
        raise InvalidInput(f"path is {path!r}: it must be the name of a folder or file")
    try:
        Path(path).exists()
    except OSError as error:  # a name that is too long
        raise InvalidInput(f"{path} cannot be read or written ({error.strerror})") from None
    return Path(path)


def _zarr() -> Any:
    validation.check_installed("zarr", "store", "Zarr stores")
    return import_module("zarr")
