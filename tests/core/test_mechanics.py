import numpy as np
import pytest
from tolerances import agrees, closed_form

from kickdyn.core.mechanics import rotation_between


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("apart", [0.0, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
def test_the_least_rotation_turns_one_direction_into_another(apart, sign):
    """Also of nearly equal and nearly opposite ones; its trace is 1 + 2 cos of the angle."""
    a, off = np.random.default_rng(0).normal(size=(2, 3))
    b = 0.3 * (sign * a + apart * off)
    turn, a, b = rotation_between(a, b), a / np.linalg.norm(a), b / np.linalg.norm(b)
    agrees(turn @ a, b, closed_form())
    agrees(turn @ turn.T, np.eye(3), closed_form())
    assert np.trace(turn) == pytest.approx(1.0 + 2.0 * a @ b, abs=closed_form())
