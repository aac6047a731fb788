"""What is wrong with a URDF, found before Pinocchio sees it.

Pinocchio drops an inertial it cannot read and goes on with mass 0, takes negative masses, zero
axes and loops, and dies on long chains. So every fault is named here first.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from xml.etree.ElementTree import Element

import numpy as np

MAX_LINKS = 3000
"""Pinocchio's parser overflows the stack at about 3,800 links in a row."""

MAX_MOVING_JOINTS = 250
"""Pinocchio's workspace takes about 32 n^3 bytes: 0.5 GB here."""

MASS_RANGE = (1e-15, 1e15)
MOVING = ("revolute", "continuous", "prismatic")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def faults_of(root: Element) -> list[str]:
    """Return one line per fault of the robot under `root`; none means it is sound."""
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
    sound = {name: _link(name, link, faults) for name, link in links.items()}
    for name, joint in joints.items():
        _joint(name, joint, faults)
    if _tree(links, joints, faults):
        _masses(joints, sound, faults)
    return faults


def _named(root: Element, tag: str, faults: list[str]) -> dict[str, Element]:
    elements = root.findall(tag)
    names = [_name(element, tag, faults) for element in elements]
    for name, times in Counter(names).items():
        if times > 1 and name:
            faults.append(f"{tag} name {name!r} is used {times} times")
    return {name: element for name, element in zip(names, elements, strict=True) if name}


def _name(element: Element, tag: str, faults: list[str]) -> str:
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
    said = f"has no {key}" if text is None else f"{key} is {_shown(text)}"
    faults.append(f"{where} {said}: it must be {wanted}")
    return None


def _shown(text: str | None) -> str:
    return repr(text) if text is None or len(text) <= 60 else f"{text[:60]!r}..."


def _single(where: str, element: Element, tags: tuple[str, ...], faults: list[str]) -> None:
    for tag in tags:
        times = len(element.findall(tag))
        if times > 1:
            faults.append(f"{where} has {times} of <{tag}>: one is meant")


def _origin(where: str, parent: Element, faults: list[str]) -> None:
    origin = parent.find("origin")
    for key in ("xyz", "rpy"):
        if origin is not None and key in origin.attrib:
            _numbers(f"{where} origin", origin, key, 3, faults)


def _link(name: str, link: Element, faults: list[str]) -> bool | None:
    """Check a link; True: a body of its own, None: no mass, False: at fault (already said)."""
    where = f"link {name!r}"
    for kind in ("visual", "collision"):
        for part in link.findall(kind):
            _origin(f"{where} {kind}", part, faults)
            _geometry(f"{where} {kind}", part.find("geometry"), faults)
    inertials = link.findall("inertial")
    if not inertials:
        return None
    if len(inertials) > 1:
        faults.append(f"{where} has {len(inertials)} inertials: one is meant")
        return False
    before = len(faults)
    _single(f"{where} inertial", inertials[0], ("origin", "mass", "inertia"), faults)
    _origin(f"{where} inertial", inertials[0], faults)
    mass = _mass(where, inertials[0].find("mass"), faults)
    inertia = _inertia(where, inertials[0].find("inertia"), faults)
    if len(faults) > before or mass is None or inertia is None:
        return False
    if mass == 0.0 and not inertia.any():
        return None
    if not MASS_RANGE[0] <= mass <= MASS_RANGE[1]:
        faults.append(
            f"{where} mass is {mass:g} kg: it must be {MASS_RANGE[0]:g} to {MASS_RANGE[1]:g} kg"
        )
    least, middle, largest = np.linalg.eigvalsh(inertia / max(np.abs(inertia).max(), 1e-300))
    moments = np.linalg.eigvalsh(inertia)
    if not least > 0.0:
        faults.append(
            f"{where} inertia is not positive definite (principal moments {_list(moments)} kg m2)"
        )
    elif largest > (least + middle) * (1 + 1e-9):
        faults.append(
            f"{where} inertia violates the triangle inequality: of the principal moments "
            f"{_list(moments)} kg m2 the largest exceeds the sum of the others"
        )
    return len(faults) == before


def _mass(where: str, element: Element | None, faults: list[str]) -> float | None:
    if element is None:
        faults.append(f"{where} inertial has no mass")
        return None
    values = _numbers(f"{where} mass", element, "value", 1, faults, unit="kg")
    return values[0] if values else None


def _inertia(where: str, element: Element | None, faults: list[str]) -> np.ndarray | None:
    if element is None:
        faults.append(f"{where} inertial has no inertia")
        return None
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    read = [_numbers(f"{where} inertia", element, key, 1, faults, unit="kg m2") for key in keys]
    if any(value is None for value in read):
        return None
    xx, xy, xz, yy, yz, zz = (value[0] for value in read if value)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _list(moments: np.ndarray) -> str:
    return ", ".join(f"{moment:.3g}" for moment in moments)


_SIZES: dict[str, dict[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
}


def _geometry(where: str, geometry: Element | None, faults: list[str]) -> None:
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1:
        faults.append(f"{where} has {len(shapes)} shapes in its geometry: one is meant")
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
    where = f"joint {name!r}"
    kind = joint.get("type", "")
    _single(where, joint, ("origin", "parent", "child", "axis", "limit"), faults)
    _origin(where, joint, faults)
    if kind not in (*MOVING, "fixed"):
        faults.append(f"{where} type is {_shown(kind)}: it must be {', '.join(MOVING)} or fixed")
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
    """Check a limit; only a joint with a range must have one."""
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


def _tree(links: dict[str, Element], joints: dict[str, Element], faults: list[str]) -> bool:
    """Check that joints join the links into one tree; return whether they do."""
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
                faults.append(f"joint {name!r} {role} is {_shown(link)}: there is no such link")
            ends[role] = link or ""
        if len(faults) > before:
            continue
        if ends["child"] in parents:
            faults.append(f"link {ends['child']!r} has two parents: loops cannot be read")
        parents[ends["child"]] = ends["parent"]
    if len(faults) > before:
        return False
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        faults.append(f"has {len(roots)} roots ({', '.join(roots[:5])}): all links must be joined")
    reached = set(roots)
    for name in links:  # walk up until known ground; a walk that meets itself is a loop
        path = []
        while name not in reached and name not in path:
            path.append(name)
            name = parents[name]
        if name not in reached:
            faults.append(f"links {', '.join(sorted(path))} form a loop")
            return False
        reached.update(path)
    return len(faults) == before


def _masses(joints: dict[str, Element], sound: dict[str, bool | None], faults: list[str]) -> None:
    """Check that every moving joint carries mass before the next moving joint."""
    fixed: dict[str, list[str]] = {}
    for joint in joints.values():
        if joint.get("type") == "fixed":
            fixed.setdefault(_end(joint, "parent"), []).append(_end(joint, "child"))
    for name, joint in joints.items():
        if joint.get("type") not in MOVING:
            continue
        group = [_end(joint, "child")]
        for link in group:  # grows while it is walked
            group += fixed.get(link, [])
        if all(sound[link] is None for link in group):
            faults.append(
                f"link {group[0]!r} moves with joint {name!r} but has no mass: "
                "give it an inertial with mass and inertia above 0"
            )


def _end(joint: Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")
