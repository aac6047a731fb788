"""The file that a robot was read from, the shapes that it describes, and the files that it names.

A page contains the meshes that it shows, and is passed on; the robot's file may come from anyone.
So one rule holds for all files: one is read if its real path, links followed, lies in a package
that contains the robot's file (in its folder, if no package does), or in a folder that the user or
ROS names. Without a package, meshes are read from folders beside the robot's, too, as from
`meshes/` beside `urdf/`. Of a mesh, only triangles and colours are read, from memory, without
access to further files.
"""

import io
import logging
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml import DefusedXmlException, DTDForbidden
from defusedxml.ElementTree import fromstring

from kickdyn.core import validation
from kickdyn.core.files import check_file, read_text
from kickdyn.core.validation import Array, ArrayLike, brief
from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.robot.joint_table import Mimic

MAX_BYTES = 5_000_000
"""Size of the largest robot file that is read [bytes]; files of robots have up to 0.5 MB."""

MAX_DEPTH = 64
"""Levels of tags of an XML document: parsers of robots' files call themselves at each level."""

MANIFEST = "package.xml"
"""The file that makes a folder a ROS package, and has its name (REP 149)."""


def robot_path(kind: str, path: object) -> Path:
    """Return the path of a robot's file; raise `InvalidInput` if it is none."""
    try:
        return Path(path)  # type: ignore[arg-type]
    except TypeError:
        raise InvalidInput(f"{kind} path is {path!r}: it must be a str or a Path") from None


def read_xml(
    path: str | os.PathLike[str], source: str, error: type[FaultyFile] = FaultyFile
) -> Element:
    """Return the root of an XML file of at most `MAX_BYTES`, by `parse_xml`, or raise `error`."""
    try:
        return parse_xml(read_text(path, source, MAX_BYTES, error))
    except FaultyFile:
        raise
    except ValueError as fault:
        raise error(source, [str(fault)]) from None


def parse_xml(text: str) -> Element:
    """Return the root of an XML document; raise `ValueError` with the reason.

    A document type, with which entities come, is refused. Whatever encoding the document declares,
    it is taken as the text that it is.
    """
    if not text.strip():
        raise ValueError("is empty")
    try:
        root: Element = fromstring(text, forbid_dtd=True)
    except DTDForbidden as error:
        if error.name.lower() == "html":
            raise ValueError("is an HTML page") from None
        raise ValueError("has a DOCTYPE: entities are not expanded, remove it") from None
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise ValueError(f"is not well-formed XML ({error})") from None
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > MAX_DEPTH:
            raise ValueError(f"nests tags deeper than {MAX_DEPTH}")
    return root


def list_folders(package_dirs: Iterable[str | os.PathLike[str]]) -> tuple[Path, ...]:
    """Return folders by their real paths; raise `InvalidInput` where there is none."""
    if isinstance(package_dirs, str | os.PathLike) or not isinstance(package_dirs, Iterable):
        raise InvalidInput(f"package_dirs is {package_dirs!r}: it must be a list of folders")
    folders = tuple(package_dirs)
    for folder in folders:
        if not isinstance(folder, str | os.PathLike) or not os.path.isdir(folder):  # noqa: PTH112
            raise InvalidInput(f"package_dirs names {brief(str(folder))}: there is no such folder")
    return tuple(Path(folder).resolve() for folder in folders)


