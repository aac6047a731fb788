import numpy as np
import pytest

import kickdyn as kd
from kickdyn.impact.footing import footing

SOLE = np.array([(0.15, 0.05, -0.04), (0.15, -0.05, -0.04), (-0.05, -0.05, -0.04)])
SOLE = np.vstack([SOLE, (-0.05, 0.05, -0.04)])
FOOT = kd.Support("foot", friction=0.5, sole=SOLE)


def wrench(force, at):
    """Of a force at a point given in the foot's frame."""
    return np.concatenate([force, np.cross(at, force)])


@pytest.mark.parametrize(
    ("force", "at", "does"),
    [
        ((0, 0, 1), (0, 0, -0.04), "stands"),
        ((0.49, 0, 1), (0.149, 0.049, -0.04), "stands"),
        ((0.3, -0.3, 1), (-0.049, -0.049, -0.04), "stands"),
        ((0, 0, -1), (0, 0, -0.04), "lifts off"),
        ((0.51, 0, 1), (0, 0, -0.04), "slips"),
        ((0.4, 0.4, 1), (0, 0, -0.04), "slips"),
        ((0.4, 0, 1), (0.151, 0, -0.04), "tips"),
        ((0, 0.4, 1), (0, -0.051, -0.04), "tips"),
        ((0, 0, 1), (-0.051, 0, -0.04), "tips"),
        ((0, 0, 0), (0, 0, 0), "stands"),
    ],
)
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 0, 3, 1]])
def test_what_the_ground_allows(force, at, does, order):
    support = kd.Support("foot", friction=0.5, sole=SOLE[order])
    assert footing(support, wrench(force, at), np.eye(3), 1.0) == does


def test_the_sole_turns_with_the_foot():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for at, does in (((0, 0.14, -0.04), "stands"), ((0.14, 0, -0.04), "tips")):
        assert footing(FOOT, wrench((0, 0, 1), at), quarter, 1.0) == does


def test_only_what_is_given_is_judged():
    sliding = wrench((3, 0, 1), (0.5, 0, -0.04))
    assert footing(kd.Support("foot"), sliding, np.eye(3), 1.0) == "stands"
    assert footing(kd.Support("foot", friction=0.5), sliding, np.eye(3), 1.0) == "slips"
    assert footing(kd.Support("foot", sole=SOLE), sliding, np.eye(3), 1.0) == "tips"
    point = kd.Support("foot", point=True, friction=0.5)
    assert footing(point, np.array([0.4, 0, 1]), np.eye(3), 1.0) == "stands"
    assert footing(point, np.array([0.6, 0, 1]), np.eye(3), 1.0) == "slips"


def test_a_moment_alone_tips_and_a_tilted_sole_is_said():
    assert footing(FOOT, np.array([0, 0, 0, 0, 0.1, 0]), np.eye(3), 1.0) == "tips"
    c, s = np.cos(0.1), np.sin(0.1)
    tilt = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert footing(FOOT, wrench((0, 0, 1), (0, 0, -0.04)), tilt, 1.0) == "is tilted"
