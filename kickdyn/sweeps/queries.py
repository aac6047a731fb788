"""Questions to the dataset of a sweep that xarray does not answer by itself.

All else is xarray's: `data.ball_speed.where(possible(data)).max(("hip", "ankle"))` is the best ball
speed for each angle of the knee. A dataset may be larger than memory: `blocks` cuts it.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import Chunks
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
_LANGUAGE = "names, numbers, + - * /, < <= > >= == !=, and, or, not, ( )"


def possible(data: xr.Dataset) -> xr.DataArray:
    """Return where the leg can kick so: a boolean array, true where the status is `ok`."""
    return data["status"] == PostureStatus.OK.flag


def condition(data: xr.Dataset, text: str) -> xr.DataArray:
    """Return where the postures of a dataset fulfil a condition, such as `20 < knee < 30`.

    The text is parsed, never run: it consists of joints and variables, numbers, `+ - * /`,
    comparisons, `and`, `or`, `not` and brackets. A name that Python would not take stands in
    quotes. Angles are in degrees, lengths in metres. nan fulfils no comparison but `!=`.

    Args:
        data: the dataset.
        text: the condition.

    Returns:
        A boolean array over dimensions of the dataset.

    Raises:
        InvalidInput: anything else in the text, or an unknown name.
    """
    if not isinstance(text, str) or len(text) > 1000:
        raise InvalidInput(f"a condition is text of up to 1000 characters, not {str(text)[:40]!r}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = _evaluate(tree, data)
    except InvalidInput as error:
        raise InvalidInput(f"condition {text[:100]!r} {error}") from None
    except (SyntaxError, ValueError, TypeError, ArithmeticError, RecursionError, MemoryError):
        raise InvalidInput(
            f"condition {text[:100]!r} cannot be read: it consists of {_LANGUAGE}"
        ) from None
    result = xr.DataArray(found)
    if result.dtype != bool:
        raise InvalidInput(
            f"condition {text[:100]!r} is a number: compare it, as in ball_speed > 1"
        )
    return result


def _evaluate(node: ast.AST, data: xr.Dataset) -> Any:
    """Return the value of a node of a condition: an array over postures, or a scalar."""
    match node:
        case ast.Name(id=name) | ast.Constant(value=str() as name):
            return _column(data, name)
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return xr.DataArray(np.float64(number))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _apply(op, _evaluate(operand, data))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _apply(op, _evaluate(left, data), _evaluate(right, data))
        case ast.BoolOp(op=op, values=values):
            result = _evaluate(values[0], data)
            for value in values[1:]:
                result = _apply(op, result, _evaluate(value, data))
            return result
        case ast.Compare(left=left, ops=ops, comparators=others) if all(
            type(op) in _OPERATORS for op in ops
        ):
            terms = [_evaluate(each, data) for each in (left, *others)]
            result = xr.DataArray(True)
            for comparison, one, other in zip(ops, terms, terms[1:], strict=False):
                result = result & _apply(comparison, one, other)
            return result
    raise InvalidInput(f"has {ast.unparse(node)[:40]!r} in it: it consists of {_LANGUAGE}")


def _apply(op: ast.AST, *terms: xr.DataArray) -> Any:
    """Return an operator's value; raise `InvalidInput` where it mixes numbers and conditions."""
    logical = isinstance(op, ast.And | ast.Or | ast.Not)
    if any((term.dtype == bool) != logical for term in terms):
        kinds = ("condition", "number") if logical else ("number", "condition")
        raise InvalidInput(f"has a {kinds[1]} where a {kinds[0]} belongs")
    return _OPERATORS[type(op)](*terms)


