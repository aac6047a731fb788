"""The file that a robot was read from, the shapes that it describes, and their meshes.

Of a mesh, only triangles and colours are read, from memory, without access to further files: it
could bring any file of this machine into a page that is passed on.
"""

import io
import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path, PurePath
from typing import Any
from xml.etree import ElementTree

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.robot.joint_table import Mimic
from kickdyn.robot.package_files import PackageFiles, parse_xml

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it logs what it ignores

FORMATS = (".stl", ".obj", ".dae", ".ply")

MAX_VERTICES = 3_000_000
"""Vertices and triangles of a mesh."""

GREY = "0.4 0.4 0.4 1"
"""Colour of surfaces that COLLADA colours by a picture, as trimesh's own without the picture."""

UPRIGHT = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotation from a COLLADA file's axes to z up, by its `up_axis` (COLLADA 1.4.1)."""


class Shape(StrEnum):
    """Kinds of visuals, and the meaning of their `size` [m]."""

    BOX = "box"  # lengths of the edges along x, y and z
    SPHERE = "sphere"  # radius
    ELLIPSOID = "ellipsoid"  # radii along x, y and z
    CYLINDER = "cylinder"  # length along z and radius
    CAPSULE = "capsule"  # length along z without the two ends, and radius
    MESH = "mesh"  # scale of the file's own lengths, one number or three, without a unit


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape fixed to a frame of a robot, as the robot's file describes it, unchecked.

    Attributes:
        frame: name of the frame in the model, such as a link.
        pose: of the shape in that frame, shape `(4, 4)` [m].
        shape: the kind.
        size: see `Shape`.
        mesh: name of the mesh file as it is written; empty for other shapes.
        rgba: colour, 0 to 1; None if the file gives none.
        has_texture: whether the file colours it by a picture, which is not read.
        vertices, faces: of a mesh that was read with the robot's file, in place of `mesh`: shape
            `(n, 3)` [m, frame of the visual], and indices of vertices, shape `(m, 3)`.
    """

    frame: str
    pose: Array
    shape: Shape
    size: tuple[float, ...] = (1.0,)
    mesh: str = ""
    rgba: tuple[float, ...] | None = None
    has_texture: bool = False
    vertices: Array | None = None
    faces: Array | None = None


@dataclass(frozen=True)
class RobotFile:
    """The text of a robot's file that passed every check, and where it came from.

    Attributes:
        text: the document as it was checked; everything later is read from it, never from the file
            again.
        folder: the folder of the file, for its meshes.
        source: the file as the caller named it.
        package_dirs: ROS packages, or folders that contain them, for meshes named `package://`.
        mimics: joints that the file lets move with another, each with a driver that does not.
        warnings: a line for each kind of irregularity with which the file was read.
        passive_joints: joints that a file with actuators does not drive; none where that is not
            known.
        lacks_drives: whether drives that the file should have were not given either.
    """

    text: str
    folder: Path
    source: str
    package_dirs: tuple[Path, ...] = ()
    mimics: tuple[Mimic, ...] = ()
    warnings: tuple[str, ...] = ()
    passive_joints: tuple[str, ...] = ()
    lacks_drives: bool = False

    def visuals(self) -> list[Visual]:
        """Return the shapes that the file describes; raise `InvalidInput` if unreadable."""
        return []

    def collisions(self) -> list[Visual]:
        """Return the shapes that the file has for contacts; raise `InvalidInput` as `visuals`."""
        return []

    @cached_property
    def visuals_by_frame(self) -> dict[str, list[Visual]]:
        """The shapes by the frame that they are fixed to; none where they are unreadable."""
        return _by_frame(self.visuals)

    @cached_property
    def collisions_by_frame(self) -> dict[str, list[Visual]]:
        """The shapes for contacts by frame; none where they are unreadable."""
        return _by_frame(self.collisions)


def _by_frame(read: Callable[[], list[Visual]]) -> dict[str, list[Visual]]:
    by_frame: dict[str, list[Visual]] = {}
    with suppress(InvalidInput):  # a page of the leg says why
        for shape in read():
            by_frame.setdefault(shape.frame, []).append(shape)
    return by_frame


@dataclass(frozen=True, eq=False)
class Triangles:
    """One surface of one colour.

    Attributes:
        vertices: shape `(n, 3)` [m, frame of the visual].
        faces: indices of vertices, shape `(m, 3)`.
        rgba: its own colour, 0 to 1; None if the file gives none.
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
        raise InvalidInput(
            f"mesh {filename!r} has no known extension: {', '.join(FORMATS)} are read"
        )
    try:
        scales = validation.floats("its scale", scale)
        if scales.size not in (1, 3):
            raise ValueError(f"its scale is {scales.tolist()}: it must be one number or three")
        stretch = np.diag(np.broadcast_to(scales, 3))
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
    visual = getattr(mesh, "visual", None)
    if visual is None or not visual.defined:
        return None
    source = visual.material if visual.kind == "texture" else visual
    return np.asarray(source.main_color, dtype=float) / 255.0


def _remove_pictures(root: ElementTree.Element) -> None:
    """Give grey to surfaces that a picture colours: without it, they would be lost."""
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
