"""Robots by name, and surfaces of a foot that can meet a ball, by hand and by their meshes."""

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial import cKDTree
from tolerances import EPSILON, agrees, closed_form

import kickdyn as kd
from kickdyn.cli.leg_options import load_leg
from kickdyn.robot import catalog
from kickdyn.robot.catalog import ROBOTS, SURFACES, read_robot, robots_folder
from kickdyn.robot.foot_surfaces import load_with_surface
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.view.leg_figure import joint_poses, leg_shapes

MASS = {"g1": 33.34, "talos": 90.27, "icub": 28.35, "romeo": 40.53, "human": 74.71, "bolt": 1.25}
MASS |= {"simple_humanoid": 130.80, "icub_reduced": 28.35}
"""Sums of the masses in the files [kg]."""


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_has_legs_with_which_it_stands_and_kicks(name, base):
    leg = kd.Leg.from_robot(name, base=base, legs_only=True)
    assert leg.nv == (6 if name == "bolt" else 12) + 6 * (base == "floating")
    assert (leg.name, leg.joint_names[0] == "root_joint") == (name, base == "floating")
    assert leg.frame == ("r_ankle" if name == "simple_humanoid" else "toe")
    mass = pin.computeTotalMass(leg.model)
    mass += leg.model.inertias[0].mass if base == "fixed" else 0.0
    assert mass == pytest.approx(MASS[name], abs=0.005)
    posture = leg.posture(leg.configuration())
    assert posture.condition < 1e3
    data = leg.model.createData()
    pin.framesForwardKinematics(leg.model, data, posture.q)
    right, left = (
        data.oMf[leg.model.getFrameId(foot)].translation
        for foot in (ROBOTS[name].foot, ROBOTS[name].stance)
    )
    assert right[2] < -0.4  # z is up
    assert right[1] < 0 < left[1]  # y points left
    assert right * [1, -1, 1] == pytest.approx(left, abs=1e-4)  # digits of the files


@pytest.mark.parametrize("name", ["human", "icub_reduced", "g1"])
def test_a_turned_base_is_the_same_robot(name):
    """Masses and places beside frames are those of the file, which Pinocchio reads alone."""
    file = robots_folder() / ROBOTS[name].file
    raw = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer())
    move = np.random.default_rng(0).uniform(-0.5, 0.5, size=raw.nv - 6)
    places, inertias = [], []
    for model in (raw, read_robot(name, "floating")[1]):
        data = model.createData()
        q = pin.integrate(model, pin.neutral(model), np.concatenate([np.zeros(6), move]))
        pin.framesForwardKinematics(model, data, q)
        pin.centerOfMass(model, data, q)
        frames = [data.oMf[model.getFrameId(frame.name)] for frame in raw.frames[2:]]
        beside = [frame.act(np.array([0.1, 0.2, 0.3])) for frame in frames]
        places.append(np.array([*beside, data.com[0]]))
        inertias.append(pin.crba(model, data, q)[6:, 6:])
    turn = pin.rpy.rpyToMatrix(*np.radians(ROBOTS[name].turn_deg))
    agrees(places[1], places[0] @ turn.T, closed_form())
    agrees(inertias[1], inertias[0], closed_form())


OVERLAPS = {  # largest depth of a ball in the visual meshes of a foot, for any normal [mm]
    "g1": {"toe": 1.2, "instep": 3.0, "sole_edge": 1.6},
    "talos": {"toe": 6},
    "icub": {"toe": 2, "sole_edge": 1.6},
    "romeo": {"toe": 4, "instep": 4.1, "sole_edge": 2.8},
    "human": {"toe": 4, "instep": 3.0, "sole_edge": 1.6},
    "bolt": {"toe": 4},
}
RISES = {"instep": (60, 80), "sole_edge": (-90, 0)}
RISES |= dict.fromkeys(("inside", "outside", "heel"), (0, 15))


