import numpy as np
import pytest

import kickdyn as kd
from kickdyn.cli.named_legs import LEGS, load_leg
from kickdyn.robot.catalog import ROBOTS


def test_ours_come_first_and_every_robot_is_named_once():
    assert LEGS[:2] == ("human", "testbed")
    assert set(LEGS) == {"testbed", *ROBOTS}
    assert len(LEGS) == len(set(LEGS))


def test_a_name_is_ours_a_robot_or_a_file(tmp_path):
    assert (load_leg("human").model.njoints, load_leg("testbed", "foot").frame) == (4, "foot")
    (tmp_path / "human.urdf").write_text(kd.Leg.testbed().file.text)
    assert load_leg(str(tmp_path / "human.urdf")).name == kd.Leg.testbed().name
    with pytest.raises(kd.InvalidInput, match=r"'hunam' is neither human, testbed, g1, .* nor a f"):
        load_leg("hunam")
    with pytest.raises(kd.InvalidInput, match="nor a file"):
        load_leg("x" * 5000)


def test_a_file_without_our_frame_is_told_the_option(tmp_path):
    (tmp_path / "other.urdf").write_text(kd.Leg.testbed().file.text.replace('"toe"', '"instep"'))
    said = r"^no --frame is named, and frame 'toe' is unknown: leg_testbed has .*instep"
    with pytest.raises(kd.InvalidInput, match=said):
        load_leg(str(tmp_path / "other.urdf"))
    assert load_leg(str(tmp_path / "other.urdf"), "instep").frame == "instep"
    with pytest.raises(kd.InvalidInput, match=r"^frame 'toe' is unknown"):
        load_leg(str(tmp_path / "other.urdf"), "toe")
    with pytest.raises(kd.UrdfError, match="there is no such file"):
        load_leg(str(tmp_path / "none.urdf"))


def test_an_mjcf_file_is_known_by_what_is_in_it(tmp_path):
    body = '<body name="toe"><joint name="hip" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
    for name in ("leg.xml", "leg.urdf"):
        (tmp_path / name).write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        assert load_leg(str(tmp_path / name)).joint_names == ("hip",)
    with pytest.raises(kd.InvalidInput, match=r"^frame 'heel' is unknown"):
        load_leg(str(tmp_path / "leg.xml"), "heel")
    (tmp_path / "leg.xml").write_text(kd.Leg.testbed().file.text)
    assert load_leg(str(tmp_path / "leg.xml")).name == "leg_testbed"
    (tmp_path / "leg.xml").write_text("<mujoco/>")
    with pytest.raises(kd.InvalidInput, match="package-dir is 'share': it is for a URDF file"):
        load_leg(str(tmp_path / "leg.xml"), package_dirs=["share"])
    (tmp_path / "leg.xml").write_text("<mujoco")
    with pytest.raises(kd.MjcfError, match="is not well-formed XML"):
        load_leg(str(tmp_path / "leg.xml"))


