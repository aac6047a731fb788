import math

import numpy as np
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view.document import recording_viewer
from kickdyn.view.wall_and_goal import GOAL, draw_box, goal_boxes, plane_boxes, wall_boxes


def test_a_wall_stands_across_the_way_on_the_ground():
    ahead = np.array([math.cos(0.2), math.sin(0.2), 0.0])
    foot = np.array([1.0, 2.0, -3.0])
    corners = np.vstack([box.corners() for box in wall_boxes(foot, ahead, 9.0, 1.9, 2.5)]) - foot
    assert corners[:, 2].min() == pytest.approx(0)
    assert corners[:, 2].max() == pytest.approx(1.9)
    left = np.array([-ahead[1], ahead[0], 0.0])
    assert corners @ ahead == pytest.approx(np.full(len(corners), 9.0), abs=0.16)
    assert np.abs(corners @ left).max() == pytest.approx(1.25, abs=0.05)


def test_a_goal_is_open_where_it_should_be():
    left, right, bar = goal_boxes(np.zeros(3), 20.0)
    assert right.corners()[:, 1].min() - left.corners()[:, 1].max() == pytest.approx(GOAL[0])
    assert bar.corners()[:, 2].min() == pytest.approx(GOAL[1])
    for side, post in ((1, left.corners()), (-1, right.corners())):  # the bar covers both posts
        assert (side * bar.corners()[:, 1]).max() == pytest.approx(np.abs(post[:, 1]).max())


def test_a_box_is_drawn_where_its_corners_are():
    box = wall_boxes(np.zeros(3), np.array([0.6, 0.8, 0.0]), 5.0, 2.0, 0.5)[0]
    viewer = recording_viewer()
    draw_box(viewer["box"], box)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    (shape,) = [c["object"]["geometries"][0] for c in said if c["type"] == "set_object"]
    assert [shape["width"], shape["height"], shape["depth"]] == box.size.tolist()
    (place,) = [c["matrix"] for c in said if c["type"] == "set_transform"]
    matrix = np.reshape(place, (4, 4)).T
    corner = matrix @ [*(box.size / 2), 1.0]
    assert corner[:3] == pytest.approx(box.corners()[-1])


def test_what_is_behind_a_wall_is_seen_through_it_and_a_goal_is_solid():
    viewer = recording_viewer()
    draw_box(viewer["wall"], wall_boxes(np.zeros(3), np.array([1.0, 0.0, 0.0]), 5.0, 2.0, 0.5)[0])
    draw_box(viewer["goal"], goal_boxes(np.zeros(3), 20.0)[0])
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    looks = [c["object"]["materials"][0] for c in said if c["type"] == "set_object"]
    assert [look["transparent"] for look in looks] == [True, False]
    assert looks[0]["opacity"] < 0.6


@pytest.mark.parametrize("part", ["centre", "back"])
def test_a_goal_line_is_a_goal_across_it(part):
    normal = np.array([-0.6, 0.8, 0.0])
    boxes = plane_boxes(kd.Plane((20, 5, 0), normal, part), np.array([19.0, 4.0, 0.3]), -0.9)
    corners = np.vstack([box.corners() for box in boxes]) - (20, 5, -0.9)
    assert np.abs(corners @ normal).max() == pytest.approx(GOAL[2] / 2)
    assert corners[:, 2].min() == pytest.approx(0)
    assert np.abs(corners @ (0.8, 0.6, 0.0)).max() == pytest.approx(GOAL[0] / 2 + GOAL[2])


@pytest.mark.parametrize("normal", [(-1, 0, 0), (-0.6, 0.8, 0), (-0.6, 0, -0.8), (0, 0.6, 0.8)])
def test_a_wall_has_its_face_in_the_plane_where_the_ball_meets_it(normal):
    plane = kd.Plane((10, 0, 0), normal)
    end = np.array([9.0, 1.0, 0.5])
    (box,) = plane_boxes(plane, end, -0.9)
    depth = (box.corners() - plane.point) @ plane.normal
    assert depth.max() == pytest.approx(0)
    assert (depth > -1e-9).sum() == 4
    face = box.corners()[depth > -1e-9]
    meet = end - plane.normal * (plane.normal @ (end - plane.point))
    assert (face.min(axis=0) <= meet + 1e-9).all()
    assert (face.max(axis=0) >= meet - 1e-9).all()
