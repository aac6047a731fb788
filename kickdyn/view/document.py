"""meshcat scenes in memory, and the HTML that shows them: one file that needs no network.

`page.html` has the page's style and script; meshcat's own `static_html` needs its server.
A page shows one scene at a time; buttons choose among several. At the end of the page's address,
`#scene=2&at=1.5` shows the third scene and stops its animation at 1.5 s, `#picture` hides the
slider of the animation, and `#controls` shows meshcat's own controls.
"""

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

import meshcat
import meshcat.transformations as tf
import umsgpack

from kickdyn.core.validation import Array
from kickdyn.view.camera import LEFT, RIGHT, UP

TEMPLATE = "page.html"
"""The page, beside this file; `html_document` fills in the names between two `@`."""

IDENTIFIERS = ("uuid", "geometry", "material")
"""Keys of three.js's objects whose values are identifiers."""


class Recorder:
    """The window into which a `meshcat.Visualizer` draws: it has no socket, server or process."""

    web_url = "in memory"  # the address that a `meshcat.Visualizer` reads; there is none

    def __init__(self) -> None:
        """Start without commands, labels and warnings."""
        self.commands: list[bytes] = []  # packed, in order
        self.labels: list[str] = []  # HTML
        self.warnings: list[str] = []  # of what could not be drawn, plain text

    def send(self, command: Any) -> None:
        """Record a meshcat command, equal to the bytes of another that does the same."""
        self.commands.append(umsgpack.packb(_renumbered(command.lower(), {})))


def _renumbered(value: Any, known: dict[str, str]) -> Any:
    """Return a command with numbers, in order, for the random identifiers of its objects."""
    if isinstance(value, list):
        return [_renumbered(item, known) for item in value]
    if not isinstance(value, dict):
        return value
    return {
        key: known.setdefault(item, f"{len(known)}")
        if key in IDENTIFIERS and isinstance(item, str)
        else _renumbered(item, known)
        for key, item in value.items()
    }


@dataclass(frozen=True, eq=False)
class Recording:
    """A scene as a page shows it.

    Attributes:
        viewer: the `meshcat.Visualizer` of `recording_viewer` into which the scene is drawn.
        panel: HTML beside it.
        times: of the animation, and of the kick that it shows then, shape `(n, 2)` [s]; the kick's
            time is linear in between. None where nothing moves.
    """

    viewer: Any
    panel: str
    times: Array | None = None


def recording_viewer() -> Any:
    """Return a `meshcat.Visualizer` that draws into memory: its `window` is a `Recorder`."""
    return meshcat.Visualizer(window=Recorder())


def draw_label(viewer: Any, text: str, colour: str, point: Array) -> None:
    """Draw a plain text beside a point, shape `(3,)` [m], in a frame of a colour of CSS.

    `viewer` is the label's node, whose parent's origin is the start of the arrow to that point.
    """
    viewer.set_transform(tf.translation_matrix(point))
    viewer.window.labels.append(
        f'<div class="label" data-node="{viewer.path.lower()}" style="border-color: {colour}">'
        f"{escape(text)}</div>"
    )


def draw_mark(viewer: Any, text: str, point: Array) -> None:
    """Draw a plain text at a point, shape `(3,)` [m], where no other text is in its place."""
    viewer.set_transform(tf.translation_matrix(point))
    viewer.window.labels.append(
        f'<div class="label mark" data-node="{viewer.path.lower()}">{escape(text)}</div>'
    )


def html_document(title: str, recordings: Mapping[str, Recording]) -> str:
    """Return a page with a title in plain text that shows the first of some scenes.

    Of several, there is a button for each, with its name in plain text.
    """
    numbers: dict[bytes, int] = {}  # of commands; each command is on the page once
    scenes, labels, panels = [], [], []
    for index, recording in enumerate(recordings.values()):
        window, times = recording.viewer.window, recording.times
        scenes.append({
            "commands": [numbers.setdefault(c, len(numbers)) for c in window.commands],
            "times": None if times is None else times.tolist(),
        })  # fmt: skip
        texts = "\n".join(window.labels)
        labels.append(f'<div class="labels scene" data-scene="{index}">\n{texts}\n</div>')
        panels.append(f'<section class="scene" data-scene="{index}">\n{recording.panel}</section>')
    buttons = "".join(f"<button>{escape(name)}</button>\n" for name in recordings)
    values = {
        "title": escape(title),
        "labels": "\n".join(labels),
        "buttons": f"<nav>\n{buttons}</nav>\n" if len(recordings) > 1 else "",
        "panels": "\n".join(panels),
        "engine": _read("meshcat", "viewer/dist/main.min.js"),  # with three.js
        "commands": ",\n".join(f'"{base64.b64encode(packed).decode()}"' for packed in numbers),
        "scenes": json.dumps(scenes),
        "left": str(LEFT / UP),
        "right": str(RIGHT / UP),
        "spread": str(1.1 * (LEFT + RIGHT) / (2 * UP)),
        "aside": str((RIGHT - LEFT) / 2),
    }
    return re.sub("@([a-z]+)@", lambda name: values[name[1]], _read("kickdyn.view", TEMPLATE))


@cache
def _read(package: str, name: str) -> str:
    """Return a text file of a package."""
    return (files(package) / name).read_text(encoding="utf-8")
