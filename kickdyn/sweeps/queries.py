"""Questions to the dataset of a sweep that xarray does not answer by itself, and its summary.

Everything else is left to xarray: `data.ball_speed.where(possible(data)).max(("hip", "ankle"))` is
the best ball speed for each angle of the knee. `blocks` reads a dataset larger than memory.
"""

import ast
import math
import operator
from collections.abc import Callable, Collection, Iterator
from functools import reduce
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import VARIABLES, with_variables
from kickdyn.sweeps.grid import DECIMALS, Chunks, Grid
from kickdyn.sweeps.sweep_kick import Kick, PostureOutcome, PostureStatus, kick_from

BLOCK = 1_000_000
"""Postures of a block, roughly, where the dataset is not stored in chunks."""

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: operator.invert,
    ast.And: operator.and_, ast.Or: operator.or_,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip
_LANGUAGE = "comparisons (< <= > >= == !=) of names and numbers (+ - * /), and, or, not, ( )"


def possible(data: xr.Dataset) -> xr.DataArray:
    """Return a boolean array, true where the leg can kick so: the status is `ok`."""
    return data["status"] == PostureStatus.OK.flag


def condition(data: xr.Dataset, text: str) -> xr.DataArray:
    """Return a boolean array, true where postures fulfil a condition, such as `20 < knee < 30`.

    The text is parsed, never run: it consists of joints and variables, numbers, `+ - * /`,
    comparisons, `and`, `or`, `not` and brackets. A name that Python would not take stands in
    quotes. Angles are in degrees, lengths in metres. nan fulfils no comparison but `!=`.

    Returns:
        A boolean array over dimensions of the dataset.

    Raises:
        InvalidInput: anything else in the text, or an unknown name.
    """
    if not isinstance(text, str) or len(text) > 1000:
        raise InvalidInput(f"a condition is text of up to 1000 characters, not {str(text)[:40]!r}")
    try:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            result = xr.DataArray(_evaluate(ast.parse(text.strip(), mode="eval").body, data))
    except InvalidInput as error:
        raise InvalidInput(f"condition {text[:100]!r} {error}") from None
    except (
        SyntaxError, ValueError, TypeError, LookupError, ArithmeticError, RecursionError,
        MemoryError,
    ):  # fmt: skip
        raise InvalidInput(
            f"condition {text[:100]!r} cannot be read: it consists of {_LANGUAGE}"
        ) from None
    if result.dtype != bool:
        raise InvalidInput(f"condition {text[:100]!r} is a number: compare it, as ball_speed > 1")
    return result


def _evaluate(node: ast.AST, data: xr.Dataset) -> Any:
    """Return the value of a node of a condition: an array over postures, or a scalar."""
    match node:
        case ast.Name(id=name) | ast.Constant(value=str() as name):
            return _column(data, name)
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](_evaluate(operand, data))
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_evaluate(left, data), _evaluate(right, data))
        case ast.BoolOp(op=op, values=values):
            return reduce(_OPERATORS[type(op)], (_evaluate(value, data) for value in values))
        case ast.Compare(left=left, ops=ops, comparators=rest):
            terms = [_evaluate(term, data) for term in (left, *rest)]
            pairs = zip(ops, terms, terms[1:], strict=False)
            return reduce(operator.and_, (_OPERATORS[type(op)](a, b) for op, a, b in pairs))
    raise InvalidInput(f"has {ast.unparse(node)[:40]!r} in it: it consists of {_LANGUAGE}")


