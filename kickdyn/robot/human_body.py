"""The leg of a person of a given height, mass and sex, from published segment parameters.

`urdf/leg_human.urdf` is the template: its joints, ranges, speed limits and shapes stay, the
segments get their size. The axes are the template's: x forward, y left, z up.

Segments are from de Leva 1996 (J Biomech 29:1223, Table 4) for college-aged adults, with the
joint centres as ends: lengths are proportional to the height, masses to the mass of the body, and
radii of gyration to the lengths. The foot lies along x from the heel to the tip of the toes at the
height of the ankle, as in the paper's model.

Torques are the c1 of Anderson, Madigan & Nussbaum 2007 (J Biomech 40:3105, Table 3, 18-25 years),
as transcribed in RBDL's Millard2016TorqueMuscle, times body weight and height.
"""

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
from kickdyn.robot.urdf_file import UrdfFile, build_model, read_urdf, shipped_urdf


class Sex(StrEnum):
    """Sex of the persons whose segments were measured."""

    FEMALE = "female"
    MALE = "male"


class Side(StrEnum):
    """Side of the kicking leg."""

    LEFT = "left"
    RIGHT = "right"


class HumanModel(StrEnum):
    """Joints of a human leg: as in the paper, in one plane, or six in space."""

    PAPER = "paper"
    SPATIAL = "3d"


class Segment(NamedTuple):
    """A segment of the mean person of de Leva's Table 4.

    Attributes:
        mass: share of the mass of the body.
        length: from the proximal to the distal end, of the foot from the heel to the tip [m].
        centre: centre of mass, from the proximal end (of the foot the heel, of the pelvis the
            navel), over the length.
        sagittal, transverse, longitudinal: radii of gyration about axes through the centre, over
            the length: forward, sideways and along the segment. The sagittal axis of the foot,
            whose longitudinal one points forward, points up.
    """

    mass: float
    length: float
    centre: float
    sagittal: float
    transverse: float
    longitudinal: float


HEIGHT = {Sex.MALE: 1.741, Sex.FEMALE: 1.735}
"""Height of the mean person [m]."""

SEGMENTS = {
    Sex.MALE: {
        "thigh": Segment(0.1416, 0.4222, 0.4095, 0.329, 0.329, 0.149),
        "shank": Segment(0.0433, 0.4403, 0.4395, 0.251, 0.246, 0.102),
        "foot": Segment(0.0137, 0.2581, 0.4415, 0.257, 0.245, 0.124),
        "base": Segment(0.1117, 0.1457, 0.6115, 0.615, 0.551, 0.587),
    },
    Sex.FEMALE: {
        "thigh": Segment(0.1478, 0.3685, 0.3612, 0.369, 0.364, 0.162),
        "shank": Segment(0.0481, 0.4386, 0.4352, 0.267, 0.263, 0.092),
        "foot": Segment(0.0129, 0.2283, 0.4014, 0.299, 0.279, 0.139),
        "base": Segment(0.1247, 0.1815, 0.4920, 0.433, 0.402, 0.444),
    },
}
"""Segments by the names of the template's links; the base is the lower trunk."""

STRENGTH = {
    Sex.MALE: {"hip": 0.161, "knee": 0.163, "ankle": 0.095},
    Sex.FEMALE: {"hip": 0.181, "knee": 0.159, "ankle": 0.104},
}
"""Largest torque over body weight and height: hip extension, knee extension, plantar flexion."""

HEEL = 0.25
"""Distance from the heel to the ankle over the length of the foot: an assumption, because the
table has no ankle in the foot."""

