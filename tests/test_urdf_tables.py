"""The shipped legs: every number derived anew from the paper's tables and the files' headers."""

import math
import re
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf

G = 9.81


class Limb(NamedTuple):
    length: float
    mass: float
    inertia: float
    centre: float  # from the proximal joint


TABLE_1 = {
    "thigh": Limb(0.371, 7, 0.08, 0.371 / 2),
    "shank": Limb(0.443, 3, 0.049, 0.443 / 2),
    "foot": Limb(0.145, 1, 0.0018, 0.145 / 2),
}
TABLE_6 = {
    "thigh": Limb(0.4, 1.712, 0.02305, 0.2),
    "shank": Limb(0.396, 1.074, 0.01413, 0.198),
    "foot": Limb(0.22, 0.57, 0.00055, 0.073),
}
RADIUS = {"thigh": 0.07, "shank": 0.05, "foot": 0.03}
"""Of the cylinders whose inertia about their axes the human leg has [m]."""

RANGE_DEG = {"hip": (-30, 125), "knee": (0, 140), "ankle": (-20, 50)}

# Anderson, Madigan & Nussbaum 2007, Table 3, men 18-25: the largest torque is c1 times body
# weight times height; hip extension, knee extension, plantar flexion.
HUMAN_EFFORT = {
    joint: c1 * 75 * G * 1.75 for joint, c1 in (("hip", 0.161), ("knee", 0.163), ("ankle", 0.095))
}
# RBDL's GymnastWholeBody, and 1160 deg/s at the knee
HUMAN_VELOCITY = {"hip": 9.18043, "knee": math.radians(1160), "ankle": 17.2746}


def outstretched(limbs):
    """Weight torque of, and reach from, each joint of a leg held level."""
    thigh, shank, foot = limbs.values()
    torque = {"ankle": foot.mass * foot.centre * G}
    reach = {"ankle": foot.length}
    torque["knee"] = G * (shank.mass * shank.centre + foot.mass * (shank.length + foot.centre))
    reach["knee"] = shank.length + foot.length
    torque["hip"] = G * (
        thigh.mass * thigh.centre
        + shank.mass * (thigh.length + shank.centre)
        + foot.mass * (thigh.length + shank.length + foot.centre)
    )
    reach["hip"] = thigh.length + reach["knee"]
    return torque, reach


TORQUE, REACH = outstretched(TABLE_6)
BED_EFFORT = {joint: 2 * torque for joint, torque in TORQUE.items()}
BED_VELOCITY = {joint: 2 * 2.2 / reach for joint, reach in REACH.items()}

LEGS = {
    "leg_human.urdf": (kd.Leg.human, TABLE_1, HUMAN_EFFORT, HUMAN_VELOCITY),
    "leg_testbed.urdf": (kd.Leg.testbed, TABLE_6, BED_EFFORT, BED_VELOCITY),
}
each_leg = pytest.mark.parametrize("name", LEGS)


def numbers(element, key):
    return [float(text) for text in element.get(key).split()]


@each_leg
def test_every_number_of_the_table_is_in_the_file(name):
    root = ElementTree.parse(shipped_urdf(name)).getroot()
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    limbs = LEGS[name][1]
    for proximal, distal, limb in zip(
        ("hip", "knee", "ankle"), ("knee", "ankle", "toe_fixed"), limbs, strict=True
    ):
        table = limbs[limb]
        along = (1, 0, 0) if limb == "foot" else (0, 0, -1)
        link = root.find(f"link[@name='{limb}']")
        inertial = link.find("inertial")
        tensor = inertial.find("inertia")
        assert joints[proximal].find("child").get("link") == limb
        assert float(inertial.find("mass").get("value")) == table.mass
        centre = [table.centre * axis for axis in along]
        assert numbers(inertial.find("origin"), "xyz") == pytest.approx(centre, abs=1e-15)
        end = [table.length * axis for axis in along]
        assert numbers(joints[distal].find("origin"), "xyz") == pytest.approx(end, abs=1e-15)

        radius = RADIUS[limb]
        if name != "leg_human.urdf":  # drawn by meshes
            drawn = link.findall("visual")[1].find("geometry/cylinder")
            assert float(drawn.get("length")) == table.length
            radius = float(drawn.get("radius"))
        about_itself = table.mass * radius**2 / 2
        own, across = ("ixx", "izz") if limb == "foot" else ("izz", "ixx")
        assert float(tensor.get("iyy")) == float(tensor.get(across)) == table.inertia
        assert float(tensor.get(own)) == pytest.approx(about_itself, rel=1e-4)
        assert [tensor.get(key) for key in ("ixy", "ixz", "iyz")] == ["0", "0", "0"]


