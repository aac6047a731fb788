"""From an MJCF file, the XML of MuJoCo, to a checked document and to MuJoCo's compiled model.

MuJoCo resolves all that its format allows: classes of defaults, units, inertias of geoms and
meshes, copies, scaled masses. It receives the checked document in memory and opens no file.
"""

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import MjcfError
from kickdyn.robot.names import name_fault
from kickdyn.robot.robot_file import (
    MAX_DEPTH,
    PackageFiles,
    RobotFile,
    Shape,
    Visual,
    list_folders,
    read_xml,
    robot_path,
)
from kickdyn.robot.urdf_file import MAX_MOVING_JOINTS

MAX_ELEMENTS = 100_000
"""XML elements of a model, copies by `<replicate>` included: MuJoCo compiles them in seconds."""

LEAST_MASS = 2e-15
"""Mass [kg] and moments [kg m2] with which MuJoCo takes a body without mass; 0 again after that."""

MESHES = (".stl", ".obj", ".msh")
"""Endings of the mesh files that MuJoCo reads."""

SECTIONS = ("compiler", "option", "default", "asset", "worldbody", "equality", "tendon", "actuator")
"""Sections that say something about the robot's mechanics or shape; the others are not passed on:
`contact`, `custom`, `keyframe`, `sensor`, `size`, `statistic`, `visual`.
"""

REFUSED = {
    "plugin": "plugins of bodies and shapes",
    "composite": "composite bodies",
    "flexcomp": "flexible bodies",
    "deformable": "flexible bodies",
    "attach": "models attached to another",
}
"""Elements that are refused, and their meaning."""

_SHAPES = {
    2: Shape.SPHERE,
    3: Shape.CAPSULE,
    4: Shape.ELLIPSOID,
    5: Shape.CYLINDER,
    6: Shape.BOX,
    7: Shape.MESH,
}
"""By MuJoCo's `geom_type`; planes and terrain are not drawn."""

_TRANSMISSION = ("name", "joint", "jointinparent", "tendon", "site", "body", "gear", "forcerange")
"""Attributes of an actuator that say what it acts on, and with what force at most."""

_UNUSED = ("camera", "light", "texture", "hfield", "skin", "layer", "model")
"""Elements that only a picture, the terrain or another model needs."""

_lock = threading.Lock()  # MuJoCo's handler of warnings belongs to the whole process


@dataclass(frozen=True)
class MjcfFile(RobotFile):
    """An MJCF document that passed every check, its `name`, and its meshes by names in `text`."""

    meshes: dict[str, bytes] = field(default_factory=dict, repr=False)
    name: str = ""

    def compile(self) -> Any:
        """Return the `mujoco.MjModel`, or raise `MjcfError` if MuJoCo refuses it or is missing."""
        try:
            import mujoco  # an optional package
        except ImportError:
            line = 'MJCF needs the package mujoco: install it with pip install "kickdyn[mjcf]"'
            raise MjcfError(self.source, [line]) from None
        try:
            with quiet_mujoco():
                model = mujoco.MjModel.from_xml_string(self.text, self.meshes)
        except Exception as error:  # ValueError; FatalError of a later stage
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            reason = " ".join(lines).removeprefix("XML Error: ").removeprefix("Error: ")[:300]
            line = f"MuJoCo refuses its bodies, joints, tendons and actuators: {reason}"
            raise MjcfError(self.source, [line]) from None
        for array in (model.body_mass, model.body_inertia):
            array[array <= LEAST_MASS] = 0.0
        if model.njnt > MAX_MOVING_JOINTS:
            line = f"has {model.njnt} joints: at most {MAX_MOVING_JOINTS} are read"
            raise MjcfError(self.source, [line])
        return model

    def visuals(self) -> list[Visual]:
        """Return the geoms that MuJoCo's viewer shows first, groups 0 to 2; all without any."""
        compiled = self.compile()
        geoms = [g for g in range(compiled.ngeom) if compiled.geom_bodyid[g]]
        return self._shapes(compiled, [g for g in geoms if compiled.geom_group[g] < 3] or geoms)

    def collisions(self) -> list[Visual]:
        """Return the geoms that collide by their masks, and those of the groups for contacts."""
        compiled = self.compile()
        collide = (compiled.geom_priority != -1) | (compiled.geom_solmix != 0.0)
        collide = (collide | (compiled.geom_group >= 3)) & (compiled.geom_bodyid > 0)
        return self._shapes(compiled, np.flatnonzero(collide).tolist())

    def _shapes(self, compiled: Any, geoms: Iterable[int]) -> list[Visual]:
        """Return the shapes of geoms, those that are transparent and planes left out."""
        shapes = []
        for number in geoms:
            geom = compiled.geom(number)
            kind, size = int(geom.type[0]), geom.size.tolist()
            rgba, material = geom.rgba.tolist(), int(compiled.geom_matid[number])
            if material >= 0 and rgba == [0.5, 0.5, 0.5, 1.0]:  # the default gives way
                rgba = compiled.mat_rgba[material].tolist()
            if kind not in _SHAPES or rgba[3] == 0.0:
                continue
            shape, vertices, faces = _SHAPES[kind], None, None
            if shape in (Shape.CAPSULE, Shape.CYLINDER):
                size = [2 * size[1], size[0]]
            elif shape == Shape.SPHERE:
                size = size[:1]
            elif shape == Shape.BOX:
                size = [2 * edge for edge in size]
            elif shape == Shape.MESH:
                data, size = compiled.mesh(int(compiled.geom_dataid[number])), [1.0]
                begin, count = int(data.vertadr[0]), int(data.vertnum[0])
                vertices = compiled.mesh_vert[begin : begin + count].astype(float)
                begin, count = int(data.faceadr[0]), int(data.facenum[0])
                faces = compiled.mesh_face[begin : begin + count].astype(int)
            pose = mujoco_pose(geom.pos, geom.quat).homogeneous
            body = body_name(compiled, int(geom.bodyid[0]))
            shapes.append(
                Visual(body, pose, shape, tuple(size), "", tuple(rgba), False, vertices, faces)
            )
        return shapes


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Let MuJoCo write no warnings, to the screen and to a file MUJOCO_LOG.TXT."""
    import mujoco

    with _lock:
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(lambda _: None)
        try:
            yield
        finally:
            mujoco.set_mju_user_warning(before)


def mujoco_pose(position: Array, quaternion: Array) -> Any:
    """Return a `pin.SE3` from a position [m] and MuJoCo's quaternion (wxyz)."""
    w, x, y, z = (float(number) for number in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized(), np.array(position, dtype=float))


