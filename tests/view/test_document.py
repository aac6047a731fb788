"""The HTML of all subjects: whole, safe, its numbers and files, and what Chromium shows."""

import io
import json
import re
import struct

import matplotlib.image
import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pytest
import trimesh
import umsgpack
from drawn_scene import SINGLE, DrawnScene
from tolerances import agrees

import kickdyn as kd
from kickdyn.view import document
from kickdyn.view.document import draw_label, html_document, recording_viewer
from kickdyn.view.kick_scene import RATE
from kickdyn.view.wall_and_goal import wall_boxes


def ball_at(x):
    viewer = recording_viewer()
    viewer["ball"].set_object(shapes.Sphere(0.1))
    viewer["ball"].set_transform(tf.translation_matrix((x, 0, 0)))
    draw_label(viewer["m"], f"<b> & {x} m", np.zeros(3), "#ff8800")
    return viewer.window, f"<p>ball at {x}</p>", np.array([[0.0, -x], [1.0, x]])


def test_a_page_needs_nothing_from_elsewhere_and_its_texts_are_escaped():
    html = html_document("</title><script>alert(1)</script>", [ball_at(1)])
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", html)
    assert not re.findall(r"<(?:link|iframe|img)\b|@import|<script[^>]+src", html)
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', html)[1]
    assert policy.startswith("default-src 'none'")
    assert "connect-src 'none'" in policy
    assert "<title>&lt;/title&gt;&lt;script&gt;alert(1)" in html
    assert re.search(r'data-node="/meshcat/m"[^>]*#ff8800[^>]*>&lt;b&gt; &amp; 1 m<', html)


def test_what_two_scenes_share_is_on_the_page_once(commands_of):
    drawn = [ball_at(1), ball_at(2)]
    html = html_document("t", drawn, ["<near>", "far"])
    commands, scenes = commands_of(html), json.loads(re.search("let scenes = (.*?);  //", html)[1])
    assert len(commands) == 4  # object, two places, place of the label
    for (window, _, times), scene in zip(drawn, scenes, strict=True):
        shown = [commands[number] for number in scene["commands"]]
        assert shown == [umsgpack.unpackb(packed) for packed in window.commands]
        assert scene["times"] == times.tolist()
    assert re.findall("<button>(.*?)</button>", html)[-2:] == ["&lt;near&gt;", "far"]
    # commands that a browser has keep their numbers
    near = document.scene_parts([ball_at(1)]).numbers
    far = document.scene_parts([ball_at(2)], (), near, 7).numbers
    assert {number for command, number in far.items() if command not in near} == {7}
    assert all(near[command] == far[command] for command in near.keys() & far.keys())


@pytest.mark.slow
def test_the_picture_is_that_of_the_time(kick, chromium, tmp_path):
    """The ball is in the air at the middle of its flight, and not at the impact."""
    page, pictures = kd.page(kick[0], kick[2]), []
    for number, at in enumerate((0.0, kick[2].duration / 2)):
        page.save(tmp_path / f"{number}.png", at)
        pictures.append(matplotlib.image.imread(tmp_path / f"{number}.png")[:, :, :3])
    assert pictures[0].shape == (720, 1280, 3)
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.2).sum() > 500


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
    (length,) = struct.unpack_from("<I", content, 12)
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


@pytest.fixture(scope="module")
def page(kick):
    impact, _, path = kick
    return kd.page(impact, path, caption="best of 12")


def test_a_page_of_a_kick_is_one_file_with_its_numbers(page, kick):
    impact, ball, path = kick
    assert f"<title>leg_human: ball at {impact.ball_after.speed:.4g} m/s</title>" in page.html
    assert "best of 12" in page.html
    assert "<nav>" not in page.html
    assert f"{path.range:.4g} m" in page.panel
    without = kd.fly(impact.ball_after, ball)
    assert f"{without.range:.4g} m" in kd.page(impact, without).panel
    assert f"{kd.fly(impact.ball_after, ball, kd.Air()).range:.4g} m" in kd.page(impact).panel


def test_a_bare_impact_is_above_the_lowest_point_of_the_leg_and_a_scene_is_not(make_kick):
    """An impact does not say where the ground is, but a plan, a scene and a course do."""
    hit, ball, _ = make_kick(kd.Leg.human(), 2.0, degrees=(40, 30, -20))
    bottom = hit.ball_before.position[2] - ball.radius
    bare = kd.page(hit, caption="a kick.")
    assert "<p>a kick. </p>" in bare.panel
    assert "tee" in bare.panel
    assert DrawnScene(bare.viewer).point("ground")[2] < bottom - 0.01
    course = kd.follow(hit.ball_after, ball, ground=kd.Ground(bottom, "turf"))
    for subject in ((kd.Scene(hit.posture, hit.v_before, ball, hit.contact),), (hit, course)):
        shown = kd.page(*subject)
        assert "tee" not in shown.panel
        assert DrawnScene(shown.viewer).point("ground")[2] == pytest.approx(bottom)


def test_the_wall_of_a_scene_stands_on_the_lower_of_both_ends(kick):
    hit, ball, _ = kick
    plane = kd.Plane((3, 0, 0), (-1, 0, 0))
    scene = kd.Scene(hit.posture, hit.v_before, ball, hit.contact, plane=plane)
    answer = kd.simulate(scene, tolerance=0.1)
    heights = scene.ball_position[2], answer.end.position[2]
    shown = DrawnScene(kd.page(answer).viewer)
    x, _, z = shown.point("scenery/0")
    box = shown.shape("scenery/0")
    assert z - box["depth"] / 2 == pytest.approx(min(heights) - ball.radius)
    assert x - box["width"] / 2 == pytest.approx(3.0)  # the plane
    # players stand on the ground, here 0.4 m below the ball, in front of it
    level = heights[0] - ball.radius - 0.4
    walled = scene.replace(wall=kd.Wall(1.2, 0.3), ground=kd.Ground(level))
    shown = DrawnScene(kd.page(kd.simulate(walled, tolerance=0.1)).viewer)
    right = scene.ball_position[0] + 1.2, scene.ball_position[1], level + 0.3 / 2
    assert shown.point("scenery/3") == pytest.approx(right)  # the third of five


def test_several_impacts_have_a_page_with_a_button_each(make_kick):
    kicks = {str(speed): make_kick(kd.Leg.human(), speed)[0] for speed in (4.0, 6.0)}
    whole = kd.page(kicks)
    assert re.findall("<button>(.*?)</button>", whole.html)[-2:] == list(kicks)
    for name, hit in kicks.items():
        speed = f"{hit.ball_after.speed:.4g} m/s"
        assert f"Ball at {speed}" in whole.pages[name].panel
        assert (speed in whole.title) == (name == "4.0")
    with pytest.raises(kd.InvalidInput, match="not both"):
        kd.page([kicks["4.0"], kd.fly(kicks["4.0"].ball_after, kd.Ball())])


def test_a_page_is_written_whole_or_refused(tmp_path, page):
    for name in ("missing/kick.html", "kick.docx"):
        with pytest.raises(kd.InvalidInput, match=name):
            page.save(tmp_path / name)
    page.save(tmp_path / "kick.html")
    assert (tmp_path / "kick.html").read_text("utf-8") == page.html
