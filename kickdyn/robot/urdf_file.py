"""From a URDF file to a Pinocchio model: safe reading, checks, and what Pinocchio reports."""

import io
import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from kickdyn.core.files import read_text, shipped
from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.robot.urdf_validation import find_faults, find_irregularities
from kickdyn.robot.visuals import RobotFile, Shape, Visual

MAX_BYTES = 20_000_000

MAX_DEPTH = 64
"""Levels of tags of an XML document."""

MAX_MARKS = 200_000
"""Tags and attributes of a document, counted as its `<` and `=`: half a second of parsing."""

MAX_ATTRIBUTES, MAX_VALUE = 100, 10_000
"""Attributes of a tag, and characters of one of them."""


class UrdfFile(RobotFile):
    """A URDF that passed every check, its text written out anew."""

    def visuals(self) -> list[Visual]:
        """Return the visuals of all links; raise `InvalidInput` if they are unreadable."""
        import yourdfpy  # takes half a second; only pages need it

        try:
            robot = yourdfpy.URDF.load(
                io.BytesIO(self.text.encode()), build_scene_graph=False, load_meshes=False
            ).robot
        except Exception as error:  # yourdfpy has no error of its own for a bad file
            raise InvalidInput(f"{self.source}: its visuals cannot be read ({error})") from None
        visuals = [(link.name, visual) for link in robot.links for visual in link.visuals]
        materials = [visual.material for _, visual in visuals if visual.material]
        colours = {m.name: m.color.rgba for m in [*materials, *robot.materials] if m.color}
        found = []
        for link, visual in visuals:
            material = visual.material
            rgba = colours.get(material.name) if material else None
            if material and material.color:
                rgba = material.color.rgba
            found.append(
                Visual(
                    link,
                    np.eye(4) if visual.origin is None else visual.origin,
                    *_shape(visual.geometry),
                    rgba=None if rgba is None else tuple(rgba),
                    has_texture=material is not None and material.texture is not None,
                )
            )
        return found

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for each kind of irregularity with which the file was read; none was repaired."""
        return tuple(find_irregularities(ElementTree.fromstring(self.text)))


def read_urdf(path: str | PathLike[str]) -> UrdfFile:
    """Read and check a URDF file.

    Raises:
        UrdfError: with all faults of the file in one message.
        InvalidInput: `path` is no path at all.
    """
    urdf = read_document(path)
    faults = find_faults(ElementTree.fromstring(urdf.text))
    if faults:
        raise UrdfError(urdf.source, faults)
    return urdf


def read_document(path: str | PathLike[str]) -> UrdfFile:
    """Read a URDF file as `read_urdf` does, without checking the robot that it describes."""
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"URDF path is {path!r}: it must be a str or a Path") from None
    document = read_text(file, source, MAX_BYTES, UrdfError)
    try:
        root = parse_xml(document)
    except ValueError as error:
        raise UrdfError(source, [str(error)]) from None
    # Written anew, so that Pinocchio's parser reads exactly what was checked: by itself it keeps
    # line ends inside a name, for one.
    text = ElementTree.tostring(root, encoding="unicode")
    return UrdfFile(text, file.resolve().parent, source)


def build_model(text: str, source: str, base: str) -> Any:
    """Return the `pin.Model` of a URDF.

    Args:
        text: the document.
        source: its name, for errors.
        base: `fixed` welds the root link to the world; `floating` lets it move, as the first
            joint, `root_joint`, of seven coordinates (position, quaternion xyzw) and six
            velocities (linear, angular, in the base's own axes).

    Raises:
        UrdfError: Pinocchio refuses it, or complains, or no joint moves.
        InvalidInput: an unknown base.
    """
    check_base(base)
    root = (pin.JointModelFreeFlyer(),) if base == "floating" else ()
    with _captured_stderr() as lines:
        try:
            model = pin.buildModelFromXML(text, *root)
        except Exception as error:
            model, reason = None, str(error).strip().splitlines()[0]
    said = (line.strip()[:200] for line in lines if not line.strip().startswith("at line "))
    complaints = [each for line in said if (each := line.removeprefix("Error:").strip())]
    if model is None:
        raise UrdfError(source, ["Pinocchio cannot read it", *(complaints or [reason])])
    if complaints:
        raise UrdfError(source, ["Pinocchio complains", *complaints])
    if model.nv == 0:
        raise UrdfError(source, ["has no moving joint"])
    return model


def _shape(geometry: Any) -> tuple[Shape, tuple[float, ...], str]:
    """Return the shape of a geometry of yourdfpy, its size and the name of its mesh."""
    if geometry.box:
        return Shape.BOX, tuple(geometry.box.size.tolist()), ""
    if geometry.sphere:
        return Shape.SPHERE, (geometry.sphere.radius,), ""
    if geometry.cylinder:
        return Shape.CYLINDER, (geometry.cylinder.length, geometry.cylinder.radius), ""
    scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
    return Shape.MESH, tuple(np.atleast_1d(scale)), geometry.mesh.filename


def shipped_urdf(name: str) -> Path:
    """Return the path of a URDF that comes with kickdyn."""
    return shipped("urdf") / name


def check_base(base: str) -> None:
    """Raise `InvalidInput` for a base that is neither fixed nor floating."""
    if not isinstance(base, str) or base not in ("fixed", "floating"):
        raise InvalidInput(f"base is {base!r}: it must be fixed or floating")


class _StrictBuilder(ElementTree.TreeBuilder):
    """Builds the tree; refuses a DOCTYPE, and with it every entity, and absurd tags."""

    depth = 0

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse a DOCTYPE."""
        if name.lower() == "html":
            raise ValueError("is an HTML page")
        raise ValueError("has a DOCTYPE: entities are not expanded, remove it")

    def start(self, tag: str, attrs: dict[str, str], /) -> ElementTree.Element:
        """Open an element."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ValueError(f"nests tags deeper than {MAX_DEPTH}")
        if len(attrs) > MAX_ATTRIBUTES or any(len(v) > MAX_VALUE for v in attrs.values()):
            raise ValueError(
                f"has a tag <{tag[:40]}> with more than {MAX_ATTRIBUTES} attributes, or one of "
                f"more than {MAX_VALUE} characters"
            )
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        """Close an element."""
        self.depth -= 1
        return super().end(tag)


def parse_xml(text: str) -> ElementTree.Element:
    """Return the root of an XML document of limited size; raise `ValueError` with the reason."""
    if not text.strip():
        raise ValueError("is empty")
    marks = text.count("<") + text.count("=")
    if marks > MAX_MARKS:
        raise ValueError(f"has {marks} tags and attributes: at most {MAX_MARKS} are read")
    try:
        parser = ElementTree.XMLParser(target=_StrictBuilder(), encoding="utf-8")
        return ElementTree.fromstring(text.encode(), parser=parser)
    except ElementTree.ParseError as error:
        raise ValueError(f"is not well-formed XML ({error})") from None
    except LookupError as error:  # an encoding declared but unknown
        raise ValueError(f"cannot be parsed ({error})") from None


_stderr_lock = threading.Lock()  # file descriptor 2 belongs to the whole process


@contextmanager
def _captured_stderr() -> Iterator[list[str]]:
    """Collect what C++ writes to file descriptor 2, which contextlib does not see."""
    lines: list[str] = []
    with _stderr_lock, tempfile.TemporaryFile() as sink:
        saved = os.dup(2)
        os.dup2(sink.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            sink.seek(0)
            lines += sink.read().decode(errors="replace").splitlines()
