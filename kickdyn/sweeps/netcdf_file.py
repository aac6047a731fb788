"""Keeping a sweep: netCDF files, written whole or not at all."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import xarray as xr

from kickdyn.core.files import replacing
from kickdyn.errors import InvalidInput


def check_name(path: str | PathLike[str]) -> None:
    """Raise `InvalidInput` unless the name ends in `.nc`."""
    if Path(path).suffix != ".nc":
        raise InvalidInput(f"{path} has no known ending: datasets are written as .nc (netCDF 4)")


def save(data: xr.Dataset, path: str | PathLike[str]) -> None:
    """Write a dataset; `xarray.open_dataset` reads it back.

    Raises:
        InvalidInput: the name does not end in `.nc`, or the file cannot be written.
    """
    check_name(path)
    with replacing(path) as draft:
        data.to_netcdf(draft, engine="h5netcdf")
