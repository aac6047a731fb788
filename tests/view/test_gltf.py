"""A page as glTF: the same bodies in the same places at the same times."""

import io
import json
import struct

import numpy as np
import pytest
import trimesh
from drawn_scene import SINGLE, DrawnScene
from tolerances import agrees

import kickdyn as kd
from kickdyn.view.kick_scene import RATE
from kickdyn.view.wall_and_goal import wall_boxes

Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""The world's z is glTF's y."""


@pytest.fixture(scope="module")
def saved(kick, tmp_path_factory):
    boxes = wall_boxes(np.array([0.0, 0.0, -1.0]), np.eye(3)[0], 3.0, 1.8, 1.0)
    page = kd.page(kick[0], kick[2], scenery=boxes)
    file = tmp_path_factory.mktemp("gltf") / "kick.glb"
    page.save(file)
    return page, file.read_bytes()


def placed(scene, start):
    """Return the vertices of the nodes whose names begin so, in the axes of the world."""
    nodes = [name for name in scene.graph.nodes_geometry if name.startswith(start)]
    return np.vstack([
        trimesh.transform_points(scene.geometry[geometry].vertices, Y_UP.T @ pose)
        for pose, geometry in map(scene.graph.get, nodes)
    ])  # fmt: skip


def test_ball_arrows_curve_and_leg_are_in_the_places_of_the_page(kick, saved):
    impact, ball, _ = kick
    drawn = DrawnScene(saved[0])
    scene = trimesh.load(io.BytesIO(saved[1]), file_type="glb")
    distances = np.linalg.norm(placed(scene, "ball") - impact.ball_before.position, axis=1)
    np.testing.assert_allclose(distances, ball.radius, rtol=10 * SINGLE)
    for node in ("arrow", "joint_arrows/3"):
        start, vector = drawn.arrow(node)
        points = placed(scene, node.replace("/", "_")) - start
        along = points @ vector / np.linalg.norm(vector)
        agrees(points[np.argmax(along)], vector, 10 * SINGLE)
        assert along.min() == pytest.approx(0.0, abs=SINGLE)
    for corners in (placed(scene, f"scenery_{k}").round(5) for k in range(2)):
        assert np.ptp(corners, axis=0) == pytest.approx([0.3, 0.45, 1.8], abs=1e-4)
        assert corners.mean(axis=0)[[0, 2]] == pytest.approx([3.0, -0.1], abs=1e-4)
    length = np.ptp(scene.geometry["arrow_shaft_mesh"].vertices, axis=0).max()
    assert length == pytest.approx(drawn.shape("arrow/shaft")["height"], rel=10 * SINGLE)
    for node in ("ball/hexagons", "ball/pentagons", "curve", "arrow/head", "leg/0/person/0"):
        look = drawn.objects[node]["materials"][0]
        shown = scene.geometry[f"{node.replace('/', '_')}_mesh"].visual.material.baseColorFactor
        assert bytes(shown[:3]) == look["color"].to_bytes(3), node
        assert shown[3] == pytest.approx(255 * look["opacity"], abs=0.5), node
    agrees(placed(scene, "curve"), drawn.vertices("curve"), 10 * SINGLE)
    for node in drawn.objects:
        if node.startswith("leg/") and "data" in drawn.shape(node):
            vertices = placed(scene, node.replace("/", "_") + "_mesh")
            agrees(np.sort(vertices, axis=0), np.sort(drawn.vertices(node), axis=0), 10 * SINGLE)
    assert np.abs(scene.bounds).max() < 100  # without the backdrop of the ground


def channels(content):
    """Return times and values of the animation by node and target, as the standard defines them."""
    magic, version, size, length = struct.unpack_from("<4sIII", content)
    assert (magic, version, size) == (b"glTF", 2, len(content))
    tree, blob = json.loads(content[20 : 20 + length]), content[28 + length :]

    def array(number):
        accessor = tree["accessors"][number]
        start = tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        values = np.frombuffer(blob, "<f4", accessor["count"] * width, start).reshape(-1, width)
        assert values.min(axis=0) == pytest.approx(accessor["min"])
        assert values.max(axis=0) == pytest.approx(accessor["max"])
        return values

    (animation,) = tree["animations"]
    samplers = [(array(s["input"])[:, 0], array(s["output"])) for s in animation["samplers"]]
    nodes = [tree["nodes"][c["target"]["node"]] for c in animation["channels"]]
    assert not any("matrix" in node for node in nodes)
    return {
        (node["name"], c["target"]["path"]): samplers[c["sampler"]]
        for node, c in zip(nodes, animation["channels"], strict=True)
    }


def test_the_animation_is_that_of_the_page(saved):
    page, content = saved
    drawn, moves = DrawnScene(page), channels(content)
    for name, node in (("ball", "ball"), ("leg_2", "leg/2")):
        for path, target in ((".position", "translation"), (".quaternion", "rotation")):
            times, values = moves[name, target]
            track = drawn.tracks[node][path]
            assert times == pytest.approx(np.array(list(track)) / RATE)
            agrees(values, list(track.values()), SINGLE)
    times, sizes = moves["arrow", "scale"]
    assert sizes[times < page.pace.impact / RATE - 1e-6].max() < 0.01
    assert sizes[-1] == pytest.approx([1.0] * 3)
