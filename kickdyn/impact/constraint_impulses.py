"""What supports and loops carry in an impact, by name, and how well they constraint_projector."""

from __future__ import annotations

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import ConstraintProjector
from kickdyn.robot.leg import Leg


def named_impulses(
    constraint_projector: ConstraintProjector | None, impulses: Array
) -> tuple[dict[str, Array], dict[tuple[str, str], Array]]:
    """Return the stacked impulses by support and by loop."""
    if constraint_projector is None:
        return {}, {}
    constraints = constraint_projector.constraints
    supports, loops = constraints.supports, constraints.loops
    parts = [impulses[block.at] for block in constraint_projector.blocks]
    by_support = {
        support.frame: part for support, part in zip(supports, parts[: len(supports)], strict=True)
    }
    return by_support, dict(zip(loops, parts[len(supports) :], strict=True))


def residuals(constraint_projector: ConstraintProjector | None, v: Array) -> tuple[float, float]:
    """Return the largest velocity of a support [m/s, rad/s] and of a loop [m/s]."""
    if constraint_projector is None:
        return 0.0, 0.0
    speeds = np.abs(constraint_projector.rows @ v)
    split = sum(support.size for support in constraint_projector.constraints.supports)
    return float(speeds[:split].max(initial=0.0)), float(speeds[split:].max(initial=0.0))


def check_free(leg: Leg, what: str) -> None:
    """Refuse a leg that is held by more than its joints; raise `InvalidInput`.

    Args:
        leg: the leg.
        what: for the message: what is derived for legs that nothing else holds.
    """
    if leg.constraints is not None:
        raise InvalidInput(
            f"{leg.name} is held by more than its joints: {what} for legs without supports and "
            "loops only"
        )
