"""The ball among the geoms of an MJCF file: on the foot, beside it, and inside other geoms."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.simulators.mujoco_placement import find_foot, placement_warnings

pytest.importorskip("mujoco")

ROBOT = """<mujoco model="leg">
  <default><geom density="500"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1" pos="0 0 {floor}"/>
    <body name="thigh" pos="0 0 1">
      <joint name="hip" axis="0 -1 0"/>
      <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.7"/>
      <body name="foot" pos="0 0 -0.8">
        <joint name="rail" type="slide" axis="0 0 1" ref="0.1"/>
        <geom name="shoe" type="sphere" size="0.1"/>
      </body>
    </body>
    <body name="post" pos="{post} 0 0.2"><geom type="box" size="0.02 0.02 0.1"/></body>
  </worldbody>
</mujoco>
"""
RADIUS = 0.11


def warnings(folder, offset=(0.1, 0, 0), floor=0.0, post=2.0, normal=(1, 0, 0), angles=None):
    file = folder / "robot.xml"
    file.write_text(ROBOT.format(floor=floor, post=post))
    leg = kd.Leg.from_mjcf(file, "foot")
    q = leg.configuration({"rail": 0.1} if angles is None else angles)
    posture = leg.posture(q).with_contact_offset(offset)
    normal = np.array(normal, float)
    centre = posture.contact_point + RADIUS * normal
    return placement_warnings(posture, normal, centre, RADIUS)


def test_a_ball_on_the_foot_is_all_right(tmp_path):
    assert warnings(tmp_path) == ()
    turned = {"hip": 0.3, "rail": 0.05}
    assert (
        warnings(tmp_path, offset=(0.1 * np.cos(0.3), 0, -0.1 * np.sin(0.3)), angles=turned) == ()
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"offset": (0.07, 0, 0)}, "ball's surface is 30 mm inside 'shoe' of 'foot'"),
        ({"offset": (0.13, 0, 0)}, "ball's surface is 30 mm outside 'shoe' of 'foot'"),
        ({"floor": 0.15}, "the ball is 60 mm inside 'floor' of 'world'"),
        ({"post": 0.3}, "the ball is 40 mm inside geom 3 of 'post'"),
    ],
)
def test_the_distance_is_said(tmp_path, given, said):
    (line,) = warnings(tmp_path, **given)
    assert said in line


def test_the_ball_lies_under_the_floor_where_a_ref_is_forgotten(tmp_path):
    (line,) = warnings(tmp_path, angles={}, floor=0.05)
    assert "inside 'floor'" in line


def test_a_ball_that_the_file_has_already_is_left_out(tmp_path, monkeypatch):
    ball = '<body name="ball" pos="0.2 0 0.2"><freejoint/><geom size="0.1"/></body></worldbody>'
    monkeypatch.setitem(globals(), "ROBOT", ROBOT.replace("</worldbody>", ball))
    assert warnings(tmp_path) == ()


def test_another_normal_is_said(tmp_path):
    """The ball touches the sphere beside the contact point."""
    up = np.array([0.6, 0, 0.8])
    touching = (np.array([0.21, 0, 0]) - RADIUS * up).tolist()
    (line,) = warnings(tmp_path, offset=touching, normal=up)
    assert "normal is 53 deg from that of the contact" in line


def test_other_legs_have_no_geoms():
    posture = kd.Leg.human().posture([0, 0, 0])
    assert placement_warnings(posture, np.array([1.0, 0, 0]), np.zeros(3), 0.11) == ()


@pytest.mark.parametrize("frame", ["toe", "foot", "shoe"])
def test_the_geom_of_a_frame_is_found(tmp_path, frame):
    file = tmp_path / "robot.xml"
    text = ROBOT.format(floor=0.0, post=2.0)
    file.write_text(text.replace('<geom name="shoe"', '<site name="toe"/><geom name="shoe"'))
    assert find_foot(kd.Leg.from_mjcf(file, frame)) == ("shoe",)
    assert find_foot(kd.Leg.human()) == ()
