"""From a URDF file to a Pinocchio model: reading, faults of the text, and what Pinocchio reports.

Pinocchio's parser overflows its stack on long chains, never returns from loops, takes double names
and axes without direction, and stops at the first fault that it reports. `build_model` passes on
what it reports; `model_validation` then judges the inertia of what moves together.
"""

import io
import math
import os
import re
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from kickdyn.core.files import shipped
from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.robot.joint_table import Mimic
from kickdyn.robot.model_validation import ROUNDING, second_moments
from kickdyn.robot.names import expand_patterns, listed, name_fault
from kickdyn.robot.robot_file import RobotFile, Shape, Visual, list_folders, read_xml, robot_path

MAX_LINKS = 3000
"""Pinocchio's parser overflows the stack at about 3,800 links in a row."""

MAX_MOVING_JOINTS = 250
"""Pinocchio's workspace takes about 32 n^3 bytes: 0.5 GB here."""

LARGEST_MIMIC = 1e4
"""Largest multiplier and offset of a mimic joint [rad or m, per rad or m]."""

MOVING = ("revolute", "continuous", "prismatic")

NO_LIMIT = repr(sys.float_info.max)
"""Limit of effort, velocity or range that means none: the parser refuses inf."""

NUMBERS = {
    "origin": ("xyz", "rpy"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "limit": ("lower", "upper", "effort", "velocity"),
}
"""Attributes that are numbers, by the element of a joint or an inertial."""

REQUIRED = {*NUMBERS["mass"], *NUMBERS["inertia"], "effort", "velocity"}
"""Attributes without a default."""

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
"""A number as Pinocchio's parser reads it, which takes neither nan nor inf."""


class UrdfFile(RobotFile):
    """A URDF that passed every check, its text written out anew."""

    def visuals(self) -> list[Visual]:
        """Return the visuals of all links; raise `InvalidInput` if they are unreadable."""
        robot = self._robot
        visuals = [(link.name, visual) for link in robot.links for visual in link.visuals]
        materials = [visual.material for _, visual in visuals if visual.material]
        colours = {m.name: m.color for m in [*materials, *robot.materials] if m.color}
        shapes = []
        for link, visual in visuals:
            material = visual.material
            colour = (material.color or colours.get(material.name)) if material else None
            shapes.append(
                replace(
                    _visual(link, visual),
                    rgba=None if colour is None else tuple(colour.rgba),
                    has_texture=material is not None and material.texture is not None,
                )
            )
        return shapes

    def collisions(self) -> list[Visual]:
        """Return the collision shapes of all links; raise `InvalidInput` if unreadable."""
        return [
            _visual(link.name, shape) for link in self._robot.links for shape in link.collisions
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


def read_urdf(
    path: str | PathLike[str],
    package_dirs: Iterable[str | PathLike[str]] = (),
    locked: Iterable[str] = (),
) -> UrdfFile:
    """Read and check a URDF file, or raise `UrdfError` with all faults of `find_faults`."""
    file, source = robot_path("URDF", path), str(path)
    root, folders = read_xml(file, source, UrdfError), list_folders(package_dirs)
    if faults := find_faults(root, locked):
        raise UrdfError(source, faults)
    warnings = find_irregularities(root)
    if unlimited := _remove_limits(root):
        warnings.append(
            f"joints with an effort or velocity of 0, below, or inf ({listed(unlimited, 3)}): "
            "taken as no limit"
        )
    # Written anew, so that Pinocchio's parser reads exactly what was checked: by itself it keeps
    # line ends inside a name, for one.
    text = ElementTree.tostring(root, encoding="unicode")
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    mimics = tuple(  # with a driver that exists, which may mimic another one
        Mimic(name, driver, float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0)))
        for name, driver in _drivers(joints).items()
        for mimic in joints[name].findall("mimic")
        if driver in joints
    )
    return UrdfFile(
        text,
        file.resolve().parent,
        source,
        package_dirs=folders,
        mimics=mimics,
        warnings=tuple(warnings),
    )


