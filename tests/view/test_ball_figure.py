import numpy as np
import pytest
import umsgpack

from kickdyn.view.ball_figure import draw_ball
from kickdyn.view.recorder import recorder


def panels(radius):
    viewer = recorder()
    draw_ball(viewer, radius)
    for packed in viewer.window.commands():
        said = umsgpack.unpackb(packed)
        data = said["object"]["geometries"][0]["data"]
        vertices = np.frombuffer(data["attributes"]["position"]["array"].data, dtype=np.float32)
        faces = np.frombuffer(data["index"]["array"].data, dtype=np.uint32)
        yield said["path"], vertices.reshape(-1, 3).astype(float), faces.reshape(-1, 3)


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


def test_twelve_pentagons_and_twenty_hexagons():
    counts = {path: len(faces) for path, _, faces in panels(1.0)}
    assert counts == {"/meshcat/hexagons": 20 * 6 * 16, "/meshcat/pentagons": 12 * 5 * 16}
