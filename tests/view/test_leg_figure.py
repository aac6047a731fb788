import io
import re

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import umsgpack
import yourdfpy

import kickdyn as kd
from kickdyn.robot.visuals import RobotFile, Shape, Visual
from kickdyn.view import leg_figure
from kickdyn.view.document import recording_viewer
from kickdyn.view.leg_figure import (
    BODY_COLOUR,
    JOINT_COLOUR,
    PERSON,
    draw_leg,
    joint_poses,
    leg_shapes,
)
from kickdyn.view.marks import UPRIGHT


def positions(leg, q):
    """Where the middle of each part is."""
    places = joint_poses(leg, q)
    return np.array([(places[part.joint] @ part.pose)[:3, 3] for part in leg_shapes(leg)[0]])


@pytest.mark.parametrize("name", ["human", "testbed"])
@pytest.mark.parametrize("seed", range(3))
def test_parts_are_where_yourdfpy_puts_them(name, seed):
    leg = getattr(kd.Leg, name)()
    q = np.random.default_rng(seed).uniform(leg.lower, leg.upper)
    robot = yourdfpy.URDF.load(io.StringIO(leg.file.text), load_meshes=False)
    robot.update_cfg(dict(zip(leg.joint_names, q, strict=True)))
    places = joint_poses(leg, q)
    expected = []
    for link in robot.robot.links:
        for visual in link.visuals:
            origin = np.eye(4) if visual.origin is None else visual.origin
            turn = UPRIGHT if visual.geometry.cylinder else np.eye(4)
            expected.append(robot.get_transform(link.name, "base") @ origin @ turn)
    found = [places[part.joint] @ part.pose for part in leg_shapes(leg)[0]]
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_links_beyond_fixed_joints_are_drawn(load, spoil):
    pad = '<link name="toe"><visual><geometry><sphere radius="1"/></geometry></visual></link>'
    leg = load(spoil(('<link name="toe"/>', pad)))
    np.testing.assert_allclose(positions(leg, np.zeros(2)), [(0, 0, 1), (0, 0, 0.2)], atol=1e-15)


def test_a_leg_without_urdf_is_sticks():
    leg = kd.Leg.from_model(kd.Leg.human().model, "toe")
    q = leg.configuration({"knee": 1.0})
    posture = leg.posture(q)
    places = joint_poses(leg, q)
    hip, knee, ankle = (place[:3, 3] for place in places[1:])
    toe = posture.contact_point
    expected = [hip, knee, ankle, (hip + knee) / 2, (knee + ankle) / 2, (ankle + toe) / 2, toe]
    np.testing.assert_allclose(positions(leg, q), expected, atol=1e-15)
    for part, way in zip(
        leg_shapes(leg)[0][3:6], (knee - hip, ankle - knee, toe - ankle), strict=True
    ):
        along = (places[part.joint] @ part.pose)[:3, 1]
        np.testing.assert_allclose(along, way / np.linalg.norm(way), atol=1e-15)
        assert part.geometry.height == pytest.approx(np.linalg.norm(way))
    shank = np.linalg.norm(ankle - knee)  # the longest of the three
    knobs = [part.geometry.radius for part in leg_shapes(leg)[0][:3]]
    assert knobs == pytest.approx(3 * [0.1 * shank])


def test_a_leg_without_visuals_is_sticks(leg_looking_like):
    leg = leg_looking_like("")
    assert len(leg_shapes(leg)[0]) == 2 + 2 + 1


def test_joints_in_one_place_need_no_stick(load, spoil):
    leg = load(spoil(('xyz="0 0 -0.4"', 'xyz="0 0 0"')))
    assert leg_shapes(leg)[0]
    bare = kd.Leg.from_model(leg.model, "toe")
    assert np.isfinite(positions(bare, np.zeros(2))).all()


def test_a_floating_base_is_drawn():
    model = pin.buildModelFromXML(kd.Leg.human().file.text, pin.JointModelFreeFlyer())
    model.inertias[1] = pin.Inertia(10.0, np.zeros(3), 0.2 * np.eye(3))
    leg = kd.Leg.from_model(model, "toe")
    assert np.isfinite(positions(leg, leg.configuration())).all()


