"""The leg of a person of a given height, mass and sex, from published segment parameters.

`urdf/leg_human.urdf` is the template: its joints, ranges, speed limits and shapes stay, the
segments get their size. The axes are the template's: x forward, y left, z up.

Segments are from `segment_tables`: lengths are proportional to the height, masses to the mass of
the body. The tip of the toes is at the height of the ankle, as in the paper's model.

Torques are the c1 of Anderson, Madigan & Nussbaum 2007 (J Biomech 40:3105, Table 3, 18-25 years),
as transcribed in RBDL's Millard2016TorqueMuscle, times body weight and height.
"""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from enum import StrEnum
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.robot.catalog import SURFACES, TOE, normal_cone
from kickdyn.robot.segment_tables import Segment, Sex, segments
from kickdyn.robot.urdf_file import UrdfFile, build_model, read_urdf, shipped_urdf

HILL = 0.25
"""k = a / F_0 of muscles of frogs (Hill 1938, Proc. R. Soc. Lond. B 126:136)."""


def muscle_share(u: Any) -> Any:
    r"""Return the torque of muscles over that at rest, which falls with speed in the form of Hill.

    .. math:: \frac{\tau(\omega)}{\tau_0} = \frac{1 - u}{1 + u / k}, \qquad
              u = \frac{\omega}{\omega_0}

    At the speed :math:`\omega_0` of shortening, a joint has no torque; u is from 0 to 1. Muscles
    that lengthen count as at rest, although they are stronger.
    """
    return (1.0 - u) / (1.0 + u / HILL)


def muscle_share_slope(u: Any) -> Any:
    """Return the derivative of `muscle_share`."""
    return -(1.0 + 1.0 / HILL) / (1.0 + u / HILL) ** 2


Side = StrEnum("Side", {"LEFT": "left", "RIGHT": "right"})
"""Side of the kicking leg."""

HumanModel = StrEnum("HumanModel", {"PAPER": "paper", "SPATIAL": "3d"})
"""Joints of a human leg: as in the paper, in one plane, or six in space."""


class Person(NamedTuple):
    """A person: height [m], mass [kg], sex, and segments by the names of the template's links.

    The body's middle is along y in the direction `medial`, 1 for the right leg and -1 for the left
    one.
    """

    height: float
    mass: float
    sex: Sex
    medial: float
    segments: Mapping[str, Segment]

    def segment(self, link: str) -> Segment:
        """Return a segment with its mass [kg], points [m] and inertia tensor [kg m2]."""
        share = self.segments[link]
        mirror = np.array([1.0, self.medial, 1.0])
        mass = share.mass * self.mass
        return Segment(
            mass,
            mirror * share.end * self.height,
            mirror * share.centre * self.height,
            mass * self.height**2 * share.gyration * np.outer(mirror, mirror),
        )


STRENGTH = {
    Sex.MALE: {"hip": 0.161, "knee": 0.163, "ankle": 0.095},
    Sex.FEMALE: {"hip": 0.181, "knee": 0.159, "ankle": 0.104},
}
"""Largest torque over body weight and height: hip extension, knee extension, plantar flexion."""

TEMPLATE_HEIGHT, TEMPLATE_FOOT = 1.75, 0.145
"""Height to which the template's shapes belong, and its distance from ankle to toe [m]."""

CONTACT_POINTS = {"instep": (0.06, 0.0, 0.0277), "inside": (0.06, 0.0372, -0.02)}
"""Points on the right boot of the template where a ball overlaps little with it [m, from the
ankle]: the middle of the slope above the foot, and the inner face in front of the ankle."""

SPATIAL_JOINTS = {
    "hip_adduction": ("hip", (1.0, 0.0, 0.0), (-45.0, 25.0)),
    "hip_rotation": ("hip", (0.0, 0.0, 1.0), (-60.0, 40.0)),
    "subtalar": ("ankle", (1.0, 0.0, 0.0), (-25.0, 35.0)),
}
"""Joints of the model `3d` that follow a joint of the template: this joint, the axis for the right
leg, and the range [deg]. Adduction, internal rotation and inversion are positive. Ranges: US
Department of Veterans Affairs, joint examination norms (hip); Merck Manual (foot)."""


