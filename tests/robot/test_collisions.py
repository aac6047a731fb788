"""Bodies inside each other and inside a ball."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.robot.collisions import Placed, bodies_at, find_ball_overlaps, find_self_collisions
from kickdyn.robot.ground_clearance import body_frames
from kickdyn.robot.urdf_file import shipped_urdf

LEGS = """<mujoco><worldbody><body name="trunk" pos="0 0 1"><geom type="sphere" size="0.05"/>
<body name="left" pos="0 0.1 0"><joint name="l" type="hinge" axis="1 0 0"/>
<geom type="{}" {}="{}" pos="0 0 -0.4"/></body>
<body name="right" pos="0 -0.1 0"><joint name="r" type="hinge" axis="1 0 0"/>
<geom type="{}" {}="{}" pos="0 0 -0.4"/></body></body></worldbody></mujoco>"""


def legs(folder, kind, size):
    path = folder / "legs.xml"
    path.write_text(LEGS.format(kind, "size", size, kind, "size", size))
    return kd.Leg.from_mjcf(path, "right")


@pytest.mark.parametrize(
    ("kind", "size", "width"),
    [("capsule", "0.04 0.3", 0.04), ("sphere", "0.04", 0.04), ("box", "0.1 0.04 0.3", 0.04)],
)
def test_crossed_legs_are_inside_each_other_and_straight_ones_are_not(tmp_path, kind, size, width):
    leg = legs(tmp_path, kind, size)
    assert find_self_collisions(leg, leg.configuration()) == {}
    crossed = leg.configuration({"l": -0.3, "r": 0.3})
    (((first, other), depth),) = find_self_collisions(leg, crossed).items()
    assert {first, other} == {"left", "right"}
    if kind == "sphere":  # centres at 0.1 cos 0 -+ 0.4 sin 0.3
        between = 2 * abs(0.1 - 0.4 * np.sin(0.3))
        assert depth == pytest.approx(2 * width - between, abs=1e-9)


def test_bodies_that_touch_at_rest_do_not_count(tmp_path):
    wide = legs(tmp_path, "capsule", "0.11 0.3")
    assert find_self_collisions(wide, wide.configuration({"l": -0.3, "r": 0.3})) == {}


@pytest.mark.parametrize("name", ["g1", "talos"])
def test_robots_do_not_touch_themselves_at_rest(name):
    robot = kd.Leg.from_robot(name, base="floating", legs_only=True)
    assert find_self_collisions(robot, robot.configuration()) == {}


def test_a_body_and_the_one_that_carries_its_joints_do_not_count():
    """An upper arm of gymnasium's humanoid has two hinges, and thus a joint without a body."""
    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    humanoid = kd.Leg.from_mjcf(file, "right_foot", base="floating")
    raised = humanoid.configuration({"right_shoulder1": 1.0, "right_shoulder2": 0.39})
    assert find_self_collisions(humanoid, raised) == {}


def test_pairs_that_the_srdf_disables_do_not_count(tmp_path):
    """A hip's box reaches the shank where the knee is bent by 150 degrees."""
    link = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
    link += 'iyz="0" izz="1"/></inertial><visual><origin xyz="0 0 {}"/><geometry>'
    link += '<box size="0.1 0.1 0.3"/></geometry></visual></link>'
    joint = '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin '
    joint += 'xyz="0 0 {3}"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" '
    joint += 'velocity="1"/></joint>'
    text = '<robot name="three">' + link.format("trunk", 0) + link.format("thigh", -0.2)
    text += link.format("shank", -0.2) + joint.format("hip", "trunk", "thigh", -0.2)
    text += joint.format("knee", "thigh", "shank", -0.2) + "</robot>"
    (tmp_path / "three.urdf").write_text(text)
    leg = kd.Leg.from_urdf(tmp_path / "three.urdf", "shank")
    bent = leg.configuration({"knee": 2.9})
    assert [*find_self_collisions(leg, bent)] == [("trunk", "shank")]
    (tmp_path / "urdf").mkdir()
    (tmp_path / "srdf").mkdir()
    srdf = '<robot name="three"><disable_collisions link1="shank" link2="trunk"/></robot>'
    # beside the file or in the folder srdf beside its folder, by its name or that of the robot
    for urdf in ("three.urdf", "urdf/other.urdf"):
        for place in (Path(urdf).with_suffix(".srdf"), Path("urdf/three.srdf"), "srdf/Three.srdf"):
            if urdf == "three.urdf" and place != Path("three.srdf"):
                continue
            (tmp_path / urdf).write_text(text)
            (tmp_path / place).write_text(srdf)
            again = kd.Leg.from_urdf(tmp_path / urdf, "shank")
            assert find_self_collisions(again, bent) == {}
            (tmp_path / place).unlink()
            again = kd.Leg.from_urdf(tmp_path / urdf, "shank")
            assert find_self_collisions(again, bent) != {}


