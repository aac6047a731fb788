import re
import subprocess
import sys

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import psutil
import umsgpack

from kickdyn.view.document import draw_label, html_document, recording_viewer


def test_needs_nothing_from_elsewhere():
    html = html_document(recording_viewer(), "t", "")
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", html)
    assert not re.findall(r"<(?:link|iframe|img)\b|@import|<script[^>]+src", html)
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', html)[1]
    assert policy.startswith("default-src 'none'")
    assert "connect-src 'none'" in policy
    assert "http" not in policy


def test_title_is_escaped():
    html = html_document(recording_viewer(), "</title><script>alert(1)</script>", "")
    assert "alert(1)</script>" not in html
    assert "<title>&lt;/title&gt;&lt;script&gt;alert(1)" in html


def test_a_label_is_escaped_and_names_its_node():
    viewer = recording_viewer()
    draw_label(viewer["x"]["label"], "<b> & c", "#ff8800", np.array([1.0, 2.0, 3.0]))
    html = html_document(viewer, "t", "")
    assert (
        '<div class="label" data-node="/meshcat/x/label" style="border-color: #ff8800">'
        "&lt;b&gt; &amp; c</div>"
    ) in html
    (command,) = (umsgpack.unpackb(packed) for packed in viewer.window.commands)
    assert (command["path"], command["matrix"][12:15]) == ("/meshcat/x/label", [1.0, 2.0, 3.0])


def test_importing_kickdyn_leaves_meshcat_alone():
    heavy = "{'meshcat', 'yourdfpy', 'trimesh', 'tornado'}"
    code = f"import sys, kickdyn; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def kinds(viewer):
    commands = [umsgpack.unpackb(packed) for packed in viewer.window.commands]
    return [(command["type"], command["path"], command.get("property")) for command in commands]


def test_no_socket_and_no_child():
    process = psutil.Process()
    sockets, children = process.net_connections("all"), process.children()
    viewer = recording_viewer()
    viewer["ball"].set_object(shapes.Sphere(0.1))
    html_document(viewer, "t", "")
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
