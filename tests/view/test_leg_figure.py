"""The figure of a leg: shapes where other readers of the file put them, and sticks without any."""

import io
import re
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import yourdfpy
from drawn_scene import SINGLE, DrawnScene, check_joints
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot.robot_file import RobotFile, Shape, Visual
from kickdyn.view.document import recording_viewer
from kickdyn.view.leg_figure import draw_leg, joint_poses, leg_shapes

SPHERE = "<visual><geometry><sphere radius='1'/></geometry>{}</visual>"
Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""A cylinder's axis is z in a URDF and y in meshcat."""


def drawn(leg, q):
    viewer = recording_viewer()
    corners = draw_leg(viewer["leg"], leg, q)
    return DrawnScene(viewer), corners


@pytest.mark.parametrize("name", ["human", "testbed"])
def test_parts_are_where_yourdfpy_puts_them(name):
    leg = getattr(kd.Leg, name)()
    q = np.random.default_rng(1).uniform(leg.lower, leg.upper)
    robot = yourdfpy.URDF.load(io.StringIO(leg.file.text), load_meshes=False)
    robot.update_cfg(dict(zip(leg.joint_names, q, strict=True)))
    (scene, _), right = drawn(leg, q), []
    for link in robot.robot.links:
        for visual in link.visuals:
            origin = np.eye(4) if visual.origin is None else visual.origin
            turn = Y_TO_Z if visual.geometry.cylinder else np.eye(4)
            right.append(robot.get_transform(link.name, "base") @ origin @ turn)
    for number, (part, pose) in enumerate(zip(leg_shapes(leg)[0], right, strict=True)):
        agrees(scene.pose(f"leg/{part.joint}/{number}"), pose, closed_form(100))


def test_a_leg_without_urdf_is_sticks_from_joint_to_joint(leg_looking_like):
    leg = kd.Leg.from_model(kd.Leg.human().model, "toe")
    q = leg.configuration({"knee": 1.0})
    data, poses = leg.model.createData(), joint_poses(leg, q)
    pin.forwardKinematics(leg.model, data, q)
    points = [*(data.oMi[joint].translation for joint in (1, 2, 3)), leg.posture(q).contact_point]
    parts = leg_shapes(leg)[0]
    places = [poses[part.joint] @ part.pose for part in parts]
    middles = [(a + b) / 2 for a, b in pairwise(points)]
    right = [*points[:3], *middles, points[3]]
    agrees([place[:3, 3] for place in places], right, closed_form())
    for k, (start, end) in enumerate(pairwise(points), start=3):
        assert parts[k].geometry.height == pytest.approx(np.linalg.norm(end - start))
        agrees(places[k][:3, 1] * parts[k].geometry.height, end - start, closed_form())
    # bodies without visuals are sticks beside drawn ones: a knee, a shank to the toe
    parts, warning = leg_shapes(leg_looking_like(SPHERE.format("")))
    assert (warning, [part.joint for part in parts]) == ("", [1, 2, 2, 2])


def test_the_person_is_as_tall_as_its_height_says():
    """The ankle is 3.9 % of the height above the ground (Drillis & Contini 1966)."""
    leg = kd.Leg.human(height=1.75, mass=75)
    scene, _ = drawn(leg, leg.configuration())
    (head,) = [node for node in scene.objects if "person" in node
               and scene.shape(node)["type"] == "SphereGeometry"]  # fmt: skip
    straight = leg.posture(leg.configuration()).contact_point  # as high as the ankle
    top = scene.point(head)[2] + scene.shape(head)["radius"] - straight[2] + 0.039 * 1.75
    assert top == pytest.approx(1.75, rel=0.02)
    middles = np.array([scene.point(node) for node in scene.objects if "person" in node])
    agrees(np.unique(middles[:, 1].round(9)), np.unique(-middles[:, 1].round(9)), closed_form())
    moving = kd.Leg.human(height=1.75, mass=75, base="floating")
    assert not any("person" in node for node in drawn(moving, moving.configuration())[0].objects)


