"""From an MJCF file (MuJoCo's XML) to one checked document with its meshes, without MuJoCo."""

import stat
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

from kickdyn.core.files import read_text
from kickdyn.errors import InvalidInput, MjcfError
from kickdyn.robot.urdf_file import MAX_BYTES, MAX_DEPTH, parse_xml
from kickdyn.robot.urdf_validation import MAX_LINKS, MAX_MOVING_JOINTS, MAX_NAME

MAX_FILES = 200
"""Files that a model may include, and meshes that it may name."""

MAX_MESH_BYTES = 50_000_000
"""Size of a mesh file; all meshes of a model together may have ten times as much."""

MESHES = (".stl", ".obj", ".msh")
"""Endings of the mesh files that MuJoCo reads."""

SECTIONS = ("compiler", "option", "default", "asset", "worldbody", "equality", "tendon", "actuator")
"""Sections that say something about the robot's mechanics or shape; the others are not passed on:
`contact`, `custom`, `keyframe`, `sensor`, `size`, `statistic`, `visual`.
"""

REFUSED = {
    "extension": "plugins",
    "plugin": "plugins",
    "composite": "composite bodies",
    "flexcomp": "flexible bodies",
    "deformable": "flexible bodies",
    "attach": "models attached to another",
}
"""Elements that are refused, and what they stand for."""

_UNUSED = ("camera", "light", "texture", "hfield", "skin", "layer", "model")
"""Elements that only a picture, the terrain or another model needs."""


@dataclass(frozen=True)
class MjcfFile:
    """An MJCF document that passed every check, with the meshes that it names.

    Attributes:
        text: the document, included files in their places; MuJoCo needs no other file to read it.
        meshes: content of the mesh files, by the names that they have in `text`.
        missing: mesh files that do not exist, by those names; `text` names them all the same.
        name: of the model.
        source: the file as the caller named it.
    """

    text: str
    meshes: dict[str, bytes] = field(repr=False)
    missing: dict[str, str]
    name: str
    source: str


def read_mjcf(path: str | PathLike[str]) -> MjcfFile:
    """Read and check an MJCF file, the files that it includes, and its meshes.

    Included files and meshes are read from the file's own folder and the folders below it only.

    Raises:
        MjcfError: with the first fault of the file.
        InvalidInput: `path` is no path at all.
    """
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"MJCF path is {path!r}: it must be a str or a Path") from None
    try:
        return _Reader(file, source).read()
    except ValueError as fault:
        if isinstance(fault, InvalidInput):
            raise
        raise MjcfError(source, [str(fault)]) from None


class _Reader:
    """Reads one model; faults are raised as `ValueError`."""

    def __init__(self, file: Path, source: str) -> None:
        self.file, self.source = file, source
        self.folder = file.resolve().parent
        self.read_bytes = 0
        self.included: set[Path] = set()

    def read(self) -> MjcfFile:
        """Return the checked document."""
        root = self._parse(self.file, self.source)
        if root.tag == "robot":
            raise ValueError("is a URDF, its root is <robot>: Leg.from_urdf reads it")
        if root.tag != "mujoco":
            raise ValueError(f"is not an MJCF: its root is <{root.tag[:40]}>, not <mujoco>")
        self._include(root, 0)
        _keep_mechanics(root)
        _check_size(root)
        _check_names(root)
        name = root.get("model", "") or self.file.stem
        return MjcfFile(_written(root), *self._take_meshes(root), name, self.source)

    def _parse(self, file: Path, shown: str) -> Element:
        """Return the root of a file; the files of a model have at most `MAX_BYTES` together."""
        text = read_text(file, shown, MAX_BYTES - self.read_bytes, MjcfError)
        self.read_bytes += len(text)
        try:
            return parse_xml(text)
        except ValueError as fault:
            raise MjcfError(shown, [str(fault)]) from None

    def _include(self, element: Element, depth: int) -> None:
        """Replace each `<include file="..."/>` below an element by what the file contains."""
        if depth > MAX_DEPTH:
            raise ValueError(f"nests tags deeper than {MAX_DEPTH}, included files among them")
        children = list(element)
        for child in children:
            if child.tag != "include":
                self._include(child, depth + 1)
                continue
            name = child.get("file", "")
            file = self._inside("included file", name, self.folder)
            if file is None:
                raise ValueError(f"includes {name!r}: there is no such file")
            if file in self.included or file == self.file.resolve():
                raise ValueError(f"includes {name!r} twice: a file can be included once")
            self.included.add(file)
            if len(self.included) > MAX_FILES:
                raise ValueError(f"includes more than {MAX_FILES} files")
            inner = self._parse(file, f"{self.source} includes {name!r}, which")
            self._include(inner, depth + 1)
            at = list(element).index(child)
            element[at : at + 1] = list(inner)

    def _inside(self, what: str, name: str, folder: Path) -> Path | None:
        """Return a regular file in the model's folder, links followed; None if it is missing."""
        if not name or "://" in name:
            raise ValueError(f"{what} {name!r} is refused: it must be the name of a file")
        try:
            file = (folder / name).resolve()
            if not file.is_relative_to(self.folder):
                raise ValueError(
                    f"{what} {name!r} is refused: it lies outside the model's folder {self.folder}"
                )
            if not file.exists():
                return None
            regular = stat.S_ISREG(file.stat().st_mode)  # a FIFO would block for ever
        except (OSError, RuntimeError) as error:  # a loop of links
            raise ValueError(f"{what} {name!r} cannot be found ({error})") from None
        if not regular:
            raise ValueError(f"{what} {name!r} is not a regular file")
        return file

    def _take_meshes(self, root: Element) -> tuple[dict[str, bytes], dict[str, str]]:
        """Return the meshes that exist and the names of those that do not; rename them."""
        folder, strip = self.folder, False
        for compiler in root.iter("compiler"):
            for key in ("assetdir", "meshdir"):
                folder = self.folder / compiler.attrib.pop(key, folder)
            strip = compiler.attrib.pop("strippath", str(strip)).lower() == "true"
        content: dict[str, bytes] = {}
        missing: dict[str, str] = {}
        meshes = [mesh for mesh in root.iterfind("asset/mesh") if "file" in mesh.attrib]
        if len(meshes) > MAX_FILES:
            raise ValueError(f"names {len(meshes)} meshes: at most {MAX_FILES} are read")
        for number, mesh in enumerate(meshes):
            name = mesh.attrib["file"].replace("\\", "/")
            if strip:
                name = name.rpartition("/")[2]
            file = self._inside("mesh", name, folder)
            ending = Path(name).suffix.lower()
            if ending not in MESHES:
                raise ValueError(f"mesh {name!r} has no known ending: {', '.join(MESHES)} are read")
            mesh.set("name", mesh.get("name") or Path(name).stem)
            if file is None:
                mesh.set("file", f"{number}.obj")
                missing[f"{number}.obj"] = name
                continue
            mesh.set("file", short := f"{number}{ending}")
            size, used = file.stat().st_size, sum(map(len, content.values()))
            if size > MAX_MESH_BYTES or used + size > 10 * MAX_MESH_BYTES:
                raise ValueError(
                    f"mesh {name!r} has {size} bytes: at most {MAX_MESH_BYTES} are read, and ten "
                    "times as many of all meshes"
                )
            content[short] = file.read_bytes()
        return content, missing


