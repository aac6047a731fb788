"""meshcat scenes in memory, the HTML that shows them without a network, and pictures of it.

`page.html` has the page's style and script; meshcat's own `static_html` needs its server. A page
shows one scene at a time; buttons choose among several. A picture is a screenshot by Chromium, for
which `#picture` at the end of the address hides the slider of the animation.
"""

import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from itertools import count
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import meshcat
import meshcat.transformations as tf
import umsgpack

from kickdyn.core.files import replacing
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.view.camera import LEFT, RIGHT, UP

TEMPLATE = "page.html"
"""The page, beside this file; `html_document` fills in the names between two `@`."""

IDENTIFIER = re.compile(rb"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}")
"""The random name that meshcat gives an object, geometry or material."""

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT = 600.0
"""Longest run of Chromium for one picture [s]."""

# The picture is drawn without a graphics processor, so that it is the same everywhere.
_FLAGS = (
    "--headless=new --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--hide-scrollbars --disable-background-networking --disable-component-update --disable-sync "
    "--no-first-run --virtual-time-budget=3000 --window-size=1280,720"
)


class Recorder:
    """The window into which a `meshcat.Visualizer` draws: it has no socket, server or process."""

    web_url = "in memory"  # the address that a `meshcat.Visualizer` reads; there is none

    def __init__(self) -> None:
        self.commands: list[bytes] = []  # packed, in order
        self.labels: list[str] = []  # HTML
        self.warnings: list[str] = []  # of what could not be drawn, plain text

    def send(self, command: Any) -> None:
        """Record a meshcat command, equal to the bytes of another that does the same."""
        names: dict[bytes, bytes] = {}  # numbers of the same length, in order
        self.commands.append(
            IDENTIFIER.sub(
                lambda name: names.setdefault(name[0], b"%036d" % len(names)),
                umsgpack.packb(command.lower()),
            )
        )


DrawnScene = tuple[Recorder, str, Array | None]
"""The window into which a scene is drawn, the HTML beside it, and the times of the animation and of
the kick that it shows then, shape `(n, 2)` [s]. The kick's time is linear in between; without an
animation there are None."""


def recording_viewer() -> Any:
    """Return a `meshcat.Visualizer` that draws into memory: its `window` is a `Recorder`."""
    return meshcat.Visualizer(window=Recorder())


def draw_label(
    viewer: Any, text: str, point: Array, colour: str = "", *, under_pointer: bool = False
) -> None:
    """Draw a plain text at a point, shape `(3,)` [m], where no other text is in its place.

    With a colour of CSS, the text stands beside the point in a frame of that colour, at all times
    or only while the pointer is at the arrow to that point. `viewer` is the label's node, whose
    parent's origin is the start of that arrow.
    """
    viewer.set_transform(tf.translation_matrix(point))
    kind, style = ("label", f' style="border-color: {colour}"') if colour else ("label mark", "")
    kind += " hover" * under_pointer
    viewer.window.labels.append(
        f'<div class="{kind}" data-node="{viewer.path.lower()}"{style}>{escape(text)}</div>'
    )


class SceneParts(NamedTuple):
    """Scenes as a page has them.

    Attributes:
        numbers: of the packed commands, each of which a page has once.
        scenes: of each, the numbers of its commands in order, and `times` of its animation.
        labels, buttons, panels: HTML.
    """

    numbers: dict[bytes, int]
    scenes: list[dict[str, Any]]
    labels: str
    buttons: str
    panels: str


def scene_parts(
    scenes: Sequence[DrawnScene],
    names: Sequence[str] = (),
    known: Mapping[bytes, int] = MappingProxyType({}),
    first_number: int = 0,
) -> SceneParts:
    """Return the parts of a page.

    Args:
        scenes: that it shows.
        names: plain text of the buttons that choose a scene, one for each of several.
        known: numbers of commands that have one.
        first_number: of the commands that have none.
    """
    numbers: dict[bytes, int] = {}
    next_number = count(first_number)
    recordings, labels, panels = [], [], []
    for index, (window, panel, times) in enumerate(scenes):
        for command in window.commands:
            if command not in numbers:
                numbers[command] = known[command] if command in known else next(next_number)
        recordings.append({
            "commands": [numbers[command] for command in window.commands],
            "times": None if times is None else times.tolist(),
        })  # fmt: skip
        texts = "\n".join(window.labels)
        labels.append(f'<div class="labels scene" data-scene="{index}">\n{texts}\n</div>')
        panels.append(f'<section class="scene" data-scene="{index}">\n{panel}</section>')
    buttons = "".join(f"<button>{escape(name)}</button>\n" for name in names)
    return SceneParts(
        numbers,
        recordings,
        "\n".join(labels),
        f"<nav>\n{buttons}</nav>\n" if len(scenes) > 1 else "",
        "\n".join(panels),
    )


def html_document(
    title: str, scenes: Sequence[DrawnScene], names: Sequence[str] = (), *, is_live: bool = False
) -> str:
    """Return a page that shows the first of some scenes.

    Args:
        title: plain text.
        scenes: that buttons choose among.
        names: plain text of the buttons, one for each of several scenes.
        is_live: whether it takes scenes from the server that it comes from (`View`).
    """
    parts = scene_parts(scenes, names)
    values = {
        "title": escape(title),
        "source": "'self'" if is_live else "'none'",
        "live": str(is_live).lower(),
        "labels": parts.labels,
        "buttons": parts.buttons,
        "panels": parts.panels,
        "engine": _text_of("meshcat", "viewer/dist/main.min.js"),  # with three.js
        "commands": ",\n".join(
            f'"{base64.b64encode(packed).decode()}"' for packed in parts.numbers
        ),
        "scenes": json.dumps(parts.scenes),
        "left": str(LEFT / UP),
        "right": str(RIGHT / UP),
        "spread": str(1.1 * (LEFT + RIGHT) / (2 * UP)),
        "aside": str((RIGHT - LEFT) / 2),
    }
    return re.sub("@([a-z]+)@", lambda name: values[name[1]], _text_of("kickdyn.view", TEMPLATE))


@cache
def _text_of(package: str, name: str) -> str:
    return (files(package) / name).read_text(encoding="utf-8")


def find_browser() -> str:
    """Return the browser that draws pictures, or raise `InvalidInput` if there is none."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise InvalidInput(
            "a picture of a page needs Chromium: install it (Debian package chromium), "
            "or write the page alone"
        )
    return browser


def save_picture(html: str, path: str | PathLike[str], time: float = 0.0) -> None:
    """Write a page as a PNG, at a time from the impact [s].

    Raises:
        InvalidInput: there is no Chromium, or the file cannot be written.
        KickdynError: Chromium failed.
    """
    browser = find_browser()
    with replacing(path) as draft, tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(html, encoding="utf-8")
        command = [
            *(browser, *_FLAGS.split(), f"--user-data-dir={folder}/profile"),
            *(f"--screenshot={draft}", f"{page.as_uri()}#picture&at={time:.9g}"),
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:  # Chromium's sandbox refuses root
            command.insert(1, "--no-sandbox")
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            raise KickdynError(f"{browser} did not end within {TIMEOUT:g} s") from None
        if done.returncode != 0 or not draft.exists():
            reason = f"it ended with {done.returncode}"
            if b"No usable sandbox" in done.stderr:
                reason = "it has no sandbox here: install the Debian package chromium-sandbox"
            raise KickdynError(f"{browser} made no picture: {reason}")
