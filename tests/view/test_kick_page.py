import json
import re

import matplotlib.image
import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.view import marks
from kickdyn.view.camera import LEFT, RIGHT, UP
from kickdyn.view.kick_page import kick_page, write_page


@pytest.fixture(scope="module")
def page(kick):
    return kick_page(*kick, caption="best of 12")


def test_a_page_needs_nothing_else(page):
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)
    assert "<title>leg_human: ball at 10.12 m/s</title>" in page
    assert "best of 12" in page


def test_names_are_escaped(load, spoil):
    evil = "&lt;script&gt;alert(1)&lt;/script&gt;"
    leg = load(spoil(('robot name="leg"', f'robot name="{evil}"'), ('"knee"', f'"{evil}"')))
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    html = kick_page(hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()), caption="<script>alert(1)")
    assert "<script>alert(1)" not in html
    assert html.count("&lt;script&gt;alert(1)") == 5  # title, heading, caption, joint, worst joint


def test_a_leg_with_a_mesh(leg_looking_like, tmp_path, commands_of):
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    leg = leg_looking_like('<visual><geometry><mesh filename="box.stl"/></geometry></visual>')
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    said = commands_of(kick_page(hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball())))
    (drawn,) = (c for c in said if c["path"] == "/meshcat/leg/1/0" and c["type"] == "set_object")
    assert drawn["object"]["geometries"][0]["type"] == "BufferGeometry"
    assert "images" not in drawn["object"]


def test_a_leg_with_a_mesh_from_elsewhere(leg_looking_like):
    leg = leg_looking_like('<visual><geometry><mesh filename="../a.stl"/></geometry></visual>')
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    with pytest.raises(kd.InvalidInput, match=r"'\.\./a\.stl' is refused"):
        kick_page(hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))


def test_write_page_replaces_a_file_at_once(tmp_path, monkeypatch):
    file = tmp_path / "kick.html"
    file.write_text("old")
    write_page(file, "ü")
    assert file.read_text(encoding="utf-8") == "ü"
    monkeypatch.setattr("pathlib.Path.write_text", disk_full)
    with pytest.raises(kd.InvalidInput, match=r"cannot be written \(No space left"):
        write_page(file, "half a page")
    assert [(f.name, f.read_bytes()) for f in tmp_path.iterdir()] == [("kick.html", "ü".encode())]


def disk_full(self, text, **_):
    self.write_bytes(text[:4].encode())
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("name", ["missing/kick.html", "folder", "file/kick.html", "/proc/a.html"])
def test_a_page_that_cannot_be_written(tmp_path, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(kd.InvalidInput, match=name) as caught:
        write_page(tmp_path / name, "page")
    assert "\n" not in str(caught.value)
    assert {f.name for f in tmp_path.iterdir()} == {"folder", "file"}


def test_the_page_in_a_browser(page, chromium, tmp_path):
    file, picture = tmp_path / "kick.html", tmp_path / "kick.png"
    write_page(file, page)
    chromium(file.as_uri(), f"--screenshot={picture}")
    pixels = 255 * matplotlib.image.imread(picture)[:, 330:, :3].astype(float)  # beside the caption
    red, green, blue = np.moveaxis(pixels, -1, 0)

    def of(colour):
        return np.abs(pixels - (colour >> 16, colour >> 8 & 255, colour & 255)).max(axis=-1) < 2

    # Light changes how bright the skin is, not its hue.
    skin = (np.abs(red / green.clip(1) - 0.85 / 0.64) < 0.06) & (
        np.abs(green / blue.clip(1) - 0.64 / 0.49) < 0.06
    )
    panels = (red > 170) & (np.abs(red - green) < 4) & (red >= blue) & (red - blue < 12)
    assert (skin & (red > 60)).sum() > 2000
    assert panels.sum() > 300
    assert of(marks.CURVE).sum() > 500
    assert of(marks.GRASS[0]).sum() > 10_000


def test_controls_are_shown_when_asked_for(page, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      document.title = getComputedStyle(document.querySelector(".dg.main")).display;
    }, 500);</script></body>"""
    file = tmp_path / "kick.html"
    file.write_text(page.replace("</body>", look))
    for end, display in (("", "none"), ("#controls", "block")):
        dom = chromium(file.as_uri() + end, "--dump-dom")
        assert re.search("<title>(.*?)</title>", dom)[1] == display


def test_the_page_plays_for_ever(page, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      const a = viewer.animator;
      document.title = JSON.stringify(
        [a.playing, a.time, a.actions.length, a.actions.every(x => x.repetitions === Infinity),
         performance.getEntriesByType("resource").length]);
    }, 1500);</script></body>"""
    (tmp_path / "kick.html").write_text(page.replace("</body>", look))
    dom = chromium((tmp_path / "kick.html").as_uri(), "--dump-dom")
    playing, time, actions, for_ever, fetched = json.loads(
        re.search("<title>(.*?)</title>", dom)[1]
    )
    assert playing
    assert time > 0.2
    assert actions == 9
    assert for_ever
    assert fetched == 0


def test_in_a_narrow_window_the_numbers_stand_below(page, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      const box = name => document.querySelector(name).getBoundingClientRect();
      document.title = JSON.stringify(
        [box("canvas").height, box("#meshcat-pane").bottom, box("#caption").top, innerHeight]);
    }, 1500);</script></body>"""
    (tmp_path / "kick.html").write_text(page.replace("</body>", look))
    dom = chromium((tmp_path / "kick.html").as_uri(), "--dump-dom", "--window-size=800,600")
    canvas, bottom, top, window = json.loads(re.search("<title>(.*?)</title>", dom)[1])
    assert canvas == pytest.approx(bottom, abs=1.0)
    assert top == pytest.approx(bottom, abs=1.0)
    assert bottom == pytest.approx(0.66 * window, abs=2.0)


@pytest.mark.parametrize("size", ["500,900", "1280,800"])
def test_every_window_shows_what_the_camera_was_placed_for(size, page, chromium, tmp_path):
    """Slopes at the edges of the picture, from the lens; where the caption lies over it, beside."""
    look = """<script>setTimeout(() => {
      const {elements: m} = viewer.camera.projectionMatrix, box = name =>
        document.querySelector(name).getBoundingClientRect();
      const over = box("#caption").top < box("#meshcat-pane").bottom ? box("#caption").right : 0;
      document.title = JSON.stringify([2 * over / innerWidth - 1, m[0], m[8], m[5]]);
    }, 1500);</script></body>"""
    (tmp_path / "kick.html").write_text(page.replace("</body>", look))
    dom = chromium((tmp_path / "kick.html").as_uri(), "--dump-dom", f"--window-size={size}")
    start, x, shift, y = json.loads(re.search("<title>(.*?)</title>", dom)[1])
    assert (start > -1) == size.startswith("1280")
    assert (start + shift) / x <= -LEFT
    assert (1 + shift) / x >= RIGHT - 1e-9
    assert 1 / y >= UP - 1e-9