@validation.check_arguments
def human_leg(
    height: float | None,
    mass: float | None,
    sex: str,
    side: str,
    model: str,
    frame: str,
    base: str,
    source: Any,
) -> tuple[UrdfFile, Any, Array | None]:
    """Return the URDF, the `pin.Model` and the cone of contact normals of `Leg.human`.

    Joints without a source for torque and speed have no limits in the model; in the URDF, which
    needs them, they have those of the joint before them.
    """
    height = validation.number("height", height, at_least=1.2, at_most=2.3, unit="m")
    mass = validation.number("mass", mass, at_least=30.0, at_most=200.0, unit="kg")
    kind = validation.choice("sex", sex, Sex)
    is_right = validation.choice("side", side, Side) is Side.RIGHT
    joints = validation.choice("model", model, HumanModel)
    file = read_urdf(shipped_urdf("leg_human.urdf"))
    root = ElementTree.fromstring(file.text)
    medial = 1.0 if is_right else -1.0  # side of the body's middle along y
    person = Person(height, mass, kind, medial, segments(source, kind, side, height))
    _set_size(root, person)
    _add_contact_points(root, medial)
    if joints is HumanModel.SPATIAL:
        for name, (before, axis, degrees) in SPATIAL_JOINTS.items():
            _add_joint(root, name, before, _text(medial * np.array(axis)), degrees)
    if base == "floating":
        _find(root, "link[@name='base']").insert(0, _inertial(person.segment("base")))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    pin_model = build_model(text, file.source, base)
    for number, name in enumerate(pin_model.names):
        if name in SPATIAL_JOINTS:
            index = pin_model.idx_vs[number]
            pin_model.effortLimit[index] = pin_model.velocityLimit[index] = np.inf
    cone = None
    if frame in (TOE, *CONTACT_POINTS):
        direction, lowest, highest = SURFACES[frame]
        cone = normal_cone(*np.radians([medial * direction, lowest, highest]))
    return replace(file, text=text), pin_model, cone


def _set_size(root: Element, person: Person) -> None:
    """Give thigh, shank and foot of the template their size, and the joints their torques."""
    thickness = person.height / TEMPLATE_HEIGHT
    ends = {"thigh": "knee", "shank": "ankle", "foot": "toe_fixed"}
    for link, distal in ends.items():
        segment = person.segment(link)
        origin = _find(root, f"joint[@name='{distal}']/origin")
        if link == "foot":
            stretch = (float(segment.end[0]) / TEMPLATE_FOOT, thickness, thickness)
        else:
            before = _numbers(origin.get("xyz", ""))
            stretch = (thickness, thickness, float(segment.end[2] / before[2]))
        origin.set("xyz", _text(segment.end))
        body = _find(root, f"link[@name='{link}']")
        body.remove(_find(body, "inertial"))
        body.insert(0, _inertial(segment))
        _stretch_shapes(body, stretch)
    _stretch_shapes(_find(root, "link[@name='base']"), (thickness,) * 3)
    for joint, strength in STRENGTH[person.sex].items():
        torque = strength * person.mass * GRAVITY * person.height
        _find(root, f"joint[@name='{joint}']/limit").set("effort", repr(torque))


def _inertial(segment: Segment) -> Element:
    """Return the element with mass [kg], centre [m] and inertia tensor [kg m2] of a segment."""
    inertial = Element("inertial")
    SubElement(inertial, "origin", xyz=_text(segment.centre))
    SubElement(inertial, "mass", value=repr(float(segment.mass)))
    rows = dict(zip("xyz", segment.gyration.tolist(), strict=True))
    tensor = {
        f"i{a}{b}": repr(rows[a]["xyz".index(b)]) for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
    }
    SubElement(inertial, "inertia", tensor)
    return inertial


def _stretch_shapes(link: Element, stretch: tuple[float, ...]) -> None:
    """Multiply the scale of the meshes of a link; pins keep their shape."""
    for mesh in link.iter("mesh"):
        is_pin = mesh.get("filename", "").endswith("pin.stl")
        by = np.full(3, stretch[1]) if is_pin else np.array(stretch)
        mesh.set("scale", _text(by * _numbers(mesh.get("scale", "1 1 1"))))


def _add_contact_points(root: Element, medial: float) -> None:
    """Add links without mass at the contact points of the boot."""
    mesh = next(mesh for mesh in root.iter("mesh") if mesh.get("filename", "").endswith("boot.stl"))
    stretch = _numbers(mesh.get("scale", "")) * (1.0, medial, 1.0)
    for name, point in CONTACT_POINTS.items():
        SubElement(root, "link", name=name)
        joint = SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        SubElement(joint, "parent", link="foot")
        SubElement(joint, "child", link=name)
        SubElement(joint, "origin", xyz=_text(stretch * point))


def _add_joint(
    root: Element, name: str, before: str, axis: str, degrees: tuple[float, float]
) -> None:
    """Add a joint at the origin of the one before it, whose child becomes its own."""
    # the last joint that hangs on `before` comes next in the chain
    last = _find(root, f"joint[@name='{before}']")
    while _find(last, "child").get("link", "").startswith("axes_"):
        link = _find(last, "child").get("link")
        last = next(j for j in root.iter("joint") if _find(j, "parent").get("link") == link)
    joint = deepcopy(last)
    joint.set("name", name)
    SubElement(root, "link", name=f"axes_{name}")
    _find(last, "child").set("link", f"axes_{name}")
    _find(joint, "parent").set("link", f"axes_{name}")
    _find(joint, "origin").set("xyz", "0 0 0")
    _find(joint, "axis").set("xyz", axis)
    lower, upper = np.radians(degrees).tolist()
    _find(joint, "limit").attrib.update(lower=repr(lower), upper=repr(upper))
    root.append(joint)


def _find(element: Element, path: str) -> Element:
    """Return an element of the template, which has it."""
    return next(element.iterfind(path))


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _text(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)
