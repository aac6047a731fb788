"""`kick_library`: motions of a robot for a range of launches, from which any kick follows at once.

Motions are planned on a grid of launches and places of the ball, each next to that of a neighbour,
outward from the middle. Between them, motions are interpolated: in a cell of the grid, those at its
centre and at the centres of its faces must keep all limits and meet the launch by `strike`, or the
cell is halved, and at last not covered. `KickReader` has the interpolation and the exact impact.
"""

import json
import math
import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.integrate import trapezoid
from scipy.interpolate import BSpline

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.executors import STOPPED, in_order, reason_of_stop
from kickdyn.core.files import replacing
from kickdyn.core.representation import ReprMixin, Row, freeze_arrays
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.motion import Motion
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick import turn_plan
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_reader import (
    AXES,
    FORMAT,
    InterpolatedKick,
    checksum,
    read_kicks,
)
from kickdyn.planning.kick_steps import (
    check_has_drives,
    checked_contact,
    checked_leg,
    path_to_target,
)
from kickdyn.planning.launch import plan_launch
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.stance import Balance
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import StandingRobot, is_floating

STEPS = {"speed": 0.04, "elevation": math.radians(2), "azimuth": math.radians(2), "x": 0.02,
         "y": 0.02}  # fmt: skip
"""Largest distances of nodes: of the speed relative to the largest one, in rad, and in m."""

REFINEMENTS = 1
"""How often a cell that is not covered is halved."""

UNITS = {"speed": "m/s", "elevation": "rad", "azimuth": "rad", "x": "m", "y": "m"}

SAME = 1e-6
"""Difference from the only value of an axis that counts as rounding [m/s, rad, m]."""

SAMPLES = 200
"""Times at which the torques of a motion are integrated."""

AHEAD = 64
"""Tasks that are given to an executor before the first of them is computed."""

Range = float | tuple[float, float]
"""A single value of an axis, or its least and largest one."""

Progress = Callable[[str, int, int], None]
"""Is called with what is computed, `motions` or `checks`, how many there are, and of how many."""

Key = tuple[int, ...]
"""A point of the lattice of a library: numbers of steps along the axes that have a range."""

T = TypeVar("T")


