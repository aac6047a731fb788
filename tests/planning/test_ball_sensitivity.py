"""The launch of a ball that is displaced by 1 cm: closed forms of sliding feet, and MuJoCo."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from chains import at, serial, shapes
from tolerances import optimized

import kickdyn as kd
from kickdyn.planning.ball_sensitivity import sensitivity_to_ball
from kickdyn.robot.robot_file import Shape, Visual

BALL, SHIFT, ROUND = kd.Ball(), 0.01, 0.04
SPEED, GAIN = 5.0, 60.0  # of the foot [m/s], and its acceleration [m/s2]


def slides(place, kind, *size, ball=BALL):
    """Return how a foot that slides along x, y and z, with one shape at a place, meets a ball."""
    origin, body = at(0, 0, 0), pin.Inertia.FromSphere(2.0, 0.1)
    model = serial([("slide", pin.JointModelTranslation(), origin, body)], origin)
    file = shapes([Visual("toe", at(*place).homogeneous, kind, size)])
    leg = replace(kd.Leg.from_model(model, "toe"), file=file)
    hit = kd.strike(leg.posture(np.zeros(3)), [SPEED, 0, 0], ball, kd.Contact((1, 0, 0), 0.8))
    motion = SimpleNamespace(robot=leg, a=lambda t: np.array([GAIN, 0.0, 0.0]))
    return sensitivity_to_ball(hit, motion)


@pytest.mark.parametrize(("shape", "aside", "reach"), [
    (((-ROUND, 0, 0), Shape.SPHERE, ROUND), SHIFT, ROUND + BALL.radius),
    (((-0.05, 0, 0), Shape.BOX, 0.1, 0.2, 0.2), 0.0, BALL.radius),
    (((-0.05, -0.096, 0), Shape.BOX, 0.1, 0.2, 0.2), SHIFT - 0.004, BALL.radius),
])  # fmt: skip
def test_a_ball_aside_is_struck_along_the_line_of_centres_or_from_an_edge(shape, aside, reach):
    """The foot accelerates on the way to it."""
    seen, cosine = slides(*shape), math.sqrt(1 - (aside / reach) ** 2)
    gained = math.sqrt(1 + 2 * GAIN * reach * (1 - cosine) / SPEED**2)
    right = [math.degrees(math.acos(cosine)), 100 * abs(1 - cosine * gained)]
    assert seen.across == pytest.approx(right, abs=optimized(1e-6))
    slower = 1 - math.sqrt(1 - 2 * GAIN * SHIFT / SPEED**2)
    assert seen.along == pytest.approx([0.0, 100 * slower], abs=optimized(1e-6))
    assert seen.foot == "shapes"


def test_a_small_ball_aside_is_missed_and_a_foot_far_away_is_a_plate():
    seen = slides((-0.002, 0, 0), Shape.SPHERE, 0.002, ball=kd.Ball(0.003, 0.005))
    assert seen.across == (math.inf, math.inf)
    far = slides((-0.5, 0, 0), Shape.SPHERE, 0.01)
    assert (far.foot, far.across) == ("plate", (0.0, 0.0))
