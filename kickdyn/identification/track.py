"""`Track`: measured positions of a ball over time, and how they are read from a file."""

import contextlib
import csv
import io
import math
import os
import re
import struct
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.files import FileName, check_file, read_text
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.representation import ReprMixin, Row, ValueEquality, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.robot.names import unknown

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

FASTEST_BALL = 60.0
"""Speed of a kicked ball [m/s] above which other units do not explain it either."""

METRES = {
    "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "inch": 0.0254, "millimeters": 1e-3,
    "centimeters": 1e-2, "meters": 1.0,
}  # fmt: skip
"""Units of lengths in files [m]."""

UNITS = {"s": 1.0, "ms": 1e-3}, METRES, METRES, METRES
"""Units of the four columns of a track [s, m]."""

UNIT = re.compile(r"(.+?)\s*[\[(]\s*(\w+)\s*[\])]|(.+?)[_ ](mm?|m?s)", re.IGNORECASE)
"""Name and unit of a column."""

TIME = ("t", "time", "times", "timestamp")
"""Names of the column with the time, if none is asked for."""

SEPARATORS = (",", ";", "\t", None)
"""What stands between the columns of a file; None is blanks."""

MISSING = {"", "na", "n/a", "nan", "null", "none"}
"""What stands for a value that is missing, in lower case."""

MOST_TITLES = 50
"""Lines among which the names of the columns are sought."""


@dataclass(frozen=True, eq=False, repr=False)
class Track(ValueEquality, ReprMixin):
    """Measured positions of the centre of a ball.

    `track[i:j]` is the part from sample i up to, but without, sample j. The time between samples
    need not be constant: leave out the samples at which there is no measurement.

    Args:
        times: times of the samples, shape `(n,)` [s], increasing; or a table, such as a
            `pandas.DataFrame`, with columns t, x, y and z, which is read as by `from_csv`.
        positions: positions of the centre, shape `(n, 3)` [m, world frame: z up].

    Attributes:
        warnings: a line for rows of a file or a table that were taken for gaps.

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
    warnings: tuple[str, ...] = field(default=(), compare=False)

    MADE_BY: ClassVar[str] = (
        "kd.Track(table) makes one of a table with columns t, x, y, z, and kd.Track.from_csv reads "
        "a file"
    )
    """How to make a track, for the message about an argument that is none."""

    def __init__(self, times: Any, positions: ArrayLike | None = None) -> None:
        warnings: tuple[str, ...] = ()
        if positions is None:
            times, positions, warnings = _without_gaps(*_rows_of_table(times))
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
        vars(self).update(
            times=validation.read_only(moments), positions=validation.read_only(points),
            warnings=warnings,
        )  # fmt: skip

    def _rows(self) -> Iterable[Row]:
        yield "samples", len(self), ""
        yield "duration", self.duration, "s"
        if len(self) > 1:
            yield "median interval", float(np.median(np.diff(self.times))), "s"
        yield "lowest corner", self.positions.min(axis=0), "m"
        yield "highest corner", self.positions.max(axis=0), "m"
        yield from warned(self.warnings)

    def __len__(self) -> int:
        """Return the number of samples."""
        return int(self.times.size)

    def __getitem__(self, index: slice) -> "Track":
        """Return a part of the track; raise `InvalidInput` unless it is a slice with a sample."""
        if not isinstance(index, slice):
            raise InvalidInput(f"track[{index!r}]: a part of a track is a slice, track[10:60]")
        return Track(self.times[index], self.positions[index])

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.times[-1] - self.times[0])

    @classmethod
    @validation.check_arguments
    def from_csv(cls, file: FileName, columns: Sequence[str] = ("t", "x", "y", "z")) -> "Track":
        """Read a track from a file of values in columns, below a row that names the columns.

        Commas, semicolons, tabs or blanks stand between the values. Decimals may have a comma where
        no comma stands between values. Titles above the names and lines that begin with # are left
        out. Units are read behind the names, as in `t [ms]`, `x (cm)` and `y_mm`, or in a row of
        units below them.

        Rows in which one of the four values is empty, missing or nan are gaps and are left out. So
        are rows of 0, 0, 0, or of three other equal numbers from 999 on such as -9999, if no ball
        could be there; `warnings` says so.

        Args:
            file: the file, UTF-8 text, up to 64 MB.
            columns: names of the columns with the time [s] and the three coordinates [m], in upper
                or lower case; `t` may be called time, times or timestamp.

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
        lines = read_text(file, source, LARGEST_FILE, FaultyFile).splitlines()
        try:
            times, positions, warnings = _without_gaps(*_read_rows(lines, names))
        except InvalidInput as error:
            raise FaultyFile(source, error.faults) from None
        track = cls(times, positions)
        vars(track)["warnings"] = warnings
        return track

    @classmethod
    @validation.check_arguments
    def from_c3d(cls, file: FileName, marker: str | None = None) -> "Track":
        """Read a track from a C3D file of a motion capture system, in metres by its unit.

        Needs ezc3d, `pip install "kickdyn[c3d]"`. Frames without the marker are left out.

        Args:
            file: the file, up to 64 MB, with its z axis up.
            marker: label of the marker, without the prefix of its subject or with it; None takes
                the only one of the file.

        Raises:
            FaultyFile: the file cannot be read, or lacks the marker, its unit or its rate.
            InvalidInput: the package ezc3d is not installed.
        """
        source = str(file)
        labels, scale, rate, first_frame, data = c3d_content(file)
        if marker is None and len(labels) > 1:
            fault = f"it has several markers, name one: its markers are {validation.brief(labels)}"
            raise FaultyFile(source, [fault])
        try:
            number = 0 if marker is None else find_label(marker, labels, "the file")
        except InvalidInput as error:
            raise FaultyFile(source, [str(error)]) from None
        path = scale * data[number]
        seen = np.isfinite(path).all(axis=1)
        if not seen.any():
            raise FaultyFile(source, [f"the marker {labels[number]!r} is not seen in any frame"])
        return cls((first_frame + np.flatnonzero(seen)) / rate, path[seen])


