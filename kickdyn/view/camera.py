"""The camera, as near as the picture allows, with sky, light and the sizes that follow from it."""

import math
from itertools import product
from typing import Any, NamedTuple

import meshcat.transformations as tf
import numpy as np

from kickdyn.core.validation import Array

FIELD_OF_VIEW = 44.0
"""Vertical field of view [deg]."""

UP = math.tan(math.radians(FIELD_OF_VIEW / 2))
LEFT, RIGHT = 0.76 * UP, 1.6 * UP
"""Slopes that bound the scene, in a picture of 16 by 9 with a caption at its left."""

TOP, BOTTOM = 0.85 * UP, 0.8 * UP

UP_AXIS = np.array([0.0, 0.0, 1.0])

SKY_COLOURS = {"top_color": [0.60, 0.78, 0.93], "bottom_color": [0.96, 0.98, 1.0]}
LIGHT_INTENSITIES = {
    "AmbientLight": 0.6,
    "FillLight": 0.7,  # from afar: of the same strength everywhere
    "PointLightNegativeX": 0.1,
    "PointLightPositiveX": 0.1,
}
SUN_DIRECTION = np.array([-0.3, -0.5, 0.81])
"""Unit vector from the scene to the light."""


class Camera(NamedTuple):
    """A camera: its position, and the point at which it looks, `(3,)` [m, world frame]."""

    position: Array
    target: Array

    def distance(self, points: Array) -> Array:
        """Return the distance of points, shape `(n, 3)`, from the camera [m]."""
        return np.asarray(np.linalg.norm(points - self.position, axis=-1))


def camera_for(near: Array, far: Array, forward: Array, *, behind: bool = False) -> Camera:
    """Return the camera that sees all points and keeps leg and ball recognisable.

    A kick of some metres is seen from the right side. The longer the flight, the further the
    camera moves behind the leg, where perspective shortens it.

    Args:
        near: points of leg and ball, shape `(n, 3)` [m, world frame].
        far: points of the flight and of all else that is drawn, likewise.
        forward: horizontal unit vector of the flight, shape `(3,)`.
        behind: whether to look along the flight in any case, at a wall or goal across it.
    """
    floor = near[:, 2].min()
    points = np.vstack([near, far])
    # From the side to behind the leg; looking down, then up at a high flight.
    turns = np.radians(np.arange(75 if behind else 15, 86, 5))
    candidates = []
    for turn, tilt in product(turns, np.radians((14, 8, 2, -4))):
        level = math.sin(turn) * forward + math.cos(turn) * np.cross(UP_AXIS, forward)
        right, into = np.cross(level, UP_AXIS), math.cos(tilt) * level - math.sin(tilt) * UP_AXIS
        axes = np.array([right, np.cross(right, into), into])  # of the camera, as rows
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


def set_stage(viewer: Any, camera: Camera, points: Array) -> None:
    """Set sky, camera, and light that casts the shadows of points, shape `(n, 3)` [m].

    The script of the page keeps the camera above the ground. meshcat's camera turns about the
    origin only, so the scene is moved instead of its target.
    """
    for name in ("/Grid", "/Axes"):
        viewer[name].set_property("visible", False)
    for name, colour in SKY_COLOURS.items():
        viewer["/Background"].set_property(name, colour)
    for name, brightness in LIGHT_INTENSITIES.items():
        viewer[f"/Lights/{name}/<object>"].set_property("intensity", brightness)
    reach = float(np.linalg.norm(points - camera.target, axis=1).max())
    sun = viewer["/Lights/FillLight/<object>"]
    sun.set_property("position", (1.8 * reach * SUN_DIRECTION).tolist())
    sun.set_property("reach", reach)  # the page's script frames the shadows by it
    x, y, z = (camera.position - camera.target).tolist()
    size = math.hypot(x, y, z)
    viewer.set_transform(tf.translation_matrix(-camera.target))
    lens = viewer["/Cameras/default/rotated/<object>"]
    lens.set_property("fov", FIELD_OF_VIEW)
    lens.set_property("near", 0.02 * size)
    lens.set_property("far", 1e4 * size)
    lens.set_property("position", [x, z, -y])  # three.js has y up there


def level_direction(vector: Array) -> Array:
    """Return the horizontal unit vector of a direction; x where it is vertical or zero."""
    level = vector * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(level))
    steep = length <= 1e-3 * np.linalg.norm(vector)
    return np.array([1.0, 0.0, 0.0]) if steep else np.asarray(level / length)


def stripe_width(extent: float) -> float:
    """Return 1, 2 or 5 times a power of ten, about a sixth of the extent [m]."""
    sixth = extent / 6 * (1 + 1e-9)  # so that a round one stays
    power = 10.0 ** math.floor(math.log10(sixth))
    return power * max(step for step in (1, 2, 5) if step * power <= sixth)


def box_corners(points: Array, radius: float) -> Array:
    """Return the corners of boxes around points, shape `(8 n, 3)`."""
    corners = np.array(list(product((-1, 1), repeat=3)))
    return np.asarray((points[:, None] + radius * corners).reshape(-1, 3))


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
