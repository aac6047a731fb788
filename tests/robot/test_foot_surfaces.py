"""Surfaces of a foot that can meet a ball, of a box by hand and of robots by their meshes."""

from pathlib import Path

import numpy as np
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.cli.leg_options import load_leg
from kickdyn.robot.catalog import ROBOTS, SURFACES
from kickdyn.robot.foot_surfaces import load_with_surface
from kickdyn.robot.urdf_file import shipped_urdf

LINK = """<link name="{}"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01"
ixy="0" ixz="0" iyz="0"/></inertial>{}</link>"""
BOX = """<collision><origin xyz="0.05 0.01 -0.02" rpy="0 0 0"/><geometry><box size="0.24 0.1 0.06"/>
</geometry></collision>"""
JOINT = """<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="{}"/>
<origin xyz="0 {} {}"/><limit lower="-2" upper="2" effort="300" velocity="30"/></joint>"""


def box_foot(folder, y=-0.1, shape=BOX):
    """A leg with a foot of 0.24 m x 0.1 m x 0.06 m, its middle (0.05, 0.01, -0.02) m off."""
    links = [("pelvis", ""), ("hips", ""), ("thigh", ""), ("shank", ""), ("foot", shape)]
    joints = [("yaw", "pelvis", "hips", "0 0 1", y, 0), ("hip", "hips", "thigh", "0 1 0", 0, 0)]
    joints += [("knee", "thigh", "shank", "0 1 0", 0, -0.4)]
    joints += [("ankle", "shank", "foot", "0 1 0", 0, -0.4)]
    text = "".join(LINK.format(*link) for link in links)
    text += "".join(JOINT.format(*joint) for joint in joints)
    path = folder / "box.urdf"
    path.write_text(f'<robot name="box">{text}</robot>')
    return kd.Leg.from_urdf(path, "foot", drives=False)


@pytest.mark.parametrize(("name", "point", "direction", "rises"), [  # directions to the left of x
    ("toe", (0.17, 0.01, 0.01), 0, (0, 60)), ("sole_edge", (0.17, 0.01, -0.05), 0, (-90, 0)),
    ("inside", (0.05, 0.06, 0.01), 90, (0, 15)), ("outside", (0.05, -0.04, 0.01), -90, (0, 15)),
    ("heel", (-0.07, 0.01, 0.01), 180, (0, 15))])  # fmt: skip
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_surfaces_of_a_box_are_its_edges(tmp_path, name, point, direction, rises, side):
    """Normals to both sides meet in the middle of an edge, the upper one if they rise."""
    surfaces = kd.foot_surfaces(box_foot(tmp_path, y=-0.02 if side == "right" else 0.005))
    if side == "left":  # whose inside is on its right
        name = {"inside": "outside", "outside": "inside"}.get(name, name)
    assert surfaces.keys() == SURFACES.keys()
    assert surfaces[name].point == pytest.approx(point, abs=closed_form(1e4))
    rise, direction = np.radians(np.mean(rises)), np.radians(direction)
    level = np.array([np.cos(direction), np.sin(direction)]) * np.cos(rise)
    assert surfaces[name].normal == pytest.approx([*level, np.sin(rise)], abs=closed_form(10))
    assert np.degrees(surfaces[name].rise) == pytest.approx(rises)


def test_a_turned_box_is_met_at_the_corner_that_is_ahead(tmp_path):
    """Normals up to 15 degrees to either side of x lie between those of its front and its side."""
    turned = BOX.replace('rpy="0 0 0"', 'rpy="0 0 0.35"')
    point = kd.foot_surfaces(box_foot(tmp_path, shape=turned))["toe"].point
    ahead, left = np.array([np.cos(0.35), np.sin(0.35)]), np.array([-np.sin(0.35), np.cos(0.35)])
    corner = 0.12 * ahead - 0.05 * left + (0.05, 0.01)
    assert point == pytest.approx([*corner, 0.01], abs=closed_form(1e4))


@pytest.mark.parametrize(("name", "rise", "width"), [("inside", 7.5, 0.24), ("toe", 30.0, 0.1)])
def test_the_size_of_a_surface_is_what_a_plane_5_mm_deep_cuts_off(tmp_path, name, rise, width):
    """At the upper edge of a box the cut is a right triangle, its hypotenuse seen face on."""
    sine, cosine = np.sin(np.radians(rise)), np.cos(np.radians(rise))
    height = 0.005 / sine * cosine + 0.005 / cosine * sine
    size = kd.foot_surfaces(box_foot(tmp_path))[name].size
    assert size == pytest.approx([width, height], abs=closed_form(1e4))


def test_the_size_of_a_surface_of_a_round_foot_is_that_of_its_cap(tmp_path):
    """The hull of 400 points of a sphere is up to 2 % of the radius inside it."""
    ball = BOX.replace('box size="0.24 0.1 0.06"', 'sphere radius="0.08"')
    surface = kd.foot_surfaces(box_foot(tmp_path, shape=ball))["inside"]
    assert surface.size == pytest.approx(2 * np.sqrt(2 * 0.08 * 5e-3 - 5e-3**2), rel=0.15)
    reach = (surface.point - [0.05, 0.01, -0.02]) @ surface.normal
    assert reach == pytest.approx(0.08, rel=0.04)


