"""The making of a library of kicks: motions at the nodes of a grid, and checks of its cells."""

import json
import math
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain, product
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from kickdyn.core.executors import STOPPED, in_order, reason_of_stop
from kickdyn.core.files import replacing
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.planning.kick_reader import AXES, FORMAT, write_kicks
from kickdyn.planning.library_motions import (
    Found,
    Kicks,
    check_between,
    described,
    first_motion,
    next_motion,
)

STEPS = {"speed": 0.04, "elevation": math.radians(2), "azimuth": math.radians(2), "x": 0.02,
         "y": 0.02}  # fmt: skip
"""Largest distances of nodes: of the speed relative to the largest one, in rad, and in m."""

ATTEMPTS, REFINEMENTS = 2, 1
"""Neighbours from which a motion is sought at most, and how often a cell that is not covered is
halved."""

MOST_NODES = 100_000
"""Motions of the largest grid, which take days."""

Key = tuple[int, ...]
"""A point of the lattice of a library: numbers of steps along the axes that have a range."""

T = TypeVar("T")


class Cell(NamedTuple):
    """A cell of the lattice: its lowest corner, and its sizes along the axes."""

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


class LibraryMaking:
    """The making of a library, whose parts are stored in a folder beside it."""

    def __init__(
        self,
        file: Path,
        kicks: Kicks,
        ranges: Mapping[str, tuple[float, ...] | None],
        executor: Executor | None,
        progress: Callable[[str, int, int], None],
    ) -> None:
        self.file, self.kicks = file, kicks
        self.executor, self.progress = executor, progress
        self.folder = file.with_name(f"{file.name}.parts")
        self.ranges = ranges
        self.lower, self.upper = np.zeros(5), np.zeros(5)
        self.nodes: dict[Key, str] = {}  # why there is no motion; empty where there is one
        self.tried: dict[Key, set[Key]] = {}  # neighbours from which a motion was sought
        self.checks: dict[str, tuple[str, list[float]]] = {}
        self.coefficients: dict[Key, Array] = {}

    def run(self) -> None:
        """Compute what is missing, and write the library."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._begin()
            self._plan_grid()
            size = (self.unit,) * len(self.counts)
            lows = product(*(range(0, count * self.unit, self.unit) for count in self.counts))
            covered, others = list[Cell](), [Cell(low, size) for low in lows]
            for number in range(REFINEMENTS + 1):
                self._check(others)
                covered += [cell for cell in others if not self._reason(cell)]
                others = [cell for cell in others if self._reason(cell)]
                if number < REFINEMENTS:
                    others = [part for cell in others for part in self._halves(cell)]
                    self._plan_midpoints(others)
            self._write([*covered, *others])
        except InvalidInput:
            with suppress(OSError):  # it is empty unless motions were planned
                self.folder.rmdir()
            raise
        except STOPPED as error:
            motions = sum(1 for reason in self.nodes.values() if not reason)
            raise Unfinished(
                f"{reason_of_stop(error)}: {motions} motions and {len(self.checks)} checks are "
                f"stored in {self.folder}; to continue, run it again"
            ) from None

    def _begin(self) -> None:
        """Plan the first motion, or read what is stored."""
        steps = STEPS | {"speed": STEPS["speed"] * (self.ranges["speed"] or (0.0, 0.0))[1]}
        steps |= {name: ends[2] for name, ends in self.ranges.items() if ends and len(ends) > 2}
        size = math.prod(1.0 + (ends[1] - ends[0]) / steps[name]
                         for name, ends in self.ranges.items() if ends)  # fmt: skip
        if size > MOST_NODES:
            raise InvalidInput(
                f"a grid of these ranges has {size:.3g} motions: it must have at most {MOST_NODES},"
                " by smaller ranges or larger steps"
            )
        robot = self.kicks.robot
        settings = json.dumps([
            self.ranges, REFINEMENTS, repr(self.kicks.ball), repr(self.kicks.contact),
            self.kicks.height, robot.name, robot.frame, robot.joint_names,
            [body.mass for body in robot.model.inertias],
        ])  # fmt: skip
        stored = self.folder / "first.npz"
        if not stored.exists():
            middle = [0.5 * sum((self.ranges[name] or (0.0, 0.0))[:2]) for name in AXES]
            kicks, point, found = first_motion(self.kicks, np.array(middle))
            if found.reason:
                raise InvalidInput(f"no motion for the middle keeps all limits: {found.reason}")
            pairs = [
                (self.ranges[name] or (at, at))[:2] for name, at in zip(AXES, point, strict=True)
            ]
            _write_arrays(stored, found.solution | {
                "settings": settings, "ranges": np.array(pairs), "point": point,
                "joints": np.array(kicks.joints), "aside": np.array([*kicks.aside], dtype=str),
                "angles": np.array([*kicks.aside.values()]), "near": kicks.near,
            })  # fmt: skip
        first = _read_arrays(stored)
        if str(first.get("settings")) != settings:
            raise InvalidInput(f"{self.folder} has parts with other settings: remove it")
        self.lower, self.upper = first["ranges"].T
        aside = dict(zip(first["aside"].tolist(), first["angles"].tolist(), strict=True))
        joints = tuple(first["joints"].tolist())
        self.kicks = replace(self.kicks, joints=joints, aside=aside, near=first["near"])
        self.pickled = pickle.dumps(self.kicks)
        self.active = np.flatnonzero(self.upper > self.lower)
        self.steps = np.array([*steps.values()])
        span = (self.upper - self.lower)[self.active]
        counts = np.ceil(span / self.steps[self.active] - 1e-9)
        self.counts = np.maximum(counts, 1).astype(int)
        self.unit = 2 ** (REFINEMENTS + 1)
        self.start = tuple(int(count // 2) * self.unit for count in self.counts)
        self._read_log()
        if self.start not in self.nodes:
            self._reach_start(first)

    def _reach_start(self, motion: dict[str, Array]) -> None:
        """Plan the motion at the start of the grid by steps from the first one."""
        first, goal = motion["point"], self._point(self.start)
        count = max(int(np.ceil((np.abs(goal - first) / self.steps).max())), 1)
        for k in range(1, count + 1):
            point = first + k / count * (goal - first)
            found = next_motion(self.pickled, point, [motion])
            if found.reason:
                place = ", ".join(f"{n} {v:.4g}" for n, v in zip(AXES, point, strict=True))
                raise InvalidInput(
                    f"no motion keeps all limits on the way to the middle of the ranges, at {place}"
                    f": {found.reason}; the ball suits this robot at x {first[3]:.3f}, "
                    f"y {first[4]:.3f} m"
                )
            motion = found.solution
        self._keep(self.start, found)

    def _point(self, key: Key) -> Array:
        """Return the values of the axes at a point of the lattice."""
        point = self.lower.copy()
        share = np.array(key) / (self.counts * self.unit)
        point[self.active] += share * (self.upper - self.lower)[self.active]
        return point

    def _plan_grid(self) -> None:
        """Plan motions next to those that there are, outward, until no more is found."""
        sizes = (self.unit,) * len(self.counts)
        grid = [*product(*(range(0, count * self.unit + 1, self.unit) for count in self.counts))]
        while True:
            tasks = []
            for key in grid:
                former = self.tried.setdefault(key, set())
                others = self._motions_near(key, sizes)
                near = [other for other in others if other not in former]
                near = near[: max(ATTEMPTS - len(former), 0)]
                if self.nodes.get(key) != "" and near:
                    former.update(near)
                    tasks.append((key, near))
            if not tasks:
                return
            self._plan(tasks, len(grid))

    def _motions_near(self, key: Key, sizes: Key) -> list[Key]:
        """Return neighbours with a motion, at distances along the axes."""
        steps = [(axis, step) for axis, size in enumerate(sizes) for step in (-size, size)]
        neighbours = (_moved(key, axis, step) for axis, step in steps)
        return [other for other in neighbours if self.nodes.get(other) == ""]

    def _plan(self, tasks: list[tuple[Key, list[Key]]], total: int) -> None:
        jobs = [
            (self._point(key), [_read_arrays(self._node_file(n)) for n in near])
            for key, near in tasks
        ]
        results = in_order(self.executor, partial(_call, next_motion, self.pickled), jobs)
        for (key, near), found in zip(tasks, results, strict=True):
            self._keep(key, found, near)
            self.progress("motions", len(self.nodes), max(total, len(self.nodes)))

    def _keep(self, key: Key, found: Found, near: Sequence[Key] = ()) -> None:
        """Store a motion that was sought from neighbours, or why there is none."""
        if not found.reason:
            _write_arrays(self._node_file(key), found.solution)
        self._log({"node": key, "reason": found.reason, "from": near})
        self.nodes[key] = found.reason

    def _node_file(self, key: Key) -> Path:
        return self.folder / f"{'_'.join(map(str, key)) or 'only'}.npz"

    def _log(self, entry: Mapping[str, Any]) -> None:
        with (self.folder / "log.jsonl").open("a") as log:
            log.write(json.dumps(entry) + "\n")

    def _read_log(self) -> None:
        """Read what was stored, and remove a last line that was cut."""
        log = self.folder / "log.jsonl"
        lines = log.read_text().splitlines(keepends=True) if log.exists() else []
        if lines and not lines[-1].endswith("\n"):
            with replacing(log) as draft:
                draft.write_text("".join(lines[:-1]))
            lines.pop()
        for line in lines:
            entry = json.loads(line)
            if "node" in entry:
                key = tuple(entry["node"])
                self.nodes[key] = entry["reason"]
                self.tried.setdefault(key, set()).update(map(tuple, entry.get("from", ())))
            else:
                self.checks[entry["check"]] = entry["reason"], entry["margins"]

    def _coefficients(self, key: Key) -> Array:
        if key not in self.coefficients:
            self.coefficients[key] = _read_arrays(self._node_file(key))["coefficients"]
        return self.coefficients[key]

    def _check(self, cells: Iterable[Cell]) -> None:
        """Check the motions between the nodes of cells that have all."""
        tasks = {}
        for cell in cells:
            if all(self.nodes.get(corner) == "" for corner in cell.corners()):
                for key, corners in cell.checked():
                    if (name := _name(key, corners)) not in self.checks:
                        tasks[name] = key, corners
        jobs = [
            (self._point(key), np.mean([self._coefficients(c) for c in corners], axis=0))
            for key, corners in tasks.values()
        ]
        results = in_order(self.executor, partial(_call, check_between, self.pickled), jobs)
        for number, (name, found) in enumerate(zip(tasks, results, strict=True), start=1):
            margins = found.margins.tolist()
            self._log({"check": name, "reason": found.reason, "margins": margins})
            self.checks[name] = found.reason, margins
            self.progress("checks", number, len(tasks))

    def _reason(self, cell: Cell) -> str:
        """Return why a cell is not covered; empty where it is."""
        of_nodes = (self.nodes.get(key, "there is no motion near it") for key in cell.corners())
        of_checks = (self.checks[_name(*checked)][0] for checked in cell.checked())
        return next(filter(None, chain(of_nodes, of_checks)), "")

    def _halves(self, cell: Cell) -> list[Cell]:
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
        return [Cell(cell.low, size), Cell(_moved(cell.low, axis, half), size)]

    def _plan_midpoints(self, cells: Iterable[Cell]) -> None:
        """Plan the motions at the corners of halves of cells, from their neighbours there."""
        tasks = {}
        for cell in cells:
            for corner in cell.corners():
                if corner not in self.nodes:
                    tasks[corner] = self._motions_near(corner, cell.size)
        self._plan([(key, near) for key, near in tasks.items() if near], len(self.nodes))

    def _write(self, cells: list[Cell]) -> None:
        """Write the library, and remove its parts."""
        names = [key for key, reason in self.nodes.items() if not reason]
        numbers = {key: k for k, key in enumerate(names)}
        arrays, labels = described(self.kicks, self._point(self.start))
        least = []
        for cell in cells:
            checks = [self.checks.get(_name(*checked)) for checked in cell.checked()]
            rows = [check[1] for check in checks if check and check[1]]
            least.append(np.min(rows, axis=0) if rows else np.full(len(labels), np.nan))
        nodes = [[numbers.get(corner, -1) for corner in cell.corners()] for cell in cells]
        lows = [self._point(cell.low) for cell in cells]
        highs = [self._point(cell.corners()[-1]) for cell in cells]
        arrays |= {
            "format": np.array(FORMAT),
            "lower": self.lower,
            "upper": self.upper,
            "coefficients": np.array([self._coefficients(key) for key in names]),
            "cell_lower": np.array(lows),
            "cell_upper": np.array(highs),
            "cell_nodes": np.array(nodes),
            "cell_reasons": np.array([self._reason(cell) for cell in cells], dtype=str),
            "cell_margins": np.array(least),
            "limits": np.array(labels),
        }  # fmt: skip
        with replacing(self.file) as draft, draft.open("wb") as out:
            write_kicks(out, arrays)
        for part in self.folder.iterdir():
            part.unlink()
        self.folder.rmdir()


def _call(function: Callable[..., T], pickled: bytes, arguments: tuple[Any, ...]) -> T:
    return function(pickled, *arguments)


def _moved(key: Key, axis: int, step: int) -> Key:
    return (*key[:axis], key[axis] + step, *key[axis + 1 :])


def _name(key: Key, corners: list[Key]) -> str:
    """Return the name of a check: the point, and between which corners it is."""
    return f"{key} {corners[0]} {corners[-1]}"


def _write_arrays(file: Path, arrays: dict[str, Any]) -> None:
    with replacing(file) as draft, draft.open("wb") as out:
        np.savez(out, **arrays)


def _read_arrays(file: Path) -> dict[str, Array]:
    with np.load(file, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}
