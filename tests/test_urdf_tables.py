"""The shipped legs: every number derived anew from the paper's tables and the files' headers."""

import math
import re
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest
from tolerances import closed_form

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
HUMAN_EFFORT = [c1 * 75 * G * 1.75 for c1 in (0.161, 0.163, 0.095)]
# RBDL's GymnastWholeBody, and 1160 deg/s at the knee
HUMAN_VELOCITY = [9.18043, math.radians(1160), 17.2746]


def outstretched(limbs):
    """Weight torque of, and reach from, hip, knee and ankle of a leg that is level."""
    torques, reaches = [], []
    for k in range(3):
        torque, reach = 0.0, 0.0
        for limb in list(limbs.values())[k:]:
            torque += G * limb.mass * (reach + limb.centre)
            reach += limb.length
        torques.append(torque)
        reaches.append(reach)
    return np.array(torques), np.array(reaches)


TORQUE, REACH = outstretched(TABLE_6)
LEGS = {  # file: leg, table, limits, and the digits that these have in the file
    "leg_human.urdf": (kd.Leg.human(), TABLE_1, HUMAN_EFFORT, HUMAN_VELOCITY, (0.5, 0.05)),
    "leg_testbed.urdf": (kd.Leg.testbed(), TABLE_6, 2 * TORQUE, 2 * 2.2 / REACH, (1e-3, 1e-3)),
}
each_leg = pytest.mark.parametrize("name", LEGS)


def numbers(element, key):
    return [float(text) for text in element.get(key).split()]


@each_leg
def test_every_number_of_the_table_is_in_the_file(name):
    text = shipped_urdf(name).read_text()
    head = re.search(r"<!--(.*?)-->", text, re.DOTALL).group(1)
    assert ("Table 1" if "human" in name else "Table 6") in head
    root = ElementTree.fromstring(text)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for (limb, table), proximal, distal in zip(
        LEGS[name][1].items(), ("hip", "knee", "ankle"), ("knee", "ankle", "toe_fixed"), strict=True
    ):
        along = np.array([1, 0, 0] if limb == "foot" else [0, 0, -1])
        link = root.find(f"link[@name='{limb}']")
        inertial = link.find("inertial")
        tensor = inertial.find("inertia")
        assert joints[proximal].find("child").get("link") == limb
        assert float(inertial.find("mass").get("value")) == table.mass
        assert numbers(inertial.find("origin"), "xyz") == pytest.approx(table.centre * along)
        assert numbers(joints[distal].find("origin"), "xyz") == pytest.approx(table.length * along)
        radius = RADIUS[limb]
        if name != "leg_human.urdf":  # drawn by meshes
            drawn = link.findall("visual")[1].find("geometry/cylinder")
            assert float(drawn.get("length")) == table.length
            radius = float(drawn.get("radius"))
        axial, other = ("ixx", "izz") if limb == "foot" else ("izz", "ixx")
        assert float(tensor.get("iyy")) == float(tensor.get(other)) == table.inertia
        assert float(tensor.get(axial)) == pytest.approx(table.mass * radius**2 / 2, rel=1e-4)
        assert [tensor.get(key) for key in ("ixy", "ixz", "iyz")] == ["0", "0", "0"]


@each_leg
def test_limits_are_derived_as_the_header_says(name):
    leg, _, effort, velocity, digits = LEGS[name]
    assert leg.joint_names == tuple(RANGE_DEG)
    for joint, span in RANGE_DEG.items():
        assert leg.joint_range(joint) == pytest.approx(np.radians(span), rel=closed_form(10))
    assert leg.effort_limit == pytest.approx(effort, abs=digits[0])
    assert leg.velocity_limit == pytest.approx(velocity, abs=digits[1])


@each_leg
@pytest.mark.parametrize(
    ("joint", "frame", "moves"),
    [
        ("hip", "shank", (1, 0, 0)),  # the knee goes forward
        ("knee", "foot", (-1, 0, 0)),  # the heel goes back
        ("ankle", "toe", (0, 0, -1)),  # the toe goes down
    ],
)
def test_flexion_is_positive_from_a_straight_leg(name, joint, frame, moves):
    leg = kd.Leg.from_urdf(shipped_urdf(name), frame)
    straight = leg.posture(np.zeros(3))
    velocity = straight.jacobian[:, leg.velocity_index(joint)]
    assert velocity / np.linalg.norm(velocity) == pytest.approx(moves, abs=closed_form())
    if frame == "toe":
        thigh, shank, foot = (limb.length for limb in LEGS[name][1].values())
        assert straight.contact_point == pytest.approx([foot, 0, -thigh - shank], abs=closed_form())
        assert LEGS[name][0].frame == "toe"
