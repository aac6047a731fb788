"""Marks around a kick, walls and goals: where they are, and how large."""

import math

import numpy as np
import pytest
from drawn_scene import SINGLE, DrawnScene, in_the_picture, packed_array
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.view import marks
from kickdyn.view.document import recording_viewer
from kickdyn.view.marks import BOTTOM, LEFT, RIGHT, TOP, camera_for, set_stage
from kickdyn.view.wall_and_goal import goal_boxes, plane_boxes, wall_boxes

Y = np.array([0.0, 1.0, 0.0])


def drawn(draw, *args):
    viewer = recording_viewer()
    draw(viewer["x"], *args)
    return DrawnScene(viewer)


def test_a_curve_keeps_its_thickness():
    t = np.linspace(0, 1, 40)
    points, radii = np.stack([t, 0 * t, t * (1 - t)], axis=1), 0.01 + 0.02 * t
    scene = drawn(marks.draw_curve, points, radii, -Y)
    agrees(scene.curve("x"), points, SINGLE)
    away = scene.vertices("x").reshape(40, 8, 3) - points[:, None]
    agrees(np.linalg.norm(away, axis=2), np.tile(radii[:, None], 8), 10 * SINGLE)
    across = np.einsum("nsi,ni->ns", away[:-1], np.diff(points, axis=0))
    np.testing.assert_allclose(across, 0, atol=1e-8)
    tube = scene.mesh("x")  # of eight sides, closed but for its ends, with normals outwards
    counts = np.bincount(tube.edges_unique_inverse)
    assert ((counts == 1).sum(), (counts == 2).sum()) == (16, len(counts) - 16)
    outwards = tube.triangles_center - points[tube.faces // 8].mean(axis=1)
    reach = np.einsum("ni,ni->n", tube.face_normals, outwards) / radii[tube.faces // 8].mean(axis=1)
    np.testing.assert_allclose(reach, np.cos(np.pi / 8), rtol=0.01)
    assert drawn(marks.draw_curve, np.ones((5, 3)), np.ones(5), -Y).commands == []


@pytest.mark.parametrize("vector", [(1.2, 0.0, 1.6), (0, -2, 0), (0, 2, 0), (-1e-3, 2e-3, 0)])
def test_an_arrow_has_the_direction_and_length_of_its_vector(vector):
    start, arrow = drawn(marks.draw_arrow, np.array(vector), marks.ARROW).arrow("x")
    np.testing.assert_allclose(start, 0, atol=closed_form(10))
    agrees(arrow, vector, closed_form())


def test_the_ground_is_level_with_stripes_across_the_flight():
    scene = drawn(marks.draw_ground, np.array([1.0, 2.0, -3.0]), Y, 0.5, 10.0)
    vertices = scene.vertices("x") - (1, 2, -3)
    assert np.linalg.det(scene.pose("x")) == pytest.approx(1.0)
    assert not vertices[:, 2].any()
    near = vertices[np.abs(vertices).max(axis=1) < 9.7, 1]
    agrees(np.unique(near.round(5)), 0.5 * np.arange(-19, 20), SINGLE)
    lawn = scene.mesh("x")
    assert (lawn.face_normals == (0, 0, 1)).all()
    assert lawn.area == pytest.approx((2 * 100 * 10.0) ** 2)
    light, deep = (np.array(list(colour.to_bytes(3))) / 255 for colour in marks.GRASS)
    colours = packed_array(scene.shape("x")["data"]["attributes"]["color"])
    dark = np.repeat(vertices[:, 1].reshape(-1, 4).mean(axis=1) % 1.0 > 0.5, 4)
    fade = np.clip(1.0 - np.hypot(*vertices[:, :2].T) / 10.0, 0.0, 1.0)
    agrees(colours, light + (dark * fade)[:, None] * (deep - light), 10 * SINGLE)


def test_axes_are_those_of_the_world_with_the_length_that_they_say():
    scene = drawn(marks.draw_axes, np.array([1.0, 2.0, 3.0]), 0.5)
    for name, axis in zip("xyz", np.eye(3), strict=True):
        start, vector = scene.arrow(f"x/{name}")
        agrees(start, (1, 2, 3), closed_form())
        agrees(vector, 0.5 * axis, closed_form())
    assert ">x (0.5 m)<" in scene.labels


LEG = np.array([(x, y, z) for x in (-0.1, 0.3) for y in (-0.1, 0.1) for z in (-0.9, 0.1)])
X = np.array([1.0, 0.0, 0.0])


def parabola(distance, height, way=X):
    t = np.linspace(0, 1, 50)[:, None]
    return t * distance * way + 4 * height * t * (1 - t) * (0, 0, 1) + (0.2, 0, -0.8)


def staged(camera, points):
    viewer = recording_viewer()
    set_stage(viewer, camera, points)
    return DrawnScene(viewer)


def seen(camera, points):
    """Return slopes of points as the page shows them."""
    scene = staged(camera, points)
    agrees(scene.camera(), camera, closed_form())
    return scene.slopes(points)


@pytest.mark.parametrize("distance", [0.0, 0.1, 1.0, 6.0, 40.0, 85.0])
@pytest.mark.parametrize("way", [X, -X, np.array([0.6, 0.8, 0.0])], ids=str)
def test_all_is_in_the_picture_as_near_as_possible(distance, way):
    """Points touch two edges that face each other, and the leg fills a quarter of the height."""
    curve = parabola(distance, distance / 6, way)
    camera = camera_for(LEG, curve, way)
    slopes = seen(camera, np.vstack([LEG, curve]))
    in_the_picture(slopes)
    (right, up), (left, down) = slopes.max(axis=0), slopes.min(axis=0)
    gaps = max(RIGHT - right, left + LEFT), max(TOP - up, down + BOTTOM)
    assert min(gaps) == pytest.approx(0.0, abs=closed_form(1e4))
    assert np.ptp(seen(camera, LEG)[:, 1]) > 0.25 * (TOP + BOTTOM)
    assert camera.position[2] > -0.9


@pytest.mark.parametrize("distance", [0.0, 40.0])
def test_lens_and_light_include_all_points(distance):
    """Shadows are framed by the distance of the farthest point from the middle."""
    points = np.vstack([LEG, parabola(distance, distance / 6)])
    camera = camera_for(LEG, points, X)
    stage = staged(camera, points).properties
    lens, sun = "Cameras/default/rotated/<object>", "Lights/FillLight/<object>"
    away = camera.curve_width(points) / marks.CURVE_RADIUS
    around = np.linalg.norm(points - camera.target, axis=1)
    assert stage[lens, "near"] < away.min() < away.max() < stage[lens, "far"]
    assert stage[sun, "reach"] == pytest.approx(around.max())
    assert np.linalg.norm(stage[sun, "position"]) > around.max()  # outside
    assert (stage[lens, "fov"], stage[sun, "position"][2] > 0) == (44.0, True)


def test_a_short_kick_goes_to_the_right_and_a_wall_is_seen_from_behind():
    """At all sizes of the world."""
    curve = parabola(6.0, 1.0)
    beside, behind = camera_for(LEG, curve, X), camera_for(LEG, curve, X, behind=True)
    assert (np.diff(seen(beside, curve)[:, 0]) > 0).all()
    along = [(c.target - c.position)[:2] / np.hypot(*(c.target - c.position)[:2])
             for c in (beside, behind)]  # fmt: skip
    assert along[0][0] < 0.6 < 0.95 < along[1][0]
    large = camera_for(1000 * LEG, 1000 * curve, X)
    agrees(large.position, 1000 * beside.position, closed_form(100))


@pytest.mark.parametrize(("extent", "width"), [
    (6, 1), (11.9, 1), (12, 2), (30, 5), (59, 5), (0.6, 0.1)])  # fmt: skip
def test_stripes_are_round_numbers_of_a_sixth_or_less(extent, width):
    assert marks.stripe_width(extent) == pytest.approx(width)


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
