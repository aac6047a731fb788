"""Where to look from: as near as the picture allows, from the side if that shows enough."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import meshcat.transformations as tf
import numpy as np

from kickdyn.core.validation import Array

FIELD = 44.0
"""Vertical field of view [deg]."""

UP = math.tan(math.radians(FIELD / 2))
LEFT, RIGHT = 0.9 * UP, 1.6 * UP
"""Slopes that may be filled, of a picture 16 wide and 9 high with a caption at its left."""

TOP, BOTTOM = 0.85 * UP, 0.88 * UP
SHARE = 0.36
"""Share of the picture's height that leg and ball should fill."""

LOWEST = 0.1
"""Height of the camera above the ground, at least, over its distance from the leg."""

TURNS = np.radians(np.arange(15, 86, 5))
"""From the side to behind the leg, in the order they are tried."""

BEHIND = math.radians(72)
"""Least turn that counts as looking along the flight."""

TILTS = np.radians((14, 8, 2, -4))
"""How far the camera looks down, likewise: a high flight is seen from below."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera.

    Attributes:
        position: shape `(3,)` [m, world frame].
        target: what it looks at and turns about, likewise.
    """

    position: Array
    target: Array

    def distance(self, points: Array) -> Array:
        """Return the distance of points, shape `(n, 3)`, from the camera [m]."""
        return np.asarray(np.linalg.norm(points - self.position, axis=-1))

    def across(self, point: Array) -> Array:
        """Return where the picture shows a point: right and up, over its depth, shape `(2,)`."""
        into = self.target - self.position
        into = into / np.linalg.norm(into)
        right = np.cross(into, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        away = point - self.position
        return np.array([away @ right, away @ np.cross(right, into)]) / (away @ into)


def camera_for(
    near: Array, far: Array, forward: Array, *, marks: Array | None = None, behind: bool = False
) -> Camera:
    """Place the camera so that all is in the picture and what is near stays recognisable.

    A kick of some metres is seen from the right side. The longer the flight, the further the
    camera moves behind the leg, where perspective shortens it.

    Args:
        near: points of leg and ball, shape `(n, 3)` [m, world frame].
        far: points of the flight, likewise.
        forward: horizontal unit vector of the flight, shape `(3,)`.
        marks: what is drawn over everything, under the ground too, likewise.
        behind: whether to look along the flight in any case, at what stands across it.
    """
    floor = min(near[:, 2].min(), far[:, 2].min())
    points = np.vstack([near, far] if marks is None else [near, far, marks])
    shots = []
    for turn, tilt in product(TURNS[TURNS > BEHIND] if behind else TURNS, TILTS):
        axes = _axes(forward, turn, tilt)
        position = _fitted(points @ axes.T)
        seen = near @ axes.T - position
        share = float(np.ptp(seen[:, 1] / seen[:, 2])) / (2 * UP)
        depth = float(np.median(seen[:, 2]))
        camera = Camera(position @ axes, (position + np.array([0.0, 0.0, depth])) @ axes)
        above = bool(camera.position[2] > floor + LOWEST * depth)
        shots.append((above, share, camera))
        if above and share > SHARE:
            return camera
    return max(shots, key=lambda shot: shot[:2])[2]


def set_camera(viewer: Any, camera: Camera) -> None:
    """Show a meshcat viewer's scene as the camera sees it.

    meshcat's camera turns about the origin and nothing else; so the scene moves, not the camera's
    target.
    """
    x, y, z = (camera.position - camera.target).tolist()
    size = math.hypot(x, y, z)
    viewer.set_transform(tf.translation_matrix(-camera.target))
    lens = viewer["/Cameras/default/rotated/<object>"]
    lens.set_property("fov", FIELD)
    lens.set_property("near", 0.02 * size)
    lens.set_property("far", 1e4 * size)
    lens.set_property("position", [x, z, -y])  # three.js has y up there


def _axes(forward: Array, turn: float, tilt: float) -> Array:
    """Return the camera's axes as rows: right, up, into the picture."""
    up = np.array([0.0, 0.0, 1.0])
    level = math.sin(turn) * forward + math.cos(turn) * np.cross(up, forward)
    into = math.cos(tilt) * level - math.sin(tilt) * up
    right = np.cross(level, up)
    return np.array([right, np.cross(right, into), into])


def _fitted(points: Array) -> Array:
    """Return the foremost camera position that sees all points, in the camera's axes.

    Each edge of the picture is a plane through the camera; each coordinate across is bounded by
    two of them, and where both bounds meet the camera can come no nearer.
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