def test_drawing():
    leg, viewer = kd.Leg.human(), recording_viewer()
    q = leg.configuration({"hip": 0.3})
    draw_leg(viewer["leg"], leg, q)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    said = [command for command in said if "/person/" not in command["path"]]
    objects = [command for command in said if command["type"] == "set_object"]
    assert len(objects) == len(leg_shapes(leg)[0]) == 9
    assert {command["object"]["materials"][0]["color"] for command in objects} == {
        0xD9A37D,  # skin
        0x40454F,  # pins of the joints
        0x293D73,  # shorts
        0x292B33,  # boot
        0xEDEDE6,  # its sole
    }
    moved = {c["path"]: np.reshape(c["matrix"], (4, 4)).T
             for c in said if c["type"] == "set_transform"}  # fmt: skip
    for joint, place in enumerate(joint_poses(leg, q)):
        np.testing.assert_allclose(moved[f"/meshcat/leg/{joint}"], place)


def test_corners_hold_every_part(leg_looking_like, tmp_path):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "box.stl")
    for shape, half in (
        ('<mesh filename="box.stl"/>', (0.05, 0.1, 0.15)),
        ('<box size="0.1 0.2 0.3"/>', (0.05, 0.1, 0.15)),
        ('<cylinder length="0.3" radius="0.1"/>', (0.1, 0.1, 0.15)),
        ('<sphere radius="0.1"/>', (0.1, 0.1, 0.1)),
    ):
        visual = f'<visual><origin xyz="0 0 0.7"/><geometry>{shape}</geometry></visual>'
        corners = draw_leg(recording_viewer()["leg"], leg_looking_like(visual), np.zeros(2))
        top = corners[corners[:, 2] > 1.4]
        np.testing.assert_allclose(top.max(axis=0), np.add((0, 0, 1.7), half), atol=1e-7)
        np.testing.assert_allclose(top.min(axis=0), np.subtract((0, 0, 1.7), half), atol=1e-7)


def test_names_are_no_paths(load, spoil):
    evil = '../<b>"x'.replace("<", "&lt;").replace('"', "&quot;")
    leg = load(spoil(('name="thigh"', f'name="{evil}"'), ('link="thigh"', f'link="{evil}"'),
                     ('link="thigh"', f'link="{evil}"')))  # fmt: skip
    viewer = recording_viewer()
    draw_leg(viewer["leg"], leg, np.zeros(2))
    paths = {umsgpack.unpackb(packed)["path"] for packed in viewer.window.commands}
    assert "/meshcat/leg/1/0" in paths
    assert all(re.fullmatch(r"/meshcat/leg(/\d){1,2}", path) for path in paths)


@pytest.mark.parametrize("name", ["bolt", "icub"])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_robots_are_drawn_with_their_meshes(name, base):
    """Each shank reaches from the knee towards the ankle."""
    leg = kd.Leg.from_robot(name, base=base, legs_only=name == "icub")
    knee, ankle = {"bolt": ("FR_KFE", None), "icub": ("r_knee", "r_ankle_pitch")}[name]
    model = leg.model
    joint = model.getJointId(knee)
    parts = [part for part in leg_shapes(leg)[0] if part.joint == joint]
    corners = np.vstack(
        [
            np.asarray(part.geometry.vertices) @ part.pose[:3, :3].T + part.pose[:3, 3]
            for part in parts
        ]
    )
    middle = (corners.max(axis=0) + corners.min(axis=0)) / 2
    end = model.jointPlacements[model.getJointId(ankle)].translation if ankle else leg.contact_lever
    assert middle @ end / (end @ end) == pytest.approx(0.4, abs=0.2)
    assert any(part.rgba[:3] != (0.0, 0.0, 0.0) for part in parts)


def lowered(visual):
    data = {}
    visual.geometry.lower_in_object(data)
    return data["geometries"][0]


def thigh(leg):
    return [part for part in leg_shapes(leg)[0] if part.joint == 1]


@pytest.mark.parametrize(
    ("tag", "shape"),
    [
        ('<box size="1 2 3"/>', {"type": "BoxGeometry", "width": 1, "height": 2, "depth": 3}),
        ('<sphere radius="0.5"/>', {"type": "SphereGeometry", "radius": 0.5}),
        (
            '<cylinder radius="0.5" length="2"/>',
            {"type": "CylinderGeometry", "radiusTop": 0.5, "radiusBottom": 0.5, "height": 2},
        ),
    ],
)
def test_shapes(leg_looking_like, tag, shape):
    leg = leg_looking_like(
        f'<visual><origin xyz="1 2 3"/><geometry><!-- -->{tag}</geometry></visual>'
    )
    (visual,) = thigh(leg)
    assert lowered(visual).items() >= shape.items()
    np.testing.assert_allclose(visual.pose[:3, 3], (1, 2, 3))


