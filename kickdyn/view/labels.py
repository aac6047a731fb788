"""Labels: texts in the scene that face the viewer and do not cover each other."""

from __future__ import annotations

import base64
from html import escape
from typing import Any
from uuid import uuid4

import meshcat.transformations as tf
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

    Attributes:
        centre: of its frame from the point, right and up, shape `(2,)` [pixels of the image].
        half: half the size of the frame, likewise.
    """

    def __init__(self, text: str, colour: int, *, row: float = 0.0, left: bool = False) -> None:
        self.uuid = str(uuid4())
        self.text, self.colour, self.row, self.left = text, colour, row, left
        self.half = PIXELS * np.array([0.2 + 0.17 * len(text), 0.5])
        side = -1 if left else 1
        self.centre = np.array([side * (GAP + self.half[0]), row * PIXELS])

    def lower(self) -> dict[str, Any]:
        """Return the meshcat object: a sprite of three.js, textured with an SVG."""
        material, texture, image = (str(uuid4()) for _ in range(3))
        url = "data:image/svg+xml;base64," + base64.b64encode(self.picture().encode()).decode()
        look = {"sizeAttenuation": False, "depthTest": False, "transparent": True}
        scale = np.diag([*2 * SLOPE * self._reach(), 1.0, 1.0])
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

    def picture(self) -> str:
        """Return the SVG, whose middle is the labelled point."""
        wide, high = self._reach()
        x, y = wide + self.centre[0], high - self.centre[1]
        half, edge = self.half[0], self.half[1] - 3
        line = (
            f'<line x1="{wide:g}" y1="{high:g}" x2="{x + (half if self.left else -half):g}" '
            f'y2="{y:g}" stroke="{INK}" stroke-width="2.5"/>'
        )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{2 * wide:g}" height="{2 * high:g}">'
            f"{line if self.row else ''}"
            f'<rect x="{x - half:g}" y="{y - edge:g}" width="{2 * half:g}" height="{2 * edge:g}" '
            f'rx="10" fill="#ffffff" fill-opacity="0.88" '
            f'stroke="#{self.colour:06x}" stroke-width="4"/>'
            f'<text x="{x:g}" y="{y + 0.2 * PIXELS:g}" text-anchor="middle" '
            f'font-family="system-ui, Helvetica, Arial, sans-serif" '
            f'font-size="{0.6 * PIXELS:g}" fill="{INK}">{escape(self.text)}</text></svg>'
        )

    def _reach(self) -> Array:
        """Return half the size of the image, which contains point and frame [pixels]."""
        return np.asarray(np.abs(self.centre) + self.half + (3, 0))


class LabelLayout:
    """Labels of a camera's picture, placed one after another, the most important first."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._frames: list[tuple[Array, Array]] = []

    def draw(
        self, viewer: Any, text: str, colour: int, point: Array, origin: Array, *, tip: bool = False
    ) -> Label | None:
        """Draw a label for a point, and return it; None where no position beside others is left.

        Args:
            viewer: the label's node.
            text: plain text.
            colour: of its frame, 0xRRGGBB.
            point: shape `(3,)` [m, in the parent of the node].
            origin: of that parent, shape `(3,)` [m, world frame].
            tip: whether an arrow from there ends at the point; then the label stands ahead of it.
        """
        seen = self._camera.project(origin + point)
        ahead = seen - self._camera.project(origin) if tip else np.zeros(2)
        left = bool(ahead[0] < 0.0)
        for row in ROWS:
            # At the other side a label beside the tip would cover the arrow.
            for side in (left, not left) if abs(row) >= 1 or not tip else (left,):
                label = Label(text, colour, row=-row if ahead[1] < 0.0 else row, left=side)
                centre, half = seen + SLOPE * label.centre, SLOPE * label.half
                if self._is_free(centre, half):
                    self._frames.append((centre, half))
                    viewer.set_object(label)
                    viewer.set_transform(tf.translation_matrix(point))
                    return label
        return None

    def _is_free(self, centre: Array, half: Array) -> bool:
        """Return whether a frame lies in the picture and covers no other."""
        inside = (centre - half > LOW).all() and (centre + half < HIGH).all()
        return bool(inside) and not any(
            (abs(centre - other) < half + size - 1e-9).all() for other, size in self._frames
        )