def test_a_robot_by_name_has_the_points_of_its_frames():
    leg = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    point = kd.foot_surfaces(leg)["inside"].point
    assert point == pytest.approx(ROBOTS["g1"].contact_points["inside"], abs=closed_form(10))
    named, made = kd.Leg.from_robot("g1", "inside", legs_only=True), kd.kick_with(leg, "inside")
    assert made.frame == named.frame
    assert made.contact_normal_cone == pytest.approx(named.contact_normal_cone, abs=closed_form(10))
    q = named.configuration({"right_knee_joint": 0.4})
    assert made.posture(q).contact_point == pytest.approx(named.posture(q).contact_point)


def test_a_surface_can_be_given(tmp_path):
    """By `FootSurface` or in a line of text; its normals are 15 degrees to all sides."""
    leg = box_foot(tmp_path)
    surface = kd.FootSurface("side", (0, 0.06, 0), (0, 2, 0), (0.2, 0.05))

    def load(frame):
        return load_leg(leg.file.source, frame)

    made = kd.kick_with(leg, surface), load_with_surface("foot:0,0.06,0:0,1,0", load)
    for kicking in made:
        posture = kicking.posture(kicking.configuration())
        assert posture.contact_point == pytest.approx([0, -0.04, -0.8], abs=closed_form(10))
        tan = np.tan(np.radians([14, 16]))
        for axis, outside in ((0, (1, 0)), (2, (0, 1))):
            normals = np.array([[0.0, 1.0, 0.0]] * 2)
            normals[:, axis] = tan
            inside = (normals @ kicking.contact_normal_cone.T >= 0).all(axis=1)
            assert inside.tolist() == [True, False], outside
    assert [kicking.frame for kicking in made] == ["side", "surface"]
    assert load_with_surface("foot:inside", load).frame == "inside"


@pytest.mark.parametrize("name", ["foot:L2", "foot:toe", "a:b:c"])
@pytest.mark.parametrize("surface", ["", ":inside", ":0,0.06,0:0,1,0"])
def test_the_name_of_a_foot_may_have_colons(tmp_path, name, surface):
    source = Path(box_foot(tmp_path).file.source)
    plain = load_with_surface(f"foot{surface}", lambda frame: load_leg(str(source), frame))
    source.write_text(source.read_text().replace('"foot"', f'"{name}"'))
    leg = load_with_surface(f"{name}{surface}", lambda frame: load_leg(str(source), frame))
    right, seen = (one.posture(one.configuration()).contact_point for one in (plain, leg))
    agrees(seen, right, closed_form())
    assert leg.frame == (plain.frame if surface else name)


@pytest.mark.parametrize(("text", "said"), [
    ("foot:insid", "'insid' of foot .*heel, or X,Y,Z:NX,NY,NZ"),
    ("foot:1,2,3:4,5", "normal of surface"),
    ("foot:1,2,3:0,0,0", "normal of surface .*0.0, 0.0, 0.0"), ("fot:toe", "frame 'fot' .*'foot'"),
    ("shank:toe", "shank .*FootSurface")])  # fmt: skip
def test_bad_surfaces_are_refused(tmp_path, text, said):
    source = box_foot(tmp_path).file.source
    with pytest.raises(kd.InvalidInput, match=f"^[^\n]*{said}[^\n]*$"):
        load_with_surface(text, lambda frame: load_leg(source, frame))


@pytest.mark.parametrize(("facing", "yaw"), [("y", 90), ("-x", 180), ("-y", -90)])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_robot_that_faces_another_axis_is_turned(tmp_path, facing, yaw, base):
    """It then moves as one that faces x in its file; where it is not turned, a line says so."""
    text, turned = shipped_urdf("biped.urdf").read_text(), tmp_path / "turned.urdf"
    root = f'<origin rpy="0 0 {np.radians(yaw)}"/><parent link="file"/><child link="trunk"/>'
    mount = f'<link name="file"/><joint name="mount" type="fixed">{root}</joint></robot>'
    turned.write_text(text.replace("</robot>", mount))
    right = kd.Leg.from_urdf(shipped_urdf("biped.urdf"), "right_foot", base=base)
    leg = kd.Leg.from_urdf(turned, "right_foot", base=base, facing=facing)
    assert leg.warnings[:-1] == right.warnings  # the last one is about drives
    q = right.configuration(dict.fromkeys(right.single_joints, 0.3))
    agrees(leg.posture(q).delassus(), right.posture(q).delassus(), closed_form(100))
    agrees(leg.posture(q).contact_point, right.posture(q).contact_point, closed_form(10))
    seen = kd.foot_surfaces(leg)["toe"]
    assert seen.point == pytest.approx(kd.foot_surfaces(right)["toe"].point, abs=closed_form(100))
    ignored = kd.kick_with(kd.Leg.from_urdf(turned, "right_foot", base=base), "toe")
    said = sum("(--facing)" in line for line in ignored.warnings)
    assert said == (0 if facing == "-x" else 2)  # feet apart along x, and longer across


@pytest.mark.parametrize("facing", [["x"], {}, np.array(["x", "y"]), None, "z"])
def test_an_axis_that_no_robot_faces_is_refused(facing):
    with pytest.raises(kd.InvalidInput, match="facing is"):
        kd.Leg.from_urdf(shipped_urdf("leg_human.urdf"), facing=facing)
