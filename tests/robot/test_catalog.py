import pickle
import sys
from importlib import metadata
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial import cKDTree

import kickdyn as kd
from kickdyn.cli.leg_options import load_leg
from kickdyn.robot import catalog
from kickdyn.robot.catalog import ROBOTS, SURFACES, read_robot, robots_folder
from kickdyn.view.leg_figure import joint_poses, leg_shapes

MASS = {"g1": 33.34, "talos": 90.27, "icub": 28.35, "romeo": 40.53, "human": 74.71, "bolt": 1.25}
MASS |= {"simple_humanoid": 130.80, "icub_reduced": 28.35}
WHOLE = [name for name in ROBOTS if name not in ("icub", "romeo")]


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_has_legs_with_which_it_stands_and_kicks(name, base):
    leg = kd.Leg.from_robot(name, base=base, legs_only=True)
    size = 6 if name == "bolt" else 12
    assert leg.nv == size + 6 * (base == "floating")
    assert leg.name == name
    assert leg.frame == ("r_ankle" if name == "simple_humanoid" else "toe")
    assert leg.file.source.endswith(ROBOTS[name].file)
    model = leg.model
    mass = pin.computeTotalMass(model) + (model.inertias[0].mass if base == "fixed" else 0)
    assert mass == pytest.approx(MASS[name], abs=0.005)
    posture = leg.posture(leg.configuration())
    assert posture.condition < 1e3
    data = model.createData()
    pin.framesForwardKinematics(model, data, posture.q)
    feet = (ROBOTS[name].foot, ROBOTS[name].stance)
    right, left = (data.oMf[model.getFrameId(foot)].translation for foot in feet)
    # z up and y left; the feet mirror each other
    assert right[2] < -0.4
    assert right[1] < 0 < left[1]
    assert right * [1, -1, 1] == pytest.approx(left, abs=1e-4)


@pytest.mark.parametrize("name", WHOLE)
def test_every_whole_robot_loads_but_the_singular_ones(name):
    leg = kd.Leg.from_robot(name, base="floating")
    assert leg.nv > 30 or name == "bolt"
    assert leg.posture(leg.configuration()).condition < 1e4
    assert leg.joint_names[0] == "root_joint"


@pytest.mark.parametrize(
    ("name", "knee"),
    [
        ("g1", {"right_hip_pitch_joint": -1}),
        ("talos", {"leg_right_3_joint": -1}),
        ("icub", {"r_hip_pitch": 1}),
        ("human", {"right_hip_Z": 1}),
        ("romeo", {"RHipPitch": -1}),
    ],
)
def test_robots_face_forward(name, knee):
    """Toes lie ahead of the ankle, and a flexed hip brings the foot to the front."""
    leg = kd.Leg.from_robot(name, legs_only=True)
    straight, raised = (leg.posture(leg.configuration(q)) for q in (None, knee))
    assert raised.contact_point[0] - straight.contact_point[0] > 0.3
    assert raised.contact_point[2] - straight.contact_point[2] > 0.1


@pytest.mark.parametrize("name", ["human", "icub_reduced", "g1"])
def test_a_turned_base_is_the_same_robot(name):
    """Masses and distances are those of the file, read by Pinocchio alone."""
    file = robots_folder() / ROBOTS[name].file
    raw = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer())
    ours = read_robot(name, "floating")[1]
    move = np.random.default_rng(0).uniform(-0.5, 0.5, size=raw.nv - 6)
    turn = pin.SE3(pin.rpy.rpyToMatrix(*np.radians(ROBOTS[name].turn_deg)), np.zeros(3))
    places, energies = [], []
    for model in (raw, ours):
        data = model.createData()
        q = pin.integrate(model, pin.neutral(model), np.concatenate([np.zeros(6), move]))
        pin.forwardKinematics(model, data, q)
        pin.centerOfMass(model, data, q)
        inertia = pin.crba(model, data, q)
        shared = [model.getFrameId(frame.name) for frame in raw.frames]
        placed = [pin.updateFramePlacement(model, data, one).translation for one in shared]
        places.append([*map(np.copy, placed), data.com[0].copy()])
        energies.append(inertia[6:, 6:])
    turned = [turn.act(place) for place in places[0]]
    assert np.abs(np.array(turned) - places[1]).max() < 1e-14
    assert np.abs(energies[0] - energies[1]).max() < 1e-13


