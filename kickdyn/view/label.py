"""A text in the scene that faces the viewer and keeps its size on the screen."""

from __future__ import annotations

import base64
from html import escape
from typing import Any
from uuid import uuid4

import numpy as np
from meshcat.geometry import Object

HEIGHT = 0.026
"""Of a label over its distance from the camera: 23 pixels of 720."""

PIXELS = 54
"""Height of the drawn picture, twice what is shown, so that it stays sharp."""

GAP = 12
"""Between where the label is put and its frame, likewise."""


class Label(Object):  # type: ignore[misc]  # meshcat has no types
    """A text to the right of where it is put, over everything else, as a meshcat object.

    Args:
        text: plain text; it is escaped here.
        colour: of the frame, 0xRRGGBB.
    """

    def __init__(self, text: str, colour: int) -> None:
        self.uuid = str(uuid4())
        self.text, self.colour = text, colour

    def lower(self) -> dict[str, Any]:
        """Return what meshcat sends: a sprite of three.js, textured with an SVG."""
        material, texture, image = (str(uuid4()) for _ in range(3))
        svg, ratio = self.picture()
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
                "matrix": np.diag([HEIGHT * ratio, HEIGHT, 1.0, 1.0]).ravel().tolist(),
                "renderOrder": 1,
            },
        }

    @property
    def size(self) -> tuple[float, float]:
        """Width, with the gap at its left, and height, over the distance from the camera."""
        return HEIGHT * self._pixels() / PIXELS, HEIGHT

    def picture(self) -> tuple[str, float]:
        """Return the SVG, and its width over its height; its left half is empty."""
        half = self._pixels()
        svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{2 * half}" height="{PIXELS}">'
            f'<rect x="{half + GAP}" y="3" width="{half - GAP - 3}" height="{PIXELS - 6}" rx="10" '
            f'fill="#ffffff" fill-opacity="0.88" stroke="#{self.colour:06x}" stroke-width="4"/>'
            f'<text x="{1.5 * half + GAP / 2}" y="{0.7 * PIXELS}" text-anchor="middle" '
            f'font-family="system-ui, Helvetica, Arial, sans-serif" '
            f'font-size="{0.6 * PIXELS}" fill="#1d2733">{escape(self.text)}</text></svg>'
        )
        return svg, 2 * half / PIXELS

    def _pixels(self) -> int:
        return round(GAP + PIXELS * (0.4 + 0.34 * len(self.text)))
