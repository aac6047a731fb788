"""Faults of a URDF's text, found before Pinocchio sees it.

Pinocchio drops an inertial that it cannot read and goes on with mass 0, takes negative masses,
zero axes and loops, and overflows its stack on long chains. So every such fault is named here
first; `model_validation` then judges the inertia of what moves together.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from xml.etree.ElementTree import Element

MAX_LINKS = 3000
"""Pinocchio's parser overflows the stack at about 3,800 links in a row."""

MAX_MOVING_JOINTS = 250
"""Pinocchio's workspace takes about 32 n^3 bytes: 0.5 GB here."""

MOVING = ("revolute", "continuous", "prismatic")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def find_faults(root: Element) -> list[str]:
    """Return one line per fault of the robot under `root`; none if it can be read."""
    if root.tag != "robot":
        return [f"is not a URDF: its root is <{root.tag}>, not <robot>"]
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
        _link(name, link, faults)
    for name, joint in joints.items():
        _joint(name, joint, faults)
    _tree(links, joints, faults)
    return faults


def _named(root: Element, tag: str, faults: list[str]) -> dict[str, Element]:
    """Return the elements of a tag by name; add a fault for each name used twice."""
    elements = root.findall(tag)
    names = [_name(element, tag, faults) for element in elements]
    for name, times in Counter(names).items():
        if times > 1 and name:
            faults.append(f"{tag} name {name!r} is used {times} times")
    return {name: element for name, element in zip(names, elements, strict=True) if name}


def _name(element: Element, tag: str, faults: list[str]) -> str:
    """Return an element's name, or add a fault and return nothing."""
    name = element.get("name", "")
    if not name.strip():
        faults.append(f"a {tag} has no name")
    elif len(name) > 200 or not name.isprintable():
        faults.append(f"{tag} name {name[:40]!r} is not a printable name of at most 200 characters")
    elif name == "universe":
        faults.append(f"{tag} name 'universe' is Pinocchio's own")
    else:
        return name
    return ""


def _numbers(
    where: str,
    element: Element,
    key: str,
    count: int,
    faults: list[str],
    *,
    least: float = -math.inf,
    unit: str = "",
) -> list[float] | None:
    """Read exactly `count` finite decimal numbers from an attribute, or add a fault."""
    text = element.get(key)
    parts = (text or "").split()
    values = [float(part) for part in parts if _NUMBER.fullmatch(part)]
    whole = len(parts) == count == len(values) and all(map(math.isfinite, values))
    if whole and min(values) >= least:
        return values
    wanted = "a finite number" if count == 1 else f"{count} finite numbers"
    wanted += f", {least:g} or more" if least > -math.inf else ""
    wanted += f" [{unit}]" if unit else ""
    found = f"has no {key}" if text is None else f"{key} is {_quoted(text)}"
    faults.append(f"{where} {found}: it must be {wanted}")
    return None


def _quoted(text: str | None) -> str:
    """Return an attribute's text in quotes, cut if it is long."""
    return repr(text) if text is None or len(text) <= 60 else f"{text[:60]!r}..."


def _single(where: str, element: Element, tags: tuple[str, ...], faults: list[str]) -> None:
    """Add a fault for each of these tags that an element has more than once."""
    for tag in tags:
        times = len(element.findall(tag))
        if times > 1:
            faults.append(f"{where} has {times} of <{tag}>: it must have one")


def _origin(where: str, parent: Element, faults: list[str]) -> None:
    """Check the numbers of an element's origin, if it has one."""
    origin = parent.find("origin")
    for key in ("xyz", "rpy"):
        if origin is not None and key in origin.attrib:
            _numbers(f"{where} origin", origin, key, 3, faults)


def _link(name: str, link: Element, faults: list[str]) -> None:
    """Check the shapes of a link and the numbers of its inertial, if it has one."""
    where = f"link {name!r}"
    for kind in ("visual", "collision"):
        for part in link.findall(kind):
            _origin(f"{where} {kind}", part, faults)
            _geometry(f"{where} {kind}", part.find("geometry"), faults)
    inertials = link.findall("inertial")
    if len(inertials) > 1:
        faults.append(f"{where} has {len(inertials)} inertials: it must have one at most")
    elif inertials:
        _inertial(where, inertials[0], faults)