def _read_rows(lines: Sequence[str], names: Sequence[str]) -> tuple[Array, list[float]]:
    """Return times and positions below the row that names their columns, `(n, 4)`, and units."""
    headers = (
        (number, separator, header, found)
        for number, line in enumerate(lines[:MOST_TITLES], start=1)
        for separator in SEPARATORS
        if (found := _find_columns(header := cells_of(line.lstrip("#% "), separator), names))
    )
    first, separator, header, columns = next(headers, (0, None, [], []))
    if not columns:
        top = lines[:MOST_TITLES]
        rows = [cells_of(line, mark) for line in top for mark in SEPARATORS]
        longest = max(rows, key=len, default=[])
        shown = next((row for row in rows if len(row) >= len(names)), longest)
        raise InvalidInput(
            f"{validation.brief(shown)} does not name the columns: between commas, semicolons, "
            f"tabs or blanks, a row must name {', '.join(map(repr, names))} once each, alone or "
            "with a unit (s, ms; mm, cm, m, in); `columns` (--columns) says which are time, x, y, z"
        )
    units, values, marks = [unit for _, unit in columns], list[list[float]](), set[str]()
    for number, line in enumerate(lines[first:], start=first + 1):
        row = cells_of(line, separator)
        cells = [row[place] if place < len(row) else "" for place, _ in columns]
        is_gap = any(x.lower().lstrip("+-") in MISSING for x in cells)
        # beginnings of lines that are comments
        if is_gap or row[0].startswith(("#", "%")):
            continue
        if number == first + 1:
            words = [cell.strip("[]()").lower() for cell in cells]
            given = [known.get(word) for word, known in zip(words, UNITS, strict=True)]
            if None not in given:
                units = [unit or 1.0 for unit in given]
                continue
        if separator != ",":
            marks |= {mark for mark in ",." if mark in "".join(cells)}
        try:
            numbers = [float(x.replace(",", ".")) for x in cells]
        except ValueError:
            numbers = [math.inf]
        fault = ""
        if len(row) > len(header) and any(row[len(header) :]):
            fault = (
                f"{len(row)} cells and the row of names {len(header)}: all rows must have the same "
                "number; write decimals with a point"
            )
        elif len(marks) > 1 or (separator == "," and any("," in x for x in cells)):
            fault = f"{validation.brief(cells)}: write all decimals of the file with a point"
        elif not all(abs(x) * unit <= LARGEST for x, unit in zip(numbers, units, strict=True)):
            fault = (
                f"{validation.brief(cells)}: all must be finite numbers up to {LARGEST:g}, times "
                "in seconds"
            )
        elif values and numbers[0] <= values[-1][0]:
            fault = f"the time {numbers[0]:.10g} after {values[-1][0]:.10g}: times must increase"
        if fault:
            raise InvalidInput(f"row {number} has {fault}")
        values.append(numbers)
    if not values:
        below = [row for line in lines[first:] if any(row := cells_of(line, separator))]
        hint = f": {validation.brief(below[0])} is not separated as the names are" if below else ""
        raise InvalidInput(f"it has no row of numbers below the names of the columns{hint}")
    return np.array(values), units


