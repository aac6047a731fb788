"""Where labels stand: beside what they name, not over each other, and not over arrows."""

from __future__ import annotations

import numpy as np

from kickdyn.checks import Array
from kickdyn.view.camera import LEFT, UP, Camera
from kickdyn.view.label import Label

ROWS = sorted(np.arange(-8.0, 8.5, 0.5).tolist(), key=lambda row: (abs(row), -row))
"""Of a label over what it names, in its heights, the nearest first."""

LOW, HIGH = np.array([-LEFT, -UP]), np.array([16 / 9 * UP, UP])
"""Corners of the picture, over the distance, without what the caption covers."""

STEPS = np.linspace(0.0, 1.0, 21)[:, None]
"""Of an arrow, looked at."""

COVERED, OUTSIDE = 6.0, 100.0
"""What it is worth, in rows, not to cover the whole of an arrow, and to be in the picture."""


class LabelPlaces:
    """The labels of a picture, placed one after another, the most important first.

    Args:
        camera: it sees them.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._frames: list[tuple[Array, Array]] = []
        self._lines: list[Array] = []

    def keep_clear(self, start: Array, end: Array) -> None:
        """Keep labels off a line from `start` to `end`, shape `(3,)` [m], as far as possible."""
        line = [self._camera.across(start + step * (end - start)) for step in STEPS]
        self._lines.append(np.array(line))

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
                centre, half = label.frame
                cost = abs(row) + 0.25 * left + self._cost(point + centre, half)
                if cost < least:
                    best, least = label, cost
        if best is not None:
            centre, half = best.frame
            self._frames.append((point + centre, half))
        return best

    def _cost(self, centre: Array, half: Array) -> float:
        """Return what a frame there costs, in rows; infinite over another."""
        if any((abs(centre - other) < half + its - 1e-9).all() for other, its in self._frames):
            return np.inf
        covered = sum((abs(line - centre) < half).all(axis=1).mean() for line in self._lines)
        inside = (centre - half > LOW).all() and (centre + half < HIGH).all()
        return COVERED * float(covered) + (0.0 if inside else OUTSIDE)
