import re

import pytest

import kickdyn as kd
from kickdyn.view.flights_page import flights_page

BALL = kd.Ball()


def path(spin, speed=20.0):
    return kd.fly(kd.BallState(velocity=(speed, 0, 9), spin=(0, spin, 0)), BALL, kd.Air())


def test_every_curve_stands_in_the_legend():
    page = flights_page({"top": path(40), "<b>back</b>": path(-40)}, title="a & b")
    assert "<title>a &amp; b</title>" in page
    assert "&lt;b&gt;back&lt;/b&gt;" in page
    assert "<b>back" not in page
    assert f"{path(40).range:.4g} m" in page
    assert not re.findall(r'(?:src|href)=["\']http', page)


@pytest.mark.parametrize("number", [0, 9])
def test_too_few_or_too_many(number):
    with pytest.raises(kd.InvalidInput, match="1 to 8 can be told apart"):
        flights_page({str(i): path(0) for i in range(number)}, title="many")


def test_a_ball_that_does_not_fly_can_be_shown():
    assert "0 m" in flights_page({"rest": kd.fly(kd.BallState(), BALL)}, title="rest")