def _remove_limits(root: Element) -> list[str]:
    """Give joints the number that means no limit; return those with an effort or velocity of none.

    A continuous joint that takes part in a mimic becomes a revolute one without a range, whose q is
    its angle, because cosine and sine do not tell one turn from the next.
    """
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    drivers, unlimited = _drivers(joints), []
    for name, joint in joints.items():
        for limit in joint.findall("limit"):
            for key in ("effort", "velocity"):
                number = _number(limit.get(key, "1"))
                if number <= 0.0 or number == math.inf:
                    limit.set(key, NO_LIMIT)
                    unlimited.append(name)
        if joint.get("type") == "continuous" and name in {*drivers, *drivers.values()}:
            joint.set("type", "revolute")
            limits = joint.findall("limit")
            limit = limits[0] if limits else ElementTree.SubElement(joint, "limit")
            given = {"effort": NO_LIMIT, "velocity": NO_LIMIT, **limit.attrib}
            limit.attrib.update(given, lower=f"-{NO_LIMIT}", upper=NO_LIMIT)
    return list(dict.fromkeys(unlimited))


def build_model(text: str, source: str, base: str) -> Any:
    """Return the `pin.Model` of a URDF's text, or raise `UrdfError`, also if no joint moves."""
    check_base(base)
    joints = {joint.get("name") for joint in ElementTree.fromstring(text).iter("joint")}
    names = ("root_joint", *(f"root_joint{k}" for k in range(2, len(joints) + 3)))
    free = next(name for name in names if name not in joints)
    root = (pin.JointModelFreeFlyer(), free) if base == "floating" else ()
    with _captured_stderr() as lines:
        try:
            model = pin.buildModelFromXML(text, *root)
        except Exception as error:
            model, reason = None, str(error).strip().splitlines()[0]
    said = (line.strip()[:200] for line in lines if not line.strip().startswith("at line "))
    complaints = [complaint for line in said if (complaint := line.removeprefix("Error:").strip())]
    if model is None:
        raise UrdfError(source, [f"Pinocchio cannot read it: {'; '.join(complaints or [reason])}"])
    if complaints:
        raise UrdfError(source, [f"Pinocchio complains: {'; '.join(complaints)}"])
    if model.nv == 0:
        raise UrdfError(source, ["has no moving joint"])
    for limits in (model.lowerPositionLimit, model.upperPositionLimit):
        unlimited = np.abs(limits) == sys.float_info.max
        limits[unlimited] = np.copysign(math.inf, limits[unlimited])
    return model


def _visual(link: str, visual: Any) -> Visual:
    pose, geometry = np.eye(4) if visual.origin is None else visual.origin, visual.geometry
    if geometry.box:
        return Visual(link, pose, Shape.BOX, tuple(geometry.box.size.tolist()))
    if geometry.sphere:
        return Visual(link, pose, Shape.SPHERE, (geometry.sphere.radius,))
    if geometry.cylinder:
        size = geometry.cylinder.length, geometry.cylinder.radius
        return Visual(link, pose, Shape.CYLINDER, size)
    scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
    return Visual(link, pose, Shape.MESH, tuple(np.atleast_1d(scale)), geometry.mesh.filename)


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


def find_faults(root: Element, locked: Iterable[str] = ()) -> list[str]:
    """Return a line per fault of a robot; joints that `locked` ones mimic are not checked."""
    if root.tag == "mujoco":
        return ["is an MJCF, its root is <mujoco>: Leg.from_mjcf reads it"]
    if root.tag != "robot":
        return [f"is not a URDF: its root is <{root.tag}>, not <robot>"]
    # namespace of the macros of xacro, as ElementTree writes it before their names
    if any(element.tag.startswith("{http://www.ros.org/wiki/xacro}") for element in root.iter()):
        return ["is a xacro file: expand it with `xacro FILE > robot.urdf`, and read the result"]
    faults: list[str] = []
    _name(root, "robot", faults)
    links = _named(root, "link", faults)
    joints = _named(root, "joint", faults)
    moving = sum(joint.get("type") in MOVING for joint in joints.values())
    if not links:
        return [*faults, "has no link"]
    if len(links) > MAX_LINKS or moving > MAX_MOVING_JOINTS:
        return [
            *faults,
            f"has {len(links)} links and {moving} moving joints: "
            f"at most {MAX_LINKS} and {MAX_MOVING_JOINTS} are read",
        ]
    for name, link in links.items():
        where = f"link {name!r}"
        _check_single(where, link, ("inertial",), faults)
        for inertial in link.findall("inertial"):
            _check_single(f"{where} inertial", inertial, ("origin", "mass", "inertia"), faults)
            _check_numbers(f"{where} inertial", inertial, faults)
    for name, joint in joints.items():
        _check_joint(f"joint {name!r}", joint, faults)
    _check_tree(links, joints, faults)
    fixed, drivers = expand_patterns(dict.fromkeys(locked, 0.0), joints), _drivers(joints)
    judged = {n: j for n, j in joints.items() if not fixed.keys() & {n, drivers.get(n)}}
    _check_mimics(judged, joints, faults)
    return faults


