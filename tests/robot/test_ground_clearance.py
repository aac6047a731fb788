"""Depths under the ground and of points in bodies, against shapes whose depths are known."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.robot.ground_clearance import (
    TOLERANCE,
    find_depths,
    shapes_of,
    sphere_directions,
)

G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)

URDF = """<robot name="arm">
<link name="base"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="body"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="body"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial>
<visual><origin xyz="0 0 -0.3" rpy="{turn} 0 0"/><geometry>{shape}</geometry></visual></link>
</robot>"""

SHAPES = {  # by shape: its lowest point below its own centre, upright and turned by 90 degrees
    '<box size="0.2 0.4 0.6"/>': (0.3, 0.2),
    '<sphere radius="0.25"/>': (0.25, 0.25),
    '<cylinder length="0.5" radius="0.1"/>': (0.25, 0.1),
    '<mesh filename="wedge.obj" scale="0.1 0.1 0.1"/>': (0.3, 0.2),
    '<mesh filename="missing.obj"/>': (0.0, 0.0),  # a point
}


def leg_of(folder, shape, turn=0.0):
    (folder / "wedge.obj").write_text(
        "v 0 0 -3\nv 1 2 1\nv -1 2 1\nv 0 -2 1\nf 1 2 3\nf 1 3 4\nf 2 3 4\nf 1 2 4\n"
    )
    file = folder / "arm.urdf"
    file.write_text(URDF.format(shape=shape, turn=turn))
    return kd.Leg.from_urdf(file, "body")


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turned", [0, 1])
def test_the_lowest_point_of_each_shape_is_known(tmp_path, shape, turned):
    leg = leg_of(tmp_path, shape, turned * np.pi / 2)
    low = SHAPES[shape][turned]
    depths = find_depths(leg, np.zeros(1), -0.3)
    assert depths.pop("body", 0.0) == pytest.approx(low, abs=1e-9)
    assert not find_depths(leg, np.zeros(1), -0.3 - low - 0.5 * TOLERANCE)


def test_the_depth_follows_the_joint_and_the_deepest_body_comes_first(tmp_path):
    leg = leg_of(tmp_path, '<sphere radius="0.1"/>')
    depths = find_depths(leg, np.array([-0.1]), -0.35)
    assert depths == {"body": pytest.approx(0.3 * np.cos(0.1) + 0.1 - 0.35)}
    feet = find_depths(G1, G1.configuration(), -0.76)
    assert set(list(feet)[:2]) == {"left_ankle_roll_link", "right_ankle_roll_link"}
    assert list(feet.values()) == sorted(feet.values(), reverse=True)


def test_a_leg_without_shapes_is_its_frames():
    leg = kd.Leg.from_model(kd.Leg.human().model, "toe")
    toe = leg.posture(leg.configuration()).contact_point
    depths = find_depths(leg, leg.configuration(), toe[2] + 0.01)
    assert depths["toe"] == pytest.approx(0.01)


def test_meshes_can_be_left_out(tmp_path):
    mesh, box = '<mesh filename="wedge.obj"/>', '<box size="0.2 0.4 0.6"/>'
    leg = leg_of(tmp_path, f"{mesh}</geometry></visual><visual><geometry>{box}")
    assert [len(shape.centres) for shape in shapes_of(leg, "body")] == [4, 8]
    (corners,) = shapes_of(leg, "body", meshes=False)
    assert np.abs(corners.centres) == pytest.approx(np.tile([0.1, 0.2, 0.3], (8, 1)))


def test_directions_are_spread_over_the_whole_sphere():
    """No two are nearer than 8 degrees, and none of all others is 8 degrees from its nearest."""
    directions = sphere_directions()
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(len(directions)))
    cosines = directions @ directions.T - 2.0 * np.eye(len(directions))
    assert np.degrees(np.arccos(cosines.max())) > 8.0
    others = np.random.default_rng(0).normal(size=(2000, 3))
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    assert np.degrees(np.arccos((others @ directions.T).max(axis=1).min())) < 8.0
