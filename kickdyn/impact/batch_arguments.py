"""Arguments of functions that compute many impacts: rows of q and v, one object or n of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput


def rows_of(
    leg_size: tuple[int, int], q: ArrayLike, v: ArrayLike, single: str
) -> tuple[Array, Array]:
    """Return q and v of shape `(n, nq)` and `(n, nv)`, or raise `InvalidInput`."""
    arrays = []
    for name, value, size in zip("qv", (q, v), leg_size, strict=True):
        array = validation.floats(name, value)
        if array.ndim != 2 or array.shape[1] != size:
            raise InvalidInput(
                f"{name} has shape {array.shape}: it must be (n, {size}); {single} takes one"
            )
        arrays.append(array)
    if len(arrays[0]) != len(arrays[1]):
        raise InvalidInput(
            f"q has {len(arrays[0])} rows and v {len(arrays[1])}: both must have the same number"
        )
    return arrays[0], arrays[1]


def one_or_many(name: str, value: Any, kind: type, n: int) -> list[Any]:
    """Return a list of one object, or of n, or raise `InvalidInput`."""
    if isinstance(value, kind):
        return [value]
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise InvalidInput(
            f"{name} is {validation.brief(value)}: it must be a {kind.__name__} or {n} of them"
        )
    if len(value) != n:
        raise InvalidInput(f"{name} has length {len(value)}: it must be one or {n}, as q has rows")
    for item in value:
        validation.check_type(kind, **{name: item})
    return list(value)


def vector_rows(name: str, value: ArrayLike, n: int) -> Array:
    """Return n vectors of three numbers, of one or of n, or raise `InvalidInput`."""
    array = validation.floats(name, value)
    if array.shape not in ((3,), (n, 3)):
        raise InvalidInput(f"{name} has shape {array.shape}: it must be (3,) or ({n}, 3)")
    return np.broadcast_to(array, (n, 3))


def contact_frames(normals: Array) -> Array:
    """Return two tangents and the normal of n unit normals as rows, shape `(n, 3, 3)`."""
    across = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    across = across - normals * (across * normals).sum(axis=1, keepdims=True)
    across /= np.sqrt((across * across).sum(axis=1, keepdims=True))
    return np.stack([np.cross(across, normals), across, normals], axis=1)
