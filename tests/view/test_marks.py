import re

import numpy as np
import pytest
import umsgpack

from kickdyn.view import marks
from kickdyn.view.document import recording_viewer


def drawn(draw, *args):
    """Draw into a fresh viewer; return the positions of all triangular meshes, and all said."""
    viewer = recording_viewer()
    draw(viewer["x"], *args)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
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
    way = np.array([0.6, 0.0, 0.8])
    _, said = drawn(marks.draw_arrow, 2.0 * way, marks.ARROW)
    shaft, head = (place_of(said, f"/meshcat/x/{name}") for name in ("shaft", "head"))
    sizes = [c["object"]["geometries"][0] for c in said if c["type"] == "set_object"]
    for place in (shaft, head):
        np.testing.assert_allclose(place[:3, 1], way, atol=1e-15)
    ends = []
    for place, size in ((shaft, sizes[0]), (head, sizes[1])):
        middle = place[:3, 3] @ way
        ends += [middle - size["height"] / 2, middle + size["height"] / 2]
    np.testing.assert_allclose(ends, [0, 1.44, 1.44, 2])
    assert sizes[1]["radiusTop"] == 0 < sizes[1]["radiusBottom"]


def test_the_ground_is_level_and_turned_to_the_flight():
    forward = np.array([0.0, 1.0, 0.0])
    (lawn, shaded), said = drawn(marks.draw_ground, np.array([1.0, 2.0, -3.0]), forward, 0.5, 10.0)
    np.testing.assert_array_equal(lawn, shaded)  # else they would cover each other in patches
    vertices = lawn
    place = place_of(said, "/meshcat/x")
    np.testing.assert_allclose(place[:3, 0], forward)
    np.testing.assert_allclose(place[:3, 2], (0, 0, 1))
    np.testing.assert_allclose(place[:3, 3], (1, 2, -3))
    assert not vertices[:, 2].any()
    near = vertices[np.abs(vertices).max(axis=1) < 9.7, 0]  # the seam is at 9.8
    np.testing.assert_allclose(np.unique(near), 0.5 * np.arange(-19, 20))


@pytest.mark.parametrize(
    ("length", "last"), [(0.0, 1), (1.9, 1), (2.05, 1), (2.2, 2), (11.0, 6), (12.0, 6)]
)
def test_marks_stand_along_the_flight_at_their_distances(length, last):
    start, forward = np.array([1.0, 2.0, -3.0]), np.array([0.0, 1.0, 0.0])
    viewer = recording_viewer()
    marks.draw_distances(viewer["x"], start, forward, 2.0, length)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    texts = [re.sub("<.*?>", "", label) for label in viewer.window.labels]
    assert texts == [f"{2 * k} m" for k in (0, last, *range(1, last))]  # as they are placed
    line = place_of(said, "/meshcat/x")
    for k in range(last + 1):
        point = line @ place_of(said, f"/meshcat/x/{k}")[:, 3]
        assert (point[:3] - start) @ forward == pytest.approx(2 * k)
        assert point[2] == pytest.approx(-3.0)


def test_axes_are_those_of_the_world():
    origin = np.array([1.0, 2.0, 3.0])
    viewer = recording_viewer()
    marks.draw_axes(viewer["x"], origin, 0.5)
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    np.testing.assert_allclose(place_of(said, "/meshcat/x")[:3, 3], origin)
    for name, axis in zip("xyz", np.eye(3), strict=True):
        np.testing.assert_allclose(
            place_of(said, f"/meshcat/x/{name}/head")[:3, 1], axis, atol=1e-15
        )
    texts = [re.sub("<.*?>", "", label) for label in viewer.window.labels]
    assert texts == ["x (0.5 m)", "y", "z"]


@pytest.mark.parametrize("end", [(1, 0, 0), (0, -2, 0), (0, 0, 1e-9), (3, 4, -5)])
def test_cylinder_pose_lays_the_y_axis_from_start_to_end(end):
    start = np.array([1.0, 2.0, 3.0])
    pose = marks.cylinder_pose(start, start + end)
    turn = pose[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1)
    np.testing.assert_allclose(turn[:, 1], np.array(end) / np.linalg.norm(end), atol=1e-6)
    np.testing.assert_allclose(pose[:3, 3], start + np.array(end) / 2)


def test_upright_turns_y_to_z():
    np.testing.assert_allclose(marks.UPRIGHT[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-15)


def panels(radius):
    viewer = recording_viewer()
    marks.draw_ball(viewer, radius, np.zeros(3))
    for packed in viewer.window.commands[:2]:
        command = umsgpack.unpackb(packed)
        data = command["object"]["geometries"][0]["data"]
        vertices = np.frombuffer(data["attributes"]["position"]["array"].data, dtype=np.float32)
        faces = np.frombuffer(data["index"]["array"].data, dtype=np.uint32)
        yield command["path"], vertices.reshape(-1, 3).astype(float), faces.reshape(-1, 3)


def test_the_panels_cover_the_sphere_once():
    # Each triangle spans a solid angle (Van Oosterom & Strackee 1983); all of them, 4 pi.
    total = 0.0
    for _, vertices, faces in panels(0.11):
        np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 0.11, rtol=1e-6)
        a, b, c = np.moveaxis(vertices[faces] / 0.11, 1, 0)
        volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
        edges = 1 + sum(np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
        total += 2 * np.arctan2(volume, edges).sum()
    assert total == pytest.approx(4 * np.pi, rel=1e-6)


def test_the_dark_panels_are_round_the_twelve_corners_of_an_icosahedron():
    dark, bright = ({tuple(row) for row in faces} for _, _, faces in panels(1.0))
    counts = {path: len(faces) for path, _, faces in panels(1.0)}
    assert set(counts) == {"/meshcat/hexagons", "/meshcat/pentagons"}
    assert counts["/meshcat/pentagons"] % 12 == 0
    assert 0.2 < counts["/meshcat/pentagons"] / sum(counts.values()) < 0.4
    assert not dark & bright