def test_a_joint_of_an_mjcf_is_locked_in_degrees(tmp_path):
    part = '<joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
    knee = f'<body name="toe" pos="0 0 -1">{part.format("knee")}</body>'
    hip = f"<body>{part.format('hip')}{knee}</body>"
    (tmp_path / "leg.xml").write_text(f"<mujoco><worldbody>{hip}</worldbody></mujoco>")
    leg = load_leg(str(tmp_path / "leg.xml"), locked={"hip": 90.0})
    assert leg.joint_names == ("knee",)
    assert leg.frame == "toe"
    assert leg.posture([0.0]).contact_point == pytest.approx([-1.0, 0.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("name", ["rail", ""], ids=["named", "unnamed"])
def test_joints_of_an_mjcf_are_locked_before_it_is_judged(tmp_path, name):
    # joints of the file that move its root body make a floating base singular
    part = '<joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
    knee = f'<body name="toe" pos="0 0 -1">{part.format("knee")}</body>'
    rail = f'<joint {f"name={name!r}" if name else ""} type="slide" axis="1 0 0"/>'
    body = f'<body name="body">{rail}{part.format("turn")}{knee}</body>'
    tie = '<equality><joint joint1="knee" joint2="turn" polycoef="0 0 1 0 0"/></equality>'
    file = tmp_path / "leg.xml"
    file.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    locked = {name or "body_joint": 0.25, "turn": 90.0}
    with pytest.raises(kd.MjcfError, match="lock them"):
        load_leg(str(file), base="floating")
    leg = load_leg(str(file), base="floating", locked=locked)
    assert leg.joint_names == ("root_joint", "knee")
    point = leg.posture(leg.configuration()).contact_point
    assert point == pytest.approx([0.25 - 1.0, 0.0, 0.0], abs=1e-15)
    scene = tmp_path / "scene.toml"
    locks = ", ".join(f"{joint} = {value}" for joint, value in locked.items())
    scene.write_text(
        f'[leg]\nfile = "leg.xml"\nbase = "floating"\nlocked = {{ {locks} }}\n'
        "[posture]\njoint_velocity_rad_s = { knee = 1.0 }\n"
        "[contact]\nattack_deg = 45.0\nrestitution = 0.8\n"
    )
    assert kd.load_scene(scene).leg.joint_names == ("root_joint", "knee")
    file.write_text(f"<mujoco><worldbody>{body}</worldbody>{tie}</mujoco>")
    with pytest.raises(kd.MjcfError, match=r"lock its joints \(locked=, --lock\)"):
        load_leg(str(file))
    tied = {"turn": 0.0, "knee": 0.0}
    assert load_leg(str(file), locked=tied).joint_names == (name or "body_joint",)


@pytest.mark.parametrize("name", ["human", "g1", "g1_description"])
def test_folders_of_packages_are_not_for_a_robot_by_name(name):
    with pytest.raises(kd.InvalidInput, match=f"it is for a URDF file, not {name}$"):
        load_leg(name, package_dirs=["share"])


def test_of_a_robot_only_what_moves_the_foot_can_move():
    whole, leg = kd.Leg.from_robot("g1", legs_only=True), load_leg("g1")
    assert leg.nv < whole.nv
    assert all(name.startswith("right") for name in leg.joint_names)
    q = whole.configuration({"right_knee_joint": 0.5})
    mine = leg.configuration({"right_knee_joint": 0.5})
    normal = (np.cos(0.5), 0.0, np.sin(0.5))
    weights = [whole.posture(q).effective_mass(normal), leg.posture(mine).effective_mass(normal)]
    assert weights[0] == pytest.approx(weights[1], rel=1e-12)


def test_joints_are_locked_in_degrees_or_metres(tmp_path):
    sliding = kd.Leg.testbed().file.text.replace(
        'name="ankle" type="revolute"', 'name="ankle" type="prismatic"'
    )
    (tmp_path / "slide.urdf").write_text(sliding)
    path, values = tmp_path / "slide.urdf", {"hip": 30.0, "ankle": 0.1}
    leg = load_leg(str(path), locked=values)
    same = kd.Leg.from_urdf(path, locked={"hip": np.radians(30), "ankle": 0.1})
    places = [each.posture([0.2]).contact_point for each in (leg, same)]
    assert places[0] == pytest.approx(places[1], abs=1e-15)
    matched = load_leg(str(path), locked={"[ah]*": 0.1})  # the hip in degrees, the ankle in metres
    named = kd.Leg.from_urdf(path, locked={"hip": np.radians(0.1), "ankle": 0.1})
    places = [each.posture([0.2]).contact_point for each in (matched, named)]
    assert places[0] == pytest.approx(places[1], abs=1e-15)
    with pytest.raises(kd.InvalidInput, match=r"^joint 'hop' is unknown: did you mean 'hip'"):
        load_leg(str(path), locked={"hop": 1.0})
    g1 = load_leg("g1", locked={"right_knee_joint": 30.0})
    assert "right_knee_joint" not in g1.joint_names
