"""The limb that kicks, taken out of a robot: what else hangs on the fixed base stays at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg


class Limb(NamedTuple):
    """A limb on a fixed base, and where its joints stand in the whole robot.

    An impact on it moves nothing else, and its equations are the whole robot's, without the rest.

    Attributes:
        leg: the limb alone; the whole robot, where that is nothing else.
        qs, vs: indices of its joints in the robot's q and v.
    """

    leg: Leg
    qs: Array
    vs: Array

    def whole(self, robot: Leg, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v of the robot, all other joints at 0."""
        posture, velocity = robot.configuration(), np.zeros(robot.nv)
        posture[self.qs], velocity[self.vs] = q, v
        return posture, velocity


def limb_of(robot: Leg) -> Limb:
    """Return the limb that a robot on a fixed base kicks with."""
    model = robot.model
    ways = [[int(j) for j in model.supports[joint] if j > 0] for joint in range(model.njoints)]
    root = ways[robot.contact_joint][0]
    others = [j for j, way in enumerate(ways) if way and way[0] != root and model.nvs[j] == 1]
    own = [joint for joint in range(1, model.njoints) if joint not in others]
    qs, vs = (
        np.concatenate([np.arange(start[j], start[j] + size[j]) for j in own])
        for start, size in ((model.idx_qs, model.nqs), (model.idx_vs, model.nvs))
    )
    still = {str(model.names[joint]): 0.0 for joint in others}
    return Limb(robot.locked(still) if still else robot, qs, vs)
