"""Meshes of a robot: only their triangles and colours.

A mesh may name further files (textures, materials) and could bring any file of this machine into
a page that is passed on. So it is read once, from memory, without access to further files.
"""

import io
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.core.xml_text import parse_xml
from kickdyn.errors import InvalidInput
from kickdyn.robot.package_files import PackageFiles

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it logs what it ignores

FORMATS = (".stl", ".obj", ".dae", ".ply")

MAX_VERTICES = 3_000_000
"""Vertices and triangles of a mesh."""

GREY = "0.4 0.4 0.4 1"
"""Colour of what COLLADA colours by a picture, as trimesh's own without the picture."""

UPRIGHT = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotation from a COLLADA file's axes to z up, by its `up_axis` (COLLADA 1.4.1)."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """One surface of one colour.

    Attributes:
        vertices: shape `(n, 3)` [m, frame of the visual].
        faces: indices of vertices, shape `(m, 3)`.
        rgba: its own colour, 0 to 1; None where the file gives none.
    """

    vertices: Array
    faces: Array
    rgba: Array | None


def read_mesh(files: PackageFiles, filename: str, scale: ArrayLike = 1.0) -> list[Triangles]:
    """Return the surfaces of a mesh that a robot's file names, scaled by a number or by three.

    No file is opened but the one that `files` finds.

    Raises:
        InvalidInput: the mesh is not found, is too large, or cannot be read.
    """
    import trimesh  # takes half a second; most legs have no mesh

    content, ending = files.read_mesh(filename), PurePath(filename).suffix.lower()
    if ending not in FORMATS:
        raise InvalidInput(f"mesh {filename!r} has no known ending: {', '.join(FORMATS)} are read")
    stretch = np.diag(_stretch(filename, scale))
    try:
        if ending == ".dae":
            root = parse_xml(content.decode(errors="replace"))
            _remove_pictures(root)
            content = ElementTree.tostring(root)  # what was checked, not the file's own bytes
            stretch = stretch @ UPRIGHT.get(root.findtext(".//{*}up_axis", "Z_UP"), np.eye(3))
        scene = trimesh.load_scene(io.BytesIO(content), file_type=ending[1:], resolver=None)
        surfaces = list(_surfaces(scene, stretch))
    except Exception as error:  # each format has its own
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InvalidInput(f"mesh {filename!r} cannot be read ({reason})") from None
    if not any(len(surface.faces) for surface in surfaces):
        raise InvalidInput(f"mesh {filename!r} has no triangles")
    return surfaces


def _stretch(filename: str, scale: ArrayLike) -> Array:
    """Return the scale along each axis, shape `(3,)`."""
    stretch = validation.floats(f"scale of mesh {filename!r}", scale)
    if stretch.shape not in ((), (1,), (3,)):
        raise InvalidInput(
            f"mesh {filename!r} has scale {stretch.tolist()}: it must be one number or three"
        )
    return np.broadcast_to(stretch, 3)


def _surfaces(scene: Any, turn: Array) -> Iterator[Triangles]:
    """Yield the surfaces at their positions in the scene, turned and scaled by `turn`."""
    import trimesh

    meshes = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    sizes = [len(m.vertices) + len(m.faces) for m in meshes if isinstance(m, trimesh.Trimesh)]
    if sum(sizes) > MAX_VERTICES:
        raise ValueError(f"it has more than {MAX_VERTICES} vertices and triangles")
    for mesh in scene.dump():
        if isinstance(mesh, trimesh.Trimesh):  # others are lines, or points
            yield Triangles(mesh.vertices @ turn.T, np.asarray(mesh.faces), _colour(mesh))


def _colour(mesh: object) -> Array | None:
    """Return the colour of a surface; None where the file gives none."""
    visual = getattr(mesh, "visual", None)
    if visual is None or not visual.defined:
        return None
    source = visual.material if visual.kind == "texture" else visual
    return np.asarray(source.main_color, dtype=float) / 255.0


def _remove_pictures(root: ElementTree.Element) -> None:
    """Give grey to what a picture colours: without the picture, its surfaces would be lost."""
    for parent in root.iterfind(".//{*}library_effects//*[{*}texture]"):
        for texture in parent.findall("{*}texture"):
            texture.tag = texture.tag.replace("texture", "color")
            texture.text = GREY
            texture.attrib.clear()
            del texture[:]
    for profile in root.iterfind(".//{*}library_effects//*[{*}newparam]"):
        for param in profile.findall("{*}newparam"):
            if param.find("{*}surface") is not None or param.find("{*}sampler2D") is not None:
                profile.remove(param)