def find_irregularities(root: Element) -> list[str]:
    """Return a line for links with impossible inertias and one for limits that are left out."""
    impossible = [link.get("name", "") for link in root.findall("link") if _is_impossible(link)]
    unlimited = [
        joint.get("name", "")
        for joint in root.findall("joint")
        if joint.get("type") in ("revolute", "prismatic")
        and (limit := joint.find("limit")) is not None
        and not {"lower", "upper"} <= limit.attrib.keys()
    ]
    lines = {
        "links with moments of inertia that no body has ({}): they count together with what is "
        "fixed to them or hangs from them": impossible,
        "joints without lower or upper limit ({}): the URDF specification says 0": unlimited,
    }
    return [line.format(listed(names, 3)) for line, names in lines.items() if names]


def _is_impossible(link: Element) -> bool:
    """Return whether moments of inertia are negative or break the triangle inequality."""
    inertia, mass = link.find("inertial/inertia"), link.find("inertial/mass")
    if inertia is None or (mass is not None and _number(mass.get("value", "")) == 0.0):
        return False
    keys = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")
    moments = np.array([_number(inertia.get(key, "")) for key in keys]).reshape(3, 3)
    if not np.isfinite(moments).all():  # Pinocchio or `model_validation` refuses it
        return False
    principal = second_moments(moments)
    return bool(principal.min() < -ROUNDING * np.abs(principal).max())


def _named(root: Element, tag: str, faults: list[str]) -> dict[str, Element]:
    elements = [(_name(element, tag, faults), element) for element in root.findall(tag)]
    for name, times in Counter(name for name, _ in elements if name).items():
        if times > 1:
            faults.append(f"{tag} name {name!r} is used {times} times")
    return {name: element for name, element in elements if name}


def _name(element: Element, tag: str, faults: list[str]) -> str:
    name = element.get("name", "")
    fault = name_fault(f"{tag} name", name) if name.strip() else f"a {tag} has no name"
    faults += filter(None, [fault])
    return "" if fault else name


def _check_single(where: str, element: Element, tags: tuple[str, ...], faults: list[str]) -> None:
    for tag in tags:
        times = len(element.findall(tag))
        if times > 1:
            faults.append(f"{where} has {times} of <{tag}>: it must have one at most")


def _check_joint(where: str, joint: Element, faults: list[str]) -> None:
    kind = joint.get("type", "")
    _check_single(where, joint, ("origin", "parent", "child", "axis", "limit", "mimic"), faults)
    if kind not in (*MOVING, "fixed"):
        faults.append(f"{where} type is {kind[:40]!r}: it must be {', '.join(MOVING)} or fixed")
    _check_numbers(where, joint, faults)
    if kind in ("revolute", "prismatic") and joint.find("limit") is None:
        faults.append(
            f"{where} has no <limit>: it must have effort and velocity, and may have lower and "
            "upper; a revolute joint without a range is continuous"
        )
    axis = joint.find("axis")
    if axis is None or kind == "fixed":
        return
    text = axis.get("xyz", "")
    numbers = [_number(word) for word in text.split()]
    if len(numbers) != 3 or not 1e-100 < math.hypot(*numbers) < 1e100:  # its square is needed
        faults.append(f"{where} axis is {text[:60]!r}: it must be 3 finite numbers, not all 0")


