"""A leg turned about the vertical: one whose foot moves in a plane can then kick aside."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg

UPRIGHT = 1e-9
"""How far the foot's plane may lean."""


def turned(leg: Leg, heading: float) -> Leg:
    """Return a leg with its base turned to the left about the world's vertical [rad].

    Args:
        leg: on a fixed base, without supports or loops.
        heading: positive to the left, from x towards y.
    """
    model, turn = leg.model, pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, heading), np.zeros(3))
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = turn * model.jointPlacements[joint]
    for number, frame in enumerate(model.frames):
        if number and frame.parentJoint == 0:
            frame.placement = turn * frame.placement
    return Leg(model, leg.frame, leg.urdf, contact_normal_cone=leg.contact_normal_cone)


def heading_for(directions: Array, wish: Array) -> float | None:
    """Return the turn that brings a wish into the plane the foot moves in [rad].

    Args:
        directions: that the foot can move in, orthonormal rows, shape `(k, 3)`.
        wish: shape `(3,)`.

    Returns:
        None where that is no upright plane, or the wish has no level part to turn to.
    """
    if len(directions) != 2 or not math.hypot(wish[0], wish[1]) > 0.0:
        return None
    across = np.cross(*directions)
    if abs(across[2]) > UPRIGHT:
        return None
    ahead = np.array([across[1], -across[0]])
    if ahead[0] < 0.0:  # legs face x
        ahead = -ahead
    turn = math.atan2(wish[1], wish[0]) - math.atan2(ahead[1], ahead[0])
    return math.remainder(turn, 2 * math.pi)
