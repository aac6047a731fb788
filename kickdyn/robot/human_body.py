"""The leg of a person of a given height, mass and sex, from published tables or girths.

`urdf/leg_human.urdf` is the template: its joints, ranges, speed limits and shapes stay, the
segments get their size. The axes are the template's: x forward, y left, z up. The tip of the toes
is at the height of the ankle, as in the paper's model. Torques are the c1 of Anderson, Madigan &
Nussbaum 2007 (J Biomech 40:3105, Table 3, 18-25 years), as transcribed in RBDL's
Millard2016TorqueMuscle, times body weight and height.

Tables have masses as shares of the body's, and lengths, centres of mass and radii of gyration of
the mean person of each sex, which are taken as proportional to the height.

- **de Leva** 1996 (J Biomech 29:1223, Table 4): college-aged adults, segments between joint
  centres, principal radii of gyration. The foot lies along x from the heel to the tip of the toes.
- **Dumas**, Chèze & Verriest 2007 (J Biomech 40:543, Table 2, with its corrigendum 40:1651):
  adults  of 31 and 28 years, whole inertia tensors in axes of the joints, centres beside the line
  between  joints. The numbers are from two independent transcriptions, in Kinetics Toolkit
  (`dumas_2007.csv`) and in a program for multibody dynamics, which agree except for the mass of
  the  man's shank; there the second agrees with Dumas & Wojtusch 2018 (Handbook of Human Motion),
  as  does the place of the hips. The tensors agree with a third one,
  `SubjectParameterEstimation.m` of the  HuMoD data (Wojtusch & von Stryk 2015, Humanoids).

A `yeadon.Human` has segments by Yeadon 1990 (J Biomech 23:67): a stack of solids, with uniform
densities, from 95 lengths and girths of one person.
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
from kickdyn.errors import InvalidInput
from kickdyn.robot.catalog import SURFACES, TOE, normal_cone
from kickdyn.robot.urdf_file import UrdfFile, build_model, read_urdf, shipped_urdf


class Sex(StrEnum):
    """Sex of the persons whose segments were measured."""

    FEMALE = "female"
    MALE = "male"


class Tables(StrEnum):
    """Published tables of segments."""

    DE_LEVA = "de Leva"
    DUMAS = "Dumas"


class BodySegment(NamedTuple):
    """A segment of a right leg, in the axes of its link: x forward, y left, z up.

    Attributes:
        mass: over the mass of the body.
        end: from the upper joint to the next one, of a foot to the tip of the toes, shape `(3,)`,
            over the height. The origin of the pelvis is the hip.
        centre: centre of mass from the upper joint, shape `(3,)`, over the height.
        gyration: inertia tensor about the centre, over mass and squared height, shape `(3, 3)`.
    """

    mass: float
    end: Array
    centre: Array
    gyration: Array


DE_LEVA_HEIGHT = {Sex.MALE: 1.741, Sex.FEMALE: 1.735}
"""Height of the mean person [m]."""

DE_LEVA = {
    Sex.MALE: {
        "thigh": (0.1416, 0.4222, 0.4095, 0.329, 0.329, 0.149),
        "shank": (0.0433, 0.4403, 0.4395, 0.251, 0.246, 0.102),
        "foot": (0.0137, 0.2581, 0.4415, 0.257, 0.245, 0.124),
        "base": (0.1117, 0.1457, 0.6115, 0.615, 0.551, 0.587),
    },
    Sex.FEMALE: {
        "thigh": (0.1478, 0.3685, 0.3612, 0.369, 0.364, 0.162),
        "shank": (0.0481, 0.4386, 0.4352, 0.267, 0.263, 0.092),
        "foot": (0.0129, 0.2283, 0.4014, 0.299, 0.279, 0.139),
        "base": (0.1247, 0.1815, 0.4920, 0.433, 0.402, 0.444),
    },
}
"""Segments by the names of the template's links; the base is the lower trunk.

