"""How a support moves on ground that can push but not pull."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.impact.leg_response import footing

SOLE = np.array([(0.15, 0.05, -0.04), (0.15, -0.05, -0.04), (-0.05, -0.05, -0.04)])
SOLE = np.vstack([SOLE, (-0.05, 0.05, -0.04)])
FOOT = kd.Support("foot", friction=0.5, sole=SOLE)
STILL = np.eye(3)


def wrench(force, at):
    """Wrench of a force at a point in the axes of the foot's frame."""
    return np.concatenate([force, np.cross(at, force)])


@pytest.mark.parametrize(("force", "at", "motion"), [
    ((0, 0, 1), (0, 0, -0.04), "stands"), ((0.49, 0, 1), (0.149, 0.049, -0.04), "stands"),
    ((0.3, -0.3, 1), (-0.049, -0.049, -0.04), "stands"), ((0, 0, -1), (0, 0, -0.04), "lifts-off"),
    ((0.51, 0, 1), (0, 0, -0.04), "slips"), ((0.4, 0.4, 1), (0, 0, -0.04), "slips"),
    ((0.4, 0, 1), (0.151, 0, -0.04), "tips"), ((0, 0.4, 1), (0, -0.051, -0.04), "tips"),
    ((0, 0, 1), (-0.051, 0, -0.04), "tips"), ((0, 0, 0), (0, 0, 0), "stands")])  # fmt: skip
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 0, 3, 1]])
def test_impulses_inside_and_outside_the_cone_and_the_sole(force, at, motion, order):
    support = kd.Support("foot", friction=0.5, sole=SOLE[order])
    for size, scale in ((1.0, 1.0), (7.0, 3.0), (0.02, 5.0)):
        assert footing(support, size * wrench(force, at), STILL, scale) == motion


def test_a_pull_is_negligible_relative_to_the_impulse_on_the_ball():
    """1e-13 of the kick is rounding; the same pull in a feeble kick is not."""
    pull = wrench((0, 0, -1e-12), (0, 0, -0.04))
    assert footing(FOOT, pull, STILL, 10.0) == "stands"
    assert footing(FOOT, pull, STILL, 0.1) == "lifts-off"


@pytest.mark.parametrize("turn", [-1, 1])
def test_friction_has_a_largest_moment_about_the_vertical(turn):
    """In the middle of the sole: all four corners slide about it, at the same distance.

    Friction along x takes 0.8 of the cone, sqrt(1 - 0.64) = 0.6 remains for the moment.
    """
    middle, free = np.array([0.05, 0.0, -0.04]), kd.Support("foot", sole=SOLE)
    twist = turn * 0.5 * 3.0 * np.hypot(0.1, 0.05) * np.eye(6)[5]
    for share, motion in ((0.0, "stands"), (0.99, "stands"), (1.01, "turns")):
        impulse = wrench((0, 0, 3.0), middle) + twist * share
        assert footing(FOOT, impulse, STILL, 1.0) == motion
        assert footing(free, impulse, STILL, 1.0) == "stands"
    assert footing(FOOT, wrench((1.2, 0, 3.0), middle) + twist * 0.7, STILL, 1.0) == "turns"


def test_the_sole_turns_with_the_foot():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for at, motion in (((0, 0.14, -0.04), "stands"), ((0.14, 0, -0.04), "tips")):
        assert footing(FOOT, wrench((0, 0, 1), at), quarter, 1.0) == motion
    c, s = np.cos(0.1), np.sin(0.1)
    tilt = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert footing(FOOT, wrench((0, 0, 1), (0, 0, -0.04)), tilt, 1.0) == "tilted"


@pytest.mark.parametrize(("support", "impulse", "motion"), [
    (kd.Support("foot"), wrench((3, 0, 1), (0.5, 0, -0.04)), "stands"),
    (kd.Support("foot", friction=0.5), wrench((3, 0, 1), (0.5, 0, -0.04)), "slips"),
    (kd.Support("foot", sole=SOLE), wrench((3, 0, 1), (0.5, 0, -0.04)), "tips"),
    (kd.Support("foot", point=True, friction=0.5), np.array([0.4, 0, 1]), "stands"),
    (kd.Support("foot", point=True, friction=0.5), np.array([0.6, 0, 1]), "slips"),
    (FOOT, np.array([0, 0, 0, 0, 0.1, 0]), "tips"),  # a moment alone
])  # fmt: skip
def test_without_friction_or_sole_less_is_judged(support, impulse, motion):
    assert footing(support, impulse, STILL, 1.0) == motion
