"""Tables of recorded motions, as CSV and NPZ files have them."""

import os
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import NamedTuple
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
        source: name of the file.
        joints: positions of the joints, shape `(k, n)`; of a CSV file, with the base before them.
        root: position and quaternion of the base, shape `(k, 7)`; None without, or in `joints`.
        quaternion: order of the quaternions in `root`; empty if the file does not say it.
        names: of the joints, or of the columns of a CSV file; empty without.
        rate: of the frames [Hz]; None without.
        t: times, shape `(k,)` [s, impact at 0]; None without.
        bodies: positions of bodies in the world, shape `(k, m, 3)` [m]; None without.
    """

    source: str
    joints: Array
    root: Array | None = None
    quaternion: str = ""
    names: tuple[str, ...] = ()
    rate: float | None = None
    t: Array | None = None
    bodies: Array | None = None

    def fault(self, text: str) -> FaultyFile:
        """Return the error of a fault of the file."""
        return FaultyFile(self.source, [text])


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
    return MotionTable(source, _finite(table, source, ""), names=names if has_header else ())


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
            arrays = {name: read[name] for name in (*_SHAPES, "fps", "joint_names")
                      if name in read.files and read[name].size}  # fmt: skip
    except (BadZipFile, ValueError, OSError, EOFError, AttributeError) as error:
        raise FaultyFile(source, [f"is no NPZ file of arrays: {error}"]) from None
    if "joint_pos" not in arrays:
        raise FaultyFile(source, ["has no joint_pos, the positions of the joints"])
    names = tuple(map(str, np.ravel(arrays.pop("joint_names", ()))))
    fps = np.ravel(arrays.pop("fps", ()))
    k = len(arrays["joint_pos"])
    for name, shape in _SHAPES.items():
        array = arrays.get(name, np.zeros(0))
        fits = array.ndim == len(shape) and array.dtype.kind in "fiu" and len(array) == k
        if name in arrays and not (fits and shape[-1] in (None, array.shape[-1])):
            raise FaultyFile(source, [f"has {name} of shape {array.shape} for {k} frames"])
        arrays[name] = _finite(np.asarray(array, float), source, name)
    root, quaternion, bodies = None, "", None
    if arrays["root_pos"].size and arrays["root_quat_xyzw"].size:
        root, quaternion = np.hstack([arrays["root_pos"], arrays["root_quat_xyzw"]]), "xyzw"
    elif arrays["body_pos_w"].size and arrays["body_quat_w"].size:
        bodies, quaternion = arrays["body_pos_w"], "wxyz"
        root = np.hstack([bodies[:, 0], arrays["body_quat_w"][:, 0]])
    rate = float(fps[0]) if fps.size == 1 and fps.dtype.kind in "fiu" else None
    t = arrays["time"] if arrays["time"].size else None
    return MotionTable(source, arrays["joint_pos"], root, quaternion, names, rate, t, bodies)


_SHAPES: dict[str, tuple[int | None, ...]] = {
    "joint_pos": (None, None), "time": (None,), "root_pos": (None, 3), "root_quat_xyzw": (None, 4),
    "body_pos_w": (None, None, 3), "body_quat_w": (None, None, 4),
}  # fmt: skip
"""Arrays of numbers in an NPZ file, with their shapes; None is any size."""


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