@validation.check_arguments
def kick_library(
    robot: Leg,
    file: str | os.PathLike[str],
    ball: Ball | None = None,
    *,
    speed: Range | None = None,
    elevation: Range = 0.0,
    azimuth: Range = 0.0,
    x: Range | None = None,
    y: Range | None = None,
    height: float | None = None,
    contact: Contact | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> "KickLibrary":
    """Plan motions for a range of launches and places of the ball, or read those in a file.

    What is computed is stored beside the file as it comes, so that a library that was interrupted
    is continued by the same call. A file that is finished is read: without a `speed`, or with the
    ranges that it was made for.

    Args:
        robot: as for `plan_kick` with a motion.
        file: of the library, `.npz`.
        ball: at rest; None is `Ball()`.
        speed: of the launch [m/s]: a value, or the least and the largest one.
        elevation: of the launch above the ground, likewise [rad].
        azimuth: of the launch to the left of x, likewise [rad]. A standing robot can turn instead,
            as `LibraryKick.heading` says, so that one azimuth is enough.
        x: place of the ball's centre in the axes in which the robot stands, with the base above
            the origin while all joints are at 0, likewise [m]. None is the place that suits the
            middle of the ranges best.
        y: likewise, to the left.
        height: of the ball's centre [m]; None is its radius, for a robot that stands.
        contact: as for `plan_kick`, with one coefficient of restitution.
        executor: of processes or of a cluster, as for `sweep`; None computes here.
        progress: is called as motions and checks are computed.

    Raises:
        InvalidInput: a range that is none, a robot whose motions cannot be planned, or a file of
            another robot, of other ranges, or damaged.
        Unfinished: interrupted by Ctrl-C, a full disk or lost workers.
    """
    path = Path(file)
    if path.suffix != ".npz":
        raise InvalidInput(f"{path.name} has the extension {path.suffix!r}: it must be .npz")
    contact = checked_contact(contact)
    if speed is None or path.exists():
        library = KickLibrary(path, robot)
        named = {"speed": speed, "elevation": elevation, "azimuth": azimuth, "x": x, "y": y}
        if speed is not None:
            library.check_ranges(
                {name: value for name, value in named.items() if value is not None}
            )
        return library
    if not isinstance(contact.restitution, float):
        raise InvalidInput("the restitution depends on the speed: a library needs a single value")
    ball, robot = ball or Ball(), checked_leg(robot)
    check_has_drives(robot)
    ranges = {
        "speed": _checked_range("speed", speed, above=0.0),
        "elevation": _checked_range("elevation", elevation, most=math.pi / 2),
        "azimuth": _checked_range("azimuth", azimuth, most=math.pi),
        "x": None if x is None else _checked_range("x", x),
        "y": None if y is None else _checked_range("y", y),
    }
    if height is None:
        if not is_floating(robot):
            raise InvalidInput("height of the ball's centre is missing: a leg needs it")
        height = ball.radius
    from kickdyn.planning.library_motions import Kicks  # it imports CasADi

    kicks = Kicks(robot, ball, contact, height)
    making = _Making(path, kicks, ranges, executor, progress or (lambda *_: None))
    making.run()
    return KickLibrary(path, robot)


def _checked_range(
    name: str, value: Range, above: float = -math.inf, most: float = math.inf
) -> tuple[float, float]:
    """Return the least and the largest value of an axis."""
    pair = np.atleast_1d(validation.floats(name, value, unit=UNITS[name]))
    if pair.shape not in ((1,), (2,)) or pair[0] > pair[-1]:
        raise InvalidInput(
            f"{name} is {validation.brief(value)}: it must be a value, or the least and the "
            "largest one"
        )
    for each in pair:
        validation.number(name, each, above=above, unit=UNITS[name])
        if abs(each) > most:
            raise InvalidInput(
                f"{name} is {each:g} rad: at most {most:.4g} (angles are in radians)"
            )
    return float(pair[0]), float(pair[-1])


class _Cell(NamedTuple):
    """A cell of the lattice: its lowest corner, its sizes and how often each axis was halved."""

    low: Key
    size: Key

    def corners(self) -> list[Key]:
        """Return all corners, the last axis fastest."""
        ends = [(a, a + b) for a, b in zip(self.low, self.size, strict=True)]
        return list(product(*ends))

    def centre(self) -> Key:
        return tuple(a + b // 2 for a, b in zip(self.low, self.size, strict=True))

    def checked(self) -> Iterator[tuple[Key, list[Key]]]:
        """Yield the centre and those of the faces, with the corners between which they are."""
        corners, centre = self.corners(), self.centre()
        yield centre, corners
        for axis in range(len(self.low)):
            for end in (self.low[axis], self.low[axis] + self.size[axis]):
                face = [corner for corner in corners if corner[axis] == end]
                yield (*centre[:axis], end, *centre[axis + 1 :]), face


class _Making:
    """The making of a library, whose parts are stored in a folder beside it."""

    def __init__(
        self,
        file: Path,
        kicks: Any,
        ranges: Mapping[str, tuple[float, float] | None],
        executor: Executor | None,
        progress: Progress,
    ) -> None:
        self.file, self.kicks = file, kicks
        self.executor, self.progress = executor, progress
        self.folder = file.with_name(f"{file.name}.parts")
        self.ranges = ranges
        self.lower, self.upper = np.zeros(5), np.zeros(5)
        self.nodes: dict[Key, str] = {}  # why there is no motion; empty where there is one
        self.checks: dict[str, tuple[str, list[float]]] = {}
        self.coefficients: dict[Key, Array] = {}

    def run(self) -> None:
        """Compute what is missing, and write the library."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._begin()
            self._plan_grid()
            covered, others = list[_Cell](), self._cells()
            for number in range(REFINEMENTS + 1):
                self._check(others)
                covered += [cell for cell in others if not self._reason(cell)]
                others = [cell for cell in others if self._reason(cell)]
                if number < REFINEMENTS:
                    others = [part for cell in others for part in self._halves(cell)]
                    self._plan_midpoints(others)
            self._write([*covered, *others])
        except STOPPED as error:
            motions = sum(1 for reason in self.nodes.values() if not reason)
            raise Unfinished(
                f"{reason_of_stop(error)}: {motions} motions and {len(self.checks)} checks are "
                f"stored in {self.folder}; to continue, run it again"
            ) from None

    def _begin(self) -> None:
        """Plan the first motion, or read what is stored."""
        from kickdyn.planning.library_motions import first_motion

        settings = json.dumps([self.ranges, REFINEMENTS, repr(self.kicks.ball),
                               repr(self.kicks.contact), self.kicks.height])  # fmt: skip
        stored = self.folder / "settings.json"
        if stored.exists():
            former = json.loads(stored.read_text())
            if former["settings"] != settings:
                raise InvalidInput(
                    f"{self.folder} has parts of a library with other settings: remove it"
                )
            self.lower, self.upper = np.array(former["lower"]), np.array(former["upper"])
            first = np.array(former["first"])
            aside = tuple((name, value) for name, value in former["aside"])
            near = _read_arrays(self.folder / "first.npz")["near"]
            joints = tuple(former["joints"])
            self.kicks = self.kicks._replace(joints=joints, aside=aside, near=near)
        else:
            middle = [0.5 * sum(self.ranges[name] or (0.0, 0.0)) for name in AXES]
            self.kicks, first, found = first_motion(self.kicks, np.array(middle))
            if found.reason:
                raise InvalidInput(f"no motion for the middle keeps all limits: {found.reason}")
            pairs = [self.ranges[n] or (first[k], first[k]) for k, n in enumerate(AXES)]
            self.lower, self.upper = np.array(pairs).T
            np.savez(self.folder / "first.npz", near=self.kicks.near, **found.solution)
            former = {
                "settings": settings, "lower": self.lower.tolist(), "upper": self.upper.tolist(),
                "first": first.tolist(), "joints": self.kicks.joints, "aside": self.kicks.aside,
            }  # fmt: skip
            with replacing(stored) as draft:
                draft.write_text(json.dumps(former))
        self.pickled = pickle.dumps(self.kicks)
        self.active = np.flatnonzero(self.upper > self.lower)
        names = np.array(AXES)[self.active]
        span = (self.upper - self.lower)[self.active]
        steps = np.array([STEPS[n] * (self.upper[0] if n == "speed" else 1.0) for n in names])
        self.counts = np.maximum(np.ceil(span / steps - 1e-9), 1).astype(int)
        self.unit = 2 ** (REFINEMENTS + 1)
        self.start = tuple(int(count // 2) * self.unit for count in self.counts)
        self._read_log()
        if self.start not in self.nodes:
            self._reach_start(first)

    def _reach_start(self, first: Array) -> None:
        """Plan the motion at the start of the grid by steps from the first one."""
        from kickdyn.planning.library_motions import next_motion

        goal, steps = self._point(self.start), np.array([STEPS[name] for name in AXES])
        steps[0] *= self.upper[0]
        count = max(int(np.ceil((np.abs(goal - first) / steps).max())), 1)
        start = _read_arrays(self.folder / "first.npz")
        for k in range(1, count + 1):
            point = first + k / count * (goal - first)
            found = next_motion(self.pickled, point, [start])
            if found.reason:
                place = ", ".join(f"{n} {v:.4g}" for n, v in zip(AXES, point, strict=True))
                raise InvalidInput(
                    f"no motion keeps all limits on the way to the middle of the ranges, at {place}"
                    f": {found.reason}; the ball suits this robot at x {first[3]:.3f}, "
                    f"y {first[4]:.3f} m"
                )
            start = found.solution
        self._keep(self.start, found)

    def _point(self, key: Key) -> Array:
        """Return the values of the axes at a point of the lattice."""
        point = self.lower.copy()
        share = np.array(key) / (self.counts * self.unit)
        point[self.active] += share * (self.upper - self.lower)[self.active]
        return point

    def _plan_grid(self) -> None:
        """Plan motions next to those that there are, outward, until no more is found."""
        grid = {
            tuple(int(k) * self.unit for k in numbers)
            for numbers in product(*(range(count + 1) for count in self.counts))
        }
        tried: dict[Key, int] = dict.fromkeys(self.nodes, 0)
        while True:
            tasks = []
            for key in sorted(grid):
                near = [n for n in self._neighbours(key) if self.nodes.get(n) == ""]
                if self.nodes.get(key) != "" and len(near) > tried.get(key, 0):
                    tried[key] = len(near)
                    tasks.append((key, near))
            if not tasks:
                return
            self._plan(tasks, len(grid))

    def _neighbours(self, key: Key) -> Iterator[Key]:
        for axis in range(len(key)):
            for step in (-self.unit, self.unit):
                yield (*key[:axis], key[axis] + step, *key[axis + 1 :])

    def _plan(self, tasks: list[tuple[Key, list[Key]]], total: int) -> None:
        from kickdyn.planning.library_motions import next_motion

        jobs = [
            (self._point(key), [_read_arrays(self._node_file(n)) for n in near])
            for key, near in tasks
        ]
        results = self._compute(partial(_call, next_motion, self.pickled), jobs)
        for (key, _), found in zip(tasks, results, strict=True):
            self._keep(key, found)
            self.progress("motions", len(self.nodes), max(total, len(self.nodes)))

    def _compute(self, function: Callable[[Any], T], jobs: list[Any]) -> Iterator[T]:
        if self.executor is None:
            return map(function, jobs)
        return in_order(self.executor, function, jobs, AHEAD)

    def _keep(self, key: Key, found: Any) -> None:
        """Store a motion, or why there is none."""
        if not found.reason:
            with replacing(self._node_file(key)) as draft, draft.open("wb") as out:
                np.savez(out, **found.solution)
        self._log({"node": key, "reason": found.reason})
        self.nodes[key] = found.reason

    def _node_file(self, key: Key) -> Path:
        return self.folder / f"{'_'.join(map(str, key)) or 'only'}.npz"

    def _log(self, entry: Mapping[str, Any]) -> None:
        with (self.folder / "log.jsonl").open("a") as log:
            log.write(json.dumps(entry) + "\n")

    def _read_log(self) -> None:
        """Read what was stored; a last line that was cut does not count."""
        log = self.folder / "log.jsonl"
        for line in log.read_text().splitlines(keepends=True) if log.exists() else ():
            if not line.endswith("\n"):
                continue
            entry = json.loads(line)
            if "node" in entry:
                self.nodes[tuple(entry["node"])] = entry["reason"]
            else:
                self.checks[entry["check"]] = entry["reason"], entry["margins"]

    def _cells(self) -> list[_Cell]:
        size = (self.unit,) * len(self.counts)
        lows = product(*(range(0, count * self.unit, self.unit) for count in self.counts))
        return [_Cell(low, size) for low in lows]

    def _coefficients(self, key: Key) -> Array:
        if key not in self.coefficients:
            self.coefficients[key] = _read_arrays(self._node_file(key))["coefficients"]
        return self.coefficients[key]

    def _check(self, cells: Iterable[_Cell]) -> None:
        """Check the motions between the nodes of cells that have all."""
        from kickdyn.planning.library_motions import check_between

        tasks = {}
        for cell in cells:
            if all(self.nodes.get(corner) == "" for corner in cell.corners()):
                for key, corners in cell.checked():
                    name = _name(key, corners)
                    if name not in self.checks:
                        tasks[name] = key, corners
        jobs = [
            (self._point(key), np.mean([self._coefficients(c) for c in corners], axis=0))
            for key, corners in tasks.values()
        ]
        results = self._compute(partial(_call, check_between, self.pickled), jobs)
        for number, (name, found) in enumerate(zip(tasks, results, strict=True), start=1):
            margins = found.margins.tolist()
            self._log({"check": name, "reason": found.reason, "margins": margins})
            self.checks[name] = found.reason, margins
            self.progress("checks", number, len(tasks))

    def _reason(self, cell: _Cell) -> str:
        """Return why a cell is not covered; empty where it is."""
        for corner in cell.corners():
            reason = self.nodes.get(corner, "there is no motion near it")
            if reason:
                return reason
        reasons = (self.checks[_name(*checked)][0] for checked in cell.checked())
        return next((reason for reason in reasons if reason), "")

    def _halves(self, cell: _Cell) -> list[_Cell]:
        """Return both halves of a cell, along the axis along which its motions differ most."""
        known = {c: self._coefficients(c) for c in cell.corners() if self.nodes.get(c) == ""}
        changes = []
        for axis in range(len(cell.low)):
            pairs = [
                np.abs(known[high] - known[low]).max()
                for low in known
                if low[axis] == cell.low[axis]
                and (high := _moved(low, axis, cell.size[axis])) in known
            ]
            changes.append(max(pairs, default=0.0))
        if not known or not max(changes):
            return [cell]
        axis = int(np.argmax(changes))
        half = cell.size[axis] // 2
        size = (*cell.size[:axis], half, *cell.size[axis + 1 :])
        return [_Cell(cell.low, size), _Cell(_moved(cell.low, axis, half), size)]

    def _plan_midpoints(self, cells: Iterable[_Cell]) -> None:
        """Plan the motions at the corners of halves of cells, from their neighbours there."""
        tasks = {}
        for cell in cells:
            for corner in cell.corners():
                if corner in self.nodes:
                    continue
                near = [
                    other
                    for axis, size in enumerate(cell.size)
                    for step in (-size, size)
                    if self.nodes.get(other := _moved(corner, axis, step)) == ""
                ]
                tasks[corner] = near
        self._plan([(key, near) for key, near in tasks.items() if near], len(self.nodes))

    def _write(self, cells: list[_Cell]) -> None:
        """Write the library, and remove its parts."""
        from kickdyn.planning.library_motions import described

        names = [key for key, reason in self.nodes.items() if not reason]
        numbers = {key: k for k, key in enumerate(names)}
        arrays, labels = described(self.kicks, self._point(self.start))
        least = []
        for cell in cells:
            rows = [self.checks[name][1] for name in map(_named, cell.checked())
                    if name in self.checks and self.checks[name][1]]  # fmt: skip
            least.append(np.min(rows, axis=0) if rows else np.full(len(labels), np.nan))
        lows = [self._point(cell.low) for cell in cells]
        highs = [self._point(_opposite(cell)) for cell in cells]
        arrays |= {
            "format": np.array(FORMAT),
            "lower": self.lower,
            "upper": self.upper,
            "coefficients": np.array([self._coefficients(key) for key in names]),
            "cell_lower": np.array(lows),
            "cell_upper": np.array(highs),
            "cell_nodes": np.array([
                [numbers.get(corner, -1) for corner in cell.corners()] for cell in cells
            ]),
            "cell_reasons": np.array([self._reason(cell) for cell in cells], dtype=str),
            "cell_margins": np.array(least),
            "limits": np.array(labels),
        }  # fmt: skip
        with replacing(self.file) as draft, draft.open("wb") as out:
            np.savez_compressed(out, checksum=np.array(checksum(arrays)), **arrays)
        for part in self.folder.iterdir():
            part.unlink()
        self.folder.rmdir()


def _call(function: Callable[..., T], pickled: bytes, arguments: tuple[Any, ...]) -> T:
    return function(pickled, *arguments)


def _moved(key: Key, axis: int, step: int) -> Key:
    return (*key[:axis], key[axis] + step, *key[axis + 1 :])


def _opposite(cell: _Cell) -> Key:
    return tuple(a + b for a, b in zip(cell.low, cell.size, strict=True))


def _name(key: Key, corners: list[Key]) -> str:
    """Return the name of a check: the point, and between which corners it is."""
    return f"{key} {corners[0]} {corners[-1]}"


def _named(checked: tuple[Key, list[Key]]) -> str:
    return _name(*checked)


def _read_arrays(file: Path) -> dict[str, Array]:
    with np.load(file, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


class KickLibrary(ReprMixin):
    """Motions of a robot for a range of launches, see `kick_library`.

    Args:
        file: that `kick_library` has written.
        robot: that it was made for.

    Attributes:
        reader: of the file, on NumPy alone.
    """

    def __init__(self, file: str | os.PathLike[str], robot: Leg) -> None:
        try:
            self.reader = read_kicks(file)
        except FileNotFoundError:
            raise InvalidInput(f"{file} does not exist: speed is missing to make it") from None
        except ValueError as error:
            raise InvalidInput(str(error)) from None
        self.file, robot = Path(file), checked_leg(robot)
        self._standing = StandingRobot(robot) if is_floating(robot) else None
        self.robot = robot if self._standing is None else self._standing.robot
        whole = robot if self._standing is None else self._standing.leg
        a = self.reader.arrays
        masses = np.array([body.mass for body in whole.workspace.model.inertias[1:]])
        same = tuple(self.reader.joints) == whole.joint_names and np.allclose(masses, a["masses"])
        if not same:
            raise InvalidInput(
                f"{self.file.name} is a library of {a['robot']}, with "
                f"{len(self.reader.joints)} joints and {a['masses'].sum():.4g} kg: {robot.name} "
                f"has {len(whole.joint_names)} and {masses.sum():.4g} kg"
            )

    @property
    def covered(self) -> float:
        """Share of the ranges in which there are kicks."""
        a, active = self.reader.arrays, self.reader.active
        sizes = (a["cell_upper"] - a["cell_lower"])[:, active].prod(axis=1)
        return float(sizes[a["cell_reasons"] == ""].sum() / sizes.sum())

    def _rows(self) -> Iterable[Row]:
        yield "robot", str(self.reader.arrays["robot"]), ""
        for name, low, high in zip(AXES, self.reader.lower, self.reader.upper, strict=True):
            yield name, f"{low:.4g} to {high:.4g}" if high > low else f"{low:.4g}", UNITS[name]
        yield "motions", len(self.reader.arrays["coefficients"]), ""
        yield "covered share of the ranges", self.covered, ""

    def to_json(self) -> dict[str, Any]:
        """Return the ranges and the share of them that is covered."""
        a, reader = self.reader.arrays, self.reader
        pairs = zip(AXES, reader.lower.tolist(), reader.upper.tolist(), strict=True)
        return {
            "robot": str(a["robot"]),
            "ranges": {name: {"low": low, "high": high, "unit": UNITS[name]}
                       for name, low, high in pairs},
            "motions": len(a["coefficients"]),
            "covered": self.covered,
        }  # fmt: skip

    def check_ranges(self, ranges: Mapping[str, Range]) -> None:
        """Raise `InvalidInput` for ranges that are not those of the library."""
        for name, value in ranges.items():
            number, pair = AXES.index(name), np.atleast_1d(np.asarray(value, dtype=float))
            stored = self.reader.lower[number], self.reader.upper[number]
            if not np.allclose([pair[0], pair[-1]], stored):
                raise InvalidInput(
                    f"{name} is {validation.brief(value)}: {self.file.name} exists, for "
                    f"{stored[0]:.4g} to {stored[1]:.4g} {UNITS[name]}"
                )

    def kick(
        self,
        goal: Goal,
        *,
        ball_position: ArrayLike | None = None,
        air: Air | None = None,
    ) -> "LibraryKick":
        """Return the kick that meets a goal, or why there is none.

        Args:
            goal: seen from where the ball lies, in the axes in which the robot stands.
            ball_position: x and y of the ball's centre in the axes of the library, in which the
                launch has its azimuths, `(2,)` [m]. None is the middle of its ranges.
            air: of the flight to the goal; None is the vacuum.

        Raises:
            InvalidInput: a goal with spin, or a value that is no number.
        """
        if goal.spin.any() or goal.beside is not None:
            raise InvalidInput("the goal has spin: kicks of a library give the ball none")
        launch = plan_launch(goal, self._ball, air)
        reader, (vx, vy, vz) = self.reader, launch.velocity
        speed, azimuth = math.hypot(vx, vy, vz), math.atan2(vy, vx)
        heading = 0.0
        low, high = reader.lower[2], reader.upper[2]
        if self._standing is not None and not low <= azimuth <= high:
            heading, azimuth = azimuth - 0.5 * (low + high), 0.5 * (low + high)
        place = 0.5 * (reader.lower + reader.upper)[3:]
        if ball_position is not None:
            place = validation.vector("ball_position", ball_position, 2, unit="m")
        point = np.array([speed, math.asin(vz / speed), azimuth, *place])
        return self.kick_at(point, heading)

    def kick_at(self, point: Array, heading: float = 0.0) -> "LibraryKick":
        """Return the kick at speed, elevation, azimuth, x and y, `(5,)`, of a turned robot."""
        reader = self.reader
        single = (reader.upper == reader.lower) & (np.abs(point - reader.lower) <= SAME)
        point = np.where(single, reader.lower, point)
        kick = reader.kick(point)
        reason = "" if kick is not None else self._why_not(point)
        return LibraryKick(self, point, heading, reason, kick)

    def plan(
        self,
        goal: Goal,
        *,
        ball_position: ArrayLike | None = None,
        air: Air | None = None,
    ) -> KickPlan:
        """Return the plan of the `kick` that meets a goal, as `plan_kick` with a motion returns it.

        Limits are those of the motions that were checked around it. The plan serves where one of
        `plan_kick` does, as for `run_in_mujoco`.

        Raises:
            InvalidInput: as for `kick`, or there is none.
        """
        kick = self.kick(goal, ball_position=ball_position, air=air)
        motion, impact = kick.motion, kick.impact
        if motion is None or impact is None:
            raise InvalidInput(f"the library has no kick for this goal: {kick.reason}")
        launch = plan_launch(goal, self._ball, air)
        target = impact_target_for(kick.launch, np.zeros(3), impact.ball, impact.contact)
        goal = goal.at(launch.time)
        speed_use, torque_use = (
            1.0 - min(margin for name, margin in kick.margins.items() if name.startswith(kind))
            for kind in ("speed of", "torque of")
        )
        standing = self._standing
        plan = KickPlan(
            goal=goal,
            launch=launch,
            objective=KickObjective.TORQUE_SQUARED,
            value=self._torque_squared(motion),
            share=1.0,
            impact_target=target,
            impact=impact,
            path=path_to_target(impact, goal, air, None, launch.time),
            speed_use=speed_use,
            torque_use=torque_use,
            binding=(),
            ball_is_placed=True,
            heading=0.0,
            balance=None if standing is None else Balance(standing).distance(impact.posture),
            motion=motion,
        )
        return turn_plan(plan, kick.heading) if kick.heading else plan

    def _torque_squared(self, motion: Motion) -> float:
        """Return the integral of the mean squared torque of the moving joints over their limits."""
        robot = motion.robot
        columns = [robot.velocity_index(name) for name in motion.joints]
        times = np.linspace(motion.begin, motion.end, SAMPLES)
        torque = np.array([motion.torque(t)[columns] for t in times])
        return float(trapezoid(((torque / robot.effort_limit[columns]) ** 2).mean(axis=1), times))

    @cached_property
    def _ball(self) -> Ball:
        mass, radius, _ = self.reader.arrays["ball"]
        return Ball(mass=float(mass), radius=float(radius))

    def _why_not(self, point: Array) -> str:
        """Return why there is no kick at a point, and the nearest one."""
        reader = self.reader
        outside = [
            f"{name} is {value:.4g} {UNITS[name]}, outside of {low:.4g} to {high:.4g}"
            for name, value, low, high in zip(AXES, point, reader.lower, reader.upper, strict=True)
            if not low - 1e-9 <= value <= high + 1e-9
        ]
        if not outside:
            a = reader.arrays
            inside = (a["cell_lower"] <= point) & (point <= a["cell_upper"])
            numbers = np.flatnonzero(inside.all(axis=1))
            outside = [f"not covered: {a['cell_reasons'][numbers[0]]}"] if len(numbers) else []
        nearest = reader.nearest(point)
        if nearest is None:
            return "; ".join(outside)
        near = ", ".join(
            f"{name} {nearest[k]:.4g} {UNITS[name]}"
            for k, name in enumerate(AXES)
            if abs(nearest[k] - point[k]) > 1e-9
        )
        return f"{'; '.join(outside)}; the nearest kick has {near}"

    def motion_of(self, kick: InterpolatedKick) -> Motion:
        """Return the motion of the whole robot."""
        reader, a = self.reader, self.reader.arrays
        moving = a["moving"].tolist()
        before, after = (
            BSpline(a[f"{name}_knots"], a[f"{name}_matrix"] @ kick.coefficients, 3)
            for name in ("before", "after")
        )
        others = [k for k in range(len(reader.joints)) if k not in moving]
        return Motion(
            self.robot,
            tuple(reader.joints[k] for k in moving),
            before,
            after,
            None if self._standing is None else self._standing.placement,
            aside={reader.joints[k]: float(a["resting"][k]) for k in others},
            pushed={reader.joints[k]: float(kick.v_after[k]) for k in others},
        )


@dataclass(frozen=True, eq=False, repr=False)
class LibraryKick(ReprMixin):
    """A kick of a library, or why there is none.

    Attributes:
        library: that has it.
        point: speed, elevation, azimuth of the launch and place of the ball, shape `(5,)` [m/s,
            rad, m].
        heading: angle by which the robot must be turned to the left [rad].
        reason: why there is no kick, and the nearest one; empty where there is one.
        interpolated: the motion at the impact, and its margins; None without one.
    """

    library: KickLibrary = field(repr=False)
    point: Array
    heading: float
    reason: str
    interpolated: InterpolatedKick | None = field(repr=False)

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze_arrays(vars(self))

    def _rows(self) -> Iterable[Row]:
        yield "status", "met" if self.met else f"none: {self.reason}", ""
        for name, value in zip(AXES, self.point, strict=True):
            yield name, float(value), UNITS[name]
        yield "heading", self.heading, "rad"
        for unit, row in {"": "least margin", "m": "least distance", "rad": "least angle"}.items():
            margins = {name: value for name, value in self.margins.items() if _unit(name) == unit}
            if margins:
                nearest = min(margins, key=margins.__getitem__)
                yield row, f"{margins[nearest]:.4g} {unit}, {nearest.split(' [')[0]}", ""

    def to_json(self) -> dict[str, Any]:
        """Return the launch, the place of the ball and the margins."""
        return {
            "met": self.met,
            "reason": self.reason,
            **{name: float(value) for name, value in zip(AXES, self.point, strict=True)},
            "heading": self.heading,
            "margins": self.margins,
        }

    @property
    def met(self) -> bool:
        """Whether there is a kick."""
        return self.interpolated is not None

    @property
    def margins(self) -> dict[str, float]:
        """Least distance from each limit among the motions checked around it."""
        return {} if self.interpolated is None else self.interpolated.margins

    @property
    def launch(self) -> Array:
        """Velocity of the ball in the axes of the library, shape `(3,)` [m/s]."""
        speed, elevation, azimuth = self.point[:3]
        level = speed * math.cos(elevation)
        launch = level * math.cos(azimuth), level * math.sin(azimuth), speed * math.sin(elevation)
        return np.array(launch)

    @cached_property
    def motion(self) -> Motion | None:
        """The motion of the robot, in the axes of the library; None without one."""
        kick = self.interpolated
        return None if kick is None else self.library.motion_of(kick)

    @cached_property
    def impact(self) -> Impact | None:
        """The impact by `strike`; None without a motion."""
        motion, a = self.motion, self.library.reader.arrays
        if motion is None:
            return None
        contact = Contact(
            self.launch, restitution=float(a["impact"][0]), friction=float(a["impact"][1])
        )
        return strike(
            motion.robot.posture(motion.q(0.0)), motion.v(0.0), self.library._ball, contact
        )


def _unit(margin: str) -> str:
    """Return the unit in the name of a margin; empty for a share of a limit."""
    return margin.partition(" [")[2].removesuffix("]")
