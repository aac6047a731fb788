"""Where meshcat's cylinder goes: it stands along y, about its middle."""

from __future__ import annotations

import math

import meshcat.transformations as tf
import numpy as np

from kickdyn.core.validation import Array

UPRIGHT: Array = tf.rotation_matrix(math.pi / 2, (1, 0, 0))
"""Turns y to z, along which a URDF's cylinder stands."""


def along(start: Array, end: Array) -> Array:
    """Return the placement that lays a cylinder from start to end, which differ, `(4, 4)`."""
    way = np.asarray(end) - start
    y = way / np.linalg.norm(way)
    x = np.cross(y, np.eye(3)[np.argmin(np.abs(y))])
    x /= np.linalg.norm(x)
    place = np.eye(4)
    place[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
    place[:3, 3] = (start + end) / 2
    return place
