"""The panel beside a kick: its numbers are those of the results, its names are plain text."""

import html
import re
from types import SimpleNamespace

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.view.caption import kick_panel, panel_of

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
    ball, felt = kd.Ball(), kd.Surface("felt", 0.5, 0.5, rolling_deceleration=1.0)
    launch = kd.BallState(velocity=(4, 0, 0), spin=(0, 4 / ball.radius, 0))
    course = kd.follow(launch, ball, ground=kd.Ground(-ball.radius, felt), plane=end)
    shown = rows(kick_panel(numbers(), course, ""))
    assert shown["path"] == f"{length} m along the ground"
    assert (shown["time"], shown["final speed"]) == (f"{time} s", f"{speed} m/s")


def spinning(*spin):
    return {"ball_after": kd.BallState(velocity=(6, 0, 8), spin=spin)}


LITTLE = {"joint_impulses": np.array([[0, 0, 0.09], [1.2, 0, 1.6], [0, 0.05, 0]]) @ np.eye(3, 6),
          "v_before": np.array([0.0, 0.0, 1.0])}  # fmt: skip


@pytest.mark.parametrize(("changes", "status", "name", "value"), [
    (spinning(0, -1e-3, 0), "landed", "spin", "0.001 rad/s"),
    (spinning(0, 1e-13, 0), "landed", "spin", "0 rad/s"),  # rounding
    ({"foot_velocity": np.zeros(3)}, "landed", "ball / foot speed", None),
    (LITTLE, "landed", "hip", None),  # at rest, and below a twentieth of the largest
    (LITTLE, "landed", "ankle", "-12.5°, 0.05 N s"),  # it moves
    ({}, "aloft", "range", "17.25 m (still aloft)"), ({}, "at-plane", "distance", "17.25 m")
], ids=range(7))  # fmt: skip
def test_values_that_are_left_out_or_shown_otherwise(changes, status, name, value):
    flight = SimpleNamespace(**{**vars(FLIGHT), "status": status})
    assert rows(kick_panel(numbers(**changes), flight, "")).get(name) == value


def test_names_and_texts_are_escaped(load, spoil):
    evil = "&lt;script&gt;alert(1)&lt;/script&gt;"
    leg = load(spoil(('robot name="leg"', f'robot name="{evil}"'), ('"knee"', f'"{evil}&amp;"')))
    assert "<script>" in leg.name
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    flight = SimpleNamespace(**{**vars(FLIGHT), "method": "<script>"})
    assert "<script" not in kick_panel(hit, flight, "<script>. <script>", ["<script>"])
    assert "<script" not in panel_of("<script>", [])
    assert "<script>alert(1)" not in kd.page(hit, caption="<script>alert(1)").html
