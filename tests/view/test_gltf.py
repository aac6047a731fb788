"""A page as glTF: the same bodies in the same places."""

import io
import json
import struct

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
    return impact, trimesh.load(io.BytesIO(file.read_bytes()), file_type="glb"), file.read_bytes()


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
    impact, drawn, _ = scene
    ball = placed(drawn, "ball")
    distance = np.linalg.norm(ball - impact.ball_before.position, axis=1)
    np.testing.assert_allclose(distance, impact.ball.radius, rtol=1e-5)


def test_arrows_start_at_their_points_and_point_along_the_impulse(scene):
    impact, drawn, _ = scene
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
    impact, drawn, _ = scene
    landing = kd.fly(impact.ball_after, kd.Ball(), kd.Air()).landing.position
    curve = placed(drawn, "curve")
    assert np.linalg.norm(curve - landing, axis=1).min() < 0.1
    assert np.abs(drawn.bounds).max() < 100
    glass = [
        drawn.geometry[name].visual.material for name in drawn.geometry if name.startswith("arrow")
    ]
    assert {tuple(material.baseColorFactor[:3]) for material in glass} == {(0x24, 0x56, 0xD6)}


def channels(content):
    """Return times and values of the animation by node and target, as the standard defines them."""
    (length,) = struct.unpack_from("<I", content, 12)
    tree, blob = json.loads(content[20 : 20 + length]), content[28 + length :]

    def array(number):
        accessor = tree["accessors"][number]
        start = tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        flat = np.frombuffer(blob, "<f4", accessor["count"] * width, start)
        return flat if width == 1 else flat.reshape(-1, width)

    (animation,) = tree["animations"]
    samplers = [(array(s["input"]), array(s["output"])) for s in animation["samplers"]]
    assert len(content) == struct.unpack_from("<I", content, 8)[0]
    nodes = [tree["nodes"][c["target"]["node"]] for c in animation["channels"]]
    assert not any("matrix" in node for node in nodes)
    return {
        (node["name"], c["target"]["path"]): samplers[c["sampler"]]
        for node, c in zip(nodes, animation["channels"], strict=True)
    }


def test_the_ball_flies_along_its_path_and_the_leg_swings(scene):
    """In the axes of the world, z up, in which the node above all others turns them."""
    impact, drawn, content = scene
    np.testing.assert_allclose(drawn.graph.get("kickdyn")[0], Y_UP, atol=1e-12)
    assert drawn.graph.transforms.parents["ball"] == "kickdyn"
    path = kd.fly(impact.ball_after, kd.Ball(), kd.Air())
    flown = path.sample(np.linspace(0, path.duration, 4000)).position
    moves = channels(content)
    times, positions = moves["ball", "translation"]
    assert (np.diff(times) > 0).all()
    gaps = np.linalg.norm(positions[:, None] - flown[None], axis=2).min(axis=1)
    assert gaps.max() < 0.02
    np.testing.assert_allclose(positions[-1], path.landing.position, atol=1e-5)
    np.testing.assert_allclose(positions[0], impact.ball_before.position, atol=1e-5)
    _, turns = moves["leg_2", "rotation"]
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0, rtol=1e-5)
    assert np.ptp(2 * np.arctan2(turns[:, 1], turns[:, 3])) > 0.5
    assert ("arrow", "scale") in moves
