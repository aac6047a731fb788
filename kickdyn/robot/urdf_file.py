"""From a URDF file to a Pinocchio model: safe reading, checks, and what Pinocchio reports."""

import io
import os
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from kickdyn.core.files import shipped
from kickdyn.core.validation import brief
from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.robot.joint_table import Mimic
from kickdyn.robot.package_files import read_xml
from kickdyn.robot.urdf_validation import find_faults, find_irregularities, read_mimics
from kickdyn.robot.visuals import RobotFile, Shape, Visual


class UrdfFile(RobotFile):
    """A URDF that passed every check, its text written out anew."""

    def visuals(self) -> list[Visual]:
        """Return the visuals of all links; raise `InvalidInput` if they are unreadable."""
        robot = self._robot
        visuals = [(link.name, visual) for link in robot.links for visual in link.visuals]
        materials = [visual.material for _, visual in visuals if visual.material]
        colours = {m.name: m.color.rgba for m in [*materials, *robot.materials] if m.color}
        shapes = []
        for link, visual in visuals:
            material = visual.material
            rgba = colours.get(material.name) if material else None
            if material and material.color:
                rgba = material.color.rgba
            shapes.append(
                Visual(
                    link,
                    np.eye(4) if visual.origin is None else visual.origin,
                    *_shape(visual.geometry),
                    rgba=None if rgba is None else tuple(rgba),
                    has_texture=material is not None and material.texture is not None,
                )
            )
        return shapes

    def collisions(self) -> list[Visual]:
        """Return the collision shapes of all links; raise `InvalidInput` if unreadable."""
        return [
            Visual(
                link.name,
                np.eye(4) if shape.origin is None else shape.origin,
                *_shape(shape.geometry),
            )
            for link in self._robot.links
            for shape in link.collisions
        ]

    @cached_property
    def _robot(self) -> Any:
        """The links of the file as yourdfpy reads them; raises `InvalidInput`."""
        import yourdfpy  # takes half a second; only pages need it

        try:
            return yourdfpy.URDF.load(
                io.BytesIO(self.text.encode()), build_scene_graph=False, load_meshes=False
            ).robot
        except Exception as error:  # yourdfpy has no error of its own for a bad file
            raise InvalidInput(f"{self.source}: its visuals cannot be read ({error})") from None

    @cached_property
    def mimics(self) -> tuple[Mimic, ...]:
        """The joints that the file lets move with another, each with a driver that does not."""
        return read_mimics(ElementTree.fromstring(self.text))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for each kind of irregularity with which the file was read; none was repaired."""
        return tuple(find_irregularities(ElementTree.fromstring(self.text)))


def read_urdf(
    path: str | PathLike[str],
    package_dirs: Iterable[str | PathLike[str]] = (),
    locked: Iterable[str] = (),
) -> UrdfFile:
    """Read and check a URDF file, whose meshes may be in further folders.

    The joints that a locked joint mimics are not checked; `locked` has names or patterns.

    Raises:
        UrdfError: with all faults that `find_faults` finds, in one message.
        InvalidInput: `path` is no path at all, or there is no such folder.
    """
    urdf = replace(read_document(path), package_dirs=tuple(_folders(package_dirs)))
    faults = find_faults(ElementTree.fromstring(urdf.text), locked)
    if faults:
        raise UrdfError(urdf.source, faults)
    return urdf


def _folders(package_dirs: Iterable[str | PathLike[str]]) -> Iterator[Path]:
    """Yield folders as absolute paths; raise `InvalidInput` for anything else."""
    if isinstance(package_dirs, str | PathLike) or not isinstance(package_dirs, Iterable):
        raise InvalidInput(f"package_dirs is {package_dirs!r}: it must be a list of folders")
    for folder in package_dirs:
        try:
            path = Path(folder).resolve()
            if path.is_dir():
                yield path
                continue
        except (TypeError, ValueError, OSError, RuntimeError):  # no path, a NUL, links in a circle
            pass
        raise InvalidInput(f"package_dirs names {brief(str(folder))}: there is no such folder")


def read_document(path: str | PathLike[str]) -> UrdfFile:
    """Read a URDF file as `read_urdf` does, without checking the robot that it describes."""
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"URDF path is {path!r}: it must be a str or a Path") from None
    root = read_xml(file, source, UrdfError)
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
    complaints = [complaint for line in said if (complaint := line.removeprefix("Error:").strip())]
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