Columns are the share of the mass of the body; the length from the proximal to the distal end [m];
the centre of mass from the proximal end, over the length; and radii of gyration about sagittal,
transverse and longitudinal axes through the centre, over the length. The foot is from the heel to
the tip of the toes, the pelvis from the navel; the sagittal axis of the foot points up.
"""

HEEL_SHARE = 0.25
"""Distance from the heel to the ankle over the length of the foot, with de Leva's segments: an
assumption, because the table has no ankle in the foot."""

HIP_OFFSET = 0.0835 / 1.80
"""Distance of a hip from the middle over the height, with de Leva's segments: model of Delp et al.
1990, IEEE Trans Biomed Eng 37:757."""

DUMAS_HEIGHT = {Sex.MALE: 1.77, Sex.FEMALE: 1.61}
"""Height of the mean person [m]."""

DUMAS = {
    Sex.MALE: {
        "thigh": (0.123, 0.432, (-0.041, -0.429, 0.033), (29, 15, 30, 7, -2, -7)),
        "shank": (0.048, 0.433, (-0.048, -0.410, 0.007), (28, 10, 28, -4, -2, 5)),
        "foot": (0.012, 0.183, (0.382, -0.151, 0.026), (17, 37, 36, 13, -8, 0)),
        "base": (0.142, 0.094, (0.028, -0.280, -0.006), (101, 106, 95, -25, -12, -8)),
    },
    Sex.FEMALE: {
        "thigh": (0.146, 0.379, (-0.077, -0.377, 0.009), (31, 19, 32, 7, -2, -7)),
        "shank": (0.045, 0.388, (-0.049, -0.404, 0.031), (28, 10, 28, 2, 1, 6)),
        "foot": (0.010, 0.165, (0.270, -0.218, 0.039), (17, 36, 35, -10, 6, -4)),
        "base": (0.146, 0.107, (-0.009, -0.232, 0.002), (91, 100, 79, -34, -1, -1)),
    },
}
"""Segments by the names of the template's links; the base is the pelvis, from the lumbar joint.

Columns are the share of the mass of the body; the distance between the joints, of the foot from
the ankle to the middle between the first and fifth metatarsal heads [m]; the centre of mass from
the upper joint, over the length (x forward, y up, z to the right); and roots of the elements xx,
yy, zz, xy, xz, yz of the inertia tensor over mass and squared length, in percent. A minus is the
sign of the element, printed as an imaginary root.
"""

DUMAS_FOOT = {Sex.MALE: (0.265, 0.436), Sex.FEMALE: (0.233, 0.443)}
"""Distance from the heel to the tip of the toes [m], and the place of the foot's centre from the
heel over it: with the place from the ankle they give the ankle's distance from the heel."""

DUMAS_HIP = {
    Sex.MALE: 0.224 * np.array([-0.095 + 0.335, -0.370 + 0.032, 0.361]),
    Sex.FEMALE: 0.238 * np.array([-0.139 + 0.340, -0.336 - 0.049, 0.372]),
}
"""Right hip from the lumbar joint [m]: places of both from the middle of the spines (Dumas &
Wojtusch 2018), times the distance between these (Dumas et al. 2007)."""

DUMAS_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes x forward, y left, z up by those of Dumas."""


YEADON_FOOT = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Axes of a foot that lies forward by the axes of one that points down."""


def segments(source: Any, sex: Sex, side: str, height: float) -> dict[str, BodySegment]:
    """Return the segments of a table, or of a `yeadon.Human` [m by this height], by link."""
    # attributes of a `yeadon.Human`: pelvis, left thigh and lower leg, and the right ones
    if all(hasattr(source, name) for name in ("P", "J1", "J2", "K1", "K2")):
        return _yeadon(source, side, height)
    if validation.choice("segments", source, Tables) is Tables.DUMAS:
        return {link: _dumas(link, row, sex) for link, row in DUMAS[sex].items()}
    return {link: _de_leva(link, row, sex) for link, row in DE_LEVA[sex].items()}


def _yeadon(human: Any, side: str, height: float) -> dict[str, BodySegment]:
    """Return the segments of a `yeadon.Human`: x is left, z up, and the foot points down."""
    thigh, lower = (human.K1, human.K2) if side == "right" else (human.J1, human.J2)
    for segment in (human.P, thigh, lower):
        if not np.allclose(segment.rot_mat, np.eye(3)):
            raise InvalidInput(
                "segments is a yeadon.Human whose legs are bent: its configuration must be neutral"
            )
    groups = {
        "thigh": thigh.solids,
        "shank": lower.solids[:2],
        "foot": lower.solids[2:],
        "base": human.P.solids,
    }
    segments = {}
    for link, solids in groups.items():
        masses = np.array([float(solid.mass) for solid in solids])
        centres = np.array([np.ravel(solid.center_of_mass)[[1, 0, 2]] for solid in solids])
        begin = np.ravel(thigh.pos if link == "base" else solids[0].pos)[[1, 0, 2]]
        if link != "base":
            begin[2] += float(solids[0].height)  # the position of a solid is its lower end
        mass, centre = masses.sum(), masses @ centres / masses.sum()
        tensor = np.zeros((3, 3))
        for solid, share, place in zip(solids, masses, centres - centre, strict=True):
            tensor += np.diag(np.diag(solid.inertia)[[1, 0, 2]])
            tensor += share * (place @ place * np.eye(3) - np.outer(place, place))
        length = 0.0 if link == "base" else sum(float(solid.height) for solid in solids)
        turn = YEADON_FOOT if link == "foot" else np.eye(3)
        offset = np.abs(centre - begin) * (1.0, 1.0, np.sign(centre - begin)[2])
        segments[link] = BodySegment(
            float(mass / human.mass),
            turn @ np.array([0.0, 0.0, -length]) / height,
            turn @ offset / height,
            turn @ tensor @ turn.T / (mass * height**2),
        )
    return segments


