"""Where labels stand: beside what they name, not over each other, and not over arrows."""

from __future__ import annotations

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.view.camera import LEFT, UP, Camera
from kickdyn.view.label import GAP, PIXELS, SLOPE, Label
from kickdyn.view.marks import arrow_radius

ROWS = sorted(np.arange(-8.0, 8.5, 0.5).tolist(), key=lambda row: (abs(row), -row))
"""Of a label over what it names, in its heights, the nearest first."""

LOW, HIGH = np.array([-LEFT, -UP]), np.array([16 / 9 * UP, UP])
"""Corners of the picture, over the distance, without what the caption covers."""

STEPS = np.linspace(0.0, 1.0, 21)
"""Shares of an arrow's length that are looked at."""

CLEAR = 4 * SLOPE
"""Between an arrow and a label or the line that leads to it, over the distance: 2 pixels of 720."""

AWAY = 0.3
"""Share of a label's line that may lie on the arrow it comes from."""

COVERED, OUTSIDE = 40.0, 100.0
"""What it is worth, in rows, not to cover the whole of an arrow, and to be in the picture."""


class LabelPlaces:
    """The labels of a picture, placed one after another, the most important first.

    Args:
        camera: it sees them.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._frames: list[tuple[Array, Array]] = []
        self._arrows: list[tuple[Array, Array]] = []

    def keep_clear(self, start: Array, end: Array) -> None:
        """Keep labels off an arrow from `start` to `end`, shape `(3,)` [m], as far as possible."""
        points = start + STEPS[:, None] * (end - start)
        radii = float(np.linalg.norm(end - start)) * arrow_radius(STEPS)
        seen = np.array([self._camera.across(point) for point in points])
        self._arrows.append((seen, radii / self._camera.distance(points) + CLEAR))

    def label(self, text: str, colour: int, at: Array) -> Label | None:
        """Return a label for a point, or None where there is no room for it.

        Args:
            text: plain text.
            colour: of its frame, 0xRRGGBB.
            at: the point, shape `(3,)` [m].
        """
        point = self._camera.across(at)
        best, least = None, np.inf
        for row in ROWS:
            for left in (False, True):
                label = Label(text, colour, row=row, left=left)
                cost = abs(row) + 0.25 * left + self._cost(point, label)
                if cost < least:
                    best, least = label, cost
        if best is not None:
            centre, half = best.frame
            self._frames.append((point + centre, half))
        return best

    def _cost(self, point: Array, label: Label) -> float:
        """Return what a label costs there, in rows; infinite over another."""
        centre, half = label.frame
        centre = point + centre
        if any((abs(centre - other) < half + its - 1e-9).all() for other, its in self._frames):
            return np.inf
        way = SLOPE * np.array([-GAP if label.left else GAP, label.row * PIXELS])
        covered = 0.0
        for arrow, radii in self._arrows:
            under = (abs(arrow - centre) < half + radii[:, None]).all(axis=1)
            if label.row:
                under |= _apart(arrow, point + AWAY * way, point + way) < radii
            covered += float(under.mean())
        inside = (centre - half > LOW).all() and (centre + half < HIGH).all()
        return COVERED * covered + (0.0 if inside else OUTSIDE)


def _apart(points: Array, start: Array, end: Array) -> Array:
    """Return the distances of points, shape `(n, 2)`, from a line between two."""
    way = end - start
    share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * way, axis=1))
