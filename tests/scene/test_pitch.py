"""Walls and goals: how a ball passes and meets them, by hand and by the path itself."""

from dataclasses import astuple

import numpy as np
import pytest
from tolerances import optimized

import kickdyn as kd
from kickdyn.scene.pitch import FRAME, MOUTH, Passage, passage_on, read_wall, score_at

RADIUS = 0.11
HALF, BAR = 7.32 / 2, 2.44  # IFAB, Laws of the Game, Law 1


@pytest.mark.parametrize(("passage", "numbers", "clear"), [
    ((0.1, -1.06, 0.3), ["0.1"], True), ((-1.9, 0.25, 1.46), ["0.25", "left"], True),
    ((-1.9, 0.25, -1.46), ["0.25", "right"], True),
    ((-0.2, -0.06, 1.3), ["0.2", "0.06", "hits"], False)])  # fmt: skip
def test_a_ball_passes_over_or_beside_a_wall_or_hits_it(passage, numbers, clear):
    assert Passage(*passage).is_clear is clear
    assert all(number in str(Passage(*passage)) for number in numbers)


@pytest.mark.parametrize(("left", "up", "end"), [
    (0, 0, "in"), (-HALF + RADIUS + 1e-6, BAR - 2 * RADIUS - 1e-6, "in"),
    (HALF - RADIUS + 1e-6, 0, "post"), (-HALF - RADIUS - FRAME + 1e-6, 0, "post"),
    (HALF + RADIUS + FRAME + 1e-6, 0, "beside"), (0, BAR - 2 * RADIUS + 1e-6, "bar"),
    (0, BAR + FRAME - 1e-6, "bar"), (0, BAR + FRAME + 1e-6, "over"),
    (HALF + 0.5, BAR + 1.0, "over"), (HALF + 1.0, BAR + 0.5, "beside")])  # fmt: skip
def test_a_ball_meets_a_goal(left, up, end):
    score = score_at(left, up, RADIUS, arrives=True)
    assert score.end == end
    assert score.post == pytest.approx(HALF - abs(left) - RADIUS)
    assert score.bar == pytest.approx(BAR - up - 2 * RADIUS)
    assert score_at(left, up, RADIUS, arrives=False) == ("short", score.post, score.bar)
    assert MOUTH == (2 * HALF, BAR)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_in_a_vacuum_a_passage_is_that_of_the_parabola(side):
    v, ahead, start = np.array([9.0, 2.0 * side, 6.0]), np.array([0.96, 0.28 * side, 0.0]), 0.3
    path = kd.fly(kd.BallState((1, 2, 0.5), v), kd.Ball(), None, kd.Ground(0.5 - RADIUS - start))
    t = 5.0 / (ahead @ v)
    x, y = v[0] * t, v[1] * t
    left = ahead[0] * y - ahead[1] * x
    passage = passage_on(path, kd.Wall(5.0, 1.5, 0.5), ahead, RADIUS, start)
    right = 6.0 * t - 9.81 / 2 * t**2 + start - 1.5, abs(left) - 0.25 - RADIUS, left
    assert passage == pytest.approx(right, rel=optimized(1e-11), abs=optimized(1e-11))
    end = float(ahead @ (path.landing.position - path.launch.position))
    for share, passes in ((0.999, True), (1.001, False)):
        assert (passage_on(path, kd.Wall(share * end, 1.5), ahead, RADIUS) is not None) is passes


def test_a_wall_is_read_with_its_default_width_of_five_players():
    assert astuple(read_wall("9.15:1.9")) == astuple(kd.Wall(9.15, 1.9)) == (9.15, 1.9, 2.5)
    assert astuple(read_wall("9.15:1.9:3.5")) == (9.15, 1.9, 3.5)
    for text in ("9" * 1000, "1:2:3:4", "a:b"):
        with pytest.raises(kd.InvalidInput, match="DISTANCE:HEIGHT"):
            read_wall(text)
