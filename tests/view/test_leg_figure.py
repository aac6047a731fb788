"""The figure of a leg: shapes where other readers of the file put them, and sticks without any."""

import io
import re
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import planned_motions
import pytest
import trimesh
import yourdfpy
from drawn_scene import SINGLE, DrawnScene, check_joints
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot.robot_file import RobotFile, Shape, Visual
from kickdyn.view.document import recording_viewer
from kickdyn.view.leg_figure import draw_leg, draw_run, joint_poses, leg_shapes

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


@pytest.mark.parametrize("hits", [True, False])
def test_a_simulated_run_is_beside_the_plan_at_the_same_times(hits):
    plan = planned_motions.swinging()
    motion, start, leg = plan.motion, plan.impact.ball_before.position, plan.impact.posture.leg
    t, ahead = np.linspace(motion.begin, motion.end, 300), np.array([5.0, 0.0, 0.0])
    after = kd.BallState(start + 0.1 * np.eye(3)[0], (9.0, 1.0, 8.0), time=0.02)
    run = SimpleNamespace(
        plan=plan, t=t, q=np.array([motion.q(time) + 0.05 for time in t]), summary="",
        ball_position=start + np.outer(np.maximum(t, 0.0), ahead), ball_after=after,
        path=kd.fly(after, kd.Ball(), kd.Air()) if hits else None,
    )  # fmt: skip
    page = kd.page(run)
    scene, pace = DrawnScene(page), page.pace
    offset, forward = scene.point("run"), plan.path.landing.position - start
    assert np.cross((offset[0], offset[1], 0.0), forward)[2] > 0  # to the right of the kick
    for frame in (0, pace.impact, pace.impact + 1, pace.impact + 30, len(pace.times) - 1):
        time = pace.times[frame]
        sample = min(np.searchsorted(t, time), len(t) - 1)
        check_joints(scene, "run/leg", leg, run.q[sample], frame, offset)
        check_joints(scene, "leg", leg, motion.q(time), frame)
        right = start + np.interp(time, t, np.maximum(t, 0.0)) * ahead
        if hits and time >= after.time:
            right = run.path.sample(min(time - after.time, run.path.duration)).position
        agrees(scene.point("run/ball", frame) - offset, right, 10 * SINGLE)
    figure = np.vstack([scene.vertices(node) for node in scene.objects
                        if node.startswith("leg/") and "data" in scene.shape(node)])  # fmt: skip
    for node, place in (("planned/name", 0.0), ("run/name", offset)):
        _, y, z = scene.point(node) - place  # above the middle of the robot
        assert (z > figure[:, 2].max(), abs(y - figure[:, 1].mean()) < 0.02) == (True, True)
    wide = np.array([(0.0, -1.0, 0.0), (0.0, 2.0, 1.0)])
    apart = draw_run(recording_viewer(), run, np.array([1.0, 0.0, 0.0]), wide).offset
    assert apart[1] < -3.0  # by more than the robot's width
    assert ("run/curve" in scene.objects) is hits
    if hits:
        agrees(scene.curve("run/curve")[-1] - offset, run.path.landing.position, 10 * SINGLE)
        assert pace.times[-1] == pytest.approx(after.time + run.path.duration)


def test_a_motion_alone():
    motion = planned_motions.swinging().motion
    page = kd.page(motion)
    times = page.pace.times
    assert times[[0, -1]] == pytest.approx([motion.begin, motion.end])
    assert abs(times[page.pace.impact]) <= np.diff(times).max()
    for frame in (0, page.pace.impact, 200, len(times) - 1):
        check_joints(DrawnScene(page), "leg", motion.robot, motion.q(times[frame]), frame)
    assert all(f"{phase.begin:.4g} to {phase.end:.4g} s" in page.panel for phase in motion.phases)


def test_a_posture_alone():
    posture = kd.Leg.human().posture(np.radians([40.0, 30.0, -20.0]))
    page = kd.page(posture, caption="at the impact")
    check_joints(DrawnScene(page), "leg", posture.leg, posture.q)
    x, y, z = posture.contact_point
    for shown in ("hip</th><td>40°", "knee</th><td>30°", "ankle</th><td>-20°",
                  f"{x:.3f}, {y:.3f}, {z:.3f} m", "at the impact"):  # fmt: skip
        assert shown in page.panel
    assert DrawnScene(page).point("ground")[2] < min(z, 0.0)
