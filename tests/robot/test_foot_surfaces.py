"""Surfaces of a foot that can meet a ball."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.cli.leg_options import load_leg
from kickdyn.robot.catalog import ROBOTS, SURFACES
from kickdyn.robot.collisions import find_ball_overlaps
from kickdyn.robot.foot_surfaces import load_with_surface
from kickdyn.robot.standing import joint_bodies

LINK = """<link name="{}"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01"
ixy="0" ixz="0" iyz="0"/></inertial>{}</link>"""
BOX = """<collision><origin xyz="0.05 0.01 -0.02" rpy="0 0 0"/><geometry><box size="0.24 0.1 0.06"/>
</geometry></collision>"""
JOINT = """<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="{}"/>
<origin xyz="0 {} {}"/><limit lower="-2" upper="2" effort="300" velocity="30"/></joint>"""


def box_foot(folder, y=-0.1):
    """A leg with a foot of 0.24 m x 0.1 m x 0.06 m, its middle (0.05, 0.01, -0.02) m off."""
    links = [("pelvis", ""), ("hips", ""), ("thigh", ""), ("shank", ""), ("foot", BOX)]
    joints = [("yaw", "pelvis", "hips", "0 0 1", y, 0), ("hip", "hips", "thigh", "0 1 0", 0, 0)]
    joints += [("knee", "thigh", "shank", "0 1 0", 0, -0.4)]
    joints += [("ankle", "shank", "foot", "0 1 0", 0, -0.4)]
    text = "".join(LINK.format(*link) for link in links)
    text += "".join(JOINT.format(*joint) for joint in joints)
    path = folder / "box.urdf"
    path.write_text(f'<robot name="box">{text}</robot>')
    return kd.Leg.from_urdf(path, "foot", drives=False)


def test_the_surfaces_of_a_box_are_its_upper_edges(tmp_path):
    """Corners of a box meet the normals to the side, its upper edge those that rise."""
    surfaces = kd.foot_surfaces(box_foot(tmp_path))
    assert [*surfaces] == [*SURFACES]
    ahead, left, right, behind = (
        (0.17, 0.01, 0.01),
        (0.05, 0.06),
        (0.05, -0.04),
        (-0.07, 0.01, 0.01),
    )
    assert surfaces["toe"].point == pytest.approx(ahead, abs=1e-9)
    assert surfaces["sole_edge"].point == pytest.approx([0.17, 0.01, -0.05], abs=1e-9)
    assert surfaces["inside"].point == pytest.approx([*left, 0.01], abs=1e-9)
    assert surfaces["outside"].point == pytest.approx([*right, 0.01], abs=1e-9)
    assert surfaces["heel"].point == pytest.approx(behind, abs=1e-9)
    assert surfaces["inside"].normal == pytest.approx(
        [0.0, np.cos(np.radians(7.5)), np.sin(np.radians(7.5))], abs=1e-12
    )
    # of the face's height, the tangent plane is 5 mm deep at 0.005 / sin 7.5
    rise = np.radians(7.5)
    face = 0.005 / np.sin(rise) * np.cos(rise)
    assert surfaces["inside"].size == pytest.approx(
        [0.24, face + 0.005 / np.cos(rise) * np.sin(rise)], abs=1e-9
    )
    # the toe's edge: the plane rises by 30 degrees, and cuts a triangle off the box
    cut = 0.005 / np.sin(np.radians(30)) * np.cos(np.radians(30))
    cut += 0.005 / np.cos(np.radians(30)) * np.sin(np.radians(30))
    assert surfaces["toe"].size == pytest.approx([0.1, cut], abs=1e-9)


def test_the_left_foot_has_its_inside_on_the_right(tmp_path):
    surfaces = kd.foot_surfaces(box_foot(tmp_path, y=0.1))
    assert surfaces["inside"].point[1] == pytest.approx(-0.04)
    assert surfaces["inside"].normal[1] < 0 < surfaces["outside"].normal[1]


@pytest.mark.parametrize("name", ["g1", "human"])
def test_a_ball_is_outside_the_foot_for_all_normals_of_a_surface(name, monkeypatch):
    """And points are near those of the catalogue, which are read off the visual meshes."""
    known = ROBOTS[name]
    monkeypatch.setattr("kickdyn.robot.foot_surfaces.frames_by_name", lambda model: {})
    leg, ball = kd.Leg.from_robot(name, known.foot, legs_only=True), kd.Ball()
    for surface in kd.foot_surfaces(leg).values():
        off = surface.point - known.contact_points[surface.name]
        assert np.abs(off).max() < (0.075 if surface.name == "instep" else 0.055)
        kicking = kd.kick_with(leg, surface)
        posture = kicking.posture(kicking.configuration())
        normals = np.random.default_rng(1).normal(size=(4000, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        normals = normals[(normals @ kicking.contact_normal_cone.T >= 0).all(axis=1)][:10]
        assert len(normals) > 5
        for normal in [*normals, surface.normal]:
            centre = posture.contact_point + ball.radius * normal
            depths = find_ball_overlaps(posture, centre, ball.radius)
            foot = joint_bodies(kicking, kicking.contact_joint)
            assert max((depths.get(body, 0.0) for body in foot), default=0.0) < 8e-3


def test_a_robot_by_name_has_the_points_of_its_frames():
    leg = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    surfaces = kd.foot_surfaces(leg)
    assert surfaces["inside"].point == pytest.approx(
        ROBOTS["g1"].contact_points["inside"], abs=1e-12
    )
    named, made = kd.Leg.from_robot("g1", "inside", legs_only=True), kd.kick_with(leg, "inside")
    assert made.frame == named.frame
    assert made.contact_normal_cone == pytest.approx(named.contact_normal_cone, abs=1e-12)
    q = named.configuration({"right_knee_joint": 0.4})
    assert made.posture(q).contact_point == pytest.approx(named.posture(q).contact_point)


def test_a_plan_turns_the_surface_to_the_ball(tmp_path):
    leg = kd.kick_with(box_foot(tmp_path), "heel")
    plan = kd.plan_kick(leg, kd.Goal((-2, 0, 0), time=0.5), kd.Ball(), kd.Air())
    assert plan.status == "met"
    turned = plan.leg.workspace.data.oMf[plan.leg.frame_id].rotation
    plan.leg.posture(plan.q)
    assert (leg.contact_normal_cone @ turned.T @ plan.impact.contact.normal > -1e-3).all()
    assert plan.impact.contact.normal[0] < -0.5


def test_a_surface_is_given_in_a_line(tmp_path):
    leg = box_foot(tmp_path)
    given = kd.kick_with(leg, kd.FootSurface("side", (0, 0.06, 0), (0, 2, 0), (0.2, 0.05)))
    text = load_with_surface("foot:0,0.06,0:0,1,0", lambda frame: load_leg(leg.file.source, frame))
    for made in (given, text):
        posture = made.posture(made.configuration())
        assert posture.contact_point == pytest.approx([0, -0.04, -0.8], abs=1e-12)
        inside = made.contact_normal_cone @ np.array([[0, 1, 0], [1, 1, 0], [0, 1, 0.3]]).T
        assert (inside >= 0).all(axis=0).tolist() == [True, False, False]
    assert (given.frame, text.frame) == ("side", "surface")
    named = load_with_surface("foot:inside", lambda frame: load_leg(leg.file.source, frame))
    assert named.frame == "inside"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("foot:insid", "surface 'insid' of foot must be toe, instep, .*heel, or X,Y,Z:NX,NY,NZ"),
        ("foot:1,2,3:4,5", "normal of surface surface has shape"),
        ("foot:1,2,3", "surface '1,2,3' of foot must be toe"),
        ("foot:1,2,3:0,0,0", "normal of surface surface is .0.0, 0.0, 0.0"),
        ("fot:toe", "frame 'fot' is unknown: did you mean 'foot'"),
        ("shank:toe", "the foot at shank of box has no shapes that span a volume: give the surf"),
    ],
)
def test_bad_surfaces_are_refused_in_a_line(tmp_path, text, said):
    source = box_foot(tmp_path).file.source
    with pytest.raises(kd.InvalidInput, match=said) as refused:
        load_with_surface(text, lambda frame: load_leg(source, frame))
    assert "\n" not in str(refused.value)
    with pytest.raises(kd.InvalidInput, match="surface 'insid' is unknown: choose toe, instep"):
        kd.kick_with(kd.Leg.human(), "insid")
