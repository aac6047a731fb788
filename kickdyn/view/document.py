"""meshcat scenes in memory, the HTML that shows them without a network, pictures of it, and glTF.

`page.html` has the page's style and script; meshcat's own `static_html` needs its server. A page
shows one scene at a time; buttons choose among several. A picture is a screenshot by Chromium, for
which `#picture` at the end of the address hides the slider of the animation. Slides, Blender and
viewers of 3-D models open animated glTF.
"""

import base64
import json
import math
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache, partial
from html import escape
from importlib.resources import files
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import meshcat
import meshcat.transformations as tf
import numpy as np
import trimesh
import umsgpack
from scipy.spatial.transform import Rotation

from kickdyn.core.files import FileName, replacing
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError

FIELD_OF_VIEW = 44.0
"""Vertical field of view [deg]."""

UP = math.tan(math.radians(FIELD_OF_VIEW / 2))
LEFT, RIGHT = 0.76 * UP, 1.6 * UP
"""Slopes that bound the scene, in a picture of 16 by 9 with a caption at its left."""


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
            re.sub(  # the random name that meshcat gives an object, geometry or material
                rb"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}",
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
    """Scenes as a page has them: `numbers` of the packed commands, each once, and HTML.

    `scenes` has of each the numbers of its commands in order, and `times` of its animation.
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
    """Return the parts of a page of scenes; commands without a `known` number get further ones."""
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
    """Return a page of scenes that buttons choose; a live one gets them from its server."""
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
    page = _text_of("kickdyn.view", "page.html")  # the names between two `@` are filled in
    return re.sub("@([a-z]+)@", lambda name: values[name[1]], page)


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


def save_picture(html: str, path: FileName, time: float = 0.0) -> None:
    """Write a page as a PNG, at a time from the impact [s]; raise where Chromium cannot."""
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


ROOT = "/meshcat/"

SEGMENTS = 32

Y_UP: Array = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""From axes with z up to the axes of glTF, whose y is up."""

Z_TO_Y: Array = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""A rotation that turns the axis z to y."""


def to_glb(recorder: Recorder) -> bytes:
    """Return the drawing of a recorder as binary glTF, with its animation.

    Bodies, arrows, curves and the ground are meshes with colours, in metres; labels, light and
    shadows are left out. Each path of the recorder is a node with the path as its name, `/` as `_`.
    Before the animation plays, the nodes stand as they were drawn.
    """
    poses: dict[str, Array] = {}
    drawn: dict[str, dict[str, Any]] = {}
    clips: dict[str, dict[str, Any]] = {}
    for packed in recorder.commands:
        command = umsgpack.unpackb(packed)
        path = command.get("path", "").removeprefix(ROOT)
        match command["type"]:
            case "set_transform":
                poses[path] = np.reshape(command["matrix"], (4, 4)).T
            case "set_object" if command["path"].startswith(ROOT):
                drawn[path] = command["object"]
            case "set_animation":
                clips = {clip["path"]: clip["clip"] for clip in command["animations"]}
    scene: Any = trimesh.Scene()
    scene.graph.update("kickdyn", "world", matrix=Y_UP)
    for path, lowered in drawn.items():
        mesh = _mesh(lowered)
        if mesh is None:
            continue
        names, parent = path.split("/"), "kickdyn"
        for depth in range(1, len(names) + 1):
            upper = "/".join(names[:depth])
            name = upper.replace("/", "_")
            scene.graph.update(name, parent, matrix=poses.get(upper, np.eye(4)))
            parent = name
        placement = np.reshape(lowered["object"]["matrix"], (4, 4)).T
        name = f"{parent}_mesh"
        where = {"node_name": name, "parent_node_name": parent, "transform": placement}
        scene.add_geometry(mesh, geom_name=name, **where)
    named = {path.removeprefix(ROOT).replace("/", "_"): clip for path, clip in clips.items()}
    return bytes(scene.export(file_type="glb", buffer_postprocessor=partial(_animate, named)))


def _animate(clips: dict[str, Any], buffers: dict[Any, bytes], tree: dict[str, Any]) -> None:
    """Add clips of meshcat to a tree of glTF, by the names of nodes, and numbers to its buffers."""
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []

    def accessor(numbers: Array) -> int:
        array = np.asarray(numbers, dtype="<f4")
        rows, key = array.reshape(len(array), -1), ("animation", len(buffers))
        tree["accessors"][key] = {
            "bufferView": len(buffers), "componentType": 5126, "count": len(array),  # floats
            "type": "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}",
            "min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist(),
        }  # fmt: skip
        buffers[key] = array.tobytes()
        return len(tree["accessors"]) - 1

    for number, node in enumerate(tree["nodes"]):
        clip = clips.get(node.get("name", ""))
        if clip is None:
            continue
        # an animation cannot move a matrix, only its three factors
        pose = np.reshape(node.pop("matrix", np.eye(4)), (4, 4)).T
        scale = np.linalg.norm(pose[:3, :3], axis=0)
        node["translation"], node["scale"] = pose[:3, 3].tolist(), scale.tolist()
        node["rotation"] = Rotation.from_matrix(pose[:3, :3] / scale).as_quat().tolist()
        for track in clip["tracks"]:
            frames, indices = np.unique([key["time"] for key in track["keys"]], return_index=True)
            values = np.array([track["keys"][k]["value"] for k in indices])
            kinds = {".position": "translation", ".quaternion": "rotation", ".scale": "scale"}
            target = {"node": number, "path": kinds[track["name"]]}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append({"input": accessor(frames / clip["fps"]), "output": accessor(values)})
    if channels:
        tree["animations"] = [{"name": "kick", "channels": channels, "samplers": samplers}]


def _mesh(lowered: dict[str, Any]) -> Any:
    """Return the mesh of an object of meshcat; None for a shadow."""
    (geometry,), (material,) = lowered["geometries"], lowered["materials"]
    if material["type"] == "ShadowMaterial":
        return None
    match geometry["type"]:
        case "BoxGeometry":
            mesh = trimesh.creation.box([geometry[name] for name in ("width", "height", "depth")])
        case "SphereGeometry":
            mesh = trimesh.creation.uv_sphere(geometry["radius"], count=[SEGMENTS, SEGMENTS])
        case "CylinderGeometry":
            height, top, bottom = (geometry[x] for x in ("height", "radiusTop", "radiusBottom"))
            half = 0.5 * height
            profile = [(0.0, -half), (bottom, -half), (top, half), (0.0, half)]
            mesh = trimesh.creation.revolve(profile, sections=SEGMENTS)  # about z; three.js's is y
            mesh.apply_transform(Z_TO_Y)
        case _:
            data = geometry["data"]
            attributes = {name: _array(packed) for name, packed in data["attributes"].items()}
            vertices, faces = attributes["position"], _array(data["index"]).reshape(-1, 3)
            colours = attributes.get("color")
            if colours is not None:  # of the ground, the part that is no backdrop
                size = np.abs(vertices).max(axis=1)
                faces = faces[(size[faces] < 0.5 * size.max()).all(axis=1)]
            mesh = trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False)
            if colours is not None:
                mesh.remove_unreferenced_vertices()
    rgb = int(material.get("color", 0xFFFFFF)).to_bytes(3)
    alpha = round(255 * float(material.get("opacity", 1.0)))
    if not material.get("vertexColors"):
        looks: Any = trimesh.visual
        mesh.visual = looks.TextureVisuals(
            material=looks.material.PBRMaterial(
                baseColorFactor=[*rgb, alpha], metallicFactor=0.0, roughnessFactor=0.8,
                alphaMode="BLEND" if alpha < 255 else "OPAQUE", doubleSided=True,
            )
        )  # fmt: skip
    return mesh


def _array(packed: dict[str, Any]) -> Any:
    extension = packed["array"]
    # types of meshcat's packed arrays, by the code of their extension
    numbers = np.frombuffer(extension.data, {0x16: np.uint32, 0x17: np.float32}[extension.type])
    return np.asarray(numbers.reshape(-1, packed["itemSize"]))
