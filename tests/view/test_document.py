"""The HTML of scenes: whole, safe, each command once; pictures of it by Chromium."""

import json
import re
import sys

import matplotlib.image
import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view import document
from kickdyn.view.document import draw_label, html_document, recording_viewer


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


def test_the_browser_gets_the_page_the_time_and_the_file(monkeypatch, tmp_path):
    """A browser that copies the page, and the end of its address, into the picture."""
    browser, picture = tmp_path / "chromium", tmp_path / "a.png"
    browser.write_text(
        f"#!{sys.executable}\nimport sys\nfrom pathlib import Path\n"
        "page, _, end = sys.argv[-1].partition('#')\n"
        "(file,) = (x.partition('=')[2] for x in sys.argv if x.startswith('--screenshot='))\n"
        "Path(file).write_text(Path(page.removeprefix('file://')).read_text() + end)\n"
    )
    browser.chmod(0o755)
    monkeypatch.setattr(document.shutil, "which", lambda name: str(browser))
    document.save_picture("the page ", picture, -0.125)
    assert picture.read_text() == "the page picture&at=-0.125"


@pytest.mark.slow
def test_the_picture_is_that_of_the_time(kick, chromium, tmp_path):
    """The ball is in the air at the middle of its flight, and not at the impact."""
    page, pictures = kd.page(kick[0], kick[2]), []
    for number, at in enumerate((0.0, kick[2].duration / 2)):
        page.save(tmp_path / f"{number}.png", at)
        pictures.append(matplotlib.image.imread(tmp_path / f"{number}.png")[:, :, :3])
    assert pictures[0].shape == (720, 1280, 3)
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.2).sum() > 500
