import re

import numpy as np
import pytest

import kickdyn as kd


@pytest.fixture(scope="module")
def hits(make_kick):
    return {
        name: make_kick(kd.Leg.human(), 1.0, (5, 10, ankle))[0]
        for name, ankle in (("a", -5), ("<b>", 15), ("c", 40))
    }


def test_legs_stand_side_by_side_with_arrows_to_one_scale(hits, commands_of):
    said = commands_of(kd.page(hits, caption="three").html)
    moved = {c["path"]: np.reshape(c["matrix"], (4, 4)).T
             for c in said if c["type"] == "set_transform"}  # fmt: skip
    places = [moved[f"/meshcat/{number}"][:3, 3] for number in range(3)]
    assert (np.diff(places, axis=0)[:, 0] > 0.3).all()
    assert not np.diff(places, axis=0)[:, 1:].any()
    heights = {c["path"]: c["object"]["geometries"][0]["height"] for c in said
               if c["type"] == "set_object" and c["path"].endswith(("shaft", "head"))}  # fmt: skip
    scales = []
    for number, hit in enumerate(hits.values()):
        path = f"/meshcat/{number}/arrow/"
        length = heights[path + "shaft"] + heights[path + "head"]
        scales.append(length / np.linalg.norm(hit.impulse))
    assert scales == pytest.approx([scales[0]] * 3)


def test_the_panel_says_both_impulses_and_escapes(hits):
    html = kd.page(hits, caption="<i>three").html
    assert "<b></th>" not in html
    assert "&lt;b&gt;" in html
    assert "<h1>&lt;i&gt;three</h1>" in html
    for hit in hits.values():
        joint, worst = hit.worst_joint
        assert f"{np.linalg.norm(hit.impulse):.4g} N s on the ball" in html
        assert f"{worst:.4g} N s at {joint}" in html


@pytest.mark.parametrize("count", [0, 9])
def test_too_few_or_too_many(hits, count):
    with pytest.raises(kd.InvalidInput, match="1 to 8"):
        kd.page([hits["a"]] * count)


BALL = kd.Ball()


def path(spin, speed=20.0):
    return kd.fly(kd.BallState(velocity=(speed, 0, 9), spin=(0, spin, 0)), BALL, kd.Air())


def test_every_curve_stands_in_the_legend():
    page = kd.page({"top": path(40), "<b>back</b>": path(-40)}, caption="a & b").html
    assert "<title>a &amp; b</title>" in page
    assert "&lt;b&gt;back&lt;/b&gt;" in page
    assert "<b>back" not in page
    assert f"{path(40).range:.4g} m" in page
    assert not re.findall(r'(?:src|href)=["\']http', page)


@pytest.mark.parametrize("number", [0, 9])
def test_too_few_or_too_many_flights(number):
    with pytest.raises(kd.InvalidInput, match="one page compares 1 to 8"):
        kd.page([path(0)] * number)


def test_a_ball_that_does_not_fly_can_be_shown():
    assert "0 m" in kd.page({"rest": kd.fly(kd.BallState(), BALL)}).html