def _check_numbers(where: str, element: Element, faults: list[str]) -> None:
    """Check the numbers of a joint, or of an inertial: Pinocchio does not say which are valid."""
    for tag, keys in NUMBERS.items():
        for child in element.findall(tag):
            for key in keys:
                text, is_missing = child.get(key, ""), key not in child.attrib
                if is_missing and key not in REQUIRED:
                    continue
                count, words = 3 if tag == "origin" else 1, text.split()
                if key in ("effort", "velocity") and _number(text) == math.inf:
                    continue  # no limit
                sound = [w for w in words if NUMBER.fullmatch(w) and math.isfinite(float(w))]
                if len(words) != count or sound != words:
                    valid = "3 finite numbers, X Y Z" if count == 3 else "a finite number"
                    fault = f"has no {key}" if is_missing else f"{key} is {text[:60]!r}"
                    faults.append(f"{where} {tag} {fault}: it must be {valid}")


def _number(text: str) -> float:
    """Return the number that a text is; NaN where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _check_mimics(
    judged: dict[str, Element], joints: dict[str, Element], faults: list[str]
) -> None:
    drivers = _drivers(joints)
    for name, driver in drivers.items():
        if name not in judged:
            continue
        remedy = f"lock it: locked={{{name!r}: 0}} of from_urdf, or --lock {name}=0"
        mimic = joints[name].find("mimic")
        for key in ("multiplier", "offset"):
            text = "0" if mimic is None else mimic.get(key, "0")
            if not abs(_number(text)) <= LARGEST_MIMIC:
                faults.append(
                    f"joint {name!r} mimic {key} is {text!r}: it must be a number of at most "
                    f"{LARGEST_MIMIC:g} in size"
                )
        kind = joints[driver].get("type") if driver in joints else None
        if kind is None:
            close = get_close_matches(driver[:200], list(joints), 8, 0.7)
            sides = [other for other in close if driver in other]  # such as of left and right
            close = get_close_matches(name, sides, 1, 0.0) or close
            hint = f"did you mean {close[0]!r}? Correct the name" if close else "correct the name"
            faults.append(
                f"joint {name!r} mimics {driver[:40]!r}, and there is no such joint: {hint}, or "
                + remedy
            )
        elif kind == "fixed":
            faults.append(f"joint {name!r} mimics {driver!r}, which is fixed: {remedy}")
    if cycle := _find_cycle(drivers):
        faults.append(f"joints {cycle} mimic each other in a loop")


def _drivers(joints: dict[str, Element]) -> dict[str, str]:
    """Return the joint that each joint mimics; the mimic of a fixed joint has no effect."""
    return {
        name: mimic.get("joint", "")
        for name, joint in joints.items()
        if joint.get("type") != "fixed" and (mimic := joint.find("mimic")) is not None
    }


def _check_tree(links: dict[str, Element], joints: dict[str, Element], faults: list[str]) -> None:
    before = len(faults)
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        ends = {}
        for role in ("parent", "child"):
            element = joint.find(role)
            link = None if element is None else element.get("link")
            if link is None:
                faults.append(f"joint {name!r} has no {role}: it must name a link")
            elif link not in links:
                faults.append(f"joint {name!r} {role} is {link[:40]!r}: there is no such link")
            ends[role] = link or ""
        if len(faults) > before:
            continue
        if ends["child"] in parents:
            faults.append(f"link {ends['child']!r} has two parents: loops cannot be read")
        parents[ends["child"]] = ends["parent"]
    if len(faults) > before:
        return
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        faults.append(f"has {len(roots)} roots ({', '.join(roots[:5])}): all links must be joined")
    if cycle := _find_cycle(parents):
        faults.append(f"links {cycle} form a loop")


def _find_cycle(follows: dict[str, str]) -> str:
    """Return the names of a loop of names of which each follows another; empty without one."""
    try:
        TopologicalSorter({name: [before] for name, before in follows.items()}).prepare()
    except CycleError as error:
        return ", ".join(sorted(set(error.args[1])))
    return ""