@each_leg
def test_limits_are_derived_as_the_header_says(name):
    make, _, effort, velocity = LEGS[name]
    leg = make()
    assert leg.joint_names == ("hip", "knee", "ankle")
    for i, joint in enumerate(leg.joint_names):
        low, high = (math.radians(angle) for angle in RANGE_DEG[joint])
        assert leg.joint_range(joint) == pytest.approx((low, high), rel=1e-15)
        digits = {"rel": 2e-5} if name == "leg_testbed.urdf" else {"abs": 0.5}
        assert leg.effort_limit[i] == pytest.approx(effort[joint], **digits)
        digits = {"rel": 2e-5} if name == "leg_testbed.urdf" else {"abs": 0.05}
        assert leg.velocity_limit[i] == pytest.approx(velocity[joint], **digits)


@each_leg
def test_standing_straight_at_zero_with_the_toe_at_the_tip(name):
    make, limbs, *_ = LEGS[name]
    leg = make()
    straight = leg.posture(leg.configuration())
    thigh, shank, foot = (limb.length for limb in limbs.values())
    assert leg.frame == "toe"
    assert straight.contact_point == pytest.approx([foot, 0, -thigh - shank], abs=1e-15)


@each_leg
@pytest.mark.parametrize(
    ("joint", "frame", "moves"),
    [
        ("hip", "shank", (1, 0, 0)),  # the knee goes forward
        ("knee", "foot", (-1, 0, 0)),  # the heel goes back
        ("ankle", "toe", (0, 0, -1)),  # the toe goes down
    ],
)
def test_flexion_is_positive(name, joint, frame, moves):
    leg = kd.Leg.from_urdf(shipped_urdf(name), frame)
    velocity = leg.posture(np.zeros(3)).jacobian[:, leg.velocity_index(joint)]
    assert velocity / np.linalg.norm(velocity) == pytest.approx(moves, abs=1e-15)


@each_leg
def test_yourdfpy_reads_the_same_leg(name):
    leg = LEGS[name][0]()
    other = yourdfpy.URDF.load(str(shipped_urdf(name)))
    assert other.validate()
    masses = [link.inertial.mass for link in other.robot.links if link.inertial]
    assert sum(masses) == pytest.approx(sum(body.mass for body in leg.model.inertias), rel=1e-15)
    assert sum(masses) == pytest.approx(sum(limb.mass for limb in LEGS[name][1].values()))
    model = leg.model
    data = model.createData()
    rng = np.random.default_rng(1)
    for q in rng.uniform(leg.lower, leg.upper, size=(20, 3)):
        pin.framesForwardKinematics(model, data, q)
        other.update_cfg(dict(zip(leg.joint_names, q, strict=True)))
        for link in other.link_map:
            placement = data.oMf[model.getFrameId(link, pin.FrameType.BODY)].homogeneous
            assert np.abs(other.get_transform(link) - placement).max() < 5e-15


@each_leg
def test_shipped_files_say_where_their_numbers_come_from(name):
    head = re.search(r"<!--(.*?)-->", shipped_urdf(name).read_text(), re.DOTALL).group(1)
    assert "Choi et al." in head
    assert ("Table 1" if "human" in name else "Table 6") in head