def _keep_mechanics(root: Element) -> None:
    """Remove what describes no robot, and refuse what is not read; nothing names a file but meshes.

    Geoms collide with nothing, which spares MuJoCo their convex hulls.
    """
    for section in list(root):
        if section.tag in REFUSED or section.tag in SECTIONS:
            continue
        root.remove(section)
    for element in root.iter():
        if element.tag in REFUSED:
            raise ValueError(f"has <{element.tag}>: {REFUSED[element.tag]} are not read")
        for child in list(element):
            if child.tag in _UNUSED or "hfield" in (child.get("hfield"), child.get("type")):
                element.remove(child)
        if element.tag == "material":
            element.attrib.pop("texture", None)
        elif element.tag == "mesh" and "builtin" in element.attrib:
            raise ValueError("has a builtin mesh: only meshes of files and vertices are read")
        elif element.tag == "geom":
            element.attrib.update(contype="0", conaffinity="0")
        if element.tag == "mesh":
            element.attrib.pop("content_type", None)
        if element.tag != "asset":
            for child in element:
                child.attrib.pop("file", None)
    for compiler in root.iter("compiler"):
        compiler.attrib.pop("texturedir", None)
    # at the end: it holds for the whole model; bodies and geoms keep their names
    fixed = {"fusestatic": "false", "discardvisual": "false", "usethread": "false"}
    root.append(Element("compiler", fixed))


def _check_size(root: Element) -> None:
    """Raise `ValueError` for more bodies or joints than can be computed, copies included."""

    def count(element: Element) -> dict[str, int]:
        """Return how many of some elements there are, those that are replicated included."""
        total = {"body": 0, "joint": 0, "geom": 0, "site": 0}
        tag = "joint" if element.tag == "freejoint" else element.tag
        if tag in total:
            total[tag] = 1
        for child in element:
            for key, number in count(child).items():
                total[key] += number
        if element.tag == "replicate":
            copies = _whole(element.get("count", "1"))
            total = {key: copies * number for key, number in total.items()}
        return total

    for world in root.iterfind("worldbody"):
        for key, number in count(world).items():
            most = MAX_MOVING_JOINTS if key == "joint" else MAX_LINKS
            if number > most:
                raise ValueError(f"has {number} of <{key}>: at most {most} are read")


def _whole(text: str) -> int:
    """Return the number of copies that a text says; raise `ValueError`."""
    if not (text.isascii() and text.isdigit() and len(text) < 7):
        raise ValueError(f"has <replicate count={text[:40]!r}>: it must be a whole number")
    return int(text)


def _check_names(root: Element) -> None:
    """Raise `ValueError` for a name that cannot be shown."""
    for element in root.iter():
        for key in ("name", "class", "childclass", "dclass", "model"):
            name = element.get(key, "")
            if len(name) > MAX_NAME or not name.isprintable():
                raise ValueError(
                    f"{element.tag[:40]} {key} {name[:40]!r} is not a printable name of at most "
                    f"{MAX_NAME} characters"
                )
            if key == "name" and name == "universe":
                raise ValueError(f"{element.tag[:40]} name 'universe' is Pinocchio's own")


def _written(root: Element) -> str:
    """Return a document as text."""
    text: Any = tostring(root, encoding="unicode")
    return str(text)
