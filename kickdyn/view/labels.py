"""Labels: texts in the scene that face the viewer and do not cover each other."""

from __future__ import annotations

import base64
from html import escape
from typing import Any
from uuid import uuid4

import numpy as np
from meshcat.geometry import Object

from kickdyn.core.validation import Array
from kickdyn.view.camera import LEFT, UP, Camera

HEIGHT = 0.026  # of a label over its distance from the camera: 23 pixels of 720
PIXELS = 54  # height of the drawn image, twice what the screen shows, so that it stays sharp
SLOPE = HEIGHT / PIXELS  # size of a pixel of the drawn image over its distance from the camera
GAP = 12  # pixels between the labelled point and the frame
INK = "#1d2733"  # of the text, and of the line that leads to the labelled point

ROWS = sorted(np.arange(-8.0, 8.5, 0.5).tolist(), key=lambda row: (abs(row), -row))
"""Heights of a label above the labelled point, over its own height, the nearest first."""

LOW, HIGH = np.array([-LEFT, -UP]), np.array([16 / 9 * UP, UP])
"""Corners of the picture, over the distance, without what the caption covers."""


class Label(Object):  # type: ignore[misc]  # meshcat has no types
    """A text beside a point, drawn over everything else and always of one size on the screen.

    Args:
        text: plain text; it is escaped here.
        colour: of the frame, 0xRRGGBB.
        row: how far the label stands above the point, over its height; a line connects them.
        left: whether it stands at the left of the point, not at the right.
    """

    def __init__(self, text: str, colour: int, *, row: float = 0.0, left: bool = False) -> None:
        self.uuid = str(uuid4())
        self.text, self.colour, self.row, self.left = text, colour, row, left
        self._width = round(PIXELS * (0.4 + 0.34 * len(text)))

    def lower(self) -> dict[str, Any]:
        """Return the meshcat object: a sprite of three.js, textured with an SVG."""
        material, texture, image = (str(uuid4()) for _ in range(3))
        svg, width, height = self.picture()
        url = "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
        look = {"sizeAttenuation": False, "depthTest": False, "transparent": True}
        scale = np.diag([SLOPE * width, SLOPE * height, 1.0, 1.0])
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [],
            "images": [{"uuid": image, "url": url}],
            "textures": [{"uuid": texture, "image": image, "wrap": [1001, 1001], "repeat": [1, 1]}],
            "materials": [{"uuid": material, "type": "SpriteMaterial", "map": texture, **look}],
            "object": {
                "uuid": self.uuid,
                "type": "Sprite",
                "material": material,
                "matrix": scale.ravel().tolist(),
                "renderOrder": 1,
            },
        }

    @property
    def frame(self) -> tuple[Array, Array]:
        """Centre from the point, and half the size: right and up, over the distance."""
        half = self._width / 2
        centre = np.array([(-1 if self.left else 1) * (GAP + half), self.row * PIXELS])
        return SLOPE * centre, SLOPE * np.array([half, PIXELS / 2])

    def picture(self) -> tuple[str, int, int]:
        """Return the SVG, its width and its height; the labelled point is its middle."""
        wide, high = self._width, PIXELS - 6
        half, middle = GAP + wide + 3, round((abs(self.row) + 0.5) * PIXELS)
        x = half - GAP - wide if self.left else half + GAP
        y = middle - self.row * PIXELS
        line = (
            f'<line x1="{half}" y1="{middle}" x2="{x + wide if self.left else x}" y2="{y:g}" '
            f'stroke="{INK}" stroke-width="2.5"/>'
        )
        svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{2 * half}" height="{2 * middle}">'
            f"{line if self.row else ''}"
            f'<rect x="{x}" y="{y - high / 2:g}" width="{wide}" height="{high}" rx="10" '
            f'fill="#ffffff" fill-opacity="0.88" stroke="#{self.colour:06x}" stroke-width="4"/>'
            f'<text x="{x + wide / 2}" y="{y + 0.2 * PIXELS:g}" text-anchor="middle" '
            f'font-family="system-ui, Helvetica, Arial, sans-serif" '
            f'font-size="{0.6 * PIXELS}" fill="{INK}">{escape(self.text)}</text></svg>'
        )
        return svg, 2 * half, 2 * middle


class LabelLayout:
    """Labels of a camera's picture, placed one after another, the most important first."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._frames: list[tuple[Array, Array]] = []

    def add(self, text: str, colour: int, point: Array, start: Array | None = None) -> Label | None:
        """Return a label for a point, or None where no position beside the others is left.

        Args:
            text: plain text.
            colour: of its frame, 0xRRGGBB.
            point: shape `(3,)` [m, world frame].
            start: of the arrow whose tip the point is, likewise; the label stands ahead of it.
        """
        seen = self._camera.project(point)
        ahead = np.zeros(2) if start is None else seen - self._camera.project(start)
        left = bool(ahead[0] < 0.0)
        for row in ROWS:
            # At the other side a label beside the tip would cover the arrow.
            for side in (left, not left) if abs(row) >= 1 or start is None else (left,):
                label = Label(text, colour, row=-row if ahead[1] < 0.0 else row, left=side)
                centre, half = label.frame
                if self._is_free(seen + centre, half):
                    self._frames.append((seen + centre, half))
                    return label
        return None

    def _is_free(self, centre: Array, half: Array) -> bool:
        """Return whether a frame lies in the picture and covers no other."""
        inside = (centre - half > LOW).all() and (centre + half < HIGH).all()
        return bool(inside) and not any(
            (abs(centre - other) < half + size - 1e-9).all() for other, size in self._frames
        )