OVERLAPS = {
    "g1": {"toe": 1.2, "instep": 3.0, "sole_edge": 1.6, "inside": 4.6, "outside": 4.6, "heel": 4.6},
    "talos": {"toe": 6, "inside": 5, "outside": 5, "heel": 5},
    "icub": {"toe": 2, "sole_edge": 1.6, "inside": 4.6, "outside": 4.6, "heel": 4.6},
    "romeo": {
        **{"toe": 4, "instep": 4.1, "sole_edge": 2.8},
        **{"inside": 4.6, "outside": 4.6, "heel": 4.6},
    },
    "human": {
        "toe": 4,
        "instep": 3.0,
        "sole_edge": 1.6,
        "inside": 4.6,
        "outside": 4.6,
        "heel": 4.6,
    },
    "bolt": {"toe": 4},
}
RISES = {"toe": (0, None), "instep": (60, 80), "sole_edge": (-90, 0)}
RISES |= dict.fromkeys(("inside", "outside", "heel"), (0, 15))


@pytest.mark.parametrize("name", OVERLAPS)
def test_a_ball_at_a_contact_point_overlaps_with_the_foot_no_more_than_it_says(name):
    """Of every normal that the point allows; the foot is that of the visual meshes."""
    assert set(ROBOTS[name].contact_points) == set(OVERLAPS[name])
    leg, radius = kd.Leg.from_robot(name, legs_only=True), kd.Ball().radius
    poses, corners = joint_poses(leg, leg.configuration()), []
    for part in leg_shapes(leg)[0]:
        if part.joint == leg.contact_joint:
            pose = poses[part.joint] @ part.pose
            ends = part.geometry.vertices[part.geometry.faces]
            corners.append(ends @ pose[:3, :3].T + pose[:3, 3])
    triangles = np.vstack(corners)
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles))
    surface, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=0)
    foot = cKDTree(np.vstack([surface, triangles.reshape(-1, 3)]))
    side, up = np.meshgrid(np.radians(np.arange(-20, 21, 5)), np.radians(np.arange(-90, 91, 5)))
    every = np.stack([np.cos(up) * np.cos(side), np.cos(up) * np.sin(side), np.sin(up)], -1)
    ahead = every.reshape(-1, 3)
    for point, most in OVERLAPS[name].items():
        leg = kd.Leg.from_robot(name, point, legs_only=True)
        posture = leg.posture(leg.configuration())
        assert foot.query(posture.contact_point)[0] < 2e-3
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(SURFACES[point][0]))
        every = ahead @ turn.T
        normals = every[(every @ leg.contact_normal_cone.T > -1e-9).all(axis=1)]
        assert len(normals) > 10
        low, high = RISES[point]
        rise = np.degrees(np.arcsin(np.clip(normals[:, 2], -1, 1)))
        assert rise.min() == pytest.approx(low, abs=1e-5)
        high = ROBOTS[name].steepest if high is None else high
        assert rise.max() == pytest.approx(high, abs=1e-5)
        into = radius - foot.query(posture.contact_point + radius * normals)[0]
        assert into.max() < 1e-3 * most


def test_the_ankle_can_still_be_named():
    leg = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    assert leg.contact_normal_cone is None
    toe = kd.Leg.from_robot("g1", "toe", legs_only=True)
    apart = [one.posture(one.configuration()).contact_point for one in (toe, leg)]
    np.testing.assert_allclose(apart[0] - apart[1], ROBOTS["g1"].contact_points["toe"], atol=1e-12)
    locked = toe.locked({"left_knee_joint": 0.2})
    for other in (locked, pickle.loads(pickle.dumps(toe))):
        assert (other.frame, other.contact_normal_cone.tolist()) == (
            "toe",
            toe.contact_normal_cone.tolist(),
        )


