"""Obstacles and targets of a kick: a wall of players, a goal, a scene's plane."""

import math
from dataclasses import dataclass
from typing import Any

import meshcat.geometry as shapes
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.plane import Plane
from kickdyn.scene.scene import FRAME, MOUTH
from kickdyn.view.marks import UP_AXIS, box_corners

WALL, WHITE = 0x34506E, 0xF7F7F7

GOAL = (*MOUTH, FRAME)
"""Width between the posts, height under the bar, thickness [m]: IFAB, Laws of the Game, Law 1."""

THICKNESS, SLAB = 0.2, (4.0, 2.5)
"""Of the drawn piece of a plane that is no goal line: thickness; width and height [m]."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box.

    Attributes:
        centre: shape `(3,)` [m, world frame].
        size: along its heading, to its left, upwards, shape `(3,)` [m].
        heading: from x towards y [rad].
        colour: 0xRRGGBB.
        tilt: of its heading, upwards [rad].
        opacity: 1; below it, things behind the box are seen through it.
    """

    centre: Array
    size: Array
    heading: float
    colour: int
    tilt: float = 0.0
    opacity: float = 1.0

    @property
    def pose(self) -> Array:
        """Homogeneous matrix, shape `(4, 4)` [m, world frame]."""
        turn = pin.rpy.rpyToMatrix(0.0, -self.tilt, self.heading)
        return np.asarray(pin.SE3(turn, self.centre).homogeneous)

    def corners(self) -> Array:
        """Return its corners, shape `(8, 3)` [m, world frame]."""
        corners = box_corners(np.zeros((1, 3)), 0.5) * self.size
        return np.asarray(self.centre + corners @ self.pose[:3, :3].T)


def wall_boxes(
    foot: Array, ahead: Array, distance: float, height: float, width: float
) -> list[Box]:
    """Return a wall of players side by side, across the line to the target.

    Args:
        foot: the point on the ground below the ball, shape `(3,)` [m].
        ahead: horizontal unit vector to the target, shape `(3,)`.
        distance: of the wall [m].
        height: of the wall [m].
        width: of the wall [m].
    """
    count = max(1, round(width / 0.5))
    share, heading = width / count, math.atan2(ahead[1], ahead[0])
    middle = foot + distance * ahead + height / 2 * UP_AXIS
    return [  # not opaque, as the ball passes and its flight goes on behind
        Box(
            middle + side * share * np.cross(UP_AXIS, ahead),
            np.array([0.3, 0.9 * share, height]), heading, WALL, opacity=0.4,
        )
        for side in np.arange(count) - (count - 1) / 2
    ]  # fmt: skip


def goal_boxes(foot: Array, distance: float, heading: float = 0.0) -> list[Box]:
    """Return a goal at a distance [m] straight ahead of a point on the ground `(3,)` [m].

    The heading is the direction ahead, from x towards y [rad].
    """
    width, height, thick = GOAL
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    line, left = foot + distance * ahead, np.cross(UP_AXIS, ahead)
    side = (width + thick) / 2
    post, up = np.array([thick, thick, height]), np.array([0.0, 0.0, height / 2])
    bar = np.array([thick, width + 2 * thick, thick])
    return [
        *(Box(line + y * left + up, post, heading, WHITE) for y in (-side, side)),
        Box(line + 2 * up + np.array([0.0, 0.0, thick / 2]), bar, heading, WHITE),
    ]


def plane_boxes(plane: Plane, end: Array, floor: float) -> list[Box]:
    """Return the boxes of a scene's plane: a goal, or a wall around the end of the path [m]."""
    normal = plane.normal
    heading = math.atan2(normal[1], normal[0])
    if plane.is_goal_line:
        return goal_boxes(np.array([*plane.point[:2], floor]), 0.0, heading)
    middle = end - float(normal @ (end - plane.point)) * normal - THICKNESS / 2 * normal
    if abs(float(normal[2])) >= 1e-9:
        tilt = math.asin(float(normal[2]))
        return [Box(middle, np.array([THICKNESS, *SLAB]), heading, WALL, tilt)]
    height = max(SLAB[1], float(end[2]) - floor + 0.5)
    middle = np.array([*middle[:2], floor + height / 2])
    return [Box(middle, np.array([THICKNESS, SLAB[0], height]), heading, WALL)]


def draw_box(viewer: Any, box: Box) -> None:
    """Draw a box."""
    look = shapes.MeshLambertMaterial(color=box.colour, opacity=box.opacity)
    viewer.set_object(shapes.Box(box.size.tolist()), look)
    viewer.set_transform(box.pose)
