import base64
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import umsgpack

from kickdyn.view.camera import LEFT, Camera
from kickdyn.view.document import recording_viewer
from kickdyn.view.labels import HEIGHT, PIXELS, SLOPE, Label, LabelLayout

SVG = "{http://www.w3.org/2000/svg}"


def test_a_label_is_a_sprite_with_its_text():
    viewer = recording_viewer()
    label = Label("1.2 <N> & s", 0xFF8800)
    viewer["x"].set_object(label)
    (said,) = (umsgpack.unpackb(packed)["object"] for packed in viewer.window.commands)
    head, body = said["images"][0]["url"].split(",")
    assert head == "data:image/svg+xml;base64"
    drawn = ET.fromstring(base64.b64decode(body))  # ours, just made
    assert drawn.find(f"{SVG}text").text == "1.2 <N> & s"
    assert drawn.find(f"{SVG}rect").get("stroke") == "#ff8800"
    width, height = (float(drawn.get(name)) for name in ("width", "height"))
    scale = np.reshape(said["object"]["matrix"], (4, 4)).diagonal()
    assert scale[:2] == pytest.approx([HEIGHT * width / height, HEIGHT])
    used = said["materials"][0]
    assert said["object"]["material"] == used["uuid"]
    assert used["map"] == said["textures"][0]["uuid"]
    assert said["textures"][0]["image"] == said["images"][0]["uuid"]


def test_a_label_stands_to_the_right_of_where_it_is_put():
    svg = Label("12 N s", 0).picture()
    drawn = ET.fromstring(svg)
    half = float(drawn.get("width")) / 2
    frame = drawn.find(f"{SVG}rect")
    left = float(frame.get("x"))
    assert half < left < left + float(frame.get("width")) < 2 * half
    assert half < float(drawn.find(f"{SVG}text").get("x")) < 2 * half
    assert drawn.find(f"{SVG}line") is None


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("row", [0.0, 1.5, -2.0])
def test_its_frame_is_where_it_says_and_a_line_leads_there(row, left):
    label = Label("12 N s", 0, row=row, left=left)
    drawn = ET.fromstring(label.picture())
    width, height = (float(drawn.get(name)) for name in ("width", "height"))
    x, y, w, h = (
        float(drawn.find(f"{SVG}rect").get(name)) for name in ("x", "y", "width", "height")
    )
    assert min(x, y, width - x - w, height - y - h) >= 0
    assert label.centre == pytest.approx((x + w / 2 - width / 2, height / 2 - y - h / 2))
    assert label.half == pytest.approx((w / 2, PIXELS / 2))
    assert bool(label.centre[0] < 0) is left
    if row:
        line = {name: float(value) for name, value in drawn.find(f"{SVG}line").items()
                if name[0] in "xy"}  # fmt: skip
        assert (line["x1"], line["y1"]) == (width / 2, height / 2)
        assert line["x2"] == (x + w if left else x)
        assert line["y2"] == pytest.approx(y + h / 2)


ASIDE = Camera(np.array([0.0, -5.0, 0.0]), np.zeros(3))


def draw(layout, point, *, tip=False):
    viewer = recording_viewer()
    label = layout.draw(viewer["x"], "1.23 N s", 0, point, np.zeros(3), tip=tip)
    assert bool(viewer.window.commands) is (label is not None)
    return label


def test_no_label_covers_another():
    layout = LabelLayout(ASIDE)
    points = [np.array([0.02 * number, 0.0, 0.0]) for number in range(12)]
    frames = []
    for point in points:
        label = draw(layout, point)
        frames.append((ASIDE.project(point) + SLOPE * label.centre, SLOPE * label.half))
    for number, (centre, half) in enumerate(frames):
        for other, size in frames[:number]:
            assert (abs(centre - other) > 0.999 * (half + size)).any()


def test_without_space_there_is_no_label():
    layout = LabelLayout(ASIDE)
    labels = [draw(layout, np.zeros(3)) for _ in range(60)]
    assert all(labels[:30])
    assert labels[-1] is None


@pytest.mark.parametrize("left", [False, True])
def test_a_label_stands_ahead_of_its_arrow(left):
    tip = np.array([-0.5 if left else 0.5, 0.0, 0.0])
    label = draw(LabelLayout(ASIDE), tip, tip=True)
    assert (label.left, label.row) == (left, 0.0)


def test_a_second_label_moves_on_along_its_arrow():
    for up in (1.0, -1.0):
        layout, tip = LabelLayout(ASIDE), np.array([0.1, 0.0, up])
        rows = [draw(layout, tip, tip=True).row for _ in range(2)]
        assert rows[0] == 0.0
        assert rows[1] * up >= 1.0


def test_a_label_is_in_the_picture_and_not_under_the_caption():
    """Where its own side is outside, it stands above or below the tip of its arrow."""
    for x in (3.5, -0.99 * 5 * LEFT):
        tip = np.array([x, 0.0, 0.0])
        label = draw(LabelLayout(ASIDE), tip, tip=True)
        assert label.left is (x > 0)
        assert abs(label.row) >= 1.0
