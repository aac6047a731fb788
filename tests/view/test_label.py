import base64
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import umsgpack

from kickdyn.view.label import HEIGHT, Label
from kickdyn.view.recorder import recorder

SVG = "{http://www.w3.org/2000/svg}"


def test_a_label_is_a_sprite_with_its_text():
    viewer = recorder()
    label = Label("1.2 <N> & s", 0xFF8800)
    viewer["x"].set_object(label)
    (said,) = (umsgpack.unpackb(packed)["object"] for packed in viewer.window.commands())
    head, body = said["images"][0]["url"].split(",")
    assert head == "data:image/svg+xml;base64"
    drawn = ET.fromstring(base64.b64decode(body))  # ours, just made
    assert drawn.find(f"{SVG}text").text == "1.2 <N> & s"
    assert drawn.find(f"{SVG}rect").get("stroke") == "#ff8800"
    width, height = (float(drawn.get(name)) for name in ("width", "height"))
    scale = np.reshape(said["object"]["matrix"], (4, 4)).diagonal()
    assert scale[:2] == pytest.approx([HEIGHT * width / height, HEIGHT])
    assert label.size == pytest.approx((scale[0] / 2, HEIGHT))
    used = said["materials"][0]
    assert said["object"]["material"] == used["uuid"]
    assert used["map"] == said["textures"][0]["uuid"]
    assert said["textures"][0]["image"] == said["images"][0]["uuid"]


def test_a_label_stands_to_the_right_of_where_it_is_put():
    svg, _ = Label("12 N s", 0).picture()
    drawn = ET.fromstring(svg)
    half = float(drawn.get("width")) / 2
    frame = drawn.find(f"{SVG}rect")
    left = float(frame.get("x"))
    assert half < left < left + float(frame.get("width")) < 2 * half
    assert half < float(drawn.find(f"{SVG}text").get("x")) < 2 * half
