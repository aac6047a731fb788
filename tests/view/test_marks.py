"""Marks around a kick: where they are, what they point at, how large they are."""

import re

import numpy as np
import pytest
from drawn_scene import SINGLE, DrawnScene
from tolerances import agrees, closed_form

from kickdyn.view import marks
from kickdyn.view.document import recording_viewer

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


@pytest.mark.parametrize(("length", "last"), [(0.0, 1), (1.9, 1), (2.2, 2), (11.0, 6), (12.0, 6)])
def test_distances_stand_where_they_say(length, last):
    start = np.array([1.0, 2.0, -3.0])
    scene = drawn(marks.draw_distances, start, Y, 2.0, length)
    shown = re.findall(r'data-node="/meshcat/(x/\d+)">([\d.]+) m<', scene.labels)
    assert {float(text) for _, text in shown} == {2.0 * k for k in range(last + 1)}
    for node, text in shown:
        agrees(scene.point(node), start + float(text) * Y, closed_form())


def test_axes_are_those_of_the_world_with_the_length_that_they_say():
    scene = drawn(marks.draw_axes, np.array([1.0, 2.0, 3.0]), 0.5)
    for name, axis in zip("xyz", np.eye(3), strict=True):
        start, vector = scene.arrow(f"x/{name}")
        agrees(start, (1, 2, 3), closed_form())
        agrees(vector, 0.5 * axis, closed_form())
    assert ">x (0.5 m)<" in scene.labels


def test_dots_are_round_their_points_and_a_tee_reaches_from_the_ground_to_the_ball():
    points = np.array([(0.0, 0.0, 1.0), (5.0, 2.0, 3.0)])
    vertices = drawn(marks.draw_dots, points, 0.1, 0).vertices("x").reshape(2, 12, 3)
    agrees(vertices.mean(axis=1), points, SINGLE)
    assert np.linalg.norm(vertices - points[:, None], axis=2) == pytest.approx(0.1, rel=10 * SINGLE)
    scene = drawn(marks.draw_tee, np.array([1.0, 2.0, 0.5]), 0.3, 0.11)
    half = scene.shape("x")["height"] / 2
    for end, z in ((-half, 0.2), (half, 0.5)):
        agrees((scene.pose("x") @ (0, end, 0, 1))[:3], (1.0, 2.0, z), closed_form())