def test_base_pose_is_in_world_axes():
    leg = kd.Leg.from_robot("human", base="floating")
    q = leg.configuration()
    up = q.copy()
    up[2] = 1.0
    moved = leg.posture(up).contact_point - leg.posture(q).contact_point
    assert moved == pytest.approx([0, 0, 1], abs=1e-15)
    v = np.zeros(leg.nv)
    v[2] = 1.0
    assert leg.posture(q).point_velocity(v) == pytest.approx([0, 0, 1], abs=1e-15)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_robot_is_refused_where_no_posture_of_it_exists(base):
    icub = kd.Leg.from_robot("icub", base=base)
    with pytest.raises(kd.InvalidInput, match=r"condition .*fault: neck_roll, neck_yaw; .*locked"):
        icub.posture(icub.configuration())
    bent = icub.configuration({"neck_yaw": 0.3})
    assert icub.posture(bent).effective_mass([1, 0, 0]) > 0
    with pytest.raises(
        kd.InvalidInput, match=r"'LFinger21' .*mass 0 kg.*, as do LFinger22.*RThumb3.*legs_only"
    ):
        kd.Leg.from_robot("romeo", base=base)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": "asimo"}, "robot 'asimo' is unknown: choose g1, talos, icub, .*bolt"),
        ({"name": None}, "name is None: it must be a str"),
        ({"base": "wheels"}, "base is 'wheels': it must be fixed or floating"),
        ({"frame": "tip"}, "frame 'tip' is unknown: bolt has .*FR_FOOT"),
        ({"frame": "base_link"}, "'base_link' is fixed to the base: a kick must move it$"),
        ({"frame": "base_link", "legs_only": True}, "fixed to the base"),
    ],
)
def test_bad_names_are_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_robot(**{"name": "bolt", **change})


@pytest.mark.parametrize("found", [metadata.PackageNotFoundError("x"), None, []])
def test_without_the_package_one_line_says_how_to_get_it(monkeypatch, found):
    def files(_):
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr("kickdyn.robot.catalog.metadata.files", files)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[robots\]"') as caught:
        kd.Leg.from_robot("g1")
    assert "\n" not in str(caught.value)


def test_what_is_asked_for_is_checked_first():
    with pytest.raises(kd.InvalidInput, match="frame 'foo' is unknown"):
        kd.Leg.from_robot("icub", "foo")
    with pytest.raises(kd.InvalidInput, match=r"name is \['g1'\]: it must be a str"):
        kd.Leg.from_robot(["g1"])


def test_options_are_not_guessed():
    with pytest.raises(kd.InvalidInput, match="frame '' is unknown"):
        kd.Leg.from_robot("bolt", "")
    with pytest.raises(kd.InvalidInput, match="legs_only is 'no': it must be True or False"):
        kd.Leg.from_robot("bolt", legs_only="no")


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_joints_outside_the_legs_are_locked_at_values(base):
    locked = {"waist_yaw_joint": 0.25, "left_knee_joint": 0.5}
    legs = kd.Leg.from_robot("g1", base=base, legs_only=True, locked=locked)
    whole = kd.Leg.from_robot("g1", base=base)
    assert legs.nv == (11 if base == "fixed" else 17)
    turned, q = legs.posture(legs.configuration()), whole.configuration(locked)
    assert turned.contact_point == pytest.approx(whole.posture(q).contact_point, abs=1e-14)
    data, other = legs.model.createData(), whole.model.createData()
    centre = pin.centerOfMass(legs.model, data, turned.q)
    if base == "floating":
        assert centre == pytest.approx(pin.centerOfMass(whole.model, other, q), abs=1e-14)
    with pytest.raises(kd.InvalidInput, match="joint 'waist' is unknown"):
        kd.Leg.from_robot("g1", base=base, legs_only=True, locked={"waist": 0.25})


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


def test_a_urdf(described, good_urdf):
    name = described("atlas_v4_description", good_urdf, "URDF_PATH")
    assert kd.Leg.from_robot(name, "shank").joint_names == ("hip", "knee")
    assert load_leg(name, "shank").joint_names == ("hip", "knee")
    assert load_leg(name, "shank", locked={"hip": 90}).joint_names == ("knee",)
    with pytest.raises(kd.InvalidInput, match=r"^frame 'heel' is unknown"):
        kd.Leg.from_robot(name, "heel")


