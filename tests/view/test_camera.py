import math

import numpy as np
import pytest
import umsgpack

from kickdyn.view.camera import FIELD_OF_VIEW, camera_for, set_stage, stripe_width
from kickdyn.view.document import recording_viewer

LEG = np.array([(x, y, z) for x in (-0.1, 0.3) for y in (-0.1, 0.1) for z in (-0.9, 0.1)])
X = np.array([1.0, 0.0, 0.0])


def parabola(distance, height, way=X):
    t = np.linspace(0, 1, 50)[:, None]
    return t * distance * way + 4 * height * t * (1 - t) * (0, 0, 1) + (0.2, 0, -0.8)


def seen(camera, points):
    """Where points are in the picture: right and up, each +-1 at the edges of 16:9."""
    into = camera.target - camera.position
    into /= np.linalg.norm(into)
    right = np.cross(into, (0, 0, 1))
    right /= np.linalg.norm(right)
    up = np.cross(right, into)
    away = points - camera.position
    depth = away @ into
    assert (depth > 0).all()
    half = math.tan(math.radians(FIELD_OF_VIEW / 2))
    return np.stack([away @ right / depth / half * 9 / 16, away @ up / depth / half], axis=1)


@pytest.mark.parametrize("distance", [0.0, 0.1, 1.0, 6.0, 40.0, 85.0])
@pytest.mark.parametrize("way", [X, -X, np.array([0.6, 0.8, 0.0])])
def test_all_is_in_the_picture_and_the_leg_is_large(distance, way):
    curve = parabola(distance, distance / 6, way)
    camera = camera_for(LEG, curve, way)
    picture = seen(camera, np.vstack([LEG, curve]))
    assert (np.abs(picture) <= 1).all()
    assert (picture[:, 0] > 2 * 350 / 1280 - 1).all()  # beside the caption
    assert np.ptp(seen(camera, LEG)[:, 1]) / 2 > 0.25
    assert camera.position[2] > -0.9


def test_a_short_kick_goes_to_the_right():
    curve = parabola(1.0, 0.2)
    across = seen(camera_for(LEG, curve, X), curve)[:, 0]
    assert (np.diff(across) > 0).all()


def test_the_size_of_the_world_does_not_matter():
    small = camera_for(LEG, parabola(6, 1), X)
    large = camera_for(1000 * LEG, 1000 * parabola(6, 1), X)
    np.testing.assert_allclose(large.position, 1000 * small.position)


def test_meshcat_sees_the_same():
    camera, viewer = camera_for(LEG, parabola(6, 1), X), recording_viewer()
    set_stage(viewer, camera, LEG)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    values = {c["property"]: c["value"] for c in said
              if c["type"] == "set_property" and c["path"].startswith("/Cameras")}  # fmt: skip
    x, y, z = values["position"]  # y up
    (matrix,) = (c["matrix"] for c in said if c["type"] == "set_transform")
    shift = np.reshape(matrix, (4, 4)).T[:3, 3]
    np.testing.assert_allclose(np.array([x, -z, y]) - shift, camera.position)
    np.testing.assert_allclose(-shift, camera.target)
    assert values["fov"] == FIELD_OF_VIEW
    assert values["near"] < math.hypot(x, y, z) < values["far"]


def test_from_behind_when_asked():
    def across(camera):
        return abs((camera.target - camera.position)[1]) / np.linalg.norm(
            (camera.target - camera.position)[:2]
        )

    curve = parabola(6, 1)
    assert across(camera_for(LEG, curve, X)) > 0.8
    assert across(camera_for(LEG, curve, X, behind=True)) < 0.32


def test_marks_are_in_the_picture_and_do_not_lower_the_camera_under_the_ground():
    curve, marks = parabola(1.0, 0.2), np.array([[0.4, 0.0, -1.6], [0.9, 0.0, 0.4]])
    camera = camera_for(LEG, np.vstack([curve, marks]), X)
    assert (np.abs(seen(camera, np.vstack([LEG, curve, marks]))) <= 1).all()
    assert camera.position[2] > -0.9


@pytest.mark.parametrize("away", [-5.0, -1e3, -1e9, 1e5])
def test_whatever_stands_around_there_is_a_camera(away):
    wall = np.array([(away, y, z) for y in (-2.0, 2.0) for z in (-0.9, 1.6)])
    camera = camera_for(LEG, np.vstack([parabola(10.0, 1.0), wall]), X, behind=True)
    assert np.isfinite(camera.position).all()


@pytest.mark.parametrize(
    ("extent", "width"), [(6, 1), (11.9, 1), (12, 2), (30, 5), (59, 5), (0.6, 0.1)]
)
def test_stripes_are_round_numbers(extent, width):
    assert stripe_width(extent) == pytest.approx(width)
