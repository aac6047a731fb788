"""What stands around a kick: a wall of players, a goal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np

from kickdyn.checks import Array

WALL, FRAME = 0x34506E, 0xF7F7F7

GOAL = (7.32, 2.44, 0.12)
"""Width between the posts, height under the bar, thickness [m]: IFAB, Laws of the Game, Law 1."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box that stands upright.

    Attributes:
        centre: shape `(3,)` [m, world frame].
        size: along its heading, to its left, upwards, shape `(3,)` [m].
        heading: from x towards y [rad].
        colour: 0xRRGGBB.
    """

    centre: Array
    size: Array
    heading: float
    colour: int

    def place(self) -> Array:
        """Return its placement, shape `(4, 4)`."""
        place: Array = tf.rotation_matrix(self.heading, (0, 0, 1))
        place[:3, 3] = self.centre
        return place

    def corners(self) -> Array:
        """Return its corners, shape `(8, 3)` [m]."""
        signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return np.asarray(self.centre + 0.5 * signs * self.size @ self.place()[:3, :3].T)


def wall_boxes(
    foot: Array, ahead: Array, distance: float, height: float, width: float
) -> list[Box]:
    """Return a wall of players across a way, side by side.

    Args:
        foot: on the ground, where the ball lies, shape `(3,)` [m].
        ahead: horizontal unit vector of the way, shape `(3,)`.
        distance: of the wall [m].
        height: of the wall [m].
        width: of the wall [m].
    """
    count = max(1, round(width / 0.5))
    left = np.array([-ahead[1], ahead[0], 0.0])
    each, heading = width / count, math.atan2(ahead[1], ahead[0])
    size = np.array([0.3, 0.9 * each, height])
    middle = foot + distance * ahead + np.array([0.0, 0.0, height / 2])
    return [
        Box(middle + (number - (count - 1) / 2) * each * left, size, heading, WALL)
        for number in range(count)
    ]


def goal_boxes(foot: Array, distance: float) -> list[Box]:
    """Return a goal across x, straight ahead of a point on the ground `(3,)` [m]."""
    width, height, thick = GOAL
    line = foot + np.array([distance, 0.0, 0.0])
    side = (width + thick) / 2
    posts = [
        Box(line + np.array([0.0, y, height / 2]), np.array([thick, thick, height]), 0.0, FRAME)
        for y in (-side, side)
    ]
    bar = np.array([thick, width + 2 * thick, thick])
    return [*posts, Box(line + np.array([0.0, 0.0, height + thick / 2]), bar, 0.0, FRAME)]


def draw_box(viewer: Any, box: Box) -> None:
    """Draw a box."""
    look = shapes.MeshLambertMaterial(color=box.colour)
    viewer.set_object(shapes.Box(box.size.tolist()), look)
    viewer.set_transform(box.place())
