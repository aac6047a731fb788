import re
import subprocess
import sys

import meshcat.geometry as shapes
import meshcat.transformations as tf
import psutil
import umsgpack

from kickdyn.view.document import live_document, recording_viewer, static_document


def test_needs_nothing_from_elsewhere():
    html = static_document(recording_viewer(), "t", "")
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", html)
    assert not re.findall(r"<(?:link|iframe|img)\b|@import|<script[^>]+src", html)
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', html)[1]
    assert policy.startswith("default-src 'none'")
    assert "connect-src 'none'" in policy
    assert "http" not in policy


def test_title_is_escaped():
    html = static_document(recording_viewer(), "</title><script>alert(1)</script>", "")
    assert "alert(1)</script>" not in html
    assert "<title>&lt;/title&gt;&lt;script&gt;alert(1)" in html


def test_live_page_asks_its_own_server_only():
    html = live_document("/scene", "t", "")
    assert 'viewer.connect("ws://" + location.host + "/scene")' in html
    assert "connect-src ws://127.0.0.1:* ws://localhost:*" in html


def test_importing_kickdyn_leaves_meshcat_alone():
    heavy = "{'meshcat', 'yourdfpy', 'trimesh', 'tornado'}"
    code = f"import sys, kickdyn; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def kinds(viewer):
    commands = [umsgpack.unpackb(packed) for packed in viewer.window.commands()]
    return [(command["type"], command["path"], command.get("property")) for command in commands]


def test_no_socket_and_no_child():
    process = psutil.Process()
    sockets, children = process.net_connections("all"), process.children()
    viewer = recording_viewer()
    viewer["ball"].set_object(shapes.Sphere(0.1))
    static_document(viewer, "t", "")
    assert process.net_connections("all") == sockets
    assert process.children() == children


def test_keeps_what_a_browser_needs_in_order():
    viewer = recording_viewer()
    viewer["a"].set_object(shapes.Sphere(0.1))
    viewer["a"].set_transform(tf.translation_matrix((1, 0, 0)))
    viewer["a"].set_property("visible", True)
    viewer["a"].set_property("color", [1, 0, 0, 1])
    assert kinds(viewer) == [
        ("set_object", "/meshcat/a", None),
        ("set_transform", "/meshcat/a", None),
        ("set_property", "/meshcat/a", "visible"),
        ("set_property", "/meshcat/a", "color"),
    ]


def test_the_latest_replaces_and_comes_last():
    viewer = recording_viewer()
    viewer["a"].set_transform(tf.translation_matrix((1, 0, 0)))
    viewer["b"].set_property("visible", True)
    viewer["a"].set_transform(tf.translation_matrix((2, 0, 0)))
    last = [umsgpack.unpackb(packed) for packed in viewer.window.commands()]
    assert [command["path"] for command in last] == ["/meshcat/b", "/meshcat/a"]
    assert last[1]["matrix"][12] == 2


def test_delete_forgets_the_node_and_what_is_below():
    viewer = recording_viewer()
    for name in ("a", "a/b", "ab"):
        viewer[name].set_object(shapes.Sphere(0.1))
    viewer["a"].delete()
    assert [path for _, path, _ in kinds(viewer)] == ["/meshcat/ab"]


def test_a_listener_hears_every_command():
    viewer, heard = recording_viewer(), []
    viewer.window.listener = heard.append
    viewer["a"].set_object(shapes.Sphere(0.1))
    viewer["a"].delete()
    assert [umsgpack.unpackb(packed)["type"] for packed in heard] == ["set_object", "delete"]