def test_a_faulty_srdf_is_refused_before_a_kick_is_planned(tmp_path, monkeypatch):
    (tmp_path / "leg_human.urdf").write_text(shipped_urdf("leg_human.urdf").read_text())
    leg = kd.Leg.from_urdf(tmp_path / "leg_human.urdf", "toe")
    (tmp_path / "leg_human.srdf").write_text("<robot")
    monkeypatch.setattr("kickdyn.planning.kick.kick_problem", None)  # nothing is computed
    with pytest.raises(kd.InvalidInput, match=r"leg_human\.srdf"):
        kd.plan_kick(leg, kd.Goal(15, time=1), kd.Ball())


def test_a_flat_hull_is_a_body(tmp_path):
    """coal ends the process for hulls without thickness."""
    leg = legs(tmp_path, "box", "0.1 0.04 1e-9")
    posture = leg.posture(leg.configuration())
    assert len(bodies_at(leg, "right")) == 1
    centre = np.array([0.0, -0.1, 0.6 + 0.08])
    depths = find_ball_overlaps(posture, centre, 0.1)
    assert depths == pytest.approx({"right": 0.02}, abs=1e-4)


def test_the_nearest_point_of_a_body_and_its_normal(tmp_path):
    leg = legs(tmp_path, "box", "0.1 0.04 0.3")
    space, q = leg.workspace, leg.configuration()
    placed = Placed(leg, body_frames(leg), space.model, space.data, q)
    (body,) = bodies_at(leg, "right")
    for ahead in (0.15, 0.35):
        ball = placed.place_ball(np.array([ahead, -0.1, 0.6]), 0.1)
        contact = placed.proximity(body, ball)
        assert contact.depth == pytest.approx(0.2 - ahead, abs=1e-6)
        assert contact.normal == pytest.approx([1, 0, 0], abs=1e-6)
        assert contact.point[0] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(
    ("second", "place", "size", "counts"),
    [
        ("1 0 0", "0 0 0", "0.3 0.3 0.1", False),  # axes that cross, bodies around the crossing
        ("1 0 0", "0 0 -0.02", "0.3 0.3 0.1", True),  # axes 2 cm apart
        ("0 1 0", "0 0 0", "0.3 0.3 0.1", True),  # parallel axes
        ("1 0 0", "0 0 0", "0.01 0.01 0.01", True),  # a shape that is far from the crossing
    ],
)
def test_bodies_on_both_sides_of_axes_that_meet_do_not_count(tmp_path, second, place, size, counts):
    """Of an ankle whose roll and pitch axes cross, foot and shank are forks."""
    xyz = "0 0.3 -0.12" if size == "0.01 0.01 0.01" else "0 0 -0.12"
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
    inertial += 'izz="1"/></inertial>'
    visual = '<visual><origin xyz="{}"/><geometry><box size="{}"/></geometry></visual>'
    text = f'<robot name="ankle"><link name="shank">{inertial}'
    text += visual.format("0 0 0.15", "0.1 0.9 0.2") + f'</link><link name="cross">{inertial}'
    text += f'</link><link name="foot">{inertial}{visual.format(xyz, size)}</link>'
    joint = '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin '
    joint += 'xyz="{3}"/><axis xyz="{4}"/><limit lower="-3" upper="3" effort="1" velocity="1"/>'
    text += joint.format("pitch", "root", "shank", "0 0 0", "1 0 0") + "</joint>"
    text += joint.format("first", "shank", "cross", "0 0 0", "0 1 0") + "</joint>"
    text += joint.format("roll", "cross", "foot", place, second) + "</joint>"
    (tmp_path / "ankle.urdf").write_text(f'{text}<link name="root"/></robot>')
    leg = kd.Leg.from_urdf(tmp_path / "ankle.urdf", "foot", drives=False)
    turned = leg.configuration({"first": 3.0})
    expected = [("shank", "foot")] if counts else []
    assert [*find_self_collisions(leg, turned)] == expected