def body_name(compiled: Any, body: int) -> str:
    """Return the name of a body, by its number where it has none."""
    return str(compiled.body(body).name) or f"body{body}"


def find_body(compiled: Any, frame: str) -> int:
    """Return the number of the body of a body, site or geom; -1 where there is none of the name."""
    import mujoco

    for kind, bodies in (
        (mujoco.mjtObj.mjOBJ_BODY, range(compiled.nbody)),
        (mujoco.mjtObj.mjOBJ_SITE, compiled.site_bodyid),
        (mujoco.mjtObj.mjOBJ_GEOM, compiled.geom_bodyid),
    ):
        number = mujoco.mj_name2id(compiled, kind, frame)
        if number >= 0:
            return int(bodies[number])
    return -1


def is_mjcf(path: str | PathLike[str]) -> bool:
    """Return whether a file is an MJCF, by its root element; if it has none, by its ending."""
    try:
        return read_xml(path, str(path)).tag == "mujoco"
    except ValueError:  # whoever reads it says why
        return Path(path).suffix.lower() in (".xml", ".mjcf")


def read_mjcf(
    path: str | PathLike[str], package_dirs: Iterable[str | PathLike[str]] = ()
) -> MjcfFile:
    """Read and check an MJCF file with all it names, or raise `MjcfError` with the first fault."""
    file, source = robot_path("MJCF", path), str(path)
    try:
        return _checked_file(file, source, list_folders(package_dirs))
    except MjcfError:
        raise
    except ValueError as fault:
        raise MjcfError(source, [str(fault)]) from None


def _checked_file(file: Path, source: str, folders: Iterable[Path]) -> MjcfFile:
    root, folder = read_xml(file, source, MjcfError), file.resolve().parent
    if root.tag == "robot":
        raise ValueError("is a URDF, its root is <robot>: Leg.from_urdf reads it")
    if root.tag != "mujoco":
        raise ValueError(f"is not an MJCF file: its root is <{root.tag[:40]}>, not <mujoco>")
    files = PackageFiles(folder, folders)
    _include(root, files, source, {file.resolve()}, 0)
    _keep_mechanics(root)
    for element in root.iter():
        for key in ("name", "model"):
            if fault := name_fault(f"{element.tag[:40]} {key}", element.get(key, "")):
                raise ValueError(fault)
    elements = _count_elements(root)
    if elements > MAX_ELEMENTS:
        raise ValueError(
            f"has {elements} elements, copies of <replicate> included: at most {MAX_ELEMENTS} "
            "are read"
        )
    meshes = _take_meshes(root, files, folder)  # the document names them anew
    text, name = tostring(root, encoding="unicode"), root.get("model", "") or file.stem
    return MjcfFile(text, folder, source, meshes=meshes, name=name)


