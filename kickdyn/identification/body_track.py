"""`BodyTrack`: measured markers of a body, or its joint angles, over time, and their files."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from kickdyn.core import validation
from kickdyn.core.files import FileName, read_text
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.identification.track import (
    LARGEST_FILE,
    METRES,
    Track,
    c3d_content,
    find_label,
    with_gaps,
)

TRANSLATION = re.compile(r"_t[xyz](/value|/speed)?$", re.IGNORECASE)
"""End of the name of a coordinate that is a length."""


Up = StrEnum("Up", {"Y": "y", "Z": "z"})
"""Axis of a file that points up."""


@dataclass(frozen=True, eq=False, repr=False)
class BodyTrack(ReprMixin):
    """Measured markers of a body, or its joint angles, over time.

    Args:
        times: times of the frames, shape `(n,)` [s], increasing.
        markers: names of the markers.
        positions: of the markers, shape `(n, markers, 3)` [m, world frame: z up]; NaN where a
            marker is not seen.
        angles: coordinates by name, each of shape `(n,)` [rad; m], as of a file of joint angles;
            NaN where one is not known.

    Attributes:
        warnings: lines about what a file has and the track has not.

    Raises:
        InvalidInput: other shapes, infinite entries, or times that do not increase.

    Example:
        >>> import numpy as np
        >>> import kickdyn as kd
        >>> positions = np.zeros((3, 2, 3))
        >>> positions[1, 0] = np.nan  # not seen
        >>> track = kd.BodyTrack([0, 0.002, 0.004], ["knee", "ankle"], positions)
        >>> track.gaps
        {'knee': (1,)}
    """

    times: Array
    markers: tuple[str, ...]
    positions: Array
    angles: Mapping[str, Array]
    warnings: tuple[str, ...] = ()

    def __init__(
        self,
        times: ArrayLike,
        markers: Sequence[str] = (),
        positions: ArrayLike | None = None,
        *,
        angles: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        moments = validation.floats("times", times, unit="s")
        if moments.ndim != 1 or not moments.size or not (np.diff(moments) > 0.0).all():
            raise InvalidInput("times must have shape (n,), with one entry at least, and increase")
        if not isinstance(markers, list | tuple) or not all(isinstance(n, str) for n in markers):
            raise InvalidInput(f"markers is {validation.brief(markers)}: it must list names")
        names = tuple(markers)
        shape = (moments.size, len(names), 3)
        points = _with_gaps("positions", np.zeros(shape) if positions is None else positions, shape)
        coordinates = {
            name: _with_gaps(f"angle {name}", values, moments.shape)
            for name, values in validation.mapping("angles", angles).items()
        }
        vars(self).update(times=moments, markers=names, positions=points, angles=coordinates)
        for array in (moments, points, *coordinates.values()):
            array.setflags(write=False)

    def __len__(self) -> int:
        """Return the number of frames."""
        return int(self.times.size)

    @property
    def gaps(self) -> dict[str, tuple[int, ...]]:
        """Frames in which a marker is not seen, by marker; only markers that have some."""
        unseen = np.asarray(np.isnan(self.positions).any(axis=2))
        return {
            name: tuple(np.flatnonzero(unseen[:, k]).tolist())
            for k, name in enumerate(self.markers)
            if unseen[:, k].any()
        }

    @validation.check_arguments
    def find_marker(self, name: str) -> int:
        """Return the number of a marker; `RASI` finds `Anna:RASI`, if no other subject has it.

        Raises:
            InvalidInput: no marker of this name, or several with different prefixes.
        """
        return find_label(name, self.markers, "the track")

    @validation.check_arguments
    def marker_track(self, name: str, *others: str, radius: float | None = None) -> Track:
        r"""Return the track of one marker, or of the centre of a ball with several markers.

        The centre is :math:`c` with the least :math:`\sum_i (|p_i - c| - r)^2` of each frame in
        which at least four of the markers are seen.

        Args:
            name: name of the marker.
            others: further markers on the surface of the same ball, at least three.
            radius: distance of these markers from the centre of the ball [m].

        Raises:
            InvalidInput: an unknown marker or one that is never seen; several markers that are
                fewer than four, without a radius, or not on a sphere of this radius.
        """
        paths = self.positions[:, [self.find_marker(label) for label in (name, *others)]]
        if others:
            if radius is None or len(others) < 3:
                raise InvalidInput(
                    f"{1 + len(others)} markers are named: the centre of a ball needs at least "
                    "four on its surface, and their distance from it (radius=)"
                )
            size = validation.number("radius", radius, above=0.0, at_most=1.0, unit="m")
            path = np.array([_centre(frame, size) for frame in paths])
        else:
            path = paths[:, 0]
        seen = np.isfinite(path).all(axis=1)
        if not seen.any():
            raise InvalidInput(
                "no frame has four of these markers"
                if others
                else f"marker {name!r} is not seen in any frame"
            )
        return Track(self.times[seen], path[seen])

    def _rows(self) -> Iterable[Row]:
        yield "frames", len(self), ""
        yield "duration", float(self.times[-1] - self.times[0]), "s"
        yield "markers", ", ".join(self.markers) or "none", ""
        if self.angles:
            yield "angles", ", ".join(self.angles), ""
        for name, frames in self.gaps.items():
            yield f"gaps of {name}", len(frames), "frames"
        yield from warned(self.warnings)

    @classmethod
    @validation.check_arguments
    def from_c3d(cls, file: FileName, *, up: str = "z") -> "BodyTrack":
        """Read all markers of a C3D file, as `Track.from_c3d` reads one.

        Args:
            file: the file, up to 64 MB.
            up: axis of the file that points up, `y` or `z`.

        Raises:
            FaultyFile: the file cannot be read, or does not name its unit or its rate.
            InvalidInput: the package ezc3d is not installed, or another axis.
        """
        axis = validation.choice("up", up, Up)
        labels, scale, rate, first_frame, data = c3d_content(file)
        times = (first_frame + np.arange(data.shape[1])) / rate
        return cls(times, labels, _with_z_up(scale * data[: len(labels)].transpose(1, 0, 2), axis))

    @classmethod
    @validation.check_arguments
    def from_trc(cls, file: FileName, *, up: str = "y") -> "BodyTrack":
        """Read all markers of a TRC file, as OpenSim, Pose2Sim and OpenCap write it, in metres.

        Empty cells and nan are gaps. Markers without a name are left out, with a warning; so is
        one if line 3 has other numbers of markers or frames than the table.

        Args:
            file: the file, text up to 64 MB.
            up: axis of the file that points up, `y`, as OpenSim has it, or `z`.

        Raises:
            FaultyFile: the file cannot be read; the message names the line.
            InvalidInput: another axis.
        """
        axis, source = validation.choice("up", up, Up), str(file)
        lines = read_text(file, source, LARGEST_FILE, FaultyFile).splitlines()
        if not "".join(lines[:1]).lower().startswith("pathfiletype"):
            raise FaultyFile(source, ["is not a TRC file: its first word must be PathFileType"])
        if len(lines) < 5:
            raise FaultyFile(source, [f"ends after {len(lines)} lines, before its first frame"])
        units = [METRES[word] for word in lines[2].lower().split() if word in METRES]
        if not units:
            fault = f"line 3 is {validation.brief(lines[2].split())}: one of these must be the unit"
            raise FaultyFile(source, [f"{fault}, {', '.join(METRES)}"])
        cells = [name.strip() for name in _split(lines[3])[2:]]
        columns = [k for k, name in enumerate(cells) if name]
        if not columns:
            raise FaultyFile(source, ["line 4 must name the markers, after frame and time"])
        is_packed = any(k % 3 for k in columns)  # without two empty cells behind each name
        places = [*range(len(columns))] if is_packed else [k // 3 for k in columns]
        begin = 4 if lines[4].strip()[:1].isdigit() else 5
        width = 2 + 3 * (1 + places[-1])
        table = _table(source, lines, begin, width, 1, is_ragged=not is_packed)
        said = dict(zip(lines[1].lower().split(), lines[2].split(), strict=False))
        warnings = [
            f"line 3 says {said[key]} {what}, and {count} are read"
            for key, what, count in (
                ("nummarkers", "markers", len(columns)), ("numframes", "frames", len(table)),
            )
            if said.get(key, str(count)) != str(count)
        ]  # fmt: skip
        points = units[0] * with_gaps(table[:, 2:].reshape(len(table), -1, 3))
        names, positions = [cells[k] for k in columns], _with_z_up(points[:, places], axis)
        return cls(table[:, 1], names, positions)._warned(warnings)

    @classmethod
    @validation.check_arguments
    def from_mot(cls, file: FileName) -> "BodyTrack":
        """Read joint angles of a MOT file of OpenSim; angles in degrees become radians.

        A file with `inDegrees=yes`, a SIMM header or a note about degrees has degrees in all
        columns except the translations, whose names end in `_tx`, `_ty` or `_tz`, or in these
        and `/value` or `/speed`. Columns that share their name are left out, with a warning.

        Args:
            file: the file, text up to 64 MB.

        Raises:
            FaultyFile: the file cannot be read; the message names the line.
        """
        source = str(file)
        lines = read_text(file, source, LARGEST_FILE, FaultyFile).splitlines()
        ends = [i for i, line in enumerate(lines) if line.strip().lower() == "endheader"]
        if not ends:
            raise FaultyFile(source, ["is not a MOT file: it must have a line endheader"])
        header = ["".join(line.split()).lower() for line in lines[: ends[0]]]
        below = [k for k, line in enumerate(lines) if k > ends[0] and line.strip()]
        end = below[0] if below else ends[0] + 1
        names = "".join(lines[end : end + 1]).split()
        if "".join(names[:1]).lower() != "time":
            raise FaultyFile(source, [f"line {end + 1} must name the columns, time first"])
        table = _table(source, lines, end + 1, len(names), 0)
        said = [line[9:].lstrip("=:") for line in header if line.startswith("indegrees")]
        if not set(said) <= {"yes", "no"}:
            raise FaultyFile(source, [f"inDegrees is {said[0]!r}: it must be yes or no"])
        notes = ("simmmotionfileheader", "degrees")
        noted = any(note in line for line in header for note in notes)
        degrees = "yes" in said or (not said and noted)
        angles = {
            name: np.radians(column) if degrees and not TRANSLATION.search(name) else column
            for name, column in zip(names[1:], table.T[1:], strict=True)
            if names.count(name) == 1
        }
        doubled = dict.fromkeys(name for name in names if names.count(name) > 1)
        warnings = [f"{names.count(name)} columns are named {name}: left out" for name in doubled]
        return cls(table[:, 0], angles=angles)._warned(warnings)

    def _warned(self, warnings: Sequence[str]) -> "BodyTrack":
        vars(self).update(warnings=tuple(warnings))
        return self


def _with_gaps(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return an array of a shape whose entries are finite or NaN, or raise `InvalidInput`."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = validation.floats(name, value)  # which says what is wrong
    if array.shape != shape:
        raise InvalidInput(f"{name} has shape {array.shape}: it must be {shape}")
    if np.isinf(array).any():
        raise InvalidInput(f"{name} has infinite entries: they must be finite, or NaN for a gap")
    return array


def _centre(points: Array, radius: float) -> Array:
    """Return the centre of the sphere through points, `(n, 3)`; NaN if fewer than four are seen."""
    seen = points[np.isfinite(points).all(axis=1)]
    if len(seen) < 4:
        return np.full(3, np.nan)
    mean = seen.mean(axis=0)
    offsets = seen - mean
    squares = (offsets**2).sum(axis=1)
    # equal distances are linear in the centre; the radius then corrects it by Gauss-Newton steps
    centre = np.linalg.lstsq(2.0 * offsets, squares - squares.mean(), rcond=None)[0]
    for _ in range(10):  # Gauss-Newton steps
        lever = centre - offsets
        distances = np.sqrt((lever**2).sum(axis=1))
        if not distances.all():  # the markers are one point
            break
        centre = centre - np.linalg.lstsq(lever / distances[:, None], distances - radius)[0]
    misfit = float(np.abs(np.sqrt(((centre - offsets) ** 2).sum(axis=1)) - radius).max())
    # largest accepted distance of a marker from the surface of the ball, over its radius
    if not misfit <= 0.05 * radius:
        raise InvalidInput(
            f"the markers are up to {1000.0 * misfit:.3g} mm from a sphere of radius {radius:g} m: "
            "check the radius, and that all of them are on the ball and not in one plane"
        )
    return np.asarray(mean + centre)


def _with_z_up(positions: Array, up: Up) -> Array:
    return positions if up is Up.Z else positions[..., [0, 2, 1]] * (1.0, -1.0, 1.0)


def _split(line: str) -> list[str]:
    """Return the cells of a line: between tabs, or between blanks where it has no tab."""
    return line.split("\t") if "\t" in line.strip() else line.split()


def _table(
    source: str, lines: list[str], begin: int, width: int, time: int, *, is_ragged: bool = False
) -> Array:
    """Return the numbers of lines of text, shape `(n, width)`; empty cells are NaN.

    `begin` is the first of these lines, and `time` the column of the times. Only between tabs can
    cells be empty. In a ragged table, surplus cells are left out, and missing ones are empty.
    """
    rows, numbers = [], []
    for number, line in enumerate(lines[begin:], start=begin + 1):
        if not line.strip():
            continue
        cells = _split(line)
        mixed = "\t" not in line.strip() or any(len(cell.split()) > 1 for cell in cells)
        cells = line.split() if mixed else cells
        while len(cells) > width and not cells[-1].strip():
            cells.pop()
        if len(cells) != width and (mixed or not is_ragged):
            fault = f"line {number} has {len(cells)} cells: by the names of the columns, it must"
            raise FaultyFile(source, [f"{fault} have {width}, separated by tabs"])
        cells = cells[:width] + [""] * (width - len(cells))
        try:
            row = [float(cell.replace(",", ".")) if cell.strip() else math.nan for cell in cells]
        except ValueError:
            shown = validation.brief(cells)
            raise FaultyFile(source, [f"line {number} is {shown}: it must be numbers"]) from None
        rows.append(row)
        numbers.append(number)
    if not rows:
        raise FaultyFile(source, ["it has no row of numbers"])
    table = np.array(rows)
    times = table[:, time]
    before = np.append(-math.inf, times[:-1])
    late = np.flatnonzero(~(np.isfinite(times) & (times > before)))
    if late.size:
        k = int(late[0])
        fault = f"line {numbers[k]} has the time {times[k]:.10g} after {before[k]:.10g}"
        raise FaultyFile(source, [f"{fault}: times must increase"])
    return table
