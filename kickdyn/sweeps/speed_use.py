"""How near to their limits joint speeds must come for the foot to move so: a linear programme.

More than three joints, or two in a plane, can move a foot in many ways. Which of them has the least
`max |v_i| / l_i` under `J v = w` is said by its dual: the largest of `w.y / sum_i l_i |a_i.y|` over
all directions y, with a_i the columns of J. It lies at a y that is square to as many of them as fix
it, two in space and one in a plane, so that there are few to be tried.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.robot.leg import Posture

ROUNDING = 1e-12
"""Share of a product's terms that is no more than their rounding."""

UNLIMITED = 1e300
"""A limit from which on there is none: Pinocchio's default is the largest float64."""


def speed_use(posture: Posture, v: Array) -> float:
    """Return the largest joint speed of `v`, shape `(nv,)`, over its limit."""
    limit, needed = posture.leg.velocity_limit, np.abs(v)
    use = np.divide(needed, limit, out=np.where(needed > 0, np.inf, 0.0), where=limit > 0)
    return float(use.max())


def least_use(posture: Posture, wish: Array) -> float:
    """Return the least `speed_use` with which the contact point moves so, inf where none does.

    Args:
        posture: the leg.
        wish: velocity of the contact point, within reach, shape `(3,)` [m/s, world frame].
    """
    if posture.constraint_projector is not None:
        return speed_use(posture, least_used(posture, wish))
    limit = posture.leg.velocity_limit
    moving = posture.jacobian[:, limit > 0]
    if not moving.any():
        return math.inf
    left, gains, _ = np.linalg.svd(moving)
    rank = int((gains > ROUNDING * gains[0]).sum())
    aside = left[:, rank:].T @ wish
    if aside.size and np.abs(aside).max() > 1e-9 * np.abs(wish).max():
        return math.inf
    columns, wish, limit = left[:, :rank].T @ moving, left[:, :rank].T @ wish, limit[limit > 0]
    y = _corners(columns)
    along, gain = np.abs(y @ columns), np.abs(y @ wish)
    size = np.linalg.norm(y, axis=1)
    along[along <= ROUNDING * size[:, None] * np.linalg.norm(columns, axis=0)] = 0.0
    free = limit > UNLIMITED
    most = float(limit[~free].max(initial=1e-300))
    taken = along[:, ~free] @ (limit[~free] / most)
    taken[along[:, free].any(axis=1)] = math.inf
    gain[gain <= ROUNDING * size * np.linalg.norm(wish)] = 0.0
    shares = np.divide(gain, taken, out=np.where(gain > 0, math.inf, 0.0), where=taken > 0)
    return float(shares.max(initial=0.0)) / most


def _corners(columns: Array) -> Array:
    """Return every direction that is square to one less of the columns than there are rows."""
    if len(columns) == 1:
        return np.ones((1, 1))
    if len(columns) == 2:
        return np.column_stack([-columns[1], columns[0]])
    pairs = np.array(list(combinations(range(columns.shape[1]), 2)))
    first, second = columns.T[pairs[:, 0]], columns.T[pairs[:, 1]]
    y = np.cross(first, second)
    apart = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.asarray(y[np.linalg.norm(y, axis=1) > ROUNDING * apart])


def least_used(posture: Posture, wish: Array) -> Array:
    """Return a joint velocity of the least `speed_use` that moves the contact point so.

    Args:
        posture: the leg.
        wish: velocity of the contact point, within reach, shape `(3,)` [m/s, world frame].

    Returns:
        v, shape `(nv,)` [rad/s]; the one of least kinetic energy where none is within any limits.

    Raises:
        KickdynError: the solver finds none.
    """
    from scipy.optimize import linprog  # a quarter of a second

    easy = posture.try_joint_velocity(wish)
    assert easy is not None
    held = (
        np.zeros((0, easy.size))
        if posture.constraint_projector is None
        else posture.constraint_projector.rows
    )
    asked = np.vstack([posture.jacobian, held])
    moves = posture.leg.velocity_limit > 0
    rows, limit, size = asked[:, moves], posture.leg.velocity_limit[moves], np.linalg.norm(wish)
    bound = np.eye(limit.size)[limit <= UNLIMITED]
    most = limit[limit <= UNLIMITED, None]
    found = linprog(
        np.append(np.zeros(limit.size), 1.0),
        A_ub=np.vstack([np.hstack([bound, -most]), np.hstack([-bound, -most])]),
        b_ub=np.zeros(2 * len(bound)),
        A_eq=np.column_stack([rows, np.zeros(len(rows))]),
        b_eq=asked @ (easy / size),
        bounds=[(None, None)] * limit.size + [(0.0, None)],
        method="highs",
    )
    if found.status == 2:  # infeasible: a joint that must move has limit 0
        return easy
    if not found.success:
        raise KickdynError(f"no joint velocity found for {posture!r}: {found.message}")
    v = np.zeros(easy.size)
    v[moves] = size * found.x[:-1]  # to the solver's tolerance
    v[moves] += np.linalg.lstsq(rows, asked @ (easy - v), rcond=ROUNDING)[0]
    return v