def test_an_mjcf_has_its_files_anywhere_in_its_package(described):
    name = described("g1_mj_description", MJCF, "MJCF_PATH")
    leg = kd.Leg.from_robot(name, "foot")
    assert leg.joint_names == ("hip",)
    assert kd.Leg.from_robot(name, "foot", base="floating").nv == 7
    with pytest.raises(kd.InvalidInput, match=r"^frame 'toe' is unknown: .*b"):
        kd.Leg.from_robot(name)
    with pytest.raises(kd.InvalidInput, match="joint 'knee' is unknown"):
        kd.Leg.from_robot(name, "foot", locked={"knee": 0})
    with pytest.raises(kd.InvalidInput, match=r"^base is 'free'"):
        kd.Leg.from_robot(name, base="free")
    with pytest.raises(kd.InvalidInput, match=r"legs_only is for g1, .*use locked="):
        kd.Leg.from_robot(name, "foot", legs_only=True)
    with pytest.raises(kd.InvalidInput, match="package-dir is 'a': it is for a URDF file"):
        load_leg(name, "foot", package_dirs=["a"])


def test_joints_are_locked_before_the_file_is_judged(described):
    slide = MJCF.replace("<freejoint/>", '<joint name="rail" type="slide"/>')
    name = described("g1_mj_description", slide, "MJCF_PATH")
    with pytest.raises(kd.MjcfError, match=r"joints of the file \(rail\) move its root body"):
        load_leg(name, "foot", "floating")
    leg = load_leg(name, "foot", "floating", locked={"rail": 0.25})
    assert leg.joint_names == ("root_joint", "hip")
    assert leg.posture(leg.configuration()).contact_point.tolist() == [0, 0, 0.25]


def test_a_bad_file_is_named(described):
    name = described("atlas_v4_description", "<robot/>", "URDF_PATH")
    with pytest.raises(kd.UrdfError, match=r"robot\.xml: a robot has no name"):
        kd.Leg.from_robot(name)
    name = described("ur10e_description", "<robot/>", "XACRO_PATH")
    with pytest.raises(
        kd.InvalidInput, match="has neither a URDF nor an MJCF file: make a URDF file of its"
    ):
        kd.Leg.from_robot(name)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("atlas_v4_descriptio", r"did you mean 'atlas_v4_description'\? choose g1, talos, .*bolt"),
        ("talso", r"did you mean 'talos'\? choose g1, .*or a name of robot_descriptions$"),
        ("_cache", "robot '_cache' is unknown: choose g1"),
        ("../a1_description", r"did you mean 'a1_description'\?"),
        ("", "robot '' is unknown: choose g1"),
    ],
)
def test_an_unknown_name_suggests_the_nearest(name, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_robot(name)


def test_without_the_package_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    said = r'install more with pip install "kickdyn\[descriptions\]"$'
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_robot("g1_mj_description")


def test_without_a_network_it_says_so_in_one_line(tmp_path, monkeypatch, capfd):
    """As git does it; the address is one that no network answers."""
    cache = pytest.importorskip("robot_descriptions._cache")
    place = cache.REPOSITORIES["mujoco_menagerie"]
    gone = type(place)(url=str(tmp_path / "gone.git"), commit=place.commit, cache_path="gone")
    monkeypatch.setitem(cache.REPOSITORIES, "mujoco_menagerie", gone)
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delitem(sys.modules, "robot_descriptions.g1_mj_description", raising=False)
    with pytest.raises(kd.InvalidInput) as refusal:
        kd.Leg.from_robot("g1_mj_description", "foot")
    said = str(refusal.value)
    assert said.startswith("robot 'g1_mj_description' is not on this machine, and cannot be downl")
    assert "gone.git' does not appear to be a git repository" in said
    assert said.endswith("or set ROBOT_DESCRIPTIONS_CACHE to a folder that has it")
    assert "\n" not in said
    out, progress = capfd.readouterr()
    assert out == ""
    assert progress.endswith("\n")  # the message gets a line of its own


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("stderr: 'fatal: no host: x'\nmore"), "no host: x"),
        (ImportError("Bad git executable.\nThe git"), "Bad git executable."),
        (OSError(), "OSError"),
    ],
)
def test_the_reason_is_one_line(error, said):
    assert catalog._reason(error) == said
