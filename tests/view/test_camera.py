"""The camera sees all that is drawn, beside the caption; sizes that follow from the picture."""

import numpy as np
import pytest
from drawn_scene import DrawnScene, in_the_picture
from tolerances import agrees, closed_form

from kickdyn.view import camera as cameras
from kickdyn.view.camera import BOTTOM, LEFT, RIGHT, TOP, camera_for, set_stage
from kickdyn.view.document import recording_viewer

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
    away, around = camera.distance(points), np.linalg.norm(points - camera.target, axis=1)
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
    assert cameras.stripe_width(extent) == pytest.approx(width)
