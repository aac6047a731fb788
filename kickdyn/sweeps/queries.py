"""Questions to the dataset of a sweep that xarray does not answer by itself.

Everything else is left to xarray: `data.ball_speed.where(possible(data)).max(("hip", "ankle"))` is
the best ball speed for each angle of the knee. `blocks` reads a dataset larger than memory.
"""

import ast
import math
import operator
from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import VARIABLES
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
    joints = [str(joint) for joint in data.coords if str(joint)[:-4] not in data.coords]
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
