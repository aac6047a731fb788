"""Depths under the ground and of points in bodies, against shapes whose depths are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import kickdyn as kd
from kickdyn.robot.ground_clearance import TOLERANCE, Spheres, find_depths

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
    ((frame, depth, number),) = find_depths(leg, [np.zeros(1)], -0.3)[:1] or [("body", 0.0, 0)]
    assert (frame, number) == ("body", 0)
    assert depth == pytest.approx(low, abs=1e-9)
    assert find_depths(leg, [np.zeros(1)], -0.3 - low - 0.5 * TOLERANCE) == []


def test_the_deepest_configuration_counts_and_the_deepest_body_comes_first(tmp_path):
    leg = leg_of(tmp_path, '<sphere radius="0.1"/>')
    motion = [np.array([angle]) for angle in (1.0, 0.2, -0.1, 0.4)]
    (found,) = find_depths(leg, motion, -0.35)
    assert found.number == 2
    assert found.depth == pytest.approx(0.3 * np.cos(0.1) + 0.1 - 0.35)
    feet = find_depths(G1, [G1.configuration()], -0.76)
    assert {one.frame for one in feet[:2]} == {"left_ankle_roll_link", "right_ankle_roll_link"}
    assert [one.depth for one in feet] == sorted((one.depth for one in feet), reverse=True)


def test_a_leg_without_shapes_is_its_frames():
    leg = kd.Leg.from_model(kd.Leg.human().model, "toe")
    toe = leg.posture(leg.configuration()).contact_point
    (found,) = [
        one for one in find_depths(leg, [leg.configuration()], toe[2] + 0.01) if one.frame == "toe"
    ]
    assert found.depth == pytest.approx(0.01)


corner = st.tuples(*[st.floats(-1, 1)] * 3)


@given(st.lists(corner, min_size=1, max_size=30), corner, st.floats(0, 1))
def test_no_direction_separates_a_point_from_a_body_by_more(corners, point, radius):
    """The distance is the largest by which a plane separates both; samples find no larger one."""
    centres = np.array(corners)
    depth = Spheres(centres, np.full(len(centres), radius)).depth_of(np.array(point))
    normals = np.random.default_rng(0).normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    apart = (normals @ point - (normals @ centres.T).max(axis=1)).max() - radius
    assert -depth >= apart - 1e-7
    assert -depth <= np.linalg.norm(centres - point, axis=1).min() - radius + 1e-7


@pytest.mark.parametrize("at", [(0.1, 0.2, 0.3), (0.4, 0.0, 0.0), (0.5, 0.5, 0.5)])
def test_the_depth_in_a_box_is_the_way_to_its_nearest_face(at):
    box = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
    hull = box[ConvexHull(box).vertices]
    depth = Spheres(hull, np.zeros(8)).depth_of(np.array(at))
    assert depth == pytest.approx(0.5 - max(at), abs=1e-12)
    out = Spheres(hull, np.zeros(8)).depth_of(np.array(at) + 1.0)
    assert out == pytest.approx(-math.dist(np.array(at) + 1.0, (0.5, 0.5, 0.5)), abs=1e-9)


def test_coal_gives_the_same_depth_of_a_point():
    coal, draw = pytest.importorskip("coal"), np.random.default_rng(0)
    centres, still = draw.uniform(-1.0, 1.0, (30, 3)), coal.Transform3s()
    corners = coal.StdVec_Vec3s()
    corners.extend(list(centres))
    hull, body = coal.ConvexBase.convexHull(corners, True, "Qt"), Spheres(centres, np.full(30, 0.1))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for point in draw.uniform(-2.0, 2.0, (50, 3)):
        result.clear()
        pose = coal.Transform3s(np.eye(3), point)
        distance = coal.distance(hull, still, coal.Sphere(0.1), pose, request, result)
        assert body.depth_of(point) == pytest.approx(-distance, abs=1e-9)
