"""Relative motion of ball and foot: its derivatives by differences; friction and sliding."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form, differenced

from kickdyn.impact.contact_motion import contact_motion, free_rise, free_sliding, slip_direction


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
    agrees([*free_sliding(*state), free_rise(*state)], expected, 100 * differenced())


@pytest.mark.parametrize("seed", range(6))
def test_friction_opposes_the_sliding_that_it_leaves(seed):
    rng = np.random.default_rng(seed)
    root, sliding = rng.normal(size=(2, 2)), rng.normal(size=2)
    mobility = root @ root.T * 10.0 ** -(seed % 3)
    sliding *= 3.0 * np.linalg.norm(mobility) / np.linalg.norm(sliding)  # it does not stick
    x, y, gain = slip_direction(mobility[0, 0], mobility[0, 1], mobility[1, 1], *sliding)
    direction = np.array([x, y])
    assert np.linalg.norm(direction) == pytest.approx(1.0, rel=closed_form())
    assert gain > 0.0
    agrees(mobility @ direction + sliding, -gain * direction, closed_form(100))
