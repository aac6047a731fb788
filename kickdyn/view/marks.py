"""Marks of the picture that are no bodies: ground, curve, arrow."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import meshcat.geometry as shapes
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.view.cylinder_pose import UPRIGHT, along

CURVE, ARROW = 0xE63946, 0x2456D6
GRASS = (0x86B56B, 0x7DAD63)
SIDES = 8

THICK, NECK, BARB = 0.028, 0.72, 0.084
"""Of an arrow, over its length: radius of the shaft, where the head begins, the head's radius."""


def draw_ground(viewer: Any, centre: Array, forward: Array, stripe: float, reach: float) -> None:
    """Draw a level lawn, mown in stripes across the flight that fade with the distance.

    Args:
        viewer: node to draw into.
        centre: of the edge between two stripes, shape `(3,)` [m].
        forward: horizontal unit vector across the stripes, shape `(3,)`.
        stripe: width of one [m].
        reach: where the last stripe fades out [m].
    """
    count = math.ceil(reach / stripe)
    edges = stripe * np.arange(-count, count + 1)
    end, far = edges[-1], 100 * edges[-1]
    # One mesh, as two faces in one plane flicker: stripes in two halves, so that they can fade to
    # both sides, and four plain pieces around. Those reach under what has faded, so that the sky
    # does not glint through the seam.
    pieces = [
        (left, right, low, high, number % 2)
        for number, (left, right) in enumerate(pairwise(edges))
        for low, high in ((-end, 0.0), (0.0, end))
    ]
    seam = 0.98 * end
    pieces += [(-far, -seam, -far, far, 0), (seam, far, -far, far, 0)]
    pieces += [(-seam, seam, -far, -seam, 0), (-seam, seam, seam, far, 0)]
    left, right, low, high, dark = np.array(pieces).T
    x, y = np.stack([left, right, right, left], 1), np.stack([low, low, high, high], 1)
    shade = dark[:, None] * np.clip(1 - np.hypot(x, y) / end, 0.0, 1.0)
    colours = _rgb(GRASS[0]) + shade[..., None] * (_rgb(GRASS[1]) - _rgb(GRASS[0]))
    corners = 4 * np.arange(len(pieces))[:, None, None]
    viewer.set_object(
        shapes.TriangularMeshGeometry(
            np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3),
            (corners + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3),
            colours.reshape(-1, 3),
        ),
        shapes.MeshBasicMaterial(vertexColors=True),
    )
    up = np.array([0.0, 0.0, 1.0])
    place = np.eye(4)
    place[:3, :3] = np.column_stack([forward, np.cross(up, forward), up])
    place[:3, 3] = centre
    viewer.set_transform(place)


def draw_curve(
    viewer: Any, points: Array, radii: Array, sideways: Array, colour: int = CURVE
) -> None:
    """Draw a tube over everything else, as WebGL draws lines one pixel thin.

    Args:
        viewer: node to draw into.
        points: shape `(n, 3)` [m].
        radii: of the tube at each, shape `(n,)` [m].
        sideways: unit vector roughly at right angles to the curve, shape `(3,)`.
        colour: 0xRRGGBB.
    """
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1)
    kept = np.concatenate([[True], moves > 1e-9 * np.abs(points).max()])
    points, radii = points[kept], radii[kept]
    if len(points) < 2:
        return
    # Forward differences: central ones vanish where a ball that went straight up turns back.
    tangents = np.diff(points, axis=0, append=2 * points[-1:] - points[-2:-1])
    first = np.cross(tangents, sideways)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangents, first)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
    vertices = (points[:, None] + radii[:, None, None] * ring).reshape(-1, 3)
    along_it = SIDES * np.arange(len(points) - 1)[:, None]
    a, b = along_it + np.arange(SIDES), along_it + (np.arange(SIDES) + 1) % SIDES
    faces = np.concatenate(
        [
            np.stack([a, b, b + SIDES], axis=-1).reshape(-1, 3),
            np.stack([a, b + SIDES, a + SIDES], axis=-1).reshape(-1, 3),
        ]
    )
    viewer.set_object(shapes.TriangularMeshGeometry(vertices, faces), _overlay(colour))


def draw_landing(viewer: Any, point: Array, radius: float) -> None:
    """Draw a disc on the ground."""
    viewer.set_object(shapes.Cylinder(0.02 * radius, radius), shapes.MeshBasicMaterial(color=CURVE))
    place = UPRIGHT.copy()
    place[:3, 3] = point
    viewer.set_transform(place)


def draw_shadow(viewer: Any, radius: float) -> None:
    """Draw what tells the height of a ball of that radius; it belongs on the ground below it."""
    dark = shapes.MeshBasicMaterial(color=0x14301A, opacity=0.35)
    viewer["disc"].set_object(shapes.Cylinder(0.02 * radius, 0.8 * radius), dark)
    viewer["disc"].set_transform(UPRIGHT)


def arrow_radius(shares: Array) -> Array:
    """Return how thick an arrow is, as radius over length, at shares of its length."""
    return np.where(shares < NECK, THICK, BARB * (1.0 - shares) / (1.0 - NECK))


def draw_arrow(
    viewer: Any, start: Array, direction: Array, length: float, colour: int = ARROW
) -> None:
    """Draw an arrow over everything else; its start is the origin of `viewer`.

    Args:
        viewer: node to draw into.
        start: shape `(3,)` [m].
        direction: unit vector, shape `(3,)`.
        length: [m].
        colour: 0xRRGGBB.
    """
    neck = NECK * length
    shaft = shapes.Cylinder(neck, THICK * length)
    head = shapes.Cylinder(length - neck, radiusTop=0.0, radiusBottom=BARB * length)
    for name, shape, begin, end in (("shaft", shaft, 0.0, neck), ("head", head, neck, length)):
        viewer[name].set_object(shape, _overlay(colour))
        viewer[name].set_transform(along(begin * direction, end * direction))
    place = np.eye(4)
    place[:3, 3] = start
    viewer.set_transform(place)


def _overlay(colour: int) -> Any:
    # Transparent things are drawn last; without a depth test, over what is nearer too.
    return shapes.MeshBasicMaterial(color=colour, transparent=True, depthTest=False)


def _rgb(colour: int) -> Array:
    return np.array([colour >> 16, colour >> 8 & 255, colour & 255]) / 255
