import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import psutil
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view import document
from kickdyn.view.document import (
    draw_label,
    find_browser,
    html_document,
    recording_viewer,
    save_picture,
)


def html_of(viewer, title="t"):
    return html_document(title, [(viewer.window, "", None)])


def test_needs_nothing_from_elsewhere():
    html = html_of(recording_viewer())
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", html)
    assert not re.findall(r"<(?:link|iframe|img)\b|@import|<script[^>]+src", html)
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', html)[1]
    assert policy.startswith("default-src 'none'")
    assert "connect-src 'none'" in policy
    assert "http" not in policy


def test_title_is_escaped():
    html = html_of(recording_viewer(), "</title><script>alert(1)</script>")
    assert "alert(1)</script>" not in html
    assert "<title>&lt;/title&gt;&lt;script&gt;alert(1)" in html


def test_a_label_is_escaped_and_names_its_node():
    viewer = recording_viewer()
    draw_label(viewer["x"]["label"], "<b> & c", np.array([1.0, 2.0, 3.0]), "#ff8800")
    html = html_of(viewer)
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
    html_of(viewer)
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


def ball_at(x):
    viewer = recording_viewer()
    viewer["ball"].set_object(shapes.Sphere(0.1))
    viewer["ball"].set_transform(tf.translation_matrix((x, 0, 0)))
    draw_label(viewer["m"], f"{x} m", np.zeros(3))
    return viewer.window, f"<p>ball at {x}</p>", None


def test_what_two_scenes_share_is_on_the_page_once(commands_of):
    html = html_document("t", [ball_at(1), ball_at(2)], ["<near>", "far"])
    assert [command["type"] for command in commands_of(html)] == [
        "set_object",
        "set_transform",
        "set_transform",
        "set_transform",
    ]
    scenes = json.loads(re.search("let scenes = (.*?);  //", html)[1])
    assert [scene["commands"] for scene in scenes] == [[0, 1, 2], [0, 3, 2]]
    assert re.findall("<button>(.*?)</button>", html) == ["pause", "&lt;near&gt;", "far"]
    assert html == html_document("t", [ball_at(1), ball_at(2)], ["<near>", "far"])  # no random


SWITCH = """<script>setTimeout(() => {
  const seen = () => [
    [...document.querySelectorAll("section.scene")].map(each => each.offsetHeight > 0),
    [...document.querySelectorAll(".labels.scene")].map(each => !each.hidden),
    viewer.scene_tree.find(["meshcat", "ball"]).object.position.x,
  ];
  const all = [seen()];
  for (const each of [1, 0]) {
    document.querySelectorAll("nav button")[each].click();
    all.push(seen());
  }
  document.title = JSON.stringify(all);
}, 500);</script></body>"""


def test_buttons_choose_the_scene(chromium, tmp_path):
    html = html_document("t", [ball_at(1), ball_at(2)], ["near", "far"])
    file = tmp_path / "page.html"
    file.write_text(html.replace("</body>", SWITCH))
    near, far = [[True, False], [True, False], 1], [[False, True], [False, True], 2]
    for start, shown in (("", [near, far, near]), ("#scene=1", [far, far, near])):
        dom = chromium(file.as_uri() + start, "--dump-dom")
        assert json.loads(re.search("<title>(.*?)</title>", dom)[1]) == shown


LOW = """<script>setTimeout(() => {
  const {controls, camera} = viewer, {target} = controls, floor = 2;
  const lowest = [];
  for (const pan of [0, -5, 3]) {
    target.y += pan;
    camera.position.set(3, target.y - 4, 0);  // below the ground
    stay_above_ground();
    viewer.render();
    lowest.push([camera.position.y - floor, target.y - floor]);
  }
  document.title = JSON.stringify(lowest);
}, 500);</script></body>"""


def test_the_camera_stays_above_the_ground(chromium, tmp_path):
    viewer = recording_viewer()
    viewer["ground"].set_transform(tf.translation_matrix((0, 0, 2)))
    file = tmp_path / "page.html"
    file.write_text(html_of(viewer).replace("</body>", LOW))
    dom = chromium(file.as_uri(), "--dump-dom")
    for camera, target in json.loads(re.search("<title>(.*?)</title>", dom)[1]):
        assert camera > 0.0
        assert target >= -1e-9


def test_without_a_browser_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(document.shutil, "which", lambda name: None)
    with pytest.raises(kd.InvalidInput, match="Debian package chromium") as caught:
        find_browser()
    assert "\n" not in str(caught.value)


def test_a_browser_that_fails_leaves_nothing(monkeypatch, tmp_path):
    monkeypatch.setattr(document.shutil, "which", lambda name: "/bin/false")
    with pytest.raises(kd.KickdynError, match="made no picture"):
        save_picture("page", tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_the_browser_is_told_the_page_the_moment_and_the_file(monkeypatch, tmp_path):
    commands = []

    def run(command, **_):
        commands.append(command)
        page = command[-1].partition("#")[0].removeprefix("file://")
        file = next(x for x in command if x.startswith("--screenshot="))
        Path(file.removeprefix("--screenshot=")).write_text(Path(page).read_text() + "!")
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(document, "find_browser", lambda: "/usr/bin/chromium")
    monkeypatch.setattr(document.subprocess, "run", run)
    save_picture("the page", tmp_path / "a.png", -0.125)
    save_picture("the page", tmp_path / "a.png")
    assert (tmp_path / "a.png").read_text() == "the page!"
    assert [command[-1].partition("#")[2] for command in commands] == [
        "picture&at=-0.125", "picture&at=0"
    ]  # fmt: skip
    for command in commands:
        assert command[0] == "/usr/bin/chromium"
        (profile,) = (x for x in command if x.startswith("--user-data-dir="))
        assert command[-1].startswith(f"file://{profile.partition('=')[2][: -len('/profile')]}/")


def test_a_browser_without_its_sandbox_says_what_helps(monkeypatch, tmp_path):
    browser = tmp_path / "chromium"
    browser.write_text("#!/bin/sh\necho 'No usable sandbox! If this is' >&2\nexit 1\n")
    browser.chmod(0o755)
    monkeypatch.setattr(document.shutil, "which", lambda name: str(browser))
    with pytest.raises(kd.KickdynError, match="Debian package chromium-sandbox"):
        save_picture("page", tmp_path / "a.png")


def test_the_moment_is_what_was_asked_for(kick, chromium, tmp_path):
    """The ball is in the air at the middle of its flight, and not at the impact."""
    impact, _, path = kick
    page = kd.page(impact, path)
    pictures = []
    for number, at in enumerate((0.0, path.duration / 2)):
        page.save(tmp_path / f"{number}.png", at)
        pictures.append(matplotlib.image.imread(tmp_path / f"{number}.png")[:, :, :3])
    assert pictures[0].shape == (720, 1280, 3)
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.2).sum() > 500