class PackageFiles:
    """Finds files by the names that a robot's file, in a folder, has for them.

    A name is a path relative to the folder, else to one of `package_dirs`, which are packages
    or contain them; an absolute one, with `file://` or without; or `package://NAME/...`, also
    written `model://NAME/...`. A package is looked up in `package_dirs`, then among the folders
    that contain the robot's file, then in the folders of ROS.
    """

    def __init__(self, folder: Path, package_dirs: Iterable[Path] = ()) -> None:
        self._folder = folder.resolve()
        containing = [self._folder, *self._folder.parents]
        self._packages = [path for path in containing if _package_name(path) is not None]
        # folders above a robot's file, its own included, that can be a package without a manifest
        self._near = containing[:4]
        self._dirs = [path.resolve() for path in package_dirs]

    def find(self, name: str, what: str = "mesh", folder: Path | None = None) -> Path:
        """Return the real path of a file by the name that the robot's file has for it.

        `what` it is, is for errors; a relative path starts in `folder`, that of the robot's file as
        a default. Raises `MissingFile`, or `InvalidInput` for a place that may not be read.
        """
        scheme, mark, path = name.partition("://")
        if not mark:
            place = (folder or self._folder) / name
            ends = [name, os.path.relpath(place, self._folder)]
            paths = [Path(os.path.normpath(named / end)) for named in self._dirs for end in ends]
            inside = [p for p in paths if any(p.is_relative_to(named) for named in self._dirs)]
            # any text may be a name
            present = [path for path in (place, *inside) if os.path.isfile(path)]  # noqa: PTH113
            return self._first(name, what, present or [place])
        if scheme == "file" and path.startswith("/"):
            return self._first(name, what, [Path(unquote(path))])
        if scheme not in ("package", "model"):
            raise InvalidInput(f"{what} {name!r} is refused: only files are read, no addresses")
        package, _, below = path.lstrip("/").partition("/")
        for place in self._places(package):
            if os.path.isdir(place):  # noqa: PTH112 any text may be a name
                return self._first(name, what, [place / below.lstrip("/")])
        for place in self._near:  # packages from pip have no manifest
            if place.name == package and (place / below).exists():
                return self._first(name, what, [place / below.lstrip("/")], place)
        # without a manifest, the folder of the robot's file may be the package, or contain it
        paths = [self._folder / inner.lstrip("/") for inner in (path, below) if inner.strip("/")]
        try:
            return self._first(name, what, paths)
        except MissingFile:
            raise MissingFile(
                f"{what} {name!r} is missing: package {package!r} is unknown; name the package's "
                "folder, or the folder that contains it under that name, in package_dirs= or "
                "--package-dir, or in the environment variable ROS_PACKAGE_PATH"
            ) from None

    def read_mesh(self, name: str, folder: Path | None = None) -> bytes:
        """Return the content of a mesh; raise `InvalidInput` as `find`, or if it is too large."""
        path = self.find(name, folder=folder)
        # size of the largest mesh that is read [bytes]: an STL file of two million triangles
        check_file(path, f"mesh {name!r}", 100_000_000, FaultyFile)
        return path.read_bytes()

    def _first(self, name: str, what: str, paths: list[Path], package: Path | None = None) -> Path:
        """Return the real path of the first file that exists, if all may be read."""
        roots = [*(self._packages or [package or self._folder]), *self._dirs, *self._ros]
        beside = self._folder.parent if what == "mesh" and not self._packages else None
        try:
            real = [path.resolve() for path in paths]
            present = [path for path in real if path.exists()]
        except (OSError, ValueError, RuntimeError) as error:  # links in a circle, a NUL
            raise InvalidInput(f"{what} {name!r} cannot be found ({error})") from None
        for path in real:
            is_beside = beside is not None and beside in path.parent.parents
            if not is_beside and not any(path.is_relative_to(root) for root in roots):
                raise InvalidInput(
                    f"{what} {name!r} is refused: it lies outside {roots[0]}, the folder or ROS "
                    "package of the robot's file; package_dirs= or --package-dir names its folder"
                )
        if not present:
            place = str(paths[0]).removesuffix(name.rpartition("://")[2]).rstrip("/") or roots[0]
            raise MissingFile(
                f"{what} {name!r} is missing from {place}; package_dirs= or --package-dir names "
                "its folder"
            )
        return present[0]

    def _places(self, package: str) -> list[Path]:
        if package in ("", ".", ".."):
            return []

        def in_or_below(folders: list[Path]) -> list[Path]:
            return [path for folder in folders for path in (*named([folder]), folder / package)]

        def named(folders: list[Path]) -> list[Path]:
            return [path for path in folders if package in (path.name, _package_name(path))]

        return [*in_or_below(self._dirs), *named(self._packages), *in_or_below(self._ros)]

    @cached_property
    def _ros(self) -> list[Path]:
        """The folders of packages that the environment names, of ROS 1 and of ROS 2."""
        folders = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        named = [Path(path) for path in folders if path]
        named += [Path(path) / "share" for path in prefixes if path]
        return [path.resolve() for path in named if path.is_absolute()]


class MissingFile(InvalidInput):
    """A robot's file names a file that does not exist."""


def _package_name(folder: Path) -> str | None:
    """Return the name of the ROS package that a folder is; None if it is none."""
    manifest = folder / MANIFEST
    try:
        root = read_xml(manifest, str(manifest))
    except ValueError:  # there is none, or it cannot be read
        return None
    return (root.findtext("name") or "").strip() if root.tag == "package" else None


logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it logs what it ignores

FORMATS = (".stl", ".obj", ".dae", ".ply")

MAX_VERTICES = 3_000_000
"""Vertices and triangles of a mesh."""

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
        mimics: joints that the file lets move with another, which may itself mimic a third one.
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
        """Return the shapes that the file draws; raise `InvalidInput` if unreadable."""
        return []

    def collisions(self) -> list[Visual]:
        """Return the shapes that the file has for contacts, likewise."""
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
    """A surface: vertices `(n, 3)` [m, frame of the visual], faces `(m, 3)`, and colour or None."""

    vertices: Array
    faces: Array
    rgba: Array | None


def read_mesh(files: PackageFiles, filename: str, scale: ArrayLike = 1.0) -> list[Triangles]:
    """Return the surfaces of a mesh, scaled by one number or three, or raise `InvalidInput`."""
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
    import trimesh

    meshes = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    sizes = [len(m.vertices) + len(m.faces) for m in meshes if isinstance(m, trimesh.Trimesh)]
    if sum(sizes) > MAX_VERTICES:
        raise ValueError(f"it has more than {MAX_VERTICES} vertices and triangles")
    for mesh in scene.dump():
        if isinstance(mesh, trimesh.Trimesh):  # others are lines, or points
            look: Any = mesh.visual
            colour = None
            if look is not None and look.defined:
                source = look.material if look.kind == "texture" else look
                colour = np.asarray(source.main_color, dtype=float) / 255.0
            yield Triangles(mesh.vertices @ turn.T, np.asarray(mesh.faces), colour)


def _remove_pictures(root: ElementTree.Element) -> None:
    """Give grey to surfaces that a picture colours: without it, they would be lost."""
    for parent in root.iterfind(".//{*}library_effects//*[{*}texture]"):
        for texture in parent.findall("{*}texture"):
            texture.tag = texture.tag.replace("texture", "color")
            # colour of surfaces that COLLADA colours by a picture, as trimesh's own without the
            # picture
            texture.text = "0.4 0.4 0.4 1"
            texture.attrib.clear()
            del texture[:]
    for profile in root.iterfind(".//{*}library_effects//*[{*}newparam]"):
        for param in profile.findall("{*}newparam"):
            if param.find("{*}surface") is not None or param.find("{*}sampler2D") is not None:
                profile.remove(param)
