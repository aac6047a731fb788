"""The panel beside a kick: its numbers are those of the results, its names are plain text."""

import html
import re
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_scene import SINGLE, DrawnScene
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY
from kickdyn.view.caption import kick_panel, panel_of

BALL = kd.Ball()
FELT = kd.Surface("felt", 0.5, 0.5, rolling_deceleration=1.0)
ROLLING = kd.BallState(velocity=(4, 0, 0), spin=(0, 4 / BALL.radius, 0))
FLIGHT = SimpleNamespace(method="DOP853, drag", status="landed", range=17.25, duration=1.5)


def rows(text):
    """Return the values of a panel by their names."""
    text = text.replace("<wbr>", "")
    cells = re.findall(r"<tr[^>]*><th>(.*?)</th><td>(.*?)</td></tr>", text)
    return dict([html.unescape(re.sub(r" ?<.*?>", "", cell)) for cell in row] for row in cells)


def numbers(**changed):
    """Return an impact of round numbers, as far as a caption reads it."""
    impact = {
        "posture": kd.Leg.human().posture(np.radians([20.0, 30.0, -12.5])),
        "impulse": np.array([0.0, -0.6, 0.8]), "effective_mass": 1.25,
        "joint_impulses": np.array([[0, 0, 0.25], [1.2, 0, 1.6], [0, 0.5, 0]]) @ np.eye(3, 6),
        "worst_joint": ("knee", 2.0), "foot_velocity": np.array([3.0, 0.0, 4.0]),
        "speed_ratio": 2.0, "ball": kd.Ball(), "v_before": np.array([0.0, 1.0, 0.0]),
        "ball_after": kd.BallState(velocity=(6, 0, 8), spin=(0, -30, 40)),
    }  # fmt: skip
    return SimpleNamespace(**{**impact, **changed})


def test_the_numbers_are_those_of_the_impact_and_the_flight():
    """Norms of vectors of whole numbers; the largest impulse of a joint comes first."""
    text = kick_panel(numbers(), FLIGHT, "best & first. Then more.")
    shown = rows(text)
    right = {
        "leg": "leg_human", "impulse on ball": "1 N s", "worst joint": "2 N s at knee",
        "effective mass": "1.25 kg", "foot speed": "5 m/s", "ball speed": "10 m/s",
        "ball / foot speed": "2", "launch angle": "53.1°", "spin": "50 rad/s", "range": "17.25 m",
        "flight time": "1.5 s", "flight": "DOP853, drag", "knee": "30.0°, 2 N s",
        "ankle": "-12.5°, 0.5 N s", "hip": "20.0°, 0.25 N s",
    }  # fmt: skip
    assert {name: shown.get(name) for name in right} == right
    assert [name for name in shown if name in ("hip", "knee", "ankle")] == ["knee", "ankle", "hip"]
    assert "best &amp; first" in text


@pytest.mark.parametrize(("end", "length", "time", "speed"), [
    (None, 8, 4, 0), (kd.Plane((6, 0, 0), (-1, 0, 0), "centre"), 6, 2, 2)])  # fmt: skip
def test_a_course_along_the_ground(end, length, time, speed):
    """Rolling 8 m at a deceleration of 1 m/s2, from 4 m/s to rest."""
    course = kd.follow(ROLLING, BALL, ground=kd.Ground(-BALL.radius, FELT), plane=end)
    shown = rows(kick_panel(numbers(), course, ""))
    assert shown["path"] == f"{length} m along the ground"
    assert (shown["time"], shown["final speed"]) == (f"{time} s", f"{speed} m/s")


def test_names_and_texts_are_escaped(load, spoil):
    evil = "&lt;script&gt;alert(1)&lt;/script&gt;"
    leg = load(spoil(('robot name="leg"', f'robot name="{evil}"'), ('"knee"', f'"{evil}&amp;"')))
    assert "<script>" in leg.name
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    flight = SimpleNamespace(**{**vars(FLIGHT), "method": "<script>"})
    assert "<script" not in kick_panel(hit, flight, "<script>. <script>", ["<script>"])
    assert "<script" not in panel_of("<script>", [])
    assert "<script>alert(1)" not in kd.page(hit, caption="<script>alert(1)").html


PARABOLA = kd.fly(kd.BallState(velocity=(10, 0, GRAVITY)), BALL, None)
COURSE = kd.follow(ROLLING, BALL, ground=kd.Ground(-BALL.radius, FELT))


def test_every_flight_is_a_curve_along_its_path():
    """As wide all along as the camera sees it."""
    aside = kd.fly(kd.BallState(velocity=(9, 3, 9)), BALL)
    flights = {"top": PARABOLA, "<b>back</b>": aside, "roll": COURSE}
    page = kd.page(flights, caption="a & b")
    scene = DrawnScene(page)
    for k, path in enumerate(flights.values()):
        centres = scene.curve(f"curve/{k}")
        right = path.sample(np.linspace(0, path.duration, len(centres))).position
        agrees(centres, right, 10 * SINGLE)
        radii = scene.vertices(f"curve/{k}").reshape(-1, 8, 3) - centres[:, None]
        away = np.linalg.norm(centres - scene.camera()[0], axis=1)
        angles = np.linalg.norm(radii, axis=2) / away[:, None]
        np.testing.assert_allclose(angles, angles[0, 0], rtol=1e-2)
    assert scene.point("ground")[2] == pytest.approx(-BALL.radius)
    agrees(scene.point("ball"), PARABOLA.launch.position, closed_form(1e4))
    size = np.ptp(scene.vertices("ball/hexagons"), axis=0)
    assert size == pytest.approx(2 * BALL.radius, rel=1e-2)
    assert "&lt;b&gt;back&lt;/b&gt;" in page.html
    assert "<title>a &amp; b</title>" in page.html


def test_measured_positions_are_dots_along_the_whole_flight():
    flight = kd.fly(kd.BallState(velocity=(10, 0, 8)), BALL, kd.Air(lift=None))
    track = kd.Track(times := np.linspace(0.0, 1.5, 60), flight.sample(times).position)
    page = kd.page(kd.identify(track, BALL, kd.Air(lift=None), free=[]))
    centres = DrawnScene(page).vertices("dots/0").reshape(-1, 12, 3).mean(axis=1)
    distances = np.linalg.norm(centres[:, None] - track.positions, axis=2)
    assert distances.min(axis=1).max() < 100 * SINGLE