def cells_of(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line, without blanks and quotation marks around them."""
    if separator is None:
        return line.split()
    try:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:  # a field of more than 131,072 characters
        row = line.split(separator)
    return [cell.strip() for cell in row]


def _find_columns(header: Sequence[str], names: Sequence[str]) -> list[tuple[int, float]]:
    """Return place and unit of the columns for t, x, y, z; none unless each is named once."""
    found = []
    for name, units in zip(names, UNITS, strict=True):
        split = list[tuple[str, float]]()
        for cell in header:
            match = UNIT.fullmatch(cell[:100])  # the pattern takes long for thousands of blanks
            unit = (match[2] or match[4]).lower() if match else ""
            is_unit = match is not None and unit in units
            name_alone = match[1] or match[3] if match and is_unit else cell
            split.append((name_alone.casefold(), units[unit] if is_unit else 1.0))
        places = [k for k, cell in enumerate(header) if cell == name]
        meant = TIME if name == "t" else (name.casefold(),)
        places = places or [k for k, (bare, _) in enumerate(split) if bare in meant]
        if len(places) != 1:
            return []
        found.append((places[0], split[places[0]][1]))
    return found


def _rows_of_table(table: Any) -> tuple[Array, list[float]]:
    """Return times and positions of a table with columns t, x, y, z, `(n, 4)`, and their units."""
    labels = list(getattr(table, "columns", ()))
    columns = _find_columns([str(label).strip() for label in labels], ("t", "x", "y", "z"))
    if not columns:
        has = f", and not {validation.brief(labels)}" if labels else ""
        raise InvalidInput(
            "positions is missing: kd.Track takes times and positions, or one table, such as a "
            f"pandas.DataFrame, with columns t, x, y, z{has}; kd.Track.from_csv reads a file"
        )
    rows = []
    for place, _ in columns:
        values = np.asarray(table[labels[place]])
        try:
            if values.dtype.kind in "mM":
                raise InvalidInput(
                    f"column {labels[place]} has the type {values.dtype}: it must be numbers, "
                    "times in seconds"
                )
            if values.dtype.kind not in "fiuO":
                raise TypeError
            rows.append(values.astype(float))
        except (TypeError, ValueError):
            validation.floats(f"column {labels[place]}", values.tolist())
            raise
    return np.column_stack(rows), [unit for _, unit in columns]


def _without_gaps(rows: Array, units: Sequence[float]) -> tuple[Array, Array, tuple[str, ...]]:
    """Return times, positions and warnings of rows, `(n, 4)` [units, in s and m], without gaps."""
    rows = rows[~np.isnan(rows).any(axis=1)]
    if not rows.size:
        raise InvalidInput("it has no row of four numbers")
    missing, number = _missing(rows[:, 1:]), rows[:, 1]
    times, positions = units[0] * rows[:, 0], units[1:] * rows[:, 1:]
    missing &= ~_within_reach(times, positions, missing)
    if missing.all():
        raise InvalidInput("all its rows are gaps, of one number for x, y and z")
    if not missing.any():
        return times, positions, ()
    line = (
        f"{missing.sum()} rows of {number[missing][0]:g} for x, y and z are gaps, "
        f"{times[missing][0]:.10g} to {times[missing][-1]:.10g} s"
    )
    return times[~missing], positions[~missing], (line,)


def find_label(name: str, labels: Sequence[str], where: str) -> int:
    """Return the number of a marker, or raise `InvalidInput`; `RASI` finds the only `Anna:RASI`."""
    ends = [k for k, label in enumerate(labels) if label == name]
    ends = ends or [k for k, label in enumerate(labels) if label.endswith(f":{name}")]
    if len(ends) > 1:
        found = ", ".join(labels[k] for k in ends)
        raise InvalidInput(f"marker {name!r} is named {len(ends)} times in {where}: {found}")
    if not ends:
        raise InvalidInput(unknown("marker", name, where, labels))
    return ends[0]


def _missing(positions: Array) -> NDArray[np.bool_]:
    """Return which positions, `(..., 3)`, stand for missing ones: 0, 0, 0, or -9999 thrice."""
    number = positions[..., 0]
    same = (positions == number[..., None]).all(axis=-1)
    # size from which three equal coordinates stand for a measurement that is missing
    return np.asarray(same & ((number == 0.0) | (np.abs(number) >= 999.0)))


def _within_reach(times: Array, positions: Array, missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which positions a ball could reach from those before and after that are measured."""
    within, measured = np.ones(len(times), bool), np.flatnonzero(~missing)
    for rows in (measured, measured[::-1]):
        if not rows.size:
            return ~missing
        order = 1 if rows is measured else -1
        places = np.searchsorted(measured, np.arange(len(times)), "right" if order > 0 else "left")
        places = np.clip(places - (order > 0), 0, measured.size - 1)
        others = measured[places]
        distance = np.linalg.norm(positions - positions[others], axis=1)
        within &= distance <= FASTEST_BALL * np.abs(times - times[others])
    return within


def c3d_content(file: FileName) -> tuple[list[str], float, float, int, Array]:
    """Return labels, unit [m], rate [Hz], first frame and positions `(markers, n, 3)` of a C3D.

    Gaps are NaN. A child process reads the file, because on damaged ones ezc3d may crash, take all
    memory, or never end. With `-P` it imports nothing from the working directory.
    """
    source = str(file)
    validation.check_installed("ezc3d", "c3d", "C3D files")
    check_file(file, source, LARGEST_FILE, FaultyFile)
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
            data = content["data"]
    except (subprocess.SubprocessError, OSError, ValueError, LookupError, BadZipFile):
        raise FaultyFile(source, ["is not a C3D file that ezc3d can read"]) from None
    if unit.lower() not in METRES or not rate > 0.0:
        fault = (
            f"its unit is {unit!r} and its rate {rate:g} Hz: the unit must be one of "
            f"{', '.join(METRES)}, the rate above 0"
        )
        raise FaultyFile(source, [fault])
    if not labels:
        raise FaultyFile(source, ["has no markers, but analog or rotation data only"])
    return labels, METRES[unit.lower()], rate, first_frame, with_gaps(data)


def with_gaps(positions: Array) -> Array:
    """Return positions, `(..., 3)`, with NaN where a file has 0, 0, 0 or -9999, -9999, -9999."""
    return np.where(_missing(positions)[..., None], np.nan, positions)


def _send_c3d() -> None:
    """Write what `c3d_content` loads to standard output; arguments: file, memory, time."""
    with contextlib.suppress(ImportError, ValueError):  # Windows has no limits
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)
    import ezc3d

    output = os.dup(1)
    os.dup2(2, 1)  # ezc3d may print
    content, file = ezc3d.c3d(sys.argv[1]), io.BytesIO()
    _, markers, frames = content["data"]["points"].shape
    if markers and frames < _frames_of_header(sys.argv[1]):
        sys.exit("the file ends early, which ezc3d hides")
    np.savez(file, **_arrays_of(content))
    with os.fdopen(output, "wb") as stream:
        stream.write(file.getvalue())


