"""Reading files safely, and writing them so that nothing half-written is left behind."""

import json
import math
import os
import re
import stat
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kickdyn.core.validation import brief
from kickdyn.errors import FaultyFile, InvalidInput, shortened

FileName = str | os.PathLike[str]
"""The name of a file."""

MAX_TOML_BYTES = 100_000
"""Size of the largest file that `read_toml` reads [bytes]."""

MAX_TOML_DOTS = 1000
"""Dots in a line of such a file: each part of a dotted key is a table inside the previous one."""


def shipped(folder: str) -> Path:
    """Return the path of a folder that comes with kickdyn, such as `urdf` or `scenes`.

    It is inside the package in the wheel, beside it in a checkout.
    """
    package = Path(__file__).resolve().parents[1]
    packaged = package / folder
    return packaged if packaged.exists() else package.parent / folder


def check_file(path: FileName, source: str, most: int, error: type[FaultyFile]) -> None:
    """Raise `error`, which calls the file `source`, unless it is regular and of `most` bytes."""
    try:
        status = os.stat(path)  # noqa: PTH116 a path of any kind
    except (OSError, ValueError) as fault:  # ValueError: a NUL in the name
        name = os.fsdecode(path)
        if "\n" in name or name.lstrip().startswith("<"):
            hint = "this is the text of a file: save it, and give the name of the file"
            raise error(source, [hint]) from None
        if isinstance(fault, FileNotFoundError):
            raise error(source, ["there is no such file"]) from None
        raise error(source, [f"cannot be read ({_reason(fault)})"]) from None
    if not stat.S_ISREG(status.st_mode):  # a FIFO would block for ever, /dev/zero never end
        raise error(source, ["is not a regular file"])
    if status.st_size > most:
        raise error(source, [f"has {status.st_size} bytes: at most {most} are read"])


def read_text(path: FileName, source: str, most: int, error: type[FaultyFile]) -> str:
    """Return the text of a regular UTF-8 file of at most `most` bytes, or raise `error`.

    The error calls the file `source`.
    """
    check_file(path, source, most, error)
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(source, [f"is not UTF-8 text (byte {fault.start}): save it as UTF-8"]) from None
    except OSError as fault:
        raise error(source, [f"cannot be read ({_reason(fault)})"]) from None


def read_toml(
    path: FileName, source: str = "", error: type[FaultyFile] = FaultyFile
) -> dict[str, Any]:
    """Return the tables of a TOML file of at most `MAX_TOML_BYTES`, or raise `error`.

    The error calls the file `source`, without one by its path.
    """
    source = source or str(path)
    text = read_text(path, source, MAX_TOML_BYTES, error)
    if max(line.count(".") for line in text.split("\n")) > MAX_TOML_DOTS:
        raise error(source, [f"has more than {MAX_TOML_DOTS} dots in a line"])
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as fault:  # ValueError: an endless integer, too
        raise error(source, [f"is not TOML: {fault}{_line_of(text, fault)}"]) from None


def _line_of(text: str, fault: Exception) -> str:
    place = re.search(r"at line (\d+)", str(fault))
    if place is None:
        return ""
    line = brief(text.split("\n")[int(place[1]) - 1].strip())
    return (
        f": {line}; keys are written as key = value, each once in a section, text in quotes, and "
        "numbers with a decimal point"
    )


def check_writable(path: FileName) -> None:
    """Raise `InvalidInput` unless a file can be written at `path`; call it before long work.

    A symbolic link is refused: where others may write to the folder, it could lead anywhere.
    """
    name = shortened(str(path))
    if not os.fspath(path):
        raise InvalidInput("the name of a file is empty")
    try:
        mode = _mode(path)
        if stat.S_ISLNK(mode):
            raise InvalidInput(f"{name} cannot be written (it is a link: name the file itself)")
        if stat.S_ISDIR(mode):
            raise InvalidInput(f"{name} is a folder: name a file in it")
        if not stat.S_ISREG(mode):  # replacing a device would remove it
            raise InvalidInput(f"{name} is not a regular file: name a regular file or a new one")
        with tempfile.TemporaryFile(dir=Path(path).parent):
            pass
    except InvalidInput:
        raise
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise _refused(path, error) from None


def checked_ending(path: FileName, endings: Iterable[str], use: str) -> str:
    """Return the ending of a file's name in lower case; refuse one for which there is no `use`."""
    ending = Path(path).suffix.lower()
    if ending not in endings:
        name = f"{shortened(os.fspath(path))} has the extension {Path(path).suffix!r}"
        raise InvalidInput(f"{name}: {use} {', '.join(endings)}")
    return ending


def _mode(path: FileName) -> int:
    try:
        status = os.lstat(path)
    except FileNotFoundError:
        return stat.S_IFREG
    if status.st_uid != os.geteuid():  # whose permissions may not be what the user wants
        return stat.S_IFMT(status.st_mode)
    return status.st_mode


@contextmanager
def replacing(path: FileName) -> Iterator[Path]:
    """Yield a temporary file to write, which replaces `path` at the end; after an error, delete it.

    The temporary name keeps the suffix, by which many writers choose the format. A file of the user
    that exists keeps its permissions. Raises `InvalidInput` where the file cannot be written.
    """
    check_writable(path)
    file = Path(path)
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=f".{file.stem}-") as folder:
        draft = Path(folder) / file.name
        try:
            yield draft
            mode = _mode(file)
            if stat.S_ISREG(mode) and stat.S_IMODE(mode):
                draft.chmod(stat.S_IMODE(mode))
            draft.replace(file)  # the name itself, if a link has come there meanwhile
        except OSError as error:
            raise _refused(path, error) from None


def check_outputs(
    *files: FileName | None,
    json_file: str | None = None,
    inputs: Iterable[FileName | None] = (),
) -> list[str]:
    """Return which of the files exist; raise `InvalidInput` unless all can be written.

    They must differ from each other and from the inputs. None is no file, and a `json_file` of `-`
    is stdout.
    """
    named = [file for file in (None if json_file == "-" else json_file, *files) if file is not None]
    for file in named:
        check_writable(file)
    groups = (named, inputs)
    real, read = ([Path(file).resolve() for file in some if file is not None] for some in groups)
    for output in real:
        if real.count(output) > 1:
            raise InvalidInput(f"{output.name} is named for two outputs: give each its own file")
        if output in read and output.exists():
            raise InvalidInput(f"{output.name} is an input: name another file for the output")
    return [str(file) for file, path in zip(named, real, strict=True) if path.exists()]


def _refused(path: FileName, error: Exception) -> InvalidInput:
    return InvalidInput(f"{shortened(str(path))} cannot be written ({_reason(error)})")


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)  # of h5py, strerror has several lines
    return os.strerror(number) if number else " ".join(str(error).split())


def write_json(path: str, document: object) -> None:
    """Write a document as JSON, completely or not at all; `-` is stdout, NaN a `ValueError`."""
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    if path == "-":
        sys.stdout.write(text)
        return
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it.

    Records, such as named tuples, are mappings and arrays lists. A number that is not finite is
    None, which is null in JSON.
    """
    if is_dataclass(value):
        value = vars(value)
    elif isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    elif isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def attributes(value: object, names: str) -> dict[str, Any]:
    """Return attributes for JSON, by their names, which are separated by blanks."""
    return {name: plain(getattr(value, name)) for name in names.split()}
