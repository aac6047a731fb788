import numpy as np
import pytest
import umsgpack

from kickdyn.view import marks
from kickdyn.view.recorder import recorder


def drawn(draw, *args):
    """Draw into a fresh viewer; return the positions of all triangular meshes, and all said."""
    viewer = recorder()
    draw(viewer["x"], *args)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands()]
    meshes = []
    for command in said:
        for geometry in command.get("object", {}).get("geometries", ()):
            if geometry["type"] == "BufferGeometry":
                raw = geometry["data"]["attributes"]["position"]["array"].data
                meshes.append(np.frombuffer(raw, dtype=np.float32).reshape(-1, 3))
    return meshes, said


def place_of(said, path):
    (found,) = (c["matrix"] for c in said if c["type"] == "set_transform" and c["path"] == path)
    return np.reshape(found, (4, 4)).T


def test_the_curve_keeps_its_thickness():
    t = np.linspace(0, 1, 40)
    points = np.stack([t, 0 * t, t * (1 - t)], axis=1)
    radii = 0.01 + 0.02 * t
    ((vertices,), _) = drawn(marks.draw_curve, points, radii, np.array([0.0, -1.0, 0.0]))
    rings = vertices.reshape(40, marks.SIDES, 3)
    np.testing.assert_allclose(rings.mean(axis=1), points, atol=1e-7)
    away = np.linalg.norm(rings - points[:, None], axis=-1)
    np.testing.assert_allclose(away, np.broadcast_to(radii[:, None], away.shape), rtol=1e-5)


@pytest.mark.parametrize("points", [np.ones((5, 3)), np.ones((5, 3)) + 1e-17])
def test_no_flight_no_curve(points):
    meshes, said = drawn(marks.draw_curve, points, np.ones(5), np.array([0.0, -1.0, 0.0]))
    assert meshes == said == []


def test_the_arrow_starts_at_the_contact_and_points_along_the_impulse():
    start, way = np.array([1.0, 2.0, 3.0]), np.array([0.6, 0.0, 0.8])
    _, said = drawn(marks.draw_arrow, start, way, 2.0)
    np.testing.assert_allclose(place_of(said, "/meshcat/x")[:3, 3], start)
    shaft, head = (place_of(said, f"/meshcat/x/{name}") for name in ("shaft", "head"))
    sizes = [c["object"]["geometries"][0] for c in said if c["type"] == "set_object"]
    for place in (shaft, head):
        np.testing.assert_allclose(place[:3, 1], way)
    ends = []
    for place, size in ((shaft, sizes[0]), (head, sizes[1])):
        middle = place[:3, 3] @ way
        ends += [middle - size["height"] / 2, middle + size["height"] / 2]
    np.testing.assert_allclose(ends, [0, 1.44, 1.44, 2])
    assert sizes[1]["radiusTop"] == 0 < sizes[1]["radiusBottom"]


def test_the_ground_is_level_and_turned_to_the_flight():
    forward = np.array([0.0, 1.0, 0.0])
    ((vertices,), said) = drawn(marks.draw_ground, np.array([1.0, 2.0, -3.0]), forward, 0.5, 10.0)
    place = place_of(said, "/meshcat/x")
    np.testing.assert_allclose(place[:3, 0], forward)
    np.testing.assert_allclose(place[:3, 2], (0, 0, 1))
    np.testing.assert_allclose(place[:3, 3], (1, 2, -3))
    assert not vertices[:, 2].any()
    near = vertices[np.abs(vertices).max(axis=1) < 9.7, 0]  # the seam is at 9.8
    np.testing.assert_allclose(np.unique(near), 0.5 * np.arange(-19, 20))
