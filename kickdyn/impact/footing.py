"""Would the ground really hold a support: lift-off, slip and tipping, judged from its impulse."""

from __future__ import annotations

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.robot.constraints import ConstraintProjector, Support

ROUNDING = 1e-12
"""Share of the impulse on the ball that counts as none."""

LEVEL = 0.01
"""Height differences of a sole's corners, over their distance, up to which it counts as level."""

STANDS, LIFTS, SLIPS, TIPS = "stands", "lifts off", "slips", "tips"
TILTED = "is tilted"


def judged(hold: ConstraintProjector | None, impulses: Array, scale: float) -> dict[str, str]:
    """Return `footing` of every support by name, from the stacked constraint impulses."""
    if hold is None:
        return {}
    return {
        support.frame: footing(support, impulses[block.at], block.frame, scale)
        for support, block in zip(hold.constraints.supports, hold.blocks, strict=False)
    }


def footing(support: Support, impulse: Array, turn: Array, scale: float) -> str:
    """Return what the ground, which only pushes, would let a held support do.

    An impact lasts too short for weight to press the foot down, so nothing but the impulse itself
    holds it.

    Args:
        support: with friction and sole, or what is to be judged of them.
        impulse: on the robot at the support's frame, shape `(3,)` or `(6,)` [N s, N m s, world
            axes]; the ground's normal is z.
        turn: from the frame's axes to the world's, shape `(3, 3)`.
        scale: size of the impulse on the ball [N s].

    Returns:
        `lifts off` where the ground would have to pull, `slips` where the impulse lies outside the
        friction cone, `is tilted` where the sole is not level, so that nobody knows what it stands
        on, `tips` where the impulse acts outside the sole, else `stands`. Friction's moment about
        the normal is not judged.
    """
    none = ROUNDING * scale
    normal = float(impulse[2])
    if normal < -none:
        return LIFTS
    across = float(np.hypot(impulse[0], impulse[1]))
    if support.friction is not None and across > support.friction * normal + none:
        return SLIPS
    if support.sole is not None:
        corners = support.sole @ turn.T
        if not level(corners):
            return TILTED
        height = corners[:, 2].mean()
        # where on the sole's plane the impulse has no moment about x and y
        moment = impulse[3:] - np.cross([0.0, 0.0, height], impulse[:3])
        if normal <= none:
            return TIPS if np.abs(moment[:2]).max() > none * np.abs(corners).max() else STANDS
        if not _within(corners[:, :2], np.array([-moment[1], moment[0]]) / normal):
            return TIPS
    return STANDS


def level(corners: Array) -> bool:
    """Return whether the corners of a sole, shape `(k, 3)` [m, world axes], are level."""
    return bool(np.ptp(corners[:, 2]) <= LEVEL * np.ptp(corners[:, :2], axis=0).max())


def _within(corners: Array, point: Array) -> bool:
    """Return whether a point is inside the convex hull of corners, both shape `(..., 2)` [m].

    It is unless some direction has it beyond all corners; of those, the ones across an edge count.
    """
    offsets = corners - point
    edges = (corners[:, None] - corners[None]).reshape(-1, 2)
    across = np.column_stack([-edges[:, 1], edges[:, 0]])
    size = np.abs(edges).max()
    return bool(((across @ offsets.T).min(axis=1) <= 1e-9 * size * size).all())
