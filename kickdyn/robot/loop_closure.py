"""Closing the loops of a leg: Newton's method on their gaps."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import CLOSED, Constraints

if TYPE_CHECKING:
    from kickdyn.robot.leg import Leg

NEWTON_STEPS = 50
LEAD = 0.1
"""How far the kept joints are led at a time [rad, m]."""


def closed_configuration(leg: Leg, q: ArrayLike, keep: Iterable[str] = ()) -> Array:
    """Return a configuration near `q` with all loops closed, as `Leg.close_loops` says.

    Args:
        leg: of any kind.
        q: shape `(nq,)`.
        keep: joints that must not move.

    Raises:
        InvalidInput: the loops stay open; the widest, its gap and the rank of all together.
    """
    if isinstance(keep, str) or not isinstance(keep, Iterable):
        raise InvalidInput(f"keep is {keep!r}: it must be a list of joints' names")
    model = leg.workspace.model
    q, fixed = leg.checked_configuration(q), [leg.velocity_index(name) for name in keep]
    if leg.constraints is None or not leg.constraints.loops:
        return q
    own = leg.constraints.between(model)
    mask = own.copy()
    mask[fixed] = 0.0
    near, gaps, rank = _newton(leg, leg.constraints, q, mask)
    if _open(gaps):
        away = pin.difference(model, pin.neutral(model), q) * own
        here, way = pin.integrate(model, q, -away), away * (1.0 - mask)
        stages = max(1, math.ceil(float(np.abs(way).max()) / LEAD))
        for _ in range(stages):
            here = pin.integrate(model, here, way / stages)
            here, led, _ = _newton(leg, leg.constraints, here, mask)
            if _open(led):
                break
        else:
            return np.asarray(here)
        widths = np.linalg.norm(gaps, axis=1)
        a, b = leg.constraints.loops[int(np.argmax(widths))]
        raise InvalidInput(
            f"loop {a} - {b} stays open by {widths.max():.6g} m: from there the loops cannot be "
            f"closed (rank {rank} of {gaps.size} rows)"
        )
    return near


def _open(gaps: Array) -> bool:
    return bool(np.abs(gaps).max() > CLOSED / 10)


def _newton(leg: Leg, constraints: Constraints, q: Array, mask: Array) -> tuple[Array, Array, int]:
    """Return the best configuration on the way, its gaps and the rank of the last step.

    Each step is the smallest that closes the loops to first order, half a radian at most.
    """
    model, data = leg.workspace.model, leg.workspace.data
    first = constraints.size - 3 * len(constraints.loops)
    best, narrowest, rank = q, np.full((len(constraints.loops), 3), np.inf), 0
    for _ in range(NEWTON_STEPS):
        pin.forwardKinematics(model, data, q)
        gaps = constraints.gaps(model, data)
        if np.abs(gaps).max() < np.abs(narrowest).max():
            best, narrowest = q, gaps
        elif not _open(narrowest):  # as near as rounding lets it
            break
        rows = constraints.rows(model, data, q)[0][first:] * mask
        step, _, found, _ = np.linalg.lstsq(rows, -gaps.ravel(), rcond=1e-9)
        step, rank = step * mask, int(found)
        longest = float(np.abs(step).max())
        q = pin.integrate(model, q, step * (0.5 / longest if longest > 0.5 else 1.0))
    return np.asarray(best), narrowest, rank
