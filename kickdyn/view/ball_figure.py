"""The ball's figure: 12 dark pentagons and 20 light hexagons, so that its spin can be seen."""

from __future__ import annotations

from functools import cache
from typing import Any

import meshcat.geometry as shapes
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from kickdyn.core.validation import Array

Indices = NDArray[np.int64]

LIGHT, DARK = 0xF7F7F2, 0x1E2A38
ROWS = 4
"""Triangles along the edge of each sector of a panel, before it is bulged to the sphere."""


def draw_ball(viewer: Any, radius: float) -> None:
    """Draw a ball around the origin of `viewer`."""
    for name, colour in (("hexagons", LIGHT), ("pentagons", DARK)):
        vertices, faces = _panels()[name]
        mesh = shapes.TriangularMeshGeometry(radius * vertices, faces)
        viewer[name].set_object(mesh, shapes.MeshLambertMaterial(color=colour))


@cache
def _panels() -> dict[str, tuple[Array, Indices]]:
    """Return vertices and faces of all panels of a kind, on the unit sphere."""
    golden = (1 + 5**0.5) / 2
    corners = np.array([(0, a, b) for a in (-1, 1) for b in (-golden, golden)])
    icosahedron = np.vstack([np.roll(corners, turn, axis=1) for turn in range(3)])
    triangles = ConvexHull(icosahedron).simplices
    # Each edge of the icosahedron is cut at its thirds; those cuts are the panels' corners.
    cut = {(a, b): (2 * icosahedron[a] + icosahedron[b]) / 3
           for t in triangles for a in t for b in t if a != b}  # fmt: skip
    pentagons = [np.array([cut[pair] for pair in cut if pair[0] == a]) for a in range(12)]
    hexagons = [np.array([cut[a, b] for a in t for b in t if a != b]) for t in triangles]
    return {"pentagons": _bulged(pentagons), "hexagons": _bulged(hexagons)}


def _bulged(polygons: list[Array]) -> tuple[Array, Indices]:
    sectors = []
    for polygon in polygons:
        centre = polygon.mean(axis=0)
        u = polygon[0] - centre
        angle = np.arctan2(
            (polygon - centre) @ np.cross(centre, u) / np.linalg.norm(centre),
            (polygon - centre) @ u,
        )
        ring = polygon[np.argsort(angle)]
        sectors += [(centre, p, q) for p, q in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    steps = [(i, j) for i in range(ROWS + 1) for j in range(ROWS + 1 - i)]
    index = {step: k for k, step in enumerate(steps)}
    faces = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in steps if i + j < ROWS]
    faces += [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1])
              for i, j in steps if i + j < ROWS - 1]  # fmt: skip
    weights = np.array([(ROWS - i - j, i, j) for i, j in steps]) / ROWS
    points = np.concatenate([weights @ np.array(sector) for sector in sectors])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    offsets = len(steps) * np.arange(len(sectors))
    indices = np.array(faces, dtype=np.int64) + offsets[:, None, None]
    return points, indices.reshape(-1, 3)