def test_every_joint_is_at_its_pose_and_all_parts_are_within_the_corners():
    leg = kd.Leg.from_robot("bolt", base="floating")
    q = pin.integrate(leg.model, leg.configuration(), np.linspace(-0.3, 0.4, leg.nv))
    scene, corners = drawn(leg, q)
    check_joints(scene, "leg", leg, q)
    meshes = [scene.vertices(node) for node in scene.objects if "data" in scene.shape(node)]
    assert (np.vstack(meshes) > corners.min(axis=0) - 10 * SINGLE).all()
    assert (np.vstack(meshes) < corners.max(axis=0) + 10 * SINGLE).all()


@pytest.mark.parametrize(("tag", "half"), [
    ('<mesh filename="box.stl"/>', (0.05, 0.1, 0.15)),
    ('<mesh filename="box.stl" scale="2 2 2"/>', (0.1, 0.2, 0.3)),
    ('<box size="0.1 0.2 0.3"/>', (0.05, 0.1, 0.15)), ('<sphere radius="0.1"/>', (0.1, 0.1, 0.1)),
    ('<cylinder length="0.3" radius="0.1"/>', (0.1, 0.1, 0.15))])  # fmt: skip
def test_shapes_have_their_size_and_place(leg_looking_like, tmp_path, tag, half):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "box.stl")
    visual = f'<visual><origin xyz="0 0 0.7"/><geometry><!-- -->{tag}</geometry></visual>'
    _, corners = drawn(leg_looking_like(visual), np.zeros(2))
    top = corners[corners[:, 2] > 1.3]
    agrees(top.max(axis=0), np.add((0, 0, 1.7), half), SINGLE)
    agrees(top.min(axis=0), np.subtract((0, 0, 1.7), half), SINGLE)


@pytest.mark.parametrize(("shape", "fault"), [
    ('<mesh filename="../box.stl"/>', r"'\.\./box.stl' is refused"),
    ('<mesh filename="box.stl"/>', "'box.stl' is"), ('<sphere radius="0"/>', "0.0"),
    ('<box size="1 -1 1"/>', "-1.0"), ('<cylinder length="1" radius="1e308"/>', r"1e\+308")
])  # fmt: skip
def test_a_shape_that_cannot_be_drawn_is_named_and_others_stay(leg_looking_like, shape, fault):
    bad = f"<visual><geometry>{shape}</geometry></visual>"
    parts, warning = leg_shapes(leg_looking_like(bad + SPHERE.format("") + bad))
    assert re.search(f"2 of 3 visuals.* {fault}", warning)
    assert [part.geometry.radius for part in parts if part.joint == 1] == [1.0]
    assert len(leg_shapes(leg_looking_like(bad))[0]) == 2 + 2 + 1  # sticks


def test_shapes_of_other_formats_are_drawn_in_the_frame_that_they_name():
    human = kd.Leg.human()

    class Shown(RobotFile):
        def visuals(self):
            pose = np.eye(4)
            pose[:3] = (0, -1, 0, 0.1), (1, 0, 0, 0.2), (0, 0, 1, 0.3)  # turned about z
            return [
                Visual("toe", pose, Shape.ELLIPSOID, (1.0, 2.0, 3.0), rgba=(1, 0.2, 0.4, 0.8)),
                Visual("toe", pose, Shape.CAPSULE, (2.0, 0.5)),
            ]

    leg = kd.Leg(human.model, "toe", Shown(human.file.text, human.file.folder, "shown"))
    ellipsoid, _, *ends = [part for part in leg_shapes(leg)[0] if part.joint == 3]
    body = human.model.frames[human.model.getFrameId("toe")].placement.translation
    agrees(ellipsoid.pose[:3, 3], body + np.array((0.1, 0.2, 0.3)), closed_form())
    heights = [(part.pose[2, 3] - body[2], part.geometry.radius) for part in ends]
    agrees(heights, [(-0.7, 0.5), (1.3, 0.5)], closed_form())
    scene, corners = drawn(leg, human.configuration())
    looks = [scene.objects[node]["materials"][0] for node in scene.objects]
    assert (0xFF3366, 0.8) in [(look["color"], look["opacity"]) for look in looks]
    assert np.ptp(corners, axis=0)[1:] == pytest.approx((2.0, 6.0))
