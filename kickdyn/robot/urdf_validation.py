"""Faults of a URDF's text, all of them at once, before Pinocchio reads it.

Its parser overflows its stack on long chains, never returns from loops, and takes double names,
negative masses and axes without direction. It stops at the first fault that it reports: links that
do not exist are therefore found before. What it reports besides, such as a missing attribute,
`build_model` passes on; `model_validation` then judges the inertia of what moves together.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable
from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter
from xml.etree.ElementTree import Element

import numpy as np

from kickdyn.robot.joint_table import Mimic
from kickdyn.robot.model_validation import MAX_MAGNITUDE, ROUNDING, second_moments
from kickdyn.robot.names import expand_patterns, listed, name_fault

MAX_LINKS = 3000
"""Pinocchio's parser overflows the stack at about 3,800 links in a row."""

MAX_MOVING_JOINTS = 250
"""Pinocchio's workspace takes about 32 n^3 bytes: 0.5 GB here."""

MOVING = ("revolute", "continuous", "prismatic")

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
"""A decimal number; each text matches in one way only, so that a long one is read quickly."""

_COUNTS = {
    **{("origin", key): 3 for key in ("xyz", "rpy")},
    **{("axis", "xyz"): 3, ("mass", "value"): 1},
    **{("inertia", key): 1 for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
    **{("mimic", key): 1 for key in ("multiplier", "offset")},
    **{("limit", key): 1 for key in ("lower", "upper", "effort", "velocity")},
}
"""How many numbers there are in an attribute, by tag and key."""


def find_faults(root: Element, locked: Iterable[str] = ()) -> list[str]:
    """Return one line per fault of the robot under `root`; none if Pinocchio may read it.

    The joints that a locked joint mimics are not checked; `locked` has names or patterns.
    """
    if root.tag == "mujoco":
        return ["is an MJCF, its root is <mujoco>: Leg.from_mjcf reads it"]
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
        where = f"link {name!r}"
        _check_single(where, link, ("inertial",), faults)
        for inertial in link.findall("inertial"):
            _check_single(f"{where} inertial", inertial, ("origin", "mass", "inertia"), faults)
        _check_numbers(where, link, faults)
    for name, joint in joints.items():
        _check_joint(f"joint {name!r}", joint, faults)
    _check_tree(links, joints, faults)
    fixed = expand_patterns(dict.fromkeys(locked, 0.0), joints)
    _check_mimics({n: j for n, j in joints.items() if n not in fixed}, joints, faults)
    return faults


def find_irregularities(root: Element) -> list[str]:
    """Return one line for each kind of irregularity with which the robot under `root` is read.

    Inertias are judged with what moves together, by `model_validation`: a link alone may have none,
    or one that no body has.
    """
    light, impossible, without = [], [], []
    moved = {
        child.get("link")
        for joint in root.findall("joint")
        if joint.get("type") != "fixed" and (child := joint.find("child")) is not None
    }
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None and link.get("name") in moved and link.find("visual") is not None:
            without.append(link.get("name", ""))
        if inertial is not None and (mass := inertial.find("mass")) is not None:
            if float(mass.get("value", "nan")) == 0.0:
                light.append(link.get("name", ""))
            elif _is_impossible(inertial.find("inertia")):
                impossible.append(link.get("name", ""))
    unlimited = [
        joint.get("name", "")
        for joint in root.findall("joint")
        if joint.get("type") in ("revolute", "prismatic")
        and (limit := joint.find("limit")) is not None
        and not {"lower", "upper"} <= limit.attrib.keys()
    ]
    idle = [
        joint.get("name", "")
        for joint in root.findall("joint")
        if joint.get("type") == "fixed" and joint.find("mimic") is not None
    ]
    together = "they count together with what is fixed to them or hangs from them"
    return [
        f"{kind} ({listed(names, 3)}): {meaning}"
        for names, kind, meaning in (
            (light, "links with mass 0", together),
            (without, "links that a joint moves, with a shape but no mass", together),
            (impossible, "links with moments of inertia that no body has", together),
            (idle, "fixed joints with a mimic", "they stay fixed"),
            (unlimited, "joints without lower or upper limit", "the URDF specification says 0"),
        )
        if names
    ]


def _is_impossible(inertia: Element | None) -> bool:
    """Return whether moments of inertia are negative or break the triangle inequality."""
    if inertia is None:
        return False
    xx, xy, xz, yy, yz, zz = (
        float(inertia.get(key, "nan")) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not (np.abs(moments) < MAX_MAGNITUDE).all():
        return False
    principal = second_moments(moments)
    return bool(principal.min() < -ROUNDING * np.abs(principal).max())


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
    fault = name_fault(f"{tag} name", name) if name.strip() else f"a {tag} has no name"
    if not fault:
        return name
    faults.append(fault)
    return ""


def _check_single(where: str, element: Element, tags: tuple[str, ...], faults: list[str]) -> None:
    """Add a fault for each of these tags that an element has more than once."""
    for tag in tags:
        times = len(element.findall(tag))
        if times > 1:
            faults.append(f"{where} has {times} of <{tag}>: it must have one at most")


def _check_numbers(where: str, element: Element, faults: list[str]) -> None:
    """Check every number in an element: finite, and 0 or more for masses, efforts and speeds."""
    for tag_element in element.iter():
        for key, text in tag_element.items():
            count = _COUNTS.get((tag_element.tag, key))
            if count is None:
                continue
            words = text.split()
            values = [float(word) for word in words if _NUMBER.fullmatch(word)]
            valid = "a finite number" if count == 1 else f"{count} finite numbers"
            sound = len(values) == len(words) == count and all(map(math.isfinite, values))
            if key in ("value", "effort", "velocity"):
                valid += ", 0 or more"
                sound = sound and values[0] >= 0.0
            elif tag_element.tag == "axis":
                if element.get("type") == "fixed":  # it turns about nothing
                    continue
                valid += ", not all 0"
                sound = sound and 1e-100 < max(map(abs, values)) < 1e100  # its square is needed
            if not sound:
                shown = repr(text) if len(text) <= 60 else f"{text[:60]!r}..."
                faults.append(f"{where} {tag_element.tag} {key} is {shown}: it must be {valid}")


def _check_joint(where: str, joint: Element, faults: list[str]) -> None:
    """Check type, limit and numbers of a joint."""
    kind = joint.get("type", "")
    _check_single(where, joint, ("origin", "parent", "child", "axis", "limit", "mimic"), faults)
    _check_numbers(where, joint, faults)
    if kind not in (*MOVING, "fixed"):
        faults.append(f"{where} type is {kind[:40]!r}: it must be {', '.join(MOVING)} or fixed")
    axis = joint.find("axis")
    if axis is not None and "xyz" not in axis.attrib and kind != "fixed":
        faults.append(f"{where} axis has no xyz: it must be 3 finite numbers, not all 0")


def _check_mimics(
    judged: dict[str, Element], joints: dict[str, Element], faults: list[str]
) -> None:
    """Check that the judged joints mimic others with a range, and no two of them each other."""
    drivers = _drivers(joints)
    for name, driver in drivers.items():
        if name not in judged:
            continue
        remedy = f"lock it: locked={{{name!r}: 0}} of from_urdf, or --lock {name}=0"
        kind = joints[driver].get("type") if driver in joints else None
        if kind is None:
            near = get_close_matches(driver[:200], list(joints), 1, 0.7)
            hint = f"did you mean {near[0]!r}? Correct the name" if near else "correct the name"
            faults.append(
                f"joint {name!r} mimics {driver[:40]!r}, and there is no such joint: {hint}, or "
                + remedy
            )
        elif "continuous" in (kind, joints[name].get("type")) or kind == "fixed":
            faults.append(
                f"joint {name!r} mimics {driver!r}: both must be revolute or prismatic, for a "
                f"continuous joint's angle is known but for whole turns; {remedy}"
            )
    try:
        TopologicalSorter({joint: [driver] for joint, driver in drivers.items()}).prepare()
    except CycleError as error:
        faults.append(f"joints {', '.join(sorted(set(error.args[1])))} mimic each other in a loop")


def _drivers(joints: dict[str, Element]) -> dict[str, str]:
    """Return the joint that each joint mimics; the mimic of a fixed joint has no effect."""
    return {
        name: mimic.get("joint", "")
        for name, joint in joints.items()
        if joint.get("type") != "fixed" and (mimic := joint.find("mimic")) is not None
    }


def read_mimics(root: Element) -> tuple[Mimic, ...]:
    """Return the mimic joints of a robot without faults, each with a driver that mimics none.

    What mimics a joint that does not exist, and is to be locked, is left out.
    """
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    drivers, mimics = _drivers(joints), []
    for name in drivers:
        driver, multiplier, offset = name, 1.0, 0.0
        while driver in drivers:  # q = a (c q_driver + d) + b
            mimic = joints[driver].find("mimic")
            assert mimic is not None
            offset += multiplier * float(mimic.get("offset", 0.0))
            multiplier *= float(mimic.get("multiplier", 1.0))
            driver = drivers[driver]
        if driver in joints:
            mimics.append(Mimic(name, driver, multiplier, offset))
    return tuple(mimics)


def _check_tree(links: dict[str, Element], joints: dict[str, Element], faults: list[str]) -> None:
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
    try:
        TopologicalSorter({child: [parent] for child, parent in parents.items()}).prepare()
    except CycleError as error:
        faults.append(f"links {', '.join(sorted(set(error.args[1])))} form a loop")