def _inertial(where: str, inertial: Element, faults: list[str]) -> None:
    """Check that mass and moments of inertia are there, finite, and the mass 0 or more."""
    _single(f"{where} inertial", inertial, ("origin", "mass", "inertia"), faults)
    _origin(f"{where} inertial", inertial, faults)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None:
        faults.append(f"{where} inertial has no mass")
    else:
        _numbers(f"{where} mass", mass, "value", 1, faults, least=0.0, unit="kg")
    if inertia is None:
        faults.append(f"{where} inertial has no inertia")
    else:
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
            _numbers(f"{where} inertia", inertia, key, 1, faults, unit="kg m2")


_SIZES: dict[str, dict[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
}


def _geometry(where: str, geometry: Element | None, faults: list[str]) -> None:
    """Check that a geometry has one known shape of positive size."""
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1:
        faults.append(f"{where} has {len(shapes)} shapes in its geometry: it must have one")
        return
    shape = shapes[0]
    if shape.tag == "mesh":
        if not shape.get("filename", "").strip():
            faults.append(f"{where} mesh has no filename")
    elif shape.tag not in _SIZES:
        faults.append(f"{where} shape <{shape.tag}> is unknown")
    for key, count in _SIZES.get(shape.tag, {}).items():
        sizes = _numbers(f"{where} {shape.tag}", shape, key, count, faults, unit="m")
        if sizes and min(sizes) <= 0:
            faults.append(f"{where} {shape.tag} {key} is {shape.get(key)!r}: it must be above 0")


def _joint(name: str, joint: Element, faults: list[str]) -> None:
    """Check type, axis and limit of a joint."""
    where = f"joint {name!r}"
    kind = joint.get("type", "")
    _single(where, joint, ("origin", "parent", "child", "axis", "limit"), faults)
    _origin(where, joint, faults)
    if kind not in (*MOVING, "fixed"):
        faults.append(f"{where} type is {_quoted(kind)}: it must be {', '.join(MOVING)} or fixed")
    if joint.find("mimic") is not None:
        faults.append(f"{where} mimics another: Pinocchio would move it freely, remove the mimic")
    axis = joint.find("axis")
    if kind in MOVING and axis is not None:
        values = _numbers(f"{where} axis", axis, "xyz", 3, faults)
        if values and not 1e-100 < max(map(abs, values)) < 1e100:  # its square is needed
            shown = " ".join(f"{value:g}" for value in values)
            faults.append(f"{where} axis is {shown}: it must have a direction")
    _limit(where, kind, joint.find("limit"), faults)


def _limit(where: str, kind: str, limit: Element | None, faults: list[str]) -> None:
    """Check a joint's limit; only a joint with a range must have one."""
    ranged = kind in ("revolute", "prismatic")
    angle, force = ("m", "N") if kind == "prismatic" else ("rad", "N m")
    if limit is None:
        if ranged:
            endless = "" if kind == "prismatic" else " (turning without end is of type continuous)"
            faults.append(
                f"{where} has no limit: it must have lower and upper [{angle}], effort [{force}] "
                f"and velocity [{angle}/s]{endless}"
            )
        return
    where = f"{where} limit"
    keys = [key for key in ("lower", "upper") if ranged or key in limit.attrib]
    ends = [_numbers(where, limit, key, 1, faults, unit=angle) for key in keys]
    for key, unit in (("effort", force), ("velocity", f"{angle}/s")):
        _numbers(where, limit, key, 1, faults, least=0.0, unit=unit)
    if ranged and ends[0] and ends[1] and ends[0] > ends[1]:
        faults.append(f"{where} lower {ends[0][0]:g} is above upper {ends[1][0]:g}")


def _tree(links: dict[str, Element], joints: dict[str, Element], faults: list[str]) -> None:
    """Check that the joints join all links into one tree."""
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
                faults.append(f"joint {name!r} {role} is {_quoted(link)}: there is no such link")
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
    reached = set(roots)
    for name in links:  # walk up to a link that is reached; a walk that meets itself is a loop
        path = []
        while name not in reached and name not in path:
            path.append(name)
            name = parents[name]
        if name not in reached:
            faults.append(f"links {', '.join(sorted(path))} form a loop")
            return
        reached.update(path)
