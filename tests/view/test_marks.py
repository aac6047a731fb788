"""Marks around a kick: where they are, what they point at, how large they are."""

import numpy as np
import pytest
import trimesh
from drawn_scene import SINGLE, DrawnScene, packed_array
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


def test_a_ball_is_a_sphere_with_twelve_dark_panels():
    scene = drawn(marks.draw_ball, 0.11, np.array([1.0, 2.0, 3.0]))
    dark, bright = (scene.mesh(f"x/{name}") for name in ("pentagons", "hexagons"))
    whole = trimesh.Trimesh(dark.vertices, np.vstack([dark.faces, bright.faces]), process=False)
    assert whole.is_watertight
    assert whole.volume == pytest.approx(4 / 3 * np.pi * 0.11**3, rel=0.01)
    agrees(np.linalg.norm(whole.vertices - (1, 2, 3), axis=1), np.full(len(whole.vertices), 0.11),
           10 * SINGLE)  # fmt: skip
    assert len(trimesh.graph.connected_components(dark.face_adjacency)) == 12