def _arrays_of(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is read of a C3D file from the content that ezc3d gives."""
    points, data = content["parameters"]["POINT"], content["data"]["points"]
    lists = [points[key]["value"] for k in ("", *range(2, 100)) if (key := f"LABELS{k}") in points]
    labels = [str(label).strip() for labels in lists for label in labels]
    units = [str(unit).strip() for unit in points.get("UNITS", {"value": ()})["value"]]
    return {
        "labels": np.array(labels[: data.shape[1]], dtype=str),
        "unit": np.array([*units, ""][:1]),
        "rate": float(points["RATE"]["value"][0]),
        "first": int(content["header"]["points"]["first_frame"]),
        "data": np.asarray(data[:3], dtype=float).transpose(1, 2, 0),
    }


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
    """Raise `InvalidInput` for units other than m and s, by a ball that falls this fast."""
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
    if speed > 340.0:  # speed of sound [m/s], which no ball of a game reaches
        units = [unit for unit, size, *_ in OTHER_UNITS[:2] if speed < FASTEST_BALL * size]
        likely = f", as with positions in {' or '.join(units)}" if units else ""
        raise InvalidInput(
            f"the ball moves with {speed:.4g} m/s, faster than sound{likely}: positions must be in "
            "metres, times in seconds"
        )


def mean_acceleration(track: Track) -> Array:
    """Return the mean acceleration, from a parabola, shape `(3,)` [m/s2]."""
    return np.asarray(2.0 * np.polyfit(track.times - track.times[0], track.positions, 2)[0])


def doubts_of_track(track: Track, falling: float) -> tuple[str, ...]:
    """Return the warnings of a track, and a line if the ball seems to fall in yards."""
    # yards per metre: a ball in yards falls as one in metres does whose top spin adds 9 %
    if abs(falling / (GRAVITY * 1.0936) - 1.0) > 0.02:
        return track.warnings
    line = f"the ball falls with {falling:.4g} per s2, as in yards: positions must be in metres"
    return (*track.warnings, line)


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
