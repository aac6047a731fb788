"""Walls and goals: corners of their boxes where the laws of the game and the plane have them."""

import math

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.view.wall_and_goal import goal_boxes, plane_boxes, wall_boxes

WIDTH, HEIGHT, POST = 7.32, 2.44, 0.12
"""Of a goal, and the thickness of its posts at most [m]: IFAB, Laws of the Game, Law 1."""


def extent(boxes, axis, origin=(0.0, 0.0, 0.0)):
    """Return the least and largest coordinate of boxes along an axis."""
    places = (np.vstack([box.corners() for box in boxes]) - origin) @ axis
    return pytest.approx((places.min(), places.max()), abs=closed_form(10))


def test_a_wall_of_players_stands_across_the_way_on_the_ground():
    ahead, foot = np.array([math.cos(0.2), math.sin(0.2), 0.0]), np.array([1.0, 2.0, -3.0])
    boxes, left = wall_boxes(foot, ahead, 9.0, 1.9, 2.5), np.array([-ahead[1], ahead[0], 0.0])
    assert len(boxes) == 5  # half a metre each
    assert extent(boxes, (0, 0, 1), foot) == (0.0, 1.9)
    assert extent(boxes, ahead, foot) == (9.0 - 0.15, 9.0 + 0.15)
    assert extent(boxes, left, foot) == (-1.25 + 0.025, 1.25 - 0.025)


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_a_goal_is_open_where_the_laws_of_the_game_have_it(heading):
    """At its distance, or in the plane of a goal line."""
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    across, foot = np.array([-ahead[1], ahead[0], 0.0]), np.array([1.0, 2.0, -0.5])
    middle = foot + 20.0 * ahead
    line = kd.Plane((*middle[:2], 0.4), -ahead, "back")
    for boxes in (goal_boxes(foot, 20.0, heading), plane_boxes(line, middle, -0.5)[1::-1] +
                  plane_boxes(line, middle, -0.5)[2:]):  # fmt: skip
        right, left, bar = boxes
        assert extent([right], across, middle) == (-WIDTH / 2 - POST, -WIDTH / 2)
        assert extent([left], across, middle) == (WIDTH / 2, WIDTH / 2 + POST)
        assert extent([right], (0, 0, 1), middle) == (0.0, HEIGHT)
        assert extent([bar], (0, 0, 1), middle) == (HEIGHT, HEIGHT + POST)
        assert extent([bar], across, middle) == (-WIDTH / 2 - POST, WIDTH / 2 + POST)
        assert extent(boxes, ahead, middle) == (-POST / 2, POST / 2)


@pytest.mark.parametrize("normal", [(-1, 0, 0), (-0.6, 0.8, 0), (-0.6, 0, -0.8), (0, 0.6, 0.8)])
@pytest.mark.parametrize("height", [0.5, 4.0])
def test_a_wall_has_its_face_in_the_plane_where_the_ball_meets_it(normal, height):
    plane, end = kd.Plane((10, 0, 0), normal), np.array([9.0, 1.0, height])
    (box,) = plane_boxes(plane, end, -0.9)
    depth = (box.corners() - plane.point) @ plane.normal
    face = box.corners()[depth > -1e-6]
    assert (len(face), depth.max()) == (4, pytest.approx(0, abs=closed_form(1e4)))
    meet = end - plane.normal * (plane.normal @ (end - plane.point))
    assert (face.min(axis=0) <= meet + closed_form(1e4)).all()
    assert (face.max(axis=0) >= meet - closed_form(1e4)).all()
    if plane.normal[2] == 0.0:
        assert face[:, 2].min() == pytest.approx(-0.9)
