"""The camera: as near as the picture allows, at the right side of the kick if that shows enough."""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import meshcat.transformations as tf
import numpy as np

from kickdyn.core.validation import Array

FIELD_OF_VIEW = 44.0
"""Vertical field of view [deg]."""

UP = math.tan(math.radians(FIELD_OF_VIEW / 2))
LEFT, RIGHT = 0.76 * UP, 1.6 * UP
"""Slopes that bound the scene, in a picture of 16 by 9 with a caption at its left."""

UP_AXIS = np.array([0.0, 0.0, 1.0])

TOP, BOTTOM = 0.85 * UP, 0.8 * UP


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera.

    Attributes:
        position: shape `(3,)` [m, world frame].
        target: the point at which it looks and about which it turns, likewise.
    """

    position: Array
    target: Array

    def distance(self, points: Array) -> Array:
        """Return the distance of points, shape `(n, 3)`, from the camera [m]."""
        return np.asarray(np.linalg.norm(points - self.position, axis=-1))

    def slopes(self, points: Array) -> Array:
        """Return where points, shape `(n, 3)`, are in the picture: slopes to right and up."""
        into = self.target - self.position
        x, y, z = _axes(into / np.linalg.norm(into)) @ (points - self.position).T
        return np.asarray(np.stack([x, y], axis=-1) / np.maximum(z, 1e-9)[:, None])


def camera_for(
    near: Array, far: Array, forward: Array, *, marks: Array | None = None, behind: bool = False
) -> Camera:
    """Return the camera that sees all points and keeps leg and ball recognisable.

    A kick of some metres is seen from the right side. The longer the flight, the further the
    camera moves behind the leg, where perspective shortens it.

    Args:
        near: points of leg and ball, shape `(n, 3)` [m, world frame].
        far: points of the flight, likewise.
        forward: horizontal unit vector of the flight, shape `(3,)`.
        marks: points drawn over everything, even where they lie under the ground, likewise.
        behind: whether to look along the flight in any case, at a wall or goal across it.
    """
    floor = min(near[:, 2].min(), far[:, 2].min())
    points = np.vstack([near, far] if marks is None else [near, far, marks])
    # From the side to behind the leg; looking down, then up at a high flight.
    turns = np.radians(np.arange(75 if behind else 15, 86, 5))
    candidates = []
    for turn, tilt in product(turns, np.radians((14, 8, 2, -4))):
        level = math.sin(turn) * forward + math.cos(turn) * np.cross(UP_AXIS, forward)
        axes = _axes(math.cos(tilt) * level - math.sin(tilt) * UP_AXIS)
        position = _nearest_position(points @ axes.T)
        seen = near @ axes.T - position
        share = float(np.ptp(seen[:, 1] / seen[:, 2])) / (2 * UP)
        depth = float(np.median(seen[:, 2]))
        camera = Camera(position @ axes, (position + np.array([0.0, 0.0, depth])) @ axes)
        above = bool(camera.position[2] > floor + 0.1 * depth)
        candidates.append((above, share, camera))
        if above and share > 0.42:  # leg and ball fill as much of the picture's height
            return camera
    return max(candidates, key=lambda candidate: candidate[:2])[2]


def set_camera(viewer: Any, camera: Camera) -> None:
    """Show a meshcat viewer's scene as the camera sees it.

    The script of the page keeps the camera above the ground. meshcat's camera turns about the
    origin only, so the scene is moved instead of its target.
    """
    x, y, z = (camera.position - camera.target).tolist()
    size = math.hypot(x, y, z)
    viewer.set_transform(tf.translation_matrix(-camera.target))
    lens = viewer["/Cameras/default/rotated/<object>"]
    lens.set_property("fov", FIELD_OF_VIEW)
    lens.set_property("near", 0.02 * size)
    lens.set_property("far", 1e4 * size)
    lens.set_property("position", [x, z, -y])  # three.js has y up there


def _axes(into: Array) -> Array:
    """Return the axes of a camera that looks along a unit vector, as rows: right, up, into."""
    right = np.cross(into, UP_AXIS)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(right, into), into])


def _nearest_position(points: Array) -> Array:
    """Return the foremost camera position that sees all points, in the camera's axes.

    Each edge of the picture is a plane through the camera. Two of them bound each coordinate
    across the picture, and where both bounds meet the camera cannot come nearer.
    """
    x, y, z = points.T
    bounds = [
        ((x - RIGHT * z).max(), (x + LEFT * z).min(), RIGHT, LEFT),
        ((y - TOP * z).max(), (y + BOTTOM * z).min(), TOP, BOTTOM),
    ]
    depth = min((high - low) / (plus + minus) for low, high, plus, minus in bounds)
    centre = [
        ((low + plus * depth) + (high - minus * depth)) / 2 for low, high, plus, minus in bounds
    ]
    return np.array([*centre, depth])
