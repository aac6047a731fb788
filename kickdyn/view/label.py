"""A text in the scene that faces the viewer and keeps its size on the screen."""

from __future__ import annotations

import base64
from html import escape
from typing import Any
from uuid import uuid4

import numpy as np
from meshcat.geometry import Object

from kickdyn.core.validation import Array

HEIGHT = 0.026
"""Of a label over its distance from the camera: 23 pixels of 720."""

PIXELS = 54
"""Height of the drawn picture, twice what is shown, so that it stays sharp."""

GAP = 12
"""Between where the label is put and its frame, likewise."""

INK = "#1d2733"
"""Of the text and the line that leads there, which in the frame's colour could be an arrow."""

SLOPE = HEIGHT / PIXELS
"""What a pixel of the drawn picture is over the distance from the camera."""


class Label(Object):  # type: ignore[misc]  # meshcat has no types
    """A text beside where it is put, over everything else, as a meshcat object.

    Args:
        text: plain text; it is escaped here.
        colour: of the frame, 0xRRGGBB.
        row: heights of a label that it stands above where it is put; a line leads there.
        left: whether it stands at the left, not at the right.
    """

    def __init__(self, text: str, colour: int, *, row: float = 0.0, left: bool = False) -> None:
        self.uuid = str(uuid4())
        self.text, self.colour, self.row, self.left = text, colour, row, left

    def lower(self) -> dict[str, Any]:
        """Return what meshcat sends: a sprite of three.js, textured with an SVG."""
        material, texture, image = (str(uuid4()) for _ in range(3))
        svg, width, height = self.picture()
        url = "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
        return {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [],
            "images": [{"uuid": image, "url": url}],
            "textures": [{"uuid": texture, "image": image, "wrap": [1001, 1001], "repeat": [1, 1]}],
            "materials": [
                {
                    "uuid": material,
                    "type": "SpriteMaterial",
                    "map": texture,
                    "sizeAttenuation": False,
                    "depthTest": False,
                    "transparent": True,
                }
            ],
            "object": {
                "uuid": self.uuid,
                "type": "Sprite",
                "material": material,
                "matrix": np.diag([SLOPE * width, SLOPE * height, 1.0, 1.0]).ravel().tolist(),
                "renderOrder": 1,
            },
        }

    @property
    def frame(self) -> tuple[Array, Array]:
        """Its centre from where it is put, and half its size: right and up, over the distance."""
        half = self._wide() / 2
        side = -1 if self.left else 1
        centre = np.array([side * (GAP + half), self.row * PIXELS])
        return SLOPE * centre, SLOPE * np.array([half, PIXELS / 2])

    def picture(self) -> tuple[str, int, int]:
        """Return the SVG, its width and height; where the label is put is its middle."""
        wide, high = self._wide(), PIXELS - 6
        half, middle = GAP + wide + 3, round((abs(self.row) + 0.5) * PIXELS)
        x = half - GAP - wide if self.left else half + GAP
        y = middle - self.row * PIXELS
        lead = (
            f'<line x1="{half}" y1="{middle}" x2="{x + wide if self.left else x}" y2="{y:g}" '
            f'stroke="{INK}" stroke-width="2.5"/>'
            if self.row
            else ""
        )
        svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{2 * half}" height="{2 * middle}">'
            f'{lead}<rect x="{x}" y="{y - high / 2:g}" width="{wide}" height="{high}" rx="10" '
            f'fill="#ffffff" fill-opacity="0.88" stroke="#{self.colour:06x}" stroke-width="4"/>'
            f'<text x="{x + wide / 2}" y="{y + 0.2 * PIXELS:g}" text-anchor="middle" '
            f'font-family="system-ui, Helvetica, Arial, sans-serif" '
            f'font-size="{0.6 * PIXELS}" fill="{INK}">{escape(self.text)}</text></svg>'
        )
        return svg, 2 * half, 2 * middle

    def _wide(self) -> int:
        return round(PIXELS * (0.4 + 0.34 * len(self.text)))