@pytest.mark.parametrize("name", OVERLAPS)
def test_a_ball_at_a_contact_point_hardly_overlaps_with_the_foot(name):
    """It touches the foot of the visual meshes, for every normal that the surface allows."""
    leg, radius = kd.Leg.from_robot(name, legs_only=True), kd.Ball().radius
    poses, corners = joint_poses(leg, leg.configuration()), []
    for shape in leg_shapes(leg)[0]:
        if shape.joint == leg.contact_joint:
            pose = poses[shape.joint] @ shape.pose
            ends = shape.geometry.vertices[shape.geometry.faces]
            corners.append(ends @ pose[:3, :3].T + pose[:3, 3])
    triangles = np.vstack(corners)
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles))
    surface, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=0)
    foot = cKDTree(np.vstack([surface, triangles.reshape(-1, 3)]))
    side, up = np.meshgrid(np.radians(np.arange(-20, 21, 5)), np.radians(np.arange(-90, 91, 5)))
    near = closed_form(EPSILON**-0.5)  # of an arc sine at 90 degrees
    ahead = np.stack([np.cos(up) * np.cos(side), np.cos(up) * np.sin(side), np.sin(up)], -1)
    for point in ROBOTS[name].contact_points:
        leg = kd.Leg.from_robot(name, point, legs_only=True)
        posture = leg.posture(leg.configuration())
        assert foot.query(posture.contact_point)[0] < 2e-3, point
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(SURFACES[point][0]))
        every = ahead.reshape(-1, 3) @ turn.T
        normals = every[(every @ leg.contact_normal_cone.T > -closed_form()).all(axis=1)]
        rise = np.degrees(np.arcsin(np.clip(normals[:, 2], -1, 1)))
        low, high = RISES.get(point, (0, ROBOTS[name].steepest))
        assert (rise.min(), rise.max()) == pytest.approx((low, high), abs=near), point
        lateral = np.degrees(np.arctan2(*(normals @ turn).T[1::-1]))[np.abs(rise) < 85]
        assert (lateral.min(), lateral.max()) == pytest.approx((-15, 15), abs=near), point
        depth = radius - foot.query(posture.contact_point + radius * normals)[0]
        assert depth.max() < 1e-3 * OVERLAPS[name].get(point, 5), point


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_joints_outside_the_legs_are_locked_at_values(base):
    locked = {"waist_yaw_joint": 0.25, "left_knee_joint": 0.5}
    legs = kd.Leg.from_robot("g1", base=base, legs_only=True, locked=locked)
    whole = kd.Leg.from_robot("g1", base=base)
    assert legs.nv == (11 if base == "fixed" else 17)
    one, other = legs.posture(legs.configuration()), whole.posture(whole.configuration(locked))
    assert one.contact_point == pytest.approx(other.contact_point, abs=closed_form())


@pytest.mark.parametrize(("change", "said"), [
    ({"name": "asimo"}, "'asimo' .*choose g1, talos, icub, .*bolt"),
    ({"name": "talso"}, "'talso' .*did you mean 'talos'"),
    ({"frame": "base_link"}, "'base_link' is fixed to the base"),
    ({"locked": {"waist": 0.25}}, "'waist' is unknown"),
    ({"name": "g1_mj_description", "legs_only": True}, "legs_only .*locked="),
    ({"name": "romeo"}, "'LFinger21' .*LFinger22.*RThumb3.*legs_only"),  # without mass
])  # fmt: skip
def test_bad_arguments_are_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_robot(**{"name": "bolt", **change})


def test_a_failed_download_gives_the_reason_of_git(monkeypatch):
    def fails(name, importing=catalog.import_module):
        if name == "robot_descriptions":
            return importing(name)
        raise OSError("Cmd('git') failed\n  stderr: 'fatal: no route to the host'\n")

    monkeypatch.setattr(catalog, "import_module", fails)
    with pytest.raises(kd.InvalidInput, match=r"downloaded \(no route to the host\)"):
        kd.Leg.from_robot("g1_description")


def test_a_robot_that_is_singular_where_it_is_straight_is_taken():
    icub = kd.Leg.from_robot("icub")
    with pytest.raises(kd.InvalidInput, match=r"fault: neck_roll, neck_yaw; .*locked"):
        icub.posture(icub.configuration())


MJCF = """<mujoco><compiler meshdir="../meshes"/><asset><mesh name="m" file="m.stl"/></asset>
<worldbody><body name="base"><freejoint/><geom size="0.2"/><body name="foot"><joint name="hip"/>
<geom size="0.1" pos="0 0 -1"/></body></body></worldbody></mujoco>"""


@pytest.fixture
def described(tmp_path, monkeypatch):
    """Make a module of robot_descriptions, with files in a cache."""
    for folder in ("files", "meshes"):
        (tmp_path / "robot" / folder).mkdir(parents=True)
    trimesh.creation.box().export(tmp_path / "robot" / "meshes" / "m.stl")

    def make(name, text, key):
        file = tmp_path / "robot" / "files" / "robot.xml"
        file.write_text(text)
        module = ModuleType(f"robot_descriptions.{name}")
        module.REPOSITORY_PATH, module.PACKAGE_PATH = str(tmp_path), str(tmp_path / "robot")
        setattr(module, key, str(file))
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return name

    return make


def test_a_description_can_be_an_mjcf_with_files_anywhere_in_its_package(described):
    name = described("g1_mj_description", MJCF, "MJCF_PATH")
    assert kd.Leg.from_robot(name, "foot").joint_names == ("hip",)
    assert kd.Leg.from_robot(name, "foot", base="floating").nv == 7
    with pytest.raises(kd.InvalidInput, match=r"package-dir .*'a'"):
        load_leg(name, "foot", package_dirs=["a"])


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
