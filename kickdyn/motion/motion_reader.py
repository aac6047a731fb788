"""Tables of recorded motions, as CSV and NPZ files have them."""

import os
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np

from kickdyn.core.files import check_file, read_text
from kickdyn.core.validation import Array
from kickdyn.errors import FaultyFile, InvalidInput, shortened

LARGEST = 500_000_000
"""Size of the largest file of a motion that is read [bytes]."""

BASE_COLUMNS = 7
"""Columns of the floating base in a CSV file: its position and its quaternion."""


class MotionTable(NamedTuple):
    """What a file has of a motion.

    Attributes:
        joints: positions of the joints, shape `(k, n)`; of a CSV file, with the base before them.
        root: position and quaternion of the base, shape `(k, 7)`; None without, or in `joints`.
        quaternion: order of the quaternions in `root`; empty if the file does not say it.
        names: of the joints, or of the columns of a CSV file; empty without.
        rate: of the frames [Hz]; None without.
        t: times, shape `(k,)` [s, impact at 0]; None without.
        bodies: positions of bodies in the world, shape `(k, m, 3)` [m]; None without.
    """

    joints: Array
    root: Array | None = None
    quaternion: str = ""
    names: tuple[str, ...] = ()
    rate: float | None = None
    t: Array | None = None
    bodies: Array | None = None


def read_table(file: str | os.PathLike[str]) -> MotionTable:
    """Return the table of a file by its ending, one of `READERS`.

    Raises:
        InvalidInput: another ending.
        FaultyFile: the file cannot be read, or has no motion.
    """
    ending = Path(file).suffix.lower()
    if ending not in READERS:
        raise InvalidInput(
            f"{shortened(str(file))} has the extension {ending!r}: a motion is read from "
            f"{' and '.join(READERS)} files"
        )
    return READERS[ending](file, str(file))


def _read_csv(file: str | os.PathLike[str], source: str) -> MotionTable:
    text = read_text(file, source, LARGEST, FaultyFile)
    if not text.strip():
        raise FaultyFile(source, ["is empty"])
    head, _, _ = text.lstrip().partition("\n")
    names = tuple(word.strip().strip('"') for word in head.split(","))
    has_header = not all(map(_is_number, names))
    try:
        if "\n" not in text.strip():
            raise ValueError("a motion has several rows")
        table = np.loadtxt(StringIO(text), delimiter=",", ndmin=2, skiprows=int(has_header))
    except ValueError as error:
        raise FaultyFile(source, [f"is no table of numbers: {error}"]) from None
    if has_header and len(names) != table.shape[1]:
        counts = f"{len(names)} names in its first line and {table.shape[1]} columns"
        raise FaultyFile(source, [f"has {counts}: each column needs a name"])
    return MotionTable(_finite(table, source, ""), names=names if has_header else ())


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_npz(file: str | os.PathLike[str], source: str) -> MotionTable:
    check_file(file, source, LARGEST, FaultyFile)
    try:
        with np.load(file, allow_pickle=False) as read:
            arrays: dict[str, Any] = {name: read[name] for name in _ARRAYS if name in read.files}
    except (BadZipFile, ValueError, OSError, EOFError, AttributeError) as error:
        raise FaultyFile(source, [f"is no NPZ file of arrays: {error}"]) from None
    if "joint_pos" not in arrays:
        raise FaultyFile(source, ["has no joint_pos, the positions of the joints"])
    joints = _numbers(arrays, "joint_pos", source, (None, None))
    k = len(joints)
    fps = arrays.get("fps")
    rate = None if fps is None else _numbers({"fps": np.ravel(fps)}, "fps", source, (1,))
    t = _numbers(arrays, "time", source, (k,)) if "time" in arrays else None
    bodies = root = None
    quaternion = ""
    if "root_pos" in arrays and "root_quat_xyzw" in arrays:
        quaternion = "xyzw"
        place = _numbers(arrays, "root_pos", source, (k, None))
        root = np.hstack([place, _numbers(arrays, "root_quat_xyzw", source, (k, None))])
        root = root if root.shape[1] else None  # on a fixed base
    elif "body_pos_w" in arrays and "body_quat_w" in arrays:
        quaternion = "wxyz"
        bodies = _numbers(arrays, "body_pos_w", source, (k, None, 3))
        turns = _numbers(arrays, "body_quat_w", source, (k, None, 4))
        root = np.hstack([bodies[:, 0], turns[:, 0]])
    if root is not None and root.shape[1] != BASE_COLUMNS:
        raise FaultyFile(source, ["has no 3 and 4 columns in root_pos and root_quat_xyzw"])
    names = tuple(map(str, np.ravel(arrays.get("joint_names", ()))))
    return MotionTable(
        joints, root, quaternion, names, None if rate is None else float(rate[0]), t, bodies
    )


_ARRAYS = ("joint_pos", "joint_names", "fps", "time", "root_pos", "root_quat_xyzw",
           "body_pos_w", "body_quat_w")  # fmt: skip
"""Arrays that are read from an NPZ file."""


def _numbers(arrays: Any, name: str, source: str, shape: tuple[int | None, ...]) -> Array:
    """Return an array of finite numbers of a shape, in which None is any size."""
    array = arrays[name]
    sizes = [size if size is None else int(size) for size in shape]
    fits = array.ndim == len(shape) and all(
        size is None or size == have for size, have in zip(sizes, array.shape, strict=True)
    )
    if array.dtype.kind not in "fiu" or not fits:
        wanted = f"({', '.join('n' if size is None else str(size) for size in sizes)})"
        kind = f"{name} of shape {array.shape}, type {array.dtype}"
        raise FaultyFile(source, [f"has {kind}: it must be numbers of shape {wanted}"])
    return _finite(np.asarray(array, float), source, name)


def _finite(table: Array, source: str, name: str) -> Array:
    """Return a table; raise `FaultyFile` with row and column of an entry that is not finite."""
    faulty = np.argwhere(~np.isfinite(table))
    if len(faulty):
        row, *columns = (faulty[0] + 1).tolist()
        column = f", column {columns[-1]}" if columns else ""
        of_name = f" of {name}" if name else ""
        value = table[tuple(faulty[0])]
        fault = f"has {value} in row {row}{column}{of_name}: every number must be finite"
        raise FaultyFile(source, [fault])
    return table


READERS: dict[str, Callable[[str | os.PathLike[str], str], MotionTable]] = {
    ".csv": _read_csv,
    ".npz": _read_npz,
}
"""Readers of the formats, by the ending of the file."""