def _column(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return a joint or variable of a dataset by its name, angles in degrees."""
    joints = list(map(str, data.coords))
    joints = [joint for joint in joints if not (joint.endswith("_deg") and joint[:-4] in joints)]
    names = [*joints, *(variable for variable in VARIABLES if variable in data)]
    if name not in names:
        choices = ", ".join(f"{entry} [{shown_unit(data, entry)}]" for entry in names)
        reason = "which this sweep does not keep" if name in VARIABLES else "which is unknown"
        raise InvalidInput(f"names {name!r}, {reason}: there are {choices}")
    return shown(data, name)


def shown(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return a joint or variable in the unit in which it is shown."""
    if shown_unit(data, name) != "deg":
        return data[name]
    degrees = xr.DataArray(np.degrees(data[name]))
    return degrees if name in VARIABLES else degrees.round(DECIMALS) + 0.0  # no -0


def shown_unit(data: xr.Dataset, name: str) -> str:
    """Return the unit in which a joint or variable is shown: degrees for radians, else its own."""
    unit = str(data[name].attrs.get("units") or VARIABLES.get(name, ("",))[0])
    return "deg" if unit == "rad" else unit


def blocks(data: xr.Dataset) -> Iterator[tuple[int, xr.Dataset]]:
    """Cut a dataset into blocks that fit in memory, as its store is cut.

    Each comes with the number of its first posture.
    """
    status = data["status"]
    stored = status.encoding.get("chunks")
    size = math.prod(stored) if stored else BLOCK
    chunks = Chunks.of(status.shape, size)  # of a whole store, its own chunks
    for k in range(len(chunks)):
        region = dict(zip(status.dims, chunks.region(k), strict=True))
        yield chunks.span(k)[0], data.isel(region)


def pareto_front(
    data: xr.Dataset,
    more: str = "ball_speed",
    less: str = "worst_joint_impulse",
    where: str | None = None,
) -> xr.Dataset:
    """Return the postures that no other beats in both of two variables, along `posture`.

    Args:
        data: the dataset, of any size; postures count where their status is `ok`.
        more: variable of which more is better.
        less: variable of which less is better.
        where: condition that postures must fulfil.

    Returns:
        All variables of the postures on the front, the largest `more` first. Of equal postures the
        first is on the front.

    Raises:
        InvalidInput: an unknown variable or a condition that cannot be read.
    """
    points = np.empty((0, 3))
    for start, block in blocks(data):
        chosen = chosen_postures(block, where)
        columns = [_column(block, name).values.ravel()[chosen] for name in (more, less)]
        points = front_of(np.vstack([points, np.column_stack([*columns, start + chosen])]))
    places = np.unravel_index(points[:, 2].astype(np.int64), data["status"].shape)
    dims = zip(data["status"].dims, places, strict=True)
    return data.isel({name: ("posture", i) for name, i in dims}).load()


def chosen_postures(block: xr.Dataset, where: str | None = None) -> NDArray[np.intp]:
    """Return the places in a block of postures whose status is `ok` and that fulfil a condition."""
    chosen = possible(block)
    if where is not None:
        chosen = (chosen & condition(block, where)).transpose(*block["status"].dims)
    return np.flatnonzero(chosen.values)


def front_of(points: Array) -> Array:
    """Return the rows (more, less, number) that no other beats in both, the most first."""
    if not len(points):
        return points
    low, high = points[:, 0].min(), points[:, 0].max()
    bins = ((points[:, 0] - low) * (255 / max(high - low, 1e-300))).astype(np.int64)
    least = np.full(257, np.inf)  # sorting all would take longest: most are beaten by faster bins
    np.minimum.at(least, bins, points[:, 1])
    rival = np.minimum.accumulate(least[::-1])[::-1]
    points = points[points[:, 1] < rival[bins + 1]]
    ordered = points[np.lexsort((points[:, 2], points[:, 1], -points[:, 0]))]
    lightest = np.minimum.accumulate(ordered[:, 1])
    efficient = np.concatenate([[True], lightest[1:] < lightest[:-1]])
    return np.asarray(ordered[efficient])


def outcome_at(leg: Leg, kick: Kick, posture: xr.Dataset) -> PostureOutcome:
    """Return the impact of one posture of a dataset, with its joint impulses and its flight.

    Each joint of the posture is a coordinate without dimension, as after
    `data.isel(hip=3, knee=0)` or `pareto_front(data).isel(posture=0)`.
    """
    joints = [name for name in leg.joint_names if name in posture.coords]
    alone = Grid({name: np.array([float(posture[name])]) for name in joints})
    return kick_from(leg.posture(alone.configuration(leg, 0)), kick)


KEPT_POSTURES = 10
"""Postures of highest ball speed that are kept."""

SAMPLE_SIZE = 4000
"""Postures of the random sample."""

T = TypeVar("T")

NEEDED = ("ball_speed", "worst_joint_impulse", "speed_use")
"""Variables that a summary is made from."""

BINS = 200
"""Values of a joint that a map distinguishes; of more, neighbours go together."""


class Summary:
    """Reduces a sweep chunk by chunk; memory does not grow with the grid.

    `counts` and `residual` are of all computed postures; all else is of those whose status is `ok`
    and that fulfil the condition. A posture is a row: ball speed [m/s], largest impulse in a joint
    [N s], number in the grid.

    Args:
        described: coordinates and attributes of the sweep, see `dataset.describe`.
        where: a condition, see `queries.condition`.
        kept: the variables of the sweep, `NEEDED` among them.

    Attributes:
        axes: values of each joint, shape `(k,)` [deg; m].
        units: unit of each joint.
        counts: number of postures by status.
        residual: largest residual of restitution and momentum; nan without any impact.
        chosen: number of postures that count.
        best: the `KEPT_POSTURES` postures of highest ball speed, the fastest first, shape `(n, 3)`.
        worst: number of the posture of lowest ball speed, -1 without any.
        front: postures that no other beats in speed and impulse, the fastest first, `(n, 3)`.
        sample: impulse in a joint, ball speed and speed use of `SAMPLE_SIZE` random postures,
            `(n, 3)`.
        maps: the highest ball speed over pairs of the three joints with most values, or over the
            one joint there is, by the names of the joints.

    Raises:
        InvalidInput: a condition that cannot be read, or variables that do not suffice.
    """

    def __init__(
        self,
        described: xr.Dataset,
        where: str | None = None,
        kept: Collection[str] = tuple(VARIABLES),
    ) -> None:
        for name in NEEDED:
            if name not in kept:
                raise InvalidInput(f"the sweep does not keep {name}: its summary needs it")
        ordered = described["status"].dims if "status" in described else described.dims
        joints = [str(name) for name in ordered]
        self.axes = {name: shown(described, name).values for name in joints}
        self.units = {name: shown_unit(described, name) for name in joints}
        self.attributes, self.where = dict(described.attrs), where
        self.counts = {status.value: 0 for status in PostureStatus}
        self.residual, self.chosen, self.worst = math.nan, 0, -1
        self.best, self.front, self.sample = (np.empty((0, 3)) for _ in range(3))
        self._lowest, self._draws = math.inf, np.empty(0)
        self._random = np.random.default_rng(0)
        varied = [name for name in joints if len(self.axes[name]) > 1]
        longest = sorted(varied, key=lambda name: -len(self.axes[name]))[:3]
        pairs = list(combinations([name for name in varied if name in longest], 2))
        over: list[tuple[str, ...]] = [*pairs] or [tuple([*varied, *joints][:1])]
        self.maps = {names: SpeedMap(self.axes, names) for names in over}
        if where is not None:  # refuse what cannot be read before any posture is computed
            corner = described.isel({name: slice(0, 1) for name in joints})
            rows, status = np.ones((len(VARIABLES), 1)), np.zeros(1, np.int8)
            condition(with_variables(corner, rows, status, kept), where)

    @property
    def postures(self) -> int:
        """Number of postures that are computed."""
        return sum(self.counts.values()) - self.counts[PostureStatus.NOT_COMPUTED]

    def add(self, block: xr.Dataset) -> None:
        """Add the next postures, in the order of the grid."""
        begin = sum(self.counts.values())
        numbers = np.bincount(block["status"].values.ravel() + 1, minlength=len(PostureStatus))
        for status in PostureStatus:
            self.counts[status.value] += int(numbers[status.flag + 1])
        for name in {"restitution_residual", "momentum_residual"} & set(block.data_vars):
            largest = np.fmax.reduce(block[name].values, axis=None)
            self.residual = float(np.fmax(self.residual, largest))
        places = chosen_postures(block, self.where)
        self.chosen += places.size
        if not places.size:
            return
        speed, load, use = (block[name].values.ravel()[places] for name in NEEDED)
        slowest = int(speed.argmin())
        if speed[slowest] < self._lowest:
            self._lowest, self.worst = float(speed[slowest]), begin + int(places[slowest])
        points = np.column_stack([speed, load, begin + places])
        self.front = front_of(np.vstack([self.front, points]))
        few = min(KEPT_POSTURES, speed.size)
        fast = np.vstack([self.best, points[speed >= np.partition(speed, -few)[-few]]])
        self.best = fast[np.argsort(-fast[:, 0], kind="stable")[:KEPT_POSTURES]]
        draws = np.append(self._draws, self._random.random(len(load)))
        smallest = np.argsort(draws)[:SAMPLE_SIZE]  # the smallest of all draws so far
        rows = np.vstack([self.sample, np.column_stack([load, speed, use])])
        self._draws, self.sample = draws[smallest], rows[smallest]
        speeds = np.full(block["status"].shape, np.nan)
        speeds.reshape(-1)[places] = speed
        start = np.unravel_index(begin, [len(axis) for axis in self.axes.values()])
        for speed_map in self.maps.values():
            speed_map.add(dict(zip(self.axes, start, strict=True)), speeds)

    def as_json(self) -> dict[str, Any]:
        """Return the best postures and the front: joints, ball speed and impulse as lists."""
        entries = {}
        for name, rows in (("best", self.best), ("front", self.front)):
            shape = [len(axis) for axis in self.axes.values()]
            index = np.unravel_index(rows[:, 2].astype(np.int64), shape)
            angles = zip(self.axes.items(), index, strict=True)
            values = {joint: axis[i].tolist() for (joint, axis), i in angles}
            entries[name] = {
                **joint_values_by_unit(values, self.units),
                "ball_speed": rows[:, 0].tolist(),
                "worst_joint_impulse": rows[:, 1].tolist(),
            }
        return entries


def joint_values_by_unit(values: dict[str, T], units: dict[str, str]) -> dict[str, dict[str, T]]:
    """Return joint values as JSON has them: `angles_deg`, and `positions_m` of prismatic joints."""
    kinds = {name: "positions_m" if unit == "m" else "angles_deg" for name, unit in units.items()}
    return {
        kind: {name: value for name, value in values.items() if kinds[name] == kind}
        for kind in sorted(set(kinds.values()))
    }


class SpeedMap:
    """The highest ball speed for each value of one or two joints.

    At most `BINS` values of each joint are distinguished.

    Attributes:
        values: of each joint, or their means where neighbours go together.
        best: highest ball speed [m/s], one axis per joint, nan where there is no posture.
    """

    def __init__(self, axes: dict[str, Array], over: tuple[str, ...]) -> None:
        self._kept = [name in over for name in axes]
        self._bin_of = {
            name: np.arange(len(axes[name])) * min(BINS, len(axes[name])) // len(axes[name])
            for name in over
        }
        self.values = {
            name: np.bincount(bins, axes[name]) / np.bincount(bins)
            for name, bins in self._bin_of.items()
        }
        self.best = np.full([len(values) for values in self.values.values()], np.nan)

    def add(self, start: dict[str, np.intp], speeds: Array) -> None:
        """Add a block of postures: where it starts along each joint, and ball speeds or nan."""
        reduced = tuple(axis for axis, kept in enumerate(self._kept) if not kept)
        lengths = dict(zip(start, speeds.shape, strict=True))
        bins = (b[start[k] : start[k] + lengths[k]] for k, b in self._bin_of.items())
        np.fmax.at(self.best, np.ix_(*bins), np.fmax.reduce(speeds, axis=reduced))


def summarize(data: xr.Dataset, where: str | None = None) -> Summary:
    """Return the summary of a dataset, in memory or in a store."""
    summary = Summary(data, where, [name for name in VARIABLES if name in data])
    for _, block in blocks(data):
        summary.add(block)
    return summary
