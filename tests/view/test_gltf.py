"""A page as glTF: the same bodies in the same places."""

import io

import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.view.gltf import Y_UP
from kickdyn.view.kick_scene import impulse_arrows


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    posture = kd.Leg.human().posture(np.radians([40, 30, -20]))
    contact = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
    impact = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), contact)
    file = tmp_path_factory.mktemp("gltf") / "kick.glb"
    kd.page(impact, kd.fly(impact.ball_after, kd.Ball(), kd.Air())).save(file)
    return impact, trimesh.load(io.BytesIO(file.read_bytes()), file_type="glb")


def placed(scene, start):
    """Return the vertices of the nodes whose names begin so, in the axes of the world."""
    nodes = [name for name in scene.graph.nodes_geometry if name.startswith(start)]
    assert nodes, start
    vertices = [
        trimesh.transform_points(scene.geometry[geometry].vertices, Y_UP.T @ pose)
        for pose, geometry in map(scene.graph.get, nodes)
    ]
    return np.vstack(vertices)


def test_the_ball_is_where_it_is_struck(scene):
    impact, drawn = scene
    ball = placed(drawn, "ball")
    distance = np.linalg.norm(ball - impact.ball_before.position, axis=1)
    np.testing.assert_allclose(distance, impact.ball.radius, rtol=1e-5)


def test_arrows_start_at_their_points_and_point_along_the_impulse(scene):
    impact, drawn = scene
    for arrow in impulse_arrows(impact, 0.05 * np.linalg.norm(impact.impulse)):
        name = arrow.node.replace("/", "_")
        shaft = placed(drawn, f"{name}_shaft") - arrow.start
        head = placed(drawn, f"{name}_head") - arrow.start
        along = arrow.impulse / arrow.size
        assert (shaft @ along).min() == pytest.approx(0.0, abs=1e-6)
        tip = head[np.argmax(head @ along)]
        np.testing.assert_allclose(tip, (tip @ along) * along, atol=1e-6)
        assert (head @ along).min() == pytest.approx((shaft @ along).max(), abs=1e-6)


def test_the_flight_ends_where_the_ball_lands_and_no_backdrop_is_left(scene):
    impact, drawn = scene
    landing = kd.fly(impact.ball_after, kd.Ball(), kd.Air()).landing.position
    curve = placed(drawn, "curve")
    assert np.linalg.norm(curve - landing, axis=1).min() < 0.1
    assert np.abs(drawn.bounds).max() < 100
    glass = [
        drawn.geometry[name].visual.material for name in drawn.geometry if name.startswith("arrow")
    ]
    assert {tuple(material.baseColorFactor[:3]) for material in glass} == {(0x24, 0x56, 0xD6)}
