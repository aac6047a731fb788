"""Robots by name, of example-robot-data, turned to face x, and of robot_descriptions."""

import sys
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
