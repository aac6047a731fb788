"""Writing files so that nothing half-written is ever left behind."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kickdyn.errors import InvalidInput


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise `InvalidInput` unless a file can be made at `path`; to be asked before long work."""
    file = Path(path)
    if file.is_dir():
        raise InvalidInput(f"{path} is a folder: name a file in it")
    if file.exists() and not file.is_file():  # replacing a device would remove it
        raise InvalidInput(f"{path} is not a regular file: name one, or one yet to be")
    try:
        with tempfile.TemporaryFile(dir=file.parent):
            pass
    except OSError as error:
        raise _refused(path, error) from None


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary file to write; put it at `path` when all is well, else leave no trace.

    The temporary name keeps the suffix, by which many writers choose the format.

    Raises:
        InvalidInput: the file cannot be written.
    """
    check_writable(path)
    file = Path(path).resolve()  # a link stays a link
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=f".{file.stem}-") as folder:
        draft = Path(folder) / file.name
        try:
            yield draft
            draft.replace(file)
        except OSError as error:
            raise _refused(path, error) from None


def _refused(path: str | os.PathLike[str], error: OSError) -> InvalidInput:
    return InvalidInput(f"{path} cannot be written ({error.strerror or error})")
