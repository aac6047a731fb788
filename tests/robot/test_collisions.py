"""Bodies inside each other and inside a ball, against distances that geometry gives."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.robot.collisions import body_of, find_ball_overlaps, find_self_collisions
from kickdyn.robot.ground_clearance import Spheres

GJK = 1e-6
"""Absolute tolerance of the distance of two convex shapes by iteration [m]."""

LEGS = """<mujoco><worldbody><body name="trunk" pos="0 0 1"><geom type="sphere" size="0.05"/>
<body name="left" pos="0 0.1 0"><joint name="l" type="hinge" axis="1 0 0"/>
<geom type="{0}" size="{1}" pos="0 0 -0.4"/></body>
<body name="right" pos="0 -0.1 0"><joint name="r" type="hinge" axis="1 0 0"/>
<geom type="{0}" size="{1}" pos="0 0 -0.4"/></body></body></worldbody></mujoco>"""


def legs(folder, kind, size):
    """Two legs of one shape each, 0.4 m below hips that are 0.2 m apart and turn about x."""
    path = folder / "legs.xml"
    path.write_text(LEGS.format(kind, size))
    return kd.Leg.from_mjcf(path, "right")


@pytest.mark.parametrize(("kind", "size", "lowest"), [
    ("capsule", "0.04 0.3", 0.26), ("sphere", "0.04", 0.56), ("box", "0.1 0.04 0.3", 0.3)
])  # fmt: skip
def test_crossed_legs_are_inside_each_other_and_straight_ones_are_not(tmp_path, kind, size, lowest):
    leg = legs(tmp_path, kind, size)
    assert find_self_collisions(leg, leg.configuration()) == {}
    for depth in (0.00501, 0.00499):  # of a ball below; 5 mm count as touching
        centre = np.array([0.0, -0.1, lowest - 0.1 + depth])
        overlaps = find_ball_overlaps(leg.posture(leg.configuration()), centre, 0.1)
        assert overlaps == ({"right": pytest.approx(depth, abs=GJK)} if depth > 5e-3 else {})
    (pair, depth), *others = find_self_collisions(
        leg, leg.configuration({"l": -0.3, "r": 0.3})
    ).items()
    assert (set(pair), others) == ({"left", "right"}, [])
    if kind == "sphere":  # centres at y = +-(0.1 - 0.4 sin 0.3)
        assert depth == pytest.approx(0.08 - 2 * abs(0.1 - 0.4 * np.sin(0.3)), abs=GJK)


def test_bodies_that_touch_at_rest_do_not_count(tmp_path):
    wide = legs(tmp_path, "capsule", "0.11 0.3")
    assert find_self_collisions(wide, wide.configuration({"l": -0.3, "r": 0.3})) == {}


INERTIAL = """<inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"""
LINK = f"""<link name="{{}}">{INERTIAL}<visual><origin xyz="{{}}"/><geometry><box size="{{}}"/>
</geometry></visual></link>"""
JOINT = """<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}"/>
<axis xyz="{}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""


@pytest.mark.parametrize(("urdf", "srdf"), [
    ("urdf/other.urdf", "urdf/three.srdf"),  # by the name of the robot
    ("urdf/other.urdf", "srdf/Three.srdf"),  # in the folder srdf beside its folder
])  # fmt: skip
def test_pairs_that_the_srdf_disables_do_not_count(tmp_path, urdf, srdf):
    """A shank reaches thigh and trunk where the knee is bent by 166 degrees."""
    box = "0.1 0.1 0.3"
    text = LINK.format("trunk", "0 0 0", box) + LINK.format("thigh", "0 0 -0.1", "0.1 0.1 0.1")
    text += LINK.format("shank", "0 0 -0.2", box)
    text += JOINT.format("hip", "trunk", "thigh", "0 0 -0.2", "0 1 0")
    text += JOINT.format("knee", "thigh", "shank", "0 0 -0.2", "0 1 0")
    for path in (tmp_path / urdf, tmp_path / srdf):
        path.parent.mkdir(exist_ok=True)
    (tmp_path / urdf).write_text(f'<robot name="three">{text}</robot>')

    def collisions():
        leg = kd.Leg.from_urdf(tmp_path / urdf, "shank")
        return [*find_self_collisions(leg, leg.configuration({"knee": 2.9}))]

    assert collisions() == [("trunk", "shank")]
    line = '<disable_collisions link1="shank" link2="trunk"/>'
    (tmp_path / srdf).write_text(f'<robot name="three">{line}</robot>')
    assert collisions() == []


@pytest.mark.parametrize("size", [1e-3, 1.0, 30.0])
@pytest.mark.parametrize("width", [0.0, 1.0])
def test_a_flat_or_thin_body_is_thickened_a_little(size, width):
    """A hull without volume would end the process."""
    corners = [(x, width * y, 0.0) for x in (0, 1) for y in (0, 1)]
    box = body_of("sheet", Spheres(size * np.array(corners), np.zeros(4))).shape
    box.computeLocalAABB()
    sizes, thin = box.aabb_local.max_ - box.aabb_local.min_, 1e-3 * np.hypot(1.0, width) / 2
    assert sizes == pytest.approx(size * np.array([1.0, width or thin, thin]))


@pytest.mark.parametrize(("axis", "place", "size", "between", "counts"), [
    ("1 0 0", "0.02 0.03 0", "0.3 0.3 0.1", INERTIAL, False),  # axes that cross within the bodies
    ("1 0 0", "0 0 -0.02", "0.3 0.3 0.1", INERTIAL, True),  # axes 2 cm apart
    ("1 0 0", "0 0 -0.02", "0.3 0.3 0.1", "", False),  # no body between them
    ("0 1 0", "0 0 0", "0.3 0.3 0.1", INERTIAL, True),  # parallel axes
    ("1 0 0", "0 0 0", "0.01 0.01 0.01", INERTIAL, True),  # a shape that is far from the crossing
])  # fmt: skip
def test_forks_around_axes_that_meet_do_not_count(tmp_path, axis, place, size, between, counts):
    """Shank and foot of an ankle whose roll and pitch axes cross are forks."""
    centre = "0 0.3 -0.12" if size == "0.01 0.01 0.01" else "0 0 -0.12"
    text = '<link name="root"/>' + LINK.format("shank", "0 0 0.15", "0.1 0.9 0.2")
    text += f'<link name="cross">{between}</link>' + LINK.format("foot", centre, size)
    text += JOINT.format("knee", "root", "shank", "0 0 0", "1 0 0")
    text += JOINT.format("pitch", "shank", "cross", "0 0 0", "0 1 0")
    text += JOINT.format("roll", "cross", "foot", place, axis)
    (tmp_path / "ankle.urdf").write_text(f'<robot name="ankle">{text}</robot>')
    leg = kd.Leg.from_urdf(tmp_path / "ankle.urdf", "foot", drives=False)
    collisions = [*find_self_collisions(leg, leg.configuration({"pitch": 3.0}))]
    assert collisions == ([("shank", "foot")] if counts else [])
