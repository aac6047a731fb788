import re

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY
from kickdyn.view import comparison
from kickdyn.view.comparison import COLOURS, DOT_COLOUR

BALL = kd.Ball()


def path(spin, speed=20.0):
    return kd.fly(kd.BallState(velocity=(speed, 0, 9), spin=(0, spin, 0)), BALL, kd.Air())


def test_every_curve_stands_in_the_legend():
    page = kd.page({"top": path(40), "<b>back</b>": path(-40)}, caption="a & b").html
    assert "<title>a &amp; b</title>" in page
    assert "&lt;b&gt;back&lt;/b&gt;" in page
    assert "<b>back" not in page
    assert not re.findall(r'(?:src|href)=["\']http', page)


def test_the_legend_says_how_far_how_high_and_how_long():
    """Two seconds in vacuum, from 9.81 m/s upward and 10 m/s ahead."""
    flight = kd.fly(kd.BallState(velocity=(10, 0, GRAVITY)), BALL, None)
    html = kd.page(flight).html
    assert "<td>20 m, rises 4.91 m, 2 s</td>" in html
    assert "from the launch" in html


def test_the_legend_says_how_far_and_how_long_a_ball_rolls():
    """From 4 m/s at a deceleration of 1 m/s2."""
    felt = kd.Surface("felt", 0.5, 0.5, rolling_deceleration=1.0)
    launch = kd.BallState(velocity=(4, 0, 0), spin=(0, 4 / BALL.radius, 0))
    course = kd.follow(launch, BALL, ground=kd.Ground(-BALL.radius, felt))
    assert "<td>8 m along the ground, 4 s</td>" in kd.page(course).html


def test_a_curve_has_the_same_width_all_along_as_seen_by_the_camera(monkeypatch):
    drawn, cameras, find = [], [], comparison.camera_for

    def find_and_keep(*boxes):
        cameras.append(find(*boxes))
        return cameras[-1]

    monkeypatch.setattr(comparison, "camera_for", find_and_keep)
    monkeypatch.setattr(comparison.marks, "draw_curve", lambda _, *curve: drawn.append(curve))
    kd.page({"near": path(40), "far": path(-40, 30.0)})
    assert [curve[3] for curve in drawn] == list(COLOURS[:2])
    for points, radii, *_ in drawn:
        assert radii == pytest.approx(0.00255 * cameras[0].distance(points), rel=1e-12)
        assert np.ptp(radii) > 0.0


def test_the_ball_has_its_size(commands_of):
    html = kd.page(kd.fly(kd.BallState(velocity=(10, 0, GRAVITY)), BALL, None)).html
    shapes = {c["path"]: c["object"]["geometries"][0] for c in commands_of(html)
              if c["type"] == "set_object"}  # fmt: skip
    data = shapes["/meshcat/ball/hexagons"]["data"]["attributes"]["position"]["array"].data
    vertices = np.frombuffer(data, np.float32).reshape(-1, 3)
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(BALL.radius, rel=1e-3)


def test_distances_stand_where_they_say_and_an_axis_is_as_long_as_it_says(commands_of):
    """Marks are a sixth of 20 m apart, or less; axes are half as long."""
    html = kd.page(kd.fly(kd.BallState(velocity=(10, 0, GRAVITY)), BALL, None)).html
    marks = re.findall(r'data-node="(/meshcat/distances/\d+)">([\d.]+) m<', html)
    commands = commands_of(html)
    nodes = {c["path"]: c["matrix"][12] for c in commands if c["type"] == "set_transform"}
    shown = sorted((float(text), nodes[node]) for node, text in marks)
    assert all(text == pytest.approx(place) for text, place in shown)
    assert [text for text, _ in shown] == [2.0 * k for k in range(11)]
    shapes = {c["path"]: c["object"]["geometries"][0] for c in commands if "object" in c}
    arrow = [shapes[f"/meshcat/axes/x/{name}"]["height"] for name in ("shaft", "head")]
    assert sum(arrow) == pytest.approx(1.0)
    assert ">x (1 m)</div>" in html


def test_measured_positions_are_shown_along_the_whole_flight(commands_of):
    times = np.linspace(0.0, 1.5, 120)
    flight = kd.fly(kd.BallState(velocity=(10, 0, 8)), BALL, kd.Air(lift=None))
    track = kd.Track(times, flight.sample(times).position)
    html = kd.page(kd.identify(track, BALL, kd.Air(lift=None), free=[])).html
    (dots,) = (c["object"]["geometries"][0]["data"]["attributes"]["position"]["array"]
               for c in commands_of(html)
               if c["type"] == "set_object" and c["path"].startswith("/meshcat/dots"))  # fmt: skip
    packed = np.frombuffer(dots.data, np.float32) if hasattr(dots, "data") else np.array(dots)
    centres = packed.reshape(-1, 12, 3).mean(axis=1)
    assert 10 <= len(centres) <= 14
    ends = track.positions[[0, -1], 0]
    gaps = np.diff([*centres[:, 0], ends[1]])
    assert centres[0, 0] == pytest.approx(ends[0], abs=1e-3)
    assert gaps.max() < 0.2 * (ends[1] - ends[0])


def test_the_colours_differ_from_each_other_and_from_measured_positions():
    parts = [np.array([c >> 16, c >> 8 & 255, c & 255]) for c in (*COLOURS, DOT_COLOUR)]
    apart = [np.linalg.norm(a - b) for i, a in enumerate(parts) for b in parts[:i]]
    assert min(apart) > 75.0


@pytest.mark.parametrize("number", [0, 9])
def test_too_few_or_too_many_flights(number):
    with pytest.raises(kd.InvalidInput, match="one page compares 1 to 8"):
        kd.page([path(0)] * number)


def test_a_ball_that_does_not_fly_can_be_shown():
    assert "0 m" in kd.page({"rest": kd.fly(kd.BallState(), BALL)}).html
