"""`Track`: measured positions of a ball over time, and how they are read from a file."""

import contextlib
import csv
import io
import math
import os
import struct
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from kickdyn.core import validation
from kickdyn.core.files import check_file, read_text
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.representation import ReprMixin, Row, ValueEquality
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import FaultyFile, InvalidInput

LEAST_SAMPLES = 5
"""Fewer positions do not determine a launch together with its standard deviations."""

LARGEST_FILE = 64_000_000
"""Bytes of a track file that is read: ten hours at 25 Hz."""

OTHER_UNITS = (
    ("millimetres", 1000.0, 0.4, 2.0),
    ("centimetres", 100.0, 0.4, 2.0),
    ("inches", 39.37, 0.4, 2.0),
    ("feet", 3.2808, 0.9, 1.1),
)
"""Units that positions may be in by mistake: name, number per metre, and by how much a ball with
drag and lift may fall slower or faster than in free fall. For feet the range is narrow, because
lift alone can make a ball fall as fast as a number in feet seems to."""

C3D_MEMORY, C3D_TIME = 2**31, 60.0
"""Memory [bytes] and processor time [s] in which a C3D file is read."""

LARGEST = 1e12
"""Largest number of a track [s, m]: larger ones are faults of a clock or of a file."""

SOUND = 340.0
"""Speed of sound [m/s], which no ball of a game reaches."""