def _include(
    element: Element, files: PackageFiles, source: str, included: set[Path], depth: int
) -> None:
    """Replace each `<include file="..."/>` below an element by what the file contains."""
    if depth > MAX_DEPTH:
        raise ValueError(f"nests tags deeper than {MAX_DEPTH}, included files among them")
    for child in list(element):
        if child.tag != "include":
            _include(child, files, source, included, depth + 1)
            continue
        name = child.get("file", "")
        file = files.find(name, "included file")
        if file in included:
            raise ValueError(f"includes {name!r} twice: a file can be included once")
        included.add(file)
        content = read_xml(file, f"{source} includes {name!r}, which", MjcfError)
        _include(content, files, source, included, depth + 1)
        index = list(element).index(child)
        element[index : index + 1] = list(content)


def _take_meshes(root: Element, files: PackageFiles, home: Path) -> dict[str, bytes]:
    """Return the meshes by new names, under which the document has them from now on."""
    folder, strip = home, False
    for compiler in root.iter("compiler"):
        for key in ("assetdir", "meshdir"):
            folder = home / compiler.attrib.pop(key, folder)
        strip = compiler.attrib.pop("strippath", str(strip)).lower() == "true"
    contents: dict[str, bytes] = {}
    meshes = [mesh for mesh in root.iterfind("asset/mesh") if "file" in mesh.attrib]
    for number, mesh in enumerate(meshes):
        name = mesh.attrib["file"].replace("\\", "/")
        path = PurePosixPath(name)
        if path.suffix.lower() not in MESHES:
            raise ValueError(f"mesh {name!r} has no known extension: {', '.join(MESHES)} are read")
        key = f"{number}{path.suffix.lower()}"
        contents[key] = files.read_mesh(path.name if strip else name, folder)
        mesh.attrib.update(name=mesh.get("name") or path.stem, file=key)
    return contents


def _keep_mechanics(root: Element) -> None:
    """Remove sections without mechanics and refuse unsupported elements; only meshes name files.

    Geoms collide with nothing, which spares MuJoCo their convex hulls. Their masks become settings
    that are inherited alike: `contype` the `priority`, 0 for a mask of 1, and `conaffinity` the
    `solmix`.
    """
    for section in list(root):
        if section.tag not in (*REFUSED, *SECTIONS):
            root.remove(section)
    for plugin in root.iterfind("actuator/plugin"):  # what it exerts is not known
        plugin.tag, plugin[:] = "general", []
        for key in set(plugin.attrib) - set(_TRANSMISSION):
            del plugin.attrib[key]
    for element in root.iter():
        if element.tag in REFUSED:
            raise ValueError(f"has <{element.tag}>: {REFUSED[element.tag]} are not read")
        for child in list(element):
            if child.tag in _UNUSED or "hfield" in (child.get("hfield"), child.get("type")):
                element.remove(child)
        if element.tag == "material":
            element.attrib.pop("texture", None)
        elif element.tag == "mesh":
            element.attrib.pop("content_type", None)
        elif element.tag == "flag":
            element.attrib.pop("sensornoise", None)  # MuJoCo has no such flag any more
        for child in element:
            if child.tag == "geom" and element.tag != "spatial":  # a tendon only names its geoms
                _hide_masks(child)
            if element.tag != "asset":
                child.attrib.pop("file", None)
    for compiler in root.iter("compiler"):
        compiler.attrib.pop("texturedir", None)
    # at the end: it holds for the whole model; bodies and geoms keep their names
    fixed = {"fusestatic": "false", "discardvisual": "false", "usethread": "false"}
    for key in ("boundmass", "boundinertia"):  # bodies without mass are judged after joints lock
        if not any(key in compiler.attrib for compiler in root.iter("compiler")):
            fixed[key] = repr(LEAST_MASS)
    root.append(Element("compiler", fixed))


def _hide_masks(geom: Element) -> None:
    """Let a geom, or the default of one, collide with nothing, see `_keep_mechanics`."""
    for name in ("priority", "solmix"):
        geom.attrib.pop(name, None)
    for mask, name, change in (("contype", "priority", -1), ("conaffinity", "solmix", 0)):
        if (text := geom.get(mask)) is not None:
            try:
                geom.set(name, str(int(text) + change))
            except ValueError:
                raise ValueError(f"has a geom of {mask} {text[:40]!r}: it is an integer") from None
        geom.set(mask, "0")


def _count_elements(element: Element) -> int:
    count = 1 + sum(map(_count_elements, element))
    copies = element.get("count", "") if element.tag == "replicate" else ""
    is_number = copies.isascii() and copies.isdigit() and len(copies) < 10
    return count * int(copies) if is_number else count