def test_a_cylinder_stands_along_z(leg_looking_like):
    (visual,) = thigh(
        leg_looking_like('<visual><geometry><cylinder radius="1" length="2"/></geometry></visual>')
    )
    np.testing.assert_allclose(visual.pose[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-15)


def test_several_visuals_keep_their_order(leg_looking_like):
    one = '<visual><geometry><sphere radius="{}"/></geometry></visual>'
    found = thigh(leg_looking_like(one.format(1) + one.format(2)))
    assert [lowered(visual)["radius"] for visual in found] == [1, 2]


SPHERE = "<visual><geometry><sphere radius='1'/></geometry>{}</visual>"


@pytest.mark.parametrize(
    ("material", "rgba"),
    [
        ("", BODY_COLOUR),
        ('<material name="a"><color rgba="0.1 0.2 0.3 0.4"/></material>', (0.1, 0.2, 0.3, 0.4)),
        ('<material name="nowhere"><texture filename="/etc/passwd"/></material>', BODY_COLOUR),
    ],
)
def test_colours(leg_looking_like, material, rgba):
    (visual,) = thigh(leg_looking_like(SPHERE.format(material)))
    assert visual.rgba == pytest.approx(rgba)


def test_a_colour_is_found_by_its_name():
    visuals = leg_shapes(kd.Leg.human())[0]
    assert {visual.rgba for visual in visuals} >= {(0.85, 0.64, 0.49, 1), (0.25, 0.27, 0.31, 1)}


def test_a_colour_named_in_another_visual(leg_looking_like):
    first = SPHERE.format('<material name="a"><color rgba="1 0 0 1"/></material>')
    found = thigh(leg_looking_like(first + SPHERE.format('<material name="a"/>')))
    assert [visual.rgba for visual in found] == [(1, 0, 0, 1)] * 2


def test_the_file_is_not_read_again(leg_looking_like, tmp_path):
    leg = leg_looking_like(SPHERE.format(""))
    (tmp_path / "leg.urdf").write_text("changed meanwhile")
    assert len(thigh(leg)) == 1


def test_a_mesh_of_the_folder(leg_looking_like, tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    mesh = '<visual><geometry><mesh filename="box.stl" scale="2 2 2"/></geometry></visual>'
    (visual,) = thigh(leg_looking_like(mesh))
    np.testing.assert_allclose(np.ptp(visual.geometry.vertices, axis=0), 2)
    assert visual.rgba == BODY_COLOUR


@pytest.mark.parametrize("name", ["../box.stl", "/box.stl", "box.stl", "file:///box.stl"])
def test_a_refused_mesh_is_named(leg_looking_like, name):
    leg = leg_looking_like(f'<visual><geometry><mesh filename="{name}"/></geometry></visual>')
    parts, warning = leg_shapes(leg)
    assert warning.startswith(f"1 of 1 visuals of leg is not drawn: mesh '{name}' is ")
    assert len(parts) == 2 + 2 + 1  # sticks


def test_what_yourdfpy_cannot_read_is_one_line(leg_looking_like, monkeypatch):
    def fail(*_, **__):
        raise KeyError("radius")

    leg = leg_looking_like(SPHERE.format(""))
    monkeypatch.setattr("yourdfpy.URDF.load", fail)
    parts, warning = leg_shapes(leg)
    assert warning.endswith(
        "leg.urdf: its visuals cannot be read ('radius'): sticks are drawn instead"
    )
    assert len(parts) == 2 + 2 + 1


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ('<sphere radius="0"/>', "0.0"),
        ('<sphere radius="-1"/>', "-1.0"),
        ('<box size="1 0 1"/>', "0.0"),
        ('<cylinder length="0" radius="1"/>', "0.0"),
        ('<cylinder length="1" radius="1e308"/>', r"1e\+308"),
    ],
)
def test_a_shape_without_size_is_refused(shape, size, leg_looking_like):
    leg = leg_looking_like(f"<visual><geometry>{shape}</geometry></visual>")
    assert re.search(rf"size of a visual is {size}: .* above 0", leg_shapes(leg)[1])