def _column(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return a joint or variable of a dataset by its name, angles in degrees."""
    joints = [str(joint) for joint in data["status"].dims]
    if name not in joints and name not in VARIABLES:
        known = ", ".join(f"{each} [{shown_unit(data, each)}]" for each in (*joints, *VARIABLES))
        raise InvalidInput(f"names {name!r}, which is unknown: there are {known}")
    if f"{name}_deg" in data.coords:
        return data[f"{name}_deg"].drop_vars(f"{name}_deg").astype(float)
    return xr.DataArray(np.degrees(data[name])) if shown_unit(data, name) == "deg" else data[name]


def shown_unit(data: xr.Dataset, name: str) -> str:
    """Return the unit in which a joint or variable is shown: degrees for radians, else its own."""
    unit = str(data[name].attrs.get("units") or VARIABLES.get(name, ("",))[0])
    return "deg" if unit == "rad" else unit


def blocks(data: xr.Dataset) -> Iterator[tuple[int, xr.Dataset]]:
    """Cut a dataset into consecutive postures that fit in memory, as its store is cut.

    Yields:
        Number of the first posture, and the dataset of the block.
    """
    status = data["status"]
    stored = status.encoding.get("chunks")
    chunks = Chunks(status.shape, tuple(stored)) if stored else Chunks.of(status.shape, BLOCK)
    for k in range(len(chunks)):
        region = dict(zip(status.dims, chunks.region(k), strict=True))
        yield chunks.span(k)[0], data.isel(region)


def take(data: xr.Dataset, numbers: NDArray[np.int64]) -> xr.Dataset:
    """Return postures by their numbers, the last joint running fastest, along `posture`."""
    place = np.unravel_index(numbers, data["status"].shape)
    dims = zip(data["status"].dims, place, strict=True)
    return data.isel({name: ("posture", i) for name, i in dims})


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
    for first, block in blocks(data):
        chosen = chosen_postures(block, where)
        columns = [_column(block, name).values.ravel()[chosen] for name in (more, less)]
        points = front_of(np.vstack([points, np.column_stack([*columns, first + chosen])]))
    return take(data, points[:, 2].astype(np.int64)).load()


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
    kept = np.concatenate([[True], lightest[1:] < lightest[:-1]])
    return np.asarray(ordered[kept])


def outcome_at(leg: Leg, kick: Kick, posture: xr.Dataset) -> PostureOutcome:
    """Return the impact of one posture of a dataset, with its joint impulses and its flight.

    Args:
        leg: the leg of the sweep.
        kick: the kick of the sweep.
        posture: one posture: each joint is a coordinate without dimension, as after
            `data.isel(hip=3, knee=0)` or `pareto_front(data).isel(posture=0)`.
    """
    joints = [name for name in leg.joint_names if name in posture.coords]
    return kick_from(
        leg.posture(leg.configuration({name: float(posture[name]) for name in joints})), kick
    )


def optimum(data: xr.Dataset, of: str = "ball_speed", where: str | None = None) -> xr.Dataset:
    r"""Return slopes and curvatures of a variable around its largest value on the grid.

    The slopes are central differences :math:`(f_{+1} - f_{-1}) / 2h` with the grid's step
    :math:`h`, and one-sided ones of second order at an end of the grid; the error is estimated from
    the next coarser difference. Neighbours count where their status is `ok`, whether or not they
    fulfil the condition.

    Args:
        data: the dataset, of any size.
        of: the variable.
        where: condition that the best posture must fulfil.

    Returns:
        All variables of the best posture and, along `joint`: `step` (nan where a joint has one
        value), `step_down` and `step_up` (change of the variable by one step), `slope`,
        `slope_error`, and `curvature` along `joint` and `other_joint`; per rad or metre.

    Raises:
        InvalidInput: an unknown variable, or no posture fulfils the condition.
    """
    best, largest = -1, -np.inf
    for first, block in blocks(data):
        chosen = chosen_postures(block, where)
        values = _column(block, of).values.ravel()[chosen]
        if values.size and values.max() > largest:
            best, largest = first + int(chosen[values.argmax()]), float(values.max())
    if best < 0:
        raise InvalidInput(f"no posture has status ok and fulfils {where or 'anything'}")
    shape, joints = data["status"].shape, [str(name) for name in data["status"].dims]
    centre, n = np.array(np.unravel_index(best, shape)), len(joints)

    def at(*moves: tuple[int, int]) -> float:
        place = centre.copy()
        for joint, steps in moves:
            place[joint] += steps
        if (place < 0).any() or (place >= shape).any():
            return np.nan
        here = data.isel(dict(zip(joints, place.tolist(), strict=True)))
        return float(here[of]) if bool(possible(here)) else np.nan

    value, curvature = at(), np.full((n, n), np.nan)
    columns = {name: np.full(n, np.nan) for name in ("step", "step_down", "step_up", "slope",
                                                     "slope_error")}  # fmt: skip
    for i, name in enumerate(joints):
        if shape[i] == 1:
            continue
        axis = data[name].values
        h = columns["step"][i] = (axis[-1] - axis[0]) / (len(axis) - 1)
        line = [at((i, steps)) for steps in (-2, -1, 0, 1, 2)]
        columns["step_down"][i], columns["step_up"][i] = line[1] - value, line[3] - value
        columns["slope"][i], columns["slope_error"][i] = _slope(line, h)
        curvature[i, i] = (line[1] - 2 * value + line[3]) / h**2
        for j in range(i):
            corners = [at((i, a), (j, b)) for a, b in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
            mixed = corners[0] + corners[1] - corners[2] - corners[3]
            curvature[i, j] = curvature[j, i] = mixed / (4 * h * columns["step"][j])
    found = take(data, np.array([best])).isel(posture=0).load()
    found = found.assign_coords(joint=joints, other_joint=joints)
    along: dict[str, Any] = {name: ("joint", column) for name, column in columns.items()}
    return found.assign({**along, "curvature": (("joint", "other_joint"), curvature)})


def _slope(line: list[float], h: float) -> tuple[float, float]:
    """Return slope and error at the middle of five values, of which some may be missing."""
    low, lower, middle, upper, high = line
    central = (upper - lower) / (2 * h)
    if not np.isnan(central):
        return central, abs(central - (high - low) / (4 * h)) / 3
    for one, two, sign in ((upper, high, 1), (lower, low, -1)):
        if not np.isnan(two):
            slope = sign * (4 * one - 3 * middle - two) / (2 * h)
            return slope, abs(slope - sign * (one - middle) / h)
        if not np.isnan(one):
            return sign * (one - middle) / h, np.nan
    return np.nan, np.nan