HIP_OFFSET = 0.0835 / 1.80
"""Distance of a hip from the middle over the height: model of Delp et al. 1990, IEEE Trans Biomed
Eng 37:757."""

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
) -> tuple[UrdfFile, Any, Array | None]:
    """Return the URDF, the `pin.Model` and the cone of contact normals of a person's leg.

    The arguments are as for `Leg.human`, which raises the same errors. Joints without a source
    for torque and speed have no limits in the model; in the URDF, which needs them, they have those
    of the joint before them.
    """
    height = validation.number("height", height, at_least=1.2, at_most=2.3, unit="m")
    mass = validation.number("mass", mass, at_least=30.0, at_most=200.0, unit="kg")
    kind = validation.choice("sex", sex, Sex)
    is_right = validation.choice("side", side, Side) is Side.RIGHT
    joints = validation.choice("model", model, HumanModel)
    file = read_urdf(shipped_urdf("leg_human.urdf"))
    root = ElementTree.fromstring(file.text)
    medial = 1.0 if is_right else -1.0  # side of the body's middle along y
    _set_size(root, height, mass, kind)
    _add_contact_points(root, medial)
    if joints is HumanModel.SPATIAL:
        for name, (before, axis, degrees) in SPATIAL_JOINTS.items():
            _add_joint(root, name, before, _text(medial * np.array(axis)), degrees)
    if base == "floating":
        _add_pelvis(root, height, mass, kind, medial)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    pin_model = build_model(text, file.source, base)
    for number, name in enumerate(pin_model.names):
        if name in SPATIAL_JOINTS:
            at = pin_model.idx_vs[number]
            pin_model.effortLimit[at] = pin_model.velocityLimit[at] = np.inf
    cone = None
    if frame in (TOE, *CONTACT_POINTS):
        direction, lowest, highest = SURFACES[frame]
        cone = normal_cone(*np.radians([medial * direction, lowest, highest]))
    return replace(file, text=text), pin_model, cone


def _set_size(root: Element, height: float, mass: float, sex: Sex) -> None:
    """Give thigh, shank and foot of the template their size, and the joints their torques."""
    scale = height / HEIGHT[sex]
    thickness = height / TEMPLATE_HEIGHT
    ends = {"thigh": "knee", "shank": "ankle", "foot": "toe_fixed"}
    for link, distal in ends.items():
        segment = SEGMENTS[sex][link]
        length = scale * segment.length
        if link == "foot":
            centre = ((segment.centre - HEEL) * length, 0.0, 0.0)
            end = ((1.0 - HEEL) * length, 0.0, 0.0)
            stretch = (end[0] / TEMPLATE_FOOT, thickness, thickness)
            radii = (segment.longitudinal, segment.transverse, segment.sagittal)
        else:
            centre, end = (0.0, 0.0, -segment.centre * length), (0.0, 0.0, -length)
            before = _numbers(_find(root, f"joint[@name='{distal}']/origin").get("xyz", ""))
            stretch = (thickness, thickness, end[2] / before[2])
            radii = (segment.sagittal, segment.transverse, segment.longitudinal)
        _find(root, f"joint[@name='{distal}']/origin").set("xyz", _text(end))
        body = _find(root, f"link[@name='{link}']")
        _set_inertial(_find(body, "inertial"), segment.mass * mass, centre, length, radii)
        _stretch_shapes(body, stretch)
    _stretch_shapes(_find(root, "link[@name='base']"), (thickness,) * 3)
    for joint, strength in STRENGTH[sex].items():
        torque = strength * mass * GRAVITY * height
        _find(root, f"joint[@name='{joint}']/limit").set("effort", repr(torque))


def _set_inertial(
    inertial: Element, mass: float, centre: tuple[float, ...], length: float, radii: Any
) -> None:
    """Write mass [kg], centre [m] and inertia, by radii of gyration over the length."""
    _find(inertial, "origin").set("xyz", _text(centre))
    _find(inertial, "mass").set("value", repr(mass))
    for axis, radius in zip("xyz", radii, strict=True):
        _find(inertial, "inertia").set(f"i{axis}{axis}", repr(mass * (radius * length) ** 2))


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


def _add_pelvis(root: Element, height: float, mass: float, sex: Sex, medial: float) -> None:
    """Give the base the inertia of the lower trunk; its origin stays at the hip that kicks."""
    segment = SEGMENTS[sex]["base"]
    length = height / HEIGHT[sex] * segment.length
    inertial = deepcopy(_find(root, "link[@name='thigh']/inertial"))
    centre = (0.0, medial * HIP_OFFSET * height, (1.0 - segment.centre) * length)
    radii = (segment.sagittal, segment.transverse, segment.longitudinal)
    _set_inertial(inertial, segment.mass * mass, centre, length, radii)
    _find(root, "link[@name='base']").insert(0, inertial)


def _find(element: Element, path: str) -> Element:
    """Return an element of the template, which has it."""
    return next(element.iterfind(path))


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _text(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)
