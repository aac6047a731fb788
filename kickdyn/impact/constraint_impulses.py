"""What supports and loops transmit in an impact, and whether the ground could supply it."""

from enum import StrEnum

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.robot.constraints import Support

NEGLIGIBLE_IMPULSE = 1e-12
"""Impulse on a support, relative to the impulse on the ball, that counts as 0."""

LEVEL_SLOPE = 0.01
"""Height difference of a sole's corners over their distance up to which the sole is level."""


class Footing(StrEnum):
    """Motion of a support in an impact, on ground that can push but not pull.

    It lifts off if the ground would have to pull, slips if the impulse lies outside the friction
    cone, tips if it acts outside the sole, and is tilted (not judged) if its sole is not level.
    """

    STANDS = "stands"
    LIFTS_OFF = "lifts-off"
    SLIPS = "slips"
    TIPS = "tips"
    TILTED = "tilted"


def footing(support: Support, impulse: Array, rotation: Array, scale: float) -> Footing:
    """Return how a support moves that the impact takes for fixed.

    The impulse alone presses the foot down: an impact is too short for weight. Friction's moment
    about the normal is not judged. The impulse on the robot is at the support's frame, `(3,)` or
    `(6,)` [N s, N m s, world axes], z the ground's normal; the rotation is from the frame's axes to
    the world's, and the scale is the size of the impulse on the ball [N s].
    """
    negligible = NEGLIGIBLE_IMPULSE * scale
    normal = float(impulse[2])
    if normal < -negligible:
        return Footing.LIFTS_OFF
    tangential = float(np.hypot(impulse[0], impulse[1]))
    if support.friction is not None and tangential > support.friction * normal + negligible:
        return Footing.SLIPS
    if support.sole is None:
        return Footing.STANDS
    corners = support.sole @ rotation.T
    if not is_level(corners):
        return Footing.TILTED
    height = corners[:, 2].mean()
    # The centre of pressure is where the impulse has no moment about x and y.
    moment = impulse[3:] - np.cross([0.0, 0.0, height], impulse[:3])
    if normal <= negligible:
        stands = np.abs(moment[:2]).max() <= negligible * np.abs(corners).max()
    else:
        stands = _is_inside(corners[:, :2], np.array([-moment[1], moment[0]]) / normal)
    return Footing.STANDS if stands else Footing.TIPS


def is_level(corners: Array) -> bool:
    """Return whether the corners of a sole, shape `(k, 3)` [m, world axes], are level."""
    return bool(np.ptp(corners[:, 2]) <= LEVEL_SLOPE * np.ptp(corners[:, :2], axis=0).max())


def _is_inside(corners: Array, point: Array) -> bool:
    """Return whether a point is inside the convex hull of corners, both shape `(..., 2)` [m].

    It is unless all corners are on one side of it, in a direction across some edge.
    """
    offsets = corners - point
    edges = (corners[:, None] - corners[None]).reshape(-1, 2)
    normals = np.column_stack([-edges[:, 1], edges[:, 0]])
    size = np.abs(edges).max()
    return bool(((normals @ offsets.T).min(axis=1) <= 1e-9 * size * size).all())