def test_every_shape_is_drawn_in_the_frame_that_it_names():
    """A robot's file need not be a URDF."""
    human = kd.Leg.human()

    class Shown(RobotFile):
        def visuals(self):
            pose = np.eye(4)
            pose[:3, 3] = 0.1, 0.2, 0.3
            return [
                Visual("shank", pose, Shape.ELLIPSOID, (1.0, 2.0, 3.0), rgba=(1, 0, 0, 1)),
                Visual("shank", pose, Shape.CAPSULE, (2.0, 0.5)),
            ]

    file = Shown(human.file.text, human.file.folder, "shown")
    leg = kd.Leg(human.model, "toe", file)
    ellipsoid, *capsule = [part for part in leg_shapes(leg)[0] if part.joint == 2]
    assert [ellipsoid.rgba] + [part.rgba for part in capsule] == [(1, 0, 0, 1)] + [BODY_COLOUR] * 3
    body = human.model.frames[human.model.getFrameId("shank")].placement.translation
    np.testing.assert_allclose(ellipsoid.pose[:3, 3], body + np.array((0.1, 0.2, 0.3)))
    heights = [(part.pose[2, 3] - body[2], part.geometry.radius) for part in capsule[1:]]
    np.testing.assert_allclose(heights, [(-0.7, 0.5), (1.3, 0.5)])
    viewer = recording_viewer()
    corners = draw_leg(viewer["leg"], kd.Leg(human.model, "toe", file), human.configuration())
    assert np.ptp(corners, axis=0)[1:] == pytest.approx((4.0, 6.0))


def test_bodies_without_visuals_are_sticks_beside_drawn_ones(leg_looking_like):
    """The shank of this leg has none: a sphere at the knee, and a stick to the toe."""
    leg = leg_looking_like(SPHERE.format(""))
    parts, warning = leg_shapes(leg)
    assert warning == ""
    assert [part.joint for part in parts] == [1, 2, 2, 2]
    knob, stick, tip = parts[1:]
    assert knob.rgba == JOINT_COLOUR
    assert stick.geometry.height == pytest.approx(np.linalg.norm(leg.contact_lever))
    np.testing.assert_allclose(tip.pose[:3, 3], leg.contact_lever)


def test_a_body_without_extent_has_no_stick(load, spoil):
    """As the links between the axes of a hip, whose joints are in one place."""
    leg = load(spoil(('xyz="0 0 -0.4"', 'xyz="0 0 0"'), (
        '<visual><geometry><sphere radius="0.05"/></geometry></visual>', ""
    )))  # fmt: skip
    assert {part.joint for part in leg_shapes(leg)[0]} == {2}


def test_every_missing_mesh_is_counted_and_the_first_is_named(leg_looking_like):
    mesh = '<visual><geometry><mesh filename="{}.stl"/></geometry></visual>'
    leg = leg_looking_like(mesh.format("first") + SPHERE.format("") + mesh.format("second"))
    parts, warning = leg_shapes(leg)
    assert warning.startswith("2 of 3 visuals of leg are not drawn, the first: mesh 'first.stl' is")
    assert [part.geometry.radius for part in parts if part.joint == 1] == [1.0]


def test_a_mesh_is_read_once(leg_looking_like, tmp_path, monkeypatch):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.obj")
    mesh = '<visual><geometry><mesh filename="box.obj"/></geometry></visual>'
    leg, read = leg_looking_like(3 * mesh), []
    load = leg_figure.read_mesh
    monkeypatch.setattr(leg_figure, "read_mesh", lambda *names: read.append(names) or load(*names))
    assert len(thigh(leg)) == 3
    assert len(read) == 1


def test_the_boot_ends_at_the_contact_point():
    """The nearest point of its surface, and what lies ahead of it."""
    leg = kd.Leg.human()
    foot = leg.workspace.model.getJointId("ankle")
    (boot,) = (part for part in leg_shapes(leg)[0] if part.rgba == (0.16, 0.17, 0.2, 1))
    assert boot.joint == foot
    mesh = trimesh.Trimesh(boot.geometry.vertices, boot.geometry.faces)
    _, (gap,), _ = trimesh.proximity.closest_point_naive(mesh, [leg.contact_lever])
    assert gap < 0.006
    assert mesh.bounds[1, 0] == pytest.approx(leg.contact_lever[0], abs=0.002)


def test_the_leg_of_a_person_has_a_faint_person_above_it():
    def persons(leg):
        viewer = recording_viewer()
        draw_leg(viewer["leg"], leg, leg.configuration())
        commands = map(umsgpack.unpackb, viewer.window.commands)
        return [c for c in commands if c["type"] == "set_object" and "/person/" in c["path"]]

    drawn = persons(kd.Leg.human())
    assert len(drawn) == len(PERSON)
    assert all(c["object"]["materials"][0]["opacity"] < 0.3 for c in drawn)
    assert len(persons(kd.Leg.human(height=1.65, mass=58, model="3d"))) == len(PERSON)
    assert persons(kd.Leg.testbed()) == []
    assert persons(kd.Leg.human(height=1.65, mass=58, base="floating")) == []
