"""Arguments of functions that compute many impacts: rows of q and v, one object or n of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.robot.joint_table import DEGREES, look_like_degrees
from kickdyn.robot.leg import Leg


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


def unit_warnings(leg: Leg, q: Array, balls: Iterable[Ball]) -> tuple[str, ...]:
    """Return lines about balls and configurations, `(n, nq)`, that seem to be in other units."""
    lines = dict.fromkeys(line for ball in balls for line in ball.warnings)
    doubtful = np.flatnonzero(look_like_degrees(leg, q))
    if doubtful.size:
        lines[f"{doubtful.size} rows of q, the first {doubtful[0]}: {DEGREES}"] = None
    return tuple(lines)


def vector_rows(name: str, value: ArrayLike, n: int) -> Array:
    """Return n vectors of three numbers, of one or of n, or raise `InvalidInput`."""
    array = validation.floats(name, value)
    if array.shape not in ((3,), (n, 3)):
        raise InvalidInput(f"{name} has shape {array.shape}: it must be (3,) or ({n}, 3)")
    return np.broadcast_to(array, (n, 3))


def contact_frames(normals: Array) -> Array:
    """Return two tangents and the normal of n unit normals as rows, shape `(n, 3, 3)`."""
    tangent = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    tangent = tangent - normals * (tangent * normals).sum(axis=1, keepdims=True)
    tangent /= np.sqrt((tangent * tangent).sum(axis=1, keepdims=True))
    return np.stack([np.cross(tangent, normals), tangent, normals], axis=1)


@dataclass(frozen=True, eq=False)
class ContactRows:
    """One contact or n as arrays.

    Attributes:
        given: the contacts; or one, which the arrays change in each of n rows.
        normal: shape `(n, 3)`, unit vectors.
        restitution: shape `(n,)`, nan where it depends on the speed of approach.
        friction: shape `(n,)`.
        changed: whether the arrays change the contact that is given.
    """

    given: Sequence[Contact]
    normal: Array
    restitution: Array
    friction: Array
    changed: bool = False

    @classmethod
    def of(cls, contacts: Sequence[Contact]) -> "ContactRows":
        """Return contacts as arrays; refuse one without a normal."""
        for contact in contacts:
            contact.check_normal()
        restitution = [
            contact.restitution if isinstance(contact.restitution, float) else math.nan
            for contact in contacts
        ]
        return cls(
            contacts, np.array([contact.normal for contact in contacts]), np.array(restitution),
            np.array([contact.friction for contact in contacts]),
        )  # fmt: skip

    @property
    def offset(self) -> Array:
        """Offsets of the contact points in the contact frame, shape `(n, 3)` or `(1, 3)` [m]."""
        still = (0.0, 0.0, 0.0)
        return np.array([still if one.offset is None else one.offset for one in self.given])

    def __len__(self) -> int:
        return len(self.normal)

    def __getitem__(self, i: int) -> Contact:
        if not self.changed:
            return self.given[i]
        contact, e = self.given[0], float(self.restitution[i])
        return replace(
            contact, normal=self.normal[i], friction=float(self.friction[i]),
            restitution=contact.restitution if math.isnan(e) else e,
        )  # fmt: skip