FASTEST_BALL = 60.0
"""Speed of a kicked ball [m/s] above which other units do not explain it either."""

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""Units of C3D files [m]."""


@contextlib.contextmanager
def _long_fields() -> Iterator[None]:
    """Let the module csv read fields of any length; its default is 131,072 characters."""
    default = csv.field_size_limit(LARGEST_FILE)
    try:
        yield
    finally:
        csv.field_size_limit(default)


@dataclass(frozen=True, eq=False, repr=False)
class Track(ValueEquality, ReprMixin):
    """Measured positions of the centre of a ball.

    `track[i:j]` is the part from sample i up to, but without, sample j. The time between samples
    need not be constant: leave out the samples at which there is no measurement.

    Args:
        times: times of the samples, shape `(n,)` [s], increasing.
        positions: positions of the centre, shape `(n, 3)` [m, world frame: z up].

    Raises:
        InvalidInput: other shapes, no sample, an entry that is not finite, or times that do not
            increase.

    Example:
        >>> import kickdyn as kd
        >>> track = kd.Track([0.0, 0.1, 0.2], [(0, 0, 0), (2, 0, 0.9), (4, 0, 1.7)])
        >>> len(track), track.duration, track[1:].positions[0].tolist()
        (3, 0.2, [2.0, 0.0, 0.9])
    """

    times: Array
    positions: Array

    def __init__(self, times: ArrayLike, positions: ArrayLike) -> None:
        moments = _finite_rows("times", times)
        points = _finite_rows("positions", positions)
        if moments.ndim != 1 or not moments.size or points.shape != (moments.size, 3):
            raise InvalidInput(
                f"times has shape {moments.shape} and positions {points.shape}: they must be (n,) "
                "and (n, 3), with at least one sample"
            )
        late = np.flatnonzero(np.diff(moments) <= 0.0)
        if late.size:
            i = int(late[0])
            raise InvalidInput(
                f"times[{i + 1}] is {moments[i + 1]:.10g} s after times[{i}] of {moments[i]:.10g} "
                "s: times must increase"
            )
        object.__setattr__(self, "times", validation.read_only(moments))
        object.__setattr__(self, "positions", validation.read_only(points))

    def _rows(self) -> Iterable[Row]:
        yield "samples", len(self), ""
        yield "duration", self.duration, "s"
        if len(self) > 1:
            yield "median interval", float(np.median(np.diff(self.times))), "s"
        yield "lowest corner", self.positions.min(axis=0), "m"
        yield "highest corner", self.positions.max(axis=0), "m"

    def __len__(self) -> int:
        """Return the number of samples."""
        return int(self.times.size)

    def __getitem__(self, index: slice) -> "Track":
        """Return a part of the track.

        Raises:
            InvalidInput: an index that is no slice, or a slice without a sample.
        """
        if not isinstance(index, slice):
            raise InvalidInput(
                f"track[{index!r}]: a part of a track is a slice such as track[10:60]"
            )
        return Track(self.times[index], self.positions[index])

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.times[-1] - self.times[0])

    @classmethod
    @validation.check_arguments
    @_long_fields()
    def from_csv(
        cls, file: str | PathLike[str], columns: Sequence[str] = ("t", "x", "y", "z")
    ) -> "Track":
        """Read a track from a file of comma-separated values whose first row names the columns.

        Rows in which one of the four values is empty, missing or nan are gaps and are left out.

        Args:
            file: the file, UTF-8 text, up to 64 MB.
            columns: names of the columns with the time [s] and the three coordinates [m].

        Raises:
            FaultyFile: the file cannot be read, a column is missing, a value is not a number, or
                times do not increase; the message names the first such row.
        """
        source = str(file)
        names = list(columns)
        if len(names) != 4 or not all(isinstance(name, str) for name in names):
            raise InvalidInput(
                f"columns is {validation.brief(columns)}: it must name four columns, for "
                "time, x, y and z"
            )
        rows = csv.reader(read_text(file, source, LARGEST_FILE, FaultyFile).splitlines())
        header = [name.strip() for name in next(rows, [])]
        if any(header.count(name) != 1 for name in names):
            fault = (
                f"its first row is {validation.brief(header)}: separated by commas, it must name "
                f"{', '.join(map(repr, names))} once each; `columns` (--columns) says which are "
                "time, x, y and z"
            )
            raise FaultyFile(source, [fault])
        where = [header.index(name) for name in names]
        values: list[list[float]] = []
        for number, row in enumerate(rows, start=2):
            cells = [row[i].strip() if i < len(row) else "" for i in where]
            if "" in cells:
                continue
            try:
                numbers = [float(cell) for cell in cells]
            except ValueError:
                numbers = [math.inf]
            if any(map(math.isnan, numbers)):
                continue
            fault = ""
            if len(row) > len(header) and any(row[len(header) :]):
                fault = (
                    f"row {number} has {len(row)} cells and the first row {len(header)}: all rows "
                    "must have the same number; write decimals with a point"
                )
            elif not all(abs(value) <= LARGEST for value in numbers):
                fault = (
                    f"row {number} has {validation.brief(cells)}: all must be finite numbers up to "
                    f"{LARGEST:g}"
                )
            elif values and numbers[0] <= values[-1][0]:
                fault = (
                    f"row {number} has the time {numbers[0]:.10g} s after {values[-1][0]:.10g} s: "
                    "times must increase"
                )
            if fault:
                raise FaultyFile(source, [fault])
            values.append(numbers)
        if not values:
            raise FaultyFile(source, ["it has no row of numbers below the names of the columns"])
        table = np.array(values)
        return cls(table[:, 0], table[:, 1:])

    @classmethod
    @validation.check_arguments
    def from_c3d(cls, file: str | PathLike[str], marker: str | None = None) -> "Track":
        """Read a track from a C3D file of a motion capture system.

        Needs ezc3d, `pip install "kickdyn[c3d]"`. Frames in which the marker was not seen are gaps
        and are left out. Positions are converted to metres by the unit that the file names.

        Args:
            file: the file, up to 64 MB, with its z axis up.
            marker: label of the marker; None takes the only one of the file.

        Raises:
            FaultyFile: the file cannot be read, does not have the marker, or does not name its
                unit or its rate.
            InvalidInput: the package ezc3d is not installed.
        """
        source = str(file)
        labels, scale, rate, first_frame, data = c3d_content(file)
        if marker is None and len(labels) == 1:
            marker = labels[0]
        if marker not in labels:
            asked = f"no marker {marker!r}" if marker is not None else "several markers, name one"
            raise FaultyFile(
                source, [f"it has {asked}: its markers are {validation.brief(labels)}"]
            )
        path = scale * data[labels.index(marker)]
        seen = np.isfinite(path).all(axis=1)
        if not seen.any():
            raise FaultyFile(source, [f"the marker {marker!r} is not seen in any frame"])
        return cls((first_frame + np.flatnonzero(seen)) / rate, path[seen])


def c3d_content(file: str | PathLike[str]) -> tuple[list[str], float, float, int, Array]:
    """Return labels, unit [m], rate [Hz], first frame and positions `(markers, n, 3)` of a C3D.

    Raises `FaultyFile`, or `InvalidInput` where ezc3d is not installed.
    """
    source = str(file)
    if find_spec("ezc3d") is None:
        raise InvalidInput(
            'C3D files need the package ezc3d: install it with pip install "kickdyn[c3d]"'
        )
    check_file(file, source, LARGEST_FILE, FaultyFile)
    labels, unit, rate, first_frame, data = _c3d_content(file, source)
    if unit.lower() not in METRES or not rate > 0.0:
        fault = (
            f"its unit is {unit!r} and its rate {rate:g} Hz: the unit must be one of "
            f"{', '.join(METRES)}, the rate above 0"
        )
        raise FaultyFile(source, [fault])
    return labels, METRES[unit.lower()], rate, first_frame, data


def _c3d_content(
    file: str | PathLike[str], source: str
) -> tuple[list[str], str, float, int, Array]:
    """Return labels, unit, rate [Hz], first frame and positions `(markers, n, 3)` of a C3D file.

    A child process reads it, because on damaged files ezc3d may crash, take all memory, or never
    end. With `-P` it imports nothing from the working directory, which may come from anyone.
    """
    code = f"from {__name__} import _send_c3d; _send_c3d()"
    paths = os.pathsep.join(filter(None, sys.path))
    try:
        child = subprocess.run(
            [sys.executable, "-P", "-c", code, os.fspath(file), str(C3D_MEMORY),
             str(math.ceil(C3D_TIME))],
            capture_output=True, timeout=10.0 * C3D_TIME, check=True,
            env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        with np.load(io.BytesIO(child.stdout)) as content:
            labels, (unit,) = content["labels"].tolist(), content["unit"].tolist()
            rate, first_frame = float(content["rate"]), int(content["first"])
            np.take(content["data"], len(labels) - 1, axis=0)  # raises: fewer points than labels
            return labels, unit, rate, first_frame, np.asarray(content["data"])
    except (subprocess.SubprocessError, OSError, ValueError, LookupError, BadZipFile):
        raise FaultyFile(source, ["is not a C3D file that ezc3d can read"]) from None


def _send_c3d() -> None:
    """Write what `_c3d_content` returns to standard output; arguments: file, memory, time."""
    with contextlib.suppress(ImportError, ValueError):  # Windows has no limits
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)
    import ezc3d

    output = os.dup(1)
    os.dup2(2, 1)  # ezc3d may print
    content = ezc3d.c3d(sys.argv[1])
    if content["data"]["points"].shape[2] < _frames_of_header(sys.argv[1]):
        sys.exit("the file ends early, which ezc3d hides")
    points = content["parameters"]["POINT"]
    file = io.BytesIO()
    np.savez(
        file,
        labels=np.array([str(label).strip() for label in points["LABELS"]["value"]]),
        unit=np.array([str(points["UNITS"]["value"][0]).strip()]),
        rate=float(points["RATE"]["value"][0]),
        first=int(content["header"]["points"]["first_frame"]),
        data=np.asarray(content["data"]["points"][:3], dtype=float).transpose(1, 2, 0),
    )
    with os.fdopen(output, "wb") as stream:
        stream.write(file.getvalue())


def _frames_of_header(file: str) -> int:
    """Return the number of frames by the header of a C3D file; 65535 at most, where it is full."""
    with Path(file).open("rb") as stream:
        header = stream.read(10)
        stream.seek(512 * (header[0] - 1) + 3)
        big_endian = stream.read(1) == b"\x56"  # the processor is MIPS
    first, last = struct.unpack(">HH" if big_endian else "<HH", header[6:])
    return int(last - first + 1)


def _finite_rows(name: str, value: ArrayLike) -> Array:
    """Return an array of finite floats, or raise `InvalidInput` that names the first other row."""
    try:
        array = np.asarray(value, dtype=float)
    except (OverflowError, TypeError, ValueError):
        return validation.floats(name, value)  # which says what is wrong
    outside = np.argwhere(~(np.abs(array) <= LARGEST))  # NaN, too
    if array.ndim and outside.size:
        i = int(outside[0, 0])
        raise InvalidInput(
            f"{name}[{i}] is {array[i].tolist()}: every entry must be finite, up to {LARGEST:g}; "
            "leave out the samples at which there is no measurement"
        )
    return validation.floats(name, value)


def refuse_units(track: Track, falling: float) -> None:
    """Raise `InvalidInput` for a ball that moves as in other units than metres and seconds.

    `falling` is its acceleration downwards, by the positions [their unit per s2].
    """
    units = [
        f"{unit} ({size:g} per metre)"
        for unit, size, low, high in OTHER_UNITS
        if low < falling / (GRAVITY * size) < high
    ]
    if units:
        raise InvalidInput(
            f"the ball falls with {falling:.4g} per s2, as in {' or '.join(units)}, and not with "
            f"about {GRAVITY:g} m/s2: positions must be in metres, with z up"
        )
    steps = np.linalg.norm(np.diff(track.positions, axis=0), axis=1) / np.diff(track.times)
    speed = float(np.median(steps))
    if speed > SOUND:
        units = [unit for unit, size, *_ in OTHER_UNITS[:2] if speed < FASTEST_BALL * size]
        likely = f", as with positions in {' or '.join(units)}" if units else ""
        raise InvalidInput(
            f"the ball moves with {speed:.4g} m/s, faster than sound{likely}: positions must be in "
            "metres, times in seconds"
        )


def check_samples(track: Track) -> None:
    """Raise `InvalidInput` for few samples, or a second or more apart: no times in seconds."""
    if len(track) < LEAST_SAMPLES:
        raise InvalidInput(f"track has {len(track)} samples: at least {LEAST_SAMPLES} are needed")
    interval = float(np.median(np.diff(track.times)))
    if interval > 1.0 - 1e-9:
        raise InvalidInput(
            f"the samples are {interval:.4g} s apart, as in milliseconds or numbers of frames: "
            "times must be in seconds"
        )
