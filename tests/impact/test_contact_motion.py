"""Relative motion of ball and foot: derivatives by differences, and friction by its equations."""

import math

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

from kickdyn.impact.contact_motion import (
    contact_motion,
    free_rise,
    free_sliding,
    slip_direction,
    sticking_force,
)


@pytest.mark.parametrize("seed", range(4))
def test_free_accelerations_are_derivatives_of_the_motion(seed):
    """Foot and ball on parabolas, in axes that turn with the foot, by central differences."""
    rng = np.random.default_rng(seed)
    reach, arm, ball, ball_spin, foot, spin, bias, turn, gravity = rng.normal(size=(9, 3))

    def motion(t):
        rotation = pin.exp3(spin * t + 0.5 * turn * t * t).T
        acceleration = bias + np.cross(spin, foot)  # of the joint's origin
        origin = foot * t + 0.5 * acceleration * t * t
        centre = arm + reach + ball * t + 0.5 * gravity * t * t
        vectors = ball + gravity * t, ball_spin, foot + acceleration * t, spin + turn * t
        return contact_motion(
            rotation @ (centre - origin) - arm, arm, *(rotation @ vector for vector in vectors)
        )

    h, (point, relative) = 1e-5, motion(0.0)
    expected = (np.array(motion(h)[1]) - motion(-h)[1]) / (2 * h)
    state = reach[2], point, relative, ball, ball_spin, spin, bias, turn, gravity
    agrees([*free_sliding(*state), free_rise(*state)], expected, 1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_friction_that_stops_points_or_lets_them_begin_to_slide(seed):
    """G s + b = -alpha w; (A + k) d = -g with a unit vector d and k >= 0."""
    rng = np.random.default_rng(seed)
    rows, (free, w) = rng.normal(size=(2, 3)), rng.normal(size=(2, 2))
    matrix = rows @ rows.T
    force = sticking_force((matrix[0, 0], matrix[0, 1], matrix[1, 1]), free, 7.0, *w)
    agrees(matrix @ force + free, -7.0 * w, closed_form(np.linalg.cond(matrix)))
    weak = 0.1 * np.linalg.norm(free) / np.trace(matrix) * matrix
    x, y, k = slip_direction(weak[0, 0], weak[0, 1], weak[1, 1], *free)
    agrees((weak + k * np.eye(2)) @ (x, y), -free, closed_form(100))
    assert (math.hypot(x, y), k > 0) == (pytest.approx(1.0), True)
