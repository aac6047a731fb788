"""Closing the loops of a leg: Newton's method on their gaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from kickdyn.checks import Array
from kickdyn.constraints import CLOSED
from kickdyn.errors import InvalidInput

if TYPE_CHECKING:
    from kickdyn.leg import Leg

STEPS = 100


def close_loops(leg: Leg, q: Array, fixed: Sequence[int] = ()) -> Array:
    """Return the configuration that Newton's method reaches from `q`, all loops closed.

    Each step is the smallest that closes the loops to first order, half a radian at most.

    Args:
        leg: with loops.
        q: shape `(nq,)`.
        fixed: indices of v that must not move.

    Raises:
        InvalidInput: the loops stay open; the widest, its gap and the rank of all together.
    """
    model, data, constraints = leg.workspace.model, leg.workspace.data, leg.constraints
    if constraints is None:
        return q
    start = constraints.size - 3 * len(constraints.loops)
    best, narrowest, rank = q, np.inf, 0
    for _ in range(STEPS):
        pin.forwardKinematics(model, data, q)
        gap = constraints.gaps(model, data).ravel()
        width = float(np.abs(gap).max(initial=0.0))
        if width < narrowest:
            best, narrowest = q, width
        elif narrowest <= CLOSED / 10:  # as near as rounding lets it
            break
        rows = constraints.rows(model, data, q)[0][start:].copy()
        rows[:, list(fixed)] = 0.0
        step, _, found, _ = np.linalg.lstsq(rows, -gap, rcond=1e-9)
        rank = int(found)
        longest = float(np.abs(step).max(initial=0.0))
        q = pin.integrate(model, q, step * min(1.0, 0.5 / longest) if longest else step)
    if narrowest > CLOSED / 10:
        pin.forwardKinematics(model, data, best)
        widths = np.linalg.norm(constraints.gaps(model, data), axis=1)
        a, b = constraints.loops[int(np.argmax(widths))]
        raise InvalidInput(
            f"loop {a} - {b} stays open by {widths.max():.6g} m: from there the loops cannot be "
            f"closed (rank {rank} of {3 * len(widths)} rows)"
        )
    return np.asarray(best)