def _de_leva(link: str, row: tuple[float, ...], sex: Sex) -> BodySegment:
    mass, length, share, *radii = row
    length /= DE_LEVA_HEIGHT[sex]
    along = np.array([0.0, 0.0, -length])
    end, centre = along, share * along
    if link == "foot":
        radii = radii[::-1]
        end, centre = (np.array([(x - HEEL_SHARE) * length, 0.0, 0.0]) for x in (1.0, share))
    elif link == "base":
        end, centre = np.zeros(3), np.array([0.0, HIP_OFFSET, (1.0 - share) * length])
    return BodySegment(mass, end, centre, np.diag((length * np.array(radii)) ** 2))


def _dumas(link: str, row: tuple[Any, ...], sex: Sex) -> BodySegment:
    height, (mass, size, place, radii) = DUMAS_HEIGHT[sex], row
    centre, end = size * np.array(place), np.array([0.0, -size, 0.0])
    if link == "foot":
        length, from_heel = DUMAS_FOOT[sex]
        end = np.array([centre[0] + (1.0 - from_heel) * length, 0.0, 0.0])
    elif link == "base":
        centre, end = centre - DUMAS_HIP[sex], np.zeros(3)
    roots = 0.01 * size * np.array(radii, dtype=float)
    xx, yy, zz, xy, xz, yz = (np.sign(roots) * roots**2).tolist()
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return BodySegment(
        mass,
        DUMAS_AXES @ end / height,
        DUMAS_AXES @ centre / height,
        DUMAS_AXES @ tensor @ DUMAS_AXES.T / height**2,
    )


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
    mirror, sized = np.array([1.0, medial, 1.0]), dict[str, BodySegment]()  # in kg, m and kg m2
    for link, segment in segments(source, kind, side, height).items():
        share, end, centre, gyration = segment
        tensor = share * mass * height**2 * gyration * np.outer(mirror, mirror)
        sized[link] = BodySegment(
            share * mass, mirror * end * height, mirror * centre * height, tensor
        )
    _set_size(root, sized, height)
    for name, strength in STRENGTH[kind].items():
        torque = strength * mass * GRAVITY * height
        _find(root, f"joint[@name='{name}']/limit").set("effort", repr(torque))
    mesh = next(mesh for mesh in root.iter("mesh") if mesh.get("filename", "").endswith("boot.stl"))
    stretch = _numbers(mesh.get("scale", "")) * (1.0, medial, 1.0)
    for name, point in CONTACT_POINTS.items():
        SubElement(root, "link", name=name)
        joint = SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        SubElement(joint, "parent", link="foot")
        SubElement(joint, "child", link=name)
        SubElement(joint, "origin", xyz=_text(stretch * point))
    if joints is HumanModel.SPATIAL:
        for name, (before, axis, degrees) in SPATIAL_JOINTS.items():
            _add_joint(root, name, before, _text(medial * np.array(axis)), degrees)
    if base == "floating":
        _find(root, "link[@name='base']").insert(0, _inertial(sized["base"]))
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


def _set_size(root: Element, sized: Mapping[str, BodySegment], height: float) -> None:
    thickness = height / TEMPLATE_HEIGHT
    ends = {"thigh": "knee", "shank": "ankle", "foot": "toe_fixed"}
    for link, distal in ends.items():
        segment = sized[link]
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


def _inertial(segment: BodySegment) -> Element:
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
    for mesh in link.iter("mesh"):
        is_pin = mesh.get("filename", "").endswith("pin.stl")
        by = np.full(3, stretch[1]) if is_pin else np.array(stretch)
        mesh.set("scale", _text(by * _numbers(mesh.get("scale", "1 1 1"))))


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
    return next(element.iterfind(path))


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _text(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)
