from importlib import metadata

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robots import ROBOTS, robot_model, robots_folder

MASS = {"g1": 33.34, "talos": 90.27, "icub": 28.35, "romeo": 40.53, "human": 74.71, "bolt": 1.25}
MASS |= {"simple_humanoid": 130.80, "icub_reduced": 28.35}
WHOLE = [name for name in ROBOTS if name not in ("icub", "romeo")]


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_has_legs_with_which_it_stands_and_kicks(name, base):
    leg = kd.Leg.from_robot(name, base=base, legs_only=True)
    size = 6 if name == "bolt" else 12
    assert leg.nv == size + 6 * (base == "floating")
    assert (leg.name, leg.frame) == (name, ROBOTS[name].foot)
    assert leg.urdf.folder.name == ROBOTS[name].file.split("/")[0]  # meshes from there only
    model = leg.model
    mass = pin.computeTotalMass(model) + (model.inertias[0].mass if base == "fixed" else 0)
    assert mass == pytest.approx(MASS[name], abs=0.005)
    posture = leg.posture(leg.configuration())
    assert posture.condition < 1e3
    right = posture.contact_point
    data = model.createData()
    pin.framesForwardKinematics(model, data, posture.q)
    left = data.oMf[model.getFrameId(ROBOTS[name].stance)].translation
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
    ours = robot_model(name, "floating", legs_only=False)
    move = np.random.default_rng(0).uniform(-0.5, 0.5, size=raw.nv - 6)
    turn = pin.SE3(pin.rpy.rpyToMatrix(*ROBOTS[name].turn), np.zeros(3))
    places, energies = [], []
    for model in (raw, ours):
        data = model.createData()
        q = pin.integrate(model, pin.neutral(model), np.concatenate([np.zeros(6), move]))
        pin.framesForwardKinematics(model, data, q)
        pin.centerOfMass(model, data, q)
        inertia = pin.crba(model, data, q)
        places.append([f.translation.copy() for f in data.oMf] + [data.com[0].copy()])
        energies.append(inertia[6:, 6:])
    turned = [turn.act(place) for place in places[0]]
    assert np.abs(np.array(turned) - places[1]).max() < 1e-14
    assert np.abs(energies[0] - energies[1]).max() < 1e-13


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
def test_singular_robots_are_refused_by_joint(base):
    with pytest.raises(
        kd.InvalidInput, match=r"condition .*fault: neck_roll, neck_yaw; .*legs_only=True"
    ):
        kd.Leg.from_robot("icub", base=base)
    with pytest.raises(
        kd.InvalidInput, match=r"'LFinger21' .*mass 0 kg.*, as do LFinger22.*RThumb3.*legs_only"
    ):
        kd.Leg.from_robot("romeo", base=base)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": "asimo"}, "robot 'asimo' is unknown: choose g1, talos, icub, .*bolt"),
        ({"name": None}, "robot None is unknown"),
        ({"base": "wheels"}, "base is 'wheels': it must be fixed or floating"),
        ({"frame": "toe"}, "frame 'toe' is unknown: bolt has .*FR_FOOT"),
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

    monkeypatch.setattr("kickdyn.robots.metadata.files", files)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[robots\]"') as caught:
        kd.Leg.from_robot("g1")
    assert "\n" not in str(caught.value)


def test_what_is_asked_for_is_checked_first():
    with pytest.raises(kd.InvalidInput, match="frame 'foo' is unknown"):
        kd.Leg.from_robot("icub", "foo")
    with pytest.raises(kd.InvalidInput, match=r"robot \['g1'\] is unknown"):
        kd.Leg.from_robot(["g1"])


def test_options_are_not_guessed():
    with pytest.raises(kd.InvalidInput, match="frame '' is unknown"):
        kd.Leg.from_robot("bolt", "")
    with pytest.raises(kd.InvalidInput, match="legs_only is 'no': it must be True or False"):
        kd.Leg.from_robot("bolt", legs_only="no")
