"""Walls and goals: how a ball passes and meets them, by hand."""

import math
from dataclasses import astuple

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.pitch import MOUTH, Passage, read_wall, score_at

RADIUS = 0.11


@pytest.mark.parametrize(
    ("passage", "sentence"),
    [
        ((0.1, -1.06, 0.3), "The lower edge of the ball clears the wall by 0.1 m."),
        ((-1.9, 0.1, 1.46), "The ball passes 0.1 m to the left of the wall."),
        ((-1.9, 0.1, -1.46), "The ball passes 0.1 m to the right of the wall."),
        (
            (-0.2, -0.06, 1.3),
            "The ball hits the wall, 0.2 m below its top and 0.06 m from its edge.",
        ),
    ],
)
def test_a_ball_passes_a_wall_or_hits_it(passage, sentence):
    assert str(Passage(*passage)) == sentence
    assert Passage(*passage).is_clear is ("hits" not in sentence)


@pytest.mark.parametrize(
    ("left", "up", "end"),
    [
        (0, 0, "in"),
        (-MOUTH[0] / 2 + RADIUS + 1e-9, MOUTH[1] - 2 * RADIUS - 1e-9, "in"),
        (MOUTH[0] / 2, 0, "post"),
        (0, MOUTH[1], "bar"),
        (MOUTH[0] / 2 + 1, 0, "beside"),
        (0, MOUTH[1] + 1, "over"),
    ],
)
def test_a_ball_meets_a_goal(left, up, end):
    assert score_at(left, up, RADIUS, arrives=True).end == end
    assert score_at(left, up, RADIUS, arrives=False).end == "short"


@pytest.mark.parametrize("values", [(0, 1), (1, -1), (1, 1, 0), (math.nan, 1), ("9", 1)])
def test_walls_that_cannot_stand_are_refused(values):
    with pytest.raises(kd.InvalidInput, match="of the wall is"):
        kd.Wall(*values)


@pytest.mark.parametrize(
    ("text", "values"), [("9.15:1.9", (9.15, 1.9, 2.5)), ("9.15:1.9:3.5", (9.15, 1.9, 3.5))]
)
def test_a_wall_is_read_with_its_usual_width(text, values):
    assert astuple(read_wall(text)) == values


def test_a_long_text_is_cut():
    with pytest.raises(kd.InvalidInput) as caught:
        read_wall("9" * 1000)
    assert len(str(caught.value)) < 350


def test_the_free_kick_scores_around_the_wall_because_of_its_spin():
    scene = kd.load_scene("free_kick")
    answer = kd.simulate(scene, 0.05)
    assert answer.passage.above < 0 < answer.passage.beside
    assert answer.passage.left < 0
    assert answer.score.end == "in"
    assert answer.pitch_text in str(answer)
    still = kd.simulate(scene.replace(air=kd.Air.at(250, 12, drag="brazuca", lift=None)), 0.05)
    assert still.score.end == "short"
    # the leg is within the limits of its file
    assert (np.abs(scene.v) <= scene.leg.workspace.model.velocityLimit).all()
    assert answer.impact.warnings == ()


def test_passage_and_score_are_of_the_path():
    """The same by the path itself, sampled where it comes to the wall and to the goal."""
    scene = kd.load_scene("free_kick")
    answer = kd.simulate(scene, None)
    path = answer.path.sample(np.linspace(0, answer.path.duration, 20001)).position
    moved = path - path[0]
    at_wall = moved[np.searchsorted(moved @ scene.ahead, 9.15)]
    assert answer.passage.above == pytest.approx(at_wall[2] - 1.9, abs=1e-3)
    aside = math.sqrt(at_wall[:2] @ at_wall[:2] - (at_wall @ scene.ahead) ** 2)
    assert answer.passage.beside == pytest.approx(aside - 1.25 - scene.ball.radius, abs=1e-3)
    height = path[-1][2] - scene.ground.height + scene.ball.radius
    assert answer.score.bar == pytest.approx(MOUTH[1] - height)
    along = np.hypot(*(path[-1] - scene.plane.point)[:2])
    across = math.sqrt(along**2 - scene.ball.radius**2)  # the ball is its radius behind the line
    assert answer.score.post == pytest.approx(MOUTH[0] / 2 - across - scene.ball.radius, abs=1e-6)


def test_a_wall_that_is_hit_is_named():
    scene = kd.load_scene("free_kick").replace(wall=kd.Wall(9.15, 1.9, 5.0))
    said = kd.simulate(scene, 0.05).pitch_text
    assert said.startswith("The ball hits the wall, ")
    assert "The flight goes on as if the wall were not there." in said


def test_walls_out_of_place_are_refused():
    scene = kd.load_scene("free_kick")
    with pytest.raises(kd.InvalidInput, match="wall is at 30 m: it must be between"):
        scene.replace(wall=kd.Wall(30, 1.9))
    with pytest.raises(kd.InvalidInput, match="wall is given without a plane"):
        scene.replace(plane=None)
    assert kd.simulate(scene.replace(wall=None), 0.05).passage is None
    assert kd.simulate(scene.replace(plane=None, wall=None), 0.05).pitch_text == ""


def test_a_ball_that_comes_down_before_the_wall_and_the_goal():
    scene = kd.load_scene("free_kick")
    answer = kd.simulate(scene.replace(v=0.4 * scene.v), 0.05)
    assert answer.passage is None
    assert answer.pitch_text == (
        "The ball lands before it reaches the wall. The ball does not reach the goal."
    )
